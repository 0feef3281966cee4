//! Noise of a channel at rest: rms, and density in a band.

use mimu_allan::spectrum::density_in;
use mimu_recording::statistics::Line;

/// A figure with its standard uncertainty.
pub type WithSigma = (f64, f64);

/// Correlations are summed to this share of the record.
const LONGEST_LAG: usize = 10;
/// And to at most this many samples.
const MOST_LAGS: usize = 500;

/// Root mean square of `readings` about their straight line, with its standard uncertainty.
///
/// Filtered noise has fewer independent samples than readings: the variance of a variance is `2 σ⁴ (1 + 2 Σ ρ²) / n` with the autocorrelations ρ (Bartlett
/// 1946). What n readings show of ρ² by chance, 1/n, is taken off.
pub fn rms(readings: &[f64]) -> WithSigma {
    let rest = about_line(readings);
    let n = rest.len() as f64;
    let power = rest.iter().map(|v| v * v).sum::<f64>();
    if power <= 0.0 {
        return (0.0, 0.0);
    }
    let lags = (rest.len() / LONGEST_LAG).min(MOST_LAGS);
    let square = |lag: usize| {
        let products = rest.iter().zip(&rest[lag..]);
        let rho = products.map(|(a, b)| a * b).sum::<f64>() / power;
        rho * rho - 1.0 / n
    };
    let sum: f64 = (1..=lags).map(square).sum();
    let rms = (power / (n - 2.0)).sqrt();
    let factor = (1.0 + 2.0 * sum).max(1.0);
    (rms, rms * (factor / (2.0 * n)).sqrt())
}

/// `readings` minus their straight line by least squares.
fn about_line(readings: &[f64]) -> Vec<f64> {
    let points = || (0..).zip(readings).map(|(k, v)| [f64::from(k), *v]);
    let line = Line::through(points());
    let rest = |[k, v]: [f64; 2]| v - line.map_or(v, |line| line.at(k));
    points().map(rest).collect()
}

/// Band whose mean density is reported, Hz. Data sheets state the density at 10 Hz.
pub const BAND_HZ: [f64; 2] = [5.0, 20.0];
/// The band ends at this share of the sample rate: beyond, filters and aliasing change the density.
const HIGHEST: f64 = 0.4;

/// One-sided density of the noise of `readings`, which are `dt_s` apart: root mean square over [`BAND_HZ`], unit/√Hz, with its standard uncertainty. `None`
/// if the record or its rate does not reach so far.
pub fn density(readings: &[f64], dt_s: f64) -> Option<WithSigma> {
    density_in(readings, dt_s, [BAND_HZ[0], BAND_HZ[1].min(HIGHEST / dt_s)])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// White noise of standard deviation 1.
    fn white(n: usize, seed: u64) -> Vec<f64> {
        let mut random = mimu_rig::random::Random::new(seed, "white");
        (0..n).map(|_| random.normal()).collect()
    }

    /// Share of `figures` within two of their standard uncertainties of `truth`.
    fn within(figures: &[WithSigma], truth: f64) -> f64 {
        let near = figures.iter().filter(|(v, s)| (v - truth).abs() < 2.0 * s);
        near.count() as f64 / figures.len() as f64
    }

    #[test]
    fn the_rms_of_filtered_noise_has_an_honest_uncertainty() {
        // A first-order filter: variance (1 - a)/(1 + a) of that of the input.
        let a: f64 = 0.9;
        let truth = ((1.0 - a) / (1.0 + a)).sqrt();
        let figures: Vec<WithSigma> = (1..=300)
            .map(|seed| {
                let mut state = 0.0;
                let filtered = white(2200, seed).into_iter().map(|w| {
                    state = a * state + (1.0 - a) * w;
                    100.0 + state
                });
                rms(&filtered.skip(200).collect::<Vec<_>>())
            })
            .collect();
        // 95.4 % of 300: a standard deviation is 1.2 %.
        let share = within(&figures, truth);
        assert!((0.91..=0.99).contains(&share), "{share}");
    }

    #[test]
    fn the_density_of_white_noise_is_that_of_its_variance() {
        // Variance 1 at 1 kHz is 1/500 unit²/Hz, one-sided.
        let truth = (1.0_f64 / 500.0).sqrt();
        let figures: Vec<WithSigma> = (1..=300)
            .filter_map(|seed| density(&white(10_000, seed), 1e-3))
            .collect();
        assert_eq!(figures.len(), 300);
        let share = within(&figures, truth);
        assert!((0.91..=0.99).contains(&share), "{share}");
    }

    #[test]
    fn a_dead_channel_has_no_noise() {
        assert_eq!(rms(&[3.0; 500]), (0.0, 0.0));
        assert_eq!(density(&[3.0; 5000], 1e-3), Some((0.0, 0.0)));
        assert_eq!(density(&[3.0; 50], 0.1), None);
    }
}
