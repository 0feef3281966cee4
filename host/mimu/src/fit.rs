//! From a recording to a calibration of both triads, judged on what it was not fitted to.

mod biases;
mod outlying;
pub mod plausible;
mod sensor;
pub mod session_bias;

use mimu_core::compensation::Affine;
use nalgebra::Vector3;
use rayon::prelude::*;

use crate::estimate::least_squares::POORLY_DETERMINED;
use crate::estimate::rotation::{Rest, Turn, direction_error};
use crate::estimate::{Estimated, Failure, Observation, gravity_size, known_input, rotation};
use crate::prepared::{Prepared, si_covariance};
use crate::quantity::{Figure, Sensor};
use crate::stillness::STILL_FACTOR;
use crate::triad::Triad;
use mimu_recording::error::{Argument, Error, Result};
use mimu_recording::{RawUnit, Reference};

use sensor::rms;

pub use biases::fit_biases;
pub use sensor::{Residual, SensorFit};

/// How a triad with known input is estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Forward form, batch: fang (15), (17).
    LeastSquares,
    /// Forward form, recursive: fang (23)-(28).
    Kalman,
    /// Inverse form: xu (3)-(11) for the gyro, (12)-(16) for the accelerometer.
    InverseForm,
    /// Six positions: scale factors and biases only.
    SixPositions,
}

/// What to fit and how to judge it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Estimator where the input is known.
    pub method: Method,
    /// Number of contiguous blocks that are left out in turn; 0: none.
    pub holdout_blocks: usize,
    /// See [`crate::stillness::STILL_FACTOR`].
    pub still_factor: f64,
    /// Calibrate this triad only. Without a table the gyro needs the accelerometer, which is then calibrated as well.
    pub only: Option<Sensor>,
}

impl Method {
    /// Name for people and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::LeastSquares => "least squares",
            Self::Kalman => "Kalman bank",
            Self::InverseForm => "inverse form",
            Self::SixPositions => "six positions",
        }
    }
}

impl Default for Options {
    /// Least squares of both triads, judged on four contiguous blocks.
    fn default() -> Self {
        Self {
            method: Method::LeastSquares,
            holdout_blocks: 4,
            still_factor: STILL_FACTOR,
            only: None,
        }
    }
}

impl Options {
    fn wants(&self, sensor: Sensor) -> bool {
        self.only.is_none_or(|only| only == sensor)
    }
}

/// Fit of a recording.
#[derive(Debug, Clone)]
pub struct Fit {
    /// What was fitted.
    pub prepared: Prepared,
    /// How.
    pub options: Options,
    /// Gyro, then accelerometer, as far as there are any.
    pub sensors: Vec<SensorFit>,
    /// What a person should know of the recording.
    pub warnings: Vec<String>,
}

impl Fit {
    /// Name of the estimator of `sensor`.
    pub fn estimator(&self, sensor: Sensor) -> &'static str {
        match (self.prepared.manifest.reference, sensor) {
            (Reference::Table, _) => self.options.method.name(),
            (Reference::Gravity, Sensor::Accel) => "magnitude of specific force",
            (Reference::Gravity, Sensor::Gyro) => "turns and rests",
        }
    }

    /// Fit of `sensor`.
    pub fn sensor(&self, sensor: Sensor) -> Option<&SensorFit> {
        self.sensors.iter().find(|s| s.sensor == sensor)
    }
}

/// Fits both triads of a recording.
pub fn fit(mut prepared: Prepared, options: Options) -> Result<Fit> {
    if let Some(only) = options.only
        && !prepared.has(only)
    {
        return Err(Error::new(
            &prepared.place,
            format!("there is no {only} to fit alone"),
            format!("fit the other one, or add {only}_x, {only}_y, {only}_z"),
        )
        .about(Argument::Only));
    }
    if prepared.manifest.means
        && prepared.manifest.reference == Reference::Gravity
        && options.only == Some(Sensor::Gyro)
    {
        return Err(Error::undetermined(
            &prepared.place,
            "the gyro is calibrated by turns, which need samples, and this is a table of means",
            "give it steps of known rate (ref_rate_ columns, reference = \"table\"), or record samples",
        )
        .about(Argument::Only));
    }
    if prepared.manifest.reference == Reference::Gravity {
        outlying::leave_out(&mut prepared);
    }
    let mut warnings = prepared.condensed.warnings.clone();
    warnings.extend(prepared.dwells.warnings.iter().cloned());
    warn_of_temperature(&prepared, &mut warnings);
    let mut sensors = match prepared.manifest.reference {
        Reference::Table => fit_known(&prepared, options, &mut warnings)?,
        Reference::Gravity => fit_gravity(&prepared, options, &mut warnings)?,
    };
    for sensor in &mut sensors {
        plausible::check(&prepared, sensor)?;
    }
    Ok(Fit {
        prepared,
        options,
        sensors,
        warnings,
    })
}

/// A bias of 0.1 deg/s per °C is ordinary for these sensors: five degrees are half a degree a second.
const ISOTHERMAL_C: f64 = 5.0;

fn warn_of_temperature(prepared: &Prepared, warnings: &mut Vec<String>) {
    let temperatures = || {
        prepared
            .dwells
            .list
            .iter()
            .map(|d| d.temp_c)
            .filter(|t| t.is_finite())
    };
    let high = temperatures().fold(f64::NEG_INFINITY, f64::max);
    let low = temperatures().fold(f64::INFINITY, f64::min);
    if high - low > ISOTHERMAL_C {
        warnings.push(format!(
            "the dwells range from {low:.1} to {high:.1} °C, and the model has no temperature in it"
        ));
    }
}

/// The one of `blocks` contiguous blocks that item `i` of `n` falls into, in order of time: sizes differ by one
/// at most, the larger blocks first (as k-fold cross-validation is commonly cut, so that figures compare).
fn block_of(i: usize, n: usize, blocks: usize) -> usize {
    if blocks == 0 {
        return 0;
    }
    let (small, larger) = (n / blocks, n % blocks);
    let in_larger = larger * (small + 1);
    if i < in_larger {
        i / (small + 1)
    } else {
        larger + (i - in_larger) / small.max(1)
    }
}

fn fit_known(
    prepared: &Prepared,
    options: Options,
    warnings: &mut Vec<String>,
) -> Result<Vec<SensorFit>> {
    let mut sensors = Vec::new();
    let mut missing = Vec::new();
    let wanted = |s: &Sensor| prepared.has(*s) && options.wants(*s);
    for sensor in Sensor::BOTH.into_iter().filter(wanted) {
        let observations = prepared.observations(sensor);
        if observations.is_empty() {
            let unused = prepared.dwells.unused(sensor);
            missing.push(format!(
                "{sensor}: no usable dwell has a known input{unused}, so it is not calibrated"
            ));
            continue;
        }
        refuse_wrong_gravity(prepared, sensor, &observations)?;
        let wander = prepared.noise.wander(sensor, &prepared.dwells.list);
        let wander = wander.as_ref();
        let estimate = |o: &[Observation]| match (options.method, sensor) {
            (Method::LeastSquares, _) => known_input::least_squares(o, wander),
            (Method::Kalman, _) => known_input::kalman(o, wander),
            (Method::InverseForm, Sensor::Gyro) => known_input::opposite_rates(o),
            (Method::InverseForm, Sensor::Accel) => known_input::inverse_form(o),
            (Method::SixPositions, _) => known_input::six_positions(o),
        };
        let estimated = match estimate(&observations) {
            Ok(estimated) => estimated,
            // A level cube tells nothing of the gyro, and a rate table not much of the accelerometer.
            Err(_)
                if observations
                    .iter()
                    .all(|o| o.input == observations[0].input) =>
            {
                missing.push(format!(
                    "{sensor}: all dwells have the same input, so it is not calibrated"
                ));
                continue;
            }
            Err(failure) => {
                let mut error = prepared.refused(failure, sensor);
                if options.method != Method::LeastSquares {
                    error = error.about(Argument::Method);
                }
                let other = Sensor::BOTH.into_iter().find(|s| *s != sensor && wanted(s));
                return Err(match other {
                    Some(other) => error
                        .map(|e| e.remedy += &format!("; or fit the {other} alone"))
                        .about(Argument::Only),
                    None => error,
                });
            }
        };
        if observations
            .iter()
            .any(|o| prepared.dwells.list[o.dwell].turn)
            && sensor == Sensor::Gyro
        {
            warnings.push("gyro: the turns are taken to be of exactly the given angle about exactly the given axis; what hands and table miss of that is in no interval".into());
        }
        let error = |triad: &Triad, o: &Observation| triad.inverse.apply(&o.raw) - o.input;
        let matrix = estimated.triad.inverse.matrix;
        let mut residuals: Vec<Residual> = observations
            .iter()
            .map(|o| Residual {
                dwell: o.dwell,
                value: error(&estimated.triad, o),
                held_out: None,
                floor: (si_covariance(&matrix, &o.variance).trace() / 3.0).sqrt(),
            })
            .collect();
        let n = observations.len();
        let refits = refit(options.holdout_blocks.min(n), |block| {
            let kept: Vec<_> = (0..n)
                .filter(|&i| block_of(i, n, options.holdout_blocks.min(n)) != block)
                .map(|i| observations[i])
                .collect();
            determined(estimate(&kept)?, &estimated)
        });
        let mut not_held_out = Vec::new();
        for (block, refit) in refits.into_iter().enumerate() {
            let members =
                (0..n).filter(|&i| block_of(i, n, options.holdout_blocks.min(n)) == block);
            match refit {
                Ok(refit) => members.for_each(|i| {
                    residuals[i].held_out = Some(error(&refit.triad, &observations[i]))
                }),
                Err(failure) => not_held_out.push(cannot_hold_out(block, failure, sensor)),
            }
        }
        sensors.push(finish(
            sensor,
            estimated,
            Figure::Input,
            residuals,
            n,
            None,
            not_held_out,
        ));
    }
    if sensors.is_empty() {
        return Err(Error::new(
            &prepared.place,
            missing.join(", "),
            "give dwells of a second and more their inputs in the ref_ columns, or set reference = \"gravity\" where there is no table",
        ));
    }
    warnings.extend(missing);
    Ok(sensors)
}

/// Runs `estimate` for each block that is left out, side by side.
fn refit<T: Send>(
    blocks: usize,
    estimate: impl Fn(usize) -> std::result::Result<T, Failure> + Sync + Send,
) -> Vec<std::result::Result<T, Failure>> {
    (0..blocks).into_par_iter().map(estimate).collect()
}

/// How much worse than the whole recording what is left without a block may determine the parameters.
const WORSE: f64 = 10.0;

/// A fit without a block, unless what is left determines it so poorly that its error is that of the cut: one block held all slanted poses
/// of a recording, and the held-out error was 2451 mm/s².
fn determined(refit: Estimated, full: &Estimated) -> std::result::Result<Estimated, Failure> {
    let condition = refit.condition;
    if condition > POORLY_DETERMINED && condition > WORSE * full.condition {
        let problem = format!(
            "the rest determines some parameters poorly (condition {condition:.0}, and {:.0} with it)",
            full.condition
        );
        return Err(Failure::NoSolution(problem));
    }
    Ok(refit)
}

/// Fewer degrees of freedom than this show no error of the model.
const FEW_DOF: f64 = 3.0;

fn cannot_hold_out(block: usize, failure: Failure, sensor: Sensor) -> String {
    let error = failure.into_error(sensor);
    let problem = &error.refused().problem;
    format!(
        "block {} cannot be held out: without it {problem}",
        block + 1
    )
}

fn finish(
    sensor: Sensor,
    estimated: Estimated,
    figure: Figure,
    residuals: Vec<Residual>,
    dwells: usize,
    static_rms: Option<(f64, Option<f64>)>,
    not_held_out: Vec<String>,
) -> SensorFit {
    let mut warnings = Vec::new();
    warnings.extend(
        estimated
            .notes
            .iter()
            .map(|note| format!("{sensor}: {note}")),
    );
    if estimated.scatter.iter().any(|(_, s)| s.dof < FEW_DOF) {
        warnings.push(format!("{sensor}: hardly more dwells than parameters: nothing can contradict the model, and the intervals rest on the noise within dwells alone"));
    }
    if estimated.condition > POORLY_DETERMINED {
        warnings.push(format!("{sensor}: the experiment determines some parameters poorly (condition {:.0}); their intervals say which", estimated.condition));
    }
    if estimated.triad.inverse.matrix.determinant() < 0.0 {
        warnings.push(format!("{sensor}: the axes come out left-handed: one of them, of gyro or accelerometer, points the other way than its column says"));
    }
    for reason in &not_held_out {
        warnings.push(format!("{sensor}: {reason}"));
    }
    SensorFit {
        sensor,
        estimated,
        figure,
        residuals,
        dwells,
        static_rms,
        not_held_out,
        warnings,
    }
}

/// A recording in SI whose accelerometer reads one at rest is in g.
pub(crate) fn refuse_wrong_gravity(
    prepared: &Prepared,
    sensor: Sensor,
    observations: &[Observation],
) -> Result<()> {
    let g = prepared.manifest.gravity_mps2;
    if sensor == Sensor::Accel && prepared.manifest.reference == Reference::Table {
        let mut sizes: Vec<f64> = observations.iter().map(|o| o.input.norm()).collect();
        sizes.sort_by(f64::total_cmp);
        let typical = sizes[sizes.len() / 2];
        if (0.8..1.2).contains(&typical) {
            let problem = format!("the known forces have a size of {typical:.3}, so they are in g");
            return Err(Error::new(
                format!("{}, ref_force_*_mps2", prepared.place),
                problem,
                format!("write them in m/s² (times {g})"),
            ));
        }
    }
    if sensor == Sensor::Accel && prepared.manifest.raw_unit == RawUnit::Si {
        let mut sizes: Vec<f64> = observations.iter().map(|o| o.raw.norm()).collect();
        sizes.sort_by(f64::total_cmp);
        let typical = sizes[sizes.len() / 2];
        if (0.5..2.0).contains(&typical) {
            let problem = format!(
                "raw_unit = \"SI\", but at rest the accelerometer reads {typical:.3}, so it is in g"
            );
            return Err(Error::new(
                &prepared.place,
                problem,
                "import it with the factor accel=9.80665",
            )
            .about(Argument::Scale));
        }
    }
    Ok(())
}

fn fit_gravity(
    prepared: &Prepared,
    options: Options,
    warnings: &mut Vec<String>,
) -> Result<Vec<SensorFit>> {
    let g = prepared.manifest.gravity_mps2;
    if !prepared.has(Sensor::Accel) {
        return Err(Error::new(
            &prepared.place,
            "there is no accelerometer, and gravity is the only reference",
            "add accel_x, accel_y, accel_z, or give the gyro its rates in ref_rate_ columns (reference = \"table\")",
        ));
    }
    let poses = prepared.observations(Sensor::Accel);
    if poses.is_empty() {
        return Err(Error::new(
            &prepared.place,
            format!(
                "no dwell can be used for the accelerometer{}",
                prepared.dwells.unused(Sensor::Accel)
            ),
            "hold the unit still for some seconds in every pose, within the sensor's range",
        ));
    }
    refuse_wrong_gravity(prepared, Sensor::Accel, &poses)?;
    let variances = |accel: &Affine<f64>| prepared.size_variances(accel, &poses);
    let by_sphere = gravity_size::first_guess(&poses, g)
        .map_or_else(|| vec![0.0; poses.len()], |a| variances(&a));
    let accel = gravity_size::estimate(&poses, &by_sphere, g)
        .map_err(|f| prepared.refused(f, Sensor::Accel))?;
    let floors = variances(&accel.triad.inverse);
    let all_dwells = prepared.dwells.list.len();
    let blocks = options.holdout_blocks.min(poses.len());
    let block = |dwell: usize| block_of(dwell, all_dwells, blocks);
    let accel_refits = refit(blocks, |b| {
        let kept = poses
            .iter()
            .zip(&by_sphere)
            .filter(|(o, _)| block(o.dwell) != b);
        let (kept, variances): (Vec<_>, Vec<_>) = kept.map(|(o, v)| (*o, *v)).unzip();
        determined(gravity_size::estimate(&kept, &variances, g)?, &accel)
    });
    let size_error = |triad: &Triad, o: &Observation| {
        Vector3::new(triad.inverse.apply(&o.raw).norm() - g, 0.0, 0.0)
    };
    let residuals = poses
        .iter()
        .zip(&floors)
        .map(|(o, floor)| {
            let refit = accel_refits
                .get(block(o.dwell))
                .and_then(|r| r.as_ref().ok());
            Residual {
                dwell: o.dwell,
                value: size_error(&accel.triad, o),
                held_out: refit.map(|r| size_error(&r.triad, o)),
                floor: floor.sqrt(),
            }
        })
        .collect();
    let not_held_out = failures(&accel_refits, Sensor::Accel);
    let mut sensors = Vec::new();
    // The turns of a table of means are not known, which its warnings say.
    if prepared.has(Sensor::Gyro) && options.wants(Sensor::Gyro) && !prepared.manifest.means {
        sensors.extend(fit_turns(
            prepared,
            &accel,
            &accel_refits,
            &block,
            warnings,
        )?);
    }
    sensors.push(finish(
        Sensor::Accel,
        accel,
        Figure::GravitySize,
        residuals,
        poses.len(),
        None,
        not_held_out,
    ));
    Ok(sensors)
}

fn failures(refits: &[std::result::Result<Estimated, Failure>], sensor: Sensor) -> Vec<String> {
    let failed = refits
        .iter()
        .enumerate()
        .filter_map(|(b, r)| r.as_ref().err().map(|f| (b, f)));
    failed
        .map(|(b, f)| cannot_hold_out(b, f.clone(), sensor))
        .collect()
}

/// The gyro from the turns. A turn belongs to the block of the dwell that it ends in, and no turn that touches
/// a dwell of a block is used while the block is left out.
fn fit_turns(
    prepared: &Prepared,
    accel: &Estimated,
    accel_refits: &[std::result::Result<Estimated, Failure>],
    block: &(impl Fn(usize) -> usize + Sync),
    warnings: &mut Vec<String>,
) -> Result<Option<SensorFit>> {
    let g = prepared.manifest.gravity_mps2;
    let by_full = &accel.triad.inverse;
    let (turns, refused) = prepared.turns(by_full);
    warnings.extend(refused);
    let rest = prepared.rest(by_full);
    if turns.is_empty() {
        warnings
            .push("gyro: no turn lies between two usable dwells, so it is not calibrated".into());
        return Ok(None);
    }
    let motions = prepared.motions(by_full);
    let gyro = rotation::estimate(&turns, &rest, &accel.triad, &motions, None, g)
        .map_err(|f| prepared.refused(f, Sensor::Gyro))?;
    let refits = refit(accel_refits.len(), |b| {
        let accel = accel_refits[b].as_ref().map_err(Clone::clone)?;
        let (turns, _) = prepared.turns(&accel.triad.inverse);
        let kept: Vec<_> = turns
            .into_iter()
            .filter(|t| block(t.from) != b && block(t.to) != b)
            .collect();
        let rest: Vec<_> = rest
            .iter()
            .filter(|o| block(o.dwell) != b)
            .copied()
            .collect();
        let start = Some(&gyro.triad.inverse);
        let refit = rotation::estimate(&kept, &rest, &accel.triad, &[], start, g)?;
        determined(refit, &gyro)
    });
    let held_out = |t: &Turn| {
        let b = block(t.to);
        let (gyro, accel) = (
            refits.get(b)?.as_ref().ok()?,
            accel_refits[b].as_ref().ok()?,
        );
        let direction = |d: usize| {
            accel
                .triad
                .inverse
                .apply(&prepared.dwells.list[d].raw_mean(Sensor::Accel))
        };
        let turn = Turn {
            before: direction(t.from),
            after: direction(t.to),
            ..*t
        };
        Some(direction_error(&turn, &gyro.triad.inverse))
    };
    let c = gyro.triad.inverse.matrix;
    let mean_square = c.norm_squared() / 3.0;
    let residuals = turns
        .iter()
        .map(|t| Residual {
            dwell: t.to,
            value: direction_error(t, &gyro.triad.inverse),
            held_out: held_out(t),
            floor: t.floor(mean_square),
        })
        .collect();
    let static_rms = |rate: &dyn Fn(&Rest) -> Option<Vector3<f64>>| {
        let all: Vec<_> = rest.iter().filter_map(rate).collect();
        (!all.is_empty()).then(|| rms(Figure::Input, all.into_iter()))
    };
    let in_sample = static_rms(&|o| Some(gyro.triad.inverse.apply(&o.raw) - o.rate));
    let held = static_rms(&|o| {
        let refit = refits.get(block(o.dwell))?.as_ref().ok()?;
        Some(refit.triad.inverse.apply(&o.raw) - o.rate)
    });
    let not_held_out = failures(&refits, Sensor::Gyro);
    let wide = turns
        .iter()
        .map(|t| direction_error(t, &gyro.triad.inverse).norm())
        .fold(0.0, f64::max);
    let mut fit = finish(
        Sensor::Gyro,
        gyro,
        Figure::Direction,
        residuals,
        rest.len(),
        in_sample.map(|r| (r, held)),
        not_held_out,
    );
    if wide > 20f64.to_radians() {
        fit.warnings.push(format!("gyro: after one turn gravity is {:.0} degrees from where it is predicted; samples are missing or clipped, or the gyro's columns are not the gyro's", wide.to_degrees()));
    }
    Ok(Some(fit))
}
