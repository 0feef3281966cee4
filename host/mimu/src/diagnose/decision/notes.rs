//! Notes on accepted effects for the user.

use crate::diagnose::note::Note;
use crate::diagnose::rows::Rows;
use crate::diagnose::search::Chosen;
use crate::effects::candidate::CandidateKind;
use crate::effects::quantity::Quantity;
use crate::effects::regressor::Product;

/// Notes on the chosen effects for the user.
pub(super) fn notes(rows: &Rows, chosen: &[Chosen]) -> Vec<Note> {
    let mut notes = Vec::new();
    let inputs = chosen.iter().filter(|c| !c.candidate.is_error());
    notes.extend(inputs.map(|c| {
        let found = format!("{}: it is a true input of the gyro", c.candidate.id());
        Note::new(
            found,
            "it is no error of the unit: the calibration is corrected for it, and nothing is removed from readings",
        )
    }));
    notes.extend(chosen.iter().filter_map(|c| {
        let input = c.or_true_input()?;
        let id = c.candidate.id();
        let found = format!(
            "{id}: {}, a true input of the gyro, explains the recording as well, so a calibration does not store {id}",
            input.id
        );
        Some(Note::new(
            found,
            format!("at 1 g it is no larger than {}; a force of several g distinguishes them", input.size),
        ))
    }));
    let sessions = chosen.iter().filter(|c| c.candidate.is_of_session());
    notes.extend(sessions.map(|c| {
        let found = format!(
            "{}: specific to this session, because it is unknown how long it lasts; it is not stored in a calibration, and the biases are those of the middle of the session",
            c.candidate.id()
        );
        Note::new(found, "")
    }));
    for candidate in chosen.iter().map(|c| &c.candidate) {
        if let CandidateKind::Effect(effect) = &candidate.kind
            && !candidate.inseparable.is_empty()
        {
            let names = candidate
                .inseparable
                .iter()
                .map(|k| effect.coefficients[*k].name);
            let found = format!(
                "{}: this recording does not distinguish {} from the bias and the other coefficients, so they are 0 in the file",
                effect.id,
                names.collect::<Vec<_>>().join(", ")
            );
            notes.push(Note::new(found, format!("it needs {}", effect.needs)));
        }
    }
    // The horizontal part of Earth rate depends on the heading. On a table with one heading in each attitude it looks like products of the
    // force.
    let only_force = |p: &Product| p.parts().all(|(q, _)| matches!(q, Quantity::Force(_)));
    let level = chosen
        .iter()
        .filter(|c| matches!(&c.candidate.kind, CandidateKind::Term(_, m) if only_force(m)));
    let level: Vec<String> = level.map(|c| c.candidate.id()).collect();
    if !level.is_empty() && chosen.iter().any(|c| !c.candidate.is_error()) {
        let found = format!(
            "{}: may be the horizontal part of Earth rate, which depends on the heading and the place: record each attitude at several headings",
            level.join(", ")
        );
        notes.push(Note::new(found, ""));
    }
    let heated = chosen.iter().filter(|c| c.candidate.without_self_heating);
    notes.extend(heated.map(|c| {
        let found = format!(
            "{}: the thermometer heats itself in the first minute, and the sensor is on another die",
            c.candidate.id()
        );
        let advice = "the device has no other thermometer, so it has this error for that time after power-on";
        Note::new(found, advice)
    }));
    let slow = chosen.iter().filter(|c| c.candidate.is_slow());
    let ids: Vec<String> = slow.map(|c| c.candidate.id()).collect();
    let Some(order) = rows.one_way().filter(|_| !ids.is_empty()) else {
        return notes;
    };
    let found = format!(
        "{}: the temperature only {} during the recording (rank correlation {order:.2}), so effects of temperature and of time look alike, and a lag of the die looks like a bias",
        ids.join(", "),
        if order > 0.0 { "rises" } else { "falls" },
    );
    notes.push(Note::new(
        found,
        "let the temperature return within one recording",
    ));
    notes
}
