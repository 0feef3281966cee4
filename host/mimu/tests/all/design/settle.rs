//! Experiments that show effects and tell them apart: optima that are known from elsewhere, and what a plan is said to show.

use mimu::design::budget::DwellNoise;
use mimu::design::reach::{Carrier, RateList, Rates};
use mimu::design::settle::layout::Goal;
use mimu::design::settle::pool::{Pool, Rows};
use mimu::design::settle::{Question, SEEN, Suspect, settle};
use mimu::design::tour::Motion;
use mimu::diagnose::library;
use mimu::quantity::Sensor;
use mimu_recording::Reference;
use nalgebra::{DMatrix, DVector};

/// The fewest of `points` such that the last of the regressors has this information beside the others.
fn fewest(points: &[f64], regressors: impl Fn(f64) -> Vec<f64>, information: f64) -> Vec<f64> {
    let width = regressors(0.0).len();
    let rows = Rows {
        width,
        rows: points.iter().flat_map(|x| regressors(*x)).collect(),
        start: DMatrix::from_diagonal_element(width, width, 1e-9),
    };
    let goal = Goal {
        members: vec![(0, width - 1)],
        limit: information,
        suspect: Some(0),
        name: "last".into(),
    };
    let (chosen, enough) = Pool::of(vec![rows], vec![goal]).fewest(1, 200);
    assert!(enough);
    chosen.into_iter().map(|i| points[i]).collect()
}

fn grid(step: f64) -> Vec<f64> {
    let n = (1.0 / step).round() as i32;
    (-n..=n).map(|k| f64::from(k) / f64::from(n)).collect()
}

fn count(points: &[f64], wanted: impl Fn(f64) -> bool) -> usize {
    points.iter().filter(|x| wanted(**x)).count()
}

#[test]
fn a_square_is_told_from_a_line_at_minus_one_nothing_and_one() {
    // Atkinson and Fedorov: weights 1/4, 1/2, 1/4, and a quarter of a dwell's information each.
    let found = fewest(&grid(0.05), |x| vec![1.0, x, x * x], 2.0 - 1e-6);
    assert_eq!(found, [-1.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0]);
}

#[test]
fn a_cube_is_told_from_a_parabola_at_the_extrema_of_chebyshev() {
    // 4 x³ - 3 x: ±1 with 1/6, ±1/2 with 1/3, and 1/16 of a dwell's information each.
    let found = fewest(&grid(0.05), |x| vec![1.0, x, x * x, x * x * x], 0.75 - 1e-6);
    let shares = [-1.0, -0.5, 0.5, 1.0].map(|at| count(&found, |x| (x - at).abs() < 1e-9));
    assert_eq!((found.len(), shares), (12, [2, 4, 4, 2]));
}

#[test]
fn a_square_is_told_from_an_asymmetry_at_rest_half_rate_and_full_rate() {
    // x² beside |x|: Chebyshev's 8 u² - 8 u + 1 of u = |x|: 0, 1/2, 1 with 1/4, 1/2, 1/4; 1/64 each.
    let found = fewest(&grid(0.05), |x| vec![1.0, x, x.abs(), x * x], 0.125 - 1e-8);
    let shares = [0.0, 0.5, 1.0].map(|at: f64| count(&found, |x| (x.abs() - at).abs() < 1e-9));
    assert_eq!((found.len(), shares), (8, [2, 4, 2]));
}

#[test]
fn the_published_example_of_two_rival_models_is_found() {
    // Atkinson and Fedorov, Biometrika 62 (1975), 4.5 - 1.5 exp(x) - 2 exp(-x) against a parabola: -1, -0.669, 0.144, 0.957
    // with 0.253, 0.428, 0.247, 0.072, of 1.087e-3 a dwell.
    let truth = |x: f64| 4.5 - 1.5 * x.exp() - 2.0 * (-x).exp();
    let found = fewest(
        &grid(0.001 * 20.0 / 3.0),
        |x| vec![1.0, x, x * x, truth(x)],
        0.1 * 1.087,
    );
    let n = found.len() as f64;
    assert!((99.0..=102.0).contains(&n), "{n}");
    let near = |at: f64| count(&found, |x| (x - at).abs() < 0.06) as f64 / n;
    for (at, share) in [
        (-1.0, 0.253),
        (-0.669, 0.428),
        (0.144, 0.247),
        (0.957, 0.072),
    ] {
        assert!((near(at) - share).abs() < 0.02, "{at}: {}", near(at));
    }
}

fn question(ids: &[&str]) -> Question<'static> {
    Question {
        suspects: ids
            .iter()
            .map(|id| Suspect::listed(library::by_id(id).unwrap()).expect("a plan can show it"))
            .collect(),
        reference: Reference::Table,
        carrier: Carrier::ThreeAxis,
        sensors: Sensor::BOTH.to_vec(),
        rates: RateList {
            largest_dps: 300.0,
            rates: Rates::Any,
        },
        chamber_c: [25.0, 45.0, 5.0],
        noise: Sensor::BOTH.map(DwellNoise::fang),
        dwell_s: 10.0,
        motion: Motion::of(Carrier::ThreeAxis),
        seed: 1,
        known: None,
    }
}

#[test]
fn what_a_plan_is_said_to_show_is_what_least_squares_gives() {
    // Cubic of the x gyro beside bias, row of the matrix, force, square and asymmetry, by the plan's attitudes and rates alone.
    let question = question(&["gyro_scale_cubic"]);
    let answer = settle(&question);
    let rows: Vec<[f64; 10]> = answer
        .stops
        .iter()
        .map(|s| (s.setting.up, s.setting.up * s.setting.rate))
        .map(|(f, w)| {
            let x = w.x;
            [1.0, x, w.y, w.z, f.x, f.y, f.z, x * x, x.abs(), x.powi(3)]
        })
        .collect();
    let design = DMatrix::from_fn(rows.len(), 10, |i, j| rows[i][j]);
    let y = DVector::from_fn(rows.len(), |i, _| rows[i][9]);
    let others = design.columns(0, 9).into_owned();
    let fit = others.clone().svd(true, true).solve(&y, 1e-12).unwrap();
    let left = (y - others * fit).norm();
    let size = 1e-3 / 300f64.to_radians().powi(2);
    let known = size * left / question.noise[0].sigma(10.0);
    let said = &answer.settled[0];
    assert!(said.done() && said.sigmas >= SEEN * (1.0 - 1e-9));
    // That of x is no smaller than the least of the three axes.
    assert!(
        known >= said.sigmas * (1.0 - 1e-3),
        "{known} {}",
        said.sigmas
    );
    let told = &said.coefficients[0];
    assert!(
        (size / told.2 / known - 1.0).abs() < 1e-3,
        "{told:?} {known}"
    );
}

#[test]
fn slow_effects_get_a_session_in_time_and_a_chamber_that_warms_and_cools() {
    let answer = settle(&question(&["gyro_thermal_bias", "gyro_thermal_lag"]));
    let temperatures: Vec<f64> = answer.chamber_c.iter().map(|c| c.1).collect();
    assert_eq!(temperatures, [25.0, 25.0, 45.0, 45.0, 5.0, 5.0, 25.0, 25.0]);
    assert!(
        answer.settled.iter().all(|s| s.done()),
        "{:?}",
        answer.settled
    );
    let cold = settle(&question(&["accel_warm_up"]));
    assert!(cold.cold && cold.chamber_c.is_empty());
    assert!(cold.settled[0].done(), "{:?}", cold.settled);
}

#[test]
fn what_no_such_experiment_shows_is_said_so() {
    // At rest by hand a gyro does not turn.
    let by_hand = settle(&Question {
        reference: Reference::Gravity,
        carrier: Carrier::Hand,
        ..question(&["gyro_scale_cubic"])
    });
    assert!(!by_hand.possible() && by_hand.words().contains("no experiment of this kind"));
    // On six faces products of two forces are always nothing.
    let faces = settle(&Question {
        carrier: Carrier::Faces,
        ..question(&["accel_cross_axis_product"])
    });
    assert!(!faces.possible());
}
