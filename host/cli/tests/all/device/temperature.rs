//! The emulated board in a chamber, with a calibration over temperature made from the bench's truth; and trimming its offsets.

use std::fmt::Write as _;

use mimu_rig::located::Source;
use mimu_rig::rig_file::{RigFile, RigTruth};
use nalgebra::{Matrix3, Vector3};

use super::Place;
use super::board::{AT_REST, Bench, GRAVITY, forward, unit};
use super::calibration::{Forward, text_of};

/// Drifts of the gyros' biases, deg/s per °C, and their curvature, 1/°C.
const DRIFT_DPS_PER_C: [f64; 3] = [0.1, -0.08, 0.05];
const CURVATURE_PER_C: f64 = 0.01;
/// Time constant of the thermometer's filter, s: the lead of the dies over its reading.
const FILTER_S: f64 = 1.0;

/// fang's unit with drifting biases, on a board so light that a chamber sweeps it within seconds. All TEMP pins are exact.
fn drifting() -> RigTruth {
    let text = include_str!("../../../../../rig/rigs/fang.toml");
    let unit = "gyro_reference_v = [2.5, 2.5, 2.5]\nsupply_error_ppm = 0.0\n";
    let text = text.replace("[unit.gyro_affine]", &format!("{unit}[unit.gyro_affine]"));
    let more = format!(
        "\n[thermal]\nboard_lag_s = 1.0\ndie_lag_s = [0.5, 0.5, 0.5, 0.5]\nboard_heating_c = 0.0\n\
         die_heating_c = [0.0, 0.0, 0.0, 0.0]\non_before_s = inf\n\
         [[effect]]\nid = \"gyro_thermal_bias\"\ndps_per_c = {DRIFT_DPS_PER_C:?}\ncurvature_per_c = {CURVATURE_PER_C:?}\n"
    );
    let file = RigFile::parse(&Source::new("drifting", format!("{text}{more}"))).unwrap();
    RigTruth::resolve(&file, 7).unwrap()
}

/// o of the gyro and its derivative at a temperature: `-C (b + S e)`, with S the norms of the rows of P.
fn offset(models: &Forward, temp_c: f64) -> [Vector3<f64>; 2] {
    let (p, b) = models[0];
    let c = p.try_inverse().unwrap();
    let scale = Vector3::from_fn(|i, _| p.row(i).norm());
    let size = Vector3::from(DRIFT_DPS_PER_C.map(f64::to_radians)).component_mul(&scale);
    let w = temp_c - 25.0;
    [
        -c * (b + size * (w + CURVATURE_PER_C * w * w)),
        -c * size * (1.0 + 2.0 * CURVATURE_PER_C * w),
    ]
}

/// The calibration file, with nodes for every 15 °C.
fn curves(models: &Forward) -> String {
    let plain = text_of(models, "V", "").replace("calibration/1", "calibration/2");
    let mut out = format!(
        "{plain}\n[temperature]\nrange_c = [10.0, 60.0]\ndies.gyro.lag_s = {:?}\ndies.accel.lag_s = 4.0\n",
        -FILTER_S
    );
    let rows = |m: &Matrix3<f64>| {
        let row = |i: usize| format!("[{:?}, {:?}, {:?}]", m[(i, 0)], m[(i, 1)], m[(i, 2)]);
        format!("[{}, {}, {}]", row(0), row(1), row(2))
    };
    let three = |v: &Vector3<f64>| format!("[{:?}, {:?}, {:?}]", v[0], v[1], v[2]);
    let zero = Matrix3::zeros();
    for k in 0..5 {
        let temp_c = 5.0 + 15.0 * f64::from(k);
        let [o, slope] = offset(models, temp_c);
        let (p, b) = models[1];
        let [gyro, accel] = models.map(|(p, _)| p.try_inverse().unwrap());
        let still = -(p.try_inverse().unwrap() * b);
        let _ = write!(out, "[[temperature.node]]\ntemp_c = {temp_c:?}\n");
        for (sensor, c, o, slope) in [
            ("gyro", gyro, o, slope),
            ("accel", accel, still, Vector3::zeros()),
        ] {
            let _ = write!(
                out,
                "[temperature.node.{sensor}]\nC = {}\no = {}\nslope_C = {}\nslope_o = {}\n",
                rows(&c),
                three(&o),
                rows(&zero),
                three(&slope)
            );
        }
    }
    out
}

/// Means of gyro x, y, z over two seconds each, rad/s, with the temperature at the end, °C, and whether the out-of-range flag was set.
fn means(csv: &str) -> Vec<([f64; 3], f64, bool)> {
    let rows: Vec<Vec<f64>> = csv
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
        .collect();
    rows.as_chunks::<2000>()
        .0
        .iter()
        .map(|chunk| {
            let mean = |c: usize| chunk.iter().map(|r| r[c]).sum::<f64>() / 2000.0;
            let last = &chunk[1999];
            (
                [mean(4), mean(5), mean(6)],
                last[2],
                last[3] as u32 & 1 == 1,
            )
        })
        .collect()
}

#[test]
#[ignore = "nightly: half a minute of the emulated board; by day `pipeline::temperature` follows the dies"]
fn the_device_follows_a_chamber_through_its_nodes_and_says_where_they_end() {
    let (place, truth) = (Place::new(), drifting());
    // From 20 to 70 °C at 2 °C/s, after the calibration is stored.
    let plan = AT_REST.replace(
        "lead_in_s",
        "chamber_c = [[0.0, 20.0], [6.0, 20.0], [31.0, 70.0]]\nlead_in_s",
    );
    let bench = Bench::carried(&plan, &truth);
    let models = forward(&truth);
    std::fs::write(place.path("curves.toml"), curves(&models)).unwrap();
    let sent = bench.json(&place, &["device", "upload", "curves.toml"]);
    assert_eq!(sent["node_temp_c"].as_array().unwrap().len(), 5, "{sent}");
    let ran = bench.run(&place, &["device", "stream", "compensated", "--for", "20s"]);
    assert_eq!(ran.status, Some(0), "{}", ran.stderr);
    let seen = means(&ran.stdout);
    for (gyro, temp_c, _) in &seen {
        for (axis, rate) in gyro.iter().enumerate() {
            // Six sigmas of two seconds of 0.1 deg/s/√Hz. The drift is up to 5 deg/s, of which 0.4 deg/s is within the filter's second.
            assert!(
                rate.abs() < 7.5e-3,
                "gyro {axis} at {temp_c} °C: {rate} rad/s"
            );
        }
    }
    let (first, last) = (seen[0].1, seen[seen.len() - 1].1);
    assert!(last - first > 25.0, "{first} to {last} °C");

    #[rustfmt::skip]
    let checked = ["device", "check", "--calibration", "curves.toml", "--for", "4s"];
    let checked = bench.json(&place, &checked);
    assert_eq!(checked["holds"], true, "{checked}");
    assert_eq!(
        (&checked["gyro"]["ulps"], &checked["accel"]["ulps"]),
        (&0.into(), &0.into())
    );
    assert!(
        checked["die_temperature_k"].as_f64().unwrap() < 1e-3,
        "{checked}"
    );
    let range = &checked["die_range_c"];
    assert!(
        range[1].as_f64().unwrap() - range[0].as_f64().unwrap() > 1.0,
        "{checked}"
    );

    // 70 °C is 10 °C outside the range, and 5 °C beyond the last node.
    let ran = bench.run(&place, &["device", "stream", "compensated", "--for", "8s"]);
    let seen = means(&ran.stdout);
    let (_, temp_c, outside) = seen[seen.len() - 1];
    assert!(outside && temp_c > 65.0, "{temp_c}");
    assert!(
        ran.stderr
            .contains("outside the temperatures of the stored calibration"),
        "{}",
        ran.stderr
    );
    bench.end();
}

#[test]
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
