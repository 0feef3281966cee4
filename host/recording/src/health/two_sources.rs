//! Rows of two devices, or readings in two units, in the columns of one recording.

use super::sixteen_bits::across_16_bits;
use super::{Fault, Finding, Rows};
use crate::columns::RAW_COLUMNS;

/// Rows at the beginning that are searched for alternating sources.
const WATCHED: usize = 20_000;
/// Least size of a jump, and largest distance after the return, in units of the change over two rows.
const LEAP: f64 = 8.0;
const BACK: f64 = 4.0;
/// Least share of rows that jump away and back. If two sources alternate at random, one row in four does.
const LEAPING: f64 = 0.1;
/// Share of the jumps of a channel in whose rows another one jumps too. Two coarse channels of one device share a quarter at most.
const TOGETHER: f64 = 0.5;
/// Fewest rows from which this is concluded.
const FEWEST: usize = 100;

/// Classes of the magnitude of specific force are a quarter of an octave wide.
const CLASSES_PER_OCTAVE: f64 = 4.0;
const CLASSES: usize = 800;
/// Empty classes that separate two units: an octave. The smaller group has at least the share `SMALLER` of all rows; up to the share `BETWEEN` of its
/// number may lie between the groups.
const APART: usize = 4;
const SMALLER: f64 = 0.01;
const BETWEEN: f64 = 0.01;
/// Least factor between the usual magnitudes of both groups.
const FACTOR: f64 = 3.0;

/// Watches the readings of a recording, row by row.
#[derive(Debug, Clone)]
pub struct TwoSources {
    /// First readings of the channels.
    first: [Vec<f64>; 6],
    /// Number of rows in each class of magnitude, and the first row of each.
    sizes: Vec<(u64, u64)>,
    /// Magnitude of specific force in each row. Classes find groups; only the median tells how large a group's magnitude is, because at rest it may be
    /// at the edge of a class.
    magnitudes: Vec<f32>,
}

impl Default for TwoSources {
    fn default() -> Self {
        Self {
            first: Default::default(),
            sizes: vec![(0, 0); CLASSES],
            magnitudes: Vec::new(),
        }
    }
}

impl TwoSources {
    /// Takes the next row and its number; channels without a reading are NaN.
    pub fn take(&mut self, number: u64, raw: &[f64; 6]) {
        for (first, value) in self.first.iter_mut().zip(raw) {
            if first.len() < WATCHED {
                first.push(*value);
            }
        }
        let squares = raw[3..].iter().map(|force| force.powi(2));
        let magnitude = squares.sum::<f64>().sqrt() as f32;
        if let Some(class) = class(magnitude) {
            self.magnitudes.push(magnitude);
            let (rows, first) = &mut self.sizes[class];
            if *rows == 0 {
                *first = number;
            }
            *rows += 1;
        }
    }

    /// Findings about the channels: readings of two sources that alternate, or that jump between the ends of 16 bits.
    pub fn channels(&self) -> Vec<Finding> {
        let leaps = std::array::from_fn(|c| leaps(&self.first[c]));
        let each = self.first.iter().enumerate();
        let each = each.flat_map(|(c, first)| [across_16_bits(c, first), alternating(c, &leaps)]);
        each.flatten().collect()
    }

    /// Median magnitude of specific force.
    pub fn usual_force(&self) -> Option<f64> {
        self.median(0..CLASSES)
    }

    /// The finding that the accelerometer shows two magnitudes.
    pub fn two_magnitudes(&self) -> Option<Finding> {
        let all: u64 = self.sizes.iter().map(|(rows, _)| rows).sum();
        let count = |classes: std::ops::Range<usize>| -> u64 {
            self.sizes[classes].iter().map(|(rows, _)| rows).sum()
        };
        for gap in 0..CLASSES - APART {
            let (below, above) = (0..gap, gap + APART..CLASSES);
            let few = count(below.clone()).min(count(above.clone()));
            let between = count(gap..gap + APART);
            if (few as f64) < SMALLER * all as f64
                || few == 0
                || between as f64 > BETWEEN * few as f64
            {
                continue;
            }
            let (Some(low), Some(high)) = (self.median(below.clone()), self.median(above.clone()))
            else {
                continue;
            };
            if high < FACTOR * low {
                continue;
            }
            let fewer = if count(below.clone()) == few {
                below
            } else {
                above
            };
            let first = fewer
                .filter(|class| self.sizes[*class].0 > 0)
                .map(|class| self.sizes[class].1)
                .min();
            return Some(Finding {
                about: Some("accel"),
                rows: Rows { first, count: few },
                fault: Fault::TwoMagnitudes { low, high, of: all },
            });
        }
        None
    }

    /// Median of the magnitudes in `classes`.
    fn median(&self, classes: std::ops::Range<usize>) -> Option<f64> {
        let within = |m: &f32| class(*m).is_some_and(|c| classes.contains(&c));
        let mut own: Vec<f32> = self.magnitudes.iter().copied().filter(within).collect();
        let middle = own.len() / 2;
        let (_, median, _) =
            (!own.is_empty()).then(|| own.select_nth_unstable_by(middle, f32::total_cmp))?;
        Some(f64::from(*median))
    }
}

/// Class of a magnitude; `None` if it is 0 or unknown.
fn class(magnitude: f32) -> Option<usize> {
    let octaves = f64::from(magnitude).log2();
    let class = (octaves * CLASSES_PER_OCTAVE).floor() as i64 + CLASSES as i64 / 2;
    let within = class.clamp(0, CLASSES as i64 - 1) as usize;
    octaves.is_finite().then_some(within)
}

/// The finding that channel `c` jumps away and back, if a large share of its rows does, and another channel jumps in the same rows: a row of another
/// device or unit has other readings in all channels. A single device with coarse readings also jumps by a whole step and back, but each channel by
/// itself.
fn alternating(c: usize, leaps: &[Vec<bool>; 6]) -> Option<Finding> {
    let count = |rows: &[bool]| rows.iter().filter(|leap| **leap).count();
    let share = |c: usize| count(&leaps[c]) as f64 / leaps[c].len().max(1) as f64;
    let in_the_same_rows = |other: usize| {
        let both = leaps[c].iter().zip(&leaps[other]);
        let both = both.filter(|(a, b)| **a && **b).count();
        both as f64 >= TOGETHER * count(&leaps[c]).min(count(&leaps[other])) as f64
    };
    let mut others = (0..6).filter(|other| *other != c && share(*other) >= LEAPING);
    let share = share(c);
    (share >= LEAPING && others.any(in_the_same_rows)).then(|| {
        let rows = count(&leaps[c]) as u64;
        Finding::new(RAW_COLUMNS[c], rows, Fault::Alternating { share })
    })
}

/// Which of the first `readings` jump away from the reading before and back; none if there are too few.
fn leaps(readings: &[f64]) -> Vec<bool> {
    let over_two = readings.windows(3).map(|w| (w[2] - w[0]).abs());
    let mut changes: Vec<f64> = over_two.filter(|change| change.is_finite()).collect();
    if changes.len() < FEWEST {
        return Vec::new();
    }
    let at = changes.len() / 4;
    // The lower quartile, because half of all pairs come from one source if two sources alternate at random.
    let quarter = *changes.select_nth_unstable_by(at, f64::total_cmp).1;
    let nonzero = changes.iter().copied().filter(|change| *change > 0.0);
    let unit = (2.0 * quarter).max(nonzero.fold(f64::INFINITY, f64::min));
    let leap = |w: &[f64]| {
        (w[1] - w[0]).abs() > LEAP * unit
            && (w[1] - w[2]).abs() > LEAP * unit
            && (w[2] - w[0]).abs() <= BACK * unit
    };
    readings.windows(3).map(leap).collect()
}
