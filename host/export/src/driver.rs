//! Readings in SI, as converted by a driver.
//!
//! Many programs receive readings that a driver has converted axis by axis: `y_i = si_per_raw_i (u_i - zero_i)`. Their calibrations apply to y, while
//! a calibration file applies to the raw readings u.

use clap::Args;
use mimu::calibration::bias_cubic::{Conversion, KnownConversion};
use mimu::{Calibration, Forward, PerSensor, Sensor};
use mimu_core::compensation::Affine;
use mimu_recording::{Argument, Error, RawUnit, Result, TriadName};
use nalgebra::{Matrix3, Vector3};

use crate::Sources;

/// The user's knowledge of the driver.
#[derive(Debug, Clone, Default, Args)]
pub struct Options {
    /// rad/s per raw unit by which the driver converts; without it as the calibration does, and 1 for readings in SI
    #[arg(long, value_name = "SI", value_parser = positive)]
    pub gyro_si_per_raw: Option<f64>,
    /// m/s² per raw unit by which the driver converts; likewise
    #[arg(long, value_name = "SI", value_parser = positive)]
    pub accel_si_per_raw: Option<f64>,
    /// Raw reading that the driver takes for no rate; without it 0
    #[arg(long, value_name = "RAW", allow_negative_numbers = true, value_parser = finite)]
    pub gyro_zero: Option<f64>,
    /// Raw reading that the driver takes for no force; without it 0
    #[arg(long, value_name = "RAW", allow_negative_numbers = true, value_parser = finite)]
    pub accel_zero: Option<f64>,
}

/// Relation between the input and a driver's readings of a triad, in both directions.
#[derive(Debug, Clone, PartialEq)]
pub struct Readings {
    /// The triad.
    pub triad: TriadName,
    /// Unit of the input and of the driver's readings.
    pub unit: String,
    /// From raw readings to the driver's.
    pub conversion: Conversion,
    /// From the input to the driver's readings, unit to unit.
    pub forward: Forward,
    /// From the driver's readings to the input, unit to unit.
    pub inverse: Affine<f64>,
}

impl Options {
    /// Conversions of the drivers, as far as the user knows them.
    pub(crate) fn conversions(&self) -> PerSensor<KnownConversion> {
        let of = |si_per_raw, zero_raw| KnownConversion {
            si_per_raw,
            zero_raw,
        };
        PerSensor {
            gyro: of(self.gyro_si_per_raw, self.gyro_zero),
            accel: of(self.accel_si_per_raw, self.accel_zero),
        }
    }

    /// Refuses options that would be ignored. Without a calibration, a driver's factor has nothing to be compared with.
    ///
    /// # Errors
    ///
    /// An option is given.
    pub fn unused(&self) -> Result<()> {
        #[rustfmt::skip]
        let given = [
            (Argument::GyroConversion, "conversion of the gyro", self.gyro_si_per_raw),
            (Argument::AccelConversion, "conversion of the accelerometer", self.accel_si_per_raw),
            (Argument::GyroZero, "zero of the gyro", self.gyro_zero),
            (Argument::AccelZero, "zero of the accelerometer", self.accel_zero),
        ];
        let Some((argument, name, _)) = given.iter().find(|(.., value)| value.is_some()) else {
            return Ok(());
        };
        let remedy = "give a calibration too, or leave the option out";
        let error = Error::new(*name, "this option needs a calibration", remedy);
        Err(error.about(*argument).about(Argument::Calibration))
    }

    /// Refuses readings that are not in SI without the factor of the driver: the calibration's own would leave no error of the scale factors to export.
    ///
    /// # Errors
    /// The factor of `sensor` is not given.
    pub(crate) fn needs_factor(&self, calibration: &Calibration, sensor: Sensor) -> Result<()> {
        let raw = calibration.recording.raw_unit;
        if raw == RawUnit::Si || self.conversions()[sensor].si_per_raw.is_some() {
            return Ok(());
        }
        let argument = sensor.pick(Argument::GyroConversion, Argument::AccelConversion);
        Err(Error::new(
            sensor,
            format!("its scale factors are errors of the driver's factor, which is not given: the readings are in {raw}"),
            format!("give the factor by which the program converts, {} per {raw}", sensor.unit()),
        )
        .about(argument))
    }

    /// The driver's readings of both triads of the calibration.
    ///
    /// # Errors
    /// The calibration is missing, or those of [`Self::readings`].
    pub fn both<'a>(&self, from: &Sources<'a>) -> Result<(&'a Calibration, PerSensor<Readings>)> {
        let (calibration, place) = from.calibration()?;
        let [gyro, accel] = Sensor::BOTH.map(|s| self.readings(calibration, place, s));
        Ok((calibration, PerSensor::from([gyro?, accel?])))
    }

    /// The driver's readings of `sensor`. If no factor is given, it is 1 for readings in SI, and otherwise one over the scale factor of the axis: the
    /// best conversion by three factors.
    ///
    /// # Errors
    /// `sensor` is not calibrated; C is singular.
    pub fn readings(
        &self,
        calibration: &Calibration,
        place: &str,
        sensor: Sensor,
    ) -> Result<Readings> {
        let model = calibration.inverse(sensor).ok_or_else(|| {
            let problem = format!("the {sensor} is not calibrated");
            Error::new(place, problem, "fit a recording that determines it")
        })?;
        let (triad, unit) = (name_of(sensor), sensor.unit());
        let raw_unit = calibration.recording.raw_unit;
        let known = &self.conversions()[sensor];
        Readings::of((triad, unit), &model, known, raw_unit, place)
    }
}

/// The first triad of a kind.
pub(crate) fn name_of(sensor: Sensor) -> TriadName {
    sensor.pick(TriadName::GYRO, TriadName::ACCEL)
}

/// Raw readings of `sensor`, for programs that take them.
///
/// # Errors
/// Those of [`Options::readings`].
pub fn raw(calibration: &Calibration, place: &str, sensor: Sensor) -> Result<Readings> {
    let one = Options {
        gyro_si_per_raw: Some(1.0),
        accel_si_per_raw: Some(1.0),
        ..Options::default()
    };
    one.readings(calibration, place, sensor)
}

/// A number greater than 0, as an option.
pub(crate) fn positive(text: &str) -> std::result::Result<f64, String> {
    match finite(text)? {
        value if value > 0.0 => Ok(value),
        _ => Err("it has to be greater than 0".into()),
    }
}

/// A finite number, as an option.
fn finite(text: &str) -> std::result::Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "it is not a number".to_string())?;
    match value.is_finite() {
        true => Ok(value),
        false => Err("it is not a finite number".into()),
    }
}

impl Readings {
    /// The driver's readings of a triad, `model` raw to its unit; a factor that is not known as for [`Options::readings`].
    ///
    /// # Errors
    /// C is singular.
    pub(crate) fn of(
        (triad, unit): (TriadName, &str),
        model: &Affine<f64>,
        known: &KnownConversion,
        raw_unit: RawUnit,
        place: &str,
    ) -> Result<Self> {
        let raw = Forward::of(model).ok_or_else(|| {
            let problem = format!("C of the {triad} is singular");
            Error::new(place, problem, "fit the recording again")
        })?;
        let factors = Vector3::from_fn(|i, _| match known.si_per_raw {
            Some(factor) => factor,
            None if raw_unit == RawUnit::Si => 1.0,
            None => 1.0 / raw.matrix.row(i).norm(),
        });
        let zero = Vector3::repeat(known.zero_raw.unwrap_or(0.0));
        let back = Matrix3::from_diagonal(&factors.map(f64::recip));
        Ok(Self {
            triad,
            unit: unit.into(),
            conversion: Conversion {
                si_per_raw: factors.into(),
                zero_raw: zero.into(),
            },
            forward: Forward {
                matrix: Matrix3::from_diagonal(&factors) * raw.matrix,
                bias: factors.component_mul(&(raw.bias - zero)),
            },
            inverse: Affine {
                matrix: model.matrix * back,
                offset: model.matrix * zero + model.offset,
            },
        })
    }

    /// Describes the driver's conversion for the head of a file.
    pub fn line(&self) -> String {
        let [factors, zeros] = [self.conversion.si_per_raw, self.conversion.zero_raw];
        let list = |values: [f64; 3]| values.map(|v| format!("{v:.6e}")).join(", ");
        let (triad, unit) = (self.triad, &self.unit);
        if (factors, zeros) == ([1.0; 3], [0.0; 3]) {
            return format!("{triad}: the program's readings are the recorded ones.");
        }
        let raw = match zeros {
            [0.0, 0.0, 0.0] => "raw".into(),
            zeros => format!("(raw - [{}])", list(zeros)),
        };
        let factors = list(factors);
        format!(
            "{triad}: readings of the program = [{factors}] {raw}, axis by axis, raw to {unit}: the driver has to convert in this way."
        )
    }

    /// Factors from noise at the input to noise in the driver's readings.
    pub fn noise_gain(&self) -> [f64; 3] {
        [0, 1, 2].map(|i| self.forward.matrix.row(i).norm())
    }
}
