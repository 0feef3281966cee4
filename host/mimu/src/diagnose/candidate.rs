//! Candidates for the rows of a sensor, and their columns.

use nalgebra::{DMatrix, DVector};

use super::rows::Rows;
use crate::effects::candidate::{Candidate, CandidateKind};
use crate::effects::quantity::Conditions;

/// Step of a central difference in the logarithm of a parameter. The error is a millionth of the derivative, far above rounding.
const STEP: f64 = 1e-3;

impl Candidate {
    /// The candidates that it is tried as. The search starts from the best of these, and adds or drops [offered](Self::offered) coefficients.
    ///
    /// An effect is tried with the coefficients that are
    /// [excited](Self::excited), with all that the rows determine, and with each alone; each time with and without the coefficients that are
    /// specific to the recording. A thermal effect is tried with and without the thermometer's self-heating.
    pub fn variants(mut self, rows: &Rows) -> Vec<Self> {
        self.offered.clone_from(&self.active);
        let with = |one: &Self, active: Vec<usize>| Self {
            active,
            ..one.clone()
        };
        self.offered.extend(self.of_recording());
        let mut all = vec![self.clone()];
        if !self.excited.is_empty() && self.excited.len() < self.active.len() {
            all.push(with(&self, self.excited.clone()));
        }
        // Each alone, as a product found from the data would be.
        if self.active.len() > 1 {
            let alone = self.active.iter().filter(|k| self.rests_on(**k).is_none());
            let alone: Vec<Self> = alone.map(|k| with(&self, vec![*k])).collect();
            all.extend(alone);
        }
        for k in 0..all.len() {
            let mut whole = all[k].clone();
            whole.active.extend(whole.of_recording());
            if whole.active.len() > all[k].active.len() {
                all.push(whole);
            }
        }
        if rows.thermometer_heats_itself() && self.is_thermal() {
            let without = all.clone().into_iter().map(|c| Self {
                without_self_heating: true,
                ..c
            });
            all.extend(without.collect::<Vec<_>>());
        }
        let choices = all.len() as f64;
        all.iter_mut().for_each(|c| c.choices = choices);
        all
    }

    /// The candidate with one of its offered coefficients added, or dropped with those that depend on it. `None` if none would be left, or if the
    /// added one depends on one that is not active.
    pub fn toggled(&self, coefficient: usize) -> Option<Self> {
        let mut active = self.active.clone();
        match active.binary_search(&coefficient) {
            Ok(at) => {
                active.remove(at);
                active.retain(|k| self.rests_on(*k) != Some(coefficient));
            }
            Err(at) => {
                // Only `variants` adds the coefficients that are specific to the recording, all of them together.
                if self.of_recording().contains(&coefficient) {
                    return None;
                }
                let base = self.rests_on(coefficient);
                if base.is_some_and(|base| active.binary_search(&base).is_err()) {
                    return None;
                }
                active.insert(at, coefficient);
            }
        }
        (!active.is_empty()).then(|| Self {
            active,
            ..self.clone()
        })
    }

    /// Number of choices of coefficients that this one is the best of. All numbers of coefficients are equally likely, and all choices of the
    /// same number.
    pub fn choices_of_coefficients(&self) -> f64 {
        let (n, k) = (self.offered.len(), self.active.len());
        if n < 2 {
            return 1.0;
        }
        let ratios = (0..k.min(n - k)).map(|i| (n - i) as f64 / (i + 1) as f64);
        n as f64 * ratios.product::<f64>()
    }

    /// Its columns in `rows`.
    pub fn columns(&self, rows: &Rows, parameter: f64) -> DMatrix<f64> {
        match &self.kind {
            CandidateKind::Term(axis, product) => rows.term(product, &[*axis]),
            CandidateKind::Jump { axis, session, t_s } => rows.jump(*session, *t_s, *axis),
            CandidateKind::Effect(_) => {
                self.columns_at(rows, &rows.conditions(self.followed(parameter)), parameter)
            }
        }
    }

    /// Derivative of its contribution to `rows`, with the coefficients `values`, by the natural logarithm of its nonlinear parameter; unit of the
    /// rows.
    pub fn slope(&self, rows: &Rows, parameter: f64, values: &DVector<f64>) -> DVector<f64> {
        let step = STEP.exp();
        let [up, down] = [parameter * step, parameter / step].map(|p| self.columns(rows, p));
        (up - down) * values / (2.0 * STEP)
    }

    /// The candidate with all of the coefficients that the search chooses from.
    pub fn with_all_offered(&self) -> Self {
        Self {
            active: self.offered.clone(),
            ..self.clone()
        }
    }

    /// Its columns out of those [with all that are offered](Self::with_all_offered): a search over choices needs the same columns again and
    /// again.
    pub fn columns_of(&self, all_offered: &DMatrix<f64>) -> DMatrix<f64> {
        let places = self.active.iter();
        let places: Vec<usize> = places
            .filter_map(|k| self.offered.binary_search(k).ok())
            .collect();
        all_offered.select_columns(&places)
    }

    /// Its columns in `rows` at other conditions.
    pub fn columns_at(
        &self,
        rows: &Rows,
        conditions: &[Conditions],
        parameter: f64,
    ) -> DMatrix<f64> {
        let all = rows.columns(conditions, &self.axes(), |at, out| {
            self.regressors(at, parameter, out)
        });
        self.by_coefficient(all)
    }

    /// Columns of its active coefficients out of those of its slots.
    fn by_coefficient(&self, slots: DMatrix<f64>) -> DMatrix<f64> {
        let of = self.slots();
        if of.len() == self.active.len() {
            return slots;
        }
        let mut columns = DMatrix::zeros(slots.nrows(), self.active.len());
        for (slot, (coefficient, _)) in of.iter().enumerate() {
            let mut sum = columns.column_mut(*coefficient);
            sum += slots.column(slot);
        }
        columns
    }
}
