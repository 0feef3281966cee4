//! Triads on the board beyond the first gyro and accelerometer: a magnetometer, a second unit. Each has a place, an attitude and a delay.
//!
//! They have noise and low-passes as the first two, but no effects. The temperature changes only the iron of a magnetometer. Their supplies and converters are ideal.

use serde::{Deserialize, Serialize};

use crate::catalog::MeasuredQuantity;
use crate::field::FieldTruth;
use crate::flaws::Flaws;
use crate::ideal::{Inverse, invert};
use crate::motion::{Carrier, Motion};
use crate::rotation::{Rotation, Vector, add, cross, dot, scale};
use crate::sensor::{Axis, TriadTruth};
use crate::unit::UnitTruth;

/// What the cells of a slower triad contain between its samples.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Between {
    /// Nothing.
    #[default]
    Empty,
    /// The last sample.
    Repeat,
}

/// Truth of a further triad.
#[derive(Debug, Clone, PartialEq)]
pub struct FurtherTruth {
    /// Stem of its columns: `mag`, `gyro2`.
    pub name: String,
    /// What it measures; the input is in rad/s, m/s² or µT.
    pub kind: MeasuredQuantity,
    /// Its sensors; their directions are in the triad's axes, in place of the body's.
    pub triad: TriadTruth,
    /// From the triad's axes into body axes.
    pub rotation: Rotation,
    /// From the board's origin, where the first accelerometer is, body axes, m.
    pub lever: Vector,
    /// Age of the input in a sample, s.
    pub delay_s: f64,
    /// Rows of the recording from sample to sample.
    pub every: u32,
    /// Cells of the other rows.
    pub between: Between,
    /// Quantisation, raw; 0: none.
    pub step_raw: f64,
    /// Field of iron on the board, per kelvin of the board above [`IRON_C`], triad's axes, µT/K.
    pub iron_per_c: Vector,
}

/// Temperature at which the nulls contain all iron, °C.
pub const IRON_C: f64 = 25.0;

/// A further triad as calibrations describe it, relative to the first gyro or accelerometer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Relation {
    /// `x = C u + o`, x in the triad's own frame: x along its first sensitive axis, y in the plane of the first two. rad/s, m/s² or µT.
    pub inverse: Inverse,
    /// Rotation vector from its own frame to that of the first accelerometer, which is defined likewise, degrees.
    pub rotation_deg: Vector,
    /// By how much it is later than the first accelerometer (an accelerometer) or gyro (the others): delay and low-passes, ms.
    pub delay_ms: f64,
    /// From the first accelerometer, in its frame, mm.
    pub lever_mm: Vector,
    /// By how much its iron reads more per kelvin, in its own frame, µT/K.
    pub iron_per_c: Vector,
}

impl FurtherTruth {
    /// The input of its sensors, triad's axes; the board is at `board_c`.
    fn input(&self, motion: &Motion, field: &FieldTruth, board_c: f64) -> Vector {
        let lever = self.lever;
        let body = match self.kind {
            MeasuredQuantity::Gyro => motion.rate,
            MeasuredQuantity::Accel => {
                let euler = cross(motion.angular_acceleration, lever);
                let centripetal = cross(motion.rate, cross(motion.rate, lever));
                add(motion.force, add(euler, centripetal))
            }
            MeasuredQuantity::Mag => {
                let position = add(motion.position, motion.attitude.turn(lever));
                let level = field.at(position, motion.t_s);
                motion.attitude.inverse().turn(level)
            }
        };
        let iron = scale(board_c - IRON_C, self.iron_per_c);
        add(self.rotation.inverse().turn(body), iron)
    }

    /// Its calibration; `None` if its sensitive directions do not span space.
    pub fn relation(&self, unit: &UnitTruth) -> Option<Relation> {
        let own = own_frame(&self.triad);
        let body = own_frame(&unit.accel);
        let (matrix, bias) = self.triad.affine();
        // The rows in the own frame: components change by the rotation into that frame.
        let c = invert(&matrix.map(|row| own.inverse().turn(row)))?;
        let (axis, angle) = (body.inverse() * self.rotation * own).axis_angle();
        let reference = match self.kind {
            MeasuredQuantity::Accel => &unit.accel,
            MeasuredQuantity::Gyro | MeasuredQuantity::Mag => &unit.gyro,
        };
        Some(Relation {
            inverse: Inverse {
                matrix: c,
                offset: c.map(|row| -dot(row, bias)),
            },
            rotation_deg: scale(angle.to_degrees(), axis),
            delay_ms: 1e3 * (self.delay_s + self.triad.lag_s() - reference.lag_s()),
            lever_mm: scale(1e3, body.inverse().turn(self.lever)),
            iron_per_c: own.inverse().turn(self.iron_per_c),
        })
    }
}

/// From the frame of a triad (x along its first sensitive axis, y in the plane of the first two) into the axes of its directions.
fn own_frame(triad: &TriadTruth) -> Rotation {
    let (matrix, _) = triad.affine();
    let x = [1.0, 0.0, 0.0];
    let aligned = Rotation::between(x, matrix[0]);
    let second = aligned.inverse().turn(matrix[1]);
    aligned * Rotation::about(x, second[2].atan2(second[1]))
}

/// State of a further triad.
pub(crate) struct Further {
    truth: FurtherTruth,
    /// Carries the board as in the rest of the recording, at the times of this triad.
    carrier: Box<dyn Carrier>,
    axes: [Axis; 3],
    row: u32,
    last: Vector,
}

impl Further {
    /// The triad at rows of `dt_s`, on a carrier from the beginning of the recording.
    pub(crate) fn new(
        truth: &FurtherTruth,
        carrier: Box<dyn Carrier>,
        dt_s: f64,
        seed: u64,
    ) -> Self {
        let axis = |i: usize| {
            let name = format!("{} {}", truth.name, ["x", "y", "z"][i]);
            Axis::new(&truth.triad.axes[i], false, &name, dt_s, seed)
        };
        Self {
            truth: truth.clone(),
            carrier,
            axes: std::array::from_fn(axis),
            row: 0,
            last: [0.0; 3],
        }
    }

    /// Cells of the next row, which is at `t_s`, with the board at `board_c`, raw: NaN if they are empty. Before the recording the board is as in its beginning.
    pub(crate) fn read(
        &mut self,
        (t_s, board_c): (f64, f64),
        flaws: &Flaws,
        field: &FieldTruth,
    ) -> Vector {
        let truth = &self.truth;
        let mut instant = self.carrier.at((t_s - truth.delay_s).max(0.0));
        flaws.sway(&mut instant);
        let input = truth.input(&instant.motion, field, board_c);
        // The low-passes run in every row: between the samples of a slow triad the input is far from linear.
        let output: Vector = std::array::from_fn(|i| {
            let axis = &mut self.axes[i];
            let exact = axis.step(axis.sensed(input), 1.0);
            if truth.step_raw > 0.0 {
                truth.step_raw * (exact / truth.step_raw).round()
            } else {
                exact
            }
        });
        let samples = self.row.is_multiple_of(truth.every);
        self.row += 1;
        if samples {
            self.last = output;
        }
        match truth.between {
            Between::Empty if !samples => [f64::NAN; 3],
            _ => self.last,
        }
    }
}
