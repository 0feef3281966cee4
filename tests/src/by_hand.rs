//! Units recorded by hand, of three grades, with effects that are not declared to the diagnosis.
//!
//! The bench makes the truth. The judgement covers the output for the user: which effects, which verdict, and whether the intervals contain the
//! truth.

use mimu::diagnose::diagnose;
use mimu::fit::{Fit, Options, fit};
use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use mimu::triad::Triad;
use mimu_rig::flaws::FlawsTruth;
use mimu_rig::random::Random;
use mimu_rig::rig_file::{AffineFile, Parts, RigFile};
use nalgebra::SVector;

use crate::bench;
use crate::blind::{reported, with_effects};
use crate::study::Said;

/// Effects that a few minutes by hand can show: hands have no steady rate, and the temperature does not go up and down.
#[rustfmt::skip]
pub const SHOWN: [&str; 10] = [
    "gyro_g_sensitivity", "gyro_scale_quadratic", "gyro_scale_cubic", "gyro_scale_asymmetry", "gyro_bias_drift", "gyro_warm_up",
    "accel_scale_quadratic", "accel_scale_cubic", "accel_bias_drift", "accel_warm_up",
];

/// Grade of the sensors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Grade {
    /// ADXRS300 and MMA7260QT: 0.07 deg/s/√Hz.
    Analog,
    /// MPU-6050: 0.0035 deg/s/√Hz.
    Consumer,
    /// The class of a STIM300: 0.0025 deg/s/√Hz (0.15 deg/√h), 0.5 deg/h; 100 µg/√Hz, 50 µg.
    ///
    /// A gyro five times quieter would be limited by its 100 samples per second: the hand's motion between them is worth 5 arc seconds a turn.
    Tactical,
}

impl Grade {
    /// All.
    pub const ALL: [Self; 3] = [Self::Analog, Self::Consumer, Self::Tactical];
}

/// One unit of the suite.
#[derive(Debug, Clone)]
pub struct Case {
    /// Effects that it has.
    pub truth: Vec<&'static str>,
    /// Grade of its sensors.
    pub grade: Grade,
    /// Whether the recording has the flaws of a real one.
    pub flawed: bool,
    /// Rms that the weakest effect leaves after the affine fit, over the noise.
    pub strength: f64,
    /// What the diagnosis says.
    pub said: Said,
    /// Number of parameters of C and o inside their intervals, and number of all, of gyro and accelerometer.
    pub inside: [[u32; 2]; 2],
}

impl Case {
    /// Whether `found` contains an effect of the unit, also as one that the recording does not distinguish.
    pub fn is_right(&self, found: &[String]) -> bool {
        self.truth.iter().any(|t| found.iter().any(|f| f == t))
    }

    /// Whether exactly the effects of the unit are named.
    pub fn is_named_alone(&self) -> bool {
        self.said.found.len() == self.truth.len()
            && self.said.found.iter().all(|f| self.is_right(f))
    }

    /// Whether the verdict is correct for the effects of the unit.
    pub fn has_right_verdict(&self) -> bool {
        let right = if self.truth.is_empty() {
            "clean"
        } else {
            "explained"
        };
        self.said.verdict == right
    }
}

fn counts(model: AffineFile, per_volt: f64) -> AffineFile {
    AffineFile {
        matrix: model.matrix.map(|row| row.map(|p| p * per_volt)),
        bias: model.bias.map(|b| b * 100.0),
    }
}

/// A unit of `grade` with the effects `ids`, sizes drawn over a decade around the data-sheet size; its affine models are given.
pub fn unit(ids: &[&'static str], grade: Grade, seed: u64) -> RigFile {
    let mut random = Random::new(seed, "unit");
    let (gyro, accel) = (bench::gyro(&mut random), bench::accel(&mut random));
    let mut file = match grade {
        Grade::Analog => bench::clean(gyro, accel),
        // 65.5 counts per deg/s for 5 mV, and 16384 per g for 80 mV per m/s².
        _ => bench::clean(counts(gyro, 13_100.0), counts(accel, 20_900.0)),
    };
    if grade != Grade::Analog {
        file.unit.gyro = Some(Parts::One("MPU6050-gyro".into()));
        file.unit.accel = Some(Parts::One("MPU6050-accel".into()));
    }
    if grade == Grade::Tactical {
        file.unit.gyro_axes.white_si = Some([0.0025f64.to_radians(); 3]);
        file.unit.gyro_axes.instability_si = Some([1.4e-4f64.to_radians(); 3]);
        file.unit.gyro_axes.walk_si = Some([5e-6f64.to_radians(); 3]);
        file.unit.accel_axes.white_si = Some([1e-3; 3]);
        file.unit.accel_axes.instability_si = Some([5e-4; 3]);
        file.unit.accel_axes.walk_si = Some([1e-5; 3]);
    }
    with_effects(file, ids, seed)
}

/// One flaw of real recordings; the seed selects which.
pub fn flaw(seed: u64) -> FlawsTruth {
    let none = FlawsTruth::default();
    match seed / 2 % 6 {
        0 => FlawsTruth {
            shake_turns: 1,
            ..none
        },
        1 => FlawsTruth {
            settle_mrad: 5.0,
            ..none
        },
        2 => FlawsTruth {
            turning_rests: 1,
            ..none
        },
        3 => FlawsTruth {
            upset_turns: 1,
            ..none
        },
        4 => FlawsTruth {
            building_mg: 1.0,
            ..none
        },
        _ => FlawsTruth {
            shake_turns: 1,
            settle_mrad: 5.0,
            upset_turns: 1,
            ..none
        },
    }
}

/// 26 to 42 poses in 2 to 4 minutes at 100 Hz.
pub fn plan(seed: u64) -> String {
    let poses = 26 + (Random::new(seed, "poses").uniform() * 17.0) as usize;
    plan_of(poses, 100.0)
}

/// `poses` poses at `rate_hz`.
pub fn plan_of(poses: usize, rate_hz: f64) -> String {
    format!(
        "format = \"mimu-plan/1\"\nsample_rate_hz = {rate_hz:?}\ncarrier = \"hands\"\nlatitude_deg = 48.0\nlead_in_s = 5.0\n\
         [[step]]\nposes = {poses}\ndwell_s = 2.5\n"
    )
}

/// Rms that the affine fit of `with` leaves in excess of that of `without`, over the noise, for the sensor where it is larger.
fn strength(with: &Prepared, without: &Prepared) -> f64 {
    let chi = |prepared: &Prepared, sensor: Sensor| {
        let fit = fit(prepared.clone(), Options::IN_SAMPLE).ok()?;
        let residuals = &fit.sensor(sensor)?.residuals;
        let squares = residuals
            .iter()
            .map(|r| r.value.norm_squared() / (3.0 * r.floor * r.floor));
        Some(squares.sum::<f64>() / residuals.len() as f64)
    };
    let of = |sensor| Some((chi(with, sensor)? - chi(without, sensor)?).max(0.0).sqrt());
    let both = Sensor::BOTH.map(|s| of(s).unwrap_or(f64::NAN));
    both[0].max(both[1])
}

/// Gyro and accelerometer of `fit`, as far as it has them.
pub(crate) fn triads(fit: &Fit) -> [Option<&Triad>; 2] {
    Sensor::BOTH.map(|sensor| Some(&fit.sensor(sensor)?.estimated.triad))
}

/// How many intervals of the forward models of gyro and accelerometer contain the truth, and of how many. Parameters whose truth is NaN are not judged.
/// `own_frame`: the accelerometer defines the frame, as by hand.
pub(crate) fn inside(
    triads: [Option<&Triad>; 2],
    truths: &[SVector<f64, 12>; 2],
    own_frame: bool,
) -> [[u32; 2]; 2] {
    std::array::from_fn(|k| {
        let Some(found) = triads[k] else {
            return [0; 2];
        };
        let free: &[usize] = match own_frame && k == 1 {
            true => &[0, 3, 4, 6, 7, 8, 9, 10, 11],
            false => &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11],
        };
        let estimates = found.forward_estimates();
        let judged = || free.iter().filter(|i| truths[k][**i].is_finite());
        let held = judged().filter(|i| {
            let estimate = &estimates[**i];
            (estimate.value - truths[k][**i]).abs() <= estimate.interval
        });
        [held.count() as u32, judged().count() as u32]
    })
}

/// Records and diagnoses a unit of `grade` with `ids`.
pub fn case(ids: &[&'static str], grade: Grade, seed: u64, flawed: bool) -> Case {
    let mut file = unit(ids, grade, seed);
    if flawed {
        file.flaws = flaw(seed);
    }
    case_of(&file, ids, &plan(seed), grade, seed, flawed)
}

/// Records the unit `file` with the effects `ids` and diagnoses it.
pub(crate) fn case_of(
    file: &RigFile,
    ids: &[&'static str],
    plan: &str,
    grade: Grade,
    seed: u64,
    flawed: bool,
) -> Case {
    let with = bench::recorded(plan, file, seed);
    let strengths = (0..ids.len()).map(|k| {
        let mut less = file.clone();
        less.effect.remove(k);
        strength(&with, &bench::recorded(plan, &less, seed))
    });
    let strength = strengths.fold(f64::INFINITY, f64::min);
    let wander = bench::wander(plan, file, seed);
    // The true value of a drifting bias is its value in the middle of the dwells.
    let mut drift = [[0.0; 3]; 2];
    for k in (0..ids.len()).filter(|k| ids[*k].ends_with("_bias_drift")) {
        let mut less = file.clone();
        less.effect.remove(k);
        let drifted = bench::drifted(plan, [file, &less], seed, with.middle_s());
        for (sum, d) in drift.iter_mut().flatten().zip(drifted.iter().flatten()) {
            *sum += d;
        }
    }
    let models = [&file.unit.gyro_affine, &file.unit.accel_affine];
    let mut truths: [SVector<f64, 12>; 2] = std::array::from_fn(|k| {
        let mut truth = bench::parameters(models[k].as_ref().expect("stated"));
        for i in 0..3 {
            truth[9 + i] += wander[k][i] + drift[k][i];
        }
        truth
    });
    let diagnosis = diagnose(with.into(), Options::IN_SAMPLE).map(reported);
    let mut case = Case {
        truth: ids.to_vec(),
        grade,
        flawed,
        strength,
        said: Said::of(&diagnosis),
        inside: [[0; 2]; 2],
    };
    let Ok(diagnosis) = diagnosis else {
        return case;
    };
    let accepted = diagnosis.sensors.iter().flat_map(|s| &s.decision.accepted);
    // A bias is defined where its effect is zero: at 25 °C for an effect of temperature, after settling for a warm-up. If a rival was accepted that
    // the recording does not distinguish from the true effect, its bias is a different quantity and is not judged.
    for a in accepted.filter(|a| a.chosen.candidate.is_slow_bias()) {
        if ids.iter().all(|id| *id != a.chosen.candidate.id()) {
            let k = usize::from(a.chosen.candidate.sensor == Sensor::Accel);
            truths[k].fixed_rows_mut::<3>(9).fill(f64::NAN);
        }
    }
    case.inside = inside(triads(&diagnosis.after), &truths, true);
    case
}
