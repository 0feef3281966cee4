//! The Earth's rate on a table: the bench turns, and the truth is the bias that the rig file states.

use mimu_tests::earth::{DEG_PER_H, Errors, Experiment, run};

/// A few runs, and all of their errors.
fn runs(experiment: Experiment, latitude_known: bool, seeds: u64) -> (Vec<Errors>, Vec<[f64; 3]>) {
    let each: Vec<Errors> = (1..=seeds)
        .map(|seed| run(experiment, latitude_known, seed))
        .collect();
    let all = each.iter().flat_map(|e| e.all.iter().copied()).collect();
    (each, all)
}

/// Every error is within four standard deviations of zero: by chance one in 16000 is not.
fn assert_covered(errors: &[[f64; 3]]) {
    for [error, sigma, _] in errors {
        assert!(error.abs() < 4.0 * sigma, "{errors:?}");
    }
}

fn names_the_earth(errors: &Errors) -> bool {
    errors.warnings.iter().any(|w| w.contains("NoLatitude"))
}

#[test]
fn a_fibre_gyro_on_six_faces_errs_by_less_than_its_intervals_say_and_far_less_than_the_earth_turns()
{
    let (each, errors) = runs(Experiment::Fibre, true, 4);
    assert_covered(&errors);
    let mut sizes: Vec<f64> = errors.iter().map(|e| e[0].abs()).collect();
    sizes.sort_by(f64::total_cmp);
    assert!(sizes[sizes.len() / 2] < 0.2 * DEG_PER_H, "{errors:?}");
    assert!(!each.iter().any(names_the_earth), "{each:?}");
}

#[test]
fn without_a_latitude_the_rate_of_the_earth_is_in_the_intervals_and_named() {
    let (each, errors) = runs(Experiment::Fibre, false, 4);
    assert_covered(&errors);
    assert!(each.iter().all(names_the_earth), "{each:?}");
}

#[test]
fn a_good_mems_gyro_on_a_table_is_not_off_by_the_rate_of_the_earth() {
    let (_, errors) = runs(Experiment::Table, true, 4);
    assert_covered(&errors);
    // The noise of the dwells leaves 1.5 deg/h. An Earth that is left in the bias adds 5 to 15.
    let normal = errors.iter().map(|e| (e[0] / e[1]).powi(2)).sum::<f64>() / errors.len() as f64;
    assert!(normal.sqrt() < 1.5, "{errors:?}");
    assert!(errors.iter().all(|e| e[1] < 2.0 * DEG_PER_H), "{errors:?}");
}

#[test]
fn the_scheme_of_niu_gives_biases_over_temperature_without_the_rate_of_the_earth() {
    let (each, errors) = runs(Experiment::Ramp, true, 2);
    let rms = errors.iter().map(|e| e[0] * e[0]).sum::<f64>() / errors.len() as f64;
    assert_covered(&errors);
    // The noise of the scheme leaves 0.6 deg/h; the Earth turns at 15.
    assert!(rms.sqrt() < 2.0 * DEG_PER_H, "{errors:?}");
    assert!(each.iter().all(|e| e.verdict != "misfit"), "{each:?}");
}
