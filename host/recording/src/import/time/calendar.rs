//! Times of day and dates in a cell, such as `15:04:23.125` and `2024-03-05T15:04:23.125+01:00`.

use super::stamp::Stamp;

const MINUTE: i64 = 60;
const HOUR: i64 = 3600;
const DAY: i64 = 86_400;

/// The time in `cell` as a stamp in s: since midnight, or with a date since 1970. `None` if it is written in another way.
pub(in super::super) fn parse(cell: &[u8]) -> Option<Stamp> {
    if !cell.contains(&b':') {
        return None;
    }
    let text = std::str::from_utf8(cell.trim_ascii()).ok()?;
    let (days, clock) = match text.split_once(['T', ' ']) {
        Some((date, clock)) => (days_since_1970(date)?, clock),
        None => (0, text),
    };
    let (clock, zone) = without_zone(clock)?;
    let (clock, decimals) = clock.split_once(['.', ',']).unwrap_or((clock, ""));
    let mut parts = clock.split(':');
    let mut next = |most: i64| whole(parts.next()?).filter(|part| (0..=most).contains(part));
    // A leap second has the number 60.
    let (hours, minutes, seconds) = (next(23)?, next(59)?, next(60)?);
    if parts.next().is_some() || !decimals.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    let whole = days * DAY + hours * HOUR + minutes * MINUTE + seconds - zone;
    Some(Stamp::in_cell(format!("{whole}.{decimals}0").as_bytes(), {
        let fraction: f64 = format!("0.{decimals}0").parse().ok()?;
        whole as f64 + fraction
    }))
}

fn whole(digits: &str) -> Option<i64> {
    let plain = !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit());
    plain.then(|| digits.parse().ok()).flatten()
}

/// A time without the zone at its end, and the zone's offset from Greenwich, s.
fn without_zone(clock: &str) -> Option<(&str, i64)> {
    if let Some(clock) = clock.strip_suffix('Z') {
        return Some((clock, 0));
    }
    let Some(at) = clock.rfind(['+', '-']) else {
        return Some((clock, 0));
    };
    let (clock, zone) = clock.split_at(at);
    let digits: String = zone[1..].chars().filter(|c| *c != ':').collect();
    let (hours, minutes) = match digits.len() {
        2 => (whole(&digits)?, 0),
        4 => (whole(&digits[..2])?, whole(&digits[2..])?),
        _ => return None,
    };
    let sign = if zone.starts_with('-') { -1 } else { 1 };
    Some((clock, sign * (hours * HOUR + minutes * MINUTE)))
}

/// Days of the Gregorian calendar from 1970-01-01 to `date`, written as year, month and day with `-` or `/`.
fn days_since_1970(date: &str) -> Option<i64> {
    let mut parts = date.split(['-', '/']);
    let mut next = || whole(parts.next()?);
    let (year, month, day) = (next()?, next()?, next()?);
    if parts.next().is_some()
        || !(1970..=9999).contains(&year)
        || !(1..=12).contains(&month)
        || !(1..=31).contains(&day)
    {
        return None;
    }
    // Years begin in March, so that the leap day is the last one; 153 days are five months from March on.
    let (year, month) = if month > 2 {
        (year, month - 3)
    } else {
        (year - 1, month + 9)
    };
    let leaps = year / 4 - year / 100 + year / 400;
    Some(365 * year + leaps + (153 * month + 2) / 5 + day - 1 - 719_468)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_and_times_are_those_of_the_calendar() {
        let seconds = |text: &str| parse(text.as_bytes()).unwrap().value;
        // By `date -u -d ... +%s.%N`.
        assert_eq!(seconds("2024-03-05T15:04:23.125Z"), 1_709_651_063.125);
        assert_eq!(seconds("2024-03-05 16:04:23,125+01:00"), 1_709_651_063.125);
        assert_eq!(seconds("2000-02-29T00:00:00"), 951_782_400.0);
        assert_eq!(seconds("1970/01/01 00:00:01"), 1.0);
        assert_eq!(seconds("2038-12-31T23:59:60Z"), 2_177_452_800.0);
        assert_eq!(seconds("15:04:23.5"), 54_263.5);
        for text in [
            "",
            "12:30",
            "1.5",
            "25:00:00",
            "12:61:00",
            "2024-13-01T00:00:00",
            "a:b:c",
        ] {
            assert!(parse(text.as_bytes()).is_none(), "{text}");
        }
    }

    #[test]
    fn nanoseconds_of_a_date_are_kept() {
        let stamp = parse(b"2024-03-05T15:04:23.123456789Z").unwrap();
        assert_eq!(stamp.since(1_709_651_063), 0.123_456_789);
    }
}
