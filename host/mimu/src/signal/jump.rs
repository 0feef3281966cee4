//! The largest change of the accelerometer's reading between two samples of a block.
//!
//! Faults of a log are instantaneous: another range, or columns that change places. Blocks show between which rests such a fault lies, and
//! the jumps show the row.

/// Where the reading of the accelerometer changes most between two samples, and by how much.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Jump {
    /// Data row of the second of the two samples, from 0.
    pub row: u64,
    /// Length of the difference, raw; zero if there are no two samples of all axes.
    pub size: f64,
}

impl Jump {
    /// The largest in a block whose first row is `first_row`; `before` is the sample before the block, if no gap separates them.
    pub(crate) fn of(axes: &[Vec<f64>], first_row: u64, before: Option<[f64; 3]>) -> Self {
        let [x, y, z] = axes else {
            return Self::default();
        };
        let samples = x.iter().zip(y).zip(z).map(|((x, y), z)| [*x, *y, *z]);
        let (mut last, mut largest) = (before, Self::default());
        for (row, sample) in (first_row..).zip(samples) {
            let size = last.map_or(0.0, |last| {
                let squares = (0..3).map(|k| (sample[k] - last[k]).powi(2));
                squares.sum::<f64>().sqrt()
            });
            if size > largest.size {
                largest = Self { row, size };
            }
            last = Some(sample);
        }
        largest
    }
}
