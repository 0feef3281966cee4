//! The course of an experiment in time: dwells one after the other, while the chamber warms and cools where it has to.

use std::collections::BTreeMap;

use super::super::model::Setting;
use super::super::reach::Carrier;
use super::super::tour::by_lot;
use super::stop::{Stop, forms, slow};
use super::{Question, judged};
use crate::diagnose::effect::REFERENCE_C;
use crate::diagnose::rows::late;

/// Dwells in order, and what the chamber does meanwhile.
#[derive(Debug, Clone)]
pub struct Course {
    /// Dwells.
    pub stops: Vec<Stop>,
    /// Chamber, s and °C; empty if it stays as it is.
    pub chamber_c: Vec<(f64, f64)>,
    /// Time from beginning to end, s.
    pub time_s: f64,
}

/// Speed at which a chamber warms and cools, °C/s: 2 °C a minute, which any does.
const RAMP: f64 = 2.0 / 60.0;
/// Time that the chamber stays at each temperature, s; the first that does. A board of some ten grams follows within five minutes.
const SOAKS_S: [f64; 3] = [300.0, 600.0, 1200.0];
/// Length of a session at one temperature, s; the first that does.
const SESSIONS_S: [f64; 4] = [600.0, 1200.0, 1800.0, 3600.0];
/// Time constant by which a board follows its chamber, s: rig and paper boards have two to seven minutes.
const BOARD_LAG_S: f64 = 300.0;
/// Most times that a person puts the unit down in a session.
const BY_HAND: f64 = 24.0;
/// Step of the temperature's course, s.
const STEP_S: f64 = 5.0;

impl Course {
    /// `settings` one after the other, at one temperature.
    pub fn at_once(question: &Question, settings: &[Setting]) -> Self {
        Self::along(question, settings.iter().copied(), Vec::new())
    }

    /// The shortest session that shows what is asked, with `settings` in turn, each round in an order drawn by lot. All
    /// of the session is used: dwells cost nothing while one waits for time to pass or a chamber to warm.
    pub fn shortest(question: &Question, settings: &[Setting], chamber: bool) -> Self {
        let tries = if chamber {
            SOAKS_S.len()
        } else {
            SESSIONS_S.len()
        };
        let mut course = Self::session(question, settings, chamber, 0);
        let mut seen = worst(question, &course);
        for length in 1..tries {
            if seen >= 1.0 {
                break;
            }
            let longer = Self::session(question, settings, chamber, length);
            let better = worst(question, &longer);
            if better > seen {
                (course, seen) = (longer, better);
            }
        }
        course
    }

    /// The longest session with `settings`: what it does not show none does.
    pub fn longest(question: &Question, settings: &[Setting]) -> Self {
        let chamber = question
            .suspects
            .iter()
            .any(|s| slow(&s.candidate).temperature);
        let last = if chamber {
            SOAKS_S.len()
        } else {
            SESSIONS_S.len()
        } - 1;
        Self::session(question, settings, chamber, last)
    }

    fn session(question: &Question, settings: &[Setting], chamber: bool, length: usize) -> Self {
        let (length_s, chamber_c) = match chamber {
            true => {
                let profile = profile(question.chamber_c, SOAKS_S[length]);
                (profile.last().map_or(0.0, |p| p.0), profile)
            }
            false => (SESSIONS_S[length], Vec::new()),
        };
        // By hand a unit lies for minutes between two moves.
        let hold = match question.carrier {
            Carrier::Hand => (length_s / BY_HAND / question.dwell_s).ceil().max(1.0) as usize,
            _ => 1,
        };
        let rounds = (0_u64..).map(|round| by_lot(settings, question.seed + round));
        let each = rounds.flatten().flat_map(|s| std::iter::repeat_n(s, hold));
        let mut time_s = 0.0;
        let mut last: Option<Setting> = None;
        let fitting = each.take_while(|next| {
            time_s += question.dwell_s + question.between(last.as_ref(), next);
            last = Some(*next);
            time_s <= length_s
        });
        let fitting: Vec<Setting> = match settings.is_empty() {
            true => Vec::new(),
            false => fitting.collect(),
        };
        Self::along(question, fitting.into_iter(), chamber_c)
    }

    fn along(
        question: &Question,
        settings: impl Iterator<Item = Setting>,
        chamber_c: Vec<(f64, f64)>,
    ) -> Self {
        let mut time_s = 0.0;
        let mut last = None;
        let mut stops = Vec::new();
        for setting in settings {
            time_s += question.between(last.as_ref(), &setting);
            stops.push(Stop {
                setting,
                t_s: time_s + 0.5 * question.dwell_s,
                dwell_s: question.dwell_s,
                warm_c: 0.0,
                late_c: Vec::new(),
            });
            time_s += question.dwell_s;
            last = Some(setting);
        }
        if !chamber_c.is_empty() {
            warm(question, &chamber_c, time_s, &mut stops);
        }
        Self {
            stops,
            chamber_c,
            time_s,
        }
    }
}

impl Question<'_> {
    /// Time from a dwell to the next, s.
    fn between(&self, last: Option<&Setting>, next: &Setting) -> f64 {
        match last {
            None => self.motion.settle_s,
            Some(last) => self.motion.between(last, next),
        }
    }
}

/// Least seen over wanted of all that can be seen at all.
fn worst(question: &Question, course: &Course) -> f64 {
    let settled = judged(question, course).into_iter();
    settled
        .filter(|s| s.possible())
        .map(|s| s.sigmas / s.wanted)
        .fold(f64::INFINITY, f64::min)
}

/// From the first temperature to the others and back: up and down, and the first again at the end.
fn profile(temperatures_c: [f64; 3], soak_s: f64) -> Vec<(f64, f64)> {
    let [first, second, third] = temperatures_c;
    let mut profile = vec![(0.0, first), (soak_s, first)];
    let (mut t_s, mut now) = (soak_s, first);
    for next in [second, third, first] {
        t_s += (next - now).abs() / RAMP;
        profile.push((t_s, next));
        t_s += soak_s;
        profile.push((t_s, next));
        now = next;
    }
    profile
}

/// Temperature of a profile at a time, °C.
fn at(profile: &[(f64, f64)], t_s: f64) -> f64 {
    let after = profile.partition_point(|p| p.0 <= t_s);
    match (after.checked_sub(1).map(|i| profile[i]), profile.get(after)) {
        (Some(a), Some(b)) => a.1 + (b.1 - a.1) * (t_s - a.0) / (b.0 - a.0),
        (Some(a), None) => a.1,
        (None, first) => first.map_or(f64::NAN, |f| f.1),
    }
}

/// Gives the stops their temperatures.
fn warm(question: &Question, chamber_c: &[(f64, f64)], time_s: f64, stops: &mut [Stop]) {
    let steps = (time_s / STEP_S).ceil() as usize;
    let air: Vec<(f64, f64)> = (0..=steps)
        .map(|k| k as f64 * STEP_S)
        .map(|t| (t, at(chamber_c, t) - REFERENCE_C))
        .collect();
    let track = |values: Vec<f64>| -> Vec<(f64, f64)> {
        air.iter().zip(values).map(|(a, v)| (a.0, v)).collect()
    };
    let board = track(late(&air, BOARD_LAG_S));
    // Lags in question, in milliseconds, so that each is there once.
    let mut lags: BTreeMap<u64, (f64, Vec<(f64, f64)>)> = BTreeMap::new();
    for suspect in &question.suspects {
        for form in forms(&suspect.candidate) {
            if let Some(lag_s) = suspect.candidate.lag_s(form) {
                lags.entry((lag_s * 1e3) as u64)
                    .or_insert_with(|| (lag_s, track(late(&board, lag_s))));
            }
        }
    }
    for stop in stops {
        stop.warm_c = at(&board, stop.t_s);
        stop.late_c = lags
            .values()
            .map(|(lag_s, track)| (*lag_s, at(track, stop.t_s)))
            .collect();
    }
}
