//! The unknown part of the Earth's rate in dwell means: a few numbers that all dwells of one heading share.
//!
//! Least squares takes their covariance. Where parameters are given, the likeliest numbers become part of the inputs.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::inputs::{design, span};
use super::{EarthShare, Estimated, Observation};
use crate::observable::Observable;

/// Places of the numbers of each heading that several observations share.
fn places(observations: &[Observation]) -> (Vec<Option<usize>>, usize) {
    let count = observations.iter().map(|o| o.earth.heading + 1).max();
    let mut shared_by = vec![0; count.unwrap_or(0)];
    let concerned = observations.iter().filter(|o| o.earth.is_unknown());
    concerned.for_each(|o| shared_by[o.earth.heading] += 1);
    let mut used = 0;
    let place = |n: &i32| {
        (*n > 1).then(|| {
            used += 3;
            used - 3
        })
    };
    (shared_by.iter().map(place).collect(), used)
}

/// The readings of `axis` by the unknown numbers, one column for each that several observations share. The others are added to the `variances`.
/// `forward` is the sensor's matrix, raw/SI.
pub fn factor(
    observations: &[Observation],
    axis: usize,
    forward: &Matrix3<f64>,
    variances: &mut DVector<f64>,
) -> DMatrix<f64> {
    let (places, used) = places(observations);
    let factor = factor_of_all(observations, axis, forward, &places, variances);
    let kept: Vec<usize> = (0..used)
        .filter(|k| factor.column(*k).amax() > 0.0)
        .collect();
    factor.select_columns(&kept)
}

/// The unknown numbers, in standard deviations: three for each heading that several observations share.
struct Numbers {
    places: Vec<Option<usize>>,
    value: DVector<f64>,
}

impl Numbers {
    /// Their likeliest values by `observations`, together with those parameters that have columns in `design`. `forward` is the sensor's matrix, raw/SI,
    /// and `extra` the variances of each axis beyond the noise, raw units squared.
    fn of(
        observations: &[Observation],
        design: &DMatrix<f64>,
        forward: &Matrix3<f64>,
        extra: &[f64; 3],
    ) -> Option<Self> {
        let (places, used) = places(observations);
        if used == 0 || !observations.iter().any(|o| o.earth.is_unknown()) {
            return None;
        }
        // Without data the numbers are zero, with a variance of one.
        let mut normal = DMatrix::identity(used, used);
        let mut with = DVector::zeros(used);
        for (axis, extra) in extra.iter().enumerate() {
            let mut variances = DVector::from_fn(observations.len(), |i, _| {
                observations[i].variance[axis] + extra
            });
            let factor = factor_of_all(observations, axis, forward, &places, &mut variances);
            let floor = (1e-12 * variances.max()).max(f64::MIN_POSITIVE);
            let weights = variances.map(|v| v.max(floor).sqrt().recip());
            let weighted = |rows: &DMatrix<f64>| {
                let mut rows = rows.clone();
                for (mut row, weight) in rows.row_iter_mut().zip(weights.iter()) {
                    row *= *weight;
                }
                rows
            };
            let readings = DMatrix::from_fn(observations.len(), 1, |i, _| {
                let o = &observations[i];
                o.raw[axis] - (forward.row(axis) * o.input)[(0, 0)]
            });
            // What the parameters explain says nothing about the numbers.
            let basis = weighted(design).qr().q();
            let beside = |rows: &DMatrix<f64>| {
                let rows = weighted(rows);
                &rows - &basis * basis.tr_mul(&rows)
            };
            let (factor, readings) = (beside(&factor), beside(&readings));
            normal += factor.tr_mul(&factor);
            with += factor.tr_mul(&readings).column(0);
        }
        Some(Self {
            places,
            value: normal.cholesky()?.solve(&with),
        })
    }

    /// By heading; zeros for a heading of one observation.
    fn by_heading(&self) -> Vec<Vector3<f64>> {
        let of = |place: &Option<usize>| {
            place.map_or_else(Vector3::zeros, |from| {
                Vector3::from_fn(|k, _| self.value[from + k])
            })
        };
        self.places.iter().map(of).collect()
    }
}

/// As [`factor`], with a column for each number, also if it is zero.
fn factor_of_all(
    observations: &[Observation],
    axis: usize,
    forward: &Matrix3<f64>,
    places: &[Option<usize>],
    variances: &mut DVector<f64>,
) -> DMatrix<f64> {
    let used = 3 * places.iter().flatten().count();
    let mut out = DMatrix::zeros(observations.len(), used);
    for (i, o) in observations.iter().enumerate() {
        let row = forward.row(axis) * o.earth.by;
        match places[o.earth.heading] {
            Some(from) => out.view_mut((i, from), (1, 3)).copy_from(&row),
            None => variances[i] += row.norm_squared(),
        }
    }
    out
}

/// `estimated` with the unknown numbers in `observations`, which it was estimated from.
pub(super) fn found(mut estimated: Estimated, observations: &[Observation]) -> Estimated {
    let extra = [0, 1, 2].map(|axis| {
        let mut scatter = estimated.scatter.iter();
        let of_axis = scatter.find(|s| s.0 == Observable::Axis(axis));
        of_axis.map_or(0.0, |s| s.1.extra_variance)
    });
    let design = design(observations, span(observations));
    let numbers = Numbers::of(
        observations,
        &design,
        &estimated.triad.forward.matrix,
        &extra,
    );
    estimated.earth = numbers.map_or_else(Vec::new, |n| n.by_heading());
    estimated
}

/// `o` with the unknown part of the Earth's rate, given by these numbers, in its known input.
fn completed(o: &Observation, numbers: &Vector3<f64>) -> Observation {
    let unknown = o.earth.by * numbers;
    Observation {
        input: o.input + unknown,
        earth: EarthShare {
            known: o.earth.known + unknown,
            ..EarthShare::NONE
        },
        ..*o
    }
}

/// Rounds in which the scatter of the readings and the likeliest numbers are brought into agreement.
const ROUNDS: usize = 3;

/// The likeliest unknown numbers for a sensor with this `forward` matrix, raw/SI, and any bias: by heading, in standard deviations.
///
/// The readings may have errors far beyond their noise: those of an effect that is not found yet, or of another unit's calibration. With the noise alone
/// as their variance, a bias over temperature of 1.8 deg/s was taken for a rate of the Earth of a hundred standard deviations, and the diagnosis could
/// not reach the noise (0.035 instead of 0.018 deg/s). So the variance is that which the readings show, from the largest on.
pub fn numbers(observations: &[Observation], forward: &Matrix3<f64>) -> Vec<Vector3<f64>> {
    let bias = DMatrix::from_element(observations.len(), 1, 1.0);
    let mut found = None;
    for _ in 0..ROUNDS {
        let extra = scatter(observations, &bias, forward, found.as_ref());
        found = Numbers::of(observations, &bias, forward, &extra);
        if found.is_none() {
            return Vec::new();
        }
    }
    found.map_or_else(Vec::new, |n| n.by_heading())
}

/// Variance of the readings of each axis beyond their noise, raw units squared, beside the parameters in `design` and with these `numbers`.
fn scatter(
    observations: &[Observation],
    design: &DMatrix<f64>,
    forward: &Matrix3<f64>,
    numbers: Option<&Numbers>,
) -> [f64; 3] {
    let basis = design.clone().qr().q();
    let spare = observations.len().saturating_sub(design.ncols()).max(1) as f64;
    [0, 1, 2].map(|axis| {
        let row = forward.row(axis);
        let of = |o: &Observation| {
            let place = numbers.and_then(|n| Some((n, n.places[o.earth.heading]?)));
            let unknown = place.map_or_else(Vector3::zeros, |(n, from)| {
                o.earth.by * Vector3::from_fn(|k, _| n.value[from + k])
            });
            o.raw[axis] - (row * (o.input + unknown))[(0, 0)]
        };
        let readings = DVector::from_iterator(observations.len(), observations.iter().map(of));
        let left = &readings - &basis * basis.tr_mul(&readings);
        let noise: f64 = observations.iter().map(|o| o.variance[axis]).sum();
        (left.norm_squared() / spare - noise / observations.len() as f64).max(0.0)
    })
}

/// `observations` with the likeliest unknown part of the Earth's rate in their inputs, for a sensor with the matrix of `forward` and any bias.
pub fn likely(observations: &[Observation], forward: &Matrix3<f64>) -> Vec<Observation> {
    let numbers = numbers(observations, forward);
    let own = |o: &Observation| numbers.get(o.earth.heading).copied();
    let each = observations.iter();
    each.map(|o| completed(o, &own(o).unwrap_or_else(Vector3::zeros)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rests in poses all over the sphere, of a session whose Earth rate is three times `number`, plus `error` of each.
    fn rests(number: f64, error: impl Fn(usize) -> Vector3<f64>) -> Vec<Observation> {
        let sigma = 7e-5;
        let rest = |k: usize| {
            let angle = |by: f64| (by * k as f64).fract() * std::f64::consts::TAU;
            let turn =
                nalgebra::Rotation3::from_euler_angles(angle(0.618), angle(0.414), angle(0.732));
            let by = turn.matrix() * sigma;
            Observation {
                dwell: k,
                raw: by * Vector3::repeat(number) + error(k),
                variance: Vector3::repeat(1e-10),
                input: Vector3::zeros(),
                earth: EarthShare {
                    known: Vector3::zeros(),
                    heading: 0,
                    by,
                },
                change: Vector3::zeros(),
            }
        };
        (0..50).map(rest).collect()
    }

    fn noise(k: usize) -> Vector3<f64> {
        Vector3::from_fn(|axis, _| 1e-5 * (7.1 * k as f64 + 2.3 * axis as f64).sin() * 2f64.sqrt())
    }

    #[test]
    fn a_rate_of_the_earth_far_beyond_the_noise_is_found() {
        let found = numbers(&rests(1.5, noise), &Matrix3::identity());
        assert!(
            (found[0] - Vector3::repeat(1.5)).amax() < 0.1,
            "{}",
            found[0]
        );
    }

    #[test]
    fn a_bias_over_temperature_that_is_not_known_yet_is_not_taken_for_the_earth() {
        let drift = |k: usize| noise(k) + Vector3::repeat(0.03 * (0.11 * k as f64).sin());
        let found = numbers(&rests(0.0, drift), &Matrix3::identity());
        assert!(found[0].amax() < 0.2, "{}", found[0]);
    }
}
