//! Numbers for columns, as in `gyro=57.2958`: factors, offsets, zeros and bits.

use std::fmt;
use std::marker::PhantomData;
use std::str::FromStr;

use crate::cell::shorten;
use crate::columns::{Column, of_sensor};
use crate::error::{Error, Result};
use crate::triad_name::TriadName;

/// What the number of a [`PerColumn`] is.
pub trait Meaning {
    /// Where messages say that it was given.
    const PLACE: &'static str;
    /// What a text has to be, after "is not".
    const WANTED: &'static str;
    /// How to write it.
    const REMEDY: &'static str;
    /// Whether one may hold for the three columns of a sensor.
    const OF_SENSORS: bool = true;
    /// Whether `column` can have one.
    fn takes(column: Column) -> bool;
    /// Whether `number` can be one.
    fn fits(number: f64) -> bool;
}

/// A number for a column, or for the three columns of a triad: `gyro`, `accel`, `mag`, `gyro2`.
#[derive(Debug, Clone, PartialEq)]
pub struct PerColumn<M> {
    target: String,
    number: f64,
    meaning: PhantomData<M>,
}

/// A factor, as in `gyro=57.2958`.
pub type Scale = PerColumn<Factor>;
/// What is added after the factor, as in `temp_c=36.53`.
pub type Offset = PerColumn<Added>;
/// Bits of unsigned codes in two's complement, as in `accel=12`: the upper half of the codes are negative readings.
pub type TwosComplement = PerColumn<Bits>;
/// The code at an input of 0, as in `gyro=2048`: subtracted before the factor.
pub type Zero = PerColumn<Code>;

/// See [`Scale`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Factor;
/// See [`Offset`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Added;
/// See [`TwosComplement`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bits;
/// See [`Zero`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Code;

impl Meaning for Factor {
    const PLACE: &'static str = "scale";
    const WANTED: &'static str = "a column of numbers with a finite factor other than 0";
    const REMEDY: &'static str = "write it like gyro=57.2958, for gyro, accel, mag, gyro2 and the like, temp_c, t_s or a single column such as gyro_x";

    fn takes(column: Column) -> bool {
        column != Column::Step
    }

    fn fits(number: f64) -> bool {
        number.is_finite() && number != 0.0
    }
}

impl Meaning for Added {
    const PLACE: &'static str = "offset";
    const WANTED: &'static str = "a column of numbers with an offset";
    const REMEDY: &'static str = "write it like temp_c=36.53, one column at a time";
    const OF_SENSORS: bool = false;

    fn takes(column: Column) -> bool {
        !matches!(column, Column::Time | Column::Step)
    }

    fn fits(number: f64) -> bool {
        number.is_finite()
    }
}

impl Meaning for Bits {
    const PLACE: &'static str = "two's complement";
    const WANTED: &'static str = "a raw column with 2 to 32 bits";
    const REMEDY: &'static str =
        "write it like accel=12, for gyro, accel or a single column such as gyro_x";

    fn takes(column: Column) -> bool {
        column.triad().is_some()
    }

    fn fits(number: f64) -> bool {
        number.fract() == 0.0 && (2.0..=32.0).contains(&number)
    }
}

impl Meaning for Code {
    const PLACE: &'static str = "zero";
    const WANTED: &'static str = "a raw column with a code";
    const REMEDY: &'static str =
        "write it like gyro=2048, for gyro, accel or a single column such as gyro_x";

    fn takes(column: Column) -> bool {
        column.triad().is_some()
    }

    fn fits(number: f64) -> bool {
        number.is_finite()
    }
}

impl<M> PerColumn<M> {
    fn applies_to(&self, column: Column) -> bool {
        column.name() == self.target || of_sensor(&self.target, column)
    }

    /// The numbers for `column`.
    pub(super) fn given(all: &[Self], column: Column) -> impl Iterator<Item = f64> {
        let own = all.iter().filter(move |one| one.applies_to(column));
        own.map(|one| one.number)
    }

    /// The columns that it is for.
    fn columns(&self) -> Vec<Column> {
        match TriadName::parse(&self.target) {
            Some(triad) => [0, 1, 2].map(|axis| Column::of(triad, axis)).to_vec(),
            None => Column::from_name(&self.target).into_iter().collect(),
        }
    }
}

impl Scale {
    /// Whether it holds for readings of the first gyro or accelerometer, not only for the time, the temperature or a further triad.
    pub fn is_of_readings(&self) -> bool {
        let mut columns = self.columns().into_iter();
        columns.any(|column| matches!(column, Column::Raw(_)))
    }

    /// The scales of those columns for which `by_hand` has none. If it has some axes of a sensor, the scale is kept for the others.
    pub(super) fn beside(scales: &[Scale], by_hand: &[Scale]) -> Vec<Scale> {
        let free = |column: &Column| Self::given(by_hand, *column).next().is_none();
        let mut beside = Vec::new();
        for scale in scales {
            let columns = scale.columns();
            match columns.iter().all(free) {
                true => beside.push(scale.clone()),
                false => beside.extend(columns.into_iter().filter(free).map(|column| Scale {
                    target: column.name().to_owned(),
                    ..scale.clone()
                })),
            }
        }
        beside
    }
}

impl<M: Meaning> FromStr for PerColumn<M> {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let parsed = text.split_once('=').and_then(|(target, number)| {
            let (target, number) = (target.trim(), number.trim().parse().ok()?);
            let named = Column::from_name(target).is_some_and(M::takes);
            let known = named || M::OF_SENSORS && TriadName::parse(target).is_some();
            (known && M::fits(number)).then(|| Self {
                target: target.to_owned(),
                number,
                meaning: PhantomData,
            })
        });
        parsed.ok_or_else(|| {
            let problem = format!("{} is not {}", shorten(text.as_bytes()), M::WANTED);
            Error::new(M::PLACE, problem, M::REMEDY)
        })
    }
}

impl<M> fmt::Display for PerColumn<M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.target, self.number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all<M: Meaning>(texts: &[&str]) -> Vec<PerColumn<M>> {
        texts.iter().map(|text| text.parse().unwrap()).collect()
    }

    #[test]
    fn factors_multiply_and_reach_the_axes_of_their_sensor_only() {
        let scales: Vec<Scale> = all(&["gyro=2", "gyro_x=3", "t_s=0.001"]);
        let product = |column| -> f64 { Scale::given(&scales, column).product() };
        let columns = [Column::Raw(0), Column::Raw(1), Column::Raw(3), Column::Time];
        assert_eq!(columns.map(product), [6.0, 2.0, 1.0, 0.001]);
        let zeros: Vec<Zero> = all(&["gyro=512", "accel_z=-3"]);
        let sum = |c| -> f64 { Zero::given(&zeros, Column::Raw(c)).sum() };
        assert_eq!([1, 4, 5].map(sum), [512.0, 0.0, -3.0]);
        let mag = |axis| Column::of(TriadName::MAG, axis);
        let scales: Vec<Scale> = all(&["mag=0.1", "mag_y=-1", "mag2=7"]);
        let product = |column| -> f64 { Scale::given(&scales, column).product() };
        assert_eq!([0, 1].map(|axis| product(mag(axis))), [0.1, -0.1]);
    }

    #[test]
    fn what_names_no_column_or_no_number_is_refused() {
        for text in ["gyro", "gyro=x", "gyro=0", "foo=1", "step=2", "gyro=inf"] {
            assert!(text.parse::<Scale>().is_err(), "{text}");
        }
        for text in ["12", "accel", "accel=1", "accel=33", "temp_c=12", "accel=x"] {
            assert!(text.parse::<TwosComplement>().is_err(), "{text}");
        }
        for text in ["12", "gyro", "gyro=inf", "t_s=1", "gyro=x"] {
            assert!(text.parse::<Zero>().is_err(), "{text}");
        }
        let both: TwosComplement = "gyro=16".parse().unwrap();
        assert_eq!(both.to_string(), "gyro=16");
    }
}
