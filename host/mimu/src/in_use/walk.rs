//! One pass over the samples of a recording: means over its rests, dead reckoning over its segments.

use nalgebra::Vector3;

use super::dead_reckoning::DeadReckoning;
use super::state::Readings;
use crate::calibration::Calibration;
use crate::calibration::apply::Compensated;
use crate::quantity::{PerSensor, Sensor};
use crate::triad::Forward;
use mimu_recording::{Batch, Recording, Result};

/// Longest interval in which samples are lost that is followed, s: no variance allows for what the unit did in it.
const BRIDGED_S: f64 = 0.025;

/// Corner of the filter above which acceleration counts as vibration, Hz. A hand moves a unit below it.
pub const VIBRATION_HZ: f64 = 10.0;

/// A segment to dead reckon, and the instant within it to mark.
#[derive(Debug, Clone, Copy)]
pub(super) struct Span {
    pub start_s: f64,
    pub mark_s: Option<f64>,
    pub end_s: f64,
}

/// A segment as it was reckoned; `None` if samples were missing in it.
pub(super) type Reckoned = Option<DeadReckoning>;

/// Means over the rests, and the segments.
pub(super) struct Walked {
    pub rests: Vec<Readings>,
    pub spans: Vec<Reckoned>,
    /// Readings at the beginning and at the end of each segment.
    pub ends: Vec<[Readings; 2]>,
}

/// A Butterworth high pass of second order for each axis: what is above [`VIBRATION_HZ`].
struct HighPass {
    b: [f64; 3],
    a: [f64; 2],
    held: [Vector3<f64>; 4],
    begun: bool,
}

impl HighPass {
    /// For samples at `rate_hz`; at less than four times the corner nothing passes.
    fn new(rate_hz: f64) -> Self {
        let k = (std::f64::consts::PI * VIBRATION_HZ / rate_hz)
            .min(1.0)
            .tan();
        let norm = 1.0 / (1.0 + std::f64::consts::SQRT_2 * k + k * k);
        let passes = rate_hz >= 4.0 * VIBRATION_HZ;
        let gain = if passes { norm } else { 0.0 };
        Self {
            b: [gain, -2.0 * gain, gain],
            a: [
                2.0 * (k * k - 1.0) * norm,
                (1.0 - std::f64::consts::SQRT_2 * k + k * k) * norm,
            ],
            held: [Vector3::zeros(); 4],
            begun: false,
        }
    }

    fn take(&mut self, x: Vector3<f64>) -> Vector3<f64> {
        if !self.begun {
            (self.held[0], self.held[1], self.begun) = (x, x, true);
        }
        let [x1, x2, y1, y2] = self.held;
        let y = x * self.b[0] + x1 * self.b[1] + x2 * self.b[2] - y1 * self.a[0] - y2 * self.a[1];
        self.held = [x, x1, y, y1];
        y
    }
}

/// Sums over the rests and segments, sample by sample.
struct Walk<'a, B> {
    rests: &'a [[f64; 2]],
    spans: &'a [Span],
    period_s: f64,
    begin: B,
    before: Option<(f64, Readings)>,
    rest: usize,
    span: usize,
    started: bool,
    open: Reckoned,
    walked: Walked,
}

impl<B: FnMut(usize, &[Readings]) -> DeadReckoning> Walk<'_, B> {
    /// Takes the sample `now` at `t`.
    fn take(&mut self, t: f64, now: Readings) {
        let Some((t0, last)) = self.before.replace((t, now)) else {
            return;
        };
        let mean = last.mean_with(&now, t - t0);
        self.rest_through(t0, t, &mean);
        self.follow_through(t0, t, &mean);
    }

    /// Adds what lies within a rest.
    fn rest_through(&mut self, t0: f64, t: f64, mean: &Readings) {
        while self.rests.get(self.rest).is_some_and(|r| r[1] <= t0) {
            self.rest += 1;
        }
        if let Some([from, to]) = self.rests.get(self.rest)
            && t0 >= *from
            && t <= *to
        {
            add(&mut self.walked.rests[self.rest], mean);
        }
    }

    /// Follows the segments from `t0` to `t`, which may lie in several of them.
    fn follow_through(&mut self, t0: f64, t: f64, mean: &Readings) {
        let dt = t - t0;
        let missing = dt > 1.5 * self.period_s && dt > BRIDGED_S;
        let mut from = t0;
        while let Some(own) = self.spans.get(self.span) {
            if t <= own.start_s {
                break;
            }
            if !self.started {
                self.started = true;
                let through = self.rests.partition_point(|r| r[1] <= own.start_s + 1e-9);
                self.open = Some((self.begin)(self.span, &self.walked.rests[..through]));
                self.walked.ends[self.span][0] = *mean;
                from = from.max(own.start_s);
            }
            let to = t.min(own.end_s);
            if missing {
                self.open = None;
            }
            if let Some(reckoned) = &mut self.open {
                follow(reckoned, own, [from, to], mean);
            }
            if t < own.end_s {
                break;
            }
            if let Some(reckoned) = &mut self.open {
                reckoned.close();
            }
            self.walked.ends[self.span][1] = *mean;
            self.walked.spans[self.span] = self.open.take();
            (self.span, self.started, from) = (self.span + 1, false, to);
        }
    }
}

/// Reckons `own` on with `mean` from the one instant to the other, and marks it between them.
fn follow(reckoned: &mut DeadReckoning, own: &Span, [from, to]: [f64; 2], mean: &Readings) {
    let go = |reckoned: &mut DeadReckoning, duration_s: f64| {
        reckoned.follow(&Readings {
            duration_s,
            ..*mean
        });
    };
    match own.mark_s.filter(|m| (from..to).contains(m)) {
        Some(mark) => {
            if mark > from {
                go(reckoned, mark - from);
            }
            reckoned.mark();
            go(reckoned, to - mark);
        }
        None if to > from => go(reckoned, to - from),
        None => {}
    }
}

/// Walks over `recording`, calibrated. `rests` and `spans` are in order of time; `begin` begins a segment, by its index and the means of the rests
/// before it.
pub(super) fn walk(
    recording: &Recording,
    calibration: &Calibration,
    rests: &[[f64; 2]],
    spans: &[Span],
    begin: impl FnMut(usize, &[Readings]) -> DeadReckoning,
    progress: impl Fn(f64),
) -> Result<Walked> {
    let forward = PerSensor::from_fn(|s| calibration.inverse(s).and_then(|c| Forward::of(&c)));
    let mut high = HighPass::new(recording.manifest.sample_rate_hz);
    let mut walk = Walk {
        rests,
        spans,
        period_s: 1.0 / recording.manifest.sample_rate_hz,
        begin,
        before: None,
        rest: 0,
        span: 0,
        started: false,
        open: None,
        walked: Walked {
            rests: vec![Readings::default(); rests.len()],
            spans: vec![None; spans.len()],
            ends: vec![[Readings::default(); 2]; spans.len()],
        },
    };
    let mut compensated = Compensated::new(recording, calibration, |share| progress(0.5 * share))?;
    compensated.for_each(
        |share| progress(0.5 + 0.5 * share),
        |_, clean| {
            for row in 0..clean.len() {
                if let Some(mut now) = readings(clean, row, &forward) {
                    now.vibration = high.take(now.force).norm_squared();
                    walk.take(clean.t_s[row], now);
                }
            }
            Ok(())
        },
    )?;
    let mut walked = walk.walked;
    for rest in &mut walked.rests {
        *rest = rest.mean();
    }
    Ok(walked)
}

impl Readings {
    /// Their mean, of sums over a time; nothing changes if that is none.
    pub fn mean(&self) -> Self {
        let t = if self.duration_s > 0.0 {
            self.duration_s
        } else {
            1.0
        };
        Self {
            rate: self.rate / t,
            force: self.force / t,
            raw: PerSensor::from_fn(|s| self.raw[s] / t),
            vibration: self.vibration / t,
            ..*self
        }
    }

    /// The mean of two samples that are `duration_s` apart.
    fn mean_with(&self, next: &Self, duration_s: f64) -> Self {
        Self {
            duration_s,
            rate: (self.rate + next.rate) * 0.5,
            force: (self.force + next.force) * 0.5,
            raw: PerSensor::from_fn(|s| (self.raw[s] + next.raw[s]) * 0.5),
            vibration: 0.5 * (self.vibration + next.vibration),
        }
    }
}

/// Adds `mean`, times its duration, to `sum`.
fn add(sum: &mut Readings, mean: &Readings) {
    let dt = mean.duration_s;
    sum.duration_s += dt;
    sum.rate += mean.rate * dt;
    sum.force += mean.force * dt;
    sum.vibration += mean.vibration * dt;
    sum.raw = PerSensor::from_fn(|s| sum.raw[s] + mean.raw[s] * dt);
}

/// The sample of `row`; `None` if an axis has no reading.
fn readings(clean: &Batch, row: usize, forward: &PerSensor<Option<Forward>>) -> Option<Readings> {
    let of = |s: Sensor| {
        let from = s.channels().start;
        Vector3::from_fn(|i, _| clean.raw[from + i][row])
    };
    let (rate, force) = (of(Sensor::Gyro), of(Sensor::Accel));
    let whole = rate.iter().chain(force.iter()).all(|v| v.is_finite());
    whole.then(|| Readings {
        duration_s: 0.0,
        rate,
        force,
        raw: PerSensor::from_fn(|s| {
            let clean = if s == Sensor::Gyro { rate } else { force };
            forward[s].map_or(clean, |f| f.apply(&clean))
        }),
        vibration: 0.0,
    })
}
