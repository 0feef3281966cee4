//! A body of two units and a magnetometer by hand, through `fit`, `verify`, `apply`, `export` and `diagnose`.

use std::path::Path;

use mimu_recording::Recording;
use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::rig_file::{RigFile, RigTruth};
use serde_json::Value;

use super::command::{done, json, says};

const PLAN: &str = "format = \"mimu-plan/1\"\ndevice = \"board\"\nsample_rate_hz = 100.0\ncarrier = \"hands\"\n\
    gravity_mps2 = 9.80665\nlead_in_s = 8.0\n[[step]]\nposes = 24\ndwell_s = 3.0\n";

/// The second chip is turned by a quarter about z, 30 mm away and 6 ms late; the magnetometer is 12 ms late.
const RIG: &str = "format = \"mimu-rig/1\"\nearth_rate = false\n[unit]\ngyro = \"MPU6050-gyro\"\naccel = \"MPU6050-accel\"\n\
    [thermal]\non_before_s = inf\n[field]\nsize_ut = 50.0\ndip_deg = 60.0\n\
    [[triad]]\nname = \"gyro2\"\nrotation_deg = [0.0, 0.0, 90.0]\ndelay_ms = 6.0\n\
    [[triad]]\nname = \"accel2\"\nrotation_deg = [0.0, 0.0, 90.0]\nlever_mm = [30.0, 0.0, 0.0]\ndelay_ms = 6.0\n\
    [[triad]]\nname = \"mag\"\ndelay_ms = 12.0\n";

fn record(folder: &Path, name: &str, seed: u64) {
    let file = RigFile::parse(&Source::new("rig", RIG.to_string())).unwrap();
    let plan = Plan::parse(Source::new("plan", PLAN.to_string())).unwrap();
    let truth = RigTruth::resolve(&file, 3).unwrap();
    let output = mimu_rig::record::Output::new(&folder.join(name), &plan).unwrap();
    mimu_rig::record::write(&plan, &truth, seed, &output).unwrap();
}

fn near(of: &Value, truth: f64, most: f64) {
    let value = of["value"].as_f64().unwrap();
    assert!((value - truth).abs() < most, "{of} and {truth} is true");
}

#[test]
fn a_body_is_calibrated_verified_compensated_exported_and_diagnosed() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    record(folder, "one", 1);
    record(folder, "two", 2);
    let text = done(folder, "fit one --field 50 -o cal.toml");
    says(
        &text,
        &["gyro2 rotation, deg", "accel2 arm, mm", "dip, deg"],
    );
    let fit = json(folder, "fit one --field 50");
    for triad in ["gyro", "accel", "gyro2", "accel2", "mag"] {
        assert!(fit["sensors"][triad]["held_out_rms"].is_number(), "{triad}");
    }
    let place = |name: &str| {
        let mut all = fit["body"].as_array().unwrap().iter();
        all.find(|of| of["triad"] == name).unwrap()
    };
    // The parts' low-passes are a part of the delay: 1.6 ms of each gyro and accelerometer, 6.4 ms of the magnetometer.
    near(&place("gyro2")["delay_ms"], 6.0, 0.2);
    near(&place("mag")["delay_ms"], 12.0 + 6.4 - 1.6, 1.5);
    near(&place("accel2")["lever_arm_mm"][0], 30.0, 1.0);
    near(&place("accel2")["rotation_deg"][2], 90.0, 3.0);

    let verified = json(folder, "verify two --calibration cal.toml");
    for triad in ["gyro2", "accel2", "mag"] {
        let of = &verified["sensors"][triad];
        assert_eq!(of["judgement"]["kind"], "good", "{of}");
    }
    done(folder, "apply two --calibration cal.toml -o compensated");
    let compensated = Recording::open(&folder.join("compensated")).unwrap();
    assert_eq!(compensated.triads().len(), 5);
    done(folder, "export px4 --calibration cal.toml -o px4.params");
    let px4 = std::fs::read_to_string(folder.join("px4.params")).unwrap();
    says(&px4, &["CAL_MAG0_XOFF", "CAL_GYRO1_XOFF"]);

    let split = &json(folder, "diagnose one")["body"];
    assert_eq!(split["own"].as_object().unwrap().len(), 2, "{split}");
}
