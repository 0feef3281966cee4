//! What the name of a column means: by the words that loggers use, each with who writes it.

use super::Decimal;

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
    /// An axis of the sensor that the file is named after.
    Axis(usize),
    /// A thermometer.
    Temperature,
    /// Number or label of a dwell.
    Step,
    /// A running number. It is no time: a logger may count from any rate.
    Counter,
    /// A known input of a table, by the recording's own name.
    Reference(&'static str),
    /// Something else that loggers write: a magnetometer, an attitude, a force without gravity.
    Other,
}

/// Words of a gyro. A name is cut into words at capitals, digits and signs, and joined again without its axis: `GyroX(dps)`, `Gyr_X`,
/// `angular_velocity.x` are `gyro`, `gyr` and `angularvelocity`.
const GYRO: [&str; 35] = [
    "gyro",      // most
    "gyr",       // Xsens, Movella
    "gyroscope", // phyphox, Sensor Logger
    "gyrorate",
    "gyroraw",
    "rawgyro",
    "gyroadc",    // Betaflight, INAV
    "gyrounfilt", // Betaflight from 4.4 on
    "gyrodata",
    "gyroscopedata",
    "angularvelocity", // ROS
    "angvel",
    "angularrate", // VectorNav, LORD
    "angrate",
    "rotationrate", // iOS
    "rotrate",
    "rotation",
    "rate",
    "bodyrate",
    "omega",
    "turnrate",
    "imugyro",
    "imuangularvelocity",
    "uncompgyro", // VectorNav
    "deltaangle",
    "gy", // AcX, GyX: the first sketch for an MPU-6050
    "w",  // wx, ADI's and many papers' names
    "g",  // gx: InvenSense's examples
    "gr",
    "wrss", // EuRoC: w_RS_S_x
    "giro", // Portuguese, Spanish, Italian
    "giros",
    "giroscopio",
    "drehrate", // German
    "gyroskop",
];
/// Words of an accelerometer.
const ACCEL: [&str; 37] = [
    "accel",
    "acc",                // Xsens, Movella
    "accelerometer",      // phyphox, Sensor Logger
    "acceleration",       // phyphox
    "linearacceleration", // ROS: with gravity, despite its name
    "accelraw",
    "rawaccel",
    "accraw",
    "accsmooth", // Betaflight, INAV
    "acceldata",
    "accdata",
    "specificforce",
    "sf",
    "force",
    "imuaccel",
    "imuacc",
    "imuacceleration",
    "imulinearacceleration",
    "bodyaccel",
    "uncompaccel",                  // VectorNav
    "accelerationincludinggravity", // browsers
    "totalacc",
    "ac", // AcX, GyX: the first sketch for an MPU-6050
    "a",  // ax: InvenSense's examples
    "f",
    "acl",
    "xl", // ST
    "deltavelocity",
    "accelrate",
    "arss", // EuRoC: a_RS_S_x
    "acel", // Portuguese, Spanish
    "aceleracao",
    "aceleração",
    "aceleracion",
    "aceleración",
    "acelerometro",
    "beschleunigung", // German
];
/// What is neither, though it may contain a word of one: magnetometers, attitudes, forces without gravity, satellites, motors.
const OTHER: [&str; 40] = [
    "mag",
    "quat",
    "orient",
    "euler",
    "gravity",
    "user",
    "linacc",
    "lin",
    "roll",
    "pitch",
    "yaw",
    "heading",
    "angle",
    "attitude",
    "baro",
    "press",
    "humid",
    "alt",
    "lat",
    "lon",
    "gps",
    "vel",
    "pos",
    "covariance",
    "cov",
    "variance",
    "motor",
    "servo",
    "setpoint",
    "debug",
    "volt",
    "current",
    "flag",
    "status",
    "valid",
    "accuracy",
    "bias",
    "filtered",
    "norm",
    "vector",
];
const TIME: [&str; 39] = [
    "t",
    "ts",
    "time",
    "times",
    "timestamp",
    "timestamps",
    "stamp",
    "sec",
    "secs",
    "second",
    "seconds",
    "ms",
    "us",
    "ns",
    "millis",
    "micros",
    "elapsed",
    "timeelapsed",
    "elapsedtime",
    "secondselapsed",
    "timeus",
    "timems",
    "timens",
    "sampletime",
    "sampletimefine",
    "systemtime",
    "loggingtime",
    "datetime",
    "utc",
    "clock",
    "epoch",
    "headerstamp",
    "timeusec",
    "timesec",
    "zeit",   // German
    "tempo",  // Portuguese, Italian
    "tiempo", // Spanish
    "temps",  // French
    "tijd",   // Dutch
];
const NANOSECONDS: [&str; 5] = ["nsec", "nsecs", "nanosec", "nanosecs", "nanoseconds"];
const TEMPERATURE: [&str; 9] = [
    "temp",
    "temperature",
    "tmp",
    "tempc",
    "imutemp",
    "imutemperature",
    "chiptemp",
    "dietemp",
    "sensortemp",
];
const STEP: [&str; 5] = ["step", "pose", "label", "position", "segment"];
const COUNTER: [&str; 19] = [
    "index",
    "idx",
    "sample",
    "samples",
    "counter",
    "count",
    "packetcounter",
    "packet",
    "seq",
    "sequence",
    "frame",
    "n",
    "no",
    "nr",
    "row",
    "id",
    "loopiteration",
    "iteration",
    "num",
];

/// Cuts a name into words in lower case: at signs, before capitals, around digits.
fn words(name: &str) -> Vec<String> {
    let mut words = Vec::new();
    let mut word = String::new();
    let mut before = ' ';
    let mut letters = name.chars().peekable();
    while let Some(c) = letters.next() {
        // `gyroADC`, `GyroX`, and `ACCx` in another way.
        let capital = c.is_uppercase() && before.is_lowercase();
        let last_capital = c.is_uppercase()
            && before.is_uppercase()
            && letters.peek().is_some_and(|next| next.is_lowercase());
        let digit = c.is_ascii_digit() != before.is_ascii_digit();
        let cut = !c.is_alphanumeric() || capital || last_capital || digit;
        if cut && !word.is_empty() {
            words.push(std::mem::take(&mut word));
        }
        if c.is_alphanumeric() {
            word.extend(c.to_lowercase());
        }
        before = c;
    }
    if !word.is_empty() {
        words.push(word);
    }
    words
}

/// The name without its unit: what stands in brackets, unless it is an index, and units behind it.
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
    let is_unit = |word: &&str| {
        let own = |spellings: &[&str]| spellings.contains(&word.to_lowercase().as_str());
        let named = |units: &[(&str, &[&str])]| units.iter().any(|(_, s)| own(s));
        word.contains(['/', '²', '^']) && (named(&RATES) || named(&FORCES))
    };
    let kept: Vec<&str> = bare
        .split_whitespace()
        .filter(|word| !is_unit(word))
        .collect();
    kept.join(" ")
}

/// The axis that a word is, or that it ends or begins with behind or before a sensor's word: `x`, `gx`, `xgyro`, `0`.
fn axis_of(words: &[String]) -> Option<(usize, String)> {
    let axes = ["x", "y", "z"];
    let plain = |word: &str| axes.iter().position(|a| *a == word);
    // A word of its own, from the end on.
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
    let sensor =
        |stem: &str| GYRO.contains(&stem) || ACCEL.contains(&stem) || OTHER.contains(&stem);
    let last = all.chars().next_back()?;
    let stem = &all[..all.len() - last.len_utf8()];
    if let Some(axis) = plain(&last.to_string()).filter(|_| sensor(stem)) {
        return Some((axis, stem.to_owned()));
    }
    let first = all.chars().next()?;
    let stem = &all[first.len_utf8()..];
    if let Some(axis) = plain(&first.to_string()).filter(|_| sensor(stem)) {
        return Some((axis, stem.to_owned()));
    }
    let axis = words.last().and_then(index).filter(|_| numbered)?;
    Some((axis, all))
}

/// Drops what says nothing: units, and words such as `imu`, `raw`, `sensor`, `body` and their numbers.
fn essential(mut words: Vec<String>) -> Vec<String> {
    let unit = |w: &str| {
        [
            "dps", "mdps", "rad", "mrad", "deg", "rads", "degs", "radps", "degps", "rps", "mps",
            "mps2", "ms2", "mg", "gs", "mss", "raw", "imu", "sensor", "body", "b", "data", "value",
            "val", "field", "msg",
        ]
        .contains(&w)
    };
    let index = |w: &str| w.chars().all(|c| c.is_ascii_digit());
    // The axis of `gyro_x_rad_s` stands before its unit.
    let axis = words
        .iter()
        .position(|w| ["x", "y", "z"].contains(&w.as_str()));
    if let Some(at) = axis.filter(|at| *at > 0) {
        words.truncate(at + 1);
    }
    let kept: Vec<String> = words.iter().filter(|w| !unit(w)).cloned().collect();
    let kept = if kept.is_empty() { words } else { kept };
    // `imu0.accel.x`, but `gyro[0]` and `0` stay.
    let last = kept.len().saturating_sub(1);
    let kept: Vec<String> = kept
        .into_iter()
        .enumerate()
        .filter(|(k, w)| *k == last || !index(w))
        .map(|(_, w)| w)
        .collect();
    kept
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
    let bare = without_unit(exact);
    let all = words(&bare);
    let joined = all.concat();
    let essential = essential(all.clone());
    let whole = essential.concat();
    let one_of = |list: &[&str], word: &str| list.contains(&word);
    if matches!(whole.as_str(), "p" | "q" | "r") && all.len() == 1 {
        return Meaning::Gyro(
            ["p", "q", "r"]
                .iter()
                .position(|a| *a == whole)
                .unwrap_or(0),
        );
    }
    if let Some(axis) = rate_of_an_angle(&essential) {
        return Meaning::Gyro(axis);
    }
    // `ax_g`, but `g_x` and `x_g` may be those of a gyro.
    if let [of @ .., unit] = &essential[..]
        && unit == "g"
        && let Some((axis, stem)) = axis_of(of)
        && one_of(&ACCEL, &stem)
    {
        return Meaning::Accel(axis);
    }
    if let Some((axis, stem)) = axis_of(&essential) {
        if stem.is_empty() {
            return Meaning::Axis(axis);
        }
        let in_gyro = one_of(&GYRO, &stem);
        let in_accel = one_of(&ACCEL, &stem);
        if in_gyro != in_accel {
            return if in_gyro {
                Meaning::Gyro(axis)
            } else {
                Meaning::Accel(axis)
            };
        }
        // A longer name that begins or ends with a sensor's word. What is left of it may say that it is something else: `userAcceleration`.
        let rest_of = |list: &[&str]| {
            let long = list.iter().filter(|w| w.len() > 2);
            let mut rests = long.filter_map(|w| stem.strip_suffix(*w).or(stem.strip_prefix(*w)));
            rests.next().map(str::to_owned)
        };
        let is_other = |rest: &str| OTHER.iter().any(|word| rest.contains(word));
        return match (rest_of(&GYRO), rest_of(&ACCEL)) {
            (Some(rest), None) if !is_other(&rest) => Meaning::Gyro(axis),
            (None, Some(rest)) if !is_other(&rest) => Meaning::Accel(axis),
            _ => Meaning::Other,
        };
    }
    let last = essential.last().map_or("", String::as_str);
    if NANOSECONDS.contains(&last) {
        return Meaning::Nanoseconds;
    }
    if one_of(&STEP, &whole) {
        return Meaning::Step;
    }
    if TEMPERATURE.contains(&whole.as_str()) || ["temp", "temperature", "tmp"].contains(&last) {
        return Meaning::Temperature;
    }
    if one_of(&COUNTER, &whole) {
        return Meaning::Counter;
    }
    let time = TIME.contains(&whole.as_str())
        || TIME.contains(&joined.as_str())
        || is_short_time(&all)
        || essential
            .iter()
            .any(|w| w.len() > 2 && TIME.contains(&w.as_str()));
    match time {
        true => Meaning::Time,
        false => Meaning::Other,
    }
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

/// The axis of a rate that is named after its angle: `roll_rate`, MAVLink's `pitchspeed`.
fn rate_of_an_angle(words: &[String]) -> Option<usize> {
    const RATE: [&str; 8] = [
        "rate",
        "rates",
        "speed",
        "dot",
        "vel",
        "velocity",
        "angularrate",
        "gyro",
    ];
    let joined = words.concat();
    let rest = |angle: &&str| joined.strip_prefix(*angle).or(joined.strip_suffix(*angle));
    let is_rate = |angle: &&str| rest(angle).is_some_and(|rest| RATE.contains(&rest));
    ["roll", "pitch", "yaw"].iter().position(is_rate)
}

/// Letters before an axis that mean no inertial sensor: magnetometer, quaternion, velocity, position, attitude, field.
const OTHER_LETTERS: [&str; 9] = ["m", "q", "v", "p", "h", "b", "e", "u", "n"];

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
                || OTHER_LETTERS.contains(&stem.as_str())
                || is_other(&stem)
                || meaning(&names[first]) != Meaning::Other;
            if let (false, Some(y), Some(z)) = (known, on('y'), on('z')) {
                return Some(([first, y, z], stem));
            }
        }
    }
    None
}

/// `t_ms`, `ts [us]`: a letter or two with a unit of time.
fn is_short_time(words: &[String]) -> bool {
    let units = ["s", "ms", "us", "ns", "sec"];
    matches!(words, [first, rest @ ..] if ["t", "ts"].contains(&first.as_str()) && rest.iter().all(|w| units.contains(&w.as_str())))
}

/// Spellings of the units of a gyro, of an accelerometer and of time, the longer ones first. They count only as words of their own.
const RATES: [(&str, &[&str]); 3] = [
    ("mdeg/s", &["mdps", "mdeg/s", "mdegs", "m°/s", "millidps"]),
    (
        "deg/s",
        &[
            "deg/s",
            "dps",
            "°/s",
            "deg_s",
            "degs",
            "degps",
            "deg/sec",
            "degpersec",
            "degrees/s",
            "degree/s",
            "º/s",
            "deg s-1",
            "degrees_per_second",
            "deg_per_s",
            "deg.s-1",
        ],
    ),
    (
        "rad/s",
        &[
            "rad/s",
            "radps",
            "rads",
            "rad_s",
            "rad/sec",
            "radians/s",
            "rps",
            "rad s-1",
            "rad s^-1",
            "rad.s-1",
            "radians_per_second",
            "rad_per_s",
            "1/s",
            "rad*s^-1",
        ],
    ),
];
const FORCES: [(&str, &[&str]); 3] = [
    ("mg", &["mg", "milli-g", "millig", "mgal"]),
    (
        "m/s²",
        &[
            "m/s2",
            "m/s^2",
            "m/s²",
            "m/s/s",
            "mps2",
            "ms2",
            "m_s2",
            "m.s-2",
            "m/s**2",
            "mss",
            "m s-2",
            "m s^-2",
            "m/sec^2",
            "m/s^-2",
            "meters_per_second_squared",
            "ms-2",
        ],
    ),
    ("g", &["g", "gs", "g's", "gravity", "gees"]),
];
const CLOCKS: [(Decimal, &[&str]); 4] = [
    (
        Decimal::Nanosecond,
        &["ns", "nsec", "nanoseconds", "nanosec", "nanos"],
    ),
    (
        Decimal::Microsecond,
        &["us", "µs", "μs", "usec", "microseconds", "micros", "timeus"],
    ),
    (
        Decimal::Millisecond,
        &["ms", "msec", "milliseconds", "millis"],
    ),
    (Decimal::Second, &["s", "sec", "secs", "second", "seconds"]),
];

/// Fields of `sensor_msgs/Imu` of ROS, which are in rad/s and m/s² by definition.
const ROS: [&str; 2] = ["angular_velocity", "linear_acceleration"];

/// Whether `text` has one of the spellings as a word of its own.
fn spelled(text: &str, spellings: &[&str]) -> bool {
    let text = text.to_lowercase();
    let part = |c: Option<char>| {
        c.is_some_and(|c| c.is_alphanumeric() || c == '/' || c == '°' || c == '^')
    };
    spellings.iter().any(|spelling| {
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

fn of<T: Copy>(text: &str, units: &[(T, &[&str])]) -> Option<T> {
    units
        .iter()
        .find(|(_, spellings)| spelled(text, spellings))
        .map(|(unit, _)| *unit)
}

/// The unit of a gyro in the names of its columns, or beside them.
pub(super) fn rate_unit(text: &str) -> Option<&'static str> {
    of(text, &RATES).or_else(|| text.contains(ROS[0]).then_some("rad/s"))
}

/// The unit of an accelerometer. A `g` of its own is a unit only in brackets or at the end: `acc_g_x` may be an accelerometer of the group g.
pub(super) fn force_unit(text: &str) -> Option<&'static str> {
    of(text, &FORCES).or_else(|| text.contains(ROS[1]).then_some("m/s²"))
}

/// The unit of time stamps whose name is one word with its unit: `ustime`, `tms`, `msecs`.
pub(super) fn clock_unit_within(name: &str) -> Option<Decimal> {
    let word = words(name).concat();
    let within = |spelling: &&str| {
        let rest = word
            .strip_prefix(*spelling)
            .or(word.strip_suffix(*spelling));
        rest.is_some_and(|rest| ["t", "s"].contains(&rest) || TIME.contains(&rest))
    };
    // A lone s may be the end of any word.
    let finer = CLOCKS.iter().filter(|(unit, _)| *unit != Decimal::Second);
    let mut found = finer.filter(|(_, spellings)| spellings.iter().any(&within));
    found.next().map(|(unit, _)| *unit)
}

/// Whether `name` contains a word of something that is neither a time nor an inertial sensor.
pub(super) fn is_other(name: &str) -> bool {
    let name = name.to_lowercase();
    OTHER.iter().any(|word| name.contains(word))
}

/// The unit of time stamps.
pub(super) fn clock_unit(text: &str) -> Option<Decimal> {
    let joined = words(text);
    of(text, &CLOCKS).or_else(|| joined.iter().find_map(|word| of(word, &CLOCKS)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_of_both_sensors_are_known_by_the_names_that_loggers_write() {
        for (name, wanted) in [
            ("ax", Meaning::Accel(0)),
            ("gz", Meaning::Gyro(2)),
            ("wx", Meaning::Gyro(0)),
            ("fy", Meaning::Accel(1)),
            ("acc_x", Meaning::Accel(0)),
            ("AccX(g)", Meaning::Accel(0)),
            ("A_X [mg]", Meaning::Accel(0)),
            ("G_Z [mdps]", Meaning::Gyro(2)),
            ("linear_acceleration.x", Meaning::Accel(0)),
            ("angular_velocity.y", Meaning::Gyro(1)),
            ("field.angular_velocity.y", Meaning::Gyro(1)),
            ("p", Meaning::Gyro(0)),
            ("q", Meaning::Gyro(1)),
            ("r", Meaning::Gyro(2)),
            ("gyroADC[0]", Meaning::Gyro(0)),
            ("accSmooth[2]", Meaning::Accel(2)),
            ("imu.gyro.x", Meaning::Gyro(0)),
            ("Gx [°/s]", Meaning::Gyro(0)),
            ("AcX", Meaning::Accel(0)),
            ("GyZ", Meaning::Gyro(2)),
            ("giro_x", Meaning::Gyro(0)),
            ("aceleración_z", Meaning::Accel(2)),
            ("Gyroscope x (rad/s)", Meaning::Gyro(0)),
            ("Acceleration z (m/s^2)", Meaning::Accel(2)),
            ("Gyr_X", Meaning::Gyro(0)),
            ("xacc", Meaning::Accel(0)),
            ("zgyro", Meaning::Gyro(2)),
            ("gyro_x_rad_s", Meaning::Gyro(0)),
            ("accel_y_mps2", Meaning::Accel(1)),
            ("IMU0.AccelX", Meaning::Accel(0)),
            ("rotationRate.x", Meaning::Gyro(0)),
            ("x-axis angular velocity", Meaning::Gyro(0)),
            ("gx1", Meaning::Gyro(0)),
            ("gyrox rad/s", Meaning::Gyro(0)),
            ("gy1", Meaning::Gyro(1)),
            ("az2", Meaning::Accel(2)),
            ("x", Meaning::Axis(0)),
            ("ACCx", Meaning::Accel(0)),
            ("gyro_x", Meaning::Gyro(0)),
            ("GYRO_Z", Meaning::Gyro(2)),
            ("Accelerometer X", Meaning::Accel(0)),
            ("omega_z", Meaning::Gyro(2)),
            ("accelerometer_m_s2[1]", Meaning::Accel(1)),
            ("gyro_rad[0]", Meaning::Gyro(0)),
            ("RawAccelY", Meaning::Accel(1)),
            ("ax(g)", Meaning::Accel(0)),
            ("gx_dps", Meaning::Gyro(0)),
            ("Gyro X (deg/s)", Meaning::Gyro(0)),
            ("w_x", Meaning::Gyro(0)),
            ("w_RS_S_x [rad s^-1]", Meaning::Gyro(0)),
            ("a_RS_S_z [m s^-2]", Meaning::Accel(2)),
            ("sensor_accel.x", Meaning::Accel(0)),
            ("ax_g", Meaning::Accel(0)),
            ("accZ_g", Meaning::Accel(2)),
            ("Ay_mg", Meaning::Accel(1)),
            ("Gz_mdps", Meaning::Gyro(2)),
            ("gx_rps", Meaning::Gyro(0)),
            ("roll_rate", Meaning::Gyro(0)),
            ("pitchspeed", Meaning::Gyro(1)),
            ("YawRate (deg/s)", Meaning::Gyro(2)),
        ] {
            assert_eq!(meaning(name), wanted, "{name}: {:?}", words(name));
        }
    }

    #[test]
    fn times_counters_thermometers_and_what_is_no_input_are_told_apart() {
        for (name, wanted) in [
            ("t", Meaning::Time),
            ("t_ms", Meaning::Time),
            ("Time (ms)", Meaning::Time),
            ("timestamp_us", Meaning::Time),
            ("SampleTimeFine", Meaning::Time),
            ("seconds_elapsed", Meaning::Time),
            ("TimeUS", Meaning::Time),
            ("#timestamp [ns]", Meaning::Time),
            ("header.stamp.sec", Meaning::Time),
            ("header.stamp.nanosec", Meaning::Nanoseconds),
            ("time", Meaning::Time),
            ("Timestamp", Meaning::Time),
            ("millis", Meaning::Time),
            ("Elapsed (s)", Meaning::Time),
            ("DateTime", Meaning::Time),
            ("PacketCounter", Meaning::Counter),
            ("index", Meaning::Counter),
            ("loopIteration", Meaning::Counter),
            ("seq", Meaning::Counter),
            ("Temperature", Meaning::Temperature),
            ("Tmp", Meaning::Temperature),
            ("imu_temp", Meaning::Temperature),
            ("Temp (°C)", Meaning::Temperature),
            ("label", Meaning::Step),
            ("step", Meaning::Step),
            ("mag_x", Meaning::Other),
            ("qw", Meaning::Other),
            ("roll", Meaning::Other),
            ("roll_rate_setpoint", Meaning::Other),
            ("Mx", Meaning::Other),
            ("orientation.x", Meaning::Other),
            ("userAcceleration.x", Meaning::Other),
            ("gravity.x", Meaning::Other),
            ("velocity_x", Meaning::Other),
            ("ref_rate_x_dps", Meaning::Reference("ref_rate_x_dps")),
            ("motor[0]", Meaning::Other),
            ("setpoint[1]", Meaning::Other),
            ("altitude", Meaning::Other),
            ("orientation_covariance[0]", Meaning::Other),
            ("angle_x", Meaning::Other),
            ("Humidity", Meaning::Other),
        ] {
            assert_eq!(meaning(name), wanted, "{name}: {:?}", words(name));
        }
    }

    #[test]
    fn a_triad_of_an_unknown_word_is_noticed() {
        let triad = |name: &str| {
            let names = ["x", "z", "y"].map(|axis| name.replace('*', axis));
            unknown_triad(&names)
        };
        for (name, stem) in [("foo_*", "foo"), ("R*", "r"), ("g*_foo", "gfoo")] {
            assert_eq!(triad(name), Some(([0, 2, 1], stem.into())), "{name}");
        }
        for name in [
            "*",
            "gyro_*",
            "mag_*",
            "M*",
            "q_*",
            "orientation.*",
            "g*_dps",
        ] {
            assert_eq!(triad(name), None, "{name}");
        }
        assert_eq!(unknown_triad(&["foo_x".into(), "foo_y".into()]), None);
    }

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
