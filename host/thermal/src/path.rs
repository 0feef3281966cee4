//! What a recording does with the temperature: one way, or there and back.

use crate::session::Session;
use crate::thermometer::Die;

/// Width of the bins of temperature, K.
const BIN_K: f64 = 5.0;
/// Slower than this share of the fastest ramp the temperature stands.
const STANDS: f64 = 0.1;
/// Share of the range that has to be heated through and cooled through.
const BOTH_WAYS: f64 = 0.25;
/// Share of the range over which the temperature stands somewhere: a soak needs no way back.
const SOAKED: f64 = 0.5;
/// Instants of a record that are looked at, s apart.
const EVERY_S: f64 = 10.0;

/// Whether a recording heats or cools at `t_s` with the slope that is usual for it: 1, -1, or 0 where the temperature stands.
pub fn direction(session: &Session, fastest: f64, t_s: f64) -> i32 {
    match session.thermometer.at(t_s).1 {
        slope if slope.abs() < STANDS * fastest => 0,
        slope if slope > 0.0 => 1,
        _ => -1,
    }
}

/// Slope of the ramp of `session`, K/s: that which nine tenths of its rows do not exceed.
pub fn fastest(session: &Session) -> f64 {
    let rows = session.rows.iter().flatten();
    let mut slopes: Vec<f64> = rows
        .map(|r| session.thermometer.at(r.middle_s).1.abs())
        .collect();
    slopes.sort_by(f64::total_cmp);
    slopes.get(slopes.len() * 9 / 10).copied().unwrap_or(0.0)
}

/// Whether lag and slope cannot be told apart, because no session comes back to temperatures that it has been at, nor stands at several.
pub fn is_one_way(sessions: &[Session], dies: &[Die]) -> bool {
    sessions.iter().zip(dies).all(|(s, die)| one_way(s, die))
}

fn one_way(session: &Session, die: &Die) -> bool {
    let [low, high] = die.range();
    let bins = ((high - low) / BIN_K).ceil().max(1.0) as usize;
    let mut seen = vec![[false; 3]; bins];
    let fastest = fastest(session);
    let from = session.thermometer.start_s();
    let count = (session.thermometer.duration_s() / EVERY_S) as usize;
    for k in 0..=count {
        let t_s = from + k as f64 * EVERY_S;
        let bin = (((die.at(t_s) - low) / BIN_K) as usize).min(bins - 1);
        let way = direction(session, fastest, t_s) + 1;
        seen[bin][way.clamp(0, 2) as usize] = true;
    }
    let share =
        |of: fn(&[bool; 3]) -> bool| seen.iter().filter(|s| of(s)).count() as f64 / bins as f64;
    share(|s| s[0] && s[2]) < BOTH_WAYS && share(|s| s[1]) < SOAKED
}
