//! Counts samples whose batch carries a flag.

use mimu::quantity::AXES;
use mimu_core::wire::flags;
use serde::Serialize;

/// Samples in batches with each of the [`flags`] that report a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Flagged {
    /// A reading was at a rail of a sensor's output.
    pub saturated: u64,
    /// The gyros' reference voltage was missing.
    pub without_reference: u64,
    /// The TEMP pin of gyro x, y, z was excluded from the temperature.
    pub temperature_left_out: [u64; 3],
    /// No TEMP pin was usable: the temperature is the last good one.
    pub without_temperature: u64,
    /// The device did not know its time since power-on.
    pub power_on_unknown: u64,
    /// A self-test deflected the sensors.
    pub self_test: u64,
    /// The dies' temperature was outside the calibrated range.
    pub outside_range: u64,
    /// A stored calibration, perhaps younger than the one in use, was not usable.
    pub younger_unusable: u64,
    /// The converter's stored factors were lost.
    pub own_factors: u64,
}

impl Flagged {
    /// Adds the samples of a batch with these flags.
    pub fn count(&mut self, of: u16, samples: u64) {
        let [x, y, z] = &mut self.temperature_left_out;
        let [left_out_x, left_out_y, left_out_z] = flags::TEMPERATURE_LEFT_OUT;
        for (flag, counter) in [
            (flags::SATURATED, &mut self.saturated),
            (flags::NO_REFERENCE, &mut self.without_reference),
            (left_out_x, x),
            (left_out_y, y),
            (left_out_z, z),
            (flags::NO_TEMPERATURE, &mut self.without_temperature),
            (flags::POWER_ON_UNKNOWN, &mut self.power_on_unknown),
            (flags::SELF_TEST, &mut self.self_test),
            (flags::OUTSIDE_NODES, &mut self.outside_range),
            (flags::YOUNGER_UNUSABLE, &mut self.younger_unusable),
            (flags::OWN_FACTORS, &mut self.own_factors),
        ] {
            if of & flag != 0 {
                *counter += samples;
            }
        }
    }

    /// A sentence for each flag that occurred.
    pub fn warnings(&self) -> Vec<String> {
        let mut all = Vec::new();
        let mut warn = |count: u64, what: &str| {
            if count > 0 {
                all.push(format!("{count} samples {what}"));
            }
        };
        warn(
            self.saturated,
            "in batches with a reading at the end of a sensor's range",
        );
        warn(
            self.without_reference,
            "without the gyros' reference, so they drift with the supply; check its pin",
        );
        for (axis, count) in AXES.iter().zip(self.temperature_left_out) {
            let what = format!(
                "whose temperature ignores gyro {axis}: its TEMP pin is out of range, disagrees with the others, has jumped or is stuck; check its wiring"
            );
            warn(count, &what);
        }
        warn(
            self.without_temperature,
            "at the last good temperature, because no TEMP pin is usable; check their wiring",
        );
        warn(
            self.power_on_unknown,
            "without a known power-on, so a warm-up counts as over",
        );
        warn(self.self_test, "while the self-test deflected the sensors");
        warn(
            self.outside_range,
            "outside the temperatures of the stored calibration: its curves continue in a straight line for 5 K and are constant beyond",
        );
        warn(
            self.younger_unusable,
            "while the device could not use a stored calibration, perhaps a younger one; `mimu device info` shows its slots: upload the calibration again",
        );
        warn(
            self.own_factors,
            "with factors of the converter that it found itself, because those stored with the calibration are lost: upload the calibration again",
        );
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_flag_counts_its_own_samples_and_is_told() {
        let mut flagged = Flagged::default();
        flagged.count(0, 20);
        assert_eq!((flagged, flagged.warnings().len()), (Flagged::default(), 0));
        flagged.count(flags::TEMPERATURE_LEFT_OUT[1] | flags::SATURATED, 20);
        flagged.count(flags::TEMPERATURE_LEFT_OUT[1], 7);
        assert_eq!(
            (flagged.saturated, flagged.temperature_left_out),
            (20, [0, 27, 0])
        );
        let told = flagged.warnings();
        assert_eq!(told.len(), 2);
        assert!(told[1].starts_with("27 samples whose temperature ignores gyro y"));
        for flag in [
            flags::NO_REFERENCE,
            flags::NO_TEMPERATURE,
            flags::POWER_ON_UNKNOWN,
            flags::SELF_TEST,
            flags::OUTSIDE_NODES,
            flags::YOUNGER_UNUSABLE,
            flags::OWN_FACTORS,
        ] {
            let mut one = Flagged::default();
            one.count(flag, 1);
            assert_eq!(one.warnings().len(), 1, "{flag}");
        }
    }
}
