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
fn a_long_rest_ramp_knows_a_line_as_a_regression_over_time_does_and_no_scale_factor() {
    let mut asked = request(Procedure::RestRamp);
    asked.shape = Shape::Line;
    asked.soak_s = 0.0;
    let found = plan(&asked).unwrap();
    // Half an hour from 0 to 60 °C: the variance of a line is 1/n in the middle of its points and 4/n at their ends.
    let mean = WHITE.map(|n| n / 1800f64.sqrt());
    for (k, sensor) in found.sensors.iter().enumerate() {
        near(sensor.at[1].bias.unwrap(), mean[k], 1e-3);
        near(sensor.at[0].bias.unwrap(), 2.0 * mean[k], 1e-2);
        near(sensor.at[2].bias.unwrap(), 2.0 * mean[k], 1e-2);
        assert!(
            sensor
                .at
                .iter()
                .all(|at| at.scale.is_none() && at.cross.is_none())
        );
    }
    let said = found.inseparable.join("\n");
    assert!(said.contains("scale factor") && said.contains("warm-up") && said.contains("lag"));
}

#[test]
fn a_bias_that_wanders_is_known_no_better_than_it_wanders() {
    let wandering = |b: f64| {
        let mut asked = request(Procedure::Ramp);
        asked.noise = WHITE.map(|n| DwellNoise { n, b, k: 0.0 });
        plan(&asked).unwrap().sensors[0].at[1]
    };
    let [steady, wanders] = [0.0, 1e-3].map(wandering);
    // Flicker noise over three decades has the variance B² ln 1000 / π, 2.2 B². Five hours average out what is faster than an hour. The
    // slower wander limits the four coefficients: at least a third of the variance, and less than all.
    let share = (wanders.bias.unwrap() / 1e-3).powi(2) / (1000f64.ln() / std::f64::consts::PI);
    assert!((0.33..1.0).contains(&share), "{share}");
    assert!(wanders.bias > steady.bias.map(|s| 10.0 * s));
    // Turns both ways within minutes contain little of it.
    assert!(wanders.scale.unwrap() < 0.2 * wanders.bias.unwrap() / 50f64.to_radians());
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
