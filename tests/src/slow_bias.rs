//! Units by hand whose biases move slowly: linearly or exponentially in time, or with temperature, at once or with a lag.
//!
//! These effects can be mistaken for each other. Every size is many times the noise of a dwell, so the named effect depends on the diagnosis and not
//! on chance.

use mimu_rig::random::Random;
use mimu_rig::rig_file::{EffectFile, RigFile};
use mimu_rig::unit::TemperatureSensor;

use crate::by_hand::{Grade, plan, unit};

/// What moves the bias, and what else happens in the recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// Linear in time, of a unit that has been on for an hour.
    LinearDrift,
    /// Linear in time while the unit warms up after power-on.
    LinearDriftFromPowerOn,
    /// Exponential since power-on, with a time constant of an eighth to a third of the recording.
    ExponentialDrift,
    /// Linear in time, of the accelerometer.
    AccelLinearDrift,
    /// Exponential, of the accelerometer.
    AccelExponentialDrift,
    /// Linear in the reported temperature, in a chamber that warms and cools.
    LinearOverTemperature,
    /// With a curvature of 1 % a kelvin.
    CurvedOverTemperature,
    /// Linear in the temperature, plus a part that follows the temperature with a lag.
    LagBesideBias,
}

impl Kind {
    /// All.
    pub const ALL: [Self; 8] = [
        Self::LinearDrift,
        Self::LinearDriftFromPowerOn,
        Self::ExponentialDrift,
        Self::AccelLinearDrift,
        Self::AccelExponentialDrift,
        Self::LinearOverTemperature,
        Self::CurvedOverTemperature,
        Self::LagBesideBias,
    ];

    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Self::LinearDrift => "even drift",
            Self::LinearDriftFromPowerOn => "even drift from power-on",
            Self::ExponentialDrift => "drift that bends",
            Self::AccelLinearDrift => "accelerometer, even drift",
            Self::AccelExponentialDrift => "accelerometer, drift that bends",
            Self::LinearOverTemperature => "bias over temperature, straight",
            Self::CurvedOverTemperature => "bias over temperature, bent",
            Self::LagBesideBias => "lag beside a bias over temperature",
        }
    }

    /// Its effects.
    pub fn effects(self) -> &'static [&'static str] {
        match self {
            Self::LinearDrift | Self::LinearDriftFromPowerOn => &["gyro_bias_drift"],
            Self::ExponentialDrift => &["gyro_warm_up"],
            Self::AccelLinearDrift => &["accel_bias_drift"],
            Self::AccelExponentialDrift => &["accel_warm_up"],
            Self::LinearOverTemperature | Self::CurvedOverTemperature => &["gyro_thermal_bias"],
            Self::LagBesideBias => &["gyro_thermal_bias", "gyro_thermal_lag"],
        }
    }

    fn in_chamber(self) -> bool {
        matches!(
            self,
            Self::LinearOverTemperature | Self::CurvedOverTemperature | Self::LagBesideBias
        )
    }

    fn is_warm(self) -> bool {
        self.in_chamber() || matches!(self, Self::LinearDrift | Self::AccelLinearDrift)
    }

    /// 3 to 5 minutes on a warm desk, or 9 minutes in which the unit warms by some 15 K and cools again.
    pub fn plan(self, seed: u64) -> String {
        if !self.in_chamber() {
            return plan(seed);
        }
        "format = \"mimu-plan/1\"\nsample_rate_hz = 100.0\ncarrier = \"hands\"\nlatitude_deg = 48.0\nlead_in_s = 5.0\n\
         chamber_c = [[0.0, 20.0], [60.0, 20.0], [240.0, 40.0], [300.0, 40.0], [480.0, 20.0]]\n\
         [[step]]\nposes = 90\ndwell_s = 2.5\n"
            .into()
    }

    /// A unit of `grade` with its effects.
    pub fn unit(self, grade: Grade, seed: u64) -> RigFile {
        let mut file = unit(&[], grade, seed);
        if self.is_warm() {
            file.thermal.on_before_s = Some(3600.0);
        }
        if self.in_chamber() {
            // Thermometer and dies have the same temperature, so the only lag is the effect's.
            file.thermal.board_lag_s = Some(40.0);
            file.thermal.die_lag_s = Some([5.0; 4]);
            file.thermal.die_heating_c = Some([1.0; 4]);
            file.unit.temperature = Some(TemperatureSensor::Dies);
        }
        let effects = self.effects().iter().enumerate();
        file.effect = effects
            .map(|(k, id)| EffectFile {
                id: (*id).into(),
                parameters: self.parameters(k, grade, seed),
            })
            .collect();
        file
    }

    /// Parameters of its effect number `k`. A dwell of 2.5 s has a noise of 0.04, 0.003 and 0.002 deg/s and of 0.2, 0.2 and 0.07 mg by grade.
    fn parameters(self, k: usize, grade: Grade, seed: u64) -> toml::Table {
        let mut random = Random::new(seed, &format!("{} {k}", self.name()));
        let [dwell_dps, dwell_mg] = match grade {
            Grade::Analog => [0.04, 0.2],
            Grade::Consumer => [0.003, 0.2],
            Grade::Tactical => [0.002, 0.07],
        };
        // Over the whole recording, 8 to 40 times the noise of a dwell.
        let times = 8.0 * 5f64.powf(random.uniform());
        let mut axes = |size: f64| {
            let one = |_| {
                let side = if random.uniform() < 0.5 { -1.0 } else { 1.0 };
                toml::Value::Float(side * size * (0.5 + random.uniform()))
            };
            toml::Value::Array((0..3).map(one).collect())
        };
        // About the length of the shortest of these recordings.
        let session_s = 180.0;
        let mut table = toml::Table::new();
        let mut add = |key: &str, value| table.insert(key.into(), value);
        match self.effects()[k] {
            "gyro_bias_drift" => {
                let per_hour = times * dwell_dps * 3600.0 / session_s;
                add("dps_per_hour", axes(per_hour));
            }
            "accel_bias_drift" => {
                add("mg_per_hour", axes(times * dwell_mg * 3600.0 / session_s));
            }
            "gyro_warm_up" => {
                add("dps", axes(times * dwell_dps));
            }
            "accel_warm_up" => {
                add("mg", axes(times * dwell_mg));
            }
            // 15 K.
            _ => {
                add("dps_per_c", axes(times * dwell_dps / 15.0));
            }
        }
        let mut form = Random::new(seed, "form");
        let tau_s = session_s / 8.0 * (8.0 / 3.0f64).powf(form.uniform());
        let lag_s = 20.0 * 3f64.powf(form.uniform());
        match self {
            Self::ExponentialDrift | Self::AccelExponentialDrift => {
                add("time_constant_s", toml::Value::Float(tau_s));
            }
            Self::LagBesideBias if k == 1 => {
                add("lag_s", toml::Value::Float(lag_s));
            }
            Self::LinearOverTemperature | Self::LagBesideBias => {
                add("curvature_per_c", toml::Value::Float(1e-6));
            }
            Self::CurvedOverTemperature => {
                add("curvature_per_c", toml::Value::Float(0.01));
            }
            _ => {}
        }
        table
    }
}
