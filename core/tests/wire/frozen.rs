//! Frames of version 3.0 as a device sends them, byte by byte. A separate program made them from the specifications of postcard, COBS and CRC-32.
//! They never change: a device in the field meets programs older and newer than its firmware.

// Fields that are not written out belong to later versions.
#![allow(clippy::needless_update)]

use super::golden::hex;
use mimu_core::PerSensor;
use mimu_core::wire::{
    Capabilities, Compatibility, Counters, Decoder, EFFECTS, Event, Greeting, MAGIC, Message,
    Refusal, Reply, SelfTest, Slot, Start, StoredInfo, TestRow, Triad, Verdict, Version,
    WrongRegister, compatibility,
};

/// A device's greeting.
const GREETING: &str = "000107076d696d75033f0d302e312e302d316132623363340e4e55434c454f2d483734335a49320102030405060708090a0b0c0fffffff \
     03081080200841445852533330300156120103a840010320400103903e01167a4405343020487a094d4d4137323630515401561201036c \
     410103d43f0103a03d01217a4407312e36206b487a146779726f5f782c6779726f5f792c6779726f5f7a01250301b802ef9bafcdf8acd1 \
     910101020102030405060708090a0b0c80f2d6ca06020105010105396834a200";
/// The same from a device that does not send the last fields: its slots and the time since power-on.
const GREETING_SHORTER: &str = "000107076d696d75033f0d302e312e302d316132623363340e4e55434c454f2d483734335a49320102030405060708090a0b0c0fffffff \
     03081080200841445852533330300156120103a840010320400103903e01167a4405343020487a094d4d4137323630515401561201036c \
     410103d43f0103a03d01217a4407312e36206b487a146779726f5f782c6779726f5f792c6779726f5f7a01250301b802ef9bafcdf8acd1 \
     910101020102030405060708090a0b0c80f2d6ca0601b6adff00";
/// The same with the fields of 3.2, and additional bytes at the end.
const GREETING_LONGER: &str = "000107076d696d75033f0d302e312e302d316132623363340e4e55434c454f2d483734335a49320102030405060708090a0b0c0fffff \
     ff03081080200841445852533330300156120103a840010320400103903e01167a4405343020487a094d4d4137323630515401561201 \
     036c410103d43f0103a03d01217a4407312e36206b487a146779726f5f782c6779726f5f792c6779726f5f7a01250301b802ef9bafcd \
     f8acd1910101020102030405060708090a0b0c80f2d6ca060201050101030103040175010247010e7a44012a04746578747421f91f00";
/// The same with a start reason of a later version, number 19, with five bytes.
const UNKNOWN_START: &str = "000107076d696d75033f0d302e312e302d316132623363340e4e55434c454f2d483734335a49320102030405060708090a0b0c0fffffff \
     03081080200841445852533330300156120103a840010320400103903e01167a4405343020487a094d4d4137323630515401561201036c \
     410103d43f0103a03d014c7a4407312e36206b487a146779726f5f782c6779726f5f792c6779726f5f7a07130568656c6c6f0301b802ef \
     9bafcdf8acd1910101020102030405060708090a0b0c80f2d6ca0602010501010572147c9500";
/// All counters.
const COUNTERS: &str = "001d010701bbd024fccf24fbcf240102030405060708090a9c036be31a2d00";
/// Without the last field.
const COUNTERS_SHORTER: &str = "001b010701bbd024fccf24fbcf240102030405060708090a24e942de00";
/// With two additional fields.
const COUNTERS_LONGER: &str =
    "0020010701bbd024fccf24fbcf240102030405060708090a9c030580019dcebd7900";
/// A self-test of three rows.
const SELF_TEST: &str = "00110107024e0b6779726f20782c20535431010580be0156010102bf010102be0f0d616363656c20782c206e756c6c0105d03f01560103 \
     c03f010be03f0206737570706c79010540400156010348400108604001bac1dc3e00";
/// With an additional field.
const SELF_TEST_LONGER: &str = "00110107024e0b6779726f20782c20535431010580be0156010102bf010102be0f0d616363656c20782c206e756c6c0105d03f01560103 \
     c03f010be03f0206737570706c7901054040015601034840010a6040010101e0998cdd00";
/// With a reason of a later version, number 99, with three bytes.
const UNKNOWN_REFUSAL: &str = "000b0207630102035add44cd00";

/// Calls `look` with the message in the frame.
fn read<T>(text: &str, look: impl Fn(&Message<'_>) -> T) -> T {
    let mut decoder = Decoder::new();
    let frame = hex(text);
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
        protocol: Version { major: 3, minor: 0 },
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
        triads: PerSensor {
            gyro: Triad {
                part: "ADXRS300",
                unit: "V",
                bits: 18,
                range: 5.25,
                null: 2.5,
                per_si: 0.28125,
                rate_hz: 1000.0,
                filter: "40 Hz",
            },
            accel: Triad {
                part: "MMA7260QT",
                unit: "V",
                bits: 18,
                range: 14.75,
                null: 1.65625,
                per_si: 0.078125,
                rate_hz: 1000.0,
                filter: "1.6 kHz",
            },
        },
        thermometers: "gyro_x,gyro_y,gyro_z",
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
fn a_greeting_of_3_0_is_read_for_ever() {
    greets(GREETING, &greeting());
    // Today's greeting begins with the same bytes.
    let message = Message::Greeting {
        id: 7,
        greeting: greeting(),
    };
    let mut room = [0; 528];
    let sent = postcard::to_slice(&message, &mut room).unwrap();
    let mut decoder = Decoder::new();
    let frame = hex(GREETING);
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
    let expected = Greeting {
        brown_out_level: Some(3),
        wrong_register: Some(WrongRegister {
            register: 0x75,
            identifies: true,
            found: 0,
            expected: 0x47,
        }),
        nominal_hz: 1000.0,
        rate_measured: true,
        ..greeting()
    };
    greets(GREETING_LONGER, &expected);
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
fn counters_of_3_0_are_read_for_ever_and_whatever_their_length() {
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
fn a_self_test_of_3_0_is_read_for_ever_and_whatever_its_length() {
    let row = |name, value, limits, verdict| TestRow {
        name,
        value,
        unit: "V",
        limits,
        verdict,
    };
    let expected = [
        row("gyro x, ST1", -0.25, [-0.5, -0.125], Verdict::Passed),
        row("accel x, null", 1.625, [1.5, 1.75], Verdict::NotShown),
        row("supply", 3.0, [3.125, 3.5], Verdict::Failed),
    ];
    for hex in [SELF_TEST, SELF_TEST_LONGER] {
        read(hex, |message| {
            let Message::Reply {
                id: 7,
                reply: Reply::SelfTest(test),
            } = message
            else {
                panic!("{message:?}");
            };
            assert!(test.is_whole());
            assert_eq!(test.rows().collect::<Vec<_>>(), expected);
        });
    }
    // Rows that are cut off are not all of a table.
    let cut = SelfTest { rows: &[3, b'a'] };
    assert_eq!((cut.rows().count(), cut.is_whole()), (0, false));
}

#[test]
fn a_refusal_for_an_unknown_reason_is_a_refusal() {
    let refusal = Refusal::NotKnown;
    let expected = Message::Refused { id: 7, refusal };
    read(UNKNOWN_REFUSAL, |message| assert_eq!(*message, expected));
}

/// A compensated batch may end with its samples, and a later version may append.
#[test]
fn a_compensated_batch_is_read_whatever_follows_its_samples() {
    let sample = [0x40_u8; 24];
    let before = [
        // First sample 5 at 3 µs, every 4 ns; none lost.
        &[3, 1, 5, 3, 4, 0, 0][..],
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
