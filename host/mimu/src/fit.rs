//! From a recording to a calibration of both triads, judged on held-out data.

mod biases;
mod by_gravity;
mod by_rate;
pub mod change;
mod determined;
mod earth;
mod hold_out;
mod judged;
mod known;
pub(crate) mod lever_arm;
mod reference_error;
pub use reference_error::{Cause, Influence};
mod of_temperature;
mod off_level;
mod outlying;
mod partly;
pub mod plausible;
mod predicted;
mod sensor;
pub mod session_bias;
pub(crate) mod uncalibrated;

use std::sync::Arc;

use crate::estimate::least_squares::{POORLY_DETERMINED, Scatter};
use crate::estimate::{Estimated, Observation, magnitude};
use crate::prepared::Prepared;
use crate::prior::{FALSE_STRANGER, Prior};
use crate::quantity::{Figure, Sensor};
use crate::signal::blocks::extent;
use crate::triad::Triad;
use crate::turntable::RatedDwells;
use crate::unseen::{Test, Unseen};
use crate::warning::Warning;
use mimu_core::PerSensor;
use mimu_recording::units::median;
use mimu_recording::{Argument, Error, RawUnit, Reference, Result};

use crate::observable::Observable;
use by_gravity::{fit_gravity, with_priors};
use by_rate::fit_rates;
pub(crate) use determined::faces_not_up;
use judged::Judged;
use known::fit_known;
use outlying::Outlying;

pub use biases::fit_biases;
pub use hold_out::{HoldOut, Split};
pub use sensor::{Residual, SensorFit};

/// What to fit and how to judge it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Number of parts that are held out in turn: contiguous blocks, if the rest determines the model. 0: none.
    pub holdout_blocks: usize,
    /// Calibrate this triad only. Without a table the gyro needs the accelerometer, which is then calibrated as well.
    pub only: Option<Sensor>,
}

impl Default for Options {
    /// Least squares of both triads, judged on four contiguous blocks.
    fn default() -> Self {
        Self {
            holdout_blocks: 4,
            ..Self::IN_SAMPLE
        }
    }
}

impl Options {
    /// As the default, but nothing is held out.
    pub const IN_SAMPLE: Self = Self {
        holdout_blocks: 0,
        only: None,
    };

    fn wants(&self, sensor: Sensor) -> bool {
        self.only.is_none_or(|only| only == sensor)
    }
}

/// Fit of a recording.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The recording that was fitted.
    pub prepared: Prepared,
    /// Options of the fit.
    pub options: Options,
    /// Gyro, then accelerometer, if fitted.
    pub sensors: Vec<SensorFit>,
    /// Changes of the parameters by leaving out dwells and turns; empty if none was left out.
    pub changes: Vec<change::Change>,
    /// Warnings about the recording.
    pub warnings: Vec<Warning>,
}

impl Fit {
    /// Name of the estimator of `sensor`.
    pub fn estimator(&self, sensor: Sensor) -> &'static str {
        let prior = self.prepared.prior.as_ref();
        if prior.is_some_and(|p| p.table(sensor).is_some()) {
            return match sensor {
                Sensor::Gyro if self.prepared.manifest.reference == Reference::TurntableRate => {
                    "magnitude of the rate and a prior"
                }
                Sensor::Gyro => "turns, rests and a prior",
                Sensor::Accel => "magnitude of specific force and a prior",
            };
        }
        match (self.prepared.manifest.reference, sensor) {
            (Reference::Table, _) => "least squares",
            (Reference::TurntableRate, Sensor::Gyro) => "magnitude of the rate",
            (Reference::Gravity | Reference::TurntableRate, Sensor::Accel) => {
                "magnitude of specific force"
            }
            (Reference::Gravity, Sensor::Gyro) => "turns and rests",
        }
    }

    /// All warnings: about the recording, then about each triad.
    pub fn all_warnings(&self) -> impl Iterator<Item = &Warning> {
        let of_sensors = self.sensors.iter().flat_map(|s| &s.warnings);
        self.warnings.iter().chain(of_sensors)
    }

    /// Fit of `sensor`.
    pub fn sensor(&self, sensor: Sensor) -> Option<&SensorFit> {
        self.sensors.iter().find(|s| s.sensor == sensor)
    }
}

/// Fits both triads of a recording. If it has a [prior](crate::prior) that the data contradict, the triad is fitted without it, and a warning says so.
pub fn fit(prepared: Prepared, options: Options) -> Result<Fit> {
    let Some(prior) = prepared.prior.clone() else {
        return fit_as_prepared(prepared, options);
    };
    let mut fitted = fit_as_prepared(prepared.clone(), options)?;
    let (mut given_up, mut warnings) = (Prior::clone(&prior), Vec::new());
    // Without its prior an accelerometer has other directions, by which the gyro is judged again.
    for _ in 0..Sensor::BOTH.len() {
        let found = strangers(&fitted, &given_up);
        if found.is_empty() {
            break;
        }
        for (sensor, warning) in found {
            given_up.remove(sensor);
            warnings.push(warning);
        }
        let named: Vec<String> = warnings.iter().map(ToString::to_string).collect();
        let mut again = prepared.clone();
        again.prior = Some(Arc::new(given_up.clone()));
        fitted = fit_as_prepared(again, options).map_err(|error| {
            error.map(|e| {
                e.problem = format!("{}; without the prior {}", named.join("; "), e.problem)
            })
        })?;
    }
    fitted.warnings.extend(warnings);
    Ok(fitted)
}

/// As [`fit`]. What the recording leaves open stays at the values of data sheets, if these let the rest be fitted (`fit/partly.rs`).
///
/// # Errors
/// Those of [`fit`].
pub fn fit_or_faces(prepared: Prepared, options: Options) -> Result<Fit> {
    match fit(prepared.clone(), options) {
        Err(error @ Error::Undetermined(_)) if prepared.prior.is_none() => {
            partly::fit(prepared, options).ok_or(error)
        }
        done => done,
    }
}

/// Triads whose data contradict the `prior` that they were fitted with: each triad alone, or else poses and turns together. A gyro that does not belong would make
/// the accelerometer seem not to.
fn strangers(fitted: &Fit, prior: &Prior) -> Vec<(Sensor, Warning)> {
    let found = |triad: &dyn Fn(&SensorFit) -> Option<Triad>| -> Vec<(Sensor, Warning)> {
        let each = fitted.sensors.iter().filter_map(|fit| {
            let moved = prior.triad(fit.sensor)?.movement(&triad(fit)?)?;
            let warning = Warning::NotOfPopulation {
                p: moved.p,
                parameter: format!("{} {}", moved.most.0.words(), moved.most.axis()),
                sigmas: moved.sigmas,
            };
            (moved.p < FALSE_STRANGER).then(|| (fit.sensor, warning.of(fit.sensor)))
        });
        each.collect()
    };
    let alone = found(&|fit| Some(fit.estimated.triad.clone()));
    match alone.is_empty() {
        true => found(&|fit| with_priors(fitted, prior, fit.sensor)),
        false => alone,
    }
}

fn fit_as_prepared(mut prepared: Prepared, options: Options) -> Result<Fit> {
    if let Some(only) = options.only
        && !prepared.has(only)
    {
        return Err(Error::new(
            &prepared.place,
            format!("the recording has no {only}"),
            format!("fit the other sensor, or add the columns {only}_x, {only}_y, {only}_z"),
        )
        .about(Argument::Only));
    }
    if prepared.manifest.means
        && prepared.manifest.reference == Reference::Gravity
        && options.only == Some(Sensor::Gyro)
    {
        return Err(Error::undetermined(
            &prepared.place,
            "turns calibrate the gyro; they need samples, and this is a table of means",
            "give it dwells at known rates (ref_rate_ columns, reference = \"table\"), or record samples",
        )
        .about(Argument::Only));
    }
    let suspicions = suspicions(&prepared)?;
    reference_error::refuse_unused(&prepared)?;
    one_bias(&mut prepared);
    let mut with_all = PerSensor::default();
    if prepared.manifest.reference == Reference::Gravity {
        // Turns connect dwells that are not left out, so the poses are judged first.
        with_all.accel = leave_out(&mut prepared, outlying::poses);
        with_all.gyro = leave_out(&mut prepared, outlying::turns);
    }
    let rated = match prepared.manifest.reference {
        Reference::TurntableRate => Some(RatedDwells::of(&prepared)?),
        Reference::Table | Reference::Gravity => None,
    };
    let at_none = rated.iter().flat_map(|r| r.exclude_dwells(&mut prepared));
    let at_none: Vec<Warning> = at_none.collect();
    let mut warnings = prepared.condensed.warnings.clone();
    warnings.extend(suspicions);
    let others = prepared.power_ons.others();
    warnings.extend((others > 0).then_some(Warning::PowerOns { others }));
    warnings.extend(prepared.dwells.warnings.iter().cloned());
    warnings.extend(prepared.implausible_rate());
    warnings.extend(without_temperature(&prepared));
    warnings.extend(at_none);
    let mut sensors = match (prepared.manifest.reference, &rated) {
        (_, Some(rated)) => fit_rates(&prepared, rated, options, &mut warnings)?,
        (Reference::Table, None) => fit_known(&prepared, options, &mut warnings)?,
        (_, None) => fit_gravity(&prepared, options, &mut warnings)?,
    };
    let mut changes = Vec::new();
    for sensor in &mut sensors {
        plausible::check(&prepared, sensor)?;
        sensor
            .warnings
            .extend(earth::in_intervals(&prepared, sensor));
    }
    for of in &mut sensors {
        let triad = &of.estimated.triad;
        let added = match (of.sensor, prepared.manifest.reference) {
            (Sensor::Accel, Reference::Gravity | Reference::TurntableRate) => {
                reference_error::with_gravity(triad, &prepared)
            }
            (Sensor::Gyro, Reference::Gravity) => reference_error::with_clock(triad, &prepared),
            _ => None,
        };
        if let Some((triad, influence)) = added {
            of.estimated.triad = triad;
            of.influences.push(influence);
        }
    }
    let by_magnitude = |s: &&SensorFit| s.figure == Figure::GravityMagnitude;
    let accel = sensors.iter().find(by_magnitude);
    let accel = accel.map(|s| s.estimated.triad.clone());
    // The gyro is listed first. If gravity is the only reference, it depends on the accelerometer, so this is checked before it.
    for sensor in sensors.iter().rev() {
        determined::check(&prepared, sensor, accel.as_ref())?;
    }
    for sensor in &mut sensors {
        uncalibrated::compare(sensor);
        if let Some(before) = &with_all[sensor.sensor] {
            let raw = prepared.manifest.raw_unit;
            let of_sensor = change::changes(sensor.sensor, raw, before, &sensor.estimated.triad);
            sensor.warnings.extend(change::described(&of_sensor));
            changes.extend(of_sensor);
        }
    }
    Ok(Fit {
        prepared,
        options,
        sensors,
        changes,
        warnings,
    })
}

/// What is wrong with the readings of a recording that the user trusts.
///
/// # Errors
/// The same, if the user does not.
fn suspicions(prepared: &Prepared) -> Result<Vec<Warning>> {
    if prepared.manifest.trusts_readings() {
        let found = prepared.dwells.fault.iter();
        let found = found.chain(&prepared.condensed.signed_low_byte);
        return Ok(found.copied().map(Warning::Health).collect());
    }
    match &prepared.dwells.fault {
        Some(fault) => Err(fault.refusal(&prepared.place)),
        None => plausible::check_readings(prepared).map(|()| Vec::new()),
    }
}

/// Moves what the accelerometer read before the last power-on to the bias of the last, if the poses determine both. The fit finds what remains of the
/// steps, and widens the intervals by what it does not know of them.
fn one_bias(prepared: &mut Prepared) {
    let by_gravity = prepared.manifest.reference == Reference::Gravity;
    if prepared.power_ons.others() == 0 || !by_gravity || !prepared.has(Sensor::Accel) {
        return;
    }
    let g = prepared.manifest.gravity_mps2;
    for _ in 0..BIAS_ROUNDS {
        let poses = prepared.observations(Sensor::Accel);
        let Some(first) = magnitude::first_guess(&poses, g) else {
            return;
        };
        let variances = prepared.magnitude_variances(&first, &poses);
        let steps = magnitude::bias_steps(&poses, &variances, g, &prepared.power_ons);
        let (Ok(steps), Some(to_raw)) = (steps, first.matrix.try_inverse()) else {
            return;
        };
        let raw: Vec<_> = steps.iter().map(|step| to_raw * step).collect();
        let power_ons = prepared.power_ons.clone();
        prepared.move_to_one_bias(Sensor::Accel, &power_ons, &raw);
    }
}

/// How often the steps of biases are found: the scale factors that move the readings err by a few per cent at first.
pub(crate) const BIAS_ROUNDS: usize = 3;

/// Leaves out what `find` finds. Returns the triad fitted with everything, if anything was left out.
fn leave_out(prepared: &mut Prepared, find: impl Fn(&Prepared) -> Outlying) -> Option<Triad> {
    let mut found = find(prepared);
    prepared.leave_out(&found.left_out);
    prepared.dwells.warnings.append(&mut found.warnings);
    found.with_all()
}

/// A bias of 0.1 deg/s per °C is ordinary for these sensors, so five degrees change it by 0.5 deg/s.
const ISOTHERMAL_C: f64 = 5.0;

/// Warns that the model lacks temperature, if that of the dwells differs by more than [`ISOTHERMAL_C`].
fn without_temperature(prepared: &Prepared) -> Option<Warning> {
    let temperatures = || {
        prepared
            .dwells
            .list
            .iter()
            .map(|d| d.temp_c)
            .filter(|t| t.is_finite())
    };
    let [low, high] = extent(temperatures());
    (high - low > ISOTHERMAL_C).then_some(Warning::WithoutTemperature {
        low_c: low,
        high_c: high,
        sensor: None,
    })
}

/// Fewer degrees of freedom than this do not reveal errors of the model.
const FEW_DOF: f64 = 3.0;

fn finish(sensor: Sensor, estimated: Estimated, judged: Judged) -> SensorFit {
    let Judged {
        figure,
        residuals,
        dwells,
        static_rms,
        held_out,
        unseen,
        uncalibrated_rms,
    } = judged;
    let mut warnings = estimated.notes.clone();
    // Means of dwells and sums within dwells determine an axis together.
    let axis = |group: Observable| match group {
        Observable::Within(axis) => Observable::Axis(axis),
        other => other,
    };
    let dof = |group: Observable| {
        let of_axis = estimated.scatter.iter().filter(|s| axis(s.0) == group);
        of_axis.map(|s| s.1.dof).sum::<f64>()
    };
    if estimated.scatter.iter().all(|(_, s)| s.dof < 0.5) {
        warnings.push(Warning::NoResiduals);
    } else if estimated
        .scatter
        .iter()
        .any(|(group, _)| dof(axis(*group)) < FEW_DOF)
    {
        warnings.push(Warning::FewResiduals);
    }
    if estimated.condition > POORLY_DETERMINED {
        warnings.push(Warning::PoorlyDetermined {
            condition: estimated.condition,
        });
    }
    if estimated.triad.inverse.matrix.determinant() < 0.0 {
        warnings.push(Warning::LeftHanded);
    }
    warnings.extend(held_out.reasons.iter().cloned());
    let test = tested(&estimated, figure, &residuals, &unseen);
    let warnings = warnings.into_iter().map(|w| w.of(sensor)).collect();
    SensorFit {
        sensor,
        estimated,
        figure,
        residuals,
        dwells,
        static_rms,
        held_out,
        test,
        uncalibrated_rms,
        influences: Vec::new(),
        warnings,
    }
}

/// Whether a figure describes this group of observations.
fn describes(figure: Figure, group: Observable) -> bool {
    match group {
        Observable::Axis(_) | Observable::Within(_) => figure == Figure::Input,
        Observable::Magnitude => {
            matches!(figure, Figure::GravityMagnitude | Figure::RateMagnitude)
        }
        Observable::Turns | Observable::AfterWholeTurns => figure == Figure::Direction,
        Observable::AtRest(_)
        | Observable::Second(_)
        | Observable::WholeTurns
        | Observable::AsDelivered
        | Observable::Rest
        | Observable::Force => false,
    }
}

/// How the `unseen` errors compare with their prediction; if nothing was held out, how the residuals compare with the noise.
fn tested(
    estimated: &Estimated,
    figure: Figure,
    residuals: &[Residual],
    unseen: &[Unseen],
) -> Option<Test> {
    if residuals.iter().any(|r| r.floor.is_nan()) {
        return None;
    }
    let all = estimated.scatter.iter();
    let groups = all.filter(|(group, _)| describes(figure, *group));
    let sum = |of: fn(&Scatter) -> f64| groups.clone().map(|(_, s)| of(s)).sum::<f64>();
    let rows = (figure.components() * residuals.len()) as f64;
    match unseen.is_empty() {
        false => Test::of(unseen, (sum(|s| s.dof), rows), 0.0),
        true => {
            let all = Scatter {
                chi2: sum(|s| s.chi2),
                ..Scatter::of_noise(sum(|s| s.dof))
            };
            Test::of_scatter(&all, rows)
        }
    }
}

/// Refuses an accelerometer in g: known forces near 1, or readings in SI near 1 at rest.
pub(crate) fn refuse_wrong_gravity(
    prepared: &Prepared,
    sensor: Sensor,
    observations: &[Observation],
) -> Result<()> {
    let g = prepared.manifest.gravity_mps2;
    if sensor == Sensor::Accel && prepared.manifest.reference == Reference::Table {
        // If a force turns, its mean has another magnitude.
        let stand = observations
            .iter()
            .filter(|o| !prepared.dwells.list[o.dwell].moves(sensor));
        let typical = median(stand.map(|o| o.input.norm()).collect()).unwrap_or(g);
        if (0.8..1.2).contains(&typical) {
            let problem =
                format!("the known forces have a magnitude of {typical:.3}, so they are in g");
            return Err(Error::new(
                format!("{}, ref_force_*_mps2", prepared.place),
                problem,
                format!("write them in m/s² (multiply by {g})"),
            ));
        }
    }
    if sensor == Sensor::Accel && prepared.manifest.raw_unit == RawUnit::Si {
        let sizes = observations.iter().map(|o| o.raw.norm());
        let typical = median(sizes.collect()).unwrap_or(g);
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
