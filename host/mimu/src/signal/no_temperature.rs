//! Samples of the thermometer that cannot be temperatures in °C are treated as empty cells, and counted.

use mimu_recording::NoTemperatures;

use crate::warning::Warning;

/// Possible temperatures, °C, as in an import. The device's range is narrower: here a thermometer with an unknown offset may read 379 °C
/// throughout and still show what follows temperature.
const RANGE_C: std::ops::RangeInclusive<f64> = -273.15..=1000.0;

/// Empties the cells of `temp_c` (at the times `t_s`) that cannot be temperatures, and counts them.
pub(crate) fn leave_empty(
    temp_c: &mut [f64],
    t_s: impl IntoIterator<Item = f64>,
    found: &mut NoTemperatures,
) {
    for (c, t_s) in temp_c.iter_mut().zip(t_s) {
        found.of += u64::from(c.is_finite());
        if c.is_finite() && !RANGE_C.contains(c) {
            found.add(*c, || format!("at {t_s:.1} s"));
            *c = f64::NAN;
        }
    }
}

/// The warning about them, if there are any.
pub(crate) fn warning(found: &NoTemperatures) -> Option<Warning> {
    (found.count > 0).then(|| Warning::NoTemperatures {
        which: found.clone(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_temperature_is_left_empty_and_counted_and_nothing_else() {
        let mut found = NoTemperatures::default();
        let mut temp_c = [20.0, -7049.0, f64::NAN, -40.0, 1e5, 85.0];
        leave_empty(&mut temp_c, (0..6).map(f64::from), &mut found);
        assert!(temp_c[1].is_nan() && temp_c[2].is_nan() && temp_c[4].is_nan());
        assert_eq!([temp_c[0], temp_c[3], temp_c[5]], [20.0, -40.0, 85.0]);
        assert_eq!(
            warning(&found).unwrap().to_string(),
            "temp_c: 2 of 5 values cannot be temperatures in °C, the first is -7049 at 1.0 s: left empty"
        );
        assert_eq!(warning(&NoTemperatures::default()), None);
    }
}
