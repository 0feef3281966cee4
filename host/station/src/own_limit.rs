//! Limits of one quantity with their source.

/// Limits of a quantity with their source. A later one replaces an earlier one of the same name.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnLimit {
    /// Name of the quantity.
    pub name: String,
    /// Smallest value that passes.
    pub lower: Option<f64>,
    /// Largest value that passes.
    pub upper: Option<f64>,
    /// Where they are from.
    pub source: String,
}
