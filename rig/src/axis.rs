//! One axis of a table: trapezoidal rates, and the ring-down of the load behind the drive.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

use crate::chain::Jet;

/// Load on a compliant drive: it lags an acceleration, and swings when the acceleration changes.
///
/// The lag obeys `e'' + 2 damping w e' + w² e = -fraction a`, with a the commanded acceleration and w = 2π
/// frequency.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settling {
    /// Natural frequency, Hz.
    pub frequency_hz: f64,
    /// Damping ratio, above 0 and below 1.
    pub damping: f64,
    /// Acceleration of the swing right after a stop, relative to the commanded deceleration. 0 is a rigid drive.
    pub fraction: f64,
}

impl Default for Settling {
    fn default() -> Self {
        Self {
            frequency_hz: 15.0,
            damping: 0.1,
            fraction: 0.2,
        }
    }
}

/// A smaller swing is neglected, rad: a rounding error of an angle.
const QUIET: f64 = 1e-15;

/// Segment of constant commanded acceleration.
#[derive(Debug, Clone, Copy)]
struct Segment {
    start_s: f64,
    angle: f64,
    rate: f64,
    acceleration: f64,
    /// Constant part of the lag, rad.
    lag: f64,
    /// Amplitudes of cosine and sine in the decaying part of the lag, rad.
    swing: [f64; 2],
    /// Time after which the swing is neglected.
    quiet_s: f64,
}

/// Commanded motion of one axis, appended segment by segment and then read forwards.
#[derive(Debug, Clone)]
pub(crate) struct Axis {
    segments: Vec<Segment>,
    cursor: usize,
    end_s: f64,
    decay: f64,
    frequency: f64,
    compliance: f64,
}

impl Axis {
    /// At rest at `angle` (rad) from time 0.
    pub(crate) fn new(angle: f64, settling: Settling) -> Self {
        let w = TAU * settling.frequency_hz;
        Self {
            segments: vec![Segment {
                start_s: 0.0,
                angle,
                rate: 0.0,
                acceleration: 0.0,
                lag: 0.0,
                swing: [0.0; 2],
                quiet_s: 0.0,
            }],
            cursor: 0,
            end_s: 0.0,
            decay: settling.damping * w,
            frequency: w * (1.0 - settling.damping * settling.damping).sqrt(),
            compliance: settling.fraction / (w * w),
        }
    }

    /// End of the last segment, s.
    pub(crate) fn end_s(&self) -> f64 {
        self.end_s
    }

    /// Commanded angle and rate at the end, rad and rad/s.
    pub(crate) fn end(&self) -> (f64, f64) {
        let last = self.segments[self.segments.len() - 1];
        let jet = commanded(&last, self.end_s - last.start_s);
        (jet.value, jet.rate)
    }

    /// From rest to rest at the angle `to` (rad), with limits on rate and acceleration.
    pub(crate) fn move_to(&mut self, to: f64, rate: f64, acceleration: f64) {
        let angle = to - self.end().0;
        // Whole turns leave rounding errors in an angle; these must not cause a motion.
        if angle.abs() < 1e-12 {
            return;
        }
        let peak = rate.min((angle.abs() * acceleration).sqrt());
        let ramp_s = peak / acceleration;
        let cruise_s = (angle.abs() / peak - ramp_s).max(0.0);
        let acceleration = angle.signum() * acceleration;
        self.accelerate(ramp_s, acceleration);
        self.accelerate(cruise_s, 0.0);
        self.accelerate(ramp_s, -acceleration);
        self.push(to, 0.0, 0.0);
    }

    /// To `rate` (rad/s) with an acceleration (rad/s², absolute value).
    pub(crate) fn run_up(&mut self, rate: f64, acceleration: f64) {
        let change = rate - self.end().1;
        if change != 0.0 {
            self.accelerate(change.abs() / acceleration, change.signum() * acceleration);
            self.push(self.end().0, rate, 0.0);
        }
    }

    /// Continues unchanged until `end_s`.
    pub(crate) fn hold_until(&mut self, end_s: f64) {
        self.end_s = self.end_s.max(end_s);
    }

    /// Discards the commands after `t_s` and continues from its state at `t_s`, so angle, rate and swing of the load do not jump. `t_s` must not be
    /// before the time of the last [`Axis::advance`].
    pub(crate) fn cut(&mut self, t_s: f64) {
        // The first segment begins at 0.
        while self.segments.len() > 1 && self.segments[self.segments.len() - 1].start_s > t_s {
            self.segments.pop();
        }
        self.end_s = t_s;
        self.push(self.end().0, self.end().1, 0.0);
    }

    /// Commanded angle at any time, rad.
    pub(crate) fn angle(&self, t_s: f64) -> f64 {
        let after = self.segments.partition_point(|s| s.start_s <= t_s);
        let here = &self.segments[after.saturating_sub(1)];
        commanded(here, t_s - here.start_s).value
    }

    fn accelerate(&mut self, duration_s: f64, acceleration: f64) {
        let (angle, rate) = self.end();
        self.push(angle, rate, acceleration);
        self.end_s += duration_s;
    }

    fn push(&mut self, angle: f64, rate: f64, acceleration: f64) {
        let last = self.segments[self.segments.len() - 1];
        let now = self.lag(&last, self.end_s);
        let lag = -self.compliance * acceleration;
        let cosine = now.value - lag;
        let sine = (now.rate + self.decay * cosine) / self.frequency;
        let size = cosine.hypot(sine);
        let segment = Segment {
            start_s: self.end_s,
            angle,
            rate,
            acceleration,
            lag,
            swing: [cosine, sine],
            quiet_s: self.end_s + (size / QUIET).max(1.0).ln() / self.decay,
        };
        if last.start_s == self.end_s {
            self.segments.pop();
        }
        self.segments.push(segment);
    }

    fn lag(&self, segment: &Segment, t_s: f64) -> Jet {
        let constant = Jet::constant(segment.lag);
        if t_s >= segment.quiet_s {
            return constant;
        }
        let t = t_s - segment.start_s;
        let (s, c) = (self.frequency * t).sin_cos();
        let decayed = (-self.decay * t).exp();
        // The derivative of E (a cos + b sin) has the same form.
        let differentiated = |[a, b]: [f64; 2]| {
            [
                self.frequency * b - self.decay * a,
                -self.frequency * a - self.decay * b,
            ]
        };
        let sum = |[a, b]: [f64; 2]| decayed * (a * c + b * s);
        let first = differentiated(segment.swing);
        constant
            + Jet {
                value: sum(segment.swing),
                rate: sum(first),
                acceleration: sum(differentiated(first)),
            }
    }

    /// Advances to a time. Returns whether nothing moves from here to the end of the segment.
    pub(crate) fn advance(&mut self, t_s: f64) -> bool {
        while self
            .segments
            .get(self.cursor + 1)
            .is_some_and(|next| next.start_s <= t_s)
        {
            self.cursor += 1;
        }
        let here = &self.segments[self.cursor];
        here.rate == 0.0 && here.acceleration == 0.0 && t_s >= here.quiet_s
    }

    /// Index of the segment reached by [`Axis::advance`].
    pub(crate) fn cursor(&self) -> usize {
        self.cursor
    }

    /// Commanded angle, and the lag of the load behind it, at the time of the last [`Axis::advance`], rad.
    pub(crate) fn at(&self, t_s: f64) -> (Jet, Jet) {
        let here = &self.segments[self.cursor];
        (commanded(here, t_s - here.start_s), self.lag(here, t_s))
    }
}

fn commanded(segment: &Segment, t: f64) -> Jet {
    Jet {
        value: segment.angle + t * (segment.rate + 0.5 * t * segment.acceleration),
        rate: segment.rate + t * segment.acceleration,
        acceleration: segment.acceleration,
    }
}

/// The angle nearest to `near` among those that differ from `angle` by whole turns, rad.
pub(crate) fn nearest_turn(angle: f64, near: f64) -> f64 {
    angle + TAU * ((near - angle) / TAU).round()
}
