//! Judges whether a calibration is as accurate as predicted, by dwells that were not used for it.

use mimu::calibration::verify::{PowerOn, SensorVerification, WholeTurnsOfAxis, verify_since};
use mimu::signal::stillness::STILL_FACTOR;
use mimu::{Calibration, Dwell, Figure, Fit, Judgement, JudgementKind, Prepared, Sensor, Warning};
use mimu_body::{Body, TriadVerification};
use mimu_recording::{Recording, Result, TriadName};
use serde::Serialize;
use std::path::Path;

/// Errors up to this many noise floors count as noise.
pub const CLEAN: f64 = 1.3;
/// Largest ratio of the error to the prediction (held-out error and noise). With six or more dwells, more is no accident.
const BROKEN: f64 = 2.0;

/// If the error that is predicted exceeds the noise by this factor, most of it is what the poses leave open.
const OPEN: f64 = std::f64::consts::SQRT_2;

/// An error of more than this many predicted standard deviations, and more than this fraction of the data sheet's error, is too large for a good calibration. The
/// held-out error does not reveal it, because it is as large.
const ROUGH: (f64, f64) = (5.0, 0.05);

/// Figures of one sensor.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SensorJudged {
    /// The sensor.
    pub sensor: Sensor,
    /// The error that the figures give.
    pub figure: Figure,
    /// Unit of all figures.
    pub unit: &'static str,
    /// Error with the data sheet's model: one scale factor and one bias for all axes.
    pub before: f64,
    /// Error with the affine part of the calibration.
    pub affine: f64,
    /// Error with the calibration.
    pub after: f64,
    /// Error from noise alone.
    pub floor: f64,
    /// Predicted error: held out of the fit of the calibration.
    pub promised: Option<f64>,
    /// Error that the noise and the known uncertainty of the parameters predict: with a prior, few poses leave much open.
    pub predicted: f64,
    /// The error in predicted standard deviations, as it is judged.
    pub ratio: f64,
    /// Number of dwells or turns.
    pub count: usize,
}

impl SensorJudged {
    fn of(sensor: Sensor, found: &SensorVerification, promised: Option<f64>) -> Self {
        Self {
            sensor,
            figure: found.figure,
            unit: found.unit,
            before: found.rms_raw,
            affine: found.rms_affine.unwrap_or(found.rms),
            after: found.rms,
            floor: found.noise_floor,
            promised,
            // The test counts both angles of a turn by themselves, and the figure is the angle between two directions.
            predicted: found.test.map_or(found.noise_floor, |test| {
                found.noise_floor * test.predicted / test.noise
            }),
            ratio: found
                .test
                .map_or(found.rms / found.noise_floor, |test| test.ratio),
            count: found.count,
        }
    }

    /// Why it must not be stored, if so.
    pub fn broken(&self) -> Option<String> {
        let promised = self.promised.unwrap_or(0.0).hypot(self.floor);
        let promised = promised.max(self.predicted);
        // What few poses leave open is as in the data sheet's model, so that either may happen to err less.
        let is_open = self.predicted > OPEN * self.floor && self.after <= BROKEN * self.predicted;
        if !(self.after < self.before || is_open) {
            return Some(format!(
                "{}: the error of the {} is {} {} with the calibration and {} without",
                self.sensor,
                self.figure.description(),
                mimu::quantity::significant(self.after),
                self.unit,
                mimu::quantity::significant(self.before)
            ));
        }
        (self.after > BROKEN * promised).then(|| {
            format!(
                "{}: the error of the {} is {} {} in poses that the fit has not used; {} were predicted",
                self.sensor,
                self.figure.description(),
                mimu::quantity::significant(self.after),
                self.unit,
                mimu::quantity::significant(promised)
            )
        })
    }
}

impl SensorJudged {
    /// Why the user has to agree before it is stored: an error that the model lacks.
    fn rough(&self) -> Option<String> {
        let rough = self.ratio > ROUGH.0 && self.after > ROUGH.1 * self.before;
        rough.then(|| {
            let shown = |si: f64| mimu::quantity::significant(si);
            format!(
                "{}: the error of the {} is {} {} in poses that the fit has not used, {:.1} times what noise predicts; with the data sheet's values it is {}",
                self.sensor,
                self.figure.description(),
                shown(self.after),
                self.unit,
                self.ratio,
                shown(self.before)
            )
        })
    }
}

/// Why the user has to agree before a calibration that reads whole turns so is stored.
fn rough_turns(turned: &WholeTurnsOfAxis) -> Option<String> {
    let (error, half) = (turned.error_deg_per_turn, turned.half_width_deg_per_turn);
    (error.abs() > ROUGH.0 * half).then(|| {
        format!(
            "gyro: 360 deg about {} are read as {:.2} deg, where the unit was put back to {:.2}",
            turned.axis,
            360.0 + error,
            half
        )
    })
}

/// A further triad of the board, such as a magnetometer. Gyro and accelerometer are stored whatever it is.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FurtherJudged {
    /// The triad.
    pub triad: TriadName,
    /// The worse one of its judgements by the fit and by the verification.
    pub judgement: Judgement,
    /// Whether the calibration file has it.
    pub in_file: bool,
    /// Dwells of the calibration that are left out, because the others contradict them.
    pub left_out_dwells: Vec<i32>,
    /// Its errors in the verification.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub verified: Option<TriadVerification>,
}

/// Judges the further triads of a calibration by the verification recording `by`, and takes those that must not be stored out of it. `dwells` are those of the
/// fit.
pub fn judge_further(
    body: &Body,
    dwells: &[Dwell],
    calibration: &mut Calibration,
    by: &Recording,
) -> Result<Vec<FurtherJudged>> {
    let mut found = mimu_body::verify(by, calibration)?;
    let made: Vec<TriadName> = calibration.body.iter().map(|t| t.triad).collect();
    let fitted = body.triads.iter();
    let fitted = fitted.map(|t| (t.name, &t.judgement, t.left_out.as_slice()));
    let refused = body.refused.iter().map(|(name, why)| (*name, why, &[][..]));
    let judged = fitted.chain(refused).map(|(triad, judgement, spans)| {
        let verified = found.remove(&triad.to_string());
        let again = verified.iter().map(|v| &v.judgement);
        let worst = again.fold(judgement, |a, b| if b.kind > a.kind { b } else { a });
        let is_out = |d: &&Dwell| spans.iter().any(|[a, b]| d.start_s < *b && d.last_s > *a);
        FurtherJudged {
            triad,
            judgement: worst.clone(),
            in_file: made.contains(&triad) && worst.needs_consent().is_none(),
            left_out_dwells: dwells.iter().filter(is_out).map(|d| d.step).collect(),
            verified,
        }
    });
    let judged: Vec<FurtherJudged> = judged.collect();
    calibration.body.retain_mut(|own| {
        let of = judged.iter().find(|of| of.triad == own.triad);
        own.judgement = of.map(|of| of.judgement.clone());
        of.is_some_and(|of| of.in_file)
    });
    Ok(judged)
}

/// Figures of a calibration from the verification.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Judged {
    /// The judgement of the calibration: of its fit and of its errors here.
    pub judgement: Judgement,
    /// Figures of each sensor.
    pub sensors: Vec<SensorJudged>,
    /// What the gyro reads for whole turns that the fit has not used.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub whole_turns: Vec<WholeTurnsOfAxis>,
    /// Further triads of the board.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub further: Vec<FurtherJudged>,
    /// Why it must not be stored.
    pub broken: Vec<String>,
    /// Warnings for the user.
    pub warnings: Vec<Warning>,
}

impl Judged {
    /// Whether it may be stored.
    pub fn passed(&self) -> bool {
        self.broken.is_empty() && !self.sensors.is_empty()
    }

    /// Why the user has to agree before it is stored, if so.
    pub fn rough(&self) -> Option<String> {
        let of_sensors = self.sensors.iter().filter_map(SensorJudged::rough);
        let of_turns = self.whole_turns.iter().filter_map(rough_turns);
        let rough = of_sensors.chain(of_turns);
        let mut rough: Vec<String> = rough.collect();
        if rough.is_empty() {
            rough.extend(self.judgement.needs_consent());
        }
        (!rough.is_empty()).then(|| rough.join(", "))
    }

    /// Whether no sensor is worse than in `other`, and at least one is better.
    pub fn beats(&self, other: &Self) -> bool {
        let both = || self.sensors.iter().zip(&other.sensors);
        both().all(|(a, b)| a.sensor == b.sensor && a.after <= b.after)
            && both().any(|(a, b)| a.after < b.after)
    }

    /// Whether noise explains the remaining error.
    pub fn clean(&self) -> bool {
        self.sensors.iter().all(|s| s.after <= CLEAN * s.floor)
    }
}

/// Reads and prepares the recording in a directory.
pub fn prepared(directory: &Path) -> Result<Prepared> {
    Prepared::read(&Recording::open(directory)?, STILL_FACTOR, |_| {})
}

/// Judges a calibration by the verification recording; `promised` is the fit that gave it.
pub fn judge(by: &Prepared, calibration: &Calibration, promised: Option<&Fit>) -> Result<Judged> {
    // The recording names every restart since the calibration.
    let found = verify_since(by, calibration, PowerOn::Same)?;
    let of = |(sensor, s): (Sensor, &SensorVerification)| {
        let fitted = promised.and_then(|f| f.sensor(sensor));
        SensorJudged::of(sensor, s, fitted.and_then(|f| f.held_out_rms()))
    };
    let sensors: Vec<SensorJudged> = found.sensors.present().map(of).collect();
    let mut broken: Vec<String> = sensors.iter().filter_map(SensorJudged::broken).collect();
    for sensor in Sensor::BOTH {
        let judged = sensors.iter().any(|s| s.sensor == sensor);
        if calibration.inverse(sensor).is_some() && !judged {
            broken.push(format!(
                "{sensor}: the verification has no data to judge it"
            ));
        }
    }
    Ok(Judged {
        judgement: judgement(calibration.judgement.clone(), found.judgement, &broken),
        sensors,
        whole_turns: found.whole_turns,
        further: Vec::new(),
        broken,
        warnings: found.warnings,
    })
}

/// The judgement of a calibration whose fit and verification are judged so; `broken`: why it must not be stored. If the data of the fit could not
/// contradict it, the verification has.
fn judgement(fitted: Option<Judgement>, verified: Judgement, broken: &[String]) -> Judgement {
    let broken = broken
        .first()
        .map(|why| Judgement::new(JudgementKind::Misfit, why));
    let fitted = fitted.filter(|fitted| fitted.kind != JudgementKind::Untested);
    let others = broken.into_iter().chain(fitted);
    others.fold(
        verified,
        |worst, next| if next.kind > worst.kind { next } else { worst },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judged(gyro: f64, accel: f64, promised: f64) -> Judged {
        let of = |sensor, after, floor, before| SensorJudged {
            sensor,
            figure: Figure::Input,
            unit: "SI",
            before,
            affine: after,
            after,
            floor,
            promised: Some(promised),
            predicted: floor,
            ratio: after / floor,
            count: 6,
        };
        let sensors = vec![
            of(Sensor::Gyro, gyro, 1e-4, 2e-2),
            of(Sensor::Accel, accel, 6e-3, 0.6),
        ];
        Judged {
            judgement: Judgement::new(JudgementKind::Good, "a test"),
            broken: sensors.iter().filter_map(SensorJudged::broken).collect(),
            sensors,
            whole_turns: Vec::new(),
            further: Vec::new(),
            warnings: Vec::new(),
        }
    }

    #[test]
    fn a_promise_as_large_as_the_error_does_not_make_a_calibration_good() {
        // 17 mg, 28 times the noise; the held-out error is the same.
        let cubic = judged(1.2e-4, 0.167, 0.167);
        assert!(cubic.passed() && cubic.rough().is_some_and(|why| why.starts_with("accel")));
        assert_eq!(judged(1.2e-4, 8e-3, 7e-3).rough(), None);
    }

    #[test]
    fn a_verification_supersedes_that_a_fit_is_untested_and_nothing_supersedes_a_broken_calibration()
     {
        use JudgementKind::{Good, Misfit, Suspect, Unexplained, Untested};
        let of = |fitted, verified, broken: &[String]| {
            let judged = |kind| Judgement::new(kind, kind);
            judgement(Some(judged(fitted)), judged(verified), broken).kind
        };
        assert_eq!(of(Untested, Good, &[]), Good);
        assert_eq!(of(Good, Untested, &[]), Untested);
        assert_eq!(of(Suspect, Good, &[]), Suspect);
        assert_eq!(of(Suspect, Unexplained, &[]), Unexplained);
        assert_eq!(of(Good, Good, &["worse than before".into()]), Misfit);
    }

    #[test]
    fn effects_may_not_make_one_sensor_better_and_the_other_worse() {
        let without = judged(5e-4, 8e-3, 7e-3);
        assert!(judged(1.2e-4, 8e-3, 7e-3).beats(&without));
        assert!(!judged(1.2e-4, 8.1e-3, 7e-3).beats(&without));
        assert!(!judged(5e-4, 8e-3, 7e-3).beats(&without));
    }
}
