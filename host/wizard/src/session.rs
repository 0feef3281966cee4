//! A whole session: warmed up, dwells, calibration, verification, store, diagnosis, and the same again with what was found.

use std::path::{Path, PathBuf};

use mimu::calibration::{Calibration, EffectTable};
use mimu::diagnose::{Recordings, diagnose};
use mimu::fit::{Fit, Options, fit};
use mimu::next_experiment;
use mimu::prepared::Prepared;
use mimu::result::diagnosis::DiagnosisResult;
use mimu_recording::error::Result;
use mimu_recording::result_file::stage;
use serde::Serialize;

use crate::drive::Driver;
use crate::event::{Event, Question, View};
use crate::folder::{Begun, Entry, Folder, Part};
use crate::one::One;
use crate::procedure::{Asked, verification};
use crate::source::Opener;
use crate::station::Station;
use crate::step::Step;
use crate::verdict::{Judged, judge, prepared};
use crate::wizard::{Ended, Wizard};

/// A unit to calibrate: how it is opened, and where its folder is.
pub struct Wanted {
    /// Opens it.
    pub opener: Opener,
    /// Its folder.
    pub folder: PathBuf,
}

/// Makes the page of a diagnosis.
pub type Page<'a> = &'a dyn Fn(&DiagnosisResult, &Path) -> Result<String>;

/// What a session has come to, unit by unit: the result of `mimu wizard`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    /// `mimu-wizard/1`.
    pub format: &'static str,
    /// This program and its version.
    pub tool: &'static str,
    /// Whether it was ended before its end; the session can go on.
    pub cancelled: bool,
    /// The units.
    pub units: Vec<UnitOutcome>,
}

/// What has become of a unit.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct UnitOutcome {
    /// Its name.
    pub unit: String,
    /// Its folder.
    pub folder: String,
    /// Dwells that the calibration was made from.
    pub dwells: usize,
    /// Dwells that were thrown away while they lasted.
    pub thrown: usize,
    /// Time of the recordings, s.
    pub recorded_s: f64,
    /// The affine calibration, in poses that were not used.
    pub verified: Option<Judged>,
    /// Verdict of the diagnosis.
    pub verdict: Option<&'static str>,
    /// Effects that were found.
    pub effects: Vec<String>,
    /// The calibration with the effects, in a third set of poses.
    pub confirmed: Option<Judged>,
    /// Calibration file that the device holds now, if one of this session is stored.
    pub stored: Option<String>,
    /// The page.
    pub page: Option<String>,
    /// Why nothing was stored, and what else a person should know.
    pub notes: Vec<String>,
}

/// Carries out a session. `asked` counts where it is begun; one that goes on keeps what it was begun with.
pub fn run(
    asked: Asked,
    wanted: Vec<Wanted>,
    driver: Box<dyn Driver + '_>,
    view: &mut dyn View,
    page: Page<'_>,
) -> Result<Outcome> {
    let mut units = Vec::new();
    let mut kept = asked;
    for Wanted { opener, folder } in wanted {
        let begun = Folder::begun(&folder)?;
        let (opened, station) = match &begun {
            Some(begun) => {
                kept = begun.asked.clone();
                let opened = Folder::open(&folder)?;
                let next = One::first_tick(&opened, begun.rate_hz);
                let station = Station::open(opener, next, Some(&begun.unit_id))?;
                let dwells = opened.dwells(Part::Calibration).len();
                view.tell(&Event::Resumed { dwells });
                (opened, station)
            }
            None => {
                let station = Station::open(opener, 0, None)?;
                let begun = Begun {
                    format: "mimu-wizard-session/1".into(),
                    unit_id: station.unit.id.clone(),
                    rate_hz: station.unit.rate_hz,
                    asked: kept.clone(),
                };
                (Folder::create(&folder, &begun)?, station)
            }
        };
        view.tell(&Event::Greeted {
            unit: station.unit.name.clone(),
            told: station.unit.told.clone(),
        });
        units.push(One::new(station, opened, &kept));
    }
    let count = units.len();
    let mut session = Whole {
        wizard: Wizard::new(kept, units, driver, view),
        outcomes: vec![UnitOutcome::default(); count],
        page,
    };
    let ended = session.carry_out();
    // Whatever happens, nothing goes on turning.
    let stopped = session.wizard.driver.stop();
    let ended = ended?;
    stopped?;
    let outcomes = session.outcomes();
    Ok(Outcome {
        format: "mimu-wizard/1",
        tool: concat!("mimu ", env!("CARGO_PKG_VERSION")),
        cancelled: ended == Ended::Cancelled,
        units: outcomes,
    })
}

struct Whole<'a> {
    wizard: Wizard<'a>,
    outcomes: Vec<UnitOutcome>,
    page: Page<'a>,
}

/// What the diagnosis of a unit has brought.
struct Found {
    calibration: Calibration,
    fit: Fit,
    effects: Vec<String>,
}

macro_rules! or_cancelled {
    ($ended:expr) => {
        if $ended? == Ended::Cancelled {
            return Ok(Ended::Cancelled);
        }
    };
}

impl Whole<'_> {
    fn carry_out(&mut self) -> Result<Ended> {
        let wizard = &mut self.wizard;
        let limit = wizard.asked.warm_c_per_min;
        let words = match limit {
            Some(limit) => format!(
                "until the temperature changes by less than {limit} °C/min; leave the unit still"
            ),
            None => "until it is known how quiet the unit can be; leave it still".into(),
        };
        wizard.begin_phase("warm-up", words);
        or_cancelled!(wizard.warm_up());
        or_cancelled!(wizard.look_at_devices());
        let steps = wizard.asked.steps.clone();
        wizard.begin_phase("calibration", format!("{} dwells are planned", steps.len()));
        or_cancelled!(wizard.dwells(Part::Calibration, &steps));
        self.finish()?;
        let mut fits = Vec::new();
        for unit in &self.wizard.units {
            let directory = unit.folder.file(Part::Calibration.name());
            fits.push(fit(prepared(&directory)?, Options::default())?);
        }
        if self.wizard.asked.by_device {
            for (k, fitted) in fits.iter_mut().enumerate() {
                self.take_from_device(k, fitted)?;
            }
        }
        let wizard = &mut self.wizard;
        let steps = wizard.asked.verification.clone();
        let words = format!("{} poses that were not used", steps.len());
        wizard.begin_phase("verification", words);
        or_cancelled!(wizard.dwells(Part::Verification, &steps));
        self.finish()?;
        self.wizard
            .begin_phase("store", "what was verified is stored".into());
        let mut judging = Vec::new();
        for (k, fitted) in fits.iter().enumerate() {
            let calibration = Calibration::of(fitted, &[], &now())?;
            let other = prepared(&self.file(k, Part::Verification.name()))?;
            let passed = self.judged(k, &other, &calibration, fitted, Part::Verification)?;
            judging.push(other);
            if passed {
                let place = self.write(k, "calibration.toml", &calibration)?;
                or_cancelled!(self.wizard.store(k, &calibration, &place));
                self.outcomes[k].stored = Some(place);
            }
        }
        self.wizard
            .begin_phase("diagnosis", "what still errs".into());
        let mut found = Vec::new();
        for (k, other) in judging.into_iter().enumerate() {
            found.push(self.diagnose(k, other)?);
        }
        if found.iter().all(Option::is_none) {
            self.wizard.journal(&Entry::Done)?;
            return Ok(Ended::Done);
        }
        self.with_effects(found)
    }

    /// Puts the estimate of the device's own filters in the place of the fit, if they have had all dwells.
    fn take_from_device(&mut self, k: usize, fitted: &mut Fit) -> Result<()> {
        let unit = &mut self.wizard.units[k];
        let name = unit.name();
        let before = unit.folder.entries().iter().rev().find_map(|e| match e {
            Entry::ByDevice(found) => Some(*found),
            _ => None,
        });
        let found = match (before, unit.banks.take()) {
            (Some(found), _) => Ok(found),
            (None, Some(mut banks)) => banks.end(&unit.station),
            (None, None) => Err("they were not run".into()),
        };
        let words = match found {
            Ok(found) => {
                if before.is_none() {
                    unit.folder.add(Entry::ByDevice(found))?;
                }
                found.replace(fitted, &name)?
            }
            Err(why) => format!(
                "the calibration is the PC's fit, as the device's filters have not had all dwells: {why}"
            ),
        };
        self.outcomes[k].notes.push(words.clone());
        let words = format!("{name}: {words}");
        self.wizard.tell(Event::Note { words });
        Ok(())
    }

    fn file(&self, k: usize, name: &str) -> PathBuf {
        self.wizard.units[k].folder.file(name)
    }

    fn write(&self, k: usize, name: &str, calibration: &Calibration) -> Result<String> {
        let path = self.file(k, name);
        stage(&path, calibration.to_toml())?.publish()?;
        Ok(path.display().to_string())
    }

    fn finish(&mut self) -> Result<()> {
        for unit in &mut self.wizard.units {
            if let Some(taking) = unit.taking.take() {
                taking.finish(&unit.folder)?;
            }
        }
        Ok(())
    }

    /// Judges a calibration by a recording, and tells; whether it may be stored.
    fn judged(
        &mut self,
        k: usize,
        by: &Prepared,
        calibration: &Calibration,
        fitted: &Fit,
        part: Part,
    ) -> Result<bool> {
        let judged = judge(by, calibration, Some(fitted))?;
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
        self.wizard.tell(Event::Verified { unit: name, judged });
        Ok(passed)
    }

    /// What still errs, and the calibration with it, if that is anything that can be stored.
    fn diagnose(&mut self, k: usize, other: Prepared) -> Result<Option<Found>> {
        let name = self.wizard.units[k].name();
        let first = prepared(&self.file(k, Part::Calibration.name()))?;
        let mut diagnosis = diagnose(
            Recordings {
                second: Some(other.clone()),
                ..Recordings::from(first)
            },
            Options {
                holdout_blocks: 0,
                ..Options::default()
            },
        )?;
        let accepted = diagnosis.sensors.iter().flat_map(|s| &s.decision.accepted);
        let tables: Vec<EffectTable> = accepted
            .filter(|a| a.of_unit)
            .map(EffectTable::from)
            .collect();
        let made = Calibration::of(&diagnosis.after, &tables, &now())?;
        let before = Calibration::of(&diagnosis.before, &[], &now())?;
        let both = (
            mimu::verify::verify(&other, &before),
            mimu::verify::verify(&other, &made),
        );
        let judged = match both {
            (Ok(before), Ok(after)) => Some([before, after]),
            (Err(refusal), _) | (_, Err(refusal)) => {
                diagnosis.after.warnings.push(refusal.to_string());
                None
            }
        };
        let next = next_experiment::next(&diagnosis);
        let judged = judged.as_ref().map(|both| ("verification", both));
        let result = DiagnosisResult::of(&diagnosis, &next, judged);
        let page = self.file(k, "diagnosis.html");
        let folder = self.wizard.units[k].folder.path.clone();
        stage(&page, (self.page)(&result, &folder)?)?.publish()?;
        let effects: Vec<String> = made.effects().iter().map(|e| e.candidate.id()).collect();
        let outcome = &mut self.outcomes[k];
        let verdict = diagnosis.verdict.name();
        outcome.verdict = Some(verdict);
        outcome.effects.clone_from(&effects);
        outcome.page = Some(page.display().to_string());
        self.wizard.tell(Event::Diagnosed {
            unit: name,
            verdict,
            effects: effects.clone(),
            page: page.display().to_string(),
        });
        Ok((!effects.is_empty()).then_some(Found {
            calibration: made,
            fit: diagnosis.after,
            effects,
        }))
    }

    /// The calibrations with effects: offered, judged in a third set of poses, and stored.
    fn with_effects(&mut self, found: Vec<Option<Found>>) -> Result<Ended> {
        let names: Vec<String> = found
            .iter()
            .flatten()
            .flat_map(|f| f.effects.clone())
            .collect();
        let question = Question::StoreEffects(names.join(", "));
        match self.wizard.ask(&question)? {
            None => return Ok(Ended::Cancelled),
            Some(false) => {
                self.wizard.journal(&Entry::Done)?;
                return Ok(Ended::Done);
            }
            Some(true) => {}
        }
        let asked = &self.wizard.asked;
        let used: Vec<Step> = asked
            .steps
            .iter()
            .chain(&asked.verification)
            .copied()
            .collect();
        let steps = verification(asked.fixture, &used, asked.dwell_s, asked.largest_rate_dps);
        let words = format!(
            "{} poses that were not used, for the calibration with {}",
            steps.len(),
            names.join(", ")
        );
        self.wizard.begin_phase("confirmation", words);
        or_cancelled!(self.wizard.dwells(Part::Confirmation, &steps));
        self.finish()?;
        for (k, found) in found.into_iter().enumerate() {
            let Some(found) = found else { continue };
            let by = prepared(&self.file(k, Part::Confirmation.name()))?;
            let passed = self.judged(k, &by, &found.calibration, &found.fit, Part::Confirmation)?;
            let better = self.outcomes[k]
                .confirmed
                .as_ref()
                .is_some_and(|judged| judged.sensors.iter().any(|s| s.after < s.affine));
            if passed && better {
                let place = self.write(k, "with-effects.toml", &found.calibration)?;
                or_cancelled!(self.wizard.store(k, &found.calibration, &place));
                self.outcomes[k].stored = Some(place);
            } else if passed {
                let note =
                    "the effects do no better in new poses: the calibration without them stays"
                        .into();
                self.outcomes[k].notes.push(note);
            }
        }
        self.wizard.journal(&Entry::Done)?;
        Ok(Ended::Done)
    }

    fn outcomes(&self) -> Vec<UnitOutcome> {
        let both = self.outcomes.iter().zip(&self.wizard.units);
        both.map(|(outcome, unit)| UnitOutcome {
            unit: unit.name(),
            folder: unit.folder.path.display().to_string(),
            dwells: unit.folder.dwells(Part::Calibration).len(),
            thrown: unit.folder.thrown(),
            recorded_s: unit.standing.samples as f64 / unit.station.unit.rate_hz,
            ..outcome.clone()
        })
        .collect()
    }
}

fn now() -> String {
    let now = jiff::Timestamp::now().round(jiff::Unit::Second);
    now.unwrap_or_default().to_string()
}
