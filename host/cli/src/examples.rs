//! Examples at the end of each subcommand's help. A test parses each of them.

use clap::CommandFactory;

use crate::Cli;

/// Name of a subcommand, and its command lines.
const EXAMPLES: [(&str, &[&str]); 19] = [
    (
        "wizard",
        &[
            "mimu wizard --text t_ms,ax,ay,az,gx,gy,gz -o session --port /dev/ttyUSB0 --latitude 48.1",
            "mimu wizard -o session --port /dev/ttyACM0",
            "mimu wizard -o session --prior kind.toml --as-planned --latitude 48.1",
            "mimu wizard -o session --fixture table --driver turntable.toml --rate 250 --latitude 48.1",
        ],
    ),
    (
        "import",
        &[
            "mimu import log.csv -o rec",
            "mimu import log.csv --units g,deg/s --latitude 48.1 -o rec",
            "mimu import log.csv --columns t_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z,- --raw-unit count --gravity 9.81 --reference gravity -o rec",
            "mimu import player.csv --columns t_s,gyro_x,gyro_y,gyro_z --raw-unit count --reference turntable-rate --rate-dps 200,270 --rate-error 0.3% -o player",
            "mimu import MT_00B4D6D1.txt --preset xsens --reference gravity --gravity 9.81 -o rec",
        ],
    ),
    (
        "fit",
        &[
            "mimu fit log.csv -o cal.toml",
            "mimu fit rec -o cal.toml",
            "mimu fit rec --noise noise.toml --verbose",
            "mimu fit monday tuesday friday -o cal.toml",
            "mimu fit six-poses --prior kind.toml -o cal.toml",
            "mimu fit rec --json -",
        ],
    ),
    ("verify", &["mimu verify another --calibration cal.toml"]),
    (
        "apply",
        &["mimu apply rec --calibration cal.toml -o compensated"],
    ),
    (
        "compare",
        &[
            "mimu compare before.toml after.toml",
            "mimu compare monday.toml tuesday.toml wednesday.toml --verbose",
        ],
    ),
    (
        "fleet",
        &[
            "mimu fleet calibrations -o fleet.html",
            "mimu fleet calibrations --labels units.csv --limits icm42688p -o fleet.html",
            "mimu fleet calibrations --prior kind.toml",
            "mimu fleet calibrations --folders line,batch --gage operator,fixture --json fleet.json",
        ],
    ),
    (
        "diagnose",
        &[
            "mimu diagnose rec --verify another --noise noise.toml -o cal.toml",
            "mimu diagnose rec --page diagnosis.html --plan next.toml",
        ],
    ),
    (
        "design",
        &[
            "mimu design -n 12 --reference gravity --table hand",
            "mimu design --budget 10 --sensor gyro -o plan.toml",
            "mimu design --prior kind.toml --target accel-scale=500 -o plan.toml",
        ],
    ),
    (
        "thermal",
        &[
            "mimu thermal plan --procedure ramp --range -10..70 -o plan.toml",
            "mimu thermal fit sweep --verify another -o cal.toml --page thermal.html",
        ],
    ),
    (
        "allan",
        &["mimu allan at-rest --calibration cal.toml -o noise.toml --plot noise.svg"],
    ),
    (
        "noise",
        &[
            "mimu noise by-hand --calibration cal.toml --noise noise.toml -o imu.yaml",
            "mimu noise mav0/imu0 --calibration cal.toml --noise noise.toml --trajectory truth.csv -o in-use.toml",
        ],
    ),
    (
        "export",
        &[
            "mimu export c cal.toml -o cal.h",
            "mimu export kalibr --noise noise.toml -o imu.yaml",
            "mimu export px4 --calibration cal.toml --qgc -o unit.params",
        ],
    ),
    (
        "report",
        &[
            "mimu report session -o unit.html",
            "mimu report rec --verify another --noise noise.toml -o unit.html",
        ],
    ),
    (
        "record",
        &["mimu record --port /dev/ttyACM0 --for 60s -o rec"],
    ),
    (
        "device",
        &[
            "mimu device info --port /dev/ttyACM0",
            "mimu device upload cal.toml --port /dev/ttyACM0",
        ],
    ),
    (
        "accept",
        &[
            "mimu accept at-rest --part icm42688p --range 16,2000",
            "mimu accept --port /dev/ttyUSB0 --port /dev/ttyUSB1 --text --limits limits.toml --for 10s --latitude 48.1 -o results",
            "mimu accept x-up.csv y-up.csv z-up.csv --faces --limits limits.toml --json unit.json",
            "mimu accept --port /dev/ttyACM0 --limits limits.toml --golden golden.json --latitude 48.1",
        ],
    ),
    ("completions", &["mimu completions bash"]),
    ("man", &["mimu man -o man1"]),
];

/// Export formats that store noise; the others do not list the option.
const WITH_NOISE: [&str; 6] = [
    "kalibr", "openvins", "vins", "orbslam3", "liosam", "fastlio",
];

/// Hides `--noise` from the formats of `mimu export` that do not store noise.
fn formats(mut export: clap::Command) -> clap::Command {
    let names: Vec<String> = export
        .get_subcommands()
        .map(|c| c.get_name().to_owned())
        .collect();
    for name in names.iter().filter(|n| !WITH_NOISE.contains(&n.as_str())) {
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
    let mut command = Cli::command().mut_subcommand("export", formats);
    for (name, lines) in EXAMPLES {
        // A build without ports has fewer commands.
        if command.find_subcommand(name).is_none() {
            continue;
        }
        let text = format!("Examples:\n  {}", lines.join("\n  "));
        command = command.mut_subcommand(name, |c| c.after_help(text));
    }
    command
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
            let listed = WITH_NOISE.contains(&format.get_name());
            assert_eq!(noise.is_hide_set(), !listed, "{}", format.get_name());
        }
        let of = |line: &str| {
            command
                .clone()
                .try_get_matches_from(line.split(' '))
                .map(|_| ())
        };
        of("mimu export kalibr --noise noise.toml -o imu.yaml").unwrap();
        of("mimu export px4 --calibration cal.toml -o unit.params").unwrap();
    }

    #[test]
    fn every_subcommand_has_examples_that_it_takes() {
        let command = command();
        for subcommand in command.get_subcommands() {
            let name = subcommand.get_name();
            let found = EXAMPLES.iter().find(|(n, _)| *n == name);
            let (_, lines) = found.unwrap_or_else(|| panic!("mimu {name} has no example"));
            for line in *lines {
                let parsed = command.clone().try_get_matches_from(line.split(' '));
                assert!(parsed.is_ok(), "{line}: {}", parsed.unwrap_err());
            }
        }
    }
}
