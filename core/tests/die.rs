//! Temperature of the dies against closed-form solutions of the lag's equation for a ramp and a step, in double precision.

use mimu_core::die::{DieLag, LAG_RANGE_S, RATE_SHARE, State};
use proptest::prelude::*;

/// A thermometer that is constant at `from_c` and then rises by `rate` K/s.
fn ramp(from_c: f64, rate: f64, t_s: f64) -> f64 {
    from_c + rate * t_s.max(0.0)
}

/// Solution of `lag D' + D = T` for this ramp, in equilibrium before it.
fn behind_a_ramp(lag_s: f64, from_c: f64, rate: f64, t_s: f64) -> f64 {
    from_c + rate * (t_s - lag_s * (1.0 - (-t_s / lag_s).exp()))
}

/// The followed temperature after `t_s` of the ramp, in steps of `dt_s`.
fn followed(lag_s: f64, from_c: f64, rate: f64, t_s: f64, dt_s: f64) -> f64 {
    let lag = DieLag::new(lag_s).unwrap();
    let mut state = State::new();
    assert_eq!(lag.follow(&mut state, 0.0, from_c), Some(from_c));
    let steps = (t_s / dt_s).round() as usize;
    let mut die_c = from_c;
    for k in 1..=steps {
        let now = k as f64 * dt_s;
        die_c = lag
            .follow(&mut state, dt_s, ramp(from_c, rate, now))
            .unwrap();
    }
    die_c
}

#[test]
fn dies_that_follow_are_where_the_equation_says_however_long_the_steps_are() {
    for (lag_s, rate) in [(61.2, 1.0 / 60.0), (5.0, -0.2), (600.0, 0.05)] {
        for (t_s, dt_s) in [(30.0, 0.02), (30.0, 1.0), (30.0, 30.0), (300.0, 100.0)] {
            let expected = behind_a_ramp(lag_s, 20.0, rate, t_s);
            let found = followed(lag_s, 20.0, rate, t_s, dt_s);
            assert!(
                (found - expected).abs() < 1e-9,
                "{lag_s} {dt_s}: {found} {expected}"
            );
        }
    }
}

#[test]
fn dies_that_lead_are_ahead_of_a_ramp_by_their_lead_once_the_rate_is_known() {
    for (lead_s, rate) in [(61.2, 1.0 / 60.0), (5.0, -0.2), (120.0, 0.05)] {
        let filter_s = lead_s * RATE_SHARE;
        for dt_s in [0.02, 1.0] {
            // The rate behind its filter is `rate (1 - exp(-t / filter))`.
            for t_s in [1.0, filter_s.ceil(), 20.0 * filter_s.ceil()] {
                let known = 1.0 - (-t_s / filter_s).exp();
                let expected = 20.0 + rate * (t_s + lead_s * known);
                let found = followed(-lead_s, 20.0, rate, t_s, dt_s);
                assert!(
                    (found - expected).abs() < 1e-9,
                    "{lead_s} {t_s}: {found} {expected}"
                );
            }
        }
    }
}

#[test]
fn before_the_first_reading_nothing_is_known_and_a_lost_one_is_that_of_before() {
    let lag = DieLag::<f32>::new(10.0).unwrap();
    let mut state = State::new();
    assert_eq!(lag.follow(&mut state, 1.0, f32::NAN), None);
    assert_eq!(lag.follow(&mut state, 1.0, 40.0), Some(40.0));
    let risen = lag.follow(&mut state, 1.0, 50.0).unwrap();
    let mut held = state;
    let lost = lag.follow(&mut state, 20.0, f32::NAN);
    assert_eq!(lost, lag.follow(&mut held, 20.0, 50.0));
    assert!(
        lost.unwrap() > risen + 5.0,
        "it goes on by the time that passed"
    );
    // A step of zero time leaves the dies unchanged.
    let now = state;
    assert_eq!(lag.follow(&mut state, -1.0, 50.0), lost);
    assert_eq!(state, now);
}

#[test]
fn without_a_lag_the_dies_are_at_the_thermometer() {
    for lag in [DieLag::<f32>::none(), DieLag::new(0.0).unwrap()] {
        let mut state = State::new();
        for reading in [20.0, 30.0, -5.0] {
            assert_eq!(lag.follow(&mut state, 0.02, reading), Some(reading));
        }
    }
    let [least, most] = LAG_RANGE_S;
    for bad in [least - 1.0, most + 1.0, f64::NAN] {
        assert_eq!(DieLag::new(bad), None);
    }
}

proptest! {
    /// Once thermometer and dies are both known, the future follows as from the whole history.
    #[test]
    fn a_state_is_known_from_both_temperatures(
        lag_s in -120.0_f64..600.0, readings in prop::collection::vec(-40.0_f64..80.0, 2..40), dt_s in 0.02_f64..30.0,
    ) {
        let lag = DieLag::new(lag_s).unwrap();
        let mut state = State::new();
        let (before, after) = readings.split_at(readings.len() / 2);
        let mut both = (0.0, 0.0);
        for reading in before {
            both = (*reading, lag.follow(&mut state, dt_s, *reading).unwrap());
        }
        let mut joined = lag.state_of(both.0, both.1);
        for reading in after {
            let expected = lag.follow(&mut state, dt_s, *reading).unwrap();
            let found = lag.follow(&mut joined, dt_s, *reading).unwrap();
            prop_assert!((found - expected).abs() < 1e-8 * (1.0 + expected.abs()), "{found} {expected}");
        }
    }
}
