//! Compensation over temperature along the path of the samples.

use super::*;

/// Sums of TEMP pins at this temperature, in a sample of the nominal reference.
pub(super) fn at_temperature(sums: &mut Channels<u32>, temp_c: f64) {
    let volts = 2.5 + (temp_c - 25.0) * 0.0084;
    let sum = (volts / 2.5 * f64::from(NOMINAL_REFERENCE)).round() as u32;
    sums.temperature = [sum; 3];
}

/// Solution for dies `t` s after the beginning of a ramp from 25 °C by 0.1 °C/s, at rest before.
fn on_the_ramp(lag_s: f64, t: f64) -> f64 {
    match lag_s > 0.0 {
        true => 25.0 + 0.1 * (t - lag_s * (1.0 - (-t / lag_s).exp())),
        false => 25.0 + 0.1 * (t - lag_s * (1.0 - (t / (0.25 * lag_s)).exp())),
    }
}

#[test]
fn compensation_follows_the_dies_of_each_triad_and_the_raw_stream_the_thermometer() {
    for lags_s in [[40.0, 40.0], [-20.0, -20.0], [40.0, -20.0], [-20.0, 40.0]] {
        let mut pipeline = Pipeline::<Analog>::new(&FrontEnd::default());
        pipeline.calibrate(with_lags(
            &[],
            Some(PerSensor::from(lags_s).map(|s| s as f32)),
        ));
        pipeline.stream(both());
        // 25 °C, and from 5 s on 0.1 °C/s.
        let at = |number: u32| 25.0 + 0.1 * (f64::from(number) / 1000.0 - 5.0).max(0.0);
        let reference = f64::from(NOMINAL_REFERENCE.round());
        let (mut thermometer, mut worst) = (0.0, [0.0_f64; 2]);
        for number in 0..65_000 {
            let mut sums = sums(number);
            at_temperature(&mut sums, at(number));
            pipeline.take(&scan(number.into(), &sums), &mut |message| {
                match keep(message) {
                    Sent::Raw(head, ..) => thermometer = f64::from(head.temp_c),
                    Sent::Compensated(head, samples, dies_c) => {
                        let t = f64::from(head.first) / 1000.0 - 5.0;
                        if t < 0.0 {
                            return true;
                        }
                        // The filter of the thermometer is behind by its second.
                        let filtered = t - 1.0 + (-t).exp();
                        assert!((thermometer - 25.0 - 0.1 * filtered).abs() < 0.01);
                        assert_eq!(head.temp_c, dies_c.gyro);
                        let dies_c = [dies_c.gyro, dies_c.accel].map(f64::from);
                        for ((worst, die_c), lag_s) in worst.iter_mut().zip(dies_c).zip(lags_s) {
                            *worst = worst.max((die_c - on_the_ramp(lag_s, t)).abs());
                        }
                        // Gains of 2 at -10 °C and 4 at 60 °C.
                        let gain = |die_c: f64| 2.0 + 2.0 * (die_c + 10.0) / 70.0;
                        let (number, sample) = &samples[0];
                        let read = f64::from(60_000 + number % 5) * 3.3 / 131_070.0;
                        let expected = gain(dies_c[1]) * (read - 1.0);
                        assert!((f64::from(sample.accel[0]) - expected).abs() < 1e-5);
                        let read = f64::from(50_000 + number % 7) * 2.5 / reference;
                        let expected = gain(dies_c[0]) * (read - 1.0);
                        assert!((f64::from(sample.gyro[0]) - expected).abs() < 1e-5);
                    }
                    Sent::Kalman(_) => {}
                }
                true
            });
        }
        // The second by which the thermometer's filter is behind, and what that makes of a lead at its beginning.
        for (worst, lag_s) in worst.into_iter().zip(lags_s) {
            let bound = if lag_s > 0.0 { 0.11 } else { 0.5 };
            assert!(worst < bound, "{lags_s:?}: {worst}");
        }
        assert!((thermometer - 30.9).abs() < 0.02, "{thermometer}");
    }
}

#[test]
fn samples_outside_the_range_are_flagged_from_the_first_degree_on() {
    let mut pipeline = Pipeline::<Analog>::new(&FrontEnd::default());
    pipeline.calibrate(calibration(&[]));
    pipeline.stream(both());
    let mut seen = [0; 2];
    for number in 0..70_000 {
        let mut sums = sums(number);
        // From 25 to 60 °C, beyond the 50 of the range and up to the last node.
        at_temperature(&mut sums, 25.0 + 0.5 * f64::from(number) / 1000.0);
        pipeline.take(&scan(number.into(), &sums), &mut |message| {
            if let Sent::Compensated(head, ..) = keep(message) {
                let outside = head.flags & flags::OUTSIDE_NODES != 0;
                assert_eq!(outside, head.temp_c > 50.0, "{}", head.temp_c);
                seen[usize::from(outside)] += 1;
            }
            true
        });
    }
    assert!(seen.iter().all(|count| *count > 500), "{seen:?}");
}

#[test]
fn without_a_thermometer_the_last_good_temperature_is_used_and_flagged() {
    let mut pipeline = Pipeline::<Analog>::new(&FrontEnd::default());
    pipeline.calibrate(with_lags(&[], Some(PerSensor::both(40.0))));
    pipeline.stream(both());
    let mut last = None;
    for number in 0..30_000 {
        let mut sums = sums(number);
        at_temperature(&mut sums, 35.0);
        if number >= 10_000 {
            // All three are open.
            sums.temperature = [0; 3];
        }
        pipeline.take(&scan(number.into(), &sums), &mut |message| {
            if let Sent::Compensated(head, ..) = keep(message) {
                last = Some(head);
            }
            true
        });
    }
    let head = last.unwrap();
    assert!((head.temp_c - 35.0).abs() < 0.02, "{}", head.temp_c);
    assert_ne!(head.flags & flags::NO_TEMPERATURE, 0);
    // And without any the lag does not begin at what stands in for it.
    let mut pipeline = Pipeline::<Analog>::new(&FrontEnd::default());
    pipeline.calibrate(with_lags(&[], Some(PerSensor::both(40.0))));
    pipeline.stream(both());
    let mut heads = Vec::new();
    for number in 0..4_000 {
        let mut sums = sums(number);
        match number < 2_000 {
            true => sums.temperature = [0; 3],
            false => at_temperature(&mut sums, 45.0),
        }
        pipeline.take(&scan(number.into(), &sums), &mut |message| {
            if let Sent::Compensated(head, ..) = keep(message) {
                heads.push(head);
            }
            true
        });
    }
    assert_eq!(heads[50].temp_c, 25.0);
    assert!(
        (heads[150].temp_c - 45.0).abs() < 0.02,
        "{}",
        heads[150].temp_c
    );
}
