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
