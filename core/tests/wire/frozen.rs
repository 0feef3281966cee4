//! Frames of version 2.0 as a device sends them, byte by byte. A separate program made them from the specifications of postcard, COBS and CRC-32.
//! They never change: a device in the field meets programs older and newer than its firmware.

// Fields that are not written out belong to later versions.
#![allow(clippy::needless_update)]

use mimu_core::wire::{
    Capabilities, Compatibility, Counters, Decoder, EFFECTS, Event, Greeting, MAGIC, Message,
    Refusal, Reply, SelfTest, Slot, Start, StoredInfo, Version, compatibility,
};

/// A device's greeting.
const GREETING: &str = "000107076d696d7502650d302e312e302d316132623363340e4e55434c454f2d483734335a49320102030405060708090a0b0c0fffffff \
     0308108020e8072c6779726f5f782c6779726f5f792c6779726f5f7a2c616363656c5f782c616363656c5f792c616363656c5f7a015601 \
     250301b802ef9bafcdf8acd1910101020102030405060708090a0b0c80f2d6ca0602010501059a3c25b400";
/// The same from a device that does not yet send its slots, the last field.
const GREETING_SHORTER: &str = "000107076d696d7502650d302e312e302d316132623363340e4e55434c454f2d483734335a49320102030405060708090a0b0c0fffffff \
     0308108020e8072c6779726f5f782c6779726f5f792c6779726f5f7a2c616363656c5f782c616363656c5f792c616363656c5f7a015601 \
     250301b802ef9bafcdf8acd1910101020102030405060708090a0b0c80f2d6ca066b8fe73f00";
/// The same with the fields up to 2.3, empty, and additional bytes at the end.
const GREETING_LONGER: &str = "000107076d696d7502650d302e312e302d316132623363340e4e55434c454f2d483734335a49320102030405060708090a0b0c0fffffff \
     0308108020e8072c6779726f5f782c6779726f5f792c6779726f5f7a2c616363656c5f782c616363656c5f792c616363656c5f7a015601 \
     250301b802ef9bafcdf8acd1910101020102030405060708090a0b0c80f2d6ca0602010501010101010101010101010101010101010101 \
     0101010101010101010101010101010101010101010101010b2a0474657874f0559abc00";
/// The same with a start reason of a later version, number 19, with five bytes.
const UNKNOWN_START: &str = "000107076d696d7502900d302e312e302d316132623363340e4e55434c454f2d483734335a49320102030405060708090a0b0c0fffffff \
     0308108020e8072c6779726f5f782c6779726f5f792c6779726f5f7a2c616363656c5f782c616363656c5f792c616363656c5f7a015607 \
     130568656c6c6f0301b802ef9bafcdf8acd1910101020102030405060708090a0b0c80f2d6ca0602010501050e29b3db00";
const COUNTERS: &str = "001d010701bbd024fccf24fbcf240102030405060708090a9c036be31a2d00";
/// Without the last field.
const COUNTERS_SHORTER: &str = "001b010701bbd024fccf24fbcf240102030405060708090a24e942de00";
/// With two additional fields.
const COUNTERS_LONGER: &str =
    "0020010701bbd024fccf24fbcf240102030405060708090a9c030580019dcebd7900";
const SELF_TEST: &str = "0034010702713d8abe713d8abe713d8abe713d8a3e713d8a3e713d8a3e3333d33f3333d33fcdcc1c403333d33f3333d33fcd \
     ccec3f0103cc410103d2410103c641010d204033335340ff1fc61d8cf300";
/// Without the fields after the accelerometer's fine range.
const SELF_TEST_SHORTER: &str =
    "002c010702713d8abe713d8abe713d8abe713d8a3e713d8a3e713d8a3e3333d33f3333d33fcdcc1c400bcd240100";
/// With an additional field.
const SELF_TEST_LONGER: &str = "0034010702713d8abe713d8abe713d8abe713d8a3e713d8a3e713d8a3e3333d33f3333d33fcdcc1c403333d33f3333d33fcd \
     ccec3f0103cc410103d2410103c641010f204033335340ff1f0101b5fc63d100";
/// With a reason of a later version, number 99, with three bytes.
const UNKNOWN_REFUSAL: &str = "000b0207630102035add44cd00";

fn bytes(hex: &str) -> Vec<u8> {
    let digits: Vec<u8> = hex
        .chars()
        .filter_map(|c| Some(c.to_digit(16)? as u8))
        .collect();
    digits.chunks(2).map(|d| d[0] << 4 | d[1]).collect()
}

/// Calls `look` with the message in the frame.
fn read<T>(hex: &str, look: impl Fn(&Message<'_>) -> T) -> T {
    let mut decoder = Decoder::new();
    let frame = bytes(hex);
    let (last, before) = frame.split_last().unwrap();
    for byte in before {
        assert_eq!(decoder.push(*byte), None);
    }
    let frame = decoder.push(*last).expect("a whole frame");
    look(&frame.message().expect("a message"))
}

fn greeting() -> Greeting<'static> {
    Greeting {
        magic: MAGIC,
        protocol: Version { major: 2, minor: 0 },
        firmware: "0.1.0-1a2b3c4",
        board: "NUCLEO-H743ZI2",
        unit_id: [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12],
        capabilities: Capabilities::TEMPERATURE_NODES
            .and(Capabilities::TERMS)
            .and(Capabilities::KALMAN)
            .and(Capabilities::SELF_TEST),
        effects: 0x007f_ffff,
        effects_room: 8,
        nodes_room: 16,
        stored_room: 4096,
        sample_rate_hz: 1000,
        channels: "gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z",
        raw_unit: "V",
        start: Start::PowerOn,
        starts: 3,
        stored: Some(StoredInfo {
            length: 312,
            hash: 0x0123_4567_89ab_cdef,
            nodes: 1,
            effects: 2,
            unit_id: [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12],
            // 2026-01-01.
            created_s: 1_767_225_600,
        }),
        slots: [Slot::Whole { generation: 5 }, Slot::Empty],
        ..Greeting::default()
    }
}

#[track_caller]
fn greets(hex: &str, expected: &Greeting<'_>) {
    read(hex, |message| {
        let Message::Greeting { id: 7, greeting } = message else {
            panic!("{message:?}");
        };
        assert_eq!(greeting, expected);
        let found = compatibility(greeting);
        let usable = Compatibility::DeviceOlder { usable: true };
        assert!(
            found == Compatibility::Same || found == usable,
            "{found:?} asks for an update"
        );
    });
}

#[test]
fn a_greeting_of_2_0_is_read_for_ever() {
    greets(GREETING, &greeting());
    // Today's greeting begins with the same bytes.
    let message = Message::Greeting {
        id: 7,
        greeting: greeting(),
    };
    let mut room = [0; 512];
    let sent = postcard::to_slice(&message, &mut room).unwrap();
    let mut decoder = Decoder::new();
    let frame = bytes(GREETING);
    let payload = frame
        .iter()
        .find_map(|b| Some(decoder.push(*b)?.0.to_vec()));
    assert!(sent.starts_with(&payload.unwrap()));
    assert_eq!(EFFECTS[18], "gyro_g_squared", "the last bit of it");
}

#[test]
fn what_a_greeting_lacks_is_unknown() {
    let slots = [Slot::NotKnown; 2];
    let expected = Greeting {
        slots,
        ..greeting()
    };
    greets(GREETING_SHORTER, &expected);
}

#[test]
fn what_a_greeting_has_beyond_is_not_looked_at() {
    greets(GREETING_LONGER, &greeting());
}

#[test]
fn a_reason_to_start_that_is_not_known_hides_nothing_behind_it() {
    let start = Start::NotKnown;
    let expected = Greeting {
        start,
        ..greeting()
    };
    greets(UNKNOWN_START, &expected);
}

#[test]
fn counters_of_2_0_are_read_for_ever_and_whatever_their_length() {
    let whole = Counters {
        uptime_ms: 600_123,
        samples: 600_060,
        last: 600_059,
        late: 1,
        converter_overruns: 2,
        stalls: 3,
        queue_overruns: 4,
        batches_dropped: 5,
        frames_garbled: 6,
        receiver_overruns: 7,
        refused: 8,
        flash_corrected: 9,
        flash_uncorrectable: 10,
        longest_us: 412,
        ..Counters::default()
    };
    let shorter = Counters {
        longest_us: 0,
        ..whole
    };
    for (hex, expected) in [(COUNTERS, whole), (COUNTERS_SHORTER, shorter)] {
        let id = 7;
        let reply = Reply::Counters(expected);
        read(hex, |message| {
            assert_eq!(*message, Message::Reply { id, reply })
        });
    }
    read(COUNTERS_LONGER, |message| {
        let Message::Reply {
            id: 7,
            reply: Reply::Counters(found),
        } = message
        else {
            panic!("{message:?}");
        };
        assert_eq!((found.uptime_ms, found.longest_us), (600_123, 412));
    });
}

#[test]
fn a_self_test_of_2_0_is_read_for_ever_and_whatever_its_length() {
    let whole = SelfTest {
        gyro_st1_v: [-0.27; 3],
        gyro_st2_v: [0.27; 3],
        accel_fine_v: [1.65, 1.65, 2.45],
        accel_coarse_v: [1.65, 1.65, 1.85],
        gyro_temps_c: [25.5, 26.25, 24.75],
        reference_v: 2.5,
        supply_v: 3.3,
        passed: 0xfff,
        ..SelfTest::default()
    };
    let shorter = SelfTest {
        gyro_st1_v: whole.gyro_st1_v,
        gyro_st2_v: whole.gyro_st2_v,
        accel_fine_v: whole.accel_fine_v,
        ..SelfTest::default()
    };
    for (hex, expected) in [
        (SELF_TEST, whole),
        (SELF_TEST_LONGER, whole),
        (SELF_TEST_SHORTER, shorter),
    ] {
        let id = 7;
        let reply = Reply::SelfTest(expected);
        read(hex, |message| {
            assert_eq!(*message, Message::Reply { id, reply })
        });
    }
}

#[test]
fn a_refusal_for_an_unknown_reason_is_a_refusal() {
    let refusal = Refusal::NotKnown;
    let expected = Message::Refused { id: 7, refusal };
    read(UNKNOWN_REFUSAL, |message| assert_eq!(*message, expected));
}

/// A device of protocol 2.1 ends a compensated batch with its samples, and a later one may append.
#[test]
fn a_compensated_batch_is_read_whatever_follows_its_samples() {
    let sample = [0x40_u8; 24];
    let before = [
        &[3, 1, 5, 0, 0][..],
        &25.0_f32.to_le_bytes(),
        &[0, 24],
        &sample,
    ]
    .concat();
    let own = [&before[..], &[1], &30.0_f32.to_le_bytes()].concat();
    let longer = [&own[..], &[7, 7]].concat();
    for (bytes, dies_c) in [
        (&before, [25.0, 25.0]),
        (&own, [25.0, 30.0]),
        (&longer, [25.0, 30.0]),
    ] {
        let message = mimu_core::wire::Frame(bytes).message();
        let Some(Message::Event(Event::Compensated(batch))) = message else {
            panic!("{message:?}");
        };
        assert!(batch.is_whole());
        assert_eq!((batch.head.first, batch.dies_c()), (5, dies_c.into()));
    }
    // A batch that ends within the samples is invalid.
    let message = mimu_core::wire::Frame(&before[..20]).message();
    assert_eq!(message, None);
}

#[test]
fn a_message_of_another_kind_is_whole_or_none() {
    // `Done` for call 7: with an additional byte, and truncated.
    for payload in [&[1, 7, 0, 9][..], &[1, 7], &[0], &[0, 7, b'n']] {
        assert_eq!(mimu_core::wire::Frame(payload).message(), None);
    }
}
