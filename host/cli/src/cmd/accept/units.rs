//! Where the samples of units come from: recordings, or boards at their ports.

use std::io::BufRead as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use mimu::quantity::{normal_gravity, plural};
use mimu_recording::units::STANDARD_GRAVITY;
use mimu_recording::{Error, Result, UNNAMED, are_two_units};
use mimu_station::boards::Boards;
use mimu_station::gather::{Samples, Take};
use mimu_wizard::source::Opener;

use super::{AcceptArgs, Source};
use crate::cmd::wizard::each;
use crate::output::progress;
use crate::reading::open;

/// Length of a measurement at a port, s.
const LENGTH_S: f64 = 10.0;
/// Time left out after a person has put the unit down, s. Lines are half a second on their way.
const HANDS_OFF_S: f64 = 1.0;
/// Standard uncertainty of gravity by latitude, m/s²: 300 m of height, or an anomaly of 100 mGal.
const BY_LATITUDE: f64 = 1e-3;
/// The same where nothing is said of the place: 9.780 to 9.832 m/s², all equally likely.
const ANYWHERE: [f64; 2] = [STANDARD_GRAVITY, 0.015];
/// Least share of the requested length that a recording has.
const LEAST_SHARE: f64 = 0.95;
/// Sides of a measurement with three sides up.
const FACES: usize = 3;

/// Takes the samples of a unit.
type Consume<'a> = dyn FnMut(&Source, Result<Vec<Samples>>) -> Result<()> + 'a;

impl AcceptArgs {
    /// Whether there are several units.
    pub(super) fn several(&self) -> bool {
        self.ports.len() > 1 || self.recordings.len() > if self.faces { FACES } else { 1 }
    }

    /// Local gravity with its standard uncertainty, if the person says anything of it.
    fn gravity(&self) -> Option<[f64; 2]> {
        let by_latitude = |at: f64| [normal_gravity(at), BY_LATITUDE];
        let given = self.log.options.gravity_mps2.map(|g| [g, 0.0]);
        given.or(self.log.options.latitude_deg.map(by_latitude))
    }

    /// Hands the samples of each unit to `consume`.
    ///
    /// # Errors
    /// Neither a recording nor a port is given, or not three recordings for each unit with three sides; those of `consume`.
    pub(super) fn for_each(
        &self,
        mut consume: impl FnMut(&Source, Result<Vec<Samples>>) -> Result<()>,
    ) -> Result<()> {
        if !self.recordings.is_empty() {
            return self.of_recordings(&mut consume);
        }
        self.of_ports(&mut consume)
    }

    /// Refuses names that are not as many as the units.
    fn check_names(&self, units: usize) -> Result<()> {
        if self.units.is_empty() || self.units.len() == units {
            return Ok(());
        }
        let problem = format!(
            "{} given, and {} measured",
            plural(self.units.len() as u64, "name"),
            plural(units as u64, "unit")
        );
        let remedy = "give one for each unit, in the order of the recordings or ports";
        Err(Error::new("--unit", problem, remedy))
    }

    fn of_recordings(&self, consume: &mut Consume) -> Result<()> {
        let each = if self.faces { FACES } else { 1 };
        if !self.recordings.len().is_multiple_of(each) {
            let problem = format!(
                "{} recordings are given, and a unit has three sides",
                self.recordings.len()
            );
            let remedy = "give three recordings of each unit, one after the other: with a side of x, of y and of z up";
            return Err(Error::new("--faces", problem, remedy));
        }
        self.check_names(self.recordings.len() / each)?;
        for (k, paths) in self.recordings.chunks(each).enumerate() {
            let samples: Result<Vec<Samples>> = paths.iter().map(|p| self.read(p)).collect();
            let places: Vec<String> = paths.iter().map(|p| p.display().to_string()).collect();
            let name = self.units.get(k).cloned();
            let source = Source { name, places };
            let samples = samples.and_then(|samples| one_unit(&source, samples));
            consume(&source, samples)?;
        }
        Ok(())
    }

    fn read(&self, path: &Path) -> Result<Samples> {
        let is_log = path.is_file();
        let recording = open(path, &self.log)?;
        let unknown = (is_log && self.gravity().is_none()).then_some(ANYWHERE);
        let seconds = self.length.map(|length| length.as_secs_f64());
        let gravity = self.gravity().or(unknown);
        let mut samples = Samples::of_recording(&recording, seconds, gravity)?;
        samples.place = path.display().to_string();
        let ends = samples.batch.t_s.first().zip(samples.batch.t_s.last());
        let lasts_s = ends.map_or(0.0, |(first, last)| last - first);
        if let Some(seconds) = seconds.filter(|s| lasts_s < LEAST_SHARE * s) {
            let problem = format!("it lasts {lasts_s:.1} s, and --for asks for {seconds} s");
            return Err(Error::undetermined(
                &samples.place,
                problem,
                "record for longer",
            ));
        }
        Ok(samples)
    }

    /// The ports with what opens them; without any, the only port at which a device greets.
    fn openers(&self) -> Result<Vec<(String, Opener)>> {
        let several = self.ports.len() > 1;
        let openers = (1..).zip(each(&self.ports)).map(|(k, port)| {
            let place = port.cloned().unwrap_or_else(|| "device".into());
            let opener = self.text.opener(port, several.then_some(k), None)?;
            Ok((place, opener))
        });
        openers.collect()
    }

    fn of_ports(&self, consume: &mut Consume) -> Result<()> {
        let openers = self.openers()?;
        let sources: Vec<Source> = openers
            .iter()
            .enumerate()
            .map(|(k, (place, _))| Source {
                name: self.units.get(k).cloned(),
                places: vec![place.clone()],
            })
            .collect();
        self.check_names(sources.len())?;
        let gravity = self.gravity().unwrap_or_else(|| {
            eprintln!("warning: the place is not given, so gravity may be 9.780 to 9.832 m/s²: give --gravity or --latitude");
            ANYWHERE
        });
        let seconds = self.length.map_or(LENGTH_S, |length| length.as_secs_f64());
        let mut boards = Boards::open(openers)?;
        let sides = if self.faces { FACES } else { 1 };
        let mut complete: Vec<Vec<Samples>> = sources.iter().map(|_| Vec::new()).collect();
        let mut failed = Ok(());
        for side in 0..sides {
            if self.faces {
                wait_for_side(side)?;
            }
            let skip_s = if self.faces { HANDS_OFF_S } else { 0.0 };
            let take = Take {
                seconds,
                skip_s,
                gravity,
            };
            let (bar, begun) = (progress("measuring"), Instant::now());
            boards.take(take, |answer| {
                let Some((k, samples)) = answer else {
                    return bar
                        .reach((begun.elapsed().as_secs_f64() / (skip_s + seconds)).min(1.0));
                };
                let samples = match samples {
                    Ok(samples) if complete[k].len() + 1 < sides => {
                        return complete[k].push(samples);
                    }
                    Ok(samples) => {
                        complete[k].push(samples);
                        one_unit(&sources[k], std::mem::take(&mut complete[k]))
                    }
                    Err(error) => Err(error),
                };
                if failed.is_ok() {
                    failed = consume(&sources[k], samples);
                }
            });
            bar.finish();
            if failed.is_err() {
                break;
            }
        }
        failed
    }
}

/// The samples under the name of their unit, if all are of one.
fn one_unit(source: &Source, mut samples: Vec<Samples>) -> Result<Vec<Samples>> {
    let first = samples[0].unit.clone();
    if let Some(other) = samples.iter().find(|s| are_two_units(&first, &s.unit)) {
        let problem = format!(
            "it is of the unit {}, and the first side is of {first}",
            other.unit
        );
        let remedy = "give three recordings of one unit";
        return Err(Error::new(&other.place, problem, remedy));
    }
    let name = match (&source.name, first.as_str()) {
        (Some(name), _) => name,
        (None, UNNAMED) => &source.places[0],
        (None, _) => &first,
    };
    samples.iter_mut().for_each(|s| s.unit.clone_from(name));
    Ok(samples)
}

/// Asks for a side, and waits for Enter.
fn wait_for_side(side: usize) -> Result<()> {
    match side {
        0 => eprintln!("put one side of every unit up, let go, and press Enter"),
        _ => eprintln!(
            "now put a side of another axis up, let go, and press Enter ({} of {FACES})",
            side + 1
        ),
    }
    let mut line = String::new();
    let read = std::io::stdin().lock().read_line(&mut line);
    match read {
        Ok(1..) => Ok(()),
        Ok(0) => Err(Error::new(
            "standard input",
            "it ended before all three sides were up",
            "run it at a terminal, or give three recordings",
        )),
        Err(error) => Err(Error::io(&PathBuf::from("standard input"), &error)),
    }
}
