//! From the rows of one sensor to a verdict: effects tried, effects accepted, residual errors.

mod acceptance;
mod accepted;
mod choice;
mod hold_out;
mod in_time;
mod leftover;
mod limit;
mod model;
mod nonlinear;
mod not_chosen;
mod notes;
mod reading;
mod second;
mod together;
mod tried;
mod undecided;

use nalgebra::DVector;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::Heard;
use super::rejected::{Reason, Rejected};
use super::rows::Rows;
use super::search::{Chosen, Search};
use crate::diagnose::columns;
use crate::effects::effect::Effect;
use crate::effects::fitted::FittedEffect;
use crate::fit::{SensorFit, Split};
use acceptance::Acceptance;
pub use accepted::Accepted;
use accepted::accepted;
use choice::{Choice, choose};
use in_time::others_in_time;
use leftover::leftover;
pub(super) use leftover::noisier;
use not_chosen::not_chosen;
use notes::notes;
use reading::of_readings;
use together::together;
use tried::candidates;
use undecided::undecided;

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
    pub notes: Vec<String>,
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
            self.notes.push(format!(
                "{}: the device had started by a reset, not by a power-on ({start}), so the time since power-on is unknown; the coefficients count from the start of the recording and are specific to it, so they are not stored in a calibration; switch the unit off and on, and record at once",
                ids.join(", ")
            ));
        }
    }

    /// Accepted effects.
    pub fn effects(&self) -> Vec<FittedEffect> {
        self.accepted.iter().map(|a| a.effect.clone()).collect()
    }

    /// Residual structure beyond that of usual sensors.
    pub fn unexplained(&self) -> impl Iterator<Item = &Leftover> {
        self.leftover.iter().filter(|l| !l.usual)
    }
}

/// Decides on the rows of one sensor. `dwell_ends` are the times between dwells, where a bias may have jumped: index of the recording and s.
/// `unseen` are the rows of a second recording, in which no effects are sought; an effect that it contradicts is not accepted. `without` are
/// effects that are not tried, each with the reason.  `heard` is told the share that is done.
pub fn decide(
    rows: &Rows,
    dwell_ends: &[(usize, f64)],
    unseen: Option<&Rows>,
    without: &[Rejected],
    heard: Heard,
) -> Option<Decision> {
    let (mut all, not_excited) = candidates(rows, dwell_ends);
    all.retain(|c| !without.iter().any(|w| w.id == c.id()));
    let search = Search::new(rows, all);
    let null = search.fit(&[])?;
    let known = search
        .variance
        .fit_at(&search.basis, &search.variance.none())?;
    let dof = rows.y.len() as f64 - search.basis.ncols() as f64;
    let omnibus_p = ChiSquared::new(dof).map_or(1.0, |d| d.sf(known.chi2));
    heard(0.2);
    let found = search.run()?;
    heard(0.6);
    let superfluous = found.superfluous.clone();
    let judge = Acceptance::new(&search, unseen, &null);
    let Choice {
        mut kept,
        mut with,
        mut jumps,
        suggested,
        mut rejected,
        mut not_excited,
    } = choose(&search, &judge, found, not_excited, without)?;
    heard(0.9);
    nonlinear::refine(&search, &mut kept, &mut with);
    others_in_time(&search, &mut kept, &with);
    let one_at_these_inputs = together(&search, &mut kept, &with);
    let split = judge.common(&kept, &with).1;
    let before = Model::of(&search, &[], &null, split)?;
    let after = Model::of(&search, &kept, &with, split)?;
    let nonlinear = Nonlinear::of(&search, &kept, &after);
    let (model, last) = (&after.columns, &after.fitted);
    let accepted = accepted(&search, &judge, (&kept, &with), last, &nonlinear, split)?;
    // A walk at random has steps that look like jumps.
    jumps.retain(|one| {
        let beside_it: Vec<Chosen> = kept.iter().chain([one]).cloned().collect();
        judge.wanders([&kept, &beside_it], one, &with).is_none()
    });
    let suggestion = |one: &Chosen| Rejected {
        id: one.candidate.id(),
        sensor: rows.sensor,
        reason: Reason::Suggestion(one.p),
    };
    rejected.extend(suggested.iter().map(suggestion));
    let known = rejected.iter().map(|r| r.id.as_str());
    let known: Vec<&str> = known.chain(not_excited.iter().map(|n| n.id)).collect();
    let beside = (&kept[..], &with);
    let others = not_chosen(&search, beside, &jumps, &superfluous, &known)?;
    rejected.extend(others);
    let of_readings = of_readings(&search, model, last, split);
    // Scatter beside these functions of the readings.
    let whole = of_readings
        .iter()
        .fold(model.clone(), |m, r| columns::beside(&m, &r.columns));
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
    not_excited.retain(|n| kept.iter().all(|k| k.candidate.id() != n.id));
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
        not_excited,
        rejected,
        leftover: left,
        undecided: undecided(&search, &kept),
        notes: [notes(rows, &kept), one_at_these_inputs].concat(),
        rows: [rows.y.len(), search.basis.ncols()],
        jumps_sought: [dwell_ends.len(); 2],
        omnibus_p,
    })
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
