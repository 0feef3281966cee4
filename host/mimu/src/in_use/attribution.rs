//! Which causes the errors beyond Allan's noise have, by likelihood, and the sentences that say so.

use nalgebra::{Cholesky, Matrix3};
use rayon::prelude::*;

use super::closure::Closure;
use super::component::{Cause, Component, FILTER, Kind};
use super::estimates::Smoothed;
use super::likelihood::{Model, Session};
use super::{CauseFound, Density};
use crate::quantity::{PerSensor, Sensor, significant};
use crate::readable::STANDARD_GRAVITY;
use crate::variance_search::Fitted;

/// Rise of the log-likelihood that a cause has to make: by chance one of the fifteen makes it in one recording of fifty.
const RISE: f64 = 3.0;
/// Standard deviations of an element of a matrix whose error is seen: by chance one of nine is in one recording of forty.
const SEEN: f64 = 3.0;
/// Causes that are looked for, one after the other.
const MOST: usize = 8;
/// Candidates that are fitted together with those found before.
const CLOSE: usize = 3;
/// Below this factor nothing is inflated.
const INFLATED: f64 = 1.1;

/// Causes, and the share of the calibration's own uncertainty.
pub(super) struct Attributed {
    pub causes: Vec<CauseFound>,
    pub share_of_calibration: PerSensor<f64>,
}

/// The causes that the segments of `session` show, beside Allan's noise and the uncertainty of the calibration: forward selection.
pub(super) fn of(session: &Session) -> Attributed {
    let search = session.search(true, |_| true);
    let mut best = search.fitted(session.known(true).values);
    let mut included: Vec<(usize, f64)> = Vec::new();
    let mut unseen: Vec<usize> = Vec::new();
    while included.len() < MOST {
        let free: Vec<usize> = included.iter().map(|(k, _)| *k).collect();
        let candidates =
            (0..session.components.len()).filter(|k| !free.contains(k) && !unseen.contains(k));
        let candidates: Vec<usize> = candidates.collect();
        let tried = candidates.into_par_iter();
        let tried = tried.map(|k| (k, search.along(best.clone(), k, None)));
        let mut tried: Vec<(usize, Fitted)> = tried.collect();
        tried.sort_by(|a, b| b.1.log_likelihood.total_cmp(&a.1.log_likelihood));
        // With the others fitted anew, one that was close behind may be better.
        let tried = tried.into_par_iter().take(CLOSE).map(|(k, along)| {
            let mut with = free.clone();
            with.push(k);
            (k, search.maximise(along, &with))
        });
        let next = tried.max_by(|a, b| a.1.log_likelihood.total_cmp(&b.1.log_likelihood));
        let Some((k, fitted)) = next else { break };
        let rise = fitted.log_likelihood - best.log_likelihood;
        if rise < RISE {
            break;
        }
        if let Kind::Matrix(sensor) = session.components[k].kind
            && !is_seen(session, &fitted, sensor)
        {
            unseen.push(k);
            continue;
        }
        included.push((k, 2.0 * rise));
        best = fitted;
    }
    attributed(session, &best, &included)
}

fn attributed(session: &Session, best: &Fitted, included: &[(usize, f64)]) -> Attributed {
    let known = session.known(true);
    let [gyro, accel] = Sensor::BOTH.map(|s| share_of_calibration(session, &known, s));
    let powers = included
        .iter()
        .map(|(k, _)| power(session, &known, best, *k));
    let powers: Vec<f64> = powers.collect();
    let of_sensor = |sensor: Option<Sensor>| {
        let own = included.iter().zip(&powers);
        let found: f64 = own
            .filter(|((k, _), _)| session.components[*k].sensor == sensor)
            .map(|(_, p)| p)
            .sum();
        match sensor {
            Some(Sensor::Gyro) => found + gyro,
            Some(Sensor::Accel) => found + accel,
            None => found,
        }
    };
    let mut causes: Vec<CauseFound> = included
        .iter()
        .zip(&powers)
        .filter(|((k, _), _)| best.values[*k] > 0.0)
        .map(|((k, deviance), power)| {
            let component = &session.components[*k];
            CauseFound {
                sensor: component.sensor,
                cause: component.cause,
                size: match &component.kind {
                    Kind::Matrix(sensor) => matrix_error(session, best, *sensor),
                    _ => (component.unit * best.values[*k]).sqrt(),
                },
                unit: unit(component, *k),
                deviance: *deviance,
                share: power / of_sensor(component.sensor).max(f64::MIN_POSITIVE),
            }
        })
        .collect();
    causes.sort_by(|a, b| b.share.total_cmp(&a.share));
    let share = |sensor, own: f64| match of_sensor(Some(sensor)) {
        all if all > 0.0 => own / all,
        _ => 0.0,
    };
    Attributed {
        causes,
        share_of_calibration: PerSensor {
            gyro: share(Sensor::Gyro, gyro),
            accel: share(Sensor::Accel, accel),
        },
    }
}

/// Whether the error of the matrix of `sensor` is itself seen, on an element at least: where the force hardly changes, a large one and a bias are alike.
fn is_seen(session: &Session, fitted: &Fitted, sensor: Sensor) -> bool {
    let estimated = session.smoothed(&session.model(fitted, true));
    let own = estimated.as_ref().and_then(Smoothed::middle);
    own.is_some_and(|own| {
        super::state::matrix(sensor).any(|k| own.value[k].abs() > SEEN * own.sigma[k])
    })
}

/// The estimated relative error of the matrix of `sensor` on its worst axis: the norm of a row of `E`, where `E C` is the error of C.
fn matrix_error(session: &Session, best: &Fitted, sensor: Sensor) -> f64 {
    let estimated = session.smoothed(&session.model(best, true));
    let inverse = session.matrices[sensor].try_inverse();
    let own = estimated.as_ref().and_then(Smoothed::middle);
    let (Some(own), Some(inverse)) = (own, inverse) else {
        return f64::NAN;
    };
    let from = super::state::matrix(sensor).start;
    let error = Matrix3::from_fn(|i, j| own.value[from + 3 * i + j]) * inverse;
    let rows = error.row_iter().map(|row| row.norm());
    rows.fold(0.0, f64::max)
}

/// Errors that component `k` adds, as a sum of squares over those of Allan's noise.
fn power(session: &Session, known: &Model, best: &Fitted, k: usize) -> f64 {
    let value = best.values[k];
    weighted(session, known, |closure| {
        session.unlearned(closure, k) * value
    })
}

fn share_of_calibration(session: &Session, known: &Model, sensor: Sensor) -> f64 {
    let own = super::state::matrix(sensor);
    let p = session
        .calibration
        .view((own.start, own.start), (9, 9))
        .into_owned();
    weighted(session, known, |closure| {
        let by = closure.by.columns(own.start, 9);
        by * &p * by.transpose()
    })
}

fn weighted(
    session: &Session,
    known: &Model,
    of: impl Fn(&Closure) -> nalgebra::DMatrix<f64>,
) -> f64 {
    let moving = session.closures.iter().filter(|c| c.moves);
    let each = moving.filter_map(|closure| {
        let root = Cholesky::new(session.covariance(closure, known))?;
        Some(root.solve(&of(closure)).trace())
    });
    each.sum()
}

/// Unit of the size of a component, whose square root of variance it is.
pub(super) fn unit(component: &Component, k: usize) -> &'static str {
    let gyro = component.sensor == Some(Sensor::Gyro);
    match (component.cause, gyro) {
        (Cause::White, true) => "rad/s/sqrt(Hz)",
        (Cause::White, false) => "m/s^2/sqrt(Hz)",
        (Cause::Walk, true) => "rad/s^2/sqrt(Hz)",
        (Cause::Walk, false) => "m/s^3/sqrt(Hz)",
        (Cause::Scale | Cause::Motion, _) => "1",
        (Cause::GSensitivity, _) => "rad/s/(m/s^2)",
        (Cause::Rectification, true) => "rad/s/(m/s^2)^2",
        (Cause::Rectification, false) => "m/s^2/(m/s^2)^2",
        (Cause::Vibration, true) => "rad/s/sqrt(Hz)/(m/s^2)",
        (Cause::Vibration, false) => "m/s^2/sqrt(Hz)/(m/s^2)",
        (Cause::Reference, _) if k == FILTER => "rad",
        (Cause::Reference, _) => "m or m/s",
    }
}

impl CauseFound {
    /// The cause with its size, and what to do.
    fn words(&self) -> String {
        let size = self.size;
        let deg_per_g = || significant((size * STANDARD_GRAVITY).to_degrees());
        match self.cause {
            Cause::Scale => format!(
                "the calibration's scale factors and angles are wrong by {} % on the worst axis in this session; calibrate again",
                significant(100.0 * size)
            ),
            Cause::Motion => format!(
                "errors grow with the motion, by {} % of it, differently each time: nonlinearity, a scale factor that differs between directions, or a delay; see mimu diagnose",
                significant(100.0 * size)
            ),
            Cause::GSensitivity => format!(
                "the gyro senses force, {} deg/s per g; mimu diagnose finds the matrix",
                deg_per_g()
            ),
            Cause::Rectification => match self.sensor {
                Some(Sensor::Gyro) => format!(
                    "vibration shifts the bias, by {} deg/s per g² of mean square; mount the unit softer",
                    significant((size * STANDARD_GRAVITY.powi(2)).to_degrees())
                ),
                _ => format!(
                    "vibration shifts the bias, by {} mg per g² of mean square; mount the unit softer",
                    significant(1e3 * size * STANDARD_GRAVITY)
                ),
            },
            Cause::Vibration => "noise grows with vibration, which aliases or clips: mount the unit softer, or filter before sampling".into(),
            Cause::White => "white noise is larger in motion than at rest".into(),
            Cause::Walk => "the bias wanders more than at rest, as with temperature".into(),
            Cause::Reference => "the reference is uncertain".into(),
        }
    }
}

/// For each sensor, why its noise has to be inflated, or that it has not.
pub(super) fn sentences(densities: &[Density], found: &Attributed) -> Vec<String> {
    let each = Sensor::BOTH.into_iter().map(|sensor| {
        let own = || densities.iter().filter(|d| d.sensor == sensor);
        let large = own().filter(|d| d.factor.is_some_and(|f| f > INFLATED));
        let certain = large.clone().any(|d| d.factor_interval.is_some_and(|i| i[0] > 1.0));
        let inflated: Vec<String> = large
            .map(|d| {
                let name = if d.term == "white" { "noise density" } else { "bias random walk" };
                format!("{name} {} times Allan's", significant(d.factor.unwrap_or(1.0)))
            })
            .collect();
        let causes: Vec<&CauseFound> = found.causes.iter().filter(|c| c.sensor == Some(sensor)).collect();
        let calibration = found.share_of_calibration[sensor];
        let first = causes.first().filter(|c| c.share >= calibration);
        match (inflated.is_empty(), first) {
            // A cause that is found decides, whatever end the interval has.
            (false, None) if !certain => format!(
                "{sensor}: {}, or nothing to inflate: the reference may err by as much, or the segments are too few",
                inflated.join(", ")
            ),
            (true, _) => format!("{sensor}: nothing to inflate; Allan's noise explains the errors in motion"),
            (false, Some(cause)) => format!(
                "{sensor}: {}: {} ({:.0} % of the errors beyond Allan's noise)",
                inflated.join(", "),
                cause.words(),
                100.0 * cause.share
            ),
            (false, None) if calibration > 0.0 => format!(
                "{sensor}: {}: the calibration is only known that well ({:.0} % of the errors beyond Allan's noise); record more poses and turns",
                inflated.join(", "),
                100.0 * calibration
            ),
            (false, None) => format!(
                "{sensor}: {}: the segments show no single cause",
                inflated.join(", ")
            ),
        }
    });
    let unseen = densities.iter().filter(|d| d.value == 0.0).map(|d| {
        format!(
            "{}: neither rest nor motion shows a random walk of the bias; a file has the upper end of its interval, {} {}",
            d.sensor,
            significant(d.interval[1]),
            d.unit
        )
    });
    each.chain(unseen).collect()
}
