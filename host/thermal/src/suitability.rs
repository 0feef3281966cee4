//! Recordings that no curves can be estimated from: what is wrong with them, and what to do.

use mimu::quantity::{duration, significant};
use mimu_recording::error::{Error, Result};

use crate::basis::SLOPE_SPAN;
use crate::path::fastest;
use crate::profile::Lag;
use crate::session::Session;

/// The die may lag behind by this share of the range at most; beyond, a first-order lag that is a tenth off shifts curves by kelvins.
const BEHIND_SHARE: f64 = 0.25;

/// Refuses recordings of two units, or of different readings.
pub fn check_alike(sessions: &[Session]) -> Result<()> {
    let Some(first) = sessions.first() else {
        return Err(Error::new(
            "recordings",
            "there is none",
            "give at least one",
        ));
    };
    for other in &sessions[1..] {
        let alike = match (&first.unit_id, &other.unit_id) {
            (Some(a), Some(b)) => a.eq_ignore_ascii_case(b),
            _ => first.device == other.device,
        };
        if !alike {
            let problem = format!(
                "this is a recording of {:?}, and {} is one of {:?}: two units have two sets of curves",
                other.device, first.place, first.device
            );
            let remedy = "fit the recordings of each unit by themselves";
            return Err(Error::new(&other.place, problem, remedy));
        }
        if first.raw_unit != other.raw_unit || first.reference != other.reference {
            let problem = format!(
                "its readings are in {} with reference {:?}, those of {} in {} with reference {:?}",
                other.raw_unit, other.reference, first.place, first.raw_unit, first.reference
            );
            let remedy = "fit recordings of one kind together";
            return Err(Error::new(&other.place, problem, remedy));
        }
    }
    Ok(())
}

/// Refuses a span that shows no slope.
pub fn check_span(sessions: &[Session], span: f64) -> Result<()> {
    if span >= SLOPE_SPAN {
        return Ok(());
    }
    let problem = format!(
        "the temperature spans {} K only: a slope needs {SLOPE_SPAN} K, curvature 20 K",
        significant(span.max(0.0))
    );
    let remedy = "heat or cool the unit further, or use `mimu fit`, which is for one temperature";
    Err(Error::undetermined(
        format!("{}, temp_c", sessions[0].place),
        problem,
        remedy,
    ))
}

/// Refuses a ramp in which the die is so far behind that a first-order lag decides everything.
pub fn check_speed(sessions: &[Session], lag: &Lag, span: f64) -> Result<()> {
    if !lag.is_determined() {
        return Ok(());
    }
    for session in sessions {
        let fastest = fastest(session);
        let behind = fastest * lag.value.abs();
        if behind > BEHIND_SHARE * span {
            let problem = format!(
                "the ramp of {} K/min is too fast: the dies are {} K off the thermometer by their lag of {}",
                significant(fastest * 60.0),
                significant(behind),
                duration(lag.value.abs())
            );
            let slow = 0.4 * BEHIND_SHARE * span / lag.value.abs() * 60.0;
            let remedy = format!("heat and cool by at most {} K/min", significant(slow));
            return Err(Error::undetermined(&session.place, problem, remedy));
        }
    }
    Ok(())
}
