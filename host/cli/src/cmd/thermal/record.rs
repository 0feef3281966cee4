//! `mimu thermal record`: arguments and execution.

use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

use clap::Args;
use indicatif::ProgressBar;
use mimu::plan::Plan;
use mimu_device::record::{Procedure, RecordOptions, Steps};
use mimu_equipment::carry_out::{Equipped, Progress, carry_out};
use mimu_equipment::drive::{Driver, TextDriver};
use mimu_recording::Growing;
use mimu_recording::error::Result;

use crate::arguments::JsonArgs;
use crate::cmd::device::{PortArgs, interruption, open};
use crate::cmd::record::RecordingArgs;
use crate::output::{check_outputs, print, progress};
use crate::report;

/// Interval of progress lines within a round, s, by the procedure's time.
const LINE_S: f64 = 60.0;

#[derive(Args)]
pub(super) struct RecordArgs {
    /// Plan of the procedure (`mimu thermal plan -o`)
    plan: PathBuf,
    /// Driver file of a table, a chamber, or both; may be repeated [default: a person warms the unit, which lies still]
    #[arg(long = "driver", value_name = "FILE")]
    drivers: Vec<PathBuf>,
    #[command(flatten)]
    port: PortArgs,
    /// Directory of the new recording
    #[arg(short, value_name = "DIR")]
    output: PathBuf,
    #[command(flatten)]
    of: RecordingArgs,
    #[command(flatten)]
    json: JsonArgs,
}

pub(super) fn run(args: &RecordArgs) -> Result<()> {
    let inputs: Vec<&Path> = std::iter::once(&args.plan)
        .chain(&args.drivers)
        .map(PathBuf::as_path)
        .collect();
    check_outputs(&[args.json.file()], &inputs)?;
    Growing::check(&args.output)?;
    let plan = Plan::read(&args.plan)?;
    let gravity_mps2 = args.of.gravity_mps2(Some(&plan));
    let place = args.plan.display().to_string();
    let procedure = Procedure::of(&plan, gravity_mps2, &place)?;
    let drivers = args
        .drivers
        .iter()
        .map(|path| -> Result<Box<dyn Driver>> { Ok(Box::new(TextDriver::open(path)?)) });
    let equipped = Equipped::new(&procedure, &place, drivers.collect::<Result<_>>()?)?;
    let options = RecordOptions {
        directory: args.output.clone(),
        duration: None,
        steps: Steps::marks_for(procedure.dwells.len()),
        reconnect: args.of.reconnect,
        one_power_on: true,
        table: equipped.has_table(),
        device: args.of.device(Some(&plan)),
        gravity_mps2,
        latitude_deg: args.of.latitude_deg(Some(&plan)),
        format: args.of.format,
    };
    let mut session = open(&args.port)?;
    begin(&procedure, &equipped);
    let stop = interruption()?;
    let mut lines = Lines::new(equipped.has_chamber());
    let bar = progress("writing the recording");
    let made = carry_out(
        &mut session,
        &options,
        &procedure,
        equipped,
        || stop.load(Ordering::Relaxed),
        |at| lines.show(at),
        |share| bar.reach(share),
    )?;
    lines.spinner.finish_and_clear();
    bar.finish();
    print(&args.json, &report::thermal_record_text(&made), &made, None)?;
    match made.cut_short.or(made.not_at_rest.into_iter().next()) {
        Some(error) => Err(error),
        None => Ok(()),
    }
}

/// Prints the instructions for the person.
fn begin(procedure: &Procedure, equipped: &Equipped) {
    let first = &procedure.dwells[0];
    if !equipped.has_table()
        && let Some(up) = first.up
    {
        let words = mimu_equipment::step::words(&up.into());
        eprintln!(
            "no driver moves a table: the unit lies still, {words}, and only gravity is known"
        );
    }
    if !equipped.has_chamber() {
        let [low, high] = procedure.range_c();
        eprintln!(
            "no driver sets a chamber: warm the unit from {low} to {high} °C as the lines below say"
        );
    }
}

/// Prints a line for each round and each minute. A terminal also shows the present state.
struct Lines {
    has_chamber: bool,
    spinner: ProgressBar,
    told: Option<(Option<usize>, f64, bool)>,
}

impl Lines {
    fn new(has_chamber: bool) -> Self {
        Self {
            has_chamber,
            spinner: ProgressBar::new_spinner(),
            told: None,
        }
    }

    fn show(&mut self, at: &Progress) {
        let line = report::thermal_progress(at, self.has_chamber);
        let round = at.since_s.map(|_| at.round[0]);
        let now_s = at.since_s.unwrap_or_default();
        let new = self.told.is_none_or(|(told, told_s, lost)| {
            told != round || now_s >= told_s + LINE_S || lost != at.line_lost
        });
        if new {
            self.told = Some((round, now_s, at.line_lost));
            self.spinner.suspend(|| eprintln!("{line}"));
        }
        self.spinner.set_message(format!("{line}; Ctrl-C ends it"));
        self.spinner.tick();
    }
}
