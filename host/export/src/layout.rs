//! Where the numbers of a triad and of its noise are in a program's file: the table that its writer and its reader follow.
//!
//! An [`Entry`] is a key, and the numbers of [`Parts`] behind it in their order. A [`NoiseKey`] is a key, and the coefficient behind it. What a format has of
//! both, it declares once ([`Target`](crate::Target)).

use mimu::quantity::{AXES, PerSensor, Sensor};
use mimu_allan::model::Term;
use nalgebra::{Matrix3, Vector3};

use crate::convention::Parts;
use crate::keyed::Keyed;

/// Numbers behind a key.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Numbers {
    /// The left factor by rows.
    Left,
    /// The left factor by columns.
    LeftByColumns,
    /// The diagonal of the left factor.
    LeftDiagonal,
    /// The right factor by rows.
    Right,
    /// The diagonal of the right factor.
    RightDiagonal,
    /// β.
    Bias,
    /// Three rows of the left factor, an element of β behind each.
    LeftBesideBias,
    /// β, then the left factor by columns.
    BiasThenLeft,
    /// β, then the lower triangle of the left factor by columns.
    BiasThenLower,
}

/// A number of [`Parts`].
#[derive(Clone, Copy)]
enum Slot {
    Left(usize, usize),
    Right(usize, usize),
    Bias(usize),
}

impl Numbers {
    /// Whether β is among them.
    pub fn has_bias(self) -> bool {
        self.slots()
            .iter()
            .any(|slot| matches!(slot, Slot::Bias(_)))
    }

    fn slots(self) -> Vec<Slot> {
        let all = (0..3).flat_map(|i| (0..3).map(move |j| (i, j)));
        let left = |(i, j)| Slot::Left(i, j);
        let by_columns = |(i, j)| Slot::Left(j, i);
        let bias = (0..3).map(Slot::Bias);
        match self {
            Self::Left => all.map(left).collect(),
            Self::LeftByColumns => all.map(by_columns).collect(),
            Self::LeftDiagonal => (0..3).map(|i| Slot::Left(i, i)).collect(),
            Self::Right => all.map(|(i, j)| Slot::Right(i, j)).collect(),
            Self::RightDiagonal => (0..3).map(|i| Slot::Right(i, i)).collect(),
            Self::Bias => bias.collect(),
            Self::LeftBesideBias => (0..3)
                .flat_map(|i| (0..3).map(move |j| Slot::Left(i, j)).chain([Slot::Bias(i)]))
                .collect(),
            Self::BiasThenLeft => bias.chain(all.map(by_columns)).collect(),
            Self::BiasThenLower => {
                let lower = all.filter(|(column, row)| row >= column);
                bias.chain(lower.map(by_columns)).collect()
            }
        }
    }
}

/// A key with numbers of a triad.
#[derive(Debug, Clone, Copy)]
pub struct Entry {
    /// Path of the key, `/` between levels; the reader accepts levels before it. `{axis}` is x, y and z in turn, `{AXIS}` X, Y and Z: a key for each number.
    pub key: &'static str,
    /// The triad.
    pub sensor: Sensor,
    /// The numbers.
    pub numbers: Numbers,
    /// A number of the file 1 is this much, in the unit of the [`Parts`].
    pub unit: f64,
    /// A number 0 on the diagonal of a matrix is this much.
    pub from: f64,
    /// Whether programs leave it out: it is then the identity, or 0.
    pub is_optional: bool,
}

impl Entry {
    /// An entry in the unit of the parts.
    pub const fn of(sensor: Sensor, numbers: Numbers, key: &'static str) -> Self {
        Self {
            key,
            sensor,
            numbers,
            unit: 1.0,
            from: 0.0,
            is_optional: false,
        }
    }

    /// The same, `from` plus numbers in this unit.
    pub const fn scaled(self, from: f64, unit: f64) -> Self {
        Self { unit, from, ..self }
    }

    /// The same, if programs leave it out.
    pub const fn optional(self) -> Self {
        Self {
            is_optional: true,
            ..self
        }
    }

    /// The numbers of the file.
    pub fn values(&self, parts: &Parts) -> Vec<f64> {
        let mut parts = *parts;
        let value = |slot| {
            let (place, from) = self.place(&mut parts, slot);
            (*place - from) / self.unit
        };
        self.numbers.slots().into_iter().map(value).collect()
    }

    /// Where the number of a slot is, and how much a 0 of the file is there.
    fn place<'a>(&self, parts: &'a mut Parts, slot: Slot) -> (&'a mut f64, f64) {
        match slot {
            Slot::Left(i, j) if i == j => (&mut parts.left[(i, j)], self.from),
            Slot::Right(i, j) if i == j => (&mut parts.right[(i, j)], self.from),
            Slot::Left(i, j) => (&mut parts.left[(i, j)], 0.0),
            Slot::Right(i, j) => (&mut parts.right[(i, j)], 0.0),
            Slot::Bias(i) => (&mut parts.bias[i], 0.0),
        }
    }

    /// The keys of the file, each with its numbers.
    pub fn written(&self, parts: &Parts) -> Vec<(String, Vec<f64>)> {
        let values = self.values(parts);
        match keys(self.key) {
            [Some(x), Some(y), Some(z)] => {
                let each = [x, y, z].into_iter().zip(values);
                each.map(|(key, value)| (key, vec![value])).collect()
            }
            _ => vec![(self.key.into(), values)],
        }
    }

    /// Reads its numbers from `file` to `parts`; whether it is there.
    ///
    /// # Errors
    /// The key that is there with too few numbers, and how many it has to have.
    pub(crate) fn read(&self, file: &Keyed, parts: &mut Parts) -> Result<bool, (String, usize)> {
        let slots = self.numbers.slots();
        let Some(values) = numbers(self.key, file, slots.len())? else {
            return Ok(false);
        };
        for (slot, value) in slots.into_iter().zip(values) {
            let (place, from) = self.place(parts, slot);
            *place = value * self.unit + from;
        }
        Ok(true)
    }
}

/// The keys of three axes, if `key` names an axis.
fn keys(key: &str) -> [Option<String>; 3] {
    AXES.map(|axis| {
        let each = key.replace("{axis}", axis);
        let each = each.replace("{AXIS}", &axis.to_uppercase());
        (each != key).then_some(each)
    })
}

/// Whether `file` has a key.
pub(crate) fn is_there(key: &str, file: &Keyed) -> bool {
    !matches!(numbers(key, file, 1), Ok(None))
}

/// `count` numbers behind `key`; `None` if it is not there.
fn numbers(key: &str, file: &Keyed, count: usize) -> Result<Option<Vec<f64>>, (String, usize)> {
    let (keys, each) = match keys(key) {
        [Some(x), Some(y), Some(z)] => (vec![x, y, z], count.div_ceil(3)),
        _ => (vec![key.to_owned()], count),
    };
    let found: Vec<Option<&[f64]>> = keys.iter().map(|key| file.numbers(key)).collect();
    if found.iter().all(Option::is_none) {
        return Ok(None);
    }
    let mut all = Vec::new();
    for (key, values) in keys.into_iter().zip(found) {
        match values.and_then(|values| values.get(..each)) {
            Some(values) => all.extend(values),
            None => return Err((key, each)),
        }
    }
    Ok(Some(all))
}

/// No matrix, no bias: what a file starts from.
pub(crate) fn nothing() -> Parts {
    Parts {
        left: Matrix3::identity(),
        right: Matrix3::identity(),
        bias: Vector3::zeros(),
    }
}

/// What a program's number of the noise is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoiseOf {
    /// A continuous-time density.
    Density,
    /// The standard deviation of a sample, `density √rate`.
    Deviation,
    /// Its variance, `density² rate`.
    Variance,
}

impl NoiseOf {
    /// The program's number of this density.
    pub fn number(self, density: f64, rate_hz: f64) -> f64 {
        match self {
            Self::Density => density,
            Self::Deviation => density * rate_hz.sqrt(),
            Self::Variance => density * density * rate_hz,
        }
    }

    /// The density of this number.
    pub fn density(self, number: f64, rate_hz: f64) -> f64 {
        match self {
            Self::Density => number,
            Self::Deviation => number / rate_hz.sqrt(),
            Self::Variance => (number / rate_hz).sqrt(),
        }
    }
}

/// A key with a coefficient of the noise: of all axes, of x, y and z, or a covariance by rows.
#[derive(Debug, Clone, Copy)]
pub struct NoiseKey {
    /// As in [`Entry::key`].
    pub key: &'static str,
    /// What the file says of its unit.
    pub unit: &'static str,
    /// The triad.
    pub sensor: Sensor,
    /// N or K.
    pub term: Term,
    /// What the number is.
    pub of: NoiseOf,
    /// A number of the file 1 is this much in SI.
    pub si: f64,
    /// For the standard deviation of a Gauss-Markov process: the key of its correlation time T, and the seconds that T counts in, so that K = number / √T.
    pub correlation: Option<(&'static str, f64)>,
}

/// The key of N, a density in SI.
pub const fn white(key: &'static str, unit: &'static str, sensor: Sensor) -> NoiseKey {
    NoiseKey {
        key,
        unit,
        sensor,
        term: Term::N,
        of: NoiseOf::Density,
        si: 1.0,
        correlation: None,
    }
}

/// The key of K, likewise.
pub const fn walk(key: &'static str, unit: &'static str, sensor: Sensor) -> NoiseKey {
    let term = Term::K;
    NoiseKey {
        term,
        ..white(key, unit, sensor)
    }
}

impl NoiseKey {
    /// The same key with another number.
    pub const fn of(self, of: NoiseOf) -> Self {
        Self { of, ..self }
    }

    /// The same key in this unit.
    pub const fn in_si(self, si: f64) -> Self {
        Self { si, ..self }
    }

    /// The same key with the standard deviation of a process, as in [`Self::correlation`].
    pub const fn gauss_markov(self, key: &'static str, seconds: f64) -> Self {
        Self {
            correlation: Some((key, seconds)),
            ..self
        }
    }

    /// The number of the file.
    pub fn number(&self, density: f64, rate_hz: f64) -> f64 {
        self.of.number(density, rate_hz) / self.si
    }

    /// The densities of the file, of x, y and z; `None` if the key is not there.
    pub(crate) fn read(&self, file: &Keyed, rate_hz: f64) -> Option<[f64; 3]> {
        let time_s = match self.correlation {
            Some((key, seconds)) => seconds * file.numbers(key)?[0],
            None => 1.0,
        };
        let density = |number: f64| self.of.density(number * self.si / time_s.sqrt(), rate_hz);
        let values = match numbers(self.key, file, 3) {
            Ok(Some(values)) => values,
            _ => file.numbers(self.key)?.to_vec(),
        };
        match *file.numbers(self.key).unwrap_or(&values) {
            [one] => Some([density(one); 3]),
            [x, _, _, _, y, _, _, _, z] | [x, y, z] => Some([x, y, z].map(density)),
            _ => None,
        }
    }
}

/// Parts of both triads, as far as a file has them.
pub(crate) type Found = PerSensor<Option<Parts>>;
