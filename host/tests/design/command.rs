//! The command `mimu design`: what it writes and what it refuses.

use std::path::Path;
use std::process::{Command, Output};

fn mimu(folder: &Path, arguments: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_mimu"));
    command
        .current_dir(folder)
        .arg("design")
        .args(arguments.split(' '));
    command.output().unwrap()
}

fn json(arguments: &str) -> serde_json::Value {
    let out = mimu(Path::new("."), &format!("{arguments} --json -"));
    assert!(
        out.status.success(),
        "{arguments}: {}",
        String::from_utf8_lossy(&out.stderr)
    );
    serde_json::from_slice(&out.stdout).unwrap()
}

#[test]
fn json_has_the_agreed_keys_and_sigmas_in_si() {
    // Six faces: a scale factor is half the difference of two dwells over gravity.
    let design = json("--scheme six-face --sigma 0.01");
    assert_eq!(design["format"], "mimu-design/1");
    assert_eq!(design["positions"].as_array().unwrap().len(), 6);
    assert!((design["d_efficiency"].as_f64().unwrap() - 1.0).abs() < 1e-7);
    let parameters = design["sigma_per_parameter"].as_array().unwrap();
    assert_eq!(parameters.len(), 12);
    let scale = parameters.iter().find(|p| p["name"] == "P_yy").unwrap();
    assert_eq!(scale["unit"], "1");
    let known = 0.01 / (2f64.sqrt() * 9.80665);
    assert!((scale["value"].as_f64().unwrap() / known - 1.0).abs() < 1e-9);
}

#[test]
fn a_parameter_that_is_not_determined_has_no_sigma() {
    let design = json("--scheme six-face --reference gravity");
    let parameters = design["sigma_per_parameter"].as_array().unwrap();
    let value = |name: &str| &parameters.iter().find(|p| p["name"] == name).unwrap()["value"];
    assert!(value("C_yx").is_null() && value("C_yy").is_number() && value("o_z").is_number());
}

#[test]
fn the_plan_is_the_design() {
    let folder = tempfile::tempdir().unwrap();
    let arguments =
        "--sensor gyro -n 8 --model affine,cubic --dwell 12.5 -o plan.toml --json plan.json";
    let out = mimu(folder.path(), arguments);
    assert!(
        out.status.success(),
        "{}",
        String::from_utf8_lossy(&out.stderr)
    );
    let plan: toml::Table = std::fs::read_to_string(folder.path().join("plan.toml"))
        .unwrap()
        .parse()
        .unwrap();
    let design: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("plan.json")).unwrap()).unwrap();
    assert_eq!(plan["format"].as_str(), Some("mimu-plan/1"));
    assert_eq!(plan["carrier"].as_str(), Some("table"));
    let steps = plan["step"].as_array().unwrap();
    assert_eq!(steps.len(), 8);
    for (k, step) in steps.iter().enumerate() {
        assert_eq!(step["dwell_s"].as_float(), Some(12.5));
        for axis in 0..3 {
            let (up, known) = (
                step["up"][axis].as_float().unwrap(),
                design["positions"][k][axis].as_f64().unwrap(),
            );
            assert!((up - known).abs() < 1e-9);
        }
        let rate = step.get("rate_dps").map_or(0.0, |r| r.as_float().unwrap());
        assert!((rate - design["rates_dps"][k].as_f64().unwrap()).abs() < 1e-5);
    }
    // Nothing else was left in the folder.
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
}

#[test]
fn text_fits_a_hundred_columns() {
    let all = [
        "--compare",
        "--compare --sensor gyro",
        "--compare --reference gravity",
        "--budget 10",
        "--scheme fang-nine",
        "--scheme niu-8 --table two-axis",
        "--scheme xu-rates --sensor gyro",
        "-n 14 --sensor gyro --model affine,quadratic,cubic,cross,g-sensitivity --walk 0.0001",
        "-n 16 --reference gravity --model affine,quadratic",
    ];
    for arguments in all {
        let out = mimu(Path::new("."), arguments);
        assert!(
            out.status.success(),
            "{arguments}: {}",
            String::from_utf8_lossy(&out.stderr)
        );
        for line in String::from_utf8(out.stdout).unwrap().lines() {
            assert!(line.chars().count() <= 100, "{arguments}: {line}");
        }
    }
}

#[test]
fn refusals_are_one_line_with_status_1_and_wrong_usage_has_status_2() {
    let cases = [
        ("-n 3", 1, "at least 4"),
        (
            "-n 20 --reference gravity --model affine,cross",
            1,
            "cross_x_yz",
        ),
        ("-n 20 --table faces --model affine,cubic", 1, "cubic_x"),
        ("-n 8 --sensor gyro --reference gravity", 1, "turns"),
        ("-n 8 --sensor gyro --table two-axis", 1, "three-axis"),
        ("-n 8 --model affine,g-sensitivity", 1, "--sensor gyro"),
        ("--scheme xu-rates", 1, "--sensor gyro"),
        ("--scheme niu-8 --sensor gyro", 1, "--sensor accel"),
        ("--budget 0.1", 1, "allow more time"),
        ("-n 8 -o missing/plan.toml", 1, "folder"),
        ("--dwell 10", 2, "--compare"),
        ("-n 8 --scheme six-face", 2, "cannot be used with"),
        ("-n 8 --model affine,quartic", 2, "quartic"),
        ("-n 8 --dwell=-1", 2, "above 0"),
        ("-n 8 --dwell NaN", 2, "above 0"),
        ("-n 8 --sensor gyro --rates 10,,30", 2, "deg/s"),
    ];
    let folder = tempfile::tempdir().unwrap();
    for (arguments, status, says) in cases {
        let out = mimu(folder.path(), arguments);
        let error = String::from_utf8(out.stderr).unwrap();
        assert_eq!(out.status.code(), Some(status), "{arguments}: {error}");
        assert!(error.contains(says), "{arguments}: {error}");
        assert!(
            status == 2 || error.lines().count() == 1,
            "{arguments}: {error}"
        );
        assert!(out.stdout.is_empty());
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
