//! Numbers for steps that a file may name in words.

use std::collections::HashMap;

use super::super::cell::{self, Refusal, shorten};

/// Most different labels in a file; a column with more is not a step.
const MOST_LABELS: usize = 10_000;

/// Turns the cells of a `step` column into numbers: numbers stay what they are, labels are
/// numbered in the order of their first appearance.
#[derive(Debug, Default)]
pub(super) struct StepLabels {
    /// Whether the first cell that is not empty was a number; all others must be alike.
    numeric: Option<bool>,
    labels: Vec<String>,
    numbers: HashMap<Vec<u8>, i32>,
}

impl StepLabels {
    /// Number of the step in a cell; -1 if it is empty or -1.
    pub fn number(&mut self, cell: &[u8]) -> Result<i32, Refusal> {
        let cell = cell.trim_ascii();
        if cell.is_empty() || cell == b"-1" {
            return Ok(-1);
        }
        if self.numeric != Some(false) {
            match cell::step(cell) {
                Ok(number) => {
                    if number >= 0 {
                        self.numeric = Some(true);
                    }
                    return Ok(number);
                }
                Err(refusal) if self.numeric == Some(true) => return Err(refusal),
                Err(_) => self.numeric = Some(false),
            }
        }
        if let Some(&number) = self.numbers.get(cell) {
            return Ok(number);
        }
        if self.labels.len() == MOST_LABELS {
            return Err(Refusal {
                problem: format!("{} is the 10001st different label", shorten(cell)),
                remedy: "give another column for step: in this one every row has another text",
            });
        }
        // Bounded by the limit above.
        let number = self.labels.len() as i32;
        self.labels.push(String::from_utf8_lossy(cell).into_owned());
        self.numbers.insert(cell.to_owned(), number);
        Ok(number)
    }

    /// For steps whose labels are known beforehand.
    pub fn of(labels: Vec<String>) -> Self {
        Self {
            numeric: Some(false),
            labels,
            numbers: HashMap::new(),
        }
    }

    /// Label of step `number`, if it has one.
    pub fn label(&self, number: i32) -> Option<&str> {
        let index = usize::try_from(number).ok()?;
        self.labels.get(index).map(String::as_str)
    }

    /// All labels, in the order of their numbers.
    pub fn into_labels(self) -> Vec<String> {
        self.labels
    }
}
