//! Both triads, each as a triangular matrix times a rotation, with the gyro's g-sensitivity: the parameters of Kalibr and OpenVINS.
//!
//! Readings are those of a [driver]: `y = P x + b`, SI to SI. `P = T R` with T triangular and R a rotation is the exact counterpart of a QR
//! factorisation: scale factors and non-orthogonality are in T, the misalignment of the package is in R.

use mimu::{Calibration, PerSensor, Sensor};
use mimu_recording::error::Result;
use nalgebra::{Matrix3, Vector3};

use crate::convention::{Factors, Triangle};
use crate::driver::{self, Readings};
use crate::remaining::Places;
use crate::{Export, Sources};

/// Id of the only effect that these formats can store.
const G_SENSITIVITY: &str = "gyro_g_sensitivity";

/// Intrinsics of both triads.
#[derive(Debug, Clone)]
pub struct Intrinsics {
    /// `P = T R`; R rotates from the calibration's body frame to the triad's frame.
    pub factors: PerSensor<Factors>,
    /// Error of the gyro's readings by the specific force in the body frame, (rad/s)/(m/s²).
    pub g_sensitivity: Matrix3<f64>,
    /// Factors from noise at the input to noise in the program's readings.
    pub gain: PerSensor<[f64; 3]>,
    /// The driver's readings; `None` without a calibration.
    readings: Option<PerSensor<Readings>>,
}

impl Intrinsics {
    /// Intrinsics of the calibration, or without one those of calibrated readings. Adds remaining errors to `export`.
    ///
    /// # Errors
    /// The errors of [`driver::Options::readings`], or without a calibration an option of the driver is given.
    pub fn of(
        from: &Sources,
        driver: &driver::Options,
        half: Triangle,
        export: &mut Export,
    ) -> Result<Self> {
        let Some((calibration, _)) = from.calibration else {
            driver.unused()?;
            let one = Factors {
                triangle: Matrix3::identity(),
                rotation: Matrix3::identity(),
            };
            return Ok(Self {
                factors: PerSensor::both(one),
                g_sensitivity: Matrix3::zeros(),
                gain: PerSensor::both([1.0; 3]),
                readings: None,
            });
        };
        let (_, readings) = driver.both(from)?;
        export.leaves(calibration, Places::Matrix);
        export.remaining.retain(|r| r.source != G_SENSITIVITY);
        let gain = readings.as_ref().map(Readings::noise_gain);
        // Effects are in SI along each sensor's axis: x = C (u - S e) + o.
        let gyro = Matrix3::from_diagonal(&Vector3::from(gain.gyro));
        Ok(Self {
            factors: PerSensor::from_fn(|s| Factors::of(&readings[s].forward.matrix, half)),
            g_sensitivity: gyro * g_sensitivity(calibration),
            gain,
            readings: Some(readings),
        })
    }

    /// Adds the notes common to all files with intrinsics; none without a calibration.
    pub fn describe(&self, from: &Sources, export: &mut Export) {
        let (Some((calibration, _)), Some(readings)) = (from.calibration, &self.readings) else {
            return;
        };
        export.temperature(calibration);
        for sensor in [Sensor::Accel, Sensor::Gyro] {
            let [x, y, z]: [f64; 3] = readings[sensor].forward.bias.into();
            export.note(readings[sensor].line());
            export.note(format!(
                "{sensor}: the program estimates the bias of these readings; it was [{x:.4}, {y:.4}, {z:.4}] {}.",
                sensor.unit()
            ));
        }
    }
}

/// By rows. Coefficients that the experiment did not determine are absent.
fn g_sensitivity(calibration: &Calibration) -> Matrix3<f64> {
    let mut sag = Matrix3::zeros();
    for effect in calibration.effects() {
        if effect.id() == G_SENSITIVITY {
            let known = effect.candidate.active.iter().zip(&effect.values);
            known.for_each(|(k, value)| sag[(k / 3, k % 3)] += value);
        }
    }
    sag
}
