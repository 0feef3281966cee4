//! The columns of a recording, one at a time.

use mimu_recording::{Column, Recording, Result};

/// Columns of a recording, each to be taken once.
pub(super) struct Columns<'a> {
    recording: &'a Recording,
    /// The columns of a CSV file, which cannot be read one at a time.
    read: Vec<(Column, Vec<f64>)>,
}

impl<'a> Columns<'a> {
    pub(super) fn open(
        recording: &'a Recording,
        indices: &[usize],
        progress: &impl Fn(f64),
    ) -> Result<Self> {
        let mut read = Vec::new();
        if !recording.is_columnar() {
            let wanted: Vec<Column> = [Column::Time, Column::Step, Column::Temperature]
                .into_iter()
                .filter(|c| recording.columns.has(*c))
                .chain(indices.iter().map(|i| Column::Raw(*i)))
                .collect();
            let values = recording.read_columns(&wanted, |share| progress(0.1 * share))?;
            read = wanted.into_iter().zip(values).collect();
        }
        Ok(Self { recording, read })
    }

    pub(super) fn take(&mut self, column: Column) -> Result<Vec<f64>> {
        if let Some(at) = self.read.iter().position(|(c, _)| *c == column) {
            return Ok(self.read.swap_remove(at).1);
        }
        let mut values = self.recording.read_columns(&[column], |_| {})?;
        Ok(values.pop().unwrap_or_default())
    }
}
