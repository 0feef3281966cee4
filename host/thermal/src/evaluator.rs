//! One triad: its curves and the likelihood for each lag, with noise and smoothness that are found at one of them.

use mimu::quantity::Sensor;
use mimu_recording::{Error, Reference, Result};

use crate::basis::Shape;
use crate::curves::{LagFit, TriadCurves};
use crate::noise;
use crate::profile::{LAGS, Lag, Profile};
use crate::regression::{AxisNoise, Normal, Problem};
use crate::session::Session;
use crate::smoothness::{self, Penalties, Smoothness, TriadFit};
use crate::thermometer::{Die, Start};

/// Rounds in which noise and smoothness are estimated in turn, if the bias wanders: each depends on the other.
const ROUNDS: usize = 4;

/// One triad with all that does not depend on the lag.
pub(crate) struct Evaluator<'a> {
    sessions: &'a [Session],
    pub(crate) problem: Problem,
    penalties: Penalties,
    pub(crate) noise: [AxisNoise; 3],
    smoothness: Smoothness,
    /// Whether the smoothness of one lag is kept for all. Estimated anew at each lag, it stops slightly off its best, by a different amount
    /// of the criterion each time. With that noise in the profile, the intervals contained the lag in only 78 of 100 runs.
    settled: bool,
    known: Vec<(f64, Option<TriadFit>)>,
}

impl<'a> Evaluator<'a> {
    pub(crate) fn new(
        sessions: &'a [Session],
        sensor: Sensor,
        shape: Shape,
    ) -> Result<Option<Self>> {
        let rows = sessions.iter().map(|s| s.rows[sensor].len());
        if rows.sum::<usize>() == 0 {
            return Ok(None);
        }
        let range = range_of_rows(sessions, sensor);
        let gravity = sessions.iter().any(|s| s.reference == Reference::Gravity);
        let problem = Problem::new(sessions, sensor, shape, range, gravity)?;
        let penalties = Penalties::of(&problem);
        let white = noise::white(&problem).ok_or_else(|| {
            let problem = "no dwell is long enough to show its noise";
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

    /// Discards the estimates, for example if sessions begin differently.
    pub(crate) fn forget(&mut self) {
        self.known.clear();
    }

    /// Criterion of a lag; the estimates are kept.
    pub(crate) fn criterion(&mut self, lag_s: f64, starts: &[Start]) -> Option<f64> {
        if let Some((_, fit)) = self.known.iter().find(|k| k.0 == lag_s) {
            return fit.as_ref().map(|f| f.criterion);
        }
        let fit = self.evaluate(lag_s, starts);
        let criterion = fit.as_ref().map(|f| f.criterion);
        self.known.push((lag_s, fit));
        criterion
    }

    /// For each axis its best lag among those tried, and the loss of its criterion at `lag_s`.
    pub(crate) fn by_axis(&self, lag_s: f64) -> Option<[(f64, f64); 3]> {
        let tried = || {
            let each = self.known.iter();
            each.filter_map(|(lag, fit)| Some((*lag, fit.as_ref()?.by_axis)))
        };
        let (_, here) = tried().find(|(lag, _)| *lag == lag_s)?;
        let best = |axis: usize| {
            let each = tried().map(|(lag, by_axis)| (lag, by_axis[axis]));
            each.min_by(|a, b| a.1.total_cmp(&b.1))
        };
        let of = |axis: usize| best(axis).map(|(lag, least)| (lag, here[axis] - least));
        Some([of(0)?, of(1)?, of(2)?])
    }

    /// Estimates the noise with the curves at `lag_s`.
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
                self.noise[axis] = self.with_noise_at_rest(axis);
            }
            if self.noise.iter().all(|n| n.wander == 0.0) || self.evaluate(lag_s, starts).is_none()
            {
                break;
            }
        }
    }

    /// The noise of `axis`. If a record at rest gives more bias wander than the recording shows, that wander is used: a recording hardly
    /// shows wander slower than itself.
    fn with_noise_at_rest(&self, axis: usize) -> AxisNoise {
        let found = self.noise[axis];
        let channel = self.problem.sensor.channels().start + axis;
        let all = self
            .sessions
            .iter()
            .filter_map(|s| s.noise_at_rest[channel]);
        let wander = all.map(|model| AxisNoise::wander_at_rest(&model, self.problem.gain[axis]));
        let more = wander.filter(|at_rest| at_rest.wander > found.wander);
        more.max_by(|a, b| a.wander.total_cmp(&b.wander))
            .map_or(found, |at_rest| AxisNoise {
                white: found.white,
                ..at_rest
            })
    }

    /// Finds noise and smoothness at `lag_s`, and keeps them for all lags. The noise is kept too, because an accelerometer's residuals over
    /// a ramp with a wrong lag far exceed its noise.
    pub(crate) fn settle(&mut self, lag_s: f64, starts: &[Start]) {
        self.settled = false;
        self.learn_noise(lag_s, starts);
        self.known.clear();
        // Twice: the second continues where the first ended.
        for _ in 0..2 {
            let _ = self.evaluate(lag_s, starts);
        }
        self.settled = true;
    }

    /// Curves averaged over the lags of `profile`; if no lag is applied, the curves without lag, with the covariance over all lags.
    pub(crate) fn curves(
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
        // If another sensor determined the lag, this one has not evaluated these lags yet.
        for (lag, _) in profile.weights.iter().filter(|w| w.1 > 0.0) {
            self.criterion(*lag, starts);
        }
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

/// Range of temperatures of the rows, by the thermometer and by a die with the largest lead.
fn range_of_rows(sessions: &[Session], sensor: Sensor) -> [f64; 2] {
    let mut range = [f64::INFINITY, f64::NEG_INFINITY];
    for session in sessions {
        let led = session.thermometer.die(LAGS[0], Start::Settled);
        for row in &session.rows[sensor] {
            let (temp_c, _) = session.thermometer.at(row.middle_s);
            for t in [temp_c, led.at(row.middle_s)] {
                range = [range[0].min(t), range[1].max(t)];
            }
        }
    }
    range
}
