//! From the rows of one sensor to a verdict: what is tried, what is accepted, what is left.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::candidate::{Candidate, Kind, Monomial};
use super::library;
use super::rows::Rows;
use super::search::{Chosen, Search};
use super::spread::{By, Fitted, Spread};

/// Contiguous blocks that are left out in turn.
const BLOCKS: usize = 4;
/// An effect whose coefficient of the size of a data sheet would not be this many sigmas is not excited.
const EXCITED: f64 = 3.0;
/// One dwell that has more than this share in what an effect rests on decides it alone.
const LEVERAGE: f64 = 0.7;
/// A bias that wanders by this many times the noise of a dwell mean is told of even where nobody has recorded how far it may: sensors
/// of the usual kind wander by up to three in half an hour.
const WANDERS: f64 = 4.0;
/// Probability that the rows of a clean sensor scatter so much that structure is told of.
pub const FALSE_LEFTOVER: f64 = 1e-3;

/// An accepted effect with its coefficients.
#[derive(Debug, Clone)]
pub struct Accepted {
    /// The candidate, its form and how it was found.
    pub chosen: Chosen,
    /// Coefficients, SI, in the order of the candidate's active ones.
    pub values: DVector<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
    /// Held-out root mean square without it and with it, beside the others.
    pub held_out: [f64; 2],
    /// How it was held out.
    pub split: Split,
}

/// Structure that is left.
#[derive(Debug, Clone)]
pub struct Leftover {
    /// Stratum: an axis, `turns`.
    pub stratum: String,
    /// Axis, if it is of one.
    pub axis: Option<usize>,
    /// What it goes with, if with anything.
    pub against: String,
    /// Root mean square beyond the noise, unit of the rows.
    pub strength: f64,
}

/// What was decided on one sensor.
#[derive(Debug, Clone)]
pub struct Decision {
    /// Accepted effects.
    pub accepted: Vec<Accepted>,
    /// Effects that were found and not accepted, with the reason; and the best of those that were not found.
    pub rejected: Vec<(String, String)>,
    /// Effects that the experiment could not show, with what would.
    pub not_excited: Vec<(String, String)>,
    /// Structure that is left.
    pub leftover: Vec<Leftover>,
    /// Root mean square of the judged rows before and after, in sample.
    pub rms: [f64; 2],
    /// The same held out; not a number where no block could be.
    pub held_out_rms: [f64; 2],
    /// How they were held out.
    pub split: Split,
    /// What noise alone would leave.
    pub noise_floor: f64,
    /// Probability of chance that the rows before scatter as they do, by the known noise alone.
    pub omnibus_p: f64,
}

/// Root mean square of the judged rows; of `judged.1` rows a dwell or turn.
fn rms(rows: &Rows, residuals: &DVector<f64>) -> f64 {
    let (count, together) = rows.judged;
    (residuals.rows(0, count).norm_squared() / (count / together) as f64).sqrt()
}

/// How dwells are held out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Split {
    /// Contiguous blocks of time.
    Blocks,
    /// Every so manieth dwell: for what is seen in one block only, like a warm-up, which nothing else determines.
    Interleaved,
}

impl Split {
    /// Part that dwell `d` of so many is in.
    fn part(self, d: usize, dwells: usize) -> usize {
        match self {
            Self::Blocks => d * BLOCKS / dwells.max(1),
            Self::Interleaved => d % BLOCKS,
        }
    }
}

fn dwells(rows: &Rows) -> usize {
    let all = (0..rows.y.len()).flat_map(|r| rows.dwells(r));
    1 + all.max().unwrap_or(0)
}

/// Held-out residuals of the judged rows: each by a model that has not seen its block. `None` where what is left of the
/// experiment does not determine the model.
fn held_out(
    search: &Search,
    model: &DMatrix<f64>,
    at: &Fitted,
    split: Split,
) -> Option<DVector<f64>> {
    let rows = search.rows;
    let dwells = dwells(rows);
    let parts_of = |r: usize| rows.dwells(r).map(|d| split.part(d, dwells));
    let mut out = DVector::zeros(rows.y.len());
    for block in 0..BLOCKS {
        let kept: Vec<usize> = (0..rows.y.len())
            .filter(|r| !parts_of(*r).contains(&block))
            .collect();
        let parts = search.spread.kept(&at.components, &kept)?;
        let white = parts.whiten(&model.select_rows(&kept));
        let y = parts.whiten(&DMatrix::from_fn(kept.len(), 1, |i, _| rows.y[kept[i]]));
        let svd = white.svd(true, true);
        let most = svd.singular_values.max();
        if svd.singular_values.min() < 1e-7 * most {
            return None;
        }
        let solution = svd.solve(&y, 0.0).ok()?;
        // A turn into the block is of it; one out of it is of the next, and is judged there.
        for r in (0..rows.y.len()).filter(|r| parts_of(*r)[1] == block) {
            out[r] = rows.y[r] - (model.row(r) * &solution)[(0, 0)];
        }
    }
    Some(out)
}

/// Largest shares of one dwell, and of one block of time, in what the columns of an effect rest on.
fn leverage(rows: &Rows, others: &DMatrix<f64>, columns: &DMatrix<f64>) -> [f64; 2] {
    let q = others.clone().qr().q();
    let z = columns - &q * q.tr_mul(columns);
    let count = dwells(rows);
    let mut worst = [0.0_f64; 2];
    for column in z.column_iter() {
        let mut by = [vec![0.0; count], vec![0.0; BLOCKS]];
        for (r, v) in column.iter().enumerate() {
            let dwell = rows.dwells(r)[1];
            by[0][dwell] += v * v;
            by[1][Split::Blocks.part(dwell, count)] += v * v;
        }
        for (worst, by) in worst.iter_mut().zip(by) {
            let total: f64 = by.iter().sum();
            *worst = worst.max(by.into_iter().fold(0.0, f64::max) / total);
        }
    }
    worst
}

/// Everything that is tried on a sensor, and the effects that its experiment does not show.
fn candidates(rows: &Rows, dwell_ends: &[f64]) -> (Vec<Candidate>, Vec<(String, String)>) {
    let sensor = rows.sensor;
    let mut all = Vec::new();
    let mut not_excited = Vec::new();
    // Excitation is judged by the known noise.
    let plain = Search::new(rows, Vec::new());
    let Some(whitener) = plain.spread.whitener(&plain.spread.none()) else {
        return (all, not_excited);
    };
    let q = whitener.whiten(&plain.basis).qr().q();
    let across = |columns: &DMatrix<f64>| {
        let white = whitener.whiten(columns);
        let z = &white - &q * q.tr_mul(&white);
        // Of what the affine parameters span rounding leaves a little.
        DVector::from_fn(z.ncols(), |k, _| {
            let (left, all) = (z.column(k).norm(), white.column(k).norm());
            if left > 1e-6 * all { left } else { 0.0 }
        })
    };
    for effect in library::all().filter(|e| e.sensor == sensor) {
        let mut candidate = Candidate::new(sensor, Kind::Effect(effect));
        let mut best = vec![0.0_f64; effect.coefficients.len()];
        for form in candidate.forms() {
            let seen = across(&candidate.columns(rows, form));
            for (best, (seen, typical)) in best.iter_mut().zip(seen.iter().zip(effect.typical)) {
                if seen.is_finite() {
                    *best = best.max(seen * typical);
                }
            }
        }
        candidate.active.retain(|k| best[*k] > EXCITED);
        if candidate.active.is_empty() {
            not_excited.push((effect.id.into(), effect.needs.into()));
        } else {
            all.push(candidate);
        }
    }
    for monomial in Monomial::all() {
        let first = Candidate::new(sensor, Kind::Term(0, monomial.clone()));
        for axis in 0..3 {
            let candidate = Candidate {
                kind: Kind::Term(axis, monomial.clone()),
                ..first.clone()
            };
            let columns = candidate.columns(rows, 0.0);
            if columns.iter().all(|v| v.is_finite()) && across(&columns)[0] > 0.0 {
                all.push(candidate);
            }
        }
    }
    for &t_s in dwell_ends {
        all.extend((0..3).map(|axis| Candidate::new(sensor, Kind::Jump(axis, t_s))));
    }
    (all, not_excited)
}

/// Decides on the rows of one sensor; `dwell_ends` are the times between dwells, where a bias may have jumped, s.
pub fn decide(rows: &Rows, dwell_ends: &[f64]) -> Option<Decision> {
    let (all, not_excited) = candidates(rows, dwell_ends);
    let search = Search::new(rows, all);
    let null = search.fit(&[])?;
    let known = search.spread.fit_at(&search.basis, &search.spread.none())?;
    let dof = (rows.y.len() - search.basis.ncols()) as f64;
    let omnibus_p = ChiSquared::new(dof).map_or(1.0, |d| d.sf(known.chi2));
    let (chosen, mut with) = search.run()?;
    let mut rejected = Vec::new();
    let mut kept: Vec<Chosen> = Vec::new();
    let mut jumps = Vec::new();
    for one in chosen {
        match one.candidate.kind {
            Kind::Jump(..) => jumps.push(one),
            _ => kept.push(one),
        }
    }
    // What does not hold out goes, the least worth first.
    let held_rms = |chosen: &[Chosen], fit: &Fitted, split: Split| {
        held_out(&search, &search.model(chosen), fit, split).map(|r| rms(rows, &r))
    };
    // All rates in one block of time, and without it there is no calibration.
    let usual = match held_rms(&[], &null, Split::Blocks) {
        Some(_) => Split::Blocks,
        None => Split::Interleaved,
    };
    let split_of = |rest: &[Chosen], one: &Chosen, with: &Fitted| {
        let [dwell, block] = leverage(rows, &search.model(rest), &one.columns);
        let mut all = rest.to_vec();
        all.push(one.clone());
        let alone = block > LEVERAGE || held_rms(&all, with, usual).is_none();
        (dwell, if alone { Split::Interleaved } else { usual })
    };
    loop {
        let mut worst: Option<(usize, String)> = None;
        for i in (0..kept.len()).rev() {
            let mut rest = kept.clone();
            let one = rest.remove(i);
            let (share, split) = split_of(&rest, &one, &with);
            let without = search.fit(&rest)?;
            let [a, b] = [
                held_rms(&rest, &without, split),
                held_rms(&kept, &with, split),
            ];
            let why = match (a, b) {
                _ if share > LEVERAGE => {
                    format!("it rests to {:.0} % on one dwell", 100.0 * share)
                }
                (Some(a), Some(b)) if !(b < a) => {
                    format!("the held-out error does not go down: {a:.3e} without, {b:.3e} with")
                }
                (_, None) => "what is left when a block is held out does not determine it".into(),
                _ => continue,
            };
            worst = Some((i, why));
            break;
        }
        let Some((i, why)) = worst else { break };
        rejected.push((kept.remove(i).candidate.id(), why));
        with = search.fit(&kept)?;
    }
    let model = search.model(&kept);
    let last = search
        .spread
        .fit(&model, &with.components, By::Restricted)?;
    let mut accepted = Vec::new();
    let mut from = search.basis.ncols();
    for (i, one) in kept.iter().enumerate() {
        let count = one.columns.ncols();
        let mut rest = kept.clone();
        rest.remove(i);
        let without = search.fit(&rest)?;
        let (_, split) = split_of(&rest, one, &with);
        let held = [
            held_rms(&rest, &without, split),
            held_rms(&kept, &with, split),
        ];
        accepted.push(Accepted {
            chosen: one.clone(),
            split,
            values: last.coefficients.rows(from, count).into_owned(),
            covariance: last
                .covariance
                .view((from, from), (count, count))
                .into_owned(),
            held_out: held.map(|h| h.unwrap_or(f64::NAN)),
        });
        from += count;
    }
    for one in search.others(&kept, &with) {
        let id = one.candidate.id();
        if rejected.iter().any(|r: &(String, String)| r.0 == id) {
            continue;
        }
        let mut more = kept.clone();
        more.push(one.clone());
        let held = search
            .fit(&more)
            .and_then(|f| Some((f.clone(), held_rms(&more, &f, usual)?)))
            .map(|(f, held)| {
                (
                    rms(rows, &(&rows.y - search.model(&more) * &f.coefficients)),
                    held,
                )
            });
        let now = (
            rms(rows, &(&rows.y - search.model(&kept) * &with.coefficients)),
            held_rms(&kept, &with, usual),
        );
        let chance = match one.p {
            p if p > 0.5 => "no better than chance".to_string(),
            p => format!("by chance once in {:.0}", 1.0 / p),
        };
        let figures = match (held, now) {
            (Some((sample, held)), (before, Some(out))) => format!(
                "; in sample {before:.3e} to {sample:.3e}, held out {out:.3e} to {held:.3e}"
            ),
            _ => String::new(),
        };
        rejected.push((id, chance + &figures));
    }
    let residuals = |fit: &Fitted, model: &DMatrix<f64>| &rows.y - model * &fit.coefficients;
    let base = search
        .spread
        .fit(&search.basis, &null.components, By::Restricted)?;
    let left = leftover(&search, &model, &last, &jumps);
    // One way for all of them, so that the figures compare.
    let split = match accepted.iter().any(|a| a.split == Split::Interleaved) {
        true => Split::Interleaved,
        false => usual,
    };
    let held = |chosen: &[Chosen], fit: &Fitted| held_rms(chosen, fit, split).unwrap_or(f64::NAN);
    let floor: f64 = rows.strata.iter().map(|s| known_in(s, rows.judged.0)).sum();
    Some(Decision {
        rms: [
            rms(rows, &residuals(&base, &search.basis)),
            rms(rows, &residuals(&last, &model)),
        ],
        held_out_rms: [held(&[], &null), held(&kept, &last)],
        split,
        noise_floor: (floor / (rows.judged.0 / rows.judged.1) as f64).sqrt(),
        accepted,
        rejected,
        not_excited,
        leftover: left,
        omnibus_p,
    })
}

fn known_in(stratum: &super::rows::Stratum, judged: usize) -> f64 {
    let rows = stratum.rows.clone().take_while(|r| *r < judged).count();
    stratum.known.diagonal().rows(0, rows).sum()
}

/// Scatter beyond the known noise, stratum by stratum, and what it goes with.
fn leftover(
    search: &Search,
    model: &DMatrix<f64>,
    last: &Fitted,
    jumps: &[Chosen],
) -> Vec<Leftover> {
    let rows = search.rows;
    let mut left = Vec::new();
    let spread = Spread::new(rows, true);
    let Some(last) = spread.fit(model, &last.components, By::Likelihood) else {
        return left;
    };
    for (s, stratum) in rows.strata.iter().enumerate() {
        let (excess, walk) = (last.components.excess[s], last.components.walk[s]);
        let unit = stratum.walk.as_ref().map_or(0.0, |w| w.diagonal().mean());
        let strength = (excess + walk * unit).sqrt();
        let jump = jumps
            .iter()
            .find(|j| j.candidate.axes().first().copied() == stratum.axis);
        // Without the components of this stratum: does the known noise do? A bias wanders, and while nobody has recorded
        // by how much, that it does is no news.
        let mut bare = last.components.clone();
        bare.excess[s] = 0.0;
        if stratum.wander_known {
            bare.walk[s] = 0.0;
        }
        let Some(bare) = spread.fit_at(model, &bare) else {
            continue;
        };
        let worse = bare.deviance - last.deviance;
        // Two components at the edge of what they can be: chi-square of two degrees of freedom is on the safe side.
        let p = (-0.5 * worse).exp() * rows.strata.len() as f64;
        let floor = stratum.known.diagonal().mean().sqrt();
        let wanders_far = !stratum.wander_known && strength > WANDERS * floor;
        if p > FALSE_LEFTOVER && jump.is_none() && !wanders_far {
            continue;
        }
        let against = match jump {
            Some(jump) => jump.candidate.id(),
            None if walk * unit > excess => "time: the bias wanders".into(),
            None => "no quantity recorded: the dwells do not repeat".into(),
        };
        left.push(Leftover {
            stratum: stratum.name.clone(),
            axis: stratum.axis,
            against,
            strength,
        });
    }
    left
}
