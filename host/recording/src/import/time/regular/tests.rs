//! Stamps as various ways of reading a sensor make them, with known truth.

use super::*;

/// Uniform numbers from 0 to 1.
fn uniform() -> impl FnMut() -> f64 {
    let mut seed = 1_u64;
    move || {
        seed = seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Stamps of the samples `numbers`, `period` apart, each late by `late(number)`.
fn stamps(numbers: &[u64], period: f64, mut late: impl FnMut(u64) -> f64) -> Vec<f64> {
    let each = numbers.iter().map(|&n| n as f64 * period + late(n));
    each.collect()
}

fn gap(row: u64, missing: u64) -> Gap {
    Gap { row, missing }
}

#[test]
fn jitter_of_a_steady_stream_is_no_gap_and_its_rate_is_that_of_the_line() {
    let mut random = uniform();
    let numbers: Vec<u64> = (0..12_000).collect();
    // Most steps are 10.2 ms, one in fifty is 5 or 15 ms: the stamp is early or late for once.
    let odd = stamps(&numbers, 0.0102, |_| match random() {
        x if x < 0.02 => -0.0052,
        x if x < 0.04 => 0.0048,
        _ => 0.0,
    });
    let found = Regular::find(&odd, None).unwrap();
    assert_eq!(found.gaps, []);
    assert!(!found.kept);
    assert!((found.period_s / 0.0102 - 1.0).abs() < 1e-6, "{found:?}");
    assert!((found.jitter.max_s - 0.0052).abs() < 1e-4, "{found:?}");
    // Every stamp off by up to 0.4 periods.
    let noisy = stamps(&numbers, 0.01, |_| 0.008 * (random() - 0.5));
    let found = Regular::find(&noisy, None).unwrap();
    assert_eq!(found.gaps, []);
    assert!((found.period_s / 0.01 - 1.0).abs() < 5e-6, "{found:?}");
}

#[test]
fn exact_stamps_are_exact_with_gaps_of_any_size_and_anywhere() {
    let mut numbers: Vec<u64> = (0..500).collect();
    for range in [400..401, 390..398, 200..230, 4..5, 2..3] {
        numbers.drain(range);
    }
    let found = Regular::find(&stamps(&numbers, 0.001, |_| 0.0), None).unwrap();
    assert!(found.kept);
    assert!((found.period_s / 0.001 - 1.0).abs() < 1e-9);
    let expected = [gap(2, 1), gap(3, 1), gap(198, 30), gap(358, 8), gap(360, 1)];
    assert_eq!(found.gaps, expected);
}

#[test]
fn missing_samples_are_found_behind_jitter() {
    let mut random = uniform();
    // A packet of three is lost now and then, and each stamp is late by up to a third of a period.
    let lost: Vec<u64> = (1..100).map(|i| 97 * i + i % 7).collect();
    let there = |n: &u64| !lost.iter().any(|l| (*l..*l + 3).contains(n));
    let numbers: Vec<u64> = (0..10_000).filter(there).collect();
    let found = Regular::find(&stamps(&numbers, 0.02, |_| 0.006 * random()), None).unwrap();
    let row = |l: u64| numbers.iter().position(|n| *n == l + 3).unwrap() as u64;
    let expected: Vec<Gap> = lost.iter().map(|&l| gap(row(l), 3)).collect();
    assert_eq!(found.gaps, expected);
    assert!((found.period_s / 0.02 - 1.0).abs() < 1e-6);
}

#[test]
fn a_stall_that_is_caught_up_is_no_gap_and_what_is_lost_in_it_is_one() {
    let numbers: Vec<u64> = (0..20_000).collect();
    // Nothing is read for 1.2 s; then what has queued comes at once.
    let stalled = |n: u64| match n % 4000 {
        since @ 2000..2120 => 0.01 * (2120 - since) as f64,
        _ => 0.0,
    };
    let found = Regular::find(&stamps(&numbers, 0.01, stalled), None).unwrap();
    assert_eq!(found.gaps, []);
    assert!((found.period_s / 0.01 - 1.0).abs() < 1e-6);
    // The queue holds 80 of them only: 40 of the third stall are lost.
    let kept: Vec<u64> = (0..20_000)
        .filter(|n| !(10_080..10_120).contains(n))
        .collect();
    let found = Regular::find(&stamps(&kept, 0.01, stalled), None).unwrap();
    assert_eq!(found.missing(), 40);
    assert_eq!(found.gaps.len(), 1);
    assert!((10_000..=10_080).contains(&found.gaps[0].row), "{found:?}");
}

#[test]
fn bursts_are_no_gaps_and_samples_lost_between_them_are() {
    let mut random = uniform();
    // Handed over every 8 to 20 samples, then 1.2 ms apart.
    let mut late = Vec::new();
    while late.len() < 30_000 {
        let burst = 8 + (12.0 * random()) as usize;
        late.extend((0..burst).map(|i| (burst - i) as f64 * 0.01 - 0.0012 * (burst - i) as f64));
    }
    let all: Vec<u64> = (0..30_000).collect();
    let found = Regular::find(&stamps(&all, 0.01, |n| late[n as usize]), None).unwrap();
    assert_eq!(found.gaps, []);
    assert!((found.period_s / 0.01 - 1.0).abs() < 1e-5, "{found:?}");
    let kept: Vec<u64> = (0..30_000)
        .filter(|n| !(12_000..12_060).contains(n))
        .collect();
    let found = Regular::find(&stamps(&kept, 0.01, |n| late[n as usize]), None).unwrap();
    assert_eq!(found.missing(), 60, "{:?}", found.gaps);
    assert!(found.gaps[0].row.abs_diff(12_000) <= 20);
}

#[test]
fn a_clock_that_wanders_against_the_sensor_makes_no_gaps() {
    let mut random = uniform();
    let numbers: Vec<u64> = (0..720_000).collect();
    // The rate wanders by up to 100 ppm either way within an hour: 11 samples at 200 Hz.
    let wander = |n: u64| 0.0573 * (1.0 - (n as f64 / 720_000.0 * std::f64::consts::TAU).cos());
    let found = Regular::find(
        &stamps(&numbers, 0.005, |n| wander(n) + 0.002 * random()),
        None,
    )
    .unwrap();
    assert_eq!(found.gaps, []);
    assert!((found.period_s / 0.005 - 1.0).abs() < 1e-4);
}

#[test]
fn a_clock_that_is_set_back_and_a_file_without_two_times_are_refused() {
    let twice: Vec<f64> = (0..100).map(|i| f64::from(i % 50) * 0.1).collect();
    assert_eq!(Regular::find(&twice, None), Err(Irregular::SetBack(50)));
    for short in [&[][..], &[1.0], &[1.0, 1.0], &[2.0, 1.9]] {
        assert_eq!(Regular::find(short, None), Err(Irregular::Short));
    }
    // One wrong stamp among good ones is accepted.
    let mut once: Vec<f64> = (0..1000).map(|i| f64::from(i) * 0.1).collect();
    once[500] = 1e6;
    assert_eq!(Regular::find(&once, None).unwrap().gaps, []);
    once[500] = 0.0;
    assert_eq!(Regular::find(&once, None).unwrap().gaps, []);
}

#[test]
fn bursts_with_pauses_keep_their_stamps_whatever_the_phase_behind_a_pause() {
    let mut random = uniform();
    // 51 samples at 58.3 Hz, then nothing for 1 to 5 s; stamps in whole milliseconds, the first of a burst 5 ms late.
    let (period, mut at) = (0.01715, 0.0);
    let mut all = Vec::new();
    for _ in 0..60 {
        for i in 0..51 {
            let late = if i == 0 { 0.005 } else { 0.0 };
            all.push(((at + f64::from(i) * period + late) * 1e3_f64).round() / 1e3);
        }
        at += 51.0 * period + 1.0 + 4.0 * random();
    }
    let found = Regular::find(&all, None).unwrap();
    assert!(found.kept, "{found:?}");
    assert_eq!(found.gaps.len(), 59);
    assert!((found.period_s / period - 1.0).abs() < 2e-4, "{found:?}");
    let steps = all.windows(2).map(|w| w[1] - w[0]);
    let missing: f64 = steps.filter(|s| *s > 0.5).map(|s| s / period - 1.0).sum();
    assert!((found.missing() as f64 - missing).abs() < 10.0, "{missing}");
}

#[test]
fn a_buffer_that_is_handed_over_is_no_pause_unless_the_given_rate_is_that_of_the_bursts() {
    // Ten samples at 100 Hz, handed over 2 ms apart; or ten at 500 Hz with a pause of 80 ms.
    let numbers: Vec<u64> = (0..5000).collect();
    let late = |n: u64| (9 - n % 10) as f64 * 0.008;
    let bursts = stamps(&numbers, 0.01, late);
    let found = Regular::find(&bursts, None).unwrap();
    assert!(!found.kept && found.gaps.is_empty(), "{found:?}");
    assert!((found.period_s / 0.01 - 1.0).abs() < 1e-4, "{found:?}");
    assert!((found.in_bursts_s.unwrap() / 0.002 - 1.0).abs() < 1e-6);
    let found = Regular::find(&bursts, Some(100.0)).unwrap();
    assert!(!found.kept);
    let found = Regular::find(&bursts, Some(500.0)).unwrap();
    assert!(found.kept, "{found:?}");
    assert_eq!((found.gaps.len(), found.missing()), (499, 499 * 40));
}

#[test]
fn bursts_of_any_length_have_the_rate_of_the_sensor_and_no_gaps_but_those_of_samples_lost() {
    let mut random = uniform();
    for burst in [10_u64, 20, 32, 40, 100] {
        for within_s in [0.0001, 0.0003, 0.0005, 0.0011, 0.002, 0.003] {
            for jitter_s in [0.0, 0.002, 0.02] {
                // With only 60 bursts, the samples may as well have been taken a millisecond apart, with pauses between bursts.
                if burst == 100 && within_s > 1e-3 {
                    continue;
                }
                let case = (burst, within_s, jitter_s);
                let delays: Vec<f64> = (0..=6000 / burst).map(|_| jitter_s * random()).collect();
                let late = |n: u64| {
                    let after = (n % burst) as f64;
                    let waits = (burst - 1) as f64 - after;
                    waits * 0.01 + after * within_s + delays[(n / burst) as usize]
                };
                let all: Vec<u64> = (0..6000).collect();
                let found = Regular::find(&stamps(&all, 0.01, late), None).unwrap();
                assert!(!found.kept && found.gaps.is_empty(), "{case:?} {found:?}");
                let off = found.period_s / 0.01 - 1.0;
                assert!(off.abs() < 1e-4, "{case:?} {found:?}");
                // Three bursts are lost.
                let lost = 10 * burst..13 * burst;
                let kept: Vec<u64> = all.into_iter().filter(|n| !lost.contains(n)).collect();
                let found = Regular::find(&stamps(&kept, 0.01, late), None).unwrap();
                // Jitter hides up to a twentieth of a burst and the delay of the hand-overs.
                let off = found.missing().abs_diff(3 * burst) as f64;
                let hidden = (burst / 20) as f64 + (jitter_s / 0.01).ceil();
                assert!(off <= hidden, "{case:?} {found:?}");
            }
        }
    }
}
