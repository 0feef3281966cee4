//! The known inputs of the rows of a file, by their steps.

use std::collections::{BTreeSet, HashMap};
use std::path::Path;

use super::foreign::{ForeignFile, HowToRead};
use super::inputs::Inputs;
use super::options::ImportOptions;
use super::resample::{self, Resampler};
use super::row::Row;
use super::step_labels::StepLabels;
use super::time::Times;
use crate::batch::Batch;
use crate::cell::shorten;
use crate::declared::Reference;
use crate::error::Result;

/// A table of inputs, and the inputs of the steps met so far.
pub(super) struct StepInputs {
    table: Inputs,
    /// Rows of each step of the file, counted if angles must be divided by durations.
    rows: HashMap<i32, u64>,
    /// Inputs of the steps met so far; `None` if they are unknown.
    known: HashMap<i32, Option<[f64; 6]>>,
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
        Ok(table.map(|table| Self {
            table,
            rows: HashMap::new(),
            known: HashMap::new(),
        }))
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
    pub fn turns(&self) -> impl Iterator<Item = i32> + '_ {
        self.table.turns.iter().copied()
    }

    /// A first pass over the file at `path`: the duration of a step is known only after its last row. `irregular` are the times of a file that is to
    /// be resampled at regular ones.
    pub fn count_rows(
        &mut self,
        path: &Path,
        how: &HowToRead<'_>,
        irregular: Option<Times>,
    ) -> Result<()> {
        if !self.table.has_turns {
            return Ok(());
        }
        let mut file = ForeignFile::open(path, how)?;
        let mut resampler = irregular
            .as_ref()
            .map(|times| Resampler::new(times.period_s()));
        if let Some(times) = irregular {
            file = file.with_times(times);
        }
        let mut row = Row::default();
        while resample::next(&mut file, resampler.as_mut(), &mut row)? {
            *self.rows.entry(row.step).or_default() += 1;
        }
        Ok(())
    }

    /// For a file of a sequence, whose rows all belong to `step`. The table of the files `before` it is used further, with its counts.
    pub fn of_step(mut self, step: i32, before: Option<Self>) -> Self {
        let count = self.rows.remove(&-1);
        let mut all = before.unwrap_or(self);
        all.rows.extend(count.map(|count| (step, count)));
        all
    }

    /// Appends the input of a row of `step` to `batch`.
    pub fn push(&mut self, step: i32, labels: &StepLabels, rate_hz: f64, batch: &mut Batch) {
        let known = match step {
            -1 => None,
            step => *self.known.entry(step).or_insert_with(|| {
                // n samples last n periods: each lasts until the next.
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

    /// A warning about steps without an input.
    pub fn unknown(&self, labels: &StepLabels) -> Option<String> {
        let unknown = self.known.iter().filter(|(_, input)| input.is_none());
        let steps: BTreeSet<i32> = unknown.map(|(&step, _)| step).collect();
        if steps.is_empty() {
            return None;
        }
        let name = |&step: &i32| match labels.label(step) {
            Some(label) => shorten(label.as_bytes()),
            None => step.to_string(),
        };
        let names: Vec<String> = steps.iter().take(10).map(name).collect();
        let (count, names) = (steps.len(), names.join(", "));
        Some(format!("the inputs of {count} dwells are unknown: {names}"))
    }

    /// A warning about inputs without a step.
    pub fn unused(&self) -> Option<String> {
        self.table.unused()
    }
}
