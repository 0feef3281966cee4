//! Values of the column `temp_c` that cannot be temperatures in °C, such as counts of a converter or readings of a failed bus.

/// Counts of values that cannot be temperatures.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct NoTemperatures {
    /// Values of the column.
    pub of: u64,
    /// Those that cannot be temperatures.
    pub count: u64,
    /// The first of them, and where it is.
    first: Option<(f64, String)>,
}

impl NoTemperatures {
    /// Counts the value `c`, which cannot be a temperature; `at` gives its place.
    pub fn add(&mut self, c: f64, at: impl FnOnce() -> String) {
        self.count += 1;
        self.first.get_or_insert_with(|| (c, at()));
    }

    /// What is wrong, in words; `None` if nothing is.
    pub fn problem(&self) -> Option<String> {
        let (c, at) = self.first.as_ref()?;
        Some(format!(
            "{} of {} values cannot be temperatures in °C, the first is {c} {at}",
            self.count, self.of
        ))
    }

    /// The same, for values that are replaced by empty cells.
    pub fn warning(&self) -> Option<String> {
        Some(format!("{}: left empty", self.problem()?))
    }
}
