//! Cubics of a unit that was recorded at rest only. A program that uses them has to know the scale factors itself.

use nalgebra::Vector3;

use super::{
    BiasCubics, Conversion, KnownConversion, Remainder, hysteresis, temperatures, wide_enough,
};
use crate::calibration::thermal_biases::ThermalBiases;
use crate::quantity::Sensor;
use mimu_recording::{Argument, Error, RawUnit, Result};

impl BiasCubics {
    /// The cubics of `sensor` over `range_c`, about `reference_c`; `None` if `biases` has no readings of it.
    ///
    /// The cubic of an accelerometer is 0 at `reference_c`: its readings at rest contain gravity in an unknown pose, so only their change is that of
    /// the bias. The cubic of a gyro is the whole bias, with the Earth's rate.
    ///
    /// # Errors
    /// A range of less than 10 K; readings that are not SI, with no factor to convert them.
    pub fn of_rest(
        biases: &ThermalBiases,
        sensor: Sensor,
        known: &KnownConversion,
        range_c: [f64; 2],
        reference_c: f64,
    ) -> Result<Option<Self>> {
        if !biases.has(sensor) {
            return Ok(None);
        }
        wide_enough(sensor, range_c)?;
        let si = match (known.si_per_raw, biases.recording.raw_unit) {
            (Some(factor), _) => factor,
            (None, RawUnit::Si) => 1.0,
            (None, raw_unit) => {
                let problem = format!(
                    "the readings are in {raw_unit}, and a recording at rest does not show how many {} that is",
                    sensor.unit()
                );
                let remedy = "give the factor by which the autopilot's driver converts";
                let argument = sensor.pick(Argument::GyroConversion, Argument::AccelConversion);
                return Err(Error::new(sensor, problem, remedy).about(argument));
            }
        };
        let conversion = Conversion {
            si_per_raw: [si; 3],
            zero_raw: [known.zero_raw.unwrap_or(0.0); 3],
        };
        let curves = biases.curves()?;
        let bias = |temp_c: f64| {
            let off = curves.reading(sensor, temp_c) - Vector3::from(conversion.zero_raw);
            off * si
        };
        let mut values: Vec<_> = temperatures(range_c).map(bias).collect();
        let mut cubics = Self::nearest(sensor, range_c, reference_c, conversion, &values);
        let level = sensor.pick(
            Vector3::zeros(),
            Vector3::from(cubics.coefficients.map(|c| c[0])),
        );
        values.iter_mut().for_each(|v| *v -= level);
        for (of_axis, level) in cubics.coefficients.iter_mut().zip(&level) {
            of_axis[0] -= level;
        }
        cubics.remains.push(cubics.misses(&values));
        let lag_s = biases.dies[sensor].lag_s;
        let late = cubics.late(&values, lag_s, |t| Ok(bias(t) - level))?;
        cubics.remains.push(late);
        let of_gravity = sensor.pick(
            "the unit only lay still",
            "and what they do to gravity at rest counts as bias",
        );
        let never = "the unit only lay still";
        let gains = [
            ("scale factors and cross terms", never),
            ("scale factors and cross terms over temperature", of_gravity),
        ];
        let gains = gains.map(|(source, why)| Remainder::unknown(source, why));
        cubics.remains.extend(gains);
        let own = biases.dies[sensor].hysteresis.as_ref();
        let own = own.zip(Some(Vector3::repeat(1.0)));
        cubics.remains.push(hysteresis(own, &conversion));
        Ok(Some(cubics))
    }
}
