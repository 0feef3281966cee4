//! A few seconds of every kind of step as sent by the device: `core` computes the same from them, to the last bit.

use mimu_board_tests::traces::{STEPS, Trace, replay};

#[test]
fn core_computes_what_the_device_has_computed() {
    let mut total = 0;
    for step in &STEPS {
        let trace = Trace::read(step.name);
        total += trace.wire.len() + trace.calibration.len();
        let found = replay(&trace).unwrap_or_else(|problem| panic!("{}: {problem}", step.name));
        println!("{}: {found:?}", step.name);
        assert!(found.raw >= 900, "{}: {found:?}", step.name);
        match step.name {
            // Two banks, five reports a second of each.
            "kalman" => assert!(found.reports >= 8, "{found:?}"),
            name => assert!(found.compensated >= 900, "{name}: {found:?}"),
        }
    }
    assert!(total < 300_000, "{total} bytes");
}

#[test]
fn a_last_bit_that_changes_is_noticed() {
    for name in ["by-hand", "effects"] {
        let mut trace = Trace::read(name);
        // C of the gyro in the first node: after the header, the origin, the directions of both triads, range and lags, and the temperature.
        let at = 12 + 88 + 2 * 72 + 16 + 4;
        trace.calibration[at] ^= 1;
        let end = trace.calibration.len() - 4;
        let crc = crc(&trace.calibration[..end]);
        trace.calibration[end..].copy_from_slice(&crc.to_le_bytes());
        let problem = replay(&trace).unwrap_err();
        assert!(problem.starts_with("sample"), "{problem}");
    }
    let mut trace = Trace::read("kalman");
    // In the middle of the recorded bytes.
    let middle = trace.wire.len() / 2;
    trace.wire[middle] ^= 1;
    assert!(replay(&trace).is_err());
}

/// CRC-32/ISO-HDLC, bit by bit.
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
            crc >> 1 ^ (0xedb8_8320 & 0_u32.wrapping_sub(crc & 1))
        })
    })
}
