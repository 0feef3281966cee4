//! Converters that the residuals speak of: errors by the code, of any weight and any zero.
//!
//! A bit that is worth too much is a square wave against the reading: of an unknown period, twice its weight, and an unknown phase,
//! the zero. So the residuals are looked through as a periodogram is (Lomb 1976, Scargle 1982), with the reading in place of the time,
//! and for single steps, which codes that never come leave. From the best of these the other bits of the same converter follow:
//! their weights are halves and doubles, and their turns fall together with its own. Weight and zero are then refined with all bits.

mod first_sight;
mod settle;
mod sight;

use rayon::prelude::*;

use super::{Chosen, Search, beside, exceeds, unit_columns};
use crate::diagnose::candidate::{Candidate, Kind};
use crate::diagnose::effect::Moment;
use crate::diagnose::library::readout::{self, BITS, Converter, first_of};
use crate::diagnose::spread::{By, Components, Fitted};
use first_sight::{ZEROS, affordable};
use settle::removable;
use sight::{Sight, range};

/// Of all that is followed up, the converters whose weights and zeros are refined where the noise is known; else one.
const REFINED: usize = 3;
/// A first sight that chance has more often than this, after all places, is not followed up.
const PROMISING: f64 = 0.05;

/// Some bits of a converter, and how well they explain the residuals.
#[derive(Debug, Clone)]
struct Hypothesis {
    converter: Converter,
    /// From 0, the first, up.
    bits: Vec<usize>,
    /// Drop of the deviance.
    drop: f64,
    /// What that costs, [`Sight::price`].
    price: f64,
}

impl Hypothesis {
    fn score(&self) -> f64 {
        self.drop - self.price
    }
}

/// What was found of the readings of one axis, or of all.
struct Outcome {
    best: Hypothesis,
    /// Places that were looked at.
    places: f64,
    /// Bits to choose from.
    offered: usize,
    /// Probability of chance, roughly.
    p: f64,
}

impl Sight {
    /// Errors by the code of an axis, or of all alike. `None` where there are no readings to speak of.
    fn look(&self, axis: Option<usize>) -> Option<Outcome> {
        let readings = self.of(axis);
        if !(range(&readings) > 0.0) {
            return None;
        }
        let (followed, places) = self.first_sight(&readings);
        let (drop, converter) = followed.first().copied()?;
        let chance = |drop: f64, columns: f64, choices: f64| {
            let n = self.root.len() as f64;
            let dof = n - self.model.nrows() as f64 - columns;
            let f = match self.noise_known {
                true => drop / columns,
                false => (drop / n).exp_m1() * dof / columns,
            };
            (exceeds(f, columns, dof) * choices).min(1.0)
        };
        let p = chance(drop, 2.0, places);
        let first = Outcome {
            best: Hypothesis {
                converter,
                bits: vec![0],
                drop,
                price: self.price(&[0], converter.weight, range(&readings)),
            },
            places,
            offered: 1,
            p,
        };
        // With all bits at work no single wave may stand out; a usual weight is tried all the same where the noise is known.
        if p > PROMISING && !self.noise_known {
            return removable(&first.best.converter).then_some(first);
        }
        // At first sight it is enough to know whether codes do better than what else there is; they are looked for again.
        let (usual, places, refined) = match self.noise_known {
            true => (
                self.usual(&readings),
                places + affordable(&readings, ZEROS) as f64,
                REFINED,
            ),
            false => (Vec::new(), places, 1),
        };
        let mut whole: Vec<Converter> = followed
            .into_par_iter()
            .map(|(_, seen)| self.above(&readings, seen.weight, seen.zero))
            .collect();
        whole.extend(usual.iter().map(|u| u.1));
        let whole = whole
            .into_par_iter()
            .filter_map(|converter| Some(self.choose(&readings, converter)?.0));
        let mut whole: Vec<Hypothesis> = whole.collect();
        whole.sort_by(|a, b| b.score().total_cmp(&a.score()));
        whole.truncate(refined);
        let all = whole
            .into_par_iter()
            .filter_map(|chosen| self.settled(&readings, chosen));
        let found = all.max_by(|a, b| a.0.score().total_cmp(&b.0.score()));
        let Some((best, offered)) = found else {
            let best = self.centred(&readings, first.best.clone());
            return removable(&best.converter).then_some(Outcome { best, ..first });
        };
        let choices = places * (offered as f64).exp2();
        let p = chance(best.drop, best.bits.len() as f64, choices);
        Some(Outcome {
            best,
            places,
            offered,
            p,
        })
    }
}

impl Search<'_> {
    /// Errors by the code beside the chosen, of converters of any weight and zero: of one that all axes share, and of one each.
    /// None if errors by the code are among the chosen.
    pub(super) fn converters_beside(&self, chosen: &[Chosen], null: &Fitted) -> Vec<Chosen> {
        if chosen.iter().any(|c| c.candidate.reads_code()) {
            return Vec::new();
        }
        let Some(effect) = readout::of_sensor(self.rows.sensor) else {
            return Vec::new();
        };
        let model = self.model(chosen);
        let moments = self.freed(&model, null);
        let Some(sight) = Sight::new(self, &model, null, &moments) else {
            return Vec::new();
        };
        let plain = Candidate::new(self.rows.sensor, Kind::Effect(effect));
        let mut found = Vec::new();
        if let Some(one) = sight.look(None) {
            let mut candidate = plain.clone().behind_one(one.best.converter);
            candidate.active.clone_from(&one.best.bits);
            candidate.converters = one.places;
            candidate.choices = one.places * (one.offered as f64).exp2();
            found.push(candidate);
        }
        let mut each = plain;
        each.active.clear();
        for (axis, one) in (0..3).filter_map(|axis| Some((axis, sight.look(Some(axis))?))) {
            if one.p > PROMISING {
                continue;
            }
            each.converters *= one.places;
            each.choices *= one.places * (one.offered as f64).exp2();
            each.codes[axis] = Some(one.best.converter);
            each.active
                .extend(one.best.bits.iter().map(|bit| first_of(axis) + bit));
        }
        if !each.active.is_empty() {
            found.push(each);
        }
        found
            .into_iter()
            .filter_map(|candidate| {
                let columns = candidate.columns_at(&self.by_dwell, &moments, 0.0);
                let both = beside(&model, &unit_columns(&columns));
                let fitted = self.spread.fit(&both, &null.components, By::Likelihood)?;
                let drop = (null.deviance - fitted.deviance).max(0.0);
                let p = self.chance(drop, columns.ncols(), model.ncols(), &candidate);
                Some(Chosen {
                    candidate,
                    form: 0.0,
                    columns,
                    p,
                    worth: drop,
                    alternatives: Vec::new(),
                })
            })
            .collect()
    }

    /// The converters of `one` again, beside `rest`, at readings and by a noise that are known better: as long as its errors were not
    /// known, they were in the affine parameters, in the readings that bits were taken from, and in the noise, which hid all but the largest.
    /// And by how much these cost more.
    pub(super) fn settle_converters(
        &self,
        one: &Candidate,
        rest: &[Chosen],
        moments: &[Moment],
        noise: &Components,
    ) -> Option<(Candidate, f64)> {
        let model = self.model(rest);
        let null = self.spread.fit_at(&model, noise)?;
        let mut sight = Sight::new(self, &model, &null, moments)?;
        sight.noise_known = true;
        let shared = one.active.iter().any(|k| *k < BITS);
        let mut again = one.clone();
        again.active.clear();
        (again.converters, again.choices) = (1.0, 1.0);
        for axis in 0..if shared { 1 } else { 3 } {
            let axes = if shared { None } else { Some(axis) };
            let readings = sight.of(axes);
            let as_it_was = one.codes[axis].and_then(|converter| {
                let (chosen, _) = sight.choose(&readings, converter)?;
                sight.settled(&readings, chosen)
            });
            let found = sight.look(axes);
            let places = found.as_ref().map_or(1.0, |f| f.places);
            let promising = found.filter(|f| f.p < PROMISING);
            let promising = promising.map(|f| (f.best, f.offered));
            let all = as_it_was.into_iter().chain(promising);
            let best = all.max_by(|a, b| a.0.score().total_cmp(&b.0.score()));
            again.codes[axis] = best.as_ref().map(|(best, _)| best.converter);
            let Some((best, offered)) = best else {
                continue;
            };
            again.converters *= places;
            again.choices *= places * (offered as f64).exp2();
            let first = if shared { 0 } else { first_of(axis) };
            again.active.extend(best.bits.iter().map(|bit| first + bit));
        }
        if shared {
            again.codes = [again.codes[0]; 3];
        }
        if again.active.is_empty() {
            return None;
        }
        let dearer = sight.price_of(&again) - sight.price_of(one);
        Some((again, dearer))
    }
}
