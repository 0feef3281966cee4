//! Small statistics that many modules need.

/// Standard deviation of normal deviations over the median of their magnitudes.
pub const OF_MEDIAN: f64 = 1.4826;

/// The `share` quantile, a value itself; of two in the middle the upper. Reorders `values`; `None` without any.
pub fn quantile(values: &mut [f64], share: f64) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let at = ((values.len() - 1) as f64 * share).round() as usize;
    Some(*values.select_nth_unstable_by(at, f64::total_cmp).1)
}

/// Root of the mean square; not a number without values.
pub fn root_mean_square(values: impl IntoIterator<Item = f64>) -> f64 {
    let sums = values
        .into_iter()
        .fold((0.0, 0.0), |(sum, n), v| (sum + v * v, n + 1.0));
    (sums.0 / sums.1).sqrt()
}

/// Mean of values, and the variance of one of them.
pub fn mean_and_variance(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    let squares = values.map(|v| (v - mean).powi(2));
    (mean, squares.sum::<f64>() / (n - 1.0))
}

/// A straight line by least squares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Mean of the points, through which it goes.
    pub middle: [f64; 2],
    /// Slope.
    pub slope: f64,
    /// Standard deviation of the slope, by the scatter of the points about the line.
    pub sigma: f64,
}

impl Line {
    /// Through `points`; `None` if all have one abscissa.
    pub fn through(points: impl Iterator<Item = [f64; 2]> + Clone) -> Option<Self> {
        let n = points.clone().count() as f64;
        let mean = |k: usize| points.clone().map(|p| p[k]).sum::<f64>() / n;
        let middle = [mean(0), mean(1)];
        let centred = points.map(|[x, y]| [x - middle[0], y - middle[1]]);
        let squares: f64 = centred.clone().map(|[x, _]| x * x).sum();
        let slope = centred.clone().map(|[x, y]| x * y).sum::<f64>() / squares;
        let rest = centred.map(|[x, y]| (y - slope * x).powi(2));
        let variance = rest.sum::<f64>() / (n - 2.0).max(1.0);
        (squares > 0.0).then(|| Self {
            middle,
            slope,
            sigma: (variance / squares).sqrt(),
        })
    }

    /// Its value at `x`.
    pub fn at(&self, x: f64) -> f64 {
        self.middle[1] + self.slope * (x - self.middle[0])
    }
}
