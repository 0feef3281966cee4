//! The self-test: a table of named results, so that each board tests what its sensors can.

use heapless::Vec;
use serde::{Deserialize, Serialize};

/// Most bytes of a table: 15 rows of about 30 bytes.
const ROOM: usize = 480;

/// Result of a self-test. Later versions append fields, as to [`Greeting`](super::Greeting).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct SelfTest<'a> {
    /// [`TestRow`]s in postcard, one after the other.
    pub rows: &'a [u8],
}

/// A row of the table.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TestRow<'a> {
    /// What was tested: `gyro x, ST1`.
    pub name: &'a str,
    /// What was measured.
    pub value: f32,
    /// Unit of the value and its limits.
    pub unit: &'a str,
    /// Least and largest value that passes.
    pub limits: [f32; 2],
    /// What follows from it.
    pub verdict: Verdict,
}

/// Whether a row passes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Verdict {
    /// It does.
    Passed,
    /// It does not.
    Failed,
    /// The value passes, but would be the same if the sensor were stuck: this pose does not show it.
    NotShown,
}

impl<'a> TestRow<'a> {
    /// Passed if the value is within its limits, both included. NaN fails.
    pub fn within(name: &'a str, value: f32, unit: &'a str, limits: [f32; 2]) -> Self {
        let [least, most] = limits;
        let verdict = match least <= value && value <= most {
            true => Verdict::Passed,
            false => Verdict::Failed,
        };
        Self {
            name,
            value,
            unit,
            limits,
            verdict,
        }
    }
}

impl<'a> SelfTest<'a> {
    /// The rows, up to the first that cannot be read.
    pub fn rows(&self) -> impl Iterator<Item = TestRow<'a>> + use<'a> {
        let mut rest = self.rows;
        core::iter::from_fn(move || {
            let (row, after) = postcard::take_from_bytes(rest).ok()?;
            rest = after;
            Some(row)
        })
    }

    /// Whether all bytes are rows.
    pub fn is_whole(&self) -> bool {
        let mut rest = self.rows;
        while let Ok((_, after)) = postcard::take_from_bytes::<TestRow<'a>>(rest) {
            rest = after;
        }
        rest.is_empty()
    }
}

/// A table being made.
#[derive(Debug, Clone, Default)]
pub struct TestTable {
    bytes: Vec<u8, ROOM>,
}

impl TestTable {
    /// Without a row.
    pub const fn new() -> Self {
        Self { bytes: Vec::new() }
    }

    /// Appends a row; returns whether there was room.
    pub fn push(&mut self, row: &TestRow<'_>) -> bool {
        let mut bytes = [0; 64];
        postcard::to_slice(row, &mut bytes)
            .is_ok_and(|row| self.bytes.extend_from_slice(row).is_ok())
    }

    /// The message.
    pub fn result(&self) -> SelfTest<'_> {
        SelfTest { rows: &self.bytes }
    }
}
