//! One calibration from several sessions of a unit: what is common to them, what belongs to each, and how much parameters change to the next power-on.
//!
//! | in order of use | what |
//! |---|---|
//! | [`class`] | how much the parameters of a class of parts change: the prior of one or two sessions |
//! | [`between`] | the random-effects model of the parameters of a triad |
//! | [`mixture`] | its intervals |
//! | `inconsistent` | sessions that contradict themselves |
//! | [`contradiction`] | sessions that do not belong to the others, steps and drifts |
//! | `course` | whether parameters step, drift or wander from session to session |
//! | `together` | biases that move together |

pub mod between;
pub mod class;
pub mod contradiction;
mod course;
mod inconsistent;
pub mod mixture;
pub mod together;
mod words;

use nalgebra::{DMatrix, DVector, SVector};

use between::{Between, Estimates, Kinds};
use class::PartClass;
use contradiction::{FALSE_FINDING, Finding, Kind, Triads};
use course::Course;
use mixture::Matched;
use together::Direction;

use crate::fit::{Cause, Fit, Influence, Options, fit};
use crate::one_unit::{RAW_UNIT, REFERENCE, refuse_unlike};
use crate::parameter::{ParameterKind, TriadParameter};
use crate::prepared::Prepared;
use crate::quantity::{PerSensor, Sensor};
use crate::triad::{Covariance, Part, Triad};
use mimu_recording::error::{Error, Result};

/// Sessions of one unit, combined.
#[derive(Debug, Clone)]
pub struct Sessions {
    /// The fits, in the order in which the sessions took place.
    pub fits: Vec<Fit>,
    /// Whether the calibration is made from each: not if it contradicts itself or the others, or took place before a step.
    pub used: Vec<bool>,
    /// For each session that contradicts itself, by which error: the calibration is that of the other sessions, as if it had not taken place.
    pub inconsistent: Vec<Option<String>>,
    /// What does not fit one set of constant parameters.
    pub findings: Vec<Finding>,
    /// The class whose prior was used for fewer than three sessions.
    pub prior: Option<PartClass>,
    /// Along which the biases of all axes move.
    pub together: Option<Direction>,
    /// The triads.
    pub triads: PerSensor<Option<CommonTriad>>,
}

/// Refuses fits that count errors of the reference: these are common to the sessions, and the model of the sessions takes each fit's errors as its own, so
/// that its intervals would be too narrow.
fn refuse_common_errors(fits: &[Fit]) -> Result<()> {
    // Each session compares the clocks anew.
    let common = |i: &Influence| i.cause != Cause::Time;
    let counts = |fit: &&Fit| fit.sensors.iter().any(|s| s.influences.iter().any(common));
    match fits.iter().find(counts) {
        Some(fit) if fits.len() > 1 => Err(Error::new(
            &fit.prepared.place,
            "errors of the reference are stated, and several sessions on one reference share them: a fit of the sessions would count them as independent",
            "fit each session by itself, or leave the errors out and know that no interval includes them",
        )),
        _ => Ok(()),
    }
}

/// One triad of all sessions.
#[derive(Debug, Clone)]
pub struct CommonTriad {
    /// Parameters expected at the next power-on, with the uncertainty of this expectation.
    pub common: Triad,
    /// The same parameters, with the uncertainty of what the next power-on makes of them.
    pub next: Triad,
    /// Numbers of the free parameters in the order of [`TriadParameter::physical`]; the others define the frame.
    pub free: Vec<usize>,
    /// The model of the free parameters.
    pub between: Between,
    /// Distribution of each free parameter at the next power-on.
    pub predicted: Vec<Matched>,
    /// Number, among the free parameters, of those that drift.
    pub drifting: Vec<usize>,
    /// Each session as predicted by the others. `None` for a session without this triad, or without others.
    pub left_out: Vec<Option<LeftOutTriad>>,
}

/// A triad of a session as predicted by the others.
#[derive(Debug, Clone)]
pub struct LeftOutTriad {
    /// Each free parameter.
    pub parameters: Vec<LeftOut>,
    /// The calibration by the others, without an uncertainty.
    pub by_others: Option<Triad>,
}

/// A parameter of a session as predicted by the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeftOut {
    /// Estimate of the session.
    pub value: f64,
    /// Prediction.
    pub predicted: f64,
    /// Half of the 95 % interval of their difference.
    pub half_width: f64,
}

impl LeftOut {
    /// Whether the interval contains the estimate.
    pub fn is_inside(&self) -> bool {
        (self.value - self.predicted).abs() <= self.half_width
    }
}

/// Fits both triads of a session, or the one that it determines: sessions may differ in what they show.
///
/// # Errors
/// As [`fit`]; that of both triads if it determines neither.
pub fn fit_determined(prepared: Prepared, options: Options) -> Result<Fit> {
    let only = |sensor| {
        let options = Options {
            only: Some(sensor),
            ..options
        };
        fit(prepared.clone(), options).ok()
    };
    match fit(prepared.clone(), options) {
        Err(error @ Error::Undetermined(_)) if options.only.is_none() => {
            let one = only(Sensor::Accel).or_else(|| only(Sensor::Gyro));
            one.ok_or(error)
        }
        other => other,
    }
}

/// Physical parameters and their covariance in a fit.
pub type Physical = (SVector<f64, 12>, Covariance);

impl Sessions {
    /// Combines fits of one unit, in the order in which the sessions took place. `class` gives the prior for one or two.
    ///
    /// # Errors
    /// Fits of two units, or in two raw units; no triad that all determine.
    pub fn combine(fits: Vec<Fit>, class: PartClass) -> Result<Self> {
        check(&fits)?;
        refuse_common_errors(&fits)?;
        let inconsistent = inconsistent::reasons(&fits);
        let each = fits.iter().zip(&inconsistent);
        let consistent: Vec<&Fit> = each.filter(|e| e.1.is_none()).map(|e| e.0).collect();
        let mut found = Self::of_consistent(&consistent, class)?;
        for s in (0..fits.len()).filter(|s| inconsistent[*s].is_some()) {
            found.used.insert(s, false);
            found.findings.iter_mut().for_each(|f| f.kind.make_room(s));
            for triad in found
                .triads
                .as_mut()
                .into_iter()
                .filter_map(|t| t.1.as_mut())
            {
                triad.left_out.insert(s, None);
            }
        }
        Ok(Self {
            fits,
            inconsistent,
            ..found
        })
    }

    /// Those of `fits`, without the fits themselves.
    fn of_consistent(fits: &[&Fit], class: PartClass) -> Result<Self> {
        let physical = Sensor::BOTH.map(|sensor| of_fits(fits, sensor));
        let free = physical.each_ref().map(|all| free(all));
        let data: Vec<Triads> = Sensor::BOTH
            .iter()
            .zip(physical.iter().zip(&free))
            .map(|(sensor, (all, free))| triads(*sensor, all, free, class))
            .collect();
        let Judged {
            used,
            findings,
            drifting,
        } = judge(&data, fits.len());
        let kept: Vec<Triads> = data.iter().map(|d| d.of(|s| used[s])).collect();
        let few = kept
            .iter()
            .any(|d| d.priors_if_few().is_some() && !d.sessions.is_empty());
        let mut combined = PerSensor::<Option<CommonTriad>>::default();
        for (k, sensor) in Sensor::BOTH.into_iter().enumerate() {
            if kept[k].sessions.is_empty() || free[k].is_empty() {
                continue;
            }
            let place = &fits[0].prepared.place;
            let first = physical[k]
                .iter()
                .flatten()
                .next()
                .map_or_else(SVector::zeros, |p| p.0);
            let common = combine(&kept[k], &free[k], &drifting[k], first, fits.len());
            let mut common = common.ok_or_else(|| undetermined(place, sensor))?;
            common.left_out = left_out(&data[k], &free[k], first, &used);
            combined[sensor] = Some(common);
        }
        Ok(Self {
            together: together(&data, &used),
            prior: few.then_some(class),
            fits: Vec::new(),
            inconsistent: Vec::new(),
            used,
            findings,
            triads: combined,
        })
    }

    /// Shares of the values of left-out sessions inside the intervals predicted by the others: inside, and of how many.
    pub fn predicted(&self) -> [usize; 2] {
        let all = self.triads.present().flat_map(|(_, t)| &t.left_out);
        let all = all.zip(self.used.iter().cycle()).filter(|(_, used)| **used);
        let all = all
            .filter_map(|(l, _)| l.as_ref())
            .flat_map(|l| &l.parameters);
        all.fold([0, 0], |[inside, count], one| {
            [inside + usize::from(one.is_inside()), count + 1]
        })
    }
}

fn check(fits: &[Fit]) -> Result<()> {
    if fits.is_empty() {
        return Err(Error::new("sessions", "none was given", "name recordings"));
    }
    let all: Vec<_> = fits.iter().map(|fit| &fit.prepared).collect();
    let named: Vec<_> = all
        .iter()
        .map(|p| (p.place.as_str(), &p.manifest))
        .collect();
    refuse_unlike(&named, &[RAW_UNIT, REFERENCE])?;
    for (k, first) in all.iter().enumerate() {
        let twice = |other: &&&Prepared| other.condensed.sha256 == first.condensed.sha256;
        if let Some(other) = all[k + 1..].iter().find(twice) {
            return Err(Error::new(
                &other.place,
                format!("it has the samples of {}", first.place),
                "give each session once",
            ));
        }
    }
    Ok(())
}

fn undetermined(place: &str, sensor: Sensor) -> Error {
    Error::undetermined(
        place,
        format!("the sessions together do not determine the {sensor}"),
        "record sessions with more poses",
    )
}

fn of_fits(fits: &[&Fit], sensor: Sensor) -> Vec<Option<Physical>> {
    let of = |fit: &&Fit| {
        let (values, parts) = fit.sensor(sensor)?.estimated.triad.physical_parts();
        let zero = Covariance::zeros();
        Some((values, parts.iter().fold(zero, |sum, p| sum + p.covariance)))
    };
    fits.iter().map(of).collect()
}

/// Numbers of the parameters that all fits determine with an error. One without defines the frame.
pub fn free(all: &[Option<Physical>]) -> Vec<usize> {
    let size = |values: &SVector<f64, 12>, i: usize| match i {
        0..3 | 9..12 => values[i % 3].abs(),
        _ => 1.0,
    };
    let has = |i: usize| {
        let each = all.iter().flatten();
        each.clone().count() > 0
            && each
                .clone()
                .all(|(v, c)| c[(i, i)].sqrt() > 1e-12 * size(v, i))
    };
    (0..12).filter(|i| has(*i)).collect()
}

fn triads(sensor: Sensor, all: &[Option<Physical>], free: &[usize], class: PartClass) -> Triads {
    let n = free.len();
    let of = |(s, one): (usize, &Option<Physical>)| {
        let (values, covariance) = one.as_ref()?;
        let estimates = Estimates {
            values: DVector::from_fn(n, |i, _| values[free[i]]),
            covariance: DMatrix::from_fn(n, n, |i, j| covariance[(free[i], free[j])]),
        };
        Some((s, estimates))
    };
    let names = TriadParameter::physical();
    // Of all: that of the first session would make the prior depend on their order.
    let sizes = |i: usize| {
        all.iter()
            .flatten()
            .map(move |(values, _)| values[i % 3].abs())
    };
    let scale = |i: usize| sizes(i).sum::<f64>() / sizes(i).count() as f64;
    let prior = |i: &usize| class.prior(sensor, names[*i], scale(*i));
    let kinds = Kinds {
        // Angles of both kinds change by the same causes.
        of: free.iter().map(|i| [0, 1, 1, 2][i / 3]).collect(),
        size: free
            .iter()
            .map(|i| if (3..9).contains(i) { 1.0 } else { scale(*i) })
            .collect(),
    };
    Triads {
        sessions: all.iter().enumerate().filter_map(of).collect(),
        bias: free
            .iter()
            .map(|i| names[*i].0 == ParameterKind::Bias)
            .collect(),
        kinds,
        priors: free.iter().map(prior).collect(),
    }
}

struct Judged {
    used: Vec<bool>,
    findings: Vec<Finding>,
    drifting: Vec<Vec<usize>>,
}

/// Excludes sessions until those that remain agree, as far as at least two remain.
fn judge(data: &[Triads], count: usize) -> Judged {
    let mut used = vec![true; count];
    // A session at another temperature has other biases, and does not contradict the others.
    let biases = together(data, &used).is_none();
    let mut findings = Vec::new();
    let mut drifting = vec![Vec::new(); data.len()];
    loop {
        let numbers: Vec<usize> = (0..count).filter(|s| used[*s]).collect();
        if numbers.len() < 2 {
            break;
        }
        let kept: Vec<Triads> = data.iter().map(|d| d.of(|s| used[s])).collect();
        let mut found = contradiction::search(&kept, &numbers, biases);
        let drift = contradiction::drift(&kept, &numbers);
        found.extend(drift.iter().map(|d| d.0.clone()));
        let least = found.into_iter().min_by(|a, b| a.p.total_cmp(&b.p));
        let Some(least) = least.filter(|f| f.p < FALSE_FINDING) else {
            break;
        };
        let mut least = least;
        if let Kind::Step(_) = least.kind {
            least = match (course::best(&kept, &numbers, biases), &drift) {
                (Course::Step, _) => least,
                (Course::Slope, Some((found, _))) => found.clone(),
                _ => Finding {
                    kind: Kind::Walk,
                    ..least
                },
            };
        }
        findings.push(least.clone());
        match least.kind {
            // Of two nobody knows which is wrong.
            Kind::Session(_) if numbers.len() < 3 => break,
            Kind::Session(s) => used[s] = false,
            Kind::Step(first) => (0..first).for_each(|s| used[s] = false),
            Kind::Walk => break,
            Kind::Drift => {
                drifting = drift.map_or(drifting, |d| d.1);
                break;
            }
        }
    }
    Judged {
        used,
        findings,
        drifting,
    }
}

/// The triad of the next session, whose number is `next`. `first` has the parameters that define the frame.
fn combine(
    kept: &Triads,
    free: &[usize],
    drifting: &[usize],
    first: SVector<f64, 12>,
    next: usize,
) -> Option<CommonTriad> {
    let between = kept.fitted(drifting, next as f64)?;
    let predicted = between.next();
    let mut values = first;
    for (i, k) in free.iter().enumerate() {
        values[*k] = between.parameters[i].common.mean();
    }
    let common: Vec<Matched> = between
        .parameters
        .iter()
        .map(|p| p.common.matched())
        .collect();
    Some(CommonTriad {
        common: Triad::from_physical(&values, &parts(free, &between, &common))?,
        next: Triad::from_physical(&values, &parts(free, &between, &predicted))?,
        free: free.to_vec(),
        between,
        predicted,
        drifting: drifting.to_vec(),
        left_out: Vec::new(),
    })
}

/// Parts of a covariance in physical parameters: that of the expected values, whose correlations matter, and for each parameter the rest of `matched`. The sum
/// has the variance and the degrees of freedom of `matched`.
fn parts(free: &[usize], between: &Between, matched: &[Matched]) -> Vec<Part> {
    let n = free.len();
    let mut shared = Covariance::zeros();
    for (i, a) in free.iter().enumerate() {
        for (j, b) in free.iter().enumerate() {
            shared[(*a, *b)] = between.expected[(i, j)];
        }
    }
    let mut parts = Vec::with_capacity(n + 1);
    for (i, k) in free.iter().enumerate() {
        let variance = matched[i].variance;
        // At most half of it, so that the other part can have the degrees of freedom. Correlations stay.
        let by = (0.5 * variance / shared[(*k, *k)]).sqrt().min(1.0);
        shared.row_mut(*k).scale_mut(by);
        shared.column_mut(*k).scale_mut(by);
        let rest = variance - shared[(*k, *k)];
        let mut covariance = Covariance::zeros();
        covariance[(*k, *k)] = rest;
        // Welch and Satterthwaite, the other way round.
        let dof = matched[i].dof * (rest / variance).powi(2);
        parts.push(Part {
            dof,
            ..Part::known(covariance)
        });
    }
    parts.push(Part::known(shared));
    parts
}

/// Predictions of each session by the other used ones.
fn left_out(
    data: &Triads,
    free: &[usize],
    first: SVector<f64, 12>,
    used: &[bool],
) -> Vec<Option<LeftOutTriad>> {
    let of = |s: usize| {
        let own = data.sessions.iter().find(|(k, _)| *k == s)?;
        let others = data.of(|k| k != s && used[k]);
        if others.sessions.is_empty() {
            return None;
        }
        let model = others.fitted(&[], s as f64)?;
        let each = model.parameters.iter().enumerate();
        let each = each.map(|(i, p)| LeftOut {
            value: own.1.values[i],
            predicted: p.next.mean(),
            half_width: p.next.plus(own.1.covariance[(i, i)]).half_width(0.95),
        });
        let parameters: Vec<LeftOut> = each.collect();
        let mut values = first;
        for (one, k) in parameters.iter().zip(free) {
            values[*k] = one.predicted;
        }
        let by_others = Triad::from_physical(&values, &[]);
        Some(LeftOutTriad {
            parameters,
            by_others,
        })
    };
    (0..used.len()).map(of).collect()
}

/// The direction along which the biases of all used sessions move.
fn together(data: &[Triads], used: &[bool]) -> Option<Direction> {
    let whole = |s: &usize| used[*s] && data.iter().all(|d| d.sessions.iter().any(|(k, _)| k == s));
    let sessions: Vec<usize> = (0..used.len()).filter(whole).collect();
    let mut columns = Vec::new();
    for triad in data {
        for i in (0..triad.bias.len()).filter(|i| triad.bias[*i]) {
            let value = |s: &usize| {
                let own = triad.sessions.iter().find(|(k, _)| k == s);
                own.map_or(0.0, |(_, e)| e.values[i])
            };
            columns.push(DVector::from_iterator(
                sessions.len(),
                sessions.iter().map(value),
            ));
        }
    }
    let found = together::direction(&DMatrix::from_columns(&columns))?;
    (found.p < FALSE_FINDING).then_some(found)
}
