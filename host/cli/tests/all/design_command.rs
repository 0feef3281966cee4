//! The command `mimu design`: its output and its refusals.

use std::path::Path;

use super::command::{self, Ran, all_refused, says};

fn mimu(folder: &Path, arguments: &str) -> Ran {
    command::mimu(folder, &format!("design {arguments}"))
}

fn json(arguments: &str) -> serde_json::Value {
    command::json(Path::new("."), &format!("design {arguments}"))
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
fn people_read_the_same_numbers_in_their_units() {
    // Six faces: bias ± 1.96 σ/√6, scale factor ± 1.96 σ/(√2 g), P_xy the same in µrad. The part of x² outside the model is √(4/3): noticed from
    // 3.242 σ/√(4/3) over full scale.
    let text = |arguments: &str| {
        let all = format!("{arguments} --verbose");
        mimu(Path::new("."), &all).stdout
    };
    let accel = text("--scheme six-face --sigma 0.01");
    says(
        &accel,
        &[
            "b_x ± 0.816 mg",
            "P_xx ± 1413 ppm",
            "P_xy ± 1413 µrad",
            "quadratic from 2863 ppm FS",
            "1.02 mg, given",
        ],
    );
    // At 300 deg/s: in deg/s, and as a fraction.
    let gyro = text("--scheme six-face --sensor gyro --sigma 0.001");
    says(
        &gyro,
        &[
            "b_z ± 0.0458 deg/s",
            "P_zz ± 265 ppm",
            "P_zy ± 265 µrad",
            "quadratic from 536 ppm FS",
            "0.0573 deg/s, given",
        ],
    );
}

#[test]
fn the_plan_is_the_design() {
    let folder = tempfile::tempdir().unwrap();
    let arguments =
        "--sensor gyro -n 8 --model affine,cubic --dwell 12.5 -o plan.toml --json plan.json";
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
fn text_fits_a_hundred_columns() {
    let all = [
        "--compare",
        "--compare --sensor gyro",
        "--compare --reference gravity",
        "--compare --table two-axis",
        "-n 20 --table two-axis --reference gravity --model affine,quadratic,cubic",
        "-n 200 --seed 18446744073709551615",
        "--budget 10",
        "--scheme fang-nine",
        "--scheme niu-8 --table two-axis",
        "--scheme xu-rates --sensor gyro",
        "-n 14 --sensor gyro --model affine,quadratic,cubic,cross,g-sensitivity --walk 0.0001",
        "-n 16 --reference gravity --model affine,quadratic",
    ];
    for arguments in all {
        let out = mimu(Path::new("."), arguments);
        assert_eq!(out.status, Some(0), "{arguments}: {}", out.stderr);
        let text = out.stdout;
        assert!(text.lines().count() <= 25, "{arguments}: {text}");
        for line in text.lines() {
            assert!(line.chars().count() <= 100, "{arguments}: {line}");
        }
    }
}

#[test]
fn a_lot_is_drawn_unless_the_order_is_given_and_says_its_price() {
    let positions = |arguments: &str| json(arguments)["positions"].as_array().unwrap().clone();
    let randomised = json("-n 9");
    let shortest = json("-n 9 --order shortest");
    assert_eq!(
        (&randomised["order"], &shortest["order"]),
        (&"randomised".into(), &"shortest".into())
    );
    let longer = randomised["moves_s"].as_f64().unwrap() - shortest["moves_s"].as_f64().unwrap();
    assert!(longer > 1.0 && shortest["moves_s"] == randomised["shortest_moves_s"]);
    let text = mimu(Path::new("."), "-n 9 --verbose").stdout;
    assert!(text.contains(&format!("{longer:.1} s longer")), "{text}");
    // The same dwells: in a different order for another seed, in the same order for the same seed.
    let sorted = |mut list: Vec<serde_json::Value>| {
        list.sort_by_key(ToString::to_string);
        list
    };
    let scheme = "--scheme xu-33 --order lot --seed";
    let [one, two, again] = [1, 2, 1].map(|seed| positions(&format!("{scheme} {seed}")));
    let published = json("--scheme xu-33");
    assert_eq!(published["order"], "published");
    assert!(one == again && one != two && sorted(one.clone()) == sorted(two));
    assert!(one != *published["positions"].as_array().unwrap());
    assert_eq!(
        sorted(one),
        sorted(published["positions"].as_array().unwrap().clone())
    );
}

#[test]
fn refusals_are_one_line_with_status_1_and_wrong_usage_has_status_2() {
    #[rustfmt::skip]
    let cases = [
        ("-n 3", 1, "at least 4"),
        ("-n 20 --reference gravity --model affine,cross", 1, "cross_x_yz"),
        ("-n 20 --table faces --model affine,cubic", 1, "cubic_x"),
        ("-n 8 --sensor gyro --reference gravity", 1, "turns"),
        ("-n 8 --model affine,g-sensitivity", 1, "for the gyro (--sensor)"),
        ("--scheme xu-rates", 1, "for the gyro (--sensor)"),
        ("-n 17 --model affine,quadratic --table faces --reference gravity", 1, "quadratic"),
        ("--budget 0.1", 1, "allow more time"),
        ("--scheme six-face --table two-axis", 1, "three-axis"),
        ("-n 8 --rates 10", 1, "--sensor gyro"),
        ("-n 8 -o there/plan.toml", 1, "folder"),
        ("-n 8 -o folder", 1, "directory"),
        ("-n 8 -o one --json one", 1, "another name"),
        ("--dwell 10", 2, "--compare"),
        ("-n 8 --scheme six-face", 2, "cannot be used with"),
        ("-n 8 --model affine,quartic", 2, "quartic"),
        ("-n 0", 2, "whole number, 1 to 200"),
        ("-n 8 --dwell=-1", 2, "from 0.1 to"),
        ("--budget 0", 2, "to 2880"),
        ("--budget 5 --dwell 3", 2, "cannot be used with"),
        ("-n 8 --sigma 0", 2, "write a number"),
        ("-n 8 --walk=-1", 2, "write a number"),
        ("-n 8 --sensor gyro --rates abc", 2, "is not a rate"),
        ("--scheme seven-face", 2, "six-face"),
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
