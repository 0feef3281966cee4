//! Which frequencies of a series stand above the floor of its spectrum by more than chance.

use std::ops::RangeInclusive;

use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::floor::{FIRST, Floor, REACH};
use super::welch::{BIN_OVERLAP, NOISE_BINS, Welch, fast_length};

/// Probability that anything is found in noise, over all bins of all resolutions.
const FALSE_ALARM: f64 = 1e-3;
/// A smaller ratio to the floor is ignored, however significant: with a thousand degrees of freedom even the bend of a filter is
/// significant. It would bend a curve by less than its intervals.
const LEAST_RATIO: f64 = 2.0;
/// The series is this many times as long as a segment of the finest resolution.
const FINEST: usize = 4;
/// Each resolution is this many times coarser than the next finer one.
const COARSER: usize = 8;
/// Samples of the shortest segment.
const SHORTEST: usize = 256;
/// Significant bins that are this near to each other are one band.
const GAP: usize = 3;
/// A band with this many bins above half of its peak is wider than a line through the window.
const RESOLVED: usize = 4;

/// Frequencies that stand out together.
#[derive(Debug, Clone)]
pub(super) struct Band {
    /// Resolution that shows it, an index into the spectra that were searched.
    pub level: usize,
    /// Its bins, including those that are not significant by themselves.
    pub bins: RangeInclusive<usize>,
    /// The highest.
    pub peak: usize,
    /// Whether it is wider than a line is at this resolution.
    pub resolved: bool,
}

/// A spectrum at one resolution with its floor.
#[derive(Debug)]
pub(super) struct Resolution {
    pub welch: Welch,
    pub floor: Floor,
    /// [`super::floor::Level::between`] of each bin: a search asks for it again and again.
    beneath: Vec<f64>,
}

impl Resolution {
    fn of(welch: Welch) -> Self {
        let floor = Floor::of(&welch.power, welch.dof);
        let between = |bin: usize| floor.at(bin).map_or(f64::INFINITY, |l| l.between);
        Self {
            beneath: (0..welch.power.len()).map(between).collect(),
            welch,
            floor,
        }
    }

    /// Density of `bin` above the floor, unit²/Hz; negative below.
    pub fn excess(&self, bin: usize) -> f64 {
        self.welch.power[bin] - self.beneath[bin]
    }

    fn ratio(&self, bin: usize) -> f64 {
        self.welch.power[bin] / self.beneath[bin]
    }

    /// Bins that are significant with a probability of `chance` each.
    fn significant(&self, chance: f64) -> Vec<usize> {
        let Welch { power, dof, .. } = &self.welch;
        let stands_out = |bin: &usize| {
            // A cheaper test first: the floor between is at most the highest level.
            if !(self.ratio(*bin) > LEAST_RATIO) {
                return false;
            }
            let Some(level) = self.floor.at(*bin) else {
                return false;
            };
            let ratio = power[*bin] / level.highest;
            if !(ratio > LEAST_RATIO) {
                return false;
            }
            // A median of n is known to √(π/2n) of a standard deviation.
            let of_floor = dof * level.bins / (std::f64::consts::FRAC_PI_2 * BIN_OVERLAP);
            FisherSnedecor::new(*dof, of_floor).is_ok_and(|f| f.sf(ratio) < chance)
        };
        (FIRST..power.len() - 1).filter(stands_out).collect()
    }

    fn bands(&self, level: usize, chance: f64) -> Vec<Band> {
        let significant = self.significant(chance);
        let mut bands: Vec<Band> = Vec::new();
        for bins in significant.chunk_by(|a, b| b - a <= GAP) {
            // Bins within the previous band belong to it, and the band is not extended from them again: the slopes of a bump contain
            // thousands.
            let inside = bands.pop_if(|band| bins[0] <= *band.bins.end());
            let next = self.band(level, bins, inside.as_ref());
            match bands
                .last_mut()
                .filter(|b| next.bins.start() <= b.bins.end())
            {
                Some(band) => self.join(band, &next),
                None => bands.push(next),
            }
        }
        for band in &mut bands {
            band.resolved |= self.is_resolved(band.bins.clone(), band.peak);
        }
        bands
    }

    fn join(&self, band: &mut Band, next: &Band) {
        let end = *next.bins.end().max(band.bins.end());
        band.bins = *band.bins.start()..=end;
        band.resolved |= next.resolved;
        if self.welch.power[next.peak] > self.welch.power[band.peak] {
            band.peak = next.peak;
        }
    }

    /// Whether more of the `bins` are above half of their `peak` than a line, which has no width, would have.
    fn is_resolved(&self, bins: RangeInclusive<usize>, peak: usize) -> bool {
        let half = 0.5 * self.excess(peak);
        bins.filter(|b| self.excess(*b) > half)
            .take(RESOLVED)
            .count()
            >= RESOLVED
    }

    /// The band around significant bins: it extends while the mean of three bins exceeds the floor by more than its scatter. `inside`: the
    /// band in which they begin.
    fn band(&self, level: usize, bins: &[usize], inside: Option<&Band>) -> Band {
        let last = self.welch.power.len() - 2;
        let power = &self.welch.power;
        let highest = bins.iter().max_by(|a, b| power[**a].total_cmp(&power[**b]));
        let peak = highest.copied().unwrap_or(bins[0]);
        let edge = 1.0 + 1.5 * (2.0 * BIN_OVERLAP / (3.0 * self.welch.dof)).sqrt();
        let edge = edge.max(1.2);
        let above = |bin: usize| {
            let three = bin - 1..=(bin + 1).min(last);
            three.map(|b| self.ratio(b)).sum::<f64>() / 3.0 > edge
        };
        let lowest = (peak as f64 / REACH).max(FIRST as f64 / REACH) as usize;
        let highest = ((peak as f64 * REACH) as usize).min(last);
        let (mut from, mut to) = (bins[0], bins[bins.len() - 1]);
        let resolved = self.is_resolved(from..=to, peak);
        if let Some(band) = inside {
            (from, to) = (*band.bins.start(), to.max(*band.bins.end()));
        }
        while inside.is_none() && from > lowest.max(2) && above(from - 1) {
            from -= 1;
        }
        while to < highest && above(to + 1) {
            to += 1;
        }
        let mut band = Band {
            level,
            bins: from..=to,
            peak,
            resolved,
        };
        if let Some(inside) = inside {
            self.join(&mut band, inside);
        }
        band
    }

    /// Ends of `band`, Hz, from bin border to bin border.
    pub fn ends_hz(&self, band: &Band) -> [f64; 2] {
        let df = self.welch.df_hz;
        [
            (*band.bins.start() as f64 - 0.5) * df,
            (*band.bins.end() as f64 + 0.5) * df,
        ]
    }
}

/// Spectra of a series from the coarsest resolution to the finest, and the bands that stand out.
#[derive(Debug)]
pub(super) struct Search {
    pub resolutions: Vec<Resolution>,
    pub bands: Vec<Band>,
}

impl Search {
    /// Of `rates` at steps of `dt_s`. `None` where they are too few for a spectrum.
    ///
    /// A line shows best at the finest resolution, where it is highest. A broad bump shows best at a resolution of its width: it is taken
    /// from the coarsest one that shows it wider than a line.
    pub fn of(rates: &[f64], dt_s: f64) -> Option<Self> {
        let mut lengths = Vec::new();
        let mut length = fast_length(rates.len() / FINEST);
        while length >= SHORTEST {
            lengths.push(length);
            length = fast_length(length / COARSER);
        }
        lengths.reverse();
        if lengths.is_empty() {
            return None;
        }
        let resolutions: Vec<Resolution> = lengths
            .into_par_iter()
            .map(|length| Resolution::of(Welch::of(rates, dt_s, length)))
            .collect();
        let bins: usize = resolutions.iter().map(|r| r.welch.power.len()).sum();
        let chance = FALSE_ALARM / bins as f64;
        let mut bands: Vec<Band> = Vec::new();
        for (level, resolution) in resolutions.iter().enumerate() {
            for band in resolution.bands(level, chance) {
                let [low, high] = resolution.ends_hz(&band);
                let same = |other: &Band| {
                    let [from, to] = resolutions[other.level].ends_hz(other);
                    low < to && from < high
                };
                if bands.iter().any(|b| b.resolved && same(b)) {
                    continue;
                }
                bands.retain(|b| b.level == level || !same(b));
                bands.push(band);
            }
        }
        Some(Self { resolutions, bands })
    }

    /// Lowest and highest frequency that was searched, Hz.
    pub fn searched_hz(&self) -> Option<[f64; 2]> {
        let finest = &self.resolutions.last()?.welch;
        let last = finest.power.len() as f64 - 2.0;
        Some([FIRST as f64 * finest.df_hz, last * finest.df_hz])
    }
}

/// Bandwidth of one bin, Hz.
pub(super) fn line_width_hz(welch: &Welch) -> f64 {
    NOISE_BINS * welch.df_hz
}
