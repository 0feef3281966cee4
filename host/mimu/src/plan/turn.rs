//! A turn of one axis of a table by an angle, as a step of a plan.

use nalgebra::{Rotation3, Vector3};
use serde::{Deserialize, Serialize};

/// Axes of a table: the outer one is the vertical, the inner one the body's z axis, and the middle one lies across both.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, strum::IntoStaticStr)]
#[serde(rename_all = "lowercase")]
#[strum(serialize_all = "lowercase")]
pub enum TableAxis {
    /// The vertical.
    Outer,
    /// The tilt axis, along the body's x where the inner angle is 0.
    Middle,
    /// The body's z.
    Inner,
}

impl TableAxis {
    /// Name as in a plan.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// A turn from rest to rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turn {
    /// Axis of the table.
    pub axis: TableAxis,
    /// By the right-hand rule, degrees.
    pub angle_deg: f64,
    /// Rate between its ramps, deg/s.
    pub rate_dps: f64,
    /// Body direction that points up where it begins.
    pub from_up: [f64; 3],
    /// The same where it ends.
    pub to_up: [f64; 3],
    /// Middle and inner angle of the table where it ends, degrees.
    pub to_deg: [f64; 2],
    /// The angle about each axis of the body, degrees. Over the duration of the turn it is the mean rate.
    pub about_deg: [f64; 3],
}

/// Middle and inner angle of a table, rad. With these, up is (sin m sin i, sin m cos i, cos m) in the body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Angles {
    middle: f64,
    inner: f64,
}

impl Angles {
    /// Angles at which `up`, of length 1, points upwards; the middle one is from 0 to 180 degrees.
    pub fn of(up: &Vector3<f64>) -> Self {
        let across = up.x.hypot(up.y);
        Self {
            middle: across.atan2(up.z),
            inner: if across < 1e-9 { 0.0 } else { up.x.atan2(up.y) },
        }
    }

    pub fn up(self) -> Vector3<f64> {
        let (sm, cm) = self.middle.sin_cos();
        let (si, ci) = self.inner.sin_cos();
        // Rounded, so that a face that points up is exactly that face.
        Vector3::new(sm * si, sm * ci, cm).map(|c| (c * 1e12).round() / 1e12 + 0.0)
    }

    /// Turns one axis. Returns the turn, and the angles after it.
    pub fn turn(self, axis: TableAxis, angle_deg: f64, rate_dps: f64) -> (Turn, Self) {
        let angle = angle_deg.to_radians();
        let mut to = self;
        let about = match axis {
            TableAxis::Outer => self.up(),
            TableAxis::Middle => {
                to.middle += angle;
                Rotation3::from_axis_angle(&Vector3::z_axis(), -self.inner) * Vector3::x()
            }
            TableAxis::Inner => {
                to.inner += angle;
                Vector3::z()
            }
        };
        let turn = Turn {
            axis,
            angle_deg,
            rate_dps,
            from_up: self.up().into(),
            to_up: to.up().into(),
            to_deg: [to.middle.to_degrees(), to.inner.to_degrees()],
            about_deg: (about * angle_deg)
                .map(|c| (c * 1e9).round() / 1e9 + 0.0)
                .into(),
        };
        (turn, to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_points_up_is_turned_back_by_a_turn_about_a_body_axis() {
        let start = Vector3::new(0.3, -0.5, 0.8).normalize();
        let mut at = Angles::of(&start);
        assert!((at.up() - start).norm() < 1e-9);
        for (axis, deg) in [
            (TableAxis::Middle, 70.0),
            (TableAxis::Inner, -130.0),
            (TableAxis::Outer, 45.0),
            (TableAxis::Middle, -200.0),
        ] {
            let (turn, to) = at.turn(axis, deg, 10.0);
            let about = Vector3::from(turn.about_deg).map(f64::to_radians);
            assert!((about.norm().to_degrees() - deg.abs()).abs() < 1e-6);
            let seen = Rotation3::new(-about) * at.up();
            assert!((seen - to.up()).norm() < 1e-6, "{axis:?}");
            at = to;
        }
    }
}
