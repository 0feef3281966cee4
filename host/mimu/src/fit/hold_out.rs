//! Holding out parts of a recording: the rest is fitted, and the part is judged.

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
    /// Every n-th dwell, for n parts. It is used if one block contains what nothing else determines, such as all slanted poses or the whole warm-up.
    Interleaved,
}

impl Split {
    /// The part, of `parts`, to which item `i` of `n` belongs, in order of time. Sizes of blocks differ by one at most, the larger ones first, as is
    /// common in k-fold cross-validation, so that figures compare.
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
    /// How the recording is split.
    pub split: Split,
    /// Number of parts.
    pub parts: usize,
    /// Number of parts that were held out.
    pub count: usize,
    /// Why they are not blocks, or why some parts were not held out.
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
pub(super) struct Refits<T> {
    /// How the recording is split.
    pub split: Split,
    /// One for each part.
    pub refits: Vec<Result<T, Failure>>,
    /// Why the parts are not blocks, and why some were not held out.
    pub reasons: Vec<Warning>,
}

/// The parts that cannot be held out, and why the first of them cannot.
fn not_held_out<T>(blocks: bool, refits: &[Result<T, Failure>]) -> Option<Warning> {
    let failed = refits.iter().enumerate();
    let failed = failed.filter_map(|(part, refit)| Some((part + 1, refit.as_ref().err()?)));
    let (parts, failures): (Vec<usize>, Vec<&Failure>) = failed.unzip();
    let problem = failures.first()?.problem();
    Some(Warning::NotHeldOut {
        blocks,
        parts,
        why: problem,
    })
}

impl<T: Send> Refits<T> {
    /// Fits without each of `parts` blocks, in parallel. If some blocks cannot be held out, it tries every n-th dwell instead, and keeps this if
    /// fewer parts fail.
    pub fn of(
        parts: usize,
        refit: impl Fn(Split, usize) -> Result<T, Failure> + Sync + Send,
    ) -> Self {
        let cut = |split: Split| -> Vec<Result<T, Failure>> {
            let refits = (0..parts).into_par_iter().map(|part| refit(split, part));
            refits.collect()
        };
        let blocks = cut(Split::Blocks);
        let Some(why) = not_held_out(true, &blocks) else {
            return Self {
                split: Split::Blocks,
                refits: blocks,
                reasons: Vec::new(),
            };
        };
        let failed = |refits: &[Result<T, Failure>]| refits.iter().filter(|r| r.is_err()).count();
        let interleaved = cut(Split::Interleaved);
        if failed(&interleaved) < failed(&blocks) {
            let mut reasons = vec![Warning::Interleaved {
                one_in: parts,
                why: Box::new(why),
            }];
            reasons.extend(not_held_out(false, &interleaved));
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

    /// The fit without `part`.
    pub fn without(&self, part: usize) -> Option<&T> {
        self.refits.get(part)?.as_ref().ok()
    }
}

impl<T> From<Refits<T>> for HoldOut {
    fn from(held: Refits<T>) -> Self {
        Self {
            split: held.split,
            parts: held.refits.len(),
            count: held.refits.iter().filter(|r| r.is_ok()).count(),
            reasons: held.reasons,
        }
    }
}

/// Without a part, its predictions may be uncertain by this many times the residual in sample.
const OPEN: f64 = 10.0;

/// Refuses a fit without a part if its predictions for the part are far more uncertain than the residual in sample, `typical`. The error would
/// measure the split: one block contained all slanted poses of a recording, and the held-out error was 2451 mm/s². `open` are the variances of the
/// predictions by the parameters, for the same quantity as `typical`, both in the unit of `figure`.
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
