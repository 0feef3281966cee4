//! The columns of a recording: their names, their order, and which of them a file has.

use std::sync::LazyLock;

use crate::error::{Error, Result};
use crate::triad_name::{TriadKind, TriadName};
use crate::triads::Triads;
use crate::warning::Warning;

/// Raw sensor columns, gyro before accelerometer, in the manifest's raw unit.
pub const RAW_COLUMNS: [&str; 6] = [
    "gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z",
];

/// Known input: angular rate in deg/s, then specific force in m/s².
pub const REFERENCE_COLUMNS: [&str; 6] = [
    "ref_rate_x_dps",
    "ref_rate_y_dps",
    "ref_rate_z_dps",
    "ref_force_x_mps2",
    "ref_force_y_mps2",
    "ref_force_z_mps2",
];

/// Endings of the columns of a triad.
const AXES: [&str; 3] = ["x", "y", "z"];

/// Names of the columns of all triads, by [`TriadName::place`]. They are made once, so that the name of a column is a borrowed text.
static TRIAD_COLUMNS: LazyLock<Vec<String>> = LazyLock::new(|| {
    let columns = TriadName::all().flat_map(|triad| AXES.map(|axis| format!("{triad}_{axis}")));
    columns.collect()
});

/// One column of a samples file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Column {
    /// Time in s; every recording has it.
    Time,
    /// Number of the dwell.
    Step,
    /// Temperature in °C.
    Temperature,
    /// Raw sensor reading, index into [`RAW_COLUMNS`].
    Raw(usize),
    /// Raw reading of a triad beyond the first gyro and the first accelerometer, with the index of its axis. [`Column::of`] makes it.
    More(TriadName, usize),
    /// Known input, index into [`REFERENCE_COLUMNS`].
    Reference(usize),
}

impl Column {
    /// The column of an axis (0 to 2) of `triad`: [`Column::Raw`] of the first gyro and the first accelerometer, [`Column::More`] of any other.
    pub fn of(triad: TriadName, axis: usize) -> Self {
        match triad {
            TriadName::GYRO => Self::Raw(axis),
            TriadName::ACCEL => Self::Raw(3 + axis),
            other => Self::More(other, axis),
        }
    }

    /// The triad and the index of the axis whose readings it contains.
    pub fn triad(self) -> Option<(TriadName, usize)> {
        match self {
            Self::Raw(i) if i < 3 => Some((TriadName::GYRO, i)),
            Self::Raw(i) => Some((TriadName::ACCEL, i - 3)),
            Self::More(triad, axis) => Some((triad, axis)),
            _ => None,
        }
    }

    /// Every column except those of further triads, in the order in which a writer puts them.
    pub fn fixed() -> impl Iterator<Item = Column> {
        [Column::Time, Column::Step, Column::Temperature]
            .into_iter()
            .chain((0..6).map(Column::Raw))
            .chain((0..6).map(Column::Reference))
    }

    /// Name in a file's header.
    pub fn name(self) -> &'static str {
        match self {
            Column::Time => "t_s",
            Column::Step => "step",
            Column::Temperature => "temp_c",
            Column::Raw(i) => RAW_COLUMNS[i],
            Column::More(triad, axis) => &TRIAD_COLUMNS[3 * triad.place() + axis],
            Column::Reference(i) => REFERENCE_COLUMNS[i],
        }
    }

    /// Column with that name, if there is one.
    pub fn from_name(name: &str) -> Option<Column> {
        let of_triad = || {
            let (stem, axis) = name.rsplit_once('_')?;
            let axis = AXES.iter().position(|a| *a == axis)?;
            Some(Column::of(TriadName::parse(stem)?, axis))
        };
        let mut fixed = Column::fixed();
        fixed.find(|column| column.name() == name).or_else(of_triad)
    }
}

/// Whether `column` is one of the three columns of the triad called `sensor`.
pub(crate) fn of_sensor(sensor: &str, column: Column) -> bool {
    let stem = column.triad().and_then(|_| column.name().split('_').next());
    stem == Some(sensor)
}

/// Which of the optional columns a recording has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Columns {
    /// Dwell numbers.
    pub step: bool,
    /// Temperature.
    pub temp_c: bool,
    /// The three gyro columns.
    pub gyro: bool,
    /// The three accelerometer columns.
    pub accel: bool,
    /// Known inputs, each by itself, in the order of [`REFERENCE_COLUMNS`].
    pub reference: [bool; 6],
    /// The triads beyond the first gyro and the first accelerometer.
    pub more: Triads,
}

impl Columns {
    /// Adds the three columns of `triad`.
    pub fn add(&mut self, triad: TriadName) {
        match triad {
            TriadName::GYRO => self.gyro = true,
            TriadName::ACCEL => self.accel = true,
            other => self.more.insert(other),
        }
    }

    /// The triads, by number and kind: `gyro`, `accel`, `mag`, `gyro2` and so on.
    pub fn triads(&self) -> impl Iterator<Item = TriadName> + '_ {
        let first = [(TriadName::GYRO, self.gyro), (TriadName::ACCEL, self.accel)];
        let first = first.into_iter().filter(|(_, there)| *there);
        first.map(|(triad, _)| triad).chain(self.more.iter())
    }

    /// Those of the view of the pair `number`.
    pub(super) fn of_pair(&self, number: u8) -> Self {
        let has = |kind| {
            self.triads()
                .any(|triad| triad == TriadName { kind, number })
        };
        Self {
            gyro: has(TriadKind::Gyro),
            accel: has(TriadKind::Accel),
            more: Triads::default(),
            ..*self
        }
    }

    /// Whether `column` is there.
    pub fn has(&self, column: Column) -> bool {
        match column {
            Column::Time => true,
            Column::Step => self.step,
            Column::Temperature => self.temp_c,
            Column::Raw(i) => {
                if i < 3 {
                    self.gyro
                } else {
                    self.accel
                }
            }
            Column::More(triad, _) => self.more.contains(triad),
            Column::Reference(i) => self.reference[i],
        }
    }

    /// The columns that are there, in the order of a writer.
    pub fn present(&self) -> impl Iterator<Item = Column> + '_ {
        let more = self.more.iter();
        let more = more.flat_map(|triad| [0, 1, 2].map(|axis| Column::More(triad, axis)));
        let (before, after): (Vec<_>, Vec<_>) = Column::fixed()
            .filter(|&column| self.has(column))
            .partition(|column| !matches!(column, Column::Reference(_)));
        before.into_iter().chain(more).chain(after)
    }
}

/// What the names in a header mean.
#[derive(Debug, Clone)]
pub(super) struct Layout {
    /// Meaning of each column of the file; `None` for an unknown name.
    pub slots: Vec<Option<Column>>,
    /// Which columns there are.
    pub columns: Columns,
    /// One sentence for each column that is ignored.
    pub warnings: Vec<Warning>,
}

impl Layout {
    /// Checks the names of a header; `place` is its file (and line).
    pub fn from_names<S: AsRef<str>>(names: &[S], place: &str) -> Result<Layout> {
        let mut slots = Vec::with_capacity(names.len());
        let mut warnings = Vec::new();
        for (i, name) in names.iter().enumerate() {
            let name = name.as_ref().trim();
            if !name.is_empty() && names[..i].iter().any(|other| other.as_ref().trim() == name) {
                return Err(Error::new(
                    place,
                    format!(
                        "column {} appears twice",
                        super::cell::shorten(name.as_bytes())
                    ),
                    "rename or remove one of them",
                ));
            }
            let slot = Column::from_name(name);
            if slot.is_none() {
                let name = super::cell::shorten(name.as_bytes());
                warnings.push(Warning::UnknownColumn {
                    place: place.into(),
                    name: name.clone(),
                });
            }
            slots.push(slot);
        }
        let has = |column| slots.contains(&Some(column));
        if !has(Column::Time) {
            let found: Vec<&str> = names.iter().take(20).map(|n| n.as_ref().trim()).collect();
            let found = super::cell::shorten(found.join(",").as_bytes());
            return Err(Error::new(
                place,
                format!("column t_s is missing (the header is {found})"),
                "name the column of the time in seconds t_s, or import the file with `mimu import`",
            ));
        }
        let triads: Triads = slots
            .iter()
            .flatten()
            .filter_map(|c| c.triad())
            .map(|(t, _)| t)
            .collect();
        let mut columns = Columns {
            step: has(Column::Step),
            temp_c: has(Column::Temperature),
            reference: std::array::from_fn(|i| has(Column::Reference(i))),
            ..Columns::default()
        };
        for triad in triads.iter() {
            let axes = (0..3).map(|axis| Column::of(triad, axis));
            let missing: Vec<&str> = axes.filter(|c| !has(*c)).map(Column::name).collect();
            if !missing.is_empty() {
                return Err(Error::new(
                    place,
                    format!("column {} is missing", missing.join(", ")),
                    "a sensor needs all three axes; add the missing ones, or remove the others",
                ));
            }
            columns.add(triad);
        }
        if !columns.gyro && !columns.accel {
            return Err(Error::new(
                place,
                "both the gyro_ and the accel_ columns are missing",
                "a recording needs the three columns of at least one sensor",
            ));
        }
        Ok(Layout {
            slots,
            columns,
            warnings,
        })
    }

    /// The same columns with `gyroN` and `accelN` in the places of `gyro` and `accel`; those of the other triads are left out.
    pub fn of_pair(&self, number: u8) -> Layout {
        let slots = self
            .slots
            .iter()
            .map(|slot| slot.and_then(|column| in_pair(column, number)));
        Layout {
            slots: slots.collect(),
            columns: self.columns.of_pair(number),
            warnings: self.warnings.clone(),
        }
    }
}

/// What `column` of a file is in the view of its pair `number`.
fn in_pair(column: Column, number: u8) -> Option<Column> {
    match column.triad() {
        None => Some(column),
        Some((triad, axis)) if triad.number == number && triad.kind != TriadKind::Mag => {
            Some(Column::of(TriadName::first(triad.kind), axis))
        }
        Some(_) => None,
    }
}

/// The column of a file that is `column` in the view of its pair `number`.
pub(super) fn behind_pair(column: Column, number: u8) -> Column {
    match column.triad() {
        Some((TriadName { kind, number: 1 }, axis)) => Column::of(TriadName { kind, number }, axis),
        _ => column,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_finds_its_own_column() {
        let more = TriadName::all().flat_map(|t| [0, 1, 2].map(|axis| Column::of(t, axis)));
        for column in Column::fixed().chain(more) {
            assert_eq!(Column::from_name(column.name()), Some(column));
        }
        assert_eq!(Column::fixed().count(), 15);
        let mag = TriadName::first(TriadKind::Mag);
        assert_eq!(Column::of(mag, 2).name(), "mag_z");
        let eighth = TriadName::parse("accel8").unwrap();
        assert_eq!(Column::of(eighth, 0).name(), "accel8_x");
        assert_eq!(Column::of(TriadName::ACCEL, 1), Column::Raw(4));
        for name in ["gyro1_x", "mag2", "gyro2_w", "ref_x", "gyro02_x"] {
            assert_eq!(Column::from_name(name), None, "{name}");
        }
    }

    #[test]
    fn a_writer_puts_further_triads_by_number_between_readings_and_known_inputs() {
        let names = [
            "gyro2_x",
            "ref_rate_x_dps",
            "mag_z",
            "t_s",
            "mag_x",
            "gyro2_z",
            "gyro2_y",
        ];
        let names = [&names[..], &["mag_y", "accel_x", "accel_y", "accel_z"]].concat();
        let columns = Layout::from_names(&names, "s").unwrap().columns;
        let written: Vec<&str> = columns.present().map(Column::name).collect();
        let expected =
            "t_s accel_x accel_y accel_z mag_x mag_y mag_z gyro2_x gyro2_y gyro2_z ref_rate_x_dps";
        assert_eq!(written.join(" "), expected);
    }

    #[test]
    fn a_header_with_one_sensor_is_enough() {
        let layout =
            Layout::from_names(&["t_s", "accel_x", "accel_z", "accel_y", "note"], "s").unwrap();
        assert!(layout.columns.accel && !layout.columns.gyro);
        assert_eq!(layout.slots[2], Some(Column::Raw(5)));
        assert_eq!(layout.warnings.len(), 1);
        assert!(layout.warnings[0].to_string().contains("note"));
    }

    #[test]
    fn a_header_that_lacks_an_axis_or_repeats_a_column_is_refused() {
        for (names, word) in [
            (vec!["t_s", "gyro_x", "gyro_y"], "gyro_z"),
            (vec!["gyro_x", "gyro_y", "gyro_z"], "t_s"),
            (vec!["t_s", "step"], "both the gyro_ and"),
            (vec!["t_s", "mag_x", "mag_y", "mag_z"], "both the gyro_ and"),
            (
                vec!["t_s", "gyro_x", "gyro_y", "gyro_z", "mag2_x", "mag2_z"],
                "mag2_y is missing",
            ),
            (vec!["t_s", "t_s", "gyro_x", "gyro_y", "gyro_z"], "twice"),
        ] {
            let error = Layout::from_names(&names, "samples.csv").unwrap_err();
            assert!(error.to_string().contains(word), "{error}");
        }
    }
}
