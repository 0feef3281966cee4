//! `mimu wizard` with the firmware's release image on the emulated board, on a turntable and in hands that it commands. Killed, unplugged, garbled
//! and disturbed sessions end with the right calibration or with a clear message, and never store a wrong one.

use super::bench::{Bench, in_repository, unit};
use crate::command::mimu;
use mimu::calibration::Calibration;
use mimu::quantity::Sensor;
use mimu_rig::rig_file::RigTruth;

/// Twelve dwells of a second that determine both triads, with little motion between them.
fn short_plan(bench: &Bench) -> String {
    let mut plan =
        String::from("format = \"mimu-plan/1\"\nsample_rate_hz = 1000.0\ncarrier = \"table\"\n");
    for up in [
        "1.0, 0.0, 0.0",
        "0.0, 1.0, 0.0",
        "0.0, 0.0, 1.0",
        "-1.0, 0.0, 0.0",
        "0.0, -1.0, 0.0",
        "0.0, 0.0, -1.0",
    ] {
        for rate in [-60.0, 60.0] {
            plan += &format!("[[step]]\nup = [{up}]\nrate_dps = {rate:?}\ndwell_s = 1.0\n");
        }
    }
    std::fs::write(bench.path("plan.toml"), plan).unwrap();
    "plan.toml".into()
}

/// The largest error of an entry of C and o of gyro and accelerometer, in halves of its 95 % interval.
fn half_intervals(calibration: &Calibration, truth: &RigTruth) -> [f64; 2] {
    let unit = &truth.file.unit;
    let models = [
        unit.gyro_affine.as_ref().unwrap(),
        unit.accel_affine.as_ref().unwrap(),
    ];
    let ratio = [2.5 / unit.gyro_reference_v.unwrap()[0], 1.0];
    Sensor::BOTH.map(|sensor| {
        let k = sensor as usize;
        let forward = nalgebra::Matrix3::from_fn(|i, j| ratio[k] * models[k].matrix[i][j]);
        let c = forward.try_inverse().unwrap();
        let o = -c * nalgebra::Vector3::from(models[k].bias) * ratio[k];
        let table = calibration.table(sensor).unwrap();
        let [of_c, of_o] = [
            table.interval_C.unwrap().concat(),
            table.interval_o.unwrap().into(),
        ];
        let entries = (0..9).map(|i| (table.C[i / 3][i % 3] - c[(i / 3, i % 3)]) / of_c[i]);
        let offsets = (0..3).map(|i| (table.o[i] - o[i]) / of_o[i]);
        let all = entries.chain(offsets).map(f64::abs);
        all.fold(0.0, f64::max)
    })
}

/// Arguments that the sessions on this plan share.
fn on_table(plan: &str) -> [&str; 9] {
    [
        "--fixture",
        "table",
        "--plan",
        plan,
        "--as-planned",
        "--dwell",
        "1",
        "--rate",
        "60",
    ]
}

#[test]
fn a_session_that_was_killed_and_unplugged_goes_on_to_a_stored_calibration_that_holds_the_truth() {
    let mut bench = Bench::new("table", unit(7), 7);
    // The driver file states what the table's certificate says of its rates.
    let driver = std::fs::read_to_string(bench.path("driver.toml")).unwrap();
    let stated = "\n[reference_error]\nsource = \"certificate\"\nrate = 2e-2\n";
    std::fs::write(bench.path("driver.toml"), driver + stated).unwrap();
    let plan = short_plan(&bench);
    let arguments = on_table(&plan);
    let mut child = bench.wizard(&arguments).spawn().unwrap();
    assert!(bench.heard(&mut child, "dwell", 3));
    child.kill().unwrap();
    child.wait().unwrap();
    let journal = std::fs::read_to_string(bench.path("session/journal.jsonl")).unwrap();
    let before = journal.lines().filter(|l| l.contains("\"dwell\"")).count();
    assert!(before >= 3, "{journal}");

    std::fs::remove_file(bench.path("events.jsonl")).unwrap();
    let mut child = bench.wizard(&arguments).spawn().unwrap();
    assert!(bench.heard(&mut child, "dwell", 2));
    bench.tell("LINK OFF");
    let interrupted = bench.heard(&mut child, "interrupted", 1);
    bench.tell("LINK ON");
    let out = child.wait_with_output().unwrap();
    assert!(interrupted, "{out:?}");
    let told =
        String::from_utf8_lossy(&out.stdout).into_owned() + &String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success(), "{}\n{told}", bench.ask("TRUTH?"));
    assert!(
        told.contains(&format!("continues after {before} dwells")),
        "{told}"
    );
    let outcome = bench.outcome();
    let found = &outcome["units"][0];
    assert_eq!(found["dwells"], 12, "{told}");
    assert_eq!(found["stored"], "session/calibration.toml", "{told}");

    let calibration = Calibration::read(&bench.path("session/calibration.toml")).unwrap();
    // Dwells of one second give 0.11 deg/s and 0.5 mg. Which of them are repeated depends on the instant of the interruption, and so does the noise: the
    // intervals tell whether the stored calibration holds the truth.
    let worst = half_intervals(&calibration, &bench.truth);
    assert!(worst.into_iter().all(|w| w < 2.0), "{worst:?}");
    // The recording is an ordinary one.
    let manifest =
        std::fs::read_to_string(bench.path("session/calibration/recording.toml")).unwrap();
    assert!(!manifest.contains("unfinished"), "{manifest}");
    // With two per cent, half of the interval of a scale factor of the gyro is that, and noise.
    assert!(manifest.contains("rate = 0.02"), "{manifest}");
    let gyro = calibration.table(Sensor::Gyro).unwrap();
    let share = gyro.interval_C.unwrap()[0][0] / gyro.C[0][0].abs();
    assert!((0.0195..0.023).contains(&share), "{share}");
}

#[test]
fn a_driver_file_with_a_mistake_is_refused_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let driver = folder.path().join("driver.toml");
    let text = std::fs::read_to_string(in_repository("tests/board/demo/turntable.toml")).unwrap();
    std::fs::write(&driver, text.replace("interlock =", "interlok =")).unwrap();
    let arguments = "wizard --gravity 9.8 -o session --driver driver.toml";
    mimu(folder.path(), arguments).refused(&["line 5", "interlok"]);
}
