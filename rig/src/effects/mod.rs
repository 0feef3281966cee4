//! Errors that the affine model lacks: each effect from its physics, enabled by the rig file or drawn by a seed.
//!
//! Effects add: each acts on the undisturbed motion and temperature, so their order does not matter and two together act as each alone. Neglected is
//! the effect of one on another, a product of two small numbers.
//!
//! An effect is one [`Spec`]: its id, the parameters with units and sizes, and a function. Ids that start with `x_` are unknown to every estimator.

mod accel;
mod drift;
mod gyro;
mod readout;
mod supply;
mod thermal;
mod unlisted_accel;
mod unlisted_gyro;

use std::collections::BTreeMap;

use crate::motion::Motion;
use crate::pins::Pins;
use crate::random::Random;
use crate::sensor::TriadTruth;
use crate::thermal::Temperatures;

/// rad/s per deg/s.
pub(crate) const DPS: f64 = std::f64::consts::PI / 180.0;
/// Standard gravity, m/s².
pub(crate) const G: f64 = 9.80665;
/// Reference temperature of thermal errors, °C.
const REFERENCE_C: f64 = 25.0;

/// All effects.
const ALL: &[&[Spec]] = &[
    gyro::SPECS,
    accel::SPECS,
    drift::SPECS,
    thermal::SPECS,
    readout::SPECS,
    supply::SPECS,
    unlisted_gyro::SPECS,
    unlisted_accel::SPECS,
];

/// Undisturbed quantities at one time, as input of the effects.
pub struct Condition<'a> {
    /// The motion of the board.
    pub motion: &'a Motion,
    /// Rate along each gyro's sensitive direction, rad/s.
    pub gyro: [f64; 3],
    /// Specific force at the board's origin along each accelerometer axis, m/s².
    pub accel: [f64; 3],
    /// Temperatures of board and dies.
    pub temperatures: Temperatures,
    /// Time since the unit was switched on, s.
    pub on_s: f64,
}

/// Errors that the effects add to the inputs.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Disturbance {
    /// At each gyro, rad/s.
    pub gyro: [f64; 3],
    /// At each accelerometer axis, m/s².
    pub accel: [f64; 3],
}

/// Layout of a parameter's numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// One number.
    Scalar,
    /// A list of numbers; three are for the axes x, y, z.
    List(usize),
    /// Three rows of three; rows are the sensor's axes.
    Matrix,
    /// A matrix whose diagonal is 0.
    Cross,
}

/// How a parameter is drawn if it is not given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Draw {
    /// The amplitude of the effect: each number has a random sign and is between half and one and a half times this size. None is near 0, so an
    /// enabled effect is visible.
    Size(f64),
    /// A nonlinear parameter of the effect: between two positive numbers, log-uniform.
    Between(f64, f64),
}

/// One parameter of an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Key in the rig file, with the unit.
    pub key: &'static str,
    /// Layout of its numbers.
    pub shape: Shape,
    /// How its value is drawn if it is not given.
    pub draw: Draw,
}

/// One kind of effect.
pub struct Spec {
    /// Stable name.
    pub id: &'static str,
    /// Description in a line.
    pub about: &'static str,
    /// The size first, then the nonlinear parameters.
    pub parameters: &'static [Parameter],
    build: fn(&Build) -> Active,
}

/// One effect of a unit with all parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct EffectTruth {
    /// Its id.
    pub id: &'static str,
    /// Numbers of each parameter, row by row.
    pub values: BTreeMap<&'static str, Vec<f64>>,
}

/// A function called at every step, with its state.
type Step<T> = Box<dyn FnMut(&Condition, &mut T) + Send>;

/// A running effect.
pub enum Active {
    /// Adds to the inputs of the sensors.
    Input(Step<Disturbance>),
    /// Changes the voltages at the pins.
    ReadOut(Step<Pins>),
}

impl Active {
    /// Its contribution to the inputs.
    pub fn disturb(&mut self, at: &Condition, add: &mut Disturbance) {
        if let Self::Input(f) = self {
            f(at, add);
        }
    }

    /// Its contribution to the voltages.
    pub fn read_out(&mut self, at: &Condition, pins: &mut Pins) {
        if let Self::ReadOut(f) = self {
            f(at, pins);
        }
    }
}

/// The sensors of the unit with an effect.
#[derive(Clone, Copy)]
pub struct Sensors<'a> {
    /// Gyros.
    pub gyro: &'a TriadTruth,
    /// Accelerometer.
    pub accel: &'a TriadTruth,
    /// Nominal reference of the converter for analog sensors, V.
    pub converter_reference_nominal_v: f64,
}

/// Inputs for building an effect.
struct Build<'a> {
    effect: &'a EffectTruth,
    sensors: Sensors<'a>,
    seed: u64,
    dt_s: f64,
}

impl Build<'_> {
    fn number(&self, key: &str) -> f64 {
        self.effect.values[key][0]
    }

    fn list<const N: usize>(&self, key: &str) -> [f64; N] {
        std::array::from_fn(|i| self.effect.values[key][i])
    }

    fn matrix(&self, key: &str) -> [[f64; 3]; 3] {
        std::array::from_fn(|i| std::array::from_fn(|j| self.effect.values[key][3 * i + j]))
    }

    /// A separate random stream, so that other draws do not change with it.
    fn random(&self) -> Random {
        Random::new(self.seed, self.effect.id)
    }
}

/// An effect on the inputs.
fn input(f: impl FnMut(&Condition, &mut Disturbance) + Send + 'static) -> Active {
    Active::Input(Box::new(f))
}

/// An effect on the voltages.
fn read_out(f: impl FnMut(&Condition, &mut Pins) + Send + 'static) -> Active {
    Active::ReadOut(Box::new(f))
}

const fn scalar(key: &'static str, size: f64) -> Parameter {
    sized(key, Shape::Scalar, size)
}

const fn axes(key: &'static str, size: f64) -> Parameter {
    sized(key, Shape::List(3), size)
}

const fn matrix(key: &'static str, size: f64) -> Parameter {
    sized(key, Shape::Matrix, size)
}

const fn sized(key: &'static str, shape: Shape, size: f64) -> Parameter {
    let draw = Draw::Size(size);
    Parameter { key, shape, draw }
}

const fn form(key: &'static str, low: f64, high: f64) -> Parameter {
    Parameter {
        key,
        shape: Shape::Scalar,
        draw: Draw::Between(low, high),
    }
}

impl Shape {
    /// How many numbers it has.
    pub const fn numbers(self) -> usize {
        match self {
            Self::Scalar => 1,
            Self::List(n) => n,
            Self::Matrix | Self::Cross => 9,
        }
    }

    /// The layout in words.
    pub(crate) fn form(self) -> String {
        match self {
            Self::Scalar => "one number".to_owned(),
            Self::List(n) => format!("a list of {n} numbers"),
            Self::Matrix | Self::Cross => "three lists of three numbers".to_owned(),
        }
    }
}

impl Parameter {
    /// Draws the numbers of this parameter of the effect `id` from a separate stream, so that a given parameter leaves the others unchanged.
    fn draw(&self, id: &str, amplitude: f64, seed: u64) -> Vec<f64> {
        let mut random = Random::new(seed, &format!("{id} {}", self.key));
        let one = |i: usize| match self.draw {
            Draw::Size(_) if self.shape == Shape::Cross && i.is_multiple_of(4) => 0.0,
            Draw::Size(size) => {
                let side = if random.uniform() < 0.5 { -1.0 } else { 1.0 };
                side * amplitude * size * (0.5 + random.uniform())
            }
            Draw::Between(low, high) => low * (high / low).powf(random.uniform()),
        };
        (0..self.shape.numbers()).map(one).collect()
    }
}

impl EffectTruth {
    /// The effect with the given numbers; the others are drawn, the size times `amplitude`. `None`: no such id.
    pub fn draw(
        id: &str,
        stated: BTreeMap<&'static str, Vec<f64>>,
        amplitude: f64,
        seed: u64,
    ) -> Option<Self> {
        let spec = spec(id)?;
        let values = spec.parameters.iter().map(|p| {
            let drawn = || p.draw(spec.id, amplitude, seed);
            (p.key, stated.get(p.key).cloned().unwrap_or_else(drawn))
        });
        Some(Self {
            id: spec.id,
            values: values.collect(),
        })
    }

    /// Its parameters with their numbers.
    pub fn parameters(&self) -> impl Iterator<Item = (&'static Parameter, &[f64])> {
        let parameters = spec(self.id).map_or(&[][..], |s| s.parameters);
        parameters
            .iter()
            .map(|p| (p, self.values[p.key].as_slice()))
    }

    /// Starts the effect in a unit whose steps are `dt_s` apart. The seed determines its random numbers.
    pub fn activate(&self, sensors: Sensors<'_>, seed: u64, dt_s: f64) -> Active {
        let spec = spec(self.id).expect("made from a spec");
        (spec.build)(&Build {
            effect: self,
            sensors,
            seed,
            dt_s,
        })
    }
}

/// All kinds of effects.
pub fn specs() -> impl Iterator<Item = &'static Spec> {
    ALL.iter().copied().flatten()
}

/// The kind with this id.
pub fn spec(id: &str) -> Option<&'static Spec> {
    specs().find(|s| s.id == id)
}

/// Effects with these ids, all numbers drawn, sizes times `amplitude`. Errors: an unknown id.
pub fn draw(ids: &[&str], amplitude: f64, seed: u64) -> Result<Vec<EffectTruth>, String> {
    let one = |id: &&str| {
        EffectTruth::draw(id, BTreeMap::new(), amplitude, seed)
            .ok_or_else(|| format!("no effect has the id `{id}`; use one of `effects::specs`"))
    };
    ids.iter().map(one).collect()
}

/// `count` different ids, all equally likely.
pub fn draw_ids(count: usize, seed: u64) -> Vec<&'static str> {
    let mut random = Random::new(seed, "which effects");
    let mut ids: Vec<_> = specs().map(|s| s.id).collect();
    let mut drawn = Vec::new();
    while drawn.len() < count && !ids.is_empty() {
        let pick = (random.uniform() * ids.len() as f64) as usize;
        drawn.push(ids.swap_remove(pick));
    }
    drawn
}

/// A decade around the usual size of an effect, in the unit of its first parameter.
pub fn size_range(id: &str) -> Option<(f64, f64)> {
    match spec(id)?.parameters[0].draw {
        Draw::Size(size) => Some((size / 10_f64.sqrt(), size * 10_f64.sqrt())),
        Draw::Between(..) => None,
    }
}
