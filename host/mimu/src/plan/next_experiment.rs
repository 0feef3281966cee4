//! The next experiment: the first recipe, in its smallest size, that shows what a recording could not show.
//!
//! | module         | what                                                                                |
//! |----------------|-------------------------------------------------------------------------------------|
//! | [`recipe`]     | the table of recipes, their sizes, and the conditions of a unit in each             |
//! | [`prediction`] | the sigma that an experiment gives each coefficient of an effect                    |
//! | [`words`]      | an experiment in a sentence, and as a plan                                          |
//!
//! It uses [`crate::plan::design`] and [`crate::diagnose`], which do not use each other. Regressors, typical sizes and ranges of
//! nonlinear parameters are those of the effects, so a new effect needs no change here.

pub mod prediction;
pub mod recipe;
pub mod words;

use rayon::prelude::*;
use serde::{Serialize, Serializer};

use crate::diagnose::Diagnosis;
use crate::diagnose::search::Alternative;
use crate::effects::candidate::{Candidate, CandidateKind};
use crate::effects::effect::Effect;
use crate::effects::fitted::FittedEffect;
use crate::fit::Fit;
use crate::plan::design::budget::DwellNoise;
use crate::plan::design::reach::{Fixture, RateList, Rates};
use crate::plan::design::tour::Motion;
use crate::prepared::si_covariance;
use crate::quantity::Sensor;
use mimu_recording::Reference;
use prediction::{Prediction, Target, calibrates};
use recipe::{Course, Experiment, RECIPES, Recipe};

/// Length of a dwell of the next experiment, s.
pub const DWELL_S: f64 = 10.0;
/// Largest rate, deg/s, unless the recording has a larger one: the range of most gyros.
pub const RATE_DPS: f64 = 300.0;
/// Rate at which a table changes the attitude, rad/s, in the planned course of a session. On a slower table the dwells take longer than
/// the course of the chamber, and end at its last temperature. On a faster one they would end before it.
pub const SLEW: f64 = std::f64::consts::PI / 3.0;
/// Temperatures of a chamber: where it begins and ends, and two others, °C. The recorded temperature is the unit's, which its own power
/// warms by some ten degrees.
pub const CHAMBER_C: [f64; 3] = [25.0, 45.0, 5.0];
/// Alternatives of an effect that experiments are designed for.
const ALTERNATIVES: usize = 3;

/// Two candidates that the recording does not distinguish.
#[derive(Debug, Clone, Serialize)]
pub struct Confused {
    /// The accepted one, and the other.
    pub ids: [String; 2],
    /// How much lower the score of the other is.
    pub difference: f64,
    /// Experiment that distinguishes them, in words.
    pub experiment: String,
}

/// An open question that a plan for this kind of recording does not answer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NotInPlan {
    /// Effect, or two with `or` between them.
    pub id: String,
    /// Why not.
    pub reason: NotShown,
}

/// Why a plan does not show something. JSON has the sentence.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, thiserror::Error)]
pub enum NotShown {
    /// No recipe determines it.
    #[error("no recipe shows it")]
    NoRecipe,
    /// It can be shown, but not with what this recording was made with.
    #[error("this needs a turntable")]
    Turntable,
}

impl Serialize for NotShown {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// An effect that the recording would not have shown at its typical size, and an experiment that would. That it was not found means
/// nothing.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NotExcited {
    /// Public id.
    pub id: &'static str,
    /// Sensor whose readings would err.
    pub sensor: Sensor,
    /// Experiment that would show it, in words.
    pub experiment: String,
    /// The recipe behind the words. `None` if no recipe shows the effect as well as wanted; the words are then for this effect alone.
    #[serde(skip)]
    pub recipe: Option<SizedRecipe>,
}

/// A recipe of one size. If two differ only in size, the larger also shows what the smaller shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SizedRecipe {
    /// The recipe.
    pub recipe: Recipe,
    /// Fixture.
    pub fixture: Fixture,
    /// Its size, one of [`Course::sizes`].
    pub size: f64,
}

/// What to record next.
#[derive(Debug, Clone, Default)]
pub struct Next {
    /// Effects that the recording could not show.
    pub not_excited: Vec<NotExcited>,
    /// Candidates that it could not distinguish.
    pub confused: Vec<Confused>,
    /// Those of both that this kind of recording can show, for one experiment together.
    pub targets: Vec<Target>,
    /// Those that this kind of recording cannot show.
    pub not_in_plan: Vec<NotInPlan>,
}

/// A unit, and the equipment of an experiment with it.
#[derive(Debug, Clone)]
pub struct Setup {
    /// What will be known of the input.
    pub reference: Reference,
    /// Fixture.
    pub fixture: Fixture,
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
    /// Seed of the randomised orders.
    pub seed: u64,
}

impl Setup {
    /// The unit of a fitted recording: its noise, sensors and rates. Without a `fixture`, the one that it was recorded on.
    pub fn of(fit: &Fit, fixture: Option<Fixture>) -> Self {
        let prepared = &fit.prepared;
        let fixture = fixture.unwrap_or(match prepared.manifest.reference {
            Reference::Table => Fixture::ThreeAxis,
            Reference::Gravity | Reference::TurntableRate => Fixture::Hand,
        });
        let usual = Motion::of(fixture);
        let dwells = &prepared.dwells.list;
        let rates = dwells.iter().flat_map(|d| d.reference[..3].to_vec());
        let largest = rates.fold(0.0, |m: f64, r| m.max(r.abs())).to_degrees();
        Self {
            reference: match fixture {
                Fixture::Hand => Reference::Gravity,
                _ => Reference::Table,
            },
            fixture,
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
                    .max(if fixture == Fixture::Hand { 0.0 } else { SLEW }),
                ..usual
            },
            seed: 1,
        }
    }

    /// Noise of a sensor.
    pub fn noise_of(&self, sensor: Sensor) -> &DwellNoise {
        sensor.pick(&self.noise[0], &self.noise[1])
    }
}

/// An experiment, and what it will show.
#[derive(Debug, Clone)]
pub struct Answer {
    /// The experiment.
    pub experiment: Experiment,
    /// Prediction for each target, in their order.
    pub predictions: Vec<Prediction>,
}

impl Answer {
    /// Sigma over the wanted sigma, of the target that is seen worst.
    fn worst(&self) -> f64 {
        let each = self.predictions.iter().map(|p| p.share / p.wanted);
        each.fold(0.0, f64::max)
    }

    /// Whether all targets are seen as wanted.
    pub fn done(&self) -> bool {
        self.predictions.iter().all(Prediction::done)
    }
}

/// The first recipe that shows all targets as well as wanted, in its smallest size that does. If none does, the one that shows them best.
/// `None` if no recipe determines all of them.
pub fn smallest(setup: &Setup, targets: &[Target]) -> Option<Answer> {
    let slow = targets.iter().any(Target::is_slow);
    let judged = |recipe, size| {
        let experiment = Experiment::of(setup, recipe, size);
        let predictions = targets.par_iter();
        Answer {
            predictions: predictions
                .map(|t| t.predicted(setup, &experiment))
                .collect(),
            experiment,
        }
    };
    let mut best: Option<Answer> = None;
    for recipe in RECIPES {
        if (recipe.course != Course::Dwells) != slow {
            continue;
        }
        let Some((largest, smaller)) = recipe.course.sizes().split_last() else {
            continue;
        };
        let largest = judged(recipe, *largest);
        if !largest.worst().is_finite() || !calibrates(setup, &largest.experiment) {
            continue;
        }
        let enough = |a: &Answer| a.done() && calibrates(setup, &a.experiment);
        if !largest.done() {
            if best.as_ref().is_none_or(|b| largest.worst() < b.worst()) {
                best = Some(largest);
            }
            continue;
        }
        let found = smaller.iter().map(|size| judged(recipe, *size));
        return Some(found.into_iter().find(enough).unwrap_or(largest));
    }
    best
}

/// Noise of a sensor from the dwell means of a recording, as if it were white.
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
        .filter(|d| d.faults[sensor].is_none());
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

/// The experiments that show what `diagnosis` leaves open.
pub fn next(diagnosis: &Diagnosis) -> Next {
    let setup = Setup::of(&diagnosis.after, None);
    let sensors = diagnosis.sensors.iter();
    let open = sensors.flat_map(|s| s.decision.not_excited.iter().copied());
    let open: Vec<&'static Effect> = open.collect();
    let shown = open.par_iter().map(|effect| {
        let target = Target::listed(effect);
        let shown = recommended(diagnosis, &setup, &target);
        let planned = planned(effect.id, shown.as_ref(), Some(target));
        let (experiment, recipe) =
            shown.map_or_else(|| (effect.needs.into(), None), |s| (s.words, s.recipe));
        let not_excited = NotExcited {
            id: effect.id,
            sensor: effect.sensor,
            experiment,
            recipe,
        };
        (not_excited, planned)
    });
    let (not_excited, listed): (Vec<_>, Vec<_>) = shown.unzip();
    let pairs = pairs(diagnosis);
    let told = pairs.par_iter().map(|p| p.distinguished(diagnosis, &setup));
    let (confused, apart): (Vec<_>, Vec<_>) = told.unzip();
    let (mut targets, mut not_in_plan) = (Vec::new(), Vec::new());
    for one in listed.into_iter().chain(apart) {
        match one {
            Ok(target) => targets.push(target),
            Err(left_out) => not_in_plan.push(left_out),
        }
    }
    Next {
        not_excited,
        confused,
        targets,
        not_in_plan,
    }
}

/// `target`, if a recording of the same kind shows it; otherwise the reason why the plan lacks it.
fn planned(
    id: &str,
    shown: Option<&Recommended>,
    target: Option<Target>,
) -> Result<Target, NotInPlan> {
    let reason = match (shown, target) {
        (Some(shown), Some(target)) if shown.same_kind => return Ok(target),
        (Some(shown), _) if !shown.same_kind => NotShown::Turntable,
        _ => NotShown::NoRecipe,
    };
    let id = id.into();
    Err(NotInPlan { id, reason })
}

/// An experiment that shows a target.
struct Recommended {
    words: String,
    /// Whether a recording of the same kind shows it. A table may show what cannot be shown by hand.
    same_kind: bool,
    recipe: Option<SizedRecipe>,
}

fn recommended(diagnosis: &Diagnosis, setup: &Setup, target: &Target) -> Option<Recommended> {
    let targets = std::slice::from_ref(target);
    let recipe = |answer: &Answer, fixture| {
        answer.done().then_some(SizedRecipe {
            recipe: answer.experiment.recipe,
            fixture,
            size: answer.experiment.size,
        })
    };
    if let Some(answer) = smallest(setup, targets) {
        return Some(Recommended {
            words: answer.words(setup),
            same_kind: true,
            recipe: recipe(&answer, setup.fixture),
        });
    }
    if setup.fixture != Fixture::Hand {
        return None;
    }
    let table = Setup::of(&diagnosis.after, Some(Fixture::ThreeAxis));
    let answer = smallest(&table, targets)?;
    let words = answer.words(&table);
    Some(Recommended {
        words: format!("This needs a turntable. {words}"),
        same_kind: false,
        recipe: recipe(&answer, table.fixture),
    })
}

/// An accepted effect, with the coefficients found, and another that would explain the rows nearly as well.
struct Pair<'a> {
    found: &'a FittedEffect,
    other: &'a Alternative,
}

fn pairs(diagnosis: &Diagnosis) -> Vec<Pair<'_>> {
    let accepted = diagnosis.sensors.iter().flat_map(|s| &s.decision.accepted);
    let each = accepted.flat_map(|a| {
        let alternatives = a.chosen.alternatives.iter().take(ALTERNATIVES);
        let found = &a.effect;
        alternatives.map(move |other| Pair { found, other })
    });
    each.collect()
}

impl Pair<'_> {
    fn distinguished(
        &self,
        diagnosis: &Diagnosis,
        setup: &Setup,
    ) -> (Confused, Result<Target, NotInPlan>) {
        let Self { found, other } = self;
        let candidate = &found.candidate;
        // A jump belongs to one recording.
        let jump = matches!(other.kind, CandidateKind::Jump { .. });
        let target = (!jump).then(|| Target {
            candidate: candidate.clone(),
            sizes: found.values.clone(),
            each: false,
            rivals: vec![Candidate::new(candidate.sensor, other.kind.clone())],
        });
        let shown = target
            .as_ref()
            .and_then(|t| recommended(diagnosis, setup, t));
        let ids = [candidate.id(), other.id.clone()];
        let planned = planned(&ids.join(" or "), shown.as_ref(), target);
        let experiment = shown.map(|s| s.words).unwrap_or_else(|| {
            // No plan distinguishes the two, so the experiment is what one of the effects needs.
            let words = match (&candidate.kind, &other.kind) {
                (_, CandidateKind::Effect(effect)) => effect.needs,
                (CandidateKind::Effect(found), CandidateKind::Term(..)) => found.needs,
                _ => "Make the same recording again: a jump does not recur at the same place.",
            };
            words.to_string()
        });
        let confused = Confused {
            ids,
            difference: other.score_worse_by,
            experiment,
        };
        (confused, planned)
    }
}

/// One experiment for all that a diagnosis leaves open and that its kind of recording can show; `None` if there is nothing.
pub fn together(diagnosis: &Diagnosis, next: &Next) -> Option<(Setup, Answer)> {
    let setup = Setup::of(&diagnosis.after, None);
    let any = !next.targets.is_empty();
    let answer = any.then(|| smallest(&setup, &next.targets)).flatten()?;
    Some((setup, answer))
}
