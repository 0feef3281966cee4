//! The known inputs of the rows of a file, by their steps.

use std::collections::{BTreeSet, HashMap};

use super::inputs::Inputs;
use super::options::ImportOptions;
use super::step_labels::StepLabels;
use crate::cell::shorten;
use crate::columns::Column;
use crate::declared::Reference;
use crate::error::Result;

/// A table of inputs, and the steps without an input met so far.
pub(super) struct StepInputs {
    table: Inputs,
    unknown: BTreeSet<i32>,
}

impl StepInputs {
    /// From the faces or the table of `options`, if they give inputs. Faces give inputs only if the reference is a table: with gravity only the
    /// magnitude is known.
    pub fn of(options: &ImportOptions) -> Result<Option<Self>> {
        let table = match &options.log.inputs {
            _ if !options.faces.is_empty() => (options.reference == Reference::Table)
                .then(|| Inputs::of_faces(&options.faces, options.gravity_mps2)),
            Some(path) => Some(Inputs::read(path)?),
            None => None,
        };
        let unknown = BTreeSet::new();
        Ok(table.map(|table| Self { table, unknown }))
    }

    /// Which of the `ref_` columns the table fills.
    pub fn columns(&self) -> [bool; 6] {
        self.table.columns
    }

    /// Whether the table has an angle.
    pub fn has_turns(&self) -> bool {
        self.table.has_turns
    }

    /// Numbers of the steps met so far that are turns.
    pub fn turns(&self) -> Vec<i32> {
        self.table.turns.iter().copied().collect()
    }

    /// The columns of known inputs of rows with these steps.
    pub fn of_rows(
        &mut self,
        steps: &[i32],
        labels: &StepLabels,
        rate_hz: f64,
    ) -> Vec<(Column, Vec<f64>)> {
        let mut rows: HashMap<i32, u64> = HashMap::new();
        for step in steps.iter().filter(|step| **step >= 0) {
            *rows.entry(*step).or_default() += 1;
        }
        let mut known: HashMap<i32, [f64; 6]> = HashMap::new();
        for (step, rows) in rows {
            // n samples last n periods: each lasts until the next.
            match self.table.input(step, labels, rows as f64 / rate_hz) {
                Some(input) => drop(known.insert(step, input)),
                None => drop(self.unknown.insert(step)),
            }
        }
        let of = |i: usize| {
            let input = |step| known.get(step).map_or(f64::NAN, |input| input[i]);
            (Column::Reference(i), steps.iter().map(input).collect())
        };
        let given = (0..6).filter(|i| self.table.columns[*i]);
        given.map(of).collect()
    }

    /// Warnings about steps without an input, and about inputs without a step.
    pub fn warnings(&self, labels: &StepLabels) -> Vec<String> {
        let name = |&step: &i32| match labels.label(step) {
            Some(label) => shorten(label.as_bytes()),
            None => step.to_string(),
        };
        let names: Vec<String> = self.unknown.iter().take(10).map(name).collect();
        let (count, names) = (self.unknown.len(), names.join(", "));
        let unknown =
            (count > 0).then(|| format!("the inputs of {count} dwells are unknown: {names}"));
        unknown.into_iter().chain(self.table.unused()).collect()
    }
}
