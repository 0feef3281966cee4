//! What happened to a unit before a session.

use mimu_rig::history::{ChangeSizes, History};
use mimu_rig::rig_file::{RigFile, RigTruth};

/// The gyros' forward model of a unit with this history.
fn gyro(history: History, seed: u64) -> ([[f64; 3]; 3], [f64; 3]) {
    let mut file = RigTruth::resolve(&RigFile::default(), 7)
        .expect("a rig")
        .file;
    file.history = history;
    let truth = RigTruth::resolve(&file, seed).expect("a rig");
    truth.unit.gyro.affine()
}

/// Relative change of the x gyro's scale factor.
fn scale(history: History, seed: u64) -> f64 {
    let length = |history| {
        gyro(history, seed).0[0]
            .map(|p| p * p)
            .iter()
            .sum::<f64>()
            .sqrt()
    };
    length(history) / length(History::default()) - 1.0
}

const SIZES: ChangeSizes = ChangeSizes {
    gyro_scale_ppm: 1000.0,
    gyro_angle_mrad: 0.0,
    gyro_bias_dps: 0.1,
    accel_scale_ppm: 0.0,
    accel_angle_mrad: 0.0,
    accel_bias_mg: 0.0,
};

#[test]
fn power_ons_differ_and_scatter_by_their_size() {
    let history = History {
        power_on: SIZES,
        ..History::default()
    };
    let all: Vec<f64> = (0..400).map(|seed| scale(history, seed)).collect();
    let rms = (all.iter().map(|x| x * x).sum::<f64>() / 400.0).sqrt();
    // The rms of 400 normal numbers is known to 3.5 %.
    assert!((rms / 1e-3 - 1.0).abs() < 0.15, "{rms}");
}

#[test]
fn ageing_is_even_and_a_shock_comes_before_its_session() {
    let ageing = |session| History {
        session,
        unit_seed: 3,
        ageing: SIZES,
        ..History::default()
    };
    let [one, four] = [1, 4].map(|session| scale(ageing(session), 1));
    assert!(
        one.abs() > 1e-5 && (four / one - 4.0).abs() < 1e-6,
        "{one} {four}"
    );
    // The noise of the session does not change it.
    assert_eq!(one, scale(ageing(1), 2));
    let shock = |session| History {
        session,
        shock: SIZES,
        shock_before: 2,
        ..History::default()
    };
    assert_eq!(scale(shock(1), 1), 0.0);
    assert!(scale(shock(2), 1).abs() > 1e-5);
    assert_eq!(scale(shock(2), 1), scale(shock(5), 1));
}

#[test]
fn the_truth_contains_the_changed_unit_and_no_history() {
    let history = History {
        power_on: SIZES,
        ..History::default()
    };
    let file = RigFile {
        history,
        ..RigFile::default()
    };
    let truth = RigTruth::resolve(&file, 5).expect("a rig");
    assert!(truth.file.history.is_empty());
    let again = RigTruth::resolve(&truth.file, 6).expect("a rig");
    assert_eq!(again.unit.gyro.affine().1, truth.unit.gyro.affine().1);
}
