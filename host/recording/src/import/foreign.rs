//! A foreign file as rows of a recording: time, step and numbers, in the recording's units.

use std::path::{Path, PathBuf};

use super::SkippedLines;
use super::assignment::{ColumnList, Offset, Role, Scale};
use super::broken::{BrokenTally, Fault, Unreadable};
use super::codes::{Conversion, TwosComplement, Zero};
use super::counter::{Counter, StampCounter};
use super::log::{self, is_log};
use super::log_options::LogOptions;
use super::parquet_table::ParquetTable;
use super::plausibility::Plausibility;
use super::readings::Readings;
use super::row::Row;
use super::row_filter::RowFilter;
use super::row_range::RowRange;
use super::step_labels::StepLabels;
use super::text_table::{Cells, TextTable};
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
            twos_complement: TwosComplement::bits(&log.twos_complement, column),
            signed_low_byte: log.signed_low_byte.iter().any(|s| s.applies_to(column)),
            zero: Zero::of(&log.zero, column),
            factor: Scale::product(&log.scale, column),
            offset: Offset::sum(&log.offset, column),
        }
    }
}

/// A foreign file, positioned at its next row.
#[derive(Debug)]
pub(super) struct ForeignFile {
    path: PathBuf,
    table: Table,
    /// Number of parts: a log has several if its sensors have separate clocks.
    pub parts: usize,
    cells: Cells,
    source: TimeSource,
    counter: Counter,
    stamps: StampCounter,
    /// The times of its rows, once they are known.
    clock: Option<Clock>,
    before: Row,
    values: Vec<Cell>,
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
enum Table {
    Text(Box<TextTable>),
    Parquet(ParquetTable),
    Log(Readings),
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
fn check_roles(path: &Path, parquet: bool, roles: &[Role]) -> Result<()> {
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
    if parquet && roles.contains(&Role::Nanoseconds) {
        let problem = "nanoseconds beside seconds are read from text only";
        let remedy = "give a column with the whole time, or convert the file to text";
        return Err(Error::new(path.display(), problem, remedy).about(Argument::Columns));
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
        let parquet = path
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("parquet"));
        let mut parts = 1;
        fits_log(path, how)?;
        let table = match parquet {
            _ if is_log(path) => {
                let mut all = log::read(path, how.log.choice())?;
                parts = all.len();
                Table::Log(all.swap_remove(how.part))
            }
            true => Table::Parquet(ParquetTable::open(path, how.list, &how.filters)?),
            false => Table::Text(Box::new(TextTable::open(
                path,
                how.list,
                how.log.text_format(),
                &how.filters,
            )?)),
        };
        let roles = match &table {
            Table::Text(table) => table.roles(),
            Table::Parquet(table) => table.roles(),
            Table::Log(readings) => readings.roles(),
        };
        check_roles(path, parquet, &roles)?;
        let at = |role| roles.iter().position(|&other| other == role);
        let source = time_source(path, how, &roles)?;
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
        let values: Vec<Cell> = numbers.collect();
        Ok(ForeignFile {
            path: path.to_owned(),
            seen: Plausibility::new(
                values.iter().map(|cell| cell.column),
                how.log.trust_readings,
            ),
            values,
            empty_zero_temperatures: how.empty_zero_temperatures,
            skip_empty: how.skip_empty,
            has_step: at(Role::Column(Column::Step)).is_some(),
            table,
            parts,
            cells: Cells::default(),
            source,
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

    /// Rows a second; not a number before its times are known.
    pub fn rate_hz(&self) -> f64 {
        match (&self.clock, self.source) {
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
        matches!(self.source, TimeSource::Stamp | TimeSource::Sample(_))
    }

    /// Whether its stamps are those of a sample counter, as given.
    pub fn counts_samples(&self) -> bool {
        matches!(self.source, TimeSource::Sample(_))
    }

    /// Name of the column with the time stamps in the file, if it has names.
    pub fn time_name(&self) -> Option<String> {
        match &self.table {
            Table::Text(table) => table.time_name(),
            Table::Parquet(table) => table.time_name(),
            Table::Log(_) => None,
        }
    }

    /// Whether its times so far are dates or times of day.
    pub fn has_calendar_times(&self) -> bool {
        matches!(&self.table, Table::Text(table) if table.calendar)
    }

    /// Sets the times of the rows; no row has been read yet.
    pub fn with_times(mut self, times: Times) -> Self {
        self.clock = Some(Clock::new(times));
        self
    }

    /// Lines so far that contained no row.
    pub fn skipped(&self) -> SkippedLines {
        match &self.table {
            Table::Text(table) => table.skipped,
            Table::Parquet(_) | Table::Log(_) => SkippedLines::default(),
        }
    }

    /// Rows so far that the filters chose, and those that they or the range left out.
    pub fn chosen(&self) -> [u64; 2] {
        let [chosen, left_out] = match &self.table {
            Table::Text(table) => table.filters().counts(),
            Table::Parquet(table) => table.filters.counts(),
            Table::Log(_) => [0; 2],
        };
        [chosen, left_out + self.outside]
    }

    /// Name and column of each cell of a row of text.
    pub fn names(&self) -> Option<Vec<(String, Option<Column>)>> {
        match &self.table {
            Table::Text(table) => Some(table.all_names()),
            Table::Parquet(_) | Table::Log(_) => None,
        }
    }

    /// The cells of the last row of text as they are written, with their columns.
    pub fn cells(&self) -> Option<impl Iterator<Item = (&[u8], Option<Column>)>> {
        match &self.table {
            Table::Text(table) => Some(table.all_cells()),
            Table::Parquet(_) | Table::Log(_) => None,
        }
    }

    /// Lines of words among its rows so far, and the first of them.
    pub fn restarts(&self) -> Option<(u64, u64)> {
        match &self.table {
            Table::Text(table) => table.restarts,
            Table::Parquet(_) | Table::Log(_) => None,
        }
    }

    /// Zero bytes around its lines so far.
    pub fn zero_bytes(&self) -> u64 {
        match &self.table {
            Table::Text(table) => table.zero_bytes,
            Table::Parquet(_) | Table::Log(_) => 0,
        }
    }

    /// Warnings about what was ignored.
    pub fn warnings(&self) -> &[String] {
        match &self.table {
            Table::Text(table) => &table.warnings,
            Table::Parquet(table) => &table.warnings,
            Table::Log(readings) => &readings.warnings,
        }
    }

    /// What was read from a log, and how its readings were changed.
    pub fn notes(&self) -> &[String] {
        match &self.table {
            Table::Log(readings) => &readings.notes,
            Table::Text(_) | Table::Parquet(_) => &[],
        }
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
        match &self.table {
            Table::Text(table) => table.progress(),
            Table::Parquet(table) => table.progress(),
            Table::Log(readings) => readings.progress(),
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
                    match &self.table {
                        Table::Text(table) => table.check_filters()?,
                        Table::Parquet(table) => table.filters.check(&self.path)?,
                        Table::Log(_) => {}
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
        let restarts = self.restarts();
        let number = match &mut self.table {
            Table::Text(table) => table.next(&mut self.cells)?,
            Table::Parquet(table) => table.next(&mut self.cells)?,
            Table::Log(readings) => readings.next(&mut self.cells),
        };
        let Some(number) = number else {
            return Ok(false);
        };
        if self.restarts() != restarts {
            self.stamps.restart();
        }
        let at = |path: &Path| format!("{}, row {number}", path.display());
        let time = match self.source {
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
        row.stamp = match self.source {
            TimeSource::Sample(_) => Stamp::from(self.counter.next(time)),
            TimeSource::Stamp | TimeSource::Rows(_) => self.cells.stamp,
        };
        row.t_s = match self.source {
            TimeSource::Stamp | TimeSource::Sample(_) => 0.0,
            TimeSource::Rows(_) => time,
        };
        Ok(true)
    }
}
