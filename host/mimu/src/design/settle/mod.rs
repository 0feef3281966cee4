//! The next experiment: the fewest dwells that show effects which a recording could not, and tell them apart.
//!
//! | module     | what                                                                              |
//! |------------|-----------------------------------------------------------------------------------|
//! | [`stop`]   | what a unit undergoes on a dwell: the same moments that a diagnosis is made of    |
//! | [`layout`] | columns of the affine parameters and the effects, and what is to be seen of them  |
//! | [`pool`]   | dwells that can be made, their information, and the fewest that suffice           |
//! | [`course`] | sessions in time: cold starts, chambers that warm and cool                        |
//! | [`known`]  | what a recording has told already                                                 |
//! | [`words`]  | the experiment in words, and as a plan                                            |
//!
//! What is required of a design:
//!
//! - Of an effect that was *not excited*, each coefficient at the size of data sheets is [`SEEN`] sigmas, beside the affine
//!   parameters, the other effects asked for, and the listed effects that the diagnosis could take it for.
//! - Of two that are *confused*, the one that was found, at the size found, cannot be imitated by the other: what the best fit
//!   of the other leaves of it is [`APART`] squared in deviance. That is T-optimality, Atkinson and Fedorov (Biometrika 62,
//!   1975), with the weaker of both as the criterion; for linear models with known noise it is the Kullback-Leibler
//!   distance, twice.
//!
//! Regressors are those of the diagnosis ([`crate::diagnose::candidate::Candidate::regressors`]): an effect that is new there
//! is known here.

pub mod course;
pub mod known;
pub mod layout;
pub mod pool;
pub mod stop;
pub mod words;

use super::budget::DwellNoise;
use super::model::Setting;
use super::reach::{Carrier, RateList};
use super::tour::{Motion, by_lot};
use crate::diagnose::candidate::{Candidate, Kind};
use crate::diagnose::effect::Effect;
use crate::diagnose::library;
use crate::quantity::Sensor;
use course::Course;
use known::Known;
use layout::Layout;
use mimu_recording::Reference;
use pool::Pool;
use stop::{Slow, Stop};

/// Sigmas at which a coefficient of the size of data sheets is to be seen. A diagnosis tests from 3 on; at 5 it finds the effect
/// in 98 of 100 recordings even if only one coefficient differs from nothing: 5 - 2 sigmas of it are the 3 that chance makes
/// once in 400.
pub const SEEN: f64 = 5.0;
/// Root of the deviance by which one of two effects is to be better. A diagnosis tells two to be confused below 12; the difference
/// scatters by twice its root, and 36 is two of these above 12: 36 - 2 · 2 · 6.
pub const APART: f64 = 6.0;
/// Most dwells of one pass.
const MOST: usize = 100;
/// Passes over the design, each in an order of its own. A diagnosis holds blocks of time out: each coefficient is then still
/// seen at `SEEN/√2`, more than the 3 sigmas it is tested from.
const PASSES: usize = 2;

/// An effect or a term in question.
#[derive(Debug, Clone)]
pub struct Suspect {
    /// Which, with the coefficients in question.
    pub candidate: Candidate,
    /// Their sizes, SI.
    pub sizes: Vec<f64>,
    /// What is to be seen of it.
    pub sought: Sought,
    /// Suspects of one group are to be told from each other; those of another need not be.
    pub group: usize,
}

/// What is to be seen of a suspect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sought {
    /// Each coefficient by itself.
    Each,
    /// All of them together, at these sizes with these signs.
    Whole,
    /// Nothing: it is there for the others to be told from.
    Nothing,
}

impl Suspect {
    /// An effect by name, each of its coefficients at the size of data sheets.
    ///
    /// `None` of what cannot be planned for.
    pub fn listed(effect: &'static Effect) -> Option<Self> {
        let candidate = Candidate::new(effect.sensor, Kind::Effect(effect));
        Self::can_be(&candidate).then(|| Self {
            sizes: candidate
                .active
                .iter()
                .map(|k| effect.typical[*k])
                .collect(),
            candidate,
            sought: Sought::Each,
            group: 0,
        })
    }

    /// Whether an experiment can be planned for it. Not for an error of the code: which codes a dwell meets is decided by the noise and the
    /// bias of the unit, and by no plan; nor for what is no error, which no session need be longer for.
    pub fn can_be(candidate: &Candidate) -> bool {
        match candidate.kind {
            Kind::Effect(effect) => effect.is_error() && !candidate.reads_code(),
            _ => true,
        }
    }
}

/// What is asked.
#[derive(Debug, Clone)]
pub struct Question<'a> {
    /// Effects to be seen and told apart.
    pub suspects: Vec<Suspect>,
    /// What will be known of the input.
    pub reference: Reference,
    /// What carries the unit.
    pub carrier: Carrier,
    /// Sensors of the unit: each recording has to calibrate them all.
    pub sensors: Vec<Sensor>,
    /// Rates of the table.
    pub rates: RateList,
    /// Temperatures of the chamber, °C: where it begins and ends, and two others.
    pub chamber_c: [f64; 3],
    /// Noise of gyro and accelerometer.
    pub noise: [DwellNoise; 2],
    /// Length of a dwell, s.
    pub dwell_s: f64,
    /// Moves between dwells.
    pub motion: Motion,
    /// Seed of the lots.
    pub seed: u64,
    /// What a recording has told already; without it the new one has to stand alone.
    pub known: Option<&'a Known>,
}

impl Question<'_> {
    /// Noise of a sensor.
    pub fn noise_of(&self, sensor: Sensor) -> &DwellNoise {
        match sensor {
            Sensor::Gyro => &self.noise[0],
            Sensor::Accel => &self.noise[1],
        }
    }
}

/// How one suspect fares.
#[derive(Debug, Clone, PartialEq)]
pub struct Settled {
    /// Its name.
    pub id: String,
    /// Sigmas of its least seen coefficient, or of the whole of it, over all values of its nonlinear constant looked at; 0 if
    /// nothing of it can be.
    pub sigmas: f64,
    /// Sigmas that are enough.
    pub wanted: f64,
    /// Each coefficient that is seen: name, its unit, and its sigma in it; none where the effect is looked at as a whole.
    pub coefficients: Vec<(String, String, f64)>,
    /// Coefficients that no experiment of this kind shows beside the affine parameters and the other suspects.
    pub lost: Vec<String>,
    /// Other suspects that are the same as it in every experiment of this kind.
    pub twins: Vec<String>,
}

impl Settled {
    /// Whether anything of it can be seen by an experiment of this kind.
    pub fn possible(&self) -> bool {
        self.sigmas > 0.0
    }

    /// Whether all that can be seen of it is.
    pub fn done(&self) -> bool {
        self.possible() && self.sigmas >= self.wanted * (1.0 - 1e-9)
    }
}

/// The experiment.
#[derive(Debug, Clone)]
pub struct Answer {
    /// Dwells in order.
    pub stops: Vec<Stop>,
    /// Temperature of the chamber, s and °C; empty where it does not matter.
    pub chamber_c: Vec<(f64, f64)>,
    /// Whether it has to begin with a cold start.
    pub cold: bool,
    /// Whether dwells are made twice, each pass in another order.
    pub passes: usize,
    /// The suspects.
    pub settled: Vec<Settled>,
    /// Length of a dwell, s.
    pub dwell_s: f64,
    /// What carries the unit.
    pub carrier: Carrier,
    /// All of it, moves included, s.
    pub time_s: f64,
    /// Whether a recording's information is counted: only both together settle it.
    pub together: bool,
}

impl Answer {
    /// Whether anything can be seen.
    pub fn possible(&self) -> bool {
        self.settled.iter().any(Settled::possible)
    }
}

impl<'a> Question<'a> {
    /// The question with the rivals that a diagnosis will have beside the suspects: the other listed effects of the same sensor
    /// that depend on time or temperature if the suspects do, and else on neither. What only one of six rates shows is seen,
    /// but the diagnosis could not name it. Rivals that are the same as a suspect in all experiments of this kind stay out.
    fn with_rivals(&self) -> Self {
        let mut all = self.clone();
        let each = self.suspects.iter().filter(|s| s.sought == Sought::Each);
        let of: Vec<(Sensor, usize, bool)> = each
            .map(|s| (s.candidate.sensor, s.group, stop::slow(&s.candidate).any()))
            .collect();
        let before = all.hopeless();
        for effect in library::all() {
            let Some(rival) = Suspect::listed(effect) else {
                continue;
            };
            let slow = stop::slow(&rival.candidate).any();
            let mut groups: Vec<usize> = of
                .iter()
                .filter(|(sensor, _, s)| *sensor == effect.sensor && *s == slow)
                .map(|(_, group, _)| *group)
                .collect();
            groups.sort_unstable();
            groups.dedup();
            for group in groups {
                let id = rival.candidate.id();
                let there = |s: &Suspect| s.group == group && s.candidate.id() == id;
                if all.suspects.iter().any(there) {
                    continue;
                }
                all.suspects.push(Suspect {
                    sought: Sought::Nothing,
                    group,
                    ..rival.clone()
                });
                if all.hopeless() > before {
                    all.suspects.pop();
                }
            }
        }
        all
    }

    /// How many goals no experiment of this kind reaches.
    fn hopeless(&self) -> usize {
        let candidates = stop::settings(self, false);
        let stops = match self.suspects.iter().any(|s| stop::slow(&s.candidate).any()) {
            true => Course::longest(self, &candidates).stops,
            false => stop::at_once(&candidates, self),
        };
        let layout = Layout::new(self, |_| true);
        let seen = Pool::new(&layout, self, &stops).seen();
        seen.iter().filter(|g| g.lost).count()
    }
}

/// The fewest dwells that settle the question, or the shortest session, where time or temperature matters.
pub fn settle(question: &Question) -> Answer {
    let question = &question.with_rivals();
    let slow: Vec<Slow> = question
        .suspects
        .iter()
        .map(|s| stop::slow(&s.candidate))
        .collect();
    // A rival that is slow costs no session of its own.
    let wanted =
        |i: usize| question.suspects[i].sought != Sought::Nothing || question.suspects[i].group > 0;
    let any = |f: fn(&Slow) -> bool| (0..slow.len()).any(|i| wanted(i) && f(&slow[i]));
    let still: Vec<bool> = slow.iter().map(|s| !s.any()).collect();
    // Dwells for what does not depend on when they are made, and for the calibration.
    let base = Layout::new(question, |i| still[i]);
    let mut settings = Vec::new();
    // Six faces and rates about the axes first: fixtures hold them. Other attitudes where these do not do.
    for plain in [true, false] {
        let candidates = stop::settings(question, plain);
        let mut pool = Pool::new(&base, question, &stop::at_once(&candidates, question));
        let lost = pool.forget_lost();
        let wide = stop::settings(question, false).len() == candidates.len();
        if lost && plain && !wide {
            continue;
        }
        let (points, enough) = pool.fewest(PASSES, MOST);
        settings = points.iter().map(|i| candidates[*i]).collect();
        if enough || wide {
            break;
        }
    }
    let course = if any(|s| s.time || s.temperature) {
        Course::shortest(question, &settings, any(|s| s.temperature))
    } else {
        let order: Vec<Setting> = (0..PASSES as u64)
            .flat_map(|pass| by_lot(&settings, question.seed + pass))
            .collect();
        Course::at_once(question, &order)
    };
    let slowly = any(|s| s.time || s.temperature);
    Answer {
        settled: judged(question, &course),
        cold: any(|s| s.time),
        passes: if slowly { 1 } else { PASSES },
        chamber_c: course.chamber_c,
        stops: course.stops,
        time_s: course.time_s,
        dwell_s: question.dwell_s,
        carrier: question.carrier,
        together: question.known.is_some(),
    }
}

/// What an experiment shows of each suspect.
pub fn judged(question: &Question, course: &Course) -> Vec<Settled> {
    let layout = Layout::new(question, |_| true);
    let all = Pool::new(&layout, question, &course.stops);
    let seen = all.seen();
    let suspects = question.suspects.iter().enumerate();
    suspects
        .filter(|(_, s)| s.sought != Sought::Nothing)
        .map(|(i, s)| {
            let own: Vec<_> = seen.iter().filter(|g| g.suspect == i).collect();
            let lost: Vec<String> = own
                .iter()
                .filter(|g| g.lost)
                .map(|g| g.name.clone())
                .collect();
            let sigmas = own.iter().filter(|g| !g.lost).map(|g| g.sigmas);
            let least = sigmas.fold(f64::INFINITY, f64::min);
            let names = s.candidate.names().into_iter().zip(&s.sizes);
            let coefficients = names.filter_map(|((name, unit), size)| {
                let own = own.iter().filter(|g| !g.lost && g.name == name);
                let least = own.map(|g| g.sigmas).reduce(f64::min)?;
                Some((name, unit, size.abs() / least))
            });
            Settled {
                coefficients: coefficients.collect(),
                id: s.candidate.id(),
                sigmas: if least.is_finite() { least } else { 0.0 },
                wanted: if s.sought == Sought::Whole {
                    APART
                } else {
                    SEEN
                },
                twins: match lost.is_empty() {
                    true => Vec::new(),
                    false => twins(question, course, i),
                },
                lost: sorted(lost),
            }
        })
        .collect()
}

fn sorted(mut names: Vec<String>) -> Vec<String> {
    names.sort();
    names.dedup();
    names
}

/// Suspects beside which alone suspect `i` loses something that it shows beside the affine parameters.
fn twins(question: &Question, course: &Course, i: usize) -> Vec<String> {
    let lost = |beside: &dyn Fn(usize) -> bool| {
        let layout = Layout::new(question, |k| k == i || beside(k));
        let seen = Pool::new(&layout, question, &course.stops).seen();
        seen.iter().filter(|g| g.suspect == i && g.lost).count()
    };
    let alone = lost(&|_| false);
    let others = (0..question.suspects.len()).filter(|k| *k != i);
    others
        .filter(|k| lost(&|other| other == *k) > alone)
        .map(|k| question.suspects[k].candidate.id())
        .collect()
}
