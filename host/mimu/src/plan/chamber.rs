//! The course of a chamber in a plan: corners of time, s, and temperature, °C.

/// Temperature at a time: linear between the corners, constant outside; NaN without corners.
pub fn temp_c(corners: &[[f64; 2]], t_s: f64) -> f64 {
    let after = corners.partition_point(|p| p[0] <= t_s);
    let before = after.checked_sub(1).map(|k| corners[k]);
    match (before, corners.get(after)) {
        (Some([t0, c0]), Some([t1, c1])) => c0 + (c1 - c0) * (t_s - t0) / (t1 - t0),
        (Some([_, c]), None) | (None, Some(&[_, c])) => c,
        (None, None) => f64::NAN,
    }
}
