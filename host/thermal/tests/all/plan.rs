//! Predictions for planned procedures against results derived by hand.

use mimu::plan::design::budget::DwellNoise;
use mimu::readable::STANDARD_GRAVITY as G;
use mimu_thermal::basis::Shape;
use mimu_thermal::plan::{Planned, Procedure, Request, plan};

/// White noise of gyro, rad/s/√Hz, and of accelerometer, m/s²/√Hz.
const WHITE: [f64; 2] = [2e-4, 1e-3];

fn request(procedure: Procedure) -> Request {
    let white = |n| DwellNoise { n, b: 0.0, k: 0.0 };
    Request {
        procedure,
        range_c: [0.0, 60.0],
        shape: Shape::Cubic,
        kelvin_per_min: 2.0,
        set_points: 4,
        both_ways: false,
        course: Vec::new(),
        soak_s: 3600.0,
        dwell_s: 20.0,
        largest_dps: 50.0,
        sample_rate_hz: 100.0,
        noise: WHITE.map(white),
    }
}

fn near(found: f64, known: f64, within: f64) {
    assert!((found / known - 1.0).abs() < within, "{found} {known}");
}

#[test]
fn a_soak_at_four_set_points_knows_at_each_what_its_own_dwells_give_and_between_them_what_lagrange_makes_of_it()
 {
    let found = plan(&request(Procedure::Soak)).unwrap();
    // Twelve dwells of 20 s, each axis as often up as down and turned both ways: the estimates are uncorrelated. Four dwells have force
    // along an axis, two of them at rest; two have a rate about it.
    let bias = WHITE.map(|n| n / (12.0 * 20f64).sqrt());
    let scale = [
        WHITE[0] / (50f64.to_radians() * 40f64.sqrt()),
        WHITE[1] / (G * 80f64.sqrt()),
    ];
    // A cubic through values at 0, 20, 40 and 60 °C is -1/16, 9/16, 9/16, -1/16 of them at 30 °C.
    let middle = (2.0 * (81.0 + 1.0) / 256f64).sqrt();
    for (k, sensor) in found.sensors.iter().enumerate() {
        for (at, factor) in sensor.at.iter().zip([1.0, middle, 1.0]) {
            near(at.bias.unwrap(), bias[k] * factor, 1e-6);
            near(at.scale.unwrap(), scale[k] * factor, 1e-6);
            near(at.cross.unwrap(), scale[k] * factor, 1e-6);
        }
    }
    // An hour at each set point and ten minutes from one to the next; the last dwell ends a second or two before the last soak.
    assert!((found.duration_s - (4.0 * 3600.0 + 3.0 * 600.0)).abs() < 2.5);
}

#[test]
fn every_procedure_with_motion_determines_everything_and_longer_dwells_more() {
    for procedure in [Procedure::Soak, Procedure::Niu, Procedure::Ramp] {
        let with = |kelvin_per_min: f64| -> Planned {
            let mut asked = request(procedure);
            asked.kelvin_per_min = kelvin_per_min;
            asked.dwell_s = 9.0;
            plan(&asked).unwrap()
        };
        let [slow, fast] = [1.0, 4.0].map(with);
        assert!(slow.duration_s > fast.duration_s && slow.inseparable.is_empty());
        for (slow, fast) in slow.sensors.iter().zip(&fast.sensors) {
            for (slow, fast) in slow.at.iter().zip(&fast.at) {
                for [slow, fast] in [
                    [slow.bias, fast.bias],
                    [slow.scale, fast.scale],
                    [slow.cross, fast.cross],
                ] {
                    let [slow, fast] = [slow, fast].map(Option::unwrap);
                    // A soak has the same dwells at any rate; a ramp has as many more as it is slower.
                    assert!(
                        slow.is_finite() && slow <= fast * (1.0 + 1e-9),
                        "{procedure:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn spans_that_determine_no_such_curve_are_refused_with_the_reason() {
    let refused = |change: &dyn Fn(&mut Request), says: &[&str]| {
        let mut asked = request(Procedure::Soak);
        change(&mut asked);
        let error = plan(&asked).unwrap_err().to_string();
        assert!(says.iter().all(|s| error.contains(s)), "{error}");
    };
    let range = |to: f64, shape| move |r: &mut Request| (r.range_c, r.shape) = ([20.0, to], shape);
    refused(
        &range(29.0, Shape::Line),
        &["9.00 K", "needs 10 K", "slope"],
    );
    refused(
        &range(35.0, Shape::Cubic),
        &["15.0 K", "needs 20 K", "straight lines"],
    );
    refused(&|r| r.set_points = 3, &["3 set points", "4 coefficients"]);
    refused(
        &|r| r.soak_s = 300.0,
        &["soak: 5.00 min", "soak for longer"],
    );
    refused(&|r| r.soak_s = 20.0 * 3600.0, &["two days"]);
    let mut line = request(Procedure::Soak);
    range(35.0, Shape::Line)(&mut line);
    assert_eq!(plan(&line).unwrap().curves, "line");
}

#[test]
fn the_chamber_follows_the_three_profiles_of_niu() {
    // niu, Table 2: °C and minutes held; 2 K/min. The durations are sums of the table's times.
    let profiles = [
        (
            vec![[25.0, 0.0], [-35.0, 30.0], [75.0, 60.0], [-35.0, 30.0]],
            260.0,
        ),
        (
            vec![[25.0, 0.0], [75.0, 30.0], [-35.0, 30.0], [75.0, 30.0]],
            225.0,
        ),
        (
            vec![
                [25.0, 0.0],
                [75.0, 40.0],
                [25.0, 20.0],
                [-35.0, 30.0],
                [25.0, 30.0],
            ],
            230.0,
        ),
    ];
    for (course, minutes) in profiles {
        let mut asked = request(Procedure::Niu);
        (asked.range_c, asked.dwell_s) = ([-35.0, 75.0], 9.0);
        asked.course = course.iter().map(|[c, min]| [*c, 60.0 * min]).collect();
        let found = plan(&asked).unwrap();
        let end_s = found.schedule.chamber_c.last().unwrap()[0];
        near(end_s, 60.0 * minutes, 1e-9);
        // Rounds of 152 s go on until the end, and at most two longer.
        let beyond = found.duration_s - end_s;
        assert!((0.0..304.0).contains(&beyond), "{beyond}");
        let held: Vec<f64> = course
            .iter()
            .filter(|[_, min]| *min > 0.0)
            .map(|[_, min]| 60.0 * min)
            .collect();
        let flat = found.schedule.chamber_c.windows(2);
        let flat = flat
            .filter(|w| w[0][1] == w[1][1])
            .map(|w| w[1][0] - w[0][0]);
        assert_eq!(flat.collect::<Vec<_>>(), held);
        assert!(
            found
                .sensors
                .iter()
                .all(|s| s.at.iter().all(|at| at.bias.is_some()))
        );
    }
}

#[test]
fn a_soak_both_ways_meets_each_set_point_after_heating_and_after_cooling() {
    let mut asked = request(Procedure::Soak);
    let [one, both] = [false, true].map(|both_ways| {
        asked.both_ways = both_ways;
        plan(&asked).unwrap()
    });
    assert_eq!(both.dwells, 2 * one.dwells);
    let schedule = &both.schedule;
    let at: Vec<f64> = (0..schedule.rounds)
        .map(|k| schedule.temp_c(schedule.lead_in_s + k as f64 * schedule.round_s))
        .collect();
    assert_eq!(at, [0.0, 20.0, 40.0, 60.0, 60.0, 40.0, 20.0, 0.0]);
    // Twice the dwells of white noise.
    for (one, both) in one.sensors.iter().zip(&both.sensors) {
        near(
            one.at[1].bias.unwrap() / both.at[1].bias.unwrap(),
            2f64.sqrt(),
            1e-6,
        );
    }
}
