//! Parsers of numeric options.

/// A number greater than 0.
pub(crate) fn positive(text: &str) -> Result<f64, String> {
    number(text, f64::MIN_POSITIVE)
}

/// A finite number.
pub(crate) fn finite(text: &str) -> Result<f64, String> {
    number(text, f64::MIN)
}

fn number(text: &str, least: f64) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "it is not a number".to_string())?;
    match value.is_finite() && value >= least {
        true => Ok(value),
        false if least > 0.0 => Err("it has to be greater than 0".into()),
        false => Err("it is not a finite number".into()),
    }
}
