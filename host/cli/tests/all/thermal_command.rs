//! The command `mimu thermal fit` on niu's unit and procedure, with the bench's truth.

use std::path::Path;

use mimu_rig::plan::Plan;
use mimu_rig::rig_file::{RigFile, RigTruth};
use serde_json::Value;

use super::command::{done, mimu};

/// niu's MTi-G in its chamber: always the same unit; `noise` is the seed of the noise.
fn record(folder: &Path, name: &str, noise: u64) {
    let rig = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../rig");
    record_plan(folder, name, noise, &rig.join("plans/niu-ramp.toml"));
}

/// The same unit by another plan.
fn record_plan(folder: &Path, name: &str, noise: u64, plan: &Path) {
    let rig = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../rig");
    let file = RigFile::read(&rig.join("rigs/niu-mtig.toml")).unwrap();
    let truth = RigTruth::resolve(&file, 1).unwrap();
    let plan = Plan::read(plan).unwrap();
    let output = mimu_rig::record::Output::new(&folder.join(name), &plan).unwrap();
    mimu_rig::record::write(&plan, &truth, noise, &output).unwrap();
}

#[test]
#[ignore = "nightly: two soaks of several hours"]
fn niu_s_unit_gets_curves_and_lags_that_hold_the_truth_and_another_run_agrees() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    record(folder, "niu", 1);
    record(folder, "again", 2);
    let fitted = done(
        folder,
        "thermal fit niu --verify again -o cal.toml --plot curves.svg --page curves.html --json -",
    );
    let result: Value = serde_json::from_str(&fitted).unwrap();
    assert_eq!(result["format"], "mimu-thermal/1");
    assert_eq!(result["verdict"], "fitted");
    // The dies' lags in `rigs/niu-mtig.toml`: 60 s for the gyros, 30 s for the accelerometer. Intervals of 99.9 %, because there are two.
    for (sensor, truth) in [("gyro", 60.0), ("accel", 30.0)] {
        let found = &result["sensors"][sensor];
        let number = |key: &str| found["lag_s"][key].as_f64().unwrap();
        let half = 0.5 * (number("upper") - number("lower"));
        let off = (number("value") - truth).abs();
        assert!(off < 3.3 / 1.96 * half, "{sensor}: {found}");
        assert!(half < 15.0, "{sensor}: {found}");
        let ratio =
            found["held_out_rms"].as_f64().unwrap() / found["noise_floor"].as_f64().unwrap();
        assert!(
            ratio < 1.15,
            "{sensor}: {ratio} of the noise in another run"
        );
    }
    assert_eq!(result["curves"].as_array().unwrap().len() % 2, 0);
    let calibration = std::fs::read_to_string(folder.join("cal.toml")).unwrap();
    assert!(calibration.contains("format = \"mimu-calibration/2\""));
    // Half a minute apart, on ramps of 2 K/min: each has its own lag.
    let calibration: toml::Table = calibration.parse().unwrap();
    let lag_s = |of: &str| calibration["temperature"]["dies"][of]["lag_s"].as_float();
    let [gyro_s, accel_s] = ["gyro", "accel"].map(|of| lag_s(of).unwrap());
    assert!((gyro_s - accel_s).abs() > 15.0, "{gyro_s} {accel_s}");
    let picture = std::fs::read_to_string(folder.join("curves.svg")).unwrap();
    let bands = picture.matches(" band\"").count();
    assert_eq!(bands, 24, "a band for each parameter");
    let dwells = result["sensors"]["gyro"]["dwells"].as_array().unwrap();
    assert_eq!(dwells.len(), {
        let bins = result["sensors"]["gyro"]["bins"].as_array().unwrap();
        bins.iter()
            .map(|b| b["dwells"].as_u64().unwrap())
            .sum::<u64>() as usize
    });
    assert!(dwells.iter().any(|d| d["temperature"] == "cooling"));
    let page = std::fs::read_to_string(folder.join("curves.html")).unwrap();
    let options = roxmltree::ParsingOptions {
        allow_dtd: true,
        ..Default::default()
    };
    let page = roxmltree::Document::parse_with_options(&page, options).unwrap();
    let numbers = page.descendants().filter(|n| n.has_tag_name("data"));
    let values: Vec<f64> = numbers
        .map(|n| n.attribute("value").unwrap().parse().unwrap())
        .collect();
    let lag = result["sensors"]["accel"]["lag_s"]["value"]
        .as_f64()
        .unwrap();
    assert!(values.contains(&lag), "the lag is on the page as in JSON");
    // A report draws the same curves of scale factors and biases, with the intervals of the file.
    let nodes = calibration["temperature"]["node"].as_array().unwrap();
    let curve = |name: &str| {
        let mut all = result["curves"].as_array().unwrap().iter();
        all.find(|c| c["name"] == name).unwrap()
    };
    for (node, of) in [(&nodes[0], 0), (&nodes[nodes.len() - 1], usize::MAX)] {
        for (sensor, name, key) in [
            ("gyro", "scale", "sigma_scale_factor"),
            ("accel", "bias", "sigma_bias"),
        ] {
            let curve = curve(&format!("{sensor}_{name}_y"));
            let at = of.min(curve["temp_c"].as_array().unwrap().len() - 1);
            let [low, high] = ["lower", "upper"].map(|end| curve[end][at].as_f64().unwrap());
            let sigma = node[sensor][key][1].as_float().unwrap();
            let ratio = 0.5 * (high - low) / (1.96 * sigma);
            assert!((ratio - 1.0).abs() < 0.02, "{sensor} {name}: {ratio}");
        }
    }
    let report = |calibration: &str| {
        done(
            folder,
            &format!("report --calibration {calibration} -o unit.html"),
        );
        std::fs::read_to_string(folder.join("unit.html")).unwrap()
    };
    let page = report("cal.toml");
    assert_eq!(page.matches(" band\"").count(), 12);
    assert!(page.contains("with its 95 % interval: those of the calibration's"));
    let text = std::fs::read_to_string(folder.join("cal.toml")).unwrap();
    let without: Vec<&str> = text
        .lines()
        .filter(|l| !(l.starts_with("sigma_scale_factor") || l.starts_with("sigma_bias")))
        .collect();
    std::fs::write(folder.join("without.toml"), without.join("\n")).unwrap();
    let page = report("without.toml");
    assert_eq!(page.matches(" band\"").count(), 0);
    assert!(page.contains("has no intervals at its nodes"));

    // Summaries fit a terminal, except for sentences.
    let fit = "thermal fit niu --verify again --replace -o again.toml";
    for (short, verbose) in [
        (fit, "thermal fit niu --verify again --verbose"),
        (
            "compare cal.toml again.toml",
            "compare cal.toml again.toml --verbose",
        ),
    ] {
        let [short, all] = [short, verbose].map(|arguments| done(folder, arguments));
        assert!(short.lines().count() <= 25, "{short}");
        assert!(all.lines().count() > short.lines().count(), "{all}");
        let sentences = ["verdict:", "judgement:", "warning:", "next:"];
        for line in short
            .lines()
            .filter(|l| !sentences.iter().any(|s| l.starts_with(s)))
        {
            assert!(line.chars().count() <= 100, "{line}");
        }
    }
    let short = done(folder, fit);
    for says in [
        "judgement: good: the error of unseen data is",
        "gyro, ± of 95 %",
        "calibration: again.toml",
    ] {
        assert!(
            short.lines().any(|l| l.starts_with(says)),
            "{says}: {short}"
        );
    }

    let same = done(folder, "compare cal.toml cal.toml --json -");
    let same: Value = serde_json::from_str(&same).unwrap();
    let at_ends = same["parameters"].as_array().unwrap().iter();
    let at_ends = at_ends.filter(|p| p["name"].as_str().unwrap().ends_with("°C"));
    assert_eq!(at_ends.count(), 24);

    // The error after a fit at one temperature is shown beside it.
    done(folder, "fit niu -o one.toml");
    let left = |calibration: &str| -> f64 {
        let text = done(
            folder,
            &format!("verify again --calibration {calibration} --json -"),
        );
        let result: Value = serde_json::from_str(&text).unwrap();
        result["sensors"]["gyro"]["rms"].as_f64().unwrap()
    };
    let [curves, one] = [left("cal.toml"), left("one.toml")];
    assert!(
        curves < 0.5 * one,
        "{curves} rad/s with curves, {one} without"
    );
}

/// The session of an autopilot's user: poses at room temperature, and an hour or two at rest while the unit warms up and cools.
#[test]
fn a_rest_ramp_upon_poses_at_room_temperature_halves_the_error_of_a_sweep_and_is_exported() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let rig = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../rig");
    let sweep = std::fs::read_to_string(rig.join("plans/niu-ramp.toml")).unwrap();
    let at_room = sweep.lines().map(|line| match line.split(" = ").next() {
        Some("chamber_c") => "chamber_c = [[0.0, 25.0]]",
        Some("rounds") => "rounds = 10",
        Some("lead_in_s") => "lead_in_s = 60.0",
        _ => line,
    });
    std::fs::write(
        folder.join("poses.toml"),
        at_room.collect::<Vec<_>>().join("\n"),
    )
    .unwrap();
    let at_rest = "format = \"mimu-plan/1\"\ndevice = \"niu\"\nsample_rate_hz = 20.0\ncarrier = \"table\"\n\
                   gravity_mps2 = 9.793\nchamber_c = [[0.0, -20.0], [3000.0, 70.0], [6000.0, -20.0]]\nlead_in_s = 1.0\n\n\
                   [[step]]\nup = [0.0, 0.0, 1.0]\ndwell_s = 6000.0\n";
    std::fs::write(folder.join("rest.toml"), at_rest).unwrap();
    record_plan(folder, "poses", 3, &folder.join("poses.toml"));
    record_plan(folder, "rest", 4, &folder.join("rest.toml"));
    let manifest = folder.join("rest/recording.toml");
    let known = std::fs::read_to_string(&manifest).unwrap();
    let unknown = known.replace("reference = \"table\"", "reference = \"gravity\"");
    assert_ne!(known, unknown);
    std::fs::write(&manifest, unknown).unwrap();
    record(folder, "sweep", 5);

    done(folder, "fit poses -o room.toml");
    let fitted = done(
        folder,
        "thermal fit rest --base room.toml -o cal.toml --json -",
    );
    let fitted: Value = serde_json::from_str(&fitted).unwrap();
    assert_eq!(fitted["verdict"], "fitted");
    let left = |calibration: &str| -> f64 {
        let text = done(
            folder,
            &format!("verify sweep --calibration {calibration} --json -"),
        );
        let result: Value = serde_json::from_str(&text).unwrap();
        result["sensors"]["gyro"]["rms"].as_f64().unwrap()
    };
    let [with, without] = [left("cal.toml"), left("room.toml")];
    assert!(with < 0.5 * without, "{without}, {with}");
    let exported = done(
        folder,
        "export px4 --calibration cal.toml -o thermal.params --gyro-id 1 --accel-id 2 --json -",
    );
    let exported: Value = serde_json::from_str(&exported).unwrap();
    assert_eq!(exported["to"], "px4");
    assert!(folder.join("thermal.params").exists());
    for cubics in exported["cubics"].as_array().unwrap() {
        let sensor = cubics["sensor"].as_str().unwrap();
        let remains = |source: &str| {
            let all = exported["remaining"].as_array().unwrap();
            let of_sensor = |r: &&Value| r["source"] == source && r["sensor"] == sensor;
            let found = all.iter().find(of_sensor);
            found.unwrap_or_else(|| panic!("{source}: {all:?}")).clone()
        };
        // No scale factor was measured at another temperature.
        for unknown in [
            "scale factors over temperature",
            "cross terms over temperature",
        ] {
            assert!(remains(unknown)["rms"].is_null(), "{}", remains(unknown));
        }
        assert!(remains("cross terms, constant")["rms"].as_f64().unwrap() > 0.0);
        let hysteresis = remains("hysteresis");
        let largest = fitted["sensors"][sensor]["hysteresis"]
            .as_array()
            .unwrap()
            .iter();
        let largest = largest.map(|h| h["largest"].as_f64().unwrap().abs());
        // Readings in volts: the error in SI is half of the difference times the program's scale factor, which is that of the calibration.
        let factors = cubics["conversion"]["si_per_raw"].as_array().unwrap();
        let known = largest
            .zip(factors)
            .map(|(raw, f)| 0.5 * raw * f.as_f64().unwrap().abs());
        let known = known.fold(0.0, f64::max);
        let ratio = hysteresis["max"].as_f64().unwrap() / known;
        assert!((ratio - 1.0).abs() < 0.05, "{sensor}: {ratio}");
    }

    let refused = mimu(folder, "thermal fit sweep --base room.toml -o never.toml");
    refused.refused(&["leave the base out (--base)"]);
    assert!(!folder.join("never.toml").exists());
}
