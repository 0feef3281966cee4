//! A foreign file as rows of a recording: time, step and numbers, in the recording's units.

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
use super::row::Row;
use super::row_filter::RowFilter;
use super::row_range::RowRange;
use super::step_labels::StepLabels;
use super::table::{self, Cells};
use super::time::{Clock, Stamp, Times};
use crate::cell::{is_reading, no_reading, no_time};
use crate::columns::Column;
use crate::error::{Argument, Error, Result};

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
    /// Which of the readings of a log, counted from 0.
    pub part: usize,
    /// Sample rate, if given or known.
    pub rate_hz: Option<f64>,
    /// Whether a thermometer's cell with a zero is empty.
    pub empty_zero_temperatures: bool,
    /// Whether rows without a reading belong to another source of the same file.
    pub skip_empty: bool,
}

impl HowToRead<'_> {
    /// Conversion of the cells of `column`.
    fn conversion(&self, column: Column) -> Conversion {
        let log = self.log;
        Conversion {
            twos_complement: TwosComplement::given(&log.twos_complement, column)
                .next()
                .map(|bits| bits as u32),
            signed_low_byte: log.signed_low_byte.iter().any(|s| s.applies_to(column)),
            zero: Zero::given(&log.zero, column).sum(),
            factor: Scale::given(&log.scale, column).product(),
            offset: Offset::given(&log.offset, column).sum(),
        }
    }
}

/// A foreign file, positioned at its next row.
#[derive(Debug)]
pub(super) struct ForeignFile {
    path: PathBuf,
    source: Rows,
    /// Number of parts: a log has several if its sensors have separate clocks.
    pub parts: usize,
    cells: Cells,
    time: TimeSource,
    counter: Counter,
    stamps: StampCounter,
    /// The times of its rows, once they are known.
    clock: Option<Clock>,
    before: Row,
    values: Vec<Cell>,
    /// How many of the values, the last ones, are of further triads.
    further: usize,
    empty_zero_temperatures: bool,
    skip_empty: bool,
    /// Counts and checks of the readings.
    pub seen: Plausibility,
    has_step: bool,
    pub labels: StepLabels,
    /// Rows so far, and those that could not be read.
    pub broken: BrokenTally,
    rows: Option<RowRange>,
    /// Rows so far that are outside it.
    outside: u64,
}

#[derive(Debug)]
enum Rows {
    Table(Box<table::Table>),
    Log(Box<Readings>, Noticed),
}

/// A cell that becomes a value of a row.
#[derive(Debug, Clone, Copy)]
struct Cell {
    /// Position among the cells.
    at: usize,
    column: Column,
    conversion: Conversion,
}

/// Assumed pause of a logger that started again, if its rows have no times, s.
const PAUSE_S: f64 = 1.0;

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

/// Refuses a choice of columns or rows for a log, whose messages have fixed fields.
fn fits_log(path: &Path, how: &HowToRead<'_>) -> Result<()> {
    if is_log(path) && how.list.is_some() {
        let problem = "a list of columns is given, but the messages of a log have fixed columns";
        return Err(Error::new(path.display(), problem, "leave it out").about(Argument::Columns));
    }
    if is_log(path) && !how.filters.is_empty() {
        let problem = "rows are chosen by a column, but the messages of a log have no columns";
        let remedy = "leave the choice out, and choose the topic or the instance";
        return Err(Error::new(path.display(), problem, remedy).about(Argument::Where));
    }
    Ok(())
}

/// Refuses columns that a recording of samples cannot take.
fn check_roles(path: &Path, roles: &[Role]) -> Result<()> {
    let of_means = |role: &&Role| matches!(role, Role::Deviation(_) | Role::Averaged(_));
    if let Some(role) = roles.iter().find(of_means) {
        return Err(Error::new(
            path.display(),
            format!(
                "the column {} belongs to a table of means, but samples are to be imported",
                role.name()
            ),
            "skip the column, or import the file as a table of means",
        )
        .about(Argument::Means));
    }
    Ok(())
}

/// Where the times of the rows come from.
fn time_source(path: &Path, how: &HowToRead<'_>, roles: &[Role]) -> Result<TimeSource> {
    let at = |role| roles.iter().position(|&other| other == role);
    let needs_rate = || {
        how.rate_hz.ok_or_else(|| {
            Error::new(
                path.display(),
                "no column is t_s, so the time between rows is unknown",
                "name the time column, or give the rate",
            )
            .about(Argument::SampleRate)
        })
    };
    match (at(Role::Column(Column::Time)), at(Role::Sample)) {
        (Some(_), _) => Ok(TimeSource::Stamp),
        (None, Some(cell)) => needs_rate().map(|_| TimeSource::Sample(cell)),
        (None, None) => needs_rate().map(TimeSource::Rows),
    }
}

impl ForeignFile {
    /// Opens `path` and finds its columns.
    pub fn open(path: &Path, how: &HowToRead<'_>) -> Result<ForeignFile> {
        fits_log(path, how)?;
        let (source, parts) = match is_log(path) {
            true => {
                let mut all = log::read(path, how.log.choice())?;
                let parts = all.len();
                let mut readings = all.swap_remove(how.part);
                let noticed = Noticed {
                    notes: std::mem::take(&mut readings.notes),
                    warnings: std::mem::take(&mut readings.warnings),
                    ..Noticed::default()
                };
                (Rows::Log(Box::new(readings), noticed), parts)
            }
            false => {
                let format = how.log.text_format();
                let table = table::Table::open(path, how.list, format, &how.filters)?;
                (Rows::Table(Box::new(table)), 1)
            }
        };
        let roles = match &source {
            Rows::Table(table) => table.header.roles(),
            Rows::Log(readings, _) => readings.roles(),
        };
        check_roles(path, &roles)?;
        let at = |role| roles.iter().position(|&other| other == role);
        let time = time_source(path, how, &roles)?;
        let numbers = roles
            .iter()
            .enumerate()
            .filter_map(|(cell, role)| match role {
                Role::Sample | Role::Nanoseconds | Role::Deviation(_) | Role::Averaged(_) => None,
                Role::Column(Column::Time | Column::Step) => None,
                Role::Column(column) => Some(Cell {
                    at: cell,
                    column: *column,
                    conversion: how.conversion(*column),
                }),
            });
        let mut values: Vec<Cell> = numbers.collect();
        // Those of further triads last, see `Row::further`.
        let is_further = |cell: &Cell| matches!(cell.column, Column::More(..));
        values.sort_by_key(is_further);
        Ok(ForeignFile {
            path: path.to_owned(),
            seen: Plausibility::new(
                values.iter().map(|cell| cell.column),
                how.log.trust_readings,
            ),
            further: values.iter().copied().filter(|cell| is_further(cell)).count(),
            values,
            empty_zero_temperatures: how.empty_zero_temperatures,
            skip_empty: how.skip_empty,
            has_step: at(Role::Column(Column::Step)).is_some(),
            source,
            parts,
            cells: Cells::default(),
            time,
            counter: Counter::default(),
            stamps: StampCounter::default(),
            clock: None,
            before: Row::default(),
            labels: StepLabels::default(),
            broken: BrokenTally::new(how.log.skip_broken.unwrap_or_default()),
            rows: how.rows,
            outside: 0,
        })
    }

    /// Where the file is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Columns with numbers, in the order of [`Row::values`].
    pub fn columns(&self) -> impl Iterator<Item = Column> + '_ {
        self.values.iter().map(|cell| cell.column)
    }

    /// Whether it has readings of further triads alone. Its rows then fill cells of the recording, and decide about none of its rows.
    pub fn is_further(&self) -> bool {
        !self.values.is_empty() && self.further == self.values.len()
    }

    /// Rows a second; not a number before its times are known.
    pub fn rate_hz(&self) -> f64 {
        match (&self.clock, self.time) {
            (Some(clock), _) => clock.times().summary.rate_hz,
            (None, TimeSource::Rows(rate)) => rate,
            (None, TimeSource::Stamp | TimeSource::Sample(_)) => f64::NAN,
        }
    }

    /// Whether it has a column step.
    pub fn has_step(&self) -> bool {
        self.has_step
    }

    /// Whether the file has time stamps or a sample counter.
    pub fn has_time(&self) -> bool {
        matches!(self.time, TimeSource::Stamp | TimeSource::Sample(_))
    }

    /// Whether its stamps are those of a sample counter, as given.
    pub fn counts_samples(&self) -> bool {
        matches!(self.time, TimeSource::Sample(_))
    }

    /// Name of the column with the time stamps in the file, if it has names.
    pub fn time_name(&self) -> Option<String> {
        self.table()?.header.time_name()
    }

    fn table(&self) -> Option<&table::Table> {
        match &self.source {
            Rows::Table(table) => Some(table),
            Rows::Log(..) => None,
        }
    }

    /// What was noticed beside its rows so far.
    pub fn noticed(&self) -> &Noticed {
        match &self.source {
            Rows::Table(table) => &table.noticed,
            Rows::Log(_, noticed) => noticed,
        }
    }

    /// Sets the times of the rows; no row has been read yet.
    pub fn with_times(mut self, times: Times) -> Self {
        self.clock = Some(Clock::new(times));
        self
    }

    /// Rows so far that the filters chose, and those that they or the range left out.
    pub fn chosen(&self) -> [u64; 2] {
        let counts = self.table().map(|table| table.header.filters.counts());
        let [chosen, left_out] = counts.unwrap_or_default();
        [chosen, left_out + self.outside]
    }

    /// The table, if it is text, whose cells can be copied as they are written.
    pub fn text(&self) -> Option<&table::Table> {
        self.table().filter(|table| table.is_text())
    }

    /// How often its sample counter has wrapped so far.
    pub fn wraps(&self) -> u64 {
        self.counter.wraps
    }

    /// How often its time stamps have wrapped so far.
    pub fn stamp_wraps(&self) -> u64 {
        self.stamps.wraps
    }

    /// Share of the file that has been read.
    pub fn progress(&self) -> f64 {
        match &self.source {
            Rows::Table(table) => table.progress(),
            Rows::Log(readings, _) => readings.progress(),
        }
    }

    /// Position of row `number`, for messages.
    pub fn place(&self, number: u64) -> String {
        format!("{}, row {number}", self.path.display())
    }

    /// Reads the next row; `false` at the end. Broken rows are skipped. If there are more than the limit, the file is refused at its end, so that the
    /// error lists all kinds.
    pub fn next(&mut self, row: &mut Row) -> Result<bool> {
        loop {
            let read = self.read(row);
            let number = self.broken.rows + 1;
            let is_row = matches!(read, Ok(true) | Err(Unreadable::Row(_)));
            if is_row && self.rows.is_some_and(|rows| !rows.contains(number)) {
                self.broken.rows = number;
                self.outside += 1;
                continue;
            }
            match read {
                Ok(true) => self.broken.rows += 1,
                Ok(false) => {
                    self.broken.check()?;
                    if let Some(table) = self.table() {
                        table.header.filters.check(&self.path)?;
                    }
                    return Ok(false);
                }
                Err(Unreadable::Row(broken)) => {
                    self.broken.rows += 1;
                    self.broken.add(broken)?;
                    continue;
                }
                Err(Unreadable::File(error)) => return Err(error),
            }
            if self.skip_empty && self.seen.is_empty(row) {
                continue;
            }
            let zero_stamp = self.has_time() && row.stamp.value == 0.0;
            if self
                .seen
                .is_padding(row, zero_stamp, self.stamps.has_begun())
            {
                continue;
            }
            if !self.counts_samples() {
                row.stamp = self.stamps.next(row.stamp);
            }
            let Some(clock) = &mut self.clock else {
                return Ok(true);
            };
            if clock.times().drops_repeats {
                if self.before.stamp == row.stamp && self.before.repeats(row) {
                    continue;
                }
                self.before.clone_from(row);
            }
            row.t_s = clock.next(&row.stamp);
            return Ok(true);
        }
    }

    fn read(&mut self, row: &mut Row) -> std::result::Result<bool, Unreadable> {
        let restarts = self.noticed().restarts;
        let number = match &mut self.source {
            Rows::Table(table) => table.next(&mut self.cells)?,
            Rows::Log(readings, _) => readings.next(&mut self.cells),
        };
        let Some(number) = number else {
            return Ok(false);
        };
        if self.noticed().restarts != restarts {
            self.stamps.restart();
        }
        let at = |path: &Path| format!("{}, row {number}", path.display());
        let time = match self.time {
            TimeSource::Stamp => self.cells.stamp.value,
            TimeSource::Sample(cell) => self.cells.numbers[cell],
            // A broken row was a sample too, and took its time.
            TimeSource::Rows(rate) => {
                self.broken.rows as f64 / rate + PAUSE_S * self.stamps.restarts as f64
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
                at(&self.path),
                refusal,
            ));
        }
        row.values.clear();
        row.further = self.further;
        for cell in &self.values {
            let number_in_file = self.cells.numbers[cell.at];
            let value = cell.conversion.reading(number_in_file).map_err(|refusal| {
                let place = format!("{}, column {}", at(&self.path), cell.column.name());
                Unreadable::row(number, Fault::Reading, place, refusal)
            })?;
            let missing = cell.column == Column::Temperature
                && self.seen.is_zero_temperature(number_in_file, value)
                && self.empty_zero_temperatures;
            row.values.push(if missing { f64::NAN } else { value });
        }
        row.step = -1;
        if self.has_step {
            row.step = self.labels.number(&self.cells.step).map_err(|refusal| {
                let place = format!("{}, column step", at(&self.path));
                Unreadable::row(number, Fault::Step, place, refusal)
            })?;
        }
        row.number = number;
        row.stamp = match self.time {
            TimeSource::Sample(_) => Stamp::from(self.counter.next(time)),
            TimeSource::Stamp | TimeSource::Rows(_) => self.cells.stamp,
        };
        row.t_s = match self.time {
            TimeSource::Stamp | TimeSource::Sample(_) => 0.0,
            TimeSource::Rows(_) => time,
        };
        Ok(true)
    }
}
