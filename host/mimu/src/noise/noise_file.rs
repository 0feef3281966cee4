//! The noise file `mimu-noise/1`: the result of `mimu allan`, for the commands that use it.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::judgement::Judgement;
use crate::quantity::Sensor;
use crate::toml_layout::to_toml;
use mimu_allan::model::{FLOOR, Term};
use mimu_allan::variance::AllanModel;
use mimu_recording::{Argument, Error, RAW_COLUMNS, Result, check_kind, parse_toml, read_text};

/// Version of the noise file.
pub const NOISE_FORMAT: &str = "mimu-noise/1";

/// A noise file as `mimu allan -o` writes it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoiseFile {
    /// [`NOISE_FORMAT`].
    pub format: String,
    /// Unit under test.
    pub device: String,
    /// When it was made, RFC 3339.
    pub created: Option<String>,
    /// The judgement of the record, if it was made.
    pub judgement: Option<Judgement>,
    /// Samples a second.
    pub sample_rate_hz: f64,
    /// Length of the record, s; of several records, that of the shortest.
    pub duration_s: f64,
    /// Probability of the intervals.
    pub confidence: f64,
    /// Its channels; with records at several temperatures, each channel once for each temperature.
    pub channel: Vec<NoiseChannel>,
    /// Path, for messages.
    #[serde(skip)]
    pub place: String,
}

/// One channel of a noise file.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoiseChannel {
    /// Column: `gyro_x` to `accel_z`.
    pub name: String,
    /// Unit of its coefficients and of the deviations that they describe.
    pub unit: String,
    /// Unit of the readings, if a calibration converted them to [`Self::unit`].
    pub raw_unit: Option<String>,
    /// Scale factor of that calibration, [`Self::raw_unit`] per [`Self::unit`].
    pub scale_factor: Option<f64>,
    /// Samples that it was computed from.
    pub samples: u64,
    /// Mean temperature, °C, where it was recorded.
    pub temp_c: Option<f64>,
    /// Quantization.
    pub q: Option<FileCoefficient>,
    /// White noise.
    pub n: Option<FileCoefficient>,
    /// Bias instability.
    pub b: Option<FileCoefficient>,
    /// Rate random walk.
    pub k: Option<FileCoefficient>,
    /// Rate ramp.
    pub r: Option<FileCoefficient>,
    /// Why there is no quantization.
    pub q_reason: Option<String>,
    /// Why there is no white noise.
    pub n_reason: Option<String>,
    /// Why there is no bias instability.
    pub b_reason: Option<String>,
    /// Why there is no rate random walk.
    pub k_reason: Option<String>,
    /// Why there is no rate ramp.
    pub r_reason: Option<String>,
    /// Upper end of the interval of a rate random walk that the record does not show, for programs that need a value.
    pub k_at_most: Option<f64>,
}

/// A coefficient of a noise file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FileCoefficient {
    /// Estimate.
    pub value: f64,
    /// Its standard deviation.
    pub sigma: f64,
    /// Lower end of the interval.
    pub lower: f64,
    /// Upper end.
    pub upper: f64,
    /// Unit of all of them.
    pub unit: String,
}

impl NoiseChannel {
    /// The coefficient of `term`, or the reason why it is absent.
    pub fn get(&self, term: Term) -> std::result::Result<&FileCoefficient, &str> {
        let (value, reason) = match term {
            Term::Q => (&self.q, &self.q_reason),
            Term::N => (&self.n, &self.n_reason),
            Term::B => (&self.b, &self.b_reason),
            Term::K => (&self.k, &self.k_reason),
            Term::R => (&self.r, &self.r_reason),
        };
        let unknown = "the noise file gives no reason";
        value.as_ref().ok_or(reason.as_deref().unwrap_or(unknown))
    }

    /// N, B and K as Allan variance, in the unit of the channel squared. A coefficient that the record does not show is zero; quantization
    /// and ramp are not noise of a mean.
    pub fn model(&self) -> AllanModel {
        let squared = |term| self.get(term).map_or(0.0, |c| c.value.powi(2));
        AllanModel {
            white: squared(Term::N),
            flicker: FLOOR * squared(Term::B),
            walk: squared(Term::K) / 3.0,
        }
    }

    /// [`Self::model`] in `unit` squared, which is the unit of the readings or of the calibrated readings.
    ///
    /// Errors: `unit` is another one.
    pub fn model_in(&self, unit: &str, place: &str) -> Result<AllanModel> {
        let model = self.model();
        if unit == self.unit {
            return Ok(model);
        }
        if let (Some(raw), Some(scale)) = (&self.raw_unit, self.scale_factor)
            && unit == raw
        {
            let squared = scale.powi(2);
            return Ok(AllanModel {
                white: model.white * squared,
                flicker: model.flicker * squared,
                walk: model.walk * squared,
            });
        }
        let is_si = |u: &str| Sensor::BOTH.iter().any(|s| s.unit() == u);
        let found = match &self.raw_unit {
            Some(raw) => format!("{}, of readings in {raw}", self.unit),
            None => self.unit.clone(),
        };
        let (remedy, argument) = match (is_si(&self.unit), &self.raw_unit) {
            (true, None) if !is_si(unit) => (
                "run `mimu allan` again on the raw recording, with a calibration: the file then contains the scale factor",
                Some(Argument::CalibrationOfNoise),
            ),
            (false, _) if is_si(unit) => (
                "run `mimu allan` again with a calibration: the file then serves for raw readings and for SI",
                Some(Argument::CalibrationOfNoise),
            ),
            _ => (
                "run `mimu allan` on a recording of this unit with the same raw unit",
                None,
            ),
        };
        let problem = format!("its unit is {found}, and {unit} is needed");
        let place = format!("{place}, channel {}", self.name);
        let error = Error::new(place, problem, remedy);
        Err(argument.into_iter().fold(error, Error::about))
    }
}

/// Comment at the top of a noise file.
const HEADER: &str = "\
# Noise of an inertial unit at rest: sigma^2(tau) = 3 Q^2/tau^2 + N^2/tau + (2 ln 2/pi) B^2 + K^2 tau/3 + R^2 tau^2/2.
# q quantization, n white noise, b bias instability, k rate random walk, r rate ramp, with a confidence interval each.
# If the record does not show a coefficient, the coefficient is absent and the reason is given.
# scale_factor (if a calibration was given): raw_unit per unit. A coefficient times scale_factor is that of the raw readings.
";

impl NoiseFile {
    /// Text of the file.
    pub fn to_toml(&self) -> String {
        to_toml(HEADER, self)
    }

    /// Reads and checks a noise file.
    pub fn read(path: &Path) -> Result<Self> {
        Self::parse(&read_text(path)?, &path.display().to_string())
    }

    /// Parses and checks the text of a noise file; `place` is its path.
    pub fn parse(text: &str, place: &str) -> Result<Self> {
        check_kind(text, place, "mimu-noise")?;
        let mut file: Self = parse_toml(text, place, Some("run `mimu allan` again"))?;
        if file.format != NOISE_FORMAT {
            return Err(Error::new(
                place,
                format!(
                    "format is {:?}, and this program reads {NOISE_FORMAT:?}",
                    file.format
                ),
                "use the version of mimu that wrote it",
            ));
        }
        for channel in &file.channel {
            if !RAW_COLUMNS.contains(&channel.name.as_str()) {
                return Err(Error::new(
                    format!("{place}, channel {:?}", channel.name),
                    "it is not a channel",
                    format!("use one of {}", RAW_COLUMNS.join(", ")),
                ));
            }
            let scaled = (&channel.raw_unit, channel.scale_factor);
            if !matches!(scaled, (None, None) | (Some(_), Some(_)))
                || scaled.1.is_some_and(|s| !s.is_normal())
            {
                return Err(Error::new(
                    format!("{place}, channel {}, scale_factor", channel.name),
                    "raw_unit and scale_factor need each other, and a scale factor is a number other than 0",
                    "run `mimu allan` again with a calibration",
                )
                .about(Argument::CalibrationOfNoise));
            }
            for term in Term::ALL {
                let Ok(c) = channel.get(term) else { continue };
                let good = |v: f64| v.is_finite() && v > 0.0;
                if !good(c.value) || !good(c.upper) {
                    return Err(Error::new(
                        format!("{place}, channel {}, {}", channel.name, term.letter()),
                        format!(
                            "value {} with the upper end {} cannot be noise",
                            c.value, c.upper
                        ),
                        "run `mimu allan` again",
                    ));
                }
            }
            if channel
                .k_at_most
                .is_some_and(|k| !(k.is_finite() && k >= 0.0))
            {
                return Err(Error::new(
                    format!("{place}, channel {}, k_at_most", channel.name),
                    "it cannot be the upper end of a noise",
                    "run `mimu allan` again",
                ));
            }
            if channel.model().variance(1.0) == 0.0 {
                let why = channel.get(Term::N).err().unwrap_or_default();
                return Err(Error::new(
                    format!("{place}, channel {}", channel.name),
                    format!("it has neither N nor B nor K: N {why}"),
                    "run `mimu allan` on a longer record",
                ));
            }
        }
        file.place = place.into();
        Ok(file)
    }

    /// The channels of `sensor`, in the order of the file.
    pub fn of(&self, sensor: Sensor) -> Vec<&NoiseChannel> {
        let names = &RAW_COLUMNS[sensor.channels()];
        let ours = |c: &&NoiseChannel| names.contains(&c.name.as_str());
        self.channel.iter().filter(ours).collect()
    }
}
