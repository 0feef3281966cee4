//! How much of the recordings the curves use.
//!
//! Readings that are not at rest, clipped or too short are left out of a fit. If they are many, the curves represent less than a person
//! would think.

use mimu::quantity::Sensor;
use mimu_recording::Reference;
use mimu_recording::error::{Argument, Error, Result};

use crate::session::Session;
use crate::used::Used;
use crate::warning::Warning;

/// Width of the temperatures that count as one, K.
const BIN_K: f64 = 1.0;
/// Shares of the samples and of the temperatures of a recording at rest that a fit needs.
const FEWEST_SAMPLES: f64 = 0.5;
const FEWEST_TEMPERATURES: f64 = 0.7;
/// Below this share there is a warning.
const MOST: f64 = 0.9;

/// The part of `sessions` that the curves of `sensor` use; `None` if they have no rows of it.
pub fn of(sessions: &[Session], sensor: Sensor) -> Option<Used> {
    let bin = |t: f64| (t / BIN_K).floor() as i64;
    let (mut recorded, mut used) = (Vec::new(), Vec::new());
    let (mut all, mut taken) = (0.0, 0.0);
    let none = [f64::INFINITY, f64::NEG_INFINITY];
    let (mut recorded_c, mut used_c) = (none, none);
    let widen = |range: &mut [f64; 2], t: f64| *range = [range[0].min(t), range[1].max(t)];
    for session in sessions {
        let rows = &session.rows[sensor];
        let thermometer = &session.thermometer;
        all += session.samples;
        taken += rows.iter().map(|r| r.samples).sum::<f64>();
        for row in rows {
            let (t, _) = thermometer.at(row.middle_s);
            used.push(bin(t));
            widen(&mut used_c, t);
        }
        for second in 0..=thermometer.duration_s() as u64 {
            let (t, _) = thermometer.at(thermometer.start_s() + second as f64);
            recorded.push(bin(t));
            widen(&mut recorded_c, t);
        }
    }
    for bins in [&mut recorded, &mut used] {
        bins.sort_unstable();
        bins.dedup();
    }
    (!used.is_empty()).then(|| Used {
        samples: taken / all,
        temperatures: used.len() as f64 / recorded.len() as f64,
        used_c,
        recorded_c,
    })
}

/// Refuses recordings at rest of which too little is used; warns for each sensor of which much is left out. With a table, readings between
/// its poses are left out by design.
pub fn check(sessions: &[Session], warnings: &mut Vec<Warning>) -> Result<()> {
    if sessions.iter().all(|s| s.reference == Reference::Table) {
        return Ok(());
    }
    for sensor in Sensor::BOTH {
        let Some(used) = of(sessions, sensor) else {
            continue;
        };
        let Used {
            samples,
            temperatures,
            ..
        } = used;
        if samples < FEWEST_SAMPLES || temperatures < FEWEST_TEMPERATURES {
            let problem = format!(
                "of the {sensor}'s samples only {} are found to be at rest",
                used.words()
            );
            let remedy = "record the unit at rest, or declare that it was at rest";
            return Err(
                Error::undetermined(&sessions[0].place, problem, remedy).about(Argument::AtRest)
            );
        }
        if samples.min(temperatures) < MOST {
            warnings.push(Warning::Coverage { sensor, used });
        }
    }
    Ok(())
}
