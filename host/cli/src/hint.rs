//! The flags of the command beside what an error of a library says to set otherwise.

use mimu_recording::error::{Argument, Error};

/// The error in one line, with the flags that set what it is about.
pub(crate) fn line(error: &Error) -> String {
    let arguments = &error.refused().arguments;
    let flags: Vec<&str> = arguments.iter().filter_map(|s| flag(*s)).collect();
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
        assert_eq!(
            line(&error),
            "log.csv: the rate is not known; give it (--rate-hz)"
        );
        let other = Error::new("log.csv", "it is empty", "record again");
        assert_eq!(line(&other), "log.csv: it is empty; record again");
    }
}
