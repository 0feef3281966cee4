//! An accepted effect with what shows it.

use nalgebra::DMatrix;
use serde::Serialize;

use super::acceptance::Acceptance;
use super::hold_out::{rms, rms_at_rest};
use super::nonlinear::Nonlinear;
use super::second::Second;
use crate::diagnose::search::{Chosen, Search, without};
use crate::diagnose::variance::Fitted;
use crate::effects::fitted::FittedEffect;
use crate::fit::Split;

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

/// The effects `kept`, with the errors that each one leaves out. `last` is the fit with the parameters of `nonlinear`.
pub(super) fn accepted(
    search: &Search,
    judge: &Acceptance,
    (kept, with): (&[Chosen], &Fitted),
    last: &Fitted,
    nonlinear: &Nonlinear,
    split: Split,
) -> Option<Vec<Accepted>> {
    let rows = search.rows;
    let values = search.coefficients(kept, last);
    let seconds = judge.on_second_recording(kept, &values);
    let places = search.places(kept);
    let first = search.basis.ncols();
    let held_with_all = judge.held(kept, with, split);
    let mut accepted = Vec::new();
    for (i, one) in kept.iter().enumerate() {
        let (from, count) = (places[i].start, places[i].len());
        let rest = without(kept, i);
        let held_without = judge.held(&rest, &search.fit(&rest)?, split);
        let both = [held_without.as_ref(), held_with_all.as_ref()];
        let held = both.map(|h| h.map(|h| rms(rows, h)));
        let at_rest = both.map(|h| h.and_then(|h| rms_at_rest(rows, h)));
        let shape = (count, count);
        let of_effects = (from - first, from - first);
        let covariance = nonlinear.covariance.view(of_effects, shape);
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
            conditional: last.covariance.view((from, from), shape).into_owned(),
            held_out_rms_before: before,
            held_out_rms_after: after,
            held_out_at_rest_before: at_rest_before,
            held_out_at_rest_after: at_rest_after,
            of_unit: one.candidate.is_error()
                && !one.candidate.is_of_session()
                && one.or_true_input().is_none(),
        });
    }
    Some(accepted)
}
