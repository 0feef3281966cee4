//! Rows of two devices, or readings in two units, in the columns of one file.

use super::row::Row;
use crate::columns::RAW_COLUMNS;
use crate::error::{Argument, Error, Result};

/// Rows at the beginning that are searched for alternating sources.
const WATCHED: usize = 20_000;
/// Least size of a jump, and largest distance after the return, in units of the change over two rows.
const LEAP: f64 = 8.0;
const BACK: f64 = 4.0;
/// Least share of rows that jump away and back. If two sources alternate at random, one row in four does.
const LEAPING: f64 = 0.1;
/// Fewest rows from which this is concluded.
const FEWEST: usize = 100;

/// Fewest jumps across all codes of 16 bits that are no single damaged readings.
const FEWEST_ACROSS: usize = 3;

/// Classes of the magnitude of specific force are a quarter of an octave wide.
const CLASSES_PER_OCTAVE: f64 = 4.0;
const CLASSES: usize = 800;
/// Empty classes that separate two units: an octave. The smaller group has at least the share `SMALLER` of all rows; up to the share `BETWEEN` of its
/// number may lie between the groups.
const APART: usize = 4;
const SMALLER: f64 = 0.01;
const BETWEEN: f64 = 0.01;
/// Median magnitude relative to gravity that an accelerometer in m/s² may show: bias and scale factor are some per cent, and the unit moves.
const UNIT_GAIN: std::ops::Range<f64> = 0.67..1.5;
/// A smaller median relative to gravity is that of readings without gravity: in g it would be 0.1.
const NO_GRAVITY: f64 = 0.05;
/// Least factor between the usual magnitudes of both groups.
const FACTOR: f64 = 3.0;

/// Watches the readings of a file, row by row.
#[derive(Debug, Clone)]
pub(super) struct TwoSources {
    /// Places of the channels among the values of a row, their numbers, and their first readings.
    channels: Vec<(usize, usize, Vec<f64>)>,
    /// Places of the accelerometer.
    accel: Vec<usize>,
    /// Number of rows in each class of magnitude, and the first row of each.
    sizes: Vec<(u64, u64)>,
    /// Magnitude of specific force in each row. Classes find groups; only the median tells how large a group's magnitude is, because at rest it may be
    /// at the edge of a class.
    magnitudes: Vec<f32>,
}

impl TwoSources {
    /// For a file whose rows have these channels at these places.
    pub fn new(channels: impl Iterator<Item = (usize, usize)>) -> Self {
        let channels: Vec<_> = channels.map(|(place, c)| (place, c, Vec::new())).collect();
        let accel = channels.iter().filter(|(_, c, _)| *c >= 3);
        Self {
            accel: accel.map(|(place, ..)| *place).collect(),
            sizes: vec![(0, 0); CLASSES],
            magnitudes: Vec::new(),
            channels,
        }
    }

    /// Takes the next row.
    pub fn push(&mut self, row: &Row) {
        for (place, _, first) in &mut self.channels {
            if first.len() < WATCHED {
                first.push(row.values[*place]);
            }
        }
        if self.accel.len() == 3 {
            let squares = self.accel.iter().map(|place| row.values[*place].powi(2));
            let magnitude = squares.sum::<f64>().sqrt() as f32;
            if let Some(class) = class(magnitude) {
                self.magnitudes.push(magnitude);
                let (rows, first) = &mut self.sizes[class];
                if *rows == 0 {
                    *first = row.number;
                }
                *rows += 1;
            }
        }
    }

    /// Refuses a file in which the readings jump back and forth.
    pub fn check(&self, place: &str) -> Result<()> {
        for (_, c, first) in &self.channels {
            if across_16_bits(first, 0.0) >= FEWEST_ACROSS {
                let problem = "negative readings are written as unsigned codes of 16 bits: near 0 they jump to 65535";
                let remedy = format!("say that they are two's complement: {}=16", RAW_COLUMNS[*c]);
                let column = format!("{place}, column {}", RAW_COLUMNS[*c]);
                return Err(Error::new(column, problem, remedy).about(Argument::TwosComplement));
            }
            let Some(share) = leaping(first) else {
                continue;
            };
            let problem = format!(
                "in {:.0} % of the rows the reading jumps away and returns in the next one: rows of two devices, or readings in two units, alternate",
                100.0 * share
            );
            let column = format!("{place}, column {}", RAW_COLUMNS[*c]);
            let remedy = "if a column says whose each row is, choose by it, with a list of columns for each; otherwise import the rows of each from a separate file";
            return Err(Error::new(column, problem, remedy)
                .about(Argument::Where)
                .about(Argument::Columns));
        }
        Ok(())
    }

    /// A warning for each channel whose signed readings of 16 bits jump from one end to the other.
    pub fn overflows(&self, place: &str) -> Vec<String> {
        let each = self.channels.iter().filter_map(|(_, c, first)| {
            let jumps = across_16_bits(first, -32_768.0);
            (jumps >= FEWEST_ACROSS).then(|| {
                format!(
                    "{place}: {} jumps {jumps} times from one end of 16 bits to the other: the firmware's integers overflow, and the sensor's range is too small for this motion, or its factor too large",
                    RAW_COLUMNS[*c]
                )
            })
        });
        each.collect()
    }

    /// A warning if specific forces given in m/s² mostly have another magnitude than `gravity_mps2`.
    pub fn wrong_unit(&self, place: &str, gravity_mps2: f64) -> Option<String> {
        let usual = self.median(0..CLASSES)?;
        if usual < NO_GRAVITY * gravity_mps2 {
            return Some(format!(
                "{place}: the median of the specific force is {usual:.3} m/s², although gravity is always there: a filter has removed it. Log the accelerometer with gravity"
            ));
        }
        (!UNIT_GAIN.contains(&(usual / gravity_mps2))).then(|| {
            format!(
                "{place}: the median of the specific force is {usual:.3}, but gravity is {gravity_mps2} m/s²: check unit and scale. Readings in g \
                 need the factor accel=9.80665, in mg accel=0.00980665; counts need another raw unit"
            )
        })
    }

    /// A warning if the accelerometer shows two magnitudes.
    pub fn warning(&self, place: &str) -> Option<String> {
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
            return Some(format!(
                "{place}: the specific force is about {low:.3} in some rows and about {high:.3} in others, {few} of {all} of them, first in row {}: \
                 readings in two units, or of two devices",
                first.unwrap_or_default()
            ));
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

/// How often whole `readings` within the codes of 16 bits, which begin at `lowest`, jump from one end of these codes to the other.
fn across_16_bits(readings: &[f64], lowest: f64) -> usize {
    const CODES: f64 = 65_536.0;
    let mut known = readings.iter().filter(|reading| !reading.is_nan());
    if !known.all(|r| r.fract() == 0.0 && (lowest..lowest + CODES).contains(r)) {
        return 0;
    }
    let jumps = readings.windows(2).map(|w| (w[1] - w[0]).abs());
    jumps.filter(|jump| *jump > 0.9 * CODES).count()
}

/// Share of readings that jump away and back, if it is large.
fn leaping(readings: &[f64]) -> Option<f64> {
    let mut over_two: Vec<f64> = readings
        .windows(3)
        .map(|w| (w[2] - w[0]).abs())
        .filter(|change| change.is_finite())
        .collect();
    if over_two.len() < FEWEST {
        return None;
    }
    let at = over_two.len() / 4;
    // The lower quartile, because half of all pairs come from one source if two sources alternate at random.
    let quarter = *over_two.select_nth_unstable_by(at, f64::total_cmp).1;
    let nonzero = over_two.iter().copied().filter(|change| *change > 0.0);
    let step = nonzero.fold(f64::INFINITY, f64::min);
    let unit = (2.0 * quarter).max(step);
    let leaps = readings.windows(3).filter(|w| {
        (w[1] - w[0]).abs() > LEAP * unit
            && (w[1] - w[2]).abs() > LEAP * unit
            && (w[2] - w[0]).abs() <= BACK * unit
    });
    let share = leaps.count() as f64 / over_two.len() as f64;
    (share >= LEAPING).then_some(share)
}
