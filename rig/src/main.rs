//! The command `mimu-rig`.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::{Parser, Subcommand};
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
    "docs/bench has all keys of both files; rig/plans and rig/rigs have examples to copy.";

#[derive(Subcommand)]
enum Command {
    Record(Record),
}

/// Carry out a plan with a virtual unit and write the recording.
///
/// The truth of the unit is written beside the recording, as a rig file. With --rig, the same plan and the same seed it makes the same
/// samples again. Parameters that the rig file omits are drawn from the seed, within the tolerances of the data sheets.
#[derive(clap::Args)]
#[command(after_help = KEYS)]
struct Record {
    /// Plan: poses, rates, temperatures.
    #[arg(value_name = "PLAN.toml")]
    plan: PathBuf,
    /// Parameters of the unit, the converter, the table and the person; all are optional.
    #[arg(long, value_name = "RIG.toml")]
    rig: Option<PathBuf>,
    /// Another seed is another unit, another person, and other noise.
    #[arg(long, value_name = "N")]
    seed: u64,
    /// Folder of the recording.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// File for the truth [default: DIR.truth.toml]
    #[arg(long, value_name = "FILE")]
    truth: Option<PathBuf>,
    /// Format of the samples [default: that of the plan]
    #[arg(long)]
    format: Option<Format>,
    /// Replace an existing recording and its truth.
    #[arg(long)]
    replace: bool,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum Format {
    Csv,
    Parquet,
}

fn main() -> ExitCode {
    let Command::Record(arguments) = Cli::parse().command;
    match arguments.run() {
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
