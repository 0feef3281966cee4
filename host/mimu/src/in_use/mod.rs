//! Noise in use: the densities that explain the errors of dead reckoning in motion, and what they come from.
//!
//! | module | contents |
//! |---|---|
//! | `walk`, `dead_reckoning`, `state` | one pass over the samples: the errors of each segment, and what they depend on |
//! | `rests`, `trajectory`, `trajectory_file`, `closure` | the errors against a reference: rests before and after, or a trajectory |
//! | `allan_noise`, `component` | what is known of the noise, and the variances that the errors may have beyond it |
//! | `likelihood`, `estimates` | a filter over the segments; what a smoother estimates, about which the errors are linear |
//! | `attribution`, `judged` | causes, and the errors of segments that were held out |

mod allan_noise;
mod attribution;
mod closure;
mod component;
mod dead_reckoning;
mod estimates;
mod judged;
mod likelihood;
mod noise_file;
mod rests;
mod state;
mod trajectory;
mod trajectory_file;
mod walk;

pub use component::Cause;
pub use estimates::{Estimate, Mounted};
pub use trajectory_file::{Pose, Trajectory};
pub use walk::VIBRATION_HZ;

use nalgebra::{DMatrix, Matrix3};
use rayon::prelude::*;
use serde::Serialize;

use crate::calibration::Calibration;
use crate::judgement::Judgement;
use crate::noise::noise_file::NoiseFile;
use crate::prepared::Prepared;
use crate::quantity::{PerSensor, Sensor};
use crate::variance_search::{Fitted, LOCAL, Search};
use crate::warning::Warning;
use allan_noise::AllanNoise;
use closure::Closure;
use component::{FILTER, REFERENCE_COUNT};
use estimates::Smoothed;
use likelihood::{Model, Session};
use mimu_allan::model::Term;
use mimu_recording::{Error, Recording, Result};

/// Fewer segments show no variance.
const FEWEST_SEGMENTS: usize = 6;
/// The point of linearisation is that of the estimates if none is further from it than this, in its standard deviations.
const SETTLED: f64 = 0.1;
/// Passes over the samples. A bias of 4 deg/s takes four, a clock that is 60 ms off five.
const MOST_PASSES: i32 = 12;

/// What the errors are measured against.
#[derive(Debug, Clone, Copy)]
pub enum Against<'a> {
    /// Rests before and after each motion: the recording with its dwells.
    Rests(&'a Prepared),
    /// Poses by another instrument.
    Trajectory(&'a Trajectory),
}

/// A density that a filter takes: for rates rad/s/√Hz and rad/s²/√Hz, for forces m/s²/√Hz and m/s³/√Hz.
#[derive(Debug, Clone, Serialize)]
pub struct Density {
    /// Sensor.
    pub sensor: Sensor,
    /// `white` or `walk`.
    pub term: &'static str,
    /// Of the worst axis.
    pub value: f64,
    /// Ends of its 95 % interval; the lower one is at least what the noise file has.
    pub interval: [f64; 2],
    /// Unit of both.
    pub unit: &'static str,
    /// The same by the noise file, with flicker noise as the walk of its Allan variance; null where it shows none.
    pub allan: Option<f64>,
    /// Value over Allan's.
    pub factor: Option<f64>,
    /// Its 95 % interval.
    pub factor_interval: Option<[f64; 2]>,
}

/// Normalised error squared of held-out segments, for each degree of freedom: 1 if the errors are as large as a filter believes.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Nees {
    /// Mean.
    pub value: f64,
    /// Between these it is in 95 of 100 recordings, if the model is right: chi-square.
    pub by_chance: [f64; 2],
    /// Degrees of freedom.
    pub dof: usize,
}

/// The same by three models.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Consistency {
    /// Allan's noise alone, in a filter that estimates the biases.
    pub allan: Nees,
    /// The same, with the uncertainty of the calibration.
    pub with_calibration: Nees,
    /// The densities of this result, fitted to the other segments.
    pub in_use: Nees,
}

/// A cause of errors beyond Allan's noise.
#[derive(Debug, Clone, Serialize)]
pub struct CauseFound {
    /// Sensor that errs; null for the reference.
    pub sensor: Option<Sensor>,
    /// Cause.
    pub cause: Cause,
    /// Standard deviation, in the unit of the cause; of a matrix its estimated relative error on the worst axis.
    pub size: f64,
    /// Unit of [`Self::size`].
    pub unit: &'static str,
    /// Twice the rise of the log-likelihood when it was added.
    pub deviance: f64,
    /// Its share of the errors of its sensor beyond Allan's noise, from 0 to 1.
    pub share: f64,
}

/// Noise in use: `mimu-noise-in-use/1`.
#[derive(Debug, Clone, Serialize)]
pub struct NoiseInUse {
    /// `mimu-noise-in-use/1`.
    pub format: &'static str,
    /// Program and version.
    pub tool: &'static str,
    /// Unit under test.
    pub device: String,
    /// The judgement: whether the errors of held-out segments are as large as the densities say.
    pub judgement: Judgement,
    /// `rests` or `trajectory`.
    pub reference: &'static str,
    /// Segments used.
    pub segments: usize,
    /// Segments without a reference at both ends, with missing samples, or too long.
    pub segments_left_out: usize,
    /// Mean length of a segment, s.
    pub segment_s: f64,
    /// Mean turn in a segment, rad.
    pub turn_rad: f64,
    /// Rms of the acceleration above 10 Hz, m/s²; null at less than 40 samples a second.
    pub vibration_rms_mps2: Option<f64>,
    /// Biases beyond those of the calibration in the middle of the recording, rad/s and m/s².
    pub biases: PerSensor<[Estimate; 3]>,
    /// How the trajectory is mounted and timed; null by rests.
    pub mounted: Option<Mounted>,
    /// The four numbers that a filter wants.
    pub densities: Vec<Density>,
    /// Errors over what a filter believes.
    pub nees: Consistency,
    /// Causes that the segments show, by share.
    pub causes: Vec<CauseFound>,
    /// Share of the uncertainty of the calibration in the errors beyond Allan's noise, for gyro and accelerometer.
    pub share_of_calibration: PerSensor<f64>,
    /// For each sensor whose noise is inflated, one sentence that says why.
    pub sentences: Vec<String>,
    /// What a person should know.
    pub warnings: Vec<Warning>,
    /// Noise with these densities, for the exports.
    #[serde(skip)]
    pub noise_file: NoiseFile,
}

/// The densities that explain the errors of dead reckoning on `recording`, calibrated by `calibration`; `noise` is the unit's at rest.
///
/// # Errors
/// The calibration or the noise belongs to other readings; a sensor is missing; fewer than six segments have a reference at both ends.
pub fn noise_in_use(
    recording: &Recording,
    calibration: &Calibration,
    noise: &NoiseFile,
    against: Against,
    progress: impl Fn(f64),
) -> Result<NoiseInUse> {
    for sensor in Sensor::BOTH {
        if calibration.inverse(sensor).is_none() {
            let problem = format!("the calibration has no {sensor}");
            let remedy = "dead reckoning needs both sensors: calibrate both";
            return Err(Error::new(&recording.place, problem, remedy));
        }
    }
    let experiment = Experiment {
        recording,
        calibration,
        allan: AllanNoise::of(noise)?,
        against,
    };
    let found = experiment.linearised_where_it_settles(progress)?;
    experiment.densities(noise, found)
}

/// What the errors of dead reckoning are found on.
struct Experiment<'a> {
    recording: &'a Recording,
    calibration: &'a Calibration,
    allan: AllanNoise,
    against: Against<'a>,
}

/// A session whose errors are linear about its own estimates.
struct Linearised {
    session: Session,
    /// Segments left out.
    left_out: usize,
    fitted: Fitted,
    smoothed: Smoothed,
    /// Whether the estimates stayed where they were.
    is_settled: bool,
}

impl Experiment<'_> {
    /// Linearises about the estimates of a smoother until they stay: Gauss-Newton, with the densities fitted anew at each step, which are its weights.
    fn linearised_where_it_settles(&self, progress: impl Fn(f64)) -> Result<Linearised> {
        let mut about = Smoothed::default();
        let mut before: Option<Fitted> = None;
        for pass in 1.. {
            // The last step is as likely as not the third.
            let share = |k: i32| 1.0 - 0.5_f64.powi(k);
            let [from, to] = [pass - 1, pass].map(share);
            let (closures, left_out) =
                self.closures(&about, &|s| progress(from + s * (to - from)))?;
            let session = self.session(closures);
            self.refuse_few(&session)?;
            let fitted = session.filter_densities(before, |_| true);
            let Some(smoothed) = session.smoothed(&session.model(&fitted, false)) else {
                break;
            };
            let is_settled = about.distance(&smoothed) < SETTLED;
            if is_settled || pass == MOST_PASSES {
                return Ok(Linearised {
                    session,
                    left_out,
                    fitted,
                    smoothed,
                    is_settled,
                });
            }
            (about, before) = (smoothed, Some(fitted));
        }
        Err(Error::new(
            "noise in use",
            "the errors of the segments cannot be weighed",
            "report this error: it is a mistake in the program",
        ))
    }

    /// The segments about a point of linearisation, and the number of those that could not be used.
    fn closures(&self, about: &Smoothed, progress: &dyn Fn(f64)) -> Result<(Vec<Closure>, usize)> {
        match self.against {
            Against::Rests(prepared) => rests::closures(self, prepared, about, progress),
            Against::Trajectory(poses) => trajectory::closures(self, poses, about, progress),
        }
    }

    fn session(&self, closures: Vec<Closure>) -> Session {
        let mut covariance = DMatrix::zeros(24, 24);
        for (k, sensor) in Sensor::BOTH.into_iter().enumerate() {
            if let Some(own) = self.calibration.covariance(sensor) {
                covariance
                    .view_mut((12 * k, 12 * k), (12, 12))
                    .copy_from(&own);
            }
        }
        let times: Vec<f64> = closures.iter().map(|c| c.at_s).collect();
        let apart_s = match times[..] {
            [first, .., last] => (last - first) / (times.len() - 1) as f64,
            _ => 1.0,
        };
        let (has_positions, mounted) = match self.against {
            Against::Rests(_) => (false, false),
            Against::Trajectory(poses) => (poses.has_positions, true),
        };
        Session {
            components: component::all(self.allan.mean_white(), has_positions, !mounted),
            walks: self.allan.walks(apart_s.max(1e-3)),
            calibration: covariance,
            matrices: matrices(self.calibration),
            mounted,
            earth_is_known: self.recording.manifest.latitude_deg.is_some(),
            closures,
        }
    }

    /// Refuses segments that are too few to show a variance.
    fn refuse_few(&self, session: &Session) -> Result<()> {
        let moving = session.moving().len();
        if moving >= FEWEST_SEGMENTS {
            return Ok(());
        }
        let problem = format!(
            "{moving} segments have a reference at both ends, and at least {FEWEST_SEGMENTS} are needed"
        );
        let remedy = match self.against {
            Against::Rests(_) => {
                "hold the unit still before and after each motion, or give a trajectory"
            }
            Against::Trajectory(_) => {
                "give the time of the trajectory at which the recording begins to count, --trajectory-zero: mimu import prints it"
            }
        };
        Err(Error::new(&self.recording.place, problem, remedy))
    }

    fn densities(&self, noise: &NoiseFile, found: Linearised) -> Result<NoiseInUse> {
        let (reference, sha256) = match self.against {
            Against::Rests(prepared) => ("rests", prepared.condensed.sha256.clone()),
            Against::Trajectory(_) => {
                let read = self.recording.for_each_batch(|_| (), |_| Ok(()))?;
                ("trajectory", read.sha256)
            }
        };
        let session = &found.session;
        let model = session.model(&found.fitted, false);
        let search = session.search(false, |_| true);
        let free: Vec<usize> = OF_FILTER.collect();
        let ranges: Vec<[f64; 2]> = (0..FILTER)
            .into_par_iter()
            .map(|k| search.range(&found.fitted, k, &free))
            .collect();
        let attributed = attribution::of(session);
        let densities = densities(session, &model, &ranges, &self.allan);
        let nees = judged::consistency(session);
        let moving: Vec<&Closure> = session.closures.iter().filter(|c| c.moves).collect();
        let mean = |of: &dyn Fn(&Closure) -> f64| {
            moving.iter().map(|c| of(c)).sum::<f64>() / moving.len() as f64
        };
        let total_s: f64 = moving.iter().map(|c| c.duration_s).sum();
        let shaken: f64 = moving.iter().map(|c| c.vibration * c.duration_s).sum();
        let manifest = &self.recording.manifest;
        let fast = manifest.sample_rate_hz >= 4.0 * VIBRATION_HZ;
        let judgement = match found.is_settled {
            true => judged::judgement(session, &nees, &sha256, self.calibration),
            false => judged::not_settled(),
        };
        let sentences = attribution::sentences(&densities, &attributed);
        let warnings = self.calibration.other_unit(manifest).into_iter();
        // Six segments have a middle.
        let middle = found.smoothed.middle().unwrap_or(&found.smoothed.0[0]);
        Ok(NoiseInUse {
            format: "mimu-noise-in-use/1",
            tool: crate::result::TOOL,
            device: manifest.device.clone(),
            noise_file: noise_file::of(noise, session, &model, &ranges, &judgement),
            judgement,
            reference,
            segments: moving.len(),
            segments_left_out: found.left_out,
            segment_s: mean(&|c| c.duration_s),
            turn_rad: mean(&|c| c.turned),
            vibration_rms_mps2: fast.then(|| (shaken / total_s).sqrt()),
            biases: middle.biases(),
            mounted: session.mounted.then(|| middle.mounted()),
            densities,
            nees,
            causes: attributed.causes,
            share_of_calibration: attributed.share_of_calibration,
            sentences,
            warnings: warnings.collect(),
        })
    }
}

/// C of both sensors.
fn matrices(calibration: &Calibration) -> PerSensor<Matrix3<f64>> {
    let of = |s| calibration.inverse(s).map(|c| c.matrix);
    PerSensor::from_fn(|s| of(s).unwrap_or_else(Matrix3::identity))
}

/// Components that a filter has, and the reference's.
const OF_FILTER: std::ops::Range<usize> = 0..FILTER + REFERENCE_COUNT;

impl Session {
    /// Indices of the segments in motion.
    pub(self) fn moving(&self) -> Vec<usize> {
        let all = self.closures.iter().enumerate();
        all.filter(|(_, c)| c.moves).map(|(i, _)| i).collect()
    }

    /// Without components: Allan's noise alone, or with the uncertainty of the calibration.
    pub(self) fn known(&self, calibration: bool) -> Model {
        Model {
            values: vec![0.0; self.components.len()],
            calibration,
        }
    }

    /// The model of fitted components.
    pub(self) fn model(&self, fitted: &Fitted, calibration: bool) -> Model {
        Model {
            values: fitted.values.clone(),
            calibration,
        }
    }

    /// The likelihood of components by the segments that `counts` accepts.
    pub(self) fn search(
        &self,
        calibration: bool,
        counts: impl Fn(usize) -> bool + Sync,
    ) -> Search<impl Fn(&[f64]) -> Option<f64> + Sync> {
        Search {
            of: move |values: &[f64]| {
                let model = Model {
                    values: values.to_vec(),
                    calibration,
                };
                self.log_likelihood(&model, &counts)
            },
            most: self.components.iter().map(|c| c.most).collect(),
            finest: LOCAL,
        }
    }

    /// The most likely densities of a filter, by the segments that `counts` accepts.
    pub(self) fn filter_densities(
        &self,
        from: Option<Fitted>,
        counts: impl Fn(usize) -> bool + Sync,
    ) -> Fitted {
        let search = self.search(false, counts);
        let free: Vec<usize> = OF_FILTER.collect();
        let start = from.map_or_else(|| self.known(false).values, |own| own.values);
        search.maximise(search.fitted(start), &free)
    }
}

/// The four numbers, of the worst axes.
fn densities(
    session: &Session,
    model: &Model,
    ranges: &[[f64; 2]],
    allan: &AllanNoise,
) -> Vec<Density> {
    let each = (0..FILTER).map(|k| {
        let sensor = Sensor::BOTH[k % 2];
        let is_white = k < 2;
        let known = match is_white {
            true => allan.squared()[sensor][allan.worst_axis(sensor, Term::N)],
            false => session.walks[sensor].into_iter().fold(0.0, f64::max),
        };
        let of = |value: f64| (known + value * session.components[k].unit).sqrt();
        let value = of(model.values[k]);
        let interval = ranges[k].map(of);
        let reference = (known > 0.0).then(|| known.sqrt());
        Density {
            sensor,
            term: if is_white { "white" } else { "walk" },
            value,
            interval,
            unit: attribution::unit(&session.components[k], k),
            allan: reference,
            factor: reference.map(|r| value / r),
            factor_interval: reference.map(|r| interval.map(|v| v / r)),
        }
    });
    each.collect()
}
