//! A run of consecutive rows, column by column.

use std::ops::Range;

use super::columns::{Column, Columns};
use super::triad_name::TriadName;

/// Rows of Parquet that are decoded at a time: 1 MiB of numbers in each column.
pub(super) const SLICE: usize = 1 << 17;

/// Consecutive rows of a recording, one vector a column.
///
/// Every vector is either empty (the recording lacks that column) or [`Batch::len`] long.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Batch {
    /// Number of the first row here, counted from 0 over the whole recording.
    pub first_row: u64,
    /// Time in s.
    pub t_s: Vec<f64>,
    /// Number of the dwell; -1 between two dwells.
    pub step: Vec<i32>,
    /// Temperature in °C; NaN is an empty cell.
    pub temp_c: Vec<f64>,
    /// Raw readings in the order of [`super::RAW_COLUMNS`]; NaN is an empty cell.
    pub raw: [Vec<f64>; 6],
    /// Known inputs in the order of [`super::REFERENCE_COLUMNS`], in deg/s and m/s² as in the file; NaN is unknown.
    pub reference: [Vec<f64>; 6],
    /// Raw readings of further triads in the order of [`TriadName::all`], each once; NaN is an empty cell.
    pub more: Vec<(TriadName, [Vec<f64>; 3])>,
}

impl Batch {
    /// Number of rows.
    pub fn len(&self) -> usize {
        self.t_s.len()
    }

    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.t_s.is_empty()
    }

    /// Numbers of `column`; `None` for the dwell numbers, which are integers.
    pub fn values(&self, column: Column) -> Option<&[f64]> {
        match column {
            Column::Time => Some(&self.t_s),
            Column::Step => None,
            Column::Temperature => Some(&self.temp_c),
            Column::Raw(i) => Some(&self.raw[i]),
            Column::More(triad, axis) => Some(match self.find(triad) {
                Ok(at) => self.more[at].1[axis].as_slice(),
                Err(_) => &[],
            }),
            Column::Reference(i) => Some(&self.reference[i]),
        }
    }

    /// Vector that holds `column`; `None` for the dwell numbers.
    pub fn values_mut(&mut self, column: Column) -> Option<&mut Vec<f64>> {
        match column {
            Column::Time => Some(&mut self.t_s),
            Column::Step => None,
            Column::Temperature => Some(&mut self.temp_c),
            Column::Raw(i) => Some(&mut self.raw[i]),
            Column::More(triad, axis) => {
                let at = self.find(triad).unwrap_or_else(|at| {
                    self.more.insert(at, (triad, Default::default()));
                    at
                });
                Some(&mut self.more[at].1[axis])
            }
            Column::Reference(i) => Some(&mut self.reference[i]),
        }
    }

    /// Place of `triad` in [`Self::more`], or where it belongs.
    fn find(&self, triad: TriadName) -> std::result::Result<usize, usize> {
        let place = |of: &(TriadName, _)| of.0.place();
        self.more.binary_search_by_key(&triad.place(), place)
    }

    /// Removes the rows and keeps the memory.
    pub fn clear(&mut self) {
        self.step.clear();
        for column in Column::fixed() {
            if let Some(values) = self.values_mut(column) {
                values.clear();
            }
        }
        let more = self.more.iter_mut().flat_map(|(_, axes)| axes);
        more.for_each(Vec::clear);
    }

    /// Appends these rows of `other`, in every column that it has.
    pub fn append(&mut self, other: &Self, rows: Range<usize>) {
        self.step
            .extend(other.step.get(rows.clone()).unwrap_or_default());
        let more = other.more.iter().map(|(triad, _)| *triad);
        let more = more.flat_map(|triad| [0, 1, 2].map(|axis| Column::of(triad, axis)));
        for column in Column::fixed().chain(more) {
            let own = other.values(column).and_then(|of| of.get(rows.clone()));
            if let (Some(own), Some(to)) = (own, self.values_mut(column)) {
                to.extend_from_slice(own);
            }
        }
    }

    /// Removes the first `count` rows.
    pub fn cut(&mut self, count: usize) {
        let mut rest = Self::default();
        rest.append(self, count..self.len());
        *self = rest;
    }

    /// First column whose length does not fit `columns`, if there is one.
    pub(super) fn ragged(&self, columns: &Columns) -> Option<Column> {
        let more = self.more.iter().map(|(triad, _)| *triad);
        let more = more.chain(columns.more.iter());
        let more = more.flat_map(|triad| [0, 1, 2].map(|axis| Column::of(triad, axis)));
        Column::fixed().chain(more).find(|&column| {
            let length = self.values(column).map_or(self.step.len(), <[f64]>::len);
            length != if columns.has(column) { self.len() } else { 0 }
        })
    }
}
