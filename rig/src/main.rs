//! The command `mimu-rig`.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::{Parser, Subcommand};
use mimu_rig::board::front::Front;
use mimu_rig::board::image::{Image, release_image};
use mimu_rig::board::running::Board;
use mimu_rig::board::serve::{self, Served};
use mimu_rig::located::Source;
use mimu_rig::plan::{Plan, Samples};
use mimu_rig::record::{self, Output};
use mimu_rig::rig_file::{RigFile, RigTruth};

/// The virtual bench: inertial units with known truth on a turntable, in a chamber, or in a hand.
#[derive(Parser)]
#[command(version, arg_required_else_help = true, after_help = KEYS)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

/// Where to go on reading.
const KEYS: &str =
    "docs/bench.md has all keys of both files; rig/plans and rig/rigs have examples to copy.";

#[derive(Subcommand)]
enum Command {
    Record(Record),
    Serve(Serve),
}

/// Carry out a plan with a virtual unit and write the recording.
///
/// The unit's truth is written beside the recording, as a rig file: with --rig and the same plan and seed
/// it makes the same samples again. What the rig file leaves open is drawn from the seed, within the
/// tolerances of the data sheets.
#[derive(clap::Args)]
#[command(after_help = KEYS)]
struct Record {
    /// What to do: poses, rates, temperatures.
    #[arg(value_name = "PLAN.toml")]
    plan: PathBuf,
    /// The unit, the converter, the table and the person; everything in it is optional.
    #[arg(long, value_name = "RIG.toml")]
    rig: Option<PathBuf>,
    /// Another seed is another unit, another person, and other noise.
    #[arg(long, value_name = "N")]
    seed: u64,
    /// Folder of the recording.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// File of the truth [default: DIR.truth.toml]
    #[arg(long, value_name = "FILE")]
    truth: Option<PathBuf>,
    /// Storage of the samples [default: as the plan says]
    #[arg(long)]
    format: Option<Format>,
    /// Replace a recording, and its truth, that are there.
    #[arg(long)]
    replace: bool,
}

/// Run the firmware on an emulated board and print the path of its serial port.
///
/// The port is a pseudo-terminal in raw mode; its speed does not matter. The unit is carried through the plan from
/// the moment that the board is switched on, and stays where the plan ends. Runs until it is interrupted.
#[derive(clap::Args)]
#[command(after_help = KEYS)]
struct Serve {
    /// Firmware, an ELF file [default: the release image in the target directory]
    #[arg(long, value_name = "ELF")]
    image: Option<PathBuf>,
    /// The unit, the table and the person; everything in it is optional.
    #[arg(long, value_name = "RIG.toml")]
    unit: Option<PathBuf>,
    /// What is done to the unit [default: it lies still]
    #[arg(long, value_name = "PLAN.toml")]
    plan: Option<PathBuf>,
    /// Another seed is another unit, another person, and other noise.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// How fast virtual time goes.
    #[arg(long, default_value = "wall")]
    pace: Pace,
    /// File that keeps what the device stores in its flash; made if it is not there.
    #[arg(long, value_name = "FILE")]
    flash: Option<PathBuf>,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum Pace {
    /// With the clock on the wall. What nobody reads in time is lost, as on a real line.
    Wall,
    /// As fast as the machine can and as whoever has the port open reads; it waits for them.
    Fast,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum Format {
    Csv,
    Parquet,
}

fn main() -> ExitCode {
    let done = match Cli::parse().command {
        Command::Record(arguments) => arguments.run(),
        Command::Serve(arguments) => arguments.run(),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => {
            eprintln!("mimu-rig: {problem}");
            ExitCode::FAILURE
        }
    }
}

impl Record {
    fn run(self) -> Result<(), String> {
        let plan = Plan::read(&self.plan)?;
        let rig = match &self.rig {
            Some(path) => RigFile::read(path)?,
            None => RigFile::default(),
        };
        let truth = RigTruth::resolve(&rig, self.seed)?;
        let mut output = Output::new(&self.output, &plan)?;
        output.replace = self.replace;
        output.truth = self.truth.unwrap_or(output.truth);
        output.samples = match self.format {
            Some(Format::Csv) => Samples::Csv,
            Some(Format::Parquet) => Samples::Parquet,
            None => output.samples,
        };
        let begun = Instant::now();
        let count = record::write(&plan, &truth, self.seed, &output)?;
        let (recorded_s, took_s) = (
            count as f64 / plan.sample_rate_hz,
            begun.elapsed().as_secs_f64(),
        );
        println!(
            "{}: {count} samples, {recorded_s:.1} s of {} in {took_s:.2} s: {:.0} times real time; truth in {}",
            output.folder.display(),
            plan.device,
            recorded_s / took_s,
            output.truth.display(),
        );
        Ok(())
    }
}

/// Longest virtual time that a firmware may take until it says something, ms.
const START_MS: u32 = 2000;

/// Runs a board until its firmware has said something, as one does that was plugged in before its port is opened. Executing
/// this takes seconds on a busy machine, which whoever opens the port would otherwise spend waiting for an answer.
fn start(board: &mut Board) -> Result<(), String> {
    let mut spoken = false;
    for _ in 0..START_MS {
        board.run_for(1_000_000)?;
        let quiet = board.receive().is_empty();
        if spoken && quiet {
            break;
        }
        spoken |= !quiet;
    }
    Ok(())
}

/// The unit at rest with z up, in a room.
const AT_REST: &str = include_str!("../plans/rest.toml");

impl Serve {
    fn run(self) -> Result<(), String> {
        let plan = match &self.plan {
            Some(path) => Plan::read(path)?,
            None => Plan::parse(Source::new("rest.toml", AT_REST))?,
        };
        let rig = match &self.unit {
            Some(path) => RigFile::read(path)?,
            None => RigFile::default(),
        };
        let truth = RigTruth::resolve(&rig, self.seed)?;
        let image = Image::read(&self.image.unwrap_or_else(release_image))?;
        let mut board = Board::new(&image, Front::bench(&plan, &truth, self.seed)?)?;
        start(&mut board)?;
        let pace = match self.pace {
            Pace::Wall => serve::Pace::Wall,
            Pace::Fast => serve::Pace::Fast,
        };
        let mut served = Served::new(board, pace, self.flash.as_deref())?;
        println!("{}", served.path().display());
        let mut told = served.traffic().lost;
        loop {
            served.step()?;
            let lost = served.traffic().lost;
            if lost != told {
                eprintln!(
                    "mimu-rig: {lost} bytes lost: whoever has the port open does not read them"
                );
                told = lost;
            }
        }
    }
}
