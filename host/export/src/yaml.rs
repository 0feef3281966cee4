//! Numbers and matrices in YAML that every reader parses as numbers.

use std::fmt::Write as _;

use nalgebra::SMatrix;

/// A number to ten digits.
///
/// PyYAML reads `1e-5` and `1.5e3` as strings: it requires a decimal point and a sign of the exponent.
pub fn number(value: f64) -> String {
    let decimals = |digits: f64| format!("{value:.*}", digits.clamp(1.0, 17.0) as usize);
    match value.abs() {
        0.0 => "0.0".into(),
        size if (1e-3..1e6).contains(&size) => decimals(9.0 - size.log10().floor()),
        _ => scientific(value, 9),
    }
}

/// A number with `digits` decimals and an exponent.
pub fn scientific(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$e}");
    match text.split_once('e') {
        Some((mantissa, exponent)) if !exponent.starts_with('-') => {
            format!("{mantissa}e+{exponent}")
        }
        _ => text,
    }
}

/// `key` and a list of numbers on one line.
pub fn list(out: &mut String, indent: &str, key: &str, values: impl IntoIterator<Item = f64>) {
    let values: Vec<String> = values.into_iter().map(number).collect();
    let _ = writeln!(out, "{indent}{key}: [{}]", values.join(", "));
}

/// `key` and a matrix as the list of its rows. Rounding residue of a zero is written as 0.
pub fn matrix<const N: usize>(
    out: &mut String,
    indent: &str,
    key: &str,
    matrix: &SMatrix<f64, N, N>,
) {
    let least = 1e-14 * matrix.amax();
    let value = |v: &f64| number(if v.abs() < least { 0.0 } else { *v });
    let _ = writeln!(out, "{indent}{key}:");
    for row in matrix.row_iter() {
        let row: Vec<String> = row.iter().map(value).collect();
        let _ = writeln!(out, "{indent}  - [{}]", row.join(", "));
    }
}
