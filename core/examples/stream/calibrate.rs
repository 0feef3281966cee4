use mimu_core::{compensation::Sample, stored, table::Place};

/// Raw gyro and accelerometer (V) and thermometer (°C) in; rad/s, m/s² and whether the temperature is in the calibrated range out.
pub fn calibrate(
    calibration: &[u8],
    sample_rate_hz: f32,
    stream: impl Iterator<Item = ([f32; 3], [f32; 3], f32)>,
    mut out: impl FnMut(Sample<f32>, Place),
) -> Result<(), stored::StoredError> {
    let compensator = stored::decode(calibration)?.compensator;
    let mut state = compensator.state(sample_rate_hz);
    for (gyro, accel, temp_c) in stream {
        let place = compensator.follow(&mut state, 1.0 / sample_rate_hz, Some(temp_c));
        let raw = Sample { gyro: gyro.into(), accel: accel.into() };
        out(compensator.apply(&mut state, &raw), place);
    }
    Ok(())
}
