//! Errors in a rig file.

use std::fmt;

use crate::located::written;

/// One error in a rig file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refusal {
    /// Dotted path of the key, list elements counted from 0: `effect.1.id`.
    pub path: String,
    /// The problem.
    pub problem: String,
    /// The remedy.
    pub remedy: String,
}

impl Refusal {
    pub(crate) fn new(
        path: impl Into<String>,
        problem: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self {
            path: path.into(),
            problem: problem.into(),
            remedy: remedy.into(),
        }
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "`{}`: {}; {}", self.path, self.problem, self.remedy)
    }
}

impl From<Refusal> for String {
    fn from(refusal: Refusal) -> Self {
        format!("rig: {refusal}")
    }
}

/// Refuses numbers outside `low` to `high`, both included; an infinite `high` admits inf.
///
/// Ranges are far wider than any bench needs, but all are finite. A size of 1e308 would overflow and make the recording NaN; a time of 1e308 s would
/// never end.
pub(crate) fn within(path: &str, values: &[f64], [low, high]: [f64; 2]) -> Result<(), Refusal> {
    let Some(v) = values.iter().find(|v| !(**v >= low && **v <= high)) else {
        return Ok(());
    };
    let key = path.rsplit('.').next().unwrap_or(path);
    let remedy = if high.is_infinite() {
        format!("give {} or more, or inf", written(low))
    } else {
        format!("give {} to {}", written(low), written(high))
    };
    Err(Refusal::new(
        path,
        format!("`{key}` is {}", written(*v)),
        remedy,
    ))
}
