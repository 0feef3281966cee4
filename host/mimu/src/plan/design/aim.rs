//! Poses as a person takes them: near those of the plan.
//!
//! Few poses beside a prior leave combinations of parameters open, and how much of these enters the others depends on where the poses really are: on six faces hit
//! exactly, the angles between the axes do not matter; 3 degrees beside them, they enter the scale factors. More poses than parameters make this small.

use std::f64::consts::TAU;

use nalgebra::Vector3;

use super::exchange::SplitMix;
use super::model::Setting;

/// Draws of a person's poses. The median of a half-width over them is certain to about 5 %.
const DRAWS: usize = 200;
/// Seed of the draws: the same design has the same figures.
const SEED: u64 = 1;

/// Poses that a person takes for `settings`, with this standard deviation about each level axis, rad: several draws.
pub(super) fn taken(settings: &[Setting], aim: f64) -> impl Iterator<Item = Vec<Setting>> {
    let mut random = SplitMix(SEED);
    (0..DRAWS).map(move |_| settings.iter().map(|s| near(s, aim, &mut random)).collect())
}

fn near(setting: &Setting, aim: f64, random: &mut SplitMix) -> Setting {
    let up = setting.up;
    let side = up.cross(&Vector3::ith(up.iamin(), 1.0)).normalize();
    let [a, b] = normals(random).map(|n| n * aim);
    Setting {
        up: (up + side * a + up.cross(&side) * b).normalize(),
        ..*setting
    }
}

/// Two independent standard normal numbers (Box and Muller).
fn normals(random: &mut SplitMix) -> [f64; 2] {
    // More than a `usize` has in the browser.
    const STEPS: u64 = 1 << 52;
    let mut uniform = || ((random.next() % STEPS) as f64 + 0.5) / STEPS as f64;
    let (radius, (sine, cosine)) = ((-2.0 * uniform().ln()).sqrt(), (TAU * uniform()).sin_cos());
    [radius * cosine, radius * sine]
}

/// Median; infinite values count as the largest.
pub(super) fn median(mut values: Vec<f64>) -> f64 {
    mimu_recording::statistics::quantile(&mut values, 0.5).unwrap_or(f64::NAN)
}
