//! A look at files before anything is asked: which columns they have, in which units, and what only a person can say.
//!
//! Names decide about columns, physics about units: gravity is 9.8 m/s², 1 g or 1000 mg, and a turn moves it by the angle that the gyro has to read.
//! Where both are silent, or contradict each other in a way that would pass unseen, the look asks: a wrong unit that passes is the worst that can
//! happen, because every number of the calibration is then wrong by its factor.

mod guess;
#[cfg(test)]
mod tests;
mod triads;

use std::path::{Path, PathBuf};

use self::guess::{MAG, grows_evenly};
pub use guess::{Guess, Units, guess};

use super::assignment::{ColumnList, Role};
use super::decimal::Decimal;
use super::log_options::file_name;
use super::names::{Meaning, meaning, unknown_triad};
use super::per_column::Scale;
use super::preview::{Preview, preview};
use super::reading_units::{ReadingUnits, si};
use super::time::{Seen, Unit, calendar_time};
use crate::error::{Argument, Error, Result};
use crate::separator::Separator;
use crate::triad_name::{TriadKind, TriadName};
use crate::units::{STANDARD_GRAVITY, UnitFound};
use crate::{Column, RAW_COLUMNS, RawUnit};

/// Rows that are looked at: at 100 Hz ten minutes, in which a unit that is turned by hand turns.
const ROWS: usize = 60_000;
/// Rows by which columns without names are judged.
const JUDGED: usize = 2_000;
/// Fewest rows whose magnitude shows what columns without names are.
const FEWEST_ROWS: usize = 50;
/// Nominal counts for 1 g of 16-bit accelerometers, by the ranges of ±2 to ±32 g, and of those with 12 and 14 bits.
const PER_G: [f64; 8] = [
    16_384.0, 8_192.0, 4_096.0, 2_048.0, 1_024.0, 256.0, 32_768.0, 1_000.0,
];
/// Largest share by which gravity in counts may differ from a nominal one.
const OFF_NOMINAL: f64 = 0.08;

/// One file as it was looked at.
#[derive(Debug, Clone)]
pub struct FileLook {
    /// Its path.
    pub path: PathBuf,
    /// Names of its columns; empty if it has none.
    pub names: Vec<String>,
    /// What the columns are.
    pub guess: Guess,
    /// Samples a second, if a line above the rows says it.
    pub rate_hz: Option<f64>,
    /// The separator, if an import would not recognise it.
    pub separator: Option<Separator>,
}

impl FileLook {
    /// Its name without its folder.
    fn file(&self) -> String {
        file_name(&self.path)
    }

    /// The column with this role.
    fn at(&self, role: &str) -> Option<usize> {
        self.guess.roles.iter().position(|own| *own == role)
    }

    /// See [`Look::columns_to_complete`]; `counts` are the known axes of gyro and accelerometer.
    fn columns_to_complete(&self, counts: [usize; 2]) -> String {
        let roles = &self.guess.roles;
        let used = (0..self.names.len().min(roles.len())).filter(|k| roles[*k] != "-");
        let distinct = |k: usize| {
            let name = &self.names[k];
            let again = self.names.iter().filter(|other| *other == name).count();
            again == 1 && !name.is_empty() && !name.contains([',', '=', '\''])
        };
        if self.names.is_empty() || self.separator.is_some() || !used.clone().all(distinct) {
            let separator = self
                .separator
                .map(|separator| format!(" --separator '{separator}'"));
            let mut roles = roles.clone();
            for (at, role) in self.guess.may_be_mag.into_iter().flatten().zip(MAG) {
                roles[at] = role;
            }
            return format!("{}{}", roles.join(","), separator.unwrap_or_default());
        }
        let mut items: Vec<String> = used
            .map(|k| format!("{}={}", roles[k], self.names[k]))
            .collect();
        if counts == [0; 2] && !roles.contains(&"t_s") {
            items.insert(0, "t_s=NAME".into());
        }
        let triad = unknown_triad(&self.names).map(|(triad, _)| triad);
        for (sensor, count) in ["gyro", "accel"].into_iter().zip(counts) {
            let asked = counts == [0; 2] || matches!(count, 1 | 2) || count == 0 && triad.is_some();
            for (k, axis) in ["x", "y", "z"].iter().enumerate().filter(|_| asked) {
                let role = format!("{sensor}_{axis}");
                if !roles.contains(&role.as_str()) {
                    let name = triad.map_or("NAME", |triad| &self.names[triad[k]]);
                    items.push(format!("{role}={name}"));
                }
            }
        }
        let list = items.join(",");
        let plain = |c: char| c.is_alphanumeric() || "_.,=-".contains(c);
        match list.chars().all(plain) {
            true => list,
            false => format!("'{list}'"),
        }
    }
}

/// What a person has to say.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Question {
    /// What is not known, and why, as a sentence without a full stop.
    pub about: String,
    /// The setting that answers it.
    pub setting: Argument,
    /// Its value, with a choice where several are possible.
    pub value: String,
}

/// What was found in files that belong together.
#[derive(Debug, Clone)]
pub struct Look {
    /// The files.
    pub files: Vec<FileLook>,
    /// Unit of the gyro, if there is one.
    pub gyro: Option<UnitFound>,
    /// Unit of the accelerometer, if there is one.
    pub accel: Option<UnitFound>,
    /// Unit of the readings after [`Self::scales`].
    pub raw_unit: Option<RawUnit>,
    /// Factors to that unit.
    pub scales: Vec<Scale>,
    /// What is still open.
    pub questions: Vec<Question>,
}

/// What a person has said of files.
#[derive(Debug, Clone, Copy, Default)]
pub struct Given {
    /// Units of the readings.
    pub units: ReadingUnits,
    /// Whether the unit of the readings is given in another way.
    pub raw_unit: bool,
    /// Whether the sample rate is given.
    pub rate: bool,
    /// Unit of the time stamps.
    pub time_unit: Option<Decimal>,
}

impl Look {
    /// Looks at `files`, which are joined or follow one another. `given` is what a person has said.
    ///
    /// # Errors
    /// A file that cannot be read, or has no line of numbers.
    pub fn at(files: &[PathBuf], separator: Option<Separator>, given: &Given) -> Result<Self> {
        Self::with_columns(files, &[], separator, given)
    }

    /// The same for files with these `columns`, one list for each or one for all; only the units are then open. None: they are looked for too.
    ///
    /// # Errors
    /// As [`Self::at`].
    pub fn with_columns(
        files: &[PathBuf],
        columns: &[ColumnList],
        separator: Option<Separator>,
        given: &Given,
    ) -> Result<Self> {
        let (mut looks, mut numbers) = (Vec::new(), Vec::new());
        for (k, path) in files.iter().enumerate() {
            let seen = preview(path, separator, ROWS)?;
            let list = columns.get(k).or(columns.last());
            let (mut guess, rows) = guess_preview(&file_name(path), &seen, list);
            if !guess.calendar {
                guess.time_unit = given.time_unit.or(guess.time_unit);
            }
            looks.push(FileLook {
                path: path.clone(),
                names: seen.names,
                guess,
                rate_hz: seen.rate_hz,
                separator: seen.separator,
            });
            numbers.push(rows);
        }
        if columns.is_empty() {
            take_triads_once(&mut looks);
        }
        let guesses: Vec<&Guess> = looks.iter().map(|look| &look.guess).collect();
        let units = Units::of(&guesses, &numbers);
        let mut look = Self {
            files: looks,
            gyro: units.gyro,
            accel: units.accel,
            raw_unit: None,
            scales: Vec::new(),
            questions: Vec::new(),
        };
        if columns.is_empty() {
            look.take_columns(&numbers, given);
        }
        if columns.is_empty() || look.gyro.is_some() || look.accel.is_some() {
            look.take_units(given);
        }
        Ok(look)
    }

    /// One list of columns for each file.
    pub fn columns(&self) -> Vec<ColumnList> {
        let list = |look: &FileLook| {
            let roles = look.guess.roles.iter();
            ColumnList::ByPosition(roles.map(|role| Role::from_name(role)).collect())
        };
        self.files.iter().map(list).collect()
    }

    /// Unit of the time stamps, if the names say it.
    pub fn time_unit(&self) -> Option<Decimal> {
        self.files.iter().find_map(|look| look.guess.time_unit)
    }

    /// Whether a column has known inputs of a table.
    pub fn has_reference(&self) -> bool {
        let mut roles = self.files.iter().flat_map(|look| &look.guess.roles);
        roles.any(|role| role.starts_with("ref_"))
    }

    fn ask(&mut self, about: String, setting: Argument, value: &str) {
        self.questions.push(Question {
            about,
            setting,
            value: value.into(),
        });
    }

    /// Asks about columns that are missing or that only the readings suggest.
    fn take_columns(&mut self, numbers: &[Vec<Vec<f64>>], given: &Given) {
        let has = |role: &str| self.files.iter().any(|look| look.at(role).is_some());
        let axes = |sensor: &str| {
            let found = ["x", "y", "z"].map(|axis| has(&format!("{sensor}_{axis}")));
            found.iter().filter(|f| **f).count()
        };
        let [gyro, accel] = ["gyro", "accel"].map(axes);
        let timed = has("t_s");
        let names = self.files.iter().flat_map(|look| look.names.clone());
        let names: Vec<String> = names.filter(|name| !name.is_empty()).collect();
        let list = &self.columns_to_complete();
        if gyro + accel == 0 {
            let about = match names.is_empty() {
                true => "no columns are known to be a gyro or an accelerometer".into(),
                false => format!(
                    "no name is known to be a gyro's or an accelerometer's: {}",
                    few(&names)
                ),
            };
            self.ask(about, Argument::Columns, list);
            return;
        }
        for (sensor, count) in [("gyro", gyro), ("accelerometer", accel)] {
            if (1..3).contains(&count) {
                let about = format!(
                    "{count} of the three axes of the {sensor} are known among {}",
                    few(&names)
                );
                self.ask(about, Argument::Columns, list);
            }
        }
        self.ask_about_names([gyro, accel], list);
        // A file with one triad may be named after its sensor.
        let unnamed = self.files.iter().any(|look| {
            let file = look.file().to_lowercase();
            let own = look.guess.roles.iter().filter(|r| RAW_COLUMNS.contains(r));
            let by_file = own.count() == 3 && (file.contains("acc") || file.contains("gyr"));
            look.guess.by_readings && !by_file
        });
        if unnamed && accel == 3 {
            // Gravity is seen, so the accelerometer is the one with gravity in it; else only a person knows.
            let seen = self.accel.as_ref().is_some_and(|found| match found.unit {
                Some("count") => nominal(found).is_some(),
                unit => matches!(unit, Some("m/s²" | "g" | "mg")),
            });
            // Two rows may have any magnitude.
            let enough = numbers.iter().all(|rows| rows.len() >= FEWEST_ROWS);
            if !enough || !seen {
                let about =
                    "the file has no names, and the readings do not show which triad feels gravity"
                        .into();
                self.ask(about, Argument::Columns, list);
            }
        }
        if !timed && !given.rate {
            self.ask_for_time(numbers, list);
        } else if timed && !given.rate && given.time_unit.is_none() && self.time_unit().is_none() {
            self.check_clock(numbers);
        }
    }

    /// The columns as options, with what is known of them: by name where the names are distinct, else from the left.
    fn columns_to_complete(&self) -> String {
        let roles = self.files.iter().flat_map(|look| &look.guess.roles);
        let count = |sensor: &str| roles.clone().filter(|r| r.starts_with(sensor)).count();
        let counts = [count("gyro_"), count("accel_")];
        let lists = self.files.iter();
        let lists: Vec<String> = lists.map(|l| l.columns_to_complete(counts)).collect();
        lists.join(" --columns ")
    }

    /// Asks for the rate, or whether a column that grows is the time.
    fn ask_for_time(&mut self, numbers: &[Vec<Vec<f64>>], list: &str) {
        let (look, rows) = (&self.files[0], &numbers[0]);
        let judged = &rows[..rows.len().min(JUDGED)];
        let width = judged.first().map_or(0, Vec::len);
        let unused = |at: &usize| look.guess.roles.get(*at) == Some(&"-");
        let growing = (0..width)
            .filter(unused)
            .find(|at| grows_evenly(judged, *at));
        let name = growing.and_then(|at| look.names.get(at));
        match name.filter(|name| !name.is_empty()) {
            Some(name) => {
                let about = format!(
                    "no column is known to be a time; {name:?} grows evenly, and may be one"
                );
                let known = list.trim_matches('\'');
                match known.contains('=') && self.files.len() == 1 {
                    true => self.ask(about, Argument::Columns, &format!("'t_s={name},{known}'")),
                    false => self.ask_for_rate(about),
                }
            }
            None => self.ask_for_rate("no column is a time".into()),
        }
    }

    /// Asks for the rate, with the one that the file says.
    fn ask_for_rate(&mut self, about: String) {
        let stated = self.files.iter().find_map(|look| look.rate_hz);
        let value = stated.map_or("RATE".into(), |rate| rate.to_string());
        self.ask(about, Argument::SampleRate, &value);
    }

    /// Asks about names that stand for two sensors, and about a triad of an unknown name where one sensor is missing: left out without a word, the fit
    /// would be of the other sensor alone.
    fn ask_about_names(&mut self, [gyro, accel]: [usize; 2], list: &str) {
        let mut asked = Vec::new();
        for look in &self.files {
            let used = |k: &usize| RAW_COLUMNS.contains(&look.guess.roles[*k]);
            let names = &look.names;
            let twice = (0..names.len().min(look.guess.roles.len()))
                .filter(used)
                .find(|k| (0..names.len()).any(|j| j != *k && names[j] == names[*k]));
            if let Some(k) = twice {
                asked.push(format!(
                    "the name {:?} occurs twice, and only a person knows which of the sensors is meant",
                    names[k]
                ));
            }
            let missing = match [gyro, accel] {
                [0, 3] => Some("the gyro"),
                [3, 0] => Some("the accelerometer"),
                _ => None,
            };
            if let (Some((triad, _)), Some(missing)) = (unknown_triad(names), missing) {
                asked.push(format!(
                    "the columns {} may be {missing}, which is not among the others",
                    triad.map(|at| names[at].as_str()).join(", ")
                ));
            }
        }
        for about in asked {
            self.ask(about, Argument::Columns, list);
        }
    }

    /// Asks about time stamps without a unit in which their rate is that of no inertial unit, or of two.
    fn check_clock(&mut self, numbers: &[Vec<Vec<f64>>]) {
        let mut timed = self.files.iter().zip(numbers);
        let Some((look, rows, at)) = timed.find_map(|(l, rows)| Some((l, rows, l.at("t_s")?)))
        else {
            return;
        };
        if look.guess.calendar {
            return;
        }
        let name = look.names.get(at).cloned().unwrap_or_default();
        let times: Vec<f64> = rows.iter().filter_map(|row| row.get(at).copied()).collect();
        // One by one: a counter, whose rate nobody knows.
        let counts = times.len() > 2 && times.windows(2).all(|w| w[1] - w[0] == 1.0);
        if counts {
            let about = format!("the column {name:?} counts the rows one by one, which is no time");
            let roles = &mut self.files[0].guess.roles;
            if let Some(role) = roles.iter_mut().find(|role| **role == "t_s") {
                *role = "sample";
            }
            self.ask_for_rate(about);
        } else if look.guess.grows
            && let Err([fine, coarse]) = Unit::recognise(&Seen::of(&times))
        {
            let [fine, coarse] = [fine, coarse].map(|unit| format!("{unit} ({})", unit.symbol()));
            let about =
                format!("the column {name:?} grows evenly, as a time in {fine} or {coarse} would");
            self.ask(about, Argument::TimeUnit, "UNIT");
        }
    }

    /// Decides the unit of the readings, or asks.
    fn take_units(&mut self, given: &Given) {
        let said = given.units;
        for (found, said) in [(&mut self.gyro, said.gyro), (&mut self.accel, said.accel)] {
            if let (Some(found), Some(unit)) = (found.as_mut(), said) {
                found.unit = Some(unit);
                found.reason = "as given".into();
            }
        }
        if given.raw_unit {
            return;
        }
        let found = [&self.gyro, &self.accel];
        let [gyro, accel] = found.map(|found| found.as_ref()?.unit);
        let open = |found: &Option<UnitFound>| match found {
            Some(found) if found.unit.is_none() => Some(found.reason.clone()),
            _ => None,
        };
        let open = found.map(open);
        let is_open = open.iter().any(Option::is_some);
        let sensors = [
            ("gyro", "GYRO_UNIT", "deg/s, rad/s, mdeg/s or count"),
            ("accelerometer", "ACCEL_UNIT", "g, m/s2, mg or count"),
        ];
        for ((sensor, unit, choices), reason) in sensors.into_iter().zip(open).rev() {
            if let Some(reason) = reason {
                let about = format!("the unit of the {sensor} is open ({choices}): {reason}");
                self.ask(about, Argument::Units, unit);
            }
        }
        if is_open {
            return;
        }
        let sizes = [gyro.map(si), accel.map(si)];
        match sizes {
            // Both in SI units, or the only one.
            _ if sizes.iter().flatten().all(Option::is_some) => self.convert(gyro, accel),
            _ if sizes.iter().flatten().all(Option::is_none) => {
                let volts = [gyro, accel].contains(&Some("V"));
                self.raw_unit = Some(if volts { RawUnit::Volt } else { RawUnit::Count });
            }
            _ => self.mixed(gyro, accel),
        }
    }

    fn convert(&mut self, gyro: Option<&str>, accel: Option<&str>) {
        self.raw_unit = Some(RawUnit::Si);
        let size = |unit: Option<&str>| unit.and_then(si).unwrap_or(1.0);
        self.scale(TriadKind::Gyro, size(gyro));
        self.scale(TriadKind::Accel, size(accel));
        // Without a unit in its names a magnetometer stays in its own: the size of the field on the spot gives the factor, or none is needed.
        let field = self.mag_unit().and_then(si);
        self.scale(TriadKind::Mag, field.unwrap_or(1.0));
    }

    /// Adds a factor for all triads of `kind`: further sensors of one logger are in the unit of the first.
    fn scale(&mut self, kind: TriadKind, factor: f64) {
        let first = (kind != TriadKind::Mag).then_some(TriadName::first(kind));
        let triads = first
            .into_iter()
            .chain(self.further().filter(|t| t.kind == kind));
        let scales = triads.filter(|_| factor != 1.0);
        let scales = scales.filter_map(|triad| format!("{triad}={factor}").parse().ok());
        let scales: Vec<Scale> = scales.collect();
        self.scales.extend(scales);
    }

    /// The triads beyond the first gyro and the first accelerometer, each once.
    fn further(&self) -> impl Iterator<Item = TriadName> + '_ {
        let roles = self.files.iter().flat_map(|look| &look.guess.roles);
        roles.filter_map(|role| match Column::from_name(role) {
            Some(Column::More(triad, 0)) => Some(triad),
            _ => None,
        })
    }

    /// Unit of the magnetometer, if the names of its columns say it.
    fn mag_unit(&self) -> Option<&'static str> {
        self.files.iter().find_map(|look| look.guess.mag_unit)
    }

    /// One sensor in a unit, the other in counts: a recording has one unit, so the counts are converted by their nominal size.
    fn mixed(&mut self, gyro: Option<&'static str>, accel: Option<&'static str>) {
        let per_g = self.accel.as_ref().and_then(nominal);
        match (accel, per_g) {
            (Some("count"), Some(per_g)) => {
                self.convert(gyro, None);
                self.scale(TriadKind::Accel, STANDARD_GRAVITY / per_g);
            }
            _ => {
                let about = "one sensor is in a unit and the other in counts, and a recording has one unit for both".into();
                let value = "SI --scale gyro=RAD/S_PER_COUNT (or accel=M/S²_PER_COUNT)";
                self.ask(about, Argument::RawUnit, value);
            }
        }
    }

    /// What was taken, in a few lines: columns with their meanings, units and why.
    pub fn words(&self) -> Vec<String> {
        let mut lines = Vec::new();
        for look in &self.files {
            let of = |k: usize| match look.names.get(k) {
                Some(name) if !name.is_empty() => name.clone(),
                _ => format!("column {}", k + 1),
            };
            let roles = look.guess.roles.iter().enumerate();
            let (left, used): (Vec<_>, Vec<_>) = roles.partition(|(_, role)| **role == "-");
            let used = used
                .into_iter()
                .map(|(k, role)| format!("{role} = {}", of(k)));
            let used: Vec<String> = used.collect();
            let left: Vec<String> = left.into_iter().map(|(k, _)| of(k)).collect();
            let place = match self.files.len() {
                1 => String::new(),
                _ => format!("{}: ", look.file()),
            };
            lines.push(format!("{place}{}", used.join(", ")));
            if let Some(at) = look.at("t_s").filter(|_| look.guess.grows) {
                lines.push(format!("{place}{} grows evenly, so it is the time", of(at)));
            }
            if !left.is_empty() && look.separator.is_none() {
                lines.push(format!("{place}left out: {}", few(&left)));
            }
        }
        for (sensor, found) in [("gyro", &self.gyro), ("accelerometer", &self.accel)] {
            if let Some(found) = found {
                let unit = found.unit.unwrap_or("unknown unit");
                lines.push(format!("{sensor} in {unit}: {}", found.reason));
            }
        }
        if self.further().any(|triad| triad == TriadName::MAG) {
            lines.push(match self.mag_unit() {
                Some(unit) => format!("magnetometer in {unit}: by the names of its columns"),
                None => "magnetometer in its own unit: the names of its columns say none".into(),
            });
        }
        lines
    }

    /// The refusal of what is open, all at once; `command` is the one to complete.
    pub fn refusal(&self, place: &Path, command: &str) -> Option<Error> {
        self.questions.first()?;
        let about: Vec<&str> = self.questions.iter().map(|q| q.about.as_str()).collect();
        let mut answers: Vec<(Argument, String)> = Vec::new();
        for Question { setting, value, .. } in &self.questions {
            let before = answers.iter_mut().find(|(units, _)| units == setting);
            match before.filter(|_| *setting == Argument::Units) {
                // Both units are one option.
                Some((_, units)) => *units += &format!(",{value}"),
                None => answers.push((*setting, value.clone())),
            }
        }
        let options = answers
            .iter()
            .map(|(setting, value)| format!(" {} {value}", setting.flags()));
        Some(Error::new(
            place.display(),
            about.join("; "),
            format!("say it: {command}{}", options.collect::<String>()),
        ))
    }
}

/// Keeps a further triad in the first file that has it: joined files of phones may have one magnetometer each.
fn take_triads_once(looks: &mut [FileLook]) {
    let mut before: Vec<&'static str> = Vec::new();
    for look in looks {
        let further = |role: &str| matches!(Column::from_name(role), Some(Column::More(..)));
        for role in &mut look.guess.roles {
            if before.contains(role) {
                *role = "-";
            }
        }
        let own = look.guess.roles.iter().copied();
        before.extend(own.filter(|role| further(role)));
    }
}

/// The roles of the columns of a file called `file`, by `columns` if they are given, and its numbers, in which the times go on.
pub fn guess_preview(
    file: &str,
    seen: &Preview,
    columns: Option<&ColumnList>,
) -> (Guess, Vec<Vec<f64>>) {
    let numbers = |row: &Vec<String>| row.iter().map(|cell| number(cell)).collect();
    let mut rows: Vec<Vec<f64>> = seen.rows.iter().map(numbers).collect();
    let is_clock = |cell: &String| calendar_time(cell.as_bytes()).is_some();
    let clock = seen
        .rows
        .first()
        .and_then(|row| row.iter().position(is_clock));
    let judged = &rows[..rows.len().min(JUDGED)];
    let mut guess = guess(file, &seen.names, &seen.units, judged, clock);
    if let Some(columns) = columns {
        guess.roles = columns.roles_among(&seen.names);
        (guess.grows, guess.by_readings) = (false, false);
        guess.take_named_units(&seen.names, &seen.units);
    } else if guess.by_readings {
        guess.compare_magnitudes(&rows);
    }
    // A date or a time of day is in s, whatever its name says.
    if clock.is_some_and(|at| guess.roles.get(at) == Some(&"t_s")) {
        guess.time_unit = None;
        guess.calendar = true;
    }
    join_times(&guess, &mut rows);
    (guess, rows)
}

/// The column that a name means by itself, if it is one of readings or of a thermometer: `AccX`, `wz`, `gyro_y`.
pub fn column_named(name: &str) -> Option<Column> {
    match meaning(name) {
        Meaning::Gyro(axis) => Some(Column::Raw(axis)),
        Meaning::Accel(axis) => Some(Column::Raw(3 + axis)),
        Meaning::Mag(axis) => Some(Column::of(TriadName::MAG, axis)),
        Meaning::Temperature => Some(Column::Temperature),
        _ => None,
    }
}

/// Makes the times of the rows go on: nanoseconds are added to seconds, and a clock goes on over midnight and where its logger started again.
fn join_times(guess: &Guess, rows: &mut [Vec<f64>]) {
    /// Stamps that are handed over late go back by less than this many rows.
    const BACK: f64 = 10.0;
    let at = |role: &str| guess.roles.iter().position(|r| *r == role);
    let Some(time) = at("t_s") else { return };
    let nanoseconds = at("t_ns");
    let (mut before, mut step, mut added) = (f64::NAN, 0.0, 0.0);
    for row in rows {
        let nanoseconds = nanoseconds.and_then(|at| row.get(at).copied());
        let Some(cell) = row.get_mut(time) else {
            continue;
        };
        *cell += 1e-9 * nanoseconds.unwrap_or(0.0) + added;
        if before - *cell > BACK * step {
            added += before + step - *cell;
            *cell = before + step;
        } else if *cell > before {
            step = *cell - before;
        }
        before = *cell;
    }
}

/// Nominal counts for 1 g near the usual magnitude that the evidence gives.
fn nominal(found: &UnitFound) -> Option<f64> {
    let size = found.size?;
    PER_G
        .into_iter()
        .find(|per_g| (size / per_g - 1.0).abs() < OFF_NOMINAL)
}

/// The first names.
fn few(names: &[String]) -> String {
    const MOST: usize = 12;
    let more = if names.len() > MOST { ", ..." } else { "" };
    names[..names.len().min(MOST)].join(", ") + more
}

fn number(cell: &str) -> f64 {
    let cell = cell.trim();
    match calendar_time(cell.as_bytes()) {
        Some(stamp) => stamp.value,
        None => cell.replacen(',', ".", 1).parse().unwrap_or(f64::NAN),
    }
}
