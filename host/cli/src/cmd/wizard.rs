//! `mimu wizard`: arguments and execution.

#[cfg(not(target_family = "wasm"))]
mod terminal;

use std::path::{Path, PathBuf};
use std::sync::mpsc::Receiver;

use clap::{Args, ValueEnum};
use mimu::plan::Plan;
use mimu::prior::Prior;
use mimu::quantity::normal_gravity;
use mimu::readable::STANDARD_GRAVITY;
use mimu::result::diagnosis::DiagnosisResult;
use mimu_body::Options as BodyOptions;
use mimu_equipment::drive::{Person, TextDriver};
use mimu_equipment::step::Step;
use mimu_recording::error::{Error, Result};
use mimu_recording::{Manifest, RawUnit, Reference, ReferenceError};
use mimu_wizard::event::View;
use mimu_wizard::procedure::{Fixture, SessionConfig, faces, first_steps, verification};
use mimu_wizard::relay::{Stamped, relayed};
use mimu_wizard::session::{Outcome, UnitSpec, run as carry_out};
use mimu_wizard::text::Text;
use mimu_wizard::text_line::Columns;

use crate::arguments::{JsonArgs, degrees, known_gravity, number, targets, warned, whole_turns};
use crate::report::{self, Made};

#[cfg(not(target_family = "wasm"))]
pub(crate) use terminal::{each, run};

/// Alignment of the unit with a table if nothing is stated, degrees, half of a 95 % interval: a bracket with dowel pins.
const MOUNTING_DEG: f64 = 0.02;

#[derive(Args)]
pub(crate) struct WizardArgs {
    /// Folder of the session; an unfinished session is resumed
    #[arg(short, value_name = "DIR")]
    output: PathBuf,
    /// Serial port; repeat the option for several boards on one fixture [default: the only one at which a device greets]
    #[arg(long = "port", value_name = "PATH")]
    ports: Vec<String>,
    /// What carries the unit
    #[arg(long, value_enum, default_value = "hands")]
    fixture: FixtureArg,
    /// Driver file of a turntable; if repeated, all tables get the same commands [default: a person moves the unit]
    #[arg(long = "driver", value_name = "FILE")]
    drivers: Vec<PathBuf>,
    /// Local gravity, m/s² [default: normal gravity at sea level at --latitude]
    #[arg(long)]
    gravity: Option<f64>,
    /// Latitude, degrees
    #[arg(long, allow_negative_numbers = true)]
    latitude: Option<f64>,
    /// Size of the Earth's field at the place, µT, for a board with a magnetometer; without it the field counts as 1
    #[arg(long, value_name = "UT")]
    field: Option<f64>,
    #[command(flatten)]
    text: TextArgs,
    /// Length of a dwell, s
    #[arg(long, value_name = "S", default_value_t = 4.0, value_parser = |t: &str| number(t, 1.0, 600.0))]
    dwell: f64,
    /// Largest rate of the table, deg/s
    #[arg(long, value_name = "DPS", default_value_t = 100.0, value_parser = |t: &str| number(t, 1.0, 10000.0))]
    rate: f64,
    /// Rate of temperature change below which the unit counts as warmed up, °C/min; 0: do not wait
    #[arg(long, value_name = "C_PER_MIN", default_value_t = 0.5, value_parser = |t: &str| number(t, 0.0, 100.0))]
    warm_up: f64,
    /// Largest change of temperature since the first dwell, °C
    #[arg(long, value_name = "C", default_value_t = 5.0, value_parser = |t: &str| number(t, 0.1, 200.0))]
    drift: f64,
    /// Target for the half-width of a 95 % interval: gyro-bias=0.05 (deg/s), gyro-scale=2000 (ppm), gyro-angle=2000 (µrad), accel-bias=1
    /// (mg), accel-scale=1000, accel-angle=1000; may be repeated
    #[arg(long = "target", value_name = "NAME=VALUE")]
    targets: Vec<String>,
    /// Plan of `mimu design` for the first dwells [default: the wizard makes one]
    #[arg(long, value_name = "PLAN")]
    plan: Option<PathBuf>,
    /// Population of the units' kind (`mimu fleet --prior`), by hand only: the wizard begins with the six faces, and asks for more poses if the
    /// targets need them
    #[arg(long, value_name = "FILE")]
    prior: Option<PathBuf>,
    /// How well the unit's axes are aligned with the table's, degrees: 95 % of each angle; no dwell shows it, so the intervals include it [default:
    /// mounting_deg of the driver file's [reference_error], else 0.02]
    #[arg(long, value_name = "DEG", value_parser = |t: &str| number(t, 0.0, 10.0))]
    mounting: Option<f64>,
    #[command(flatten)]
    whole: SpinArgs,
    /// Make exactly the planned dwells, whatever the targets
    #[arg(long)]
    as_planned: bool,
    /// Largest number of dwells of the calibration
    #[arg(long, value_name = "N", default_value_t = 60)]
    most: usize,
    /// Without a person: longest wait for the conditions of a dwell, s
    #[arg(long, value_name = "S", default_value_t = 120.0, value_parser = |t: &str| number(t, 1.0, 1e5))]
    patience: f64,
    /// Seed of the random order of the planned dwells
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Answer all questions in advance: store effects that are found; store nothing beyond the limits; end at a failed self-test; do not
    /// unplug the board
    #[arg(long)]
    yes: bool,
    /// Write the events as JSON lines (`-`: to standard output)
    #[arg(long, value_name = "FILE")]
    events: Option<PathBuf>,
    #[command(flatten)]
    json: JsonArgs,
}

/// Options for whole turns.
#[derive(Args)]
struct SpinArgs {
    /// By hand: after the poses, whole turns about each axis, both ways, N of each (10); they give the gyro's scale factors. With a number, the
    /// recording states it
    #[arg(long = "whole-turns", value_name = "N", num_args = 0..=1, require_equals = true)]
    turns: Option<Option<u32>>,
    /// With --whole-turns: how well the unit is put back, degrees, half-width of the 95 % interval of its heading [default: 1]
    #[arg(long, value_name = "DEG", requires = "turns", value_parser = degrees)]
    placement: Option<f64>,
}

/// Options for a board of another maker, which writes its readings as lines of text.
#[derive(Args)]
pub(crate) struct TextArgs {
    /// The board writes lines of text. Names of the numbers of a line in their order: ax, ay, az, gx, gy, gz; mx, my, mz (a magnetometer);
    /// t_us, t_ms or t_s (the board's clock); temp_c; `-` for one that is not needed. MotionCal's `Raw:` is recognised
    #[arg(long, value_name = "NAMES", num_args = 0..=1, default_missing_value = "ax,ay,az,gx,gy,gz")]
    text: Option<String>,
    /// Bits per second of a board that writes lines of text
    #[arg(long, value_name = "N", default_value_t = 115_200, requires = "text")]
    baud: u32,
    /// Unit of its readings: count, V, or SI (rad/s and m/s²)
    #[arg(long, value_name = "UNIT", default_value = "count", requires = "text")]
    raw_unit: RawUnit,
    /// Name of the unit [default: its port]
    #[arg(long, value_name = "NAME", requires = "text")]
    device: Option<String>,
    /// Keep the times of the board's clock instead of converting them to this computer's: for a replay
    #[arg(long, requires = "text")]
    trust_clock: bool,
}

impl TextArgs {
    /// Columns and unit of a board that writes lines, if there is one.
    fn words(&self) -> Option<String> {
        let names = self.text.as_ref()?;
        Some(format!("{names} in {}", self.raw_unit))
    }

    /// The board at this port; `k` is its index if there are several.
    pub(crate) fn board(&self, names: &str, port: &str, k: Option<usize>) -> Result<Text> {
        let numbered = |name: &String| k.map_or_else(|| name.clone(), |k| format!("{name}-{k}"));
        Ok(Text {
            port: port.to_owned(),
            baud: self.baud,
            columns: Columns::parse(names)?,
            raw_unit: self.raw_unit,
            name: self.device.as_ref().map(numbered),
            clock_trusted: self.trust_clock,
        })
    }
}

/// Sample rate of the session in this folder, if one exists: a resumed session counts time with it.
fn begun_rate_hz(folder: &Path) -> Option<f64> {
    let begun = Manifest::read(&folder.join("calibration").join("recording.toml"));
    begun.ok().map(|m| m.sample_rate_hz)
}

#[derive(Clone, Copy, ValueEnum)]
enum FixtureArg {
    /// A turntable: attitudes and rates are known
    Table,
    /// A box with six faces; poses are faces, edges and corners
    Cube,
    /// Hands: any attitude
    Hands,
}

impl FixtureArg {
    fn fixture(self) -> Fixture {
        match self {
            Self::Table => Fixture::Table,
            Self::Cube => Fixture::Cube,
            Self::Hands => Fixture::Hands,
        }
    }
}

impl WizardArgs {
    /// What the tables do wrong by their driver files, the mounting of the unit included. `None` if no file says anything.
    fn reference_error(&self, fixture: Fixture) -> Result<Option<ReferenceError>> {
        let mut stated: Option<(&Path, ReferenceError)> = None;
        for path in &self.drivers {
            let Some(error) = TextDriver::reference_error(path)? else {
                continue;
            };
            if let Some((first, before)) = &stated
                && *before != error
            {
                return Err(Error::new(
                    path.display(),
                    format!(
                        "its [reference_error] differs from that of {}",
                        first.display()
                    ),
                    "make a session with each table, or state the larger errors in both files",
                ));
            }
            stated = Some((path, error));
        }
        let Some((path, mut error)) = stated else {
            return Ok(None);
        };
        if fixture != Fixture::Table {
            let problem = "[reference_error] is for fits with a table's inputs";
            let remedy = "use --fixture table, or remove the table from the file";
            return Err(Error::new(path.display(), problem, remedy));
        }
        let by_file = error.mounting_deg > 0.0;
        if let Some(mounting) = self.mounting.or((!by_file).then_some(MOUNTING_DEG)) {
            error.mounting_deg = mounting;
            // --mounting is half of a 95 % interval.
            error.rectangular.retain(|key| key != "mounting_deg");
        }
        Ok(Some(error))
    }

    /// The population of the units' kind, if it is given.
    fn prior(&self, fixture: Fixture, whole_turns: bool) -> Result<Option<Prior>> {
        let Some(path) = &self.prior else {
            return Ok(None);
        };
        let refuse = |problem: &str, remedy: &str| Err(Error::new(path.display(), problem, remedy));
        if fixture == Fixture::Table {
            let problem =
                "a prior is used where gravity is the only reference, and a table gives the inputs";
            return refuse(problem, "leave --prior out, or use --fixture hands or cube");
        }
        if whole_turns {
            let problem = "whole turns are fitted without a prior";
            return refuse(problem, "leave --prior or --whole-turns out");
        }
        let prior = Prior::read(path)?;
        if prior.reference != Reference::Gravity {
            let problem = format!(
                "it is of units with the reference \"{}\", and by hand it is gravity",
                prior.reference
            );
            return refuse(&problem, "make it from calibrations by hand");
        }
        if prior.words().is_empty() {
            return refuse(
                "it has neither [gyro] nor [accel]",
                "make it again: mimu fleet DIR --prior FILE",
            );
        }
        Ok(Some(prior))
    }

    fn config(&self) -> Result<SessionConfig> {
        let fixture = self.fixture.fixture();
        let whole_turns = whole_turns(self.whole.turns, self.whole.placement)?;
        if whole_turns.is_some() && (fixture == Fixture::Table || !self.drivers.is_empty()) {
            let problem = "whole turns are turned by hand, with gravity as the reference";
            let remedy = "leave --whole-turns out, or use --fixture hands or cube without a driver";
            return Err(Error::new("--whole-turns", problem, remedy));
        }
        let mut gravity = self.gravity.or(self.latitude.map(normal_gravity));
        let mut latitude_deg = self.latitude;
        let prior = self.prior(fixture, whole_turns.is_some())?;
        let steps = match &self.plan {
            None if prior.is_some() => faces(self.dwell),
            None => first_steps(fixture, self.dwell, self.rate, self.seed),
            Some(path) => {
                let plan = Plan::read(path)?;
                gravity = gravity.or(plan.gravity_mps2);
                latitude_deg = latitude_deg.or(plan.latitude_deg);
                planned(&plan, fixture, gravity.unwrap_or(STANDARD_GRAVITY), path)?
            }
        };
        let known = known_gravity(gravity, latitude_deg);
        let Some(gravity_mps2) = known.map(warned) else {
            let problem = "local gravity is unknown, and every scale factor of the accelerometer is proportional to it";
            return Err(Error::new(
                "wizard",
                problem,
                "give --gravity, or --latitude",
            ));
        };
        // Checked now, so that an invalid manifest is refused before anybody turns the unit.
        let mut manifest = Manifest::new(
            "unit",
            100.0,
            gravity_mps2,
            RawUnit::Count,
            fixture.reference(),
        );
        manifest.latitude_deg = latitude_deg;
        let reference_error = self.reference_error(fixture)?;
        manifest.reference_error = reference_error.clone();
        manifest.check("wizard")?;
        let field_ut = self.field;
        BodyOptions { field_ut }.check()?;
        Ok(SessionConfig {
            text: self.text.words(),
            fixture,
            gravity_mps2,
            latitude_deg,
            dwell_s: self.dwell,
            largest_rate_dps: self.rate,
            verification: verification(fixture, &steps, self.dwell, self.rate),
            steps,
            by_targets: !self.as_planned,
            most_dwells: self.most,
            patience_s: self.patience,
            warm_c_per_min: (self.warm_up > 0.0).then_some(self.warm_up),
            most_drift_c: self.drift,
            targets: targets(&self.targets)?,
            mounting_deg: match reference_error {
                Some(_) => 0.0,
                None => self.mounting.unwrap_or(MOUNTING_DEG),
            },
            reference_error,
            whole_turns,
            prior,
            field_ut,
        })
    }
}

/// The dwells of a plan.
fn planned(plan: &Plan, fixture: Fixture, gravity_mps2: f64, path: &Path) -> Result<Vec<Step>> {
    let place = path.display().to_string();
    let mut steps = Vec::new();
    for (k, dwell) in (1..).zip(plan.dwells(gravity_mps2, &place)?) {
        let Some(up) = dwell.up else {
            let at = format!("{place}, dwell {k}");
            let problem = "the plan gives no pose for a person: it leaves the choice to the bench";
            return Err(Error::new(
                at,
                problem,
                "write up = [x, y, z], or leave --plan out",
            ));
        };
        if dwell.turn.is_some() {
            let at = format!("{place}, dwell {k}");
            let problem = "it is a turn by an angle; the wizard makes dwells only";
            let remedy = "record it with `mimu record --plan` and --steps, or give another plan";
            return Err(Error::new(at, problem, remedy));
        }
        if dwell.rate_dps != 0.0 && fixture != Fixture::Table {
            let at = format!("{place}, dwell {k}");
            let problem = "it turns at a rate, which only a table can hold";
            return Err(Error::new(
                at,
                problem,
                "use --fixture table, or another plan",
            ));
        }
        steps.push(Step {
            up,
            rate_dps: dwell.rate_dps,
            dwell_s: dwell.length.as_secs_f64(),
        });
    }
    Ok(steps)
}

/// Writes the page of a session's diagnosis, with the command that was typed.
fn page(command_line: &str) -> impl Fn(&DiagnosisResult, &Path) -> Result<String> {
    |found, folder| {
        let made = Made::of(&[folder.join("calibration")], command_line);
        Ok(report::diagnosis_page(found, &made))
    }
}

/// Fails if a calibration was not stored.
fn check_stored(outcome: &Outcome, folder: &Path) -> Result<()> {
    let unstored = outcome.units.iter().filter(|u| u.stored.is_none());
    let failed: Vec<String> = unstored.flat_map(|u| u.notes.clone()).collect();
    match failed.is_empty() || outcome.cancelled {
        true => Ok(()),
        false => Err(Error::new(
            folder.display(),
            failed.join(", "),
            "read the page, correct the setup, and start a new session in another folder",
        )),
    }
}

/// A session by hand with one board that writes lines of text, at a port that the caller reads; `arrivals` receives the bytes. The caller drives it
/// with [`mimu_wizard::turn`], and gets its result and the reason if it failed.
pub(crate) fn session(
    args: &WizardArgs,
    command_line: String,
    arrivals: Receiver<Stamped>,
    mut view: Box<dyn View>,
) -> Result<impl Future<Output = Result<(Outcome, Result<()>)>> + use<>> {
    let of_a_terminal = [
        ("--driver", !args.drivers.is_empty()),
        ("--events", args.events.is_some()),
        ("--json", args.json.is_given()),
        ("--yes", args.yes),
    ];
    let by_hand = args.fixture.fixture() != Fixture::Table;
    let unfit = of_a_terminal.iter().find(|(_, given)| *given);
    let unfit = unfit.map(|(name, _)| *name);
    if let Some(name) = unfit.or((!by_hand).then_some("--fixture table")) {
        let problem = "a session in the page is led by hand, and the page shows it";
        let remedy = "leave it out, or use the command mimu wizard";
        return Err(Error::new(name, problem, remedy));
    }
    let (Some(names), [port]) = (&args.text.text, args.ports.as_slice()) else {
        let problem = "a session in the page has one board, which writes lines of text";
        return Err(Error::new("wizard", problem, "give --text and one --port"));
    };
    let board = args.text.board(names, port, None)?;
    let (config, folder) = (args.config()?, args.output.clone());
    let wanted = UnitSpec {
        connect: relayed(board, begun_rate_hz(&folder), arrivals),
        folder: folder.clone(),
    };
    Ok(async move {
        let page = page(&command_line);
        let driver = Box::new(Person);
        let outcome = carry_out(config, vec![wanted], driver, view.as_mut(), &page).await?;
        let stored = check_stored(&outcome, &folder);
        Ok((outcome, stored))
    })
}
