//! Errors of segments that were held out, over what a model believes, and the judgement that follows.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::component::FILTER;
use super::likelihood::{Innovation, Model, Session};
use super::{Consistency, Nees, OF_FILTER};
use crate::calibration::Calibration;
use crate::judgement::{Judgement, JudgementKind};

/// The first segments of a session show the biases, and are not judged.
const NOT_JUDGED: usize = 3;
/// Between these a filter is called consistent, whatever chance allows.
const CONSISTENT: [f64; 2] = [0.8, 1.25];
/// With fewer degrees of freedom held out, chance alone explains almost any error.
const FEWEST_DOF: usize = 40;
/// Segments of a half are neighbours in groups of this: with a trajectory, one of each length.
const GROUP: usize = 4;

/// Errors of each half of the segments, by the densities that the other half shows.
pub(super) fn consistency(session: &Session) -> Consistency {
    let moving = session.moving();
    let group = if session.mounted { GROUP } else { 1 };
    let half_of = |index: usize| {
        let at = moving.iter().position(|m| *m == index);
        at.map(|at| at / group % 2)
    };
    let mut sums = [(0.0, 0_usize); 3];
    for half in 0..2 {
        let fitted = session.filter_densities(None, |index| half_of(index) != Some(half));
        // The reference errs alike for all: only the unit is judged.
        let mut reference = session.known(false).values;
        reference[FILTER..OF_FILTER.end].copy_from_slice(&fitted.values[FILTER..OF_FILTER.end]);
        let of = |calibration| Model {
            values: reference.clone(),
            calibration,
        };
        let in_use = session.model(&fitted, false);
        for (sum, model) in sums.iter_mut().zip([of(false), of(true), in_use]) {
            let innovations = session.innovations(&model).unwrap_or_default();
            let held = |own: &&Innovation| half_of(own.segment) == Some(half);
            for own in innovations.iter().skip(NOT_JUDGED).filter(held) {
                *sum = (sum.0 + own.squared, sum.1 + own.count);
            }
        }
    }
    let [allan, with_calibration, in_use] = sums.map(|(squared, dof)| Nees::of(squared, dof));
    Consistency {
        allan,
        with_calibration,
        in_use,
    }
}

impl Nees {
    fn of(squared: f64, dof: usize) -> Self {
        let n = dof.max(1) as f64;
        let quantile = |p: f64| ChiSquared::new(n).map_or(f64::NAN, |c| c.inverse_cdf(p)) / n;
        Self {
            value: squared / n,
            by_chance: [quantile(0.025), quantile(0.975)],
            dof,
        }
    }

    /// Whether it is 1 to what chance allows, or to a quarter.
    fn is_consistent(&self) -> bool {
        let [low, high] = [0, 1].map(|k| match k {
            0 => self.by_chance[0].min(CONSISTENT[0]),
            _ => self.by_chance[1].max(CONSISTENT[1]),
        });
        (low..=high).contains(&self.value)
    }
}

/// The estimates did not settle: what is linear about them is not about the truth.
pub(super) fn not_settled() -> Judgement {
    let reason = "biases, mounting and clock do not settle: --trajectory-zero has to be right to 0.1 s, and the quaternions rotate from the unit to a frame whose z points up";
    Judgement::new(JudgementKind::Suspect, reason)
}

/// Whether the densities may be used. `sha256`: of the samples.
pub(super) fn judgement(
    session: &Session,
    nees: &Consistency,
    sha256: &str,
    calibration: &Calibration,
) -> Judgement {
    let in_sample = calibration.recording.sha256.as_deref() == Some(sha256);
    let Nees { value, dof, .. } = nees.in_use;
    if in_sample {
        let reason = "the calibration was made from this recording, whose errors it hides: give another one of the unit";
        return Judgement::new(JudgementKind::Untested, reason);
    }
    if dof < FEWEST_DOF {
        let reason = format!(
            "{} segments show too little: record more motions between rests, or a longer trajectory",
            session.moving().len()
        );
        return Judgement::new(JudgementKind::Untested, reason);
    }
    let figure = format!(
        "the squared errors of held-out segments are {value:.2} times what these densities say, and {} times what Allan's say",
        crate::quantity::significant(nees.allan.value)
    );
    match nees.in_use.is_consistent() {
        true => Judgement::new(JudgementKind::Good, figure),
        false => Judgement::new(JudgementKind::Unexplained, figure),
    }
}
