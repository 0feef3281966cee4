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
