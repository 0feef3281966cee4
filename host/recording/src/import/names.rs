//! What the name of a column means: by the words that loggers use.
//!
//! A name is cut into words at capitals, digits and signs, and joined again without its axis: `GyroX(dps)`, `Gyr_X`, `angular_velocity.x` have the stems
//! `gyro`, `gyr` and `angularvelocity`. A stem is of the sensor whose word it is, begins or ends with, unless another part of it says that it is
//! something else.

use super::name_words::{TIME, is_in, words};
use super::unit_names::{is_unit_of_time, is_unit_word, without_field_unit};
use crate::triad_name::TriadKind;

/// Meaning of a column's name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Meaning {
    /// Time stamps.
    Time,
    /// Nanoseconds beside whole seconds, as ROS writes them.
    Nanoseconds,
    /// Axis of the gyro.
    Gyro(usize),
    /// Axis of the accelerometer.
    Accel(usize),
    /// Axis of the magnetometer.
    Mag(usize),
    /// An axis of the sensor that the file is named after.
    Axis(usize),
    /// A thermometer.
    Temperature,
    /// Number or label of a dwell.
    Step,
    /// A running number. It does not give times: a logger may count at any rate.
    Counter,
    /// A known input of a table, by the recording's own name.
    Reference(&'static str),
    /// Something else that loggers write: an attitude, a force without gravity.
    Other,
}

/// Words of a gyro. Short ones only count alone: `w` is of ADI and many papers, `g` of InvenSense's examples, `gy` of the first sketch for an MPU-6050,
/// and `wrss` is EuRoC's `w_RS_S_x`.
const GYRO: &str =
    "gyro gyr giro angularvelocity angvel deltaangle rotation rate omega gy w g gr wrss";
/// Words of an accelerometer: `linearacceleration` is ROS's, with gravity despite its name, `accelerationincludinggravity` that of browsers, `xl` of ST.
const ACCEL: &str = "accel acceleration acc acel linearacceleration accelerationincludinggravity beschleunigung force \
    deltavelocity a f ac sf acl xl arss";
/// Words of a magnetometer; the short one only counts alone.
const MAG: &str = "mag magn magnet magneto magnetic magneticfield magnetometer magfield magnetfeld compass brujula bussola m";
/// What is left of a magnetometer's name if it has no reading of the field: its offsets, its errors, the field that a filter or a map predicts.
const NO_FIELD: &str =
    "offset ofs scale err error innov innovation pred predicted ref earth ned declination itude";
/// What is neither gyro nor accelerometer, though it may contain a word of one: magnetometers, attitudes, forces without gravity, satellites, motors.
const OTHER: &str = "mag quat orient euler gravity user linacc lin roll pitch yaw heading angle attitude baro press humid alt lat lon gps vel pos \
    covariance cov variance motor servo setpoint debug volt current flag status valid accuracy bias filtered norm vector";
/// Letters before an axis that mean no gyro and no accelerometer: magnetometer, quaternion, velocity, position, attitude, field.
const OTHER_LETTERS: &str = "m q v p h b e u n";
const NANOSECONDS: &str = "nsec nsecs nanosec nanosecs nanoseconds";
const TEMPERATURE: &str = "temp temperature tmp";
const STEP: &str = "step pose label position segment";
const COUNTER: &str = "index idx sample samples counter count cnt ctr packetcounter packet seq sequence frame n no nr row id loopiteration iteration num number";
/// Rates that are named after their angle: `roll_rate`, MAVLink's `pitchspeed`.
const OF_AN_ANGLE: &str = "rate rates speed dot vel velocity angularrate gyro";
/// Words that say nothing: units, and what every logger may write.
const EMPTY: &str = "dps mdps rad mrad deg rads degs radps degps rps mps mps2 ms2 mg gs mss raw imu sensor body b data value val field msg";
/// The name without its unit: the text in brackets, unless it is an index, and units behind it.
fn without_unit(name: &str) -> String {
    let mut bare = String::new();
    let mut rest = name.trim();
    while let Some(open) = rest.find(['(', '[', '{']) {
        bare.push_str(&rest[..open]);
        let inner = &rest[open + 1..];
        let close = inner.find([')', ']', '}']).unwrap_or(inner.len());
        let text = inner[..close].trim();
        if text.len() == 1
            && text
                .chars()
                .all(|c| c.is_ascii_digit() || "xyzXYZ".contains(c))
        {
            bare.push('_');
            bare.push_str(text);
        }
        rest = inner.get(close + 1..).unwrap_or_default();
    }
    bare.push_str(rest);
    // `gyrox rad/s`
    let kept: Vec<&str> = without_field_unit(&bare)
        .split_whitespace()
        .filter(|word| !is_unit_word(word))
        .collect();
    kept.join(" ")
}

/// The sensor of a stem.
fn sensor(stem: &str) -> Option<fn(usize) -> Meaning> {
    if is_in(GYRO, stem) != is_in(ACCEL, stem) {
        return Some(if is_in(GYRO, stem) {
            Meaning::Gyro
        } else {
            Meaning::Accel
        });
    }
    // A longer name that begins or ends with a sensor's word. What is left of it may say that it is something else: `userAcceleration`.
    let longest = |list: &str| {
        let long = list.split_whitespace().filter(|word| word.len() > 2);
        let rests = long.filter_map(|word| stem.strip_suffix(word).or(stem.strip_prefix(word)));
        rests.min_by_key(|rest| rest.len()).map(str::to_owned)
    };
    match (longest(GYRO), longest(ACCEL)) {
        (Some(rest), None) if !is_other(&rest) => Some(Meaning::Gyro),
        (None, Some(rest)) if !is_other(&rest) => Some(Meaning::Accel),
        // `accelRate`
        (Some(_), Some(rest)) if rest == "rate" => Some(Meaning::Accel),
        (None, None) => {
            let unlike =
                |rest: &str| is_other(rest) || NO_FIELD.split(' ').any(|w| rest.contains(w));
            let is_mag = is_in(MAG, stem) || longest(MAG).is_some_and(|rest| !unlike(&rest));
            if is_mag { Some(Meaning::Mag) } else { None }
        }
        _ => None,
    }
}

/// The axis that a word is, or that it ends or begins with behind or before a sensor's word: `x`, `gx`, `xgyro`, `0`.
fn axis_of(words: &[String]) -> Option<(usize, String)> {
    let axes = ["x", "y", "z"];
    let plain = |word: &str| axes.iter().position(|a| *a == word);
    // A separate word, from the end on.
    if let Some((at, axis)) = (0..words.len())
        .rev()
        .find_map(|k| Some((k, plain(&words[k])?)))
    {
        let mut others = words.to_vec();
        others.remove(at);
        return Some((axis, others.concat()));
    }
    // `gx`, `xgyro`, also with the number of a sensor behind them: `gx1`.
    let index = |w: &String| ["0", "1", "2"].iter().position(|i| i == w);
    let numbered = words.len() > 1 && words.last().and_then(index).is_some();
    let named = &words[..words.len() - usize::from(numbered)];
    let all = named.concat();
    // `accuracy` is no `acc` with an axis behind it.
    let in_whole = |word: &str, stem: &str| all.contains(word) && !stem.contains(word);
    let other = |stem: &str| OTHER.split_whitespace().any(|word| in_whole(word, stem));
    let known = |stem: &str| is_in(OTHER, stem) || sensor(stem).is_some() && !other(stem);
    let last = all.chars().next_back()?;
    let stem = &all[..all.len() - last.len_utf8()];
    if let Some(axis) = plain(&last.to_string()).filter(|_| known(stem)) {
        return Some((axis, stem.to_owned()));
    }
    let first = all.chars().next()?;
    let stem = &all[first.len_utf8()..];
    if let Some(axis) = plain(&first.to_string()).filter(|_| known(stem)) {
        return Some((axis, stem.to_owned()));
    }
    let axis = words.last().and_then(index).filter(|_| numbered)?;
    Some((axis, all))
}

/// Drops what says nothing, and the numbers of sensors.
fn essential(mut words: Vec<String>) -> Vec<String> {
    let index = |w: &str| w.chars().all(|c| c.is_ascii_digit());
    // The axis of `gyro_x_rad_s` stands before its unit.
    let axis = words
        .iter()
        .position(|w| ["x", "y", "z"].contains(&w.as_str()));
    if let Some(at) = axis.filter(|at| *at > 0) {
        words.truncate(at + 1);
    }
    let kept: Vec<String> = words.iter().filter(|w| !is_in(EMPTY, w)).cloned().collect();
    let kept = if kept.is_empty() { words } else { kept };
    // `imu0.accel.x`, but `gyro[0]` and `0` stay.
    let last = kept.len().saturating_sub(1);
    let kept = kept.into_iter().enumerate();
    kept.filter(|(k, w)| *k == last || !index(w))
        .map(|(_, w)| w)
        .collect()
}

/// The meaning of `name`.
pub(super) fn meaning(name: &str) -> Meaning {
    let exact = name.trim();
    if let Some(reference) = crate::columns::Column::from_name(exact)
        .filter(|_| exact.starts_with("ref_"))
        .map(|column| column.name())
    {
        return Meaning::Reference(reference);
    }
    let all = words(&without_unit(exact));
    let essential = essential(all.clone());
    let whole = essential.concat();
    if let ([_], Some(axis)) = (&all[..], ["p", "q", "r"].iter().position(|a| *a == whole)) {
        return Meaning::Gyro(axis);
    }
    if let Some(axis) = rate_of_an_angle(&essential) {
        return Meaning::Gyro(axis);
    }
    // `ax_g`, but `g_x` and `x_g` may be those of a gyro.
    if let [of @ .., unit] = &essential[..]
        && unit == "g"
        && let Some((axis, stem)) = axis_of(of)
        && is_in(ACCEL, &stem)
    {
        return Meaning::Accel(axis);
    }
    if let Some((axis, stem)) = axis_of(&essential) {
        return match stem.is_empty() {
            true => Meaning::Axis(axis),
            false => sensor(&stem).map_or(Meaning::Other, |sensor| sensor(axis)),
        };
    }
    let last = essential.last().map_or("", String::as_str);
    let is_time = |word: &String| word.len() > 2 && is_in(TIME, word);
    match whole.as_str() {
        _ if is_in(NANOSECONDS, last) => Meaning::Nanoseconds,
        whole if is_in(STEP, whole) => Meaning::Step,
        "tempc" => Meaning::Temperature,
        _ if TEMPERATURE
            .split_whitespace()
            .any(|word| last.ends_with(word)) =>
        {
            Meaning::Temperature
        }
        whole if is_in(COUNTER, whole) => Meaning::Counter,
        whole if is_in(TIME, whole) || is_in(TIME, &all.concat()) => Meaning::Time,
        _ if is_short_time(&all) || essential.iter().any(is_time) => Meaning::Time,
        _ => Meaning::Other,
    }
}

/// An axis of a triad, by the name of its column.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct AxisName {
    /// What the triad measures.
    pub kind: TriadKind,
    /// Index of the axis.
    pub axis: usize,
    /// The numbers in the name that tell one of several sensors from another: `1` of `gx1`, `0` of `imu0.accel.x`.
    pub number: String,
    /// The name without numbers. Sensors of one logger differ in nothing else.
    pub bare: String,
}

impl AxisName {
    /// By `name`; `None` if it is no axis of a known triad.
    pub fn of(name: &str) -> Option<Self> {
        let (kind, axis) = match meaning(name) {
            Meaning::Gyro(axis) => (TriadKind::Gyro, axis),
            Meaning::Accel(axis) => (TriadKind::Accel, axis),
            Meaning::Mag(axis) => (TriadKind::Mag, axis),
            _ => return None,
        };
        let is_digits = |word: &String| word.chars().all(|c| c.is_ascii_digit());
        let words = words(&without_unit(name.trim()));
        // `m_s2`, `mps2`
        let of_unit = |k: usize| k > 0 && ["s", "ms", "mps"].contains(&words[k - 1].as_str());
        let digits = (0..words.len()).filter(|k| is_digits(&words[*k]) && !of_unit(*k));
        let mut numbers: Vec<&str> = digits.map(|k| words[k].as_str()).collect();
        let bare: Vec<&str> = words
            .iter()
            .filter(|w| !is_digits(w))
            .map(String::as_str)
            .collect();
        // `gyro2[0]`: the last number is the axis.
        if axis_of(&bare.iter().map(ToString::to_string).collect::<Vec<_>>()).is_none() {
            numbers.pop();
        }
        Some(Self {
            kind,
            axis,
            number: numbers.join("."),
            bare: bare.join("."),
        })
    }
}

/// `t_ms`, `ts [us]`: a letter or two with a unit of time.
fn is_short_time(words: &[String]) -> bool {
    matches!(words, [first, rest @ ..] if ["t", "ts"].contains(&first.as_str()) && rest.iter().all(|w| is_unit_of_time(w)))
}
/// Whether `name` has the seconds of the stamp whose nanoseconds are in `nanoseconds`: `header.stamp.secs` and `header.stamp.nsecs`.
pub(super) fn are_seconds_of(name: &str, nanoseconds: &str) -> bool {
    let [name, nanoseconds] = [name, nanoseconds].map(words);
    match (name.split_last(), nanoseconds.split_last()) {
        (Some((last, of)), Some((_, stamp))) => {
            of == stamp && ["s", "sec", "secs", "second", "seconds"].contains(&last.as_str())
        }
        _ => false,
    }
}

/// The axis of a rate that is named after its angle.
fn rate_of_an_angle(words: &[String]) -> Option<usize> {
    let joined = words.concat();
    let rest = |angle: &&str| joined.strip_prefix(*angle).or(joined.strip_suffix(*angle));
    let is_rate = |angle: &&str| rest(angle).is_some_and(|rest| is_in(OF_AN_ANGLE, rest));
    ["roll", "pitch", "yaw"].iter().position(is_rate)
}

/// Three of `names` that differ in nothing but x, y and z, and mean nothing that is known: where they are, and what they have in common.
pub(super) fn unknown_triad(names: &[String]) -> Option<([usize; 3], String)> {
    let lower: Vec<String> = names.iter().map(|name| name.to_lowercase()).collect();
    for (first, name) in lower.iter().enumerate() {
        for (at, _) in name.match_indices('x') {
            let (before, behind) = (&name[..at], &name[at + 1..]);
            let on = |axis: char| {
                let other = format!("{before}{axis}{behind}");
                lower.iter().position(|name| *name == other)
            };
            let letter = |c: &char| c.is_alphabetic();
            let stem: String = before
                .chars()
                .chain(behind.chars())
                .filter(letter)
                .collect();
            let known = stem.is_empty()
                || is_in(OTHER_LETTERS, &stem)
                || is_other(&stem)
                || meaning(&names[first]) != Meaning::Other;
            if let (false, Some(y), Some(z)) = (known, on('y'), on('z')) {
                return Some(([first, y, z], stem));
            }
        }
    }
    None
}

/// Whether `name` contains a word of something that is neither a time nor an inertial sensor.
pub(super) fn is_other(name: &str) -> bool {
    let name = name.to_lowercase();
    OTHER.split_whitespace().any(|word| name.contains(word))
}

/// Whether a word of `name` is one of a running number.
pub(super) fn is_number(name: &str) -> bool {
    words(name).iter().any(|word| is_in(COUNTER, word))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_of_both_sensors_are_known_by_the_names_that_loggers_write() {
        for (wanted, names) in [
            (
                Meaning::Accel(0),
                "ax|acc_x|AccX(g)|A_X [mg]|linear_acceleration.x|AcX|xacc|IMU0.AccelX|ACCx|Accelerometer X|ax(g)|sensor_accel.x|ax_g",
            ),
            (
                Meaning::Gyro(2),
                "gz|G_Z [mdps]|r|GyZ|zgyro|GYRO_Z|omega_z|Gz_mdps|YawRate (deg/s)",
            ),
            (
                Meaning::Gyro(0),
                "wx|p|gyroADC[0]|imu.gyro.x|Gx [°/s]|giro_x|Gyroscope x (rad/s)|Gyr_X|gyro_x_rad_s|rotationRate.x|x-axis angular velocity|gx1|gyrox rad/s|angularvelocityx|gyro_x|gyro_rad[0]|gx_dps|Gyro X (deg/s)|w_x|w_RS_S_x [rad s^-1]|gx_rps|roll_rate",
            ),
            (
                Meaning::Accel(1),
                "fy|accel_y_mps2|accelerometer_m_s2[1]|RawAccelY|Ay_mg",
            ),
            (
                Meaning::Gyro(1),
                "angular_velocity.y|field.angular_velocity.y|q|gy1|pitchspeed",
            ),
            (
                Meaning::Accel(2),
                "accSmooth[2]|aceleración_z|Acceleration z (m/s^2)|imulinearaccelerationz|az2|a_RS_S_z [m s^-2]|accZ_g",
            ),
            (Meaning::Axis(0), "x"),
            (
                Meaning::Mag(0),
                "mag_x|magX|Mx|Magnetic field x (µT)|mx_uT|magn_x [mG]|mag2_x",
            ),
            (Meaning::Mag(1), "my|MagnetometerY|magADC[1]|compass_y"),
            (Meaning::Mag(2), "Mag_Z|magnetic_field.z"),
        ] {
            for name in names.split('|') {
                assert_eq!(meaning(name), wanted, "{name}: {:?}", words(name));
            }
        }
    }

    #[test]
    fn times_counters_thermometers_and_what_is_no_input_are_told_apart() {
        for (wanted, names) in [
            (
                Meaning::Time,
                "t|t_ms|Time (ms)|timestamp_us|SampleTimeFine|seconds_elapsed|TimeUS|#timestamp [ns]|header.stamp.sec|time|Timestamp|millis|Elapsed (s)|DateTime",
            ),
            (Meaning::Nanoseconds, "header.stamp.nanosec"),
            (Meaning::Counter, "PacketCounter|index|loopIteration|seq"),
            (Meaning::Temperature, "Temperature|Tmp|imu_temp|Temp (°C)"),
            (Meaning::Step, "label|step"),
            (
                Meaning::Other,
                "mag_offset_x|mag_bias_y|magnitude|qw|roll|roll_rate_setpoint|orientation.x|userAcceleration.x|gravity.x|velocity_x|motor[0]|setpoint[1]|altitude|orientation_covariance[0]|angle_x|accuracy|Humidity",
            ),
            (Meaning::Reference("ref_rate_x_dps"), "ref_rate_x_dps"),
        ] {
            for name in names.split('|') {
                assert_eq!(meaning(name), wanted, "{name}: {:?}", words(name));
            }
        }
    }

    #[test]
    fn numbers_of_sensors_are_told_from_axes_and_units() {
        for (name, number, bare) in [
            ("gx1", "1", "gx"),
            ("gx", "", "gx"),
            ("imu0.accel.x", "0", "imu.accel.x"),
            ("gyro2[0]", "2", "gyro"),
            ("gyroADC[1]", "", "gyro.adc"),
            ("accel2_x_m_s2", "2", "accel.x.m.s"),
            ("accel_y_mps2", "", "accel.y.mps"),
            ("Gyro X 2 (deg/s)", "2", "gyro.x"),
            ("mag3_z", "3", "mag.z"),
        ] {
            let axis = AxisName::of(name).unwrap();
            assert_eq!(
                (axis.number.as_str(), axis.bare.as_str()),
                (number, bare),
                "{name}"
            );
        }
        assert_eq!(AxisName::of("temp2"), None);
    }
}
