//! A thermometer that comes late, and a calibration that comes while samples do.

use super::temperature::at_temperature;
use super::*;

/// 0.1 deg/s of the gyro for each kelvin that a die with a lag of a minute is behind.
fn lag() -> DeviceEffect<f32> {
    DeviceEffect::named("gyro_thermal_lag", &[1.745e-3; 3], Some(60.0)).unwrap()
}

/// Compensated samples of pipelines in which the TEMP pins read `temp_c`, where that is a number, and else are open. `before` is called with
/// the number of each sample, before it is taken.
fn compensated(
    pipeline: &mut Pipeline<Analog>,
    numbers: core::ops::Range<u32>,
    temp_c: impl Fn(u32) -> f64,
    mut before: impl FnMut(u32, &mut Pipeline<Analog>),
) -> Vec<(u32, Sample<f32>, f32)> {
    let mut all = Vec::new();
    for number in numbers {
        before(number, pipeline);
        let mut sums = sums(number);
        match temp_c(number) {
            open if open.is_nan() => sums.temperature = [0; 3],
            temp_c => at_temperature(&mut sums, temp_c),
        }
        pipeline.take(&scan(number.into(), &sums), &mut |message| {
            if let Sent::Compensated(head, samples, _) = keep(message) {
                all.extend(
                    samples
                        .into_iter()
                        .map(|(n, sample)| (n, sample, head.temp_c)),
                );
            }
            true
        });
    }
    all
}

fn streaming(stored: Stored) -> Pipeline<Analog> {
    let mut pipeline = Pipeline::<Analog>::new(&FrontEnd::default());
    pipeline.calibrate(stored);
    pipeline.stream(both());
    pipeline
}

#[test]
fn effects_begin_with_the_first_reading_of_the_thermometer() {
    // Open at power-on for two seconds; the dies have been at 45 °C for long.
    let late = |number| if number < 2_000 { f64::NAN } else { 45.0 };
    let run = |effects: &[DeviceEffect<f32>]| {
        let mut pipeline = streaming(calibration(effects));
        compensated(&mut pipeline, 0..10_000, late, |_, _| ())
    };
    let (with, without) = (run(&[lag()]), run(&[]));
    assert_eq!(with.len(), without.len());
    for ((number, with, _), (_, without, _)) in with.iter().zip(&without) {
        // The filtered temperature is within 0.01 K of its first value, which makes 2e-5 rad/s.
        let error = (with.gyro - without.gyro).amax();
        assert!(error < 2e-5, "{number}: {error}");
    }
    assert!((with.last().unwrap().2 - 45.0).abs() < 0.02);
}

#[test]
fn a_new_calibration_begins_with_the_next_sample_at_the_present_temperature() {
    // In the middle of a batch, at 55 °C, where the first one has a gain of 2 + 2 * 65 / 70.
    let changed = 5_013;
    let mut pipeline = streaming(calibration(&[]));
    let mut beside = streaming(times(3.0, &[], None));
    let all = compensated(
        &mut pipeline,
        0..6_000,
        |_| 55.0,
        |number, pipeline| {
            if number == changed {
                pipeline.calibrate(times(3.0, &[], None));
            }
        },
    );
    let three = compensated(&mut beside, 0..6_000, |_| 55.0, |_, _| ());
    // None is lost or sent twice.
    assert_eq!(all[0].0, 0);
    assert!(all.windows(2).all(|pair| pair[1].0 == pair[0].0 + 1));
    assert!(all.len() > 5_900);
    for ((number, sample, temp_c), (_, other, _)) in all.iter().zip(&three) {
        let read = f64::from(60_000 + number % 5) * 3.3 / 131_070.0;
        let at_55 = 2.0 + 2.0 * (f64::from(*temp_c) + 10.0) / 70.0;
        let gain = if *number < changed {
            at_55
        } else {
            3.0 * at_55
        };
        let expected = gain * (read - 1.0);
        let off = (f64::from(sample.accel.x) - expected).abs();
        assert!(off < 3e-5, "{number}: {off}");
        if *number >= changed {
            assert!((sample.accel - other.accel).amax() < 2e-6, "{number}");
        }
    }
}

#[test]
fn lags_of_dies_and_effects_go_on_under_a_new_calibration() {
    // Hot air from 25 to 55 °C; the dies follow by 40 s, the effect by a minute.
    let ramp = |number: u32| 25.0 + (0.5 * f64::from(number) / 1000.0).min(30.0);
    let one = || with_lags(&[lag()], Some(PerSensor::both(40.0)));
    // The same beside another effect, whose place in the list is before it.
    let warm_up = DeviceEffect::named("gyro_warm_up", &[0.0; 3], Some(100.0)).unwrap();
    let two = || with_lags(&[warm_up, lag()], Some(PerSensor::both(40.0)));
    let whole = compensated(&mut streaming(one()), 0..90_000, ramp, |_, _| ());
    let mut exchanged = streaming(one());
    let exchanged = compensated(&mut exchanged, 0..90_000, ramp, |number, pipeline| {
        if number == 62_007 {
            pipeline.calibrate(two());
        }
    });
    let mut worst = 0.0_f32;
    for ((number, whole, _), (_, exchanged, _)) in whole.iter().zip(&exchanged) {
        let off = (whole.gyro - exchanged.gyro).amax();
        worst = worst.max(off);
        // Other batches: the temperature of up to 20 ms ago, 0.01 K; 25 K behind would be 0.04 rad/s, and 1.4 K of gain per volt.
        assert!(off < 2e-3, "{number}: {off}");
    }
    assert!(worst > 0.0, "nothing was exchanged");
    // From the first calibration of a device on, time is since power-on: see the test of the warm-up.
}
