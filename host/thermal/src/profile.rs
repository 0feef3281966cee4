//! The lag of the dies by its profile likelihood, and what is averaged over it.

use serde::Serialize;

/// Lags that the search begins with, s: from dies that lead to dies deep inside a potted unit.
pub const LAGS: [f64; 31] = [
    -120.0, -105.0, -90.0, -75.0, -60.0, -45.0, -30.0, -15.0, 0.0, 15.0, 30.0, 45.0, 60.0, 75.0,
    90.0, 105.0, 120.0, 140.0, 160.0, 180.0, 210.0, 240.0, 270.0, 300.0, 340.0, 380.0, 420.0,
    460.0, 500.0, 550.0, 600.0,
];
/// Range of lags, s.
pub const RANGE: [f64; 2] = [LAGS[0], LAGS[30]];
/// A 95 % interval wider than this, s, determines nothing: half the range.
pub const WIDEST: f64 = 0.5 * (RANGE[1] - RANGE[0]);
/// Standard deviations on either side of the best lag at which curves are evaluated, one apart. The trapezoidal rule with this step is
/// exact to 1e-8 for a normal density.
const REACH: i32 = 4;
/// A lag known worse than this, s, is averaged over the lags that the search began with.
const WIDE_S: f64 = 25.0;
const REFINEMENTS: usize = 12;
/// Number of grids about the best lag. A parabola through the first lags, 15 s apart, does not describe a likelihood that is seconds wide:
/// best lags stayed on those lags, with intervals half or twice as wide. With points a standard deviation apart both are right.
const GRIDS: usize = 4;

/// A lag with its 95 % interval, s.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Lag {
    /// Most likely.
    pub value: f64,
    /// Lower end.
    pub lower: f64,
    /// Upper end.
    pub upper: f64,
}

impl Lag {
    /// Whether the data determine it at all.
    pub fn is_determined(&self) -> bool {
        self.upper - self.lower <= WIDEST
    }
}

/// Likelihood of the lag.
#[derive(Debug, Clone)]
pub struct Profile {
    /// Best lag and its interval.
    pub lag: Lag,
    /// Lags to average over, with their weights, which sum to one.
    pub weights: Vec<(f64, f64)>,
    /// Smallest criterion: minus twice the logarithm of the likelihood.
    pub criterion: f64,
    /// Lags and criteria that were evaluated, in order.
    pub points: Vec<(f64, f64)>,
}

impl Profile {
    /// Whether the lag was given instead of estimated.
    pub fn is_given(&self) -> bool {
        self.points.len() == 1
    }

    /// From `criterion`, minus twice the logarithm of the likelihood of a lag, over the whole range; `None` if it is nowhere finite.
    pub fn of(mut criterion: impl FnMut(f64) -> Option<f64>) -> Option<Self> {
        let mut points: Vec<(f64, f64)> = LAGS
            .iter()
            .filter_map(|lag| Some((*lag, criterion(*lag)?)))
            .collect();
        for _ in 0..REFINEMENTS {
            let Some((lag, gain)) = vertex(&points) else {
                break;
            };
            let near = points.iter().any(|p| (p.0 - lag).abs() < 0.02);
            let Some(found) = (!near).then(|| criterion(lag)).flatten() else {
                break;
            };
            insert(&mut points, (lag, found));
            if gain < 1e-3 {
                break;
            }
        }
        let lowest = |points: &[(f64, f64)]| {
            let lowest = points.iter().min_by(|a, b| a.1.total_cmp(&b.1));
            lowest.copied()
        };
        let mut best = lowest(&points)?;
        let mut grid = Vec::new();
        let mut spread = sigma(&points, best);
        for _ in 0..GRIDS {
            let Some(step) = spread.filter(|s| *s < WIDE_S) else {
                break;
            };
            let middle = best.0;
            grid.clear();
            for k in -REACH..=REACH {
                let lag = middle + f64::from(k) * step;
                if (RANGE[0]..=RANGE[1]).contains(&lag)
                    && let Some(found) = criterion(lag)
                {
                    insert(&mut points, (lag, found));
                    grid.push((lag, found));
                }
            }
            if let Some((lag, _)) = vertex(&grid)
                && let Some(found) = criterion(lag)
            {
                insert(&mut points, (lag, found));
            }
            best = lowest(&points)?;
            spread = sigma(&points, best);
            let same = spread.is_some_and(|s| (s / step - 1.0).abs() < 0.2);
            if same && (best.0 - middle).abs() < 0.3 * step {
                break;
            }
        }
        match spread.filter(|s| *s < WIDE_S) {
            // A distant lag may still be likely: another mode.
            Some(spread) if !grid.is_empty() => {
                let reach = (f64::from(REACH) + 0.5) * spread;
                grid.extend(points.iter().filter(|p| (p.0 - best.0).abs() > reach));
                grid.sort_by(|a, b| a.0.total_cmp(&b.0));
                grid.dedup_by(|a, b| a.0 == b.0);
            }
            _ => grid.clone_from(&points),
        }
        Some(Self {
            // Not from all points: those of the refinement are so close together that the rounding of one bends the parabola through them.
            lag: interval(&grid, best.0),
            weights: weights(&grid, best.1),
            criterion: best.1,
            points,
        })
    }

    /// For a given lag.
    pub fn fixed(lag_s: f64, criterion: f64) -> Self {
        Self {
            lag: Lag {
                value: lag_s,
                lower: lag_s,
                upper: lag_s,
            },
            weights: vec![(lag_s, 1.0)],
            criterion,
            points: vec![(lag_s, criterion)],
        }
    }
}

fn insert(points: &mut Vec<(f64, f64)>, point: (f64, f64)) {
    let at = points.partition_point(|p| p.0 < point.0);
    if points.get(at).is_none_or(|p| p.0 != point.0) {
        points.insert(at, point);
    }
}

/// Vertex of the parabola through the best point and its neighbours, and the improvement that it predicts.
fn vertex(points: &[(f64, f64)]) -> Option<(f64, f64)> {
    let best = (0..points.len()).min_by(|a, b| points[*a].1.total_cmp(&points[*b].1))?;
    if best == 0 || best + 1 >= points.len() {
        return None;
    }
    let [(x0, y0), (x1, y1), (x2, y2)] = [points[best - 1], points[best], points[best + 1]];
    let curvature = ((y2 - y1) / (x2 - x1) - (y1 - y0) / (x1 - x0)) / (x2 - x0);
    if !(curvature > 0.0) {
        return None;
    }
    let slope = (y2 - y0) / (x2 - x0) - curvature * (x2 + x0 - 2.0 * x1);
    let step = -0.5 * slope / curvature;
    Some(((x1 + step).clamp(x0, x2), curvature * step * step))
}

/// Standard deviation by the curvature at `best`, from the nearest points at which the criterion has risen by that of two standard
/// deviations: smaller rises would make it as uncertain as the smoothness at each point.
fn sigma(points: &[(f64, f64)], best: (f64, f64)) -> Option<f64> {
    let estimate = |p: &(f64, f64)| {
        let rise = p.1 - best.1;
        (rise > 4.0).then(|| (p.0 - best.0).abs() / rise.sqrt())
    };
    let below = points.iter().rev().filter(|p| p.0 < best.0);
    let above = points.iter().filter(|p| p.0 > best.0);
    let sides = [
        below.filter_map(estimate).next(),
        above.filter_map(estimate).next(),
    ];
    sides.into_iter().flatten().reduce(f64::max)
}

/// Weights of `grid` by the trapezoidal rule.
fn weights(grid: &[(f64, f64)], lowest: f64) -> Vec<(f64, f64)> {
    let width = |k: usize| {
        let below = k.checked_sub(1).map_or(grid[k].0, |i| grid[i].0);
        let above = grid.get(k + 1).map_or(grid[k].0, |p| p.0);
        0.5 * (above - below)
    };
    let density = |k: usize| (-0.5 * (grid[k].1 - lowest)).exp() * width(k);
    let all: Vec<(f64, f64)> = (0..grid.len()).map(|k| (grid[k].0, density(k))).collect();
    let sum: f64 = all.iter().map(|w| w.1).sum();
    if !(sum > 0.0) {
        return grid
            .iter()
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .map_or(Vec::new(), |p| vec![(p.0, 1.0)]);
    }
    all.into_iter()
        .map(|(lag, w)| (lag, w / sum))
        .filter(|w| w.1 > 1e-7)
        .collect()
}

/// 2.5 % and 97.5 % points of the likelihood as a density, the criterion interpolated between its points.
fn interval(points: &[(f64, f64)], value: f64) -> Lag {
    if points.len() < 3 {
        let [lower, upper] = [RANGE[0], RANGE[1]];
        return Lag {
            value,
            lower,
            upper,
        };
    }
    let lowest = points.iter().map(|p| p.1).fold(f64::INFINITY, f64::min);
    const PIECES: usize = 64;
    let mut cumulated = vec![(points[0].0, 0.0)];
    let mut sum = 0.0;
    for k in 0..points.len() - 1 {
        let step = (points[k + 1].0 - points[k].0) / PIECES as f64;
        for i in 0..PIECES {
            let lag = points[k].0 + (i as f64 + 0.5) * step;
            sum += (-0.5 * (interpolated(points, k, lag) - lowest)).exp() * step;
            cumulated.push((lag + 0.5 * step, sum));
        }
    }
    let quantile = |share: f64| {
        let at = cumulated.partition_point(|c| c.1 < share * sum);
        cumulated[at.min(cumulated.len() - 1)].0
    };
    Lag {
        value,
        lower: quantile(0.025).min(value),
        upper: quantile(0.975).max(value),
    }
}

/// Criterion at `lag` between the points k and k + 1: mean of the parabolas through three points on either side.
fn interpolated(points: &[(f64, f64)], k: usize, lag: f64) -> f64 {
    let through = |i: usize| {
        let [a, b, c] = [points[i], points[i + 1], points[i + 2]];
        let l = |p: f64, q: f64, r: f64| (lag - q) * (lag - r) / ((p - q) * (p - r));
        a.1 * l(a.0, b.0, c.0) + b.1 * l(b.0, a.0, c.0) + c.1 * l(c.0, a.0, b.0)
    };
    let share = (lag - points[k].0) / (points[k + 1].0 - points[k].0);
    match (k > 0, k + 2 < points.len()) {
        (true, true) => (1.0 - share) * through(k - 1) + share * through(k),
        (true, false) => through(k - 1),
        (false, true) => through(k),
        (false, false) => points[k].1 + share * (points[k + 1].1 - points[k].1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_normal_likelihood_gives_its_own_mean_and_interval() {
        for (mean, sigma) in [(61.3, 0.8), (-42.0, 12.0), (188.0, 5.0)] {
            let profile =
                Profile::of(|lag: f64| Some(7.0 + ((lag - mean) / sigma).powi(2))).unwrap();
            assert!(
                (profile.lag.value - mean).abs() < 0.03 * sigma,
                "{profile:?}"
            );
            let half = 1.96 * sigma;
            assert!(
                (profile.lag.upper - mean - half).abs() < 0.05 * sigma,
                "{:?}",
                profile.lag
            );
            assert!(
                (mean - half - profile.lag.lower).abs() < 0.05 * sigma,
                "{:?}",
                profile.lag
            );
            let moment: f64 = profile
                .weights
                .iter()
                .map(|(l, w)| w * (l - mean).powi(2))
                .sum();
            assert!((moment / sigma.powi(2) - 1.0).abs() < 0.05, "{moment}");
        }
    }

    /// A quadratic only near its best: fifteen seconds off, where the search begins, it is far below the parabola.
    #[test]
    fn a_likelihood_that_flattens_far_away_gives_its_own_interval_too() {
        for mean in [-30.4, -29.9, -30.02, 52.5, 59.7] {
            for sigma in [0.6, 1.2, 4.0] {
                let criterion = |lag: f64| {
                    let squared = ((lag - mean) / sigma).powi(2);
                    Some(200.0 * (squared / 200.0).ln_1p())
                };
                let lag = Profile::of(criterion).unwrap().lag;
                assert!((lag.value - mean).abs() < 0.05 * sigma, "{mean}: {lag:?}");
                for half in [lag.upper - mean, mean - lag.lower] {
                    let ratio = half / (1.96 * sigma);
                    assert!((0.95..1.07).contains(&ratio), "{mean} {sigma}: {lag:?}");
                }
            }
        }
    }

    #[test]
    fn a_flat_likelihood_determines_no_lag() {
        let profile = Profile::of(|lag: f64| Some(1e-3 * lag / 600.0)).unwrap();
        assert!(!profile.lag.is_determined());
    }
}
