//! The command `mimu-board`.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::{Parser, Subcommand};
use mimu_board::front::Front;
use mimu_board::image::{Image, digital_release_image, release_image};
use mimu_board::inertial::with_digital_parts;
use mimu_board::running::Board;
use mimu_board::serve::{self, Served};
use mimu_rig::located::Source;
use mimu_rig::plan::{CarriedBy, Plan};
use mimu_rig::rig_file::{RigFile, RigTruth};

/// The emulated board: the firmware's image on an emulated NUCLEO-H743ZI2 with a virtual unit at its pins.
#[derive(Parser)]
#[command(version, arg_required_else_help = true, after_help = KEYS)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

/// References for further reading.
const KEYS: &str =
    "docs/bench has all keys of both files; rig/plans and rig/rigs have examples to copy.";

#[derive(Subcommand)]
enum Command {
    Serve(Serve),
}

/// Run the firmware on an emulated board and print the path of its serial port.
///
/// The place is that of the plan, or without a plan latitude 30.5° with gravity 9.793 m/s²; it is printed at the start. The port is a
/// pseudo-terminal in raw mode; its speed does not matter. The unit follows the plan from the power-on of the board, and keeps its last
/// state; with --control, commands move it. Runs until it is interrupted.
#[derive(clap::Args)]
#[command(after_help = KEYS)]
struct Serve {
    /// The board.
    #[arg(long, default_value = "nucleo")]
    board: BoardKind,
    /// Frequency of the crystal of a Matek over its nominal one: to it, the sensor's clock is off by the inverse.
    #[arg(long, value_name = "RATIO", default_value_t = 1.0, value_parser = crystal)]
    crystal: f64,
    /// Firmware, an ELF file [default: the board's release image in the target directory]
    #[arg(long, value_name = "ELF")]
    image: Option<PathBuf>,
    /// Parameters of the unit, the table and the person; all are optional.
    #[arg(long, value_name = "RIG.toml")]
    unit: Option<PathBuf>,
    /// Plan that the unit follows [default: it lies still]
    #[arg(long, value_name = "PLAN.toml")]
    plan: Option<PathBuf>,
    /// TCP address for commands that move the unit and disturb the line; 127.0.0.1:0 chooses a free port.
    ///
    /// It is printed after the port. From the plan come carrier, place, lead-in, chamber and the first pose; its entries are not carried
    /// out. There is no password: everyone who reaches the address can send commands.
    #[arg(long, value_name = "ADDRESS")]
    control: Option<String>,
    /// What moves the unit, with --control and without a plan [default: table]
    #[arg(long, requires = "control", conflicts_with = "plan")]
    carrier: Option<Carrier>,
    /// Symbolic link to the port; it follows when the line is unplugged and plugged in again.
    #[arg(long, value_name = "PATH")]
    link: Option<PathBuf>,
    /// Another seed is another unit, another person, and other noise.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// The part's unique number, 24 hexadecimal digits [default: the seed]
    #[arg(long, value_name = "HEX", value_parser = unit_id)]
    unit_id: Option<[u8; 12]>,
    /// Speed of virtual time.
    #[arg(long, default_value = "wall")]
    pace: Pace,
    /// File with the contents of the device's flash; created if it does not exist.
    #[arg(long, value_name = "FILE")]
    flash: Option<PathBuf>,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum Pace {
    /// Virtual time follows the wall clock. Bytes that nobody reads in time are lost, as on a real line.
    Wall,
    /// As fast as the machine and the reader of the port allow; without a reader, time stands still.
    Fast,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum BoardKind {
    /// NUCLEO-H743ZI2 with analog sensors.
    Nucleo,
    /// Matek H743 with an ICM-42688-P.
    Matek,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum Carrier {
    /// A turntable.
    Table,
    /// A person.
    Hands,
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

/// Parses 24 hexadecimal digits.
fn unit_id(text: &str) -> Result<[u8; 12], String> {
    let mut id = [0; 12];
    let refused = || format!("{text:?} is not a unit id: write 24 hexadecimal digits");
    if text.len() != 2 * id.len() || !text.is_ascii() {
        return Err(refused());
    }
    for (byte, at) in id.iter_mut().zip((0..).step_by(2)) {
        *byte = u8::from_str_radix(&text[at..at + 2], 16).map_err(|_| refused())?;
    }
    Ok(id)
}

/// Parses the ratio of a crystal.
fn crystal(text: &str) -> Result<f64, String> {
    let ratio = text.parse().ok().filter(|r| (0.9..=1.1).contains(r));
    ratio.ok_or_else(|| format!("{text:?} is not a ratio from 0.9 to 1.1"))
}

/// The seed as a unit id.
fn seeded(seed: u64) -> [u8; 12] {
    let mut id = [0; 12];
    id[4..].copy_from_slice(&seed.to_be_bytes());
    id
}

/// Interval between two warnings of lost bytes: a second can lose a thousand chunks.
const BETWEEN_WARNINGS: Duration = Duration::from_secs(1);

/// The unit at rest with z up, in a room.
const AT_REST: &str = include_str!("../../plans/rest.toml");

impl Serve {
    fn run(self) -> Result<(), String> {
        let mut plan = match &self.plan {
            Some(path) => Plan::read(path)?,
            None => Plan::parse(Source::new("rest.toml", AT_REST))?,
        };
        if let Some(carrier) = self.carrier {
            plan.carrier = match carrier {
                Carrier::Table => CarriedBy::Table,
                Carrier::Hands => CarriedBy::Hands,
            };
        }
        let rig = match &self.unit {
            Some(path) => RigFile::read(path)?,
            None => RigFile::default(),
        };
        let rig = match self.board {
            BoardKind::Nucleo => rig,
            BoardKind::Matek => with_digital_parts(rig),
        };
        let truth = RigTruth::resolve(&rig, self.seed)?;
        let unit_id = self.unit_id.unwrap_or_else(|| seeded(self.seed));
        let (seed, crystal, commands) = (self.seed, self.crystal, self.control.is_some());
        let board = match self.board {
            BoardKind::Nucleo => {
                let image = Image::read(&self.image.unwrap_or_else(release_image))?;
                let front = match commands {
                    true => Front::commanded(&plan, &truth, seed)?,
                    false => Front::bench(&plan, &truth, seed)?,
                };
                Board::numbered(&image, front, unit_id)?
            }
            BoardKind::Matek => {
                let image = Image::read(&self.image.unwrap_or_else(digital_release_image))?;
                let front = match commands {
                    true => Front::commanded_digital(&plan, &truth, seed, crystal)?,
                    false => Front::digital(&plan, &truth, seed, crystal)?,
                };
                Board::matek(&image, front, unit_id)?
            }
        };
        let pace = match self.pace {
            Pace::Wall => serve::Pace::Wall,
            Pace::Fast => serve::Pace::Fast,
        };
        let mut served = Served::new(board, pace, self.flash.as_deref())?;
        if let Some(link) = &self.link {
            served.link(link)?;
        }
        let control = match &self.control {
            Some(address) => Some(served.listen(address, self.seed)?),
            None => None,
        };
        served.start()?;
        // A host that calibrates with another gravity finds scale factors that are wrong by the ratio, and no reading shows this.
        eprintln!(
            "mimu-board: gravity here is {:.5} m/s², at latitude {}°: give the same to the host (--gravity, --latitude)",
            plan.place.gravity, plan.place.latitude_deg
        );
        println!("{}", served.path().display());
        if let Some(address) = control {
            println!("control: {address}");
            if let Some(plan) = &self.plan {
                eprintln!(
                    "mimu-board: {}: its entries are not carried out; the commands of the control move the unit",
                    plan.display()
                );
            }
        }
        let mut told = (served.traffic().lost, served.behind(), Instant::now());
        loop {
            served.step()?;
            let (lost, behind) = (served.traffic().lost, served.behind());
            if told.2.elapsed() < BETWEEN_WARNINGS {
                continue;
            }
            if lost != told.0 {
                eprintln!(
                    "mimu-board: {lost} bytes lost: the program at the port does not read them"
                );
            }
            if behind > told.1 + BETWEEN_WARNINGS / 10 {
                eprintln!(
                    "mimu-board: {:.1} s behind the clock: this machine is too slow, or busy",
                    behind.as_secs_f64()
                );
            }
            told = (lost, behind, Instant::now());
        }
    }
}
