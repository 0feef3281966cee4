//! Joins the rows of several recordings.

use nalgebra::{DMatrix, DVector};

use super::build::Part;
use super::{Row, Rows};
use crate::diagnose::columns::unit_columns;
use crate::effects::quantity::Conditions;
use crate::effects::temperature::without_self_heating;
use crate::observation::from_centre;
use crate::quantity::Sensor;
use mimu_recording::Reference;

/// First of the derivatives by o.
const OF_BIAS: usize = 9;

/// For each part the places of its derivatives by the free elements of C, by o, and by what it has alone, among those of all; and how many there are.
/// Recordings with the same reference share those by C.
fn places(parts: &[(usize, Part)]) -> (Vec<Vec<usize>>, usize) {
    let mut shared: Vec<(Reference, usize)> = Vec::new();
    let (mut all, mut count) = (Vec::new(), 0);
    for (_, part) in parts {
        let (matrix, own) = (part.free.len(), 3 + part.lines[0].own.len());
        let known = shared.iter().find(|s| s.0 == part.reference());
        let first = known.map_or(count, |s| s.1);
        if first == count {
            shared.push((part.reference(), first));
            count += matrix;
        }
        all.push((first..first + matrix).chain(count..count + own).collect());
        count += own;
    }
    (all, count)
}

/// Part and stratum, in the order in which the strata are joined: those among the `judged` rows of their parts come first. A stratum is judged as a
/// whole or not at all.
fn order(parts: &[(usize, Part)], judged: &[usize]) -> Vec<(usize, usize)> {
    let mut order: Vec<(usize, usize)> = Vec::new();
    for first in [true, false] {
        for (p, (_, part)) in parts.iter().enumerate() {
            let ours = |s: &usize| (part.strata[*s].rows.end <= judged[p]) == first;
            order.extend((0..part.strata.len()).filter(ours).map(|s| (p, s)));
        }
    }
    order
}

/// What one unit of each column of the first recording, which come first and will have length 1, adds to its inverse model: C by rows, then o.
fn parameters(head: &Part, nuisance: &DMatrix<f64>) -> DMatrix<f64> {
    let change = from_centre(&head.centre);
    let mut all = DMatrix::zeros(12, head.free.len() + 3 + head.lines[0].own.len());
    for (k, of) in head.free.iter().copied().chain(OF_BIAS..12).enumerate() {
        let size = nuisance.column(k).norm();
        let size = if size > 0.0 { size } else { 1.0 };
        all.set_column(k, &(change.column(of) / size));
    }
    all
}

/// One problem of `parts`, each with the index of its recording, out of `sessions` recordings. `None` if the first recording
/// is missing.
pub(super) fn join(sensor: Sensor, parts: &[(usize, Part)], sessions: usize) -> Option<Rows> {
    let (0, head) = parts.first()? else {
        return None;
    };
    let observable = head.strata.first()?.name.0;
    let judged_rows = |(_, part): &(usize, Part)| match part.strata[0].name.0 == observable {
        true => part.judged(),
        false => 0,
    };
    let judged: Vec<usize> = parts.iter().map(judged_rows).collect();
    let (places, columns) = places(parts);
    let total: usize = parts.iter().map(|p| p.1.lines.len()).sum();
    let mut temperature = vec![Vec::new(); sessions];
    let (mut conditions, mut block, mut first_condition) = (Vec::new(), Vec::new(), Vec::new());
    let mut readings = Vec::new();
    let mut dwells = vec![0; sessions];
    for (session, part) in parts {
        let session = *session;
        first_condition.push(conditions.len());
        let own = part.conditions.iter();
        conditions.extend(own.map(|m| Conditions { session, ..*m }));
        readings.extend_from_slice(&part.readings);
        block.extend(part.block.iter().map(|b| (session, *b)));
        temperature[session].clone_from(&part.temperature_offset);
        let last = part.lines.iter().flat_map(|line| line.row.dwells).max();
        dwells[session] = 1 + last.unwrap_or(0);
    }
    let mut first = vec![0];
    first.extend(dwells.iter().scan(0, |end, count| {
        *end += count;
        Some(*end)
    }));
    let mut y = DVector::zeros(total);
    let mut nuisance = DMatrix::zeros(total, columns);
    let mut by_matrix = DMatrix::zeros(total, OF_BIAS);
    let mut strata = Vec::new();
    let mut rows = Vec::with_capacity(total);
    for (p, s) in order(parts, &judged) {
        let (session, part) = &parts[p];
        let from = rows.len();
        let mut stratum = part.strata[s].clone();
        for line in &part.lines[stratum.rows.clone()] {
            let (r, by) = (rows.len(), &line.by);
            y[r] = line.y;
            by_matrix.set_row(r, &by.fixed_rows::<OF_BIAS>(0).transpose());
            let of_triad = part.free.iter().copied().chain(OF_BIAS..12);
            let all = of_triad.map(|k| by[k]).chain(line.own.iter().copied());
            for (place, value) in places[p].iter().zip(all) {
                nuisance[(r, *place)] = value;
            }
            let (row, offset) = (&line.row, first_condition[p]);
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
    let is_unknown = |part: &Part| {
        part.session.prepared.manifest.latitude_deg.is_none()
            && part.reference() != Reference::Table
    };
    Some(Rows {
        sensor,
        parameters: parameters(head, &nuisance),
        nuisance: unit_columns(&nuisance),
        y,
        by_matrix,
        strata,
        earth_unknown: parts.iter().all(|p| is_unknown(&p.1)),
        observable,
        judged: (judged.iter().sum(), observable.components()),
        rows,
        conditions,
        readings,
        scales: parts.iter().map(|(s, part)| (*s, part.scale)).collect(),
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
