//! `mimu-allan/1`: the noise of a unit at rest.

use std::collections::BTreeMap;

use serde::Serialize;

use super::TOOL;
use crate::judgement::Judgement;
use crate::noise::noise_file::{FileCoefficient, NOISE_FORMAT, NoiseChannel, NoiseFile};
use crate::quantity::Sensor;
use crate::survey::{Channel, Survey};
use crate::warning::Warning;
use mimu_allan::Point;
use mimu_allan::model::{NoiseModel, Reason, Term, Unseen};
use mimu_allan::spectrum::Line;

/// Why a channel has no coefficients at all.
const TOO_SHORT: &str = "fewer than five octaves: record for longer";

/// Noise by one recording, or by several of one unit, each at its own temperature.
#[derive(Debug, Clone, Serialize)]
pub struct AllanResult {
    /// `mimu-allan/1`.
    pub format: &'static str,
    /// Program and version.
    pub tool: &'static str,
    /// Unit under test.
    pub device: Option<String>,
    /// The judgement; null without a recording.
    pub judgement: Option<Judgement>,
    /// Kind of deviation: Allan, modified Allan or Hadamard.
    pub kind: Option<&'static str>,
    /// Probability of each interval.
    pub confidence: Option<f64>,
    /// Samples a second; absent for several recordings.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sample_rate_hz: Option<f64>,
    /// Times of the first and the last sample, s; absent for several recordings.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub span_s: Option<[f64; 2]>,
    /// What was used of each recording.
    pub recordings: Vec<RecordingResult>,
    /// Their channels, recording by recording.
    pub channels: Vec<ChannelResult>,
    /// Warnings; for several recordings each begins with the name of its recording.
    pub warnings: Vec<Warning>,
}

/// What was used of a recording.
#[derive(Debug, Clone, Serialize)]
pub struct RecordingResult {
    /// Directory.
    pub recording: String,
    /// Mean temperature, °C; null where it was not recorded.
    pub temp_c: Option<f64>,
    /// Samples a second, by the time stamps.
    pub sample_rate_hz: f64,
    /// Times of the first and the last sample, s.
    pub span_s: [f64; 2],
    /// Warnings.
    pub warnings: Vec<Warning>,
}

/// Noise of one channel. Deviations are in [`Self::unit`].
#[derive(Debug, Clone, Serialize)]
pub struct ChannelResult {
    /// Column: `gyro_x` to `accel_z`.
    pub name: &'static str,
    /// Its sensor.
    #[serde(skip)]
    pub sensor: Sensor,
    /// Directory of its recording.
    pub recording: String,
    /// Mean temperature, °C; null where it was not recorded.
    pub temp_c: Option<f64>,
    /// rad/s, m/s^2, or the raw unit.
    pub unit: &'static str,
    /// Unit of the readings, if a calibration converted them to [`Self::unit`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub raw_unit: Option<&'static str>,
    /// Scale factor of that conversion, [`Self::raw_unit`] per [`Self::unit`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale_factor: Option<f64>,
    /// Number of samples used; 0 for a channel that is constant throughout, as [`Self::reasons`] say.
    pub samples: usize,
    /// Number of these that were disturbed for a short time, and are masked.
    pub masked_samples: usize,
    /// Averaging times, s.
    pub tau_s: Vec<f64>,
    /// Deviations.
    pub adev: Vec<f64>,
    /// Lower ends of their intervals.
    pub lower: Vec<f64>,
    /// Upper ends.
    pub upper: Vec<f64>,
    /// Equivalent degrees of freedom.
    pub edf: Vec<f64>,
    /// Exponents of the power law `S(f) ~ f^alpha`.
    pub alpha: Vec<i32>,
    /// Standard deviations as if clusters were independent, fang (7), for comparison.
    pub sigma_independent: Vec<f64>,
    /// The noise model; null where the record is too short for one.
    pub model: Option<ModelResult>,
    /// Averaging time beyond which the deviation is at most 5 % lower, s; null if a longer one was still better.
    pub useful_average_s: Option<f64>,
    /// Quantization. If it is null, [`Self::reasons`] say why; so with the others.
    pub q: Option<FileCoefficient>,
    /// White noise.
    pub n: Option<FileCoefficient>,
    /// Bias instability.
    pub b: Option<FileCoefficient>,
    /// Rate random walk.
    pub k: Option<FileCoefficient>,
    /// Rate ramp.
    pub r: Option<FileCoefficient>,
    /// Reason why a coefficient is absent, by its letter.
    pub reasons: BTreeMap<String, String>,
    /// Upper end of the interval of an absent coefficient, by its letter; null if it is unknown.
    pub at_most: BTreeMap<String, Option<f64>>,
    /// Additional length of the recording that would show half of [`Self::at_most`], s, by the letter of the coefficient; absent if a longer one does not
    /// help.
    pub longer_s: BTreeMap<String, f64>,
    /// Lowest and highest frequency that was searched for lines, Hz; null for a record too short for a spectrum.
    pub searched_hz: Option<[f64; 2]>,
    /// Lines and bumps of the spectrum, by frequency. [`Self::n`] then comes from the spectrum without them, and the other coefficients contain what they
    /// add to the curve.
    pub lines: Vec<LineResult>,
    /// Band in which the spectrum is white, Hz, if N was read from the spectrum; null if it was read from the curve.
    pub n_band_hz: Option<[f64; 2]>,
    /// Hadamard deviation; absent unless there is a drift that requires it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hadamard: Option<HadamardResult>,
}

/// A peak above the floor of a spectrum that is not noise of the sensor: from the building, a fan, the mains.
#[derive(Debug, Clone, Serialize)]
pub struct LineResult {
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Band with the middle half of its power, Hz; null for a line narrower than [`Self::resolution_hz`].
    pub width_hz: Option<f64>,
    /// Rms within [`Self::band_hz`], [`ChannelResult::unit`].
    pub rms: f64,
    /// Ends of the interval of the rms.
    pub rms_interval: [f64; 2],
    /// Its highest density over that of the floor.
    pub above_floor: f64,
    /// Noise bandwidth of the spectrum in which it has this density, Hz.
    pub resolution_hz: f64,
    /// Band in which it exceeds the floor, Hz.
    pub band_hz: [f64; 2],
}

/// A noise model over the averaging times of its channel.
#[derive(Debug, Clone, Serialize)]
pub struct ModelResult {
    /// Shortest and longest averaging time that it was fitted to, s.
    pub range_s: [f64; 2],
    /// Whether the short end falls below white noise, as behind a low-pass filter.
    pub filtered: bool,
    /// Misfit over its expectation, where the terms do not describe the curve; null where they do.
    pub excess: Option<f64>,
    /// Allan deviation of the model at [`ChannelResult::tau_s`].
    pub adev: Vec<f64>,
}

/// A Hadamard curve.
#[derive(Debug, Clone, Serialize)]
pub struct HadamardResult {
    /// Averaging times, s.
    pub tau_s: Vec<f64>,
    /// Deviations.
    pub hdev: Vec<f64>,
    /// Lower ends of their intervals.
    pub lower: Vec<f64>,
    /// Upper ends.
    pub upper: Vec<f64>,
    /// As [`ChannelResult::sigma_independent`].
    pub sigma_independent: Vec<f64>,
}

impl AllanResult {
    /// The result of surveys of one unit, each at its own temperature.
    pub fn of(surveys: &[Survey]) -> Self {
        let first = surveys.first();
        let single = match surveys {
            [single] => Some(single),
            _ => None,
        };
        let warnings = surveys.iter().flat_map(|survey| {
            let named = |w: &Warning| match surveys.len() {
                1 => w.clone(),
                _ => Warning::In(survey.recording.clone(), Box::new(w.clone())),
            };
            survey.warnings.iter().map(named).collect::<Vec<_>>()
        });
        let recordings = surveys.iter().map(|survey| RecordingResult {
            recording: survey.recording.clone(),
            temp_c: survey.temp_c,
            sample_rate_hz: survey.sample_rate_hz,
            span_s: survey.span_s,
            warnings: survey.warnings.clone(),
        });
        let channels = surveys
            .iter()
            .flat_map(|s| s.channels.iter().map(|c| ChannelResult::of(s, c)));
        Self {
            format: "mimu-allan/1",
            tool: TOOL,
            device: first.map(|s| s.device.clone()),
            judgement: Judgement::of_surveys(surveys),
            kind: first.map(|s| s.options.kind.name()),
            confidence: first.map(|s| s.options.confidence),
            sample_rate_hz: single.map(|s| s.sample_rate_hz),
            span_s: single.map(|s| s.span_s),
            recordings: recordings.collect(),
            channels: channels.collect(),
            warnings: warnings.collect(),
        }
    }

    /// The channels of `sensor` in `recording`, in the order of its axes.
    pub fn channels(&self, recording: &str, sensor: Sensor) -> Vec<&ChannelResult> {
        let ours = |c: &&ChannelResult| c.recording == recording && c.sensor == sensor;
        self.channels.iter().filter(ours).collect()
    }

    /// The noise file that other commands read; `None` without a recording.
    pub fn noise_file(&self, created: &str) -> Option<NoiseFile> {
        // A constant channel is treated as one that was not recorded.
        let alive = self.channels.iter().filter(|c| c.samples > 0);
        let lengths = self.recordings.iter().map(|r| r.span_s[1] - r.span_s[0]);
        Some(NoiseFile {
            format: NOISE_FORMAT.into(),
            created: Some(created.to_owned()),
            judgement: self.judgement.clone(),
            device: self.device.clone()?,
            sample_rate_hz: self.recordings.first()?.sample_rate_hz,
            duration_s: lengths.fold(f64::INFINITY, f64::min),
            confidence: self.confidence?,
            channel: alive.map(ChannelResult::noise).collect(),
            place: String::new(),
        })
    }
}

impl ChannelResult {
    fn of(survey: &Survey, channel: &Channel) -> Self {
        let column = |of: fn(&Point) -> f64| column(&channel.curve, of);
        let model = channel.model.as_ref();
        let (mut reasons, mut at_most) = (BTreeMap::new(), BTreeMap::new());
        let mut longer_s = BTreeMap::new();
        let [q, n, b, k, r] = Term::ALL.map(|term| {
            let why = match model.map(|m| m.get(term)) {
                Some(Ok(c)) => {
                    return Some(FileCoefficient {
                        value: c.value,
                        sigma: c.sigma,
                        lower: c.lower,
                        upper: c.upper,
                        unit: channel.unit.coefficient(term),
                    });
                }
                Some(Err(unseen)) => channel.unit.reason(term, unseen),
                None => match &channel.dead {
                    Some(dead) => dead.problem(),
                    None => TOO_SHORT.to_owned(),
                },
            };
            let key = term.letter().to_lowercase();
            if let Some(Err(Unseen {
                why: Reason::Small {
                    longer_s: Some(s), ..
                },
                ..
            })) = model.map(|m| m.get(term))
            {
                longer_s.insert(key.clone(), *s);
            }
            reasons.insert(key.clone(), why);
            at_most.insert(key, model.and_then(|m| m.at_most(term)));
            None
        });
        Self {
            name: channel.name,
            sensor: channel.sensor,
            recording: survey.recording.clone(),
            temp_c: survey.temp_c,
            unit: channel.unit.name,
            raw_unit: channel.unit.scaled_from,
            scale_factor: channel.unit.scaled_from.map(|_| 1.0 / channel.unit.per_raw),
            samples: channel.samples,
            masked_samples: channel.masked.map_or(0, |masked| masked.samples),
            tau_s: column(|p| p.tau_s),
            adev: column(|p| p.deviation),
            lower: column(|p| p.lower),
            upper: column(|p| p.upper),
            edf: column(|p| p.edf),
            alpha: channel.curve.iter().map(|p| p.alpha).collect(),
            sigma_independent: column(|p| p.sigma_independent),
            model: model.map(|m| ModelResult::of(m, &channel.curve)),
            useful_average_s: model.and_then(NoiseModel::useful_average_s),
            q,
            n,
            b,
            k,
            r,
            reasons,
            at_most,
            longer_s,
            searched_hz: channel.spectrum.searched_hz,
            lines: channel.spectrum.lines.iter().map(LineResult::of).collect(),
            n_band_hz: channel.n_band_hz,
            hadamard: channel.hadamard.as_deref().map(HadamardResult::of),
        }
    }

    /// The coefficient of `term`, or the reason why it is absent.
    pub fn get(&self, term: Term) -> Result<&FileCoefficient, &str> {
        let value = match term {
            Term::Q => &self.q,
            Term::N => &self.n,
            Term::B => &self.b,
            Term::K => &self.k,
            Term::R => &self.r,
        };
        let why = self.reasons.get(&term.letter().to_lowercase());
        value.as_ref().ok_or(why.map_or("", String::as_str))
    }

    fn noise(&self) -> NoiseChannel {
        let reason = |term| self.get(term).err().map(String::from);
        NoiseChannel {
            name: self.name.into(),
            unit: self.unit.into(),
            raw_unit: self.raw_unit.map(String::from),
            scale_factor: self.scale_factor,
            samples: self.samples as u64,
            // To a thousandth: more is the thermometer's noise.
            temp_c: self.temp_c.map(|t| (1e3 * t).round() / 1e3),
            q: self.q.clone(),
            n: self.n.clone(),
            b: self.b.clone(),
            k: self.k.clone(),
            r: self.r.clone(),
            q_reason: reason(Term::Q),
            n_reason: reason(Term::N),
            b_reason: reason(Term::B),
            k_reason: reason(Term::K),
            r_reason: reason(Term::R),
            k_at_most: self.at_most.get("k").copied().flatten(),
        }
    }
}

impl LineResult {
    fn of(line: &Line) -> Self {
        Self {
            frequency_hz: line.frequency_hz,
            width_hz: line.width_hz,
            rms: line.rms,
            rms_interval: line.interval,
            above_floor: line.above_floor,
            resolution_hz: line.resolution_hz,
            band_hz: line.band_hz,
        }
    }
}

impl ModelResult {
    fn of(model: &NoiseModel, curve: &[Point]) -> Self {
        Self {
            range_s: model.range_s,
            filtered: model.filtered,
            excess: model.excess,
            adev: curve.iter().map(|p| model.deviation(p.tau_s)).collect(),
        }
    }
}

impl HadamardResult {
    fn of(curve: &[Point]) -> Self {
        Self {
            tau_s: column(curve, |p| p.tau_s),
            hdev: column(curve, |p| p.deviation),
            lower: column(curve, |p| p.lower),
            upper: column(curve, |p| p.upper),
            sigma_independent: column(curve, |p| p.sigma_independent),
        }
    }
}

fn column(curve: &[Point], of: fn(&Point) -> f64) -> Vec<f64> {
    curve.iter().map(of).collect()
}
