//! The roles of the columns of a file, by their names; without names by the readings.
//!
//! Without names, the first column that only grows is the time. Of two triads, the one with larger readings is the accelerometer, because gravity is
//! large compared with the rate of a unit at rest. This is wrong for a gyro that turns fast or has a large bias. The magnitude of its readings then
//! varies, and that of gravity hardly does.

use serde::Serialize;

use super::triads::take_further;
use crate::RAW_COLUMNS;
use crate::import::decimal::Decimal;
use crate::import::names::{Meaning, are_seconds_of, is_other, meaning};
use crate::import::unit_names::{clock_unit, clock_unit_within, field_unit, force_unit, rate_unit};
use crate::units::{Series, UnitFound, accel_unit, gyro_unit};

/// A guess for one file.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Guess {
    /// Role of each column, `-` if it is not used.
    pub roles: Vec<&'static str>,
    /// Unit of the gyro, if the names of its columns contain it.
    pub gyro_unit: Option<&'static str>,
    /// Unit of the accelerometer, if the names of its columns contain it.
    pub accel_unit: Option<&'static str>,
    /// Unit of the magnetometer, if the names of its columns contain it.
    pub mag_unit: Option<&'static str>,
    /// Unit of the time stamps, if the name of their column contains it.
    pub time_unit: Option<Decimal>,
    /// Whether the roles follow from the readings alone.
    pub by_readings: bool,
    /// Columns of a file without names that may be a magnetometer: they are offered to a person.
    #[serde(skip)]
    pub may_be_mag: Option<[usize; 3]>,
    /// Whether a column was taken for the time because it grows evenly, under whatever name.
    #[serde(skip)]
    pub grows: bool,
    /// Whether the times are dates or times of day.
    #[serde(skip)]
    pub calendar: bool,
}

/// Least variation of the magnitude of a gyro's readings in a log in which a unit turns and rests: it was 29 to 130 in five logs, and 0.02 to 0.9 of
/// their accelerometers.
const VARIES: f64 = 3.0;
/// Least ratio of the two for an exchange.
const STEADIER: f64 = 10.0;
/// Largest variation for a magnetometer: without calibration it was 0.14 to 1.15.
const FIELD_VARIES: f64 = 1.5;

/// Difference between the upper and lower tenth of the magnitudes of a triad, relative to their median.
fn variation(rows: &[Vec<f64>], at: [usize; 3]) -> Option<f64> {
    let cell = |row: &Vec<f64>, at: usize| row.get(at).copied().unwrap_or(f64::NAN);
    let sizes = rows.iter().map(|row| at.map(|k| cell(row, k)));
    let sizes = sizes.map(|[x, y, z]| x.hypot(y).hypot(z));
    let mut sizes: Vec<f64> = sizes.filter(|size| size.is_finite()).collect();
    sizes.sort_by(f64::total_cmp);
    let tenth = sizes.len() / 10;
    (tenth > 0).then(|| {
        let [low, high] = [sizes[tenth], sizes[sizes.len() - 1 - tenth]];
        (high - low) / sizes[sizes.len() / 2]
    })
}

impl Guess {
    /// Exchanges gyro and accelerometer of a file without names if only this makes gravity steady in all its `rows`, and looks for a magnetometer.
    pub(super) fn compare_magnitudes(&mut self, rows: &[Vec<f64>]) {
        let position = |role: &str| self.roles.iter().position(|own| *own == role);
        let of = |triad: [&str; 3]| match triad.map(position) {
            [Some(x), Some(y), Some(z)] => Some([x, y, z]),
            _ => None,
        };
        let (Some(gyro), Some(accel)) = (of(GYRO), of(ACCEL)) else {
            return;
        };
        let behind = gyro[2].max(accel[2]) + 1;
        if let Ok(rest) = <[usize; 3]>::try_from(Vec::from_iter(behind..self.roles.len())) {
            let field = variation(rows, rest).filter(|v| *v > 0.0 && *v < FIELD_VARIES);
            self.may_be_mag = field.map(|_| rest);
        }
        if let [Some(steady), Some(varied)] = [gyro, accel].map(|at| variation(rows, at))
            && varied > VARIES.max(STEADIER * steady)
        {
            for axis in 0..3 {
                self.roles.swap(gyro[axis], accel[axis]);
            }
        }
    }

    /// Takes the units beside the names of the columns, in a row of units, or in the names themselves.
    pub(super) fn take_named_units(&mut self, names: &[String], units: &[String]) {
        let said = |wanted: &[&str]| -> Vec<String> {
            let all = names.iter().enumerate().zip(&self.roles);
            let own = all.filter(|(_, role)| wanted.contains(*role));
            own.map(|((k, name), _)| match units.get(k) {
                Some(unit) if !unit.is_empty() => format!("{name} [{unit}]"),
                _ => name.clone(),
            })
            .collect()
        };
        let [gyro, accel, mag, time] = [&GYRO[..], &ACCEL, &MAG, &["t_s"]].map(said);
        self.gyro_unit = alike(&gyro, rate_unit);
        self.accel_unit = alike(&accel, force_unit);
        self.mag_unit = alike(&mag, field_unit);
        self.time_unit = alike(&time, clock_unit);
        if self.grows && self.time_unit.is_none() {
            self.time_unit = alike(&time, clock_unit_within);
        }
    }
}

const GYRO: [&str; 3] = ["gyro_x", "gyro_y", "gyro_z"];
const ACCEL: [&str; 3] = ["accel_x", "accel_y", "accel_z"];
pub(super) const MAG: [&str; 3] = ["mag_x", "mag_y", "mag_z"];

/// Guesses the columns of the file called `file` from these names, the units in a row of their own, and the first rows; `clock` is the column of dates or
/// times of day.
pub fn guess(
    file: &str,
    names: &[String],
    units: &[String],
    rows: &[Vec<f64>],
    clock: Option<usize>,
) -> Guess {
    let width = rows.first().map_or(names.len(), Vec::len);
    let mut guess = match names.is_empty() {
        true => by_readings(file, width, rows, clock),
        false => by_names(file, names),
    };
    let time = ["t_s", "sample"];
    if !guess.roles.iter().any(|role| time.contains(role)) {
        match clock.filter(|at| guess.roles[*at] == "-") {
            Some(at) => guess.roles[at] = "t_s",
            None => take_growing(&mut guess, names, rows),
        }
    }
    // Codes of a thermometer are not in °C, and are worse than no temperature.
    let implausible = |at: usize| {
        let values = rows.iter().filter_map(|row| row.get(at));
        let mut finite = values.filter(|t| t.is_finite());
        finite.any(|t| !(-60.0..150.0).contains(t))
    };
    let at = guess.roles.iter().position(|role| *role == "temp_c");
    if let Some(at) = at.filter(|at| implausible(*at)) {
        guess.roles[at] = "-";
        let named = |k: &usize| meaning(&names[*k]) == Meaning::Temperature;
        if let Some(other) = (0..names.len()).filter(named).find(|k| !implausible(*k)) {
            guess.roles[other] = "temp_c";
        }
    }
    guess.take_named_units(names, units);
    guess
}

/// The unit that all of `names` have.
fn alike<T: Copy + PartialEq>(names: &[String], unit: impl Fn(&str) -> Option<T>) -> Option<T> {
    let mut units = names.iter().map(|name| unit(name));
    let first = units.next()??;
    units.all(|unit| unit == Some(first)).then_some(first)
}

fn by_names(file: &str, names: &[String]) -> Guess {
    let file = file.to_lowercase();
    // The files of phones have columns x, y and z.
    let of_file = match (
        file.contains("gyr") || file.contains("rot"),
        file.contains("acc"),
    ) {
        (true, false) => Some(&GYRO),
        (false, true) => Some(&ACCEL),
        (false, false) if file.contains("mag") || file.contains("compass") => Some(&MAG),
        _ => None,
    };
    let named = |role: &str| names.iter().any(|name| name == role);
    let has_time = named("t_s") || names.iter().any(|name| meaning(name) == Meaning::Time);
    let mut roles: Vec<&'static str> = Vec::new();
    for name in names {
        let exact = RAW_COLUMNS
            .iter()
            .chain(&["t_s", "temp_c", "step", "sample", "t_ns"]);
        let role = match (exact.into_iter().find(|role| *role == name), meaning(name)) {
            (Some(role), _) => *role,
            (None, Meaning::Time) => "t_s",
            (None, Meaning::Nanoseconds) => "t_ns",
            (None, Meaning::Gyro(axis)) => GYRO[axis],
            (None, Meaning::Accel(axis)) => ACCEL[axis],
            (None, Meaning::Mag(axis)) => MAG[axis],
            (None, Meaning::Axis(axis)) => {
                // `x (m/s^2)` says it by its unit.
                let by_unit = match (rate_unit(name), force_unit(name)) {
                    (Some(_), None) => Some(&GYRO),
                    (None, Some(_)) => Some(&ACCEL),
                    _ => field_unit(name).map(|_| &MAG),
                };
                of_file.or(by_unit).map_or("-", |triad| triad[axis])
            }
            (None, Meaning::Temperature) => "temp_c",
            (None, Meaning::Step) => "step",
            (None, Meaning::Reference(role)) => role,
            (None, Meaning::Counter) if !has_time => "sample",
            (None, Meaning::Counter | Meaning::Other) => "-",
        };
        // Of two sensors or two clocks, the first is used.
        roles.push(if roles.contains(&role) { "-" } else { role });
    }
    take_further(names, &mut roles);
    // Beside them are the seconds of the same stamp: bagpy's `Time` is when the message was received.
    if let Some(at) = roles.iter().position(|role| *role == "t_ns")
        && let Some(seconds) = names
            .iter()
            .position(|name| are_seconds_of(name, &names[at]))
    {
        for role in roles.iter_mut().filter(|role| **role == "t_s") {
            *role = "-";
        }
        roles[seconds] = "t_s";
    }
    // Nanoseconds of their own, without seconds, are the whole time.
    if let Some(at) = roles.iter().position(|role| *role == "t_ns")
        && !roles.contains(&"t_s")
    {
        roles[at] = "t_s";
    }
    Guess {
        roles,
        ..Guess::default()
    }
}

/// Takes the first column for the time if it grows evenly and its name means nothing else.
fn take_growing(guess: &mut Guess, names: &[String], rows: &[Vec<f64>]) {
    let first = names.iter().position(|name| !name.is_empty());
    let Some(at) = first.filter(|at| guess.roles[*at] == "-" && !is_other(&names[*at])) else {
        return;
    };
    if grows_evenly(rows, at) {
        guess.roles[at] = "t_s";
        guess.grows = true;
    }
}

/// Whether the cells at `at` grow in every row, most of them by about the same step.
pub(super) fn grows_evenly(rows: &[Vec<f64>], at: usize) -> bool {
    let cell = |row: &Vec<f64>| row.get(at).copied().unwrap_or(f64::NAN);
    let mut steps: Vec<f64> = rows.windows(2).map(|w| cell(&w[1]) - cell(&w[0])).collect();
    if steps.len() < 2 || !steps.iter().all(|step| *step > 0.0) {
        return false;
    }
    steps.sort_by(f64::total_cmp);
    let usual = steps[steps.len() / 2];
    let near = steps
        .iter()
        .filter(|s| (0.5 * usual..=2.0 * usual).contains(*s));
    5 * near.count() >= 4 * steps.len()
}

/// Columns beyond which a file without names is no log of samples: a row is then a whole recording, or many sensors.
const MOST_COLUMNS: usize = 24;

/// Without names: the time, and the first two triads.
fn by_readings(file: &str, width: usize, rows: &[Vec<f64>], clock: Option<usize>) -> Guess {
    let column = |at: usize| {
        rows.iter()
            .map(move |row| row.get(at).copied().unwrap_or(f64::NAN))
    };
    let grows = |at: usize| {
        let values: Vec<f64> = column(at).collect();
        values.len() > 2 && values.is_sorted() && values[0] < values[values.len() - 1]
    };
    let mut roles = vec!["-"; width];
    if width > MOST_COLUMNS {
        return Guess {
            roles,
            by_readings: true,
            ..Guess::default()
        };
    }
    let is_number =
        |at: &usize| 10 * column(*at).filter(|v| v.is_finite()).count() >= 9 * rows.len();
    let numbers: Vec<usize> = (0..width).filter(is_number).collect();
    let time = numbers
        .iter()
        .position(|&at| clock.map_or_else(|| grows(at), |clock| at == clock));
    let behind = &numbers[time.map_or(0, |k| k + 1)..];
    if let Some(k) = time {
        roles[numbers[k]] = "t_s";
    }
    // Gravity is large compared with the noise of a unit at rest; a rate of zero is not.
    let size = |triad: &[usize]| -> f64 {
        let mean = |at: &usize| column(*at).sum::<f64>() / rows.len().max(1) as f64;
        triad.iter().map(|at| mean(at).powi(2)).sum::<f64>().sqrt()
    };
    let gyro_alone = file.to_lowercase().contains("gyr");
    let sensors: &[[&'static str; 3]] = match behind.len() {
        0..3 => &[],
        3..6 if gyro_alone => &[GYRO],
        3..6 => &[ACCEL],
        _ if size(&behind[..3]) <= size(&behind[3..6]) => &[GYRO, ACCEL],
        _ => &[ACCEL, GYRO],
    };
    for (at, role) in behind.iter().zip(sensors.iter().flatten()) {
        roles[*at] = role;
    }
    Guess {
        roles,
        by_readings: true,
        ..Guess::default()
    }
}

/// Units of both sensors of the files: by the readings, and by the names where the readings leave it open.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Units {
    /// Of the gyro, if it has columns.
    pub gyro: Option<UnitFound>,
    /// Of the accelerometer, if it has columns.
    pub accel: Option<UnitFound>,
}

impl Units {
    /// Of the first file with each sensor; `rows` are the numbers of each file.
    pub fn of(guesses: &[&Guess], rows: &[Vec<Vec<f64>>]) -> Self {
        let files = || guesses.iter().zip(rows);
        let first = |sensor: &[&'static str; 3]| {
            files().find_map(|(guess, rows)| Some((*guess, series(guess, rows, sensor)?)))
        };
        let [gyro, accel] = [first(&GYRO), first(&ACCEL)];
        let none = Series::default();
        let forces = accel.as_ref().map_or(&none, |(_, series)| series);
        Self {
            gyro: gyro.map(|(guess, series)| gyro_unit(&series, forces, guess.gyro_unit)),
            accel: accel
                .as_ref()
                .map(|(guess, series)| accel_unit(series, guess.accel_unit)),
        }
    }

    /// Unit of gyro and accelerometer, if they are known.
    pub fn known(&self) -> [Option<&'static str>; 2] {
        [&self.gyro, &self.accel].map(|found| found.as_ref()?.unit)
    }
}

/// The readings of a sensor, if all its axes have a column.
fn series(guess: &Guess, rows: &[Vec<f64>], sensor: &[&'static str; 3]) -> Option<Series> {
    let at = |role: &str| guess.roles.iter().position(|r| *r == role);
    let [x, y, z] = [at(sensor[0])?, at(sensor[1])?, at(sensor[2])?];
    let cell = |row: &Vec<f64>, at: usize| row.get(at).copied().unwrap_or(f64::NAN);
    let times: Vec<f64> = at("t_s").map_or(Vec::new(), |t| {
        rows.iter().map(|row| cell(row, t)).collect()
    });
    let unit_s = match guess.time_unit {
        Some(unit) => Some(unit.seconds()),
        None => clock_unit_s(&times),
    };
    Some(Series {
        t_s: unit_s.map_or(Vec::new(), |unit_s| {
            times.iter().map(|t| t * unit_s).collect()
        }),
        readings: rows
            .iter()
            .map(|row| [x, y, z].map(|at| cell(row, at)))
            .collect(),
    })
}

/// Unit of time stamps, s, of the four that make the sample rate that of an inertial unit: 3 to 3000 Hz.
fn clock_unit_s(times: &[f64]) -> Option<f64> {
    let rate = crate::usual_rate_hz(times).ok()?;
    let units = [1.0, 1e-3, 1e-6, 1e-9];
    units
        .into_iter()
        .find(|unit| (3.2..3200.0).contains(&(rate / unit)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_codes_of_a_thermometer_are_not_taken_for_degrees() {
        let names = ["time", "dTemp", "Temp", "gyrox rad/s"].map(String::from);
        let found = guess(
            "log.csv",
            &names,
            &[],
            &[vec![0.0, -8884.0, 31.2, 0.0]],
            None,
        );
        assert_eq!(found.roles, ["t_s", "-", "temp_c", "gyro_x"]);
    }

    #[test]
    fn without_names_the_triad_that_shows_gravity_is_the_accelerometer() {
        let rows: Vec<Vec<f64>> = (0..20)
            .map(|k| vec![0.01 * f64::from(k), 0.1, 0.2, 9.8, 0.01, -0.02, 0.01])
            .collect();
        let found = guess("log.csv", &[], &[], &rows, None);
        assert_eq!(
            found.roles,
            [
                "t_s", "accel_x", "accel_y", "accel_z", "gyro_x", "gyro_y", "gyro_z"
            ]
        );
        assert!(found.by_readings);
        let alone: Vec<Vec<f64>> = rows.iter().map(|row| row[..4].to_vec()).collect();
        assert_eq!(
            guess("my_Gyro.txt", &[], &[], &alone, None).roles,
            ["t_s", "gyro_x", "gyro_y", "gyro_z"]
        );
    }
}
