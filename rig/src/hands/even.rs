//! A slow turn instead of a rest: the unit turns slowly and evenly.

use crate::chain::Jet;
use crate::rotation::{Rotation, Vector, norm, scale};

/// Time in which an even turn accelerates, and in which it stops, s; at most a quarter of the dwell.
const RAMP_S: f64 = 0.3;

/// An even turn instead of a rest.
#[derive(Debug, Clone, Copy)]
pub(super) struct Even {
    /// Rate, rad/s, body axes.
    pub(super) rate: Vector,
    /// From the end of the turn to the end of the dwell, s.
    pub(super) span_s: [f64; 2],
}

impl Even {
    /// Axis, and the angle about it at `t_s`, rad.
    pub(super) fn at(&self, t_s: f64) -> (Vector, Jet) {
        let size = norm(self.rate);
        let [from, to] = self.span_s;
        let ramp_s = RAMP_S.min(0.25 * (to - from));
        // Integral of a smooth step of the rate: 5u⁴/2 - 3u⁵ + u⁶, half of it over the whole step.
        let run_up = |t: f64, sign: f64| {
            let u = (t / ramp_s).clamp(0.0, 1.0);
            let u2 = u * u;
            Jet {
                value: ramp_s * u2 * u2 * (2.5 + u * (u - 3.0)) + (t - ramp_s).max(0.0),
                rate: sign * u2 * u * (10.0 + u * (6.0 * u - 15.0)),
                acceleration: 30.0 * u2 * (1.0 - u) * (1.0 - u) / ramp_s,
            }
        };
        let whole_s = to - from - ramp_s;
        let seconds = if t_s < 0.5 * (from + to) {
            run_up((t_s - from).max(0.0), 1.0)
        } else {
            let left = run_up((to - t_s).max(0.0), -1.0);
            Jet::constant(whole_s) + left.times(-1.0)
        };
        (scale(1.0 / size, self.rate), seconds.times(size))
    }

    /// The rotation by the whole turn.
    pub(super) fn turned(&self) -> Rotation {
        let (axis, angle) = self.at(self.span_s[1]);
        Rotation::about(axis, angle.value)
    }
}
