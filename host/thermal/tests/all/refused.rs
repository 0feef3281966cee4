//! Recordings without usable temperatures: each is refused with the problem and the remedy.

use mimu::{Manifest, Samples};
use mimu_thermal::joint::{Choice, estimate};
use mimu_thermal::warning::Warning;

use crate::says;
use crate::session;
use crate::simulation::Experiment;

/// The error with which the recording is refused after `change`.
fn refusal(change: impl FnOnce(&mut Manifest, &mut Samples)) -> String {
    let (mut manifest, mut samples) = Experiment::ramp(60.0, false).record(1);
    change(&mut manifest, &mut samples);
    let result = session((manifest, samples)).and_then(|s| estimate(&[s], Choice::JOINT));
    result.map(|_| ()).unwrap_err().to_string()
}

#[test]
fn a_thermometer_that_sticks_is_named_with_its_time() {
    let said = refusal(|_, samples| {
        let stuck = samples.temp_c[8000];
        samples.temp_c[8000..11_000].fill(stuck);
    });
    says(&said, &["sticks: from 800", "temp_c"]);
}

#[test]
fn a_thermometer_that_jumps_is_named_with_its_time() {
    let said = refusal(|_, samples| samples.temp_c[9000..].iter_mut().for_each(|t| *t += 4.0));
    says(&said, &["jumps by 4.", "K at 900 s"]);
}

#[test]
fn a_temperature_that_is_missing_in_part_is_named_from_and_to() {
    let said = refusal(|_, samples| samples.temp_c[5000..6000].fill(f64::NAN));
    says(&said, &["no value from 500.0 s", "to 600"]);
    let said = refusal(|_, samples| samples.temp_c.clear());
    assert!(said.contains("temp_c is empty throughout"), "{said}");
}

#[test]
fn a_span_that_shows_no_slope_is_refused_with_what_is_needed() {
    let said = refusal(|_, samples| {
        samples
            .temp_c
            .iter_mut()
            .for_each(|t| *t = 25.0 + 0.1 * (*t - 25.0));
    });
    says(&said, &["a slope needs 10 K, curvature 20 K"]);
}

#[test]
fn a_column_that_spans_more_than_the_dwells_is_refused_with_both_spans_and_what_is_left_out() {
    // Dwells in the first three minutes of a ramp of 80 K; after them every row is in transit.
    let said = refusal(|_, samples| samples.step[1800..].fill(-1));
    assert!(said.contains("the column spans 80"), "{said}");
    assert!(said.contains("the dwells that are used span 5."), "{said}");
    says(&said, &["92.5 % of the samples are outside of dwells"]);
}

/// Two soaks that stay within 0.4 K, at 13 and at 47 °C, and nothing in between.
fn soaks() -> [(Manifest, Samples); 2] {
    [13.0, 47.0].map(|at| {
        let soak = Experiment {
            corners: vec![(0.0, at - 0.2), (2400.0, at + 0.2)],
            ..Experiment::ramp(60.0, false)
        };
        soak.record(at as u64)
    })
}

#[test]
fn soaks_of_one_temperature_each_determine_no_bias_in_between_and_are_refused_together() {
    let sessions = soaks().map(|soak| session(soak).unwrap());
    let said = estimate(&sessions, Choice::JOINT).unwrap_err().to_string();
    assert!(said.contains("its dwells span 34."), "{said}");
    says(&said, &["at most 0.4", "separate biases"]);
}

#[test]
fn temperatures_that_no_recording_crosses_are_said() {
    let [_, warm] = soaks();
    let cold = Experiment {
        corners: vec![(0.0, -10.0), (2400.0, 20.0), (4800.0, -10.0)],
        ..Experiment::ramp(60.0, false)
    };
    let sessions = [session(cold.record(5)).unwrap(), session(warm).unwrap()];
    let joint = estimate(&sessions, Choice::JOINT).unwrap();
    let gap = joint
        .warnings
        .iter()
        .find(|w| matches!(w, Warning::NotCrossed { .. }));
    let said = gap.expect("the gap is said").to_string();
    assert!(said.contains("to 46.8 °C"), "{said}");
}

#[test]
fn two_units_have_two_sets_of_curves() {
    let [first, mut second] = [1, 2].map(|seed| Experiment::ramp(60.0, false).record(seed));
    second.0.device = "another".into();
    let sessions = [session(first).unwrap(), session(second).unwrap()];
    let said = estimate(&sessions, Choice::JOINT).unwrap_err().to_string();
    says(&said, &["\"another\"", "\"mti-g\""]);
}

#[test]
fn inputs_that_leave_a_scale_factor_open_are_named() {
    let said = refusal(|_, samples| samples.reference[2].fill(0.0));
    assert!(said.contains("gyro") && said.contains("along z"), "{said}");
}

#[test]
fn a_ramp_too_fast_for_the_lag_is_refused_with_the_rate_that_is_not() {
    let experiment = Experiment {
        corners: vec![
            (0.0, -10.0),
            (480.0, 70.0),
            (1500.0, 70.0),
            (1980.0, -10.0),
            (3000.0, -10.0),
        ],
        ..Experiment::ramp(180.0, true)
    };
    let fast = session(experiment.record(3)).unwrap();
    let said = estimate(&[fast], Choice::JOINT).unwrap_err().to_string();
    says(&said, &["too fast", "at most"]);
}
