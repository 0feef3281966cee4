//! Columns that count samples, and columns of a clock that stands still.

use super::*;

const GYRO: &str = "t_s,gyro_x,gyro_y,gyro_z";

/// Numbers of the packets that arrived, from 1207 on: a third is lost at random, by a linear congruence.
fn arrived(sent: u64) -> Vec<u64> {
    let mut state = 7_u64;
    let mut kept = |_: &u64| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        !(state >> 33).is_multiple_of(3)
    };
    (1207..1207 + sent).filter(|n| kept(n)).collect()
}

fn packets(header: &str, numbers: &[u64]) -> String {
    let row = |n: &u64| format!("{n},{},{},{}\n", n % 5, n % 7, n % 3);
    header.to_owned() + &numbers.iter().map(row).collect::<String>()
}

#[test]
fn a_packet_counter_is_no_clock_and_its_losses_are_gaps_at_the_given_rate() {
    let numbers = arrived(9000);
    let named = packets("Packet number,gx,gy,gz\n", &numbers);
    let bench = Bench::new(&[("named.csv", &named), ("bare.csv", &packets("", &numbers))]);
    let by_name = "t_s=Packet number,gyro_x=gx,gyro_y=gy,gyro_z=gz";
    let as_sample = "sample,gyro_x,gyro_y,gyro_z";
    let cases = [
        ("named.csv", by_name),
        ("named.csv", GYRO),
        ("bare.csv", GYRO),
        ("bare.csv", as_sample),
    ];
    for (file, list) in cases {
        let mut options = bench.options(&[file], &[list]);
        let refused = bench.import(&options).unwrap_err();
        let arguments = &refused.refused().arguments;
        assert!(arguments.contains(&Argument::SampleRate), "{refused}");
        options.log.rate_hz = Some(128.0);
        let (summary, batch, manifest) = bench.import(&options).unwrap();
        let time = &summary.time[0];
        assert_eq!((manifest.sample_rate_hz, time.counter), (128.0, true));
        let sent = numbers[numbers.len() - 1] - numbers[0] + 1;
        assert_eq!(time.missing, sent - numbers.len() as u64, "{file} {list}");
        let t_s: Vec<f64> = numbers.iter().map(|n| *n as f64 / 128.0).collect();
        assert_eq!(batch.t_s, t_s);
    }
    // If the numbers are milliseconds, a person knows it.
    let mut options = bench.options(&["bare.csv"], &[GYRO]);
    options.log.time_unit = Some(Decimal::Millisecond);
    let (summary, ..) = bench.import(&options).unwrap();
    assert!(!summary.time[0].counter);
}

#[test]
fn a_counter_without_losses_asks_for_its_rate_beside_the_unit_of_a_clock() {
    let text = packets("", &(0..400).collect::<Vec<u64>>());
    let bench = Bench::new(&[("a.csv", &text)]);
    let mut options = bench.options(&["a.csv"], &[GYRO]);
    let refused = bench.import(&options).unwrap_err();
    let arguments = &refused.refused().arguments;
    assert_eq!(arguments[..], [Argument::TimeUnit, Argument::SampleRate]);
    options.log.rate_hz = Some(50.0);
    let (summary, batch, _) = bench.import(&options).unwrap();
    assert_eq!(
        (summary.time[0].counter, batch.t_s[399]),
        (true, 399.0 / 50.0)
    );
}

#[test]
fn a_counter_that_rises_by_four_is_used_with_a_warning_and_one_that_starts_again_is_refused() {
    let fours: Vec<u64> = (0..400).map(|n| 4 * n).collect();
    let mut again: Vec<u64> = (0..400).collect();
    again.extend(0..400);
    let bench = Bench::new(&[
        ("fours.csv", &packets("", &fours)),
        ("again.csv", &packets("", &again)),
    ]);
    let list = "sample,gyro_x,gyro_y,gyro_z";
    let mut options = bench.options(&["fours.csv"], &[list]);
    options.log.rate_hz = Some(200.0);
    let (summary, batch, manifest) = bench.import(&options).unwrap();
    assert_eq!((manifest.sample_rate_hz, batch.t_s[1]), (50.0, 4.0 / 200.0));
    assert_eq!((summary.time[0].gaps, summary.warnings.len()), (0, 1));
    let mut options = bench.options(&["again.csv"], &[list]);
    options.log.rate_hz = Some(200.0);
    let refused = bench.refused(&options);
    assert!(refused.contains("data row 401"), "{refused}");
}

#[test]
fn a_time_that_stands_still_is_named_with_its_value() {
    let row = |i: usize| format!("17.5,{},2,3\n", i % 5);
    let text: String = (0..300).map(row).collect();
    let refused = one_refused(&text, GYRO);
    says(&refused, &["17.5 in all 300 rows", "column t_s"]);
    // A single row has one time too, and is no clock that stands still.
    assert!(one_refused("17.5,1,2,3\n", GYRO).contains("fewer than two rows"));
}
