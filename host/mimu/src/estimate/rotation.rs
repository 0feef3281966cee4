//! Gyro calibration without a table: from the turns between dwells, from the dwells themselves, and from whole turns ([`super::whole_turns`]).
//!
//! Gravity is the reference. The integrated gyro rotates the direction of gravity of one dwell into the frame of the next, where it must agree with
//! the measured direction (references 19 of xu and 12 of fang); at rest the rate is zero. Both are fitted together, because the turns and the
//! readings at rest may need different biases if the model lacks something. The frame is that of the accelerometer, so the full 3x3 matrix contains
//! the alignment of gyro to accelerometer.

use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector, Vector3};

use super::factor_fit::{Coordinates, FactorFit, HALF_DEGREE, Minimum, Solved, mean_square};
use super::least_squares::{Observability, root};
use super::{Estimated, Failure};
use crate::factor::chains::Chains;
use crate::factor::{Factors, Kind, ParameterBlock};
use crate::observable::Observable;
use crate::observation::ALL;
use crate::observation::closure::Closures;
use crate::observation::turn::{Motion, Rest, Turn};
use crate::prior::TriadPrior;
use crate::quantity::{AXES, Sensor};
use crate::signal::power_ons::PowerOns;
use crate::triad::{Covariance, Part, Triad, vector};

/// Turns and rests of a gyro, and what its fit starts from.
#[derive(Clone, Copy)]
pub struct Data<'a> {
    /// Turns from dwell to dwell.
    pub turns: &'a [Turn<'a>],
    /// Dwells at rest.
    pub rest: &'a [Rest],
    /// The accelerometer.
    pub accel: &'a Triad,
    /// For the first guess, if there is neither a start nor a prior.
    pub motions: &'a [Motion],
    /// The first guess, if there is a better one.
    pub start: Option<&'a Affine<f64>>,
    /// Magnitude of gravity, m/s².
    pub gravity: f64,
    /// What is known of the gyro beforehand; whole turns do not use it.
    pub prior: Option<&'a TriadPrior>,
    /// The power-ons that the dwells are of.
    pub power_ons: &'a PowerOns,
}

/// The elements of C across the axes.
const CROSS: [usize; 6] = [1, 2, 3, 5, 6, 7];

/// Number of parameters: nine of C, three of o.
pub const PARAMETERS: usize = 12;

/// First guess of C, to within some ten per cent. A direction fixed in the world moves by `f × ω` in the body, so `df = [f]× C (u - u0) dt` is linear
/// in C. It works for any mounting of the gyro and any scale.
///
/// If hands shake, the accelerometer shows more than gravity: a pair has the less weight, the more its magnitude is off.
pub(super) fn guess(motions: &[Motion], rest: &Vector3<f64>, gravity: f64) -> Option<Matrix3<f64>> {
    let mut normal = SMatrix::<f64, 9, 9>::zeros();
    let mut right = SVector::<f64, 9>::zeros();
    for m in motions {
        let off = (m.force.norm() - gravity) / (0.1 * gravity);
        let weight = 1.0 / (1.0 + off * off);
        let turned = (m.raw - rest) * m.duration_s;
        let across = m.force.cross_matrix();
        let mut rows = SMatrix::<f64, 3, 9>::zeros();
        for i in 0..3 {
            for j in 0..3 {
                for r in 0..3 {
                    rows[(r, 3 * i + j)] = across[(r, i)] * turned[j];
                }
            }
        }
        normal += rows.transpose() * rows * weight;
        right += rows.transpose() * m.change * weight;
    }
    // Columns of unit size, so that volts and counts are judged alike.
    let scale = normal.diagonal().map(|d| d.sqrt().max(f64::MIN_POSITIVE));
    let scaled = SMatrix::<f64, 9, 9>::from_fn(|i, j| normal[(i, j)] / (scale[i] * scale[j]));
    let solution = scaled
        .cholesky()?
        .solve(&right.component_div(&scale))
        .component_div(&scale);
    let c = Matrix3::from_fn(|i, j| solution[3 * i + j]);
    c.iter().all(|x| x.is_finite()).then_some(c)
}

fn undetermined(shape: &Observability) -> Failure {
    let names: Vec<String> = shape
        .undetermined
        .iter()
        .map(|(k, _)| format!("C_{}{}", AXES[k / 3], AXES[k % 3]))
        .collect();
    Failure::Undetermined {
        parameters: names.join(", "),
        add: "add turns about every axis, with that axis level and slanted: gravity does not show a turn about the vertical".into(),
    }
}

/// Fits `ω = C u + o` to the turns and to the dwells at rest together.
///
/// The directions of gravity come from the accelerometer. Its errors are common to all turns, so its covariance is propagated into that of the gyro. (Without
/// this, the intervals of a quiet gyro beside a noisy accelerometer contained the truth in 75 to 81 % of the cases.)
pub fn estimate(data: &Data) -> Result<Estimated, Failure> {
    if data.prior.is_none() || data.rest.is_empty() {
        refuse_few(data.turns, data.rest, &Closures::default())?;
    }
    let at_rest = mean_at_rest(data.rest);
    let middle = data.prior.and_then(TriadPrior::middle);
    let first = match data.start.or(middle.as_ref()) {
        Some(start) => start.matrix,
        None => guess(data.motions, &at_rest, data.gravity).ok_or_else(|| {
            Failure::NoSolution(
                "no scale factor of the gyro makes its turns agree with those of gravity".into(),
            )
        })?,
    };
    fitted(data, &first, &Closures::default())
}

/// Mean reading at rest.
pub(super) fn mean_at_rest(rest: &[Rest]) -> Vector3<f64> {
    rest.iter().map(|o| o.raw).sum::<Vector3<f64>>() / rest.len().max(1) as f64
}

/// Refuses turns that are too few for C.
pub(super) fn refuse_few(turns: &[Turn], rest: &[Rest], whole: &Closures) -> Result<(), Failure> {
    if rest.is_empty() || 2 * turns.len() + whole.list.len() + 3 < PARAMETERS {
        return Err(Failure::Undetermined {
            parameters: "C of the gyro".into(),
            add: format!(
                "{} turns between dwells can be used; at least 5 about different axes are needed: turn the unit about each axis, and hold it still in between",
                turns.len()
            )
            .into(),
        });
    }
    Ok(())
}

/// The fit from the matrix `first` on, with the `whole` ones among the turns, and without a prior.
pub(super) fn from(
    data: &Data,
    first: &Matrix3<f64>,
    whole: &Closures,
) -> Result<Estimated, Failure> {
    refuse_few(data.turns, data.rest, whole)?;
    let alone = Data {
        prior: None,
        ..*data
    };
    fitted(&alone, first, whole)
}

/// The turns, rests and whole turns of a gyro, and what is known beforehand.
struct ByTurns<'a> {
    fit: FactorFit<'a>,
    /// Number of rows that determine C; they are the first.
    of_matrix: usize,
    /// What is known of the accelerometer, if its errors are fitted too: the inverse of its covariance.
    of_accel: Option<DMatrix<f64>>,
}

impl<'a> ByTurns<'a> {
    fn of(data: &Data<'a>, first: &Matrix3<f64>, whole: &Closures) -> Self {
        let Data {
            turns,
            rest,
            accel,
            prior,
            ..
        } = *data;
        let [gyro, of_accel] = Sensor::BOTH.map(ParameterBlock::Triad);
        let at_rest = mean_at_rest(rest);
        let start = Affine {
            matrix: *first,
            offset: -(first * at_rest),
        };
        let mut coordinates = vec![Coordinates::triad(
            Sensor::Gyro,
            &start,
            &ALL,
            &at_rest,
            1.0,
        )];
        let chains = Chains::of(turns, rest);
        let levels = (0..chains.count).map(ParameterBlock::LevelRate);
        coordinates.extend(levels.map(Coordinates::around_zero));
        let mut factors = Factors::among(turns, chains);
        // Whole turns are long, and errors of the model grow on the way, so that their directions scatter by themselves.
        let of_whole = |t: usize| whole.list.iter().any(|c| c.turns.contains(&t));
        factors.directions(Observable::Turns, |t| !of_whole(t));
        factors.directions(Observable::AfterWholeTurns, of_whole);
        factors.headings(whole);
        if let Some(cross) = whole.delivered {
            let size = first.norm() / 3f64.sqrt();
            let of = |i: usize, k| f64::from(u8::from(CROSS[i] == k)) / size;
            let by = DMatrix::from_fn(CROSS.len(), 12, of);
            let stated = Kind::Stated(gyro, DVector::zeros(12), by, cross * cross);
            factors.known(stated, Some(Observable::AsDelivered));
        }
        let of_matrix = factors.rows();
        let at = vector(&accel.inverse.matrix, &accel.inverse.offset);
        let at = DVector::from_column_slice(at.as_slice());
        // Headings do not depend on the accelerometer, and directions do, all of them by the same errors. To weigh one against the other these errors have to be
        // parameters: without them, directions of a tenth of a degree were believed to a fiftieth, and the headings that contradicted them were not.
        let errors = match whole.list.is_empty() {
            true => DMatrix::zeros(12, 0),
            false => root(&accel.inverse_covariance.resize(12, 12, 0.0)),
        };
        // The columns of the root are orthogonal.
        let mut back = errors.transpose();
        for mut row in back.row_iter_mut() {
            row /= row.norm_squared();
        }
        let information = (!whole.list.is_empty()).then(|| back.tr_mul(&back));
        if !back.is_empty() {
            let stated = Kind::Stated(of_accel, at.clone(), back, 1.0);
            factors.known(stated, Some(Observable::Force));
        }
        // An accelerometer as delivered errs by degrees: with derivatives at the start the fit to whole turns alone did not end.
        coordinates.push(Coordinates::linear(of_accel, at, errors).evaluated());
        factors.rests(rest);
        if let Some(prior) = prior {
            factors.known(Kind::Population(Sensor::Gyro, prior), None);
        }
        let steps = factors.bias_steps(Sensor::Gyro, data.power_ons);
        coordinates.extend(steps.into_iter().map(Coordinates::around_zero));
        let lost = "the fit of the gyro to the turns does not converge";
        // The first weights are a guess, so that there are two rounds or more.
        let mut fit = FactorFit::new(factors, coordinates, (1e-3, 2), lost);
        fit.common = (information.is_none()).then_some((of_accel, accel.inverse_covariance));
        Self {
            fit,
            of_matrix,
            of_accel: information,
        }
    }

    /// How well the turns determine C.
    fn shape(&self, found: &Minimum) -> Observability {
        let by_c = found.at.jacobian.view((0, 0), (self.of_matrix, 9));
        Observability::of(&by_c.into_owned())
    }

    /// What each group and each part of the accelerometer's covariance add to that of the gyro, which follows the accelerometer by `gain`.
    fn parts(&self, solved: &Solved, accel: &Triad, gain: &Covariance) -> Vec<Part> {
        let of_accel = accel.inverse_parts();
        let mut parts = solved.parts(Sensor::Gyro);
        for (part, group) in parts.iter_mut().zip(&solved.groups) {
            if group.observable == Some(Observable::Force) {
                let dof = of_accel.iter().map(|part| part.dof);
                part.dof = dof.fold(f64::INFINITY, f64::min);
                part.known = accel.known_covariance().trace() / accel.inverse_covariance.trace();
            }
        }
        if self.of_accel.is_none() {
            parts.extend(of_accel.iter().map(|part| part.seen_by(gain)));
        }
        parts
    }
}

fn fitted(data: &Data, first: &Matrix3<f64>, whole: &Closures) -> Result<Estimated, Failure> {
    let by = ByTurns::of(data, first, whole);
    let (accel, prior) = (data.accel, data.prior);
    // The first weights: half a degree, and the scatter of the dwells.
    let extra = |group, residuals: &[f64]| match group {
        // Beside a prior they are those of the noise: with half a degree a prior that does not hold was believed, and what then remained of the turns was taken
        // for their scatter.
        Observable::Turns | Observable::AfterWholeTurns if prior.is_none() => HALF_DEGREE,
        Observable::Rest => mean_square(residuals),
        _ => 0.0,
    };
    let check = |found: &Minimum| {
        let shape = by.shape(found);
        match shape.is_complete() || prior.is_some() {
            true => Ok(()),
            false => Err(undetermined(&shape)),
        }
    };
    let solved = by.fit.solve(by.fit.start(), &extra, &check)?;
    let gain = solved.gain(by.of_accel.as_ref());
    let parts = by.parts(&solved, accel, &gain);
    let singular = "C is singular: the gyro does not respond to turns about some axis";
    let triad = solved.triad(Sensor::Gyro, parts, singular)?;
    let condition = match prior {
        None => by.shape(&solved.found).condition,
        // Of data and prior together.
        Some(_) => solved.condition(9),
    };
    Ok(Estimated {
        follows_accel: Some(gain),
        ..Estimated::new(triad, solved.scatter(false).collect(), condition)
    })
}
