//! Calibrations of other programs, judged by a recording of their unit. The recording is by hand, of a unit with readings in counts (tests/example).

use super::command::{done, example, json, mimu, refused};
use crate::command::says;

/// A folder with the recording `counts`, and its calibration `counts.toml`.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    example(at);
    folder
}

#[test]
fn a_transposed_matrix_is_named_and_undone() {
    let folder = folder();
    let at = folder.path();
    let own = json(at, "verify counts --calibration counts.toml");
    assert!(own.get("conventions").is_none());
    done(at, "export c counts.toml -o cal.h");
    let header = std::fs::read_to_string(at.join("cal.h")).unwrap();
    let (before, rest) = header.split_once("mimu_gyro_C[3][3] = {").unwrap();
    let (matrix, after) = rest.split_once("};").unwrap();
    let numbers: Vec<&str> = matrix
        .split(|c: char| "{}, \n".contains(c))
        .filter(|word| !word.is_empty())
        .collect();
    let column = |k: usize| format!("{{{}, {}, {}}}", numbers[k], numbers[k + 3], numbers[k + 6]);
    let transposed = [0, 1, 2].map(column).join(", ");
    let text = format!("{before}mimu_gyro_C[3][3] = {{{transposed}}};{after}");
    std::fs::write(at.join("transposed.h"), text).unwrap();
    for (file, changed) in [
        ("cal.h", ""),
        ("transposed.h", "with its matrix transposed"),
    ] {
        let found = json(at, &format!("verify counts --calibration {file}"));
        let all = found["conventions"].as_array().unwrap();
        let of = |sensor: &str| all.iter().find(|of| of["sensor"] == sensor).unwrap();
        assert_eq!(of("gyro")["changed"], changed);
        assert_eq!(of("accel")["changed"], "");
        for sensor in ["gyro", "accel"] {
            let [a, b] = [&found, &own].map(|v| v["sensors"][sensor]["rms"].as_f64().unwrap());
            assert!((a / b - 1.0).abs() < 1e-3, "{file}, {sensor}: {a} {b}");
        }
    }
    let text = done(at, "verify counts --calibration transposed.h");
    let said = [
        "transposed.h: a file of c",
        "gyro: fits with its matrix transposed, error ",
    ];
    says(&text, &said);
}

#[test]
fn a_calibration_goes_through_formats_and_comes_back() {
    let folder = folder();
    let at = folder.path();
    done(at, "convert counts.toml --to fusion -o cal.h");
    done(at, "convert cal.h --to core -o cal.bin");
    done(at, "convert cal.bin --to mimu -o back.toml");
    let [own, back] = ["counts.toml", "back.toml"]
        .map(|file| json(at, &format!("verify counts --calibration {file}")));
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
    let error = refused(at, "convert back.toml --to inav -o x.txt");
    says(&error, &["were not provided: --acc-1g <CODES>"]);
    std::fs::write(at.join("empty.toml"), "").unwrap();
    let error = refused(at, "convert empty.toml --to c -o x.h");
    says(&error, &["empty.toml: the file is empty"]);
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
    done(at, "compare counts.toml cal.h");
    done(at, "report counts --calibration cal.h -o unit.html");
}

/// IMU-TK writes a file of each triad. A gyro is judged with the accelerometer's.
#[test]
fn two_files_of_a_triad_each_are_one_calibration() {
    let folder = folder();
    let at = folder.path();
    for sensor in ["accel", "gyro"] {
        let options = format!("--calibration counts.toml --sensor {sensor}");
        done(at, &format!("export imu-tk {options} -o {sensor}.calib"));
    }
    let both = "verify counts --calibration accel.calib --calibration gyro.calib";
    let [own, found] = ["verify counts --calibration counts.toml", both].map(|of| json(at, of));
    done(at, "convert gyro.calib accel.calib --to mimu -o cal.toml");
    let converted = json(at, "verify counts --calibration cal.toml");
    for sensor in ["gyro", "accel"] {
        let rms = |of: &serde_json::Value| of["sensors"][sensor]["rms"].as_f64().unwrap();
        for read in [&found, &converted] {
            let ratio = rms(read) / rms(&own);
            assert!((ratio - 1.0).abs() < 1e-3, "{sensor}: {ratio}");
        }
    }
    let error = refused(at, "verify counts --calibration gyro.calib");
    says(
        &error,
        &["the calibration has no accelerometer", "(--calibration)"],
    );
    for (files, problem) in [
        (["gyro.calib", "gyro.calib"], "both files have"),
        (["counts.toml", "gyro.calib"], "which has both triads"),
    ] {
        let [first, second] = files;
        let error = refused(
            at,
            &format!("verify counts --calibration {first} --calibration {second}"),
        );
        says(&error, &[problem, second]);
    }
}
