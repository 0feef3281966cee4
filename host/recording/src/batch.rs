//! A run of consecutive rows, column by column.

use super::columns::{Column, Columns};

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
            Column::Reference(i) => Some(&mut self.reference[i]),
        }
    }

    /// Removes the rows and keeps the memory.
    pub fn clear(&mut self) {
        self.step.clear();
        for column in Column::all() {
            if let Some(values) = self.values_mut(column) {
                values.clear();
            }
        }
    }

    /// First column whose length does not fit `columns`, if there is one.
    pub(super) fn ragged(&self, columns: &Columns) -> Option<Column> {
        Column::all().find(|&column| {
            let length = self.values(column).map_or(self.step.len(), <[f64]>::len);
            length != if columns.has(column) { self.len() } else { 0 }
        })
    }
}
