//! Variances within dwells, pooled over them, and the noise model that is fitted to them.

use super::ChannelNoise;
use crate::signal::blocks::{Block, Condensed};
use crate::signal::dwell::Dwell;
use crate::signal::ramp::ramps;
use mimu_allan::Deviation;
use mimu_allan::deviation::Integrated;
use mimu_allan::gamma::{GammaFit, MeanSquare, sets};
use mimu_allan::variance::AllanModel;

/// Noise of `value` of the blocks within `dwells`.
pub(super) fn within<'a>(
    dwells: impl Iterator<Item = &'a Dwell>,
    condensed: &Condensed,
    value: impl Fn(&Block) -> Option<f64>,
) -> ChannelNoise {
    let (rows, block_s) = block_s(condensed);
    let series = dwells.map(|dwell| {
        let blocks = condensed.blocks[dwell.blocks.clone()].iter();
        let whole = blocks.filter(|b| b.rows == rows);
        Series {
            means: whole.filter_map(&value).collect(),
            ramps: ramps(&condensed.blocks[dwell.blocks.clone()], dwell.duration_s),
        }
    });
    pooled(series, block_s)
}

/// Samples of a full block, and its length, s.
pub(super) fn block_s(condensed: &Condensed) -> (u32, f64) {
    let rows = condensed.blocks.iter().map(|b| b.rows).max().unwrap_or(1);
    (rows, f64::from(rows) * condensed.period_s)
}

/// Means of the blocks of one dwell, one after the other.
pub(super) struct Series {
    pub means: Vec<f64>,
    /// Whether the temperature ramps meanwhile: the reading then drifts with it, linearly over so short a time, and the drift is not noise.
    pub ramps: bool,
}

/// A variance, for one length of the means.
#[derive(Debug, Clone, Copy)]
struct Point {
    tau_s: f64,
    variance: f64,
    /// Number of differences that share no sample: the weight of the point.
    count: f64,
    /// Which variance.
    kind: Deviation,
}

/// The variances that are pooled: a linear drift cancels in the second.
const KINDS: [Deviation; 2] = [Deviation::Allan, Deviation::Hadamard];

/// Variances of one `kind`, by octave of the averaging time, from the series that it applies to (means over `block_s`).
fn points(kind: Deviation, all: &[Series], block_s: f64) -> Vec<Point> {
    // Sum of the variances of all differences, their number, and that of those which share no sample.
    let mut octaves: Vec<(f64, f64, f64)> = Vec::new();
    let of_kind = |s: &&Series| s.ramps == (kind == Deviation::Hadamard);
    for Series { means, .. } in all.iter().filter(of_kind) {
        let Ok(integrated) = Integrated::new(means.clone(), block_s) else {
            continue;
        };
        for octave in 0.. {
            let m = 1usize << octave;
            if kind.order() * m > means.len() {
                break;
            }
            if octaves.len() <= octave {
                octaves.push((0.0, 0.0, 0.0));
            }
            let (terms, sum) = integrated.variances(kind, m);
            octaves[octave].0 += sum;
            octaves[octave].1 += terms as f64;
            octaves[octave].2 += (means.len() / (kind.order() * m)) as f64;
        }
    }
    octaves
        .iter()
        .enumerate()
        .filter(|(_, o)| o.1 > 0.0)
        .map(|(k, o)| Point {
            tau_s: block_s * f64::from(1u32 << k),
            variance: o.0 / o.1,
            count: o.2,
            kind,
        })
        .collect()
}

/// Noise of series of means over `block_s`, pooled.
pub(super) fn pooled(series: impl Iterator<Item = Series>, block_s: f64) -> ChannelNoise {
    let all: Vec<Series> = series.collect();
    let of_kinds = KINDS.map(|kind| points(kind, &all, block_s));
    let model = fit(&of_kinds.concat());
    // A variance of n independent differences is known to √(2/n) of itself.
    let fits = |p: &Point| {
        let [white, flicker, walk] = basis(p);
        let expected = model.white * white + model.flicker * flicker + model.walk * walk;
        (p.variance / expected).ln().abs() <= MISFIT_SIGMAS * (2.0 / p.count).sqrt()
    };
    let misfit = of_kinds
        .iter()
        .flatten()
        .any(|p| p.count >= CURVE_DIFFERENCES && !fits(p));
    // One curve only: the kind of variance with more differences.
    let weight = |points: &[Point]| points.iter().map(|p| p.count).sum::<f64>();
    let [allan, hadamard] = &of_kinds;
    let most = match weight(allan) >= weight(hadamard) {
        true => allan,
        false => hadamard,
    };
    let known: Vec<(f64, f64)> = most
        .iter()
        .filter(|p| p.count >= CURVE_DIFFERENCES && p.variance > 0.0)
        .map(|p| (p.tau_s, p.variance))
        .collect();
    ChannelNoise {
        known: all.iter().any(|s| s.means.len() > 1),
        model,
        curve: (misfit && known.len() >= 2).then_some(known),
    }
}

/// If a point of the Allan curve is this many sigmas from the model, the model is rejected.
const MISFIT_SIGMAS: f64 = 4.0;
/// Points with fewer independent differences do not decide: their variance is known to a half only.
const CURVE_DIFFERENCES: f64 = 8.0;

/// A smaller variance is ignored: the square of its weight would overflow.
const SMALLEST: f64 = 1e-100;

/// A point's variance of white noise, flicker floor and random walk of [`AllanModel`], each with the coefficient 1.
fn basis(point: &Point) -> [f64; 3] {
    let [_, white, flicker, walk, _] = point.kind.basis(point.tau_s);
    [white, flicker, walk]
}

/// Fits the three terms to the points, none of them negative. A term that does not lower the deviance enough is left out.
fn fit(points: &[Point]) -> AllanModel {
    let points = points.iter().filter(|p| p.variance > SMALLEST);
    let squares: Vec<MeanSquare<3>> = points
        .map(|p| MeanSquare {
            value: p.variance,
            dof: p.count,
            basis: basis(p),
        })
        .collect();
    let best = sets(3)
        .filter_map(|terms| GammaFit::of(&squares, terms))
        .filter(|fitted| fitted.terms.iter().all(|k| fitted.coefficients[*k] > 0.0))
        .min_by(|a, b| a.cost().total_cmp(&b.cost()));
    best.map_or_else(AllanModel::default, |best| {
        let [white, flicker, walk] = best.coefficients;
        AllanModel {
            white,
            flicker,
            walk,
        }
    })
}

#[cfg(test)]
mod tests {
    use mimu_rig::random::Random;

    use super::*;

    #[test]
    fn terms_that_made_a_curve_are_found_again() {
        let truth = AllanModel {
            white: 4e-6,
            flicker: 1e-7,
            walk: 2e-9,
        };
        let points: Vec<_> = (0..12)
            .map(|k| 0.1 * f64::from(1 << k))
            .map(|t| Point {
                tau_s: t,
                variance: truth.variance(t),
                count: 1e4,
                kind: Deviation::Allan,
            })
            .collect();
        let found = fit(&points);
        for (a, b) in [
            (truth.white, found.white),
            (truth.flicker, found.flicker),
            (truth.walk, found.walk),
        ] {
            assert!((a / b - 1.0).abs() < 1e-9, "{found:?}");
        }
    }

    #[test]
    fn white_noise_alone_is_given_no_other_term() {
        let points: Vec<_> = (0..6)
            .map(|k| 0.1 * f64::from(1 << k))
            .map(|t| Point {
                tau_s: t,
                variance: 4e-6 / t,
                count: 10.0,
                kind: Deviation::Allan,
            })
            .collect();
        let found = fit(&points);
        assert!(
            (found.white / 4e-6 - 1.0).abs() < 1e-9 && found.variance(100.0) < 4.1e-8,
            "{found:?}"
        );
    }

    fn series(
        ramps: bool,
        dwells: usize,
        next: &mut impl FnMut() -> f64,
        slope: f64,
    ) -> Vec<Series> {
        let one = |_| Series {
            means: (0..200).map(|k| next() + slope * f64::from(k)).collect(),
            ramps,
        };
        (0..dwells).map(one).collect()
    }

    #[test]
    fn an_even_drift_is_no_noise_where_the_temperature_ramps() {
        let found = |ramps: bool, slope: f64| {
            let mut random = Random::new(7, "pool");
            let mut next = || random.uniform() - 0.5;
            pooled(series(ramps, 50, &mut next, slope).into_iter(), 0.1)
        };
        let still = found(true, 0.0);
        // A block of 0.1 s has the variance 1/12, which 10 000 blocks determine to 1.4 %.
        let white = 0.1 / 12.0;
        assert!((still.model.white / white - 1.0).abs() < 0.06, "{still:?}");
        let drifting = found(true, 0.01);
        for tau in [0.1, 1.0, 20.0] {
            let ratio = drifting.variance(tau) / still.variance(tau);
            assert!((ratio - 1.0).abs() < 1e-6, "{ratio}");
        }
        // The Allan variance includes the drift: 0.01 per block is 2 over the dwell, and the noise of its mean is 0.02.
        assert!(found(false, 0.01).variance(20.0) > 100.0 * still.variance(20.0));
    }

    #[test]
    fn a_random_walk_has_the_same_size_by_both_variances() {
        let found = |ramps: bool| {
            let mut random = Random::new(11, "pool");
            let mut at = 0.0;
            let mut next = || {
                at += random.uniform() - 0.5;
                at
            };
            pooled(series(ramps, 200, &mut next, 0.0).into_iter(), 1.0).model
        };
        // Steps of variance 1/12 each second: K²/3 is 1/36.
        for ramps in [false, true] {
            let walk = found(ramps).walk;
            assert!((walk * 36.0 - 1.0).abs() < 0.1, "{ramps} {walk}");
        }
    }
}
