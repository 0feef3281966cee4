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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_numbered_by_first_appearance_and_keep_their_number() {
        let mut labels = StepLabels::default();
        let cells = ["", "x_a", " x_p", "x_a", "-1", "7", "x_p"];
        let numbers: Vec<i32> = cells
            .iter()
            .map(|cell| labels.number(cell.as_bytes()).unwrap())
            .collect();
        assert_eq!(numbers, [-1, 0, 1, 0, -1, 2, 1]);
        assert_eq!(labels.label(1), Some("x_p"));
        assert_eq!(labels.label(-1), None);
        assert_eq!(labels.into_labels(), ["x_a", "x_p", "7"]);
    }

    #[test]
    fn numbers_stay_and_a_word_among_them_is_refused() {
        let mut labels = StepLabels::default();
        assert_eq!(labels.number(b"12").unwrap(), 12);
        assert_eq!(labels.number(b"3.0").unwrap(), 3);
        assert!(labels.number(b"x_a").unwrap_err().problem.contains("x_a"));
        assert!(labels.into_labels().is_empty());
    }

    #[test]
    fn a_column_of_remarks_is_no_step() {
        let mut labels = StepLabels::default();
        let refused = (0..20_000).any(|i| labels.number(format!("note {i}").as_bytes()).is_err());
        assert!(refused);
    }
}
