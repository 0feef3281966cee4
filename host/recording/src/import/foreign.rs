//! A foreign file as rows of a recording: time, step and numbers, in the recording's units.

use std::path::{Path, PathBuf};

use super::SkippedLines;
use super::assignment::{ColumnList, Role, Scale};
use super::parquet_table::ParquetTable;
use super::step_labels::StepLabels;
use super::text_table::{Cells, TextTable};
use crate::cell::{is_reading, no_reading, no_time};
use crate::columns::Column;
use crate::error::{Argument, Error, Result};
use crate::separator::Separator;

/// How many time steps the sample period is the median of.
const STEPS_FOR_PERIOD: usize = 100_000;

/// One row in the recording's units.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Row {
    /// Line of a text file, number of the row in a Parquet file; from 1.
    pub number: u64,
    pub t_s: f64,
    /// -1 where the file has no steps.
    pub step: i32,
    /// In the order of [`ForeignFile::columns`].
    pub values: Vec<f64>,
}

/// How to read a foreign file.
#[derive(Debug, Clone)]
pub(super) struct HowToRead<'a> {
    pub list: Option<&'a ColumnList>,
    pub separator: Option<Separator>,
    pub scales: &'a [Scale],
    /// Sample rate, where it was given or is known.
    pub rate_hz: Option<f64>,
}

/// A foreign file, positioned at its next row.
#[derive(Debug)]
pub(super) struct ForeignFile {
    path: PathBuf,
    table: Table,
    cells: Cells,
    clock: Clock,
    /// Position among the cells, column and factor.
    values: Vec<(usize, Column, f64)>,
    has_step: bool,
    pub labels: StepLabels,
    rows: u64,
}

#[derive(Debug)]
enum Table {
    Text(TextTable),
    Parquet(ParquetTable),
}

/// Where the time of a row comes from.
#[derive(Debug, Clone, Copy)]
enum Clock {
    /// Cell, and factor to seconds.
    Column(usize, f64),
    /// Cell with a running number, and the sample rate.
    Sample(usize, f64),
    /// Count of rows, and the sample rate.
    Rows(f64),
}

impl ForeignFile {
    /// Opens `path` and finds its columns.
    pub fn open(path: &Path, how: &HowToRead<'_>) -> Result<ForeignFile> {
        let parquet = path
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("parquet"));
        let table = match parquet {
            true => Table::Parquet(ParquetTable::open(path, how.list)?),
            false => Table::Text(TextTable::open(path, how.list, how.separator)?),
        };
        let roles = match &table {
            Table::Text(table) => table.roles(),
            Table::Parquet(table) => table.roles(),
        };
        let at = |role| roles.iter().position(|&other| other == role);
        let needs_rate = || {
            how.rate_hz.ok_or_else(|| {
                Error::new(
                    path.display(),
                    "no column is t_s, so the time between rows is not known",
                    "name the time column, or give the rate",
                )
                .about(Argument::SampleRate)
            })
        };
        let clock = match (at(Role::Column(Column::Time)), at(Role::Sample)) {
            (Some(cell), _) => Clock::Column(cell, Scale::product(how.scales, Column::Time)),
            (None, Some(cell)) => Clock::Sample(cell, needs_rate()?),
            (None, None) => Clock::Rows(needs_rate()?),
        };
        let numbers = roles
            .iter()
            .enumerate()
            .filter_map(|(cell, role)| match role {
                Role::Sample | Role::Column(Column::Time | Column::Step) => None,
                Role::Column(column) => Some((cell, *column, Scale::product(how.scales, *column))),
            });
        Ok(ForeignFile {
            path: path.to_owned(),
            values: numbers.collect(),
            has_step: at(Role::Column(Column::Step)).is_some(),
            table,
            cells: Cells::default(),
            clock,
            labels: StepLabels::default(),
            rows: 0,
        })
    }

    /// Where the file is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Columns with numbers, in the order of [`Row::values`].
    pub fn columns(&self) -> impl Iterator<Item = Column> + '_ {
        self.values.iter().map(|(_, column, _)| *column)
    }

    /// Whether it says which step a row belongs to.
    pub fn has_step(&self) -> bool {
        self.has_step
    }

    /// Whether the file itself tells the time.
    pub fn has_time(&self) -> bool {
        matches!(self.clock, Clock::Column(..))
    }

    /// Lines that held no row, so far.
    pub fn skipped(&self) -> SkippedLines {
        match &self.table {
            Table::Text(table) => table.skipped,
            Table::Parquet(_) => SkippedLines::default(),
        }
    }

    /// What was ignored.
    pub fn warnings(&self) -> &[String] {
        match &self.table {
            Table::Text(table) => &table.warnings,
            Table::Parquet(table) => &table.warnings,
        }
    }

    /// Share of the file that has been read.
    pub fn progress(&self) -> f64 {
        match &self.table {
            Table::Text(table) => table.progress(),
            Table::Parquet(table) => table.progress(),
        }
    }

    /// Place of row `number`, for messages.
    pub fn place(&self, number: u64) -> String {
        format!("{}, row {number}", self.path.display())
    }

    /// Reads the next row; `false` at the end.
    pub fn next(&mut self, row: &mut Row) -> Result<bool> {
        let number = match &mut self.table {
            Table::Text(table) => table.next(&mut self.cells)?,
            Table::Parquet(table) => table.next(&mut self.cells)?,
        };
        let Some(number) = number else {
            return Ok(false);
        };
        row.number = number;
        row.t_s = match self.clock {
            Clock::Column(cell, factor) => self.cells.numbers[cell] * factor,
            Clock::Sample(cell, rate) => self.cells.numbers[cell] / rate,
            Clock::Rows(rate) => self.rows as f64 / rate,
        };
        if row.t_s.is_nan() || !is_reading(row.t_s) {
            let refusal = match row.t_s.is_nan() {
                true => no_time(),
                false => no_reading(row.t_s, &format!("a time of {:e} s", row.t_s)),
            };
            return Err(Error::new(
                self.place(number),
                refusal.problem,
                refusal.remedy,
            ));
        }
        row.step = -1;
        if self.has_step {
            row.step = self.labels.number(&self.cells.step).map_err(|refusal| {
                let place = format!("{}, column step", self.place(number));
                Error::new(place, refusal.problem, refusal.remedy)
            })?;
        }
        row.values.clear();
        for &(cell, column, factor) in &self.values {
            let value = self.cells.numbers[cell] * factor;
            if !is_reading(value) {
                let place = format!("{}, column {}", self.place(number), column.name());
                let problem = format!(
                    "{:e} times {factor:e} is too large for a reading",
                    self.cells.numbers[cell]
                );
                return Err(Error::new(place, problem, "correct the cell or the factor"));
            }
            row.values.push(value);
        }
        self.rows += 1;
        Ok(true)
    }
}

/// Median time between the rows at the start of a file, in s.
///
/// The start only, as all time steps of a long file do not belong into memory; the median, as
/// gaps and repeated stamps must not count.
pub(super) fn sample_period(path: &Path, how: &HowToRead<'_>) -> Result<f64> {
    let mut file = ForeignFile::open(path, how)?;
    let mut row = Row::default();
    let mut steps = Vec::new();
    let mut before = f64::NAN;
    while steps.len() < STEPS_FOR_PERIOD && file.next(&mut row)? {
        let step = row.t_s - before;
        before = row.t_s;
        if step > 0.0 {
            steps.push(step);
        }
    }
    if steps.is_empty() {
        return Err(Error::new(
            path.display(),
            "the rate cannot be told from the times of fewer than two rows",
            "give it",
        )
        .about(Argument::SampleRate));
    }
    let middle = steps.len() / 2;
    let (_, median, _) = steps.select_nth_unstable_by(middle, f64::total_cmp);
    Ok(*median)
}
