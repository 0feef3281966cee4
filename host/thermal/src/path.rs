//! The path of the temperature in a recording: one way, or there and back.

use serde::Serialize;

use crate::session::Session;
use crate::thermometer::Die;

/// Bins of temperature over the range of a record.
const BINS: usize = 16;
/// If the temperature changes more slowly than this share of the fastest ramp, it counts as constant.
const STANDS: f64 = 0.1;
/// Least share of the range through which the unit must be heated and cooled.
const BOTH_WAYS: f64 = 0.25;
/// Or least share of the range in which the temperature is constant: a soak needs no way back.
const SOAKED: f64 = 0.5;
/// Spacing of the instants at which a record is evaluated, s.
const EVERY_S: f64 = 10.0;

/// Half of the time over which a slope is taken, s, or this share of the record if that is longer: over less a coarse or noisy thermometer
/// shows false slopes.
const AROUND_S: f64 = 30.0;
const AROUND_SHARE: f64 = 0.01;

/// Slope of the thermometer around `t_s`, K/s.
fn slope(session: &Session, t_s: f64) -> f64 {
    let half = half(session);
    between(session, t_s - half, t_s + half)
}

fn half(session: &Session) -> f64 {
    AROUND_S.max(AROUND_SHARE * session.thermometer.duration_s())
}

/// Slope of the thermometer from one instant to another, K/s, or to the ends of the record.
fn between(session: &Session, from_s: f64, to_s: f64) -> f64 {
    let thermometer = &session.thermometer;
    let from = from_s.max(thermometer.start_s());
    let to = to_s.min(thermometer.start_s() + thermometer.duration_s());
    (thermometer.at(to).0 - thermometer.at(from).0) / (to - from).max(1.0)
}

/// Whether the temperature is constant before or after `t_s`: at the end of a soak the slope around an instant includes the next ramp.
pub fn stands(session: &Session, fastest: f64, t_s: f64) -> bool {
    let half = half(session);
    let sides = [[t_s - half, t_s], [t_s, t_s + half]];
    let slopes = sides.map(|[from, to]| between(session, from, to).abs());
    slopes[0].min(slopes[1]) < STANDS * fastest
}

/// Direction of a temperature.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Way {
    /// It falls.
    Cooling,
    /// It hardly changes.
    Standing,
    /// It rises.
    Heating,
}

/// Direction of the temperature at `t_s`; `fastest` is the slope of the recording's ramp.
pub fn direction(session: &Session, fastest: f64, t_s: f64) -> Way {
    match slope(session, t_s) {
        slope if slope.abs() < STANDS * fastest => Way::Standing,
        slope if slope > 0.0 => Way::Heating,
        _ => Way::Cooling,
    }
}

/// Slope of the ramp of `session`, K/s: that which nine tenths of its record do not exceed.
pub fn fastest(session: &Session) -> f64 {
    let from = session.thermometer.start_s();
    let count = (session.thermometer.duration_s() / EVERY_S) as usize;
    let at = |k: usize| slope(session, from + k as f64 * EVERY_S).abs();
    let mut slopes: Vec<f64> = (0..=count).map(at).collect();
    slopes.sort_by(f64::total_cmp);
    slopes[slopes.len() * 9 / 10]
}

/// Whether lag and slope cannot be distinguished, because no session returns to earlier temperatures or is constant at several.
pub fn is_one_way(sessions: &[Session], dies: &[Die]) -> bool {
    sessions.iter().zip(dies).all(|(s, die)| one_way(s, die))
}

fn one_way(session: &Session, die: &Die) -> bool {
    let [low, high] = die.range();
    let mut seen = [[false; 3]; BINS];
    let fastest = fastest(session);
    let from = session.thermometer.start_s();
    let count = (session.thermometer.duration_s() / EVERY_S) as usize;
    for k in 0..=count {
        let t_s = from + k as f64 * EVERY_S;
        let share = (die.at(t_s) - low) / (high - low).max(1e-9);
        let bin = ((share * BINS as f64) as usize).min(BINS - 1);
        seen[bin][direction(session, fastest, t_s) as usize] = true;
    }
    let share =
        |of: fn(&[bool; 3]) -> bool| seen.iter().filter(|s| of(s)).count() as f64 / BINS as f64;
    let both = |s: &[bool; 3]| s[Way::Cooling as usize] && s[Way::Heating as usize];
    share(both) < BOTH_WAYS && share(|s| s[Way::Standing as usize]) < SOAKED
}
