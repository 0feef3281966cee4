//! Rows that the readers of logs have read.

use std::collections::BTreeMap;
use std::panic::{UnwindSafe, catch_unwind};
use std::path::Path;

use super::assignment::Role;
use super::decimal::Decimal;
use super::instance::Instance;
use super::table::Cells;
use super::time::Stamp;
use crate::ahead::reader_panicked;
use crate::columns::Column;
use crate::error::{Argument, Error, Result};
use crate::triad_name::{TriadKind, TriadName};

/// A format of logs.
pub(super) struct LogFormat {
    /// Who writes it.
    pub name: &'static str,
    /// The ending of its files.
    pub ending: &'static str,
    /// The unit in which it counts time.
    pub unit: Decimal,
    /// Its reader, which converts the stamps to ns.
    pub read: fn(&Path, Choice<'_>) -> Result<Vec<Readings>>,
}

/// The chosen sensor in a log.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Choice<'a> {
    /// Names of topics or messages: one, or those of two sensors. Without them, the format decides.
    pub topics: &'a [String],
    /// Sensor among those of one topic.
    pub instance: Option<Instance>,
}

impl<'a> Choice<'a> {
    /// The only topic, or the first of several if these are among one of `sets`, which are read together.
    pub fn topic_of(&self, path: &Path, sets: &[&[&str]]) -> Result<Option<&'a str>> {
        let within = |set: &&[&str]| {
            self.topics
                .iter()
                .all(|topic| set.contains(&topic.as_str()))
        };
        match self.topics.len() < 2 || sets.iter().any(within) {
            true => Ok(self.topics.first().map(String::as_str)),
            false => {
                let problem = format!("{} are not read together", self.topics.join(" and "));
                let remedy = "choose one topic, or those of one gyro and one accelerometer";
                Err(Error::new(path.display(), problem, remedy).about(Argument::Topic))
            }
        }
    }

    /// The instances that are wanted, or the only one of those `there`, each with what it has of gyro and accelerometer; `listed` names all. The first is
    /// the pair of a recording: of all, the first that has both.
    pub fn instances_of(
        &self,
        path: &Path,
        there: &BTreeMap<u32, [bool; 2]>,
        listed: &str,
    ) -> Result<Vec<u32>> {
        let problem = match (self.instance, there.first_key_value()) {
            (None, Some((only, _))) if there.len() == 1 => return Ok(vec![*only]),
            (Some(Instance::Number(wanted)), _) if there.contains_key(&wanted) => {
                return Ok(vec![wanted]);
            }
            (Some(Instance::All), Some(_)) => {
                let mut all: Vec<u32> = there.keys().copied().collect();
                all.sort_by_key(|instance| there[instance] != [true; 2]);
                return Ok(all);
            }
            (Some(Instance::Number(wanted)), _) => {
                format!("the log has no instance {wanted}; it has: {listed}")
            }
            (None, Some(_)) => format!("the log has several sensors: {listed}"),
            (None | Some(Instance::All), None) => format!("the log has {listed}"),
        };
        let remedy = match there.is_empty() {
            true => "log the messages of the inertial sensors",
            false => "choose one of the instances, or all",
        };
        let error = Error::new(path.display(), problem, remedy);
        Err(error.about(Argument::Topic).about(Argument::Instance))
    }
}

/// Readings of one clock: those of a whole unit, or of one of its two sensors.
#[derive(Debug, Default)]
pub(super) struct Readings {
    /// Column of each value of a row.
    columns: Vec<Column>,
    stamps_ns: Vec<i64>,
    /// Row by row.
    values: Vec<f64>,
    next: usize,
    /// What was read, and how it was changed.
    pub notes: Vec<String>,
    pub warnings: Vec<String>,
}

impl Readings {
    /// Without rows yet; `columns` in the order of the values.
    pub fn of(columns: Vec<Column>) -> Self {
        Self {
            columns,
            ..Self::default()
        }
    }

    /// Without rows yet, for both sensors.
    pub fn of_unit() -> Self {
        Self::of((0..6).map(Column::Raw).collect())
    }

    /// Without rows yet; for these triads.
    pub fn of_triads(triads: impl IntoIterator<Item = TriadName>) -> Self {
        let triads = triads.into_iter();
        Self::of(
            triads
                .flat_map(|t| [0, 1, 2].map(|axis| Column::of(t, axis)))
                .collect(),
        )
    }

    /// Those of magnetometer `number`: stamps, ns, and readings, µT.
    pub fn of_mag(number: u8, rows: impl Iterator<Item = (i64, [f64; 3])>, note: String) -> Self {
        let kind = TriadKind::Mag;
        let mut readings = Self::of_triads([TriadName { kind, number }]);
        rows.for_each(|(stamp_ns, values)| readings.push(stamp_ns, values));
        readings.notes.push(note);
        readings.sorted()
    }

    /// Puts rows in order of their stamps, and keeps the first of those with the same one. Rows of gyro and accelerometer are judged as they come.
    pub fn sorted(mut self) -> Self {
        let width = self.columns.len();
        let mut order: Vec<usize> = (0..self.len()).collect();
        order.sort_by_key(|row| self.stamps_ns[*row]);
        order.dedup_by_key(|row| self.stamps_ns[*row]);
        let rows = order
            .iter()
            .flat_map(|row| &self.values[row * width..(row + 1) * width]);
        self.values = rows.copied().collect();
        self.stamps_ns = order.iter().map(|row| self.stamps_ns[*row]).collect();
        self
    }

    /// Appends a row; one value for each column.
    pub fn push(&mut self, stamp_ns: i64, values: impl IntoIterator<Item = f64>) {
        self.stamps_ns.push(stamp_ns);
        self.values.extend(values);
    }

    /// Whether they are those of further triads alone.
    pub fn is_further(&self) -> bool {
        let mut columns = self.columns.iter();
        columns.all(|column| matches!(column, Column::More(..)))
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.stamps_ns.len()
    }

    /// Stamps of all rows, ns.
    #[cfg(test)]
    pub fn stamps_of(&self) -> Vec<i64> {
        self.stamps_ns.clone()
    }

    /// Values of all rows, row by row.
    #[cfg(test)]
    pub fn values_of(&self) -> Vec<f64> {
        self.values.clone()
    }

    /// Roles in the order of [`Cells::numbers`].
    pub fn roles(&self) -> Vec<Role> {
        let time = std::iter::once(Column::Time);
        time.chain(self.columns.iter().copied())
            .map(Role::Column)
            .collect()
    }

    /// Share of the rows that has been handed out.
    pub fn progress(&self) -> f64 {
        self.next as f64 / self.len().max(1) as f64
    }

    /// Puts the next row into `cells` and returns its number from 1, or `None` at the end.
    pub fn next(&mut self, cells: &mut Cells) -> Option<u64> {
        let stamp_ns = *self.stamps_ns.get(self.next)?;
        let width = self.columns.len();
        cells.stamp = Stamp::from(stamp_ns);
        cells.step.clear();
        cells.numbers.clear();
        cells.numbers.push(stamp_ns as f64);
        let from = self.next * width;
        cells
            .numbers
            .extend_from_slice(&self.values[from..from + width]);
        self.next += 1;
        Some(self.next as u64)
    }
}

/// Calls `read` on the file at `path`. The crates that read logs panic on some damaged files; this becomes an error about the file.
pub(super) fn guarded<T>(path: &Path, read: impl FnOnce() -> Result<T> + UnwindSafe) -> Result<T> {
    catch_unwind(read).map_err(|_| reader_panicked(&path.display().to_string()))?
}
