//! Writes single-precision readings as short decimal numbers.

/// The shortest decimal number that equals `value` in single precision: read as `f32` it is exactly what the device sent. All digits of the same
/// `f32` in double precision would take twice the space.
pub fn shortest(value: f32) -> f64 {
    // The standard library writes the shortest decimal number that reads back as the same `f32`.
    value.to_string().parse().unwrap_or(f64::from(value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reading_keeps_all_bits_of_single_precision_in_its_shortest_form() {
        let mut readings: Vec<f32> = (59_000..70_000).map(|n| n as f32 * 4.2e-5).collect();
        readings.extend([0.0, -0.0, 1e-30, f32::MAX, f32::MIN_POSITIVE, 16_777_217.0]);
        for reading in readings {
            let kept = shortest(reading);
            assert_eq!((kept as f32).to_bits(), reading.to_bits());
            assert_eq!(kept.to_string(), reading.to_string());
        }
        assert_eq!(shortest(2.478), 2.478);
        assert_ne!(f64::from(2.478_f32), 2.478);
    }
}
