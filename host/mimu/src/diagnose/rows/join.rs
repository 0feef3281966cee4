//! Joins the rows of several recordings.

use nalgebra::{DMatrix, DVector};

use super::build::{Part, common_step};
use super::{Row, Rows};
use crate::diagnose::columns::unit_columns;
use crate::effects::temperature::without_self_heating;
use crate::quantity::Sensor;
use mimu_recording::Reference;

/// For each part the places of its nuisance columns among those of all, and how many there are. Recordings with the same
/// reference share the columns of the matrix; each has separate columns for its biases.
fn places(parts: &[(usize, Part)]) -> (Vec<Vec<usize>>, usize) {
    let mut shared: Vec<(Reference, Vec<usize>)> = Vec::new();
    let mut count = 0;
    let mut new = |many: usize| {
        count += many;
        (count - many..count).collect::<Vec<usize>>()
    };
    let mut all = Vec::new();
    for (_, part) in parts {
        let matrix = part.nuisance.ncols() - part.biases.len();
        let known = shared.iter().find(|s| s.0 == part.reference);
        let of_matrix = match known {
            Some((_, places)) => places.clone(),
            None => {
                let places = new(matrix);
                shared.push((part.reference, places.clone()));
                places
            }
        };
        let of_biases = new(part.biases.len());
        let (mut matrix, mut biases) = (of_matrix.into_iter(), of_biases.into_iter());
        let place = |k: usize| match part.biases.contains(&k) {
            true => biases.next(),
            false => matrix.next(),
        };
        all.push((0..part.nuisance.ncols()).filter_map(place).collect());
    }
    (all, count)
}

/// One problem of `parts`, each with the index of its recording, out of `sessions` recordings. `None` if the first recording
/// is missing.
pub(super) fn join(sensor: Sensor, parts: Vec<(usize, Part)>, sessions: usize) -> Option<Rows> {
    let (0, head) = parts.first()? else {
        return None;
    };
    let (figure, together) = (head.figure, head.judged.1);
    let (places, columns) = places(&parts);
    // The judged rows come first. A stratum is judged as a whole or not at all.
    let judged_rows = |part: &Part| match part.figure == figure {
        true => part.judged.0,
        false => 0,
    };
    let mut order: Vec<(usize, usize)> = Vec::new();
    for judged in [true, false] {
        for (p, (_, part)) in parts.iter().enumerate() {
            let ours = |s: &usize| (part.strata[*s].rows.end <= judged_rows(part)) == judged;
            order.extend((0..part.strata.len()).filter(ours).map(|s| (p, s)));
        }
    }
    let total: usize = parts.iter().map(|p| p.1.y.len()).sum();
    let judged = parts.iter().map(|p| judged_rows(&p.1)).sum();

    let steps: Vec<Option<f64>> = parts.iter().map(|p| p.1.step).collect();
    let step = common_step(&steps);
    let mut first = vec![0];
    let mut conditions = Vec::new();
    let mut block = Vec::new();
    let mut temperature = vec![Vec::new(); sessions];
    let mut first_condition = Vec::new();
    for session in 0..sessions {
        let dwells = match parts.iter().find(|p| p.0 == session) {
            Some((_, part)) => {
                first_condition.push(conditions.len());
                conditions.extend(part.conditions.iter().map(|m| {
                    let mut conditions = *m;
                    conditions.session = session;
                    conditions
                }));
                block.extend(part.block.iter().map(|b| (session, *b)));
                temperature[session].clone_from(&part.temperature_offset);
                let last = part.rows.iter().flat_map(|r| r.dwells).max();
                1 + last.unwrap_or(0)
            }
            None => 0,
        };
        first.push(first[session] + dwells);
    }

    let mut y = DVector::zeros(total);
    let mut nuisance = DMatrix::zeros(total, columns);
    let mut by_matrix = DMatrix::zeros(total, 9);
    let mut strata = Vec::new();
    let mut rows = Vec::with_capacity(total);
    for (p, s) in order {
        let (session, part) = &parts[p];
        let from = rows.len();
        let mut stratum = part.strata[s].clone();
        for r in stratum.rows.clone() {
            y[rows.len()] = part.y[r];
            for (k, place) in places[p].iter().enumerate() {
                nuisance[(rows.len(), *place)] = part.nuisance[(r, k)];
            }
            by_matrix.set_row(rows.len(), &part.by_matrix.row(r));
            let row = &part.rows[r];
            let offset = first_condition[p];
            rows.push(Row {
                conditions: row.conditions.start + offset..row.conditions.end + offset,
                weights: row.weights.clone(),
                dwells: row.dwells.map(|d| d + first[*session]),
                moving: row.moving,
            });
        }
        stratum.rows = from..rows.len();
        stratum.session = *session;
        if sessions > 1 {
            stratum.name.1 = Some(*session);
        }
        strata.push(stratum);
    }
    // The columns of the first recording come first.
    let mut parameters = head.parameters.clone();
    for (column, place) in head.parameters.column_iter().zip(&places[0]) {
        let size = nuisance.column(*place).norm();
        let size = if size > 0.0 { size } else { 1.0 };
        parameters.set_column(*place, &(column / size));
    }
    Some(Rows {
        sensor,
        y,
        parameters,
        by_matrix,
        nuisance: unit_columns(&nuisance),
        strata,
        earth_unknown: parts.iter().all(|p| p.1.earth_unknown),
        figure,
        judged: (judged, together),
        step,
        rows,
        conditions,
        block,
        without_self_heating: temperature
            .iter()
            .map(|w| without_self_heating(w))
            .collect(),
        temperature,
        first,
        quantities: std::sync::OnceLock::new(),
    })
}
