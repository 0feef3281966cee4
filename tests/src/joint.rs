//! Several sessions of one unit diagnosed together, and the effect of the resulting file on another session.
//!
//! The judge knows the true motion from the bench and shares nothing with the diagnosis. The file is written and read as by the command, another
//! session is compensated with it sample by sample (`mimu apply`), and rate and force are compared with the true ones.

use mimu::calibration::Calibration;
use mimu::calibration::apply::apply;
use mimu::calibration::verify::verify;
use mimu::diagnose::{Recordings, diagnose};
use mimu::effects::fitted::FittedEffect;
use mimu::fit::{Options, fit};
use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use mimu::signal::stillness::STILL_FACTOR;
use mimu_recording::error::Result;
use mimu_recording::{Recording, SampleFormat};
use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::random::Random;
use mimu_rig::record::{Output, samples, write};
use mimu_rig::rig_file::{RigFile, RigTruth};
use nalgebra::{Matrix3, Vector3};

use crate::bench;
use crate::blind::reported;
use crate::by_hand::{Grade, unit};

/// Creation time of every file.
const NOW: &str = "2026-01-01T00:00:00Z";
/// Standard deviation of a session's bias from the unit's: deg/s and mg.
const TURN_ON: [f64; 2] = [0.2, 3.0];
/// A file is worse than another if its error is larger by more than this factor,
const FACTOR: f64 = 1.05;
/// and if its excess (difference in squares) is more than the square of this share of the noise-only error in the same session.
const SHARE_OF_NOISE: f64 = 0.5;

/// One set of sessions.
#[derive(Debug, Clone)]
pub struct Set {
    /// Effects of the unit.
    pub effects: Vec<&'static str>,
    /// Its sensors.
    pub grade: Grade,
    /// Sessions that are diagnosed together.
    pub sessions: usize,
    /// On a table, or by hand.
    pub on_table: bool,
    /// Share of the sessions that begin at power-on. The others begin an hour later.
    pub cold: f64,
    /// Parameters of its first effect instead of drawn ones, as a file of the bench has them.
    pub size: Option<&'static str>,
    /// By hand: largest angle between the vertical and the nearest face, deg; `None`: poses of all directions.
    pub near_faces_deg: Option<f64>,
    seed: u64,
}

/// Errors of a file on another session: gyro (deg/s over dwells on a table, degrees after a turn by hand), accelerometer (m/s² over dwells).
pub type Errors = [f64; 2];

/// Errors of a file without effects and of one with effects on another session.
#[derive(Debug, Clone, Copy)]
pub struct Judged {
    /// Error from noise alone, with the true model.
    pub noise: Errors,
    /// Error of the file without effects, and of the file with effects.
    pub of_files: [Errors; 2],
}

/// Result of a set.
#[derive(Debug, Clone)]
pub struct Case {
    /// The set.
    pub set: Set,
    /// Accepted effects, each with those that the recordings do not distinguish from it.
    pub found: Vec<Vec<String>>,
    /// Those of the unit that the file contains.
    pub effects: Vec<FittedEffect>,
    /// Verdict, or why the set was refused.
    pub verdict: String,
    /// On a session with the biases of the first session, files as written.
    pub as_written: Option<Judged>,
    /// On a session with different biases, with the constant error of each axis removed.
    pub without_offset: Option<Judged>,
    /// On that session, files as written: both errors include the change of the biases.
    pub own_biases: Option<Judged>,
    /// Direction of gravity after the turns of a session by hand with the biases of the first, by `mimu verify`, deg: without effects, and with them.
    pub directions: Option<[f64; 2]>,
}

impl Set {
    /// The set of a seed: effects and number of sessions cycle through their values; the rest is drawn at random.
    pub fn of(seed: u64) -> Self {
        let mut random = Random::new(seed, "joint set");
        let mut one_of = |all: &[&'static str]| all[(random.uniform() * all.len() as f64) as usize];
        let effects = match seed % 6 {
            0 => Vec::new(),
            1 => vec!["accel_warm_up"],
            2 => vec!["gyro_warm_up", "accel_warm_up"],
            3 => vec!["gyro_g_sensitivity"],
            4 => vec![one_of(&[
                "gyro_scale_quadratic",
                "gyro_scale_cubic",
                "accel_scale_quadratic",
                "accel_scale_cubic",
            ])],
            _ => vec![one_of(&["gyro_bias_drift", "accel_bias_drift"])],
        };
        Self {
            effects,
            grade: match random.uniform() < 0.5 {
                true => Grade::Analog,
                false => Grade::Consumer,
            },
            // 6 and 8 have a common factor; `seed / 6` makes every kind of effects meet every number.
            sessions: 2 + ((seed / 6 + seed) % 8) as usize,
            on_table: random.uniform() < 1.0 / 3.0,
            cold: [0.0, 0.5, 1.0][(random.uniform() * 3.0) as usize],
            size: None,
            near_faces_deg: None,
            seed,
        }
    }

    /// A set of `sessions` sessions by hand of a digital unit whose only effect is a warm-up of the accelerometer, each recorded from power-on.
    pub fn of_warm_up(sessions: usize, seed: u64) -> Self {
        Self {
            effects: vec!["accel_warm_up"],
            grade: Grade::Consumer,
            sessions,
            on_table: false,
            cold: 1.0,
            size: None,
            near_faces_deg: None,
            seed,
        }
    }

    /// One session by hand of a unit of `grade` whose accelerometer has a cubic of this `size`, in poses of all directions or near the faces.
    pub fn of_cubic(
        size: &'static str,
        near_faces_deg: Option<f64>,
        grade: Grade,
        seed: u64,
    ) -> Self {
        Self {
            effects: vec!["accel_scale_cubic"],
            grade,
            sessions: 1,
            on_table: false,
            cold: 0.0,
            size: Some(size),
            near_faces_deg,
            seed,
        }
    }

    fn plan(&self, session: u64) -> String {
        let seed = self.session_seed(session);
        let plan = match self.on_table {
            true => bench::table_plan(Some(seed)),
            false => {
                let mut random = Random::new(seed, "poses");
                let poses = 26 + (random.uniform() * 17.0) as usize;
                match self.near_faces_deg {
                    Some(most) => bench::near_faces_plan(poses, most, &mut random),
                    None => bench::hand_plan(poses),
                }
            }
        };
        format!("latitude_deg = 48.0\nlead_in_s = 5.0\n{plan}")
    }

    fn session_seed(&self, session: u64) -> u64 {
        1000 * self.seed + session
    }

    /// The unit in a session, with the biases of session number `biases`.
    fn unit(&self, session: u64, biases: u64) -> RigFile {
        let mut file = unit(&self.effects, self.grade, self.seed);
        if let Some(size) = self.size {
            file.effect[0].parameters = toml::from_str(size).expect("parameters");
        }
        let mut random = Random::new(self.session_seed(biases), "turn-on");
        let si = [TURN_ON[0].to_radians(), TURN_ON[1] * 9.80665e-3];
        let models = [&mut file.unit.gyro_affine, &mut file.unit.accel_affine];
        for (model, si) in models.into_iter().zip(si) {
            let model = model.as_mut().expect("stated");
            for (bias, row) in model.bias.iter_mut().zip(&model.matrix) {
                *bias += si * Vector3::from(*row).norm() * random.normal();
            }
        }
        let cold = Random::new(self.session_seed(session), "cold").uniform() < self.cold;
        file.thermal.on_before_s = Some(if cold { 0.0 } else { 3600.0 });
        file
    }

    /// Records a session, whose manifest states when the power came.
    fn recorded(&self, session: u64, biases: u64) -> Session {
        let file = self.unit(session, biases);
        let seed = self.session_seed(session);
        let text = self.plan(session);
        let plan = Plan::parse(Source::new("plan", &text)).expect("a plan");
        let truth = RigTruth::resolve(&file, seed).expect("a rig");
        let folder = tempfile::tempdir().expect("a folder");
        let place = folder.path().join("recording");
        let output = Output::new(&place, &plan).expect("a name");
        write(&plan, &truth, seed, &output).expect("written");
        let manifest = place.join("recording.toml");
        let mut text = std::fs::read_to_string(&manifest).expect("written");
        let on_before_s = truth.unit.thermal.on_before_s;
        text += &format!("power_on_s = {:?}\n", -on_before_s);
        std::fs::write(&manifest, text).expect("writable");
        Session {
            recording: Recording::open(&place).expect("a recording"),
            folder,
            plan,
            file,
            seed,
        }
    }
}

/// A recording and its truth.
struct Session {
    folder: tempfile::TempDir,
    recording: Recording,
    plan: Plan,
    file: RigFile,
    seed: u64,
}

/// Error of rate (rad/s) and force (m/s²) at a sample, and the dwell that it belongs to.
type Sample = ([Vector3<f64>; 2], Option<u32>);

impl Session {
    fn prepared(&self) -> Prepared {
        Prepared::read(&self.recording, STILL_FACTOR, |_| ()).expect("readable")
    }

    /// Errors of `calibration`, sample by sample.
    fn errors(&self, calibration: &Calibration) -> Result<Vec<Sample>> {
        let out = self.folder.path().join("compensated");
        apply(
            &self.recording,
            calibration,
            &out,
            SampleFormat::Parquet,
            true,
            |_| (),
        )?;
        let mut readings: Vec<[Vector3<f64>; 2]> = Vec::new();
        Recording::open(&out)?.for_each_batch(
            |_| (),
            |batch| {
                readings.extend(
                    (0..batch.len()).map(|k| {
                        [0, 3].map(|from| Vector3::from_fn(|i, _| batch.raw[from + i][k]))
                    }),
                );
                Ok(())
            },
        )?;
        let truth = RigTruth::resolve(&self.file, self.seed).expect("a rig");
        let run = samples(&self.plan, &truth, self.seed).expect("a run");
        Ok(run
            .zip(readings)
            .map(|(row, [rate, force])| {
                let motion = row.instant.motion;
                let errors = [
                    rate - Vector3::from(motion.rate),
                    force - Vector3::from(motion.force),
                ];
                (errors, row.instant.step)
            })
            .collect())
    }

    /// Errors of a perfect calibration of a unit without effects: noise alone.
    fn noise(&self) -> Vec<Sample> {
        let mut file = self.file.clone();
        file.effect.clear();
        let truth = RigTruth::resolve(&file, self.seed).expect("a rig");
        let models = [&file.unit.gyro_affine, &file.unit.accel_affine].map(|model| {
            let model = model.as_ref().expect("stated");
            let matrix = Matrix3::from_fn(|i, j| model.matrix[i][j]);
            let inverse = matrix.try_inverse().expect("regular");
            (inverse, Vector3::from(model.bias))
        });
        let run = samples(&self.plan, &truth, self.seed).expect("a run");
        run.map(|row| {
            let motion = row.instant.motion;
            let of = |k: usize, raw: [f64; 3], input: [f64; 3]| {
                let (inverse, bias) = models[k];
                inverse * (Vector3::from(raw) - bias) - Vector3::from(input)
            };
            let errors = [
                of(0, row.readings.gyro, motion.rate),
                of(1, row.readings.accel, motion.force),
            ];
            (errors, row.instant.step)
        })
        .collect()
    }

    /// Root mean squares of the errors, as they are and with the constant error of each axis removed.
    fn rms(&self, samples: &[Sample]) -> [Errors; 2] {
        let on_table = matches!(self.plan.carrier, mimu_rig::plan::CarriedBy::Table);
        // Sum and count of each dwell and of each turn between two dwells.
        let mut segments: Vec<(Option<u32>, [Vector3<f64>; 2], f64)> = Vec::new();
        for (errors, step) in samples {
            match segments.last_mut() {
                Some((of, sums, count)) if of == step => {
                    (0..2).for_each(|k| sums[k] += errors[k]);
                    *count += 1.0;
                }
                _ => segments.push((*step, *errors, 1.0)),
            }
        }
        let dwells: Vec<[Vector3<f64>; 2]> = segments
            .iter()
            .filter(|s| s.0.is_some())
            .map(|(_, sums, count)| sums.map(|s| s / *count))
            .collect();
        // The lead-in and the end are not turns.
        let first = segments.iter().position(|s| s.0.is_some()).unwrap_or(0);
        let last = segments.iter().rposition(|s| s.0.is_some()).unwrap_or(0);
        let turns: Vec<(Vector3<f64>, f64)> = segments[first..last]
            .iter()
            .filter(|s| s.0.is_none())
            .map(|(_, sums, count)| {
                let period_s = 1.0 / self.plan.sample_rate_hz;
                (sums[0].map(f64::to_degrees) * period_s, count * period_s)
            })
            .collect();
        let mean =
            |k: usize| dwells.iter().map(|d| d[k]).sum::<Vector3<f64>>() / dwells.len() as f64;
        let rms = |errors: Vec<Vector3<f64>>| {
            let sum: f64 = errors.iter().map(Vector3::norm_squared).sum();
            (sum / (3.0 * errors.len() as f64)).sqrt()
        };
        [0.0, 1.0].map(|out| {
            let offset = [0, 1].map(|k| mean(k) * out);
            let gyro = match on_table {
                true => rms(dwells
                    .iter()
                    .map(|d| (d[0] - offset[0]).map(f64::to_degrees))
                    .collect()),
                false => rms(turns
                    .iter()
                    .map(|(angle, s)| angle - offset[0].map(f64::to_degrees) * *s)
                    .collect()),
            };
            [gyro, rms(dwells.iter().map(|d| d[1] - offset[1]).collect())]
        })
    }

    /// Errors of a file without effects and of one with them: as written, and with the constant error of each axis removed.
    fn judge(&self, files: &[Calibration; 2]) -> Result<[Judged; 2]> {
        let noise = self.rms(&self.noise());
        let without = self.rms(&self.errors(&files[0])?);
        let with = self.rms(&self.errors(&files[1])?);
        Ok([0, 1].map(|k| Judged {
            noise: noise[k],
            of_files: [without[k], with[k]],
        }))
    }
}

impl Judged {
    /// Error of the file with effects over that of the file without them.
    pub fn ratio(&self) -> Errors {
        [0, 1].map(|k| self.of_files[1][k] / self.of_files[0][k])
    }

    /// For each sensor, whether the file with effects is worse by more than noise.
    pub fn is_worse(&self) -> [bool; 2] {
        [0, 1].map(|k| {
            let [without, with] = self.of_files.map(|e| e[k]);
            let more = with * with - without * without;
            !(with <= FACTOR * without || more <= (SHARE_OF_NOISE * self.noise[k]).powi(2))
        })
    }
}

impl Case {
    /// Whether `found` contains an effect of the unit, also as one that the recordings do not distinguish. The Earth's rotation is always right.
    pub fn is_right(&self, found: &[String]) -> bool {
        let is_true = |f: &String| f == "earth_rate" || self.set.effects.iter().any(|t| f == t);
        found.iter().any(is_true)
    }

    /// Whether the file with effects is worse on another session than the file without them.
    pub fn is_worse(&self) -> bool {
        let judged = [&self.as_written, &self.without_offset];
        judged
            .into_iter()
            .flatten()
            .any(|j| j.is_worse().contains(&true))
    }
}

/// A file after one command has written it and another has read it.
fn written(made: &Calibration) -> Result<Calibration> {
    Calibration::parse(&made.to_toml(), "cal.toml")
}

/// Records a set, diagnoses it, and judges the file on another session.
pub fn case(set: &Set) -> Case {
    let mut case = Case {
        set: set.clone(),
        found: Vec::new(),
        effects: Vec::new(),
        verdict: String::new(),
        as_written: None,
        without_offset: None,
        own_biases: None,
        directions: None,
    };
    if let Err(refusal) = judge(&mut case) {
        case.verdict = format!("refused: {refusal}");
    }
    case
}

fn judge(case: &mut Case) -> Result<()> {
    let set = case.set.clone();
    let sessions = 0..set.sessions as u64;
    let mut all: Vec<Prepared> = sessions.map(|k| set.recorded(k, k).prepared()).collect();
    let first = all.remove(0);
    let without = written(&Calibration::of(
        &fit(first.clone(), Options::IN_SAMPLE)?,
        &[],
        NOW,
    )?)?;
    let recordings = Recordings {
        first,
        more: all,
        second: None,
        given: None,
    };
    let diagnosis = reported(diagnose(recordings, Options::IN_SAMPLE)?);
    case.verdict = diagnosis.verdict.name().into();
    let accepted = diagnosis.sensors.iter().flat_map(|s| &s.decision.accepted);
    case.found = accepted
        .clone()
        .map(|a| {
            let alike = a.chosen.alternatives.iter().map(|other| other.id.clone());
            std::iter::once(a.chosen.candidate.id())
                .chain(alike)
                .collect()
        })
        .collect();
    let mut effects: Vec<FittedEffect> = Vec::new();
    for accepted in accepted.filter(|a| a.of_unit) {
        let effect = accepted.effect.lasting();
        effect.join(&mut effects);
    }
    let with = written(&Calibration::of(&diagnosis.after, &effects, NOW)?)?;
    case.effects = effects;
    let files = [without, with];
    let judge = set.sessions as u64;
    let unseen = set.recorded(judge, 0);
    case.as_written = Some(unseen.judge(&files)?[0]);
    if !set.on_table {
        let prepared = unseen.prepared();
        let turns = files.each_ref().map(|file| {
            let gyro = verify(&prepared, file).ok()?.sensors[Sensor::Gyro]
                .as_ref()?
                .rms;
            Some(gyro.to_degrees())
        });
        case.directions = turns[0].zip(turns[1]).map(|(a, b)| [a, b]);
    }
    let [own, without_offset] = set.recorded(judge, judge).judge(&files)?;
    (case.own_biases, case.without_offset) = (Some(own), Some(without_offset));
    Ok(())
}
