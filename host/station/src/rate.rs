//! Sample rate and lost samples, by the time stamps.

use mimu_recording::statistics::Line;
use mimu_recording::{Result, usual_rate_hz};

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
            if let Some(line) = Line::through(points.iter().copied()) {
                (period, sigma) = (line.slope, line.sigma);
            }
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
