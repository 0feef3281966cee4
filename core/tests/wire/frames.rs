//! Frames: what is sent arrives, garbled frames are counted, and the next frame arrives again.

use mimu_core::PerSensor;
use mimu_core::effects::DeviceEffect;
use mimu_core::wire::{
    BATCH, BatchHead, COMPENSATED_BYTES, Call, Compatibility, CompensatedBatch, Decoder, EFFECTS,
    Event, Greeting, MAGIC, MAX_FRAME, MAX_PAYLOAD, Message, PROTOCOL, RAW_BYTES, RawBatch,
    Request, Version, compatibility, effects_of_this_build, encode,
};
use proptest::prelude::*;

/// The payloads of the intact frames in `bytes`, and the number of garbled frames.
fn decode(bytes: &[u8]) -> (Vec<Vec<u8>>, u32) {
    let mut decoder = Decoder::new();
    let mut all = Vec::new();
    for byte in bytes {
        all.extend(decoder.push(*byte).map(|frame| frame.0.to_vec()));
    }
    (all, decoder.garbled())
}

fn frame(message: &impl serde::Serialize) -> Vec<u8> {
    let mut out = [0; MAX_FRAME];
    let length = encode(message, &mut out).unwrap();
    out[..length].to_vec()
}

/// Message `01 00`; its CRC-32 by zlib, and COBS by hand: each run begins with the distance to the zero that ends it.
#[test]
fn a_frame_written_by_hand() {
    let hello = Call {
        id: 1,
        request: Request::Hello,
    };
    let by_hand = [0x00, 0x02, 0x01, 0x05, CRC[0], CRC[1], CRC[2], CRC[3], 0x00];
    assert_eq!(frame(&hello), by_hand);
    let mut decoder = Decoder::new();
    let (last, others) = by_hand.split_last().unwrap();
    for byte in others {
        assert_eq!(decoder.push(*byte), None);
    }
    assert_eq!(decoder.push(*last).unwrap().call(), Some(hello));
    assert_eq!(decoder.garbled(), 0);
}

/// `zlib.crc32(b"\x01\x00")`, little-endian: it contains no zero.
const CRC: [u8; 4] = CRC_OF_01_00.to_le_bytes();
const CRC_OF_01_00: u32 = 0x58c2_23be;

fn head() -> BatchHead {
    BatchHead {
        first: u32::MAX,
        // A year.
        tick_us: 31_536_000_000_000,
        period_ns: u32::MAX,
        samples_lost: u32::MAX,
        batches_dropped: u32::MAX,
        temp_c: 25.0,
        flags: u16::MAX,
    }
}

/// The longest messages fit into a frame, and 1 kHz of them fit the line.
#[test]
fn full_batches_fit() {
    let raw = [255; BATCH * RAW_BYTES];
    let raw = frame(&Message::Event(Event::Raw(RawBatch {
        head: head(),
        scale: PerSensor::both(1.0),
        temperatures: &[255; 12],
        samples: &raw,
    })));
    let compensated = [255; BATCH * COMPENSATED_BYTES];
    let compensated = frame(&Message::Event(Event::Compensated(CompensatedBatch {
        head: head(),
        samples: &compensated,
        accel_die_c: Some(1.0),
    })));
    let frames_a_second = 1000 / BATCH;
    assert!(raw.len() * frames_a_second <= 24_000, "{}", raw.len());
    assert!(compensated.len() <= MAX_FRAME, "{}", compensated.len());
    let all = [raw.len(), compensated.len()];
    println!("{all:?} bytes");
    let (payloads, garbled) = decode(&compensated);
    assert_eq!((payloads.len(), garbled), (1, 0));
    assert!(mimu_core::wire::Frame(&payloads[0]).message().is_some());
}

#[test]
fn a_message_that_is_too_long_is_refused() {
    let bytes = [1_u8; MAX_PAYLOAD];
    assert!(encode(&&bytes[..], &mut [0; MAX_FRAME]).is_err());
    // The length takes two bytes.
    let (payloads, _) = decode(&frame(&&bytes[..MAX_PAYLOAD - 2]));
    assert_eq!(payloads[0].len(), MAX_PAYLOAD);
}

#[test]
fn what_follows_the_message_is_refused() {
    let hello = [1, 0, 9];
    assert_eq!(mimu_core::wire::Frame(&hello).call(), None);
    assert!(mimu_core::wire::Frame(&hello[..2]).call().is_some());
}

#[test]
fn a_frame_without_end_is_counted_once_and_the_next_arrives() {
    let hello = frame(&Call {
        id: 1,
        request: Request::Hello,
    });
    let endless = vec![0x55; 100_000];
    let (payloads, garbled) = decode(&[&endless[..], &hello].concat());
    assert_eq!((payloads.len(), garbled), (1, 1));
    // Shorter than a CRC, and empty.
    let (payloads, garbled) = decode(&[&[0, 0, 2, 1, 0, 1, 0, 0][..], &hello].concat());
    assert_eq!((payloads.len(), garbled), (1, 2));
}

#[test]
fn older_newer_and_foreign_devices_are_told_apart() {
    let of = |magic, major, minor| {
        compatibility(&Greeting {
            magic,
            protocol: Version { major, minor },
            ..Greeting::default()
        })
    };
    let Version { major, minor } = PROTOCOL;
    assert_eq!(of(MAGIC, major, minor), Compatibility::Same);
    assert_eq!(of(*b"mimo", major, minor), Compatibility::NotMimu);
    assert_eq!(
        of(MAGIC, major, minor + 1),
        Compatibility::DeviceNewer { usable: true }
    );
    assert_eq!(
        of(MAGIC, major + 1, 0),
        Compatibility::DeviceNewer { usable: false }
    );
    assert_eq!(
        of(MAGIC, major - 1, minor + 9),
        Compatibility::DeviceOlder { usable: false }
    );
}

#[test]
fn every_effect_in_the_list_is_one_that_this_build_removes() {
    assert_eq!(effects_of_this_build(), (1 << EFFECTS.len()) - 1);
    let unknown = DeviceEffect::<f32>::named("gyro_no_such_thing", &[], None);
    assert_eq!(
        unknown.unwrap_err(),
        mimu_core::effects::EffectError::Unknown
    );
}

proptest! {
    #[test]
    fn what_is_encoded_is_decoded(messages in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..=510), 0..6)) {
        let line: Vec<u8> = messages.iter().flat_map(|m| frame(&m.as_slice())).collect();
        let (payloads, garbled) = decode(&line);
        prop_assert_eq!(garbled, 0);
        prop_assert_eq!(payloads.len(), messages.len());
        for (payload, message) in payloads.iter().zip(&messages) {
            prop_assert_eq!(postcard::from_bytes::<&[u8]>(payload).unwrap(), message);
        }
    }

    /// Any one byte changed, inserted or removed destroys only the frames that it touches, and lost frames are counted.
    #[test]
    fn after_damage_the_next_frame_arrives(
        length in 1..=510_usize, at in 0.0..1.0_f64, kind in 0..3, by in 1..=255_u8,
    ) {
        let one = frame(&vec![0xa5_u8; length].as_slice());
        let mut line = [&one[..], &one, &one].concat();
        let at = one.len() + (at * one.len() as f64) as usize;
        match kind {
            0 => line[at] ^= by,
            1 => line.insert(at, by),
            _ => { line.remove(at); }
        }
        let (payloads, garbled) = decode(&line);
        let all = decode(&one).0.remove(0);
        prop_assert!(payloads.iter().all(|p| *p == all));
        // At worst the byte was the end of one frame and the beginning of the next.
        prop_assert!(!payloads.is_empty());
        prop_assert!(payloads.len() == 3 || garbled >= 1);
    }

    #[test]
    fn noise_is_never_a_message(noise in prop::collection::vec(any::<u8>(), 0..4000)) {
        let (payloads, _) = decode(&noise);
        prop_assert!(payloads.is_empty());
    }
}
