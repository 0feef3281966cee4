//! The noise file, as the errors of dead reckoning need it.

use nalgebra::Vector3;

use crate::noise::noise_file::NoiseFile;
use crate::quantity::{AXES, PerSensor, Sensor};
use mimu_allan::model::Term;
use mimu_recording::error::{Error, Result};

/// Squares of the densities of every axis at rest, of calibrated readings.
#[derive(Debug, Clone, Copy)]
pub(super) struct AllanNoise {
    white: PerSensor<Vector3<f64>>,
    walk: PerSensor<Vector3<f64>>,
    flicker: PerSensor<Vector3<f64>>,
}

impl AllanNoise {
    /// Of a noise file; of several temperatures the noisiest counts.
    ///
    /// # Errors
    /// The file is not of calibrated readings, or lacks an axis or its white noise.
    pub fn of(file: &NoiseFile) -> Result<Self> {
        let mut noise = Self {
            white: PerSensor::both(Vector3::zeros()),
            walk: PerSensor::both(Vector3::zeros()),
            flicker: PerSensor::both(Vector3::zeros()),
        };
        for sensor in Sensor::BOTH {
            for (k, axis) in AXES.iter().enumerate() {
                let name = format!("{sensor}_{axis}");
                for channel in file.channel.iter().filter(|c| c.name == name) {
                    let model = channel.model_in(sensor.unit(), &file.place)?;
                    let largest = |to: &mut f64, value: f64| *to = to.max(value);
                    largest(&mut noise.white[sensor][k], model.white);
                    largest(&mut noise.walk[sensor][k], 3.0 * model.walk);
                    largest(&mut noise.flicker[sensor][k], model.flicker);
                }
                if noise.white[sensor][k] == 0.0 {
                    let problem = format!("{name} has no white noise N");
                    let remedy = "record the unit at rest for longer, and run `mimu allan` again";
                    return Err(Error::new(&file.place, problem, remedy));
                }
            }
        }
        Ok(noise)
    }

    /// Squares of N.
    pub fn squared(&self) -> PerSensor<Vector3<f64>> {
        self.white
    }

    /// Mean square of N of the axes of each sensor.
    pub fn mean_white(&self) -> [f64; 2] {
        Sensor::BOTH.map(|s| self.white[s].sum() / 3.0)
    }

    /// Squares of the random walks that a bias takes between instants `apart_s` apart: K, and flicker noise as the walk that has the Allan variance of
    /// the flicker there. A filter has no flicker noise (the Allan variance of a walk is K² τ/3, that of the floor does not depend on τ).
    pub fn walks(&self, apart_s: f64) -> PerSensor<[f64; 3]> {
        PerSensor::from_fn(|s| {
            std::array::from_fn(|k| self.walk[s][k] + 3.0 * self.flicker[s][k] / apart_s)
        })
    }

    /// The axis of the most white noise, or of the largest walk.
    pub fn worst_axis(&self, sensor: Sensor, term: Term) -> usize {
        match term {
            Term::K => self.walk[sensor].imax(),
            _ => self.white[sensor].imax(),
        }
    }
}
