//! A further triad as it was found: its own calibration, and where it stands on the body.

use mimu::judgement::Judgement;
use mimu::triad::{Estimate, Part, Triad, affine, half_width_95, vector};
use mimu_core::compensation::Affine;
use mimu_recording::{TriadKind, TriadName};
use nalgebra::{Matrix3, Rotation3, SMatrix, SVector, Vector3};

use crate::iron::Iron;
use crate::relation::{DELAY, Relation};

/// A number, or why it is not known.
pub type Known<T> = Result<T, String>;

/// A further triad of a body.
#[derive(Debug, Clone)]
pub struct FittedTriad {
    /// Its name.
    pub name: TriadName,
    /// What rotation, delay and lever arm are against; `None` for a trajectory.
    pub reference: Option<TriadName>,
    /// Unit of its calibrated readings.
    pub unit: &'static str,
    /// Calibration, raw to `unit`, in its own frame: x along its first axis, y in the plane of the first two.
    pub triad: Triad,
    /// Takes what it measures from its own frame to that of the reference.
    pub rotation: Rotation3<f64>,
    /// Errors of `rotation`, as a rotation vector in the frame of the reference, degrees, with the values of its rotation vector.
    pub rotation_deg: [Estimate; 3],
    /// By how much its readings are later than those of the reference, ms.
    pub delay_ms: Known<Estimate>,
    /// From the reference to the triad, in the frame of the reference, mm.
    pub lever_arm_mm: Known<[Estimate; 3]>,
    /// Angle of the field below the level, degrees; only of a magnetometer.
    pub dip_deg: Option<Known<Estimate>>,
    /// How its hard iron moves with the temperature, if it does; only of a magnetometer.
    pub iron: Option<Iron>,
    /// Rms error, in sample, in `unit`: of means over [`Self::window_s`].
    pub rms: f64,
    /// The same in pieces of time that the fit has not used.
    pub held_out_rms: f64,
    /// The same by white noise alone.
    pub noise_floor: f64,
    /// Length of the means or turns that are compared, s.
    pub window_s: f64,
    /// Number of these.
    pub windows: usize,
    /// Pieces of time whose readings the others contradict, s: they are left out.
    pub left_out: Vec<[f64; 2]>,
    /// Its judgement.
    pub judgement: Judgement,
}

impl FittedTriad {
    /// Of its relation to the reference, whose errors add `by_reference` to those of its calibration; without a lever arm and a dip. `None` if two of its axes read the same.
    pub(crate) fn of(
        name: TriadName,
        (relation, by_reference): (&Relation, Vec<Part>),
        (unit, window_s): (&'static str, f64),
        judgement: Judgement,
    ) -> Option<Self> {
        let parts = [vec![relation.part()], by_reference].concat();
        let Placed {
            triad,
            rotation,
            rotation_deg,
        } = placed(&relation.calibration(), &parts)?;
        let errors = &relation.errors;
        Some(Self {
            name,
            reference: Some(TriadName::first(match name.kind {
                TriadKind::Accel => TriadKind::Accel,
                _ => TriadKind::Gyro,
            })),
            unit,
            judgement,
            triad,
            rotation,
            rotation_deg,
            delay_ms: Ok(relation.estimate(DELAY, 1e3)),
            lever_arm_mm: Err("it reads the same everywhere on a body".to_string()),
            dip_deg: None,
            iron: None,
            rms: errors.rms,
            held_out_rms: errors.held_out_rms,
            noise_floor: errors.noise_floor,
            window_s,
            windows: errors.windows,
            left_out: relation.left_out.clone(),
        })
    }
}

/// A calibration in the frame of the reference, taken apart into one in the triad's own frame and a rotation.
#[derive(Debug, Clone)]
pub(crate) struct Placed {
    pub triad: Triad,
    pub rotation: Rotation3<f64>,
    pub rotation_deg: [Estimate; 3],
}

/// C and o in the triad's own frame, and the rotation from there to the frame that `of` is in. `None` if C is singular.
///
/// With the sensors' directions as the rows of P = C⁻¹, `P = L Rᵀ`: L, lower triangular, is what the triad itself is. Its scale factors are positive, and
/// all negative if the axes are left-handed.
fn apart(of: &Affine<f64>) -> Option<(Affine<f64>, Rotation3<f64>)> {
    let forward = of.matrix.try_inverse()?;
    let sign = forward.determinant().signum();
    let qr = (sign * forward).transpose().qr();
    let (mut q, r) = (qr.q(), qr.r());
    for k in 0..3 {
        if r[(k, k)] < 0.0 {
            q.column_mut(k).neg_mut();
        }
    }
    let back = q.transpose();
    let own = Affine {
        // Above its diagonal there is nothing but rounding.
        matrix: (back * of.matrix).lower_triangle(),
        offset: back * of.offset,
    };
    Some((own, Rotation3::from_matrix_unchecked(q)))
}

/// Rotation vector of a small rotation. By its trace an angle below 1e-8 would be zero.
fn small_turn(of: &Rotation3<f64>) -> Vector3<f64> {
    let m = of.matrix() - of.matrix().transpose();
    0.5 * Vector3::new(m[(2, 1)], m[(0, 2)], m[(1, 0)])
}

/// Takes a calibration in the frame of the reference apart, with the parts of its covariance (C by rows, then o).
pub(crate) fn placed(of: &Affine<f64>, parts: &[Part]) -> Option<Placed> {
    let (own, rotation) = apart(of)?;
    let at = vector(&of.matrix, &of.offset);
    let mut by_own = SMatrix::<f64, 12, 12>::zeros();
    let mut by_rotation = SMatrix::<f64, 3, 12>::zeros();
    let size = of.matrix.norm();
    for k in 0..12 {
        // Central differences of 1e-5 of C: an error of second order, 1e-10 of the slope.
        let step = if k < 9 { 1e-5 * size } else { size };
        let moved = |by: f64| {
            let mut at: SVector<f64, 12> = at;
            at[k] += by;
            apart(&affine(&at))
        };
        let (up, down) = (moved(step)?, moved(-step)?);
        let own = vector(&up.0.matrix, &up.0.offset) - vector(&down.0.matrix, &down.0.offset);
        by_own.set_column(k, &(own / (2.0 * step)));
        by_rotation.set_column(k, &(small_turn(&(up.1 * down.1.inverse())) / (2.0 * step)));
    }
    let triad = Triad::from_inverse(own, parts.iter().map(|p| p.seen_by(&by_own)).collect())?;
    let angles = rotation.scaled_axis();
    let degree = 1f64.to_degrees();
    let rotation_deg = [0, 1, 2].map(|i| {
        let by = by_rotation.row(i);
        let along = |p: &Part| ((by * p.covariance * by.transpose())[0].max(0.0), p.dof);
        let variance: f64 = parts.iter().map(|p| along(p).0).sum();
        Estimate {
            value: angles[i] * degree,
            sigma: variance.sqrt() * degree,
            interval: half_width_95(parts.iter().map(along)) * degree,
        }
    });
    Some(Placed {
        triad,
        rotation,
        rotation_deg,
    })
}

/// What errors of the reference's C and o make of those of a triad whose readings follow it: `x = C u + o` was fitted to `C₁ u₁ + o₁`, so
/// with u₁ = P₁ x + b₁ an error of these is `δC₁ (P₁ x + b₁) + δo₁`.
pub(crate) fn by_reference(of: &Affine<f64>, reference: &Triad) -> Vec<Part> {
    let forward = &reference.forward;
    let mut by = SMatrix::<f64, 12, 12>::zeros();
    for i in 0..3 {
        for j in 0..3 {
            let mut change = Matrix3::zeros();
            change[(i, j)] = 1.0;
            let matrix = change * forward.matrix * of.matrix;
            let offset = change * (forward.matrix * of.offset + forward.bias);
            by.set_column(3 * i + j, &vector(&matrix, &offset));
        }
        let offset = Vector3::ith(i, 1.0);
        by.set_column(9 + i, &vector(&Matrix3::zeros(), &offset));
    }
    let parts = reference.inverse_parts();
    parts.iter().map(|p| p.seen_by(&by)).collect()
}

/// What errors of a gyro's C make of a triad whose frame follows the turns of that gyro: the part of them that is a rotation. Its scale factors err by far
/// less in a second's turn than a field is known.
pub(crate) fn turned_with(of: &Affine<f64>, gyro: &Triad) -> Vec<Part> {
    let mut by = SMatrix::<f64, 12, 12>::zeros();
    for i in 0..3 {
        for j in 0..3 {
            let mut change = Matrix3::zeros();
            change[(i, j)] = 1.0;
            let error = change * gyro.forward.matrix;
            let turn = 0.5 * (error - error.transpose());
            by.set_column(3 * i + j, &vector(&(turn * of.matrix), &(turn * of.offset)));
        }
    }
    let parts = gyro.inverse_parts();
    parts.iter().map(|p| p.seen_by(&by)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triad_that_is_turned_is_itself_and_its_rotation() {
        // Sensors with these directions by rows (lower triangular), in a chip turned by 170 degrees about (1, 2, 3).
        let own = Matrix3::new(2.0, 0.0, 0.0, 0.02, 1.9, 0.0, -0.03, 0.01, 2.1);
        let rotation =
            Rotation3::new(Vector3::new(1.0, 2.0, 3.0).normalize() * 170f64.to_radians());
        let forward = own * rotation.matrix().transpose();
        let matrix = forward.try_inverse().unwrap();
        let offset = Vector3::new(0.3, -0.2, 0.1);
        let found = placed(&Affine { matrix, offset }, &[]).unwrap();
        assert!((found.triad.forward.matrix - own).norm() < 1e-12);
        assert!((found.rotation.matrix() - rotation.matrix()).norm() < 1e-12);
        let x = rotation * found.triad.inverse.apply(&Vector3::new(1.0, 2.0, 3.0));
        assert!((x - (matrix * Vector3::new(1.0, 2.0, 3.0) + offset)).norm() < 1e-12);
    }

    #[test]
    fn the_error_of_a_rotation_is_that_of_the_calibration_it_is_in() {
        // One milliradian about z, in all of C.
        for (size, about) in [
            (0.5, Vector3::zeros()),
            (1e-3, Vector3::new(0.8, -0.3, 2.4)),
        ] {
            error_of_rotation(Rotation3::new(about), size);
        }
    }

    fn error_of_rotation(rotation: Rotation3<f64>, size: f64) {
        let matrix = rotation.matrix() * size;
        let about_z: Vector3<f64> = Vector3::z();
        let turned: Matrix3<f64> = about_z.cross_matrix() * matrix * 1e-3;
        let by = vector(&turned, &Vector3::zeros());
        let part = Part::known(by * by.transpose());
        let offset = Vector3::zeros();
        let found = placed(&Affine { matrix, offset }, &[part]).unwrap();
        let sigmas = found.rotation_deg.map(|e| e.sigma.to_radians());
        assert!(
            (sigmas[2] - 1e-3).abs() < 1e-8 && sigmas[0] < 1e-8,
            "{sigmas:?}"
        );
        assert!(found.triad.inverse_covariance.norm() < 1e-12);
    }
}
