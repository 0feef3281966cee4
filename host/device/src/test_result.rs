//! A row of the self-test.

use mimu_core::wire::{self, TestRow};
use serde::Serialize;

use super::reading::shortest;

/// A row of the device's table: an owned copy of a [`TestRow`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TestResult {
    /// What was tested.
    pub name: String,
    /// What was measured.
    pub value: f64,
    /// Unit of the value and its limits.
    pub unit: String,
    /// Least and largest value that passes.
    pub limits: [f64; 2],
    /// What follows from it.
    pub verdict: Verdict,
}

/// Whether a row passes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// It does.
    Passed,
    /// It does not.
    Failed,
    /// The value passes, but would be the same if the sensor were stuck: this pose does not show it.
    NotShown,
}

impl From<TestRow<'_>> for TestResult {
    fn from(row: TestRow<'_>) -> Self {
        Self {
            name: row.name.into(),
            value: shortest(row.value),
            unit: row.unit.into(),
            limits: row.limits.map(shortest),
            verdict: match row.verdict {
                wire::Verdict::Passed => Verdict::Passed,
                wire::Verdict::Failed => Verdict::Failed,
                wire::Verdict::NotShown => Verdict::NotShown,
            },
        }
    }
}
