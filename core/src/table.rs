//! Compensation over temperature: inverse models at several temperatures, and between them.
//!
//! A node holds the whole of C and o of both triads, and these are interpolated linearly. Not a scale factor K(T) in front of a fixed
//! M: what drifts is the sensor, a row of the forward matrix and so a column of C; row factors would be wrong by drift times
//! misalignment, of which 1 % each make 100 ppm.
//!
//! Temperature moves slowly, so this runs some times a second ([`Table::follow`]), and what runs with every sample is
//! [`Compensation::apply`] of the model that it leaves behind.

use heapless::Vec;
use nalgebra::{RealField, convert};

use crate::compensation::{Affine, Compensation};
use crate::effects::REFERENCE_C;

/// Inverse models of a unit at one temperature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Node<T: RealField> {
    /// Temperature, °C.
    pub temp_c: T,
    /// Raw to SI.
    pub model: Compensation<T>,
}

impl<T: RealField + Copy> Node<T> {
    fn is_finite(&self) -> bool {
        let affine = |a: &Affine<T>| {
            a.matrix
                .iter()
                .chain(a.offset.iter())
                .all(|v| v.is_finite())
        };
        self.temp_c.is_finite() && affine(&self.model.gyro) && affine(&self.model.accel)
    }
}

/// Why nodes are not a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refused {
    /// There is no node, or more than N.
    Count,
    /// The temperature of this node is not above that of the one before.
    Order(usize),
    /// A number of this node is not finite.
    NotFinite(usize),
}

/// Nodes in the order of their temperatures: immutable, for any number of streams.
#[derive(Debug, Clone, PartialEq)]
pub struct Table<T: RealField, const N: usize> {
    /// Apart, because there always is one.
    first: Node<T>,
    others: Vec<Node<T>, N>,
}

/// Where a temperature is in a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Between the first node and the last.
    Inside,
    /// Below the first, whose model is used as it is.
    Below,
    /// Above the last, whose model is used as it is.
    Above,
}

/// The model of one stream at its temperature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State<T: RealField> {
    /// Raw to SI.
    pub model: Compensation<T>,
    /// Whether it is that of a temperature outside the nodes. A single node is for all temperatures, and has no outside.
    pub place: Place,
}

impl<T: RealField + Copy, const N: usize> Table<T, N> {
    /// A table of 1 to N nodes of strictly increasing temperature.
    pub fn new(nodes: impl IntoIterator<Item = Node<T>>) -> Result<Self, Refused> {
        let mut nodes = nodes.into_iter();
        let first = nodes.next().ok_or(Refused::Count)?;
        if !first.is_finite() {
            return Err(Refused::NotFinite(0));
        }
        let mut before = first.temp_c;
        let mut table = Self {
            first,
            others: Vec::new(),
        };
        for node in nodes {
            let at = table.len();
            if at == N {
                return Err(Refused::Count);
            }
            if !node.is_finite() {
                return Err(Refused::NotFinite(at));
            }
            if !(node.temp_c > before) {
                return Err(Refused::Order(at));
            }
            before = node.temp_c;
            table.others.push(node).map_err(|_| Refused::Count)?;
        }
        Ok(table)
    }

    /// The state of a stream whose temperature is not known yet: that of [`REFERENCE_C`].
    pub fn state(&self) -> State<T> {
        self.at(convert(REFERENCE_C))
    }

    /// Follows the temperature, °C. One that is not a number changes nothing.
    pub fn follow(&self, state: &mut State<T>, temp_c: T) {
        if temp_c.is_finite() {
            *state = self.at(temp_c);
        }
    }

    /// How many nodes.
    pub fn len(&self) -> usize {
        1 + self.others.len()
    }

    /// Never: there is a first.
    pub const fn is_empty(&self) -> bool {
        false
    }

    fn at(&self, temp_c: T) -> State<T> {
        let held = |node: &Node<T>, place| State {
            model: node.model,
            place,
        };
        let mut low = &self.first;
        for high in &self.others {
            if temp_c < low.temp_c {
                break;
            }
            if temp_c <= high.temp_c {
                let weight = (temp_c - low.temp_c) / (high.temp_c - low.temp_c);
                return State {
                    model: between(&low.model, &high.model, weight),
                    place: Place::Inside,
                };
            }
            low = high;
        }
        match temp_c < low.temp_c {
            _ if self.others.is_empty() => held(low, Place::Inside),
            true => held(low, Place::Below),
            false if temp_c > low.temp_c => held(low, Place::Above),
            false => held(low, Place::Inside),
        }
    }
}

/// `low` at weight 0, `high` at 1; both ends exactly, which `low + weight (high - low)` would miss at the upper one.
fn between<T: RealField + Copy>(
    low: &Compensation<T>,
    high: &Compensation<T>,
    weight: T,
) -> Compensation<T> {
    let rest = T::one() - weight;
    let affine = |low: &Affine<T>, high: &Affine<T>| Affine {
        matrix: low.matrix * rest + high.matrix * weight,
        offset: low.offset * rest + high.offset * weight,
    };
    Compensation {
        gyro: affine(&low.gyro, &high.gyro),
        accel: affine(&low.accel, &high.accel),
    }
}
