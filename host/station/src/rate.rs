//! Sample rate and lost samples, by the time stamps.

use mimu_recording::error::Result;
use mimu_recording::usual_rate_hz;

/// What the time stamps say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rate {
    /// Samples a second, by the clock of the stamps.
    pub hz: f64,
    /// Its standard uncertainty by the scatter of the stamps. The error of the clock itself is not in it.
    pub sigma_hz: f64,
    /// Samples that are missing between the first and the last.
    pub lost: u64,
    /// Samples that came.
    pub samples: u64,
}

impl Rate {
    /// By the stamps `t_s`, s, of all samples.
    ///
    /// Each interval is a whole number of periods; a straight line of the stamps over the counted periods gives the rate, so that lost samples do not
    /// change it.
    ///
    /// # Errors
    /// There are fewer than two times, or most of them do not increase.
    pub fn of(t_s: &[f64]) -> Result<Self> {
        let mut period = 1.0 / usual_rate_hz(t_s)?;
        let (mut sigma, mut count) = (0.0, 0.0);
        for _ in 0..3 {
            count = 0.0;
            let mut points = vec![[0.0, 0.0]];
            for pair in t_s.windows(2) {
                count += ((pair[1] - pair[0]) / period).round().max(1.0);
                points.push([count, pair[1] - t_s[0]]);
            }
            (period, sigma) = line(&points);
        }
        let hz = 1.0 / period;
        Ok(Self {
            hz,
            sigma_hz: hz * sigma / period,
            lost: count as u64 + 1 - t_s.len() as u64,
            samples: t_s.len() as u64,
        })
    }

    /// Share of the samples that are missing, %, with the standard uncertainty of a count.
    pub fn lost_percent(&self) -> (f64, f64) {
        let all = (self.samples + self.lost) as f64;
        let share = self.lost as f64 / all;
        (100.0 * share, 100.0 * (share * (1.0 - share) / all).sqrt())
    }
}

/// Slope of a straight line through `points`, and its standard deviation by their scatter.
fn line(points: &[[f64; 2]]) -> (f64, f64) {
    let n = points.len() as f64;
    let [x, y] = [0, 1].map(|i| points.iter().map(|p| p[i]).sum::<f64>() / n);
    let squares = points.iter().map(|p| (p[0] - x).powi(2)).sum::<f64>();
    let products = points.iter().map(|p| (p[0] - x) * (p[1] - y));
    let slope = products.sum::<f64>() / squares;
    let rest = points
        .iter()
        .map(|p| (p[1] - y - slope * (p[0] - x)).powi(2));
    let variance = rest.sum::<f64>() / (n - 2.0).max(1.0);
    (slope, (variance / squares).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lost_samples_are_counted_and_do_not_change_the_rate() {
        let all = (0..4000).filter(|k| k % 97 != 40 && !(1000..1010).contains(k));
        let t_s: Vec<f64> = all.map(|k| 5.0 + f64::from(k) / 416.3).collect();
        let rate = Rate::of(&t_s).unwrap();
        assert!((rate.hz / 416.3 - 1.0).abs() < 1e-9, "{rate:?}");
        assert_eq!(rate.lost + rate.samples, 4000);
    }

    #[test]
    fn stamps_in_whole_milliseconds_give_the_rate() {
        let t_s: Vec<f64> = (0..1040)
            .map(|k| (f64::from(k) / 0.104).floor() / 1e3)
            .collect();
        let rate = Rate::of(&t_s).unwrap();
        assert!((rate.hz - 104.0).abs() < 3.0 * rate.sigma_hz, "{rate:?}");
        assert!(rate.sigma_hz < 0.01 && rate.lost == 0, "{rate:?}");
    }
}
