//! A known magnitude: of gravity in a pose, or of a turntable's rate in any orientation.

use mimu_core::compensation::Affine;
use nalgebra::{SVector, Vector3};

use super::{Block, slope};

/// Error of a magnitude.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Magnitude {
    /// The calibrated input, SI.
    pub input: Vector3<f64>,
    /// Its direction.
    pub up: Vector3<f64>,
    /// `|C u + o|` minus the known magnitude, SI.
    pub block: Block<1>,
}

impl Magnitude {
    /// At the mean reading `raw`, where the magnitude is `known`.
    pub fn at(model: &Affine<f64>, raw: &Vector3<f64>, known: f64) -> Self {
        let input = model.apply(raw);
        let size = input.norm();
        let up = input / size;
        Self {
            input,
            up,
            block: Block {
                residual: SVector::from([size - known]),
                by: slope(&up, raw).transpose(),
            },
        }
    }

    /// The error.
    pub fn residual(&self) -> f64 {
        self.block.residual[0]
    }
}
