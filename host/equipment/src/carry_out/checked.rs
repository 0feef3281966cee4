//! Checks that the unit moves as the table was commanded. A tilt axis with the wrong sign, or an interlock that opened for a moment, would make the
//! known inputs wrong.

use mimu::plan::Planned;
use mimu_core::compensation::Affine;
use mimu_device::record::RecordingState;
use mimu_recording::error::Error;
use nalgebra::Vector3;

use crate::step::words;

/// Angle between measured and planned vertical above which the pose is a different one, degrees. Wrong axes cause 90 or more; the biases of an
/// uncalibrated unit at the ends of its temperature range cause 20 at most.
const SAME_POSE_DEG: f64 = 30.0;
/// As in the wizard: sensitivities differ from the data sheet's by a few per cent, and nulls shift.
const RATE_SHARE: f64 = 0.2;
const RATE_DPS: f64 = 2.0;
/// Time over which readings are averaged, s.
const WINDOW_S: f64 = 1.0;

/// Readings of the running dwell, converted by the data sheet.
#[derive(Debug)]
pub(super) struct Checked {
    /// Inverse models of gyro and accelerometer by the data sheet.
    nominal: [Affine<f64>; 2],
    dwell: Option<usize>,
    since_s: f64,
    /// Number of samples at the last update.
    samples: u64,
    sum: [f64; 6],
    batches: f64,
    /// Mean raw gyro reading in the last dwell at rest.
    at_rest: Option<Vector3<f64>>,
}

impl Checked {
    /// Before the first reading.
    pub fn new(nominal: [Affine<f64>; 2]) -> Self {
        Self {
            nominal,
            dwell: None,
            since_s: 0.0,
            samples: 0,
            sum: [0.0; 6],
            batches: 0.0,
            at_rest: None,
        }
    }

    /// Adds the last readings; `running` is the running dwell. Returns a dwell that does not match the plan, and the reason.
    pub fn look(
        &mut self,
        running: Option<usize>,
        dwells: &[Planned],
        state: &RecordingState,
    ) -> Option<(usize, Error)> {
        let now_s = state.last_s.unwrap_or_default();
        if state.samples != self.samples && self.dwell.is_some() {
            self.batches += 1.0;
            for (sum, value) in self.sum.iter_mut().zip(state.raw) {
                *sum += value;
            }
        }
        self.samples = state.samples;
        let over = running != self.dwell || now_s - self.since_s >= WINDOW_S;
        if !over {
            return None;
        }
        let of = self.dwell.filter(|_| self.batches > 0.0);
        let mean = self.sum.map(|sum| sum / self.batches);
        (self.dwell, self.since_s) = (running, now_s);
        (self.sum, self.batches) = ([0.0; 6], 0.0);
        let wrong = of.and_then(|k| self.judge(&dwells[k], mean));
        Some((
            of?,
            wrong?.map(|e| e.place = format!("dwell {}", of.unwrap_or_default())),
        ))
    }

    fn judge(&mut self, dwell: &Planned, mean: [f64; 6]) -> Option<Error> {
        let up = Vector3::from(dwell.up.filter(|_| dwell.turn.is_none())?);
        let [gyro, accel] = [0, 3].map(|at| Vector3::new(mean[at], mean[at + 1], mean[at + 2]));
        let [by_gyro, by_accel] = self.nominal;
        let force = by_accel.matrix * accel + by_accel.offset;
        if force.angle(&up).to_degrees() > SAME_POSE_DEG {
            let (is, planned) = (words(&force.normalize()), words(&up));
            let problem =
                format!("by the accelerometer the pose is {is}, but {planned} was planned");
            let remedy = "check how the unit is mounted, and the directions in the driver file";
            return Some(Error::new("", problem, remedy));
        }
        if dwell.rate_dps == 0.0 {
            self.at_rest = Some(gyro);
            return None;
        }
        let rate = by_gyro.matrix * (gyro - self.at_rest?);
        let off = (rate - up * dwell.rate_dps.to_radians())
            .norm()
            .to_degrees();
        if off <= RATE_SHARE * dwell.rate_dps.abs() + RATE_DPS {
            return None;
        }
        let is = rate.dot(&up).to_degrees();
        let problem = format!(
            "by the gyro it turns at {is:+.1} deg/s about the vertical, but {:+} was planned",
            dwell.rate_dps
        );
        let remedy = "check the sign of `rate` in the driver file, and whether the interlock stopped the table";
        Some(Error::new("", problem, remedy))
    }
}
