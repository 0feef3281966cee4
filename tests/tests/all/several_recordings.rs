//! Diagnosis of several recordings of one unit, and of one that was never turned.
//!
//! Between recordings a unit is switched off, so its biases change; this must not be taken for an effect.

use mimu::calibration::Calibration;
use mimu::diagnose::rejected::Reason;
use mimu::diagnose::{Diagnosis, Recordings, Verdict, diagnose};
use mimu::diagnosed::diagnosed;
use mimu::fit::{Options, fit};
use mimu::judgement::JudgementKind;
use mimu::prepared::Prepared;
use mimu::signal::stillness::STILL_FACTOR;
use mimu_recording::RawUnit;
use mimu_rig::rig_file::RigFile;
use mimu_tests::bench;
use mimu_tests::blind::{plan, unit};
use mimu_tests::recordings::{Foreign, data_set};

/// A session of the unit `file`: the seed determines noise and order, and the biases move by 15 mV (3 deg/s) and 20 mV (25 mg).
fn session(file: &RigFile, seed: u64) -> Prepared {
    let mut file = file.clone();
    for (k, (model, by)) in [
        (&mut file.unit.gyro_affine, 0.015),
        (&mut file.unit.accel_affine, 0.02),
    ]
    .into_iter()
    .enumerate()
    {
        let bias = &mut model.as_mut().expect("stated").bias;
        let sign = if (seed + k as u64).is_multiple_of(2) {
            1.0
        } else {
            -1.0
        };
        bias.iter_mut().for_each(|b| *b += sign * by);
    }
    let prepared = bench::recorded(&plan(seed), &file, seed);
    let noise = bench::noise_file(&file, seed, prepared.condensed.period_s);
    prepared.with_noise(&noise).expect("its noise")
}

fn ids(found: &Diagnosis) -> Vec<String> {
    found.effects.iter().map(|e| e.candidate.id()).collect()
}

fn together(first: Prepared, more: Vec<Prepared>) -> Diagnosis {
    let recordings = Recordings {
        first,
        more,
        second: None,
        given: None,
    };
    diagnose(recordings, Options::IN_SAMPLE).expect("a diagnosis")
}

fn judged_by(first: Prepared, second: Prepared) -> Diagnosis {
    let recordings = Recordings {
        first,
        more: Vec::new(),
        second: Some(second),
        given: None,
    };
    diagnose(recordings, Options::IN_SAMPLE).expect("a diagnosis")
}

#[test]
fn biases_that_change_between_recordings_are_no_effect() {
    let file = unit(&[], 3);
    let found = together(session(&file, 31), vec![session(&file, 32)]);
    assert_eq!(found.verdict, Verdict::Clean, "{:?}", ids(&found));
}

#[test]
fn a_second_recording_bears_an_effect_out_or_refuses_it() {
    let file = unit(&["gyro_g_sensitivity"], 7);
    let agrees = judged_by(session(&file, 71), session(&file, 72));
    assert_eq!(ids(&agrees), ["gyro_g_sensitivity"]);
    let gyro = &agrees.sensors[0].decision;
    let second = gyro.accepted[0].second.expect("judged");
    assert!(second.shows);
    assert!(second.rms_after < second.rms_before && second.rms_after < 1.3 * gyro.noise_floor);

    // An effect in one session only, such as a fixture that bends, is not a property of the unit.
    let mut other = file.clone();
    other.effect.clear();
    let refuted = judged_by(session(&file, 71), session(&other, 72));
    assert!(refuted.effects.is_empty(), "{:?}", ids(&refuted));
    let why = &refuted.sensors[0].decision.rejected;
    assert!(
        why.iter().any(
            |r| r.id == "gyro_g_sensitivity" && matches!(r.reason, Reason::SecondRecording(..))
        ),
        "{why:?}"
    );
    assert_eq!(refuted.verdict, Verdict::Unexplained);
}

#[test]
fn recordings_of_two_units_are_refused() {
    let file = unit(&[], 3);
    let first = session(&file, 31);
    let mut other = first.clone();
    other.manifest.device = "unit-008".into();
    let recordings = Recordings {
        more: vec![other],
        ..first.into()
    };
    let refused = diagnose(recordings, Options::IN_SAMPLE).unwrap_err();
    assert!(refused.to_string().contains("unit-008"), "{refused}");
}

/// 25 bursts of five seconds over two hours in a chamber that only cools.
fn cooling() -> Option<Prepared> {
    let data = data_set("pan_tvac_gyro")?;
    let foreign = Foreign {
        files: vec![(
            data.join("TVCtest3_7_20.csv"),
            "t_s,-,-,-,gyro_x,gyro_y,gyro_z,temp_c",
        )],
        rate_hz: Some(50.0),
        gravity_mps2: 9.804,
        raw_unit: RawUnit::Si,
        // Halved, as its authors do; 172 counts per degree, from an unrecorded origin.
        scales: &["t_s=0.001", "gyro=0.5", "temp_c=0.0058139535"],
        inputs: None,
    };
    let folder = tempfile::tempdir().expect("a folder");
    let recording = foreign.import(&folder).expect("importable");
    Some(Prepared::read(&recording, STILL_FACTOR, |_| ()).expect("readable"))
}

#[test]
fn a_chamber_that_only_cools_cannot_tell_temperature_from_time() {
    let Some(prepared) = cooling() else { return };
    let found = diagnose(prepared.into(), Options::IN_SAMPLE).expect("a diagnosis");
    let gyro = &found.sensors[0].decision;
    let of_slow = |id: &str| {
        id.contains("thermal")
            || id.contains("drift")
            || id.contains("temp")
            || id.contains("time")
            || id.contains("warm")
    };
    assert!(!gyro.accepted.is_empty(), "{:?}", gyro.rejected);
    for a in &gyro.accepted {
        assert!(of_slow(&a.chosen.candidate.id()));
    }
    assert!(gyro.held_out_rms[1] < 0.2 * gyro.held_out_rms[0]);
    let told = gyro.notes.iter().any(|n| n.contains("only falls"));
    assert!(told, "{:?}", gyro.notes);
}

#[test]
fn one_pose_with_a_given_matrix_tests_nothing_and_is_no_misfit() {
    let file = bench::drawn(5, "one pose");
    let poses = |count, seed| bench::recorded(&bench::hand_plan(count), &file, seed);
    let fitted = fit(poses(24, 1), Options::default()).expect("a fit");
    let given = Calibration::of(&fitted, &[], "2026-01-01T00:00:00Z").expect("a calibration");
    let recordings = Recordings {
        given: Some(&given),
        ..poses(1, 2).into()
    };
    let found = diagnosed(recordings, [None, Some("given")], "", &|_| ()).expect("a diagnosis");
    let judgement = found.result.judgement;
    assert_eq!(judgement.kind, JudgementKind::Untested, "{judgement}");
}

#[test]
fn ten_poses_by_hand_leave_nothing_to_find_in_an_accelerometer() {
    let Some(data) = data_set("suarez_mpu6050") else {
        return;
    };
    let foreign = Foreign {
        files: vec![(
            data.join("example_data_calibration.csv"),
            "accel_x,accel_y,accel_z,gyro_x,gyro_y,gyro_z",
        )],
        rate_hz: Some(100.0),
        gravity_mps2: 9.79,
        raw_unit: RawUnit::Count,
        scales: &[],
        inputs: None,
    };
    let folder = tempfile::tempdir().expect("a folder");
    let recording = foreign.import(&folder).expect("importable");
    let prepared = Prepared::read(&recording, STILL_FACTOR, |_| ()).expect("readable");
    let found = diagnose(prepared.into(), Options::IN_SAMPLE).expect("a diagnosis");
    assert!(found.effects.is_empty(), "{:?}", ids(&found));
    let accel = &found.sensors[1].decision;
    // One of the ten is too short; nine poses determine nine parameters.
    assert_eq!(accel.rows, [9, 9]);
    assert!(
        accel
            .not_excited
            .iter()
            .any(|e| e.id == "accel_scale_quadratic")
    );
}
