//! What a format writes, its reader reads: the same C and o within the printed digits, as far as the format has a place for them.

use mimu::calibration::Calibration;
use mimu::quantity::{PerSensor, Sensor};
use mimu::triad::Forward;
use mimu_allan::model::Term;
use mimu_core::compensation::Affine;
use mimu_export::foreign::{self, Foreign};
use mimu_export::{FORMATS, Noise, Sources};
use mimu_recording::RawUnit;
use nalgebra::{Matrix3, Vector3};

use crate::noise_of_one_axis::noise;
use crate::unit::calibration_of;

/// What a format keeps of a triad.
#[derive(Clone, Copy, PartialEq)]
enum Kept {
    Nothing,
    /// C and o.
    Whole,
    /// C and o in the frame of the accelerometer.
    Rotated,
    /// C in that frame, or in that of the calibration.
    RotatedMatrix,
    Matrix,
    /// The diagonal of P and b.
    Axes,
    /// The diagonal of P.
    Gains,
    /// b.
    Bias,
}

use Kept::{Axes, Bias, Gains, Matrix, Nothing, Rotated, RotatedMatrix, Whole};

/// Format, its options, unit of the readings, what it keeps of gyro and accelerometer, and the largest error in SI: of rounding, or of single precision.
type Case = (
    &'static str,
    &'static [&'static str],
    &'static str,
    [Kept; 2],
    f64,
);

#[rustfmt::skip]
const CASES: [Case; 24] = [
    ("c", &[], "count", [Whole, Whole], 1e-6),
    ("rust", &[], "count", [Whole, Whole], 1e-6),
    ("core", &[], "count", [Whole, Whole], 1e-6),
    ("json", &[], "SI", [Whole, Whole], 1e-14),
    ("kalibr", &[], "SI", [RotatedMatrix, RotatedMatrix], 1e-8),
    (
        "kalibr",
        &["--result"],
        "SI",
        [RotatedMatrix, RotatedMatrix],
        1e-8,
    ),
    ("openvins", &[], "SI", [Matrix, Matrix], 1e-8),
    (
        "openvins",
        &["--model", "rpng"],
        "SI",
        [Matrix, Matrix],
        1e-8,
    ),
    ("imu-calib", &[], "SI", [Nothing, Whole], 1e-8),
    ("dlio", &[], "SI", [Bias, Whole], 1e-8),
    (
        "imu-tk",
        &["--sensor", "accel"],
        "count",
        [Nothing, Whole],
        1e-9,
    ),
    (
        "imu-tk",
        &["--sensor", "gyro"],
        "count",
        [Whole, Nothing],
        1e-9,
    ),
    ("fusion", &[], "count", [Whole, Whole], 1e-5),
    ("realsense", &[], "SI", [Whole, Whole], 1e-5),
    (
        "realsense",
        &["--layout", "json"],
        "SI",
        [Whole, Whole],
        1e-12,
    ),
    ("depthai", &[], "SI", [Whole, Whole], 1e-12),
    ("basalt", &[], "SI", [Rotated, Rotated], 1e-12),
    ("matlab", &[], "SI", [Whole, Whole], 1e-12),
    ("px4", &[], "SI", [Bias, Axes], 1e-5),
    ("ardupilot", &["--qgc"], "SI", [Bias, Axes], 1e-5),
    // Whole codes of 1/2048 g, and gains of 1/4096.
    ("betaflight", &[], "SI", [Nothing, Bias], 0.0025),
    ("inav", &["--acc-1g", "2048"], "SI", [Nothing, Axes], 0.004),
    ("adafruit", &[], "SI", [Bias, Bias], 1e-6),
    ("adafruit", &["--layout", "json"], "SI", [Bias, Bias], 1e-12),
];
/// Likewise.
#[rustfmt::skip]
const MORE: [Case; 5] = [
    ("slimenrf", &[], "SI", [Gains, Nothing], 1e-5),
    ("pigeon", &[], "SI", [Gains, Nothing], 1e-5),
    ("iio", &[], "SI", [Bias, Bias], 1e-8),
    ("autoware", &[], "SI", [Bias, Nothing], 1e-8),
    ("gazebo", &[], "SI", [Bias, Bias], 1e-8),
];

/// The file of a format, read.
fn read_back(name: &str, options: &[&str], calibration: &Calibration) -> Foreign {
    let format = FORMATS.iter().find(|format| format.name == name).unwrap();
    let options: Vec<String> = options.iter().map(ToString::to_string).collect();
    let noise = noise();
    let of_noise = format.noise == Noise::Only;
    let from = Sources {
        calibration: (!of_noise).then_some((calibration, "cal.toml")),
        noise: (format.noise != Noise::No).then_some(&noise),
        biases: None,
    };
    let export = format.chosen(&options).unwrap().export(&from).unwrap();
    let place = if options.contains(&"gyro".into()) {
        "gyro.calib"
    } else {
        "file"
    };
    let read = foreign::read(&export.content, place).unwrap();
    read.unwrap_or_else(|| panic!("{name} {options:?} is not recognised"))
}

/// The part of `model` that is kept; `rotation` is that to the frame of the accelerometer.
fn kept(model: &Affine<f64>, of: Kept, rotation: &Matrix3<f64>) -> Affine<f64> {
    let Forward { matrix: p, bias: b } = Forward::of(model).unwrap();
    let zero = Vector3::zeros();
    let along = Matrix3::from_diagonal(&p.diagonal().map(f64::recip));
    let [matrix, offset] = [model.matrix, Matrix3::from_diagonal(&model.offset)];
    let (matrix, offset) = match of {
        Whole | Nothing => (matrix, offset.diagonal()),
        Matrix => (matrix, zero),
        Rotated => (rotation * matrix, rotation * model.offset),
        RotatedMatrix => (rotation * matrix, zero),
        Axes => (along, -along * b),
        Gains => (along, zero),
        Bias => (Matrix3::identity(), -b),
    };
    Affine { matrix, offset }
}

#[test]
fn what_a_format_keeps_of_a_calibration_is_read_back() {
    for (name, options, unit, keeps, most) in CASES.into_iter().chain(MORE) {
        let written = calibration_of(unit, false);
        let models = PerSensor::from_fn(|s| written.inverse(s).unwrap());
        let file = read_back(name, options, &written);
        assert_eq!(file.format.name, name, "{options:?}");
        let raw_unit = written.recording.raw_unit;
        assert_eq!(file.raw_unit(RawUnit::Si), raw_unit, "{name}");
        let read = file.calibration(RawUnit::Si).unwrap();
        assert!(!read.is_uncertain(), "{name}");
        let accel = read.inverse(Sensor::Accel);
        let rotation = accel.map(|accel| accel.matrix * models.accel.matrix.try_inverse().unwrap());
        let rotation = rotation.unwrap_or_else(Matrix3::identity);
        for (sensor, of) in Sensor::BOTH.into_iter().zip(keeps) {
            let Some(found) = read.inverse(sensor) else {
                assert!(of == Nothing, "{name}: no {sensor}");
                continue;
            };
            assert!(of != Nothing, "{name}: {sensor}");
            if matches!(of, Rotated | RotatedMatrix) {
                let error = rotation * rotation.transpose() - Matrix3::identity();
                assert!(
                    error.amax() < 1e-8 && rotation.determinant() > 0.0,
                    "{name}"
                );
            }
            // Compared at inputs of up to 1 g and 100 deg/s.
            let expected = kept(&models[sensor], of, &rotation);
            for k in 0..6 {
                let size = if k % 2 == 0 { 1.75 } else { -1.75 };
                let size = if sensor == Sensor::Gyro {
                    size
                } else {
                    5.6 * size
                };
                let raw = Forward::of(&models[sensor])
                    .unwrap()
                    .apply(&Vector3::ith(k / 2, size));
                let error = (found.apply(&raw) - expected.apply(&raw)).amax();
                assert!(error <= most, "{name} {options:?}, {sensor}: {error}");
            }
        }
    }
}

#[test]
fn every_format_is_read_back() {
    let tried: Vec<&str> = CASES.iter().chain(&MORE).map(|case| case.0).collect();
    let calibration = calibration_of("SI", false);
    for format in FORMATS {
        if format.noise == Noise::Only {
            assert_eq!(
                read_back(format.name, &[], &calibration).format.name,
                format.name
            );
        } else {
            assert!(tried.contains(&format.name), "{}", format.name);
        }
    }
}

#[test]
fn noise_is_read_back_in_the_densities_that_were_written() {
    let (calibration, written) = (calibration_of("SI", false), noise());
    for format in FORMATS.iter().filter(|f| f.noise != Noise::No) {
        let file = read_back(format.name, &[], &calibration);
        let found = file.noise(Some(written.sample_rate_hz)).unwrap().unwrap();
        // The files of a program with one number have the worst axis, of the readings before the calibration if the file has one.
        for channel in &found.channel {
            for term in [Term::N, Term::K] {
                let Ok(density) = channel.get(term).map(|c| c.value) else {
                    // No place for a walk.
                    assert!(
                        ["ros-imu", "autoware"].contains(&format.name),
                        "{}",
                        format.name
                    );
                    continue;
                };
                let of = written
                    .channel
                    .iter()
                    .filter(|c| c.name[..4] == channel.name[..4]);
                let values: Vec<f64> = of.map(|c| c.get(term).unwrap().value).collect();
                let axis = written
                    .channel
                    .iter()
                    .find(|c| c.name == channel.name)
                    .unwrap();
                let own = axis.get(term).unwrap().value;
                let worst = values.into_iter().fold(0.0, f64::max);
                let is_one_of = [own, worst]
                    .iter()
                    .any(|v| (density / v - 1.0).abs() < 0.02);
                assert!(is_one_of, "{}, {}: {density}", format.name, channel.name);
                assert!(channel.get(term).unwrap().sigma.is_nan());
            }
        }
        assert_eq!(found.channel.len(), 6, "{}", format.name);
    }
}

/// The file of a format, converted to another, with the notes.
fn converted(text: &str, to: &str) -> (String, Vec<String>) {
    let file = foreign::read(text.as_bytes(), "file").unwrap().unwrap();
    let calibration = file.calibration(RawUnit::Si).unwrap();
    let noise = file.noise(Some(200.0)).unwrap();
    let from = Sources {
        calibration: Some((&calibration, "file")),
        noise: noise.as_ref(),
        biases: None,
    };
    let format = FORMATS.iter().find(|format| format.name == to).unwrap();
    let options = match to {
        "inav" => vec!["--acc-1g".to_owned(), "2048".to_owned()],
        _ => Vec::new(),
    };
    let export = format.chosen(&options).unwrap().export(&from).unwrap();
    (String::from_utf8(export.content).unwrap(), export.notes)
}

/// The numbers of x, y and z behind the keys `name`, `#` in place of the axis.
fn three(text: &str, name: &str) -> [f64; 3] {
    ["X", "Y", "Z"].map(|axis| {
        let name = name.replace('#', axis) + ",";
        let line = text.lines().find_map(|line| line.strip_prefix(&name));
        line.unwrap_or_else(|| panic!("{name} in {text}"))
            .parse()
            .unwrap()
    })
}

/// Densities of a Kalibr file are those of its readings, so a scale factor of 5 % leaves them as they are in another such file, and Basalt, whose densities are
/// those of calibrated readings, gets them divided by it.
#[test]
fn noise_of_readings_is_kept_between_files_of_it_and_calibrated_for_the_others() {
    let kalibr = "accelerometer_noise_density: 0.006\naccelerometer_random_walk: 0.0002\ngyroscope_noise_density: 0.0004\ngyroscope_random_walk: 4.0e-06\nupdate_rate: 200.0\n\
                  accelerometers:\n  M:\n  - [1.05, 0.0, 0.0]\n  - [0.0, 1.05, 0.0]\n  - [0.0, 0.0, 1.05]\n\
                  gyroscopes:\n  M:\n  - [0.99732203, 0.0, 0.0]\n  - [0.00373207, 0.99372249, 0.0]\n  - [-0.00218998, -0.00186741, 0.99919668]\n";
    for to in ["kalibr", "openvins"] {
        let (text, _) = converted(kalibr, to);
        for line in [
            "accelerometer_noise_density: 6.000000e-3 ",
            "accelerometer_random_walk: 2.000000e-4 ",
            "gyroscope_noise_density: 4.000000e-4 ",
            "gyroscope_random_walk: 4.000000e-6 ",
        ] {
            assert!(text.contains(line), "{to}: {line}: {text}");
        }
    }
    let (basalt, _) = converted(kalibr, "basalt");
    let read: serde_json::Value = serde_json::from_str(&basalt).unwrap();
    for (key, expected) in [
        ("accel_noise_std", 0.006 / 1.05),
        ("accel_bias_std", 0.0002 / 1.05),
    ] {
        for axis in 0..3 {
            let found = read["value0"][key][axis].as_f64().unwrap();
            assert!((found / expected - 1.0).abs() < 1e-9, "{key}: {found}");
        }
    }
    // And back: the readings are noisier again.
    let (back, _) = converted(&basalt, "kalibr");
    assert!(
        back.contains("accelerometer_noise_density: 6.000000e-3 "),
        "{back}"
    );
    let (again, _) = converted(&basalt, "basalt");
    let again: serde_json::Value = serde_json::from_str(&again).unwrap();
    let first = |of: &serde_json::Value| of["value0"]["accel_noise_std"][0].as_f64().unwrap();
    assert!((first(&again) / first(&read) - 1.0).abs() < 1e-12);
}

/// PX4 and ArduPilot calibrate with x forward, y right, z down, Betaflight with x forward, y left, z up, INAV on the axes of the sensor. Offsets in codes of
/// 1/2048 g.
#[test]
fn between_two_choices_of_the_axes_of_the_craft_y_and_z_change_their_signs() {
    const CODE: f64 = 9.80665 / 2048.0;
    let codes = [1.20, -19.11, 6.95];
    let mut px4 = String::new();
    for (axis, code) in ["X", "Y", "Z"].into_iter().zip(codes) {
        px4 += &format!(
            "CAL_ACC0_{axis}OFF,{}\nCAL_ACC0_{axis}SCALE,1\n",
            code * CODE
        );
        px4 += &format!("CAL_GYRO0_{axis}OFF,{}\n", 0.001 * code);
    }
    let is_rotated = |notes: &[String]| notes.iter().any(|note| note.starts_with("Rotated by"));
    let (betaflight, notes) = converted(&px4, "betaflight");
    assert!(
        betaflight.contains("set acc_calibration = 1,19,-7,1\n"),
        "{betaflight}"
    );
    assert!(
        betaflight.contains("rotated to x forward, y left, z up"),
        "{betaflight}"
    );
    assert!(is_rotated(&notes), "{notes:?}");
    for (to, name) in [("px4", "CAL_ACC0_#OFF"), ("ardupilot", "INS_ACCOFFS_#")] {
        let (back, notes) = converted(&betaflight, to);
        assert!(is_rotated(&notes), "{to}: {notes:?}");
        for (found, whole) in three(&back, name).into_iter().zip([1.0, -19.0, 7.0]) {
            assert!((found / CODE - whole).abs() < 1e-5, "{to}: {found}");
        }
    }
    // The same axes, and axes that the file does not state.
    let (ardupilot, notes) = converted(&px4, "ardupilot");
    assert!(!is_rotated(&notes), "{notes:?}");
    for (name, size) in [("INS_ACCOFFS_#", CODE), ("INS_GYROFFS_#", 0.001)] {
        for (found, code) in three(&ardupilot, name).into_iter().zip(codes) {
            assert!((found / size - code).abs() < 1e-5, "{name}: {found}");
        }
    }
    let (inav, notes) = converted(&px4, "inav");
    assert!(inav.contains("set acczero_y = -19\n"), "{inav}");
    assert!(!is_rotated(&notes), "{notes:?}");
}

#[test]
fn triads_that_are_not_read_are_named_and_a_zero_has_no_sign() {
    let read = |text: &str| foreign::read(text.as_bytes(), "file").unwrap().unwrap();
    let px4 = "CAL_ACC0_XOFF 0.1\nCAL_ACC0_YOFF 0.1\nCAL_ACC0_ZOFF 0.1\nCAL_ACC0_XSCALE 1\nCAL_ACC0_YSCALE 1\nCAL_ACC0_ZSCALE 1\n";
    assert_eq!(
        read(&format!("{px4}CAL_MAG2_ID 0\nCAL_MAG2_ROT -1\n")).left_out(),
        None
    );
    let more = "CAL_ACC2_XOFF 0.1\nCAL_GYRO2_XOFF 0.1\nCAL_MAG1_XOFF 0.1\n";
    let left_out = read(&format!("{px4}{more}")).left_out().unwrap();
    let said = "file: CAL_ACC2, CAL_GYRO2, CAL_MAG1_XOFF are not read";
    assert!(left_out.starts_with(said), "{left_out}");
    let one = "set acc_calibration = 1,2,3,1\nset mag_calibration = 5,6,7\n";
    let left_out = read(one).left_out().unwrap();
    assert!(
        left_out.starts_with("file: mag_calibration is not read"),
        "{left_out}"
    );
    let (text, _) = converted(
        "accelerometers:\n  M: [1, 0, 0, 0, 1, 0, 0, 0, 1]\ngyroscopes:\n  M: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n",
        "px4",
    );
    assert!(text.contains("\nCAL_GYRO0_XOFF,0\n"), "{text}");
}

#[test]
fn what_is_missing_is_named_with_its_key() {
    let refused = |text: &str| {
        let error = foreign::read(text.as_bytes(), "cal.yaml").err();
        error.map(|e| e.to_string()).unwrap_or_default()
    };
    let said = refused("SM: [1, 0, 0, 0, 1, 0, 0, 0]\nbias: [0, 0, 0]\n");
    assert!(
        said.starts_with("cal.yaml, key SM: it is missing, or has fewer numbers than 9"),
        "{said}"
    );
    let said = refused("CAL_ACC0_XOFF 0.1\nCAL_ACC0_YOFF 0.1\nCAL_ACC0_ZOFF 0.1\n");
    assert!(
        said.starts_with("cal.yaml, key CAL_ACC0_{AXIS}SCALE: it is missing"),
        "{said}"
    );
    assert!(
        foreign::read(b"t,x,y\n1,2,3\n", "log.csv")
            .unwrap()
            .is_none()
    );
    let noise = foreign::read(b"acc_n: 0.1\ngyr_n: 0.01\n", "vins.yaml")
        .unwrap()
        .unwrap();
    assert!(noise.calibration(RawUnit::Si).is_err());
    assert!(
        noise
            .noise(None)
            .unwrap_err()
            .to_string()
            .contains("does not say the rate")
    );
}
