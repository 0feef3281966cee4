//! One stream through a compensator, as bits: compiled into the test, and into the program with the exported module.

use mimu_core::compensation::Sample;
use mimu_core::compensator::Compensator;

/// Each compensated sample in hexadecimal digits.
pub fn lines<const NODES: usize, const ROOM: usize>(
    compensator: &Compensator<f32, NODES, ROOM>,
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
        let raw = Sample {
            gyro: [2.5 + next(), 2.5 + next(), 2.5 + next()].into(),
            accel: [
                1.65 + 0.4 * next(),
                1.65 + 0.4 * next(),
                1.65 + 0.4 * next(),
            ]
            .into(),
        };
        let out = compensator.apply(&mut state, &raw);
        let all = out.gyro.iter().chain(out.accel.iter());
        lines.push(all.map(|v| format!("{:08x}", v.to_bits())).collect());
    }
    lines
}
