//! The joint estimate of all curves and of the lag.

use mimu::quantity::{Sensor, significant};
use mimu_recording::Reference;
use mimu_recording::error::{Error, Result};

use crate::basis::Shape;
use crate::curves::{LagFit, TriadCurves};
use crate::noise;
use crate::path::is_one_way;
use crate::profile::{LAGS, Lag, Profile};
use crate::regression::{AxisNoise, Normal, Problem};
use crate::session::Session;
use crate::smoothness::{self, Penalties, Smoothness, TriadFit};
use crate::suitability::{check_alike, check_span, check_speed};
use crate::thermometer::{Die, Start};

/// Rounds of noise and smoothness in turn, where the bias wanders: each is found with the other.
const ROUNDS: usize = 4;
/// A best lag farther than this, s, from that which the smoothness was found at has it found anew.
const SETTLED_S: f64 = 0.5;
/// Drop in deviance that tells the lags of gyro and accelerometer apart: one degree of freedom at 1 %.
const TWO_LAGS: f64 = 6.63;
/// Start of the record: so much lag times slope, K, for a lag of a minute makes it worth asking what the die was like.
const START_OFFSET_K: f64 = 0.2;

/// How the curves are estimated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    /// Richest shape of the curves; the span may allow less.
    pub shape: Shape,
    /// A lag that is given, s; none to estimate it.
    pub lag_s: Option<f64>,
}

impl Choice {
    /// Smooth splines and an unknown lag.
    pub const JOINT: Self = Self {
        shape: Shape::Spline,
        lag_s: None,
    };
}

/// Curves of both triads and the lags of their dies.
#[derive(Debug, Clone)]
pub struct Joint {
    /// Curves of gyro and accelerometer; none of a triad that was not recorded.
    pub curves: [Option<TriadCurves>; 2],
    /// Likelihoods of the lags of gyro and accelerometer: that of both together, unless the data tell the two apart.
    pub profiles: [Profile; 2],
    /// Whether the temperature goes one way only, so that lag and slope cannot be told apart.
    pub one_way: bool,
    /// Drop in deviance by two lags against one, where they are told apart.
    pub apart: Option<f64>,
    /// Noise of the rows.
    pub noise: [Option<[AxisNoise; 3]>; 2],
    /// How each session began.
    pub starts: Vec<Start>,
    /// What a person should know.
    pub warnings: Vec<String>,
}

impl Joint {
    /// Lag of `sensor` that is applied: given, or determined by the data; none otherwise.
    pub fn lag(&self, sensor: Sensor) -> Option<Lag> {
        let profile = &self.profiles[sensor as usize];
        let determined = profile.lag.is_determined() && !self.one_way;
        (determined || profile.is_given()).then_some(profile.lag)
    }

    /// Lag that the curves of `sensor` are for, s: zero where none is applied. Curves for another lag than that which is applied to them
    /// would be wrong on the very ramp that they come from.
    pub fn applied_s(&self, sensor: Sensor) -> f64 {
        self.lag(sensor).map_or(0.0, |lag| lag.value)
    }

    /// Temperatures of the die of `sensor` in `sessions` by the lag that is applied.
    pub fn dies(&self, sessions: &[Session], sensor: Sensor) -> Vec<Die> {
        let lag = self.applied_s(sensor);
        let each = sessions.iter().zip(&self.starts);
        each.map(|(s, start)| s.thermometer.die(lag, *start))
            .collect()
    }
}

/// One triad with all that does not depend on the lag.
struct Evaluator<'a> {
    sessions: &'a [Session],
    problem: Problem,
    penalties: Penalties,
    noise: [AxisNoise; 3],
    smoothness: Smoothness,
    /// Whether the smoothness is that of the lag which it was found at. Found anew at each lag it stops a little beside its best, by another
    /// part of the criterion each time, and that noise of the profile left intervals that held the lag in 78 of 100 runs.
    settled: bool,
    known: Vec<(f64, Option<TriadFit>)>,
}

impl<'a> Evaluator<'a> {
    fn new(sessions: &'a [Session], sensor: Sensor, shape: Shape) -> Result<Option<Self>> {
        let rows = sessions.iter().map(|s| s.rows[sensor as usize].len());
        if rows.sum::<usize>() == 0 {
            return Ok(None);
        }
        let range = range_of_rows(sessions, sensor);
        let gravity = sessions.iter().any(|s| s.reference == Reference::Gravity);
        let problem = Problem::new(sessions, sensor, shape, range, gravity)?;
        let penalties = Penalties::of(&problem);
        let white = noise::white(&problem).ok_or_else(|| {
            let problem = "no dwell is long enough to see its noise";
            let remedy = "dwell for a second or longer";
            Error::undetermined(format!("{}, {sensor}", sessions[0].place), problem, remedy)
        })?;
        let noise = white.map(|white| AxisNoise {
            white,
            wander: 0.0,
            correlation_s: 1.0,
            parts: 1,
        });
        let smoothness = smoothness::times(&smoothness::largest(&problem), 1e-4);
        Ok(Some(Self {
            sessions,
            problem,
            penalties,
            noise,
            smoothness,
            settled: false,
            known: Vec::new(),
        }))
    }

    /// Die temperatures of the rows.
    fn dies(&self, lag_s: f64, starts: &[Start]) -> Vec<f64> {
        let each = self.sessions.iter().zip(starts);
        let dies: Vec<Die> = each
            .map(|(s, start)| s.thermometer.die(lag_s, *start))
            .collect();
        let rows = self.problem.rows.iter();
        rows.map(|r| dies[r.session].at(r.middle_s)).collect()
    }

    fn evaluate(&mut self, lag_s: f64, starts: &[Start]) -> Option<TriadFit> {
        let dies = self.dies(lag_s, starts);
        let normals = [0, 1, 2]
            .map(|axis| Normal::of(&self.problem, axis, &dies, &self.noise[axis], |_| true));
        if self.settled {
            return smoothness::fixed(&self.problem, &self.penalties, &normals, &self.smoothness);
        }
        let off = |k: &(f64, Option<TriadFit>)| (k.0 - lag_s).abs();
        let nearest = self.known.iter().filter(|k| k.1.is_some());
        let nearest = nearest.min_by(|a, b| off(a).total_cmp(&off(b)));
        let start = match nearest.and_then(|k| k.1.as_ref()) {
            Some(fit) => (&fit.smoothness, smoothness::ITERATIONS[1]),
            None => (&self.smoothness, smoothness::ITERATIONS[0]),
        };
        let fit = smoothness::fit(&self.problem, &self.penalties, &normals, start)?;
        self.smoothness = fit.smoothness;
        Some(fit)
    }

    /// Criterion of a lag; the estimates are kept.
    fn criterion(&mut self, lag_s: f64, starts: &[Start]) -> Option<f64> {
        if let Some((_, fit)) = self.known.iter().find(|k| k.0 == lag_s) {
            return fit.as_ref().map(|f| f.criterion);
        }
        let fit = self.evaluate(lag_s, starts);
        let criterion = fit.as_ref().map(|f| f.criterion);
        self.known.push((lag_s, fit));
        criterion
    }

    /// Noise with the curves at `lag_s`.
    fn learn_noise(&mut self, lag_s: f64, starts: &[Start]) {
        self.known.clear();
        let dies = self.dies(lag_s, starts);
        for _ in 0..ROUNDS {
            for axis in 0..3 {
                self.noise[axis] = noise::estimate(
                    &self.problem,
                    &self.penalties,
                    axis,
                    &dies,
                    &self.smoothness,
                    &self.noise[axis],
                );
                self.noise[axis] = self.with_stated(axis);
            }
            if self.noise.iter().all(|n| n.wander == 0.0) || self.evaluate(lag_s, starts).is_none()
            {
                break;
            }
        }
    }

    /// The noise of `axis` with the wander of its bias that a record at rest states, where the recording shows less: of what is slower than
    /// itself it shows hardly anything.
    fn with_stated(&self, axis: usize) -> AxisNoise {
        let found = self.noise[axis];
        let channel = self.problem.sensor.channels().start + axis;
        let all = self.sessions.iter().filter_map(|s| s.stated[channel]);
        let wander = all.map(|model| AxisNoise::stated_wander(&model, self.problem.gain[axis]));
        let more = wander.filter(|stated| stated.wander > found.wander);
        more.max_by(|a, b| a.wander.total_cmp(&b.wander))
            .map_or(found, |stated| AxisNoise {
                white: found.white,
                ..stated
            })
    }

    /// Finds noise and smoothness at `lag_s`, and keeps them for all lags. The noise too: what a wrong lag leaves of an accelerometer over a
    /// ramp is far beyond its noise.
    fn settle(&mut self, lag_s: f64, starts: &[Start]) {
        self.settled = false;
        self.learn_noise(lag_s, starts);
        self.known.clear();
        // Twice: the second begins where the first ended, and goes on.
        for _ in 0..2 {
            let _ = self.evaluate(lag_s, starts);
        }
        self.settled = true;
    }

    /// Curves averaged over the lags of `profile`; those of no lag where none is applied, with their covariance over all lags.
    fn curves(
        mut self,
        profile: &Profile,
        lag: Option<Lag>,
        starts: &[Start],
        range_c: [f64; 2],
    ) -> TriadCurves {
        let only = lag.is_none().then(|| {
            self.criterion(0.0, starts);
            0.0
        });
        let weight = |lag: f64| {
            let of = profile.weights.iter().find(|w| w.0 == lag);
            of.map_or(0.0, |w| w.1)
        };
        let used = self.known.into_iter().filter_map(|(lag, fit)| {
            let likelihood = weight(lag);
            let used = likelihood > 0.0 || only == Some(lag);
            Some((lag, likelihood, fit.filter(|_| used)?))
        });
        let used: Vec<(f64, f64, TriadFit)> = used.collect();
        let sum: f64 = used.iter().map(|f| f.1).sum();
        let fits = used.into_iter().map(|(lag, likelihood, fit)| LagFit {
            fit,
            likelihood: likelihood / sum,
            share: match only {
                Some(only) => f64::from(only == lag),
                None => likelihood / sum,
            },
        });
        TriadCurves::new(self.problem, fits.collect(), range_c)
    }
}

/// Temperatures of the thermometer that rows were taken at, with those of a die that leads by as much as any.
fn range_of_rows(sessions: &[Session], sensor: Sensor) -> [f64; 2] {
    let mut range = [f64::INFINITY, f64::NEG_INFINITY];
    for session in sessions {
        let led = session.thermometer.die(LAGS[0], Start::Settled);
        for row in &session.rows[sensor as usize] {
            let (temp_c, _) = session.thermometer.at(row.middle_s);
            for t in [temp_c, led.at(row.middle_s)] {
                range = [range[0].min(t), range[1].max(t)];
            }
        }
    }
    range
}

/// Temperatures of the thermometer over all rows of `sessions`.
fn measured_range(sessions: &[Session]) -> [f64; 2] {
    let temps = sessions.iter().flat_map(|s| {
        let rows = s.rows.iter().flatten();
        rows.map(|r| s.thermometer.at(r.middle_s).0)
    });
    temps.fold([f64::INFINITY, f64::NEG_INFINITY], |r, t| {
        [r[0].min(t), r[1].max(t)]
    })
}

/// Estimates all curves, and the lag unless it is given.
///
/// # Errors
/// Recordings of several units; a span below 10 K; a sensor whose parameters the inputs do not determine; a ramp that is too fast for the
/// lag.
pub fn estimate(sessions: &[Session], choice: Choice) -> Result<Joint> {
    check_alike(sessions)?;
    let range = measured_range(sessions);
    let span = range[1] - range[0];
    check_span(sessions, span)?;
    let shape = match (choice.shape, Shape::allowed(span)) {
        (_, Shape::Constant) | (Shape::Constant, _) => Shape::Constant,
        (_, Shape::Line) | (Shape::Line, _) => Shape::Line,
        (other, _) => other,
    };
    let mut warnings = Vec::new();
    if shape != choice.shape {
        warnings.push(format!(
            "the recordings span {} K: curves are straight lines, as curvature needs 20 K",
            significant(span)
        ));
    }
    let mut triads = Vec::new();
    for sensor in Sensor::BOTH {
        triads.push(Evaluator::new(sessions, sensor, shape)?);
    }
    let mut starts = vec![Start::Settled; sessions.len()];
    let rough = rough_lag(&mut triads, &mut starts, sessions, choice.lag_s)?;
    for triad in triads.iter_mut().flatten() {
        triad.settle(rough, &starts);
    }
    let (mut profiles, mut apart) = lags(&mut triads, &starts, choice.lag_s)?;
    let mut moved = false;
    for (triad, profile) in triads.iter_mut().zip(&profiles) {
        let lag_s = profile.lag.value;
        if let Some(triad) = triad
            && (lag_s - rough).abs() > SETTLED_S
        {
            triad.settle(lag_s, &starts);
            moved = true;
        }
    }
    if moved {
        (profiles, apart) = lags(&mut triads, &starts, choice.lag_s)?;
    }
    let one_way = profiles.iter().any(|profile| {
        let each = sessions.iter().zip(&starts);
        let die = |(s, start): (&Session, &Start)| s.thermometer.die(profile.lag.value, *start);
        is_one_way(sessions, &each.map(die).collect::<Vec<Die>>())
    });
    let mut joint = Joint {
        curves: [None, None],
        profiles,
        one_way,
        apart,
        noise: [None, None],
        starts,
        warnings,
    };
    for profile in &joint.profiles {
        check_speed(sessions, &profile.lag, span)?;
    }
    let [gyro, accel] = <[_; 2]>::try_from(triads).unwrap_or([None, None]);
    for (k, triad) in [gyro, accel].into_iter().enumerate() {
        let Some(triad) = triad else { continue };
        let dies = joint.dies(sessions, Sensor::BOTH[k]);
        let rows = triad.problem.rows.iter();
        let temps = rows.map(|r| dies[r.session].at(r.middle_s));
        let range_c = temps.fold([f64::INFINITY, f64::NEG_INFINITY], |r, t| {
            [r[0].min(t), r[1].max(t)]
        });
        joint.noise[k] = Some(triad.noise);
        let (profile, lag) = (&joint.profiles[k], joint.lag(Sensor::BOTH[k]));
        joint.curves[k] = Some(triad.curves(profile, lag, &joint.starts, range_c));
    }
    Ok(joint)
}

/// A first lag with white noise, and how each session began: the likelihood chooses.
fn rough_lag(
    triads: &mut [Option<Evaluator<'_>>],
    starts: &mut [Start],
    sessions: &[Session],
    given: Option<f64>,
) -> Result<f64> {
    let mut best = |starts: &[Start]| {
        for triad in triads.iter_mut().flatten() {
            triad.known.clear();
        }
        let lags = given.map_or(LAGS.to_vec(), |lag| vec![lag]);
        let each = lags.into_iter().filter_map(|lag| {
            let sum = total(triads, lag, starts)?;
            Some((lag, sum))
        });
        each.min_by(|a, b| a.1.total_cmp(&b.1))
    };
    let mut found = best(starts).ok_or_else(|| no_solution(sessions))?;
    for k in 0..sessions.len() {
        let [settled, ramp] = [Start::Settled, Start::OnRamp].map(|start| {
            let die = sessions[k].thermometer.die(60.0, start);
            die.at(f64::NEG_INFINITY)
        });
        if (settled - ramp).abs() < START_OFFSET_K {
            continue;
        }
        starts[k] = Start::OnRamp;
        match best(starts) {
            Some(other) if other.1 < found.1 => found = other,
            _ => starts[k] = Start::Settled,
        }
    }
    Ok(found.0)
}

fn total(triads: &mut [Option<Evaluator<'_>>], lag_s: f64, starts: &[Start]) -> Option<f64> {
    let each = triads.iter_mut().flatten();
    each.map(|t| t.criterion(lag_s, starts)).sum()
}

/// The lags of gyro and accelerometer: one for both, or one for each where the likelihood tells them apart and knows either; then the drop
/// in deviance too.
fn lags(
    triads: &mut [Option<Evaluator<'_>>],
    starts: &[Start],
    given: Option<f64>,
) -> Result<([Profile; 2], Option<f64>)> {
    let none = || Error::undetermined("lag", "no lag explains the readings", "record again");
    if let Some(lag_s) = given {
        let criterion = total(triads, lag_s, starts).ok_or_else(none)?;
        let fixed = Profile::fixed(lag_s, criterion);
        return Ok(([fixed.clone(), fixed], None));
    }
    let both = Profile::of(|lag| total(triads, lag, starts)).ok_or_else(none)?;
    let each: Vec<Profile> = triads
        .iter_mut()
        .flatten()
        .filter_map(|t| Profile::of(|lag| t.criterion(lag, starts)))
        .collect();
    if let Ok(each) = <[Profile; 2]>::try_from(each)
        && each.iter().all(|p| p.lag.is_determined())
    {
        let drop = both.criterion - each[0].criterion - each[1].criterion;
        if drop > TWO_LAGS {
            return Ok((each, Some(drop)));
        }
    }
    Ok(([both.clone(), both], None))
}

fn no_solution(sessions: &[Session]) -> Error {
    let place = sessions.first().map_or("thermal", |s| s.place.as_str());
    Error::undetermined(
        place,
        "the rows do not determine the curves at any lag",
        "excite every axis at all temperatures",
    )
}
