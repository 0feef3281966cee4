//! `mimu accept` with the firmware on the emulated board: its own scale, its own self-test.

use nalgebra::Vector3;
use serde_json::Value;

use super::Place;
use super::board::{AT_REST, Bench, GRAVITY, forward, unit};

const LIMITS: &str = "format = \"mimu-limits/1\"\nup = \"+z\"\nrows = [\n\
    { name = \"gyro_offset\", lower = -20, upper = 20, unit = \"deg/s\" },\n\
    { name = \"gravity_error\", lower = -200, upper = 200, unit = \"mg\" },\n\
    { name = \"sample_rate\", lower = 999, upper = 1001, unit = \"Hz\" },\n]\n";

fn row<'a>(document: &'a Value, name: &str) -> &'a Value {
    let all = document["measurements"].as_array().unwrap();
    let found = all.iter().find(|m| m["name"] == name);
    found.unwrap_or_else(|| panic!("{name}: {document}"))
}

#[test]
#[ignore = "nightly: the emulated board; by day `accept` measures boards that write lines"]
fn a_board_is_measured_by_its_own_figures_and_with_its_self_test() {
    let (place, truth) = (Place::new(), unit());
    let bench = Bench::carried(AT_REST, &truth);
    std::fs::write(place.path("limits.toml"), LIMITS).unwrap();
    let info = bench.json(&place, &["device", "info"]);
    #[rustfmt::skip]
    let accept = ["accept", "--limits", "limits.toml", "--for", "4s", "--gravity", "9.793"];
    let ran = bench.run(&place, &[&accept[..], &["--json", "-"]].concat());
    let document: Value = serde_json::from_str(&ran.stdout).unwrap();
    assert_eq!(ran.status, Some(0), "{}{}", ran.stdout, ran.stderr);

    // By the board's data sheet figures, the deviations of this unit are its errors.
    let [(_, gyro), (p, accel)] = forward(&truth);
    let si = |sensor: &str, raw: Vector3<f64>| {
        let figure = |key: &str| info["sensors"][sensor][key].as_f64().unwrap();
        raw.map(|v| (v - figure("null")) / figure("per_si"))
    };
    let force = si("accel", p * Vector3::new(0.0, 0.0, GRAVITY) + accel);
    let error = row(&document, "gravity_error")["value"].as_f64().unwrap();
    let expected = (force.norm() - GRAVITY) * 1e3 / 9.80665;
    assert!(
        (error - expected).abs() < 2.0,
        "{error} mg, {expected} expected"
    );
    let rate = si("gyro", gyro);
    for (axis, name) in ["x", "y", "z"].iter().enumerate() {
        let offset = row(&document, &format!("gyro_{name}_offset"));
        let value = offset["value"].as_f64().unwrap();
        let expected = rate[axis].to_degrees();
        // The Earth turns by 0.004 deg/s, and these gyros wander.
        assert!(
            (value - expected).abs() < 0.1,
            "{value} deg/s, {expected} expected"
        );
    }
    let all = document["measurements"].as_array().unwrap();
    let tested = all
        .iter()
        .filter(|m| m["name"].as_str().unwrap().starts_with("self_test_"));
    assert!(tested.clone().count() >= 6, "{document}");
    assert!(tested.clone().all(|m| m["passed"] == true), "{document}");
    assert_eq!(document["up"], "+z");
    bench.end();
}
