//! From the rows of one sensor to a verdict: effects tried, effects accepted, residual errors.

mod acceptance;
mod hold_out;
mod in_time;
mod leftover;
mod limit;
mod model;
mod nonlinear;
mod reading;
mod second;
mod together;
mod tried;
mod undecided;

use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::note::Note;
use super::rejected::{ErrorRms, NotChosen, Passed, Reason, Rejected};
use super::rows::Rows;
use super::search::{Chosen, FALSE_LISTED, Found, MOST, Search};
use super::variance::Fitted;
use crate::diagnose::columns::beside;
use crate::effects::candidate::{Candidate, CandidateKind};
use crate::effects::effect::Effect;
use crate::effects::fitted::FittedEffect;
use crate::effects::quantity::Quantity;
use crate::effects::regressor::Product;

use crate::fit::{SensorFit, Split};
use acceptance::Acceptance;
use in_time::others_in_time;
use leftover::leftover;
pub(super) use leftover::noisier;
use limit::name_limits;
use reading::of_readings;
use together::together;
use tried::candidates;
use undecided::undecided;

use hold_out::rms_at_rest;
pub(super) use hold_out::{held_out, part, rms};
pub use leftover::{CorrelatesWith, FALSE_LEFTOVER, Leftover, WANDERS};
pub use model::Model;
pub use nonlinear::Nonlinear;
pub use second::Second;
pub use undecided::Undecided;

/// If one dwell has more than this share of the information about an effect, it decides the effect alone.
pub const LEVERAGE: f64 = 0.7;
/// Largest probability by chance that an effect may have without the dwell with most evidence for it; above it, one outlier could have caused
/// the effect.
const SURVIVES: f64 = 0.01;

/// An accepted effect, and why.
#[derive(Debug, Clone, Serialize)]
pub struct Accepted {
    /// The effect.
    #[serde(flatten)]
    pub effect: FittedEffect,
    /// How it was found.
    #[serde(flatten)]
    pub chosen: Chosen,
    /// Whether it is an error of the unit, so that a calibration stores it. A drift is specific to the session, and so is an effect of the
    /// time since power-on if that time is unknown. An effect that may be a true input instead is not stored either: of 32 units whose
    /// sessions on a table were diagnosed together, 6 had Earth rate in their files as g-sensitivity, and 2 of these erred more on another
    /// session, by up to a fifth.
    pub of_unit: bool,
    /// Held-out root mean square without it, beside the others; unit of the sensor's figures.
    pub held_out_rms_before: f64,
    /// The same with it.
    pub held_out_rms_after: f64,
    /// Held-out root mean square of the rates at rest without it, rad/s, where the figures are of turns.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_out_at_rest_before: Option<f64>,
    /// The same with it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_out_at_rest_after: Option<f64>,
    /// How it was held out.
    pub held_out: Split,
    /// Its test on the second recording, if there is one that it can be judged by.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub second: Option<Second>,
    /// Covariance of its coefficients, which allows for the uncertainty of its nonlinear parameter.
    #[serde(skip)]
    pub covariance: DMatrix<f64>,
    /// The same at the nonlinear parameter found: the uncertainty of a curve that is drawn for this one value.
    #[serde(skip)]
    pub conditional: DMatrix<f64>,
}

/// What was decided on one sensor.
#[derive(Debug, Clone)]
pub struct Decision {
    /// Accepted effects.
    pub accepted: Vec<Accepted>,
    /// Effects that were found but rejected, and named effects that were not chosen; each with the reason.
    pub rejected: Vec<Rejected>,
    /// Effects that the experiment could not show.
    pub not_excited: Vec<&'static Effect>,
    /// Residual structure.
    pub leftover: Vec<Leftover>,
    /// The affine model, and that with the accepted effects.
    pub models: [Model; 2],
    /// Nonlinear parameters of the accepted effects, and their part in the uncertainty.
    pub nonlinear: Nonlinear,
    /// Root mean square of the judged rows before and after, in sample.
    pub rms: [f64; 2],
    /// The same held out; not a number where no block could be.
    pub held_out_rms: [f64; 2],
    /// How they were held out.
    pub split: Split,
    /// Held-out rms with the effects if every fourth dwell is held out instead of a block of time. One block may be the only one at some temperatures;
    /// without it the model is extrapolated to these. Every fourth dwell lies between others.
    pub interleaved_rms: f64,
    /// Error that noise alone would cause.
    pub noise_floor: f64,
    /// Error that the reference may add: that of the accelerometer, whose directions judge the turns.
    pub reference_rms: f64,
    /// Accepted effects whose physics the rows do not decide.
    pub undecided: Vec<Undecided>,
    /// Number of ends of dwells at which a jump of a bias was sought, and number of all.
    pub jumps_sought: [usize; 2],
    /// Notes on the accepted effects for the user.
    pub notes: Vec<Note>,
    /// Number of rows, and of affine parameters that they determine first. A judgement can only use their difference.
    pub rows: [usize; 2],
    /// Probability by chance that the rows scatter as they do without effects, by the known noise alone.
    pub omnibus_p: f64,
}

impl Decision {
    /// Share of the held-out mean square beyond noise and errors of the reference that the accepted effects remove. `None` without effects,
    /// or if nothing exceeds the noise.
    pub fn explained(&self) -> Option<f64> {
        let known = self.noise_floor.powi(2) + self.reference_rms.powi(2);
        let [before, after] = self.held_out_rms.map(|rms| rms * rms - known);
        (!self.accepted.is_empty() && before > 0.0 && after.is_finite())
            .then(|| 1.0 - after.max(0.0) / before)
    }

    /// Takes the figures of the model without effects from its `fit`, which a calibration without effects would be made of, and those in sample
    /// with effects from the fit `with_effects`: the same model has the same figures in every result.
    ///
    /// The rows are weighted by variance components, and a fit by its extra variances. For the published Xsens session the same affine model
    /// thus had 0.441 deg in sample and 0.531 held out in one result, 0.428 and 0.549 in the other.
    pub(super) fn take_figures(&mut self, fit: &SensorFit, with_effects: Option<&SensorFit>) {
        self.rms[0] = fit.rms();
        self.rms[1] = with_effects.unwrap_or(fit).rms();
        if fit.noise_floor().is_finite() {
            self.noise_floor = fit.noise_floor();
        }
        let complete = fit.held_out.count == fit.held_out.parts;
        // Another split answers another question: whether blocks or scattered dwells are predicted.
        let alike = self.accepted.is_empty() || fit.held_out.split == self.split;
        let held_out = fit.held_out_rms().filter(|_| complete && alike);
        if let Some(held_out) = held_out.filter(|_| self.held_out_rms[0].is_finite()) {
            self.held_out_rms[0] = held_out;
            match &mut self.accepted[..] {
                [] => {
                    self.held_out_rms[1] = held_out;
                    self.split = fit.held_out.split;
                }
                [only] => only.held_out_rms_before = held_out,
                _ => {}
            }
        }
    }

    /// Marks effects that depend on the time since power-on as specific to the recording, because its device had started by `start` instead
    /// of a power-on.
    pub(super) fn without_power_on(&mut self, start: &str) {
        let by_time = |a: &&mut Accepted| a.chosen.candidate.depends_on_time();
        let mut ids = Vec::new();
        for accepted in self.accepted.iter_mut().filter(by_time) {
            accepted.of_unit = false;
            ids.push(accepted.chosen.candidate.id());
        }
        if !ids.is_empty() {
            let found = format!(
                "{}: the device had started by a reset, not by a power-on ({start}), so the time since power-on is unknown",
                ids.join(", ")
            );
            self.notes.push(Note::new(found, "the coefficients count from the start of the recording and are specific to it, so they are not stored in a calibration; switch the unit off and on, and record at once"));
        }
    }

    /// Residual structure beyond that of usual sensors.
    pub fn unexplained(&self) -> impl Iterator<Item = &Leftover> {
        self.leftover.iter().filter(|l| !l.usual)
    }
}

/// Decides on the rows of one sensor. `dwell_ends` are the times between dwells, where a bias may have jumped: index of the recording and s.
/// `unseen` are the rows of a second recording, in which no effects are sought; an effect that it contradicts is not accepted. `without` are
/// effects that are not tried, each with the reason. `accept` are ids of terms that need no second recording.
pub fn decide(
    rows: &Rows,
    dwell_ends: &[(usize, f64)],
    unseen: Option<&Rows>,
    without: &[Rejected],
    accept: &[String],
) -> Option<Decision> {
    let (mut all, mut not_excited) = candidates(rows, dwell_ends);
    all.retain(|c| !without.iter().any(|w| w.id == c.id()));
    let search = Search::new(rows, all);
    let null = search.fit(&[])?;
    let known = search
        .variance
        .fit_at(&search.basis, &search.variance.none())?;
    let dof = rows.y.len() as f64 - search.basis.ncols() as f64;
    let omnibus_p = ChiSquared::new(dof).map_or(1.0, |d| d.sf(known.chi2));
    let Found {
        chosen,
        fit: mut with,
        superfluous,
    } = search.run()?;
    let rejection = |candidate: &Candidate, reason| Rejected {
        id: candidate.id(),
        sensor: rows.sensor,
        reason,
    };
    let mut rejected = without.to_vec();
    let mut kept: Vec<Chosen> = Vec::new();
    let mut jumps = Vec::new();
    for one in chosen {
        match one.candidate.kind {
            CandidateKind::Jump { .. } => jumps.push(one),
            _ => kept.push(one),
        }
    }
    // Jumps are reported, not fitted.
    if !jumps.is_empty() {
        with = search.fit(&kept)?;
    }
    let judge = Acceptance::new(&search, unseen, &null);
    let usual = judge.usual;
    let mut suggested = Vec::new();
    // Ids that failed, in order. An effect that failed beside another that failed later is tried once more without the latter.
    let mut failures: Vec<String> = Vec::new();
    // Ids that passed. They are not judged again once suggestions are removed: what these explained would then hide an effect from held-out
    // dwells.
    let mut passed: Vec<String> = Vec::new();
    loop {
        let ids =
            |all: &[Chosen]| -> Vec<String> { all.iter().map(|c| c.candidate.id()).collect() };
        let mut failed_any = false;
        // Effects are judged with the coefficients that would be stored.
        search.complete(&mut kept, &mut with);
        name_limits(&search, &mut kept, &mut with, &failures);
        // Effects that are not accepted are removed, the last in the list first.
        while let Some(failed) = judge.first_to_fail(&kept, &with, &passed)? {
            failed_any = true;
            let candidate = kept.remove(failed.at).candidate;
            // More dwells may prove it, so the next experiment asks for it.
            if let CandidateKind::Effect(effect) = &candidate.kind
                && failed.too_few_dwells
                && !not_excited.iter().any(|n| n.id == effect.id)
            {
                not_excited.push(effect);
            }
            failures.push(candidate.id());
            rejected.retain(|r| r.id != candidate.id());
            rejected.push(rejection(&candidate, failed.why));
            with = search.fit(&kept)?;
        }
        passed = ids(&kept);
        let set_aside = judge.suggestions(&mut kept, &with, accept);
        if set_aside.is_empty() && !failed_any {
            break;
        }
        suggested.extend(set_aside);
        with = search.fit(&kept)?;
        // What a suggestion or a rejected effect had explained, a named effect may explain as well. An accelerometer's warm-up of p < 1e-6
        // was reported as not significant, because the effect that had replaced it in the search was rejected afterwards.
        let more = search.beside(kept.clone(), |c| {
            let id = c.id();
            let times = failures.iter().filter(|f| **f == id).count();
            let beside_others = times == 1 && failures.last() != Some(&id);
            let tried = without.iter().any(|w| w.id == id) || times > 0;
            c.is_listed() && (!tried || beside_others)
        })?;
        if ids(&more.chosen) == ids(&kept) {
            break;
        }
        (kept, with) = (more.chosen, more.fit);
    }
    rejected.retain(|r| kept.iter().all(|k| k.candidate.id() != r.id));
    nonlinear::refine(&search, &mut kept, &mut with);
    others_in_time(&search, &mut kept, &with);
    let one_at_these_inputs = together(&search, &mut kept, &with);
    let split = judge.common(&kept, &with).1;
    let before = Model::of(&search, &[], &null, split)?;
    let after = Model::of(&search, &kept, &with, split)?;
    let nonlinear = Nonlinear::of(&search, &kept, &after);
    let (model, last) = (&after.columns, &after.fitted);
    let mut accepted = Vec::new();
    let values = coefficients_of(&search, &kept, last);
    let seconds = judge.on_second_recording(&kept, &values);
    let (first, mut from) = (search.basis.ncols(), 0);
    let held_with_all = judge.held(&kept, &with, split);
    for (i, one) in kept.iter().enumerate() {
        let count = one.columns.ncols();
        let mut rest = kept.clone();
        rest.remove(i);
        let without = search.fit(&rest)?;
        let held_without = judge.held(&rest, &without, split);
        let both = [held_without.as_ref(), held_with_all.as_ref()];
        let held = both.map(|h| h.map(|h| rms(rows, h)));
        let at_rest = both.map(|h| h.and_then(|h| rms_at_rest(rows, h)));
        let covariance = nonlinear.covariance.view((from, from), (count, count));
        let [before, after] = held.map(|h| h.unwrap_or(f64::NAN));
        let (at_rest_before, at_rest_after) = match at_rest {
            [Some(without), Some(with)] => (Some(without), Some(with)),
            _ => (None, None),
        };
        accepted.push(Accepted {
            effect: FittedEffect {
                interval: nonlinear.intervals[i],
                sigmas: covariance.diagonal().iter().map(|v| v.sqrt()).collect(),
                ..FittedEffect::new(
                    one.candidate.clone(),
                    one.parameter,
                    values[i].iter().copied().collect(),
                )
            },
            chosen: one.clone(),
            held_out: split,
            second: seconds[i],
            covariance: covariance.into_owned(),
            conditional: last
                .covariance
                .view((first + from, first + from), (count, count))
                .into_owned(),
            held_out_rms_before: before,
            held_out_rms_after: after,
            held_out_at_rest_before: at_rest_before,
            held_out_at_rest_after: at_rest_after,
            of_unit: one.candidate.is_error()
                && !one.candidate.is_of_session()
                && one.or_true_input().is_none(),
        });
        from += count;
    }
    // A walk at random has steps that look like jumps.
    jumps.retain(|one| {
        let beside_it: Vec<Chosen> = kept.iter().chain([one]).cloned().collect();
        judge.wanders([&kept, &beside_it], one, &with).is_none()
    });
    // The jumps that were found stay in the model: otherwise every slow effect would seem to explain a part of them.
    let with_jumps: Vec<Chosen> = kept.iter().chain(&jumps).cloned().collect();
    let all = match jumps.is_empty() {
        true => with.clone(),
        false => search.fit(&with_jumps)?,
    };
    rejected.extend(
        suggested
            .iter()
            .map(|one| rejection(&one.candidate, Reason::Suggestion(one.p))),
    );
    let now = (
        rms(rows, &(&rows.y - search.model(&kept) * &with.coefficients)),
        judge.held_rms(&kept, &with, usual),
    );
    for one in search.others(&with_jumps, &all) {
        let id = one.candidate.id();
        if rejected.iter().any(|r| r.id == id) || not_excited.iter().any(|n| n.id == id) {
            continue;
        }
        let mut more = kept.clone();
        more.push(one.clone());
        let held = search
            .fit(&more)
            .and_then(|f| Some((f.clone(), judge.held_rms(&more, &f, usual)?)))
            .map(|(f, held)| {
                (
                    rms(rows, &(&rows.y - search.model(&more) * &f.coefficients)),
                    held,
                )
            });
        let errors = match (held, now) {
            (Some((sample, held)), (before, Some(out))) => {
                Some([[before, sample], [out, held]].map(|of| of.map(|v| ErrorRms::of(rows, v))))
            }
            _ => None,
        };
        let reason = Reason::NotChosen(NotChosen {
            p: one.p,
            why: passed_over(&one, &kept, &superfluous),
            errors,
        });
        rejected.push(rejection(&one.candidate, reason));
    }
    let of_readings = of_readings(&search, model, last, split);
    // Scatter beside these functions of the readings.
    let whole = of_readings
        .iter()
        .fold(model.clone(), |m, r| beside(&m, &r.columns));
    let mut left = leftover(&search, &whole, last, &jumps);
    left.extend(of_readings.into_iter().map(|r| r.left));
    for one in suggested {
        let mut more = kept.clone();
        more.push(one.clone());
        let fitted = search.fit(&more)?;
        let change = model * &last.coefficients - search.model(&more) * &fitted.coefficients;
        left.push(Leftover::suggested(&one.candidate, rows, &change));
    }
    let interleaved = judge.held_rms(&kept, last, Split::Interleaved);
    let models = [before, after];
    let [floor, reference] = known_in(rows).map(|sum| {
        let items = rows.judged.0 / rows.judged.1;
        (sum / items as f64).sqrt()
    });
    Some(Decision {
        rms: models.each_ref().map(|m| rms(rows, &m.residuals)),
        held_out_rms: models.each_ref().map(|m| {
            let held_out = m.held_out.as_ref();
            held_out.map_or(f64::NAN, |h| rms(rows, h))
        }),
        models,
        nonlinear,
        interleaved_rms: interleaved.unwrap_or(f64::NAN),
        split,
        noise_floor: floor,
        reference_rms: reference,
        accepted,
        not_excited: {
            let accepted = |id: &str| kept.iter().any(|k| k.candidate.id() == id);
            not_excited.retain(|n| !accepted(n.id));
            not_excited
        },
        rejected,
        leftover: left,
        undecided: undecided(&search, &kept),
        notes: [notes(rows, &kept), one_at_these_inputs].concat(),
        rows: [rows.y.len(), search.basis.ncols()],
        jumps_sought: [dwell_ends.len(); 2],
        omnibus_p,
    })
}

/// Why a named effect that is significant is not among the `kept`. `None` if it is not significant.
fn passed_over(one: &Chosen, kept: &[Chosen], superfluous: &[String]) -> Option<Passed> {
    let listed = kept.iter().filter(|k| k.candidate.is_listed()).count();
    match one.p {
        p if p > FALSE_LISTED => None,
        _ if superfluous.contains(&one.candidate.id()) => Some(Passed::GivenUp),
        _ if listed >= MOST => Some(Passed::Enough(listed)),
        _ => Some(Passed::NotAtFirst),
    }
}

/// Known variances of the judged rows, summed: by noise, and by errors of the reference.
fn known_in(rows: &Rows) -> [f64; 2] {
    let mut sums = [0.0; 2];
    for stratum in &rows.strata {
        let judged = stratum.rows.clone().take_while(|r| *r < rows.judged.0);
        let count = judged.count();
        let part = |of: &Option<DVector<f64>>| of.as_ref().map_or(0.0, |v| v.rows(0, count).sum());
        let by_reference = part(&stratum.by_reference);
        let known = stratum.known.diagonal().rows(0, count).sum();
        sums[0] += known - part(&stratum.by_earth);
        sums[1] += by_reference;
    }
    sums
}

/// Coefficients of each of the chosen.
fn coefficients_of(search: &Search, chosen: &[Chosen], fit: &Fitted) -> Vec<DVector<f64>> {
    let mut from = search.basis.ncols();
    let mut all = Vec::new();
    for one in chosen {
        let count = one.columns.ncols();
        all.push(fit.coefficients.rows(from, count).into_owned());
        from += count;
    }
    all
}

/// Notes on the chosen effects for the user.
fn notes(rows: &Rows, chosen: &[Chosen]) -> Vec<Note> {
    let mut notes = Vec::new();
    let inputs = chosen.iter().filter(|c| !c.candidate.is_error());
    notes.extend(inputs.map(|c| {
        let found = format!("{}: it is a true input of the gyro", c.candidate.id());
        Note::new(
            found,
            "the calibration is corrected for it, and it is not removed from readings",
        )
    }));
    notes.extend(chosen.iter().filter_map(|c| {
        let input = c.or_true_input()?;
        let id = c.candidate.id();
        let found = format!(
            "{id}: {}, a true input of the gyro, explains the recording as well, so a calibration does not store {id}",
            input.id
        );
        Some(Note::new(
            found,
            format!("at 1 g it is no larger than {}; a force of several g distinguishes them", input.size),
        ))
    }));
    let sessions = chosen.iter().filter(|c| c.candidate.is_of_session());
    notes.extend(sessions.map(|c| {
        let found = format!(
            "{}: specific to this session, because it is unknown how long it lasts; it is not stored in a calibration, and the biases are those of the middle of the session",
            c.candidate.id()
        );
        Note::new(found, "")
    }));
    for candidate in chosen.iter().map(|c| &c.candidate) {
        if let CandidateKind::Effect(effect) = &candidate.kind
            && !candidate.inseparable.is_empty()
        {
            let names = candidate
                .inseparable
                .iter()
                .map(|k| effect.coefficients[*k].name);
            let found = format!(
                "{}: this recording does not distinguish {} from the bias and the other coefficients, so they are 0 in the file",
                effect.id,
                names.collect::<Vec<_>>().join(", ")
            );
            notes.push(Note::new(found, format!("it needs {}", effect.needs)));
        }
    }
    // The horizontal part of Earth rate depends on the heading. On a table with one heading in each attitude it looks like products of the
    // force.
    let only_force = |p: &Product| p.parts().all(|(q, _)| matches!(q, Quantity::Force(_)));
    let level = chosen
        .iter()
        .filter(|c| matches!(&c.candidate.kind, CandidateKind::Term(_, m) if only_force(m)));
    let level: Vec<String> = level.map(|c| c.candidate.id()).collect();
    if !level.is_empty() && chosen.iter().any(|c| !c.candidate.is_error()) {
        let found = format!(
            "{}: may be the horizontal part of Earth rate, which depends on the heading and the place: record each attitude at several headings",
            level.join(", ")
        );
        notes.push(Note::new(found, ""));
    }
    let heated = chosen.iter().filter(|c| c.candidate.without_self_heating);
    notes.extend(heated.map(|c| {
        let found = format!(
            "{}: the thermometer heats itself in the first minute, and the sensor is on another die",
            c.candidate.id()
        );
        let advice = "the device has no other thermometer, so it has this error for that time after power-on";
        Note::new(found, advice)
    }));
    let slow = chosen.iter().filter(|c| c.candidate.is_slow());
    let ids: Vec<String> = slow.map(|c| c.candidate.id()).collect();
    let Some(order) = rows.one_way().filter(|_| !ids.is_empty()) else {
        return notes;
    };
    let found = format!(
        "{}: the temperature only {} during the recording (rank correlation {order:.2}), so effects of temperature and of time look alike, and a lag of the die looks like a bias",
        ids.join(", "),
        if order > 0.0 { "rises" } else { "falls" },
    );
    notes.push(Note::new(
        found,
        "let the temperature return within one recording",
    ));
    notes
}
