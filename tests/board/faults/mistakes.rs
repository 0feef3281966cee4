//! Mistakes of a person: wrongly wired or named axes, wrong units and time stamps, changed flags, answers given too early. The stored calibration
//! must contain the truth all the same, or one line must name the mistake.

use std::time::{Duration, Instant};

use mimu_rig::rig_file::RigTruth;

use crate::run::Ended;
use crate::session::{Bench, WizardSession};
use mimu_tests::stored_calibration::half_widths;

pub const BY_HAND: [&str; 4] = ["--fixture", "hands", "--dwell", "2"];
/// Longest wait for a step before a person does something else.
const PUZZLED: Duration = Duration::from_secs(12);

/// Our board in the hands of a person who follows the requests; `rewire` changes the wiring of its sensors.
fn our_board(
    bench: Bench<'_>,
    seed: u64,
    fixture: &str,
    rewire: impl Fn(&mut RigTruth),
) -> Result<Ended, String> {
    let mut truth = bench.unit(seed, fixture)?;
    rewire(&mut truth);
    let truth = RigTruth::resolve(&truth.file, seed)?;
    let arguments: &[&str] = match fixture {
        "hands" => &BY_HAND,
        _ => &crate::TABLE,
    };
    let mut session = WizardSession::with(fixture, &truth, seed, bench, arguments)?;
    session.run()?;
    let mut steps = 0;
    loop {
        // The command drives a table without a person.
        if fixture != "hands" {
            break;
        }
        let asked = Instant::now();
        if !session.wait_for(|s| s.told("step") > steps || asked.elapsed() > PUZZLED)? {
            break;
        }
        steps = session.told("step");
        if let Ok(pose) = session.asked_pose() {
            session.board.tell(&pose)?;
        }
    }
    session.end()
}

fn rewired(truth: &mut RigTruth, sensor: usize, order: [usize; 3], signs: [f64; 3]) {
    let unit = &mut truth.file.unit;
    let affine = [&mut unit.gyro_affine, &mut unit.accel_affine][sensor].as_mut();
    if let Some(affine) = affine {
        let (matrix, bias) = (affine.matrix, affine.bias);
        affine.matrix = std::array::from_fn(|i| matrix[order[i]].map(|m| signs[i] * m));
        affine.bias = order.map(|i| bias[i]);
    }
}

pub fn board_z_inverted(bench: Bench<'_>) -> Result<Ended, String> {
    our_board(bench, 21, "hands", |unit| {
        rewired(unit, 1, [0, 1, 2], [1.0, 1.0, -1.0])
    })
}

pub fn board_gyro_swapped(bench: Bench<'_>) -> Result<Ended, String> {
    our_board(bench, 22, "hands", |unit| {
        rewired(unit, 0, [1, 0, 2], [1.0; 3])
    })
}

pub fn table_z_inverted(bench: Bench<'_>) -> Result<Ended, String> {
    our_board(bench, 23, "table", |unit| {
        rewired(unit, 1, [0, 1, 2], [1.0, 1.0, -1.0])
    })
}

pub fn changed_flag(bench: Bench<'_>) -> Result<Ended, String> {
    let mut session = crate::on_table(24, bench)?;
    session.wait_for(|s| s.told("dwell") >= 3)?;
    session.kill()?;
    session.gravity = "9.81".into();
    session.run()?;
    session.end()
}

/// `yes` is typed at the start, and again without the supply turned off; then the supply is turned off.
pub fn early_yes(bench: Bench<'_>) -> Result<Ended, String> {
    let mut session = WizardSession::new("table", 25, bench, &crate::TABLE)?;
    let path = bench.folder.join("driver.toml");
    let driver = std::fs::read_to_string(&path).map_err(|e| e.to_string())?;
    let [before, after] = ["[power]", "# A chamber"].map(|at| driver.find(at).unwrap_or(0));
    let driver = [&driver[..before], &driver[after..]].concat();
    std::fs::write(&path, driver).map_err(|e| e.to_string())?;
    session.yes = false;
    session.run()?;
    session.type_line("yes")?;
    let mut said = Vec::new();
    if session.wait_for(|s| s.told("question") > 0 || s.told("stored") > 0)? {
        said.push(format!(
            "stored before the question: {}",
            session.told("stored")
        ));
        std::thread::sleep(Duration::from_secs(1));
        session.type_line("yes")?;
        session.wait_for(|s| s.told("question") > 1 || s.told("stored") > 0)?;
        said.push(format!(
            "stored by a yes without a cycle: {}",
            session.told("stored")
        ));
        session.board.tell("POWER OFF")?;
        std::thread::sleep(Duration::from_millis(300));
        session.board.tell("POWER ON")?;
        std::thread::sleep(Duration::from_millis(500));
        session.type_line("yes")?;
        session.wait_for(|s| s.told("stored") > 0)?;
        said.push(session.last_words("stored"));
    }
    // The effects are declined.
    while session.wait_for(|s| s.last_words("question").contains("effects"))? {
        session.type_line("no")?;
        std::thread::sleep(Duration::from_millis(300));
    }
    let mut ended = session.end()?;
    ended.notes.extend(said);
    Ok(ended)
}

/// The session of the documentation's example: a table at 250 deg/s with typical flaws, the board off its axes.
pub fn table_250(bench: Bench<'_>) -> Result<Ended, String> {
    let truth = bench.on_real_table(26)?;
    let arguments = [
        "--fixture",
        "table",
        "--driver",
        "driver.toml",
        "--rate",
        "250",
        "--latitude",
        "30.5",
    ];
    let mut session = WizardSession::with("table", &truth, 26, bench, &arguments)?;
    session.run()?;
    let mut first = String::new();
    if session.wait_for(|s| s.told("stored") > 0)? {
        first = session.first_stored()?;
    }
    let truth = *session.truth();
    let mut ended = session.end()?;
    ended.notes.push(format!("first stored: {first}"));
    for name in ["calibration.toml", "with-effects.toml"] {
        let file = bench.folder.join("session").join(name);
        if let Ok(both) = half_widths(&file, &truth) {
            let [gyro, accel] = both.map(|all| {
                let outside = all.iter().filter(|r| **r > 1.0).count();
                let worst = all.iter().copied().fold(0.0, f64::max);
                format!("{outside} of {} outside, worst {worst:.2}", all.len())
            });
            ended
                .notes
                .push(format!("{name}: gyro {gyro}; accel {accel}"));
        }
    }
    Ok(ended)
}
