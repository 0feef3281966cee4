//! Subcommands for other programs, with the same arguments as on the command line: no option, default or check is defined twice.

use std::ffi::OsString;
use std::pin::Pin;
use std::sync::mpsc::Receiver;

use clap::{Args, CommandFactory, Parser};
use mimu_export::{Choice, Export, Sources};
use mimu_recording::{Error, ImportSummary};
use mimu_wizard::event::View;
use mimu_wizard::relay::Stamped;
use mimu_wizard::session::Outcome;

use crate::Cli;
pub use crate::cmd::allan::AllanArgs;
use crate::cmd::design::DesignArgs;
pub use crate::cmd::design::Designed;
pub use crate::cmd::diagnose::{DiagnoseArgs, Further};
pub use crate::cmd::fit::{FitArgs, FitMade, Open, SessionsMade};
pub use crate::cmd::noise::NoiseInUseArgs;
pub use crate::cmd::thermal::FitArgs as ThermalFitArgs;
pub use crate::cmd::verify::{Verified, VerifyArgs};
use crate::cmd::wizard::{WizardArgs, session};
use crate::hint::{self, OF_A_LOG};
use crate::importing::{ImportArgs, imported};

/// Why a call was refused.
#[derive(Debug)]
pub enum Refusal {
    /// The arguments are invalid.
    Usage(String),
    /// The command refused the data.
    Data(Error),
}

impl From<Error> for Refusal {
    fn from(error: Error) -> Self {
        Self::Data(error)
    }
}

/// Makes a recording, with the arguments of `mimu import`.
///
/// # Errors
/// See [`Refusal`].
pub fn import(arguments: Vec<OsString>) -> Result<ImportSummary, Refusal> {
    Ok(imported(parsed::<ImportArgs>("import", arguments)?)?.0)
}

/// Result of `mimu design` with these arguments, and the plan as TOML.
///
/// # Errors
/// See [`Refusal`].
pub fn design(arguments: Vec<OsString>) -> Result<(Designed, String), Refusal> {
    Ok(parsed::<DesignArgs>("design", arguments)?.made()?)
}

/// File of `mimu export`; its arguments begin with the name of the format.
///
/// # Errors
/// See [`Refusal`].
pub fn export(arguments: Vec<OsString>, from: &Sources) -> Result<Export, Refusal> {
    #[derive(Parser)]
    struct To {
        #[command(subcommand)]
        to: Choice,
    }
    let arguments = std::iter::once("export".into()).chain(arguments);
    let chosen = To::try_parse_from(arguments).map_err(usage)?;
    Ok(chosen.to.export(from)?)
}

/// A session of the wizard: its result, and the error line if it failed ([`mimu_wizard::turn`]).
pub type Session = Pin<Box<dyn Future<Output = (Option<Outcome>, Option<String>)>>>;

/// A session by hand, with the arguments of `mimu wizard` and a board at a port that the caller reads. `arrivals` receives the bytes.
///
/// # Errors
/// See [`Refusal`].
pub fn wizard(
    arguments: Vec<OsString>,
    arrivals: Receiver<Stamped>,
    view: Box<dyn View>,
) -> Result<Session, Refusal> {
    let typed = std::iter::once("mimu".into()).chain(arguments.iter().cloned());
    let typed = crate::command_line(&typed.collect::<Vec<_>>());
    let options = arguments.into_iter().skip(1).collect();
    let session = session(
        &parsed::<WizardArgs>("wizard", options)?,
        typed,
        arrivals,
        view,
    )?;
    Ok(Box::pin(async move {
        let command = WizardArgs::augment_args(clap::Command::new("wizard"));
        let line = |error: Error| hint::line(&error, &command);
        match session.await {
            Ok((outcome, stored)) => (Some(outcome), stored.err().map(line)),
            Err(error) => (None, Some(line(error))),
        }
    }))
}

/// Names of the options of `subcommand`, such as `rate-hz` and `n`, without those of a log; `subcommand` may be one of another, such as `thermal fit`.
pub fn options(subcommand: &str) -> Vec<String> {
    let command = Cli::command();
    let mut words = subcommand.split_whitespace();
    let found = words.try_fold(&command, |command, word| command.find_subcommand(word));
    let arguments = found.into_iter().flat_map(clap::Command::get_arguments);
    let arguments = arguments.filter(|a| a.get_help_heading() != Some(OF_A_LOG));
    let long = |a: &clap::Arg| a.get_long().map(str::to_owned);
    let named = |a| long(a).or_else(|| a.get_short().map(String::from));
    arguments.filter_map(named).collect()
}

/// Flags of the command that change what `error` is about, such as `--rate-hz`.
pub fn flags(error: &Error) -> Vec<&'static str> {
    let arguments = &error.refused().arguments;
    arguments.iter().map(|a| a.flags()).collect()
}

/// The arguments `A` of the command `name`, but the files that it requires: the caller has their contents at hand.
///
/// # Errors
/// See [`Refusal`].
pub fn of_contents<A: Args>(
    name: &'static str,
    mut arguments: Vec<OsString>,
) -> Result<A, Refusal> {
    let required = A::augment_args(clap::Command::new(name));
    let required = required.get_arguments().filter(|a| a.is_required_set());
    arguments.extend(required.map(|a| match a.get_long() {
        Some(long) => format!("--{long}=given").into(),
        None => "given".into(),
    }));
    parsed(name, arguments)
}

fn parsed<A: Args>(name: &'static str, arguments: Vec<OsString>) -> Result<A, Refusal> {
    let command = A::augment_args(clap::Command::new(name));
    let arguments = std::iter::once(name.into()).chain(arguments);
    let matches = command.try_get_matches_from(arguments).map_err(usage)?;
    A::from_arg_matches(&matches).map_err(usage)
}

/// clap's message about invalid arguments, in one line.
fn usage(error: clap::Error) -> Refusal {
    let text = error.render().to_string();
    let about_help = |line: &&str| line.starts_with("Usage:") || line.starts_with("For more");
    let said = text.lines().take_while(|line| !about_help(line));
    let said: Vec<&str> = said
        .map(str::trim)
        .filter(|line| !line.is_empty())
        .collect();
    let said = said.join("; ").replace(":; ", ": ");
    Refusal::Usage(said.strip_prefix("error: ").unwrap_or(&said).to_owned())
}
