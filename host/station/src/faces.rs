//! Offsets and sensitivities of an accelerometer from three sides up.
//!
//! With the side of axis i up, axis i reads its sensitivity times gravity plus its offset, and the others read their offsets: two readings of each offset.
//! A side that is not level, or a chip that is not square to it, adds gravity times the angle to what the others read.

use mimu::readable::STANDARD_GRAVITY;
use mimu_recording::error::{Error, Result};
use nalgebra::Vector3;

use crate::measured::Measured;
use crate::quantity::Quantity;
use crate::side::side_up;

/// What an accelerometer reads with one side up, m/s², with the variances of its components.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Face {
    /// Specific force by the nominal model, m/s².
    pub force: Vector3<f64>,
    /// Variances by noise, (m/s²)².
    pub variance: Vector3<f64>,
}

/// Offsets and sensitivities of three axes. `level_deg`: standard uncertainty of the angle between an axis of the chip and its side's vertical, degrees;
/// `gravity`: m/s², with its standard uncertainty.
///
/// # Errors
/// Two faces have the same axis up.
pub fn by_faces(
    faces: &[Face; 3],
    gravity: [f64; 2],
    level_deg: f64,
    place: &str,
) -> Result<Vec<Measured>> {
    let [g, sigma_g] = gravity;
    let level = level_deg.to_radians();
    let mut of_axis: [Option<(&Face, f64)>; 3] = [None; 3];
    for face in faces {
        let (side, direction) = side_up(&face.force);
        let axis = direction.iamax();
        if of_axis[axis].replace((face, direction[axis])).is_some() {
            let problem = format!("two of the three sides are {side} or its opposite");
            let remedy = "put a side of each axis up once: of x, of y and of z";
            return Err(Error::undetermined(place, problem, remedy));
        }
    }
    let [Some(x), Some(y), Some(z)] = of_axis else {
        return Ok(Vec::new());
    };
    let of_axis = [x, y, z];
    let mg = 1e3 / STANDARD_GRAVITY;
    let mut all = Vec::new();
    let offsets = [0, 1, 2].map(|axis| {
        let others = [(axis + 1) % 3, (axis + 2) % 3].map(|other| of_axis[other].0);
        let mean = 0.5 * (others[0].force[axis] + others[1].force[axis]);
        let noise = 0.25 * (others[0].variance[axis] + others[1].variance[axis]);
        (mean, noise)
    });
    for (axis, (offset, noise)) in offsets.into_iter().enumerate() {
        let measured = Quantity::AccelOffset.measured(Some(axis), offset * mg, noise.sqrt() * mg);
        // The two sides are level independently of each other.
        all.push(measured.with_common(g * level / 2f64.sqrt() * mg));
    }
    for (axis, (offset, noise)) in offsets.into_iter().enumerate() {
        let (face, sign) = of_axis[axis];
        let reading = sign * (face.force[axis] - offset);
        let percent = 100.0 * (reading / g - 1.0);
        let by_noise = 100.0 * (face.variance[axis] + noise).sqrt() / g;
        let measured = Quantity::AccelSensitivity.measured(Some(axis), percent, by_noise);
        // The offset's error, the cosine of the angle about two axes, and gravity.
        let type_b = (level / 2f64.sqrt())
            .hypot(level * level)
            .hypot(sigma_g / g);
        all.push(measured.with_common(100.0 * type_b));
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn face(force: [f64; 3]) -> Face {
        Face {
            force: force.into(),
            variance: Vector3::repeat(1e-8),
        }
    }

    #[test]
    fn sides_in_any_order_and_sign_give_offsets_and_sensitivities() {
        let g = 9.81;
        let (offset, scale) = ([0.05, -0.1, 0.2], [1.01, 0.99, 1.002]);
        let read = |up: [f64; 3]| face(std::array::from_fn(|i| offset[i] + scale[i] * g * up[i]));
        let faces = [read([0., 0., -1.]), read([1., 0., 0.]), read([0., 1., 0.])];
        let found = by_faces(&faces, [g, 0.0], 0.1, "test").unwrap();
        for axis in 0..3 {
            let mg = offset[axis] / 9.80665e-3;
            assert!((found[axis].value - mg).abs() < 1e-6, "{:?}", found[axis]);
            let percent = 100.0 * (scale[axis] - 1.0);
            assert!(
                (found[3 + axis].value - percent).abs() < 1e-6,
                "{:?}",
                found[3 + axis]
            );
        }
        let twice = [read([0., 0., -1.]), read([0., 0., 1.]), read([0., 1., 0.])];
        assert!(by_faces(&twice, [g, 0.0], 0.1, "test").is_err());
    }
}
