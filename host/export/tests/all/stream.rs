//! One stream through a compensator, as bits: compiled into the test, and into the program with the exported module.

use mimu_core::compensation::Sample;
use mimu_core::compensator::Compensator;

/// Middle and half of the range of readings, gyro and accelerometer: of analog sensors in volts, and of a digital one in counts.
pub const VOLTS: [[f32; 2]; 2] = [[2.5, 1.0], [1.65, 0.4]];
pub const COUNTS: [[f32; 2]; 2] = [[40.0, 30_000.0], [-60.0, 16_000.0]];

/// Each compensated sample in hexadecimal digits.
pub fn lines<const NODES: usize, const ROOM: usize>(
    compensator: &Compensator<f32, NODES, ROOM>,
    readings: [[f32; 2]; 2],
) -> Vec<String> {
    let mut state = compensator.state(100.0);
    let mut random = 1u32;
    // Of whole numbers, so that no library of mathematics has a say: within 1 of 0.
    let mut next = || {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (random >> 8) as f32 / 8_388_608.0 - 1.0
    };
    let mut lines = Vec::new();
    for k in 0..2000 {
        if k % 10 == 0 {
            // From 10 K below the nodes to 20 K above them.
            let temp_c = -30.0 + 110.0 * (k as f32 / 2000.0);
            compensator.follow(&mut state, 0.1, Some(temp_c));
        }
        let mut triad = |[middle, half]: [f32; 2]| {
            let reading = [
                middle + half * next(),
                middle + half * next(),
                middle + half * next(),
            ];
            // Counts are whole numbers.
            if half > 100.0 {
                reading.map(f32::round)
            } else {
                reading
            }
        };
        let raw = Sample {
            gyro: triad(readings[0]).into(),
            accel: triad(readings[1]).into(),
        };
        let out = compensator.apply(&mut state, &raw);
        let all = out.gyro.iter().chain(out.accel.iter());
        lines.push(all.map(|v| format!("{:08x}", v.to_bits())).collect());
    }
    lines
}
