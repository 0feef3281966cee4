//! Lines and bumps of a series: where, how wide, how strong.

use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

use super::search::{Band, Resolution, Search, line_width_hz};
use super::welch::{BIN_OVERLAP, Welch};

/// What stands above the floor of a spectrum.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// Frequency with half of its power below, Hz.
    pub frequency_hz: f64,
    /// Band that contains the middle half of its power, Hz; `None` if it is not resolved: from about [`Line::resolution_hz`] down.
    pub width_hz: Option<f64>,
    /// Effective value within [`Line::band_hz`], unit of the series.
    pub rms: f64,
    /// Ends of its confidence interval: of a narrow line, of its effective value in this series; of a bump, of that in a series without an end.
    pub interval: [f64; 2],
    /// Highest density over that of the floor, at the resolution of [`Line::resolution_hz`].
    pub above_floor: f64,
    /// Noise bandwidth of the spectrum in which it was found, Hz: a finer one shows a steady line higher above the floor.
    pub resolution_hz: f64,
    /// Band in which it exceeds the floor, Hz.
    pub band_hz: [f64; 2],
}

/// The lines and bumps of a series.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Lines {
    /// By frequency.
    pub lines: Vec<Line>,
    /// Lowest and highest frequency that was searched, Hz; `None` for a series too short for a spectrum.
    pub searched_hz: Option<[f64; 2]>,
    /// Spectrum at the finest resolution.
    finest: Option<Welch>,
}

impl Lines {
    /// Those of `rates` (any unit, `dt_s` apart). Intervals have the probability `confidence`.
    pub fn of(rates: &[f64], dt_s: f64, confidence: f64) -> Self {
        let Some(search) = Search::of(rates, dt_s) else {
            return Self::default();
        };
        let line = |band| Line::of(&search.resolutions, band, confidence);
        let mut lines: Vec<Line> = search.bands.iter().map(line).collect();
        lines.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
        Self {
            lines,
            searched_hz: search.searched_hz(),
            finest: search.resolutions.into_iter().next_back().map(|r| r.welch),
        }
    }

    /// The spectrum at the finest resolution, unless it was dropped.
    pub(super) fn spectrum(&self) -> Option<&Welch> {
        self.finest.as_ref()
    }

    /// Drops the spectrum, 8 MB for three hours at 1 kHz; afterwards [`Self::white_band`] returns `None`.
    pub fn without_spectrum(mut self) -> Self {
        self.finest = None;
        self
    }
}

impl Line {
    fn of(resolutions: &[Resolution], band: &Band, confidence: f64) -> Self {
        let resolution = &resolutions[band.level];
        let welch = &resolution.welch;
        let excess = Excess::of(resolution, band);
        let floor = resolution.floor.at(band.peak).map_or(0.0, |l| l.between);
        let above_floor = welch.power[band.peak] / floor;
        let rms = excess.power.sqrt();
        let width_hz = excess.quantile_hz(0.75) - excess.quantile_hz(0.25);
        let resolution_hz = line_width_hz(welch);
        // Few bins of a narrow bump exceed half of its peak by chance, but the middle half of a line's power is within one resolution.
        let is_bump = band.resolved || width_hz > resolution_hz;
        Self {
            frequency_hz: excess.quantile_hz(0.5),
            width_hz: is_bump.then_some(width_hz),
            rms,
            interval: match is_bump {
                true => excess.interval(confidence),
                false => {
                    // A steady line and the noise at its frequency interfere: they give the power a relative variance of 4/(r n), at a density r times
                    // that of the floor with n degrees of freedom.
                    let z = Normal::standard().inverse_cdf(0.5 + 0.5 * confidence);
                    let sigma = 1.0 / (above_floor * welch.dof).sqrt();
                    [-z, z].map(|z| rms * (1.0 + z * sigma).max(0.0))
                }
            },
            above_floor,
            resolution_hz,
            band_hz: resolution.ends_hz(band),
        }
    }
}

/// The part of a band above the floor.
struct Excess {
    df_hz: f64,
    first: usize,
    /// Density by bin above that of the floor.
    bins: Vec<f64>,
    /// Mean square of the series in it, both sides of zero.
    power: f64,
    /// Degrees of freedom of the mean square.
    dof: f64,
    /// Mean square of the floor in it.
    beneath: f64,
}

impl Excess {
    fn of(resolution: &Resolution, band: &Band) -> Self {
        let welch = &resolution.welch;
        let sum = |of: &dyn Fn(usize) -> f64| band.bins.clone().map(of).sum::<f64>();
        let all = sum(&|b| welch.power[b]);
        let above = sum(&|b| resolution.excess(b));
        let squares = sum(&|b| welch.power[b].powi(2));
        // At least a thousandth of the power, so that rounding leaves a mean square above zero.
        let power = above.max(1e-3 * all);
        Self {
            df_hz: welch.df_hz,
            first: *band.bins.start(),
            bins: band
                .bins
                .clone()
                .map(|b| resolution.excess(b).max(0.0))
                .collect(),
            power: 2.0 * welch.df_hz * power,
            beneath: 2.0 * welch.df_hz * (all - above),
            dof: welch.dof * all * all / (BIN_OVERLAP * squares),
        }
    }

    /// Chi-square interval of the effective value: that of the whole band, without the floor in it.
    fn interval(&self, confidence: f64) -> [f64; 2] {
        let Ok(chi2) = ChiSquared::new(self.dof) else {
            return [0.0, f64::INFINITY];
        };
        let whole = self.power + self.beneath;
        [0.5 + 0.5 * confidence, 0.5 - 0.5 * confidence].map(|p| {
            let end = whole * self.dof / chi2.inverse_cdf(p) - self.beneath;
            end.max(0.0).sqrt()
        })
    }

    /// Frequency with this share of the excess below it, Hz.
    fn quantile_hz(&self, share: f64) -> f64 {
        let all: f64 = self.bins.iter().sum();
        let mut below = 0.0;
        for (i, here) in self.bins.iter().enumerate() {
            if below + here >= share * all && *here > 0.0 {
                let within = (share * all - below) / here;
                return (self.first as f64 + i as f64 - 0.5 + within) * self.df_hz;
            }
            below += here;
        }
        (self.first as f64 + 0.5 * (self.bins.len() - 1) as f64) * self.df_hz
    }
}
