//! What an export is made from.

use mimu::calibration::thermal_biases::ThermalBiases;
use mimu::noise::noise_file::{NoiseChannel, NoiseFile};
use mimu::{Calibration, Sensor, significant};
use mimu_recording::{Argument, Error, RAW_COLUMNS, RawUnit, Result};

/// Largest share by which a scale factor may differ from 1 without a consequence: that of N is rarely known better.
const SAME_SCALE: f64 = 0.03;
/// Largest share by which two scale factors of one unit differ: temperature and age change it by less.
const OTHER_SCALE: f64 = 0.1;

/// Sources of an export.
#[derive(Debug, Clone, Copy, Default)]
pub struct Sources<'a> {
    /// The calibration, and its file.
    pub calibration: Option<(&'a Calibration, &'a str)>,
    /// Instead of a calibration: biases over temperature of a unit that stayed at rest, for formats that take them.
    pub biases: Option<&'a ThermalBiases>,
    /// Noise of the unit.
    pub noise: Option<&'a NoiseFile>,
}

impl<'a> Sources<'a> {
    /// The calibration and its file.
    ///
    /// # Errors
    /// There is no calibration.
    pub fn calibration(&self) -> Result<(&'a Calibration, &'a str)> {
        self.calibration.ok_or_else(|| {
            Error::new(
                "export",
                "this format needs a calibration",
                "name a file of `mimu fit -o`",
            )
            .about(Argument::Calibration)
        })
    }

    /// Refuses noise of other readings than those that the calibration is for: one of the two then belongs to another unit, or to the unit with another
    /// range. Noise of calibrated readings in SI fits every calibration.
    pub(crate) fn check_same_readings(&self) -> Result<()> {
        let (Some((calibration, file)), Some(noise)) = (self.calibration, self.noise) else {
            return Ok(());
        };
        for channel in &noise.channel {
            let at = RAW_COLUMNS.iter().position(|name| *name == channel.name);
            let scaled = channel.raw_unit.as_ref().zip(channel.scale_factor);
            let Some(at) = at else { continue };
            let Some(table) = calibration.table(Sensor::BOTH[at / 3]) else {
                continue;
            };
            let ours = table.physical.scale_factor[at % 3];
            let Some((unit, scale)) = scaled else {
                self.check_alike(channel, ours, table.raw_unit)?;
                continue;
            };
            let raw = table.raw_unit.to_string();
            if *unit == raw && ((scale / ours).abs() - 1.0).abs() < OTHER_SCALE {
                continue;
            }
            return Err(Error::new(
                format!("{}, channel {}", noise.place, channel.name),
                format!(
                    "it was computed with a scale factor of {} {unit} per {}, and that of {file} is {} {raw}",
                    significant(scale),
                    channel.unit,
                    significant(ours)
                ),
                "give noise and calibration of the same unit",
            )
            .about(Argument::Noise));
        }
        Ok(())
    }

    /// Refuses noise of which nobody says whether it is that of readings in SI before the calibration or after it, if the two differ: the densities of a
    /// gyro whose driver reports half of the rate came out too small by half.
    fn check_alike(&self, channel: &NoiseChannel, scale: f64, raw: RawUnit) -> Result<()> {
        if raw != RawUnit::Si || (scale.abs() - 1.0).abs() < SAME_SCALE {
            return Ok(());
        }
        let place = self.noise.map_or("", |noise| noise.place.as_str());
        let problem = format!(
            "the calibration changes these readings by a factor of {}, and the file does not say whether its noise is that before or after",
            significant(1.0 / scale)
        );
        let remedy = "make it of the same readings with the calibration: mimu allan REC --calibration FILE -o noise.toml";
        let place = format!("{place}, channel {}", channel.name);
        Err(Error::new(place, problem, remedy).about(Argument::Noise))
    }

    /// A note if calibration and noise have the names of different units.
    pub(crate) fn other_device(&self) -> Option<String> {
        let ((calibration, _), noise) = self.calibration.zip(self.noise)?;
        (calibration.device != noise.device).then(|| {
            format!(
                "The calibration belongs to {:?} and the noise to {:?}: use the file only if these are one unit.",
                calibration.device, noise.device
            )
        })
    }

    /// The noise of the unit.
    ///
    /// # Errors
    /// The noise is missing.
    pub fn noise(&self) -> Result<&'a NoiseFile> {
        self.noise.ok_or_else(|| {
            Error::new(
                "export",
                "this format needs the noise of the unit",
                "record the unit at rest, and add its file: mimu allan REST --calibration cal.toml -o noise.toml, then --noise noise.toml",
            )
            .about(Argument::Noise)
        })
    }
}
