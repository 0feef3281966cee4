//! The bytes of every message, written by hand from the specification of postcard: a variant is its number; integers above 127 are varints; `f32` are
//! little-endian (1.0 is `0000803f`, -2.0 is `000000c0`, 0.5 is `0000003f`); text is preceded by its length.

use mimu_core::stored;
use mimu_core::wire::{
    BatchHead, Call, Capabilities, CompensatedBatch, Counters, Counts, Event, Frame, Greeting,
    KalmanAxis, KalmanState, MAGIC, Message, Prior, RawBatch, Refusal, Reply, Request, Slot, Start,
    StoredInfo, TestRow, TestTable, Triad, Version, WrongRegister, flags,
};
use mimu_core::{PerSensor, Sensor};
use serde::{Deserialize, Serialize};

pub fn hex(text: &str) -> Vec<u8> {
    let digits: Vec<u8> = text
        .chars()
        .filter(|c| !c.is_whitespace())
        .map(|c| c.to_digit(16).unwrap() as u8)
        .collect();
    assert!(digits.len().is_multiple_of(2), "{text}");
    digits.chunks(2).map(|d| d[0] << 4 | d[1]).collect()
}

/// Checks both directions.
#[track_caller]
fn frozen<'a, T>(message: T, bytes: &'a [u8])
where
    T: Serialize + Deserialize<'a> + PartialEq + std::fmt::Debug,
{
    let mut room = [0; 528];
    let written = postcard::to_slice(&message, &mut room).unwrap();
    assert_eq!(written, bytes, "{message:?}");
    let (read, rest) = postcard::take_from_bytes::<T>(bytes).unwrap();
    assert_eq!(read, message);
    assert!(rest.is_empty());
}

#[track_caller]
fn request(request: Request<'_>, text: &str) {
    // 300 is 2 * 128 + 44: ac 02.
    let bytes = hex(&format!("ac02 {text}"));
    let mut room = [0; 528];
    let call = Call { id: 300, request };
    assert_eq!(postcard::to_slice(&call, &mut room).unwrap(), bytes);
    assert_eq!(postcard::from_bytes::<Call<'_>>(&bytes).unwrap(), call);
}

#[test]
fn requests() {
    request(Request::Hello, "00");
    let (raw, compensated) = (true, false);
    request(Request::Stream { raw, compensated }, "01 01 00");
    request(Request::Stop, "02");
    request(Request::Counters, "03");
    request(Request::ResetCounters, "04");
    request(Request::SelfTest, "05");
    let (length, hash) = (1000, 128);
    for (other_unit, bytes) in [(false, "00"), (true, "01")] {
        let begin = Request::UploadBegin {
            length,
            hash,
            other_unit,
        };
        request(begin, &format!("06 e807 8001 {bytes}"));
    }
    let (offset, bytes) = (256, &[7, 0, 255][..]);
    request(Request::UploadChunk { offset, bytes }, "07 8002 03 0700ff");
    request(Request::UploadCommit, "08");
    let (offset, length) = (0, 256);
    request(Request::Download { offset, length }, "09 00 8002");
    let noise = [1.0, -2.0, 0.5];
    request(
        Request::KalmanStart {
            sensor: Sensor::Gyro,
            noise,
            prior: Prior::Diffuse { span: 1.0 },
        },
        "0a 00 0000803f 000000c0 0000003f 00 0000803f",
    );
    let row = "0000803f 000000c0 0000003f 00000000";
    request(
        Request::KalmanStart {
            sensor: Sensor::Accel,
            noise,
            prior: Prior::Known {
                mean: [[1.0, -2.0, 0.5, 0.0]; 3],
                variance: [[0.5; 4]; 3],
            },
        },
        &format!(
            "0a 01 0000803f 000000c0 0000003f 01 {} {}",
            row.repeat(3),
            "0000003f".repeat(12)
        ),
    );
    request(
        Request::KalmanInput {
            sensor: Sensor::Accel,
            input: Some([1.0, -2.0, 0.5]),
        },
        "0b 01 01 0000803f 000000c0 0000003f",
    );
    request(
        Request::KalmanInput {
            sensor: Sensor::Gyro,
            input: None,
        },
        "0b 00 00",
    );
    let sensor = Sensor::Gyro;
    request(Request::KalmanEnd { sensor }, "0c 00");
    request(Request::KalmanKeep { sensor }, "0d 00");
    request(Request::KalmanBack { sensor }, "0e 00");
}

fn greeting<'a>(start: Start<'a>, stored: Option<StoredInfo>, slots: [Slot; 2]) -> Message<'a> {
    Message::Greeting {
        id: 1,
        greeting: Greeting {
            magic: MAGIC,
            protocol: Version { major: 3, minor: 2 },
            firmware: "0.1.0",
            board: "B",
            unit_id: [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12],
            capabilities: Capabilities(31),
            effects: 0xf_ffff,
            effects_room: 8,
            nodes_room: 16,
            stored_room: 4096,
            triads: PerSensor {
                gyro: Triad {
                    part: "G",
                    unit: "count",
                    bits: 19,
                    range: 0.5,
                    null: -2.0,
                    per_si: 1.0,
                    rate_hz: 1000.0,
                    filter: "F",
                },
                accel: Triad::default(),
            },
            thermometers: "die",
            start,
            starts: 3,
            stored,
            slots,
            powered_for_ms: Some(300),
            brown_out_level: Some(2),
            banks_swapped: true,
            wrong_register: Some(WrongRegister {
                register: 0x75,
                identifies: true,
                found: 0,
                expected: 0x47,
            }),
            nominal_hz: 1000.0,
            rate_measured: true,
        },
    }
}

/// The gyro, an accelerometer of which nothing is known, and the thermometers. 0x447a0000 is 1000.0.
const SENSORS: &str = "01 47 05 636f756e74 13 0000003f 000000c0 0000803f 00007a44 01 46 \
                       00 00 00 00000000 00000000 00000000 00000000 00 03 646965";

/// A greeting up to the sensors. 0xfffff in groups of seven bits is 7f 7f 3f; 4096 is 32 * 128.
const BEFORE: &str = "00 01 6d696d75 03 02 05 302e312e30 01 42 0102030405060708090a0b0c \
                      1f ffff3f 08 10 8020";

#[test]
fn greetings() {
    let none = [Slot::Empty; 2];
    for (start, bytes) in [
        (Start::PowerOn, "01 00"),
        (Start::ResetPin, "01 01"),
        (Start::Watchdog, "01 02"),
        (Start::Software, "01 03"),
        (
            Start::Panic {
                file: "a.rs",
                line: 300,
            },
            "08 04 04 612e7273 ac02",
        ),
        (Start::Fault { pc: 128, cfsr: 1 }, "04 05 8001 01"),
        (Start::Other, "01 06"),
    ] {
        let bytes = hex(&format!(
            "{BEFORE} {SENSORS} {bytes} 03 00 0100 0100 01 ac02 01 02 01 01 75 01 00 47 00007a44 01"
        ));
        frozen(greeting(start, None, none), &bytes);
    }
    let stored = StoredInfo {
        length: 300,
        hash: u64::MAX,
        nodes: 5,
        effects: 2,
        unit_id: [0xab; 12],
        created_s: 300,
    };
    for (slot, bytes) in [
        (Slot::Empty, "01 00"),
        (Slot::Whole { generation: 128 }, "03 01 8001"),
        (Slot::Unfinished, "01 02"),
        (Slot::Damaged, "01 03"),
        (Slot::NotUsable(stored::StoredError::Check), "02 04 03"),
    ] {
        let bytes = hex(&format!(
            "{BEFORE} {SENSORS} 01 00 03 01 ac02 ffffffffffffffffff01 05 02 {} ac02 {bytes} 01 00 01 ac02 01 02 01 01 75 01 00 47 00007a44 01",
            "ab".repeat(12)
        ));
        frozen(
            greeting(Start::PowerOn, Some(stored), [slot, Slot::Empty]),
            &bytes,
        );
    }
}

#[test]
fn replies() {
    let reply = |reply| Message::Reply { id: 2, reply };
    frozen(reply(Reply::Done), &hex("01 02 00"));
    let counters = Counters {
        uptime_ms: 1,
        samples: 2,
        last: 3,
        late: 4,
        converter_overruns: 5,
        stalls: 6,
        queue_overruns: 7,
        batches_dropped: 8,
        frames_garbled: 9,
        receiver_overruns: 10,
        refused: 11,
        flash_corrected: 12,
        flash_uncorrectable: 13,
        longest_us: 300,
    };
    frozen(
        reply(Reply::Counters(counters)),
        &hex("01 02 01 01 02 03 04 05 06 07 08 09 0a 0b 0c 0d ac02"),
    );
    let mut table = TestTable::new();
    let within = TestRow::within("G", 0.5, "V", [-2.0, 1.0]);
    assert!(table.push(&within));
    assert!(table.push(&TestRow::within("A", f32::NAN, "", [0.0; 2])));
    frozen(
        reply(Reply::SelfTest(table.result())),
        &hex(
            "01 02 02 21 01 47 0000003f 01 56 000000c0 0000803f 00 01 41 0000c07f 00 00000000 00000000 01",
        ),
    );
    frozen(
        reply(Reply::Stored {
            offset: 256,
            length: 300,
            bytes: &[1, 0],
        }),
        &hex("01 02 03 8002 ac02 02 0100"),
    );
    frozen(
        reply(Reply::Kalman(kalman())),
        &hex(&format!("01 02 04 {KALMAN} {}", axis().repeat(3))),
    );
}

/// A state up to the axes.
const KALMAN: &str = "01 ac02 8001 02 03";

fn kalman() -> KalmanState {
    let axis = KalmanAxis {
        mean: [1.0, -2.0, 0.5, 0.0],
        covariance: [0.5; 10],
    };
    KalmanState {
        sensor: Sensor::Accel,
        last: 300,
        updates: 128,
        rejected: 2,
        skipped: 3,
        axes: [axis; 3],
    }
}

fn axis() -> String {
    format!(
        "0000803f 000000c0 0000003f 00000000 {}",
        "0000003f".repeat(10)
    )
}

#[test]
fn refusals() {
    #[rustfmt::skip]
    let cases = [
        (Refusal::Unknown, "00"),
        (Refusal::NoCalibration, "01"),
        (Refusal::NoUpload, "02"),
        (Refusal::TooLong { room: 4096 }, "03 8020"),
        (Refusal::WrongOffset { expected: 300 }, "04 ac02"),
        (Refusal::Incomplete { received: 5 }, "05 05"),
        (Refusal::WrongHash { found: 128 }, "06 8001"),
        (Refusal::NotUsable(stored::StoredError::NotACalibration), "07 00"),
        (Refusal::NotUsable(stored::StoredError::Length), "07 01"),
        (Refusal::NotUsable(stored::StoredError::Version { found: 300 }), "07 02 ac02"),
        (Refusal::NotUsable(stored::StoredError::Check), "07 03"),
        (Refusal::NotUsable(stored::StoredError::Node { at: 200 }), "07 04 c8"),
        (Refusal::NotUsable(stored::StoredError::Singular), "07 05"),
        (Refusal::NotUsable(stored::StoredError::EffectUnknown { at: 1 }), "07 06 01"),
        (Refusal::NotUsable(stored::StoredError::EffectValue { at: 2 }), "07 07 02"),
        (Refusal::NotUsable(stored::StoredError::EffectsFull { at: 3 }), "07 08 03"),
        (Refusal::FlashFailed, "08"),
        (Refusal::NoBank, "09"),
        (Refusal::BadNumber, "0a"),
        (Refusal::Busy, "0b"),
        (
            Refusal::OtherUnit {
                unit_id: [0xab; 12],
            },
            "0c abababababababababababab",
        ),
        (Refusal::SupplyLow, "0d"),
        (Refusal::BanksSwapped, "0e"),
    ];
    for (refusal, bytes) in cases {
        let bytes = hex(&format!("02 03 {bytes}"));
        frozen(Message::Refused { id: 3, refusal }, &bytes);
    }
}

#[test]
fn events() {
    let head = BatchHead {
        first: 300,
        tick_us: 300_000,
        period_ns: 1_000_000,
        samples_lost: 1,
        batches_dropped: 128,
        temp_c: 0.5,
        flags: flags::SELF_TEST | flags::POWER_ON_UNKNOWN,
    };
    let samples = &[1, 2, 3][..];
    // 300000 in groups of seven bits is e0 a7 12, a million c0 84 3d.
    const HEAD: &str = "ac02 e0a712 c0843d 01 8001 0000003f 8204";
    frozen(
        Message::Event(Event::Raw(RawBatch {
            head,
            scale: PerSensor {
                gyro: 1.0,
                accel: -2.0,
            },
            temperatures: &[0, 0, 0, 0x3f],
            samples,
        })),
        &hex(&format!(
            "03 00 {HEAD} 0000803f 000000c0 04 0000003f 03 010203"
        )),
    );
    // The last field is omitted if it is empty.
    let compensated = Message::Event(Event::Compensated(CompensatedBatch {
        head,
        samples,
        accel_die_c: None,
    }));
    let bytes = hex(&format!("03 01 {HEAD} 03 010203"));
    let mut room = [0; 528];
    assert_eq!(postcard::to_slice(&compensated, &mut room).unwrap(), bytes);
    assert_eq!(Frame(&bytes).message(), Some(compensated));
    frozen(
        Message::Event(Event::Compensated(CompensatedBatch {
            head,
            samples,
            accel_die_c: Some(-2.0),
        })),
        &hex(&format!("03 01 {HEAD} 03 010203 01 000000c0")),
    );
    frozen(
        Message::Event(Event::Kalman(kalman())),
        &hex(&format!("03 02 {KALMAN} {}", axis().repeat(3))),
    );
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
