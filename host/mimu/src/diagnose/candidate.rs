//! What is tried in the rows of a sensor, and its columns there.

use nalgebra::{DMatrix, DVector};

use super::rows::Rows;
use crate::effects::candidate::{Candidate, Kind};
use crate::effects::converter::{self, Converter};
use crate::effects::effect::Effect;
use crate::effects::quantity::Conditions;

/// Step of the logarithm of a parameter for a central difference, whose error is a millionth of the derivative: far above rounding.
const STEP: f64 = 1e-3;

impl Candidate {
    /// An effect in `rows`; `None` where it goes by codes that the steps of the readings would have to say, and they have none.
    pub fn effect_in(effect: &'static Effect, rows: &Rows) -> Option<Self> {
        let candidate = Self::new(rows.sensor, Kind::Effect(effect));
        if !candidate.reads_code() {
            return Some(candidate);
        }
        let (lowest, highest) = rows.reading_range();
        let weight = converter::first_weight(rows.step?, lowest, highest);
        Some(candidate.behind_one(Converter::of(weight, 0.0)))
    }

    /// The candidates that it is tried as: of the bits of a code, which are wrong has to be found as well, so each by itself
    /// and all from the first down to each. The search goes on from the best of these.
    ///
    /// What is of the recording alone is tried as well, and costs its coefficients; of what goes by the temperature, whether the
    /// thermometer is on the same die.
    pub fn variants(mut self, rows: &Rows) -> Vec<Self> {
        if !self.reads_code() {
            let mut whole = self.clone();
            whole.active.extend(self.of_recording());
            let mut all = vec![self];
            if whole.active.len() > all[0].active.len() {
                all.push(whole);
            }
            if rows.thermometer_heats_itself() && all[0].is_thermal() {
                let without = all.clone().into_iter().map(|c| Self {
                    without_self_heating: true,
                    ..c
                });
                all.extend(without.collect::<Vec<_>>());
            }
            let choices = all.len() as f64;
            all.iter_mut().for_each(|c| c.choices = choices);
            return all;
        }
        let offered = self.active.clone();
        self.offered.clone_from(&offered);
        self.choices = (offered.len() as f64).exp2();
        let with = |active: &[usize]| Self {
            active: active.to_vec(),
            ..self.clone()
        };
        let alone = offered.chunks(1).map(with);
        let down = (2..=offered.len()).map(|k| with(&offered[..k]));
        alone.chain(down).collect()
    }

    /// Its columns in `rows`.
    pub fn columns(&self, rows: &Rows, parameter: f64) -> DMatrix<f64> {
        if let Some(columns) = self.columns_by_axis(rows, &self.axes()) {
            return columns;
        }
        self.columns_at(rows, &rows.conditions(self.followed(parameter)), parameter)
    }

    /// Derivative of what it adds to `rows` with coefficients of `values` by the natural logarithm of its nonlinear parameter, unit of the
    /// rows.
    pub fn slope(&self, rows: &Rows, parameter: f64, values: &DVector<f64>) -> DVector<f64> {
        let step = STEP.exp();
        let [up, down] = [parameter * step, parameter / step].map(|p| self.columns(rows, p));
        (up - down) * values / (2.0 * STEP)
    }

    /// Columns of a term or a jump as an error of each of `axes`; `None` of an effect.
    pub fn columns_by_axis(&self, rows: &Rows, axes: &[usize]) -> Option<DMatrix<f64>> {
        match &self.kind {
            Kind::Term(_, product) => Some(rows.term(product, axes)),
            Kind::Jump { session, t_s, .. } => Some(rows.jump(*session, *t_s, axes)),
            Kind::Effect(_) => None,
        }
    }

    /// It with all of the coefficients that its search chooses from.
    pub fn with_all_offered(&self) -> Self {
        Self {
            active: self.offered.clone(),
            ..self.clone()
        }
    }

    /// Its columns out of those [with all that are offered](Self::with_all_offered): the share of the time that a bit is set takes an
    /// error function for each conditions, and a search over choices of bits asks for the same ones again and again.
    pub fn columns_of(&self, all_offered: &DMatrix<f64>) -> DMatrix<f64> {
        let places = self.active.iter();
        let places: Vec<usize> = places
            .filter_map(|k| self.offered.binary_search(k).ok())
            .collect();
        all_offered.select_columns(&places)
    }

    /// Its columns in `rows` at other conditions than theirs.
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

    /// Columns of a code in `rows` [by dwell](Rows::by_dwell) at the conditions of [`Rows::conditions_without`]; `slots` are its
    /// [columns by slot](Self::columns_by_slot) there. How often a bit is set takes an error function for each of the conditions, of which the
    /// turns have many thousands, and they stay.
    pub fn columns_without(
        &self,
        rows: &Rows,
        slots: &DMatrix<f64>,
        conditions: &[Conditions],
    ) -> DMatrix<f64> {
        let all = rows.columns_without(slots.clone(), conditions, &self.axes(), |at, out| {
            self.regressors(at, 0.0, out)
        });
        self.by_coefficient(all)
    }

    /// Columns of each of its [slots](Self::slots) in `rows`.
    pub fn columns_by_slot(&self, rows: &Rows) -> DMatrix<f64> {
        rows.columns(&rows.conditions(None), &self.axes(), |at, out| {
            self.regressors(at, 0.0, out)
        })
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
