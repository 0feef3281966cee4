//! From a recording to a calibration of both triads, judged on what it was not fitted to.

mod biases;
mod hold_out;
mod of_temperature;
mod outlying;
pub mod plausible;
mod sensor;
pub mod session_bias;

use mimu_core::compensation::Affine;
use nalgebra::Vector3;

use crate::estimate::least_squares::POORLY_DETERMINED;
use crate::estimate::turn::{Rest, Turn, direction_error, sensitivity};
use crate::estimate::{
    Estimated, Failure, Observation, gravity_size, known_input, moving_input, rotation,
};
use crate::prepared::{Prepared, si_covariance};
use crate::quantity::{Figure, Sensor, plural};
use crate::stillness::STILL_FACTOR;
use crate::triad::{Triad, slope};
use mimu_recording::error::{Argument, Error, Result};
use mimu_recording::{RawUnit, Reference};

use hold_out::{HeldOut, determined};
use sensor::{rms, typical};

pub use biases::fit_biases;
pub use hold_out::{HoldOut, Split};
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
    /// Number of parts that are left out in turn, contiguous blocks where that leaves the rest determined; 0: none.
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
        let within = prepared.within_dwells(sensor);
        let estimate = |o: &[Observation], within: &[Observation]| match (options.method, sensor) {
            (Method::LeastSquares, _) if !within.is_empty() => {
                moving_input::least_squares(o, within, wander)
            }
            (Method::LeastSquares, _) => known_input::least_squares(o, wander),
            (Method::Kalman, _) => known_input::kalman(o, wander),
            (Method::InverseForm, Sensor::Gyro) => known_input::opposite_rates(o),
            (Method::InverseForm, Sensor::Accel) => known_input::inverse_form(o),
            (Method::SixPositions, _) => known_input::six_positions(o),
        };
        let estimated = match estimate(&observations, &within) {
            Ok(estimated) => estimated,
            // A level cube tells nothing of the gyro, and a rate table not much of the accelerometer.
            Err(_)
                if within.is_empty()
                    && observations
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
        if !within.is_empty() && options.method != Method::LeastSquares {
            warnings.push(format!(
                "{sensor}: {} {} an input that moves, of which {} uses the mean alone: least squares uses how the readings follow it",
                plural(count_dwells(&within), "dwell"),
                if count_dwells(&within) == 1 { "has" } else { "have" },
                options.method.name()
            ));
        }
        let means = observations.iter().map(|o| (o, 1.0));
        let within_used = match options.method {
            Method::LeastSquares => &within[..],
            _ => &[],
        };
        let all: Vec<(&Observation, f64)> =
            means.chain(within_used.iter().map(|o| (o, 0.0))).collect();
        let matrix = estimated.triad.inverse.matrix;
        let mut residuals: Vec<Residual> = all
            .iter()
            .map(|(o, bias)| Residual {
                dwell: o.dwell,
                within: *bias == 0.0,
                value: estimated.error(o, *bias),
                held_out: None,
                floor: (si_covariance(&matrix, &o.variance).trace() / 3.0).sqrt(),
            })
            .collect();
        let n = observations.len();
        let parts = options.holdout_blocks.min(n);
        // What a dwell shows within itself is held out with its mean.
        let part_of = |split: Split, dwell: usize| {
            let at = observations.partition_point(|o| o.dwell < dwell);
            split.part(at.min(n - 1), n, parts)
        };
        let typical = typical(Figure::Input, &residuals);
        let held_out = HeldOut::of(parts, |split, part| {
            let of_part = |o: &Observation| part_of(split, o.dwell) == part;
            let kept = |all: &[Observation]| -> Vec<Observation> {
                all.iter().filter(|o| !of_part(o)).copied().collect()
            };
            let refit = estimate(&kept(&observations), &kept(&within))?;
            let open = all.iter().filter(|(o, _)| of_part(o)).map(|(o, bias)| {
                let axis = |k: usize| {
                    let mut by = slope(&Vector3::ith(k, 1.0), &o.raw);
                    by.rows_mut(9, 3).scale_mut(*bias);
                    by
                };
                (0..3).map(|k| refit.triad.variance(&axis(k))).sum::<f64>() / 3.0
            });
            determined(open, typical, (Figure::Input, sensor))?;
            Ok(refit)
        });
        for (residual, (o, bias)) in residuals.iter_mut().zip(&all) {
            let refit = held_out.without(part_of(held_out.split, o.dwell));
            residual.held_out = refit.map(|refit| refit.error(o, *bias));
        }
        sensors.push(finish(
            sensor,
            estimated,
            Figure::Input,
            residuals,
            n,
            None,
            held_out.into(),
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

/// Dwells that `observations` are of, which stand in order.
fn count_dwells(observations: &[Observation]) -> u64 {
    let mut dwells: Vec<usize> = observations.iter().map(|o| o.dwell).collect();
    dwells.dedup();
    dwells.len() as u64
}

/// Fewer degrees of freedom than this show no error of the model.
const FEW_DOF: f64 = 3.0;

fn finish(
    sensor: Sensor,
    estimated: Estimated,
    figure: Figure,
    residuals: Vec<Residual>,
    dwells: usize,
    static_rms: Option<(f64, Option<f64>)>,
    held_out: HoldOut,
) -> SensorFit {
    let mut warnings = Vec::new();
    warnings.extend(
        estimated
            .notes
            .iter()
            .map(|note| format!("{sensor}: {note}")),
    );
    // Groups of one axis have its name before them.
    let dof = |name: &str| {
        let of_axis = estimated.scatter.iter().filter(|s| {
            let rest = s.0.strip_prefix(name);
            rest.is_some_and(|r| r.is_empty() || r.starts_with(" within"))
        });
        of_axis.map(|s| s.1.dof).sum::<f64>()
    };
    if estimated
        .scatter
        .iter()
        .any(|(name, _)| dof(name.trim_end_matches(" within dwells")) < FEW_DOF)
    {
        warnings.push(format!("{sensor}: hardly more dwells than parameters: nothing can contradict the model, and the intervals rest on the noise within dwells alone"));
    }
    if estimated.condition > POORLY_DETERMINED {
        warnings.push(format!("{sensor}: the experiment determines some parameters poorly (condition {:.0}); their intervals say which", estimated.condition));
    }
    if estimated.triad.inverse.matrix.determinant() < 0.0 {
        warnings.push(format!("{sensor}: the axes come out left-handed: one of them, of gyro or accelerometer, points the other way than its column says"));
    }
    for reason in &held_out.reasons {
        warnings.push(format!("{sensor}: {reason}"));
    }
    SensorFit {
        sensor,
        estimated,
        figure,
        residuals,
        dwells,
        static_rms,
        held_out,
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
        // Of a force that turns the mean has another size.
        let stand = observations
            .iter()
            .filter(|o| !prepared.dwells.list[o.dwell].moves(sensor));
        let mut sizes: Vec<f64> = stand.map(|o| o.input.norm()).collect();
        sizes.sort_by(f64::total_cmp);
        let typical = sizes.get(sizes.len() / 2).copied().unwrap_or(g);
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
    let parts = options.holdout_blocks.min(poses.len());
    let part_of = |split: Split, dwell: usize| split.part(dwell, prepared.dwells.list.len(), parts);
    let size_error = |triad: &Triad, o: &Observation| {
        Vector3::new(triad.inverse.apply(&o.raw).norm() - g, 0.0, 0.0)
    };
    let mut residuals: Vec<Residual> = poses
        .iter()
        .zip(&floors)
        .map(|(o, floor)| Residual {
            dwell: o.dwell,
            within: false,
            value: size_error(&accel.triad, o),
            held_out: None,
            floor: floor.sqrt(),
        })
        .collect();
    let typical = typical(Figure::GravitySize, &residuals);
    let without = |split: Split, part: usize| {
        let of_part = |o: &Observation| part_of(split, o.dwell) == part;
        let kept = poses.iter().zip(&by_sphere).filter(|(o, _)| !of_part(o));
        let (kept, variances): (Vec<_>, Vec<_>) = kept.map(|(o, v)| (*o, *v)).unzip();
        let refit = gravity_size::estimate(&kept, &variances, g)?;
        let open = poses.iter().filter(|o| of_part(o)).map(|o| {
            let up = accel.triad.inverse.apply(&o.raw).normalize();
            refit.triad.variance(&slope(&up, &o.raw))
        });
        determined(open, typical, (Figure::GravitySize, Sensor::Accel))?;
        Ok(refit)
    };
    let held_out = HeldOut::of(parts, without);
    for (residual, o) in residuals.iter_mut().zip(&poses) {
        let refit = held_out.without(part_of(held_out.split, o.dwell));
        residual.held_out = refit.map(|refit| size_error(&refit.triad, o));
    }
    let mut sensors = Vec::new();
    // The turns of a table of means are not known, which its warnings say.
    if prepared.has(Sensor::Gyro) && options.wants(Sensor::Gyro) && !prepared.manifest.means {
        let parts = Parts {
            count: parts,
            of: &part_of,
            accel_without: &without,
        };
        sensors.extend(fit_turns(prepared, &accel, &parts, warnings)?);
    }
    sensors.push(finish(
        Sensor::Accel,
        accel,
        Figure::GravitySize,
        residuals,
        poses.len(),
        None,
        held_out.into(),
    ));
    Ok(sensors)
}

/// How a recording is cut into parts, and what its accelerometer is without one.
struct Parts<'a> {
    count: usize,
    of: &'a (dyn Fn(Split, usize) -> usize + Sync),
    accel_without: &'a (dyn Fn(Split, usize) -> std::result::Result<Estimated, Failure> + Sync),
}

/// The gyro from the turns. A turn belongs to the part of the dwell that it ends in, and no turn that touches
/// a dwell of a part is used while the part is left out.
fn fit_turns(
    prepared: &Prepared,
    accel: &Estimated,
    parts: &Parts,
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
    let c = gyro.triad.inverse.matrix;
    let mean_square = c.norm_squared() / 3.0;
    let mut residuals: Vec<Residual> = turns
        .iter()
        .map(|t| Residual {
            dwell: t.to,
            within: false,
            value: direction_error(t, &gyro.triad.inverse),
            held_out: None,
            floor: t.floor(mean_square),
        })
        .collect();
    let typical = typical(Figure::Direction, &residuals);
    let held = HeldOut::of(parts.count, |split, part| {
        let accel = (parts.accel_without)(split, part).map_err(|failure| {
            let problem = failure.problem();
            Failure::NoSolution(format!("the accelerometer is not determined: {problem}"))
        })?;
        let of_part = |dwell: usize| (parts.of)(split, dwell) == part;
        let kept: Vec<_> = prepared.turns(&accel.triad.inverse).0;
        let kept: Vec<_> = kept
            .into_iter()
            .filter(|t| !of_part(t.from) && !of_part(t.to))
            .collect();
        let rest: Vec<_> = rest.iter().filter(|o| !of_part(o.dwell)).copied().collect();
        let start = Some(&gyro.triad.inverse);
        let refit = rotation::estimate(&kept, &rest, &accel.triad, &[], start, g)?;
        let open = turns.iter().filter(|t| of_part(t.to)).map(|t| {
            let columns = sensitivity(t, &gyro.triad.inverse).by_parameters(t);
            columns.iter().map(|by| refit.triad.variance(by)).sum()
        });
        determined(open, typical, (Figure::Direction, Sensor::Gyro))?;
        Ok((refit, accel))
    });
    let without = |dwell: usize| held.without((parts.of)(held.split, dwell));
    for (residual, turn) in residuals.iter_mut().zip(&turns) {
        residual.held_out = without(turn.to).map(|(gyro, accel)| {
            let force = |dwell: usize| {
                let raw = prepared.dwells.list[dwell].raw_mean(Sensor::Accel);
                accel.triad.inverse.apply(&raw)
            };
            let turn = Turn {
                before: force(turn.from),
                after: force(turn.to),
                ..*turn
            };
            direction_error(&turn, &gyro.triad.inverse)
        });
    }
    let static_rms = |rate: &dyn Fn(&Rest) -> Option<Vector3<f64>>| {
        let all: Vec<_> = rest.iter().filter_map(rate).collect();
        (!all.is_empty()).then(|| rms(Figure::Input, all.into_iter()))
    };
    let in_sample = static_rms(&|o| Some(gyro.triad.inverse.apply(&o.raw) - o.rate));
    let at_rest = static_rms(&|o| {
        let (refit, _) = without(o.dwell)?;
        Some(refit.triad.inverse.apply(&o.raw) - o.rate)
    });
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
        in_sample.map(|r| (r, at_rest)),
        held.into(),
    );
    if wide > 20f64.to_radians() {
        fit.warnings.push(format!("gyro: after one turn gravity is {:.0} degrees from where it is predicted; samples are missing or clipped, or the gyro's columns are not the gyro's", wide.to_degrees()));
    }
    Ok(Some(fit))
}
