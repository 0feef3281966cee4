//! The program of the page: the command, and what only a page needs.
//!
//! | arguments | what it prints, as JSON |
//! |---|---|
//! | `columns FILE ...` | the columns of dropped files, and their guessed roles |
//! | `board FILE SECONDS` | the columns of lines that a board has written |
//! | `session wizard ...` | a session with a board (see [`session`]) |
//! | `view REC [CALIBRATION]` | the readings with the dwells, the poses, and which pose would add most |
//! | any other | what `mimu` prints |

mod board;
mod poses;
mod session;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use mimu::calibration::Calibration;
use mimu::prepared::Prepared;
use mimu::signal::stillness::{DwellSearch, STILL_FACTOR, Steps};
use mimu_recording::error::{Error, Result};
use mimu_recording::look::{Guess, Units, guess_preview};
use mimu_recording::{Preset, Preview, Recording, preview};
use serde::Serialize;

/// Rows of a file that the page shows.
const SHOWN: usize = 4;
/// Rows of a file by which its units are judged: ten minutes at 100 Hz, and a minute at 1 kHz.
const JUDGED: usize = 60_000;

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().collect();
    let paths: Vec<PathBuf> = args.iter().skip(2).map(PathBuf::from).collect();
    let answer = match (args.get(1).map(String::as_str), paths.as_slice()) {
        (Some("columns"), [_, ..]) => of_columns(&paths).and_then(json),
        (Some("view"), [recording]) => view(recording, None).and_then(json),
        (Some("view"), [recording, calibration]) => {
            view(recording, Some(calibration)).and_then(json)
        }
        (Some("board"), [file, seconds]) => {
            let seconds = seconds.to_string_lossy().parse().unwrap_or(f64::NAN);
            board::of(file, seconds).and_then(json)
        }
        (Some("session"), _) => {
            return match session::begin(&args[2..]) {
                Ok(()) => ExitCode::SUCCESS,
                Err(line) => refused(line),
            };
        }
        _ => return mimu_cli::run(std::env::args_os()).into(),
    };
    match answer {
        Ok(text) => {
            println!("{text}");
            ExitCode::SUCCESS
        }
        Err(error) => refused(error),
    }
}

fn refused(line: impl std::fmt::Display) -> ExitCode {
    eprintln!("mimu: {line}");
    ExitCode::from(1)
}

fn json(answer: impl Serialize) -> Result<String> {
    serde_json::to_string(&answer)
        .map_err(|error| Error::new("page", error, "report this: the answer cannot be written"))
}

/// What the page shows of dropped files.
#[derive(Serialize)]
struct Dropped {
    /// The preset that all of them fit.
    preset: Option<Recognised>,
    files: Vec<DroppedFile>,
    /// Units of the readings.
    units: Units,
}

#[derive(Serialize)]
struct Recognised {
    name: &'static str,
    title: &'static str,
    /// Unit of the readings, if the maker uses only one.
    raw_unit: Option<String>,
    /// Factors as `mimu import --scale` takes them.
    scales: Vec<String>,
}

#[derive(Serialize)]
struct DroppedFile {
    file: String,
    #[serde(flatten)]
    preview: Preview,
    #[serde(flatten)]
    guess: Guess,
}

fn of_columns(paths: &[PathBuf]) -> Result<Dropped> {
    let chosen = match paths.iter().any(|path| mimu_recording::is_log(path)) {
        true => None,
        false => Preset::choose(None, paths, None)?,
    };
    let (mut files, mut numbers) = (Vec::new(), Vec::new());
    for (k, path) in paths.iter().enumerate() {
        let mut preview = preview(path, None, JUDGED)?;
        let file = path.file_name().unwrap_or_default().to_string_lossy();
        let (mut guess, rows) = guess_preview(&file, &preview, None);
        preview.rows.truncate(SHOWN);
        if let Some(list) = chosen.as_ref().and_then(|chosen| chosen.columns.get(k)) {
            guess.roles = list.roles_among(&preview.names);
        }
        files.push(DroppedFile {
            file: file.into_owned(),
            preview,
            guess,
        });
        numbers.push(rows);
    }
    let preset = chosen.map(|chosen| Recognised {
        name: chosen.used.name,
        title: chosen.used.title,
        raw_unit: chosen.raw_unit.map(|unit| unit.to_string()),
        scales: chosen
            .scales
            .iter()
            .map(|scale| scale.to_string())
            .collect(),
    });
    let guesses: Vec<&Guess> = files.iter().map(|file| &file.guess).collect();
    let units = Units::of(&guesses, &numbers);
    Ok(Dropped {
        preset,
        files,
        units,
    })
}

/// What the page shows of a recording.
#[derive(Serialize)]
struct View {
    /// The readings over time with the dwells, as in the report.
    trace: String,
    #[serde(flatten)]
    poses: poses::Poses,
}

fn view(recording: &Path, calibration: Option<&PathBuf>) -> Result<View> {
    let calibration = calibration
        .map(|path| Calibration::read(path))
        .transpose()?;
    let search = DwellSearch {
        still_factor: STILL_FACTOR,
        steps: Steps::AsRecorded,
    };
    let prepared = Prepared::read(&Recording::open(recording)?, search, |_| {})?;
    Ok(View {
        trace: mimu_cli::report::trace_figure(&prepared),
        poses: poses::of(&prepared, calibration.as_ref()),
    })
}
