//! The inertial unit: three gyros and an accelerometer on a board, from motion to the voltages at their pins.
//!
//! It does not depend on the converter, which may be that of a recording or of an emulated microcontroller.

use serde::{Deserialize, Serialize};

use crate::curves::{Curves, CurvesTruth};
use crate::effects::{Active, Condition, Disturbance, EffectTruth, Sensors};
use crate::filter::LowPass;
use crate::motion::Motion;
use crate::pins::Pins;
use crate::random::Random;
use crate::sensor::{Axis, TriadTruth};
use crate::thermal::{Temperatures, Thermal, ThermalTruth};

/// A voltage relative to which others are measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VoltageTruth {
    /// Nominal value, V.
    pub nominal_v: f64,
    /// Constant relative error.
    pub error: f64,
    /// Relative drift from 25 °C with the board's temperature, 1/K.
    pub per_c: f64,
    /// White noise of each step, relative standard deviation.
    pub noise: f64,
}

/// Where the unit measures the temperature that it reports.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TemperatureSensor {
    /// Mean of the gyros' own TEMP pins.
    Dies,
    /// A separate part on the board.
    Board,
    /// TEMP pin of the x gyro.
    GyroX,
    /// TEMP pin of the y gyro.
    GyroY,
    /// TEMP pin of the z gyro.
    GyroZ,
    /// A thermometer in the accelerometer.
    Accel,
}

impl TemperatureSensor {
    /// Temperature at its place, °C.
    fn temperature(self, at: Temperatures) -> f64 {
        self.mean(at.board, at.die)
    }

    /// Selects or averages a quantity of the board and the dies according to its place.
    fn mean(self, board: f64, die: [f64; 4]) -> f64 {
        match self {
            Self::Dies => (die[0] + die[1] + die[2]) / 3.0,
            Self::Board => board,
            Self::GyroX => die[0],
            Self::GyroY => die[1],
            Self::GyroZ => die[2],
            Self::Accel => die[3],
        }
    }
}

/// The sensor of the reported temperature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TemperatureTruth {
    /// Its place.
    pub at: TemperatureSensor,
    /// Lag of the sensor behind its place, s, because of its package; 0: no lag.
    pub lag_s: f64,
    /// Constant error, K.
    pub offset_c: f64,
    /// White noise of each step, standard deviation, K.
    pub noise_c: f64,
}

/// The complete truth of a unit.
#[derive(Debug, Clone, PartialEq)]
pub struct UnitTruth {
    /// Gyros; inputs in rad/s.
    pub gyro: TriadTruth,
    /// Accelerometer; inputs in m/s².
    pub accel: TriadTruth,
    /// Temperatures of board and dies.
    pub thermal: ThermalTruth,
    /// Reported temperature.
    pub temperature: TemperatureTruth,
    /// Supply of the accelerometer.
    pub supply: VoltageTruth,
    /// Reference of the converter.
    pub converter_reference: VoltageTruth,
    /// Nominal voltage of the gyros' reference pins, V.
    pub gyro_reference_nominal_v: f64,
    /// True voltages of these pins, V.
    pub gyro_reference_v: [f64; 3],
    /// Effects that the affine model lacks.
    pub effects: Vec<EffectTruth>,
    /// The sensors over temperature.
    pub curves: CurvesTruth,
}

impl UnitTruth {
    /// Lag of each die (gyros x, y, z, then the accelerometer) behind the reported temperature on a long ramp, s. Negative: the die leads.
    ///
    /// On such a ramp the lags of a chain of first-order lags add up.
    pub fn die_lag_behind_reported_s(&self) -> [f64; 4] {
        let die = self.thermal.die_lag_s;
        let reported = self.temperature.at.mean(0.0, die) + self.temperature.lag_s;
        die.map(|lag| lag - reported)
    }
}

/// State of a voltage.
#[derive(Debug, Clone)]
struct Voltage {
    truth: VoltageTruth,
    stream: Random,
}

impl Voltage {
    fn new(truth: VoltageTruth, name: &str, seed: u64) -> Self {
        let stream = Random::new(seed, name);
        Self { truth, stream }
    }

    /// Relative to nominal, at the board's temperature.
    fn step(&mut self, board_c: f64) -> f64 {
        let t = &self.truth;
        let noise = if t.noise > 0.0 {
            t.noise * self.stream.normal()
        } else {
            0.0
        };
        1.0 + t.error + t.per_c * (board_c - 25.0) + noise
    }
}

/// A powered unit.
pub struct Unit {
    gyro: [Axis; 3],
    accel: [Axis; 3],
    thermal: Thermal,
    board_c: f64,
    supply: Voltage,
    converter_reference: Voltage,
    temperature: TemperatureTruth,
    temperature_lag: Option<LowPass>,
    temperature_started: bool,
    temperature_stream: Random,
    gyro_reference_v: [f64; 3],
    on_before_s: f64,
    effects: Vec<Active>,
    curves: Curves,
}

impl Unit {
    /// The unit at steps of `dt_s`. A seed determines the voltages bit by bit; random numbers of an effect leave the noise unchanged.
    pub fn new(truth: &UnitTruth, seed: u64, dt_s: f64) -> Self {
        let triad = |of: &TriadTruth, sensor: &str| {
            std::array::from_fn(|i| {
                let name = format!("{sensor} {}", ["x", "y", "z"][i]);
                Axis::new(&of.axes[i], of.ratiometric, &name, dt_s, seed)
            })
        };
        let sensors = Sensors {
            gyro: &truth.gyro,
            accel: &truth.accel,
            converter_reference_nominal_v: truth.converter_reference.nominal_v,
        };
        Self {
            gyro: triad(&truth.gyro, "gyro"),
            accel: triad(&truth.accel, "accel"),
            thermal: Thermal::new(&truth.thermal, dt_s),
            board_c: f64::NAN,
            supply: Voltage::new(truth.supply, "supply", seed),
            converter_reference: Voltage::new(
                truth.converter_reference,
                "converter reference",
                seed,
            ),
            temperature: truth.temperature,
            temperature_lag: (truth.temperature.lag_s > 0.0)
                .then(|| LowPass::new(truth.temperature.lag_s, dt_s, 0.0)),
            temperature_started: false,
            temperature_stream: Random::new(seed, "temperature reading"),
            gyro_reference_v: truth.gyro_reference_v,
            on_before_s: truth.thermal.on_before_s,
            effects: truth
                .effects
                .iter()
                .map(|e| e.activate(sensors, seed, dt_s))
                .collect(),
            curves: Curves::new(&truth.curves),
        }
    }

    /// Voltages after the next step, for the motion and the chamber's air at that time. The first call returns those at the start.
    pub fn step(&mut self, motion: &Motion, chamber_c: f64) -> Pins {
        let temperatures = self.thermal.step(chamber_c);
        self.board_c = temperatures.board;
        let at = Condition {
            motion,
            gyro: self.gyro.each_ref().map(|a| a.sensed(motion.rate)),
            accel: self.accel.each_ref().map(|a| a.sensed(motion.force)),
            temperatures,
            on_s: motion.t_s + self.on_before_s,
        };
        let mut add = Disturbance::default();
        for effect in &mut self.effects {
            effect.disturb(&at, &mut add);
        }
        self.curves
            .add(motion, temperatures, &mut add.gyro, &mut add.accel);
        let [gyro_noise, accel_noise] = self.curves.noise(temperatures);
        for (axes, noise) in [(&mut self.gyro, gyro_noise), (&mut self.accel, accel_noise)] {
            for (axis, sigma) in axes.iter_mut().zip(noise.into_iter().flatten()) {
                axis.set_reading_noise(sigma);
            }
        }
        let supply = self.supply.step(temperatures.board);
        let reference = self.converter_reference.step(temperatures.board);
        let die = temperatures.die;
        let mut sensor_c = self.temperature.at.temperature(temperatures);
        if let Some(lag) = &mut self.temperature_lag {
            if !self.temperature_started {
                lag.settle(sensor_c);
            }
            sensor_c = lag.step(sensor_c);
        }
        self.temperature_started = true;
        let mut noise_c = 0.0;
        if self.temperature.noise_c > 0.0 {
            noise_c = self.temperature.noise_c * self.temperature_stream.normal();
        }
        let mut pins = Pins {
            gyro_v: std::array::from_fn(|i| self.gyro[i].step(at.gyro[i] + add.gyro[i], supply)),
            gyro_reference_v: self.gyro_reference_v,
            gyro_temp_v: std::array::from_fn(|i| temp_pin_v(die[i])),
            accel_v: std::array::from_fn(|i| {
                self.accel[i].step(at.accel[i] + add.accel[i], supply)
            }),
            supply_v: self.supply.truth.nominal_v * supply,
            converter_reference_v: self.converter_reference.truth.nominal_v * reference,
            temp_c: sensor_c + self.temperature.offset_c + noise_c,
        };
        for effect in &mut self.effects {
            effect.read_out(&at, &mut pins);
        }
        pins
    }

    /// Temperature of the board after the last step, °C.
    pub(crate) fn board_c(&self) -> f64 {
        self.board_c
    }
}

/// TEMP pin of an ADXRS300: 2.50 V at 298 K, 8.4 mV/K.
fn temp_pin_v(die_c: f64) -> f64 {
    2.5 + 8.4e-3 * (die_c + 273.15 - 298.0)
}
