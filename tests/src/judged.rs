//! Judgements of sessions whose truth is known: how often a right calibration is called wrong, and how often a wrong one is called right.
//!
//! A clean unit is exactly affine (over temperature: with straight curves), so `good` and `untested` are the right words for it. A unit with an effect
//! is not; the effect leaves [`STRENGTH`] times the noise after the affine fit. Every session is recorded twice, with the same unit, biases included:
//! the second recording verifies the calibration of the first.

use mimu::calibration::Calibration;
use mimu::calibration::verify::verify;
use mimu::diagnose::{Recordings, diagnose};
use mimu::fit::{Fit, Options, fit};
use mimu::judgement::{Judgement, JudgementKind};
use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use mimu::sessions::Sessions;
use mimu::sessions::class::PartClass;
use mimu::triad::Triad;
use mimu_recording::WholeTurns;
use mimu_recording::error::Result;
use mimu_rig::rig_file::{EffectFile, RigFile};
use mimu_thermal::session::Session;
use nalgebra::SVector;

use crate::bench;
use crate::blind::{self, resize, with_effects};
use crate::by_hand::{self, Grade, inside, plan_of};
use crate::coverage::of_the_session;
use crate::planted::{Ground, array};
use crate::ramp;
use crate::sessions::{self, ARRAY_SESSIONS, Life};
use crate::study::Said;
use crate::whole_turns;

/// Rms that the affine fit leaves of an effect, over the noise of a dwell mean or turn.
pub const STRENGTH: f64 = 5.0;
/// Largest relative departure from it. An effect is linear in its size, but its residuals correlate with the noise.
const DEPARTURE: f64 = 0.1;
/// Recordings after which the size of an effect is given up: it shows nowhere.
const TRIES: usize = 5;
/// Number of the recording that verifies.
const SECOND: u64 = 4;
/// Creation time of every file.
const NOW: &str = "2026-01-01T00:00:00Z";
/// Temperatures at which curves are compared with the truth, °C.
const TEMPERATURES: [f64; 4] = [5.0, 15.0, 25.0, 32.0];

/// What is done with a unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Setting {
    /// Poses by hand at this rate. `held`: the unit stays in the hand during dwells, which sways and trembles.
    ByHand {
        /// Poses.
        poses: usize,
        /// Hz.
        rate_hz: f64,
        /// Whether it is not put down.
        held: bool,
    },
    /// Faces, corners and rates on a table without flaws.
    Table,
    /// Whole turns by hand.
    WholeTurns(whole_turns::Session),
    /// 24 turns of 8 s between poses, in which the Earth turns by more than the noise of the gyro.
    SlowTurns,
    /// Four sessions of 24 poses by hand, combined; the fifth verifies.
    Sessions(Life),
    /// Curves over temperature, of biases that follow it.
    Ramp,
}

/// A kind of sessions: a row of the table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kind {
    /// What is done.
    pub setting: Setting,
    /// With which unit. Several sessions are of a consumer unit, a ramp of an analog one, slow turns of a quiet gyro.
    pub grade: Grade,
    /// The effects of the units that are not clean: one of these, by the seed, of the strength [`STRENGTH`].
    pub planted: &'static [&'static str],
}

const POSES: &[&str] = &[
    "accel_scale_quadratic",
    "gyro_g_sensitivity",
    "accel_scale_cubic",
    "gyro_bias_drift",
];
const TURNS: &[&str] = &["gyro_g_sensitivity", "gyro_bias_drift"];
const LASTING: &[&str] = &["accel_scale_quadratic", "gyro_g_sensitivity"];

impl Kind {
    /// All.
    pub fn all() -> Vec<Self> {
        let by_hand = |poses, rate_hz, held| Setting::ByHand {
            poses,
            rate_hz,
            held,
        };
        let mut all = Vec::new();
        let mut each = |setting, planted| {
            let of = |grade| Self {
                setting,
                grade,
                planted,
            };
            all.extend(Grade::ALL.map(of));
        };
        for poses in [18, 24, 40] {
            each(by_hand(poses, 100.0, false), POSES);
        }
        each(by_hand(18, 20.0, false), POSES);
        each(by_hand(24, 100.0, true), POSES);
        each(Setting::Table, POSES);
        each(
            Setting::WholeTurns(whole_turns::Session::POSES_AND_TURNS),
            TURNS,
        );
        each(Setting::WholeTurns(whole_turns::Session::TURNS), TURNS);
        // Nobody knows the zero of an accelerometer in volts before poses show it.
        let needs_poses = |kind: &Self| {
            kind.setting == Setting::WholeTurns(whole_turns::Session::TURNS)
                && kind.grade == Grade::Analog
        };
        all.retain(|kind| !needs_poses(kind));
        let others = [
            (Setting::SlowTurns, Grade::Tactical, TURNS),
            (Setting::Sessions(Life::Constant), Grade::Consumer, LASTING),
            (Setting::Sessions(Life::PowerOn), Grade::Consumer, LASTING),
            (Setting::Ramp, Grade::Analog, LASTING),
        ];
        all.extend(others.map(|(setting, grade, planted)| Self {
            setting,
            grade,
            planted,
        }));
        all
    }

    /// In words.
    pub fn name(&self) -> String {
        let grade = format!("{:?}", self.grade).to_lowercase();
        match self.setting {
            Setting::ByHand {
                poses,
                rate_hz,
                held,
            } => {
                let held = if held { " in the hand" } else { "" };
                format!("by hand, {poses} poses{held}, {rate_hz} Hz, {grade}")
            }
            Setting::Table => format!("table, {grade}"),
            Setting::WholeTurns(session) => format!("whole turns, {}, {grade}", session.name()),
            Setting::SlowTurns => "24 turns of 8 s, quiet gyro, latitude 48".into(),
            Setting::Sessions(life) => format!("4 sessions, {}", life.name()),
            Setting::Ramp => "ramp".into(),
        }
    }

    fn unit(&self, seed: u64) -> RigFile {
        let mut file = match self.setting {
            Setting::Sessions(_) => sessions::unit(seed),
            Setting::Ramp => {
                let mut file = ramp::thermal(seed);
                file.unit.temperature_offset_c = Some(0.0);
                // The second recording is of the same unit, with its noise.
                with_effects(file, &[], seed)
            }
            _ => by_hand::unit(&[], self.grade, seed),
        };
        match self.setting {
            Setting::ByHand { held, .. } => file.hands.held = held,
            Setting::SlowTurns => {
                file.unit.gyro_axes.white_si = Some([0.002f64.to_radians(); 3]);
                file.hands.turn_s = [8.0; 2];
            }
            _ => {}
        }
        file
    }

    fn plan(&self, seed: u64) -> String {
        match self.setting {
            Setting::ByHand { poses, rate_hz, .. } => plan_of(poses, rate_hz),
            Setting::Table => bench::table_plan(Some(seed)),
            Setting::WholeTurns(session) => session.plan(),
            Setting::SlowTurns => plan_of(25, 100.0),
            Setting::Sessions(_) => bench::hand_plan(24),
            Setting::Ramp => ramp::plan(5, 10.0, &[[0.0, 0.0], [350.0, 35.0], [700.0, 0.0]]),
        }
    }

    /// Seed of the noise and the motion of the recording `number`. Of each grade another, or all would have the same poses.
    fn noise_seed(&self, seed: u64, number: u64) -> u64 {
        seed + 1_000_000 * number + 100_000 * self.grade as u64
    }

    /// The recordings of a calibration of the unit `seed` with `effect`.
    fn all_recorded(&self, effect: &[EffectFile], seed: u64) -> Vec<Prepared> {
        let numbers = match self.setting {
            Setting::Sessions(_) => 0..SECOND,
            _ => 0..1,
        };
        numbers.map(|n| self.recorded(effect, seed, n)).collect()
    }

    /// Recording `number` of the unit `seed` with `effect`; [`SECOND`] is the one that verifies.
    fn recorded(&self, effect: &[EffectFile], seed: u64, number: u64) -> Prepared {
        if let Setting::Sessions(life) = self.setting {
            let (mut file, noise) = sessions::session(seed, life, number as u32);
            file.effect = effect.to_vec();
            return bench::recorded(&self.plan(noise), &file, noise);
        }
        let mut file = self.unit(seed);
        file.effect = effect.to_vec();
        let noise = self.noise_seed(seed, number);
        let stated = match self.setting {
            Setting::WholeTurns(session) => Some(WholeTurns {
                turns: (session.poses == 0).then_some(session.turns),
                ..WholeTurns::default()
            }),
            _ => None,
        };
        whole_turns::recorded(&file, &self.plan(noise), noise, stated)
    }

    /// True forward models of gyro and accelerometer in the first recording; of a ramp at 25 °C.
    fn truths(&self, seed: u64) -> [SVector<f64, 12>; 2] {
        let file = self.unit(seed);
        match self.setting {
            // Each session has a wander of its own.
            Setting::Sessions(_) => [&file.unit.gyro_affine, &file.unit.accel_affine]
                .map(|model| bench::parameters(model.as_ref().expect("stated"))),
            _ => {
                let noise = self.noise_seed(seed, 0);
                of_the_session(&self.plan(noise), &file, noise)
            }
        }
    }

    fn calibrated(&self, mut recordings: Vec<Prepared>) -> Result<Calibrated> {
        match self.setting {
            Setting::Sessions(_) => {
                let fits = recordings.into_iter().map(|p| fit(p, Options::default()));
                let fits = fits.collect::<Result<_>>()?;
                let sessions = Sessions::combine(fits, PartClass::Consumer)?;
                let combined = Calibration::of_sessions(&sessions, NOW)?;
                let triads =
                    Sensor::BOTH.map(|s| Some(sessions.triads[s].as_ref()?.common.clone()));
                Ok(Calibrated {
                    judgement: combined.judgement,
                    calibration: combined.calibration,
                    triads: vec![(None, triads)],
                })
            }
            Setting::Ramp => {
                let session = Session::of(&recordings[0])?;
                let fitted = mimu_thermal::fit::fit(vec![session], &[], Default::default())?;
                let at = |temp_c: f64| {
                    let of = |s| fitted.joint.curves[s].as_ref()?.triad(temp_c);
                    (Some(temp_c), Sensor::BOTH.map(of))
                };
                Ok(Calibrated {
                    judgement: fitted.judgement(),
                    calibration: fitted.calibration(NOW)?,
                    triads: TEMPERATURES.map(at).to_vec(),
                })
            }
            _ => {
                let fitted = fit(recordings.swap_remove(0), Options::default())?;
                Ok(Calibrated {
                    judgement: Judgement::of_fit(&fitted),
                    calibration: Calibration::of(&fitted, &[], NOW)?,
                    triads: vec![(None, by_hand::triads(&fitted).map(|t| t.cloned()))],
                })
            }
        }
    }

    /// Number of intervals that contain the truth, and number of all, of gyro and accelerometer.
    fn inside(&self, calibrated: &Calibrated, seed: u64) -> [[u32; 2]; 2] {
        let truths = self.truths(seed);
        let own_frame = !matches!(self.setting, Setting::Table | Setting::Ramp);
        let mut sums = [[0; 2]; 2];
        for (temp_c, triads) in &calibrated.triads {
            let mut truths = truths;
            for (truth, change) in truths
                .iter_mut()
                .zip(ramp::bias_change(temp_c.unwrap_or(25.0)))
            {
                for i in 0..3 {
                    let sensitivity = truth.fixed_rows::<3>(3 * i).norm();
                    truth[9 + i] += sensitivity * change[i];
                }
            }
            let of = inside(triads.each_ref().map(Option::as_ref), &truths, own_frame);
            for (sum, of) in sums.iter_mut().flatten().zip(of.iter().flatten()) {
                *sum += of;
            }
        }
        sums
    }

    /// A clean unit calibrated and verified.
    pub fn clean(&self, seed: u64) -> Clean {
        let calibrated = match self.calibrated(self.all_recorded(&[], seed)) {
            Ok(calibrated) => calibrated,
            Err(refusal) => {
                return Clean {
                    judged: Judged::refused(refusal),
                    inside: [[0; 2]; 2],
                    verified: None,
                };
            }
        };
        let second = self.recorded(&[], seed, SECOND);
        Clean {
            inside: self.inside(&calibrated, seed),
            verified: Some(Judged::of_verify(&second, &calibrated.calibration)),
            judged: calibrated.judgement.into(),
        }
    }

    /// Rms that an effect leaves after the affine fit, over the noise, for the sensor with this effect. Not a number if one of the recordings is refused.
    fn strength(&self, sensor: Sensor, with: &Prepared, without: &Without) -> f64 {
        let Some(fit_without) = &without.fit else {
            return blind::strength(with, &without.prepared).1;
        };
        let of = || {
            let with = fit(with.clone(), Options::IN_SAMPLE).ok()?;
            let (with, without) = (with.sensor(sensor)?, fit_without.sensor(sensor)?);
            let excess = with.rms().powi(2) - without.rms().powi(2);
            Some(excess.max(0.0).sqrt() / without.noise_floor())
        };
        of().unwrap_or(f64::NAN)
    }

    /// The first recording of the clean unit `seed`; `None` if it is refused.
    fn without(&self, seed: u64) -> Option<Without> {
        let prepared = self.recorded(&[], seed, 0);
        let fit = match self.setting {
            Setting::Table | Setting::Ramp => None,
            _ => Some(fit(prepared.clone(), Options::IN_SAMPLE).ok()?),
        };
        Some(Without { prepared, fit })
    }

    /// The effect of the unit `seed`, and its strength in the first recording; `None` if no size has it.
    fn planted(&self, seed: u64) -> Option<(EffectFile, f64)> {
        let id = self.planted[seed as usize % self.planted.len()];
        let mut effect = with_effects(RigFile::default(), &[id], seed)
            .effect
            .swap_remove(0);
        let sensor = match id.starts_with("gyro") {
            true => Sensor::Gyro,
            false => Sensor::Accel,
        };
        let without = self.without(seed)?;
        for _ in 0..TRIES {
            let with = self.recorded(std::slice::from_ref(&effect), seed, 0);
            let strength = self.strength(sensor, &with, &without);
            let over = STRENGTH / strength;
            if (over - 1.0).abs() <= DEPARTURE {
                return Some((effect, strength));
            }
            // One that is refused is too large.
            resize(
                &mut effect,
                if over.is_nan() { 0.1 } else { over.min(10.0) },
            );
        }
        None
    }

    /// A unit with an effect calibrated, verified and diagnosed; `None` if the effect does not show in such sessions.
    pub fn with_effect(&self, seed: u64, diagnosed: bool) -> Option<WithEffect> {
        let (effect, strength) = self.planted(seed)?;
        let effects = std::slice::from_ref(&effect);
        let recordings = self.all_recorded(effects, seed);
        let found = diagnosed.then(|| {
            let mut all = recordings.clone();
            let first = Recordings::from(all.remove(0));
            let all = Recordings { more: all, ..first };
            Said::of(&diagnose(all, Options::IN_SAMPLE))
        });
        let (judged, verified) = match self.calibrated(recordings) {
            Ok(calibrated) => {
                let second = self.recorded(effects, seed, SECOND);
                let verified = Judged::of_verify(&second, &calibrated.calibration);
                (calibrated.judgement.into(), Some(verified))
            }
            Err(refusal) => (Judged::refused(refusal), None),
        };
        Some(WithEffect {
            id: effect.id,
            strength,
            judged,
            verified,
            found,
        })
    }
}

/// A recording without an effect, and its fit where the inputs are not known.
struct Without {
    prepared: Prepared,
    fit: Option<Fit>,
}

/// A calibration with its judgement.
struct Calibrated {
    judgement: Judgement,
    calibration: Calibration,
    /// Gyro and accelerometer; over temperature at several temperatures, °C.
    triads: Vec<(Option<f64>, [Option<Triad>; 2])>,
}

/// A session of a unit of the array, with the effect `id` of `size` or as it is, and its calibration.
struct OfArray {
    prepared: Prepared,
    judged: Judged,
    calibration: Option<Calibration>,
}

impl OfArray {
    fn of(ground: &Ground, effect: Option<(&str, f64)>) -> Result<Self> {
        let prepared = ground.prepared(effect)?;
        let (judged, calibration) = match fit(prepared.clone(), Options::default()) {
            Ok(fit) => (
                Judgement::of_fit(&fit).into(),
                Calibration::of(&fit, &[], NOW).ok(),
            ),
            Err(refusal) => (Judged::refused(refusal), None),
        };
        Ok(Self {
            prepared,
            judged,
            calibration,
        })
    }
}

/// A session of a unit of the array, and the next one.
#[derive(Debug, Clone)]
pub struct Pair {
    /// Unit and session.
    pub of: [usize; 2],
    /// The fit of the session.
    pub judged: Judged,
    /// Its file on the next session.
    pub verified: Judged,
}

/// Every session of `unit` that can be calibrated, with the next one: both as they are, or both with the effect `id` of a size along each axis. `None`
/// if the data are missing.
pub fn pairs_of_array(unit: usize, effect: Option<(&str, f64)>) -> Option<Vec<Pair>> {
    let of = |session| Some(OfArray::of(&array(unit, session)?, effect).ok());
    let all: Option<Vec<_>> = (0..ARRAY_SESSIONS).map(of).collect();
    let all = all?;
    let pairs = all.windows(2).enumerate().filter_map(|(session, pair)| {
        let [first, second] = [pair[0].as_ref()?, pair[1].as_ref()?];
        let calibration = first.calibration.as_ref()?;
        Some(Pair {
            of: [unit, session],
            judged: first.judged.clone(),
            verified: Judged::of_verify(&second.prepared, calibration),
        })
    });
    Some(pairs.collect())
}

/// A judgement or a refusal.
#[derive(Debug, Clone)]
pub struct Judged {
    /// Kind; `None` for a refusal.
    pub kind: Option<JudgementKind>,
    /// Its reason.
    pub reason: String,
}

impl From<Judgement> for Judged {
    fn from(judgement: Judgement) -> Self {
        Self {
            kind: Some(judgement.kind),
            reason: judgement.reason,
        }
    }
}

impl Judged {
    fn refused(refusal: mimu_recording::error::Error) -> Self {
        Self {
            kind: None,
            reason: refusal.to_string(),
        }
    }

    fn of_verify(second: &Prepared, calibration: &Calibration) -> Self {
        match verify(second, calibration) {
            Ok(verification) => verification.judgement.into(),
            Err(refusal) => Self::refused(refusal),
        }
    }

    /// Whether it is `good` or `untested`.
    pub fn is_unobjected(&self) -> bool {
        let fine = [JudgementKind::Good, JudgementKind::Untested];
        self.kind.is_some_and(|kind| fine.contains(&kind))
    }

    /// `good`, or `refused`.
    pub fn name(&self) -> &'static str {
        self.kind.map_or("refused", JudgementKind::name)
    }
}

/// What is said of a clean unit.
#[derive(Debug, Clone)]
pub struct Clean {
    /// Of its calibration.
    pub judged: Judged,
    /// Number of intervals that contain the truth, and number of all, of gyro and accelerometer.
    pub inside: [[u32; 2]; 2],
    /// Of its calibration on the second recording; `None` without a calibration.
    pub verified: Option<Judged>,
}

/// What is said of a unit with an effect.
#[derive(Debug, Clone)]
pub struct WithEffect {
    /// The effect.
    pub id: String,
    /// What the affine fit leaves of it over the noise.
    pub strength: f64,
    /// Of its affine calibration.
    pub judged: Judged,
    /// Of that calibration on the second recording; `None` without a calibration.
    pub verified: Option<Judged>,
    /// Of the diagnosis, if it was asked.
    pub found: Option<Said>,
}

impl WithEffect {
    /// Whether the diagnosis, if it was asked, explains the data by the effect, perhaps as one that the recording does not distinguish from another.
    pub fn is_right(&self) -> Option<bool> {
        let found = self.found.as_ref()?;
        Some(found.names(&self.id) && found.verdict == "explained")
    }
}
