//! Mistakes of a person: axes that are wired or named otherwise, units and stamps that are others, flags that change, answers that come too
//! early. What is stored holds the truth all the same, or one line says what is wrong.

use std::path::Path;
use std::time::{Duration, Instant};

use mimu_rig::rig_file::RigTruth;

use crate::session::{Ended, Run, Sitting, unit};
use crate::stored::half_widths;
use crate::text::{IDENTITY, TextBoard, Writing};

const Z_INVERTED: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]];
const NEGATED: [[f64; 3]; 3] = [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]];
const X_FOR_Y: [[f64; 3]; 3] = [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];

const BY_HAND: [&str; 4] = ["--fixture", "hands", "--dwell", "2"];
const TEXT: [&str; 4] = ["--text", "t_us,ax,ay,az,gx,gy,gz", "--device", "plane-7"];

/// Longest wait for a step that does not come, before a person does something else.
const PUZZLED: Duration = Duration::from_secs(12);

/// Our board, in the hands of a person who does what is asked; its sensors are wired as `rewire` has it.
fn our_board(
    folder: &Path,
    seed: u64,
    fixture: &str,
    rewire: impl Fn(&mut RigTruth),
) -> Result<Ended, String> {
    let mut truth = unit(seed, fixture)?;
    rewire(&mut truth);
    let truth = RigTruth::resolve(&truth.file, seed)?;
    let arguments: &[&str] = match fixture {
        "hands" => &BY_HAND,
        _ => &crate::TABLE,
    };
    let mut sitting = Sitting::with(fixture, &truth, seed, folder, arguments)?;
    sitting.run()?;
    let mut steps = 0;
    // A table is driven by the command itself.
    while fixture == "hands" {
        let asked = Instant::now();
        if !sitting.wait_for(|s| s.told("step") > steps || asked.elapsed() > PUZZLED)? {
            break;
        }
        steps = sitting.told("step");
        if let Ok(pose) = sitting.asked_pose() {
            sitting.board.tell(&pose)?;
        }
    }
    sitting.end()
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

pub fn board_z_inverted(folder: &Path) -> Result<Ended, String> {
    our_board(folder, 21, "hands", |unit| {
        rewired(unit, 1, [0, 1, 2], [1.0, 1.0, -1.0])
    })
}

pub fn board_gyro_swapped(folder: &Path) -> Result<Ended, String> {
    our_board(folder, 22, "hands", |unit| {
        rewired(unit, 0, [1, 0, 2], [1.0; 3])
    })
}

pub fn table_z_inverted(folder: &Path) -> Result<Ended, String> {
    our_board(folder, 23, "table", |unit| {
        rewired(unit, 1, [0, 1, 2], [1.0, 1.0, -1.0])
    })
}

/// A board of text in the hands of a person.
pub fn text(
    folder: &Path,
    seed: u64,
    board: TextBoard,
    more: &[&str],
) -> Result<(Writing, Run), String> {
    let truth = board.truth;
    let writing = Writing::begin(board, seed, folder.join("events.jsonl"))?;
    let arguments = [&BY_HAND[..], more].concat();
    let mut run = Run::new(folder, &writing.port, truth, &arguments);
    run.run()?;
    Ok((writing, run))
}

fn text_to_end(folder: &Path, seed: u64, board: TextBoard, more: &[&str]) -> Result<Ended, String> {
    let (_writing, run) = text(folder, seed, board, more)?;
    run.end()
}

fn wired(folder: &Path, seed: u64, wired: [[[f64; 3]; 3]; 2]) -> Result<Ended, String> {
    text_to_end(
        folder,
        seed,
        TextBoard {
            wired,
            ..TextBoard::new(seed)
        },
        &TEXT,
    )
}

pub fn text_nothing(folder: &Path) -> Result<Ended, String> {
    wired(folder, 31, [IDENTITY; 2])
}

pub fn text_z_inverted(folder: &Path) -> Result<Ended, String> {
    wired(folder, 32, [IDENTITY, Z_INVERTED])
}

pub fn text_negated(folder: &Path) -> Result<Ended, String> {
    wired(folder, 33, [IDENTITY, NEGATED])
}

pub fn text_x_for_y(folder: &Path) -> Result<Ended, String> {
    wired(folder, 34, [IDENTITY, X_FOR_Y])
}

pub fn text_gyro_swapped(folder: &Path) -> Result<Ended, String> {
    wired(folder, 35, [X_FOR_Y, IDENTITY])
}

/// Readings in g and rad/s that are said to be in SI.
pub fn text_in_g(folder: &Path) -> Result<Ended, String> {
    let mut board = TextBoard::new(36);
    for (triad, by) in board
        .truth
        .triads
        .iter_mut()
        .zip([1.0 / 3754.9, 1.0 / 1670.1 / 9.80665])
    {
        triad.matrix = triad.matrix.map(|row| row.map(|m| by * m));
        triad.bias = triad.bias.map(|b| by * b);
    }
    board.noise = [5.0 / 3754.9, 45.0 / 1670.1 / 9.80665];
    board.steps = [0.0; 2];
    text_to_end(
        folder,
        36,
        board,
        &[&TEXT[..], &["--raw-unit", "SI"]].concat(),
    )
}

pub fn text_us_for_ms(folder: &Path) -> Result<Ended, String> {
    let board = TextBoard {
        speed: 1.0,
        ..TextBoard::new(37)
    };
    text_to_end(folder, 37, board, &["--text", "t_ms,ax,ay,az,gx,gy,gz"])
}

pub fn text_ms_for_us(folder: &Path) -> Result<Ended, String> {
    let board = TextBoard {
        speed: 1.0,
        stamps_s: 1e-3,
        ..TextBoard::new(38)
    };
    text_to_end(folder, 38, board, &TEXT)
}

pub fn text_dropped(folder: &Path) -> Result<Ended, String> {
    text_to_end(
        folder,
        39,
        TextBoard {
            lost: 0.02,
            ..TextBoard::new(39)
        },
        &TEXT,
    )
}

pub fn text_garbled(folder: &Path) -> Result<Ended, String> {
    text_to_end(
        folder,
        40,
        TextBoard {
            garbled_s: Some(30.0),
            ..TextBoard::new(40)
        },
        &TEXT,
    )
}

/// Steps larger than the noise: at rest every channel is constant.
pub fn text_coarse(folder: &Path) -> Result<Ended, String> {
    let board = TextBoard {
        noise: [0.5, 1.5],
        steps: [16.0, 16.0],
        ..TextBoard::new(41)
    };
    text_to_end(folder, 41, board, &TEXT)
}

pub fn text_columns_swapped(folder: &Path) -> Result<Ended, String> {
    let (_writing, mut run) = text(
        folder,
        42,
        TextBoard::new(42),
        &["--text", "t_us,gx,gy,gz,ax,ay,az"],
    )?;
    let began = Instant::now();
    let hinted = |s: &Run| s.last_waiting().contains("exchanged");
    run.wait_for(|s| hinted(s) || began.elapsed() > Duration::from_secs(60))?;
    let words = format!("waits: {}", run.last_waiting());
    let took = run.interrupt()?;
    let mut ended = run.end()?;
    ended
        .notes
        .push(format!("{words}; ended {took:.1} s after SIGTERM"));
    Ok(ended)
}

/// An accelerometer whose readings err as a cube, by 2 % at gravity.
pub fn text_cubic(folder: &Path) -> Result<Ended, String> {
    text_to_end(
        folder,
        43,
        TextBoard {
            cubic: 0.03,
            ..TextBoard::new(43)
        },
        &TEXT,
    )
}

/// A finished session, run again.
pub fn text_again(folder: &Path) -> Result<Ended, String> {
    let (writing, mut run) = text(folder, 44, TextBoard::new(44), &TEXT)?;
    run.wait_for(|_| false)?;
    let read = || std::fs::read(folder.join("session/calibration.toml")).map_err(|e| e.to_string());
    let before = read()?;
    drop(writing);
    run.run()?;
    let mut ended = run.end()?;
    let same = if read()? == before {
        "the same file"
    } else {
        "ANOTHER file"
    };
    ended.notes.push(format!("run again: {same}"));
    Ok(ended)
}

pub fn changed_flag(folder: &Path) -> Result<Ended, String> {
    let mut sitting = crate::on_table(24, folder)?;
    sitting.wait_for(|s| s.told("dwell") >= 3)?;
    sitting.kill()?;
    sitting.gravity = "9.81".into();
    sitting.run()?;
    sitting.end()
}

/// `yes` is typed at the start, and again without the supply turned off; then the supply is.
pub fn early_yes(folder: &Path) -> Result<Ended, String> {
    let mut sitting = Sitting::new("table", 25, folder, &crate::TABLE)?;
    let path = folder.join("driver.toml");
    let driver = std::fs::read_to_string(&path).map_err(|e| e.to_string())?;
    let [before, after] = ["[power]", "# A chamber"].map(|at| driver.find(at).unwrap_or(0));
    let driver = [&driver[..before], &driver[after..]].concat();
    std::fs::write(&path, driver).map_err(|e| e.to_string())?;
    sitting.yes = false;
    sitting.run()?;
    sitting.type_line("yes")?;
    let mut said = Vec::new();
    if sitting.wait_for(|s| s.told("question") > 0 || s.told("stored") > 0)? {
        said.push(format!(
            "stored before the question: {}",
            sitting.told("stored")
        ));
        std::thread::sleep(Duration::from_secs(1));
        sitting.type_line("yes")?;
        sitting.wait_for(|s| s.told("question") > 1 || s.told("stored") > 0)?;
        said.push(format!(
            "stored by a yes without a cycle: {}",
            sitting.told("stored")
        ));
        sitting.board.tell("POWER OFF")?;
        std::thread::sleep(Duration::from_millis(300));
        sitting.board.tell("POWER ON")?;
        std::thread::sleep(Duration::from_millis(500));
        sitting.type_line("yes")?;
        sitting.wait_for(|s| s.told("stored") > 0)?;
        said.push(sitting.last_words("stored"));
    }
    // Effects are not stored.
    while sitting.wait_for(|s| s.last_words("question").contains("effects"))? {
        sitting.type_line("no")?;
        std::thread::sleep(Duration::from_millis(300));
    }
    let mut ended = sitting.end()?;
    ended.notes.extend(said);
    Ok(ended)
}

/// Seven units, and how many of their parameters are within their intervals.
pub fn text_units(folder: &Path) -> Result<Ended, String> {
    let (mut all, mut inside, mut worst) = (0, 0, 0.0_f64);
    let mut last = None;
    let mut notes = Vec::new();
    for seed in 51..58 {
        let folder = folder.join(seed.to_string());
        std::fs::create_dir(&folder).map_err(|e| e.to_string())?;
        let board = TextBoard::new(seed);
        let truth = board.truth;
        let ended = text_to_end(&folder, seed, board, &TEXT)?;
        let Some([gyro, accel]) = ended.stored else {
            return Ok(ended);
        };
        notes.push(format!(
            "unit {seed}: {gyro:.3} deg/s, {accel:.2} mg, {} dwells, {}",
            ended.dwells, ended.verdict
        ));
        for ratio in half_widths(&folder.join("session/calibration.toml"), &truth)?.concat() {
            all += 1;
            inside += usize::from(ratio <= 1.0);
            worst = worst.max(ratio);
        }
        last = Some(ended);
    }
    let mut ended = last.ok_or("no unit")?;
    ended.notes.extend(notes);
    ended.notes.push(format!(
        "{inside} of {all} parameters within their intervals, worst {worst:.2} half-widths"
    ));
    Ok(ended)
}

/// The session of the documentation's example: a table at 250 deg/s with the flaws that tables have, the board beside its axes.
pub fn table_250(folder: &Path) -> Result<Ended, String> {
    let truth = crate::session::on_real_table(26)?;
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
    let mut sitting = Sitting::with("table", &truth, 26, folder, &arguments)?;
    sitting.run()?;
    let mut first = String::new();
    if sitting.wait_for(|s| s.told("stored") > 0)? {
        first = sitting.first_stored()?;
    }
    let truth = *sitting.truth();
    let mut ended = sitting.end()?;
    ended.notes.push(format!("first stored: {first}"));
    for name in ["calibration.toml", "with-effects.toml"] {
        let file = folder.join("session").join(name);
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
