//! Files that show the unit at rest on one face each: which axis was up, and the specific force that follows.

use std::fmt;
use std::str::FromStr;

use crate::cell::shorten;
use crate::columns::REFERENCE_COLUMNS;
use crate::error::{Error, Result};

/// The axis that is up, along which the specific force at rest is +g.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Face {
    axis: usize,
    down: bool,
}

impl Face {
    /// All six, in the order +x, -x, +y, -y, +z, -z.
    pub fn all() -> [Face; 6] {
        std::array::from_fn(|i| Face {
            axis: i / 2,
            down: i % 2 == 1,
        })
    }

    /// Its known inputs, in the order of [`REFERENCE_COLUMNS`]: m/s² along each axis, and NaN for the unknown rates.
    pub(super) fn inputs(self, gravity_mps2: f64) -> [f64; REFERENCE_COLUMNS.len()] {
        let mut inputs = [f64::NAN, f64::NAN, f64::NAN, 0.0, 0.0, 0.0];
        inputs[3 + self.axis] = match self.down {
            true => -gravity_mps2,
            false => gravity_mps2,
        };
        inputs
    }

    /// A warning that lists the faces not among `faces`, if there are any.
    pub(super) fn missing(faces: &[Face]) -> Option<String> {
        let missing = Face::all().into_iter().filter(|face| !faces.contains(face));
        let names: Vec<String> = missing.map(|face| face.to_string()).collect();
        (!names.is_empty()).then(|| {
            format!(
                "the faces {} have no file: bias and scale factor of an axis need both of its faces",
                names.join(", ")
            )
        })
    }
}

impl fmt::Display for Face {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sign = if self.down { '-' } else { '+' };
        write!(f, "{sign}{}", ["x", "y", "z"][self.axis])
    }
}

impl FromStr for Face {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let face = Face::all()
            .into_iter()
            .find(|face| face.to_string() == text);
        face.ok_or_else(|| {
            Error::new(
                "face",
                format!("{} is not a face", shorten(text.as_bytes())),
                "write the axis that is up: +x, -x, +y, -y, +z or -z",
            )
        })
    }
}
