//! Sessions that contradict themselves.
//!
//! A session that lost samples in some turns fits no parameters. Its values are off by what the fault makes of them, and two such sessions are off alike: in pairs
//! they look like a step of the unit. Whether a fault or the model is to blame, only the other sessions show. What the model lacks, all sessions of a unit lack.

use crate::fit::Fit;
use crate::judge::errors::{self, ErrorFigures, UNEXPLAINED_SHARE};

/// A session contradicts itself if its error, in noise, is this many times that of another session (at least its noise). The model lacks the same in all
/// nine sessions of eight MPU-9150, and there the largest error is 3.9 times the least. What is left out has a 25th of the other's weight or less.
const WORSE: f64 = 5.0;

/// The worst error of a session, in noise; without end if it is a misfit, and that of noise if the noise is unknown.
fn worst(fit: &Fit) -> Option<(f64, ErrorFigures)> {
    let of = |figures: ErrorFigures| {
        let misfit = !(figures.share() <= UNEXPLAINED_SHARE);
        let error = if misfit {
            f64::INFINITY
        } else {
            figures.test.map_or(1.0, |test| test.ratio).max(1.0)
        };
        (error, figures)
    };
    let all = fit.sensors.iter().map(|s| of(ErrorFigures::of_fit(fit, s)));
    all.max_by(|a, b| a.0.total_cmp(&b.0))
}

/// For each session that contradicts itself, by which error.
pub(super) fn reasons(fits: &[Fit]) -> Vec<Option<String>> {
    let all: Vec<_> = fits.iter().map(worst).collect();
    let mut order: Vec<usize> = (0..fits.len()).filter(|s| all[*s].is_some()).collect();
    let error = |s: usize| all[s].as_ref().map_or(1.0, |w| w.0);
    order.sort_by(|a, b| error(*a).total_cmp(&error(*b)));
    let mut reasons = vec![None; fits.len()];
    for (rank, s) in order.iter().enumerate() {
        // With all its sensors: no sensor is left without a session, and none is compared with an easier one.
        let has_all = |o: usize| {
            fits[*s]
                .sensors
                .iter()
                .all(|own| fits[o].sensor(own.sensor).is_some())
        };
        let better = |o: usize| reasons[o].is_none() && error(*s) > WORSE * error(o);
        if order[..rank].iter().any(|o| better(*o) && has_all(*o)) {
            let figures = all[*s].as_ref().map(|w| w.1.clone());
            reasons[*s] = figures.map(|f| errors::judge(&[f]).reason);
        }
    }
    reasons
}
