//! A further triad as a calibration file has it, in the frame of its reference.

use mimu::calibration::body::BodyTriad;
use mimu::triad::vector;
use mimu_core::compensation::Affine;
use nalgebra::{DVector, Matrix3, Vector3};

use crate::iron::Warmth;
use crate::relation::DELAY;
use crate::series::Series;

/// Where a triad stands, and its calibration in the frame of the reference.
pub(crate) struct Standing {
    /// C and o, in the frame of the reference.
    pub calibration: Affine<f64>,
    /// Delay, s, and arm, m; zero if they are not known.
    pub delay_s: f64,
    pub arm_m: Vector3<f64>,
    /// By how much iron's field grows per kelvin, in the frame of the reference, and the temperature of `calibration`, °C.
    pub iron: Option<(Vector3<f64>, f64)>,
}

impl From<&BodyTriad> for Standing {
    fn from(of: &BodyTriad) -> Self {
        Self {
            calibration: of.in_reference(),
            delay_s: of.delay_ms.unwrap_or(0.0) / 1e3,
            arm_m: Vector3::from(of.lever_arm_mm.unwrap_or([0.0; 3])) / 1e3,
            iron: of.iron.map(|iron| {
                let turned = of.rotation().unwrap_or_else(Matrix3::identity);
                (turned * Vector3::from(iron.per_k), iron.temp_c)
            }),
        }
    }
}

impl Standing {
    /// What raw readings are in the frame of the reference. Where no temperature is known, iron does not move.
    pub fn compensated(&self, raw: Series, warmth: Option<&Warmth>) -> Series {
        let mut all = raw.map(|u| self.calibration.apply(u));
        if let Some(((per_k, temp_c), warmth)) = self.iron.zip(warmth) {
            let warmer = all.t.iter().map(|t| warmth.at(*t) - temp_c);
            let each = all.x.iter_mut().zip(warmer);
            each.for_each(|(x, warmer)| *x -= per_k * warmer);
        }
        all
    }

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
