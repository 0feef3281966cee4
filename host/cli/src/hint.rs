//! Adds the flags of the command line to errors and warnings of the libraries.

use std::sync::atomic::{AtomicBool, Ordering};

use clap::CommandFactory;
use mimu::diagnose::rejected::{Reason, Rejected};
use mimu::warning::Warning;
use mimu_recording::error::Error;
use mimu_recording::health::Fault;
use mimu_thermal::warning::Warning as OverTemperature;
use mimu_wizard::waiting::Waiting;

use crate::Cli;

/// Heading, in a help, of the options that say what a log contains.
pub(crate) const OF_A_LOG: &str = "A log in place of the recording";

/// Whether the command was given a log, so that these options apply.
pub(crate) static LOG_IS_READ: AtomicBool = AtomicBool::new(false);

/// The error in one line, with the flags of `command` that can remedy it. Several commands can cause the same refusal, and a flag that the present
/// one lacks is no remedy.
pub(crate) fn line(error: &Error, command: &clap::Command) -> String {
    let arguments = &error.refused().arguments;
    let all = Cli::command();
    let fit = all.find_subcommand("fit");
    let named = |flag: &'static str| {
        // A remedy in another command applies after any command.
        if flag.starts_with("mimu ") {
            return Some(flag.to_string());
        }
        let first = flag.split([',', ' ']).next()?;
        let is_it = |a: &&clap::Arg| match first.strip_prefix("--") {
            Some(long) => a.get_long() == Some(long),
            None => a.get_short() == first.chars().nth(1),
        };
        // What is wrong with a recording that was imported before is put right by another import.
        let of_the_import = |a: &clap::Arg| a.get_help_heading() == Some(OF_A_LOG);
        let mut of_a_fit = fit.iter().flat_map(|fit| fit.get_arguments());
        let imported = of_a_fit.any(|a| of_the_import(a) && is_it(&a));
        let imported = imported.then(|| format!("mimu import {flag}"));
        let log = LOG_IS_READ.load(Ordering::Relaxed);
        match command.get_arguments().find(is_it) {
            Some(a) if log || !of_the_import(a) => Some(flag.to_string()),
            _ if imported.is_some() => imported,
            // A diagnosis needs both sensors; only a fit accepts one.
            None if flag == "--only" => Some(format!("mimu fit {flag}")),
            _ => None,
        }
    };
    let flags: Vec<String> = arguments
        .iter()
        .filter_map(|argument| named(argument.flags()))
        .collect();
    match flags.is_empty() {
        true => error.to_string(),
        false => format!("{error} ({})", flags.join(", ")),
    }
}

/// The warning in one line, with the flag that suppresses its cause.
pub(crate) fn of_warning(warning: &Warning) -> String {
    match warning.left_out() {
        Some(step) => format!("{warning} (--keep {step})"),
        None => warning.to_string(),
    }
}

/// Why a unit of the wizard waits, with the flag that controls it.
pub(crate) fn of_waiting(why: &Waiting) -> String {
    match why {
        Waiting::Faulty(found) if found.fault == Fault::Exchanged => format!("{why} (--text)"),
        _ => why.to_string(),
    }
}

/// The warning of a fit over temperature in one line, with the flag that suppresses its cause.
pub(crate) fn of_thermal(warning: &OverTemperature) -> String {
    match warning {
        OverTemperature::WithoutNoise => format!("{warning} (--noise)"),
        _ => warning.to_string(),
    }
}

/// Why an effect was rejected, with the flag of the recording that would confirm it.
pub(crate) fn of_rejected(rejected: &Rejected) -> String {
    match &rejected.reason {
        reason @ Reason::Suggestion(_) => format!("{reason} (--verify)"),
        reason => reason.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use mimu::quantity::Sensor;
    use mimu_recording::error::Argument;
    use mimu_recording::health::Finding;

    use super::*;

    #[test]
    fn an_error_names_the_flag_of_what_it_is_about() {
        let error =
            Error::new("log.csv", "the rate is unknown", "give it").about(Argument::SampleRate);
        let command = |flags: &[&'static str]| {
            let args = flags.iter().map(|f| clap::Arg::new(*f).long(*f));
            clap::Command::new("import").args(args)
        };
        assert_eq!(
            line(&error, &command(&["rate-hz", "still"])),
            "log.csv: the rate is unknown; give it (--rate-hz)"
        );
        let short = Error::new("out", "it is not empty", "give another").about(Argument::Output);
        let has = clap::Command::new("wizard").arg(clap::Arg::new("output").short('o'));
        let said = "out: it is not empty; give another (-o)";
        assert_eq!(line(&short, &has), said);
        let other = Error::new("log.csv", "it is empty", "record again");
        assert_eq!(
            line(&other, &command(&["rate-hz"])),
            "log.csv: it is empty; record again"
        );
    }

    #[test]
    fn a_suggestion_names_the_flag_that_confirms_it() {
        let rejected = |reason| Rejected {
            id: "term:accel_x~rate_y*force_z".into(),
            sensor: Sensor::Accel,
            reason,
        };
        let said = of_rejected(&rejected(Reason::Suggestion(1e-9)));
        assert!(said.ends_with("that shows it (--verify)"), "{said}");
        let said = of_rejected(&rejected(Reason::OneDwell(0.83)));
        assert_eq!(said, "one dwell contains 83 % of its information");
    }

    #[test]
    fn columns_that_seem_exchanged_name_the_flag_that_orders_them() {
        let said = of_waiting(&Waiting::Faulty(Finding::of_all(0, Fault::Exchanged)));
        assert!(said.ends_with("exchanged? (--text)"), "{said}");
        assert_eq!(of_waiting(&Waiting::TableMoves), "the table moves");
    }

    #[test]
    fn a_flag_that_the_command_lacks_is_named_with_the_command_that_has_it_or_not_at_all() {
        let lacks = clap::Command::new("diagnose");
        for other in [Argument::AtRest, Argument::Stretch, Argument::StepsGiven] {
            let error = Error::new("REC, accel", "too few dwells", "add some").about(other);
            assert_eq!(line(&error, &lacks), "REC, accel: too few dwells; add some");
        }
        let error = Error::new("REC", "another rate", "give it").about(Argument::SampleRate);
        let said = "REC: another rate; give it (mimu import --rate-hz)";
        assert_eq!(line(&error, &lacks), said);
        let of_a_log = clap::Arg::new("rate-hz")
            .long("rate-hz")
            .help_heading(OF_A_LOG);
        let takes_a_log = clap::Command::new("fit").arg(of_a_log);
        assert_eq!(line(&error, &takes_a_log), said);
        let error = Error::new("REC", "no rates", "fit the accel alone").about(Argument::Only);
        let said = "REC: no rates; fit the accel alone (mimu fit --only)";
        assert_eq!(line(&error, &lacks), said);
    }
}
