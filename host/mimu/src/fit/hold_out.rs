//! Holding parts of a recording out: the rest is fitted, and the part judged.

use rayon::prelude::*;
use serde::Serialize;

use crate::estimate::Failure;
use crate::quantity::{Figure, Sensor, significant};
use crate::warning::Warning;

/// How dwells are held out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Split {
    /// Contiguous blocks of time.
    Blocks,
    /// Every so manieth dwell: where one block holds what nothing else determines, like all slanted poses or the whole warm-up.
    Interleaved,
}

impl Split {
    /// The one of `parts` parts that item `i` of `n` falls into, in order of time. Sizes of blocks differ by one at most, the larger
    /// ones first (as k-fold cross-validation is commonly cut, so that figures compare).
    pub fn part(self, i: usize, n: usize, parts: usize) -> usize {
        if parts == 0 {
            return 0;
        }
        if self == Self::Interleaved {
            return i % parts;
        }
        let (small, larger) = (n / parts, n % parts);
        let in_larger = larger * (small + 1);
        if i < in_larger {
            i / (small + 1)
        } else {
            larger + (i - in_larger) / small.max(1)
        }
    }
}

/// How the parts of a recording were held out.
#[derive(Debug, Clone, PartialEq)]
pub struct HoldOut {
    /// How they are cut.
    pub split: Split,
    /// How many there are.
    pub parts: usize,
    /// How many of them were held out.
    pub count: usize,
    /// Why not in blocks, or why some parts were not held out.
    pub reasons: Vec<Warning>,
}

impl HoldOut {
    /// Nothing was held out.
    pub(super) fn none() -> Self {
        Self {
            split: Split::Blocks,
            parts: 0,
            count: 0,
            reasons: Vec::new(),
        }
    }
}

/// Fits without each part.
pub(super) struct HeldOut<T> {
    /// How the parts are cut.
    pub split: Split,
    /// One for each part.
    pub refits: Vec<Result<T, Failure>>,
    /// Why not in blocks, and why some parts are not held out.
    pub reasons: Vec<Warning>,
}

/// Which parts cannot be held out, and why the first of them cannot.
fn cannot<T>(blocks: bool, refits: &[Result<T, Failure>]) -> Option<Warning> {
    let failed = refits.iter().enumerate();
    let failed = failed.filter_map(|(part, refit)| Some((part + 1, refit.as_ref().err()?)));
    let (parts, failures): (Vec<usize>, Vec<&Failure>) = failed.unzip();
    let problem = failures.first()?.problem();
    Some(Warning::NotHeldOut(blocks, parts, problem))
}

impl<T: Send> HeldOut<T> {
    /// Fits without each of `parts` blocks, side by side; where some cannot be held out, without every so manieth dwell instead if that
    /// leaves fewer out.
    pub fn of(
        parts: usize,
        refit: impl Fn(Split, usize) -> Result<T, Failure> + Sync + Send,
    ) -> Self {
        let cut = |split: Split| -> Vec<Result<T, Failure>> {
            let refits = (0..parts).into_par_iter().map(|part| refit(split, part));
            refits.collect()
        };
        let blocks = cut(Split::Blocks);
        let Some(why) = cannot(true, &blocks) else {
            return Self {
                split: Split::Blocks,
                refits: blocks,
                reasons: Vec::new(),
            };
        };
        let failed = |refits: &[Result<T, Failure>]| refits.iter().filter(|r| r.is_err()).count();
        let interleaved = cut(Split::Interleaved);
        if failed(&interleaved) < failed(&blocks) {
            let mut reasons = vec![Warning::Interleaved(parts, Box::new(why))];
            reasons.extend(cannot(false, &interleaved));
            return Self {
                split: Split::Interleaved,
                refits: interleaved,
                reasons,
            };
        }
        Self {
            split: Split::Blocks,
            refits: blocks,
            reasons: vec![why],
        }
    }

    /// The fit that has not seen `part`.
    pub fn without(&self, part: usize) -> Option<&T> {
        self.refits.get(part)?.as_ref().ok()
    }
}

impl<T> From<HeldOut<T>> for HoldOut {
    fn from(held: HeldOut<T>) -> Self {
        Self {
            split: held.split,
            parts: held.refits.len(),
            count: held.refits.iter().filter(|r| r.is_ok()).count(),
            reasons: held.reasons,
        }
    }
}

/// By how many times what noise and model leave in sample a fit without a part may leave it open.
const OPEN: f64 = 10.0;

/// Refuses a fit whose parameters leave a part open by much more than what is left in sample, `typical`: its error is that of the cut. One
/// block held all slanted poses of a recording, and the held-out error was 2451 mm/s². `open` are the variances of the part's
/// rows by the parameters, of the size that `typical` is of, both in the unit of `figure`.
pub(super) fn determined(
    open: impl Iterator<Item = f64>,
    typical: f64,
    (figure, sensor): (Figure, Sensor),
) -> Result<(), Failure> {
    let (count, sum) = open.fold((0.0, 0.0), |(n, sum), v| (n + 1.0, sum + v));
    let open = (sum / f64::max(count, 1.0)).sqrt();
    if open <= OPEN * typical {
        return Ok(());
    }
    let (factor, unit) = figure.readable(sensor);
    let [open, typical] = [open, typical].map(|v| significant(v * factor));
    let problem = format!(
        "predictions for it are uncertain by {open} {unit}, and the residual in sample is {typical} {unit}"
    );
    Err(Failure::NoSolution(problem))
}
