//! `mimu wizard` at a terminal: ports with their threads, driven tables, and keyboard.

use std::io::{IsTerminal as _, Write};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use mimu_equipment::drive::{Driver, Person, TextDriver, Together};
use mimu_recording::Parents;
use mimu_recording::error::{Error, Result};
use mimu_wizard::device::DeviceSource;
use mimu_wizard::session::{UnitSpec, run as carry_out};
use mimu_wizard::source::{Opener, Source};
use mimu_wizard::station::at_port;
use mimu_wizard::text_port::TextOpener;
use mimu_wizard::turn::complete;

use super::{TextArgs, WizardArgs, begun_rate_hz, check_stored};
use crate::cmd::device::interruption;
use crate::output::{check_outputs, print};
use crate::report;
use crate::views::answers::Typed;
use crate::views::lines::Lines;

impl TextArgs {
    /// Opens the board at this port, again at each call; without a port, the only one at which a device greets. `k` is its index if there are several,
    /// `rate_hz` the rate of its resumed session.
    pub(crate) fn opener(
        &self,
        port: Option<&String>,
        k: Option<usize>,
        rate_hz: Option<f64>,
    ) -> Result<Opener> {
        let Some(names) = &self.text else {
            let port = port.cloned();
            return Ok(Box::new(move |next| {
                let source = DeviceSource::open(port.as_deref(), next)?;
                Ok(Box::new(source) as Box<dyn Source>)
            }));
        };
        // A board that writes lines of text cannot be identified, so the user has to name its port.
        let Some(port) = port else {
            let mimu_device::Ports {
                of_boards, others, ..
            } = mimu_device::ports();
            let there = [of_boards, others].concat().join(", ");
            let problem =
                format!("the port that writes the lines is not given; there are: {there}");
            return Err(Error::new("--text", problem, "name it with --port"));
        };
        let mut opener = TextOpener::new(self.board(names, port, k)?, rate_hz);
        Ok(Box::new(move |next| {
            Ok(Box::new(opener.open(next)?) as Box<dyn Source>)
        }))
    }
}

/// The ports, or that of the only device.
pub(crate) fn each(ports: &[String]) -> Vec<Option<&String>> {
    match ports {
        [] => vec![None],
        ports => ports.iter().map(Some).collect(),
    }
}

impl WizardArgs {
    /// The units with their ports and folders.
    fn wanted(&self) -> Result<Vec<UnitSpec>> {
        let several = self.ports.len() > 1;
        let units = (1..).zip(each(&self.ports)).map(|(k, port)| {
            let folder = match several {
                true => self.output.join(format!("board-{k}")),
                false => self.output.clone(),
            };
            let number = several.then_some(k);
            let connect = at_port(self.text.opener(port, number, begun_rate_hz(&folder))?);
            Ok(UnitSpec { connect, folder })
        });
        units.collect()
    }
}

/// Longest time for a session to end after the request.
const ENDS: Duration = Duration::from_millis(900);
/// Longest time if the session drives a table, which it stops first.
const TABLE_STOPS: Duration = Duration::from_secs(15);

/// Ends the program if the session does not react to the request: it may wait for a silent port or a diagnosis for half a minute. All completed work
/// is on disk, and a device that is interrupted while storing keeps a complete calibration.
fn end_in_time(stop: Arc<AtomicBool>, ends: Duration) -> Result<()> {
    let watch = move || {
        while !stop.load(Ordering::Relaxed) {
            std::thread::sleep(ENDS / 20);
        }
        std::thread::sleep(ends);
        eprintln!("ended; the same command resumes here");
        std::process::exit(130);
    };
    let begun = std::thread::Builder::new().name("end".into()).spawn(watch);
    begun.map_err(|error| Error::new("wizard", error, "close other programs"))?;
    Ok(())
}

pub(crate) fn run(args: &WizardArgs, command_line: &str) -> Result<()> {
    check_outputs(&[args.json.file()], None::<&Path>)?;
    let config = args.config()?;
    let wanted = args.wanted()?;
    let driver: Box<dyn Driver> = match args.drivers.as_slice() {
        [] => Box::new(Person),
        [path] => Box::new(TextDriver::open(path)?),
        paths => {
            let each = paths
                .iter()
                .map(|path| -> Result<Box<dyn Driver>> { Ok(Box::new(TextDriver::open(path)?)) });
            Box::new(Together(each.collect::<Result<_>>()?))
        }
    };
    let to_output = args.events.as_deref() == Some(Path::new("-"));
    let events: Option<Box<dyn Write>> = match &args.events {
        Some(_) if to_output => Some(Box::new(std::io::stdout())),
        Some(path) => {
            let _parents = Parents::create(path)?;
            let file = std::fs::File::create(path).map_err(|e| Error::io(path, &e))?;
            Some(Box::new(file))
        }
        None => None,
    };
    let stop = interruption()?;
    let quiet = args.json.is_standard_output();
    let ends = match args.drivers.is_empty() {
        true => ENDS,
        false => TABLE_STOPS,
    };
    end_in_time(stop.clone(), ends)?;
    let mut lines = Lines::new(Typed::new(stop)?, args.yes);
    lines.sketches = driver.is_person() && std::io::stdout().is_terminal();
    lines.events = events;
    lines.text = match (to_output, quiet) {
        (true, _) => Some(Box::new(std::io::stderr())),
        (false, true) => None,
        (false, false) => Some(Box::new(std::io::stdout())),
    };
    let page = super::page(command_line);
    let outcome = complete(carry_out(config, wanted, driver, &mut lines, &page));
    drop(lines);
    let outcome = outcome?;
    print(&args.json, &report::wizard_text(&outcome), &outcome, None)?;
    check_stored(&outcome, &args.output)
}
