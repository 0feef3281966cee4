//! Examples at the end of each subcommand's help. A test parses each of them.

use clap::CommandFactory;
use mimu_export::Noise;

use crate::Cli;

/// Command lines; the second word of each is its subcommand.
const EXAMPLES: &str = include_str!("examples.txt");

/// The examples of a subcommand.
fn of(name: &str) -> Vec<&'static str> {
    let is = |line: &&str| line.split(' ').nth(1) == Some(name);
    EXAMPLES.lines().filter(is).collect()
}

/// Whether an export format declares a place for noise; the others do not list the option.
fn stores_noise(name: &str) -> bool {
    let mut formats = mimu_export::FORMATS.iter();
    formats.any(|format| format.name == name && format.noise != Noise::No)
}

/// Hides `--noise` from the formats of `mimu export` that do not store noise.
fn formats(mut export: clap::Command) -> clap::Command {
    let names: Vec<String> = export
        .get_subcommands()
        .map(|c| c.get_name().to_owned())
        .collect();
    for name in names.iter().filter(|n| !stores_noise(n)) {
        let noise = clap::Arg::new("noise")
            .long("noise")
            .value_parser(clap::value_parser!(std::path::PathBuf))
            .hide(true);
        export = export.mut_subcommand(name, |c| c.arg(noise));
    }
    export
}

/// The command with its examples.
pub(crate) fn command() -> clap::Command {
    let command = Cli::command().mut_subcommand("export", formats);
    // A build without ports has fewer commands than there are examples.
    command.mut_subcommands(|c| {
        let text = format!("Examples:\n  {}", of(c.get_name()).join("\n  "));
        c.after_help(text)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_formats_with_a_place_for_noise_list_it() {
        let mut command = command();
        command.build();
        let export = command.find_subcommand("export").unwrap();
        for format in export.get_subcommands().filter(|c| c.get_name() != "help") {
            let noise = format
                .get_arguments()
                .find(|a| a.get_id() == "noise")
                .unwrap();
            let listed = stores_noise(format.get_name());
            assert_eq!(noise.is_hide_set(), !listed, "{}", format.get_name());
        }
        assert!(stores_noise("gazebo") && !stores_noise("px4"));
        let parse = |line: &str| {
            command
                .clone()
                .try_get_matches_from(line.split(' '))
                .map(|_| ())
        };
        parse("mimu export kalibr --noise noise.toml -o imu.yaml").unwrap();
        parse("mimu export px4 --calibration cal.toml -o unit.params").unwrap();
    }

    #[test]
    fn every_subcommand_has_examples_that_it_takes() {
        let command = command();
        for subcommand in command.get_subcommands() {
            let name = subcommand.get_name();
            let lines = of(name);
            assert!(!lines.is_empty(), "mimu {name} has no example");
            for line in lines {
                let parsed = command.clone().try_get_matches_from(line.split(' '));
                assert!(parsed.is_ok(), "{line}: {}", parsed.unwrap_err());
            }
        }
    }
}
