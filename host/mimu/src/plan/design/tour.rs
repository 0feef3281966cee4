//! Time and order of a sequence of dwells.

use super::exchange::SplitMix;
use super::model::Setting;
use super::reach::Fixture;

/// Order of the dwells of a design, in results.
///
/// Biases wander, and neighbouring dwells share most of this error. If their inputs are similar, as in an order with short moves, the error goes into the
/// parameters that depend on the difference between such groups, and no residual shows it. In a randomised order it is scatter like any other.
pub const RANDOMISED: &str = "randomised";

/// The settings in a randomised order (Fisher and Yates), determinate for a `seed`.
pub fn randomised(settings: &[Setting], seed: u64) -> Vec<Setting> {
    let mut drawn = settings.to_vec();
    let mut random = SplitMix(seed);
    for k in (1..drawn.len()).rev() {
        drawn.swap(k, random.below(k + 1));
    }
    drawn
}

/// Speed of the moves between dwells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Rate at which the attitude is changed, rad/s.
    pub slew: f64,
    /// Acceleration up to a dwell's rate and down again, rad/s².
    pub acceleration: f64,
    /// Time between the end of a motion and the start of a dwell, s.
    pub settle_s: f64,
}

impl Motion {
    /// Of a table: 10 deg/s as in niu, 3.2, a second to settle, rates at 100 deg/s². By hand: a quarter turn
    /// in two seconds.
    pub fn of(fixture: Fixture) -> Self {
        let slew_dps: f64 = if fixture == Fixture::Hand { 45.0 } else { 10.0 };
        Self {
            slew: slew_dps.to_radians(),
            acceleration: 100f64.to_radians(),
            settle_s: 1.0,
        }
    }

    /// Time from the dwell at `a` to that at `b`, s. The attitude is changed at rest: a table that turns about two axes
    /// at once would not keep the rate about the vertical.
    pub fn between(&self, a: &Setting, b: &Setting) -> f64 {
        let angle = a.up.angle(&b.up);
        let speed = if angle < 1e-6 {
            (a.rate - b.rate).abs()
        } else {
            a.rate.abs() + b.rate.abs()
        };
        angle / self.slew + speed / self.acceleration + self.settle_s
    }

    /// Time of all moves of a sequence, s: to the first dwell's rate, and between dwells.
    pub fn moves_s(&self, settings: &[Setting]) -> f64 {
        let first = settings
            .first()
            .map_or(0.0, |s| s.rate.abs() / self.acceleration);
        first
            + settings
                .windows(2)
                .map(|w| self.between(&w[0], &w[1]))
                .sum::<f64>()
    }
}
