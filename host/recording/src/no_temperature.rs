//! What is said of values of the column `temp_c` that are no temperatures in °C: counts of a converter, a bus that failed.

/// Values that are no temperatures, among those of a column.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct NoTemperatures {
    /// Values of the column.
    pub of: u64,
    /// Those that are none.
    pub count: u64,
    /// The first of them, and where it is.
    first: Option<(f64, String)>,
}

impl NoTemperatures {
    /// Counts the value `c`, which is none; `at` says where it is.
    pub fn add(&mut self, c: f64, at: impl FnOnce() -> String) {
        self.count += 1;
        self.first.get_or_insert_with(|| (c, at()));
    }

    /// What is wrong, in words; `None` where nothing is.
    pub fn problem(&self) -> Option<String> {
        let (c, at) = self.first.as_ref()?;
        Some(format!(
            "{} of {} values cannot be temperatures in °C, the first is {c} {at}",
            self.count, self.of
        ))
    }

    /// The same where they are taken for empty cells.
    pub fn warning(&self) -> Option<String> {
        Some(format!("{}: left empty", self.problem()?))
    }
}
