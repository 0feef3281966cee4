//! Known inputs during a recording: from a table of inputs, or from the plan that is followed.

use std::collections::BTreeMap;
use std::time::Duration;

use mimu_recording::{Batch, Inputs};

use mimu::plan::Planned;

/// Known inputs of the dwells.
#[derive(Debug)]
pub struct Known {
    source: Source,
    labels: Vec<String>,
    /// Samples of each dwell so far.
    samples: BTreeMap<i32, u64>,
}

#[derive(Debug)]
enum Source {
    Table(Inputs),
    Plan(Vec<Planned>),
}

impl Known {
    /// From a table as for `mimu import --inputs`. Rows are found by the number of the dwell, or by their position if they have labels.
    pub fn of_table(inputs: Inputs) -> Self {
        let labels = inputs.labels();
        Self::of(Source::Table(inputs), labels)
    }

    /// From the dwells of a plan.
    pub fn of_plan(dwells: Vec<Planned>) -> Self {
        Self::of(Source::Plan(dwells), Vec::new())
    }

    fn of(source: Source, labels: Vec<String>) -> Self {
        Self {
            source,
            labels,
            samples: BTreeMap::new(),
        }
    }

    /// Which `ref_` columns it fills; none for a plan by hand.
    pub fn columns(&self) -> [bool; 6] {
        match &self.source {
            Source::Table(inputs) => inputs.columns,
            Source::Plan(dwells) => {
                let known =
                    |d: &Planned, i: usize| !d.input[i].is_nan() || i < 3 && d.turn.is_some();
                std::array::from_fn(|i| dwells.iter().any(|d| known(d, i)))
            }
        }
    }

    /// Labels of the dwells, if they have any.
    pub fn labels(&self) -> &[String] {
        &self.labels
    }

    /// Number of planned dwells, if there is a plan.
    pub fn planned(&self) -> Option<usize> {
        match &self.source {
            Source::Table(_) => None,
            Source::Plan(dwells) => Some(dwells.len()),
        }
    }

    /// Instruction for a dwell, if there is one.
    pub fn title(&self, step: i32) -> Option<&str> {
        let at = usize::try_from(step).ok()?;
        match &self.source {
            Source::Table(_) => self.labels.get(at).map(String::as_str),
            Source::Plan(dwells) => dwells.get(at).map(|d| d.title.as_str()),
        }
    }

    /// Input of the next sample of a dwell, deg/s and m/s²; NaN if unknown. Counts the sample. The mean rate of a turn is known only at its end.
    pub(super) fn next(&mut self, step: i32) -> [f64; 6] {
        *self.samples.entry(step).or_default() += 1;
        self.input(step, f64::NAN)
    }

    /// Input of a dwell with this length.
    fn input(&mut self, step: i32, duration_s: f64) -> [f64; 6] {
        const UNKNOWN: [f64; 6] = [f64::NAN; 6];
        let Ok(at) = usize::try_from(step) else {
            return UNKNOWN;
        };
        let known = match &mut self.source {
            Source::Plan(dwells) => dwells.get(at).map(|d| d.input_over(duration_s)),
            Source::Table(inputs) => {
                let label = self.labels.get(at).map(String::as_str);
                inputs.of_step(step, label, duration_s)
            }
        };
        known.unwrap_or(UNKNOWN)
    }

    /// Whether some rates are known only at the end of their dwell.
    pub(super) fn has_turns(&self) -> bool {
        match &self.source {
            Source::Table(inputs) => inputs.has_turns,
            Source::Plan(dwells) => dwells.iter().any(|d| d.turn.is_some()),
        }
    }

    /// Whether a dwell is a planned turn. A turn is usable only if all of it was recorded.
    pub(super) fn is_turn(&self, step: i32) -> bool {
        let at = usize::try_from(step).ok();
        match &self.source {
            Source::Table(_) => false,
            Source::Plan(dwells) => at
                .and_then(|at| dwells.get(at))
                .is_some_and(|d| d.turn.is_some()),
        }
    }

    /// Writes the inputs of complete dwells into rows. n samples span n periods of the sample rate.
    pub(super) fn complete(&mut self, batch: &mut Batch, rate_hz: f64) {
        let columns = self.columns();
        let mut inputs: BTreeMap<i32, [f64; 6]> = BTreeMap::new();
        for (row, step) in batch.step.iter().enumerate() {
            let input = *inputs.entry(*step).or_insert_with(|| {
                let samples = self.samples.get(step).copied().unwrap_or_default();
                self.input(*step, samples as f64 / rate_hz)
            });
            for (i, column) in batch.reference.iter_mut().enumerate() {
                if columns[i] {
                    column[row] = input[i];
                }
            }
        }
    }

    /// The dwells that are turns.
    pub(super) fn turns(&self) -> Vec<i32> {
        match &self.source {
            Source::Table(inputs) => inputs.turns.iter().copied().collect(),
            Source::Plan(_) => {
                let recorded = self.samples.keys().copied();
                recorded.filter(|step| self.is_turn(*step)).collect()
            }
        }
    }

    /// A sentence about planned inputs without samples, if there are any.
    pub(super) fn unused(&self) -> Option<String> {
        match &self.source {
            Source::Table(inputs) => inputs.unused(),
            Source::Plan(dwells) => {
                let done = self.samples.keys().filter(|step| **step >= 0).count();
                (done < dwells.len()).then(|| {
                    format!(
                        "{done} of the {} dwells of the plan were recorded",
                        dwells.len()
                    )
                })
            }
        }
    }

    /// Lengths of the planned dwells.
    pub fn lengths(&self) -> Vec<Duration> {
        match &self.source {
            Source::Table(_) => Vec::new(),
            Source::Plan(dwells) => dwells.iter().map(|d| d.length).collect(),
        }
    }
}
