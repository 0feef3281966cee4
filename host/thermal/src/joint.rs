//! The joint estimate of all curves and of the lag.

use mimu::quantity::{PerSensor, Sensor};
use mimu::signal::blocks::extent;
use mimu_recording::error::{Error, Result};

use crate::basis::Shape;
use crate::curves::TriadCurves;
use crate::evaluator::Evaluator;
use crate::path::is_one_way;
use crate::profile::{LAGS, Lag, Profile};
use crate::regression::AxisNoise;
use crate::session::Session;
use crate::suitability::{Spans, check_alike, check_speed};
use crate::thermometer::{Die, Start};
use crate::warning::Warning;

/// If the best lag differs by more than this, s, from that at which the smoothness was estimated, the smoothness is estimated anew.
const SETTLED_S: f64 = 0.5;
/// Drop in deviance that distinguishes the lags of gyro and accelerometer: one degree of freedom at 1 %.
const TWO_LAGS: f64 = 6.63;
/// The axes contradict each other if a common lag costs more than this in deviance and their separate lags differ by more than this, s. The
/// limit is that of five degrees of freedom at 1e-5, because noise that deviates from the model increases the deviance.
const CONTRADICT: f64 = 30.0;
const CONTRADICT_S: f64 = 10.0;
/// An axis that loses less agrees with the common lag.
const CONTENT: f64 = 6.63;
/// If the start of a session with a lag of a minute depends on the die's state by more than this, K, both states are tried.
const START_OFFSET_K: f64 = 0.2;

/// How the curves are estimated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    /// Shape of the curves.
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
    /// Curves; none of a triad that was not recorded.
    pub curves: PerSensor<Option<TriadCurves>>,
    /// Likelihoods of the lags: that of both together, unless the data distinguish the two.
    pub profiles: PerSensor<Profile>,
    /// Whether the temperature goes one way only, so that lag and slope cannot be distinguished.
    pub one_way: bool,
    /// Drop in deviance of two lags against one, if they are distinguished.
    pub apart: Option<f64>,
    /// Lowest and highest separate lag of the axes, s, if a common lag contradicts them.
    pub contradicted: PerSensor<Option<[f64; 2]>>,
    /// Noise of the rows.
    pub noise: PerSensor<Option<[AxisNoise; 3]>>,
    /// How each session began.
    pub starts: Vec<Start>,
    /// What a person should know.
    pub warnings: Vec<Warning>,
}

impl Joint {
    /// Curves of the triads that were recorded.
    pub fn recorded(&self) -> impl Iterator<Item = &TriadCurves> {
        self.curves.present().map(|(_, curves)| curves)
    }

    /// Lag of `sensor` that is applied: given, or determined by the data; none otherwise.
    pub fn lag(&self, sensor: Sensor) -> Option<Lag> {
        let profile = &self.profiles[sensor];
        let determined =
            profile.lag.is_determined() && !self.one_way && self.contradicted[sensor].is_none();
        (determined || profile.is_given()).then_some(profile.lag)
    }

    /// Lag for which the curves of `sensor` are estimated, s: zero if none is applied. Curves used with another lag would be wrong even on
    /// the ramp from which they were estimated.
    pub fn applied_s(&self, sensor: Sensor) -> f64 {
        self.lag(sensor).map_or(0.0, |lag| lag.value)
    }

    /// Temperatures of the die of `sensor` in `sessions` with the applied lag.
    pub fn dies(&self, sessions: &[Session], sensor: Sensor) -> Vec<Die> {
        let lag = self.applied_s(sensor);
        let each = sessions.iter().zip(&self.starts);
        each.map(|(s, start)| s.thermometer.die(lag, *start))
            .collect()
    }
}

/// Estimates all curves, and the lag unless it is given.
///
/// # Errors
/// Recordings of several units; a span below 10 K; a sensor whose parameters the inputs do not determine; a ramp that is too fast for the
/// lag.
pub fn estimate(sessions: &[Session], choice: Choice) -> Result<Joint> {
    check_alike(sessions)?;
    let mut warnings = Vec::new();
    let spans = Spans::of(sessions);
    spans.check(sessions, &mut warnings)?;
    let range = spans.range();
    let span = range[1] - range[0];
    let evaluator = |sensor| Evaluator::new(sessions, sensor, choice.shape);
    let mut triads = [evaluator(Sensor::Gyro)?, evaluator(Sensor::Accel)?];
    // A bias that jumps while the temperature moves looks like a lag of minutes: then the accelerometer alone determines the lag.
    let jumps = sessions.iter().any(|s| !s.bias_jumps.is_empty());
    let telling = usize::from(jumps && triads[Sensor::Accel as usize].is_some());
    let mut starts = vec![Start::Settled; sessions.len()];
    let rough = rough_lag(&mut triads[telling..], &mut starts, sessions, choice.lag_s)?;
    for triad in triads.iter_mut().flatten() {
        triad.settle(rough, &starts);
    }
    let (mut profiles, mut apart) = lags(&mut triads[telling..], &starts, choice.lag_s)?;
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
        (profiles, apart) = lags(&mut triads[telling..], &starts, choice.lag_s)?;
    }
    let contradicted = match apart {
        None => [contradiction(&triads[telling..], &profiles[0]); 2],
        Some(_) => [0, 1].map(|k| contradiction(&triads[k..=k], &profiles[k])),
    };
    let profiles = PerSensor::from(profiles);
    let one_way = profiles.iter().any(|(_, profile)| {
        let each = sessions.iter().zip(&starts);
        let die = |(s, start): (&Session, &Start)| s.thermometer.die(profile.lag.value, *start);
        is_one_way(sessions, &each.map(die).collect::<Vec<Die>>())
    });
    let mut joint = Joint {
        curves: PerSensor::default(),
        profiles,
        one_way,
        apart,
        contradicted: contradicted.into(),
        noise: PerSensor::default(),
        starts,
        warnings,
    };
    // If lag and slope cannot be distinguished, no lag is applied, and none is checked.
    for (_, profile) in joint.profiles.iter().filter(|_| !one_way) {
        check_speed(sessions, &profile.lag, span)?;
    }
    for (sensor, triad) in PerSensor::from(triads) {
        let Some(triad) = triad else { continue };
        let dies = joint.dies(sessions, sensor);
        let rows = triad.problem.rows.iter();
        let temps = rows.map(|r| dies[r.session].at(r.middle_s));
        let range_c = extent(temps);
        joint.noise[sensor] = Some(triad.noise);
        let (profile, lag) = (&joint.profiles[sensor], joint.lag(sensor));
        joint.curves[sensor] = Some(triad.curves(profile, lag, &joint.starts, range_c));
    }
    Ok(joint)
}

/// Chooses, by the likelihood, a first lag with white noise and how each session began.
fn rough_lag(
    triads: &mut [Option<Evaluator<'_>>],
    starts: &mut [Start],
    sessions: &[Session],
    given: Option<f64>,
) -> Result<f64> {
    let mut best = |starts: &[Start]| {
        for triad in triads.iter_mut().flatten() {
            triad.forget();
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

/// The lags of gyro and accelerometer: one for both, or one for each if the likelihood distinguishes and determines them; then also the
/// drop in deviance.
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

/// Lowest and highest separate lag of the axes of `triads`, if they contradict that of `profile`. All axes of a die share its lag. If they
/// disagree, something else bends the curves, and the best common value is not a lag.
fn contradiction(triads: &[Option<Evaluator<'_>>], profile: &Profile) -> Option<[f64; 2]> {
    if profile.is_given() || !profile.lag.is_determined() {
        return None;
    }
    let each = triads.iter().flatten();
    let axes = each.filter_map(|t| t.by_axis(profile.lag.value)).flatten();
    let axes: Vec<(f64, f64)> = axes.collect();
    let lost: f64 = axes.iter().map(|a| a.1).sum();
    let wanted = axes.iter().filter(|a| a.1 > CONTENT).map(|a| a.0);
    let [from, to] = wanted.fold([profile.lag.value; 2], |r, lag| {
        [r[0].min(lag), r[1].max(lag)]
    });
    (lost > CONTRADICT && to - from > CONTRADICT_S).then_some([from, to])
}

fn no_solution(sessions: &[Session]) -> Error {
    let place = sessions.first().map_or("thermal", |s| s.place.as_str());
    Error::undetermined(
        place,
        "the data do not determine the curves at any lag",
        "excite every axis at all temperatures",
    )
}
