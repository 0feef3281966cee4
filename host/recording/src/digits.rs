//! Numbers as a person reads them.

/// `value` rounded to `digits` significant digits, for files that should contain no more digits than are known.
pub fn rounded(value: f64, digits: usize) -> f64 {
    let text = format!("{value:.*e}", digits.saturating_sub(1));
    text.parse().unwrap_or(value)
}

/// `value` to three significant digits, without an exponent where that reads well.
pub fn significant(value: f64) -> String {
    // Zero has no sign for people.
    if value == 0.0 {
        return "0".into();
    }
    if !value.is_finite() {
        return format!("{value}");
    }
    // Rounded first: otherwise 0.0099998, which time stamps make of 0.01, would have one digit more. Whole numbers keep all their digits.
    let value = match value.abs() < 100.0 {
        true => rounded(value, 3),
        false => value,
    };
    let digits = 2 - value.abs().log10().floor() as i32;
    if (-3..=6).contains(&digits) {
        format!("{value:.*}", digits.max(0) as usize)
    } else {
        format!("{value:.2e}")
    }
}

/// A time in the unit that people use for it.
pub fn duration(s: f64) -> String {
    match s {
        s if s < 120.0 => format!("{} s", significant(s)),
        s if s < 7200.0 => format!("{} min", significant(s / 60.0)),
        s if s < 172_800.0 => format!("{} h", significant(s / 3600.0)),
        s => format!("{} days", significant(s / 86_400.0)),
    }
}

/// `1 sample`, `2 samples`.
pub fn plural(n: u64, noun: &str) -> String {
    if n == 1 {
        format!("1 {noun}")
    } else {
        format!("{n} {noun}s")
    }
}

/// `value`, with -0 written as 0.
pub fn unsigned_zero(value: f64) -> f64 {
    value + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_digits_are_shown_and_no_whole_number_is_cut() {
        let cases = [
            (0.009_999_8, "0.0100"),
            (0.01, "0.0100"),
            (99.96, "100"),
            (-2.345, "-2.35"),
            (2174.4, "2174"),
            (1.5e-7, "1.50e-7"),
            (0.0, "0"),
        ];
        for (value, text) in cases {
            assert_eq!(significant(value), text);
        }
        assert_eq!(rounded(2.234_56e-6, 4), 2.235e-6);
    }
}
