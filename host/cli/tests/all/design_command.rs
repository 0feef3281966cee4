//! The command `mimu design`: its output and its refusals.

use std::path::Path;

use super::command::{self, Ran, all_refused};

fn mimu(folder: &Path, arguments: &str) -> Ran {
    command::mimu(folder, &format!("design {arguments}"))
}

fn json(arguments: &str) -> serde_json::Value {
    command::json(Path::new("."), &format!("design {arguments}"))
}

#[test]
fn json_has_the_agreed_keys_and_sigmas_in_si() {
    // Six faces: a scale factor is half the difference of two dwells over gravity.
    let design = json("-n 6 --sigma 0.01");
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
fn the_plan_is_the_design() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = "--sensor gyro -n 8 --dwell 12.5 -o plan.toml --json plan.json";
    let out = mimu(folder.path(), arguments);
    assert_eq!(out.status, Some(0), "{}", out.stderr);
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
fn refusals_are_one_line_with_status_1_and_wrong_usage_has_status_2() {
    #[rustfmt::skip]
    let cases = [
        ("-n 3", 1, "at least 4"),
        ("-n 8 --sensor gyro --reference gravity", 1, "turns"),
        ("-n 17 --table faces --reference gravity", 1, "C_yx"),
        ("--budget 0.1", 1, "allow more time"),
        ("-n 8 --rates 10", 1, "--sensor gyro"),
        ("-n 8 -o there/plan.toml", 1, "folder"),
        ("-n 8 -o folder", 1, "directory"),
        ("-n 8 -o one --json one", 1, "another name"),
        ("--dwell 10", 2, "--budget"),
        ("-n 8 --budget 5", 2, "cannot be used with"),
        ("-n 0", 2, "whole number, 1 to 200"),
        ("-n 8 --dwell=-1", 2, "from 0.1 to"),
        ("--budget 0", 2, "to 2880"),
        ("--budget 5 --dwell 3", 2, "cannot be used with"),
        ("-n 8 --sigma 0", 2, "write a number"),
        ("-n 8 --walk=-1", 2, "write a number"),
        ("-n 8 --sensor gyro --rates abc", 2, "is not a rate"),
    ];
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("folder")).unwrap();
    std::fs::write(folder.path().join("there"), "kept").unwrap();
    all_refused(folder.path(), "design", &cases);
    // Nothing was written or left behind.
    let there = std::fs::read_to_string(folder.path().join("there")).unwrap();
    let count = |path: &Path| std::fs::read_dir(path).unwrap().count();
    assert_eq!((there.as_str(), count(folder.path())), ("kept", 2));
    assert_eq!(count(&folder.path().join("folder")), 0);
}
