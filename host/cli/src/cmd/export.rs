//! `mimu export`: one subcommand for each format of [`mimu_export`].

use std::path::{Path, PathBuf};

use clap::{Arg, ArgMatches, Args, Command, FromArgMatches, Subcommand};
use mimu::calibration::thermal_biases::{self, ThermalBiases};
use mimu::{Calibration, NoiseFile};
use mimu_export::{Choice, Export, Noise, Sources};
use mimu_recording::result_file::stage;
use mimu_recording::{Argument, Error, Result, read_text};
use serde::Serialize;

use crate::arguments::JsonArgs;
use crate::output::{check_outputs, print};
use crate::overwriting::check_overwritten;

#[derive(Args)]
#[command(subcommand_value_name = "FORMAT", subcommand_help_heading = "Formats")]
pub struct ExportArgs {
    #[command(subcommand)]
    to: FormatOf,
    /// Calibration file of `mimu fit -o`, `mimu diagnose -o` or `mimu thermal fit -o`, which may also follow the format's name; px4 and ardupilot
    /// also take the biases of a unit at rest
    #[arg(long, value_name = "FILE", global = true)]
    calibration: Option<PathBuf>,
    /// Noise file of the unit (`mimu allan -o`)
    #[arg(long, value_name = "FILE", global = true)]
    noise: Option<PathBuf>,
    /// File to write
    // Required, but clap does not allow that for a global argument.
    #[arg(short = 'o', long = "out", value_name = "FILE", global = true)]
    out: Option<PathBuf>,
    #[command(flatten)]
    json: JsonArgs,
}

/// A format, and the calibration that may follow its name.
struct FormatOf {
    choice: Choice,
    calibration: Option<PathBuf>,
}

/// Id of the argument that follows the name of a format.
const FILE: &str = "file";

impl FormatOf {
    /// Adds the file to every format, so that a new one has it too.
    fn with_file(mut command: Command) -> Command {
        let formats = command.get_subcommands().map(|c| c.get_name().to_owned());
        for name in formats.collect::<Vec<_>>() {
            let file = Arg::new(FILE)
                .value_name("CALIBRATION")
                .value_parser(clap::value_parser!(PathBuf))
                .help("Calibration file, as with --calibration")
                .conflicts_with("calibration");
            command = command.mut_subcommand(name, |c| c.arg(file));
        }
        command
    }
}

impl FromArgMatches for FormatOf {
    fn from_arg_matches(matches: &ArgMatches) -> std::result::Result<Self, clap::Error> {
        let file = matches.subcommand().map(|(_, of)| of.get_one(FILE));
        Ok(Self {
            choice: Choice::from_arg_matches(matches)?,
            calibration: file.flatten().cloned(),
        })
    }

    fn update_from_arg_matches(
        &mut self,
        matches: &ArgMatches,
    ) -> std::result::Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl Subcommand for FormatOf {
    fn augment_subcommands(command: Command) -> Command {
        Self::with_file(Choice::augment_subcommands(command))
    }

    fn augment_subcommands_for_update(command: Command) -> Command {
        Self::with_file(Choice::augment_subcommands_for_update(command))
    }

    fn has_subcommand(name: &str) -> bool {
        Choice::has_subcommand(name)
    }
}

/// The written file and its contents.
#[derive(Serialize)]
struct ExportResult {
    #[serde(flatten)]
    export: Export,
    file: String,
    bytes: usize,
}

pub fn run(args: &ExportArgs) -> Result<()> {
    let path = args
        .out
        .as_deref()
        .ok_or_else(|| Error::new("-o", "it is missing", "name the file to write: -o FILE"))?;
    let choice = &args.to.choice;
    let file = args.calibration.as_ref().or(args.to.calibration.as_ref());
    if args.noise.is_some() && choice.format.noise == Noise::No {
        let problem = "this format cannot contain the noise of a unit";
        return Err(Error::new("export", problem, "leave it out").about(Argument::Noise));
    }
    let inputs = file.into_iter().chain(&args.noise);
    check_outputs(&[Some(path), args.json.file()], inputs)?;
    check_overwritten(&[Some(path)])?;
    let named = file.map(|p| p.display().to_string());
    let (mut calibration, mut biases) = (None, None);
    if let (Some(path), Some(place)) = (file, &named) {
        let text = read_text(path)?;
        match choice.format.takes_biases && thermal_biases::is_one(&text) {
            true => biases = Some(ThermalBiases::parse(&text, place)?),
            false => calibration = Some(Calibration::parse(&text, place)?),
        }
    }
    let noise = args.noise.as_deref().map(NoiseFile::read).transpose()?;
    let from = Sources {
        calibration: calibration.as_ref().zip(named.as_deref()),
        biases: biases.as_ref(),
        noise: noise.as_ref(),
    };
    written(choice, &from, path, &args.json)
}

/// Writes the export of `from`, and prints what it contains.
pub(super) fn written(choice: &Choice, from: &Sources, path: &Path, json: &JsonArgs) -> Result<()> {
    let export = choice.export(from)?;
    let content = export.content.clone();
    let result = ExportResult {
        file: path.display().to_string(),
        bytes: content.len(),
        export,
    };
    let mut lines = result.export.for_terminal();
    lines.push(format!("{}: {}", result.export.to, result.file));
    let text = lines.join("\n") + "\n";
    print(json, &text, &result, Some(stage(path, content)?))
}
