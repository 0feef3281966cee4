//! The emulated board in a chamber, with a calibration over temperature made from the bench's truth; and trimming its offsets.

use nalgebra::Vector3;

use super::Place;
use super::board::{AT_REST, Bench, GRAVITY, forward, unit};
use super::calibration::text_of;

#[test]
#[ignore = "nightly: half a minute of the emulated board; by day `trim` of mimu-device tests its figures"]
fn a_trim_takes_out_the_offsets_that_have_drifted_and_keeps_everything_else() {
    let (place, truth) = (Place::new(), unit());
    let bench = Bench::carried(AT_REST, &truth);
    // A calibration from a time when the biases differed by this much.
    let drifted = [
        Vector3::new(0.02, -0.01, 0.03),
        Vector3::new(0.1, 0.05, -0.2),
    ];
    let mut models = forward(&truth);
    for ((p, b), drifted) in models.iter_mut().zip(drifted) {
        *b -= *p * drifted;
    }
    std::fs::write(place.path("old.toml"), text_of(&models, "V", "")).unwrap();
    bench.json(&place, &["device", "upload", "old.toml"]);
    let short = bench.run(&place, &["device", "trim", "--for", "1s"]);
    short.refused(&["--for", "average for 4 s"]);
    let gravity = GRAVITY.to_string();

    let gyro_alone = bench.json(&place, &["device", "trim", "--for", "4s"]);
    let figure = |json: &serde_json::Value, sensor: &str, name: &str, i: usize| {
        json[sensor][name][i].as_f64().unwrap()
    };
    assert_eq!(gyro_alone["accel"]["trimmed"], false);
    assert_eq!(
        gyro_alone["accel"]["added"],
        serde_json::json!([0.0, 0.0, 0.0])
    );
    for i in 0..3 {
        let before = figure(&gyro_alone, "gyro", "before", i);
        let sigma = figure(&gyro_alone, "gyro", "sigma_before", i);
        // Sigma is determined to a quarter by 8 segments; and the Earth turns.
        assert!(
            (before - drifted[0][i]).abs() < 7.0 * sigma + 1e-4,
            "{gyro_alone}"
        );
        let after = figure(&gyro_alone, "gyro", "after", i);
        let both = sigma.hypot(figure(&gyro_alone, "gyro", "sigma_after", i));
        assert!(after.abs() < 7.0 * both, "{gyro_alone}");
    }
    #[rustfmt::skip]
    let up = ["device", "trim", "--up", "+z", "--gravity", &gravity, "--for", "6s"];
    let both = bench.json(&place, &up);
    for i in 0..3 {
        let sigma = figure(&both, "accel", "sigma_before", i);
        let before = figure(&both, "accel", "before", i);
        assert!(
            (before - drifted[1][i]).abs() < 7.0 * sigma + 1e-3,
            "{both}"
        );
        let left = sigma.hypot(figure(&both, "accel", "sigma_after", i));
        assert!(
            figure(&both, "accel", "after", i).abs() < 7.0 * left,
            "{both}"
        );
    }
    // If the unit is in another pose than the given one, nothing is stored.
    #[rustfmt::skip]
    let wrong = ["device", "trim", "--up", "-z", "--gravity", &gravity, "--for", "4s"];
    bench
        .run(&place, &wrong)
        .refused(&["accel z is off by", "the pose that was given"]);

    let fetched = bench.json(&place, &["device", "download", "-o", "new.toml"]);
    assert_eq!(fetched["hash"], both["hash"]);
    assert!(fetched["trimmed"].is_string() && fetched["created"] == "2026-01-01T00:00:00Z");
    #[rustfmt::skip]
    let check = ["device", "check", "--calibration", "new.toml", "--for", "1s"];
    assert_eq!(bench.json(&place, &check)["holds"], true);
    bench.end();
}
