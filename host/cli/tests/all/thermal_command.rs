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
