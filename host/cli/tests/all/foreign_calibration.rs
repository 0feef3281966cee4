//! Calibrations of other programs, judged by a recording of their unit. The recording is by hand, of a unit with readings in counts (tests/example).

use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Vector3};
use serde_json::Value;

use super::command::{done, json, mimu, refused};
use crate::command::says;

/// A folder with the recording `counts`, and its calibration `cal.toml`.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let example = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../tests/example");
    for name in ["accel.txt", "gyro.txt"] {
        std::fs::copy(example.join(name), at.join(name)).unwrap();
    }
    done(
        at,
        "import accel.txt gyro.txt --columns t_s,accel_x,accel_y,accel_z --columns t_s,gyro_x,gyro_y,gyro_z --raw-unit count \
         --gravity 9.80665 -o counts",
    );
    done(at, "fit counts -o cal.toml");
    folder
}

/// C and o.
type Model = (Matrix3<f64>, Vector3<f64>);

/// A header in C with the calibration at `at`, changed for each sensor: by other means than the export.
fn write_header(at: &Path, change: &dyn Fn(&str, Model) -> Model) {
    let text = std::fs::read_to_string(at.join("cal.toml")).unwrap();
    let calibration: toml::Table = text.parse().unwrap();
    let mut header = String::new();
    for sensor in ["gyro", "accel"] {
        let number = |v: &toml::Value| v.as_float().unwrap();
        let row = |v: &toml::Value| v.as_array().unwrap().iter().map(number).collect::<Vec<_>>();
        let rows: Vec<f64> = calibration[sensor]["C"]
            .as_array()
            .unwrap()
            .iter()
            .flat_map(row)
            .collect();
        let c = Matrix3::from_row_slice(&rows);
        let o = Vector3::from_vec(row(&calibration[sensor]["o"]));
        let (c, o) = change(sensor, (c, o));
        let rows: Vec<String> = c
            .row_iter()
            .map(|row| format!("{{{:e}f, {:e}f, {:e}f}}", row[0], row[1], row[2]))
            .collect();
        header += &format!(
            "static const float imu_{sensor}_C[3][3] = {{\n    {}}};\n",
            rows.join(",\n    ")
        );
        header += &format!(
            "static const float imu_{sensor}_o[3] = {{{:e}f, {:e}f, {:e}f}};\n",
            o[0], o[1], o[2]
        );
    }
    std::fs::write(at.join("imu.h"), header).unwrap();
}

fn changed<'a>(found: &'a Value, sensor: &str) -> &'a str {
    let all = found["conventions"].as_array().unwrap();
    let own = all.iter().find(|of| of["sensor"] == sensor);
    own.unwrap()["changed"].as_str().unwrap()
}

#[test]
fn a_convention_that_was_confused_is_named() {
    let folder = folder();
    let at = folder.path();
    let own = json(at, "verify counts --calibration cal.toml --json -");
    assert!(own.get("conventions").is_none());
    let of_gyro = |change: fn(Model) -> Model| {
        move |sensor: &str, model: Model| match sensor {
            "gyro" => change(model),
            _ => model,
        }
    };
    let cases: [(&str, &str, Box<dyn Fn(&str, Model) -> Model>); 7] = [
        ("", "", Box::new(|_, m| m)),
        (
            "with its matrix transposed",
            "",
            Box::new(of_gyro(|(c, o)| (c.transpose(), o))),
        ),
        (
            "with its matrix inverted",
            "with its matrix inverted",
            Box::new(|_, (c, o)| (c.try_inverse().unwrap(), o)),
        ),
        (
            "with its output in deg/s",
            "with its output in g",
            Box::new(|sensor, (c, o)| {
                let unit = if sensor == "gyro" {
                    1f64.to_degrees()
                } else {
                    1.0 / 9.80665
                };
                (c * unit, o * unit)
            }),
        ),
        (
            "with its bias in deg/s",
            "",
            Box::new(of_gyro(|(c, o)| (c, o * 1f64.to_degrees()))),
        ),
        (
            "with the sign of its bias changed",
            "with the sign of its bias changed",
            Box::new(|_, (c, o)| (c, -o)),
        ),
        (
            "with the recording's axes y, z, x as its x, y, z",
            "",
            Box::new(of_gyro(|(c, o)| {
                let turned = Matrix3::new(0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0);
                (c * turned.transpose(), o)
            })),
        ),
    ];
    for (gyro, accel, change) in cases {
        write_header(at, &change);
        let found = json(at, "verify counts --calibration imu.h --json -");
        assert_eq!(
            [changed(&found, "gyro"), changed(&found, "accel")],
            [gyro, accel]
        );
        // Read so, it is the calibration.
        for sensor in ["gyro", "accel"] {
            let [a, b] = [&found, &own].map(|v| v["sensors"][sensor]["rms"].as_f64().unwrap());
            assert!(
                (a / b - 1.0).abs() < 1e-3,
                "{gyro} {accel}: {sensor} {a} {b}"
            );
        }
    }
    let text = done(at, "verify counts --calibration imu.h");
    says(
        &text,
        &[
            "imu.h: a file of c",
            "gyro: fits with the recording's axes y, z, x",
        ],
    );
}

#[test]
fn a_calibration_goes_through_formats_and_comes_back() {
    let folder = folder();
    let at = folder.path();
    done(at, "convert cal.toml --to fusion -o cal.h");
    done(at, "convert cal.h --to core -o cal.bin");
    done(at, "convert cal.bin --to mimu -o back.toml");
    let [own, back] = ["cal.toml", "back.toml"]
        .map(|file| json(at, &format!("verify counts --calibration {file} --json -")));
    for sensor in ["gyro", "accel"] {
        let [a, b] = [&own, &back].map(|v| v["sensors"][sensor]["rms"].as_f64().unwrap());
        assert!((a / b - 1.0).abs() < 1e-3, "{sensor}: {a} {b}");
    }
    // What has no place is said, and a foreign file states no interval.
    let text = done(at, "convert back.toml --to px4 -o unit.params -- --qgc");
    says(
        &text,
        &["cross terms", "unknown, the calibration has no intervals"],
    );
    let text = std::fs::read_to_string(at.join("unit.params")).unwrap();
    assert!(text.contains("1\t1\tCAL_ACC0_XSCALE\t"), "{text}");
    assert!(
        refused(
            at,
            "convert back.toml --to px4 -o unit.params -- --nonsense"
        )
        .contains("mimu export px4 --help")
    );
    let out = mimu(at, "convert back.toml --to nonsense -o x");
    assert_eq!(out.status, Some(2));
    // Noise alone.
    std::fs::write(
        at.join("vins.yaml"),
        "acc_n: 0.1\ngyr_n: 0.01\nacc_w: 0.001\ngyr_w: 0.0001\n",
    )
    .unwrap();
    let error = refused(at, "convert vins.yaml --to kalibr -o imu.yaml");
    assert!(
        error.contains("does not say the rate") && error.contains("--rate-hz"),
        "{error}"
    );
    done(
        at,
        "convert vins.yaml --to kalibr --rate-hz 200 -o imu.yaml",
    );
    let text = std::fs::read_to_string(at.join("imu.yaml")).unwrap();
    says(&text, &["accelerometer_noise_density: 7.071068e-3"]);
    assert!(refused(at, "convert vins.yaml --to c -o x.h").contains("no calibration"));
    assert!(refused(at, "apply counts --calibration vins.yaml -o out").contains("no calibration"));
    // A calibration of another program is taken elsewhere too.
    done(at, "apply counts --calibration cal.h -o clean");
    done(at, "compare cal.toml cal.h");
    done(at, "report counts --calibration cal.h -o unit.html");
}
