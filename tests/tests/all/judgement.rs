//! Every kind of judgement, on recordings whose fault is made by the bench or by a driver that errs.

use std::fs;
use std::path::Path;

use mimu::calibration::Calibration;
use mimu::calibration::verify::{Causes, Share, Verification, verify};
use mimu::fit::{Fit, Options, fit};
use mimu::judgement::{Judgement, JudgementKind};
use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use mimu::signal::stillness::STILL_FACTOR;
use mimu::warning::Warning;
use mimu_recording::{RawUnit, Recording};
use mimu_rig::rig_file::{AffineFile, RigFile};
use mimu_tests::bench;
use nalgebra::{Matrix3, Vector3};

const SEED: u64 = 4;

fn unit() -> RigFile {
    bench::drawn(SEED, "unit")
}

fn fitted(prepared: Prepared) -> Fit {
    fit(prepared, Options::default()).expect("a fit")
}

fn kind(prepared: Prepared) -> JudgementKind {
    let judgement = Judgement::of_fit(&fitted(prepared));
    judgement.kind
}

/// What a driver makes of the volts of the bench: readings in rad/s and m/s² by the data sheet's 5 mV per deg/s about 2.5 V and 80 mV per m/s² about
/// 1.65 V, then changed by `fault`, which is given the share of the recording that has passed and the six readings.
fn driven(fault: impl Fn(f64, &mut [f64])) -> Prepared {
    driven_on(SEED, fault)
}

/// Converts the readings of a file to SI by the nulls and sensitivities of the parts, with a fault.
fn convert(path: &Path, fault: impl Fn(f64, &mut [f64])) {
    let text = fs::read_to_string(path).expect("samples");
    let rows = text.lines().count() as f64;
    let mut lines = text.lines();
    let head = lines.next().expect("a header");
    let at = |name: &str| head.split(',').position(|c| c == name).expect("a column");
    let first = at("gyro_x");
    assert_eq!(at("accel_z"), first + 5);
    let mut out = format!("{head}\n");
    for (row, line) in lines.enumerate() {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        let mut six: Vec<f64> = cells[first..first + 6]
            .iter()
            .map(|c| c.parse().expect("a reading"))
            .collect();
        six[..3]
            .iter_mut()
            .for_each(|u| *u = ((*u - 2.5) / 5e-3).to_radians());
        six[3..].iter_mut().for_each(|u| *u = (*u - 1.65) / 0.08);
        fault(row as f64 / rows, &mut six);
        for (cell, value) in cells[first..].iter_mut().zip(six) {
            *cell = format!("{value:.9}");
        }
        out += &(cells.join(",") + "\n");
    }
    fs::write(path, out).expect("written");
}

/// The same on the day `seed`.
fn driven_on(seed: u64, fault: impl Fn(f64, &mut [f64])) -> Prepared {
    let plan = bench::hand_plan(30).replace("carrier", "samples = \"csv\"\ncarrier");
    let folder = bench::written(&plan, &self::unit(), seed);
    let recording = folder.path().join("recording");
    convert(&recording.join("samples.csv"), fault);
    let mut recording = Recording::open(&recording).expect("a recording");
    recording.manifest.raw_unit = RawUnit::Si;
    Prepared::read(&recording, STILL_FACTOR, |_| ()).expect("readable")
}

#[test]
fn a_clean_session_of_thirty_poses_is_good() {
    let prepared = bench::recorded(&bench::hand_plan(30), &unit(), SEED);
    assert_eq!(kind(prepared), JudgementKind::Good);
    assert_eq!(kind(driven(|_, _| ())), JudgementKind::Good);
}

#[test]
fn a_range_that_changes_in_the_middle_is_a_misfit_or_refused() {
    let changed = driven(|passed, six| {
        if passed > 0.5 {
            six[3..].iter_mut().for_each(|v| *v *= 0.5);
        }
    });
    if let Ok(fit) = fit(changed, Options::default()) {
        assert_eq!(Judgement::of_fit(&fit).kind, JudgementKind::Misfit);
    }
}

#[test]
fn nothing_held_out_is_untested() {
    let prepared = bench::recorded(&bench::hand_plan(30), &unit(), SEED);
    let fit = fit(prepared, Options::IN_SAMPLE).expect("a fit");
    assert_eq!(Judgement::of_fit(&fit).kind, JudgementKind::Untested);
}

#[test]
fn an_error_that_the_model_lacks_is_unexplained_and_a_file_contains_it() {
    let fit = fitted(driven(bent));
    let judgement = Judgement::of_fit(&fit);
    assert_eq!(judgement.kind, JudgementKind::Unexplained);
    let file = Calibration::of(&fit, &[], "").expect("a file").to_toml();
    let read = Calibration::parse(&file, "file").expect("readable");
    assert_eq!(read.judgement, Some(judgement));
}

/// A quadratic of 20 mg at 1 g.
fn bent(_: f64, six: &mut [f64]) {
    six[3..].iter_mut().for_each(|v| *v += 2e-3 * *v * *v);
}

/// The misfit widens the intervals of the file, and is as large on the next day.
#[test]
fn a_file_whose_own_fit_errs_is_good_on_no_other_day() {
    let first = fitted(driven(bent));
    let file = Calibration::of(&first, &[], "").expect("a file");
    let own = file.judgement.clone().expect("a judgement");
    for seed in [5, 6] {
        let later = driven_on(seed, bent);
        let found = verify(&later, &file).expect("verified");
        assert!(found.judgement.kind >= own.kind, "{}", found.judgement);
        // Also without the word of the file.
        let mut unjudged = file.clone();
        unjudged.judgement = None;
        let found = verify(&later, &unjudged).expect("verified");
        assert_eq!(
            found.judgement.kind,
            JudgementKind::Unexplained,
            "{}",
            found.judgement
        );
    }
}

fn matrix(model: &AffineFile) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| model.matrix[i][j])
}

/// The unit after a change of its biases by `bias` SI, and of its sensors by `gain`: `P' = P (1 + gain)`.
fn changed(model: &AffineFile, bias: [f64; 3], gain: &Matrix3<f64>) -> AffineFile {
    let p = matrix(model);
    let after = p * (Matrix3::identity() + gain);
    let moved = p * Vector3::from(bias);
    AffineFile {
        matrix: std::array::from_fn(|i| std::array::from_fn(|j| after[(i, j)])),
        bias: std::array::from_fn(|i| model.bias[i] + moved[i]),
    }
}

/// A unit calibrated and then verified after its accelerometer changed.
fn verified(plan: &str, bias: [f64; 3], gain: &Matrix3<f64>) -> (Verification, Prepared) {
    let before = unit();
    let calibration = fitted(bench::recorded(plan, &before, SEED));
    let calibration = Calibration::of(&calibration, &[], "").expect("a calibration");
    let mut after = before.clone();
    let accel = before.unit.accel_affine.as_ref().expect("given");
    after.unit.accel_affine = Some(changed(accel, bias, gain));
    let later = bench::recorded(plan, &after, SEED + 1);
    (verify(&later, &calibration).expect("verified"), later)
}

fn causes(verification: &Verification) -> &Causes {
    let accel = verification.sensors[Sensor::Accel].as_ref();
    let causes = accel.and_then(|s| s.causes.as_ref());
    causes.expect("the recording distinguishes them")
}

/// A symmetric change: a magnitude shows no other.
fn gain(size: f64) -> Matrix3<f64> {
    size * Matrix3::new(1.0, 0.4, -0.3, 0.4, -0.8, 0.5, -0.3, 0.5, 0.6)
}

#[test]
fn a_changed_bias_is_distinguished_from_a_wrong_matrix_with_intervals_that_contain_the_truth() {
    let still = [0.0; 3];
    let moved = [0.10, -0.07, 0.05];
    for (bias, size) in [(moved, 0.0), (still, 0.01), (moved, 0.01)] {
        let (found, later) = verified(&bench::table_plan(Some(SEED)), bias, &gain(size));
        assert!(
            found.judgement.kind >= JudgementKind::Unexplained,
            "{}",
            found.judgement
        );
        let causes = causes(&found);
        // By physics: the calibration reads (1 + gain) x + bias for x.
        let inputs: Vec<Vector3<f64>> = later
            .observations(Sensor::Accel)
            .iter()
            .map(|o| o.input)
            .collect();
        let n = inputs.len() as f64;
        let of_matrix = inputs.iter().map(|x| (gain(size) * x).norm_squared());
        let of_matrix = of_matrix.sum::<f64>() / n;
        let of_bias = Vector3::from(bias).norm_squared();
        let truth = of_bias / (of_bias + of_matrix);
        let margin = 0.01;
        let within = |share: f64, s: &Share| (s.lower - margin..=s.upper + margin).contains(&share);
        assert!(within(truth, &causes.bias), "{truth} {:?}", causes.bias);
        assert!(within(1.0 - truth, &causes.matrix), "{:?}", causes.matrix);
        assert!(causes.bias.upper - causes.bias.lower < 0.1);
        for k in 0..3 {
            let off = (causes.bias_change[k] - bias[k]).abs();
            // The biases of two sessions differ by their wander, too.
            assert!(
                off < causes.bias_change_interval[k] + 5e-3,
                "{off} {causes:?}"
            );
        }
    }
}

#[test]
fn by_hand_the_magnitude_of_gravity_distinguishes_them_too() {
    let plan = bench::hand_plan(30);
    let (found, _) = verified(&plan, [0.10, -0.07, 0.05], &gain(0.0));
    let causes = self::causes(&found);
    assert!(
        causes.bias.lower > 0.9 && causes.matrix.upper < 0.1,
        "{causes:?}"
    );
    let (found, _) = verified(&plan, [0.0; 3], &gain(0.01));
    let causes = self::causes(&found);
    assert!(
        causes.matrix.lower > 0.9 && causes.bias.upper < 0.1,
        "{causes:?}"
    );
}

#[test]
fn another_gravity_than_that_of_the_calibration_is_named_if_the_readings_contradict_it() {
    let plan = bench::hand_plan(30);
    let calibration = fitted(bench::recorded(&plan, &unit(), SEED));
    let calibration = Calibration::of(&calibration, &[], "").expect("a calibration");
    let mut later = bench::recorded(&plan, &unit(), SEED + 1);
    later.manifest.gravity_mps2 = fitted_gravity(&calibration);
    let named = |later: &Prepared| {
        let found = verify(later, &calibration).expect("verified");
        let gravity = found.warnings.iter().find_map(|w| match w {
            Warning::OtherGravity { contradicted, .. } => Some(*contradicted),
            _ => None,
        });
        (gravity, found.judgement.kind)
    };
    assert_eq!(named(&later).0, None);
    later.manifest.gravity_mps2 -= 0.0097;
    let (contradicted, kind) = named(&later);
    assert_eq!(contradicted, Some(true));
    assert!(kind >= JudgementKind::Suspect);
}

fn fitted_gravity(calibration: &Calibration) -> f64 {
    calibration.recording.gravity_mps2.expect("known")
}
