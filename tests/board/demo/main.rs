//! `make demo`: a unit with an undeclared effect on the emulated board, and the wizard that calibrates it.
//!
//! `demo SEED FOLDER [nucleo|matek]`: another seed is another unit and another effect. The image, the serial line, the turntable's protocol and the command are the
//! real ones; only the hardware is simulated. The folder is kept for inspection.

use std::path::Path;
use std::process::{Command, ExitCode, Stdio};
use std::time::Instant;

use mimu_board::commanded::{Commanded, Kind};
use mimu_board::inertial::with_digital_parts;
use mimu_rig::rig_file::{RigFile, RigTruth};
use mimu_tests::blind::{is_listed, unit, with_effects};
use serde_json::Value;

/// Possible effects of the unit: those that a table at one temperature can show, and three that the diagnosis does not know.
const EFFECTS: [&str; 9] = [
    "gyro_g_sensitivity",
    "accel_scale_quadratic",
    "accel_cross_axis_product",
    "accel_size_effect",
    "gyro_scale_asymmetry",
    "x_gyro_g_squared",
    "accel_scale_cubic",
    "gyro_readout_code",
    "x_gyro_dead_zone",
];

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let seed = arguments.first().map_or(Ok(1), |a| a.parse());
    let board = arguments.get(2).map_or("nucleo", String::as_str);
    let kind = match board {
        "nucleo" => Some(Kind::Nucleo),
        "matek" => Some(Kind::Matek { crystal: CRYSTAL }),
        _ => None,
    };
    let done = match (seed, arguments.get(1), kind) {
        (Ok(seed), Some(folder), Some(kind)) => demo(seed, Path::new(folder), kind),
        _ => Err("usage: demo SEED FOLDER [nucleo|matek]".into()),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => {
            eprintln!("demo: {problem}");
            ExitCode::FAILURE
        }
    }
}

/// Crystal of the Matek relative to its nominal frequency: to it, the sensor's clock is 1 % fast.
const CRYSTAL: f64 = 0.99;

fn demo(seed: u64, folder: &Path, kind: Kind) -> Result<(), String> {
    let began = Instant::now();
    let effect = EFFECTS[(seed as usize + EFFECTS.len() - 1) % EFFECTS.len()];
    let mut file = match kind {
        Kind::Matek { .. } => with_effects(with_digital_parts(RigFile::default()), &[effect], seed),
        Kind::Nucleo => unit(&[effect], seed),
    };
    // It has been on for long: no warm-up.
    file.thermal.on_before_s = Some(f64::INFINITY);
    // A quick table, of the kind sold for sensors of this size: the time that it saves between dwells makes them longer.
    file.table.slew_dps = [240.0; 3];
    file.table.max_acceleration_dps2 = [1000.0; 3];
    file.table.settle_s = 0.3;
    let truth = RigTruth::resolve(&file, seed)?;
    println!(
        "A unit with unknown errors (seed {seed}) is on a turntable; the firmware's image runs on an emulated board."
    );
    let mut unit_id = [0; 12];
    unit_id[4..].copy_from_slice(&seed.to_be_bytes());
    let image = mimu_board_tests::image_of(kind);
    let board = Commanded::start(kind, &image, "table", &truth, seed, unit_id, folder)?;
    let driver = folder.join("turntable.toml");
    let text = include_str!("turntable.toml").replace("HOST:PORT", &board.address().to_string());
    std::fs::write(&driver, text).map_err(|e| format!("the driver file: {e}"))?;
    let outcome = wizard(&board.path("port"), &driver, folder);
    let ran_s = board.stop()?;
    let outcome = outcome?;
    let unit = &outcome["units"][0];
    let number = |v: &Value| v.as_f64().unwrap_or(f64::NAN);
    println!(
        "The wizard made {} dwells, and once more in poses that it had not used; {:.0} s of the board's time.",
        unit["dwells"], ran_s
    );
    for sensor in unit["verified"]["sensors"].as_array().into_iter().flatten() {
        println!(
            "  {:5} errs by {} as the data sheet has it, and by {} calibrated; noise alone would be {}.",
            sensor["sensor"].as_str().unwrap_or_default(),
            shown(sensor, "before"),
            shown(sensor, "affine"),
            shown(sensor, "floor")
        );
    }
    println!(
        "The calibration was stored, read back, and was still there after the supply had been off."
    );
    let found: Vec<&str> = unit["effects"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(Value::as_str)
        .collect();
    let verdict = unit["verdict"].as_str().unwrap_or("none");
    match found.is_empty() {
        true => {
            println!("Diagnosis: {verdict}; nothing that it knows was found, so nothing was added.")
        }
        false => println!(
            "Diagnosis: {verdict}; found {}, which was added and stored.",
            found.join(", ")
        ),
    }
    for sensor in unit["confirmed"]["sensors"]
        .as_array()
        .into_iter()
        .flatten()
    {
        println!(
            "  {:5} in a new run: before {}, after {}; noise alone {} ({:.2} times).",
            sensor["sensor"].as_str().unwrap_or_default(),
            shown(sensor, "affine"),
            shown(sensor, "after"),
            shown(sensor, "floor"),
            number(&sensor["after"]) / number(&sensor["floor"])
        );
    }
    for note in unit["notes"].as_array().into_iter().flatten() {
        println!("Note: {}", note.as_str().unwrap_or_default());
    }
    let listed = match is_listed(effect) {
        true => "which is on mimu's list of effects",
        false => "which is unlisted",
    };
    println!("The unit's undeclared error: {effect}, {listed}.");
    println!(
        "Page: {}  ({:.0} s)",
        unit["page"].as_str().unwrap_or_default(),
        began.elapsed().as_secs_f64()
    );
    Ok(())
}

/// A figure in the unit of data sheets.
fn shown(sensor: &Value, key: &str) -> String {
    let value = sensor[key].as_f64().unwrap_or(f64::NAN);
    match sensor["sensor"].as_str() {
        Some("gyro") => format!("{:.4} deg/s", value.to_degrees()),
        _ => format!("{:.3} mg", value * 1e3 / 9.80665),
    }
}

/// Runs the command beside this program.
fn wizard(port: &Path, driver: &Path, folder: &Path) -> Result<Value, String> {
    let here = std::env::current_exe().map_err(|e| format!("this program: {e}"))?;
    let mimu = here.with_file_name("mimu");
    let json = folder.join("outcome.json");
    let log = std::fs::File::create(folder.join("wizard.txt")).map_err(|e| e.to_string())?;
    let ran = Command::new(&mimu)
        .arg("wizard")
        .args([
            "--fixture",
            "table",
            "--rate",
            "120",
            "--dwell",
            "3",
            "--as-planned",
        ])
        .args(["--gravity", "9.793", "--warm-up", "0", "--yes"])
        .arg("--port")
        .arg(port)
        .arg("--driver")
        .arg(driver)
        .arg("--json")
        .arg(&json)
        .arg("-o")
        .arg(folder.join("session"))
        .stdin(Stdio::null())
        .stdout(log)
        .output()
        .map_err(|e| format!("{}: {e}", mimu.display()))?;
    if !ran.status.success() && !json.exists() {
        return Err(String::from_utf8_lossy(&ran.stderr).trim().to_owned());
    }
    let text = std::fs::read_to_string(&json).map_err(|e| format!("{}: {e}", json.display()))?;
    serde_json::from_str(&text).map_err(|e| format!("{}: {e}", json.display()))
}
