//! Joins the rows of several recordings.

use nalgebra::{DMatrix, DVector};

use super::build::Part;
use super::{Row, Rows};
use crate::diagnose::columns::unit_columns;
use crate::effects::quantity::Conditions;
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

/// Conditions, dwells and temperatures of all recordings, one after another, as in [`Rows`].
struct Joined {
    conditions: Vec<Conditions>,
    block: Vec<(usize, usize)>,
    temperature: Vec<Vec<(f64, f64)>>,
    first: Vec<usize>,
    /// Index of the first condition of each part.
    first_condition: Vec<usize>,
}

impl Joined {
    fn of(parts: &[(usize, Part)], sessions: usize) -> Self {
        let mut all = Self {
            conditions: Vec::new(),
            block: Vec::new(),
            temperature: vec![Vec::new(); sessions],
            first: vec![0],
            first_condition: Vec::new(),
        };
        for session in 0..sessions {
            let dwells = match parts.iter().find(|p| p.0 == session) {
                Some((_, part)) => {
                    all.add(session, part);
                    let last = part.rows.iter().flat_map(|r| r.dwells).max();
                    1 + last.unwrap_or(0)
                }
                None => 0,
            };
            all.first.push(all.first[session] + dwells);
        }
        all
    }

    fn add(&mut self, session: usize, part: &Part) {
        self.first_condition.push(self.conditions.len());
        let conditions = part.conditions.iter();
        self.conditions
            .extend(conditions.map(|m| Conditions { session, ..*m }));
        self.block.extend(part.block.iter().map(|b| (session, *b)));
        self.temperature[session].clone_from(&part.temperature_offset);
    }

    /// A row of part `p`, which is of recording `session`.
    fn row(&self, row: &Row, p: usize, session: usize) -> Row {
        let offset = self.first_condition[p];
        Row {
            conditions: row.conditions.start + offset..row.conditions.end + offset,
            weights: row.weights.clone(),
            dwells: row.dwells.map(|d| d + self.first[session]),
            moving: row.moving,
        }
    }
}

/// Residuals and derivatives of all rows.
struct Linear {
    y: DVector<f64>,
    nuisance: DMatrix<f64>,
    by_matrix: DMatrix<f64>,
}

impl Linear {
    fn zeros(rows: usize, columns: usize) -> Self {
        Self {
            y: DVector::zeros(rows),
            nuisance: DMatrix::zeros(rows, columns),
            by_matrix: DMatrix::zeros(rows, 9),
        }
    }

    /// Sets row `to` to row `from` of `part`, whose nuisance columns have these `places`.
    fn set(&mut self, to: usize, part: &Part, from: usize, places: &[usize]) {
        self.y[to] = part.y[from];
        for (k, place) in places.iter().enumerate() {
            self.nuisance[(to, *place)] = part.nuisance[(from, k)];
        }
        self.by_matrix.set_row(to, &part.by_matrix.row(from));
    }

    /// The parameters of the part whose nuisance columns have these `places`, for columns of length 1.
    fn parameters_of_unit_columns(&self, part: &Part, places: &[usize]) -> DMatrix<f64> {
        let mut parameters = part.parameters.clone();
        for (column, place) in part.parameters.column_iter().zip(places) {
            let size = self.nuisance.column(*place).norm();
            let size = if size > 0.0 { size } else { 1.0 };
            parameters.set_column(*place, &(column / size));
        }
        parameters
    }
}

/// One problem of `parts`, each with the index of its recording, out of `sessions` recordings. `None` if the first recording
/// is missing.
pub(super) fn join(sensor: Sensor, parts: Vec<(usize, Part)>, sessions: usize) -> Option<Rows> {
    let (0, head) = parts.first()? else {
        return None;
    };
    let (figure, together) = (head.figure, head.judged.1);
    let judged_rows = |(_, part): &(usize, Part)| match part.figure == figure {
        true => part.judged.0,
        false => 0,
    };
    let judged: Vec<usize> = parts.iter().map(judged_rows).collect();
    let joined = Joined::of(&parts, sessions);
    let (places, columns) = places(&parts);
    let total: usize = parts.iter().map(|p| p.1.y.len()).sum();
    let mut linear = Linear::zeros(total, columns);
    let mut strata = Vec::new();
    let mut rows = Vec::with_capacity(total);
    for (p, s) in order(&parts, &judged) {
        let (session, part) = &parts[p];
        let from = rows.len();
        let mut stratum = part.strata[s].clone();
        for r in stratum.rows.clone() {
            linear.set(rows.len(), part, r, &places[p]);
            rows.push(joined.row(&part.rows[r], p, *session));
        }
        stratum.rows = from..rows.len();
        stratum.session = *session;
        if sessions > 1 {
            stratum.name.1 = Some(*session);
        }
        strata.push(stratum);
    }
    let temperature = joined.temperature;
    Some(Rows {
        sensor,
        // The columns of the first recording come first.
        parameters: linear.parameters_of_unit_columns(head, &places[0]),
        nuisance: unit_columns(&linear.nuisance),
        y: linear.y,
        by_matrix: linear.by_matrix,
        strata,
        earth_unknown: parts.iter().all(|p| p.1.earth_unknown),
        figure,
        judged: (judged.iter().sum(), together),
        rows,
        conditions: joined.conditions,
        block: joined.block,
        without_self_heating: temperature
            .iter()
            .map(|w| without_self_heating(w))
            .collect(),
        temperature,
        first: joined.first,
        quantities: std::sync::OnceLock::new(),
    })
}
