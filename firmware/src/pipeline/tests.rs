//! The path of the samples, against arithmetic written out here.

extern crate std;
use std::vec::Vec;

use mimu_core::Sensor;
use mimu_core::compensation::{Affine, Compensation};
use mimu_core::effects::DeviceEffect;
use mimu_core::stored::{self, Curves};
use mimu_core::table::Node;
use mimu_core::wire::{Counts, Prior};
use nalgebra::Matrix3;

mod exchange;
mod temperature;

use super::*;
use crate::channels::Channels;
use crate::convert::{Analog, NOMINAL_REFERENCE, scan};

/// What was sent, as far as the tests ask.
#[derive(Debug, PartialEq)]
enum Sent {
    Raw(BatchHead, f32, Vec<(u32, Counts)>),
    Compensated(BatchHead, Vec<(u32, Sample<f32>)>, PerSensor<f32>),
    Kalman(u32),
}

fn keep(message: &Message<'_>) -> Sent {
    match message {
        Message::Event(Event::Raw(batch)) => {
            assert!(batch.is_whole());
            Sent::Raw(batch.head, batch.scale.gyro, batch.counts().collect())
        }
        Message::Event(Event::Compensated(batch)) => {
            assert!(batch.is_whole());
            Sent::Compensated(batch.head, batch.values().collect(), batch.dies_c())
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

fn run(pipeline: &mut Pipeline<Analog>, numbers: impl IntoIterator<Item = u32>) -> Vec<Sent> {
    let mut all = Vec::new();
    for number in numbers {
        pipeline.take(&scan(number.into(), &sums(number)), &mut |message| {
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
fn calibration(effects: &[DeviceEffect<f32>]) -> Stored {
    with_lags(effects, None)
}

/// The same of dies that follow with these lags, of gyro and accelerometer, found between 0 and 50 °C.
fn with_lags(effects: &[DeviceEffect<f32>], lags_s: Option<PerSensor<f32>>) -> Stored {
    times(1.0, effects, lags_s)
}

/// The same, this many times as large.
fn times(times: f32, effects: &[DeviceEffect<f32>], lags_s: Option<PerSensor<f32>>) -> Stored {
    let node = |temp_c, gain: f32| {
        let affine = Affine {
            matrix: Matrix3::from_diagonal_element(times * gain),
            offset: Vector3::repeat(-times * gain),
        };
        let model = Compensation {
            gyro: affine,
            accel: affine,
        };
        let slope = Affine {
            matrix: Matrix3::from_diagonal_element(times * 2.0 / 70.0),
            offset: Vector3::repeat(-times * 2.0 / 70.0),
        };
        Node {
            temp_c,
            model,
            slope: Compensation {
                gyro: slope,
                accel: slope,
            },
        }
    };
    let mut bytes = [0; stored::MAX_LENGTH];
    let one = Matrix3::identity();
    let nodes = [node(-10.0, 2.0), node(60.0, 4.0)];
    let length = stored::encode(
        &stored::Origin::UNKNOWN,
        PerSensor::both(&one),
        &Curves {
            range_c: Some([0.0, 50.0]),
            lags_s,
            ..Curves::of(&nodes)
        },
        effects,
        &mut bytes,
    )
    .unwrap();
    stored::decode(&bytes[..length]).unwrap()
}

#[test]
fn nothing_is_sent_unasked_and_what_is_asked_begins_with_a_batch() {
    let mut pipeline = Pipeline::<Analog>::new(&FrontEnd::default());
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
        let of = [of.gyro, of.accel].map(|sums| sums.map(|sum| sum as i32));
        assert_eq!((*number, [six.gyro, six.accel]), (40 + k as u32, of));
    }
    assert!((head.temp_c - 25.0).abs() < 1e-3);
    assert!((volts * NOMINAL_REFERENCE - 2.5).abs() < 1e-4);
}

#[test]
fn a_gap_ends_the_batch_and_is_counted() {
    let mut pipeline = Pipeline::<Analog>::new(&FrontEnd::default());
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
fn compensated_samples_are_those_of_the_raw_ones_at_the_stated_temperature() {
    let mut pipeline = Pipeline::<Analog>::new(&FrontEnd::default());
    pipeline.calibrate(calibration(&[]));
    pipeline.stream(both());
    let sent = run(&mut pipeline, 0..20);
    let [
        Sent::Raw(head, volts, raw),
        Sent::Compensated(same, compensated, _),
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

/// Heads of all batches of a stream in which `change` has its way with each sample.
fn heads(
    pipeline: &mut Pipeline<Analog>,
    numbers: core::ops::Range<u32>,
    mut change: impl FnMut(u32, &mut Channels<u32>),
) -> Vec<BatchHead> {
    let mut heads = Vec::new();
    for number in numbers {
        let mut sums = sums(number);
        change(number, &mut sums);
        pipeline.take(&scan(number.into(), &sums), &mut |message| {
            match keep(message) {
                Sent::Raw(head, ..) | Sent::Compensated(head, ..) => heads.push(head),
                Sent::Kalman(_) => {}
            }
            true
        });
    }
    heads
}

/// The outputs end 0.25 V from the sensors' own supplies, 5 and 3.3 V, which the converter reads as anything but its ends.
#[test]
fn a_sensor_at_its_own_stop_saturates_both_streams() {
    // 24 and 36 kilohms in front of two conversions of 65535 steps of 3.3 V.
    let gyro = |v: f64| (v * 0.6 / 3.3 * 131_070.0).round() as u32;
    let accel = |v: f64| (v / 3.3 * 131_070.0).round() as u32;
    for (gyro_v, accel_v, saturates) in [
        (4.75, 1.65, true),
        (0.25, 1.65, true),
        // With one-percent resistors in both dividers.
        (4.75 * 0.985, 1.65, true),
        (2.5, 0.25, true),
        (2.5, 3.05, true),
        // The largest rate and force that the parts are made for: 300 deg/s of 5.4 mV at a null of 2.7 V, 1.5 g at 1.65 V.
        (4.32, 2.85, false),
        (0.68, 0.45, false),
    ] {
        for axis in 0..3 {
            let mut pipeline = Pipeline::<Analog>::new(&FrontEnd::default());
            pipeline.calibrate(calibration(&[]));
            pipeline.stream(both());
            let heads = heads(&mut pipeline, 0..60, |number, sums| {
                if number == 25 {
                    sums.gyro[axis] = gyro(gyro_v);
                    sums.accel[axis] = accel(accel_v);
                }
            });
            let flags_of: Vec<u16> = heads.iter().map(|head| head.flags).collect();
            let flag = if saturates { flags::SATURATED } else { 0 };
            assert_eq!(flags_of, [0, 0, flag, flag, 0, 0], "{gyro_v} {accel_v}");
        }
    }
}

#[test]
fn an_open_temperature_pin_is_flagged_and_compensation_goes_by_the_two_others() {
    let mut pipeline = Pipeline::<Analog>::new(&FrontEnd::default());
    pipeline.calibrate(calibration(&[]));
    pipeline.stream(both());
    let heads = heads(&mut pipeline, 0..200, |number, sums| {
        if number >= 40 {
            sums.temperature[1] = 0;
        }
    });
    for head in heads {
        // The batch after the first that has it open.
        let flag = match head.first {
            0..=40 => 0,
            _ => flags::TEMPERATURE_LEFT_OUT[1],
        };
        assert_eq!(head.flags, flag, "{}", head.first);
        assert!((head.temp_c - 25.0).abs() < 0.01, "{}", head.temp_c);
    }
}

#[test]
fn a_warm_up_goes_by_the_time_since_power_on_and_is_over_where_that_is_unknown() {
    let coefficients = [0.5, -0.3, 0.2];
    let warm_up = DeviceEffect::named("gyro_warm_up", &coefficients, Some(100.0)).unwrap();
    // What is left of it in the first sample.
    let left = |powered_for_ms| {
        let mut of = [None, Some(&warm_up)].map(|warm_up: Option<&DeviceEffect<f32>>| {
            let mut pipeline = Pipeline::<Analog>::new(&FrontEnd::default());
            pipeline.powered_for(powered_for_ms);
            pipeline.calibrate(calibration(warm_up.map_or(&[], core::slice::from_ref)));
            pipeline.stream(Streams {
                raw: false,
                compensated: true,
            });
            let sent = run(&mut pipeline, 0..20);
            let [Sent::Compensated(head, samples, _)] = &sent[..] else {
                panic!("{sent:?}")
            };
            (head.flags, samples[0].1.gyro.x)
        });
        of[1].1 = of[0].1 - of[1].1;
        of[1]
    };
    for (ms, share) in [(0, 1.0), (69_315, 0.5), (138_629, 0.25)] {
        let (flags, gone) = left(Some(ms));
        assert_eq!(flags, 0);
        assert!((gone - 0.5 * share).abs() < 1e-3, "{ms}: {gone}");
    }
    assert_eq!(left(None), (flags::POWER_ON_UNKNOWN, 0.0));
}

#[test]
fn a_bank_reports_five_times_a_second_and_takes_only_what_is_known() {
    let mut pipeline = Pipeline::<Analog>::new(&FrontEnd::default());
    let bank = Bank::new(Sensor::Gyro, [1e-6; 3], Prior::Diffuse { span: 1.0 });
    pipeline.banks.gyro = bank;
    let sent = run(&mut pipeline, 0..500);
    assert_eq!(sent, [Sent::Kalman(0), Sent::Kalman(0)]);
    let bank = pipeline.banks.gyro.as_mut().unwrap();
    assert!(!bank.set_input(Some([f32::NAN, 0.0, 0.0])));
    assert!(bank.set_input(Some([0.0; 3])));
    run(&mut pipeline, 503..1000);
    let state = pipeline.banks.gyro.as_ref().unwrap().state();
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
