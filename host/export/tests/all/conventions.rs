//! Which convention of a file fits its unit, by recordings by hand of units with readings in counts.

use std::path::{Path, PathBuf};

use mimu::calibration::Calibration;
use mimu::calibration::verify::verify;
use mimu::fit::{Options, fit};
use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use mimu::signal::stillness::STILL_FACTOR;
use mimu_export::fitting_convention;
use mimu_export::foreign;
use mimu_recording::{Batch, Manifest};
use nalgebra::{Matrix3, Vector3};
use serde_json::json;

/// Rows of a file of numbers: a time and three counts.
fn rows(path: &Path) -> Vec<[f64; 4]> {
    let text = std::fs::read_to_string(path).unwrap();
    let row = |line: &str| {
        let all = line.split_whitespace().map(|v| v.parse().ok());
        all.collect::<Option<Vec<f64>>>()?.try_into().ok()
    };
    text.lines().filter_map(row).collect()
}

/// The recording of two such files.
fn recording(folder: &Path, [accel, gyro]: [&str; 2], rate_hz: f64, gravity: f64) -> Prepared {
    let [accel, gyro] = [accel, gyro].map(|name| rows(&folder.join(name)));
    let column = |rows: &[[f64; 4]], k: usize| rows.iter().map(|row| row[k]).collect::<Vec<_>>();
    let count = accel.len().min(gyro.len());
    let unknown = || vec![f64::NAN; count];
    let raw = [
        column(&gyro[..count], 1),
        column(&gyro[..count], 2),
        column(&gyro[..count], 3),
        column(&accel[..count], 1),
        column(&accel[..count], 2),
        column(&accel[..count], 3),
    ];
    let batch = Batch {
        first_row: 0,
        t_s: column(&accel[..count], 0),
        step: Vec::new(),
        temp_c: unknown(),
        raw,
        reference: std::array::from_fn(|_| unknown()),
        more: Vec::new(),
    };
    let manifest: Manifest = serde_json::from_value(json!({
        "format": "mimu-recording/1",
        "device": "unit",
        "sample_rate_hz": rate_hz,
        "gravity_mps2": gravity,
        "raw_unit": "count",
        "reference": "gravity",
    }))
    .unwrap();
    Prepared::of(manifest, &batch, STILL_FACTOR).unwrap()
}

/// C and o.
type Model = (Matrix3<f64>, Vector3<f64>);

/// A header in C with the calibration, each sensor changed.
fn header(of: &Calibration, change: &dyn Fn(Sensor, Model) -> Model) -> String {
    let mut text = String::new();
    for sensor in Sensor::BOTH {
        let model = of.inverse(sensor).unwrap();
        let (c, o) = change(sensor, (model.matrix, model.offset));
        let row = |row: [f64; 3]| format!("{{{:e}f, {:e}f, {:e}f}}", row[0], row[1], row[2]);
        let [x, y, z] = [0, 1, 2].map(|i| row([c[(i, 0)], c[(i, 1)], c[(i, 2)]]));
        text += &format!(
            "static const float imu_{sensor}_C[3][3] = {{\n    {x},\n    {y},\n    {z}}};\n"
        );
        text += &format!(
            "static const float imu_{sensor}_o[3] = {};\n",
            row(o.into())
        );
    }
    text
}

/// What is changed in the reading of gyro and accelerometer, and the errors so.
fn read(prepared: &Prepared, text: &str, place: &str) -> Vec<(Sensor, String, f64)> {
    let file = foreign::read(text.as_bytes(), place).unwrap().unwrap();
    let (_, all) = fitting_convention::calibration(&file, prepared).unwrap();
    for reading in &all {
        println!("{}", reading.text(file.format.name));
    }
    all.into_iter()
        .map(|of| (of.sensor, of.changed, of.rms))
        .collect()
}

type Change = Box<dyn Fn(Sensor, Model) -> Model>;

fn of_gyro_by(factor: Matrix3<f64>) -> Change {
    Box::new(move |sensor, (c, o)| match sensor {
        Sensor::Gyro => (factor * c, o),
        Sensor::Accel => (c, o),
    })
}

fn of_gyro(change: fn(Model) -> Model) -> Change {
    Box::new(move |sensor, model| match sensor {
        Sensor::Gyro => change(model),
        Sensor::Accel => model,
    })
}

#[test]
fn a_convention_that_was_confused_is_named() {
    let example = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../tests/example");
    let prepared = recording(&example, ["accel.txt", "gyro.txt"], 50.0, 9.80665);
    let fitted = fit(prepared.clone(), Options::default()).unwrap();
    let own = Calibration::of(&fitted, &[], "2026-01-02T03:04:05Z").unwrap();
    let errors = verify(&prepared, &own).unwrap().sensors;
    let cases: [(&str, &str, Change); 9] = [
        ("", "", Box::new(|_, m| m)),
        (
            "with its matrix transposed",
            "",
            of_gyro(|(c, o)| (c.transpose(), o)),
        ),
        (
            "with its matrix inverted",
            "with its matrix inverted",
            Box::new(|_, (c, o)| (c.try_inverse().unwrap(), o)),
        ),
        (
            "with its output in deg/s",
            "with its output in g",
            Box::new(|sensor, (c, o)| match sensor {
                Sensor::Gyro => (c * 1f64.to_degrees(), o * 1f64.to_degrees()),
                Sensor::Accel => (c / 9.80665, o / 9.80665),
            }),
        ),
        (
            "with its bias in deg/s",
            "",
            of_gyro(|(c, o)| (c, o * 1f64.to_degrees())),
        ),
        (
            "with the sign of its bias changed",
            "with the sign of its bias changed",
            Box::new(|_, (c, o)| (c, -o)),
        ),
        (
            "with the recording's axes y, z, x as its x, y, z",
            "",
            of_gyro(|(c, o)| {
                let turned = Matrix3::new(0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0);
                (c * turned.transpose(), o)
            }),
        ),
        (
            "with the range of the recording 0.5 times that of the file",
            "",
            of_gyro(|(c, o)| (2.0 * c, o)),
        ),
        (
            "",
            "if its scale factors are 0.13",
            Box::new(|sensor, (c, o)| match sensor {
                Sensor::Gyro => (c, o),
                Sensor::Accel => (9.82 / 9.80665 * c, 9.82 / 9.80665 * o),
            }),
        ),
    ];
    for (gyro, accel, change) in cases {
        for (sensor, changed, rms) in read(&prepared, &header(&own, &change), "imu.h") {
            let expected = if sensor == Sensor::Gyro { gyro } else { accel };
            let is_it = changed.starts_with(expected) && changed.is_empty() == expected.is_empty();
            assert!(is_it, "{sensor}: {changed}, not {expected}");
            // Read so, it is the calibration. Gravity is found to 1e-5, which may make its error a little less.
            let own = errors[sensor].as_ref().unwrap().rms;
            assert!(
                (0.98..1.001).contains(&(rms / own)),
                "{changed}, {sensor}: {rms} {own}"
            );
        }
    }
}

/// The data sheet of the Xsens MTi of IMU-TK's data, as of JzHuai0108/imu_tk_matlab, srcs/calibrate.m (2b3880fd, BSD): offsets in counts, counts per SI, and a
/// matrix of misalignment. They are in a file of IMU-TK here, one that it computes with as `T K (raw - B)`.
#[test]
fn the_data_sheet_of_the_xsens_unit_fits_its_recording() {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let data = std::env::var_os("MIMU_DATA").map_or(beside, PathBuf::from);
    let folder = data.join("imu_tk_xsens");
    if !folder.is_dir() {
        return println!("skipped: no recordings (set MIMU_DATA)");
    }
    let prepared = recording(&folder, ["xsens_acc.mat", "xsens_gyro.mat"], 100.0, 9.81744);
    let text = "1 0 -0.01\n0.01 1 0.01\n0.02 0.01 1\n\n2.40964e-3 0 0\n0 2.42131e-3 0\n0 0 2.40964e-3\n\n33123\n33276\n32360\n";
    let [(sensor, changed, rms)] = &read(&prepared, text, "acc.calib")[..] else {
        panic!("one triad");
    };
    assert_eq!(*sensor, Sensor::Accel);
    println!("{changed}: {rms}");
    assert!(changed.is_empty() && *rms < 0.1, "{changed} {rms}");
}

/// Numbers of a stranger's file for IMU-TK whose optimizer ended anywhere: as of ouabout/imu_tk, bin/test_imu_gyro.calib (0359a077).
#[test]
fn numbers_that_fit_in_no_convention_are_called_so() {
    let example = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../tests/example");
    let prepared = recording(&example, ["accel.txt", "gyro.txt"], 50.0, 9.80665);
    let fitted = fit(prepared.clone(), Options::default()).unwrap();
    let own = Calibration::of(&fitted, &[], "2026-01-02T03:04:05Z").unwrap();
    let wrong = Matrix3::new(
        1.0, -0.713581, 0.123544, 0.67227, 1.0, 0.238768, -0.29246, -0.141602, 1.0,
    );
    let change = of_gyro_by(wrong);
    let file = foreign::read(header(&own, &change).as_bytes(), "imu.h");
    let (_, all) = fitting_convention::calibration(&file.unwrap().unwrap(), &prepared).unwrap();
    for reading in &all {
        let text = reading.text("c");
        println!("{text}");
        let none = reading.none_fits_of.is_some();
        assert_eq!(none, reading.sensor == Sensor::Gyro, "{text}");
        assert_eq!(none, text.contains("fits in no way of the "), "{text}");
    }
}
