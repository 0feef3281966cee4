//! Voltages at the pins of a unit, as input of a converter.

/// Voltages at the pins at one time. For a digital part: its counts before rounding.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pins {
    /// RATEOUT of the gyros x, y, z, V.
    pub gyro_v: [f64; 3],
    /// 2.5 V reference pins of the gyros, V.
    pub gyro_reference_v: [f64; 3],
    /// TEMP pins of the gyros, V.
    pub gyro_temp_v: [f64; 3],
    /// Outputs of the accelerometer x, y, z, V.
    pub accel_v: [f64; 3],
    /// Supply of the accelerometer, V.
    pub supply_v: f64,
    /// Reference of the converter, V.
    pub converter_reference_v: f64,
    /// Reading of the unit's thermometer, °C.
    pub temp_c: f64,
}
