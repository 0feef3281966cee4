//! One effect after the other, each tested again beside the others.

use super::chosen::{Alternative, Chosen, score, without};
use super::{CONFUSED, FALSE_FOUND, FALSE_LISTED, Found, MOST, Search};
use crate::diagnose::variance::Fitted;
use crate::effects::candidate::Candidate;

/// Lead in score that an effect needs to replace one that was chosen before it, and the largest number of such exchanges.
const EXCHANGED: f64 = 1.0;
const EXCHANGES: usize = 4;

/// Lead in score that a term found from the data needs over a named effect.
const PREFERENCE: f64 = 12.0;

impl Search<'_> {
    /// Searches all candidates for the effects that explain the rows.
    ///
    /// A named effect is preferred to a term found from the data unless the score of the term is higher by 12: among two thousand terms,
    /// some product always resembles an effect.
    pub fn run(&self) -> Option<Found> {
        self.beside(Vec::new(), |_| true)
    }

    /// The same beside effects that are chosen already, with the candidates that `may` be tried.
    pub fn beside(
        &self,
        mut chosen: Vec<Chosen>,
        may: impl Fn(&Candidate) -> bool,
    ) -> Option<Found> {
        let mut now = self.fit(&chosen)?;
        let given = chosen.len();
        let mut exchanges = 0;
        // An effect that others made superfluous is not tried again: two that make each other superfluous would alternate for ever.
        let mut gone: Vec<String> = Vec::new();
        loop {
            let full = [true, false].map(|listed| {
                let alike = chosen.iter().filter(|c| c.candidate.is_listed() == listed);
                alike.count() >= MOST
            });
            if full == [true; 2] {
                break;
            }
            let mut finalists = self.finalists(&chosen, &now);
            finalists.retain(|c| {
                let room = !full[usize::from(!c.candidate.is_listed())];
                room && may(&c.candidate) && !gone.contains(&c.candidate.id())
            });
            let significant = |c: &&Chosen| {
                c.p < if c.candidate.is_listed() {
                    FALSE_LISTED
                } else {
                    FALSE_FOUND
                }
            };
            let best_of = |listed: bool| {
                finalists
                    .iter()
                    .filter(significant)
                    .filter(|c| c.candidate.is_listed() == listed)
                    .max_by(|a, b| score(a).total_cmp(&score(b)))
            };
            let best = match (best_of(true), best_of(false)) {
                (Some(a), Some(b)) if score(b) > score(a) + PREFERENCE => b,
                (Some(a), _) => a,
                (None, Some(b)) => b,
                (None, None) => {
                    let more = exchanges < EXCHANGES;
                    if more && self.exchange(&mut chosen, &mut now, given, &may)? {
                        exchanges += 1;
                        continue;
                    }
                    break;
                }
            };
            let mut best = best.clone();
            best.alternatives = finalists
                .iter()
                .filter(|c| c.candidate.id() != best.candidate.id())
                .filter(|c| score(&best) - score(c) < CONFUSED && significant(c))
                .map(|c| Alternative::of(&c.candidate, score(&best) - score(c)))
                .collect();
            chosen.push(best);
            let before: Vec<String> = chosen.iter().map(|c| c.candidate.id()).collect();
            let Some(fit) = self.fit(&chosen) else {
                // Whether the rows determine it beside the others depends on the noise estimate; with this one they do not.
                gone.extend(chosen.pop().map(|c| c.candidate.id()));
                continue;
            };
            now = fit;
            self.again(&mut chosen, &mut now)?;
            let stays = |id: &String| chosen.iter().any(|c| c.candidate.id() == *id);
            gone.extend(before.into_iter().filter(|id| !stays(id)));
        }
        Some(Found {
            chosen,
            fit: now,
            superfluous: gone,
        })
    }

    /// Replaces one of the chosen, from the `first` on, by a named effect if that raises the score of the whole model. Returns whether
    /// it did.
    ///
    /// In a stepwise search the first effect takes the share of others: a lagging thermal bias was found as a thermal bias, a warm-up
    /// and a drift, beside which the lag was not significant.
    fn exchange(
        &self,
        chosen: &mut Vec<Chosen>,
        now: &mut Fitted,
        first: usize,
        may: &impl Fn(&Candidate) -> bool,
    ) -> Option<bool> {
        let mut best: Option<(f64, usize, Chosen)> = None;
        for k in first..chosen.len() {
            let (mut one, rest) = (chosen[k].clone(), without(chosen, k));
            let null = self.fit(&rest)?;
            one.drop = (null.deviance - now.deviance).max(0.0);
            let rivals = self.others(&rest, &null).into_iter();
            let rivals = rivals.filter(|r| r.p < FALSE_LISTED && may(&r.candidate));
            let rival = rivals
                .filter(|r| !r.candidate.is_variant_of(&one.candidate))
                .max_by(|a, b| score(a).total_cmp(&score(b)));
            let Some(mut rival) = rival else { continue };
            let gain = score(&rival) - score(&one);
            if gain > EXCHANGED && best.as_ref().is_none_or(|b| gain > b.0) {
                rival.alternatives = vec![Alternative::of(&one.candidate, gain)];
                best = Some((gain, k, rival));
            }
        }
        let Some((_, k, rival)) = best else {
            return Some(false);
        };
        let mut there = chosen.clone();
        there[k] = rival;
        let Some(fit) = self.fit(&there) else {
            return Some(false);
        };
        (*chosen, *now) = (there, fit);
        self.again(chosen, now)?;
        Some(true)
    }

    /// Tests each of the chosen again beside the others, and removes those that the others made superfluous.
    fn again(&self, chosen: &mut Vec<Chosen>, now: &mut Fitted) -> Option<()> {
        let mut i = 0;
        while i < chosen.len() && chosen.len() > 1 {
            let (drop, p, without) = self.without(chosen, i, now)?;
            let listed = chosen[i].candidate.is_listed();
            if p > if listed { FALSE_LISTED } else { FALSE_FOUND } {
                chosen.remove(i);
                *now = without;
                i = 0;
            } else {
                (chosen[i].drop, chosen[i].p) = (drop, p);
                i += 1;
            }
        }
        Some(())
    }

    /// For chosen effect `k` beside the others: the drop in deviance, its probability by chance corrected for the number of tests, and
    /// the fit without it.
    pub(in crate::diagnose) fn without(
        &self,
        chosen: &[Chosen],
        k: usize,
        now: &Fitted,
    ) -> Option<(f64, f64, Fitted)> {
        let (one, rest) = (&chosen[k], without(chosen, k));
        let null = self.fit(&rest)?;
        let columns = self.model(&rest).ncols();
        let drop = (null.deviance - now.deviance).max(0.0);
        let p = self.chance(drop, one.columns.ncols(), columns, &one.candidate);
        Some((drop, p, null))
    }
}
