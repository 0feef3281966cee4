//! Flaws of recordings: each has only the effect of its key.

use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::record::{Row, samples};
use mimu_rig::rig_file::{RigFile, RigTruth};
use mimu_rig::rotation::{add, dot, norm, scale};

const PLAN: &str = "format = \"mimu-plan/1\"\nsample_rate_hz = 100.0\ncarrier = \"hands\"\nlead_in_s = 2.0\n\
                    [[step]]\nposes = 12\ndwell_s = 3.0\n";
const UNIT: &str = "format = \"mimu-rig/1\"\n[unit]\ngyro = \"MPU6050-gyro\"\naccel = \"MPU6050-accel\"\n\
                    [hands]\njolt_probability = 0.0\n";

fn rows(flaws: &str) -> Vec<Row> {
    let plan = Plan::parse(Source::new("PLAN.toml", PLAN)).unwrap();
    let text = format!("{UNIT}[flaws]\n{flaws}");
    let file = RigFile::parse(&Source::new("RIG.toml", text)).unwrap();
    let truth = RigTruth::resolve(&file, 4).unwrap();
    samples(&plan, &truth, 4).unwrap().collect()
}

#[test]
fn stamps_jitter_and_come_in_bursts_while_the_samples_stay_steady() {
    let steady = rows("");
    for flaws in ["stamp_jitter_s = 0.004\n", "stamp_burst = 10\n"] {
        let stamped = rows(flaws);
        assert_eq!(stamped.len(), steady.len());
        let mut late_s: Vec<f64> = Vec::new();
        for (a, b) in stamped.iter().zip(&steady) {
            assert_eq!((a.instant, a.readings), (b.instant, b.readings));
            assert_eq!(b.stamp_s, b.instant.motion.t_s);
            late_s.push(a.stamp_s - b.stamp_s);
        }
        assert!(stamped.windows(2).all(|w| w[0].stamp_s < w[1].stamp_s));
        let largest = late_s.iter().copied().fold(0.0, f64::max);
        assert!((0.008..0.1).contains(&largest), "{flaws}{largest}");
    }
    // Ten samples are stamped within a millisecond, at the time of the last one.
    let burst: Vec<f64> = rows("stamp_burst = 10\n")
        .iter()
        .map(|r| r.stamp_s)
        .collect();
    assert!((burst[0] - 0.09).abs() < 1e-9 && burst[9] - burst[0] < 1.1e-3);
    assert!(burst[10] - burst[9] > 0.098);
}

#[test]
fn a_logger_that_loses_samples_or_pauses_leaves_the_others_as_they_were() {
    let all = rows("");
    for (flaws, share) in [
        ("lost_share = 0.25\n", 0.75),
        ("pause_after = 51\npause_s = 1.49\n", 51.0 / 200.0),
    ] {
        let recorded = rows(flaws);
        let index = |row: &Row| (100.0 * row.stamp_s).round() as usize;
        for row in &recorded {
            assert_eq!(*row, all[index(row)], "{flaws}");
        }
        let left = recorded.len() as f64 / all.len() as f64;
        assert!((left - share).abs() < 0.03, "{flaws}{left}");
        let steps = recorded.windows(2).map(|w| index(&w[1]) - index(&w[0]));
        let longest = steps.max().unwrap();
        let expected = if flaws.contains("pause") {
            150..151
        } else {
            4..20
        };
        assert!(expected.contains(&longest), "{flaws}{longest}");
    }
}

#[test]
fn a_violent_shake_clips_a_few_samples_at_the_rails_of_the_converter() {
    let clipped = |rows: &[Row]| {
        let at_rail = |u: &f64| *u == 32767.0 || *u == -32768.0;
        rows.iter()
            .flat_map(|r| &r.readings.gyro)
            .filter(|u| at_rail(u))
            .count()
    };
    assert_eq!(clipped(&rows("")), 0);
    let shaken = rows("shake_turns = 1\n");
    assert!((2..60).contains(&clipped(&shaken)), "{}", clipped(&shaken));
    let in_dwells = shaken.iter().filter(|r| r.instant.step.is_some());
    assert!(
        in_dwells
            .zip(rows("").iter().filter(|r| r.instant.step.is_some()))
            .all(|(a, b)| a.instant == b.instant)
    );
}

#[test]
fn a_turning_rest_turns_evenly_and_the_next_turn_begins_where_it_ended() {
    let rows = rows("turning_rests = 3\nturning_dps = 4.0\n");
    let mut turning = 0;
    for step in 0..12 {
        let dwell: Vec<_> = rows
            .iter()
            .filter(|r| r.instant.step == Some(step))
            .collect();
        let middle = &dwell[dwell.len() / 4..3 * dwell.len() / 4];
        let dps = |r: &&Row| norm(r.instant.motion.rate).to_degrees();
        let rates: Vec<f64> = middle.iter().map(dps).collect();
        turning += usize::from(rates.iter().all(|w| (w - 4.0).abs() < 0.01));
        assert!(
            rates.iter().all(|w| (w - 4.0).abs() < 0.01 || *w < 0.01),
            "{rates:?}"
        );
    }
    assert_eq!(turning, 3);
    for pair in rows.windows(2) {
        let [a, b] = [&pair[0], &pair[1]].map(|r| r.instant.motion);
        let (_, angle) = (a.attitude.inverse() * b.attitude).axis_angle();
        assert!(angle.to_degrees() < 5.0, "at {} s: {angle} rad", a.t_s);
    }
}

#[test]
fn a_hand_that_settles_is_off_by_its_angle_and_at_rest_in_the_end() {
    let (rows, plain) = (rows("settle_mrad = 50.0\nsettle_s = 2.5\n"), rows(""));
    let mut fastest = 0.0_f64;
    for (a, b) in rows
        .iter()
        .zip(&plain)
        .filter(|(a, _)| a.instant.step.is_some_and(|s| s > 0))
    {
        fastest = fastest.max(norm(add(
            a.instant.motion.rate,
            scale(-1.0, b.instant.motion.rate),
        )));
    }
    // 50 mrad about three axes in 2.5 s, at most 15/8 of the mean rate; the pause may cover the fastest part.
    assert!((0.01..0.3).contains(&fastest), "{fastest}");
    let end = rows
        .iter()
        .zip(&plain)
        .rfind(|(a, _)| a.instant.step == Some(11))
        .unwrap();
    assert_eq!(end.0.instant.motion.attitude, end.1.instant.motion.attitude);
}

#[test]
fn an_upset_gyro_shows_a_rate_that_is_not_there_between_two_dwells() {
    let (upset, plain) = (rows("upset_turns = 1\nupset_dps = 5.0\n"), rows(""));
    let mut off = 0;
    for (a, b) in upset.iter().zip(&plain) {
        assert_eq!((a.instant, a.readings.accel), (b.instant, b.readings.accel));
        if a.readings.gyro != b.readings.gyro {
            off += 1;
        }
    }
    // One turn of one to three seconds and its pauses; the part's low-pass takes a moment to settle.
    assert!((150..700).contains(&off), "{off}");
}

#[test]
fn the_building_sways_the_force_and_turns_nothing() {
    let (swaying, plain) = (rows("building_mg = 2.0\n"), rows(""));
    let mut squares = 0.0;
    for (a, b) in swaying.iter().zip(&plain) {
        let [a, b] = [a, b].map(|r| r.instant.motion);
        assert_eq!((a.attitude, a.rate), (b.attitude, b.rate));
        let sway = add(a.force, scale(-1.0, b.force));
        squares += dot(sway, sway);
    }
    // Two sines of 2 mg amplitude have a combined rms of 2 mg.
    let effective_mg = (squares / plain.len() as f64).sqrt() / 9.80665e-3;
    assert!((effective_mg - 2.0).abs() < 0.1, "{effective_mg}");
}
