//! The noise of a recording at rest: selects a segment, and computes each channel's curve and model.
//!
//! One channel is computed at a time: three hours at 1 kHz are 86 MB per channel, and the spectrum takes more memory in addition than the
//! curves.

mod bridging;
mod columns;
mod judged;
mod masking;
mod segment;
mod several;
mod suitability;
mod suspect;
pub mod unit;
mod values;

use self::columns::Columns;
pub use self::masking::Masked;
pub use self::segment::Part;
use self::segment::{Segment, Temperature, temperature};
pub use self::several::survey_all;
use self::suitability::Suitability;
use self::unit::Unit;
use self::values::{Read, Values};
use crate::calibration::Calibration;
use crate::quantity::Sensor;
use crate::warning::Warning;
use mimu_allan::deviation::Integrated;
use mimu_allan::model::{
    Coefficient, Estimator, NoiseModel, Term, allan_factors, hadamard_factors,
};
use mimu_allan::spectrum::Lines;
use mimu_allan::{Deviation, NotFinite, Point, Spacing};
use mimu_recording::health::{At, Finding, Temperatures};
use mimu_recording::{Argument, Column, Error, RAW_COLUMNS, RawUnit, Recording, Result};

/// What to compute.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Which samples.
    pub part: Part,
    /// Deviation that is reported; the model is always fitted to the overlapping Allan deviation.
    pub kind: Deviation,
    /// Averaging times in a decade.
    pub per_decade: usize,
    /// Probability of all intervals.
    pub confidence: f64,
}

impl Default for Options {
    /// The whole recording, by the overlapping Allan deviation at ten averaging times a decade, with 95 % intervals.
    fn default() -> Self {
        Self {
            part: Part::Whole,
            kind: Deviation::Allan,
            per_decade: 10,
            confidence: 0.95,
        }
    }
}

/// Noise of one channel.
#[derive(Debug, Clone)]
pub struct Channel {
    /// Its column.
    pub name: &'static str,
    /// Its sensor.
    pub sensor: Sensor,
    /// Unit of its deviations.
    pub unit: Unit,
    /// Why it has no noise: it is constant, and nothing is computed from it.
    pub dead: Option<Finding>,
    /// Samples that it was computed from.
    pub samples: usize,
    /// Short disturbances that were masked.
    pub masked: Option<Masked>,
    /// Deviation over averaging time.
    pub curve: Vec<Point>,
    /// Hadamard deviation, if the curve shows a drift.
    pub hadamard: Option<Vec<Point>>,
    /// Lines of its spectrum.
    pub spectrum: Lines,
    /// The noise model; `None` where the record has too few octaves for one.
    pub model: Option<NoiseModel>,
    /// Band of the spectrum that N was read from, Hz, where the Allan curve does not show it.
    pub n_band_hz: Option<[f64; 2]>,
}

/// Noise of a recording.
#[derive(Debug, Clone)]
pub struct Survey {
    /// Directory of the recording.
    pub recording: String,
    /// Unit under test.
    pub device: String,
    /// Mean temperature, °C, where it was recorded.
    pub temp_c: Option<f64>,
    /// Samples a second, by the time stamps.
    pub sample_rate_hz: f64,
    /// Times of the first and the last sample, s.
    pub span_s: [f64; 2],
    /// What was computed.
    pub options: Options,
    /// The channels that the recording has, in the order of its columns.
    pub channels: Vec<Channel>,
    /// What a person should know.
    pub warnings: Vec<Warning>,
}

/// If a ramp makes more than this share of the Allan variance at the longest time, the curve shows a drift there.
const RAMP_SHARE: f64 = 0.5;

/// Computes the noise of `recording`, a unit at rest, in SI if its raw unit is SI or `calibration` gives the scale factors.
///
/// ```no_run
/// use mimu::{AllanOptions, Recording, allan};
///
/// let night = Recording::open("night".as_ref())?;
/// let survey = allan(&night, None, AllanOptions::default(), |_| ())?;
/// for channel in &survey.channels {
///     println!("{}: {:?}", channel.name, channel.unit); // N, B and K of each, with intervals
/// }
/// # Ok::<(), mimu::Error>(())
/// ```
///
/// A channel in volts or counts is divided by the scale factor of its axis, without the rotation to body axes: the noise belongs to the
/// sensor, and a misalignment of 1 % is 1e-4 of its variance.
///
/// Errors: the segment is too short, the unit moves, a channel is stuck for a time, all channels are stuck throughout, or the time stamps
/// do not fit the rate.
pub fn survey(
    recording: &Recording,
    calibration: Option<&Calibration>,
    options: Options,
    progress: impl Fn(f64),
) -> Result<Survey> {
    let place = recording.place.clone();
    let indices: Vec<usize> = (0..6)
        .filter(|i| recording.columns.has(Column::Raw(*i)))
        .collect();
    let units = units(recording, calibration, &indices)?;
    let mut columns = Columns::open(recording, &indices, &progress)?;
    let read = recording.warnings.iter().cloned();
    let mut warnings: Vec<Warning> = read.map(Warning::Reading).collect();
    let segment = Segment::find(&mut columns, recording, options.part, &place, &mut warnings)?;
    let temperature = read_temperature(&mut columns, recording, &segment, &mut warnings)?;
    let mut found = Found {
        segment: &segment,
        temperature: temperature.as_ref(),
        options,
        estimators: Estimators::default(),
        channels: Vec::new(),
        judged: Vec::new(),
        warnings,
    };
    for (done, (&i, unit)) in indices.iter().zip(units).enumerate() {
        let values = columns.take(Column::Raw(i))?;
        match Values::of(values, &segment, options.part, i, unit, &place)? {
            Read::Values(values) => {
                found.add(i, unit, values)?;
                progress(0.1 + 0.9 * (done + 1) as f64 / indices.len() as f64);
            }
            Read::Dead(dead) => found.add_dead(i, unit, dead),
        }
    }
    found.refuse_all_dead(&place)?;
    found.warn_if_suspect(recording, calibration);
    found.refuse_motion(&place)?;
    Ok(Survey {
        recording: recording.name(),
        device: recording.manifest.device.clone(),
        temp_c: temperature.as_ref().map(|t| t.mean_c),
        sample_rate_hz: 1.0 / segment.period_s,
        span_s: segment.span_s,
        options,
        channels: found.channels,
        warnings: found.warnings,
    })
}

/// Temperature over `segment`; `None` where it was not recorded.
fn read_temperature(
    columns: &mut Columns,
    recording: &Recording,
    segment: &Segment,
    warnings: &mut Vec<Warning>,
) -> Result<Option<Temperature>> {
    if !recording.columns.temp_c {
        return Ok(None);
    }
    let mut temp_c = columns.take(Column::Temperature)?;
    let mut all = Temperatures::default();
    let times = (0..).map(|k| segment.span_s[0] + f64::from(k) * segment.period_s);
    for (c, t_s) in temp_c[segment.rows.clone()].iter_mut().zip(times) {
        *c = all.take(*c, At::Time(t_s));
    }
    warnings.extend(all.impossible().map(Warning::Health));
    Ok(temperature(&temp_c, &segment.rows))
}

/// What the channels of a recording have shown so far, and what the next one is computed with.
struct Found<'a> {
    segment: &'a Segment,
    temperature: Option<&'a Temperature>,
    options: Options,
    estimators: Estimators,
    channels: Vec<Channel>,
    /// Those that are alive, by index.
    judged: Vec<(usize, Suitability)>,
    warnings: Vec<Warning>,
}

impl Found<'_> {
    /// Computes the noise of the raw channel `i`.
    fn add(&mut self, i: usize, unit: Unit, values: Values) -> Result<()> {
        let (dt_s, options) = (self.segment.period_s, &self.options);
        self.warnings.extend(values.warnings);
        let samples = values.rates.len();
        let estimator = self.estimators.of(samples, dt_s, options.confidence);
        let heat = self
            .temperature
            .and_then(|t| t.against(&values.suitability.levels));
        self.judged.push((i, values.suitability));
        let spectrum = Lines::of(&values.rates, dt_s, options.confidence);
        let integrated = Integrated::new(values.rates, dt_s).map_err(not_finite)?;
        let mut channel = Channel::of(i, unit, samples);
        channel.masked = values.masked;
        channel.spectrum = spectrum;
        channel.analyse(&integrated, estimator, options);
        channel.judge_drift(&integrated, heat, options, &mut self.warnings);
        if !channel.spectrum.lines.is_empty() {
            let lines_hz = channel.spectrum.lines.iter().map(|l| l.frequency_hz);
            let warning = Warning::Lines {
                hz: lines_hz.collect(),
            };
            self.warnings.push(warning.of_channel(i));
        }
        channel.spectrum = channel.spectrum.without_spectrum();
        self.channels.push(channel);
        Ok(())
    }

    fn add_dead(&mut self, i: usize, unit: Unit, dead: Finding) {
        self.warnings.push(Warning::Health(dead));
        self.channels.push(Channel {
            dead: Some(dead),
            ..Channel::of(i, unit, 0)
        });
    }

    fn refuse_all_dead(&self, place: &str) -> Result<()> {
        let first = self.channels.first().and_then(|c| c.dead.as_ref());
        let Some(dead) = first.filter(|_| self.judged.is_empty()) else {
            return Ok(());
        };
        let names: Vec<&str> = self.channels.iter().map(|c| c.name).collect();
        Err(Error::new(
            format!("{place}, columns {}", names.join(", ")),
            match self.channels.len() {
                1 => dead.problem(),
                n => format!(
                    "all {n} channels are constant: of the first {}",
                    dead.problem()
                ),
            },
            dead.remedy(),
        ))
    }

    fn warn_if_suspect(&mut self, recording: &Recording, calibration: Option<&Calibration>) {
        let levels = self.judged.iter().map(|(i, seen)| (*i, seen.level()));
        self.warnings.extend(suspect::input(
            &recording.manifest,
            calibration,
            self.segment.period_s,
            levels.collect(),
        ));
        self.warnings.extend(suspect::noise(&self.channels));
    }

    fn refuse_motion(&mut self, place: &str) -> Result<()> {
        suitability::refuse_motion(
            &self.judged,
            self.segment,
            self.options.part,
            place,
            &mut self.warnings,
        )
    }
}

/// Estimators, each with the number of samples that it is for.
#[derive(Default)]
struct Estimators(Vec<(usize, Estimator)>);

impl Estimators {
    fn of(&mut self, samples: usize, period_s: f64, confidence: f64) -> &Estimator {
        let at = match self.0.iter().position(|(n, _)| *n == samples) {
            Some(at) => at,
            None => {
                let new = Estimator::new(samples, period_s, confidence);
                self.0.push((samples, new));
                self.0.len() - 1
            }
        };
        &self.0[at].1
    }
}

/// Unit of each channel, with the factor from raw to it.
fn units(
    recording: &Recording,
    calibration: Option<&Calibration>,
    indices: &[usize],
) -> Result<Vec<Unit>> {
    let raw = recording.manifest.raw_unit;
    let unit = |&i: &usize| {
        let sensor = if i < 3 { Sensor::Gyro } else { Sensor::Accel };
        let Some(calibration) = calibration else {
            return Ok(match raw {
                RawUnit::Si => Unit::si(sensor),
                _ => Unit::raw(raw),
            });
        };
        let Some(table) = calibration.table(sensor) else {
            return Err(Error::new(
                format!("{}, calibration", RAW_COLUMNS[i]),
                format!("the calibration has no [{sensor}]"),
                "calibrate that sensor too, or leave the calibration out",
            )
            .about(Argument::Calibration));
        };
        if table.raw_unit != raw {
            return Err(Error::new(
                format!("{}, calibration", RAW_COLUMNS[i]),
                format!(
                    "it is for readings in {}, and those of the recording are in {raw}",
                    table.raw_unit
                ),
                "give the calibration of this unit",
            ));
        }
        let scale_factor = table.physical.scale_factor[i % 3];
        Ok(Unit::scaled(sensor, raw, scale_factor))
    };
    indices.iter().map(unit).collect()
}

fn not_finite(bad: NotFinite) -> Error {
    Error::new(
        format_args!("sample {}", bad.sample),
        format_args!("{} cannot be averaged", bad.value),
        "choose a segment without gaps",
    )
}

impl Channel {
    /// The raw channel `i` before anything is computed from its `samples`.
    fn of(i: usize, unit: Unit, samples: usize) -> Self {
        Self {
            name: RAW_COLUMNS[i],
            sensor: if i < 3 { Sensor::Gyro } else { Sensor::Accel },
            unit,
            dead: None,
            samples,
            masked: None,
            curve: Vec::new(),
            hadamard: None,
            spectrum: Lines::default(),
            model: None,
            n_band_hz: None,
        }
    }

    /// Computes the curve of the channel, and the model.
    fn analyse(&mut self, integrated: &Integrated, estimator: &Estimator, options: &Options) {
        let curve = |kind, times| integrated.curve(kind, &times, options.confidence);
        self.curve = curve(options.kind, Spacing::PerDecade(options.per_decade));
        let allan = Spacing::Samples(allan_factors(self.samples));
        let hadamard = Spacing::Samples(hadamard_factors(self.samples));
        let [allan, hadamard] = [
            curve(Deviation::Allan, allan),
            curve(Deviation::Hadamard, hadamard),
        ];
        self.model = estimator.fit(&allan, &hadamard);
        self.read_white_band(integrated.dt_s(), options.confidence);
    }

    /// Takes N from the spectrum, without its lines, if it has any or the Allan curve is bent at its short end: there the model shows N wrongly or not at all.
    fn read_white_band(&mut self, dt_s: f64, confidence: f64) {
        let Some(model) = &mut self.model else { return };
        let shortened = model.range_s[0] > 1.5 * dt_s;
        if model.get(Term::N).is_ok()
            && model.excess.is_none()
            && !shortened
            && self.spectrum.lines.is_empty()
        {
            return;
        }
        let Some(white) = self.spectrum.white_band(dt_s, confidence) else {
            return;
        };
        let n = &mut model.coefficients[Term::N as usize];
        match (white.band_hz, n) {
            (Some(band), n) => {
                let [lower, upper] = white.interval;
                *n = Ok(Coefficient {
                    value: white.value,
                    sigma: white.sigma,
                    lower,
                    upper,
                });
                self.n_band_hz = Some(band);
            }
            // Neither shows N: the curve's bound may come from times at which a filter has bent it.
            (None, Err(unseen)) => unseen.raise(white.interval[1]),
            (None, Ok(_)) => {}
        }
    }

    /// Warns if the long end of the curve shows a drift, and adds the Hadamard deviation, which cancels a drift.
    fn judge_drift(
        &mut self,
        integrated: &Integrated,
        heat: Option<(f64, f64)>,
        options: &Options,
        warnings: &mut Vec<Warning>,
    ) {
        let longest_s = self.curve.last().map_or(0.0, |p| p.tau_s);
        let ramp = self.model.as_ref().and_then(|model| {
            let r = model.get(Term::R).ok()?.value * Term::R.deviation(longest_s);
            Some((r / model.deviation(longest_s)).powi(2))
        });
        let ramp = ramp.filter(|share| *share > RAMP_SHARE);
        let warning = match (heat, ramp) {
            (Some((r, span_c)), _) => Warning::FollowsChamber {
                span_c,
                correlation: r,
            },
            (None, Some(share)) => Warning::Drifts { share, longest_s },
            (None, None) => return,
        };
        warnings.push(Warning::Channel(self.name, Box::new(warning)));
        if options.kind != Deviation::Hadamard {
            let times = Spacing::PerDecade(options.per_decade);
            self.hadamard = Some(integrated.curve(Deviation::Hadamard, &times, options.confidence));
        }
    }
}
