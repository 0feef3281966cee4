//! Exact D-optimal designs on a list of candidates: the modified Fedorov exchange of Cook and Nachtsheim
//! (Technometrics 22, 1980) from many random starts.
//!
//! Exchanging row f of a design for row g multiplies `det F'F` by `(1 + g'Ag)(1 - f'Af) + (f'Ag)²`, A =
//! (F'F)⁻¹ (Fedorov, *Theory of Optimal Experiments*, 1972). Each point in turn is exchanged for the best
//! candidate; Fedorov's own rule, the best of all pairs, looks at n times as many pairs for each exchange.

use rayon::prelude::*;

use super::information::{Inverse, Rows, dot};

/// An exact design on a list of candidates.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// Index of the candidate of each dwell, ascending; a candidate may occur more than once.
    pub points: Vec<usize>,
    /// Logarithm of `det F'F`.
    pub log_det: f64,
}

/// Gain in the determinant below which an exchange is rounding.
const GAIN: f64 = 1e-9;
/// Most passes over the design from one start.
const PASSES: usize = 100;
/// Candidates drawn for each point of a random start. More would make the starts better, but alike.
const DRAWS: usize = 8;

/// Best designs of `n` points found, the best first, each once.
///
/// `starts` random starts, determinate for a `seed`. Empty if no `n` of the candidates determine the
/// parameters, beside what the rows have as given.
pub fn search(rows: &Rows, n: usize, starts: usize, seed: u64) -> Vec<Found> {
    let too_few = !rows.has_given() && n < rows.width();
    if rows.is_empty() || too_few {
        return Vec::new();
    }
    let run = |start: usize| {
        let mut random = SplitMix(seed ^ (start as u64).wrapping_mul(0xd1b5_4a32_d192_ed03));
        improve(rows, random_start(rows, n, &mut random)?)
    };
    let mut found: Vec<Found> = (0..starts).into_par_iter().filter_map(run).collect();
    found.sort_by(|a, b| b.log_det.total_cmp(&a.log_det));
    found.dedup_by(|a, b| a.points == b.points);
    found
}

/// Points added one by one, each the one of a few drawn that adds most to the determinant.
fn random_start(rows: &Rows, n: usize, random: &mut SplitMix) -> Option<Vec<usize>> {
    let mut inverse = Inverse::ridge(rows)?;
    let mut points = Vec::with_capacity(n);
    for _ in 0..n {
        let gain = |&i: &usize| inverse.variance(rows.row(i));
        let drawn = std::iter::repeat_with(|| random.below(rows.len())).take(DRAWS);
        let Some(best) = drawn.max_by(|a, b| gain(a).total_cmp(&gain(b))) else {
            break;
        };
        inverse.update(rows.row(best), 1.0);
        points.push(best);
    }
    Some(points)
}

/// Exchanges until none helps. `None` if the start is singular.
fn improve(rows: &Rows, mut points: Vec<usize>) -> Option<Found> {
    let inverse = |points: &[usize]| Inverse::of(rows, points.iter().copied());
    for _ in 0..PASSES {
        // Computed again in each pass, because updates accumulate rounding.
        let mut inverse = inverse(&points)?;
        let each = 0..rows.len();
        let mut variances: Vec<f64> = each.map(|j| inverse.variance(rows.row(j))).collect();
        let mut exchanged = false;
        for out in &mut points {
            let v = inverse.times(rows.row(*out));
            let keep = 1.0 - variances[*out];
            let gain = |(j, d): (usize, &f64)| {
                let cross = dot(&v, rows.row(j));
                (1.0 + d) * keep + cross * cross
            };
            let gains = variances.iter().enumerate().map(gain).enumerate();
            let best = gains.max_by(|a, b| a.1.total_cmp(&b.1));
            let Some((into, _)) = best.filter(|(_, gain)| *gain > 1.0 + GAIN) else {
                continue;
            };
            for (i, weight) in [(into, 1.0), (*out, -1.0)] {
                let v = inverse.times(rows.row(i));
                let factor = weight / (1.0 + weight * dot(&v, rows.row(i)));
                for (j, d) in variances.iter_mut().enumerate() {
                    let cross = dot(&v, rows.row(j));
                    *d -= factor * cross * cross;
                }
                inverse.update(rows.row(i), weight);
            }
            *out = into;
            exchanged = true;
        }
        if !exchanged {
            break;
        }
    }
    points.sort_unstable();
    let log_det = inverse(&points)?.log_det();
    Some(Found { points, log_det })
}

/// Random numbers for starts and randomised orders: SplitMix64 (Steele, Lea and Flood, OOPSLA 2014), the same on
/// every machine.
pub(super) struct SplitMix(pub(super) u64);

impl SplitMix {
    /// A number below `end`. The remainder's bias, `end` in 2⁶⁴, is of no consequence here.
    pub(super) fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }

    /// A number of 64 bits.
    pub(super) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
}
