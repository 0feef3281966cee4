//! Location and covariance of vectors of which some do not belong to the others.
//!
//! The orthogonalised Gnanadesikan-Kettenring estimator, OGK: Maronna, Zamar (2002), Technometrics 44, 307. It starts from medians of single coordinates and of sums and
//! differences of two, so that outliers that are alike do not mask each other, and needs no random subsets.

use mimu::nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Standard deviation of a normal variable over the median of its magnitudes: 1/0.674490.
const OF_MEDIAN: f64 = 1.482_602_218_505_602;

/// Median; changes the order. NaN of nothing.
pub fn median(values: &mut [f64]) -> f64 {
    let n = values.len();
    if n == 0 {
        return f64::NAN;
    }
    let (below, middle, _) = values.select_nth_unstable_by(n / 2, f64::total_cmp);
    let upper = *middle;
    match n % 2 {
        1 => upper,
        _ => 0.5 * (upper + below.iter().copied().fold(f64::NEG_INFINITY, f64::max)),
    }
}

/// Median, and the standard deviation of a normal variable with the same median of the distances from it. If more than half of the values are equal, the
/// standard deviation is the usual one.
pub fn location_and_scale(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let mut all: Vec<f64> = values.collect();
    let centre = median(&mut all);
    let n = all.len() as f64;
    let usual = (all.iter().map(|v| (v - centre).powi(2)).sum::<f64>() / n).sqrt();
    all.iter_mut().for_each(|v| *v = (*v - centre).abs());
    let scale = OF_MEDIAN * median(&mut all);
    (centre, if scale > 0.0 { scale } else { usual })
}

/// A first location and covariance of `all`. With `jointly` correlations too; else coordinate by coordinate. `centre` is the location if it is known.
pub fn first(
    all: &[DVector<f64>],
    centre: Option<&DVector<f64>>,
    jointly: bool,
) -> (DVector<f64>, DMatrix<f64>) {
    let n = all[0].len();
    let each: Vec<(f64, f64)> = (0..n)
        .map(|i| location_and_scale(all.iter().map(|v| v[i])))
        .collect();
    let location = centre
        .cloned()
        .unwrap_or_else(|| DVector::from_fn(n, |i, _| each[i].0));
    let scale = DVector::from_fn(n, |i, _| each[i].1.max(f64::MIN_POSITIVE.sqrt()));
    if !jointly {
        return (
            location,
            DMatrix::from_diagonal(&scale.component_mul(&scale)),
        );
    }
    let standard: Vec<DVector<f64>> = all
        .iter()
        .map(|v| (v - &location).component_div(&scale))
        .collect();
    let mut correlation = DMatrix::identity(n, n);
    for i in 0..n {
        for j in 0..i {
            let [sum, difference] = [1.0, -1.0].map(|sign| {
                location_and_scale(standard.iter().map(move |v| v[i] + sign * v[j]))
                    .1
                    .powi(2)
            });
            correlation[(i, j)] = 0.25 * (sum - difference);
            correlation[(j, i)] = correlation[(i, j)];
        }
    }
    // It need not be positive definite; variances along its axes are estimated again.
    let axes = SymmetricEigen::new(correlation).eigenvectors;
    let turned: Vec<DVector<f64>> = standard.iter().map(|v| axes.tr_mul(v)).collect();
    let along: Vec<(f64, f64)> = (0..n)
        .map(|i| location_and_scale(turned.iter().map(|v| v[i])))
        .collect();
    let variances = DVector::from_fn(n, |i, _| along[i].1.powi(2).max(1e-12));
    let back = DMatrix::from_diagonal(&scale) * &axes;
    let covariance = &back * DMatrix::from_diagonal(&variances) * back.transpose();
    let middle = DVector::from_fn(n, |i, _| along[i].0);
    match centre {
        Some(centre) => (centre.clone(), covariance),
        None => (location + back * middle, covariance),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_of_an_even_count_is_between_the_two_in_the_middle() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&mut [4.0, 1.0, 2.0, 3.0]), 2.5);
        let (centre, scale) = location_and_scale([0.0, 0.0, 0.0, 4.0].into_iter());
        assert_eq!((centre, scale), (0.0, 2.0));
    }

    #[test]
    fn a_third_of_equal_outliers_hardly_moves_location_and_covariance() {
        // A square grid of correlated points, and half as many far away at one place.
        let mut all = Vec::new();
        for i in -10..=10 {
            for j in -10..=10 {
                let [a, b] = [f64::from(i) / 10.0, f64::from(j) / 10.0];
                all.push(DVector::from_vec(vec![a, 0.8 * a + 0.6 * b]));
            }
        }
        let clean = first(&all, None, true);
        all.extend(vec![DVector::from_vec(vec![30.0, -30.0]); 150]);
        let (location, covariance) = first(&all, None, true);
        assert!(location.norm() < 0.6, "{location}");
        assert!(covariance[(0, 0)] < 4.0 * clean.1[(0, 0)], "{covariance}");
        assert!(covariance[(0, 1)] > 0.0, "{covariance}");
    }
}
