//! Truth of a turntable: its limits, its controller's rates and its flaws.

use serde::{Deserialize, Serialize};

use crate::axis::Settling;
use crate::plan::Limits;
use crate::refusal::{Refusal, within};
use crate::rotation::Vector;

/// Truth of the table. Three numbers belong to the outer, the middle and the inner axis, unless stated otherwise.
///
/// The default is a good table of three axes: angles to a few arcseconds, rates to a few millionths.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TableTruth {
    /// 3; or 2: no outer axis, and rates only about the inner one.
    pub axes: u32,
    /// Lowest angle of the middle axis, degrees.
    pub middle_min_deg: f64,
    /// Highest angle of the middle axis, degrees.
    pub middle_max_deg: f64,
    /// Highest rates.
    pub max_rate_dps: Vector,
    /// Accelerations, of every ramp.
    pub max_acceleration_dps2: Vector,
    /// Rates of the moves from pose to pose.
    pub slew_dps: Vector,
    /// Time from the end of a move to the dwell, s. [`Settling`] determines whether the load has settled by then.
    pub settle_s: f64,
    /// Ring-down of every axis.
    pub settling: Settling,
    /// Tilt of each axis back and forth, once per turn, in a plane fixed to the part that carries it. (A tilt that rotates with the axis would be a
    /// mounting error, and a constant one a level error.)
    pub wobble_arcsec: Vector,
    /// Excess of the angles over 90°: outer to middle, and middle to inner axis.
    pub nonorthogonality_arcsec: [f64; 2],
    /// Deviation of the outer axis from the vertical: rotations about east and north.
    pub level_arcsec: [f64; 2],
    /// Orientation of the board in the frame of the inner axis: rotation vector.
    pub mounting_arcsec: Vector,
    /// True over reported rate, minus one, in dwells with a rate.
    pub rate_scale_ppm: Vector,
    /// True minus reported angle is this times the sine of the reported angle: an eccentric disc.
    pub encoder_arcsec: Vector,
    /// Position of the board's origin relative to the intersection of the axes, x, y, z of the board, mm.
    pub offset_mm: Vector,
}

impl Default for TableTruth {
    fn default() -> Self {
        Self {
            axes: 3,
            middle_min_deg: -180.0,
            middle_max_deg: 180.0,
            max_rate_dps: [400.0; 3],
            max_acceleration_dps2: [200.0; 3],
            slew_dps: [60.0; 3],
            settle_s: 1.0,
            settling: Settling::default(),
            wobble_arcsec: [1.0, 2.0, 2.0],
            nonorthogonality_arcsec: [3.0, -2.0],
            level_arcsec: [2.0, -3.0],
            mounting_arcsec: [20.0, -15.0, 30.0],
            rate_scale_ppm: [5.0, 0.0, -5.0],
            encoder_arcsec: [2.0, 3.0, -2.0],
            offset_mm: [2.0, -3.0, 5.0],
        }
    }
}

impl TableTruth {
    /// A table without flaws, with the board at the intersection of its axes: its reports are true.
    pub fn ideal() -> Self {
        Self {
            settling: Settling {
                fraction: 0.0,
                ..Settling::default()
            },
            wobble_arcsec: [0.0; 3],
            nonorthogonality_arcsec: [0.0; 2],
            level_arcsec: [0.0; 2],
            mounting_arcsec: [0.0; 3],
            rate_scale_ppm: [0.0; 3],
            encoder_arcsec: [0.0; 3],
            offset_mm: [0.0; 3],
            ..Self::default()
        }
    }

    /// Limits for plans.
    pub fn limits(&self) -> Limits {
        Limits {
            outer: self.axes == 3,
            middle: [
                self.middle_min_deg.to_radians(),
                self.middle_max_deg.to_radians(),
            ],
            rate: [
                self.max_rate_dps[0].to_radians(),
                self.max_rate_dps[2].to_radians(),
            ],
        }
    }

    /// Refuses impossible values.
    pub fn check(&self) -> Result<(), Refusal> {
        if self.axes != 2 && self.axes != 3 {
            let problem = format!("`axes` is {}", self.axes);
            return Err(Refusal::new("table.axes", problem, "give 2 or 3"));
        }
        let Settling {
            frequency_hz,
            damping,
            fraction,
        } = self.settling;
        // More than ten degrees is not a flaw of a table, but a board may be mounted in any orientation.
        let (flaw, any) = ([-36e3, 36e3], [-648e3, 648e3]);
        let ranges: [(&str, &[f64], [f64; 2]); 15] = [
            ("middle_min_deg", &[self.middle_min_deg], [-360.0, 0.0]),
            ("middle_max_deg", &[self.middle_max_deg], [0.0, 360.0]),
            ("max_rate_dps", &self.max_rate_dps, [0.01, 36e3]),
            (
                "max_acceleration_dps2",
                &self.max_acceleration_dps2,
                [0.01, 1e6],
            ),
            ("slew_dps", &self.slew_dps, [0.01, 36e3]),
            ("settle_s", &[self.settle_s], [0.0, 3600.0]),
            ("settling.frequency_hz", &[frequency_hz], [0.1, 1000.0]),
            ("settling.damping", &[damping], [0.001, 0.999]),
            ("settling.fraction", &[fraction], [0.0, 1.0]),
            ("wobble_arcsec", &self.wobble_arcsec, flaw),
            (
                "nonorthogonality_arcsec",
                &self.nonorthogonality_arcsec,
                flaw,
            ),
            ("level_arcsec", &self.level_arcsec, flaw),
            ("mounting_arcsec", &self.mounting_arcsec, any),
            ("encoder_arcsec", &self.encoder_arcsec, flaw),
            ("rate_scale_ppm", &self.rate_scale_ppm, [-1e5, 1e5]),
        ];
        for (key, values, range) in ranges {
            within(&format!("table.{key}"), values, range)?;
        }
        within("table.offset_mm", &self.offset_mm, [-1e4, 1e4])
    }
}
