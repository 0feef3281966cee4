//! Notes on accepted effects for the user: what was found, and what follows from it or what to do about it.

use crate::diagnose::rows::Rows;
use crate::diagnose::search::Chosen;
use crate::effects::candidate::{Candidate, CandidateKind};
use crate::effects::quantity::Quantity;
use crate::effects::regressor::Product;

/// Notes on the chosen effects for the user.
pub(super) fn notes(rows: &Rows, chosen: &[Chosen]) -> Vec<String> {
    let mut notes: Vec<String> = chosen.iter().flat_map(of_effect).collect();
    let ids = |is: &dyn Fn(&Candidate) -> bool| {
        let ours = chosen.iter().map(|c| &c.candidate).filter(|c| is(c));
        ours.map(Candidate::id).collect::<Vec<_>>().join(", ")
    };
    // The horizontal part of Earth rate depends on the heading. On a table with one heading in each attitude it looks like products of the
    // force.
    let only_force = |p: &Product| p.parts().all(|(q, _)| matches!(q, Quantity::Force(_)));
    let level = ids(&|c| matches!(&c.kind, CandidateKind::Term(_, p) if only_force(p)));
    if !level.is_empty() && chosen.iter().any(|c| !c.candidate.is_error()) {
        notes.push(format!(
            "{level}: may be the horizontal part of Earth rate, which depends on the heading and the place: record each attitude at several headings"
        ));
    }
    let slow = ids(&Candidate::is_slow);
    if let Some(order) = rows.one_way().filter(|_| !slow.is_empty()) {
        notes.push(format!(
            "{slow}: the temperature only {} during the recording (rank correlation {order:.2}), so effects of temperature and of time look alike, and a lag of the die looks like a bias; let the temperature return within one recording",
            if order > 0.0 { "rises" } else { "falls" },
        ));
    }
    notes
}

/// Those on one effect.
fn of_effect(one: &Chosen) -> Vec<String> {
    let (candidate, id) = (&one.candidate, one.candidate.id());
    let mut notes = Vec::new();
    if !candidate.is_error() {
        notes.push(format!(
            "{id}: it is a true input of the gyro and no error of the unit: the calibration is corrected for it, and nothing is removed from readings"
        ));
    }
    if let Some(input) = one.or_true_input() {
        notes.push(format!(
            "{id}: {}, a true input of the gyro, explains the recording as well, so a calibration does not store {id}; at 1 g it is no larger than {}; a force of several g distinguishes them",
            input.id, input.size
        ));
    }
    if candidate.is_of_session() {
        notes.push(format!(
            "{id}: specific to this session, because it is unknown how long it lasts; it is not stored in a calibration, and the biases are those of the middle of the session"
        ));
    }
    if let CandidateKind::Effect(effect) = &candidate.kind
        && !candidate.inseparable.is_empty()
    {
        let open = candidate.inseparable.iter();
        let names: Vec<&str> = open.map(|k| effect.coefficients[*k].name).collect();
        notes.push(format!(
            "{id}: this recording does not distinguish {} from the bias and the other coefficients, so they are 0 in the file; it needs {}",
            names.join(", "),
            effect.needs
        ));
    }
    if candidate.without_self_heating {
        notes.push(format!(
            "{id}: the thermometer heats itself in the first minute, and the sensor is on another die; the device has no other thermometer, so it has this error for that time after power-on"
        ));
    }
    notes
}
