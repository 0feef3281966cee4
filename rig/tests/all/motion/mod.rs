//! Motions against closed forms of kinematics, and against numeric differentiation of attitude and position.

mod closed_forms;
mod commands;
mod flaws;
mod hands;
mod table;
mod turns;

use mimu_rig::motion::Carrier;
use mimu_rig::place::Place;
use mimu_rig::rotation::{Rotation, Vector, add, norm, scale};

fn minus(a: Vector, b: Vector) -> Vector {
    add(a, scale(-1.0, b))
}

fn assert_near(found: Vector, expected: Vector, tolerance: f64) {
    assert!(
        norm(minus(found, expected)) <= tolerance,
        "{found:?} is not {expected:?} within {tolerance:e}"
    );
}

/// Rate from attitudes, and specific force from positions, by central differences around the middle of five times.
struct Differences {
    h: f64,
    attitudes: [Rotation; 5],
    place: Place,
}

impl Differences {
    /// Rate against inertial space, body axes, at one of the inner times.
    fn rate(&self, i: usize) -> Vector {
        let [a, b] = [self.attitudes[i - 1], self.attitudes[i + 1]];
        let (axis, angle) = (a.inverse() * b).axis_angle();
        let ground = self.attitudes[i].inverse().turn(self.place.earth_rate());
        // In the axes of the middle time, which to second order is the same as in those of its neighbours.
        add(scale(0.5 * angle / self.h, axis), ground)
    }

    fn angular_acceleration(&self) -> Vector {
        scale(0.5 / self.h, minus(self.rate(3), self.rate(1)))
    }
}

/// Compares the motion with the numeric derivatives of its own attitude, except where the angular acceleration jumps by more than `corner` (rad/s²)
/// and is undefined. Returns the number of compared times.
fn differentiate(carrier: &mut dyn Carrier, place: Place, corner: f64) -> usize {
    // The second-order error of the rate is h²/6 of the jerk of some 100 rad/s³: 2e-7 rad/s. If the jerk itself jumps, the error of the angular
    // acceleration is up to h times the jump: 2e-2 rad/s².
    let h = 1e-4;
    let n = ((carrier.duration_s() - 0.1) / 0.0097) as usize;
    let mut compared = 0;
    for k in 0..n {
        let t = 0.05 + k as f64 * 0.0097;
        let at = [-2.0, -1.0, 0.0, 1.0, 2.0].map(|i| carrier.at(t + i * h));
        let [first, .., last] = at.map(|i| i.motion.angular_acceleration);
        if norm(minus(last, first)) > corner {
            continue;
        }
        let differences = Differences {
            h,
            attitudes: at.map(|i| i.motion.attitude),
            place,
        };
        let motion = at[2].motion;
        assert_near(differences.rate(2), motion.rate, 2e-6);
        assert_near(
            differences.angular_acceleration(),
            motion.angular_acceleration,
            2e-2,
        );
        compared += 1;
    }
    compared
}
