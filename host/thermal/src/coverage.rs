//! How much of the recordings the curves use.
//!
//! Readings that are not at rest, clipped or too short are left out of a fit. If they are many, the curves represent less than a person
//! would think.

use std::collections::BTreeSet;

use mimu::quantity::Sensor;
use mimu::signal::blocks::extent;
use mimu_recording::{Argument, Error, Reference, Result};

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
    let (mut used, mut taken, mut all) = (Vec::new(), 0.0, 0.0);
    for session in sessions {
        let rows = &session.rows[sensor];
        used.extend(rows.iter().map(|r| session.thermometer.at(r.middle_s).0));
        taken += rows.iter().map(|r| r.samples).sum::<f64>();
        all += session.samples;
    }
    let recorded = || sessions.iter().flat_map(|s| s.thermometer.values());
    let bin = |t: &f64| (t / BIN_K).floor() as i64;
    let bins = |all: BTreeSet<i64>| all.len() as f64;
    (!used.is_empty()).then(|| Used {
        samples: taken / all,
        temperatures: bins(used.iter().map(bin).collect()) / bins(recorded().map(bin).collect()),
        used_c: extent(used.iter().copied()),
        recorded_c: extent(recorded().copied()),
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
