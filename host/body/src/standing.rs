//! A further triad as a calibration file has it, in the frame of its reference.

use mimu::calibration::body::BodyTriad;
use mimu::triad::vector;
use mimu_core::compensation::Affine;
use nalgebra::{DVector, Vector3};

use crate::relation::DELAY;

/// Where a triad stands, and its calibration in the frame of the reference.
pub(crate) struct Standing {
    /// C and o, in the frame of the reference.
    pub calibration: Affine<f64>,
    /// Delay, s, and arm, m; zero if they are not known.
    pub delay_s: f64,
    pub arm_m: Vector3<f64>,
}

impl From<&BodyTriad> for Standing {
    fn from(of: &BodyTriad) -> Self {
        Self {
            calibration: of.in_reference(),
            delay_s: of.delay_ms.unwrap_or(0.0) / 1e3,
            arm_m: Vector3::from(of.lever_arm_mm.unwrap_or([0.0; 3])) / 1e3,
        }
    }
}

impl Standing {
    /// So many parameters: C and o, the delay, and zeros.
    pub fn parameters(&self, count: usize) -> DVector<f64> {
        let mut at = DVector::zeros(count);
        let Affine { matrix, offset } = self.calibration;
        at.fixed_rows_mut::<12>(0)
            .copy_from(&vector(&matrix, &offset));
        at[DELAY] = self.delay_s;
        at
    }
}
