//! The path of the samples, against arithmetic written out here.

extern crate std;
use std::vec::Vec;

use mimu_core::compensation::{Affine, Compensation};
use mimu_core::effects::Sensor;
use mimu_core::stored::{self, Record};
use mimu_core::table::Node;
use mimu_core::wire::Prior;
use nalgebra::Matrix3;

use super::*;
use crate::convert::NOMINAL_REFERENCE;

/// What was sent, as far as the tests ask.
#[derive(Debug, PartialEq)]
enum Sent {
    Raw(BatchHead, f32, Vec<(u32, Sums)>),
    Compensated(BatchHead, Vec<(u32, Sample<f32>)>),
    Kalman(u32),
}

fn keep(message: &Message<'_>) -> Sent {
    match message {
        Message::Event(Event::Raw(batch)) => {
            assert!(batch.is_whole());
            Sent::Raw(batch.head, batch.gyro_volts, batch.sums().collect())
        }
        Message::Event(Event::Compensated(batch)) => {
            assert!(batch.is_whole());
            Sent::Compensated(batch.head, batch.values().collect())
        }
        Message::Event(Event::Kalman(state)) => Sent::Kalman(state.updates),
        other => panic!("{other:?}"),
    }
}

/// A sample at 25 °C whose gyros and accelerometers differ by number and axis.
fn sums(number: u32) -> Channels<u32> {
    let reference = NOMINAL_REFERENCE.round() as u32;
    Channels {
        gyro: [0, 1, 2].map(|axis| 50_000 + 100 * axis + number % 7),
        accel: [0, 1, 2].map(|axis| 60_000 + 300 * axis + number % 5),
        temperature: [reference; 3],
        reference,
    }
}

fn run(pipeline: &mut Pipeline, numbers: impl IntoIterator<Item = u32>) -> Vec<Sent> {
    let mut all = Vec::new();
    for number in numbers {
        pipeline.take(number, &sums(number), &mut |message| {
            all.push(keep(message));
            true
        });
    }
    all
}

fn both() -> Streams {
    Streams {
        raw: true,
        compensated: true,
    }
}

/// Compensation that doubles from -10 °C to 60 °C, where 25 °C is in the middle.
fn calibration(effects: &[Record<'_>]) -> Stored {
    let node = |temp_c, gain: f32| {
        let affine = Affine {
            matrix: Matrix3::from_diagonal_element(gain),
            offset: Vector3::repeat(-gain),
        };
        Node {
            temp_c,
            model: Compensation {
                gyro: affine,
                accel: affine,
            },
        }
    };
    let mut bytes = [0; stored::MAX_LENGTH];
    let one = Matrix3::identity();
    let nodes = [node(-10.0, 2.0), node(60.0, 4.0)];
    let length = stored::encode(
        &stored::Origin::UNKNOWN,
        [&one, &one],
        &nodes,
        effects,
        &mut bytes,
    )
    .unwrap();
    stored::decode(&bytes[..length]).unwrap()
}

#[test]
fn nothing_is_sent_unasked_and_what_is_asked_begins_with_a_batch() {
    let mut pipeline = Pipeline::new();
    assert_eq!(run(&mut pipeline, 0..25), []);
    pipeline.stream(Streams {
        raw: true,
        compensated: false,
    });
    let sent = run(&mut pipeline, 25..65);
    let [Sent::Raw(head, volts, samples)] = &sent[..] else {
        panic!("{sent:?}")
    };
    assert_eq!((head.first, head.flags, samples.len()), (40, 0, BATCH));
    for (k, (number, six)) in samples.iter().enumerate() {
        let of = sums(40 + k as u32);
        assert_eq!((*number, six.gyro), (40 + k as u32, of.gyro));
        assert_eq!(six.accel, of.accel);
    }
    assert!((head.temp_c - 25.0).abs() < 1e-3);
    assert!((volts * NOMINAL_REFERENCE - 2.5).abs() < 1e-4);
}

#[test]
fn a_gap_ends_the_batch_and_is_counted() {
    let mut pipeline = Pipeline::new();
    pipeline.stream(Streams {
        raw: true,
        compensated: false,
    });
    let sent = run(&mut pipeline, (100..107).chain(110..140));
    let batches: Vec<_> = sent
        .iter()
        .map(|sent| match sent {
            Sent::Raw(head, _, samples) => (head.first, head.samples_lost, samples.len()),
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(batches, [(100, 0, 7), (110, 3, 20)]);
    assert_eq!(pipeline.losses().samples, 3);
}

#[test]
fn batches_without_room_are_counted_and_the_next_says_so() {
    let mut pipeline = Pipeline::new();
    pipeline.calibrate(calibration(&[]));
    pipeline.stream(both());
    for number in 0..40 {
        pipeline.take(number, &sums(number), &mut |_| false);
    }
    assert_eq!(pipeline.losses().batches, 4);
    let sent = run(&mut pipeline, 40..60);
    let Sent::Raw(head, ..) = &sent[0] else {
        panic!("{sent:?}")
    };
    // The head was written when the batch began.
    assert_eq!((head.samples_lost, head.batches_dropped), (0, 4));
}

#[test]
fn compensated_samples_are_those_of_the_raw_ones_at_the_stated_temperature() {
    let mut pipeline = Pipeline::new();
    pipeline.calibrate(calibration(&[]));
    pipeline.stream(both());
    let sent = run(&mut pipeline, 0..20);
    let [
        Sent::Raw(head, volts, raw),
        Sent::Compensated(same, compensated),
    ] = &sent[..]
    else {
        panic!("{sent:?}")
    };
    assert_eq!(head, same);
    // Between gains of 2 at -10 °C and 4 at 60 °C.
    let gain = 2.0 + 2.0 * (f64::from(head.temp_c) + 10.0) / 70.0;
    for ((number, six), (same, value)) in raw.iter().zip(compensated) {
        assert_eq!(number, same);
        for axis in 0..3 {
            let gyro = f64::from(six.gyro[axis]) * f64::from(*volts);
            let accel = f64::from(six.accel[axis]) * 3.3 / 131_070.0;
            assert!((f64::from(value.gyro[axis]) - gain * (gyro - 1.0)).abs() < 1e-5);
            assert!((f64::from(value.accel[axis]) - gain * (accel - 1.0)).abs() < 1e-5);
        }
    }
}

#[test]
fn errors_of_the_code_are_taken_out_of_the_reading_before_its_temperature_matters() {
    // Bits of half of 3.3 V and of an eighth are worth more than they say, at any temperature and on all axes of the triad alike.
    let weight = 1.65;
    let (half, eighth) = (2e-4, -1e-4);
    let mut errors = [0.0; 9];
    (errors[0], errors[2]) = (half as f32, eighth as f32);
    let code = Record::Code {
        sensor: Sensor::Accel,
        axis: None,
        weight: weight as f32,
        zero: 0.0,
        errors: &errors,
    };
    let mut pipeline = Pipeline::new();
    pipeline.calibrate(calibration(&[code]));
    pipeline.stream(both());
    let (mut seen, mut number) = ([false; 4], 0);
    while number < 400 {
        let mut sums = sums(number);
        for axis in 0..3 {
            // Over the whole range, in steps of none of the bits.
            sums.accel[axis] = 1000 + (number * 317 + axis as u32 * 41_003) % 129_000;
        }
        pipeline.take(number, &sums, &mut |message| {
            let Sent::Compensated(head, samples) = keep(message) else {
                return true;
            };
            let gain = 2.0 + 2.0 * (f64::from(head.temp_c) + 10.0) / 70.0;
            for (of, value) in samples {
                for axis in 0..3 {
                    let sum = 1000 + (of * 317 + axis as u32 * 41_003) % 129_000;
                    let read = f64::from(sum) * 3.3 / 131_070.0;
                    let set = |bit: f64| (read / bit).floor() as u32 % 2 == 1;
                    let bits = (set(weight), set(weight / 4.0));
                    // Within the error of a turn a reading may stand for either side of it.
                    let turn = (read / (weight / 4.0)).round() * weight / 4.0;
                    if (read - turn).abs() < 5e-4 {
                        continue;
                    }
                    seen[usize::from(bits.0) + 2 * usize::from(bits.1)] = true;
                    let off =
                        f64::from(u8::from(bits.0)) * half + f64::from(u8::from(bits.1)) * eighth;
                    let expected = gain * (read - weight * off - 1.0);
                    // The step of a bit is 5e-4 at the least.
                    let left = f64::from(value.accel[axis]) - expected;
                    assert!(left.abs() < 2e-5, "{of} {axis}: {left:e}");
                }
            }
            true
        });
        number += 1;
    }
    assert_eq!(seen, [true; 4]);
}

#[test]
fn saturation_and_flags_of_others_are_in_the_batch_that_has_them() {
    let mut pipeline = Pipeline::new();
    pipeline.stream(Streams {
        raw: true,
        compensated: false,
    });
    let mut flags_of = Vec::new();
    for number in 0..60 {
        let mut sums = sums(number);
        if number == 25 {
            sums.accel[0] = SUM_FULL_SCALE;
        }
        pipeline.flag(flags::SELF_TEST, (45..50).contains(&number));
        pipeline.take(number, &sums, &mut |message| {
            if let Sent::Raw(head, ..) = keep(message) {
                flags_of.push(head.flags);
            }
            true
        });
    }
    assert_eq!(flags_of, [0, flags::SATURATED, flags::SELF_TEST]);
}

#[test]
fn a_bank_reports_five_times_a_second_and_takes_only_what_is_known() {
    let mut pipeline = Pipeline::new();
    let bank = Bank::new(Triad::Gyro, [1e-6; 3], Prior::Diffuse { span: 1.0 });
    pipeline.banks[0] = bank;
    let sent = run(&mut pipeline, 0..500);
    assert_eq!(sent, [Sent::Kalman(0), Sent::Kalman(0)]);
    let bank = pipeline.banks[0].as_mut().unwrap();
    assert!(!bank.set_input(Some([f32::NAN, 0.0, 0.0])));
    assert!(bank.set_input(Some([0.0; 3])));
    run(&mut pipeline, 503..1000);
    let state = pipeline.banks[0].as_ref().unwrap().state();
    assert_eq!((state.updates, state.skipped), (497, 503));
    // The mean of the readings, about which the bias is to be.
    let mean: f64 = (503..1000)
        .map(|k| f64::from(sums(k).gyro[0]) * 2.5 / f64::from(NOMINAL_REFERENCE.round()))
        .sum::<f64>()
        / 497.0;
    assert!((f64::from(state.axes[0].mean[0]) - mean).abs() < 1e-6);
    let sigma2 = f64::from(state.axes[0].covariance[0]);
    assert!((sigma2 * 497.0 / 1e-6 - 1.0).abs() < 1e-3);
}
