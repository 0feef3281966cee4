//! Mistakes with a board that writes lines of text: axes, units, time stamps and columns that differ from the declared ones, and lost lines.

use std::path::Path;
use std::time::{Duration, Instant};

use crate::run::{Ended, Run};
use crate::text::Writing;
use mimu_tests::stored_calibration::half_widths;
use mimu_tests::text_board::{IDENTITY, TextBoard};

const Z_INVERTED: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]];
const NEGATED: [[f64; 3]; 3] = [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]];
const X_FOR_Y: [[f64; 3]; 3] = [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];

const BY_HAND: [&str; 4] = ["--fixture", "hands", "--dwell", "2"];
const TEXT: [&str; 4] = ["--text", "t_us,ax,ay,az,gx,gy,gz", "--device", "plane-7"];

/// A board with text lines in the hands of a person.
pub fn text(
    folder: &Path,
    seed: u64,
    board: TextBoard,
    more: &[&str],
) -> Result<(Writing, Run), String> {
    let truth = board.truth;
    // Its time passes faster than the computer's, without being wrong.
    let replayed: &[&str] = if board.speed == 1.0 {
        &[]
    } else {
        &["--trust-clock"]
    };
    let writing = Writing::begin(board, seed, folder.join("events.jsonl"))?;
    let arguments = [&BY_HAND[..], more, replayed].concat();
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

/// Readings in g and rad/s that are declared as SI.
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

/// Readings in m/s² and deg/s that are declared as SI.
pub fn text_in_dps(folder: &Path) -> Result<Ended, String> {
    let mut board = TextBoard::new(43);
    for (triad, (was, is)) in board
        .truth
        .triads
        .iter_mut()
        .zip([(3754.9, 57.295_779_513), (1670.1, 1.0)])
    {
        let by = is / was;
        triad.matrix = triad.matrix.map(|row| row.map(|m| m * by));
        triad.bias = triad.bias.map(|b| b * by);
    }
    board.noise = [5.0 / 3754.9 * 57.295_779_513, 45.0 / 1670.1];
    board.steps = [0.0; 2];
    text_to_end(
        folder,
        43,
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

/// A clock three times too fast, as of a period that was written wrongly.
pub fn text_clock(folder: &Path) -> Result<Ended, String> {
    let board = TextBoard {
        speed: 1.0,
        stamps_s: 1e-6 / 3.0,
        ..TextBoard::new(42)
    };
    text_to_end(folder, 42, board, &TEXT)
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

/// Quantisation steps larger than the noise: at rest every channel is constant.
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

/// An accelerometer with a cubic error, 2 % at gravity.
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

/// A finished session, started again.
pub fn text_again(folder: &Path) -> Result<Ended, String> {
    let (_writing, mut run) = text(folder, 44, TextBoard::new(44), &TEXT)?;
    run.wait_for(|_| false)?;
    let read = || std::fs::read(folder.join("session/calibration.toml")).map_err(|e| e.to_string());
    let before = read()?;
    std::thread::sleep(Duration::from_secs(2));
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

/// Seven units, and how many of their parameters are inside their intervals.
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
