//! Time stamps as a file has them, and the unit that they are in.

use std::fmt;

use serde::Serialize;

/// A time stamp in the unit of its file.
///
/// Both as a double and cut at the decimal point: nanoseconds since 1970 do not fit into a double, which would round them to
/// 256 ns, nor do seconds since then with nine decimals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in super::super) struct Stamp {
    /// As a double, NaN if there is none.
    pub value: f64,
    /// Whole part, towards zero.
    whole: i64,
    /// What is left, with the same sign.
    fraction: f64,
}

impl Default for Stamp {
    fn default() -> Self {
        Self::from(f64::NAN)
    }
}

impl From<f64> for Stamp {
    fn from(value: f64) -> Self {
        // A cast saturates; what is beyond is refused elsewhere.
        Self {
            value,
            whole: value.trunc() as i64,
            fraction: value.fract(),
        }
    }
}

impl From<i64> for Stamp {
    fn from(whole: i64) -> Self {
        Self {
            value: whole as f64,
            whole,
            fraction: 0.0,
        }
    }
}

impl Stamp {
    /// The stamp in a cell that is the number `value`.
    pub fn in_cell(cell: &[u8], value: f64) -> Self {
        let cell = cell.trim_ascii();
        let (negative, digits) = match cell.split_first() {
            Some((b'-', digits)) => (true, digits),
            _ => (false, cell),
        };
        let (whole, decimals) = match memchr::memchr2(b'.', b',', digits) {
            Some(point) => (&digits[..point], &digits[point + 1..]),
            None => (digits, &b""[..]),
        };
        let plain = |text: &[u8]| text.iter().all(u8::is_ascii_digit);
        let whole: Option<i64> = std::str::from_utf8(whole).ok().and_then(|w| w.parse().ok());
        let (Some(whole @ 0..), true) = (whole, plain(decimals)) else {
            return Self::from(value);
        };
        let digit = |sum: i64, byte: &u8| sum * 10 + i64::from(byte - b'0');
        let sign = if negative { -1 } else { 1 };
        // Eighteen decimals fit, and are more than a double tells apart.
        let decimals = &decimals[..decimals.len().min(18)];
        let scale = 10_f64.powi(decimals.len() as i32);
        Self {
            value,
            whole: sign * whole,
            fraction: sign as f64 * (decimals.iter().fold(0, digit) as f64 / scale),
        }
    }

    /// Time since `origin`, in the unit of the stamp. Without an origin the stamp as it stands.
    pub fn since(&self, origin: i64) -> f64 {
        match origin {
            0 => self.value,
            _ => self.whole.saturating_sub(origin) as f64 + self.fraction,
        }
    }

    /// Its whole part, towards zero.
    pub fn whole(&self) -> i64 {
        self.whole
    }
}

/// Unit of time stamps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in super::super) enum Unit {
    /// One of those that clocks count in.
    Decimal(Decimal),
    /// So many seconds, as somebody has said.
    Other(f64),
}

/// Units that clocks count in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Decimal {
    /// s
    #[serde(rename = "s")]
    Second,
    /// ms
    #[serde(rename = "ms")]
    Millisecond,
    /// µs
    #[serde(rename = "us")]
    Microsecond,
    /// ns
    #[serde(rename = "ns")]
    Nanosecond,
}

impl Decimal {
    /// All of them.
    pub const ALL: [Decimal; 4] = [
        Decimal::Second,
        Decimal::Millisecond,
        Decimal::Microsecond,
        Decimal::Nanosecond,
    ];

    /// How many make a second.
    pub fn per_second(self) -> i64 {
        match self {
            Decimal::Second => 1,
            Decimal::Millisecond => 1_000,
            Decimal::Microsecond => 1_000_000,
            Decimal::Nanosecond => 1_000_000_000,
        }
    }
}

impl fmt::Display for Decimal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Decimal::Second => "seconds",
            Decimal::Millisecond => "milliseconds",
            Decimal::Microsecond => "microseconds",
            Decimal::Nanosecond => "nanoseconds",
        })
    }
}

/// Seconds since 1970 from 2001 on: nothing else that is counted in seconds is as large.
const EPOCH_S: std::ops::Range<f64> = 1e9..4.1e9;

impl Unit {
    /// That in which one is `factor` seconds.
    pub fn of_factor(factor: f64) -> Unit {
        let same = |unit: &Decimal| (factor * unit.per_second() as f64 - 1.0).abs() < 1e-12;
        let known = Decimal::ALL.into_iter().find(same);
        known.map_or(Unit::Other(factor), Unit::Decimal)
    }

    /// The unit of stamps that begin with `first` and are `step` apart, at a rate near `rate_hz` if that is known.
    ///
    /// By the size of an epoch; by the rate; else by the step: below 1 it is seconds, as clocks of other units count whole numbers,
    /// and the others are what makes the rate one from 5 Hz to 5 kHz.
    pub fn recognise(first: f64, step: f64, rate_hz: Option<f64>) -> Decimal {
        let epoch = |unit: &Decimal| EPOCH_S.contains(&(first / unit.per_second() as f64));
        if let Some(unit) = Decimal::ALL.into_iter().find(epoch) {
            return unit;
        }
        if let Some(rate) = rate_hz {
            let off = |unit: &Decimal| (unit.per_second() as f64 / step / rate).ln().abs();
            let nearest = Decimal::ALL
                .into_iter()
                .min_by(|a, b| off(a).total_cmp(&off(b)));
            return nearest.unwrap_or(Decimal::Second);
        }
        match step {
            ..1.0 => Decimal::Second,
            1.0..200.0 => Decimal::Millisecond,
            200.0..2e5 => Decimal::Microsecond,
            _ => Decimal::Nanosecond,
        }
    }

    /// `value` of it in s. Divided and not multiplied, so that 41 ms are the double nearest to 0.041.
    pub fn seconds(self, value: f64) -> f64 {
        match self {
            Unit::Decimal(unit) => value / unit.per_second() as f64,
            Unit::Other(factor) => value * factor,
        }
    }

    /// The instant `seconds` in it, as a whole number.
    pub fn whole(self, seconds: i64) -> i64 {
        match self {
            Unit::Decimal(unit) => seconds.saturating_mul(unit.per_second()),
            Unit::Other(factor) => (seconds as f64 / factor) as i64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stamp_keeps_what_a_double_loses() {
        let stamp = |text: &str| Stamp::in_cell(text.as_bytes(), text.parse().unwrap());
        let epoch = stamp("1403636579763555584").since(1_403_636_579_000_000_000);
        assert_eq!(epoch, 763_555_584.0);
        let epoch = stamp("1403636579.763555584").since(1_403_636_579);
        assert_eq!(epoch, 0.763_555_584);
        assert_eq!(stamp("-2.5").since(-1), -1.5);
        assert_eq!(stamp("2.984e-2").since(0), 0.02984);
        assert_eq!(stamp("1.5e3").since(1000), 500.0);
    }

    #[test]
    fn units_are_told_by_an_epoch_the_rate_or_the_step() {
        use Decimal::*;
        for (first, step, rate, unit) in [
            (1.7e9, 0.005, None, Second),
            (1.7e12, 5.0, None, Millisecond),
            (1.7e15, 5e3, None, Microsecond),
            (1.7e18, 5e6, None, Nanosecond),
            (0.0, 0.01, None, Second),
            (12.0, 10.2, None, Millisecond),
            (12.0, 5000.0, None, Microsecond),
            (12.0, 2.5e6, None, Nanosecond),
            (0.0, 1.0, Some(1.0), Second),
            (0.0, 100.0, Some(10_000.0), Microsecond),
        ] {
            assert_eq!(Unit::recognise(first, step, rate), unit, "{first} {step}");
        }
        assert_eq!(Unit::of_factor(0.001), Unit::Decimal(Millisecond));
        assert_eq!(Unit::of_factor(3.05e-5), Unit::Other(3.05e-5));
    }
}
