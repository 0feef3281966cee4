//! Hard iron that moves with the temperature.
//!
//! A magnet on the board, or iron beside a coil that warms, gives a field that changes as the board warms: ferrite loses 0.2 % of it per kelvin. What a magnetometer reads
//! then is `x = C u + o - m (T - T₀)`, linear in m beside C and o. The other effect that a temperature has, on C, is a hundred times smaller in 10 K.

use std::ops::Range;

use mimu::triad::{Estimate, half_width_95};
use mimu_recording::error::Result;
use mimu_recording::{Column, Recording};
use nalgebra::{DVector, Rotation3};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use crate::clustered::{Clusters, Solution};

/// Least standard deviation of the temperature, K: below it is the thermometer's noise that varies.
const LEAST_K: f64 = 0.5;
/// Iron that does not move passes for one that does with this probability, in the units whose errors are independent between pieces of time.
const BY_CHANCE: f64 = 1e-3;
/// The recording is held out in so many blocks of time, and iron has to lower the error of all but one.
const BLOCKS: usize = 4;

/// The temperature of a recording.
#[derive(Debug, Clone)]
pub(crate) struct Warmth {
    t: Vec<f64>,
    temp_c: Vec<f64>,
}

impl Warmth {
    /// `None` if the recording has none.
    pub fn read(recording: &Recording) -> Result<Option<Self>> {
        if !recording.columns.temp_c {
            return Ok(None);
        }
        let all = recording.read_columns(&[Column::Time, Column::Temperature], |_| ())?;
        let known = all[0].iter().zip(&all[1]).filter(|(_, c)| c.is_finite());
        let (t, temp_c): (Vec<f64>, Vec<f64>) = known.unzip();
        Ok((!t.is_empty()).then_some(Self { t, temp_c }))
    }

    /// Whether it shows anything of iron.
    pub fn varies(&self) -> bool {
        let mean = self.mean_c();
        let off = self.temp_c.iter().map(|c| c - mean);
        mimu_recording::statistics::root_mean_square(off) > LEAST_K
    }

    /// Mean, °C.
    pub fn mean_c(&self) -> f64 {
        self.temp_c.iter().sum::<f64>() / self.temp_c.len() as f64
    }

    /// At a time, by a straight line between readings, °C.
    pub fn at(&self, t: f64) -> f64 {
        let next = self.t.partition_point(|of| *of < t);
        let last = self.t.len() - 1;
        let [a, b] = [next.saturating_sub(1), next.min(last)];
        let share = match self.t[b] - self.t[a] {
            between if between > 0.0 => ((t - self.t[a]) / between).clamp(0.0, 1.0),
            _ => 0.0,
        };
        self.temp_c[a] + share * (self.temp_c[b] - self.temp_c[a])
    }
}

/// Iron that moves with the temperature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Iron {
    /// By how much the field of the iron grows per kelvin, along the axes of the triad's own frame, in its unit.
    pub per_k: [Estimate; 3],
    /// The temperature for which the offset is, °C.
    pub temp_c: f64,
}

impl Iron {
    /// Of the parameters from `first` on, which are in the frame of the reference; `rotation` leads there from that of the triad.
    pub(crate) fn of(
        (at, solution, first): (&DVector<f64>, &Solution, usize),
        rotation: &Rotation3<f64>,
        temp_c: f64,
    ) -> Self {
        let back = rotation.inverse();
        let values = back * at.fixed_rows::<3>(first);
        let covariance = solution.covariance.fixed_view::<3, 3>(first, first);
        let covariance = back.matrix() * covariance * back.matrix().transpose();
        let per_k = [0, 1, 2].map(|axis| {
            let variance = covariance[(axis, axis)].max(0.0);
            Estimate {
                value: values[axis],
                sigma: variance.sqrt(),
                interval: half_width_95([(variance, solution.dof)].into_iter()),
            }
        });
        Self { per_k, temp_c }
    }
}

/// Whether the iron of these parameters is there: it exceeds what its covariance allows, and lowers the error of blocks of time by a fit to the others, as effects of a unit have to.
/// `clusters`: sums at these parameters, by pieces of time of which some are `used`.
pub(crate) fn is_there(
    clusters: &Clusters,
    (at, solution, iron): (&DVector<f64>, &Solution, Range<usize>),
    used: &[bool],
) -> Option<bool> {
    let value = at.fixed_rows::<3>(iron.start);
    let covariance = solution
        .covariance
        .fixed_view::<3, 3>(iron.start, iron.start);
    let square = value.dot(&(covariance.try_inverse()? * value));
    // Hotelling's: the covariance has few degrees of freedom too.
    let rest = solution.dof - 2.0;
    let ratio = square * rest / (3.0 * solution.dof);
    if FisherSnedecor::new(3.0, rest).ok()?.sf(ratio) > BY_CHANCE {
        return Some(false);
    }
    let blocks = clusters.joined(BLOCKS, |piece| {
        used[piece].then_some(BLOCKS * piece / used.len())
    });
    let without = blocks.without(iron, at);
    let held_out = |of: &Clusters| Some(of.solve(&[true; BLOCKS])?.held_out);
    let [with, without] = [held_out(&blocks)?, held_out(&without)?];
    let helped = with.iter().zip(&without).filter(|(a, b)| a < b).count();
    Some(helped + 1 >= BLOCKS && with.iter().sum::<f64>() < without.iter().sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_temperature_is_read_between_its_readings_and_held_beyond_them() {
        let of = Warmth {
            t: vec![1.0, 3.0],
            temp_c: vec![20.0, 24.0],
        };
        assert_eq!(
            [0.0, 1.0, 1.5, 3.0, 9.0].map(|t| of.at(t)),
            [20.0, 20.0, 21.0, 24.0, 24.0]
        );
    }
}
