//! A foreign file in memory: columns in the recording's units, and the times of its rows.
//!
//! All rows are kept, 8 bytes a cell and 40 a row: 1.3 GB for four hours at 1 kHz with both sensors. Only all stamps show the rate and which samples are missing, and only
//! all rows whether a sensor or a thermometer measures anything, so the other way is to read each file two or three times.

use std::path::{Path, PathBuf};

use super::assignment::{ColumnList, Role};
use super::broken::{BrokenTally, Fault, Unreadable};
use super::codes::Conversion;
use super::counter::{Counter, StampCounter};
use super::log::{self, is_log};
use super::log_options::LogOptions;
use super::noticed::Noticed;
use super::per_column::{Offset, Scale, TwosComplement, Zero};
use super::plausibility::Plausibility;
use super::readings::Readings;
use super::row_filter::RowFilter;
use super::row_limit::{MOST_ROWS, too_many_rows};
use super::row_range::RowRange;
use super::step_labels::StepLabels;
use super::table::{Cells, Table};
use super::time::{Known, LONGEST, Stamp, Stamps, Times};
use crate::cell::{Refusal, is_reading, no_reading, no_time};
use crate::columns::Column;
use crate::error::{Argument, Error, Result};

/// Rows after which the progress is reported.
const REPORTED: u64 = 1 << 14;
/// Assumed pause of a logger that started again, if its rows have no times, s.
const PAUSE_S: f64 = 1.0;

/// How to read a foreign file.
#[derive(Debug, Clone)]
pub(super) struct HowToRead<'a> {
    pub log: &'a LogOptions,
    /// Columns of this source.
    pub list: Option<&'a ColumnList>,
    /// Which rows are wanted.
    pub filters: Vec<RowFilter>,
    /// Which of these rows are wanted, by their numbers; all if `None`.
    pub rows: Option<RowRange>,
    /// Sample rate, if given or known.
    pub rate_hz: Option<f64>,
    /// Whether rows without a reading belong to another source of the same file.
    pub skip_empty: bool,
}

impl<'a> HowToRead<'a> {
    /// Without a list of columns, filters or a rate.
    pub fn of(log: &'a LogOptions) -> Self {
        Self {
            log,
            list: None,
            filters: Vec::new(),
            rows: None,
            rate_hz: None,
            skip_empty: false,
        }
    }

    pub fn conversion(&self, column: Column) -> Conversion {
        let log = self.log;
        let mut bits = TwosComplement::given(&log.twos_complement, column);
        Conversion {
            twos_complement: bits.next().map(|bits| bits as u32),
            signed_low_byte: log.signed_low_byte.iter().any(|s| s.applies_to(column)),
            zero: Zero::given(&log.zero, column).sum(),
            factor: Scale::given(&log.scale, column).product(),
            offset: Offset::given(&log.offset, column).sum(),
        }
    }

    /// Seconds per unit of the stamps, if it was given or the kind of file determines it.
    fn time_factor(&self, path: &Path) -> Option<f64> {
        let own = match (is_log(path), self.list) {
            (true, _) => Some(1e-9),
            (false, None) => Some(1.0),
            (false, Some(_)) => None,
        };
        let mut scales = Scale::given(&self.log.scale, Column::Time).peekable();
        let scaled = scales.peek().is_some().then(|| scales.product());
        let unit = self.log.time_unit.map(|unit| unit.seconds());
        unit.or(scaled).or(own)
    }
}

/// Where the time of a row comes from.
#[derive(Debug, Clone, Copy)]
enum TimeSource {
    /// A cell with a time stamp.
    Stamp,
    /// A cell with a sample counter.
    Sample(usize),
    /// The number of rows before, and the sample rate.
    Rows(f64),
}

impl TimeSource {
    fn of(path: &Path, how: &HowToRead<'_>, roles: &[Role]) -> Result<Self> {
        let at = |role| roles.iter().position(|&other| other == role);
        if at(Role::Column(Column::Time)).is_some() {
            return Ok(Self::Stamp);
        }
        let unknown = || {
            let problem = "no column is t_s, so the time between rows is unknown";
            let remedy = "name the time column, or give the rate";
            Error::new(path.display(), problem, remedy).about(Argument::SampleRate)
        };
        let rate_hz = how.rate_hz.ok_or_else(unknown)?;
        Ok(at(Role::Sample).map_or(Self::Rows(rate_hz), Self::Sample))
    }
}

/// Rows of a file as they are read.
enum Rows {
    Table(Box<Table>),
    Log(Box<Readings>, Noticed),
}

impl Rows {
    /// Opens the parts of `path`.
    fn open(path: &Path, how: &HowToRead<'_>) -> Result<Vec<Self>> {
        if !is_log(path) {
            let table = Table::open(path, how.list, how.log.text_format(), &how.filters)?;
            return Ok(vec![Self::Table(Box::new(table))]);
        }
        let refuse = |problem: &str, remedy: &str, setting| {
            Err(Error::new(path.display(), problem, remedy).about(setting))
        };
        if how.list.is_some() {
            let problem =
                "a list of columns is given, but the messages of a log have fixed columns";
            return refuse(problem, "leave it out", Argument::Columns);
        }
        if !how.filters.is_empty() {
            let problem = "rows are chosen by a column, but the messages of a log have no columns";
            let remedy = "leave the choice out, and choose the topic or the instance";
            return refuse(problem, remedy, Argument::Where);
        }
        let parts = log::read(path, how.log.choice())?.into_iter();
        let part = |mut readings: Readings| {
            let noticed = Noticed {
                notes: std::mem::take(&mut readings.notes),
                warnings: std::mem::take(&mut readings.warnings),
                ..Noticed::default()
            };
            Self::Log(Box::new(readings), noticed)
        };
        Ok(parts.map(part).collect())
    }

    fn roles(&self) -> Vec<Role> {
        match self {
            Self::Table(table) => table.header.roles(),
            Self::Log(readings, _) => readings.roles(),
        }
    }

    fn noticed(&self) -> &Noticed {
        match self {
            Self::Table(table) => &table.noticed,
            Self::Log(_, noticed) => noticed,
        }
    }

    fn progress(&self) -> f64 {
        match self {
            Self::Table(table) => table.progress(),
            Self::Log(readings, _) => readings.progress(),
        }
    }

    fn next(&mut self, cells: &mut Cells) -> std::result::Result<Option<u64>, Unreadable> {
        match self {
            Self::Table(table) => table.next(cells),
            Self::Log(readings, _) => Ok(readings.next(cells)),
        }
    }
}

/// A cell that becomes a value of a row.
#[derive(Clone, Copy)]
struct Wanted {
    /// Position among the cells.
    at: usize,
    column: Column,
    conversion: Conversion,
}

/// A foreign file, or a part of one that has a separate clock.
#[derive(Debug)]
pub(super) struct Source {
    pub path: PathBuf,
    /// Its columns of numbers, those of further triads last.
    pub columns: Vec<Column>,
    /// One for each column.
    pub values: Vec<Vec<f64>>,
    /// Lines of the rows in a text file, numbers of those in another; from 1.
    pub numbers: Vec<u64>,
    /// Steps of the rows, if it has a column step.
    pub steps: Option<Vec<i32>>,
    pub labels: StepLabels,
    /// Times of the rows, s.
    pub t_s: Vec<f64>,
    stamps: Vec<Stamp>,
    pub times: Option<Times>,
    /// Name of the column with the time stamps, if it has names.
    time_name: Option<String>,
    /// Whether its stamps are those of a sample counter, as given.
    counts_samples: bool,
    /// Rows a second, if it has neither stamps nor a counter.
    rate_hz: Option<f64>,
    pub noticed: Noticed,
    /// What a zero in the column of the thermometer means, °C.
    zero_c: f64,
    /// Counts and checks of the readings.
    pub seen: Plausibility,
    /// Rows that could not be read.
    pub broken: BrokenTally,
    /// Rows that the filters chose, and those that they or the range left out.
    pub chosen: [u64; 2],
    /// How often its sample counter, and its time stamps, have wrapped.
    pub wraps: [u64; 2],
    /// Whether it is text, whose cells can be copied as they are written.
    pub is_text: bool,
}

impl Source {
    /// Reads the parts of `path`: a log has several if its sensors have separate clocks.
    pub fn read(path: &Path, how: &HowToRead<'_>, progress: &dyn Fn(f64)) -> Result<Vec<Self>> {
        let parts = Rows::open(path, how)?.into_iter();
        let read = |mut rows: Rows| Reader::new(path, how, &rows)?.read(&mut rows, progress);
        parts.map(read).collect()
    }

    /// Finds the times of the rows. `rate_hz` is the given rate, `joined_to` the times of the file to which this one is joined.
    pub fn find_times(
        &mut self,
        how: &HowToRead<'_>,
        rate_hz: Option<f64>,
        joined_to: Option<&Times>,
    ) -> Result<()> {
        let stamps = self.relative_stamps();
        let repeats = stamps.repeats.clone();
        let known = Known {
            factor: match self.noticed.calendar {
                true => Some(1.0),
                false => how.time_factor(&self.path),
            },
            counter: self.counts_samples,
            native: log::unit(&self.path),
            // A counter without a given rate has that of the file to which it is joined.
            rate_hz: if self.counts_samples {
                how.rate_hz
            } else {
                rate_hz
            },
            name: self.time_name.as_deref(),
            joined_to,
        };
        let times = Times::of(&self.path, stamps, &known)?;
        if times.drops_repeats {
            let mut keep = vec![true; self.numbers.len()];
            repeats.iter().for_each(|row| keep[*row] = false);
            self.keep(&keep);
        }
        self.t_s = times.of_rows(&std::mem::take(&mut self.stamps));
        self.times = Some(times);
        Ok(())
    }

    fn relative_stamps(&self) -> Stamps {
        let first = self.stamps.first().copied().unwrap_or_default();
        let since = |stamp: &Stamp| match first.whole() {
            0 => stamp.value - first.value,
            whole => stamp.since(whole) - first.since(whole),
        };
        let mut stamps = Stamps {
            first,
            since_first: self.stamps.iter().map(since).collect(),
            wraps: self.wraps[1],
            ..Stamps::default()
        };
        let same = (1..self.stamps.len()).filter(|row| self.stamps[*row] == self.stamps[*row - 1]);
        for row in same {
            match self.repeats(row) {
                true => stamps.repeats.push(row),
                false => stamps.shared += 1,
            }
        }
        stamps
    }

    /// Whether a row has the step and values of the one before. Those of further triads do not count: a slower magnetometer may change while a logger
    /// writes a sample of the others again.
    fn repeats(&self, row: usize) -> bool {
        let compared = match self.is_further() {
            true => self.columns.len(),
            false => self.first_further(),
        };
        // Two empty cells (NaN) count as equal.
        let alike = |v: &Vec<f64>| v[row] == v[row - 1] || v[row].is_nan() && v[row - 1].is_nan();
        let step = |steps: &Vec<i32>| steps[row] == steps[row - 1];
        self.values[..compared].iter().all(alike) && self.steps.as_ref().is_none_or(step)
    }

    fn keep(&mut self, keep: &[bool]) {
        retain(&mut self.numbers, keep);
        retain(&mut self.stamps, keep);
        self.values.iter_mut().for_each(|v| retain(v, keep));
        self.steps.iter_mut().for_each(|s| retain(s, keep));
    }

    fn first_further(&self) -> usize {
        let further = |column: &Column| matches!(column, Column::More(..));
        self.columns
            .iter()
            .position(further)
            .unwrap_or(self.columns.len())
    }

    /// Whether it has readings of further triads alone. Its rows then fill cells of the recording, and add and remove no rows.
    pub fn is_further(&self) -> bool {
        !self.columns.is_empty() && self.first_further() == 0
    }

    /// Whether it has time stamps or a sample counter.
    pub fn has_time(&self) -> bool {
        self.rate_hz.is_none()
    }

    /// Rows a second; not a number before its times are known.
    pub fn rate_hz(&self) -> f64 {
        let of_stamps = self.times.as_ref().map(|times| times.summary.rate_hz);
        of_stamps.or(self.rate_hz).unwrap_or(f64::NAN)
    }

    /// Leaves the cells of the thermometer empty in which it did not answer, by a zero in the file.
    pub fn empty_zero_temperatures(&mut self) {
        let thermometers = self.columns.iter().zip(&mut self.values);
        let thermometers = thermometers.filter(|(column, _)| **column == Column::Temperature);
        for value in thermometers.flat_map(|(_, values)| values) {
            if *value == self.zero_c {
                *value = f64::NAN;
            }
        }
    }

    /// Refuses rows whose times do not rise: two files can only be joined in order.
    pub fn check_order(&self) -> Result<()> {
        let Some(row) = self.t_s.windows(2).position(|pair| !(pair[1] > pair[0])) else {
            return Ok(());
        };
        let (number, path) = (self.numbers[row + 1], self.path.display());
        let [before, t_s] = [self.t_s[row], self.t_s[row + 1]];
        Err(Error::new(
            format!("{path}, row {number}, column t_s"),
            format!("the time {t_s} s is not later than the {before} s of the row before"),
            "remove the row, or sort the file by time, before you join it",
        ))
    }

    /// Interpolates the readings of a loop, which took them at irregular times, to multiples of its usual round: dwells, noise and turns are computed from
    /// blocks of a fixed number of samples. A round longer than [`LONGEST`] usual ones is a gap.
    pub fn resample(&mut self, period_s: f64) {
        let t = std::mem::take(&mut self.t_s);
        let Some(start_s) = t.first().copied() else {
            return;
        };
        let (mut before, mut after, mut next) = (0, 0, 0_u64);
        let mut picked: Vec<(usize, usize, f64)> = Vec::new();
        loop {
            let t_s = start_s + next as f64 * period_s;
            while after < t.len() && t[after] < t_s {
                (before, after) = (after, after + 1);
            }
            if after == t.len() {
                break;
            }
            let step_s = t[after] - t[before];
            if step_s > LONGEST * period_s && t[before] < t_s && t_s < t[after] {
                let behind = ((t[after] - start_s) / period_s).ceil() as u64;
                next = behind.max(next + 1);
                continue;
            }
            let part = if step_s > 0.0 {
                (t_s - t[before]) / step_s
            } else {
                1.0
            };
            picked.push((before, after, part));
            self.t_s.push(t_s);
            next += 1;
        }
        let nearest = |&(a, b, part): &(usize, usize, f64)| if part < 0.5 { a } else { b };
        self.numbers = picked.iter().map(|p| self.numbers[nearest(p)]).collect();
        if let Some(steps) = &mut self.steps {
            *steps = picked.iter().map(|p| steps[nearest(p)]).collect();
        }
        for values in &mut self.values {
            let at =
                |&(a, b, part): &(usize, usize, f64)| values[a] + (values[b] - values[a]) * part;
            *values = picked.iter().map(at).collect();
        }
    }
}

fn retain<T>(all: &mut Vec<T>, keep: &[bool]) {
    let mut keep = keep.iter();
    all.retain(|_| *keep.next().unwrap_or(&true));
}

/// Reads the rows of a part.
struct Reader<'a> {
    how: &'a HowToRead<'a>,
    wanted: Vec<Wanted>,
    time: TimeSource,
    counter: Counter,
    stamps: StampCounter,
    source: Source,
}

impl<'a> Reader<'a> {
    fn new(path: &Path, how: &'a HowToRead<'a>, rows: &Rows) -> Result<Self> {
        let roles = rows.roles();
        let of_means = |role: &&Role| matches!(role, Role::Deviation(_) | Role::Averaged(_));
        if let Some(role) = roles.iter().find(of_means) {
            let name = role.name();
            let problem = format!(
                "the column {name} belongs to a table of means, but samples are to be imported"
            );
            let remedy = "skip the column, or import the file as a table of means";
            return Err(Error::new(path.display(), problem, remedy).about(Argument::Means));
        }
        let time = TimeSource::of(path, how, &roles)?;
        let numbers = roles
            .iter()
            .enumerate()
            .filter_map(|(at, role)| match role {
                Role::Column(Column::Time | Column::Step) => None,
                Role::Column(column) => Some(Wanted {
                    at,
                    column: *column,
                    conversion: how.conversion(*column),
                }),
                _ => None,
            });
        let mut wanted: Vec<Wanted> = numbers.collect();
        wanted.sort_by_key(|cell| matches!(cell.column, Column::More(..)));
        let columns: Vec<Column> = wanted.iter().map(|cell| cell.column).collect();
        let header = match rows {
            Rows::Table(table) => Some(&table.header),
            Rows::Log(..) => None,
        };
        let has_step = roles.contains(&Role::Column(Column::Step));
        let source = Source {
            path: path.to_owned(),
            values: vec![Vec::new(); columns.len()],
            numbers: Vec::new(),
            steps: has_step.then(Vec::new),
            labels: StepLabels::default(),
            t_s: Vec::new(),
            stamps: Vec::new(),
            times: None,
            time_name: header.and_then(|header| header.time_name()),
            counts_samples: matches!(time, TimeSource::Sample(_)),
            rate_hz: match time {
                TimeSource::Rows(rate_hz) => Some(rate_hz),
                TimeSource::Stamp | TimeSource::Sample(_) => None,
            },
            noticed: Noticed::default(),
            zero_c: how
                .conversion(Column::Temperature)
                .reading(0.0)
                .unwrap_or(f64::NAN),
            seen: Plausibility::new(&columns, how.log.trust_readings),
            broken: BrokenTally::new(how.log.skip_broken.unwrap_or_default()),
            chosen: [0; 2],
            wraps: [0; 2],
            is_text: matches!(rows, Rows::Table(table) if table.is_text()),
            columns,
        };
        Ok(Self {
            how,
            wanted,
            time,
            counter: Counter::default(),
            stamps: StampCounter::default(),
            source,
        })
    }

    /// Reads all rows. Broken ones are skipped. If there are more than the limit, the file is refused at its end, so that the error lists all kinds.
    fn read(mut self, rows: &mut Rows, progress: &dyn Fn(f64)) -> Result<Source> {
        let (mut cells, mut row) = (Cells::default(), Vec::new());
        let mut outside = 0;
        loop {
            let restarts = rows.noticed().restarts;
            let next = rows.next(&mut cells);
            if rows.noticed().restarts != restarts {
                self.stamps.restart();
            }
            let read = match next {
                Ok(None) => break,
                Ok(Some(number)) => self
                    .row(number, &cells, &mut row)
                    .map(|read| (number, read)),
                Err(unreadable) => Err(unreadable),
            };
            if let Err(Unreadable::File(error)) = read {
                return Err(error);
            }
            let broken = &mut self.source.broken;
            broken.rows += 1;
            if self
                .how
                .rows
                .is_some_and(|rows| !rows.contains(broken.rows))
            {
                outside += 1;
                continue;
            }
            match read {
                Err(Unreadable::Row(row)) => broken.add(row)?,
                Ok((number, (stamp, step))) => self.take(number, stamp, step, &mut row)?,
                Err(Unreadable::File(error)) => return Err(error),
            }
            if self.source.broken.rows.is_multiple_of(REPORTED) {
                progress(rows.progress());
            }
        }
        let mut source = self.source;
        source.broken.check()?;
        if let Rows::Table(table) = rows {
            table.header.filters.check(&source.path)?;
            source.chosen = table.header.filters.counts();
        }
        source.chosen[1] += outside;
        source.wraps = [self.counter.wraps, self.stamps.wraps];
        source.noticed = rows.noticed().clone();
        let Source { seen, values, .. } = &mut source;
        seen.finish(values);
        source.seen.check(&source.path.display().to_string())?;
        Ok(source)
    }

    /// Puts the values of a row into `row`, and returns its stamp and its step.
    fn row(
        &mut self,
        number: u64,
        cells: &Cells,
        row: &mut Vec<f64>,
    ) -> std::result::Result<(Stamp, i32), Unreadable> {
        let source = &mut self.source;
        let place = |path: &Path| format!("{}, row {number}", path.display());
        let time = match self.time {
            TimeSource::Stamp => cells.stamp.value,
            TimeSource::Sample(cell) => cells.numbers[cell],
            // A broken row was a sample too, and took its time.
            TimeSource::Rows(rate) => {
                source.broken.rows as f64 / rate + PAUSE_S * self.stamps.restarts as f64
            }
        };
        if time.is_nan() || !is_reading(time) {
            let refusal = match time.is_nan() {
                true => no_time(),
                false => no_reading(time, &format!("a time of {time:e}")),
            };
            return Err(Unreadable::row(
                number,
                Fault::Time,
                place(&source.path),
                refusal,
            ));
        }
        let at = |path: &Path, column: Column, fault, refusal: Refusal| {
            let place = format!("{}, column {}", place(path), column.name());
            Unreadable::row(number, fault, place, refusal)
        };
        row.clear();
        for cell in &self.wanted {
            let of_file = cells.numbers[cell.at];
            let value = cell.conversion.reading(of_file);
            let value = value.map_err(|r| at(&source.path, cell.column, Fault::Reading, r))?;
            if cell.column == Column::Temperature {
                source.seen.take_temperature_cell(of_file, value);
            }
            row.push(value);
        }
        let step = match source.steps {
            Some(_) => source.labels.number(&cells.step),
            None => Ok(-1),
        };
        let step = step.map_err(|r| at(&source.path, Column::Step, Fault::Step, r))?;
        let stamp = match self.time {
            TimeSource::Sample(_) => Stamp::from(self.counter.next(time)),
            TimeSource::Stamp => cells.stamp,
            TimeSource::Rows(_) => Stamp::from(time),
        };
        Ok((stamp, step))
    }

    /// Keeps a row, unless it is padding or belongs to another source.
    fn take(&mut self, number: u64, mut stamp: Stamp, step: i32, row: &mut [f64]) -> Result<()> {
        let source = &mut self.source;
        if self.how.skip_empty && source.seen.is_empty(row) {
            return Ok(());
        }
        let timed = !matches!(self.time, TimeSource::Rows(_));
        let zero_stamp = timed && stamp.value == 0.0;
        if source
            .seen
            .is_padding(number, row, zero_stamp && self.stamps.has_begun())
        {
            return Ok(());
        }
        if source.numbers.len() as u64 == MOST_ROWS {
            return Err(too_many_rows(&source.path, "more"));
        }
        match self.time {
            TimeSource::Stamp => stamp = self.stamps.next(stamp),
            TimeSource::Sample(_) => {}
            TimeSource::Rows(_) => source.t_s.push(stamp.value),
        }
        if timed {
            source.stamps.push(stamp);
        }
        source.numbers.push(number);
        if let Some(steps) = &mut source.steps {
            steps.push(step);
        }
        for (values, value) in source.values.iter_mut().zip(row) {
            values.push(*value);
        }
        Ok(())
    }
}
