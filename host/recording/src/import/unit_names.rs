//! Spellings of units in the names of columns, or beside them.

use super::decimal::Decimal;
use super::name_words::{TIME, is_in, words};

/// Spellings of the units of a gyro, of an accelerometer and of time, the longer ones first. They count only as words of their own.
const RATES: [(&str, &str); 3] = [
    ("mdeg/s", "mdps|mdeg/s|mdegs|m°/s|millidps"),
    (
        "deg/s",
        "deg/s|dps|°/s|deg_s|degs|degps|deg/sec|degpersec|degrees/s|degree/s|º/s|deg s-1|degrees_per_second|deg_per_s|deg.s-1",
    ),
    (
        "rad/s",
        "rad/s|radps|rads|rad_s|rad/sec|radians/s|rps|rad s-1|rad s^-1|rad.s-1|radians_per_second|rad_per_s|1/s|rad*s^-1",
    ),
];
const FORCES: [(&str, &str); 3] = [
    ("mg", "mg|milli-g|millig|mgal"),
    (
        "m/s²",
        "m/s2|m/s^2|m/s²|m/s/s|mps2|ms2|m_s2|m.s-2|m/s**2|mss|m s-2|m s^-2|m/sec^2|m/s^-2|meters_per_second_squared|ms-2",
    ),
    ("g", "g|gs|g's|gravity|gees"),
];
/// Units of a magnetometer. Only names of its columns are searched for them, so small letters do for all.
const FIELDS: [(&str, &str); 6] = [
    ("µT", "ut|µt|μt|microtesla|micro-tesla|microteslas"),
    ("nT", "nt|nanotesla"),
    ("mG", "mg|mgauss|milligauss|mgs|mga"),
    ("mT", "mt|millitesla"),
    ("gauss", "gauss|ga"),
    ("T", "tesla"),
];
const CLOCKS: [(Decimal, &str); 4] = [
    (Decimal::Nanosecond, "ns|nsec|nanoseconds|nanosec|nanos"),
    (
        Decimal::Microsecond,
        "us|µs|μs|usec|microseconds|micros|timeus",
    ),
    (Decimal::Millisecond, "ms|msec|milliseconds|millis"),
    (Decimal::Second, "s|sec|secs|second|seconds"),
];

/// Fields of `sensor_msgs/Imu` of ROS, which are in rad/s and m/s² by definition.
const ROS: [&str; 2] = ["angular_velocity", "linear_acceleration"];

fn is_spelling(spellings: &str, word: &str) -> bool {
    spellings.split('|').any(|spelling| spelling == word)
}

/// Whether a word is a unit of readings that cannot be part of a name, as in `gyrox rad/s`.
pub(super) fn is_unit_word(word: &str) -> bool {
    let mut units = RATES.iter().chain(&FORCES);
    word.contains(['/', '²', '^']) && units.any(|(_, s)| is_spelling(s, &word.to_lowercase()))
}

/// Whether a word behind a short name of a time is its unit.
pub(super) fn is_unit_of_time(word: &str) -> bool {
    ["s", "ms", "us", "ns", "sec"].contains(&word)
}

/// Whether `text` has one of the spellings as a separate word.
fn spelled(text: &str, spellings: &str) -> bool {
    let text = text.to_lowercase();
    let part = |c: Option<char>| {
        c.is_some_and(|c| c.is_alphanumeric() || c == '/' || c == '°' || c == '^')
    };
    spellings.split('|').any(|spelling| {
        text.match_indices(spelling).any(|(at, found)| {
            let before = text[..at].chars().next_back();
            let after = text[at + found.len()..].chars().next();
            // `(0.1 deg/s)` is a tenth of this unit.
            let number = text[..at]
                .trim_end()
                .ends_with(|c: char| c.is_ascii_digit());
            !part(before) && !part(after) && !number
        })
    })
}

fn of<T: Copy>(text: &str, units: &[(T, &str)]) -> Option<T> {
    let found = units.iter().find(|(_, spellings)| spelled(text, spellings));
    found.map(|(unit, _)| *unit)
}

/// The unit of a gyro in the names of its columns, or beside them.
pub(super) fn rate_unit(text: &str) -> Option<&'static str> {
    of(text, &RATES).or_else(|| text.contains(ROS[0]).then_some("rad/s"))
}

/// The unit of an accelerometer. A separate `g` is a unit only in brackets or at the end: `acc_g_x` may be an accelerometer of the group g.
pub(super) fn force_unit(text: &str) -> Option<&'static str> {
    of(text, &FORCES).or_else(|| text.contains(ROS[1]).then_some("m/s²"))
}

/// The unit of a magnetometer. A separate `G` or `T` is one only in brackets or at the end.
pub(super) fn field_unit(text: &str) -> Option<&'static str> {
    let end = text.trim_end().trim_end_matches([')', ']']);
    let mut last = end.chars().rev();
    let letter = match (last.next(), last.next()) {
        (Some(_), Some(before)) if before.is_alphanumeric() => None,
        (Some('G'), _) => Some("gauss"),
        (Some('T'), _) => Some("T"),
        _ => None,
    };
    of(text, &FIELDS).or(letter)
}

/// Size of a unit of a magnetometer, µT.
pub(super) fn microtesla(unit: &str) -> Option<f64> {
    Some(match unit {
        "µT" => 1.0,
        "nT" => 1e-3,
        "mG" => 0.1,
        "mT" => 1e3,
        "gauss" => 100.0,
        "T" => 1e6,
        _ => return None,
    })
}

/// A name without the unit of a field at its end: `mx_uT`, `magX mG`.
pub(super) fn without_field_unit(name: &str) -> &str {
    let bare = name.rsplit_once(['_', ' ']);
    match bare.filter(|(_, unit)| ["uT", "µT", "μT", "nT", "mG", "mT"].contains(unit)) {
        Some((bare, _)) => bare,
        None => name,
    }
}

/// The unit of time stamps.
pub(super) fn clock_unit(text: &str) -> Option<Decimal> {
    of(text, &CLOCKS).or_else(|| words(text).iter().find_map(|word| of(word, &CLOCKS)))
}

/// The unit of time stamps that the name of their column ends with, as `timestamp_us` and `time [ms]` do.
pub(super) fn clock_unit_behind(name: &str) -> Option<Decimal> {
    let mut words = name.split(|c: char| !c.is_alphabetic());
    let last = words.rfind(|word| !word.is_empty())?;
    let own = CLOCKS
        .iter()
        .find(|(_, spellings)| is_spelling(spellings, last));
    own.map(|(unit, _)| *unit)
}

/// The unit of time stamps whose name is one word with its unit: `ustime`, `tms`, `msecs`.
pub(super) fn clock_unit_within(name: &str) -> Option<Decimal> {
    let word = words(name).concat();
    let within = |spelling: &str| {
        let rest = word.strip_prefix(spelling).or(word.strip_suffix(spelling));
        rest.is_some_and(|rest| ["t", "s"].contains(&rest) || is_in(TIME, rest))
    };
    // A lone s may be the end of any word.
    let finer = CLOCKS.iter().filter(|(unit, _)| *unit != Decimal::Second);
    let mut found = finer.filter(|(_, spellings)| spellings.split('|').any(within));
    found.next().map(|(unit, _)| *unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_read_as_words_of_their_own() {
        for (text, unit) in [
            ("Gx [°/s]", Some("deg/s")),
            ("gyro_x_rad_s", Some("rad/s")),
            ("G_X [mdps]", Some("mdeg/s")),
            ("gx_dps", Some("deg/s")),
            ("gyro", None),
            ("w_x [rad/s]", Some("rad/s")),
            ("AngularRate(degrees/s)", Some("deg/s")),
            // A tenth of a unit is another one.
            ("gyroscope x (0.1 deg/s)", None),
        ] {
            assert_eq!(rate_unit(text), unit, "{text}");
        }
        for (text, unit) in [
            ("A_X [mg]", Some("mg")),
            ("AccX(g)", Some("g")),
            ("ax (m/s^2)", Some("m/s²")),
            ("accel_y_mps2", Some("m/s²")),
            ("mag", None),
            ("ax", None),
        ] {
            assert_eq!(force_unit(text), unit, "{text}");
        }
        for (text, unit) in [
            ("Magnetic field x (µT)", Some("µT")),
            ("mag_x_uT", Some("µT")),
            ("Mx [mG]", Some("mG")),
            ("mag_x (T)", Some("T")),
            ("MagX [G]", Some("gauss")),
            ("magX", None),
            ("m_T_x", None),
        ] {
            assert_eq!(field_unit(text), unit, "{text}");
        }
        for (text, unit) in [
            ("Time (ms)", Some(Decimal::Millisecond)),
            ("timestamp_us", Some(Decimal::Microsecond)),
            ("#timestamp [ns]", Some(Decimal::Nanosecond)),
            ("t_s", Some(Decimal::Second)),
            ("TimeUS", Some(Decimal::Microsecond)),
            ("time", None),
            ("seconds_elapsed", Some(Decimal::Second)),
        ] {
            assert_eq!(clock_unit(text), unit, "{text}");
        }
    }
}
