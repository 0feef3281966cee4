//! The host's receiver under everything that a line can carry: random bytes, flipped bits, cut, duplicated and reordered frames. It never panics and
//! never stops receiving: an intact frame after all this is received.
//!
//! ```text
//! MIMU_FUZZ_CASES=1000000 MIMU_FUZZ_SEED=2 cargo test --release -p mimu-cli --test all device::fuzz -- --nocapture
//! ```

use mimu_core::compensation::{Affine, Compensation};
use mimu_core::effects::{DeviceEffect, Variable};
use mimu_core::stored;
use mimu_core::table::Node;
use mimu_core::{PerSensor, Sensor};

use mimu_device::contents;
use nalgebra::{Matrix3, Vector3};

use crate::random::Random;

fn environment(name: &str, default: u64) -> u64 {
    std::env::var(name)
        .ok()
        .map_or(default, |text| text.parse().expect(name))
}

/// CRC-32/ISO-HDLC, bit by bit.
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
            crc >> 1 ^ (0xedb8_8320 & 0_u32.wrapping_sub(crc & 1))
        })
    })
}

/// A stored calibration of two nodes, a named effect with a time constant, and a term.
fn image() -> Vec<u8> {
    let affine = Affine {
        matrix: Matrix3::identity(),
        offset: Vector3::repeat(-2.5),
    };
    let model = Compensation {
        gyro: affine,
        accel: affine,
    };
    let nodes = [10.0, 30.0].map(|temp_c| Node::constant(temp_c, model));
    let effects = [
        DeviceEffect::named("gyro_warm_up", &[0.1, 0.2, 0.3], Some(60.0)),
        DeviceEffect::term(Sensor::Accel, 1, 0.5, &[Variable::RateX, Variable::ForceY]),
    ]
    .map(Result::unwrap);
    let mut bytes = vec![0; 1024];
    let matrices = PerSensor::both(&affine.matrix);
    let length = stored::encode(
        &stored::Origin::UNKNOWN,
        matrices,
        &stored::Curves::of(&nodes),
        &effects,
        &mut bytes,
    )
    .unwrap();
    bytes.truncate(length);
    bytes
}

#[test]
fn damage_that_the_crc_does_not_see_makes_no_reader_of_a_stored_calibration_fail() {
    let seed = environment("MIMU_FUZZ_SEED", 1);
    let (whole, mut readable) = (image(), 0);
    assert_eq!(
        contents(&whole).unwrap().effects[1].to_string(),
        "term:accel_y~rate_x*force_y"
    );
    let cases = environment("MIMU_FUZZ_CASES", 40_000);
    for case in 0..cases {
        let mut random = Random(seed ^ case.wrapping_mul(0x2545_f491_4f6c_dd1d));
        let mut bytes = whole[..whole.len() - 4].to_vec();
        for _ in 0..1 + random.below(3) {
            // Half of them among the counts and the effects, which are few bytes among so many numbers.
            let at = match random.below(4) {
                0 => random.below(12),
                1 => 336 + random.below(bytes.len().saturating_sub(336).max(1)),
                _ => random.below(bytes.len().max(1)),
            };
            match (random.below(8), bytes.get_mut(at)) {
                (0, Some(_)) => bytes.truncate(at),
                (1, Some(_)) => bytes.insert(at, random.bits() as u8),
                (2 | 3, Some(byte)) => *byte = random.bits() as u8,
                (_, Some(byte)) => *byte ^= 1 << random.below(8),
                (_, None) => {}
            }
        }
        let length = (bytes.len() as u16 + 4).to_le_bytes();
        if let Some(place) = bytes.get_mut(6..8) {
            place.copy_from_slice(&length);
        }
        bytes.extend(crc(&bytes).to_le_bytes());
        let usable = stored::decode(&bytes);
        assert_eq!(
            contents(&bytes).err(),
            usable.as_ref().err().copied(),
            "case {case}"
        );
        readable += u64::from(usable.is_ok());
    }
    println!("seed {seed}: {cases} cases, {readable} readable");
    assert!(
        readable > cases / 20 && readable < cases,
        "{readable} of {cases}"
    );
}
