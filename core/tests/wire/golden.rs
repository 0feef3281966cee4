//! The bytes of every message, which must never change, and what they mean: `messages.txt`.

use mimu_core::PerSensor;
use mimu_core::wire::{
    BatchHead, Call, Compatibility, CompensatedBatch, Counts, Decoder, EFFECTS, Frame, MAX_PAYLOAD,
    Message, RawBatch, Reply, SelfTest, compatibility,
};

fn hex(text: &str) -> Vec<u8> {
    let digits: Vec<u8> = text
        .chars()
        .filter(|c| !c.is_whitespace())
        .map(|c| c.to_digit(16).unwrap() as u8)
        .collect();
    assert!(digits.len().is_multiple_of(2), "{text}");
    digits.chunks(2).map(|d| d[0] << 4 | d[1]).collect()
}

fn told(message: &Message<'_>) -> String {
    match message {
        Message::Reply {
            reply: Reply::SelfTest(test),
            ..
        } if test.is_whole() => format!("{:?}", test.rows().collect::<Vec<_>>()),
        Message::Greeting { greeting, .. } => {
            let found = compatibility(greeting);
            let usable = Compatibility::DeviceOlder { usable: true };
            assert!(
                found == Compatibility::Same || found == usable,
                "{found:?} asks for an update"
            );
            format!("{message:?}")
        }
        _ => format!("{message:?}"),
    }
}

/// The payload of a frame.
fn unframed(frame: &[u8]) -> Vec<u8> {
    let mut decoder = Decoder::new();
    let (last, before) = frame.split_last().unwrap();
    assert!(before.iter().all(|byte| decoder.push(*byte).is_none()));
    decoder.push(*last).expect("a whole frame").0.to_vec()
}

#[test]
fn every_message_has_the_bytes_and_the_meaning_of_the_table() {
    let lines = include_str!("messages.txt").lines();
    let mut different = Vec::new();
    for line in lines.filter(|line| !line.is_empty() && !line.starts_with('#')) {
        let (head, expected) = line.split_once(" = ").unwrap();
        let (kind, digits) = head.split_once(' ').unwrap();
        let bytes = hex(digits);
        let mut room = [0; MAX_PAYLOAD];
        let (read, written) = match kind {
            "call" => {
                let call: Call<'_> = postcard::from_bytes(&bytes).unwrap();
                (
                    format!("{call:?}"),
                    postcard::to_slice(&call, &mut room).unwrap().to_vec(),
                )
            }
            "message" => {
                let message = Frame(&bytes).message().expect(digits);
                (
                    told(&message),
                    postcard::to_slice(&message, &mut room).unwrap().to_vec(),
                )
            }
            // Of another version, it may be written otherwise.
            _ => (
                told(&Frame(&unframed(&bytes)).message().expect(digits)),
                bytes.clone(),
            ),
        };
        if read != expected || written != bytes {
            different.push(format!("{kind} {digits} = {read}"));
        }
    }
    assert!(different.is_empty(), "{}", different.join("\n"));
    assert_eq!(
        EFFECTS[18], "gyro_g_squared",
        "the last bit of the greeting of 3.0"
    );
}

/// A compensated batch may end with its samples, and a later version may append; others are whole or none.
#[test]
fn what_is_cut_is_no_message() {
    // A compensated batch within its samples; `Done` for call 7 with an additional byte, and cut; a greeting.
    let batch = [&[3, 1, 5, 3, 4, 0, 0, 0, 0, 200, 65, 0, 24][..], &[0x40; 7]].concat();
    for payload in [&batch[..], &[1, 7, 0, 9], &[1, 7], &[0], &[0, 7, b'n']] {
        assert_eq!(Frame(payload).message(), None);
    }
    let cut = SelfTest { rows: &[3, b'a'] };
    assert_eq!((cut.rows().count(), cut.is_whole()), (0, false));
}

#[test]
fn samples_of_a_batch() {
    // 131070 = 2 * 65535 is 01fffe; -1 is ffffff, the most negative number of 24 bits 800000.
    let counts = Counts {
        gyro: [-1, 0x7f_ffff, -0x80_0000],
        accel: [-300_000, 131_070, 1],
    };
    let sevens = Counts {
        gyro: [7; 3],
        accel: [7; 3],
    };
    let bytes = RawBatch::pack(&counts);
    assert_eq!(
        bytes.to_vec(),
        hex("ffffff ffff7f 000080 206cfb feff01 010000")
    );
    let two = [bytes, RawBatch::pack(&sevens)].concat();
    let batch = RawBatch {
        head: BatchHead {
            first: u32::MAX,
            tick_us: 5_000_000,
            period_ns: 1_030_000,
            samples_lost: 0,
            batches_dropped: 0,
            temp_c: 25.0,
            flags: 0,
        },
        scale: PerSensor {
            gyro: 0.25,
            accel: 0.5,
        },
        temperatures: &[0, 0, 0, 0x3f],
        samples: &two,
    };
    assert!(batch.is_whole());
    let read: Vec<_> = batch.counts().collect();
    assert_eq!(read, [(u32::MAX, counts), (0, sevens)]);
    let (number, reading) = batch.readings().nth(1).unwrap();
    assert_eq!((number, reading.gyro.y, reading.accel.z), (0, 1.75, 3.5));
    assert_eq!(batch.readings().next().unwrap().1.accel.x, -150_000.0);
    assert_eq!(batch.temperatures_c().collect::<Vec<_>>(), [0.5]);
    let times: Vec<u64> = batch.head.times_ns().take(2).collect();
    assert_eq!(times, [5_000_000_000, 5_001_030_000]);
    assert_eq!(batch.head.since_s(4_980_000), 0.02);
    assert!((batch.head.rate_hz() - 970.873_786_4).abs() < 1e-6);
    // Power-on was before sampling began.
    assert_eq!(batch.head.since_s(0_u64.wrapping_sub(1_000_000)), 6.0);

    let bytes = CompensatedBatch::pack(&mimu_core::compensation::Sample {
        gyro: [1.0, -2.0, 0.5].into(),
        accel: [0.0, 0.0, 1.0].into(),
    });
    assert_eq!(
        bytes.to_vec(),
        hex("0000803f 000000c0 0000003f 00000000 00000000 0000803f")
    );
    let head = batch.head;
    let batch = CompensatedBatch {
        head,
        samples: &bytes,
        accel_die_c: None,
    };
    assert!(batch.is_whole());
    let read: Vec<_> = batch.values().collect();
    assert_eq!(read.len(), 1);
    assert_eq!(read[0].1.gyro.y, -2.0);
    assert_eq!(read[0].1.accel.z, 1.0);
}
