//! An effect for people and programs: its public id and its stored numbers.

use core::fmt;

use nalgebra::RealField;
use serde::ser::{Serialize, SerializeStruct, Serializer};

use super::effect::{DeviceEffect, Numbers, axis_name};

/// The public id; that of a term has the form `term:accel_y~rate_x*force_y^2`.
impl<T: RealField + Copy> fmt::Display for DeviceEffect<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sensor = self.sensor;
        match &self.numbers {
            Numbers::Named { law, .. } => write!(f, "{sensor}_{}", law.name),
            Numbers::Term {
                axis, variables, ..
            } => {
                write!(f, "term:{sensor}_{}", axis_name(usize::from(*axis)))?;
                let mut sign = '~';
                for same in variables.chunk_by(|a, b| a == b) {
                    let [Some(variable), ..] = same else { continue };
                    write!(f, "{sign}{}", variable.name())?;
                    if same.len() > 1 {
                        write!(f, "^{}", same.len())?;
                    }
                    sign = '*';
                }
                Ok(())
            }
        }
    }
}

/// For people and programs: the stored numbers, unrounded.
impl<T: RealField + Copy + Serialize> Serialize for DeviceEffect<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut all = serializer.serialize_struct("DeviceEffect", 3)?;
        all.serialize_field("id", &Text(self))?;
        all.serialize_field("coefficients", self.coefficients())?;
        all.serialize_field("time_constant_s", &self.nonlinear())?;
        all.end()
    }
}

/// As text.
struct Text<T>(T);

impl<T: fmt::Display> Serialize for Text<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&self.0)
    }
}
