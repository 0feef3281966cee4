//! Time stamps of a file, and their unit.

use super::super::decimal::Decimal;
use super::super::unit_names::clock_unit_behind;

/// A time stamp in the unit of its file.
///
/// Stored as a double and also split at the decimal point: a double would round nanoseconds since 1970 to 256 ns, and seconds since then with nine
/// decimals do not fit either.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in super::super) struct Stamp {
    /// As a double, NaN if there is none.
    pub value: f64,
    /// Whole part, towards zero.
    whole: i64,
    /// Fractional part, with the same sign.
    fraction: f64,
}

impl Default for Stamp {
    fn default() -> Self {
        Self::from(f64::NAN)
    }
}

impl From<f64> for Stamp {
    fn from(value: f64) -> Self {
        // A cast saturates; values beyond its range are refused elsewhere.
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
    /// The stamp in a cell whose number is `value`.
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
        // Eighteen decimals fit, and are more than a double distinguishes.
        let decimals = &decimals[..decimals.len().min(18)];
        let scale = 10_f64.powi(decimals.len() as i32);
        Self {
            value,
            whole: sign * whole,
            fraction: sign as f64 * (decimals.iter().fold(0, digit) as f64 / scale),
        }
    }

    /// The stamp in s with these nanoseconds.
    pub fn with_nanoseconds(self, nanoseconds: f64) -> Self {
        Self {
            value: self.value + 1e-9 * nanoseconds,
            fraction: self.fraction + 1e-9 * nanoseconds,
            ..self
        }
    }

    /// Time since `origin`, in the unit of the stamp; the stamp itself if `origin` is 0.
    pub fn since(&self, origin: i64) -> f64 {
        match origin {
            0 => self.value,
            _ => self.whole.saturating_sub(origin) as f64 + self.fraction,
        }
    }

    /// The stamp `whole` later.
    pub fn plus(self, whole: i64) -> Self {
        match whole {
            0 => self,
            _ => Self {
                value: self.value + whole as f64,
                whole: self.whole.saturating_add(whole),
                ..self
            },
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
    /// A decimal unit, in which clocks count.
    Decimal(Decimal),
    /// This many seconds, as given.
    Other(f64),
    /// Samples of a counter at this rate, Hz.
    Samples(f64),
}

/// Seconds since 1970, from 2001 on: nothing else that is counted in seconds is as large.
const EPOCH_S: std::ops::Range<f64> = 1e9..4.1e9;

/// Rates of inertial units, Hz: from the slowest topic of a flight log to a gyro at 8 kHz.
const RATES_HZ: std::ops::Range<f64> = 0.8..9000.0;

/// No log is slower than this, Hz. So 2e9 microseconds since a start, at 100 Hz, are not seconds since 1970.
const SLOWEST_HZ: f64 = 0.01;

/// Longest recording, s. Of two possible units, the coarser one is excluded if it makes the recording longer than a week.
const LONGEST_S: f64 = 7.0 * 86_400.0;

/// What is known about stamps of an unknown unit, in that unit.
#[derive(Debug, Clone, Copy, Default)]
pub(in super::super) struct Seen<'a> {
    /// The first of them.
    pub first: f64,
    /// Usual time from row to row.
    pub interval: f64,
    /// Time from the first to the last.
    pub lasts: f64,
    /// Given rate, Hz.
    pub rate_hz: Option<f64>,
    /// Name of the column in the file.
    pub name: Option<&'a str>,
}

impl Seen<'_> {
    /// What stamps show by themselves.
    pub fn of(stamps: &[f64]) -> Self {
        let mut steps: Vec<f64> = stamps.windows(2).map(|w| w[1] - w[0]).collect();
        let middle = steps.len() / 2;
        let interval =
            (!steps.is_empty()).then(|| *steps.select_nth_unstable_by(middle, f64::total_cmp).1);
        let ends = stamps.first().zip(stamps.last());
        Self {
            first: ends.map_or(0.0, |(first, _)| *first),
            interval: interval.unwrap_or_default(),
            lasts: ends.map_or(0.0, |(first, last)| last - first),
            ..Self::default()
        }
    }
}

impl Unit {
    /// The unit of `factor` seconds.
    pub fn of_factor(factor: f64) -> Unit {
        let same = |unit: &Decimal| (factor * unit.per_second() as f64 - 1.0).abs() < 1e-12;
        let known = Decimal::all().find(same);
        known.map_or(Unit::Other(factor), Unit::Decimal)
    }

    /// The unit of stamps that count from 1970, by their magnitude; `None` of others.
    pub fn of_epoch(seen: &Seen<'_>) -> Option<Decimal> {
        let rate = |unit: &Decimal| unit.per_second() as f64 / seen.interval;
        let epoch = |unit: &Decimal| {
            EPOCH_S.contains(&(seen.first / unit.per_second() as f64)) && rate(unit) > SLOWEST_HZ
        };
        let mut epochs = Decimal::all().filter(epoch);
        epochs.find(|unit| rate(unit) < RATES_HZ.end)
    }

    /// The unit of the stamps that `seen` describes, or the two possible ones, the finer one first.
    ///
    /// An epoch decides by its magnitude, else a known rate, else the unit that makes the rate plausible. Two units differ by a factor of 1000, so a
    /// log of 2 Hz in microseconds looks like one of 2 kHz in nanoseconds. Then the name of the column may decide.
    pub fn recognise(seen: &Seen<'_>) -> Result<Decimal, [Decimal; 2]> {
        if let Some(unit) = Self::of_epoch(seen) {
            return Ok(unit);
        }
        let rate = |unit: &Decimal| unit.per_second() as f64 / seen.interval;
        if let Some(rate_hz) = seen.rate_hz {
            let off = |unit: &Decimal| (rate(unit) / rate_hz).ln().abs();
            let nearest = Decimal::all().min_by(|a, b| off(a).total_cmp(&off(b)));
            return Ok(nearest.unwrap_or(Decimal::Second));
        }
        let possible = |unit: &Decimal| RATES_HZ.contains(&rate(unit));
        let all: Vec<Decimal> = Decimal::all().filter(possible).collect();
        let coarse_lasts_s = |unit: &Decimal| seen.lasts / unit.per_second() as f64;
        match all[..] {
            [unit] => Ok(unit),
            [coarse, fine] if coarse_lasts_s(&coarse) > LONGEST_S => Ok(fine),
            [coarse, fine] => {
                let named = seen.name.and_then(clock_unit_behind);
                let named = named.filter(|unit| all.contains(unit));
                named.ok_or([fine, coarse])
            }
            _ => Ok(match seen.interval {
                ..1.0 => Decimal::Second,
                1.0..200.0 => Decimal::Millisecond,
                200.0..2e5 => Decimal::Microsecond,
                _ => Decimal::Nanosecond,
            }),
        }
    }

    /// `value` in s. Division instead of multiplication makes 41 ms the double nearest to 0.041.
    pub fn seconds(self, value: f64) -> f64 {
        match self {
            Unit::Decimal(unit) => value / unit.per_second() as f64,
            Unit::Other(factor) => value * factor,
            Unit::Samples(rate_hz) => value / rate_hz,
        }
    }

    /// `seconds` in this unit, as a whole number.
    pub fn whole(self, seconds: i64) -> i64 {
        match self {
            Unit::Decimal(unit) => seconds.saturating_mul(unit.per_second()),
            Unit::Other(factor) => (seconds as f64 / factor) as i64,
            Unit::Samples(rate_hz) => (seconds as f64 * rate_hz) as i64,
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

    fn seen(first: f64, interval: f64) -> Seen<'static> {
        Seen {
            first,
            interval,
            lasts: 2000.0 * interval,
            ..Seen::default()
        }
    }

    #[test]
    fn units_are_recognised_by_an_epoch_the_rate_or_the_interval() {
        use Decimal::*;
        for (first, interval, rate_hz, unit) in [
            (1.7e9, 0.005, None, Second),
            (1.7e12, 5.0, None, Millisecond),
            (1.7e12, 1.0, None, Millisecond),
            (1.7e15, 5e3, None, Microsecond),
            (1.7e15, 1e6, None, Microsecond),
            (1.7e18, 5e6, None, Nanosecond),
            (0.0, 0.01, None, Second),
            (0.0, 0.1, None, Second),
            (12.0, 10.2, None, Millisecond),
            (12.0, 100.0, None, Millisecond),
            (12.0, 5000.0, None, Microsecond),
            (12.0, 2.5e6, None, Nanosecond),
            (0.0, 1.0, Some(1.0), Second),
            (0.0, 1.0, Some(1000.0), Millisecond),
            (0.0, 100.0, Some(10_000.0), Microsecond),
            // Half an hour after the start of a microcontroller, and two seconds after that of a computer.
            (1.8e9, 10_000.0, None, Microsecond),
            (1.8e9, 5e6, None, Nanosecond),
        ] {
            let seen = Seen {
                rate_hz,
                ..seen(first, interval)
            };
            assert_eq!(Unit::recognise(&seen), Ok(unit), "{first} {interval}");
        }
        assert_eq!(Unit::of_factor(0.001), Unit::Decimal(Millisecond));
        assert_eq!(Unit::of_factor(3.05e-5), Unit::Other(3.05e-5));
    }

    #[test]
    fn two_units_remain_where_both_make_a_plausible_rate_unless_the_column_or_a_week_says_which() {
        use Decimal::*;
        for (interval, both) in [
            (1.0, [Millisecond, Second]),
            (0.5, [Millisecond, Second]),
            (500.0, [Microsecond, Millisecond]),
            (1000.0, [Microsecond, Millisecond]),
            (5e5, [Nanosecond, Microsecond]),
            (1e6, [Nanosecond, Microsecond]),
        ] {
            assert_eq!(
                Unit::recognise(&seen(97.0, interval)),
                Err(both),
                "{interval}"
            );
            for (name, unit) in [("timestamp_us", Microsecond), ("Time [ms]", Millisecond)] {
                let named = Seen {
                    name: Some(name),
                    ..seen(97.0, interval)
                };
                let known = both.contains(&unit);
                let expected = if known { Ok(unit) } else { Err(both) };
                assert_eq!(Unit::recognise(&named), expected, "{interval} {name}");
            }
            let long = Seen {
                lasts: 1e6 * interval,
                ..seen(97.0, interval)
            };
            let weeks = 1e6 * interval / both[1].per_second() as f64 > LONGEST_S;
            assert_eq!(Unit::recognise(&long).is_ok(), weeks, "{interval}");
        }
    }
}
