//! Whole turns by hand: scale factors of a gyro without equipment.

use mimu::calibration::Calibration;
use mimu::calibration::verify::verify;
use mimu::fit::{Options, fit};
use mimu::quantity::Sensor;
use mimu_recording::WholeTurns;
use mimu_tests::by_hand::{Grade, unit};
use mimu_tests::whole_turns::{Session, case, recorded, scales};
use rayon::prelude::*;

fn median(mut all: Vec<f64>) -> f64 {
    all.sort_by(f64::total_cmp);
    all[all.len() / 2]
}

/// Prints a row for a session; returns the median half-width of the scale factors, and the share of all parameters inside of their intervals.
fn row(grade: Grade, session: Session, seeds: std::ops::Range<u64>) -> (f64, f64) {
    let count = seeds.end - seeds.start;
    let all: Vec<_> = seeds
        .into_par_iter()
        .filter_map(|seed| match case(grade, session, seed) {
            Ok(scales) => Some(scales),
            Err(refused) => {
                println!("{grade:?}, {}, seed {seed}: {refused}", session.name());
                None
            }
        })
        .collect();
    let each = |of: &dyn Fn(&mimu_tests::whole_turns::Scales) -> [f64; 3]| -> Vec<f64> {
        all.iter().flat_map(of).map(f64::abs).collect()
    };
    let scale_inside = all.iter().flat_map(|s| {
        let pairs = s.errors.iter().zip(s.half_widths);
        pairs.map(|(error, half)| f64::from(u8::from(error.abs() <= half)))
    });
    let scale_inside = scale_inside.sum::<f64>() / (3 * all.len()) as f64;
    let inside = all.iter().map(|s| f64::from(s.inside)).sum::<f64>() / (12 * all.len()) as f64;
    let half = median(each(&|s| s.half_widths));
    println!(
        "| {grade:?} | {} | {:.1} | {} of {count} | {:.3} | {:.3} | {:.1} | {:.1} |",
        session.name(),
        median(all.iter().map(|s| s.duration_s / 60.0).collect()),
        all.len(),
        100.0 * median(each(&|s| s.errors)),
        100.0 * half,
        100.0 * scale_inside,
        100.0 * inside,
    );
    (half, inside)
}

const HEAD: &str = "| grade | session | min | fitted | scale error, median % | half interval, median % | scale inside, % | all inside, % |";

#[test]
fn whole_turns_make_the_scale_factors_of_the_same_recording_more_certain() {
    println!("{HEAD}");
    let (without, _) = row(Grade::Consumer, Session::UNSTATED, 0..12);
    let (with, inside) = row(Grade::Consumer, Session::POSES_AND_TURNS, 0..12);
    assert!(with < 0.0003, "{with}");
    assert!(with < 0.8 * without, "{with} {without}");
    assert!(inside > 0.9, "{inside}");
}

#[test]
#[ignore = "half an hour; prints what each minute buys"]
fn what_whole_turns_buy() {
    let with = |turns| Session {
        turns,
        ..Session::POSES_AND_TURNS
    };
    let sessions = [
        Session::of_poses(10),
        Session::of_poses(20),
        Session::of_poses(50),
        Session::UNSTATED,
        with(2),
        with(5),
        with(10),
        with(20),
        Session::TURNS,
    ];
    println!("{HEAD}");
    for grade in [Grade::Consumer, Grade::Tactical, Grade::Analog] {
        for session in sessions {
            // Nobody knows the zero of an accelerometer in volts before poses show it.
            if grade != Grade::Analog || session.poses > 0 {
                row(grade, session, 0..100);
            }
        }
    }
}

#[test]
fn a_miscounted_turn_is_named_and_does_no_harm() {
    let file = unit(&[], Grade::Consumer, 3);
    let plan = Session::POSES_AND_TURNS
        .plan()
        .replacen("whole_turns = 10", "whole_turns = 9", 1);
    let stated = WholeTurns {
        turns: Some(10),
        ..WholeTurns::default()
    };
    let fitted = fit(recorded(&file, &plan, 3, Some(stated)), Options::IN_SAMPLE).unwrap();
    let named = fitted.all_warnings().map(ToString::to_string);
    let named: Vec<String> = named.filter(|w| w.contains("not 10")).collect();
    assert_eq!(named.len(), 1, "{named:?}");
    assert!(
        named[0].contains("turned 8.9") || named[0].contains("turned 9.0"),
        "{named:?}"
    );
    let scales = scales(&fitted, &file, 3, &plan);
    assert!((0..3).all(|k| scales.errors[k].abs() < 1e-3), "{scales:?}");
}

#[test]
fn a_unit_that_is_not_put_back_is_named_and_left_out() {
    let file = unit(&[], Grade::Consumer, 4);
    let right = Session::POSES_AND_TURNS.plan();
    // 4 degrees off, which only the other turns tell, and 40.
    for off in ["whole_turns = 10.011", "whole_turns = 10.11"] {
        let plan = right.replacen("whole_turns = 10", off, 1);
        let stated = WholeTurns {
            placement_deg: 0.5,
            turns: None,
        };
        let mut careful = file.clone();
        careful.hands.put_back_deg = 0.25;
        let fitted = fit(
            recorded(&careful, &plan, 4, Some(stated)),
            Options::IN_SAMPLE,
        )
        .unwrap();
        let named = fitted.all_warnings().map(ToString::to_string);
        let named: Vec<String> = named.filter(|w| w.contains("are not used")).collect();
        assert_eq!(named.len(), 1, "{off}: {named:?}");
        let scales = scales(&fitted, &file, 4, &plan);
        assert!((0..3).all(|k| scales.errors[k].abs() < 5e-4), "{scales:?}");
    }
}

/// Somebody who stops eleven degrees short each time, with a gyro that is too noisy for a few poses to tell each turn.
#[test]
fn turns_that_all_end_short_are_not_taken_for_a_scale_factor() {
    for seed in 50..58 {
        let mut file = unit(&[], Grade::Consumer, seed);
        file.unit.gyro_axes.white_si = Some([0.03f64.to_radians(); 3]);
        let session = Session {
            poses: 8,
            ..Session::POSES_AND_TURNS
        };
        let plan = session.plan().replace("turns = 10", "turns = 9.97");
        let plan = plan.replace("turns = -10", "turns = -9.97");
        let stated = Some(WholeTurns::default());
        let Ok(fitted) = fit(recorded(&file, &plan, seed, stated), Options::IN_SAMPLE) else {
            continue;
        };
        let told: Vec<String> = fitted.all_warnings().map(ToString::to_string).collect();
        let none = told.iter().any(|w| w.contains("no whole turns were found"));
        let contradicted = told
            .iter()
            .any(|w| w.contains("by the turns between rests"));
        assert!(none || contradicted, "{seed}: {told:?}");
    }
}

#[test]
fn a_session_of_turns_verifies_a_calibration_in_degrees_for_each_turn() {
    let file = unit(&[], Grade::Consumer, 6);
    let made = recorded(
        &file,
        &Session::POSES_AND_TURNS.plan(),
        6,
        Some(WholeTurns::default()),
    );
    let fitted = fit(made, Options::IN_SAMPLE).unwrap();
    let calibration = Calibration::of(&fitted, &[], "2026-01-02T03:04:05Z").unwrap();
    let other = recorded(
        &file,
        &Session {
            turns: 5,
            ..Session::POSES_AND_TURNS
        }
        .plan(),
        7,
        Some(WholeTurns::default()),
    );
    let found = verify(&other, &calibration).unwrap();
    assert_eq!(found.whole_turns.len(), 3);
    for axis in &found.whole_turns {
        println!("{axis:?}");
        assert_eq!((axis.times, axis.turns), (2, 10), "{axis:?}");
        assert!(
            axis.error_deg_per_turn.abs() < 2.0 * axis.half_width_deg_per_turn,
            "{axis:?}"
        );
        assert!(axis.half_width_deg_per_turn < 0.2, "{axis:?}");
    }
    assert!(found.sensors[Sensor::Gyro].is_some());
}

/// Twelve minutes of spins that are put back to a twentieth of a degree, all in one direction, so that the turn of the Earth does not cancel; the recording
/// states this latitude.
fn through_twelve_minutes(seed: u64, latitude_deg: Option<f64>) -> mimu_tests::whole_turns::Scales {
    let mut file = unit(&[], Grade::Tactical, seed);
    file.hands.put_back_deg = 0.05;
    // A low-pass of 98 Hz takes part of the hand's wobble away, and with it 5 ppm of 40 turns: as much as the Earth turns in these intervals.
    file.unit.gyro_axes.bandwidth_hz = Some([4000.0; 3]);
    let spins = Session {
        turns: 40,
        ..Session::POSES_AND_TURNS
    };
    let plan = spins
        .plan()
        .replace("whole_turns = -40", "whole_turns = 40")
        .replace("sample_rate_hz = 200.0", "sample_rate_hz = 400.0");
    let stated = WholeTurns {
        placement_deg: 0.1,
        turns: None,
    };
    let mut made = recorded(&file, &plan, seed, Some(stated));
    made.manifest.latitude_deg = latitude_deg;
    let fitted = fit(made, Options::IN_SAMPLE).unwrap();
    scales(&fitted, &file, seed, &plan)
}

#[test]
#[ignore = "minutes: eighteen recordings of twelve minutes"]
fn the_earth_turns_on_below_long_spins_and_is_no_error_of_the_gyro() {
    let ratios = |latitude_deg| -> Vec<f64> {
        let all = (0..6_u64).into_par_iter().map(|seed| {
            let found = through_twelve_minutes(seed, latitude_deg);
            [0, 1, 2].map(|k| found.errors[k].abs() / found.half_widths[k])
        });
        all.collect::<Vec<_>>().concat()
    };
    let inside = |of: &[f64]| of.iter().filter(|r| **r <= 1.0).count();
    let known = ratios(Some(48.0));
    let unknown = ratios(None);
    // As if it turned the other way.
    let wrong = ratios(Some(-48.0));
    println!("known {known:.2?}\nunknown {unknown:.2?}\nwrong {wrong:.2?}");
    assert!(inside(&known) >= 15 && inside(&unknown) >= 15);
    assert!(median(wrong) > 2.0 * median(known));
}
