//! A whole session: warm-up, dwells, calibration, verification, storing, diagnosis, and the same again with the effects found.

use std::path::{Path, PathBuf};

use mimu::{Calibration, DiagnosisResult, Fit, Options, Prepared, Prior, Sensor, Verdict, fit};
use mimu_body::{Body, Options as BodyOptions};
use mimu_recording::result_file::stage;
use mimu_recording::{Argument, ClockRate, Error, Recording, Result};
use serde::Serialize;

use crate::axes;
use crate::event::{Event, Phase, Question, View};
use crate::folder::{Begun, Entry, Folder, Part};
use crate::procedure::{Fixture, SessionConfig};
use crate::refit::of_population;
use crate::resumed::resumed;
use crate::source::Unit;
use crate::station::Connect;
use crate::unit_session::UnitSession;
use crate::verdict::{Judged, judge, judge_further, prepared};
use crate::wizard::{Phased, Stop, Wizard};
use mimu_equipment::drive::Driver;

/// A unit to calibrate.
pub struct UnitSpec {
    /// Connects the session with the unit.
    pub connect: Connect,
    /// Folder of its session.
    pub folder: PathBuf,
}

/// Writes the page of a diagnosis.
pub type Page<'a> = &'a dyn Fn(&DiagnosisResult, &Path) -> Result<String>;

/// Result of `mimu wizard`, unit by unit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    /// `mimu-wizard/1`.
    pub format: &'static str,
    /// This program and its version.
    pub tool: &'static str,
    /// Whether it was ended early; the session can be resumed.
    pub cancelled: bool,
    /// Results of the units.
    pub units: Vec<UnitOutcome>,
}

/// Result of a unit.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct UnitOutcome {
    /// Name of the unit.
    pub unit: String,
    /// Its folder.
    pub folder: String,
    /// Dwells used for the calibration.
    pub dwells: usize,
    /// Dwells that were discarded while they ran.
    pub discarded: usize,
    /// Total time of the recordings, s.
    pub recorded_s: f64,
    /// The board's clock by this computer's, if the board writes its own.
    pub clock: Option<ClockRate>,
    /// The affine calibration judged by the verification.
    pub verified: Option<Judged>,
    /// Verdict of the diagnosis.
    pub verdict: Option<Verdict>,
    /// Ids of all effects that the diagnosis found, also of those that belong to the session and are not stored.
    #[serde(skip)]
    pub accepted: Vec<String>,
    /// Ids of the effects found.
    pub effects: Vec<String>,
    /// The calibration with effects, judged by a third set of poses.
    pub confirmed: Option<Judged>,
    /// Calibration file that the device stores now, if it belongs to this session.
    pub stored: Option<String>,
    /// File of the diagnosis page.
    pub page: Option<String>,
    /// Why nothing was stored, and other information for the user.
    pub notes: Vec<String>,
}

/// Carries out a session. A resumed session keeps its settings ([`resumed`]). The session pauses when it has to wait ([`crate::turn`]).
pub async fn run(
    config: SessionConfig,
    wanted: Vec<UnitSpec>,
    driver: Box<dyn Driver + '_>,
    view: &mut dyn View,
    page: Page<'_>,
) -> Result<Outcome> {
    let mut units = Vec::new();
    let mut kept = config;
    let finished = wanted.iter().map(|w| finished(&w.folder, &kept));
    if let Some(units) = finished.collect::<Result<Option<Vec<_>>>>()? {
        return Ok(Outcome::of(units, false));
    }
    for UnitSpec { connect, folder } in wanted {
        let begun = Folder::begun(&folder)?;
        let (opened, station) = match &begun {
            Some(begun) => {
                kept = resumed(&begun.config, &kept, &folder)?;
                let opened = Folder::open(&folder)?;
                let next = UnitSession::first_tick(&opened, begun.rate_hz);
                let station = connect(next, Some(begun.unit_id.clone())).await?;
                let dwells = opened.dwells(Part::Calibration).len();
                view.tell(&Event::Resumed { dwells });
                (opened, station)
            }
            None => {
                let station = connect(0, None).await?;
                read_alike(&station.unit, kept.prior.as_ref())?;
                let begun = Begun {
                    format: "mimu-wizard-session/1".into(),
                    unit_id: station.unit.id.clone(),
                    rate_hz: station.unit.rate_hz,
                    config: kept.clone(),
                };
                (Folder::create(&folder, &begun)?, station)
            }
        };
        view.tell(&Event::Greeted {
            unit: station.unit.name.clone(),
            told: station.unit.told.clone(),
        });
        units.push(UnitSession::new(station, opened, &kept));
    }
    let count = units.len();
    let mut session = OpenSession {
        wizard: Wizard::new(kept, units, driver, view),
        outcomes: vec![UnitOutcome::default(); count],
        page,
    };
    let ended = session.carry_out().await;
    // In every case, stop the table.
    let stopped = session.wizard.driver.stop();
    let cancelled = match ended {
        Err(Stop::Failed(error)) => return Err(error),
        Err(Stop::Cancelled) => true,
        Ok(()) => false,
    };
    stopped?;
    Ok(Outcome::of(session.outcomes(), cancelled))
}

/// Refuses a unit whose readings are in another unit than those of the prior.
fn read_alike(unit: &Unit, prior: Option<&Prior>) -> Result<()> {
    let Some(prior) = prior.filter(|p| p.raw_unit != unit.raw_unit) else {
        return Ok(());
    };
    let problem = format!(
        "its readings are in {}, and those of the prior in {}",
        unit.raw_unit, prior.raw_unit
    );
    let remedy = "use the prior of units that are read alike";
    Err(Error::new(&unit.name, problem, remedy).about(Argument::Prior))
}

/// Sensors that the dwells do not calibrate, with what the fit says of them.
fn not_calibrated(fitted: &Fit) -> Vec<String> {
    let missing = Sensor::BOTH
        .into_iter()
        .filter(|s| fitted.sensor(*s).is_none());
    let why: Vec<String> = fitted.warnings.iter().map(ToString::to_string).collect();
    let each = missing.map(|sensor| format!("{sensor} is not calibrated: {}", why.join("; ")));
    each.collect()
}

impl Outcome {
    fn of(units: Vec<UnitOutcome>, cancelled: bool) -> Self {
        Self {
            format: "mimu-wizard/1",
            tool: concat!("mimu ", env!("CARGO_PKG_VERSION")),
            cancelled,
            units,
        }
    }
}

/// Result of the session in a folder, if it is complete. Then there is nothing more to do.
fn finished(path: &Path, now: &SessionConfig) -> Result<Option<UnitOutcome>> {
    let Some(begun) = Folder::begun(path)? else {
        return Ok(None);
    };
    let folder = Folder::open(path)?;
    if !folder.is_done() {
        return Ok(None);
    }
    resumed(&begun.config, now, path)?;
    let existing = |name: &str| {
        Some(folder.file(name))
            .filter(|p| p.exists())
            .map(|p| p.display().to_string())
    };
    let found = folder.entries().iter().rev().find_map(|e| match e {
        Entry::Diagnosed { verdict, effects } => Some((*verdict, effects.clone())),
        _ => None,
    });
    let (verdict, effects) = found.unzip();
    Ok(Some(UnitOutcome {
        unit: begun.unit_id,
        folder: path.display().to_string(),
        dwells: folder.dwells(Part::Calibration).len(),
        discarded: folder.discarded(),
        verdict,
        effects: effects.unwrap_or_default(),
        stored: existing(WITH_EFFECTS).or(existing(PLAIN)),
        page: existing("diagnosis.html"),
        notes: vec!["the session is finished already, so nothing was done; for a new session name another folder".into()],
        ..UnitOutcome::default()
    }))
}

struct OpenSession<'a> {
    wizard: Wizard<'a>,
    outcomes: Vec<UnitOutcome>,
    page: Page<'a>,
}

/// The affine calibration of a unit.
struct AffineCalibration {
    calibration: Calibration,
    fitted: Fit,
    /// The verification recording.
    other: Prepared,
    /// Whether it may be stored, by the verification.
    passed: bool,
    /// Why the user has to agree before it is stored.
    rough: Option<String>,
}

/// Files of the calibrations.
const PLAIN: &str = "calibration.toml";
const WITH_EFFECTS: &str = "with-effects.toml";

/// Adds the misalignment on the table to the intervals: 95 % of each angle within `half_width_deg`.
fn add_mounting_uncertainty(fitted: &mut Fit, half_width_deg: f64) {
    for sensor in &mut fitted.sensors {
        let triad = sensor.estimated.triad.clone();
        sensor.estimated.triad = triad.mounted(half_width_deg.to_radians() / 1.96);
    }
}

mod effects;

impl OpenSession<'_> {
    async fn carry_out(&mut self) -> Phased<()> {
        self.warm_up().await?;
        let wizard = &mut self.wizard;
        let steps = wizard.config.steps.clone();
        let words = format!("{} dwells are planned", steps.len());
        wizard.begin_phase(Phase::Calibration, words);
        wizard.dwells(Part::Calibration, &steps).await?;
        if wizard.config.whole_turns.is_some() {
            let words = "about each axis, both ways; they give the gyro's scale factors";
            wizard.begin_phase(Phase::WholeTurns, words.into());
        }
        wizard.whole_turns(Part::Calibration).await?;
        self.finish()?;
        let fits = self.fits()?;
        let wizard = &mut self.wizard;
        let steps = wizard.config.verification.clone();
        let words = format!("{} poses that the fit has not used", steps.len());
        wizard.begin_phase(Phase::Verification, words);
        wizard.dwells(Part::Verification, &steps).await?;
        wizard.whole_turns(Part::Verification).await?;
        self.finish()?;
        self.wizard
            .begin_phase(Phase::Store, "storing the verified calibration".into());
        let mut plain = Vec::new();
        for (k, fitted) in fits.into_iter().enumerate() {
            let affine = self.affine_calibration(k, fitted)?;
            if affine.passed && affine.rough.is_none() {
                self.store(k, PLAIN, &affine.calibration).await?;
            }
            plain.push(affine);
        }
        self.wizard.begin_phase(
            Phase::Diagnosis,
            "looking for the cause of the remaining error".into(),
        );
        let mut found = Vec::new();
        for (k, plain) in plain.iter().enumerate() {
            found.push(self.diagnose(k, plain)?);
        }
        if found.iter().any(Option::is_some) {
            self.with_effects(&plain, found).await?;
        }
        self.store_rough(&plain).await?;
        self.wizard.journal(&Entry::Done)?;
        Ok(())
    }

    /// Waits until the units can be used, and shows what they are.
    async fn warm_up(&mut self) -> Phased<()> {
        let wizard = &mut self.wizard;
        let words = wizard.config.gravity_words();
        wizard.tell(Event::Note { words });
        let limit = wizard.config.warm_c_per_min;
        let words = match limit {
            Some(limit) => format!(
                "until the temperature changes by less than {limit} °C/min; leave the unit at rest"
            ),
            None => {
                "until the noise of the unit at rest is measured; leave the unit at rest".into()
            }
        };
        wizard.begin_phase(Phase::WarmUp, words);
        wizard.warm_up().await?;
        wizard.look_at_devices().await
    }

    /// The fit of each unit to its calibration dwells, or the estimate of its filters.
    fn fits(&mut self) -> Result<Vec<Fit>> {
        let mut fits = Vec::new();
        for (unit, outcome) in self.wizard.units.iter().zip(&mut self.outcomes) {
            let first = prepared(&unit.folder.file(Part::Calibration.name()))?;
            let first = of_population(first, self.wizard.config.prior.as_ref())?;
            let fitted = fit(first, Options::default())?;
            let given_up = fitted.warnings.iter().filter(|w| w.gives_prior_up());
            let given_up = given_up.map(ToString::to_string);
            for note in given_up.chain(not_calibrated(&fitted)) {
                let words = format!("{}: {note}", unit.name());
                self.wizard.view.tell(&Event::Note { words });
                outcome.notes.push(note);
            }
            if let Some(why) = axes::frames_apart(&fitted) {
                return Err(Error::device(unit.name(), why, axes::REMEDY));
            }
            fits.push(fitted);
        }
        if self.wizard.config.fixture == Fixture::Table {
            for fitted in &mut fits {
                add_mounting_uncertainty(fitted, self.wizard.config.mounting_deg);
            }
        }
        Ok(fits)
    }

    /// The further triads of unit `k`, whose gyro and accelerometer have this fit.
    fn further(&self, k: usize, fitted: &Fit) -> Result<Option<Body>> {
        let recording = Recording::open(&self.file(k, Part::Calibration.name()))?;
        let field_ut = self.wizard.config.field_ut;
        Body::of(&recording, fitted, &BodyOptions { field_ut })
    }

    /// The affine calibration of unit `k`, judged by its verification.
    fn affine_calibration(&mut self, k: usize, fitted: Fit) -> Result<AffineCalibration> {
        let created = self.wizard.units[k]
            .folder
            .created(Part::Verification, now)?;
        let mut calibration = Calibration::of(&fitted, &[], &created)?;
        let body = self.further(k, &fitted)?;
        let other = prepared(&self.file(k, Part::Verification.name()))?;
        let found = (&fitted, body.as_ref());
        let judged = self.judged(k, &other, &mut calibration, found, Part::Verification)?;
        calibration.judgement = Some(judged.judgement.clone());
        let passed = judged.passed();
        let rough = judged.rough().filter(|_| passed);
        if let Some(why) = &rough {
            let words = format!("{why}: the error is diagnosed before anything is stored");
            self.wizard.tell(Event::Note { words });
        }
        Ok(AffineCalibration {
            calibration,
            fitted,
            other,
            passed,
            rough,
        })
    }

    /// Stores rough calibrations where nothing else was stored, if the user agrees.
    async fn store_rough(&mut self, plain: &[AffineCalibration]) -> Phased<()> {
        for (k, plain) in plain.iter().enumerate() {
            let outcome = &self.outcomes[k];
            let Some(why) = plain.rough.as_ref().filter(|_| outcome.stored.is_none()) else {
                continue;
            };
            let why = match &outcome.accepted[..] {
                [] => why.clone(),
                found => format!("{why}; the diagnosis found {}", found.join(", ")),
            };
            match self.wizard.ask(&Question::StoreRough(why.clone())).await? {
                true => self.store(k, PLAIN, &plain.calibration).await?,
                false => self.outcomes[k].notes.push(format!("not stored: {why}")),
            }
        }
        Ok(())
    }

    /// Writes a calibration and stores it on unit `k`.
    async fn store(&mut self, k: usize, name: &str, calibration: &Calibration) -> Phased<()> {
        let path = self.file(k, name);
        stage(&path, calibration.to_toml())?.publish()?;
        let place = path.display().to_string();
        self.wizard.store(k, calibration, &place).await?;
        self.outcomes[k].stored = Some(place);
        Ok(())
    }

    fn file(&self, k: usize, name: &str) -> PathBuf {
        self.wizard.units[k].folder.file(name)
    }

    fn finish(&mut self) -> Result<()> {
        for unit in &mut self.wizard.units {
            if let Some(recording) = unit.recording.take() {
                recording.finish(&unit.folder)?;
            }
        }
        Ok(())
    }

    /// Judges a calibration by a recording, and reports the result. `body`: its further triads, which it gets as far as they may be stored.
    fn judged(
        &mut self,
        k: usize,
        by: &Prepared,
        calibration: &mut Calibration,
        (fitted, body): (&Fit, Option<&Body>),
        part: Part,
    ) -> Result<Judged> {
        let mut judged = judge(by, calibration, Some(fitted))?;
        if let Some(body) = body {
            calibration.body = body.tables(by.manifest.raw_unit);
            let recording = Recording::open(&self.file(k, part.name()))?;
            let dwells = &fitted.prepared.dwells.list;
            judged.further = judge_further(body, dwells, calibration, &recording)?;
        }
        let passed = judged.passed();
        let unit = &mut self.wizard.units[k];
        unit.folder.add(Entry::Verified { passed })?;
        let name = unit.name();
        let outcome = &mut self.outcomes[k];
        outcome
            .notes
            .extend(judged.broken.iter().map(|b| format!("not stored: {b}")));
        match part {
            Part::Confirmation => outcome.confirmed = Some(judged.clone()),
            _ => outcome.verified = Some(judged.clone()),
        }
        self.wizard.tell(Event::Verified {
            unit: name,
            judged: judged.clone(),
        });
        Ok(judged)
    }

    fn outcomes(&self) -> Vec<UnitOutcome> {
        let both = self.outcomes.iter().zip(&self.wizard.units);
        both.map(|(outcome, unit)| UnitOutcome {
            unit: unit.name(),
            folder: unit.folder.path.display().to_string(),
            dwells: unit.folder.dwells(Part::Calibration).len(),
            discarded: unit.folder.discarded(),
            recorded_s: unit.state.samples as f64 / unit.station.unit.rate_hz,
            clock: unit.clock,
            ..outcome.clone()
        })
        .collect()
    }
}

/// The present time, RFC 3339, in whole seconds.
pub fn now() -> String {
    let now = jiff::Timestamp::now().round(jiff::Unit::Second);
    now.unwrap_or_default().to_string()
}
