//! Mounting of a board, by the numbers that PX4 and ArduPilot use.

/// A rotation matrix, from the board's axes to the vehicle's.
pub(super) type Rotation = [[f64; 3]; 3];

/// Roll, pitch and yaw in deg of the orientations 0 to 40 of `MAV_SENSOR_ORIENTATION`, which both use. Beyond 40, the two differ.
#[rustfmt::skip]
const ORIENTATIONS: [[u16; 3]; 41] = [
    [0, 0, 0], [0, 0, 45], [0, 0, 90], [0, 0, 135], [0, 0, 180], [0, 0, 225], [0, 0, 270], [0, 0, 315],
    [180, 0, 0], [180, 0, 45], [180, 0, 90], [180, 0, 135], [0, 180, 0], [180, 0, 225], [180, 0, 270], [180, 0, 315],
    [90, 0, 0], [90, 0, 45], [90, 0, 90], [90, 0, 135], [270, 0, 0], [270, 0, 45], [270, 0, 90], [270, 0, 135],
    [0, 90, 0], [0, 270, 0], [0, 180, 90], [0, 180, 270], [90, 90, 0], [180, 90, 0], [270, 90, 0], [90, 180, 0],
    [270, 180, 0], [90, 270, 0], [180, 270, 0], [270, 270, 0], [90, 180, 90], [90, 0, 270], [90, 68, 293], [0, 315, 0],
    [90, 315, 0],
];

/// The rotation of orientation `number`, if both number it alike.
pub(super) fn orientation(number: f64) -> Option<Rotation> {
    let whole = number.fract() == 0.0 && number >= 0.0;
    let angles = ORIENTATIONS.get(whole.then_some(number as usize)?)?;
    Some(from_euler(angles.map(f64::from)))
}

/// From roll, pitch and yaw in degrees, about z, then y, then x: `Rz(yaw) Ry(pitch) Rx(roll)`.
pub(super) fn from_euler(angles_deg: [f64; 3]) -> Rotation {
    let [(sr, cr), (sp, cp), (sy, cy)] = angles_deg.map(|angle| angle.to_radians().sin_cos());
    [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
}

/// `a b`.
pub(super) fn product(a: &Rotation, b: &Rotation) -> Rotation {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

/// Offsets or scale factors of the three axes, for a note.
pub(super) fn listed(three: [f64; 3]) -> String {
    three.map(|value| format!("{value:.6}")).join(" ")
}

/// The calibration that was applied to one sensor's readings: `rotation ((raw - offset) scale)`, with offset and scale for each axis.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Correction {
    pub rotation: Rotation,
    pub offset: [f64; 3],
    pub scale: [f64; 3],
    /// Whether it was applied in another order: `scale (rotation raw) - offset`, on the vehicle's axes.
    pub in_vehicle: bool,
}

impl Correction {
    /// The reading before this calibration.
    pub fn undo(&self, reading: [f64; 3]) -> [f64; 3] {
        let Self {
            rotation,
            offset,
            scale,
            ..
        } = self;
        let in_sensor = |vehicle: [f64; 3]| -> [f64; 3] {
            std::array::from_fn(|i| (0..3).map(|k| rotation[k][i] * vehicle[k]).sum())
        };
        match self.in_vehicle {
            true => in_sensor(std::array::from_fn(|i| (reading[i] + offset[i]) / scale[i])),
            false => {
                let scaled = in_sensor(reading);
                std::array::from_fn(|i| scaled[i] / scale[i] + offset[i])
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On a board mounted with roll 180, yaw 90, the board's x points to the vehicle's y: the roll leaves x in place, and the yaw takes x to y. The
    /// board's y points to the vehicle's x, its z to the vehicle's -z.
    #[test]
    fn axes_of_a_mounted_board_point_where_a_hand_turns_them() {
        let matrix = orientation(10.0).unwrap();
        for (board, vehicle) in [
            ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]),
            ([0.0, 1.0, 0.0], [1.0, 0.0, 0.0]),
            ([0.0, 0.0, 1.0], [0.0, 0.0, -1.0]),
        ] {
            for i in 0..3 {
                let turned: f64 = (0..3).map(|k| matrix[i][k] * board[k]).sum();
                assert!((turned - vehicle[i]).abs() < 1e-12, "{matrix:?}");
            }
        }
        assert_eq!(orientation(41.0), None);
        assert_eq!(orientation(-1.0), None);
        assert_eq!(orientation(0.5), None);
    }

    #[test]
    fn undone_is_what_was_there_before() {
        let mut correction = Correction {
            rotation: product(&from_euler([3.0, -2.0, 7.0]), &orientation(38.0).unwrap()),
            offset: [0.1, -0.2, 0.3],
            scale: [1.02, 0.97, 1.0],
            in_vehicle: false,
        };
        let raw = [1.0, 2.0, -9.0];
        let rotated = |three: [f64; 3]| -> [f64; 3] {
            correction
                .rotation
                .map(|row| (0..3).map(|k| row[k] * three[k]).sum::<f64>())
        };
        let [offset, scale] = [correction.offset, correction.scale];
        let scaled = std::array::from_fn(|i| (raw[i] - offset[i]) * scale[i]);
        let turned = rotated(raw);
        let both = [
            rotated(scaled),
            std::array::from_fn(|i| turned[i] * scale[i] - offset[i]),
        ];
        for (in_vehicle, done) in [false, true].into_iter().zip(both) {
            correction.in_vehicle = in_vehicle;
            let undone = correction.undo(done);
            assert!(
                (0..3).all(|i| (undone[i] - raw[i]).abs() < 1e-12),
                "{undone:?}"
            );
        }
    }
}
