//! The accelerometer's dwells as a scene of Foxglove: points on the sphere of gravity, and arrows for their residuals.

use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use nalgebra::{UnitQuaternion, Vector3};
use serde_json::{Value, json};

use super::time;

/// Length of the longest arrow, relative to the sphere's radius.
const LONGEST: f64 = 0.5;

/// Sums of compensated samples over dwells.
pub(super) struct Dwells {
    /// First row, row after the last, sum of the forces, and their number.
    sums: Vec<(u64, u64, Vector3<f64>, u32)>,
    reached: usize,
}

impl Dwells {
    pub fn of(prepared: &Prepared) -> Self {
        let dwells = prepared.dwells.list.iter();
        let sums = dwells.map(|d| (d.first_row, d.first_row + d.rows, Vector3::zeros(), 0));
        Self {
            sums: sums.collect(),
            reached: 0,
        }
    }

    /// Adds the force of a row, m/s². Rows must come in order.
    pub fn add(&mut self, row: u64, force: impl IntoIterator<Item = f64>) {
        while self.sums.get(self.reached).is_some_and(|s| s.1 <= row) {
            self.reached += 1;
        }
        let mut each = force.into_iter();
        let force = Vector3::from_fn(|_, _| each.next().unwrap_or(f64::NAN));
        if let Some((first, _, sum, n)) = self.sums.get_mut(self.reached)
            && *first <= row
            && force.iter().all(|f| f.is_finite())
        {
            *sum += force;
            *n += 1;
        }
    }

    /// The sphere and each dwell with their times, s, and a note.
    pub fn scenes(&self, prepared: &Prepared) -> (Vec<(f64, Value)>, Option<String>) {
        let gravity = prepared.manifest.gravity_mps2;
        let dwells = prepared.dwells.list.iter().zip(&self.sums);
        let used = dwells.filter(|(d, s)| d.faults[Sensor::Accel].is_none() && s.3 > 0);
        let all: Vec<_> = used
            .map(|(dwell, (_, _, sum, n))| {
                let force = sum / f64::from(*n);
                let known = dwell.input(Sensor::Accel);
                let known = known.unwrap_or_else(|| force.normalize() * gravity);
                (dwell, force, force - known)
            })
            .collect();
        let Some(((first, ..), (last, ..))) = all.first().zip(all.last()) else {
            let note = "The scene is left out: the recording has no dwell of the accelerometer.";
            return (Vec::new(), Some(note.into()));
        };
        let largest = all.iter().map(|(_, _, off)| off.norm()).fold(0.0, f64::max);
        let enlarged = match largest > 0.0 {
            true => LONGEST * gravity / largest,
            false => 1.0,
        };
        let mut messages = vec![(first.start_s, sphere(first.start_s))];
        for (dwell, force, off) in &all {
            let at = force / gravity;
            let arrow = arrow(&at, &(off * (enlarged / gravity)));
            let metadata = [
                ("step", dwell.step.to_string()),
                ("force_mps2", format!("{:?}", force.as_slice())),
                ("residual_mps2", format!("{:?}", off.as_slice())),
                ("enlarged", format!("{enlarged:?}")),
            ];
            let entity = json!({
                "timestamp": time(dwell.last_s),
                "frame_id": "body",
                "id": format!("dwell {}", dwell.first_row),
                "lifetime": {"sec": 0, "nsec": 0},
                "frame_locked": false,
                "metadata": metadata.map(|(key, value)| json!({"key": key, "value": value})),
                "arrows": [arrow], "cubes": [], "spheres": [ball(&at, 0.03, [0.1, 0.4, 0.9, 1.0])],
                "cylinders": [], "lines": [], "triangles": [], "texts": [], "models": [],
            });
            messages.push((dwell.last_s, json!({"deletions": [], "entities": [entity]})));
        }
        let note = format!(
            "{} dwells from {:.1} to {:.1} s; arrows of residuals are enlarged by {enlarged:.4}, the longest is {largest:.4} m/s².",
            all.len(),
            first.start_s,
            last.last_s
        );
        (messages, Some(note))
    }
}

/// Gravity in all directions.
fn sphere(t_s: f64) -> Value {
    let entity = json!({
        "timestamp": time(t_s), "frame_id": "body", "id": "gravity",
        "lifetime": {"sec": 0, "nsec": 0}, "frame_locked": false, "metadata": [],
        "arrows": [], "cubes": [], "spheres": [ball(&Vector3::zeros(), 2.0, [0.7, 0.7, 0.7, 0.2])],
        "cylinders": [], "lines": [], "triangles": [], "texts": [], "models": [],
    });
    json!({"deletions": [], "entities": [entity]})
}

fn ball(at: &Vector3<f64>, diameter: f64, [r, g, b, a]: [f64; 4]) -> Value {
    json!({
        "pose": pose(at, &UnitQuaternion::identity()),
        "size": {"x": diameter, "y": diameter, "z": diameter},
        "color": {"r": r, "g": g, "b": b, "a": a},
    })
}

/// An arrow from `at` along `vector`. An unrotated arrow points along x.
fn arrow(at: &Vector3<f64>, vector: &Vector3<f64>) -> Value {
    let turned = UnitQuaternion::rotation_between(&Vector3::x(), vector);
    // Between opposite vectors there are many rotations.
    let turned = turned.unwrap_or_else(|| {
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI)
    });
    let length = vector.norm();
    json!({
        "pose": pose(at, &turned),
        "shaft_length": 0.8 * length, "shaft_diameter": 0.01,
        "head_length": 0.2 * length, "head_diameter": 0.025,
        "color": {"r": 0.9, "g": 0.2, "b": 0.1, "a": 1.0},
    })
}

fn pose(at: &Vector3<f64>, turned: &UnitQuaternion<f64>) -> Value {
    json!({
        "position": {"x": at.x, "y": at.y, "z": at.z},
        "orientation": {"x": turned.i, "y": turned.j, "z": turned.k, "w": turned.w},
    })
}

/// Schema of a time in Foxglove.
pub(super) fn time_schema() -> Value {
    json!({"type": "object", "title": "time", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}})
}

/// Schema of `foxglove.SceneUpdate`, limited to the fields that are written here. Source: Foxglove documentation, "SceneUpdate", "SceneEntity",
/// "ArrowPrimitive", "SpherePrimitive".
pub(super) fn schema() -> Value {
    let object = |properties: Value| json!({"type": "object", "properties": properties});
    let number = || json!({"type": "number"});
    let list = |items: Value| json!({"type": "array", "items": items});
    let xyz = || object(json!({"x": number(), "y": number(), "z": number()}));
    let turned = object(json!({"x": number(), "y": number(), "z": number(), "w": number()}));
    let pose = object(json!({"position": xyz(), "orientation": turned}));
    let color = object(json!({"r": number(), "g": number(), "b": number(), "a": number()}));
    let arrow = object(json!({
        "pose": pose, "shaft_length": number(), "shaft_diameter": number(),
        "head_length": number(), "head_diameter": number(), "color": color,
    }));
    let sphere = object(json!({"pose": pose, "size": xyz(), "color": color}));
    let text = || json!({"type": "string"});
    let mut duration = time_schema();
    duration["title"] = json!("duration");
    let empty = || list(object(json!({})));
    let entity = object(json!({
        "timestamp": time_schema(), "frame_id": text(), "id": text(), "lifetime": duration,
        "frame_locked": {"type": "boolean"},
        "metadata": list(object(json!({"key": text(), "value": text()}))),
        "arrows": list(arrow), "cubes": empty(), "spheres": list(sphere), "cylinders": empty(),
        "lines": empty(), "triangles": empty(), "texts": empty(), "models": empty(),
    }));
    let mut all = object(json!({"deletions": empty(), "entities": list(entity)}));
    all["title"] = json!("foxglove.SceneUpdate");
    all
}
