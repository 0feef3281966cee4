//! Which of the gyros' TEMP pins count.

use crate::design_parameters::{GYRO_TEMPERATURE_RANGE_C, GYRO_TEMPERATURE_SPREAD_C};

/// Whether each pin counts, from what the three read at the same time, °C.
///
/// One counts if it is in the range of a working gyro, and agrees with another such pin or is the only one. Of two that disagree neither
/// counts: which of them is wrong cannot be told, and a mean of both is wrong for certain.
pub fn that_count(pins_c: [f32; 3]) -> [bool; 3] {
    let [least, most] = GYRO_TEMPERATURE_RANGE_C;
    let in_range = pins_c.map(|c| (least..=most).contains(&c));
    core::array::from_fn(|i| {
        let mut others = (0..3).filter(|&j| j != i && in_range[j]).peekable();
        let alone = others.peek().is_none();
        let agrees = others.any(|j| (pins_c[i] - pins_c[j]).abs() <= GYRO_TEMPERATURE_SPREAD_C);
        in_range[i] && (alone || agrees)
    })
}

#[cfg(test)]
mod tests {
    use super::that_count;

    #[test]
    fn a_pin_out_of_range_or_that_disagrees_with_both_others_does_not_count() {
        assert_eq!(that_count([20.0, 32.0, 25.0]), [true; 3]);
        // Open or at ground, and at 5 V.
        assert_eq!(that_count([-272.6, 25.0, 26.0]), [false, true, true]);
        assert_eq!(that_count([25.0, 322.6, 26.0]), [true, false, true]);
        assert_eq!(that_count([25.0, 26.0, 60.0]), [true, true, false]);
    }

    #[test]
    fn the_only_one_counts_and_of_two_that_disagree_neither() {
        assert_eq!(that_count([-272.6, 40.0, 322.6]), [false, true, false]);
        assert_eq!(that_count([-272.6, 40.0, 70.0]), [false; 3]);
        assert_eq!(that_count([-20.0, 40.0, 70.0]), [false; 3]);
        assert_eq!(that_count([f32::NAN, -272.6, 322.6]), [false; 3]);
    }
}
