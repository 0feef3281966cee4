//! The known inputs of the rows of a file, by their steps.

use std::collections::{BTreeSet, HashMap};
use std::path::Path;

use super::foreign::{ForeignFile, HowToRead};
use super::inputs::Inputs;
use super::row::Row;
use super::step_labels::StepLabels;
use crate::batch::Batch;
use crate::cell::shorten;
use crate::error::Result;

/// A table of inputs, and what the steps of the file have needed of it.
pub(super) struct StepInputs {
    table: Inputs,
    /// Rows of each step of the file, where angles must be divided by durations.
    rows: HashMap<i32, u64>,
    /// Inputs of the steps met so far; `None` where they are not known.
    known: HashMap<i32, Option<[f64; 6]>>,
}

impl StepInputs {
    /// Of the table at `path`.
    pub fn read(path: &Path) -> Result<Self> {
        Ok(Self {
            table: Inputs::read(path)?,
            rows: HashMap::new(),
            known: HashMap::new(),
        })
    }

    /// Which of the `ref_` columns the table fills.
    pub fn columns(&self) -> [bool; 6] {
        self.table.columns
    }

    /// Numbers of the steps met so far that are turns.
    pub fn turns(&self) -> impl Iterator<Item = i32> + '_ {
        self.table.turns.iter().copied()
    }

    /// A first pass over the file at `path`: the duration of a step is known only when all of it has been seen.
    pub fn count_rows(&mut self, path: &Path, how: &HowToRead<'_>) -> Result<()> {
        if !self.table.has_turns {
            return Ok(());
        }
        let mut file = ForeignFile::open(path, how)?;
        let mut row = Row::default();
        while file.next(&mut row)? {
            *self.rows.entry(row.step).or_default() += 1;
        }
        Ok(())
    }

    /// Appends the input of a row of `step` to `batch`.
    pub fn push(&mut self, step: i32, labels: &StepLabels, rate_hz: f64, batch: &mut Batch) {
        let known = match step {
            -1 => None,
            step => *self.known.entry(step).or_insert_with(|| {
                // n samples span n periods: each stands for the time until the next.
                let rows = self.rows.get(&step).copied().unwrap_or(0);
                self.table.input(step, labels, rows as f64 / rate_hz)
            }),
        };
        for (i, target) in batch.reference.iter_mut().enumerate() {
            if self.table.columns[i] {
                target.push(known.map_or(f64::NAN, |input| input[i]));
            }
        }
    }

    /// Steps without an input, and inputs without a step.
    pub fn warnings(&self, labels: &StepLabels) -> Vec<String> {
        let mut warnings = Vec::new();
        let unknown = self.known.iter().filter(|(_, input)| input.is_none());
        let steps: BTreeSet<i32> = unknown.map(|(&step, _)| step).collect();
        if !steps.is_empty() {
            let name = |&step: &i32| match labels.label(step) {
                Some(label) => shorten(label.as_bytes()),
                None => step.to_string(),
            };
            let names: Vec<String> = steps.iter().take(10).map(name).collect();
            let (count, names) = (steps.len(), names.join(", "));
            warnings.push(format!(
                "the inputs of {count} steps are not known: {names}"
            ));
        }
        warnings.extend(self.table.unused());
        warnings
    }
}
