//! Recordings that leave parameters open: these stay at the values of data sheets, as a prior, whose width is in all intervals, and a warning names them.
//!
//! - By hand, six faces and nothing between them: the magnitude of gravity on a face does not depend on the angles between the axes, to first order. Scale factors
//!   and biases have a prior so wide that the faces alone determine them.
//! - A turntable about one or two axes of a gyro: the others keep their scale factors.

use std::sync::Arc;

use mimu_core::compensation::Affine;
use mimu_recording::Reference;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::determined::faces_not_up;
use super::{Fit, Options, SensorFit, fit_as_prepared, fit_biases};
use crate::estimate::Observation;
use crate::parameter::ParameterKind;
use crate::prepared::Prepared;
use crate::prior::{Prior, PriorTable};
use crate::quantity::{AXES, PerSensor, Sensor, plus_minus, scale_unit};
use crate::readable;
use crate::signal::blocks::{extent, quantile};
use crate::triad::Covariance;
use crate::turntable::RatedDwells;
use crate::warning::Warning;

/// Standard deviation of the angle between two axes, rad: data sheets of consumer parts have a cross-axis sensitivity of 2 % at most, and the angle is the sum of
/// two of them, each anywhere within that limit: 0.02 times the root of 2/3. With 0.01 the intervals of scale factors and biases held 56 of 72.
const ANGLE: f64 = 0.0163;
/// Standard deviations of scale factors, of themselves, and of biases, of the largest input: they leave both to the data.
const OPEN: f64 = 0.5;
/// Standard deviation of the scale factor of an axis that nothing turned about: data sheets of consumer parts give 3 % as largest value.
const SCALE: f64 = 0.015;
/// Largest share of gravity by which readings on one face may differ: that of a tilt of five degrees.
const TILT: f64 = 4e-3;
/// Numbers of scale factors, non-orthogonalities and biases among the physical parameters. The accelerometer's own axes are the body's.
const FREE: [usize; 9] = [0, 1, 2, 6, 7, 8, 9, 10, 11];
/// A prior of so many units is a known one.
const KNOWN: usize = 1_000_000;

/// The fit with such a prior. `None` if there is none for `prepared`, or if it too determines nothing.
pub(super) fn fit(prepared: Prepared, options: Options) -> Option<Fit> {
    match prepared.manifest.reference {
        Reference::Gravity if prepared.whole_turns().is_none() => six_faces(prepared, options),
        Reference::TurntableRate => few_axes(prepared, options),
        Reference::Gravity | Reference::Table => None,
    }
}

/// The gyro on a turntable, if some of its axes were turned about.
fn few_axes(prepared: Prepared, options: Options) -> Option<Fit> {
    if !options.wants(Sensor::Gyro) {
        return None;
    }
    let dwells = RatedDwells::of(&prepared).ok()?;
    let rests = dwells.rests.iter().map(|rest| rest.raw);
    let bias = rests.sum::<Vector3<f64>>() / dwells.rests.len() as f64;
    let both = dwells.turning.iter().zip(dwells.magnitudes());
    let mut scales: Vec<f64> = both.map(|(o, rate)| (o.raw - bias).norm() / rate).collect();
    let scale = match prepared.is_in_si() {
        true => 1.0,
        false => quantile(&mut scales, 0.5)?,
    };
    let largest = dwells.rates.last()? * scale;
    if !bias.iter().all(|b| b.is_finite()) {
        return None;
    }
    let prior = data_sheet(Sensor::Gyro, &prepared, |parameter, axis| match parameter {
        Parameter::Scale => (scale, SCALE * scale),
        Parameter::Bias => (bias[axis], OPEN * largest),
        Parameter::Angle => (0.0, ANGLE),
    });
    let mut found = fit_as_prepared(prepared.with_prior(Arc::new(prior)).ok()?, options).ok()?;
    let add = "turn it about every axis, and slanted between them";
    name_open(&mut found, Sensor::Gyro, add);
    Some(found)
}

/// What a prior of data sheets is of.
enum Parameter {
    Scale,
    Angle,
    Bias,
}

/// A prior with the mean and standard deviation of each parameter `of` each axis.
fn data_sheet(
    sensor: Sensor,
    prepared: &Prepared,
    of: impl Fn(Parameter, usize) -> (f64, f64),
) -> Prior {
    let each = FREE.iter().map(|k| match (k / 3, k % 3) {
        (0, axis) => of(Parameter::Scale, axis),
        (3, axis) => of(Parameter::Bias, axis),
        (_, axis) => of(Parameter::Angle, axis),
    });
    let (mean, sigma): (Vec<f64>, Vec<f64>) = each.unzip();
    let covariance = DMatrix::from_diagonal(&DVector::from_vec(sigma).map(|s| s * s));
    let (raw_unit, reference) = (prepared.manifest.raw_unit, prepared.manifest.reference);
    let table = PriorTable::new(sensor, raw_unit, KNOWN, &FREE, &mean, &covariance);
    let mut tables = PerSensor {
        gyro: None,
        accel: None,
    };
    tables[sensor] = Some(table);
    Prior::new("data sheets".into(), raw_unit, reference, tables)
}

/// Warns of the parameters of `sensor` that the data leave to the prior.
fn name_open(found: &mut Fit, sensor: Sensor, add: &'static str) {
    let prior = found.prepared.prior.as_ref();
    let (Some(prior), Some(fit)) = (prior.and_then(|p| p.triad(sensor)), found.sensor(sensor))
    else {
        return;
    };
    let scale = scale_unit(found.prepared.manifest.raw_unit, sensor.unit());
    let open = prior.open(&fit.estimated.triad).into_iter();
    let parameters = open.map(|(parameter, mean, sigma)| {
        let is_scale = parameter.0 == ParameterKind::Scale;
        let shown = readable::parameter(if is_scale { &scale } else { "rad" });
        let value = plus_minus(mean * shown.factor, 1.96 * sigma * shown.factor);
        format!(
            "{} {} {value} {}",
            parameter.0.words(),
            parameter.axis(),
            shown.unit
        )
        .trim_end()
        .to_owned()
    });
    let parameters: Vec<String> = parameters.collect();
    if !parameters.is_empty() {
        let open = Warning::LeftOpen { parameters, add };
        found.warnings.push(open.of(sensor));
    }
}

/// The accelerometer and the gyro's biases, if `prepared` has all six faces by hand.
fn six_faces(prepared: Prepared, options: Options) -> Option<Fit> {
    if !options.wants(Sensor::Accel) {
        return None;
    }
    let gravity = prepared.manifest.gravity_mps2;
    let poses = prepared.observations(Sensor::Accel);
    let raw: Vec<Vector3<f64>> = poses.iter().map(|o| o.raw).collect();
    let ends = [0, 1, 2].map(|axis| extent(raw.iter().map(|u| u[axis])));
    let scale = ends.map(|[low, high]| 0.5 * (high - low) / gravity);
    let bias = ends.map(|[low, high]| 0.5 * (high + low));
    let matrix = Matrix3::from_diagonal(&Vector3::from(scale.map(f64::recip)));
    let guess = Affine {
        matrix,
        offset: -matrix * Vector3::from(bias),
    };
    if scale.iter().any(|s| !(*s > 0.0)) || faces_not_up(&guess, &raw).is_some() {
        return None;
    }
    let prior = data_sheet(
        Sensor::Accel,
        &prepared,
        |parameter, axis| match parameter {
            Parameter::Scale => (scale[axis], OPEN * scale[axis]),
            Parameter::Bias => (bias[axis], OPEN * scale[axis] * gravity),
            Parameter::Angle => (0.0, ANGLE),
        },
    );
    let with = prepared.clone().with_prior(Arc::new(prior)).ok()?;
    let only = Options {
        only: Some(Sensor::Accel),
        ..options
    };
    // The turns between the faces depend on the angles: a gyro fitted to them would err by what these are off.
    let mut found = fit_as_prepared(with, only).ok()?;
    let unit = prepared.manifest.raw_unit;
    let differs = differing_face(&poses, &guess).map(|(axis, spread, noise)| {
        let axis = AXES[axis];
        Warning::FaceDiffers {
            axis,
            spread,
            noise,
            unit,
        }
        .of(Sensor::Accel)
    });
    found.warnings.extend(differs);
    name_open(
        &mut found,
        Sensor::Accel,
        "hold it with edges and corners up, too",
    );
    if options.wants(Sensor::Gyro) && prepared.has(Sensor::Gyro) {
        match gyro_biases(prepared, options) {
            Some(gyro) => {
                found.sensors.insert(0, gyro);
                let open = Warning::LeftOpen {
                    parameters: vec!["scale factors and angles".into()],
                    add: "hold it with edges and corners up, too",
                };
                found.warnings.push(open.of(Sensor::Gyro));
            }
            None => found.warnings.push(Warning::FewTurns.of(Sensor::Gyro)),
        }
    }
    Some(found)
}

/// The axis that differs most between `poses` on one face, the difference and the noise, if neither that nor a tilt explains it.
fn differing_face(poses: &[Observation], guess: &Affine<f64>) -> Option<(usize, f64, f64)> {
    let faces = (0..3).flat_map(|axis| [1.0, -1.0].map(|up| (axis, up)));
    let each = faces.filter_map(|(axis, up)| {
        let own = poses.iter();
        let own = own.filter(|o| up * guess.apply(&o.raw).normalize()[axis] > 0.7);
        let [low, high] = extent(own.clone().map(|o| o.raw[axis]));
        let noise = own.map(|o| o.variance[axis]).fold(0.0, f64::max).sqrt();
        let size = guess.apply(&poses[0].raw).norm() / guess.matrix[(axis, axis)];
        let spread = high - low;
        (spread > (TILT * size).max(10.0 * noise)).then_some((axis, spread, noise))
    });
    each.max_by(|a, b| a.1.total_cmp(&b.1))
}

/// The biases of a gyro whose unit is known: five turns between faces are too few for more.
fn gyro_biases(prepared: Prepared, options: Options) -> Option<SensorFit> {
    if !prepared.is_in_si() {
        return None;
    }
    let options = Options {
        only: Some(Sensor::Gyro),
        ..options
    };
    let sigma = Covariance::from_fn(|i, j| match i == j && i < 9 {
        true => ANGLE * ANGLE,
        false => 0.0,
    });
    let given = [Some(Affine::identity()), None];
    let found = fit_biases(prepared, options, given, &[Some(sigma), None]);
    found.ok()?.sensors.pop()
}
