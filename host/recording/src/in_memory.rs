//! A recording whose samples are arrays of another program: nothing is written, and the whole is never copied.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use sha2::{Digest, Sha256};

use crate::batch::Batch;
use crate::columns::{Column, Columns, behind_pair};
use crate::digest::hex;
use crate::error::{Argument, Error, Result};

/// Rows that are copied at a time: 6 MB with every column.
const ROWS: usize = 1 << 16;

/// Samples in the memory of another program.
pub trait InMemory: fmt::Debug + Send + Sync {
    /// Number of rows.
    fn rows(&self) -> usize;

    /// Which columns there are.
    fn columns(&self) -> Columns;

    /// Appends `rows` of `column`, steps as numbers, to `values`.
    ///
    /// # Errors
    /// The other program fails to provide them.
    fn append(&self, column: Column, rows: Range<usize>, values: &mut Vec<f64>) -> Result<()>;
}

impl InMemory for Batch {
    fn rows(&self) -> usize {
        self.len()
    }

    fn columns(&self) -> Columns {
        let has = |column| self.values(column).is_some_and(|of| !of.is_empty());
        Columns {
            step: !self.step.is_empty(),
            temp_c: has(Column::Temperature),
            gyro: has(Column::Raw(0)),
            accel: has(Column::Raw(3)),
            reference: std::array::from_fn(|i| has(Column::Reference(i))),
            more: self.more.iter().map(|(triad, _)| *triad).collect(),
        }
    }

    fn append(&self, column: Column, rows: Range<usize>, values: &mut Vec<f64>) -> Result<()> {
        match self.values(column) {
            Some(own) => values.extend_from_slice(&own[rows]),
            None => values.extend(self.step[rows].iter().copied().map(f64::from)),
        }
        Ok(())
    }
}

/// Samples with the pair `number` in the places of the first.
#[derive(Debug)]
pub(super) struct PairInMemory {
    pub samples: Arc<dyn InMemory>,
    pub number: u8,
}

impl InMemory for PairInMemory {
    fn rows(&self) -> usize {
        self.samples.rows()
    }

    fn columns(&self) -> Columns {
        self.samples.columns().of_pair(self.number)
    }

    fn append(&self, column: Column, rows: Range<usize>, values: &mut Vec<f64>) -> Result<()> {
        let column = behind_pair(column, self.number);
        self.samples.append(column, rows, values)
    }
}

/// Sample rate, Hz, from the median interval of `times`, s, which neither gaps nor bursts move.
///
/// # Errors
/// There are fewer than two times, or most of them do not increase.
pub fn usual_rate_hz(times: &[f64]) -> Result<f64> {
    let mut apart: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let middle = apart.len() / 2;
    let median =
        (!apart.is_empty()).then(|| *apart.select_nth_unstable_by(middle, f64::total_cmp).1);
    match median {
        Some(period_s) if period_s > 0.0 && period_s.is_finite() => Ok(1.0 / period_s),
        _ => Err(Error::new(
            "t",
            "the times do not give the sample rate",
            "give increasing times in seconds, or the sample rate instead",
        )
        .about(Argument::SampleRate)),
    }
}

/// Hands all rows to `consume` in order; returns their number and their digest: SHA-256 of the numbers as little-endian doubles, column
/// after column of every 65,536 rows.
pub(super) fn for_each_batch(
    samples: &dyn InMemory,
    progress: impl Fn(f64),
    mut consume: impl FnMut(&Batch) -> Result<()>,
) -> Result<(u64, String)> {
    let (all, columns) = (samples.rows(), samples.columns());
    let mut digest = Sha256::new();
    let (mut batch, mut steps, mut bytes) = (Batch::default(), Vec::new(), Vec::new());
    for first in (0..all).step_by(ROWS) {
        let rows = first..all.min(first + ROWS);
        batch.clear();
        batch.first_row = first as u64;
        for column in columns.present() {
            let values = batch.values_mut(column).unwrap_or(&mut steps);
            values.clear();
            samples.append(column, rows.clone(), values)?;
            bytes.clear();
            bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
            digest.update(&bytes);
        }
        // As in a file, an empty cell is between two dwells.
        let number = |step: &f64| if step.is_nan() { -1 } else { *step as i32 };
        batch.step.extend(steps.iter().map(number));
        consume(&batch)?;
        progress(rows.end as f64 / all as f64);
    }
    Ok((all as u64, hex(&digest.finalize())))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::declared::{RawUnit, Reference};
    use crate::manifest::Manifest;
    use crate::reader::Recording;
    use crate::writer::{SampleFormat, Writer};

    /// 150,000 rows of a gyro with steps: more than two batches.
    #[derive(Debug)]
    struct Numbers(usize);

    impl InMemory for Numbers {
        fn rows(&self) -> usize {
            self.0
        }

        fn columns(&self) -> Columns {
            Columns {
                step: true,
                gyro: true,
                ..Columns::default()
            }
        }

        fn append(&self, column: Column, rows: Range<usize>, values: &mut Vec<f64>) -> Result<()> {
            values.extend(rows.map(|row| match column {
                Column::Time => row as f64 / 64.0,
                Column::Step => (row / 1000) as f64 - 1.0,
                column => column.name().len() as f64 + (row % 97) as f64,
            }));
            Ok(())
        }
    }

    fn manifest() -> Manifest {
        Manifest::new("u", 64.0, 9.81, RawUnit::Count, Reference::Gravity)
    }

    #[test]
    fn it_reads_as_the_same_samples_in_a_file_do() {
        let memory = Recording::in_memory(manifest(), Arc::new(Numbers(150_000))).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rec");
        let mut writer = Writer::create(&path, memory.columns, SampleFormat::Csv, false).unwrap();
        let mut rows = Batch::default();
        let summary = memory
            .for_each_batch(
                |_| {},
                |batch| {
                    rows.t_s.extend(&batch.t_s);
                    rows.step.extend(&batch.step);
                    rows.raw[1].extend(&batch.raw[1]);
                    assert_eq!(batch.first_row + batch.len() as u64, rows.len() as u64);
                    writer.write(batch)
                },
            )
            .unwrap();
        assert_eq!(summary.rows, 150_000);
        writer.finish(&manifest()).unwrap();
        let file = Recording::open(&path).unwrap();
        let columns = [Column::Time, Column::Step, Column::Raw(1)];
        let of_file = file.read_columns(&columns, |_| {}).unwrap();
        assert_eq!(of_file, memory.read_columns(&columns, |_| {}).unwrap());
        let steps: Vec<f64> = rows.step.iter().map(|step| f64::from(*step)).collect();
        assert_eq!(of_file, [rows.t_s, steps, rows.raw[1].clone()]);
    }

    #[test]
    fn a_gap_and_a_repeated_time_do_not_move_the_rate() {
        let mut times: Vec<f64> = (0..100).map(|k| f64::from(k) / 50.0).collect();
        times[40..].iter_mut().for_each(|t| *t += 7.0);
        times[70] = times[69];
        assert!((usual_rate_hz(&times).unwrap() / 50.0 - 1.0).abs() < 1e-9);
        for none in [
            &[0.0][..],
            &[1.0, 1.0, 1.0],
            &[2.0, 1.0, 0.0],
            &[f64::NAN; 3],
        ] {
            assert!(usual_rate_hz(none).is_err(), "{none:?}");
        }
    }
}
