//! The poses of a recording, and how much each further pose would improve the accelerometer's parameters.

use mimu::calibration::Calibration;
use mimu::plan::design::model::{Model, Setting};
use mimu::plan::design::next_pose::Had;
use mimu::plan::design::reach::{Fixture, Rates, Reach};
use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use nalgebra::Vector3;
use serde::Serialize;

/// The poses, and the map of the gain of another one.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Poses {
    /// Directions that were up in the dwells at rest, in the body frame.
    poses: Vec<[f64; 3]>,
    /// Directions on a grid over both hemispheres, each with its gain: the share by which one more dwell with it up would lower the geometric mean of
    /// the parameters' sigmas.
    map: Vec<[f64; 4]>,
    /// Size of a cell of the grid over the radius of a hemisphere.
    cell: f64,
    /// The face, edge or corner that would add most.
    next: Option<Next>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct Next {
    up: [f64; 3],
    words: String,
    gain: f64,
}

/// Cells of the map across a hemisphere.
const CELLS: i32 = 36;

/// Uses the dwells that the accelerometer's fit may use. Without a calibration the directions are unknown.
pub fn of(prepared: &Prepared, calibration: Option<&Calibration>) -> Poses {
    let Some(model) = calibration.and_then(|c| c.inverse(Sensor::Accel)) else {
        return Poses::default();
    };
    let used = prepared
        .dwells
        .list
        .iter()
        .filter(|d| d.faults.accel.is_none());
    let ups: Vec<Vector3<f64>> = used
        .map(|dwell| model.apply(&dwell.raw_mean(Sensor::Accel)))
        .filter(|force| force.norm().is_finite() && force.norm() > 0.0)
        .map(|force| force.normalize())
        .collect();
    let reach = Reach {
        model: Model::accel(prepared.manifest.reference),
        fixture: Fixture::Hand,
        rates: Rates::Any,
    };
    let dwells: Vec<Setting> = ups.iter().copied().map(Setting::at_rest).collect();
    let had = Had::new(&reach, &dwells);
    let plain = reach.plain();
    let gain = |up: Vector3<f64>| had.gain(&Setting::at_rest(up)).unwrap_or(0.0);
    let best = plain.iter().map(|s| (s.up, gain(s.up)));
    // Of equal ones the first is used: faces come before edges and corners.
    let best = best.reduce(|a, b| if b.1 > a.1 * 1.001 { b } else { a });
    Poses {
        poses: ups.iter().map(|up| (*up).into()).collect(),
        cell: 2.0 / f64::from(CELLS),
        map: cells().map(|up| [up.x, up.y, up.z, gain(up)]).collect(),
        next: best.filter(|(_, gain)| *gain > 0.0).map(|(up, gain)| Next {
            up: up.into(),
            words: mimu_equipment::step::words(&up),
            gain,
        }),
    }
}

/// Middles of the cells of both hemispheres, in an equal-area projection.
fn cells() -> impl Iterator<Item = Vector3<f64>> {
    let middles = || (0..CELLS).map(|k| f64::from(2 * k + 1 - CELLS) / f64::from(CELLS));
    let flat = middles().flat_map(move |x| middles().map(move |y| (x, y, x * x + y * y)));
    let inside = flat.filter(|(.., square)| *square < 1.0);
    inside.flat_map(|(x, y, square)| {
        let z = 1.0 - square;
        let across = (1.0 - z * z).sqrt() / square.sqrt();
        [z, -z].map(|z| Vector3::new(x * across, y * across, z))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_directions_and_cover_both_hemispheres() {
        assert!(cells().all(|up| (up.norm() - 1.0).abs() < 1e-12));
        let count = |below: bool| cells().filter(|up| (up.z < 0.0) == below).count() as f64;
        let expected = std::f64::consts::FRAC_PI_4 * f64::from(CELLS * CELLS);
        assert!((count(true) / expected - 1.0).abs() < 0.05);
        assert_eq!(count(true), count(false));
    }
}
