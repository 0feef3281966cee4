//! Spellings of units in the names of columns, or beside them.

use super::decimal::Decimal;
use super::name_words::{TIME, is_in, words};
use crate::triad_name::TriadKind;
use crate::units::STANDARD_GRAVITY;

/// A unit of readings.
pub(super) struct UnitName {
    pub symbol: &'static str,
    /// What is measured in it.
    pub kind: TriadKind,
    /// Its size in rad/s, m/s² or µT.
    pub size: f64,
    /// How it is written in names of columns, in small letters, the longer ones first. They count only as separate words.
    spellings: &'static str,
}

const fn unit(
    symbol: &'static str,
    kind: TriadKind,
    size: f64,
    spellings: &'static str,
) -> UnitName {
    UnitName {
        symbol,
        kind,
        size,
        spellings,
    }
}

const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// Units of readings.
#[rustfmt::skip]
const UNITS: [UnitName; 12] = [
    unit("mdeg/s", TriadKind::Gyro, 1e-3 * DEGREE, "mdps|mdeg/s|mdegs|m°/s|millidps"),
    unit("deg/s", TriadKind::Gyro, DEGREE,
        "deg/s|dps|°/s|deg_s|degs|degps|deg/sec|degpersec|degrees/s|degree/s|º/s|deg s-1|degrees_per_second|deg_per_s|deg.s-1"),
    unit("rad/s", TriadKind::Gyro, 1.0,
        "rad/s|radps|rads|rad_s|rad/sec|radians/s|rps|rad s-1|rad s^-1|rad.s-1|radians_per_second|rad_per_s|1/s|rad*s^-1"),
    unit("mg", TriadKind::Accel, 1e-3 * STANDARD_GRAVITY, "mg|milli-g|millig|mgal"),
    unit("m/s²", TriadKind::Accel, 1.0,
        "m/s2|m/s^2|m/s²|m/s/s|mps2|ms2|m_s2|m.s-2|m/s**2|mss|m s-2|m s^-2|m/sec^2|m/s^-2|meters_per_second_squared|ms-2"),
    unit("g", TriadKind::Accel, STANDARD_GRAVITY, "g|gs|g's|gravity|gees"),
    unit("µT", TriadKind::Mag, 1.0, "ut|µt|μt|microtesla|micro-tesla|microteslas"),
    unit("nT", TriadKind::Mag, 1e-3, "nt|nanotesla"),
    unit("mG", TriadKind::Mag, 0.1, "mg|mgauss|milligauss|mgs|mga"),
    unit("mT", TriadKind::Mag, 1e3, "mt|millitesla"),
    unit("gauss", TriadKind::Mag, 100.0, "gauss|ga"),
    unit("T", TriadKind::Mag, 1e6, "tesla"),
];

/// The unit with this symbol, if it has a size.
pub(super) fn unit_of(symbol: &str) -> Option<&'static UnitName> {
    UNITS.iter().find(|unit| unit.symbol == symbol)
}

/// The unit of a gyro or an accelerometer that a person writes like this.
pub(super) fn unit_written(text: &str) -> Option<&'static UnitName> {
    let mut units = UNITS.iter().filter(|unit| unit.kind != TriadKind::Mag);
    units.find(|unit| unit.symbol == text || is_spelling(unit.spellings, text))
}

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
    word.contains(['/', '²', '^']) && unit_written(&word.to_lowercase()).is_some()
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

fn of_kind(text: &str, kind: TriadKind) -> Option<&'static str> {
    let mut units = UNITS.iter().filter(|unit| unit.kind == kind);
    units
        .find(|unit| spelled(text, unit.spellings))
        .map(|unit| unit.symbol)
}

/// The unit of a gyro in the names of its columns, or beside them.
pub(super) fn rate_unit(text: &str) -> Option<&'static str> {
    of_kind(text, TriadKind::Gyro).or_else(|| text.contains(ROS[0]).then_some("rad/s"))
}

/// The unit of an accelerometer. A separate `g` is a unit only in brackets or at the end: `acc_g_x` may be an accelerometer of the group g.
pub(super) fn force_unit(text: &str) -> Option<&'static str> {
    of_kind(text, TriadKind::Accel).or_else(|| text.contains(ROS[1]).then_some("m/s²"))
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
    of_kind(text, TriadKind::Mag).or(letter)
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
        let all = |texts: &'static str| texts.split('|');
        for (unit, texts) in [
            (Some("deg/s"), "Gx [°/s]|gx_dps|AngularRate(degrees/s)"),
            (Some("rad/s"), "gyro_x_rad_s|w_x [rad/s]"),
            (Some("mdeg/s"), "G_X [mdps]"),
            // A tenth of a unit is another one.
            (None, "gyro|gyroscope x (0.1 deg/s)"),
        ] {
            all(texts).for_each(|text| assert_eq!(rate_unit(text), unit, "{text}"));
        }
        for (unit, texts) in [
            (Some("mg"), "A_X [mg]"),
            (Some("g"), "AccX(g)"),
            (Some("m/s²"), "ax (m/s^2)|accel_y_mps2"),
            (None, "mag|ax"),
        ] {
            all(texts).for_each(|text| assert_eq!(force_unit(text), unit, "{text}"));
        }
        for (unit, texts) in [
            (Some("µT"), "Magnetic field x (µT)|mag_x_uT"),
            (Some("mG"), "Mx [mG]"),
            (Some("T"), "mag_x (T)"),
            (Some("gauss"), "MagX [G]"),
            (None, "magX|m_T_x"),
        ] {
            all(texts).for_each(|text| assert_eq!(field_unit(text), unit, "{text}"));
        }
        for (unit, texts) in [
            (Some(Decimal::Millisecond), "Time (ms)"),
            (Some(Decimal::Microsecond), "timestamp_us|TimeUS"),
            (Some(Decimal::Nanosecond), "#timestamp [ns]"),
            (Some(Decimal::Second), "t_s|seconds_elapsed"),
            (None, "time"),
        ] {
            all(texts).for_each(|text| assert_eq!(clock_unit(text), unit, "{text}"));
        }
    }
}
