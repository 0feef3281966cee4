//! Errors and intervals of the estimators on units whose truth is known: a 95 % interval must contain the truth in 95 % of the cases, for each
//! parameter.

use mimu::estimate::known_input::least_squares;
use mimu::estimate::{EarthShare, Observation};
use mimu::quantity::Sensor;
use mimu_rig::ideal::Ideal;
use mimu_rig::random::Random;
use mimu_tests::bench;
use mimu_tests::coverage::{
    Dwells, Tally, by_hand, on_a_record_player, with_a_table, with_turning_inputs,
};
use nalgebra::Vector3;

/// Every parameter within 93 to 97 %, plus a margin for the limited number of runs: 4 sigmas, because up to 60 parameters are tested.
fn judge(tally: &Tally) {
    let [mean, low, high] = tally.summary();
    println!(
        "{:<36}{:>6} runs: 95 % intervals hold the truth in {:.1} % ({:.1} to {:.1} by parameter), rms error {:.3} sigma",
        tally.name,
        tally.runs,
        100.0 * mean,
        100.0 * low,
        100.0 * high,
        tally.rms()
    );
    let margin = |share: f64| 4.0 * (share * (1.0 - share) / f64::from(tally.runs)).sqrt();
    assert!(
        low > 0.93 - margin(0.93),
        "{}: {:?}",
        tally.name,
        tally.shares()
    );
    assert!(
        high < 0.97 + margin(0.97),
        "{}: {:?}",
        tally.name,
        tally.shares()
    );
}

/// Dwells of 1000 samples at known rates: each axis in both directions, and rest.
fn on_a_table(unit: &Ideal, random: &mut Random) -> Vec<Observation> {
    let rates = [-5.0, -2.0, 2.0, 5.0];
    let turns = (0..3).flat_map(|axis| rates.map(|r| Vector3::ith(axis, r)));
    turns
        .chain([Vector3::zeros(); 4])
        .enumerate()
        .map(|(dwell, input)| Observation {
            dwell,
            raw: unit.read(input.into(), 1000, random).into(),
            variance: Vector3::from(unit.sigma).map(|s| s * s / 1000.0),
            input,
            earth: EarthShare::NONE,
            change: Vector3::zeros(),
        })
        .collect()
}

/// Recordings of each kind in every run of the tests: enough to detect an interval that contains the truth in only 85 % of the cases.
const FEW: u64 = 80;

#[test]
fn intervals_hold_the_truth_where_the_input_is_known() {
    with_a_table(FEW, Dwells::Randomised).iter().for_each(judge);
}

/// Tests the parameters, and the delays against the filters of the bench.
fn turning_inputs(runs: u64) {
    let (tallies, delays) = with_turning_inputs(runs);
    tallies.iter().for_each(judge);
    for (errors, sensor) in delays.iter().zip(Sensor::BOTH) {
        let n = errors.len() as f64;
        let inside = errors.iter().filter(|e| e.abs() < 1.96).count() as f64 / n;
        let rms = (errors.iter().map(|e| e * e).sum::<f64>() / n).sqrt();
        println!(
            "delays of the {sensor}: {n} of them, 95 % intervals hold {:.1} %, rms error {rms:.3} sigma",
            100.0 * inside
        );
        assert!(
            (0.8..1.25).contains(&rms),
            "{sensor}: rms error of {rms} sigma"
        );
    }
}

#[test]
fn intervals_hold_the_truth_where_inputs_move_within_dwells() {
    turning_inputs(24);
}

/// Rates known to 0.3 %, twenty times the noise of a scale factor here.
const INEXACT: f64 = 0.003;

/// Rates known to 0.01 %, which is below the noise of a scale factor here.
const EXACT: f64 = 0.0001;

fn record_players(runs: u64, rate_errors: &[f64]) {
    for &rate_error in rate_errors {
        println!("rates known to {} %", 100.0 * rate_error);
        on_a_record_player(runs, rate_error).iter().for_each(judge);
    }
}

#[test]
fn intervals_hold_the_truth_on_a_record_player_of_which_the_rates_are_known_to_within_an_error() {
    record_players(24, &[INEXACT]);
}

#[test]
#[ignore = "nightly: more recordings"]
fn intervals_of_many_hold_the_truth_on_a_record_player() {
    record_players(200, &[INEXACT, EXACT]);
}

#[test]
#[ignore = "nightly: more recordings"]
fn intervals_of_many_hold_the_truth_where_inputs_move_within_dwells() {
    turning_inputs(200);
}

/// Dwells in the listed order. Without the noise of the unit at rest the share drops to 90 %, because the intervals then lack the wander that
/// neighbouring dwells share.
#[test]
fn intervals_hold_the_truth_of_dwells_that_share_the_wander_where_it_is_known() {
    with_a_table(FEW, Dwells::AsListedWithNoise)
        .iter()
        .for_each(judge);
}

#[test]
fn intervals_hold_the_truth_where_only_gravity_is_known() {
    by_hand(FEW / 2, true).iter().for_each(judge);
}

/// A table that repeats its rates only to 0.1 %, or a bias that wanders: dwells scatter more than the noise, and the intervals must include this.
#[test]
fn intervals_hold_the_truth_where_dwells_scatter_more_than_the_noise() {
    let all: Vec<usize> = (0..12).collect();
    let mut tally = Tally::new("scattering dwells", &all);
    for seed in 0..2000 {
        let mut random = Random::new(seed, "unit");
        let model = bench::gyro(&mut random);
        let unit = Ideal {
            matrix: model.matrix,
            bias: model.bias,
            sigma: [2e-3; 3],
        };
        let mut dwells = on_a_table(&unit, &mut random);
        for dwell in &mut dwells {
            for axis in 0..3 {
                dwell.raw[axis] += 1e-3 * random.normal();
            }
        }
        let found = least_squares(&dwells, &[], None).unwrap().triad;
        tally.add(&found, &bench::parameters(&model));
    }
    judge(&tally);
}
