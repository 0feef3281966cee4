//! The flags of the command beside what an error of a library says to set otherwise.

use mimu_recording::error::{Argument, Error};

/// Flags that are a remedy only on the command that refused. The others belong to the import, which the remedy names.
const OF_THE_COMMAND: [&str; 4] = ["--steps", "--still", "--method", "--only"];

/// The error in one line, with those flags of `command` that set what it is about. The same refusal comes from several commands, and a
/// flag that the one at hand lacks is no remedy.
pub(crate) fn line(error: &Error, command: &clap::Command) -> String {
    let arguments = &error.refused().arguments;
    let has = |flag: &&str| {
        if !OF_THE_COMMAND.contains(flag) {
            return true;
        }
        let long = flag.trim_start_matches('-');
        command.get_arguments().any(|a| a.get_long() == Some(long))
    };
    let flags: Vec<&str> = arguments
        .iter()
        .filter_map(|s| flag(*s))
        .filter(has)
        .collect();
    match flags.is_empty() {
        true => error.to_string(),
        false => format!("{error} ({})", flags.join(", ")),
    }
}

fn flag(argument: Argument) -> Option<&'static str> {
    Some(match argument {
        Argument::Columns => "--columns",
        Argument::SampleRate => "--rate-hz",
        Argument::TimeUnit => "--time-unit",
        Argument::Scale => "--scale",
        Argument::Offset => "--offset",
        Argument::Reference => "--reference",
        Argument::Device => "--device",
        Argument::Steps => "--steps",
        Argument::StillFactor => "--still",
        Argument::AtRest => "--at-rest",
        Argument::Method => "--method",
        Argument::Only => "--only",
        Argument::Stretch => "--from, --to",
        Argument::Calibration => "--calibration",
        Argument::Table => "--table",
        Argument::Sensor => "--sensor",
        Argument::Replace => "--replace",
        Argument::Port => "--port",
        Argument::OtherUnit => "--other-unit",
        Argument::Topic => "--topic",
        Argument::Preset => "--preset",
        Argument::Means => "--means",
        // An argument that this version of the command has no flag for.
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_names_the_flag_of_what_it_is_about() {
        let error =
            Error::new("log.csv", "the rate is not known", "give it").about(Argument::SampleRate);
        let command = |flags: &[&'static str]| {
            let args = flags.iter().map(|f| clap::Arg::new(*f).long(*f));
            clap::Command::new("import").args(args)
        };
        assert_eq!(
            line(&error, &command(&["rate-hz", "still"])),
            "log.csv: the rate is not known; give it (--rate-hz)"
        );
        let other = Error::new("log.csv", "it is empty", "record again");
        assert_eq!(
            line(&other, &command(&["rate-hz"])),
            "log.csv: it is empty; record again"
        );
    }

    #[test]
    fn a_flag_that_the_command_lacks_is_not_named() {
        let error = Error::new("REC, accel", "too few dwells", "add some").about(Argument::Only);
        let lacks = clap::Command::new("diagnose");
        assert_eq!(line(&error, &lacks), "REC, accel: too few dwells; add some");
    }
}
