//! Accepts effects that were found. An effect has to lower the held-out error, also that of a second recording if there is one, and must not
//! depend on one dwell.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::hold_out::{chance_without_a_dwell, held_out_by_part, leverage, parts_helped};
use super::second::second;
use super::{LEVERAGE, SURVIVES, Second, held_out, rms};
use crate::diagnose::rejected::{ErrorRms, Reason};
use crate::diagnose::rows::Rows;
use crate::diagnose::search::{Chosen, FALSE_LISTED, Search, without};
use crate::diagnose::variance::{CommonWalk, Fitted, LikelihoodKind};
use crate::effects::candidate::CandidateKind;
use crate::effects::fitted::FittedEffect;
use crate::fit::Split;

/// A model fits the noise if the mean square of its residual, over that of the noise, is below this ...
const BELOW_NOISE: f64 = 0.25;
/// ... and if it is so small by chance with less than this probability.
const FITS_NOISE: f64 = 1e-4;

/// Data to judge the chosen effects of one sensor.
pub(super) struct Acceptance<'a> {
    search: &'a Search<'a>,
    rows: &'a Rows,
    unseen: Option<&'a Rows>,
    /// How dwells are held out: in blocks, or interleaved if the rest without a block determines no calibration.
    pub usual: Split,
}

/// One of the chosen that is not accepted.
pub(super) struct Failed {
    /// Its place among them.
    pub at: usize,
    /// The reason.
    pub why: Reason,
    /// Whether more dwells might prove it.
    pub too_few_dwells: bool,
}

impl<'a> Acceptance<'a> {
    /// By the rows of `search` and, where there is a second recording, by `unseen`. `null` is the fit without any effect.
    pub fn new(search: &'a Search<'a>, unseen: Option<&'a Rows>, null: &Fitted) -> Self {
        let mut all = Self {
            search,
            rows: search.rows,
            unseen,
            usual: Split::Blocks,
        };
        // If one block contains all rates, there is no calibration without it.
        if all.held_rms(&[], null, Split::Blocks).is_none() {
            all.usual = Split::Interleaved;
        }
        all
    }

    /// Held-out residuals.
    pub fn held(&self, chosen: &[Chosen], fit: &Fitted, split: Split) -> Option<DVector<f64>> {
        held_out(self.search, &self.search.model(chosen), fit, split)
    }

    /// Held-out root mean square.
    pub fn held_rms(&self, chosen: &[Chosen], fit: &Fitted, split: Split) -> Option<f64> {
        self.held(chosen, fit, split).map(|r| rms(self.rows, &r))
    }

    /// Columns of the kept effect `i` that the rows determine better than its prior does; all if there is no prior.
    fn determined(&self, kept: &[Chosen], i: usize, with: &Fitted) -> DMatrix<f64> {
        let one = &kept[i];
        let first = self.search.places(kept)[i].start;
        let by_rows = |k: &usize| {
            let variance = with.covariance[(first + k, first + k)];
            one.size.is_none_or(|size| variance < 0.5 * size * size)
        };
        let columns: Vec<usize> = (0..one.columns.ncols()).filter(by_rows).collect();
        one.columns.select_columns(&columns)
    }

    fn split_of(&self, kept: &[Chosen], i: usize, with: &Fitted) -> (f64, Split) {
        let rest = without(kept, i);
        let columns = self.determined(kept, i, with);
        let [dwell, block] = leverage(self.rows, &self.search.model(&rest), &columns);
        let alone = block > LEVERAGE || self.held_rms(kept, with, self.usual).is_none();
        let split = if alone {
            Split::Interleaved
        } else {
            self.usual
        };
        (dwell, split)
    }

    /// Largest share of one dwell in each of the `kept`, and one way of holding out for all. If only one block shows a warm-up, a model fitted
    /// without this block misses it by so much that no other effect would show.
    pub fn common(&self, kept: &[Chosen], with: &Fitted) -> (Vec<f64>, Split) {
        let each = (0..kept.len()).map(|i| self.split_of(kept, i, with));
        let (shares, splits): (Vec<f64>, Vec<Split>) = each.unzip();
        let split = match splits.contains(&Split::Interleaved) {
            true => Split::Interleaved,
            false => self.usual,
        };
        (shares, split)
    }

    /// Test of each of the `kept`, with these coefficients, on the second recording; `None` if it is specific to a session.
    pub fn on_second_recording(
        &self,
        kept: &[Chosen],
        values: &[DVector<f64>],
    ) -> Vec<Option<Second>> {
        let each = kept.iter().zip(values);
        let given: Vec<FittedEffect> = each
            .filter(|(c, _)| !c.candidate.is_of_session())
            .map(|(c, values)| {
                let (candidate, values) = c.candidate.lasting(values.as_slice());
                FittedEffect::new(candidate, c.parameter, values)
            })
            .collect();
        let mut found = self
            .unseen
            .and_then(|u| second(u, &given))
            .into_iter()
            .flatten();
        let each = kept.iter().map(|c| match c.candidate.is_of_session() {
            true => None,
            false => found.next(),
        });
        each.collect()
    }

    /// The last of the `kept` that is not accepted, except those with an id of the `passed`; the outer `None` if a model is singular.
    pub fn first_to_fail(
        &self,
        kept: &[Chosen],
        with: &Fitted,
        passed: &[String],
    ) -> Option<Option<Failed>> {
        let seconds = self.on_second_recording(kept, &self.search.coefficients(kept, with));
        let (weights, split) = self.common(kept, with);
        let with_all = self.held(kept, with, split);
        let open = |at: &usize| !passed.contains(&kept[*at].candidate.id());
        for at in (0..kept.len()).rev().filter(open) {
            let rest = without(kept, at);
            let null = self.search.fit(&rest)?;
            let both = [self.held(&rest, &null, split), with_all.clone()];
            let too_few_dwells = weights[at] > LEVERAGE || both[1].is_none();
            let why = match weights[at] {
                share if share > LEVERAGE => Some(Reason::OneDwell(share)),
                _ => self
                    .not_held_out(&both, (split, with), &kept[at], seconds[at])
                    .or_else(|| self.below_noise([&rest, kept]))
                    .or_else(|| self.lost_with_a_dwell([&rest, kept], &kept[at], with))
                    .or_else(|| self.wanders([&rest, kept], &kept[at], with)),
            };
            if let Some(why) = why {
                return Some(Some(Failed {
                    at,
                    why,
                    too_few_dwells,
                }));
            }
        }
        Some(None)
    }

    /// Why the residuals of held-out dwells, without and with `one`, do not show it.
    fn not_held_out(
        &self,
        both: &[Option<DVector<f64>>; 2],
        (split, with): (Split, &Fitted),
        one: &Chosen,
        second: Option<Second>,
    ) -> Option<Reason> {
        let error = |rms: f64| ErrorRms::of(self.rows, rms);
        let variances = self.search.variance.variances(&with.components);
        let sums = both.each_ref().map(|h| {
            let of = |r| held_out_by_part(self.rows, split, r, &variances);
            h.as_ref().map(of)
        });
        if let ([Some(a), Some(b)], [Some(left), Some(right)]) = (&sums, both)
            && !(b.iter().sum::<f64>() < a.iter().sum())
        {
            let errors = [left, right].map(|r| error(rms(self.rows, r)));
            return Some(Reason::HeldOut(errors));
        }
        if let Some(second) = second.filter(Second::contradicts) {
            let errors = [second.rms_before, second.rms_after].map(error);
            let chi2 = [second.chi2_before, second.chi2_after];
            return Some(Reason::SecondRecording(chi2, errors));
        }
        if let [Some(a), Some(b)] = &sums {
            let [helped, hurt] = parts_helped([a, b], one.columns.ncols());
            return (hurt >= 2 && hurt >= helped).then_some(Reason::Parts(helped, hurt));
        }
        both[1]
            .is_none()
            .then_some(Reason::UndeterminedWithoutBlock)
    }

    /// Why the second of the `models` fits noise: its residual is far below the known noise, and that of the first is not.
    fn below_noise(&self, models: [&[Chosen]; 2]) -> Option<Reason> {
        let variance = &self.search.variance;
        let [without, with] = models.map(|chosen| {
            let columns = self.search.model(chosen);
            let dof = self.rows.y.len() as f64 - columns.ncols() as f64;
            let fitted = variance.fit_at(&columns, &variance.none())?;
            Some((
                fitted.chi2 / dof,
                ChiSquared::new(dof).ok()?.cdf(fitted.chi2),
            ))
        });
        let ((before, _), (after, by_chance)) = (without?, with?);
        let fits = after < BELOW_NOISE * before.min(1.0) && by_chance < FITS_NOISE;
        fits.then(|| Reason::FitsNoise([before, after].map(f64::sqrt)))
    }

    /// Why `one`, which only the second of the `models` has, is not significant without the dwell with most evidence for it.
    fn lost_with_a_dwell(
        &self,
        models: [&[Chosen]; 2],
        one: &Chosen,
        with: &Fitted,
    ) -> Option<Reason> {
        let [rest, kept] = models.map(|m| self.search.model(m));
        let p = chance_without_a_dwell(self.search, one, [&rest, &kept], with)?;
        (p > SURVIVES).then_some(Reason::LostWithDwell(p))
    }

    /// Why `one`, which only the second of the `models` has, does not explain more than a bias that wanders at random.
    pub fn wanders(&self, models: [&[Chosen]; 2], one: &Chosen, start: &Fitted) -> Option<Reason> {
        let jumps = matches!(one.candidate.kind, CandidateKind::Jump { .. });
        if !(jumps || one.candidate.is_slow_bias()) {
            return None;
        }
        let walk = CommonWalk::of(self.rows)?;
        let columns = models.map(|m| self.search.model(m));
        let deviances = columns.each_ref().map(|columns| {
            let variance = &self.search.variance;
            variance.deviance_beside_walk(columns, &walk, &start.components)
        });
        let [Some(without), Some(with)] = deviances else {
            return None;
        };
        // A weak drift is no more evident beside a walk than a walk beside the drift. What is as likely without any walk keeps its name: of twelve
        // units with an accelerometer that drifts a little faster than data sheets say, none had one otherwise.
        let alone =
            self.search
                .variance
                .fit(&columns[1], &start.components, LikelihoodKind::Likelihood)?;
        if alone.deviance <= without {
            return None;
        }
        let before = columns[0].ncols();
        let drop = without - with;
        let p = self
            .search
            .chance(drop, one.columns.ncols(), before, &one.candidate);
        (p > FALSE_LISTED).then_some(Reason::RandomWalk(p))
    }

    /// Removes suggestions from `kept`: products without known physics that no second recording confirms.
    pub fn suggestions(&self, kept: &mut Vec<Chosen>, with: &Fitted) -> Vec<Chosen> {
        let seconds = self.on_second_recording(kept, &self.search.coefficients(kept, with));
        let confirmed = seconds.iter().map(|s| s.is_some_and(|s| s.shows));
        let (taken, suggested): (Vec<_>, Vec<_>) = kept
            .drain(..)
            .zip(confirmed)
            .partition(|(one, confirmed)| one.candidate.is_listed() || *confirmed);
        *kept = taken.into_iter().map(|t| t.0).collect();
        suggested.into_iter().map(|s| s.0).collect()
    }
}
