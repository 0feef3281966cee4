//! Readings of single precision as decimal numbers.

/// The shortest decimal number that is this one in single precision: as `f32` it is what the device has sent, and it is off by less than
/// half of the last place of that, where all the digits of the same `f32` in double precision take twice the room.
pub fn shortest(value: f32) -> f64 {
    // What the standard library writes of an `f32` is the shortest that reads back as it.
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
