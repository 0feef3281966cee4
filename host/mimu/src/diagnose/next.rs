//! The next experiment: what to record so that the next diagnosis settles what this one could not.
//!
//! The design is that of `mimu design --effects` ([`crate::design::settle`]).

use rayon::prelude::*;

use super::Diagnosis;
use super::candidate::{Candidate, Kind, Monomial};
use super::decision::EXCITED;
use super::library;
use super::rows::{Free, Rows, Session};
use crate::design::budget::DwellNoise;
use crate::design::reach::{Carrier, RateList, Rates};
use crate::design::settle::known::Known;
use crate::design::settle::stop::slow;
use crate::design::settle::{Answer, Question, Sought, Suspect, settle};
use crate::design::tour::Motion;
use crate::fit::Fit;
use crate::prepared::si_covariance;
use crate::quantity::AXES;
use crate::quantity::Sensor;
use mimu_recording::Reference;

/// Length of a dwell of the next experiment, s.
pub const DWELL_S: f64 = 10.0;
/// Range of rates where the recording did not go beyond it, deg/s: that of most gyros.
pub const RATE_DPS: f64 = 300.0;
/// Rate at which a table changes the attitude, rad/s. What the course of a session is planned with: on a slower table it takes
/// longer than the chamber does, and ends where that has ended; on a faster one it would break off.
pub const SLEW: f64 = std::f64::consts::PI / 3.0;
/// Temperatures of a chamber: where it begins and ends, and two others, °C. That of the recording is the unit's, which its own
/// power warms by some ten degrees.
pub const CHAMBER_C: [f64; 3] = [25.0, 45.0, 5.0];
/// Alternatives of an effect that experiments are designed for.
const ALTERNATIVES: usize = 3;

/// Two candidates that the recording does not tell apart.
#[derive(Debug, Clone)]
pub struct Confused {
    /// That which was accepted, and the other.
    pub ids: [String; 2],
    /// How much worse the other is, in score.
    pub difference: f64,
    /// What tells them apart, in words.
    pub experiment: String,
}

/// What to record next.
#[derive(Debug, Clone, Default)]
pub struct Next {
    /// Effects that the recording could not show, each with the experiment in words.
    pub not_excited: Vec<(String, String)>,
    /// Candidates that it could not tell apart.
    pub confused: Vec<Confused>,
    /// Suspects of all of it, for one experiment together.
    pub suspects: Vec<Suspect>,
}

/// A question about the unit of a fitted recording: its noise, sensors and way of being carried, with nothing asked yet.
pub fn question(fit: &Fit, carrier: Option<Carrier>) -> Question<'static> {
    let prepared = &fit.prepared;
    let carrier = carrier.unwrap_or(match prepared.manifest.reference {
        Reference::Table => Carrier::ThreeAxis,
        Reference::Gravity => Carrier::Hand,
    });
    let usual = Motion::of(carrier);
    let dwells = &prepared.dwells.list;
    let rates = dwells.iter().flat_map(|d| d.reference[..3].to_vec());
    let largest = rates.fold(0.0, |m: f64, r| m.max(r.abs())).to_degrees();
    Question {
        suspects: Vec::new(),
        reference: match carrier {
            Carrier::Hand => Reference::Gravity,
            _ => Reference::Table,
        },
        carrier,
        sensors: Sensor::BOTH
            .into_iter()
            .filter(|s| fit.sensor(*s).is_some())
            .collect(),
        rates: RateList {
            largest_dps: largest.round().max(RATE_DPS),
            rates: Rates::Any,
        },
        chamber_c: CHAMBER_C,
        noise: Sensor::BOTH.map(|s| noise(fit, s)),
        dwell_s: DWELL_S,
        motion: Motion {
            slew: usual
                .slew
                .max(if carrier == Carrier::Hand { 0.0 } else { SLEW }),
            ..usual
        },
        seed: 1,
        known: None,
    }
}

/// Noise of a sensor by the means of the dwells of a recording, as if it were white.
fn noise(fit: &Fit, sensor: Sensor) -> DwellNoise {
    let Some(fitted) = fit.sensor(sensor) else {
        return DwellNoise::fang(sensor);
    };
    let matrix = &fitted.estimated.triad.inverse.matrix;
    let prepared = &fit.prepared;
    let usable = prepared
        .dwells
        .list
        .iter()
        .filter(|d| d.fault(sensor).is_none());
    let each = usable.map(|d| {
        let variance = si_covariance(matrix, &prepared.noise.of_mean(sensor, d));
        variance.trace() / 3.0 * d.averaged_s(sensor)
    });
    let each: Vec<f64> = each.filter(|v| v.is_finite()).collect();
    let density = (each.iter().sum::<f64>() / each.len().max(1) as f64).sqrt();
    match density > 0.0 {
        true => DwellNoise {
            n: density,
            b: 0.0,
            k: 0.0,
        },
        false => DwellNoise::fang(sensor),
    }
}

/// What a recording has told, for an experiment that adds to it.
pub fn known(fit: &Fit) -> Known {
    let model = |s: Sensor| fit.sensor(s).map(|f| f.estimated.triad.inverse);
    let session = Session {
        prepared: &fit.prepared,
        gyro: model(Sensor::Gyro),
        accel: model(Sensor::Accel),
    };
    let rows = Sensor::BOTH
        .into_iter()
        .filter_map(|sensor| Rows::of(&[session], sensor, Free::Affine));
    Known {
        rows: rows.collect(),
    }
}

/// The candidate of this name; `None` of a jump, which is of one recording only.
fn by_id(id: &str) -> Option<Candidate> {
    if let Some(effect) = library::by_id(id) {
        return Suspect::listed(effect).map(|s| s.candidate);
    }
    let (channel, product) = id.strip_prefix("term:")?.split_once('~')?;
    let (sensor, axis) = channel.split_once('_')?;
    let sensor = Sensor::BOTH.into_iter().find(|s| s.name() == sensor)?;
    let axis = AXES.iter().position(|a| *a == axis)?;
    let monomial = Monomial::all().into_iter().find(|m| m.name() == product)?;
    Some(Candidate::new(sensor, Kind::Term(axis, monomial)))
}

/// What of the course of time an effect needs: those that need the same are shown by one experiment.
fn kind(suspect: &Suspect) -> (bool, bool, bool) {
    let slow = slow(&suspect.candidate);
    let lags = suspect.candidate.lag_s(1.0).is_some();
    (slow.time, slow.temperature, lags)
}

/// The experiments that settle what `diagnosis` leaves open.
pub fn next(diagnosis: &Diagnosis) -> Next {
    let base = question(&diagnosis.after, None);
    let open = diagnosis
        .sensors
        .iter()
        .flat_map(|s| &s.decision.not_excited);
    let open: Vec<Suspect> = open
        .filter_map(|(id, _)| library::by_id(id))
        .filter_map(Suspect::listed)
        .collect();
    let mut kinds: Vec<_> = open.iter().map(kind).collect();
    kinds.sort_unstable();
    kinds.dedup();
    let asked: Vec<Vec<Suspect>> = kinds
        .into_iter()
        .map(|k| open.iter().filter(|s| kind(s) == k).cloned().collect())
        .collect();
    let told: Vec<Vec<(String, String)>> = asked
        .into_par_iter()
        .map(|suspects| shown(&base, diagnosis, suspects))
        .collect();
    let told: Vec<(String, String)> = told.into_iter().flatten().collect();
    // In the order of the diagnosis; of what no dwell is planned for, what it needs.
    let all = diagnosis
        .sensors
        .iter()
        .flat_map(|s| &s.decision.not_excited);
    let not_excited = all.map(|(id, needs)| {
        let planned = told.iter().find(|t| t.0 == *id).cloned();
        planned.unwrap_or_else(|| (id.clone(), needs.clone()))
    });
    let pairs = pairs(diagnosis);
    let confused: Vec<Confused> = pairs.par_iter().map(|p| p.settled(&base)).collect();
    let mut suspects = open.clone();
    for (k, pair) in pairs.iter().enumerate() {
        suspects.extend(pair.suspects(k + 1).into_iter().flatten());
    }
    Next {
        not_excited: not_excited.collect(),
        confused,
        suspects,
    }
}

/// What shows effects of one kind, in words, each by name. What cannot be shown by hand may be on a table.
fn shown(base: &Question, diagnosis: &Diagnosis, suspects: Vec<Suspect>) -> Vec<(String, String)> {
    let answer = settle(&Question {
        suspects: suspects.clone(),
        ..base.clone()
    });
    // What would not even be tested after it is no experiment for it.
    let possible = |answer: &Answer, id: &str| {
        let settled = answer.settled.iter().find(|s| s.id == id);
        settled.is_some_and(|s| s.sigmas > EXCITED)
    };
    let (can, cannot): (Vec<Suspect>, Vec<Suspect>) = suspects
        .into_iter()
        .partition(|s| possible(&answer, &s.candidate.id()));
    let answer = match can.is_empty() || cannot.is_empty() {
        true => answer,
        false => settle(&Question {
            suspects: can.clone(),
            ..base.clone()
        }),
    };
    let mut all: Vec<(String, String)> = can
        .iter()
        .map(|s| (s.candidate.id(), answer.words()))
        .collect();
    if cannot.is_empty() {
        return all;
    }
    let on_table = (base.carrier == Carrier::Hand).then(|| {
        settle(&Question {
            suspects: cannot.clone(),
            ..question(&diagnosis.after, Some(Carrier::ThreeAxis))
        })
    });
    for suspect in cannot {
        let id = suspect.candidate.id();
        let words = match (&on_table, &suspect.candidate.kind) {
            (Some(table), _) if possible(table, &id) => {
                format!("on a table, not by hand: {}", table.words())
            }
            (_, Kind::Effect(effect)) => effect.needs.to_string(),
            _ => answer.words(),
        };
        all.push((id, words));
    }
    all
}

/// An accepted effect and another that would do nearly as well.
struct Pair {
    /// The accepted one, with the coefficients found.
    found: Candidate,
    values: Vec<f64>,
    id: String,
    /// The other; `None` if it is a jump.
    other: Option<Candidate>,
    difference: f64,
}

fn pairs(diagnosis: &Diagnosis) -> Vec<Pair> {
    let accepted = diagnosis.sensors.iter().flat_map(|s| &s.decision.accepted);
    let each = accepted.flat_map(|a| {
        let alternatives = a.chosen.alternatives.iter().take(ALTERNATIVES);
        alternatives.map(|(id, difference)| Pair {
            found: a.chosen.candidate.clone(),
            values: a.values.iter().copied().collect(),
            id: id.clone(),
            other: by_id(id),
            difference: *difference,
        })
    });
    each.collect()
}

impl Pair {
    fn suspects(&self, group: usize) -> Option<[Suspect; 2]> {
        let other = self.other.clone()?;
        if !Suspect::can_be(&self.found) {
            return None;
        }
        let found = Suspect {
            candidate: self.found.clone(),
            sizes: self.values.clone(),
            sought: Sought::Whole,
            group,
        };
        let other = Suspect {
            sizes: vec![1.0; other.active.len()],
            candidate: other,
            sought: Sought::Nothing,
            group,
        };
        Some([found, other])
    }

    fn settled(&self, base: &Question) -> Confused {
        let experiment = match self.suspects(0) {
            // Of the two, what no dwell is planned for.
            None => match (&self.found.kind, library::by_id(&self.id)) {
                (Kind::Effect(found), _) if !Suspect::can_be(&self.found) => found.needs.into(),
                (_, Some(effect)) => effect.needs.into(),
                (_, None) => {
                    "the same recording again: a jump does not come back where it was".into()
                }
            },
            Some(suspects) => settle(&Question {
                suspects: suspects.to_vec(),
                ..base.clone()
            })
            .words(),
        };
        Confused {
            ids: [self.found.id(), self.id.clone()],
            difference: self.difference,
            experiment,
        }
    }
}

/// One experiment for all that a diagnosis leaves open and that its kind of recording can show; `None` if there is nothing.
pub fn together(diagnosis: &Diagnosis, next: &Next) -> Option<Answer> {
    let base = question(&diagnosis.after, None);
    let ask = |suspects: Vec<Suspect>| {
        settle(&Question {
            suspects,
            ..base.clone()
        })
    };
    let answer = ask(next.suspects.clone());
    answer.possible().then_some(answer)
}
