//! The golden unit of a station: options, and what they decide.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use mimu::quantity::{plural, significant};
use mimu_recording::error::{Error, Result};
use mimu_station::golden::{FEWEST, Golden};
use mimu_station::measured::Measured;

use crate::cmd::device::duration;

/// Options about the golden unit.
#[derive(Args)]
pub(super) struct GoldenArgs {
    /// History of the golden unit, by its name: its measurement is compared with the history and added to it; other units are measured only if the golden
    /// unit agreed within the time of a shift
    #[arg(long = "golden", value_name = "FILE.json")]
    file: Option<PathBuf>,
    /// Begin the history with the unit that is measured
    #[arg(long, requires = "file")]
    new_golden: bool,
    /// With --golden: how long a check holds
    #[arg(long, value_name = "TIME", default_value = "12h", value_parser = duration, requires = "file")]
    shift: Duration,
}

impl GoldenArgs {
    /// Before anything is measured: refuses a history that cannot be read, and one that would be replaced.
    pub(super) fn check(&self) -> Result<()> {
        let Some(path) = &self.file else {
            return Ok(());
        };
        match (path.exists(), self.new_golden) {
            (true, false) => Golden::read(path).map(|_| ()),
            (false, true) => Ok(()),
            (true, true) => Err(Error::new(
                path.display(),
                "the history exists already",
                "leave --new-golden out, or name another file",
            )),
            (false, false) => Err(Error::new(
                path.display(),
                "there is no history of a golden unit",
                "measure the golden unit with --new-golden",
            )),
        }
    }

    /// Refuses a unit other than the golden one if the golden unit has not agreed within a shift before `time`.
    pub(super) fn check_shift(&self, unit: &str, time: &str) -> Result<()> {
        let Some(path) = self.file.as_ref().filter(|_| !self.new_golden) else {
            return Ok(());
        };
        let golden = Golden::read(path)?;
        if golden.unit == unit {
            return Ok(());
        }
        let refuse = |problem: String| {
            let remedy = format!(
                "measure the golden unit {} at this station first",
                golden.unit
            );
            Err(Error::undetermined(path.display(), problem, remedy))
        };
        let Some(last) = golden.sessions.last() else {
            return refuse("the golden unit was never measured".into());
        };
        if !last.agrees {
            return refuse(format!(
                "the golden unit had moved at {}: the station, or that unit, has changed",
                last.time
            ));
        }
        let parse = |text: &str| {
            text.parse::<jiff::Timestamp>()
                .map_err(|e| Error::new(path.display(), e, "correct the time of its last session"))
        };
        let age_s = (parse(time)? - parse(&last.time)?).total(jiff::Unit::Second);
        let age_s = age_s.unwrap_or(f64::INFINITY);
        match age_s <= self.shift.as_secs_f64() {
            true => Ok(()),
            false => refuse(format!(
                "the golden unit was last measured {} h ago, and a check holds for {} h",
                significant(age_s / 3600.0),
                significant(self.shift.as_secs_f64() / 3600.0)
            )),
        }
    }

    /// Compares the golden unit with its history, and adds the session.
    ///
    /// # Errors
    /// It has moved; the file cannot be written.
    pub(super) fn compare(&self, unit: &str, time: &str, today: &[Measured]) -> Result<()> {
        let Some(path) = &self.file else {
            return Ok(());
        };
        // Several recordings of the golden unit may begin its history together.
        let mut golden = match self.new_golden && !path.exists() {
            true => Golden::new(unit),
            false => Golden::read(path)?,
        };
        if golden.unit != unit {
            return Ok(());
        }
        let moved = golden.moved(today);
        golden.add(time, moved.as_ref().is_none_or(Vec::is_empty), today);
        golden.write(path)?;
        let sessions = plural(golden.sessions.len() as u64, "session");
        match moved.as_deref() {
            None => eprintln!(
                "golden unit {unit}: {sessions}; from {FEWEST} on another one can be judged"
            ),
            Some([]) => eprintln!("golden unit {unit}: agrees with its history of {sessions}"),
            Some([first, others @ ..]) => {
                let more = match others.len() {
                    0 => String::new(),
                    n => format!(", and {} more", plural(n as u64, "value")),
                };
                return Err(Error::undetermined(
                    path.display(),
                    format!(
                        "the golden unit moved: {} by {} {}, and its history allows {}{more}",
                        first.name,
                        significant(first.by),
                        first.unit,
                        significant(first.allowed)
                    ),
                    "check fixture, supply and temperature, and measure the golden unit again before any other unit",
                ));
            }
        }
        Ok(())
    }
}
