//! Judgements of further triads.

use mimu::judgement::{Judgement, JudgementKind};
use mimu::quantity::{Sensor, significant};

use crate::field::Field;
use crate::same_body::Relation;

/// Held-out errors up to this many times those of white noise are those of noise: windows also hold what a bias wanders by.
const BY_NOISE: f64 = 1.5;
/// A share of the signal as an error with which a model does not describe the readings.
const MISFIT_SHARE: f64 = 0.1;
/// The same of a field's direction, rad: a compass that is off by 5 degrees is of no use beside a gyro.
const MISFIT_RAD: f64 = 0.087;
/// Share of the pieces of time that may be left out.
const MOST_LEFT_OUT: f64 = 0.25;
/// Standard deviation of the direction of the field beyond which a calibration is not determined, rad: 3 degrees.
const DETERMINED_RAD: f64 = 0.052;

/// The recording does not determine a triad.
pub(crate) fn undetermined(why: impl std::fmt::Display) -> Judgement {
    Judgement::new(JudgementKind::Untested, why)
}

/// Of a further gyro or accelerometer; `signal`: rms of an axis of the reference, SI.
pub(crate) fn same_body(relation: &Relation, signal: f64, sensor: Sensor) -> Judgement {
    let (held, floor) = (relation.held_out_rms, relation.noise_floor);
    let of = |x: f64| format!("{} {}", significant(x), sensor.unit().replace("^2", "²"));
    if held > MISFIT_SHARE * signal {
        let reason = format!(
            "it does not read the motion of the first {sensor}: it differs by {} of {}; check its columns and its unit, and that both are on one rigid body",
            of(held),
            of(signal)
        );
        return Judgement::new(JudgementKind::Misfit, reason);
    }
    if held > BY_NOISE * floor {
        let reason = format!(
            "it differs from the first {sensor} by {} in pieces of time that the fit has not used, and white noise explains {}",
            of(held),
            of(floor)
        );
        return Judgement::new(JudgementKind::Unexplained, reason);
    }
    let reason = format!(
        "it differs from the first {sensor} by {} in pieces of time that the fit has not used, as white noise explains ({})",
        of(held),
        of(floor)
    );
    Judgement::new(JudgementKind::Good, reason)
}

/// Whether a field is determined at all.
///
/// # Errors
/// The judgement, if it is not.
pub(crate) fn determines(field: &Field) -> Result<(), Judgement> {
    if field.worst_rad <= DETERMINED_RAD {
        return Ok(());
    }
    Err(undetermined(format!(
        "the direction of the field is uncertain by {} deg in some poses: bring each axis to point each way, and turn about all three",
        significant(field.worst_rad.to_degrees())
    )))
}

/// Of a magnetometer; `size`: that of the field in the unit of its readings.
pub(crate) fn field(field: &Field, size: f64) -> Judgement {
    let degrees = |x: f64| significant((x / size).to_degrees());
    let move_away = "move away from steel, motors and phones, and record again";
    let misfit = |reason: String| Judgement::new(JudgementKind::Misfit, reason);
    if field.left_out_share > MOST_LEFT_OUT {
        return misfit(format!(
            "the field differs from the rest in {:.0} % of the time: {move_away}",
            100.0 * field.left_out_share
        ));
    }
    if field.held_out_rms > MISFIT_RAD * size {
        return misfit(format!(
            "after a turn the field is off by {} deg (rms of an axis): {move_away}",
            degrees(field.held_out_rms)
        ));
    }
    if field.halves_rad > MISFIT_RAD {
        return misfit(format!(
            "the two halves of the recording give fields that differ by {} deg (rms): the field has changed, or each half turns too little; {move_away}",
            significant(field.halves_rad.to_degrees())
        ));
    }
    let [held, floor] = [field.held_out_rms, field.noise_floor].map(degrees);
    if field.held_out_rms > BY_NOISE * field.noise_floor {
        let reason = format!(
            "after a turn the field is off by {held} deg in pieces of time that the fit has not used, and white noise explains {floor} deg"
        );
        return Judgement::new(JudgementKind::Unexplained, reason);
    }
    let reason = format!(
        "after a turn the field is off by {held} deg in pieces of time that the fit has not used, as white noise explains ({floor} deg)"
    );
    Judgement::new(JudgementKind::Good, reason)
}
