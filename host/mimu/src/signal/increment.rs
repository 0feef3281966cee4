//! The raw gyro, integrated over about 10 ms at a time, before its calibration is known.

use nalgebra::Vector3;

/// Longest time that one [`Increment`] integrates over, s: at 10 rad/s the unit turns by 0.1 rad, and the error of the second-order coning
/// correction is below 1e-5 rad.
const INCREMENT_S: f64 = 0.01;

/// Longest interval between two samples, s, across which the rate is taken as linear although samples between them are lost: twelve of a log at 100 Hz. The error
/// by the curvature of the rate is in the variance of the turn. A turn by hand of 1 rad/s at 1 Hz curves by up to 7 mrad in it, and by 0.05 mrad in 25 ms.
const BRIDGED_S: f64 = 0.135;

/// Whether a turn is integrated across an interval `dt` in which samples are lost.
pub fn is_bridged(dt: f64) -> bool {
    dt <= BRIDGED_S
}

/// Sample periods for a pause of unknown length, such as a restart of the board: no turn is integrated across it, however short it was.
pub fn pause_periods(rate_hz: f64) -> u64 {
    (2.0 * BRIDGED_S * rate_hz).ceil().max(2.0) as u64
}

/// Integral of the raw gyro readings `u` over about 10 ms, from one sample instant to another, in a form that
/// gives the rotation vector of any affine calibration of them to second order.
///
/// With `ω = C u + o` the rotation vector is (Bortz, second order)
/// `φ = C a + o T + ½ cof(C) b + ½ (C d) × o`, cof(C) being the cofactor matrix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Increment {
    /// Instant at which it ends, s.
    pub end_s: f64,
    /// T, its length, s.
    pub duration_s: f64,
    /// a = ∫ u dt, raw·s.
    pub integral: [f64; 3],
    /// b = ∫ a(t) × u(t) dt, raw²·s².
    pub coning: [f64; 3],
    /// d = 2 ∫ a(t) dt - T a(T), raw·s².
    pub moment: [f64; 3],
    /// Variance of the integral about an axis by the samples that are lost, raw²·s².
    pub lost_variance: f64,
    /// Whether all samples are there and are numbers: false across a gap that is not [bridged](is_bridged).
    pub whole: bool,
}

impl Increment {
    /// Nothing integrated yet.
    pub(crate) const EMPTY: Self = Self {
        end_s: 0.0,
        duration_s: 0.0,
        integral: [0.0; 3],
        coning: [0.0; 3],
        moment: [0.0; 3],
        lost_variance: 0.0,
        whole: true,
    };

    /// The same with `added` to all readings, raw.
    #[must_use]
    pub(crate) fn with_added(mut self, added: &Vector3<f64>) -> Self {
        let [a, b, d] = [self.integral, self.coning, self.moment].map(Vector3::from);
        // A constant rate has no moment.
        self.integral = (a + added * self.duration_s).into();
        self.coning = (b + d.cross(added)).into();
        self
    }
}

/// Integrates raw gyro samples to [`Increment`]s.
///
/// The rate in an interval is the parabola through its ends and the sample before. With a straight line, an oscillation at f loses (2π f dt)²/6 of its coning:
/// a hand of 10 Hz at 200 samples a second 1.6 %.
pub(crate) struct Integrator {
    period_s: f64,
    longest_s: f64,
    before: Option<(f64, [f64; 3])>,
    /// The reading before that, if it was one regular interval earlier.
    earlier: Option<[f64; 3]>,
    open: Increment,
    sum: [f64; 3],
}

impl Integrator {
    pub fn new(period_s: f64) -> Self {
        Self {
            period_s,
            // Half a period of slack, as time stamps jitter.
            longest_s: INCREMENT_S.max(period_s) - 0.5 * period_s,
            before: None,
            earlier: None,
            open: Increment::EMPTY,
            sum: [0.0; 3],
        }
    }

    /// Adds a sample, and whether others before it are missing; returns an increment if one is complete.
    pub fn push(&mut self, t: f64, u: [f64; 3], gap: bool) -> Option<Increment> {
        let (t0, u0) = self.before.replace((t, u))?;
        let dt = t - t0;
        let open = &mut self.open;
        if gap && !is_bridged(dt) || !u.iter().chain(&u0).all(|x| x.is_finite()) {
            open.whole = false;
        }
        let regular = !gap && (dt - self.period_s).abs() < 0.1 * self.period_s;
        if gap {
            // The slope before would lead so far from the straight line: a third of that, times the interval, is what a parabola encloses with it.
            let slope = |k: usize| self.earlier.map_or(0.0, |e| (u0[k] - e[k]) / self.period_s);
            let enclosed = [0, 1, 2].map(|k| (u[k] - u0[k] - slope(k) * dt) * dt / 6.0);
            // Three axes show its size: Student's distribution of three degrees of freedom has three times the variance of their mean square.
            open.lost_variance += enclosed.iter().map(|e| e * e).sum::<f64>();
        }
        let earlier = self.earlier.filter(|_| regular);
        self.earlier = regular.then_some(u0);
        // u(s) = u0 + b s + c s² for s from 0 to 1, integrated once and twice, and its coning.
        let c = [0, 1, 2].map(|k| earlier.map_or(0.0, |e| 0.5 * (u[k] - 2.0 * u0[k] + e[k])));
        let b = [0, 1, 2].map(|k| u[k] - u0[k] - c[k]);
        let a0 = open.integral;
        let step = [0, 1, 2].map(|k| dt * (u0[k] + b[k] / 2.0 + c[k] / 3.0));
        let across = cross(a0, step);
        let (linear, with_u0, with_b) = (cross(u0, b), cross(u0, c), cross(b, c));
        for k in 0..3 {
            let within = (linear[k] + with_u0[k]) / 6.0 + with_b[k] / 30.0;
            open.coning[k] += across[k] + dt * dt * within;
            self.sum[k] += dt * a0[k] + dt * dt * (u0[k] / 2.0 + b[k] / 6.0 + c[k] / 12.0);
            open.integral[k] += step[k];
        }
        open.duration_s += dt;
        open.end_s = t;
        (open.duration_s >= self.longest_s)
            .then(|| self.take())
            .flatten()
    }

    pub fn take(&mut self) -> Option<Increment> {
        let mut done = std::mem::replace(&mut self.open, Increment::EMPTY);
        let sum = std::mem::replace(&mut self.sum, [0.0; 3]);
        done.moment = [0, 1, 2].map(|k| 2.0 * sum[k] - done.duration_s * done.integral[k]);
        (done.duration_s > 0.0).then_some(done)
    }
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}
