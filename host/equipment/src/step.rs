//! A requested dwell: the direction that points up, a rate about it, and the duration.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// A requested or completed dwell.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// Direction in the body frame that points up, of length 1.
    pub up: [f64; 3],
    /// Rate about the upward vertical, deg/s, by the right-hand rule.
    #[serde(default)]
    pub rate_dps: f64,
    /// Length of the dwell, s.
    pub dwell_s: f64,
}

impl Step {
    /// A dwell at rest.
    pub fn at_rest(up: Vector3<f64>, dwell_s: f64) -> Self {
        Self {
            up: up.normalize().into(),
            rate_dps: 0.0,
            dwell_s,
        }
    }

    /// Direction in the body frame that points up.
    pub fn up(&self) -> Vector3<f64> {
        Vector3::from(self.up)
    }

    /// Angular rate in the body frame, rad/s.
    pub fn rate(&self) -> Vector3<f64> {
        self.up() * self.rate_dps.to_radians()
    }

    /// Short description.
    pub fn words(&self) -> String {
        let pose = words(&self.up());
        match self.rate_dps {
            0.0 => pose,
            rate => format!("{pose}, turning at {rate:+} deg/s about the vertical"),
        }
    }
}

/// Axes with their signs, the largest first. Includes those within a factor of three of the largest.
fn parts(up: &Vector3<f64>) -> Vec<(usize, f64)> {
    let largest = up.amax();
    let mut parts: Vec<(usize, f64)> = (0..3)
        .map(|i| (i, up[i]))
        .filter(|p| p.1.abs() > largest / 3.0)
        .collect();
    parts.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
    parts
}

/// `+z face up`, `edge between +x and -y up`, `corner of +x, +y and -z up`. Other poses are named by their angles to the nearest of these.
pub fn words(up: &Vector3<f64>) -> String {
    let name = |p: &(usize, f64)| {
        let sign = if p.1 < 0.0 { '-' } else { '+' };
        format!("{sign}{}", mimu::quantity::AXES[p.0])
    };
    let all = parts(up);
    let exact: Vector3<f64> = all
        .iter()
        .map(|p| Vector3::ith(p.0, p.1.signum()))
        .sum::<Vector3<f64>>()
        .normalize();
    let text = match all.as_slice() {
        [a] => format!("{} face up", name(a)),
        [a, b] => format!("edge between {} and {} up", name(a), name(b)),
        [a, b, c] => format!("corner of {}, {} and {} up", name(a), name(b), name(c)),
        _ => String::new(),
    };
    match exact.angle(up).to_degrees() {
        off if off < 1.0 => text,
        off => format!("{text}, {off:.0} degrees off"),
    }
}

/// A box seen from above, front and right, in the pose with `up` upwards, with the names of its top, front and right faces.
///
/// Only faces can be drawn this way. An edge or a corner is drawn as the pose of its first face, turned so that the part to lift is visible, and a
/// note says what to lift.
pub fn sketch(up: &Vector3<f64>) -> [String; 7] {
    let faces: Vec<Vector3<f64>> = parts(up)
        .iter()
        .map(|p| Vector3::ith(p.0, p.1.signum()))
        .collect();
    let name = |face: &Vector3<f64>| {
        let axis = face.iamax();
        let sign = if face[axis] < 0.0 { '-' } else { '+' };
        format!("{sign}{}", mimu::quantity::AXES[axis])
    };
    // A right-handed box: front x right = top.
    let (top, front) = match faces.as_slice() {
        [] => (Vector3::z(), Vector3::x()),
        [top] => {
            let axis = (top.iamax() + 1) % 3;
            (*top, Vector3::ith(axis, 1.0))
        }
        [top, one] => (*top, *one),
        // Of the two orders, only one puts the other face on the right, where it is visible.
        [top, one, other, ..] if top.cross(one) == *other => (*top, *one),
        [top, _, other, ..] => (*top, *other),
    };
    let right = top.cross(&front);
    let lift = match faces.len() {
        0 | 1 => ["", "", ""],
        2 => ["lift its front", "until that edge", "is up"],
        _ => ["lift its front", "and right until", "that corner is up"],
    };
    let [t, f, r] = [top, front, right].map(|face| name(&face));
    [
        "       ________".into(),
        format!("      /  {t}   /|"),
        "     /       / |".into(),
        format!("    /_______/{r}|"),
        format!("    |       |  /   {}", lift[0]),
        format!("    |  {f}   | /    {}", lift[1]),
        format!("    |_______|/     {}", lift[2]),
    ]
    .map(|line: String| line.trim_end().into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_are_named_as_a_person_holds_them() {
        for (up, says) in [
            ([0.0, 0.0, 1.0], "+z face up"),
            ([0.0, -1.0, 0.02], "-y face up, 1 degrees off"),
            ([1.0, 0.0, -1.0], "edge between +x and -z up"),
            ([1.0, -1.0, 1.0], "corner of +x, -y and +z up"),
        ] {
            let up = Vector3::from(up).normalize();
            assert_eq!(words(&up), says);
        }
    }

    #[test]
    fn front_times_right_of_the_sketch_is_up_and_what_is_lifted_is_seen() {
        for k in 0..27 {
            let up = Vector3::new(k / 9 - 1, k / 3 % 3 - 1, k % 3 - 1).cast::<f64>();
            if up == Vector3::zeros() {
                continue;
            }
            let lines = sketch(&up).join("\n");
            let at = |s: &str| {
                let axis = mimu::quantity::AXES
                    .iter()
                    .position(|a| s.ends_with(a))
                    .unwrap();
                Vector3::ith(axis, if s.starts_with('-') { -1.0 } else { 1.0 })
            };
            let names: Vec<&str> = lines
                .split(|c: char| !(c == '+' || c == '-' || c.is_alphabetic()))
                .filter(|w| w.starts_with(['+', '-']))
                .collect();
            // In reading order from the top: top, right, front.
            let [top, right, front] = [names[0], names[1], names[2]].map(at);
            assert_eq!(front.cross(&right), top, "{lines}");
            let seen = match lines.contains("lift") {
                false => top,
                true if lines.contains("right until") => top + front + right,
                true => top + front,
            };
            assert_eq!(seen, up, "{lines}");
        }
    }

    #[test]
    fn a_corner_is_drawn_with_all_its_faces_seen() {
        let lines = sketch(&Vector3::new(1.0, 1.0, -1.0)).join("\n");
        let drawn = "
       ________
      /  +x   /|
     /       / |
    /_______/+y|
    |       |  /   lift its front
    |  -z   | /    and right until
    |_______|/     that corner is up";
        assert_eq!(lines, drawn[1..]);
    }
}
