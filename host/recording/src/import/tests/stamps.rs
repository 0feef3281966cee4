//! What becomes of the time stamps of foreign files.

use super::*;

#[test]
fn times_that_go_back_for_good_are_refused_with_file_and_row_and_repeated_rows_are_left_out() {
    let good = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5];
    let bad = [10.0, 10.1, 10.2, 0.3, 0.4, 0.5];
    let error = join(&good, &bad).unwrap_err().to_string();
    assert!(error.contains("g, data row 4, column t_s"), "{error}");
    let error = one(&timed(&bad), GYR).unwrap_err().to_string();
    assert!(error.contains("data row 4, column t_s"), "{error}");
    let twice = [0.0, 0.1, 0.1, 0.2, 0.3, 0.3, 0.4];
    let (summary, batch, _) = one(&timed(&twice), GYR).unwrap();
    assert_eq!(summary.time[0].repeated_rows, 2);
    assert_eq!(batch.t_s, good[..5]);
    assert_eq!(batch.raw[0], [0.0, 0.2, 0.4, 0.6, 0.8]);
}

#[test]
fn a_file_with_nanoseconds_since_1970_has_the_rate_to_all_its_digits() {
    let row = |i: u64| format!("{},1,2,3\n", 1_403_636_579_763_555_584 + i * 5_000_000);
    let text: String = (0..2000).map(row).collect();
    let bench = Bench::new(&[("a", &text)]);
    let (summary, batch, manifest) = bench.import(&bench.options(&["a"], &[GYR])).unwrap();
    assert_eq!(manifest.sample_rate_hz, 200.0);
    assert_eq!(summary.time[0].unit, Some(Decimal::Nanosecond));
    assert_eq!(summary.time[0].origin_s, 1_403_636_579);
    assert_eq!(batch.t_s[0], 0.763_555_584);
    assert!((batch.t_s[1999] - batch.t_s[0] - 9.995).abs() < 1e-12);
    // The result is the same if the factor is given, or with seconds of nine decimals.
    let mut options = bench.options(&["a"], &[GYR]);
    options.log.scale = vec!["t_s=1e-9".parse().unwrap()];
    assert_eq!(bench.import(&options).unwrap().1, batch);
    let last = batch.t_s[1999];
    let seconds = |line: &str| format!("{}.{}\n", &line[..10], &line[10..]);
    let text: String = text.lines().map(seconds).collect();
    std::fs::write(bench.path("a"), text).unwrap();
    let (summary, batch, manifest) = bench.import(&bench.options(&["a"], &[GYR])).unwrap();
    assert_eq!(manifest.sample_rate_hz, 200.0);
    assert_eq!(summary.time[0].unit, Some(Decimal::Second));
    assert!((batch.t_s[1999] - last).abs() < 1e-12);
}

#[test]
fn two_sensors_with_clocks_of_their_own_are_joined_in_regular_time() {
    let mut seed = 1_u32;
    let mut late = || {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(seed >> 8) / f64::from(1 << 24)
    };
    // The value is the true time of the sample; the stamps are up to 4 ms late, the rates 100 and 104 Hz.
    let mut file = |rate: f64| -> String {
        let row = |i: i32| {
            let t = f64::from(i) / rate;
            format!("{:.0} {t} 0 1\n", 1.7e12 + 1e3 * t + 4.0 * late())
        };
        (0..2000).map(row).collect()
    };
    let bench = Bench::new(&[("a", &file(100.0)), ("g", &file(104.0))]);
    let (summary, batch, _) = bench
        .import(&bench.options(&["a", "g"], &[ACC, GYR]))
        .unwrap();
    let rates: Vec<f64> = summary.time.iter().map(|time| time.rate_hz).collect();
    assert!(
        (rates[0] - 100.0).abs() < 2e-3 && (rates[1] - 104.0).abs() < 2e-3,
        "{rates:?}"
    );
    assert_eq!(summary.time[0].gaps + summary.time[1].gaps, 0);
    for (accel, gyro) in batch.raw[3].iter().zip(&batch.raw[0]) {
        assert!((accel - gyro).abs() < 1e-3, "{accel} {gyro}");
    }
    for (i, t) in batch.t_s.iter().enumerate() {
        let regular = batch.t_s[0] + i as f64 / rates[0];
        assert!((t - regular).abs() < 1e-6);
    }
}

/// Rows of a gyro with these stamps, as they are written.
fn stamped(stamps: impl IntoIterator<Item = u64>) -> String {
    let row = |(i, stamp): (usize, u64)| format!("{stamp} {} 2 3\n", i % 7);
    stamps.into_iter().enumerate().map(row).collect()
}

#[test]
fn a_second_file_of_another_rate_has_the_unit_of_the_first_where_their_times_overlap() {
    // 100 Hz and 1 Hz in microseconds: by itself the second may be 1 kHz in nanoseconds.
    let gyro = stamped((0..3000).map(|i| 60_000_000 + 10_000 * i));
    let accel = stamped((0..31).map(|i| 60_000_000 + 1_000_000 * i));
    let bench = Bench::new(&[("g", &gyro), ("a", &accel)]);
    let (summary, batch, _) = bench
        .import(&bench.options(&["g", "a"], &[GYR, ACC]))
        .unwrap();
    let units: Vec<_> = summary.time.iter().map(|time| time.unit).collect();
    assert_eq!(units, [Some(Decimal::Microsecond); 2]);
    assert_eq!((summary.time[1].rate_hz, batch.len()), (1.0, 3000));
}

#[test]
fn counters_of_16_and_32_bits_that_begin_again_are_counted_on_and_reported() {
    for (size, step, rate) in [(1_u64 << 16, 10, 100.0), (1 << 32, 5000, 200.0)] {
        let text = stamped((0..2000).map(|i| (size - 777 * step + step * i) % size));
        let bench = Bench::new(&[("a", &text)]);
        let (summary, batch, _) = bench.import(&bench.options(&["a"], &[GYR])).unwrap();
        assert_eq!((summary.sample_rate_hz, summary.time[0].wraps), (rate, 1));
        assert!(
            summary
                .warnings
                .iter()
                .any(|w| w.contains("wrapped to 0 once"))
        );
        let steps = batch.t_s.windows(2).map(|w| w[1] - w[0]);
        assert!(steps.into_iter().all(|dt| (dt * rate - 1.0).abs() < 1e-6));
    }
}

#[test]
fn steps_of_one_and_two_periods_are_lost_samples_and_the_stamps_stay_as_they_are() {
    // A quarter of the samples is lost at random: steps of 4 and 8 ms, occasionally 12.
    let mut state = 7_u64;
    let mut kept = |_: &u64| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        state >> 62 != 0
    };
    let numbers: Vec<u64> = (0..6000)
        .filter(|i| *i == 0 || *i == 5999 || kept(i))
        .collect();
    let text = stamped(numbers.iter().map(|i| 4000 * i));
    let bench = Bench::new(&[("a", &text)]);
    let (summary, batch, _) = bench.import(&bench.options(&["a"], &[GYR])).unwrap();
    let time = &summary.time[0];
    assert_eq!(time.rate_hz, 250.0);
    assert_eq!(time.missing, 6000 - numbers.len() as u64);
    assert!(time.stamps_kept && time.missing > 1300, "{time:?}");
    let expected: Vec<f64> = numbers.iter().map(|i| *i as f64 * 0.004).collect();
    assert!(
        batch
            .t_s
            .iter()
            .zip(&expected)
            .all(|(a, b)| (a - b).abs() < 1e-9)
    );
}

#[test]
fn a_clock_that_is_set_back_by_less_than_a_second_is_refused_with_its_row() {
    let stamp = |i: u64| 1_000_000 + 10_000 * i + 37 * i % 50 - if i >= 1500 { 50_000 } else { 0 };
    let bench = Bench::new(&[("a", &stamped((0..3000).map(stamp)))]);
    let error = bench.refused(&bench.options(&["a"], &[GYR]));
    assert!(error.contains("data row 1501"), "{error}");
}

#[test]
fn stamps_that_neither_their_steps_nor_the_count_explain_are_refused_and_not_smeared() {
    // Every seventh row of the first half occurs twice, with different readings.
    let stamps =
        (0..3000).flat_map(|i| vec![10_000 * i; if i < 1500 && i % 7 == 0 { 2 } else { 1 }]);
    let bench = Bench::new(&[("a", &stamped(stamps))]);
    let error = bench.refused(&bench.options(&["a"], &[GYR]));
    assert!(error.contains("off the sample count"), "{error}");
}

#[test]
fn readings_of_a_loop_are_interpolated_to_its_usual_round() {
    let mut state = 9_u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1 << 24)
    };
    // Rounds of 70 to 90 ms, one in thirty with a card that takes 120 ms more, and one pause of 5 s. The reading is the time itself.
    let (mut t_ms, mut text, mut stamps) = (0.0_f64, String::from("t_ms,wx,wy,wz\n"), Vec::new());
    for row in 0..3000 {
        let whole = t_ms.round();
        stamps.push(whole / 1e3);
        text += &format!("{whole},{},2,3\n", whole / 1e3);
        let card = if random() < 1.0 / 30.0 { 120.0 } else { 0.0 };
        let pause = if row == 1500 { 5000.0 } else { 0.0 };
        t_ms += 70.0 + 20.0 * random() + card + pause;
    }
    let bench = Bench::new(&[("a", &text)]);
    let list = "t_s=t_ms,gyro_x=wx,gyro_y=wy,gyro_z=wz";
    let (summary, batch, manifest) = bench.import_one(list).unwrap();
    let time = &summary.time[0];
    let rounds = time.polled.unwrap();
    assert!((rounds.usual_s - 0.0805).abs() < 0.002, "{time:?}");
    assert!(time.stamps_kept && time.gaps == 1, "{time:?}");
    assert!((manifest.sample_rate_hz * rounds.usual_s - 1.0).abs() < 1e-6);
    // The interpolated reading equals the time everywhere, and no row lies in the pause.
    let off = batch
        .t_s
        .iter()
        .zip(&batch.raw[0])
        .map(|(t, x)| (t - x).abs());
    assert!(off.fold(0.0, f64::max) < 1e-9);
    let pause = [stamps[1500], stamps[1501]];
    assert!(batch.t_s.iter().all(|t| *t <= pause[0] || *t >= pause[1]));
    let steps = batch.t_s.windows(2).map(|w| w[1] - w[0]);
    let regular = steps
        .filter(|s| (s / rounds.usual_s - 1.0).abs() < 1e-6)
        .count();
    assert_eq!(regular, batch.len() - 2, "all but the pause");
    assert!(
        summary
            .warnings
            .iter()
            .any(|w| w.contains("a loop read the unit")),
        "{summary:?}"
    );
}

#[test]
fn turns_of_a_loop_last_by_its_stamps() {
    // Step 1 has 200 readings, half of which wait for a card for 7 to 13 ms.
    let (mut t_ms, mut text) = (0_u32, String::from("t_ms,s,wx,wy,wz\n"));
    for row in 0..1000_u32 {
        let slow = (400..600).contains(&row);
        text += &format!("{t_ms},{},0.1,2,3\n", u8::from(slow));
        t_ms += 20 + row * 7 % 3;
        t_ms += if slow && row % 2 == 0 {
            7 + row / 2 % 7
        } else {
            0
        };
    }
    let bench = Bench::new(&[("a", &text), ("i", "step,turn_x_deg\n0,\n1,360\n")]);
    let list = "t_s=t_ms,step=s,gyro_x=wx,gyro_y=wy,gyro_z=wz";
    let mut options = bench.options(&["a"], &[list]);
    options.log.inputs = Some(bench.path("i"));
    options.reference = Reference::Table;
    let (summary, batch, _) = bench.import(&options).unwrap();
    assert!(summary.time[0].polled.is_some(), "{summary:?}");
    let rate = batch.reference[0].iter().find(|r| !r.is_nan()).unwrap();
    // 200 rounds of 21 ms and 100 waits of 10 ms.
    assert!((rate / (360.0 / 5.2) - 1.0).abs() < 0.01, "{rate}");
}
