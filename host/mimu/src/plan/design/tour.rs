//! Time and order of a sequence of dwells.

use super::exchange::SplitMix;
use super::model::Setting;
use super::reach::Fixture;

/// Order of the dwells of a design.
///
/// Biases wander, and neighbouring dwells share most of this error. If their inputs are similar, the error goes into the
/// parameters that depend on the difference between such groups, and no residual shows it. In a randomised order it is
/// scatter like any other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// The one with the shortest moves found, in which similar settings are neighbours.
    Shortest,
    /// Randomised.
    Randomised,
}

impl Order {
    /// Name as on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Shortest => "shortest",
            Self::Randomised => "randomised",
        }
    }
}

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

    /// The settings in an order with short moves: nearest neighbours from every start, then 2-opt (Croes,
    /// 1958).
    pub fn shortest(&self, settings: &[Setting]) -> Vec<Setting> {
        let each =
            (0..settings.len()).map(|start| self.two_opt(self.nearest_neighbours(settings, start)));
        let shorter = |a: Vec<Setting>, b: Vec<Setting>| {
            if self.moves_s(&b) < self.moves_s(&a) - 1e-9 {
                b
            } else {
                a
            }
        };
        each.reduce(shorter).unwrap_or_default()
    }

    fn nearest_neighbours(&self, settings: &[Setting], start: usize) -> Vec<Setting> {
        let mut left = settings.to_vec();
        let mut tour = vec![left.remove(start)];
        while let Some(last) = tour.last()
            && !left.is_empty()
        {
            let time = |s: &Setting| self.between(last, s);
            let near = (0..left.len()).min_by(|a, b| time(&left[*a]).total_cmp(&time(&left[*b])));
            let next = left.remove(near.unwrap_or(0));
            tour.push(next);
        }
        tour
    }

    /// Reverses segments of the sequence while that shortens it. Times are the same both ways.
    fn two_opt(&self, mut tour: Vec<Setting>) -> Vec<Setting> {
        let n = tour.len();
        loop {
            let mut shortened = false;
            for i in 0..n {
                for j in i + 1..n {
                    // The ends are free: a segment at one of them has one edge to exchange.
                    let time = |a: Option<&Setting>, b: Option<&Setting>| match (a, b) {
                        (Some(a), Some(b)) => self.between(a, b),
                        (None, Some(s)) => s.rate.abs() / self.acceleration,
                        _ => 0.0,
                    };
                    let before = i.checked_sub(1).and_then(|k| tour.get(k));
                    let after = tour.get(j + 1);
                    let (first, last) = (tour.get(i), tour.get(j));
                    let now = time(before, first) + time(last, after);
                    if time(before, last) + time(first, after) < now - 1e-9 {
                        tour[i..=j].reverse();
                        shortened = true;
                    }
                }
            }
            if !shortened {
                return tour;
            }
        }
    }
}
