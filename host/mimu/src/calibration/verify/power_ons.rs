//! The biases of the power-ons within a verification: they are estimated from its own readings, taken off before anything is judged, and reported.

use mimu_core::compensation::Affine;
use nalgebra::Vector3;
use serde::Serialize;

use super::PowerOn;
use super::causes::{INTERVAL, of_errors};
use crate::calibration::Calibration;
use crate::estimate::factor_fit::{Coordinates, FactorFit, HALF_DEGREE, mean_square};
use crate::fit::BIAS_ROUNDS;
use crate::judging::{Judging, Models};
use crate::observable::Observable;
use crate::prepared::Prepared;
use crate::quantity::{PerSensor, Sensor};
use crate::signal::power_ons::PowerOns;

/// The bias of a power-on beside the one that a calibration is judged in.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BiasMoved {
    /// Time of its first sample, s; null in JSON for the power-on before the first restart.
    pub t_s: f64,
    /// By how much the output without input is more, x, y, z, SI.
    pub moved: [f64; 3],
    /// Half of the 95 % interval of each.
    pub half_width: [f64; 3],
}

/// What the biases of power-ons took from the errors of a sensor.
#[derive(Debug, Clone, Default)]
pub(super) struct Taken {
    /// The biases, power-on by power-on.
    pub moved: Vec<BiasMoved>,
    /// Degrees of freedom of the errors that are judged.
    pub dof: f64,
}

/// The recording with the readings of all power-ons moved to the biases of one of them, and what that took. It is the one of the calibration, if that is
/// known, and else the last. `None` if all dwells are of it.
pub(super) fn with_one_bias(
    prepared: &Prepared,
    calibration: &Calibration,
    power_on: PowerOn,
) -> Option<(Prepared, PerSensor<Taken>)> {
    let power_ons = match power_on {
        PowerOn::Another => prepared.power_ons.clone(),
        PowerOn::Same => prepared.power_ons.since(&prepared.dwells.list),
    };
    if power_ons.others() == 0 {
        return None;
    }
    let mut moved = prepared.clone();
    for span in power_ons.spans() {
        moved.add_between(Sensor::Gyro, &-span.gyro, span.between_s);
    }
    let accel = calibration.inverse(Sensor::Accel);
    let mut taken = PerSensor::<Taken>::default();
    // The directions that the turns of the gyro are judged by are the accelerometer's.
    for sensor in [Sensor::Accel, Sensor::Gyro] {
        let Some(model) = calibration.inverse(sensor).filter(|_| prepared.has(sensor)) else {
            continue;
        };
        let up = accel.unwrap_or_else(Affine::identity);
        let known = calibration.uncertainty(sensor);
        let known = known.and_then(|known| of_errors(&model, known));
        // The output without input errs by what the calibration does not know of its bias, too.
        let known = known.map_or_else(Vector3::zeros, |(covariance, sigmas)| {
            Vector3::from_fn(|k, _| sigmas * covariance[(k, k)].sqrt())
        });
        let found = move_sensor(&mut moved, sensor, (&model, &up, &known), &power_ons);
        taken[sensor] = found.unwrap_or_default();
    }
    Some((moved, taken))
}

/// Moves the readings of `sensor`, whose calibration is `model`, in rounds: derivatives are those of small errors. `up`: the accelerometer's calibration;
/// `known`: half of the 95 % intervals of the calibration's bias.
fn move_sensor(
    moved: &mut Prepared,
    sensor: Sensor,
    (model, up, known): (&Affine<f64>, &Affine<f64>, &Vector3<f64>),
    power_ons: &PowerOns,
) -> Option<Taken> {
    let to_raw = model.matrix.try_inverse()?;
    let none = [Vector3::zeros(); 2];
    let (mut steps, mut dof) = (vec![none; power_ons.others()], 0.0);
    for _ in 0..BIAS_ROUNDS {
        let (more, taken) = round(moved, sensor, (model, up), power_ons)?;
        let raw: Vec<_> = more.iter().map(|[step, _]| to_raw * step).collect();
        moved.move_to_one_bias(sensor, power_ons, &raw);
        for (sum, [step, sigma]) in steps.iter_mut().zip(more) {
            *sum = [sum[0] + step, sigma];
        }
        dof = taken;
    }
    let dwells = &moved.dwells.list;
    let each = (1..).zip(steps).filter_map(|(number, [step, sigma])| {
        let [from_s, _] = power_ons.between_s(dwells, number)?;
        Some(BiasMoved {
            t_s: from_s,
            moved: (-step).into(),
            half_width: (INTERVAL * sigma).zip_map(known, f64::hypot).into(),
        })
    });
    Some(Taken {
        moved: each.collect(),
        dof,
    })
}

/// By what o differs in the other power-ons, with the standard deviations, and the degrees of freedom that this takes from the errors that are judged.
fn round(
    moved: &Prepared,
    sensor: Sensor,
    (model, up): (&Affine<f64>, &Affine<f64>),
    power_ons: &PowerOns,
) -> Option<(Vec<[Vector3<f64>; 2]>, f64)> {
    let mut models = Models {
        accel: Some(*up),
        ..Models::default()
    };
    models[sensor] = Some(*model);
    let judging = Judging::of(moved, sensor, &models)?;
    let mut factors = judging.factors;
    let (judged, rows) = (factors.list[0].group?, factors.rows() as f64);
    factors.rests(&judging.rests);
    let steps = factors.bias_steps(sensor, power_ons).into_iter();
    let mut coordinates = vec![Coordinates::fixed(sensor, model)];
    coordinates.extend(steps.map(Coordinates::around_zero));
    let fit = FactorFit::new(
        factors,
        coordinates,
        (1e-3, 2),
        "the biases do not converge",
    );
    // The first weights, as in a fit of the triads.
    let first = |group, residuals: &[f64]| match group {
        Observable::Turns => HALF_DEGREE,
        Observable::Rest => mean_square(residuals),
        _ => 0.0,
    };
    let solved = fit.solve(fit.start(), &first, &|_| Ok(())).ok()?;
    let left = solved.scatter(false).filter(|(group, _)| *group == judged);
    let left: f64 = left.map(|(_, scatter)| scatter.dof).sum();
    Some((solved.bias_steps(sensor, power_ons), rows - left))
}
