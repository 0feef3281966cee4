//! Judging a calibration by another recording.

mod causes;
mod judged;
mod power_ons;
mod search;
mod whole_turns;

pub use causes::{Causes, Share};
pub use power_ons::BiasMoved;
pub use search::TriadErrors;
pub use whole_turns::WholeTurnsOfAxis;

use std::borrow::Cow;

use mimu_core::compensation::Affine;
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

use self::power_ons::{Taken, with_one_bias};
use crate::calibration::Calibration;
use crate::calibration::die_temperature::{at_one_temperature, outside};
use crate::effects::removal::{removable, remove_within};
use crate::fit::lever_arm::without_arm;
use crate::fit::refuse_wrong_gravity;
use crate::fit::uncalibrated::exceeds;
use crate::judgement::Judgement;
use crate::judging::{Judging, Models};
use crate::prepared::Prepared;
use crate::quantity::Figure;
use crate::quantity::{PerSensor, Sensor, present};
use crate::signal::unit_in_si::restless;
use crate::triad::Forward;
use crate::turntable::RatedDwells;
use crate::unseen::Test;
use crate::warning::Warning;
use mimu_recording::error::Argument;
use mimu_recording::{Error, Manifest, Reference, Result};

/// Errors of one triad of a recording with and without a calibration. Figures as in [`Figure`].
#[derive(Debug, Clone, Serialize)]
pub struct SensorVerification {
    /// With the mean of the calibration's scale factors and of its biases on all three axes and no misalignment, in [`Self::unit`]: fitted means
    /// replace those of a data sheet.
    pub rms_raw: f64,
    /// The readings without a calibration, in [`Self::unit`]; absent if they are not in SI.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_uncalibrated: Option<f64>,
    /// With the calibration, in [`Self::unit`].
    pub rms: f64,
    /// With the calibration except its effects, in [`Self::unit`]; absent if it has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_affine: Option<f64>,
    /// The largest error with the calibration, in [`Self::unit`].
    pub max: f64,
    /// By noise alone, in [`Self::unit`]; null if the noise is not known.
    pub noise_floor: f64,
    /// What the uncertainty of the calibration's parameters adds to the noise by its own account, rms in [`Self::unit`]: the largest in 95 % of cases. Absent if it is not
    /// known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parameter_uncertainty: Option<f64>,
    /// What a power-on adds to the noise by the calibration's own account, rms in [`Self::unit`]: the largest in 95 % of cases. Absent for a calibration of one
    /// session, which does not show how much parameters change.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub next_power_on: Option<f64>,
    /// How the errors compare with the noise and with what the calibration's parameters are known to err by; null if the noise is not known.
    pub test: Option<Test>,
    /// SI unit of the figures.
    pub unit: &'static str,
    /// The quantity that they describe.
    pub figure: Figure,
    /// Dwells or turns judged.
    pub count: usize,
    /// Compensated gyro at rest without a table, rad/s; absent with one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub static_rms: Option<f64>,
    /// What explains the mean square of the errors; absent if the recording does not distinguish the causes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub causes: Option<Causes>,
    /// The biases of other power-ons within the recording, which are in this figure alone; absent without any.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub bias_moved: Vec<BiasMoved>,
}

/// Result of verifying a calibration by a recording: `mimu-verify/1`.
#[derive(Debug, Clone, Serialize)]
pub struct Verification {
    /// `mimu-verify/1`.
    pub format: &'static str,
    /// The judgement.
    pub judgement: Judgement,
    /// Whether it is the recording that the calibration was made from.
    #[serde(skip)]
    pub same_recording: bool,
    /// The triads, as far as both the calibration and the recording have them.
    #[serde(serialize_with = "present")]
    pub sensors: PerSensor<Option<SensorVerification>>,
    /// What the gyro reads for whole turns about each axis; absent without any.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub whole_turns: Vec<WholeTurnsOfAxis>,
    /// What a person should know.
    pub warnings: Vec<Warning>,
}

/// Judges `calibration`, raw to SI, by a recording that it was not made from: rms errors in SI and what explains them.
///
/// ```no_run
/// use mimu::{Calibration, DwellSearch, JudgementKind, Prepared, Recording, Sensor, verify};
///
/// let recording = Recording::open("another-day".as_ref())?;
/// let prepared = Prepared::read(&recording, DwellSearch::default(), |_| ())?;
/// let found = verify(&prepared, &Calibration::read("cal.toml".as_ref())?)?;
/// if let Some(accel) = &found.sensors[Sensor::Accel] {
///     println!("{} m/s² where noise explains {}", accel.rms, accel.noise_floor);
/// }
/// assert_eq!(found.judgement.kind, JudgementKind::Good, "{}", found.judgement);
/// # Ok::<(), mimu::Error>(())
/// ```
///
/// # Errors
/// A recording of another unit, or in another unit of readings; means of poses with a calibration that has effects; no usable dwell.
pub fn verify(prepared: &Prepared, calibration: &Calibration) -> Result<Verification> {
    verify_since(prepared, calibration, PowerOn::Another)
}

/// Whether a recording that judges a calibration was made after another power-on than the calibration. Where it names restarts, each power-on has its own
/// biases, which are taken off and reported ([`SensorVerification::bias_moved`]).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PowerOn {
    /// The unit was switched off in between, which changes its biases. Those of the last power-on are judged.
    Another,
    /// It was not, before the first restart that the recording names: its biases wander by their noise alone.
    Same,
}

/// As [`verify`], if it is known whether the unit was switched off in between.
///
/// # Errors
/// As [`verify`].
pub fn verify_since(
    prepared: &Prepared,
    calibration: &Calibration,
    power_on: PowerOn,
) -> Result<Verification> {
    let same_recording = calibration.recording.sha256.as_ref() == Some(&prepared.condensed.sha256);
    let mut warnings = warnings_before(prepared, calibration, same_recording)?;
    refuse_effects_of_means(prepared, calibration)?;
    let readings = Readings::of(prepared, calibration, power_on, &mut warnings)?;
    let mut sensors = PerSensor::<Option<SensorVerification>>::default();
    for sensor in Sensor::BOTH {
        if calibration.inverse(sensor).is_some() && readings.as_read.has(sensor) {
            sensors[sensor] = readings.verify(calibration, sensor, power_on, &mut warnings)?;
        }
    }
    if sensors.present().next().is_none() {
        return Err(nothing_to_judge(&readings.as_read, calibration));
    }
    let (whole_turns, of_turns) = whole_turns::verify(&readings.as_read, calibration);
    warnings.extend(of_turns);
    for (sensor, found) in sensors.present() {
        let moved = found.bias_moved.iter();
        warnings.extend(moved.map(|of| Warning::BiasMoved {
            sensor,
            t_s: of.t_s,
            moved: of.moved,
            half_width: of.half_width,
        }));
    }
    let at_rest = sensors.present().filter_map(|(_, s)| s.static_rms);
    warnings.extend(at_rest.filter_map(restless));
    let worse = sensors.present();
    warnings.extend(worse.filter_map(|(sensor, s)| Some(worse_than_without(s)?.of(sensor))));
    let all: Vec<(Sensor, &SensorVerification)> = sensors.present().collect();
    Ok(Verification {
        format: "mimu-verify/1",
        judgement: judged::judgement(&readings.as_read, calibration, &all, &warnings),
        same_recording,
        sensors,
        whole_turns,
        warnings,
    })
}

/// Warnings about the recording, and about how the calibration fits it.
fn warnings_before(
    prepared: &Prepared,
    calibration: &Calibration,
    same_recording: bool,
) -> Result<Vec<Warning>> {
    let mut warnings = prepared.condensed.warnings.clone();
    warnings.extend(prepared.dwells.warnings.iter().cloned());
    warnings.extend(prepared.implausible_rate());
    let unit = check_unit(calibration, &prepared.manifest, &prepared.place)?;
    warnings.extend(unit);
    if same_recording {
        warnings.push(Warning::SameRecording);
    }
    warnings.extend(outside(calibration, &prepared.condensed.blocks));
    warnings.extend(judged::other_gravity(calibration, prepared));
    Ok(warnings)
}

fn refuse_effects_of_means(prepared: &Prepared, calibration: &Calibration) -> Result<()> {
    if prepared.manifest.means && !calibration.effects().is_empty() {
        return Err(Error::new(
            &prepared.place,
            "the calibration has effects, and means of poses do not show how these change the samples",
            "verify it with a recording of samples",
        ));
    }
    Ok(())
}

/// The readings that a calibration is judged by. If it has curves over temperature, they are those at one temperature, as far as the recording has
/// temperatures.
struct Readings<'a> {
    /// With the effects of the calibration. Of a turntable, the dwells that it turns in are excluded for the accelerometer.
    as_read: Cow<'a, Prepared>,
    /// Without the effects, if it has any.
    without_effects: Option<Prepared>,
    /// What the biases of other power-ons took.
    taken: PerSensor<Taken>,
}

impl<'a> Readings<'a> {
    fn of(
        prepared: &'a Prepared,
        calibration: &Calibration,
        power_on: PowerOn,
        warnings: &mut Vec<Warning>,
    ) -> Result<Self> {
        let mut taken = PerSensor::default();
        let cleaned = without_effects(prepared, calibration)?;
        let curves = calibration.curves();
        let at_one = |p: &Prepared| at_one_temperature(p, calibration, curves.as_ref()?);
        let mut cleaned = cleaned.map(|cleaned| at_one(&cleaned).unwrap_or(cleaned));
        let moved = at_one(prepared);
        if curves.is_some() && moved.is_none() {
            warnings.push(Warning::NoTemperature);
        }
        let mut as_read = moved.map_or(Cow::Borrowed(prepared), Cow::Owned);
        match prepared.manifest.reference {
            Reference::TurntableRate => {
                let dwells = RatedDwells::of(&as_read)?;
                warnings.extend(dwells.exclude_dwells(as_read.to_mut()));
            }
            Reference::Table => {
                // The unit is at another place of the table than when it was calibrated.
                let model = calibration.inverse(Sensor::Accel);
                let clean = |p: &Prepared| without_arm(p, model.as_ref()?);
                let found = clean(&as_read);
                let of_effects = cleaned.as_ref().and_then(clean);
                if let Some((other, place)) = found {
                    as_read = Cow::Owned(other);
                    let place = of_effects
                        .as_ref()
                        .map_or(place, |(_, place)| place.clone());
                    warnings.push(place.of(Sensor::Accel));
                }
                cleaned = of_effects.map(|(other, _)| other).or(cleaned);
            }
            Reference::Gravity => {
                let with_one_bias = |p: &Prepared| with_one_bias(p, calibration, power_on);
                if let Some((moved, of_moved)) = with_one_bias(&as_read) {
                    (as_read, taken) = (Cow::Owned(moved), of_moved);
                }
                if let Some((moved, of_moved)) = cleaned.as_ref().and_then(with_one_bias) {
                    (cleaned, taken) = (Some(moved), of_moved);
                }
            }
        }
        Ok(Self {
            as_read,
            without_effects: cleaned,
            taken,
        })
    }

    /// The figures of `sensor`; `None`, with a warning, if nothing judges it.
    fn verify(
        &self,
        calibration: &Calibration,
        sensor: Sensor,
        power_on: PowerOn,
        warnings: &mut Vec<Warning>,
    ) -> Result<Option<SensorVerification>> {
        let observations = self.as_read.observations(sensor);
        if !observations.is_empty() {
            refuse_wrong_gravity(&self.as_read, sensor, &observations)?;
        }
        let taken = &self.taken[sensor];
        let judge = |p: &Prepared| judge(p, calibration, sensor, (power_on, taken));
        let affine = judge(&self.as_read);
        let cleaned = self.without_effects.as_ref();
        let with_effects = cleaned.and_then(judge);
        let (judged, refused) = match (affine, with_effects) {
            // Without a calibration, the readings count as the unit gave them.
            (Some((affine, _)), Some((clean, refused))) => {
                let judged = SensorVerification {
                    rms_raw: affine.rms_raw,
                    rms_uncalibrated: affine.rms_uncalibrated,
                    rms_affine: Some(affine.rms),
                    ..clean
                };
                (judged, refused)
            }
            (Some(affine), None) if cleaned.is_none() => affine,
            _ => {
                warnings.push(Warning::NothingToJudge.of(sensor));
                return Ok(None);
            }
        };
        warnings.extend(refused);
        Ok(Some(judged))
    }
}

fn nothing_to_judge(prepared: &Prepared, calibration: &Calibration) -> Error {
    if prepared.manifest.reference == Reference::Gravity
        && calibration.inverse(Sensor::Accel).is_none()
        && prepared.has(Sensor::Accel)
    {
        let problem = "the turns of the gyro are judged by the directions of gravity, and the calibration has no accelerometer";
        let remedy = "give the calibration of the accelerometer too";
        return Error::new(&prepared.place, problem, remedy).about(Argument::Calibration);
    }
    let unused = Sensor::BOTH.map(|s| prepared.dwells.unused(s));
    let reason = unused.iter().find(|u| !u.is_empty());
    let error = Error::new(
        &prepared.place,
        format!(
            "the recording has no data that this calibration could be judged by{}",
            reason.map_or("", String::as_str)
        ),
        "record dwells with a known input, or poses and turns by hand",
    );
    let mut judged = Sensor::BOTH.into_iter();
    let judged = judged.find(|s| prepared.dwells.are_judged_not_still(*s));
    match judged {
        Some(sensor) => prepared.with_steps_as_given(error, sensor),
        None => error,
    }
}

/// The warning if the errors are not smaller than without a calibration.
fn worse_than_without(s: &SensorVerification) -> Option<Warning> {
    let other = s.rms_uncalibrated.unwrap_or(s.rms_raw);
    if !(s.rms > other) {
        return None;
    }
    let readings_in_si = s.rms_uncalibrated.is_some();
    Some(match exceeds(s.rms, other, s.figure, s.count) {
        true => Warning::Worse { readings_in_si },
        false => Warning::Undecided {
            errors: s.count as u64,
            turns: s.figure == Figure::Direction,
            readings_in_si,
        },
    })
}

/// Refuses a calibration for another raw unit; returns a warning about one of another device, or of an unnamed one. `place` is the recording.
pub(crate) fn check_unit(
    calibration: &Calibration,
    manifest: &Manifest,
    place: &str,
) -> Result<Option<Warning>> {
    if calibration.recording.raw_unit != manifest.raw_unit {
        let problem = format!(
            "its raw unit is {}, but the calibration is for {}",
            manifest.raw_unit, calibration.recording.raw_unit
        );
        return Err(Error::new(
            place,
            problem,
            "import it in the other unit, or use the calibration of this unit",
        ));
    }
    if let Some(problem) = calibration.other_setting(manifest.sensors()) {
        let remedy = "use the calibration of this range and filter, or record again with those of the calibration";
        return Err(Error::new(place, problem, remedy));
    }
    let other = calibration.other_unit(manifest);
    Ok(other.or_else(|| calibration.unnamed_unit(manifest)))
}

/// The recording without the effects of the calibration, if it has any.
fn without_effects(prepared: &Prepared, calibration: &Calibration) -> Result<Option<Prepared>> {
    let effects = calibration.effects();
    if effects.is_empty() {
        return Ok(None);
    }
    removable(prepared, effects)?;
    let [gyro, accel] = Sensor::BOTH.map(|s| calibration.inverse(s));
    let limits_c = calibration.limits();
    let cleaned = remove_within(prepared, gyro.as_ref(), accel.as_ref(), effects, limits_c);
    let singular = || {
        let place = format!("calibration of {:?}", calibration.device);
        Error::new(place, "C is singular", "fit the recording again")
    };
    cleaned.map(Some).ok_or_else(singular)
}

/// The figures of one sensor, and warnings about what could not be used; `None` if the recording has no data to judge it.
fn judge(
    prepared: &Prepared,
    calibration: &Calibration,
    sensor: Sensor,
    (power_on, taken): (PowerOn, &Taken),
) -> Option<(SensorVerification, Vec<Warning>)> {
    let (judging, models) = judging(prepared, calibration, sensor)?;
    let judged = figures(prepared, &judging, &models)?;
    let causes = causes::of(prepared, &judging, calibration);
    let announced = |of| causes::announced(prepared, &judging, calibration, of);
    let judged = SensorVerification {
        test: judged::test(
            prepared,
            &judging,
            calibration,
            (power_on, taken.dof, causes.as_ref()),
        ),
        causes,
        bias_moved: taken.moved.clone(),
        parameter_uncertainty: announced(&|s| calibration.uncertainty(s)),
        next_power_on: announced(&|s| calibration.next_power_on(s)),
        ..judged
    };
    Some((judged, judging.refused))
}

/// What judges `sensor`, and the models that its errors are by.
fn judging<'a>(
    prepared: &'a Prepared,
    calibration: &Calibration,
    sensor: Sensor,
) -> Option<(Judging<'a>, Models)> {
    let mut models = PerSensor::from_fn(|s| calibration.inverse(s));
    models[sensor]?;
    // Whole turns judge a gyro by the accelerometer's readings as delivered, too.
    let delivered = || prepared.whole_turns().map(|_| Affine::identity());
    models.accel = models.accel.or_else(delivered);
    Some((Judging::of(prepared, sensor, &models)?, models))
}

/// The calibration of a unit whose sensors are all alike and perfectly mounted: every sensor with the mean scale factor
/// and the mean bias of the three, along the axis that it is nearest to.
///
/// `None` if the calibration is singular.
pub fn nominal(calibrated: &Affine<f64>) -> Option<Affine<f64>> {
    let Forward { matrix: p, bias } = Forward::of(calibrated)?;
    let scale = (0..3).map(|i| p.row(i).norm()).sum::<f64>() / 3.0;
    let bias = bias.sum() / 3.0;
    let mut forward = Matrix3::zeros();
    for i in 0..3 {
        let axis = p.row(i).transpose().iamax();
        forward[(i, axis)] = scale * p[(i, axis)].signum();
    }
    // If two sensors are nearest to one axis, each keeps its own axis.
    let matrix = forward
        .try_inverse()
        .unwrap_or_else(|| Matrix3::from_diagonal_element(1.0 / scale));
    Some(Affine {
        matrix,
        offset: -(matrix * Vector3::repeat(bias)),
    })
}

/// The figures of the errors by `models` and without them.
fn figures(prepared: &Prepared, judging: &Judging, models: &Models) -> Option<SensorVerification> {
    let (sensor, figure) = (judging.sensor, judging.figure);
    let errors = judging.errors(models)?;
    let rms = |models: &Models| Some(judging.rms(&judging.errors(models)?));
    let nominal = models.map(|model| nominal(&model?));
    let one = PerSensor::both(Some(Affine::identity()));
    let largest = errors.iter().map(|error| match figure {
        Figure::Input => error.amax(),
        _ => error.norm(),
    });
    let floors = judging.floors(models)?;
    let squares: f64 = floors.iter().map(|floor| floor * floor).sum();
    Some(SensorVerification {
        unit: figure.unit(sensor),
        figure,
        rms_raw: rms(&nominal)?,
        rms_uncalibrated: prepared.is_in_si().then(|| rms(&one)).flatten(),
        rms_affine: None,
        rms: judging.rms(&errors),
        max: largest.fold(0.0, f64::max),
        noise_floor: (squares / floors.len() as f64).sqrt(),
        parameter_uncertainty: None,
        next_power_on: None,
        test: None,
        static_rms: models.gyro.and_then(|gyro| judging.at_rest(&gyro)),
        causes: None,
        bias_moved: Vec::new(),
        count: errors.len(),
    })
}
