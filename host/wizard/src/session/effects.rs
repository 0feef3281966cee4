//! Diagnoses the remaining errors, and offers, verifies and stores the calibration with effects.

use mimu::plan::next_experiment;
use mimu::{
    Calibration, DiagnosisResult, Fit, FittedEffect, Options, Recordings, Warning, diagnose,
};
use mimu_recording::result_file::stage;
use mimu_recording::{Reference, Result};

use super::{AffineCalibration, OpenSession, WITH_EFFECTS, add_mounting_uncertainty, now};
use crate::event::{Event, Phase, Question};
use crate::folder::{Entry, Part};
use crate::procedure::verification;
use crate::refit::of_population;
use crate::verdict::{judge, prepared};
use crate::wizard::Phased;
use mimu_equipment::step::Step;

/// Calibration with effects from the diagnosis of a unit.
pub(super) struct CalibrationWithEffects {
    calibration: Calibration,
    fitted: Fit,
    effects: Vec<String>,
}

impl OpenSession<'_> {
    /// Diagnoses the remaining errors. Returns the calibration with effects if it can be stored.
    pub(super) fn diagnose(
        &mut self,
        k: usize,
        plain: &AffineCalibration,
    ) -> Result<Option<CalibrationWithEffects>> {
        let other = &plain.other;
        let name = self.wizard.units[k].name();
        let first = prepared(&self.file(k, Part::Calibration.name()))?;
        let first = of_population(first, self.wizard.config.prior.as_ref())?;
        let diagnosed = diagnose(
            Recordings {
                second: Some(other.clone()),
                ..Recordings::from(first)
            },
            Options::IN_SAMPLE,
        );
        // The stored calibration is verified already. A recording that cannot be diagnosed does not invalidate it.
        let mut diagnosis = match diagnosed {
            Ok(diagnosis) => diagnosis,
            Err(why) => {
                let words = format!("not diagnosed: {why}");
                self.outcomes[k].notes.push(words.clone());
                self.wizard.tell(Event::Note { words });
                return Ok(None);
            }
        };
        let accepted = diagnosis.sensors.iter().flat_map(|s| &s.decision.accepted);
        let of_unit = accepted.filter(|a| a.of_unit);
        let found: Vec<FittedEffect> = of_unit.map(|a| a.effect.clone()).collect();
        // A sensor without effects keeps the earlier fit, which may be the estimate of the device's filters.
        let mut fitted = diagnosis.after.clone();
        if other.manifest.reference == Reference::Table {
            add_mounting_uncertainty(&mut fitted, self.wizard.config.mounting_deg);
            for sensor in &mut fitted.sensors {
                let is = |e: &FittedEffect| e.sensor() == sensor.sensor;
                if let (false, Some(plain)) =
                    (found.iter().any(is), plain.fitted.sensor(sensor.sensor))
                {
                    *sensor = plain.clone();
                }
            }
        }
        let created = self.wizard.units[k]
            .folder
            .created(Part::Confirmation, now)?;
        let mut made = Calibration::of(&fitted, &found, &created)?;
        let both = (
            mimu::calibration::verify::verify(other, &plain.calibration),
            mimu::calibration::verify::verify(other, &made),
        );
        let judged = match both {
            (Ok(before), Ok(after)) => Some([before, after]),
            (Err(refusal), _) | (_, Err(refusal)) => {
                let warning = Warning::NotJudged {
                    recording: None,
                    why: refusal,
                };
                diagnosis.after.warnings.push(warning);
                None
            }
        };
        let next = next_experiment::next(&diagnosis);
        let judged = judged.as_ref().map(|both| ("verification", both));
        let result = DiagnosisResult::of(&diagnosis, &next, judged);
        made.judgement = Some(result.judgement.clone());
        let page = self.file(k, "diagnosis.html");
        let folder = self.wizard.units[k].folder.path.clone();
        stage(&page, (self.page)(&result, &folder)?)?.publish()?;
        let effects: Vec<String> = made.effects().iter().map(|e| e.candidate.id()).collect();
        let accepted = diagnosis.sensors.iter().flat_map(|s| &s.decision.accepted);
        let accepted = accepted.map(|a| a.effect.candidate.id()).collect();
        let outcome = &mut self.outcomes[k];
        outcome.accepted = accepted;
        let verdict = diagnosis.verdict;
        outcome.verdict = Some(verdict);
        outcome.effects.clone_from(&effects);
        outcome.page = Some(page.display().to_string());
        let diagnosed = Entry::Diagnosed {
            verdict,
            effects: effects.clone(),
        };
        self.wizard.units[k].folder.add(diagnosed)?;
        self.wizard.tell(Event::Diagnosed {
            unit: name,
            verdict,
            effects: effects.clone(),
            page: page.display().to_string(),
        });
        Ok((!effects.is_empty()).then_some(CalibrationWithEffects {
            calibration: made,
            fitted,
            effects,
        }))
    }

    /// Offers the calibrations with effects, verifies them with a third set of poses, and stores them.
    pub(super) async fn with_effects(
        &mut self,
        plain: &[AffineCalibration],
        found: Vec<Option<CalibrationWithEffects>>,
    ) -> Phased<()> {
        let names: Vec<String> = found
            .iter()
            .flatten()
            .flat_map(|f| f.effects.clone())
            .collect();
        let question = Question::StoreEffects(names.join(", "));
        if !self.wizard.ask(&question).await? {
            return Ok(());
        }
        let config = &self.wizard.config;
        let used: Vec<Step> = config
            .steps
            .iter()
            .chain(&config.verification)
            .copied()
            .collect();
        let steps = verification(
            config.fixture,
            &used,
            config.dwell_s,
            config.largest_rate_dps,
        );
        let words = format!(
            "{} poses that the fit has not used, for the calibration with {}",
            steps.len(),
            names.join(", ")
        );
        self.wizard.begin_phase(Phase::Confirmation, words);
        self.wizard.dwells(Part::Confirmation, &steps).await?;
        self.finish()?;
        for ((k, found), plain) in (0..).zip(found).zip(plain) {
            let Some(mut found) = found else { continue };
            let by = prepared(&self.file(k, Part::Confirmation.name()))?;
            let body = self.further(k, &found.fitted)?;
            let of = (&found.fitted, body.as_ref());
            let judged = self.judged(k, &by, &mut found.calibration, of, Part::Confirmation)?;
            found.calibration.judgement = Some(judged.judgement.clone());
            if !judged.passed() {
                continue;
            }
            let [with, without] =
                [&found.calibration, &plain.calibration].map(|c| judge(&by, c, None));
            if !with?.beats(&without?) {
                let note =
                    "the effects do not improve all sensors in new poses, so they are not stored";
                self.outcomes[k].notes.push(note.into());
                continue;
            }
            if let Some(why) = judged.rough()
                && !self.wizard.ask(&Question::StoreRough(why.clone())).await?
            {
                self.outcomes[k].notes.push(format!("not stored: {why}"));
                continue;
            }
            self.store(k, WITH_EFFECTS, &found.calibration).await?;
        }
        Ok(())
    }
}
