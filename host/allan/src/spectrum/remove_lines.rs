//! Lines and bumps of a series, and the series without them.

use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

use super::flatten::{Cut, flatten};
use super::line::Line;
use super::search::{Band, Resolution, Search, line_width_hz};
use super::sinusoid::{Sinusoid, subtract, transform};
use super::transform::Transform;
use super::welch::{BIN_OVERLAP, Welch};
use super::white::{White, of_spectrum};

/// Largest number of searches, which end when nothing is found. A weak line next to a strong one is found after that is removed.
const ROUNDS: usize = 4;
/// Least share of a band's power in a sinusoid for it to be subtracted as one.
const STEADY: f64 = 0.3;
/// A sinusoid with more than this multiple of the band's power does not belong to the band.
const MUCH: f64 = 2.0;
/// A line is steady if at most this share of its power is outside its sinusoid; or twice the relative error that noise gives the power, if that is larger.
const BESIDE_IT: f64 = 0.1;
/// Least amplitude of a sinusoid, in standard deviations of the noise's amplitude.
const CERTAIN: f64 = 4.0;

/// A series without its lines.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct WithoutLines {
    /// Lines and bumps by frequency.
    pub lines: Vec<Line>,
    /// Lowest and highest frequency that was searched, Hz; `None` for a series too short for a spectrum.
    pub searched_hz: Option<[f64; 2]>,
    /// Whether something still stands out that could not be removed.
    pub remains: bool,
    /// Spectrum of the residual, at the finest resolution.
    finest: Option<Welch>,
}

impl WithoutLines {
    /// [`super::white_band`] of the residual series (samples `dt_s` apart), from its stored spectrum; `None` also if it was too short for a
    /// search.
    pub fn white_band(&self, dt_s: f64, confidence: f64) -> Option<White> {
        of_spectrum(self.finest.as_ref()?, dt_s, &self.lines, confidence)
    }

    /// Drops the spectrum, 8 MB for three hours at 1 kHz; afterwards [`Self::white_band`] returns `None`.
    pub fn without_spectrum(mut self) -> Self {
        self.finest = None;
        self
    }
}

/// Finds the lines and bumps of `rates` (any unit, `dt_s` apart) and removes them: a steady line as a sinusoid, anything else by reducing
/// its band to the floor. Without any, no bit of the series changes. Intervals have the probability `confidence`.
pub fn remove_lines(rates: &mut [f64], dt_s: f64, confidence: f64) -> WithoutLines {
    remove_lines_after(rates, dt_s, confidence, |_| {})
}

/// [`remove_lines`] that calls `before` once with the series, if it is going to be changed.
pub fn remove_lines_after(
    rates: &mut [f64],
    dt_s: f64,
    confidence: f64,
    before: impl FnOnce(&[f64]),
) -> WithoutLines {
    let mut lines: Vec<Line> = Vec::new();
    let mut searched_hz = None;
    let mut remains = false;
    let mut finest = None;
    let mut before = Some(before);
    for round in 0..=ROUNDS {
        let Some(search) = Search::of(rates, dt_s) else {
            break;
        };
        searched_hz = search.searched_hz();
        remains = !search.bands.is_empty();
        if !remains || round == ROUNDS {
            finest = search.resolutions.into_iter().next_back().map(|r| r.welch);
            break;
        }
        if let Some(before) = before.take() {
            before(rates);
        }
        remove(rates, dt_s, &search, confidence, &mut lines);
    }
    lines.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    WithoutLines {
        lines,
        searched_hz,
        remains,
        finest,
    }
}

/// Removes all bands that a search has found.
fn remove(rates: &mut [f64], dt_s: f64, search: &Search, confidence: f64, lines: &mut Vec<Line>) {
    let all: Vec<Excess> = search
        .bands
        .iter()
        .map(|band| Excess::of(&search.resolutions[band.level], band))
        .collect();
    let whole = transform(rates);
    let (mut steady, mut cuts): (Vec<Sinusoid>, Vec<Cut>) = (Vec::new(), Vec::new());
    for (band, excess) in search.bands.iter().zip(&all) {
        let resolution = &search.resolutions[band.level];
        let (line, sinusoid) = describe(&whole, dt_s, resolution, band, excess, confidence);
        match sinusoid {
            // A band next to that of a strong line finds the same line; the next search shows what remains without it.
            Some(sinusoid)
                if steady
                    .iter()
                    .any(|other| sinusoid.is(other, dt_s, rates.len())) =>
            {
                continue;
            }
            Some(sinusoid) => steady.push(sinusoid),
            None => cuts.push(Cut {
                ends_hz: line.band_hz,
                gain: Box::new(|f| excess.gain(f)),
            }),
        }
        add(lines, line);
    }
    drop(whole);
    subtract(&steady, rates);
    flatten(rates, dt_s, &cuts);
}

/// The line of a band, and the sinusoid that makes up most of it, if one does. `whole` is the transform of the series.
fn describe(
    whole: &Transform,
    dt_s: f64,
    resolution: &Resolution,
    band: &Band,
    excess: &Excess,
    confidence: f64,
) -> (Line, Option<Sinusoid>) {
    let length_s = whole.samples as f64 * dt_s;
    let welch = &resolution.welch;
    let floor = resolution.floor.at(band.peak).map_or(0.0, |l| l.between);
    let mut line = Line {
        frequency_hz: excess.quantile_hz(0.5),
        width_hz: Some(excess.quantile_hz(0.75) - excess.quantile_hz(0.25)),
        rms: excess.power.sqrt(),
        interval: excess.interval(confidence),
        above_floor: welch.power[band.peak] / floor,
        resolution_hz: line_width_hz(welch),
        band_hz: resolution.ends_hz(band),
    };
    let near_hz = band.peak as f64 * welch.df_hz;
    let sinusoid = Sinusoid::fit(whole, dt_s, near_hz, 2.0 * welch.df_hz);
    // White noise of density S puts the variance 2 S/T into each of both amplitudes.
    let noise = 2.0 * floor / length_s;
    let holds = |s: &Sinusoid| {
        let share = s.power() / excess.power;
        (STEADY..MUCH).contains(&share) && (2.0 * s.power()).sqrt() > CERTAIN * noise.sqrt()
    };
    let sinusoid = sinusoid.filter(holds);
    if let Some(sinusoid) = &sinusoid {
        let by_noise = 2.0 * (4.0 / (line.above_floor * welch.dof)).sqrt();
        if sinusoid.power() > (1.0 - by_noise.max(BESIDE_IT)) * excess.power {
            line.frequency_hz = sinusoid.frequency_hz;
            line.width_hz = None;
            line.rms = (sinusoid.power() - noise).max(0.0).sqrt();
            let z = Normal::standard().inverse_cdf(0.5 + 0.5 * confidence);
            // That of the effective value: 1/√2 of that of the amplitude.
            let sigma = (0.5 * noise).sqrt();
            line.interval = [-z, z].map(|z| (line.rms + z * sigma).max(0.0));
        }
    }
    (line, sinusoid)
}

/// Adds a line. What a later round finds at a known line is its residual; the line itself was reported before.
fn add(lines: &mut Vec<Line>, line: Line) {
    let same = |other: &&mut Line| {
        line.band_hz[0] < other.band_hz[1] && other.band_hz[0] < line.band_hz[1]
    };
    match lines.iter_mut().find(same) {
        None => lines.push(line),
        Some(first) => {
            // A sinusoid with a residual was not steady, and the sum has the uncertainty of both.
            if first.width_hz.is_none() {
                let both = (first.rms.powi(2) + line.rms.powi(2)).sqrt();
                let ends = [0, 1].map(|i| {
                    let sum = first.interval[i].powi(2) + line.interval[i].powi(2);
                    sum.sqrt()
                });
                (first.rms, first.interval) = (both, ends);
            }
            first.band_hz = [
                first.band_hz[0].min(line.band_hz[0]),
                first.band_hz[1].max(line.band_hz[1]),
            ];
        }
    }
}

/// The part of a band above the floor.
struct Excess {
    df_hz: f64,
    first: usize,
    /// Density by bin, and that of the floor.
    bins: Vec<[f64; 2]>,
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
        let floor = |bin: usize| resolution.floor.at(bin).map_or(0.0, |l| l.between);
        let bins: Vec<[f64; 2]> = band
            .bins
            .clone()
            .map(|b| [welch.power[b], floor(b)])
            .collect();
        let by = 2.0 * welch.df_hz;
        let sum = |of: fn(&[f64; 2]) -> f64| bins.iter().map(of).sum::<f64>();
        let (all, beneath) = (sum(|b| b[0]), sum(|b| b[1]));
        let squares = sum(|b| b[0] * b[0]);
        // At least a thousandth of the power, so that rounding leaves a mean square above zero.
        let power = (all - beneath).max(1e-3 * all);
        Self {
            df_hz: welch.df_hz,
            first: *band.bins.start(),
            power: by * power,
            beneath: by * beneath,
            dof: welch.dof * all * all / (BIN_OVERLAP * squares),
            bins,
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
        let above = |b: &[f64; 2]| (b[0] - b[1]).max(0.0);
        let all: f64 = self.bins.iter().map(above).sum();
        let mut below = 0.0;
        for (i, bin) in self.bins.iter().enumerate() {
            let here = above(bin);
            if below + here >= share * all && here > 0.0 {
                let within = (share * all - below) / here;
                return (self.first as f64 + i as f64 - 0.5 + within) * self.df_hz;
            }
            below += here;
        }
        (self.first as f64 + 0.5 * (self.bins.len() - 1) as f64) * self.df_hz
    }

    /// Factor that reduces the amplitude at a frequency to the floor.
    fn gain(&self, frequency_hz: f64) -> f64 {
        let at = frequency_hz / self.df_hz - self.first as f64;
        let last = self.bins.len() - 1;
        let of = |i: usize| {
            let [density, floor] = self.bins[i.min(last)];
            (floor / density).min(1.0)
        };
        let below = at.floor().clamp(0.0, last as f64);
        let share = (at - below).clamp(0.0, 1.0);
        let (low, high) = (of(below as usize), of(below as usize + 1));
        (low + share * (high - low)).sqrt()
    }
}
