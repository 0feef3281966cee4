//! Turntables with flaws.

use std::f64::consts::{PI, TAU};

use mimu_rig::axis::Settling;
use mimu_rig::motion::{Carrier, Instant};
use mimu_rig::rotation::{add, cross, dot, norm, scale};
use mimu_rig::table::{Table, TableTruth};

use super::table::{plan, table};
use super::{assert_near, differentiate, minus};

const ARCSEC: f64 = PI / 180.0 / 3600.0;

#[test]
fn an_axis_off_the_vertical_tilts_gravity_by_that_angle() {
    for arcsec in [10.0, 1000.0] {
        let truth = TableTruth {
            level_arcsec: [arcsec, 0.0],
            ..TableTruth::ideal()
        };
        let mut table = table("[[step]]\nup = [0, 0, 1]\ndwell_s = 2", &truth);
        let Instant {
            motion,
            stated_force,
            ..
        } = table.at(1.0);
        let (stated, g) = (stated_force.unwrap(), 9.793);
        let angle = norm(cross(motion.force, stated)).atan2(dot(motion.force, stated));
        assert!((angle - arcsec * ARCSEC).abs() < 1e-15);
        // A rotation about east raises north: the reaction to gravity gets a component along y.
        assert_near(motion.force, [0.0, g * angle.sin(), g * angle.cos()], 1e-13);
    }
}

/// Largest difference between true and reported force (m/s²) and rate (rad/s, without the Earth's), over a plan that uses every axis.
fn worst(truth: &TableTruth) -> [f64; 2] {
    let steps = "[[step]]\nup = [0.3, -0.5, 0.4]\ndwell_s = 1\n[[step]]\nup = [1, 0, 0.2]\nspin_dps = 90\ndwell_s = 4\n\
                 [[step]]\nup = [1, 1, 0]\nrate_dps = 90\nspin_dps = 1\ndwell_s = 4";
    let mut table = table(steps, truth);
    let earth = plan(steps).place.earth_rate();
    let (mut force, mut rate) = (0.0_f64, 0.0_f64);
    for k in 0..(table.duration_s() * 500.0) as u32 {
        let instant = table.at(f64::from(k) * 0.002);
        let motion = instant.motion;
        force = force.max(norm(minus(motion.force, instant.stated_force.unwrap())));
        let true_rate = minus(motion.rate, motion.attitude.inverse().turn(earth));
        rate = rate.max(norm(minus(true_rate, instant.stated_rate.unwrap())));
    }
    [force, rate]
}

#[test]
fn what_the_table_states_is_wrong_in_proportion_to_each_flaw() {
    type Flaw = fn(f64) -> TableTruth;
    #[rustfmt::skip]
    let flaws: [(&str, Flaw); 8] = [
        ("wobble", |s| TableTruth { wobble_arcsec: [20.0 * s, 30.0 * s, 10.0 * s], ..TableTruth::ideal() }),
        ("nonorthogonality", |s| TableTruth { nonorthogonality_arcsec: [20.0 * s, -30.0 * s], ..TableTruth::ideal() }),
        ("level", |s| TableTruth { level_arcsec: [20.0 * s, 30.0 * s], ..TableTruth::ideal() }),
        ("mounting", |s| TableTruth { mounting_arcsec: [20.0 * s, 30.0 * s, -50.0 * s], ..TableTruth::ideal() }),
        ("rate", |s| TableTruth { rate_scale_ppm: [20.0 * s, 0.0, -50.0 * s], ..TableTruth::ideal() }),
        ("encoder", |s| TableTruth { encoder_arcsec: [20.0 * s, 30.0 * s, -50.0 * s], ..TableTruth::ideal() }),
        ("settling", |s| TableTruth { settling: Settling { fraction: 0.05 * s, ..Default::default() }, ..TableTruth::ideal() }),
        ("offset", |s| TableTruth { offset_mm: [s, 2.0 * s, -3.0 * s], ..TableTruth::ideal() }),
    ];
    for (name, flaw) in flaws {
        let (one, two) = (worst(&flaw(1.0)), worst(&flaw(2.0)));
        for i in 0..2 {
            // A rate error does not change the force; a tilt of the whole table and an offset do not change the rate.
            if [("rate", 0), ("level", 1), ("offset", 1)].contains(&(name, i)) {
                assert!(two[i] < 1e-10, "{name} {two:?}");
            } else {
                assert!(one[i] > 1e-7, "{name}: {one:?}");
                let ratio = two[i] / one[i];
                assert!((ratio - 2.0).abs() < 0.01, "{name}: {one:?} {two:?}");
            }
        }
    }
}

#[test]
fn a_stop_rings_at_the_drives_frequency_and_dies_out() {
    let settling = Settling {
        frequency_hz: 10.0,
        damping: 0.05,
        fraction: 0.3,
    };
    let truth = TableTruth {
        settling,
        settle_s: 0.0,
        ..TableTruth::ideal()
    };
    let steps = "[[step]]\nup = [0, 0, 1]\ndwell_s = 1\n[[step]]\nup = [0, 1, 0]\ndwell_s = 5";
    let mut table = table(steps, &truth);
    let stop = (0..)
        .map(|k| f64::from(k) * 1e-4)
        .find(|t| table.at(*t).step == Some(1))
        .unwrap();
    let earth = table.at(stop + 4.5).motion.rate[0];
    let mut table = Table::new(&plan(steps), &truth).unwrap();
    // Peaks of the rate of the middle axis (body x) after the stop: every 1/fd, each exp(-damping w / fd) times the previous one, with fd the damped
    // frequency.
    let rates: Vec<f64> = (0..10_000)
        .map(|k| table.at(stop + f64::from(k) * 1e-4).motion.rate[0] - earth)
        .collect();
    let peaks: Vec<(usize, f64)> = (1..9_999)
        .filter(|&k| rates[k] > rates[k - 1] && rates[k] >= rates[k + 1])
        .map(|k| (k, rates[k]))
        .collect();
    let root = (1.0 - 0.05_f64.powi(2)).sqrt();
    let period = 0.1 / root;
    let decrement = (-TAU * 0.05 / root).exp();
    assert!(peaks.len() >= 8);
    for pair in peaks.windows(2) {
        let apart = (pair[1].0 - pair[0].0) as f64 * 1e-4;
        assert!((apart - period).abs() < 1.5e-4, "{apart}");
        assert!((pair[1].1 / pair[0].1 - decrement).abs() < 1e-4);
    }
}

fn flawed() -> TableTruth {
    TableTruth {
        wobble_arcsec: [2000.0, 3000.0, -2500.0],
        nonorthogonality_arcsec: [3000.0, -2000.0],
        level_arcsec: [2000.0, 1000.0],
        mounting_arcsec: [3000.0, 7000.0, -5000.0],
        rate_scale_ppm: [500.0, 0.0, -300.0],
        encoder_arcsec: [2000.0, 3000.0, -2500.0],
        settling: Settling {
            frequency_hz: 3.0,
            damping: 0.1,
            fraction: 0.3,
        },
        offset_mm: [100.0, -200.0, 150.0],
        ..TableTruth::default()
    }
}

const BUSY: &str = "[[step]]\nup = [0.3, -0.5, 0.4]\nheading_deg = 40\ndwell_s = 1\n\
                    [[step]]\nup = [0, 1, 0]\nrate_dps = 120\nspin_dps = -50\ndwell_s = 3\n\
                    [[step]]\nposes = 12\ndwell_s = 1";

#[test]
fn rate_and_angular_acceleration_of_a_flawed_table_are_derivatives_of_its_attitude() {
    let mut table = table(BUSY, &flawed());
    let compared = differentiate(&mut table, plan(BUSY).place, 0.5);
    assert!(compared > 3000, "{compared}");
}

#[test]
fn force_on_a_flawed_table_is_the_second_derivative_of_the_boards_position() {
    let mut table = table(BUSY, &flawed());
    let place = plan(BUSY).place;
    let lever = scale(1e-3, flawed().offset_mm);
    let h = 1e-3;
    for k in 0..(table.duration_s() / 0.0103) as usize - 1 {
        let t = 0.002 + k as f64 * 0.0103;
        let at = [-1.0, 0.0, 1.0].map(|i| table.at(t + i * h).motion);
        if norm(minus(
            at[2].angular_acceleration,
            at[0].angular_acceleration,
        )) > 0.3
        {
            continue;
        }
        let [before, now, after] = at.map(|motion| motion.attitude.turn(lever));
        let acceleration = scale(1.0 / (h * h), add(add(before, after), scale(-2.0, now)));
        let velocity = scale(0.5 / h, minus(after, before));
        let coriolis = scale(2.0, cross(place.earth_rate(), velocity));
        let level = add(place.force_at_rest(), add(acceleration, coriolis));
        assert_near(at[1].force, at[1].attitude.inverse().turn(level), 3e-4);
    }
}
