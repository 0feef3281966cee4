//! The passes over the rows of a sensor: first with the affine model of the readings as recorded, then with the one beside the effects that
//! were found.
//!
//! A strong effect distorts the affine model that its own columns are made with. Consider an accelerometer quadratic of 5 % at 1 g, on a table
//! that shows some attitudes more often than their opposites: the affine model alone errs by 1 % of scale and 0.3 degrees, and the quadratic
//! came out 1 % too small with `accel_cross_axis_product` beside it. By hand, products of two axes can change the magnitude of gravity like a
//! quadratic, and took its place: of three units one was diagnosed wrongly, and two were refused.

use std::cell::Cell;

use mimu_core::compensation::Affine;
use nalgebra::Matrix3;

use super::as_written::AsWritten;
use super::decision::{Decision, decide, noisier};
use super::rejected::{Reason, Rejected};
use super::rows::{ForceErrors, Rows, Session};
use super::{Calibrator, Heard};
use crate::effects::fitted::FittedEffect;
use crate::effects::removal::remove;
use crate::fit::Fit;
use crate::prepared::Prepared;
use crate::quantity::{Figure, Sensor};
use mimu_recording::error::Result;

/// Most times that the rows of a sensor are made.
const PASSES: usize = 3;
/// Error of the effects by the affine model, over the noise, above which the rows are made again.
const DISTORTED: f64 = 0.1;
/// An effect with more coefficients than this is complex: a simpler one may have distorted the affine model. The simplest effects have one
/// coefficient for each axis.
const SIMPLE: usize = 3;

/// Most ends of dwells at which a jump of a bias is sought. Each is a column of all rows for each axis: with all 1374 ends of a recording of 1375
/// dwells these took 450 MB, and most of the time.
const MOST_JUMPS: usize = 128;

/// Index of each recording, and the times between its dwells, s since it began: at most [`MOST_JUMPS`], evenly among the dwells; and how many there are.
fn dwell_ends(recordings: &[&Prepared]) -> (Vec<(usize, f64)>, usize) {
    let mut all = Vec::new();
    for (session, prepared) in recordings.iter().enumerate() {
        let t0_s = prepared.condensed.blocks.first().map_or(0.0, |b| b.start_s);
        let ends = prepared.dwells.list.windows(2);
        all.extend(ends.map(|d| (session, 0.5 * (d[0].last_s + d[1].start_s) - t0_s)));
    }
    let count = all.len();
    let every = count.div_ceil(MOST_JUMPS).max(1);
    let kept = all.into_iter().skip(every / 2).step_by(every);
    (kept.collect(), count)
}

/// Share of the work after so many passes. Nobody knows how many there will be: most sensors need one, and each further one is half as likely.
fn share_of(passes: f64) -> f64 {
    1.0 - (-passes).exp2()
}

/// The accepted effects that are removed before the calibration. One that may be a true input instead stays in: no file stores it, and its
/// mean over the poses is then part of the bias, as in a calibration without effects.
fn removed_of(decision: &Decision) -> Vec<FittedEffect> {
    let accepted = decision.accepted.iter();
    let certain = accepted.filter(|a| a.chosen.or_true_input().is_none());
    certain.map(|a| a.effect.clone()).collect()
}

/// Relative difference of two affine models in scale and direction.
fn relative_change(was: &Affine<f64>, is: &Affine<f64>) -> f64 {
    let inverse = was.matrix.try_inverse().unwrap_or_else(Matrix3::zeros);
    (is.matrix * inverse - Matrix3::identity()).amax()
}

/// Rms of the part of the rows that the effects explain in sample, unit of the rows.
fn explained_rms(decision: &Decision) -> f64 {
    let [before, after] = decision.rms.map(|rms| rms * rms);
    (before - after).max(0.0).sqrt()
}

/// Result of the rows of a sensor, made with one affine model.
pub(super) struct Pass {
    pub rows: Rows,
    pub decision: Decision,
    /// The fit of the first recording without the effects, and the later recordings without them; `None` if none was accepted.
    pub after: Option<(Fit, Vec<Prepared>)>,
}

impl Pass {
    /// Whether `other` is no better, by the held-out error.
    fn is_no_worse_than(&self, other: &Self) -> bool {
        let held_out = |pass: &Self| pass.decision.held_out_rms[1];
        other.after.is_none() || !(held_out(other) <= held_out(self))
    }

    /// Effects of the sensor's own input, about which rows are linearised if they are not linear in the readings. On a table the input is
    /// known, so there are none.
    fn about(&self) -> Vec<FittedEffect> {
        let is_linear = self.rows.observable.figure() == Figure::Input;
        let mut own = self.decision.effects();
        own.retain(|e| !is_linear && e.is_of_own_input());
        own
    }

    /// Whether `other` has the same effects. If it is linearised about the effects found here, its figures are closer to those of the calibration, and
    /// need not be lower.
    fn has_effects_of(&self, other: &Self) -> bool {
        let ids = |pass: &Self| -> Vec<String> {
            let effects = pass.decision.effects().into_iter();
            let mut ids: Vec<String> = effects.map(|e| e.id()).collect();
            ids.sort_unstable();
            ids
        };
        other.after.is_some() && ids(self) == ids(other)
    }

    fn affine(&self, sensor: Sensor) -> Option<Affine<f64>> {
        let (fit, _) = self.after.as_ref()?;
        Some(fit.sensor(sensor)?.estimated.triad.inverse)
    }
}

/// Recordings and settings for the effects of one sensor.
pub(super) struct Passes<'a> {
    pub sensor: Sensor,
    /// The first recording, without the effects of the other sensor.
    pub now: &'a Fit,
    /// The later ones.
    pub later: &'a [Prepared],
    /// Errors of the forces that turns are judged by.
    pub forces: Option<&'a ForceErrors>,
    pub calibrator: &'a Calibrator<'a>,
    /// Told the share of the search that is done.
    pub heard: Heard<'a>,
    /// Passes so far.
    pub done: Cell<u32>,
}

impl Passes<'_> {
    /// The best pass without effects that make the calibration file err more on another recording.
    pub fn best(&self) -> Result<Pass> {
        let judge = AsWritten {
            sensor: self.sensor,
            before: self.now,
            others: self.later,
            calibrator: self.calibrator,
        };
        let mut without = Vec::new();
        loop {
            let best = self.best_without(&without)?;
            let after = best.after.as_ref();
            match after.and_then(|(after, _)| judge.worst(after, &best.decision)) {
                Some(worst) => without.push(worst),
                None => return Ok(best),
            }
        }
    }

    fn rejected(&self, id: String, reason: Reason) -> Rejected {
        Rejected {
            id,
            sensor: self.sensor,
            reason,
        }
    }

    /// The same with some effects not tried, each with the reason. If the accepted effects distorted the affine model, each complex
    /// one is left out in turn, and the pass that predicts best is taken.
    fn best_without(&self, without: &[Rejected]) -> Result<Pass> {
        let (mut best, strong) = self.converged(without)?;
        let complex = best.decision.accepted.iter();
        let complex = complex.filter(|a| strong && a.effect.values.len() > SIMPLE);
        let ids: Vec<String> = complex.map(|a| a.chosen.candidate.id()).collect();
        for id in ids {
            let mut without = without.to_vec();
            without.push(self.rejected(id, Reason::OtherPredictsBetter));
            let (other, _) = self.converged(&without)?;
            if !best.is_no_worse_than(&other) {
                best = other;
            }
        }
        Ok(best)
    }

    /// Repeats passes until the affine model stays. The flag says whether the first pass distorted it.
    fn converged(&self, without: &[Rejected]) -> Result<(Pass, bool)> {
        let sensor = self.sensor;
        let fits = Sensor::BOTH.map(|s| self.now.sensor(s));
        let mut models = fits.map(|f| Some(f?.estimated.triad.inverse));
        let mut pass = self.pass(models, &[], without)?;
        let moves = |models: &[Option<Affine<f64>>; 2], pass: &Pass| {
            let (Some(was), Some(is)) = (models[sensor as usize], pass.affine(sensor)) else {
                return false;
            };
            relative_change(&was, &is) * explained_rms(&pass.decision)
                > DISTORTED * pass.decision.noise_floor
        };
        let strong = moves(&models, &pass);
        for _ in 1..PASSES {
            if !moves(&models, &pass) {
                break;
            }
            models[sensor as usize] = pass.affine(sensor);
            let about = pass.about();
            let next = self.pass(models, &about, without)?;
            let closer = !about.is_empty() && pass.has_effects_of(&next);
            if !closer && pass.is_no_worse_than(&next) {
                break;
            }
            pass = next;
        }
        Ok((pass, strong))
    }

    /// The rows of `sessions`, linearised about their readings without `effects`.
    fn rows(
        &self,
        sessions: &[Session],
        models: &[Option<Affine<f64>>; 2],
        effects: &[FittedEffect],
    ) -> Option<Rows> {
        let as_read = Rows::of(sessions, self.sensor, self.calibrator.free(self.sensor))?;
        if effects.is_empty() {
            return Some(as_read);
        }
        let clean = |s: &Session| remove(s.prepared, s.gyro.as_ref(), s.accel.as_ref(), effects);
        let clean: Vec<Prepared> = sessions.iter().map(clean).collect::<Option<_>>()?;
        let pairs = clean.iter().zip(sessions);
        let sessions: Vec<Session> = pairs
            .map(
                |(prepared, s)| match std::ptr::eq(s.prepared, &self.now.prepared) {
                    true => Session { prepared, ..*s },
                    false => Session::later(prepared, models),
                },
            )
            .collect();
        let rows = Rows::of(&sessions, self.sensor, self.calibrator.free(self.sensor))?;
        Some(rows.about(effects, &as_read).unwrap_or(as_read))
    }

    /// One pass with `models` of gyro and accelerometer, linearised about readings without the effects `about`. The effects `without`, each
    /// with the reason, are not tried.
    fn pass(
        &self,
        models: [Option<Affine<f64>>; 2],
        about: &[FittedEffect],
        without: &[Rejected],
    ) -> Result<Pass> {
        let sensor = self.sensor;
        // The others judge the effects.
        let found_in = 1 + self.calibrator.recordings.more.len();
        let head = Session {
            forces: self.forces,
            ..Session::of(&self.now.prepared, models)
        };
        let others = self.later.iter().map(|p| Session::later(p, &models));
        let sessions: Vec<Session> = std::iter::once(head).chain(others).collect();
        let (ours, unseen) = sessions.split_at(found_in);
        let rows = self.rows(ours, &models, about);
        let rows = rows.ok_or_else(|| self.calibrator.singular())?;
        let unseen = self.rows(unseen, &models, about);
        let all: Vec<&Prepared> = ours.iter().map(|s| s.prepared).collect();
        let (ends, of) = dwell_ends(&all);
        let decide = |without: &[Rejected]| {
            let done = self.done.get();
            let heard = |share: f64| (self.heard)(share_of(f64::from(done) + share));
            let decision = decide(&rows, &ends, unseen.as_ref(), without, &heard);
            self.done.set(done + 1);
            decision.ok_or_else(|| self.calibrator.singular())
        };
        let clean = |found: &[FittedEffect]| -> Result<(Fit, Vec<Prepared>)> {
            let lasting: Vec<FittedEffect> = found.iter().map(FittedEffect::lasting).collect();
            let of_unit = lasting.iter().filter(|e| !e.candidate.is_of_session());
            let of_unit: Vec<FittedEffect> = of_unit.cloned().collect();
            let clean = |(k, s): (usize, &Session)| {
                let effects = match k {
                    0 => found,
                    k if k < found_in => &lasting,
                    _ => &of_unit,
                };
                remove(s.prepared, s.gyro.as_ref(), s.accel.as_ref(), effects)
                    .ok_or_else(|| self.calibrator.singular())
            };
            let cleaned = sessions.iter().enumerate().map(clean);
            let mut cleaned: Vec<Prepared> = cleaned.collect::<Result<_>>()?;
            let first = cleaned.remove(0);
            Ok((self.calibrator.calibrate(first)?, cleaned))
        };
        let mut without = without.to_vec();
        let (mut decision, after) = loop {
            let decision = decide(&without)?;
            let accepted = decision.accepted.iter().map(|a| &a.chosen);
            let strangest = accepted.max_by(|a, b| a.unlikely.total_cmp(&b.unlikely));
            let Some(strangest) = strangest else {
                break (decision, None);
            };
            match clean(&removed_of(&decision)) {
                Ok(after) => break (decision, Some(after)),
                // Readings may be useless after removal of coefficients far larger than any sensor's. Such an effect explains nothing, and the recording
                // need not be refused for it.
                Err(error) => {
                    let id = strangest.candidate.id();
                    without.push(self.rejected(id, Reason::NotCalibrated(error)));
                }
            }
        };
        let noisier = ours.iter().enumerate().flat_map(|(k, s)| {
            let mut all = noisier(s, sensor);
            for one in all.iter_mut().filter(|_| ours.len() > 1) {
                one.stratum.1 = Some(k);
            }
            all
        });
        decision.leftover.extend(noisier);
        decision.jumps_sought = [ends.len(), of];
        if ends.len() < of {
            decision.notes.push(format!(
                "a jump of the bias was sought at {} of the {of} ends of dwells, so its time is that of the nearest of these",
                ends.len()
            ));
        }
        let mut starts = all.iter().map(|p| p.manifest.start_without_power_on());
        if let Some(start) = starts.find_map(|s| s) {
            decision.without_power_on(start);
        }
        Ok(Pass {
            rows,
            decision,
            after,
        })
    }
}
