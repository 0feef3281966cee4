//! Stores a calibration on the device, reads it back, and checks that it survives a power cycle and that the device computes as the PC does.

use std::time::{Duration, Instant};

use mimu::calibration::Calibration;
use mimu_core::wire::Capabilities;
use mimu_device::{Image, Session, Started, Verdict, check, download, look, self_test, upload};
use mimu_recording::error::{Error, Result};

use crate::event::{Event, Question};
use crate::folder::Entry;
use crate::turn::rest;
use crate::wizard::{Phased, Wizard};

/// Longest wait for a device to return after a power cycle.
const BACK: Duration = Duration::from_secs(60);
/// Interval of the attempts meanwhile.
const AGAIN: Duration = Duration::from_millis(200);
/// Length of the comparison between the device's and the PC's compensation.
const COMPARED: Duration = Duration::from_secs(1);
/// Length of the raw stream that gives the number of samples since the start.
const GLANCE: Duration = Duration::from_millis(50);

/// Time since the device's power-on, s; `None` if its last start had another cause, or if it does not know.
fn powered(session: &mut Session) -> Result<Option<f64>> {
    let who = session.hello()?;
    let before_ms = who.powered_for_ms.filter(|_| who.start == Started::PowerOn);
    let rate_hz = who.sample_rate_hz;
    let seen = look(session, GLANCE)?;
    let samples = f64::from(seen.first.unwrap_or(0));
    Ok(before_ms.map(|ms| f64::from(ms) / 1000.0 + samples / rate_hz))
}

impl Wizard<'_> {
    /// Runs the self-tests, and saves the calibrations that the devices store.
    pub async fn look_at_devices(&mut self) -> Phased<()> {
        for k in 0..self.units.len() {
            let unit = &self.units[k];
            let name = unit.name();
            if !unit.station.unit.is_device {
                continue;
            }
            let copy = unit.folder.file("held-before.bin");
            if !copy.exists() {
                let held = unit.station.with(|session| {
                    let holds = session.hello()?.stored.is_some();
                    holds.then(|| download(session)).transpose()
                })?;
                if let Some(bytes) = held {
                    mimu_recording::result_file::stage(&copy, bytes.as_slice())?.publish()?;
                }
            }
            // A resumed session has run its self-test already.
            if unit
                .folder
                .entries()
                .iter()
                .any(|e| matches!(e, Entry::Dwell { .. }))
            {
                continue;
            }
            let tested = unit.station.with(|session| {
                let able = session.who().capabilities.contains(Capabilities::SELF_TEST);
                able.then(|| self_test(session)).transpose()
            })?;
            let Some(tested) = tested else { continue };
            let failed = tested.named(Verdict::Failed);
            let words = match (failed.is_empty(), &tested.moved) {
                (true, None) => "all sensors respond as in their data sheets".to_string(),
                (true, Some(moved)) => {
                    format!("all sensors respond as in their data sheets, but {moved}")
                }
                (false, None) => format!("not as in the data sheets: {}", failed.join(", ")),
                (false, Some(moved)) => {
                    format!("{} failed; the unit moved: {moved}", failed.join(", "))
                }
            };
            let passed = failed.is_empty();
            let question = Question::GoOn(format!("{name}: the self-test failed, {words}"));
            self.tell(Event::SelfTested {
                unit: name.clone(),
                passed,
                words: words.clone(),
            });
            if !passed && !self.ask(&question).await? {
                let problem = format!("the self-test failed: {words}");
                let remedy = "check the wiring of the sensors, keep the unit still, and run the same command";
                return Err(Error::device(name, problem, remedy).into());
            }
        }
        Ok(())
    }

    /// Stores a calibration on unit `k`, reads it back, power-cycles the unit, and compares the device's compensation with the PC's on the same
    /// readings. `place` is the file.
    pub async fn store(&mut self, k: usize, calibration: &Calibration, place: &str) -> Phased<()> {
        let unit = &self.units[k];
        let name = unit.name();
        if !unit.station.unit.is_device {
            return Ok(());
        }
        let (given, file) = (calibration.clone(), place.to_owned());
        let (hash, effects) = unit.station.with(move |session| {
            let image = Image::new(&given, &file)?;
            image.check_device(&given, session.who(), &file)?;
            let done = upload(session, &image, false, |_| {})?;
            Ok((done.hash.0, done.effects))
        })?;
        let shown = format!("{hash:016x}");
        self.units[k].folder.add(Entry::Stored {
            hash: shown.clone(),
            effects,
        })?;
        let kept = loop {
            let on_s = self.units[k].station.with(powered)?;
            let since = Instant::now();
            let driven = self.driver.power_cycle()?;
            let cycled = driven || self.ask(&Question::PowerCycled).await?;
            self.wait_for(k, hash).await?;
            if !cycled {
                break "not tested with a power cycle".to_string();
            }
            let now_s = self.units[k].station.with(powered)?;
            match (now_s, driven) {
                // It has had power for a shorter time than before, or than since the question.
                (Some(now_s), _)
                    if on_s.is_none_or(|on_s| now_s < on_s)
                        || now_s < since.elapsed().as_secs_f64() =>
                {
                    break format!("survived a power cycle (switched on {now_s:.1} s before)");
                }
                (_, true) => {
                    break "not proven to survive a power cycle: the driver switched the supply off and on, but the device reports no power-on since".into();
                }
                (_, false) => {
                    let words = format!(
                        "{name}: it has not been without power since the question; perhaps a second supply keeps it on"
                    );
                    self.tell(Event::Note { words });
                }
            }
        };
        let (given, file) = (calibration.clone(), place.to_owned());
        let unit = &self.units[k];
        let checked = unit
            .station
            .with(move |session| check(session, &given, &file, COMPARED, |_| {}))?;
        if !checked.holds && checked.not_judged_for.is_empty() {
            let problem = "the device's compensation differs from the PC's by more than rounding";
            let remedy = "update device and program to the same version";
            return Err(Error::device(name, problem, remedy).into());
        }
        self.tell(Event::Stored {
            unit: name,
            hash: shown,
            words: format!("stored, read back, {kept}; device and PC compute the same"),
        });
        Ok(())
    }

    /// Waits until unit `k` reports this calibration in its greeting.
    async fn wait_for(&mut self, k: usize, hash: u64) -> Phased<()> {
        let since = Instant::now();
        loop {
            let held = self.units[k]
                .station
                .with(|session| Ok(session.hello()?.stored_hash()));
            match held {
                Ok(Some(found)) if found.0 == hash => return Ok(()),
                Ok(_) => {
                    let name = self.units[k].name();
                    let problem = "the device lost the calibration when its supply was off";
                    let remedy = "store it again; if that fails too, its flash is worn out";
                    return Err(Error::device(name, problem, remedy).into());
                }
                Err(error) if since.elapsed() > BACK => return Err(error.into()),
                Err(_) => rest(AGAIN).await,
            }
        }
    }
}
