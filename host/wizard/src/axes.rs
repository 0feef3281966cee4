//! Checks that the axes match their names. An axis with the wrong sign, or two exchanged axes, fit perfectly. Only the requested poses reveal them,
//! and the turns, on which gyro and accelerometer have to agree.

use mimu::fit::Fit;
use mimu::quantity::{AXES, Sensor};
use mimu::triad::directions;
use nalgebra::{Matrix3, Vector3};

/// Fewest poses to conclude this from: with two poses, one axis remains ambiguous.
const FEWEST_POSES: usize = 3;
/// Fewest of them that have to differ from the requested pose: a single one may be a mistake.
const FEWEST_OTHERS: usize = 2;
/// Angle between axes of the same name of gyro and accelerometer, degrees. In no package are they so far apart.
const APART_DEG: f64 = 30.0;

/// All permutations and signs of axes, those with the fewest changes first. Each row says what the named axis reads.
fn exchanges() -> Vec<Matrix3<f64>> {
    let orders = [
        [0, 1, 2],
        [1, 0, 2],
        [0, 2, 1],
        [2, 1, 0],
        [1, 2, 0],
        [2, 0, 1],
    ];
    let mut all: Vec<Matrix3<f64>> = orders
        .iter()
        .flat_map(|order| {
            (0..8).map(|signs| {
                Matrix3::from_fn(|i, j| match order[i] == j {
                    true => 1.0 - 2.0 * f64::from(signs >> i & 1),
                    false => 0.0,
                })
            })
        })
        .collect();
    all.sort_by_key(changes);
    all
}

fn changes(exchange: &Matrix3<f64>) -> usize {
    (0..3).filter(|i| exchange[(*i, *i)] != 1.0).count()
}

/// `accel_x reads y, accel_y reads x`.
fn words(sensor: Sensor, exchange: &Matrix3<f64>) -> String {
    let changed = (0..3).filter(|i| exchange[(*i, *i)] != 1.0);
    let each = changed.map(|i| {
        let j = exchange.row(i).transpose().iamax();
        let sign = if exchange[(i, j)] < 0.0 { "-" } else { "" };
        format!("{}_{} reads {sign}{}", sensor.name(), AXES[i], AXES[j])
    });
    each.collect::<Vec<_>>().join(", ")
}

/// Says what the accelerometer's axes read, if all poses differ from the requested ones in the same way. `shown`: pairs of the direction requested up
/// and the direction up by the accelerometer.
pub fn mirrored(shown: &[[Vector3<f64>; 2]], limit_deg: f64) -> Option<String> {
    let is = |by: &Matrix3<f64>, [asked, seen]: &[Vector3<f64>; 2]| {
        (by * asked).angle(seen).to_degrees() <= limit_deg
    };
    let others = shown
        .iter()
        .filter(|s| !is(&Matrix3::identity(), s))
        .count();
    if shown.len() < FEWEST_POSES || others < FEWEST_OTHERS {
        return None;
    }
    // Few poses fit several exchanges: a rotation of three axes, say, and a swap of two of them. More poses decide.
    let all = exchanges().into_iter();
    let mut fitting = all.filter(|by| shown.iter().all(|s| is(by, s)));
    let (Some(by), None) = (fitting.next(), fitting.next()) else {
        return None;
    };
    Some(format!(
        "{others} of {} poses differ from the requested ones, all in the same way: {}",
        shown.len(),
        words(Sensor::Accel, &by)
    ))
}

/// Says how the axes of gyro and accelerometer are related, if axes of the same name are far apart.
pub fn frames_apart(fit: &Fit) -> Option<String> {
    let axes = |sensor| directions(&fit.sensor(sensor)?.estimated.triad.inverse).map(|d| d.0);
    let (gyro, accel) = (axes(Sensor::Gyro)?, axes(Sensor::Accel)?);
    // Rows: the gyro's axes in coordinates of the accelerometer's.
    let between = gyro * accel.transpose();
    let apart = |i: usize| between[(i, i)].clamp(-1.0, 1.0).acos().to_degrees();
    let most = (0..3).map(apart).fold(0.0, f64::max);
    if most <= APART_DEG {
        return None;
    }
    let near = |by: &Matrix3<f64>| by.component_mul(&between).sum();
    let by = exchanges()
        .into_iter()
        .reduce(|a, b| if near(&b) > near(&a) + 1e-9 { b } else { a })?;
    let mut causes = vec![words(Sensor::Gyro, &by)];
    if by.determinant() > 0.0 {
        // If the accelerometer is a mirror image, the sense of all rates is reversed.
        let accel = if changes(&-by) < changes(&by) {
            -by
        } else {
            by
        };
        causes.insert(
            usize::from(changes(&accel) > changes(&by)),
            words(Sensor::Accel, &accel),
        );
    }
    Some(format!(
        "axes of gyro and accelerometer with the same name are {most:.0} degrees apart, as if {}",
        causes.join(", or ")
    ))
}

/// Remedy for both errors.
pub const REMEDY: &str =
    "check wiring, signs and the order of the columns, and start a new session in another folder";

#[cfg(test)]
mod tests {
    use super::*;

    const ASKED: [[f64; 3]; 4] = [
        [0.0, 0.0, 1.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, -1.0],
        [-1.0, 1.0, 1.0],
    ];

    fn shown(seen: impl Fn(usize, [f64; 3]) -> [f64; 3]) -> Vec<[Vector3<f64>; 2]> {
        let pair = |(k, asked): (usize, [f64; 3])| {
            // A person holds a unit to within a few degrees.
            let off = Vector3::new(0.1, -0.08, 0.05) * (k as f64 - 1.0);
            [
                Vector3::from(asked).normalize(),
                Vector3::from(seen(k, asked)).normalize() + off,
            ]
        };
        ASKED.into_iter().enumerate().map(pair).collect()
    }

    #[test]
    fn poses_that_all_come_mirrored_or_exchanged_name_the_axes() {
        type Seen = fn(usize, [f64; 3]) -> [f64; 3];
        let cases: [(Seen, &str); 4] = [
            (|_, [x, y, z]| [x, y, -z], ": accel_z reads -z"),
            (
                |_, [x, y, z]| [-x, -y, -z],
                "accel_x reads -x, accel_y reads -y, accel_z reads -z",
            ),
            (|_, [x, y, z]| [y, x, z], "accel_x reads y, accel_y reads x"),
            (
                |_, [x, y, z]| [y, z, x],
                "accel_x reads y, accel_y reads z, accel_z reads x",
            ),
        ];
        for (seen, says) in cases {
            let words = mirrored(&shown(seen), 25.0).unwrap();
            assert!(words.ends_with(says), "{words}");
        }
    }

    #[test]
    fn a_pose_or_two_held_by_mistake_are_no_mirror() {
        assert_eq!(mirrored(&shown(|_, asked| asked), 25.0), None);
        for wrong in 0..4 {
            let seen = |k, asked: [f64; 3]| if k == wrong { asked.map(|a| -a) } else { asked };
            assert_eq!(mirrored(&shown(seen), 25.0), None, "{wrong}");
        }
        let seen = |k, asked: [f64; 3]| match k {
            0 => [0.0, 1.0, 0.0],
            3 => [0.0, 0.0, -1.0],
            _ => asked,
        };
        assert_eq!(mirrored(&shown(seen), 25.0), None);
    }
}
