//! Judgements of further triads.

use mimu::judgement::{Judgement, JudgementKind};
use mimu::quantity::significant;
use mimu::triad::Estimate;

use crate::errors::Errors;
use crate::field::{Field, LeftOut};

/// Held-out errors up to this many times those of white noise are those of noise: windows also hold what a bias wanders by.
const BY_NOISE: f64 = 1.5;
/// A share of the signal as an error with which a model does not describe the readings.
const MISFIT_SHARE: f64 = 0.1;
/// The same of a field's direction, rad: a compass that is off by 5 degrees does not help a gyro.
const MISFIT_RAD: f64 = 0.087;
/// Share of the time that may be left out.
const MOST_LEFT_OUT: f64 = 0.25;
/// Share of the time from which on a disturbance makes the rest suspect.
const SUSPECT_LEFT_OUT: f64 = 0.1;
/// Standard deviation of the direction of the field beyond which a calibration is not determined, rad: 3 degrees.
const DETERMINED_RAD: f64 = 0.052;

/// Latitude beyond which the field points down in the north and up in the south, degrees: the magnetic equator is within 15 degrees of the other.
const MAGNETIC_EQUATOR_DEG: f64 = 20.0;

/// The recording does not determine a triad.
pub(crate) fn undetermined(why: impl std::fmt::Display) -> Judgement {
    Judgement::new(JudgementKind::Untested, why)
}

/// Of a gyro or accelerometer against `reference`; `signal`: rms of an axis of the reference, in `unit`.
pub(crate) fn same_body(errors: &Errors, signal: f64, reference: &str, unit: &str) -> Judgement {
    let errors = [errors.held_out_rms, errors.noise_floor];
    unseen(errors, signal, (reference, "pieces of time"), unit)
}

/// A judgement by the pieces of one recording, as far as these can show an error.
pub(crate) fn of_one_recording(judgement: Judgement) -> Judgement {
    match judgement.kind {
        JudgementKind::Good => Judgement::new(
            JudgementKind::Good,
            format!(
                "{}; judged on one recording only, which does not show what the instrument errs by in all of it",
                judgement.reason
            ),
        ),
        _ => judgement,
    }
}

/// The same by recordings with their trajectories, each by the calibration of the others. `without`: the error without a calibration, and whether that is of readings in SI as they are.
pub(crate) fn across(
    errors: [f64; 2],
    signal: f64,
    (without, in_si): (f64, bool),
    unit: &str,
) -> Judgement {
    let by_noise = unseen(errors, signal, ("the trajectory", "recordings"), unit);
    if by_noise.kind != JudgementKind::Unexplained || errors[0] < without {
        return by_noise;
    }
    let readings = match in_si {
        true => "the readings as they are",
        false => "one scale factor without angles",
    };
    misfit(format!(
        "it errs by {} in recordings that the fit has not used, and {readings} by {}",
        of_unit(errors[0], unit),
        of_unit(without, unit)
    ))
}

fn of_unit(x: f64, unit: &str) -> String {
    format!("{} {}", significant(x), unit.replace("^2", "²"))
}

/// By the errors in `parts` that the fit has not used, and those by white noise.
fn unseen(
    [held, floor]: [f64; 2],
    signal: f64,
    (reference, parts): (&str, &str),
    unit: &str,
) -> Judgement {
    let of = |x: f64| of_unit(x, unit);
    if held > MISFIT_SHARE * signal {
        return misfit(format!(
            "it does not read the motion of {reference}: it differs by {} of {}; check its columns and its unit, and that both are on one rigid body",
            of(held),
            of(signal)
        ));
    }
    if held > BY_NOISE * floor {
        let reason = format!(
            "it differs from {reference} by {} in {parts} that the fit has not used, and white noise explains {}",
            of(held),
            of(floor)
        );
        return Judgement::new(JudgementKind::Unexplained, reason);
    }
    let reason = format!(
        "it differs from {reference} by {} in {parts} that the fit has not used, as white noise explains ({})",
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
    let by = match field.worst_rad.to_degrees() {
        degrees if degrees < 60.0 => format!("uncertain by {} deg", significant(degrees)),
        _ => "not determined".to_string(),
    };
    Err(undetermined(format!(
        "the direction of the field is {by} in some poses: bring each axis to point each way, and turn about all three"
    )))
}

/// The judgement if the field points up in the north, or down in the south: a magnetometer whose axes are mirrored reads it reversed, and fits as well. Near the equator
/// both occur.
pub(crate) fn mirrored(dip_deg: &Estimate, latitude_deg: Option<f64>) -> Option<Judgement> {
    let latitude = latitude_deg.filter(|latitude| latitude.abs() > MAGNETIC_EQUATOR_DEG)?;
    let dip = dip_deg.value;
    if dip * latitude >= 0.0 || dip.abs() < dip_deg.interval {
        return None;
    }
    let [points, there] = if dip < 0.0 {
        ["up", "south"]
    } else {
        ["down", "north"]
    };
    Some(Judgement::new(
        JudgementKind::Suspect,
        format!(
            "the field points {points} by {} deg, as it does in the {there}: an axis of the magnetometer has the wrong sign, or two are exchanged",
            significant(dip.abs())
        ),
    ))
}

const MOVE_AWAY: &str = "move away from steel, motors and phones, and record again";

fn misfit(reason: String) -> Judgement {
    Judgement::new(JudgementKind::Misfit, reason)
}

/// Of a magnetometer; `size`: that of the field in the unit of its readings.
pub(crate) fn field(field: &Field, size: f64) -> Judgement {
    let left_out = &field.left_out;
    if left_out.share > MOST_LEFT_OUT {
        return misfit(format!(
            "the field differs from the rest in {:.0} % of the time: {MOVE_AWAY}",
            100.0 * left_out.share
        ));
    }
    let again = field_again(&field.relation.errors, field.size_rms, size);
    if field.halves_rad > MISFIT_RAD && again.needs_consent().is_none() {
        return misfit(format!(
            "the two halves of the recording give fields that differ by {} deg (rms): the field has changed, or each half turns too little; {MOVE_AWAY}",
            significant(field.halves_rad.to_degrees())
        ));
    }
    if left_out.spans.is_empty() {
        return again;
    }
    let disturbed = disturbed(left_out);
    match again.kind {
        JudgementKind::Good if left_out.share > SUSPECT_LEFT_OUT => Judgement::new(
            JudgementKind::Suspect,
            format!("{disturbed}, and less so in the rest: {MOVE_AWAY}"),
        ),
        kind => Judgement::new(
            kind,
            format!("{}; {disturbed}, which is left out", again.reason),
        ),
    }
}

/// What was left out, in words.
fn disturbed(left_out: &LeftOut) -> String {
    let by = [
        (100.0 * left_out.size, "%"),
        (left_out.angle_rad.to_degrees(), "deg"),
    ];
    let by = by.iter().filter(|(x, _)| x.is_finite());
    let by: Vec<String> = by
        .map(|(x, unit)| format!("{} {unit}", significant(*x)))
        .collect();
    format!(
        "the field is disturbed by {} in {:.1} % of the time",
        by.join(" and "),
        100.0 * left_out.share
    )
}

/// Of a magnetometer by its errors after turns, and by the rms error of the size of the field.
pub(crate) fn field_again(errors: &Errors, size_rms: f64, size: f64) -> Judgement {
    let [held, floor] = [errors.held_out_rms, errors.noise_floor].map(|x| x / size);
    let degrees = |x: f64| significant(x.to_degrees());
    if held > MISFIT_RAD {
        return misfit(format!(
            "after a turn the field is off by {} deg (rms of an axis): {MOVE_AWAY}",
            degrees(held)
        ));
    }
    // After a turn two readings err.
    let [varies, noise] = [size_rms / size, floor / 2f64.sqrt()];
    if varies > MISFIT_RAD {
        return misfit(format!(
            "the size of the field varies by {:.1} %: {MOVE_AWAY}",
            100.0 * varies
        ));
    }
    if varies > BY_NOISE * noise {
        let reason = format!(
            "the size of the field varies by {:.1} %, and noise explains {:.1} %: it differs by place",
            100.0 * varies,
            100.0 * noise
        );
        return Judgement::new(JudgementKind::Unexplained, reason);
    }
    if held > BY_NOISE * floor {
        let reason = format!(
            "after a turn the field is off by {} deg in pieces of time that the fit has not used, and white noise explains {} deg",
            degrees(held),
            degrees(floor)
        );
        return Judgement::new(JudgementKind::Unexplained, reason);
    }
    let reason = format!(
        "after a turn the field is off by {} deg in pieces of time that the fit has not used, as white noise explains ({} deg)",
        degrees(held),
        degrees(floor)
    );
    Judgement::new(JudgementKind::Good, reason)
}
