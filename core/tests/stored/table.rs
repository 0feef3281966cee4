//! Curves between nodes, and beyond them, against cubics and lines in double precision.

use mimu_core::PerSensor;
use mimu_core::table::{BEYOND_C, Place, Table};
use proptest::prelude::*;

use super::{numbers_of, sloping, two_nodes};

#[test]
fn outside_the_nodes_the_end_slope_goes_on_for_five_kelvin_and_is_then_held() {
    let nodes = two_nodes();
    let (low, high) = (numbers_of(&nodes[0].model), numbers_of(&nodes[1].model));
    let table = Table::<f32, 16>::new(nodes).unwrap();
    let mut state = table.state();
    for (temp_c, ends, grown, place) in [
        (-40.0, &low, -0.5, Place::Below),
        (-5.0, &low, -0.5, Place::Below),
        (-2.0, &low, -0.2, Place::Below),
        (-0.01, &low, -0.001, Place::Below),
        (0.0, &low, 0.0, Place::Inside),
        (50.0, &high, 0.0, Place::Inside),
        (50.01, &high, -0.002, Place::Above),
        (54.0, &high, -0.8, Place::Above),
        (55.0, &high, -1.0, Place::Above),
        (99.0, &high, -1.0, Place::Above),
    ] {
        table.follow(&mut state, PerSensor::both(temp_c));
        for (found, end) in numbers_of(&state.model).iter().zip(ends) {
            assert!((found - (end + grown)).abs() < 3e-6, "{temp_c}");
        }
        assert_eq!(state.place, place, "{temp_c}");
    }
    for lost in [[f32::NAN; 2], [20.0, f32::NAN], [f32::NAN, 20.0]] {
        table.follow(&mut state, lost.into());
        assert_eq!(state.place, Place::Above, "as before");
    }
    // If one triad is outside, the place is outside; each triad is on its own curve.
    for (dies_c, place) in [
        ([20.0, 51.0], Place::Above),
        ([51.0, 20.0], Place::Above),
        ([20.0, -1.0], Place::Below),
        ([20.0, 30.0], Place::Inside),
    ] {
        table.follow(&mut state, dies_c.into());
        assert_eq!(state.place, place, "{dies_c:?}");
        let (mut gyro, mut accel) = (table.state(), table.state());
        table.follow(&mut gyro, PerSensor::both(dies_c[0]));
        table.follow(&mut accel, PerSensor::both(dies_c[1]));
        assert_eq!(state.model.gyro, gyro.model.gyro);
        assert_eq!(state.model.accel, accel.model.accel);
    }
    let none = Table::<f32, 16>::new([]);
    assert_eq!(none.err(), Some(mimu_core::table::TableError::Count));
}

#[test]
fn a_single_node_is_for_all_temperatures_unless_its_range_is_known() {
    let [one, other] = two_nodes();
    let table = Table::<f32, 16>::new([one]).unwrap();
    let place = |table: &Table<f32, 16>, temp_c| {
        let mut state = table.state();
        table.follow(&mut state, PerSensor::both(temp_c));
        state.place
    };
    assert_eq!(table.limits(), None);
    assert_eq!(place(&table, 90.0), Place::Inside);
    let known = table.with_range([20.0, 30.0]).unwrap();
    assert_eq!(known.limits(), Some([20.0, 30.0]));
    for (temp_c, expected) in [
        (19.9, Place::Below),
        (20.0, Place::Inside),
        (30.0, Place::Inside),
        (30.1, Place::Above),
    ] {
        assert_eq!(place(&known, temp_c), expected, "{temp_c}");
    }
    // For several nodes, the range is the intersection with theirs, 0 to 50.
    let two = Table::<f32, 16>::new([one, other]).unwrap();
    let limits = |range| two.clone().with_range(range).unwrap().limits();
    assert_eq!(limits([-20.0, 40.0]), Some([0.0, 40.0]));
    assert_eq!(limits([10.0, 90.0]), Some([10.0, 50.0]));
}

/// A cubic in double precision by Newton's divided differences with both ends doubled, independent of Hermite's weights.
fn cubic([t0, t1]: [f64; 2], [v0, v1]: [f64; 2], [s0, s1]: [f64; 2], t: f64) -> f64 {
    let (h, d) = (t1 - t0, t - t0);
    let secant = (v1 - v0) / h;
    let second = (secant - s0) / h;
    let third = (s1 - 2.0 * secant + s0) / (h * h);
    v0 + s0 * d + second * d * d + third * d * d * (t - t1)
}

proptest! {
    /// Every number is on the cubic of its two neighbours, on the end slope for five kelvin outside, and constant beyond.
    #[test]
    fn every_number_is_on_the_curve_of_its_nodes(
        steps in prop::collection::vec(0.5_f32..30.0, 0..16),
        values in prop::collection::vec(-20.0_f32..20.0, 24 * 16),
        slopes in prop::collection::vec(-0.2_f32..0.2, 24 * 16),
        at in -0.3..1.3_f64,
    ) {
        let mut temp_c = -40.0;
        let mut nodes = Vec::new();
        let of = |all: &[f32], k: usize| -> [f32; 24] { all[24 * k..24 * k + 24].try_into().unwrap() };
        for (k, step) in std::iter::once(&0.0).chain(&steps).take(16).enumerate() {
            temp_c += step;
            nodes.push(sloping(temp_c, &of(&values, k), &of(&slopes, k)));
        }
        let single = Table::<f32, 16>::new(nodes.clone()).unwrap();
        let temps: Vec<f64> = nodes.iter().map(|n| f64::from(n.temp_c)).collect();
        let (first, last) = (temps[0], temps[temps.len() - 1]);
        let wanted = (first + at * (last - first + 20.0)) as f32;
        let mut state = single.state();
        single.follow(&mut state, PerSensor::both(wanted));
        let found = numbers_of(&state.model);
        let t = f64::from(wanted);
        let end = if t < first { 0 } else { nodes.len() - 1 };
        let pair = temps.windows(2).position(|w| (w[0]..=w[1]).contains(&t));
        for k in 0..24 {
            let value = |i: usize| f64::from(numbers_of(&nodes[i].model)[k]);
            let slope = |i: usize| f64::from(numbers_of(&nodes[i].slope)[k]);
            let expected = match pair {
                Some(i) => cubic([temps[i], temps[i + 1]], [value(i), value(i + 1)], [slope(i), slope(i + 1)], t),
                None => value(end) + slope(end) * (t - temps[end]).clamp(-BEYOND_C, BEYOND_C),
            };
            // Some roundings of numbers up to 20 (2e-6 each), and that of the position between nodes. Temperatures are rounded to 3e-5, and numbers
            // change by up to 120 per kelvin if nodes are half a kelvin apart.
            let steepest = pair.map_or(0.0, |i| 2.0 * (value(i + 1) - value(i)).abs() / (temps[i + 1] - temps[i]));
            let bound = 1.2e-5 + 1.6e-5 * (steepest + 0.2);
            prop_assert!((f64::from(found[k]) - expected).abs() < bound, "{} {expected} {bound}", found[k]);
        }
        let inside = (first..=last).contains(&t) || nodes.len() == 1;
        prop_assert_eq!(state.place == Place::Inside, inside);
    }
}
