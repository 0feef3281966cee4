//! Calibrations and noise in the files of other programs, read.
//!
//! [`read`] recognises the format by its keys: the first of those that find most of what they declare ([`Entry`](crate::layout::Entry)). A file says no
//! uncertainty, so what is read has none. What a file has beside what is read, [`Foreign::left_out`] names.

use mimu::calibration::Calibration;
use mimu::noise::noise_file::{FileCoefficient, NOISE_FORMAT, NoiseChannel, NoiseFile};
use mimu::quantity::{AXES, PerSensor, Sensor};
use mimu_allan::model::Term;
use mimu_core::compensation::Affine;
use mimu_recording::error::{Argument, Error, Result};
use mimu_recording::{RawUnit, UNNAMED};

use crate::convention::Bias;
use crate::keyed::Keyed;
use crate::layout::{Found, nothing};
use crate::{FORMATS, Format, driver};

/// A file of another program.
pub struct Foreign {
    /// Its format.
    pub format: &'static Format,
    /// Its path.
    pub place: String,
    /// The numbers of each triad, in the convention of the format.
    pub parts: Found,
    /// Unit of its readings; `None` if these are a unit's own, and the file does not name it.
    raw_unit: Option<RawUnit>,
    /// The calibration, if the file has all of one.
    whole: Option<Calibration>,
    file: Keyed,
}

/// The file with these bytes; `None` if no format has its keys.
///
/// # Errors
/// A key is missing beside others of its triad, or has too few numbers.
pub fn read(bytes: &[u8], place: &str) -> Result<Option<Foreign>> {
    for format in FORMATS {
        let whole = format.whole.and_then(|whole| whole(bytes, place));
        if let Some(whole) = whole.transpose()? {
            return Ok(Some(Foreign::of(
                format,
                place,
                Keyed::default(),
                Some(whole),
            )?));
        }
        if let Some(file) = format.unpack.and_then(|unpack| unpack(bytes, place)) {
            return Ok(Some(Foreign::of(format, place, file, None)?));
        }
    }
    let Ok(text) = std::str::from_utf8(bytes) else {
        return Ok(None);
    };
    let file = Keyed::of(text);
    let mut best = (0, None);
    for format in FORMATS {
        let found = format.count(&file);
        if found > best.0 {
            best = (found, Some(format));
        }
    }
    let found = best.1.map(|format| Foreign::of(format, place, file, None));
    found.transpose()
}

impl Foreign {
    fn of(
        format: &'static Format,
        place: &str,
        file: Keyed,
        whole: Option<Calibration>,
    ) -> Result<Self> {
        let refused = |key: &str, problem: &str| {
            let remedy = format!("copy the file of {} again", format.name);
            Error::new(format!("{place}, key {key}"), problem, remedy)
        };
        let mut parts: Found = PerSensor::default();
        let mut missing: PerSensor<Option<&str>> = PerSensor::default();
        for entry in format.layout {
            let of = &mut parts[entry.sensor];
            let mut these = of.unwrap_or_else(nothing);
            let read = entry.read(&file, &mut these).map_err(|(key, count)| {
                refused(
                    &key,
                    &format!("it is missing, or has fewer numbers than {count}"),
                )
            })?;
            match (read, entry.is_optional) {
                (true, _) => *of = Some(these),
                (false, true) => {}
                (false, false) => missing[entry.sensor] = missing[entry.sensor].or(Some(entry.key)),
            }
        }
        for (sensor, key) in missing.present() {
            if parts[sensor].is_some() {
                return Err(refused(
                    key,
                    "it is missing, and the file has other keys of this triad",
                ));
            }
        }
        // What mimu wrote says the unit in its comments.
        let named = |unit: &RawUnit| file.text.contains(&format!("readings in {unit},"));
        let mut units = [RawUnit::Volt, RawUnit::Count, RawUnit::Si].into_iter();
        let raw_unit = match format.takes_raw {
            true => units.find(named),
            false => Some(RawUnit::Si),
        };
        Ok(Self {
            format,
            place: place.into(),
            parts,
            raw_unit: whole.as_ref().map(|w| w.recording.raw_unit).or(raw_unit),
            whole,
            file,
        })
    }

    /// With the triad of another file of the same program.
    ///
    /// # Errors
    /// The files are of two programs, or both have one triad.
    pub fn with_triad_of(mut self, other: Self) -> Result<Self> {
        let place = format!("{}, {}", self.place, other.place);
        let refused = |problem: String| {
            let remedy = "give files of one program, each with a triad";
            Err(Error::new(&place, problem, remedy).about(Argument::Calibration))
        };
        if self.format.name != other.format.name {
            let (first, second) = (self.format.name, other.format.name);
            return refused(format!("one file is of {first}, the other of {second}"));
        }
        let both = Sensor::BOTH.map(|s| self.parts[s].is_some() && other.parts[s].is_some());
        if self.whole.is_some() || other.whole.is_some() || both.contains(&true) {
            return refused("both files have a calibration of one triad".into());
        }
        for (sensor, parts) in other.parts.present() {
            self.parts[sensor] = Some(*parts);
        }
        self.raw_unit = self.raw_unit.or(other.raw_unit);
        self.place = place;
        Ok(self)
    }

    /// What the file has that is not read.
    pub fn left_out(&self) -> Option<String> {
        let keys = self.format.not_read.iter();
        let there = |key: &&&str| self.file.has_other_than_zero(key);
        let keys: Vec<&str> = keys.filter(there).copied().collect();
        (!keys.is_empty()).then(|| {
            let is = if keys.len() == 1 { "is" } else { "are" };
            let (place, keys) = (&self.place, keys.join(", "));
            format!("{place}: {keys} {is} not read: the calibration is what the other keys say")
        })
    }

    /// Whether the file has a bias of `sensor`.
    pub fn has_bias(&self, sensor: Sensor) -> bool {
        let mut entries = self.format.layout.iter();
        let has = |e: &crate::layout::Entry| e.sensor == sensor && e.numbers.has_bias();
        self.whole.is_some() || entries.any(has) && self.format.convention.bias != Bias::Absent
    }

    /// Whether it has the noise of a unit, and no calibration.
    pub fn is_noise_only(&self) -> bool {
        self.whole.is_none() && self.parts.present().next().is_none()
    }

    /// The calibration, if the file has all of one.
    pub(crate) fn whole(&self) -> Option<&Calibration> {
        self.whole.as_ref()
    }

    /// Unit of the readings that it is for: as the file says it, or else `given`.
    pub fn raw_unit(&self, given: RawUnit) -> RawUnit {
        self.raw_unit.unwrap_or(given)
    }

    /// The calibration in the convention of the format, of readings in `given` if the file does not say their unit. A bias that it lacks is 0.
    ///
    /// # Errors
    /// The file has noise only, or a matrix that cannot be inverted.
    pub fn calibration(&self, given: RawUnit) -> Result<Calibration> {
        if let Some(whole) = self.whole() {
            return Ok(whole.clone());
        }
        if self.is_noise_only() {
            let name = self.format.name;
            let problem = format!("it has the noise of a unit for {name}, and no calibration");
            let remedy = "give a file with scale factors or biases";
            return Err(Error::new(&self.place, problem, remedy).about(Argument::Calibration));
        }
        let mut models = PerSensor::default();
        for (sensor, parts) in self.parts.present() {
            let model = self.format.convention.inverse(parts).ok_or_else(|| {
                let place = format!("{}, {sensor}", self.place);
                let remedy = "check the numbers of the file";
                Error::new(place, "its matrix is singular", remedy)
            })?;
            models[sensor] = Some(model);
        }
        self.with(&models, given)
    }

    /// A calibration with these models.
    pub(crate) fn with(
        &self,
        models: &PerSensor<Option<Affine<f64>>>,
        given: RawUnit,
    ) -> Result<Calibration> {
        let frame = self.format.frame();
        let unit = (UNNAMED, self.raw_unit(given), frame.as_str());
        Calibration::of_program(models, unit, &self.place)
    }

    /// Messages a second, if the file has them.
    fn rate_hz(&self) -> Option<f64> {
        let rate = self.file.numbers(self.format.rate_key?)?;
        rate.first().copied()
    }

    /// Densities of x, y and z, SI, for messages at the file's rate or else at `rate_hz`; `None` if the file does not have them.
    pub fn density(&self, sensor: Sensor, term: Term, rate_hz: Option<f64>) -> Option<[f64; 3]> {
        let rate_hz = self.rate_hz().or(rate_hz);
        let mut keys = self.format.noise_keys.iter();
        let key = keys.find(|key| key.sensor == sensor && key.term == term)?;
        key.read(&self.file, rate_hz.unwrap_or(f64::NAN))
    }

    /// Its noise for other formats, of calibrated readings and without intervals; `None` if it has none. Densities of a file that are those of the readings are
    /// divided by the factors that such a file is written with.
    ///
    /// # Errors
    /// Its numbers are those of a sample at a rate that is not known, or its calibration is singular.
    pub fn noise(&self, rate_hz: Option<f64>) -> Result<Option<NoiseFile>> {
        let rate_hz = self.rate_hz().or(rate_hz);
        let unknown = |value: f64, unit: &str| FileCoefficient {
            value,
            sigma: f64::NAN,
            lower: f64::NAN,
            upper: f64::NAN,
            unit: unit.into(),
        };
        let calibration = match self.is_noise_only() {
            true => None,
            false => Some(self.calibration(RawUnit::Si)?),
        };
        let mut channel = Vec::new();
        for sensor in Sensor::BOTH {
            let Some(white) = self.density(sensor, Term::N, rate_hz) else {
                continue;
            };
            let walk = self.density(sensor, Term::K, rate_hz);
            let place = format!("{}, noise of the {sensor}", self.place);
            if rate_hz.is_none() {
                let problem = "the file does not say the rate of its messages";
                let error = Error::new(place, problem, "give the messages a second");
                return Err(error.about(Argument::SampleRate));
            }
            if !white.iter().all(|n| n.is_finite() && *n > 0.0) {
                let remedy = "give a file with the noise of a unit";
                return Err(Error::new(place, "it is not above 0", remedy));
            }
            let calibration = calibration.as_ref();
            let own = calibration.and_then(|of| Some((of, of.table(sensor)?)));
            let gain = match own.filter(|_| self.format.noise_of_readings) {
                Some((of, _)) => driver::raw(of, &self.place, sensor)?.noise_gain(),
                None => [1.0; 3],
            };
            for (i, axis) in AXES.iter().enumerate() {
                channel.push(NoiseChannel {
                    name: format!("{sensor}_{axis}"),
                    unit: sensor.unit().into(),
                    raw_unit: own.map(|(_, table)| table.raw_unit.to_string()),
                    scale_factor: own.map(|(_, table)| table.physical.scale_factor[i]),
                    n: Some(unknown(white[i] / gain[i], sensor.unit())),
                    k: walk.map(|walk| unknown(walk[i] / gain[i], sensor.unit())),
                    k_reason: Some(format!("{} has no random walk", self.place)),
                    ..NoiseChannel::default()
                });
            }
        }
        Ok((!channel.is_empty()).then(|| NoiseFile {
            format: NOISE_FORMAT.into(),
            device: UNNAMED.into(),
            sample_rate_hz: rate_hz.unwrap_or(f64::NAN),
            duration_s: f64::NAN,
            confidence: f64::NAN,
            channel,
            place: self.place.clone(),
            ..NoiseFile::default()
        }))
    }
}
