//! The axes of the craft that flight controllers calibrate in, and a calibration rotated from one choice of them to another.

use mimu::calibration::Calibration;
use mimu::quantity::PerSensor;
use mimu_core::compensation::Affine;
use mimu_recording::Result;
use nalgebra::{Matrix3, Vector3};

/// Directions of x, y and z.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CraftAxes {
    /// x forward, y right, z down.
    ForwardRightDown,
    /// x forward, y left, z up.
    ForwardLeftUp,
}

impl CraftAxes {
    /// What x, y and z are.
    pub(crate) fn text(self) -> &'static str {
        match self {
            Self::ForwardRightDown => "x forward, y right, z down",
            Self::ForwardLeftUp => "x forward, y left, z up",
        }
    }
}

/// The models of a file, its y and z reversed: from one choice of [`CraftAxes`] to the other, as half a turn about x lies between the two. Readings and output
/// are in the axes of the format, so with F = F⁻¹ = diag(1, -1, -1) `x = C u + o` becomes `F x = F C F (F u) + F o`.
///
/// # Errors
/// C is singular.
pub(crate) fn rotated(of: &Calibration, frame: &str, place: &str) -> Result<Calibration> {
    let turn = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0));
    let of_axes = |model: Affine<f64>| Affine {
        matrix: turn * model.matrix * turn,
        offset: turn * model.offset,
    };
    let models = PerSensor::from_fn(|sensor| of.inverse(sensor).map(of_axes));
    let unit = (of.device.as_str(), of.recording.raw_unit, frame);
    Calibration::of_program(&models, unit, place)
}

#[cfg(test)]
mod tests {
    use super::*;
    use mimu::quantity::Sensor;
    use mimu_recording::RawUnit;

    #[test]
    fn a_rotated_calibration_gives_the_same_vector_in_the_other_axes() {
        let model = Affine {
            matrix: Matrix3::new(0.98, 0.02, -0.03, -0.01, 1.03, 0.04, 0.05, -0.02, 1.01),
            offset: Vector3::new(0.3, -0.2, 0.1),
        };
        let models = PerSensor::both(Some(model));
        let of = Calibration::of_program(&models, ("unit", RawUnit::Si, "body"), "file").unwrap();
        let turned = rotated(&of, "craft", "file").unwrap();
        for sensor in Sensor::BOTH {
            let other = turned.inverse(sensor).unwrap();
            let x = model.apply(&Vector3::new(1.0, 2.0, -3.0));
            let found = other.apply(&Vector3::new(1.0, -2.0, 3.0));
            assert!((found - Vector3::new(x[0], -x[1], -x[2])).amax() < 1e-12);
        }
    }
}
