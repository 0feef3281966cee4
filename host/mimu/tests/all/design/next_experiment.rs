//! Recipes that show effects: their predictions, and that they are as small as possible.

use mimu::effects;
use mimu::plan::design::budget::DwellNoise;
use mimu::plan::design::reach::{Fixture, RateList, Rates};
use mimu::plan::design::tour::Motion;
use mimu::plan::next_experiment::prediction::{SEEN, Target};
use mimu::plan::next_experiment::recipe::{Experiment, RECIPES};
use mimu::plan::next_experiment::{Answer, CHAMBER_C, DWELL_S, RATE_DPS, SLEW, Setup, smallest};
use mimu::quantity::Sensor;
use mimu_recording::Reference;
use nalgebra::{DMatrix, DVector};

fn setup() -> Setup {
    Setup {
        reference: Reference::Table,
        fixture: Fixture::ThreeAxis,
        sensors: Sensor::BOTH.to_vec(),
        rates: RateList {
            largest_dps: RATE_DPS,
            rates: Rates::Any,
        },
        chamber_c: CHAMBER_C,
        noise: Sensor::BOTH.map(DwellNoise::fang),
        dwell_s: DWELL_S,
        motion: Motion {
            slew: SLEW,
            ..Motion::of(Fixture::ThreeAxis)
        },
        seed: 1,
    }
}

fn target(id: &str) -> Target {
    Target::listed(effects::by_id(id).unwrap())
}

fn answer(setup: &Setup, id: &str) -> Option<Answer> {
    smallest(setup, &[target(id)])
}

/// The experiment for the cubic of a gyro with two named rivals, so that further effects in the list do not change it.
fn cubic(setup: &Setup) -> Option<Answer> {
    let rivals = ["gyro_scale_quadratic", "gyro_scale_asymmetry"];
    let target = Target {
        rivals: rivals.map(|id| target(id).candidate).to_vec(),
        ..target("gyro_scale_cubic")
    };
    smallest(setup, &[target])
}

#[test]
fn every_error_has_a_recipe_that_shows_it() {
    let setup = setup();
    for effect in effects::all() {
        let shown = answer(&setup, effect.id);
        let shown = shown.unwrap_or_else(|| panic!("{}: no recipe", effect.id));
        let words = shown.words(&setup);
        println!("{}: {words}\n", effect.id);
        assert_eq!(words.contains("Even then"), !shown.done(), "{words}");
        assert!(shown.done() || !effect.is_error(), "{}: {words}", effect.id);
    }
}

#[test]
fn what_is_predicted_is_what_least_squares_gives() {
    // Cubic of the x gyro, bias, row of the matrix and, as a rival, the square; only from the plan's attitudes and rates.
    let setup = setup();
    let answer = answer(&setup, "gyro_scale_cubic").unwrap();
    let alone = |rivals: &[&str]| {
        let cubic = Target {
            rivals: rivals.iter().map(|r| target(r).candidate).collect(),
            ..target("gyro_scale_cubic")
        };
        cubic.predicted(&setup, &answer.experiment)
    };
    let settings = &answer.experiment.settings;
    for (columns, rivals) in [(4, vec![]), (5, vec!["gyro_scale_quadratic"])] {
        let design = DMatrix::from_fn(settings.len(), columns, |i, j| {
            let w = settings[i].up * settings[i].rate;
            [1.0, w.x, w.y, w.z, w.x * w.x][j]
        });
        let cubes = settings.iter().map(|s| (s.up.x * s.rate).powi(3));
        let cubes = DVector::from_iterator(settings.len(), cubes);
        let fit = design.clone().svd(true, true).solve(&cubes, 1e-12).unwrap();
        let known = setup.noise[0].sigma(DWELL_S) / (cubes - design * fit).norm();
        let (name, unit, sigma) = &alone(&rivals).coefficients[0];
        assert_eq!((name.as_str(), unit.as_str()), ("x", "1/(rad/s)^2"));
        assert!((sigma / known - 1.0).abs() < 1e-9, "{sigma} {known}");
    }
}

#[test]
fn the_size_is_the_smallest_that_is_enough_by_the_noise_of_the_unit() {
    for id in [
        "gyro_scale_cubic",
        "accel_cross_axis_product",
        "gyro_warm_up",
        "accel_thermal_bias",
    ] {
        let mut sizes = Vec::new();
        for louder in [0.01, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0] {
            let mut setup = setup();
            for noise in &mut setup.noise {
                (noise.n, noise.b) = (louder * noise.n, louder * noise.b);
            }
            let answer = answer(&setup, id).unwrap();
            let Experiment { recipe, size, .. } = answer.experiment;
            let ladder = recipe.course.sizes();
            let at = ladder.iter().position(|s| *s == size).unwrap();
            // Alone, with its own sigma: sufficient here, but not one step below.
            let share = |size| {
                let experiment = Experiment::of(&setup, recipe, size);
                target(id).predicted(&setup, &experiment).share
            };
            assert_eq!(answer.done(), share(size) <= (1.0 + 1e-9) / SEEN);
            assert!(answer.done() || at + 1 == ladder.len(), "{id} {louder}");
            assert!(
                at == 0 || share(ladder[at - 1]) > 1.0 / SEEN,
                "{id} {louder}"
            );
            sizes.push((RECIPES.iter().position(|r| *r == recipe), at));
        }
        assert_ne!(sizes.first(), sizes.last(), "{id}");
    }
}

#[test]
fn what_a_fixture_cannot_show_has_no_recipe() {
    // By hand a gyro has no known rate; on six faces the products of two forces are always zero.
    let by_hand = Setup {
        reference: Reference::Gravity,
        fixture: Fixture::Hand,
        motion: Motion::of(Fixture::Hand),
        ..setup()
    };
    assert!(cubic(&by_hand).is_none());
    assert!(answer(&by_hand, "gyro_g_sensitivity").is_some());
    let faces = Setup {
        fixture: Fixture::Faces,
        ..setup()
    };
    assert!(answer(&faces, "accel_cross_axis_product").is_none());
    assert!(cubic(&faces).is_some());
}
