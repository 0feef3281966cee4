//! Sides of a unit: `+x` to `-z`.

use mimu::quantity::AXES;
use nalgebra::Vector3;

/// The side that is up in a specific force: the axis with the largest component and its sign, and the direction of that side.
pub fn side_up(force: &Vector3<f64>) -> (String, Vector3<f64>) {
    let axis = force.iamax();
    let sign = force[axis].signum();
    let name = format!("{}{}", if sign > 0.0 { '+' } else { '-' }, AXES[axis]);
    (name, Vector3::ith(axis, sign))
}

/// The direction of a side such as `+z`; `None` if it is none.
pub fn direction(side: &str) -> Option<Vector3<f64>> {
    let (sign, axis) = match side.strip_prefix('+') {
        Some(axis) => (1.0, axis),
        None => (-1.0, side.strip_prefix('-')?),
    };
    let axis = AXES.iter().position(|known| *known == axis)?;
    Some(Vector3::ith(axis, sign))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_side_is_named_by_its_sign_and_axis() {
        for side in ["+x", "-x", "+y", "-y", "+z", "-z"] {
            let force = direction(side).unwrap() * 9.8 + Vector3::new(0.1, -0.2, 0.3);
            assert_eq!(side_up(&force).0, side);
        }
        for wrong in ["", "z", "+w", "+", "é", "+zz"] {
            assert_eq!(direction(wrong), None, "{wrong}");
        }
    }
}
