//! Lines and bumps of a series, and the series without them.

use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

use super::flatten::{Cut, flatten};
use super::line::Line;
use super::search::{Band, Resolution, Search, line_width_hz};
use super::sinusoid::{Sinusoid, subtract, transform};
use super::transform::Transform;
use super::welch::{BIN_OVERLAP, Welch};
use super::white::{White, of_spectrum};

/// Searches until nothing is found: beside a strong line a weak one is found without it.
const ROUNDS: usize = 4;
/// Part of a band's power that a sinusoid has to hold to be taken off as one.
const STEADY: f64 = 0.3;
/// A sinusoid with more than this fraction of the band's power was not seen there.
const MUCH: f64 = 2.0;
/// Part of its power that a line may have beside a sinusoid and still is steady, or twice what the noise makes of the power.
const BESIDE_IT: f64 = 0.1;
/// Standard deviations of its amplitude by which a sinusoid exceeds what the noise has.
const CERTAIN: f64 = 4.0;

/// A series without its lines.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SetAside {
    /// Lines and bumps by frequency.
    pub lines: Vec<Line>,
    /// Lowest and highest frequency that was searched, Hz; `None` for a series too short for a spectrum.
    pub searched_hz: Option<[f64; 2]>,
    /// Whether something still stands out, which could not be brought down.
    pub remains: bool,
    /// Spectrum of the residual, at the finest resolution.
    finest: Option<Welch>,
}

impl SetAside {
    /// [`super::white_band`] of the series that is left, whose samples are `dt_s` apart, without a look at it; `None` too where it was too short
    /// for a search.
    pub fn white_band(&self, dt_s: f64, confidence: f64) -> Option<White> {
        of_spectrum(self.finest.as_ref()?, dt_s, &self.lines, confidence)
    }

    /// Lets go of the spectrum, 8 MB for three hours at 1 kHz; [`Self::white_band`] has nothing to go by afterwards.
    pub fn without_spectrum(mut self) -> Self {
        self.finest = None;
        self
    }
}

/// Finds the lines and bumps of `rates` (any unit, `dt_s` apart) and takes them off: a steady line as a sinusoid, anything else
/// by bringing its band down to the floor. Where there are none the series stays as it is, to the bit. Intervals have the
/// probability `confidence`.
pub fn set_aside(rates: &mut [f64], dt_s: f64, confidence: f64) -> SetAside {
    set_aside_after(rates, dt_s, confidence, |_| {})
}

/// [`set_aside`] that hands `before` the series once, if it is going to be changed.
pub fn set_aside_after(
    rates: &mut [f64],
    dt_s: f64,
    confidence: f64,
    before: impl FnOnce(&[f64]),
) -> SetAside {
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
    SetAside {
        lines,
        searched_hz,
        remains,
        finest,
    }
}

/// Takes all bands that a search has found off.
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
            // A band beside that of a strong line finds the same one: what it is without the line, the next search shows.
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

/// What a band is, and the sinusoid that holds most of it, if one does. `whole` is the transform of the series.
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
            // Of the effective value, 1/√2 of the amplitude.
            let sigma = (0.5 * noise).sqrt();
            line.interval = [-z, z].map(|z| (line.rms + z * sigma).max(0.0));
        }
    }
    (line, sinusoid)
}

/// Adds a line; what was found of one in a later round is left of it, and the rest of it was reported then.
fn add(lines: &mut Vec<Line>, line: Line) {
    let same = |other: &&mut Line| {
        line.band_hz[0] < other.band_hz[1] && other.band_hz[0] < line.band_hz[1]
    };
    match lines.iter_mut().find(same) {
        None => lines.push(line),
        Some(first) => {
            // A sinusoid that leaves something behind was not steady, and the sum of both is known as well as both.
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

/// What of a band is above the floor.
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
        // The least power that a bin of the peak's height holds: rounding must leave a mean square above zero.
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

    /// Frequency with so much of the excess below it, Hz.
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

    /// Factor that brings the amplitude at a frequency down to the floor.
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
