//! Recipes: which states an experiment goes through, and in what course of time and temperature.

use nalgebra::Vector3;

use super::Setup;
use crate::effects::quantity::{Conditions, REFERENCE_C};
use crate::effects::temperature::lagged;
use crate::plan::chamber::temp_c;
use crate::plan::design::model::{GRAVITY, Setting};
use crate::plan::design::reach::{Fixture, Rates};
use crate::plan::design::tour::randomised;
use crate::quantity::Sensor;
use mimu_recording::Reference;

/// Attitudes and rates, as far as the fixture reaches them. A recipe is used only if it also calibrates the unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Inputs {
    /// Rest with each axis up and down; the largest rate in both directions about each axis.
    Faces,
    /// The same with half the largest rate as well, or all the rates that the table has.
    Rates,
    /// The same, rest halfway between every two of these attitudes, and the largest rate about the diagonals between two axes.
    Edges,
}

/// Course of an experiment. It has one size, from a short list.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Course {
    /// Each state so many times, in a randomised order.
    Dwells,
    /// A cold start, and then the states again and again for so many minutes.
    ColdStart,
    /// The same while a chamber goes to both ends and back, over a share of its range.
    Chamber,
}

/// A recipe.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Recipe {
    /// States.
    pub inputs: Inputs,
    /// Course.
    pub course: Course,
}

const fn recipe(inputs: Inputs, course: Course) -> Recipe {
    Recipe { inputs, course }
}

/// All recipes, the least laborious first. None belongs to an effect: the regressors of an effect decide which recipe shows it, so
/// a new effect needs no new recipe.
pub const RECIPES: [Recipe; 7] = [
    recipe(Inputs::Faces, Course::Dwells),
    recipe(Inputs::Rates, Course::Dwells),
    recipe(Inputs::Edges, Course::Dwells),
    recipe(Inputs::Faces, Course::ColdStart),
    recipe(Inputs::Edges, Course::ColdStart),
    recipe(Inputs::Faces, Course::Chamber),
    recipe(Inputs::Edges, Course::Chamber),
];

/// Speed at which a chamber warms and cools, °C/s: 2 °C a minute, which any chamber can do.
pub const RAMP: f64 = 2.0 / 60.0;
/// Time that the chamber stays at each temperature, s: a board of some ten grams follows within five minutes.
pub const SOAK_S: f64 = 300.0;
/// Time constant with which a board follows its chamber, s: boards of the rig and of papers have two to seven minutes.
const BOARD_LAG_S: f64 = 300.0;
/// Most times that a person puts the unit down in a session.
const BY_HAND: f64 = 24.0;
/// Step of the temperature's course, s.
const STEP_S: f64 = 5.0;

impl Course {
    /// The sizes, ascending: how often each state comes; minutes; share of the chamber's range.
    ///
    /// At least two dwells in each state, because a diagnosis holds blocks of time out.
    pub fn sizes(self) -> &'static [f64] {
        match self {
            Self::Dwells => &[2.0, 4.0, 8.0, 16.0],
            Self::ColdStart => &[10.0, 20.0, 30.0, 60.0],
            Self::Chamber => &[0.25, 0.5, 1.0],
        }
    }
}

impl Inputs {
    /// The attitudes and rates of a unit and its fixture.
    pub fn settings(self, setup: &Setup) -> Vec<Setting> {
        let (faces, edges) = (axes_and_edges(1), axes_and_edges(2));
        let mut ups = faces;
        if self == Self::Edges {
            ups.extend(&edges);
        }
        ups.retain(|up| setup.fixture.reaches(up));
        let mut all: Vec<Setting> = ups.iter().map(|up| Setting::at_rest(*up)).collect();
        // An accelerometer alone needs no rates to be calibrated.
        let useful = self != Self::Faces || setup.sensors.contains(&Sensor::Gyro);
        if !setup.turns() || !useful {
            return all;
        }
        // A rate about the opposite direction is the opposite rate. Of each pair, the direction is kept whose first nonzero
        // component is positive.
        let first = |up: &Vector3<f64>| up.iter().copied().find(|c| *c != 0.0);
        for up in ups.iter().filter(|up| first(up) > Some(0.0)) {
            let on_axis = up.amax() > 1.0 - 1e-9;
            let levels = match (self, on_axis) {
                (Self::Faces, _) | (_, false) => vec![1.0],
                _ => self.levels(setup),
            };
            for level in levels {
                let rate = level * setup.rates.largest_dps.to_radians();
                all.extend([rate, -rate].map(|rate| Setting { up: *up, rate }));
            }
        }
        all
    }

    /// Number of attitudes at rest, on a fixture that reaches all of them.
    pub fn attitudes(self) -> usize {
        match self {
            Self::Faces | Self::Rates => 6,
            Self::Edges => 18,
        }
    }

    /// Rates about the axes, as shares of the largest.
    pub fn levels(self, setup: &Setup) -> Vec<f64> {
        match (self, &setup.rates.rates) {
            (Self::Faces, _) => vec![1.0],
            (_, Rates::Any) => vec![0.5, 1.0],
            (_, Rates::Levels(levels)) => levels.clone(),
        }
    }
}

/// Directions with so many components of one magnitude, the others zero: faces of the cube, or its edges.
fn axes_and_edges(components: usize) -> Vec<Vector3<f64>> {
    let steps = [0.0, 1.0, -1.0];
    let mut ups: Vec<Vector3<f64>> = Vec::new();
    for x in steps {
        for y in steps {
            ups.extend(steps.map(|z| Vector3::new(x, y, z)));
        }
    }
    ups.retain(|up| up.iter().filter(|c| **c != 0.0).count() == components);
    ups.into_iter().map(|up| up.normalize()).collect()
}

/// An experiment: a recipe of a certain size, worked out for a unit and its fixture.
#[derive(Debug, Clone)]
pub struct Experiment {
    /// Its recipe.
    pub recipe: Recipe,
    /// One of the sizes of the recipe's course.
    pub size: f64,
    /// Attitudes and rates in order.
    pub settings: Vec<Setting>,
    /// Time at which each dwell begins, s.
    pub begin_s: Vec<f64>,
    /// Length of a dwell, s.
    pub dwell_s: f64,
    /// Dwells in a row in each state before the next one.
    pub hold: usize,
    /// Temperature of the chamber, s and °C; empty where it does not matter.
    pub chamber_c: Vec<[f64; 2]>,
    /// Temperature of the board, s and °C above [`REFERENCE_C`].
    board: Vec<[f64; 2]>,
    /// All of it, moves included, s.
    pub time_s: f64,
}

impl Experiment {
    /// The experiment of `recipe` at a size.
    pub fn of(setup: &Setup, recipe: Recipe, size: f64) -> Self {
        let states = recipe.inputs.settings(setup);
        let chamber_c = match recipe.course {
            Course::Chamber => profile(setup.chamber_c, size),
            _ => Vec::new(),
        };
        let length_s = match recipe.course {
            Course::Dwells => f64::INFINITY,
            Course::ColdStart => 60.0 * size,
            Course::Chamber => chamber_c.last().map_or(0.0, |p| p[0]),
        };
        let passes = match recipe.course {
            Course::Dwells => size as u64,
            // As many as the time allows: more dwells do not make the session longer.
            _ => u64::MAX,
        };
        // By hand a unit stays in a pose for minutes before it is moved.
        let hold = match (setup.fixture, length_s.is_finite()) {
            (Fixture::Hand, true) => (length_s / BY_HAND / setup.dwell_s).ceil().max(1.0) as usize,
            _ => 1,
        };
        let mut out = Self {
            recipe,
            size,
            settings: Vec::new(),
            begin_s: Vec::new(),
            dwell_s: setup.dwell_s,
            hold,
            chamber_c,
            board: Vec::new(),
            time_s: 0.0,
        };
        'all: for pass in 0..passes {
            for state in randomised(&states, setup.seed.wrapping_add(pass)) {
                for _ in 0..hold {
                    let last = out.settings.last();
                    let moving = last.map_or(setup.motion.settle_s, |last| {
                        setup.motion.between(last, &state)
                    });
                    let begin_s = out.time_s + moving;
                    if begin_s + setup.dwell_s > length_s {
                        break 'all;
                    }
                    out.settings.push(state);
                    out.begin_s.push(begin_s);
                    out.time_s = begin_s + setup.dwell_s;
                }
            }
        }
        let steps = (out.time_s / STEP_S).ceil() as usize;
        let air: Vec<[f64; 2]> = (0..=steps)
            .map(|k| k as f64 * STEP_S)
            .map(|t| [t, temp_c(&out.chamber_c, t) - REFERENCE_C])
            .collect();
        if !out.chamber_c.is_empty() {
            out.board = behind(&air, BOARD_LAG_S);
        }
        out
    }

    /// Conditions of `sensor` in each dwell, as a diagnosis would see them. The lagged temperature follows with the time constant
    /// `lag_s`.
    pub fn states(&self, sensor: Sensor, lag_s: Option<f64>) -> Vec<Conditions> {
        let late = match lag_s {
            Some(lag_s) => behind(&self.board, lag_s),
            None => self.board.clone(),
        };
        let each = self.settings.iter().zip(&self.begin_s);
        each.map(|(setting, begin_s)| {
            let t_s = begin_s + 0.5 * self.dwell_s;
            let (rate, force) = (setting.up * setting.rate, setting.up * GRAVITY);
            let of = |track: &[[f64; 2]]| {
                if track.is_empty() {
                    0.0
                } else {
                    temp_c(track, t_s)
                }
            };
            Conditions {
                session: 0,
                t_s,
                on_s: t_s,
                from_middle_s: t_s,
                duration_s: self.dwell_s,
                rate,
                force,
                angular_acceleration: Vector3::zeros(),
                // For a perfect triad: the difference of a real one is of second order.
                sensed: sensor.pick(rate, force),
                temperature_offset: of(&self.board),
                lagged_temperature: of(&late),
            }
        })
        .collect()
    }
}

impl Setup {
    /// Whether the fixture holds known rates about the vertical.
    pub fn turns(&self) -> bool {
        let table = matches!(self.fixture, Fixture::ThreeAxis | Fixture::Faces);
        table && self.reference == Reference::Table
    }
}

/// From the first temperature to the two others and back, over a share of their distance: up and down, and the first again at
/// the end, so that a lag shows between the ways up and down and a drift between beginning and end.
fn profile([first, second, third]: [f64; 3], share: f64) -> Vec<[f64; 2]> {
    let ends = [second, third].map(|c| first + share * (c - first));
    let mut profile = vec![[0.0, first], [SOAK_S, first]];
    let (mut t_s, mut now) = (SOAK_S, first);
    for next in [ends[0], ends[1], first] {
        t_s += (next - now).abs() / RAMP;
        profile.push([t_s, next]);
        t_s += SOAK_S;
        profile.push([t_s, next]);
        now = next;
    }
    profile
}

/// A track after a first-order lag.
fn behind(track: &[[f64; 2]], lag_s: f64) -> Vec<[f64; 2]> {
    let pairs: Vec<(f64, f64)> = track.iter().map(|p| (*p).into()).collect();
    let lagged = lagged(&pairs, lag_s).into_iter();
    pairs.iter().zip(lagged).map(|(p, c)| [p.0, c]).collect()
}
