//! Flaws of real recordings, made by the bench: each is detected, and the calibration is as good as without it.

use mimu::fit::{Fit, Options, fit};
use mimu::quantity::Sensor;
use mimu::signal::dwell::{Dwell, Fault};
use mimu::warning::Warning;
use mimu_rig::located::Source;
use mimu_rig::rig_file::RigFile;
use mimu_tests::bench;

/// A 16-bit rig whose gyro scale factors are 3600 counts per rad/s.
fn rig(rest_of_rig: &str) -> RigFile {
    let rig = format!(
        "format = \"mimu-rig/1\"\nearth_rate = false\n{rest_of_rig}\n[unit]\ngyro = \"MPU6050-gyro\"\naccel = \"MPU6050-accel\"\n\
         [unit.gyro_affine]\nmatrix = [[3600.0, 0.0, 0.0], [0.0, 3600.0, 0.0], [0.0, 0.0, 3600.0]]\nbias = [30.0, -20.0, 10.0]\n\
         [unit.accel_affine]\nmatrix = [[1670.0, 0.0, 0.0], [0.0, 1670.0, 0.0], [0.0, 0.0, 1670.0]]\nbias = [100.0, 50.0, -80.0]\n"
    );
    RigFile::parse(&Source::new("RIG.toml", rig)).expect("a rig")
}

/// A fit of 38 poses by hand.
fn by_hand(rest_of_rig: &str) -> Fit {
    let file = rig(rest_of_rig);
    let prepared = bench::recorded(&bench::hand_plan(38), &file, 7);
    fit(prepared, Options::default()).expect("it can be fitted")
}

/// Largest relative error of the gyros' scale factors.
fn scale_error(fit: &Fit) -> f64 {
    let gyro = fit.sensor(Sensor::Gyro).expect("a gyro");
    let matrix = gyro.estimated.triad.forward.matrix;
    let off = matrix
        .row_iter()
        .map(|row| (row.norm() / 3600.0 - 1.0).abs());
    off.fold(0.0, f64::max)
}

/// Five times the largest error without a flaw.
const FINE: f64 = 1e-3;

#[test]
fn a_recording_without_a_flaw_loses_no_dwell_and_no_turn() {
    let fit = by_hand("");
    assert!(scale_error(&fit) < FINE, "{}", scale_error(&fit));
    assert!(fit.prepared.dwells.left_out.is_empty());
    assert!(
        fit.prepared
            .dwells
            .list
            .iter()
            .all(|d| d.faults.gyro != Some(Fault::Turning))
    );
    assert!(
        !fit.warnings.iter().any(|w| w.to_string().contains("rail")),
        "{:?}",
        fit.warnings
    );
}

#[test]
fn a_violent_shake_is_clipped_and_its_turn_left_out_by_name() {
    let fit = by_hand("[flaws]\nshake_turns = 1\n");
    assert!(scale_error(&fit) < FINE, "{}", scale_error(&fit));
    let named = |w: &Warning| {
        matches!(
            w,
            Warning::TurnNotUsed {
                fault: Some(Fault::Saturated(_)),
                ..
            }
        )
    };
    assert_eq!(
        fit.warnings.iter().filter(|w| named(w)).count(),
        1,
        "{:?}",
        fit.warnings
    );
}

/// In the noise of analog parts a turn of 0.7 deg/s goes unnoticed: three such rests among 38 tripled the error of the gyro.
#[test]
fn a_rest_that_turns_evenly_is_no_dwell() {
    let mut file = bench::drawn(7, "unit");
    let turning = |file: &RigFile| {
        let prepared = bench::recorded(&bench::hand_plan(38), file, 7);
        let is = |d: &&Dwell| d.faults.gyro == Some(Fault::Turning);
        prepared.dwells.list.iter().filter(is).count()
    };
    assert_eq!(turning(&file), 0);
    file.flaws.turning_rests = 3;
    file.flaws.turning_dps = 0.7;
    assert_eq!(turning(&file), 3);
}

#[test]
fn an_upset_turn_is_left_out_with_its_size() {
    let fit = by_hand("[flaws]\nupset_turns = 1\n");
    let [left_out] = fit.prepared.dwells.left_out[..] else {
        panic!("{:?}", fit.prepared.dwells.left_out)
    };
    assert_eq!(left_out.sensor, Sensor::Gyro);
    // 5 deg/s over a turn of some seconds.
    assert!(
        (2.0..40.0).contains(&left_out.error.to_degrees()),
        "{left_out:?}"
    );
    assert!(scale_error(&fit) < FINE, "{}", scale_error(&fit));
}

#[test]
fn a_real_effect_is_no_outlier() {
    for effect in [
        "id = \"accel_scale_cubic\"\nmg_per_g3 = [10.0, -10.0, 10.0]\n",
        "id = \"accel_scale_quadratic\"\nmg_per_g2 = [10.0, 10.0, -10.0]\n",
        "id = \"gyro_scale_asymmetry\"\ndps_at_300dps = [2.0, 2.0, -2.0]\n",
        "id = \"gyro_g_sensitivity\"\n",
    ] {
        let fit = by_hand(&format!("[[effect]]\n{effect}"));
        assert!(
            fit.prepared.dwells.left_out.is_empty(),
            "{effect}{:?}",
            fit.prepared.dwells.left_out
        );
        let turning = |d: &Dwell| d.faults.gyro == Some(Fault::Turning);
        assert!(!fit.prepared.dwells.list.iter().any(turning), "{effect}");
    }
}
