//! The command `mimu-board`.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::{Parser, Subcommand};
use mimu_board::front::Front;
use mimu_board::image::{Image, release_image};
use mimu_board::running::Board;
use mimu_board::serve::{self, Served};
use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::rig_file::{RigFile, RigTruth};

/// The emulated board: the firmware's image on an emulated NUCLEO-H743ZI2 with a virtual unit at its pins.
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
    Serve(Serve),
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

fn main() -> ExitCode {
    let Command::Serve(arguments) = Cli::parse().command;
    match arguments.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => {
            eprintln!("mimu-board: {problem}");
            ExitCode::FAILURE
        }
    }
}

/// Time between two warnings of lost bytes, of which a second loses a thousand chunks.
const BETWEEN_WARNINGS: Duration = Duration::from_secs(1);

/// The unit at rest with z up, in a room.
const AT_REST: &str = include_str!("../../plans/rest.toml");

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
        let board = Board::new(&image, Front::bench(&plan, &truth, self.seed)?)?;
        let pace = match self.pace {
            Pace::Wall => serve::Pace::Wall,
            Pace::Fast => serve::Pace::Fast,
        };
        let mut served = Served::new(board, pace, self.flash.as_deref())?;
        served.start()?;
        println!("{}", served.path().display());
        let mut told = (served.traffic().lost, Instant::now());
        loop {
            served.step()?;
            let lost = served.traffic().lost;
            if lost != told.0 && told.1.elapsed() >= BETWEEN_WARNINGS {
                eprintln!(
                    "mimu-board: {lost} bytes lost: whoever has the port open does not read them"
                );
                told = (lost, Instant::now());
            }
        }
    }
}
