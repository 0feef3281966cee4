//! A body of two units and a magnetometer by hand, through `fit`, `verify`, `apply`, `export` and `diagnose`.

use std::path::Path;

use mimu::fit::{Options, fit};
use mimu::prepared::Prepared;
use mimu::signal::stillness::STILL_FACTOR;
use mimu_body::accel_delay_ms;
use mimu_recording::statistics::root_mean_square;
use mimu_recording::{Column, Recording, TriadName};
use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::rig_file::{RigFile, RigTruth};
use serde_json::Value;

use super::command::{all_refused, done, json, mimu, says};

const PLAN: &str = "format = \"mimu-plan/1\"\nsamples = \"csv\"\ndevice = \"board\"\nsample_rate_hz = 100.0\ncarrier = \"hands\"\n\
    gravity_mps2 = 9.80665\nlead_in_s = 8.0\n[[step]]\nposes = 24\ndwell_s = 3.0\n";

/// The second chip is turned by a quarter about z, 30 mm away and 6 ms late; the magnetometer is 12 ms late.
const RIG: &str = "format = \"mimu-rig/1\"\nearth_rate = false\n[unit]\ngyro = \"MPU6050-gyro\"\naccel = \"MPU6050-accel\"\n\
    [thermal]\non_before_s = inf\n[field]\nsize_ut = 50.0\ndip_deg = 60.0\n\
    [[triad]]\nname = \"gyro2\"\nrotation_deg = [0.0, 0.0, 90.0]\ndelay_ms = 6.0\n\
    [[triad]]\nname = \"accel2\"\nrotation_deg = [0.0, 0.0, 90.0]\nlever_mm = [30.0, 0.0, 0.0]\ndelay_ms = 6.0\n\
    [[triad]]\nname = \"mag\"\ndelay_ms = 12.0\n";

fn record(folder: &Path, name: &str, rig: &str, seed: u64) {
    record_by(PLAN, folder, name, rig, seed);
}

fn record_by(plan: &str, folder: &Path, name: &str, rig: &str, seed: u64) {
    let file = RigFile::parse(&Source::new("rig", rig.to_string())).unwrap();
    let plan = Plan::parse(Source::new("plan", plan.to_string())).unwrap();
    let truth = RigTruth::resolve(&file, 3).unwrap();
    let output = mimu_rig::record::Output::new(&folder.join(name), &plan).unwrap();
    mimu_rig::record::write(&plan, &truth, seed, &output).unwrap();
}

/// Root mean square of the differences of two triads.
fn differ(of: &Recording, names: [&str; 2]) -> f64 {
    let columns = names.map(|name| {
        let name = TriadName::parse(name).unwrap();
        let columns = [0, 1, 2].map(|axis| Column::of(name, axis));
        of.read_columns(&columns, |_| ()).unwrap().concat()
    });
    let apart = columns[0].iter().zip(&columns[1]).map(|(a, b)| a - b);
    root_mean_square(apart.filter(|x| x.is_finite()))
}

fn near(of: &Value, truth: f64, most: f64) {
    let value = of["value"].as_f64().unwrap();
    assert!((value - truth).abs() < most, "{of} and {truth} is true");
}

#[test]
fn a_body_is_calibrated_verified_compensated_exported_and_diagnosed() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    record(folder, "one", RIG, 1);
    record(folder, "two", RIG, 2);
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
    // 6 ms later, in a turn by hand, they would differ by 1.3 deg/s.
    let apart = differ(&compensated, ["gyro", "gyro2"]).to_degrees();
    assert!(apart < 0.15, "{apart}");

    let mean = json(folder, "apply two --calibration cal.toml --mean -o mean");
    for sensor in ["gyro", "accel"] {
        let noise = |k: usize| mean["mean"]["noise"][sensor][k].as_f64().unwrap();
        let share = noise(1) / noise(0);
        // Of two equal ones 0.71, and 0.64 where the second lies in the middle between its samples: it is then 0.8 as noisy.
        assert!((0.6..0.73).contains(&share), "{sensor}: {share}");
    }
    let mean = Recording::open(&folder.join("mean")).unwrap();
    let names: Vec<String> = mean.triads().iter().map(ToString::to_string).collect();
    assert_eq!(names, ["gyro", "accel", "mag"]);
    done(folder, "export px4 --calibration cal.toml -o px4.params");
    let px4 = std::fs::read_to_string(folder.join("px4.params")).unwrap();
    says(&px4, &["CAL_MAG0_XOFF", "CAL_GYRO1_XOFF"]);

    let split = &json(folder, "diagnose one")["body"];
    assert_eq!(split["own"].as_object().unwrap().len(), 2, "{split}");

    let both = json(folder, "fit one two --field 50 -o both.toml");
    let all = both["body"].as_array().unwrap();
    assert_eq!(all.len(), 3, "{all:?}");
    let arm = &all.iter().find(|of| of["triad"] == "accel2").unwrap()["lever_arm_mm"][0];
    near(arm, 30.0, 1.0);
    says(
        &std::fs::read_to_string(folder.join("both.toml")).unwrap(),
        &["[[body]]", "triad = \"mag\""],
    );
    done(folder, "report one -o page.html");
    let page = std::fs::read_to_string(folder.join("page.html")).unwrap();
    says(&page, &["id=\"body\"", "gyro2"]);
}

#[test]
fn the_delay_of_an_accelerometer_against_its_gyro_is_found() {
    let folder = tempfile::tempdir().unwrap();
    // The second accelerometer is late by 18 ms, its gyro by 6; their low-passes differ by less than 0.1 ms.
    let (before, after) = RIG.split_once("name = \"accel2\"").unwrap();
    let late = after.replacen("delay_ms = 6.0", "delay_ms = 18.0", 1);
    let rig = format!("{before}name = \"accel2\"{late}");
    record(folder.path(), "late", &rig, 4);
    let both = Recording::open(&folder.path().join("late")).unwrap();
    let [none, late] = [1, 2].map(|pair| {
        let recording = both.pair(pair).unwrap();
        let prepared = Prepared::read(&recording, STILL_FACTOR, |_| ()).unwrap();
        let fit = fit(prepared, Options::default()).unwrap();
        accel_delay_ms(&recording, &fit).unwrap()
    });
    assert!(none.is_none(), "{none:?}");
    let late = late.unwrap();
    // One case of twenty may be out of the interval.
    let off = (late.value - 12.0).abs();
    assert!(off < 2.0 * late.interval + 0.1, "{late:?}");
    assert!(late.interval < 1.0, "{late:?}");
}

/// A log without rests is taken up again for its compass: it is imported once, also if its recording is kept.
#[test]
fn a_log_without_rests_is_read_once() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut log =
        String::from("t_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z,mag_x,mag_y,mag_z\n");
    for k in 0..4000 {
        let t = f64::from(k) / 100.0;
        let [a, b, c] = [1.0, 1.7, 2.3].map(|rate| (rate * t + 0.3).sin());
        let row = [
            a,
            b,
            c,
            9.0 * c,
            9.0 * a,
            9.0 * b,
            40.0 * b,
            40.0 * c,
            40.0 * a,
        ];
        let cells: Vec<String> = row.iter().map(|v| format!("{v:.5}")).collect();
        log += &format!("{t:.2},{}\n", cells.join(","));
    }
    std::fs::write(at.join("turned.csv"), log).unwrap();
    for save in ["", " --save kept"] {
        let ran = mimu(
            at,
            &format!("fit turned.csv --gravity 9.81 --units rad/s,m/s2{save}"),
        );
        assert_eq!(ran.status, Some(1), "{}", ran.stderr);
        let read = ran.stderr.matches("4000 rows at").count();
        assert_eq!(read, 1, "{}", ran.stderr);
        assert!(!ran.stderr.contains("exists"), "{}", ran.stderr);
    }
}

/// A magnetometer with two axes exchanged reads the field reversed, which only the hemisphere shows.
#[test]
fn a_magnetometer_with_mirrored_axes_is_suspect() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mag = RIG.split("[[triad]]\nname = \"gyro2\"").next().unwrap();
    let rig = format!("{mag}[[triad]]\nname = \"mag\"\n");
    record(at, "unit", &rig, 5);
    let samples = at.join("unit/samples.csv");
    let text = std::fs::read_to_string(&samples).unwrap();
    let exchanged = text.replacen("mag_x,mag_y", "mag_y,mag_x", 1);
    assert_ne!(exchanged, text);
    std::fs::write(&samples, exchanged).unwrap();
    let said = done(at, "fit unit --field 50");
    says(
        &said,
        &["mag: the field points up, as it does in the south"],
    );
    for (latitude, kind) in [(48.0, "suspect"), (-48.0, "good")] {
        let manifest = at.join("unit/recording.toml");
        let text = std::fs::read_to_string(&manifest).unwrap();
        let others = text
            .lines()
            .filter(|line| !line.starts_with("latitude_deg"));
        let others: String = others.map(|line| format!("{line}\n")).collect();
        std::fs::write(&manifest, format!("{others}latitude_deg = {latitude:.1}\n")).unwrap();
        let found = json(at, "fit unit --field 50");
        let judgement = &found["sensors"]["mag"]["judgement"];
        assert_eq!(judgement["kind"], kind, "{judgement}");
    }
}

#[test]
fn each_recording_needs_its_own_trajectory() {
    let folder = tempfile::tempdir().unwrap();
    let three = "a.csv b.csv c.csv --trajectory p.csv --trajectory q.csv --trajectory r.csv";
    let times = format!("{three} --trajectory-zero 1 --trajectory-zero 2");
    let cases = [
        (
            "a.csv b.csv --trajectory p.csv",
            1,
            "1 file for 2 recordings",
        ),
        (
            "a.csv --trajectory p.csv --trajectory q.csv",
            1,
            "2 files for 1 recording",
        ),
        (&times, 1, "2 times for 3 files"),
    ];
    all_refused(folder.path(), "fit", &cases);
}

/// By how much the size of the field of a compensated magnetometer varies, µT.
fn varies(folder: &Path, name: &str) -> f64 {
    let of = Recording::open(&folder.join(name)).unwrap();
    let columns = [0, 1, 2].map(|axis| Column::of(TriadName::MAG, axis));
    let all = of.read_columns(&columns, |_| ()).unwrap();
    let sizes = (0..all[0].len()).map(|k| all[0][k].hypot(all[1][k]).hypot(all[2][k]) - 50.0);
    root_mean_square(sizes.filter(|x| x.is_finite()))
}

#[test]
fn iron_that_moves_with_the_temperature_is_reported_stored_and_removed() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    // From 20 °C to 35 the field of the iron grows by 6 µT along x.
    let air = "chamber_c = [[0.0, 20.0], [90.0, 35.0]]\n[[step]]";
    let plan = PLAN.replacen("[[step]]", air, 1);
    let rig = RIG.replacen("inf\n", "inf\nboard_lag_s = 30.0\n", 1);
    let rig = rig + "iron_ut_per_c = [0.4, 0.0, -0.1]\n";
    record_by(&plan, folder, "one", &rig, 1);
    record_by(&plan, folder, "two", &rig, 2);
    let text = done(folder, "fit one --field 50 -o cal.toml");
    says(
        &text,
        &["mag: its hard iron moves with the temperature, x 0."],
    );
    says(&done(folder, "diagnose one"), &["mag: its hard iron moves"]);
    let found = &json(folder, "fit one --field 50")["body"];
    let mut all = found.as_array().unwrap().iter();
    let mag = all.find(|of| of["triad"] == "mag").unwrap();
    // The magnetometer's own frame is turned from its axes by a degree or two.
    near(&mag["iron"]["per_k"][0], 0.4, 0.03);
    near(&mag["iron"]["per_k"][2], -0.1, 0.03);
    let cold = &json(folder, "diagnose one")["iron"]["mag"]["per_k"][0];
    near(cold, 0.4 / 50.0, 0.03 / 50.0);

    let verified = json(folder, "verify two --calibration cal.toml");
    let mag = &verified["sensors"]["mag"];
    assert_eq!(mag["judgement"]["kind"], "good", "{mag}");
    done(folder, "apply two --calibration cal.toml -o without");
    let file = std::fs::read_to_string(folder.join("cal.toml")).unwrap();
    let (before, after) = file.split_once("[body.iron]").unwrap();
    let after = after.split_once("\n[").map_or("", |(_, after)| after);
    let stripped = match after {
        "" => before.to_owned(),
        after => format!("{before}[{after}"),
    };
    std::fs::write(folder.join("stays.toml"), stripped).unwrap();
    done(folder, "apply two --calibration stays.toml -o with");
    let [without, with] = ["without", "with"].map(|name| varies(folder, name));
    // What the sensor's noise of 0.4 µT leaves, and what six µT of iron add.
    assert!(without < 0.5 && with > 1.0, "{without} and {with} µT");
}
