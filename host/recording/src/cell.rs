//! One cell of text: parsed as a number or a dwell number, or refused with a reason.

/// Text of a cell for an error message: printable, on one line, 40 characters at most.
pub(super) fn shorten(cell: &[u8]) -> String {
    const LONGEST: usize = 40;
    let text = String::from_utf8_lossy(&cell[..cell.len().min(4 * LONGEST)]);
    let mut short: String = text
        .chars()
        .map(|c| if c.is_control() { ' ' } else { c })
        .take(LONGEST)
        .collect();
    if short.len() < cell.len() && short.chars().count() == LONGEST {
        short.push('…');
    }
    format!("\"{short}\"")
}

/// Largest magnitude of a reading. No unit needs more, and squares of sums of such numbers are far from overflowing.
const LARGEST: f64 = 1e30;

/// Whether `value` can be a reading. NaN can: it is an empty cell.
pub(super) fn is_reading(value: f64) -> bool {
    !(value.abs() > LARGEST)
}

/// Why a cell was refused.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Refusal {
    pub problem: String,
    pub remedy: &'static str,
}

impl Refusal {
    fn new(problem: String, remedy: &'static str) -> Self {
        Self { problem, remedy }
    }
}

/// Number in a cell; NaN if the cell is empty or contains `nan`.
///
/// Infinite and absurdly large values are refused: no sensor measures them, and later sums would include them unnoticed.
pub(super) fn number(cell: &[u8]) -> Result<f64, Refusal> {
    let cell = cell.trim_ascii();
    if cell.is_empty() {
        return Ok(f64::NAN);
    }
    match fast_float2::parse::<f64, _>(cell) {
        Ok(value) if !is_reading(value) => Err(no_reading(value, &shorten(cell))),
        Ok(value) => Ok(value),
        Err(_) if cell.contains(&b',') => Err(Refusal::new(
            format!("{} is not a number", shorten(cell)),
            "write decimal points, not commas",
        )),
        Err(_) => Err(no_number(cell)),
    }
}

/// Refusal of a cell that is not a number.
pub(super) fn no_number(cell: &[u8]) -> Refusal {
    Refusal::new(
        format!("{} is not a number", shorten(cell)),
        "correct the cell, or leave it empty if nothing was measured",
    )
}

/// Refusal of a value that cannot be a reading; `shown` is its text in the file.
pub(super) fn no_reading(value: f64, shown: &str) -> Refusal {
    let problem = match value.is_infinite() {
        true => format!("{shown} is infinite"),
        false => format!("{shown} is too large for a reading"),
    };
    Refusal::new(problem, "leave the cell empty if nothing was measured")
}

/// Refusal of a row without a time.
pub(super) fn no_time() -> Refusal {
    Refusal::new(
        "the time is empty".to_owned(),
        "every row needs its time; remove the row or fill it in",
    )
}

/// Number of a dwell from its value; NaN (between two dwells) becomes -1.
///
/// Whole numbers written as `3.0` pass: tables with empty cells come out of pandas that way.
pub(super) fn step_from_value(value: f64, text: &dyn Fn() -> String) -> Result<i32, Refusal> {
    if value.is_nan() {
        Ok(-1)
    } else if value.fract() == 0.0 && (-1.0..=f64::from(i32::MAX)).contains(&value) {
        Ok(value as i32)
    } else {
        Err(Refusal::new(
            format!("{} is not the number of a dwell", text()),
            "number the dwells 0, 1, 2 …; empty or -1 is in transit",
        ))
    }
}

/// Number of a dwell in a cell; -1 if it is empty.
pub(super) fn step(cell: &[u8]) -> Result<i32, Refusal> {
    let cell = cell.trim_ascii();
    // The plain case first: one or more digits that fit.
    if !cell.is_empty() && cell.len() <= 9 && cell.iter().all(u8::is_ascii_digit) {
        return Ok(cell
            .iter()
            .fold(0, |sum, digit| sum * 10 + i32::from(digit - b'0')));
    }
    let value = if cell.is_empty() {
        f64::NAN
    } else {
        // A word becomes a fraction, which the check below refuses.
        fast_float2::parse::<f64, _>(cell).unwrap_or(0.5)
    };
    step_from_value(value, &|| shorten(cell))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_empty_cell_and_nan_are_not_a_number_and_infinity_is_refused() {
        for text in ["", "  ", "nan", "NaN", "-nan"] {
            assert!(number(text.as_bytes()).unwrap().is_nan(), "{text}");
        }
        assert_eq!(number(b" 1.5e-3 ").unwrap(), 1.5e-3);
        for text in ["inf", "-Infinity", "1e999"] {
            assert!(
                number(text.as_bytes())
                    .unwrap_err()
                    .problem
                    .contains("infinite")
            );
        }
        assert!(number(b"1e31").unwrap_err().problem.contains("too large"));
        assert_eq!(number(b"-1e30").unwrap(), -1e30);
        assert!(number(b"1,5").unwrap_err().remedy.contains("points"));
        assert!(number(b"0x12").unwrap_err().problem.contains("0x12"));
    }

    #[test]
    fn a_step_is_a_whole_number_from_minus_one() {
        for (text, number) in [("", -1), ("-1", -1), ("7", 7), ("3.0", 3), ("nan", -1)] {
            assert_eq!(step(text.as_bytes()).unwrap(), number, "{text}");
        }
        assert_eq!(step(b"2147483647").unwrap(), i32::MAX);
        for text in ["1.5", "-2", "x_a", "2147483648", "inf"] {
            assert!(step(text.as_bytes()).is_err(), "{text}");
        }
    }

    #[test]
    fn shortened_text_is_one_short_line() {
        assert_eq!(shorten(b"a\nb"), "\"a b\"");
        assert!(shorten(&[b'x'; 1000]).chars().count() < 50);
        shorten(&[0xff, 0xfe, 0x00]);
    }
}
