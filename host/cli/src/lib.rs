//! The command `mimu`: one subcommand per file, and the presentation of all results.
//!
//! | module | contents |
//! |---|---|
//! | `overwriting` | which files a command may overwrite |
//! | `cmd` | the subcommands: arguments and execution |
//! | [`called`] | subcommands that other programs can call |
//! | `arguments` | arguments that several subcommands share |
//! | `status` | how a subcommand ended |
//! | `reading`, `opening`, `output` | reads recordings; opens calibrations; writes text, JSON and files |
//! | [`report`] | results as JSON, text and page |
//! | `views` | shows a session of the wizard while it runs |
//! | `examples` | examples at the end of each help |
//! | `hint` | adds the flags of the command line to errors of the libraries |

mod arguments;
pub mod called;
mod cmd;
mod examples;
mod hint;
mod importing;
mod opening;
mod output;
mod overwriting;
mod reading;
pub mod report;
mod status;
#[cfg(not(target_family = "wasm"))]
mod views;

use std::ffi::OsString;

pub use output::now;

use clap::{FromArgMatches, Parser, Subcommand};
use status::Status;

#[cfg(not(target_family = "wasm"))]
use cmd::{accept, device, record, wizard};
use cmd::{allan, apply, design, diagnose, fit, import, thermal, verify};

/// Calibration of inertial units: any gyro and accelerometer of three axes, digital or analog.
///
/// A log at hand: mimu fit log.csv -o cal.toml, then mimu export c cal.toml -o cal.h. By hand, with any board that prints lines of readings: mimu wizard
/// --text ax,ay,az,gx,gy,gz --latitude 48.1 -o session --port /dev/ttyUSB0. Every command prints the next one.
///
/// Exit status 0: done; 1: the data were refused, and one line gives the fault, its place and the remedy; 2: wrong usage; 3: done, but --strict was
/// given and the result is not judged good, or `mimu accept` rejects a unit.
#[derive(Parser)]
#[command(name = "mimu", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    #[cfg(not(target_family = "wasm"))]
    /// Calibrate a board interactively: gives instructions, checks each dwell, fits, verifies and stores
    Wizard(wizard::WizardArgs),
    /// Make a recording from foreign files
    Import(Box<import::ImportArgs>),
    /// Calibrate the gyro and the accelerometer of a recording
    Fit(fit::FitArgs),
    /// Judge a calibration on another recording
    Verify(verify::VerifyArgs),
    /// Apply a calibration to a recording and write the result
    Apply(apply::ApplyArgs),
    /// Show what changed between calibrations of one unit by more than their intervals
    Compare(cmd::compare::CompareArgs),
    /// Show what the calibrations of many units say together: population, units that do not belong, drift, Cpk
    Fleet(cmd::fleet::FleetArgs),
    /// Find the effect that causes the residual of a calibrated unit
    Diagnose(diagnose::DiagnoseArgs),
    /// Design an experiment: which attitudes and rates, how many, for how long
    Design(design::DesignArgs),
    /// Calibrate over temperature: plan, record, fit and compare curves
    Thermal(thermal::ThermalArgs),
    /// Determine the noise of a unit at rest: Allan deviation, N, B, K, Q and R
    Allan(allan::AllanArgs),
    /// Find the noise that a filter wants: what explains the errors of dead reckoning in motion
    Noise(cmd::noise::NoiseInUseArgs),
    /// Write a calibration, or noise, in the format of another program
    Export(cmd::export::ExportArgs),
    /// Write a calibration, mimu's or another program's, in the format of a further program
    Convert(cmd::convert::ConvertArgs),
    /// Write one page with everything that is known of a unit: verdict, errors, calibration, effects, noise, recordings
    Report(cmd::report::ReportArgs),
    #[cfg(not(target_family = "wasm"))]
    /// Accept or reject units by ten seconds at rest, against limits: the test of a line of production
    Accept(Box<accept::AcceptArgs>),
    #[cfg(not(target_family = "wasm"))]
    /// Record the raw stream of a device
    Record(record::RecordArgs),
    #[cfg(not(target_family = "wasm"))]
    /// Control a device: info, stream, upload, download, trim, self-test, counters, check, kalman
    Device(device::DeviceArgs),
    /// Print the completion script of a shell
    Completions(cmd::completions::CompletionsArgs),
    /// Write the manual pages, one for each subcommand
    Man(cmd::man::ManArgs),
}

/// Runs the subcommand of `arguments`, whose first element is the program, and prints an error in one line. Returns the exit status.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    let parsed = examples::command()
        .try_get_matches_from(&arguments)
        .and_then(|matches| Ok((Cli::from_arg_matches(&matches)?, matches)));
    let (cli, matches) = match parsed {
        Ok(both) => both,
        Err(error) => {
            // clap returns help and version as errors too. If they cannot be printed, the exit status shows it.
            let printed = error.print();
            return printed.map_or(1, |()| u8::try_from(error.exit_code()).unwrap_or(2));
        }
    };
    let typed = command_line(&arguments);
    let done = |()| Status::Done;
    let ended = match cli.command {
        #[cfg(not(target_family = "wasm"))]
        Command::Wizard(args) => wizard::run(&args, &typed).map(done),
        Command::Import(args) => import::run(*args).map(done),
        Command::Fit(args) => fit::run(&args),
        Command::Verify(args) => verify::run(&args),
        Command::Apply(args) => apply::run(&args).map(done),
        Command::Compare(args) => cmd::compare::run(&args).map(done),
        Command::Fleet(args) => cmd::fleet::run(&args, &typed).map(done),
        Command::Diagnose(args) => diagnose::run(&args, &typed),
        Command::Design(args) => design::run(&args).map(done),
        Command::Thermal(args) => thermal::run(&args, &typed),
        Command::Allan(args) => allan::run(&args),
        Command::Noise(args) => cmd::noise::run(&args),
        Command::Export(args) => cmd::export::run(&args).map(done),
        Command::Convert(args) => cmd::convert::run(&args).map(done),
        Command::Report(args) => cmd::report::run(&args, &typed).map(done),
        #[cfg(not(target_family = "wasm"))]
        Command::Accept(args) => accept::run(&args),
        #[cfg(not(target_family = "wasm"))]
        Command::Record(args) => record::run(&args).map(done),
        #[cfg(not(target_family = "wasm"))]
        Command::Device(args) => device::run(&args).map(done),
        Command::Completions(args) => cmd::completions::run(&args).map(done),
        Command::Man(args) => cmd::man::run(&args).map(done),
    };
    reading::remove_logs();
    match ended {
        Ok(status) => status.code(),
        Err(error) => {
            eprintln!("mimu: {}", hint::line(&error, &innermost(&matches)));
            if json_is_printed(&matches) && !output::json_printed() {
                report::print_refusal(&error);
            }
            1
        }
    }
}

/// The command as it was typed, without the path of the program.
fn command_line(arguments: &[OsString]) -> String {
    let shown = arguments.iter().skip(1).map(|a| match a.to_string_lossy() {
        a if a.contains([' ', '\'', '"']) => format!("{a:?}"),
        a => a.into_owned(),
    });
    let all: Vec<String> = std::iter::once("mimu".to_string()).chain(shown).collect();
    all.join(" ")
}

/// Whether `--json -` is among the arguments of any subcommand.
fn json_is_printed(matches: &clap::ArgMatches) -> bool {
    // The id is that of the field of `JsonArgs`.
    let to: Option<&std::path::PathBuf> = matches.try_get_one("path").ok().flatten();
    let within = matches
        .subcommand()
        .is_some_and(|(_, of)| json_is_printed(of));
    within || to.is_some_and(|path| path.as_os_str() == "-")
}

/// The innermost subcommand of `matches`, with its flags.
fn innermost(matches: &clap::ArgMatches) -> clap::Command {
    let mut command = examples::command();
    let mut at = matches;
    while let Some((name, next)) = at.subcommand() {
        match command.find_subcommand(name) {
            Some(found) => command = found.clone(),
            None => break,
        }
        at = next;
    }
    command
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arguments_are_consistent() {
        let mut command = examples::command();
        command.build();
        conflicts_with_what_is_there(&command);
        examples::command().debug_assert();
    }

    /// clap's `debug_assert` accepts a conflict with an argument that does not exist. Such a conflict has no effect, and prevents completions for
    /// zsh.
    fn conflicts_with_what_is_there(command: &clap::Command) {
        for argument in command.get_arguments() {
            command.get_arg_conflicts_with(argument);
        }
        command
            .get_subcommands()
            .for_each(conflicts_with_what_is_there);
    }
}
