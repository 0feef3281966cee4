//! Limits by the units of the same kind: where all but one in a thousand of them are.
//!
//! A data sheet allows what the maker may ship. A unit that keeps it, and lies far from all of its siblings, was soldered, glued or dropped in a way that they were not.

use mimu::prior::{FALSE_STRANGER, Prior, PriorTable};
use mimu::quantity::{AXES, Sensor};
use mimu_recording::{Error, RawUnit, Result};
use nalgebra::Vector3;
use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::own_limit::OwnLimit;
use crate::quantity::Quantity;
use crate::scale::{Scale, si_per_sheet};

/// The population of a kind of units, as `mimu fleet --prior` writes it.
#[derive(Debug, Clone, PartialEq)]
pub struct Population {
    /// Its parameters.
    pub prior: Prior,
    /// Its file.
    pub place: String,
}

impl Population {
    /// Limits of offsets and sensitivities for readings in `raw_unit` that become SI by the nominal `scale`.
    ///
    /// # Errors
    /// The population reads in another unit.
    pub(crate) fn limits(&self, scale: &Scale, raw_unit: RawUnit) -> Result<Vec<OwnLimit>> {
        if self.prior.raw_unit != raw_unit {
            let problem = format!(
                "its units read in {}, and this one reads in {raw_unit}",
                self.prior.raw_unit
            );
            let remedy = "give the population of units that are read in the same way";
            return Err(Error::new(&self.place, problem, remedy));
        }
        let mut all = Vec::new();
        for sensor in Sensor::BOTH {
            if let Some(table) = self.prior.table(sensor) {
                self.of_triad(&mut all, sensor, table, scale);
            }
        }
        Ok(all)
    }

    fn of_triad(&self, all: &mut Vec<OwnLimit>, sensor: Sensor, table: &PriorTable, scale: &Scale) {
        let Some(bounds) = Bounds::of(table) else {
            return;
        };
        let model = &scale.models[sensor as usize];
        let mut add = |of: Quantity, axis: usize, [lower, upper]: [f64; 2]| {
            all.push(OwnLimit {
                name: of.name(Some(axis)),
                lower: Some(lower),
                upper: Some(upper),
                source: format!("{}: {} units", self.place, table.units),
            });
        };
        let [offset, sheet] = sensor.pick(
            [Quantity::GyroOffset, Quantity::GyroOffset],
            [Quantity::AccelOffset, Quantity::AccelSensitivity],
        );
        // mg, as data sheets.
        let unit = si_per_sheet(sensor) / if sensor == Sensor::Accel { 1e3 } else { 1.0 };
        let biases = bounds.three("bias").filter(|_| self.prior.biases);
        let scales = bounds.three("scale").filter(|_| sensor == Sensor::Accel);
        for axis in 0..3 {
            let si_per_raw = model.matrix[(axis, axis)];
            if let Some(biases) = &biases {
                let middle = model.apply(&Vector3::from(biases.map(|[mean, _]| mean)))[axis];
                let half = si_per_raw.abs() * biases[axis][1];
                add(
                    offset,
                    axis,
                    [(middle - half) / unit, (middle + half) / unit],
                );
            }
            if let Some(scales) = &scales {
                let [mean, half] = scales[axis].map(|raw_per_si| 100.0 * raw_per_si * si_per_raw);
                add(sheet, axis, [mean - half - 100.0, mean + half - 100.0]);
            }
        }
    }
}

/// Middle of each parameter, and half of the width in which all but [`FALSE_STRANGER`] of the units are.
struct Bounds<'a> {
    table: &'a PriorTable,
    sigmas: f64,
}

impl<'a> Bounds<'a> {
    /// `None` of too few units.
    fn of(table: &'a PriorTable) -> Option<Self> {
        let dof = table.units as f64 - 1.0;
        let t = StudentsT::new(0.0, 1.0, dof).ok()?;
        Some(Self {
            table,
            sigmas: t.inverse_cdf(1.0 - 0.5 * FALSE_STRANGER),
        })
    }

    /// Of the three axes of a parameter.
    fn three(&self, name: &str) -> Option<[[f64; 2]; 3]> {
        let mut found = AXES.iter().filter_map(|axis| {
            let name = format!("{name}_{axis}");
            let k = self.table.parameters.iter().position(|p| *p == name)?;
            Some([self.table.mean[k], self.sigmas * self.table.sigma[k]])
        });
        Some([found.next()?, found.next()?, found.next()?])
    }
}

#[cfg(test)]
mod tests {
    use mimu::quantity::PerSensor;
    use mimu_core::compensation::Affine;
    use mimu_recording::Reference;
    use mimu_rig::random::Random;
    use nalgebra::{DMatrix, Matrix3};

    use super::*;

    /// Biases and scale factors of a kind: means and standard deviations, counts and counts per SI.
    const BIAS: [[f64; 2]; 3] = [[40.0, 90.0], [-120.0, 60.0], [0.0, 75.0]];
    const SCALE: [f64; 2] = [1671.0, 20.0];
    const UNITS: usize = 60;

    fn unit(random: &mut Random) -> [f64; 6] {
        std::array::from_fn(|k| match k {
            0..3 => SCALE[0] + SCALE[1] * random.normal(),
            _ => BIAS[k - 3][0] + BIAS[k - 3][1] * random.normal(),
        })
    }

    /// The table of sixty units, by mean and sample covariance.
    fn table(random: &mut Random, sensor: Sensor) -> PriorTable {
        let all: Vec<[f64; 6]> = (0..UNITS).map(|_| unit(random)).collect();
        let mean: Vec<f64> = (0..6)
            .map(|k| all.iter().map(|u| u[k]).sum::<f64>() / UNITS as f64)
            .collect();
        let covariance = DMatrix::from_fn(6, 6, |i, j| {
            let sum = all.iter().map(|u| (u[i] - mean[i]) * (u[j] - mean[j]));
            sum.sum::<f64>() / (UNITS - 1) as f64 * (1.0 + 1.0 / UNITS as f64)
        });
        let of = [0, 1, 2, 9, 10, 11];
        PriorTable::new(sensor, RawUnit::Count, UNITS, &of, &mean, &covariance)
    }

    #[test]
    fn one_unit_in_a_thousand_is_beyond_and_one_of_six_sigma_always() {
        let nominal = Affine {
            matrix: Matrix3::identity() / SCALE[0],
            offset: Vector3::zeros(),
        };
        let scale = Scale {
            models: [nominal, nominal],
            lsb: [None; 2],
            full_scale: [None; 2],
            by: String::new(),
        };
        let (mut beyond, mut count) = (0, 0);
        for seed in 0..40 {
            let mut random = Random::new(seed, "population");
            let tables = PerSensor {
                gyro: Some(table(&mut random, Sensor::Gyro)),
                accel: Some(table(&mut random, Sensor::Accel)),
            };
            let population = Population {
                prior: Prior::new("test".into(), RawUnit::Count, Reference::Gravity, tables),
                place: "fleet.toml".into(),
            };
            let limits = population.limits(&scale, RawUnit::Count).unwrap();
            assert_eq!(limits.len(), 9);
            assert!(population.limits(&scale, RawUnit::Volt).is_err());
            let is_in = |name: &str, value: f64| {
                let limit = limits.iter().find(|l| l.name == name).unwrap();
                (limit.lower.unwrap()..=limit.upper.unwrap()).contains(&value)
            };
            // What the station measures, written out: offsets in deg/s and mg, the sensitivity in per cent of the nominal one.
            for _ in 0..500 {
                let [sx, _, _, bx, by, bz] = unit(&mut random);
                for (name, value) in [
                    ("gyro_x_offset", (bx / SCALE[0]).to_degrees()),
                    ("gyro_y_offset", (by / SCALE[0]).to_degrees()),
                    ("accel_z_offset", bz / SCALE[0] / 9.806_65 * 1e3),
                    ("accel_x_sensitivity", 100.0 * (sx / SCALE[0] - 1.0)),
                ] {
                    beyond += usize::from(!is_in(name, value));
                    count += 1;
                }
            }
            let far = (BIAS[1][0] + 6.0 * BIAS[1][1]) / SCALE[0];
            assert!(!is_in("gyro_y_offset", far.to_degrees()));
        }
        // One in a thousand of 80 000 is 80; the populations themselves err.
        assert!((40..160).contains(&beyond), "{beyond} of {count}");
    }
}
