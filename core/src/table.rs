//! Compensation over temperature: inverse models at several temperatures, and curves between them.
//!
//! A node contains C and o of both triads completely, instead of a scale factor K(T) times a fixed M. The sensor drifts: a row of the
//! forward matrix, and therefore a column of C. Row factors would be wrong by drift times misalignment: 1 % of each make 100 ppm.
//!
//! Between nodes each number is a cubic Hermite segment with the values and derivatives of both nodes. Drifts of MEMS sensors are cubics of
//! the temperature (niu). Straight lines between 16 nodes miss the bias of his gyro z by 5.4 deg/h over his -10 to 70 °C, and by 18 deg/h over -40 to
//! 85 °C. Hermite segments represent a cubic exactly, and have no kink at the nodes.
//!
//! Outside the nodes a cubic diverges with the third power. There each number continues along the slope of the end node for [`BEYOND_C`]
//! and is constant beyond.
//!
//! Each triad is evaluated at the temperature of its own dies: gyro and accelerometer are separate packages in different places on the
//! board.
//!
//! Temperature changes slowly, so [`Table::follow`] runs several times per second. With every sample only [`Compensation::apply`] runs,
//! with the latest model.

use heapless::Vec;
use nalgebra::{RealField, convert};

use crate::PerSensor;
use crate::compensation::{Affine, Compensation};
use crate::effects::REFERENCE_C;

pub use crate::die::BEYOND_C;

/// Temperatures that a calibration may have, °C: wider than the range of any part on the market.
pub const TEMPERATURE_RANGE_C: [f64; 2] = [-100.0, 250.0];

/// Whether a calibration may have this temperature, °C.
pub fn is_temperature<T: RealField + Copy>(temp_c: T) -> bool {
    let [least, most] = TEMPERATURE_RANGE_C.map(convert::<f64, T>);
    temp_c >= least && temp_c <= most
}

/// Inverse models of a unit at one temperature, and how they change with it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Node<T: RealField> {
    /// Temperature of the dies, °C.
    pub temp_c: T,
    /// Raw to SI.
    pub model: Compensation<T>,
    /// Derivative of each number of the model by the temperature, per kelvin.
    pub slope: Compensation<T>,
}

impl<T: RealField + Copy> Node<T> {
    /// A node whose numbers do not change with temperature.
    pub fn constant(temp_c: T, model: Compensation<T>) -> Self {
        let none = Affine {
            matrix: nalgebra::Matrix3::zeros(),
            offset: nalgebra::Vector3::zeros(),
        };
        let slope = Compensation {
            gyro: none,
            accel: none,
        };
        Self {
            temp_c,
            model,
            slope,
        }
    }

    fn is_finite(&self) -> bool {
        let affine = |a: &Affine<T>| {
            a.matrix
                .iter()
                .chain(a.offset.iter())
                .all(|v| v.is_finite())
        };
        let both = |of: &Compensation<T>| affine(&of.gyro) && affine(&of.accel);
        self.temp_c.is_finite() && both(&self.model) && both(&self.slope)
    }
}

/// Why nodes are not a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TableError {
    /// There is no node, or more than N.
    Count,
    /// The temperature of this node is not above that of the one before.
    Order(usize),
    /// A number of this node is not finite.
    NotFinite(usize),
    /// An end of the range is not finite, or the first is above the second.
    Range,
}

impl core::fmt::Display for TableError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Count => f.write_str("the table has no temperature node, or too many"),
            Self::Order(at) => write!(f, "temperature node {at} is not warmer than the one before"),
            Self::NotFinite(at) => {
                write!(f, "temperature node {at} has an entry that is not a number")
            }
            Self::Range => {
                f.write_str("the temperature range has no numbers, or ends before it begins")
            }
        }
    }
}

impl core::error::Error for TableError {}

/// Nodes in the order of their temperatures: immutable, for any number of streams.
#[derive(Debug, Clone, PartialEq)]
pub struct Table<T: RealField, const N: usize> {
    /// Stored separately, because there is always one.
    first: Node<T>,
    others: Vec<Node<T>, N>,
    /// Temperature range of the dies from which the nodes were found, °C.
    range_c: Option<[T; 2]>,
}

/// Where a temperature is in a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Within the range of the calibration.
    Inside,
    /// Below it, by however little.
    Below,
    /// Above it, by however little.
    Above,
}

/// The model of one stream at its temperature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State<T: RealField> {
    /// Raw to SI.
    pub model: Compensation<T>,
    /// Whether it is that of a temperature outside the range. See [`Table::limits`].
    pub place: Place,
}

impl<T: RealField + Copy, const N: usize> Table<T, N> {
    /// A table of 1 to N nodes of strictly increasing temperature.
    pub fn new(nodes: impl IntoIterator<Item = Node<T>>) -> Result<Self, TableError> {
        let mut nodes = nodes.into_iter();
        let first = nodes.next().ok_or(TableError::Count)?;
        if !first.is_finite() {
            return Err(TableError::NotFinite(0));
        }
        let mut before = first.temp_c;
        let mut table = Self {
            first,
            others: Vec::new(),
            range_c: None,
        };
        for node in nodes {
            let at = table.len();
            if at == N {
                return Err(TableError::Count);
            }
            if !node.is_finite() {
                return Err(TableError::NotFinite(at));
            }
            if !(node.temp_c > before) {
                return Err(TableError::Order(at));
            }
            before = node.temp_c;
            table.others.push(node).map_err(|_| TableError::Count)?;
        }
        Ok(table)
    }

    /// One model at all temperatures, listed at this one, °C.
    pub fn constant(temp_c: T, model: Compensation<T>) -> Self {
        Self {
            first: Node::constant(temp_c, model),
            others: Vec::new(),
            range_c: None,
        }
    }

    /// The same nodes, found from dies of these temperatures, °C.
    pub fn with_range(mut self, range_c: [T; 2]) -> Result<Self, TableError> {
        let [from, to] = range_c;
        match from.is_finite() && to.is_finite() && from <= to {
            true => self.range_c = Some(range_c),
            false => return Err(TableError::Range),
        }
        Ok(self)
    }

    /// Temperature range of the dies from which the nodes were found, °C.
    pub fn range_c(&self) -> Option<[T; 2]> {
        self.range_c
    }

    /// Temperature range of the calibration, °C: that of the dies from which it was found, limited to the nodes if there are several.
    /// `None`: a single node of unknown range, which is used at all temperatures.
    pub fn limits(&self) -> Option<[T; 2]> {
        let nodes = self.others.last();
        let nodes = nodes.map(|last| [self.first.temp_c, last.temp_c]);
        match (self.range_c, nodes) {
            (Some([a, b]), Some([c, d])) => Some([a.max(c), b.min(d)]),
            (one, other) => one.or(other),
        }
    }

    /// State of a stream whose temperature is unknown so far: the model at [`REFERENCE_C`].
    pub fn state(&self) -> State<T> {
        self.at(PerSensor::both(convert(REFERENCE_C)))
    }

    /// Follows the temperatures of the dies, °C. If one is NaN, nothing changes.
    pub fn follow(&self, state: &mut State<T>, dies_c: PerSensor<T>) {
        if dies_c.gyro.is_finite() && dies_c.accel.is_finite() {
            *state = self.at(dies_c);
        }
    }

    /// How many nodes.
    pub fn len(&self) -> usize {
        1 + self.others.len()
    }

    /// Always false: there is at least one node.
    pub const fn is_empty(&self) -> bool {
        false
    }

    fn at(&self, dies_c: PerSensor<T>) -> State<T> {
        let PerSensor {
            gyro: gyro_c,
            accel: accel_c,
        } = dies_c;
        let place = match self.limits() {
            Some([from, _]) if gyro_c < from || accel_c < from => Place::Below,
            Some([_, to]) if gyro_c > to || accel_c > to => Place::Above,
            _ => Place::Inside,
        };
        let model = Compensation {
            gyro: self.model(gyro_c, |both| &both.gyro),
            accel: self.model(accel_c, |both| &both.accel),
        };
        State { model, place }
    }

    fn model(&self, temp_c: T, of: fn(&Compensation<T>) -> &Affine<T>) -> Affine<T> {
        let mut low = &self.first;
        for high in &self.others {
            if temp_c < low.temp_c {
                break;
            }
            if temp_c <= high.temp_c {
                return Self::between(low, high, temp_c, of);
            }
            low = high;
        }
        let most: T = convert(BEYOND_C);
        let away = (temp_c - low.temp_c).max(-most).min(most);
        let (at, slope) = (of(&low.model), of(&low.slope));
        Affine {
            matrix: at.matrix + slope.matrix * away,
            offset: at.offset + slope.offset * away,
        }
    }

    /// At either end of a segment one weight is 1 and the other three are 0, so a node reproduces its numbers to the last bit.
    fn between(
        low: &Node<T>,
        high: &Node<T>,
        temp_c: T,
        of: fn(&Compensation<T>) -> &Affine<T>,
    ) -> Affine<T> {
        let (one, width) = (T::one(), high.temp_c - low.temp_c);
        let w = (temp_c - low.temp_c) / width;
        let rest = one - w;
        let [a, b, c, d] = [
            (one + w + w) * rest * rest,
            (one + rest + rest) * w * w,
            w * rest * rest * width,
            -w * w * rest * width,
        ];
        let (u, v) = (of(&low.model), of(&high.model));
        let (du, dv) = (of(&low.slope), of(&high.slope));
        Affine {
            matrix: u.matrix * a + v.matrix * b + du.matrix * c + dv.matrix * d,
            offset: u.offset * a + v.offset * b + du.offset * c + dv.offset * d,
        }
    }
}
