//! The columns of a recording: their names, their order, and which of them a file has.

use crate::error::{Error, Result};
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
    /// Known input, index into [`REFERENCE_COLUMNS`].
    Reference(usize),
}

impl Column {
    /// Every column, in the order in which a writer puts them.
    pub fn all() -> impl Iterator<Item = Column> {
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
            Column::Reference(i) => REFERENCE_COLUMNS[i],
        }
    }

    /// Column with that name, if there is one.
    pub fn from_name(name: &str) -> Option<Column> {
        Column::all().find(|column| column.name() == name)
    }
}

/// Whether `column` is one of the three raw columns of `sensor`, `gyro` or `accel`.
pub(crate) fn of_sensor(sensor: &str, column: Column) -> bool {
    matches!(column, Column::Raw(_)) && column.name().split('_').next() == Some(sensor)
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
}

impl Columns {
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
            Column::Reference(i) => self.reference[i],
        }
    }

    /// The columns that are there, in the order of a writer.
    pub fn present(&self) -> impl Iterator<Item = Column> + '_ {
        Column::all().filter(|&column| self.has(column))
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
        let mut sensors = [false; 2];
        for (sensor, present) in sensors.iter_mut().enumerate() {
            let axes = sensor * 3..sensor * 3 + 3;
            let missing: Vec<&str> = axes
                .clone()
                .filter(|&i| !has(Column::Raw(i)))
                .map(|i| RAW_COLUMNS[i])
                .collect();
            *present = missing.is_empty();
            if !missing.is_empty() && missing.len() < 3 {
                return Err(Error::new(
                    place,
                    format!("column {} is missing", missing.join(", ")),
                    "a sensor needs all three axes; add the missing ones, or remove the others",
                ));
            }
        }
        if sensors == [false, false] {
            return Err(Error::new(
                place,
                "both the gyro_ and the accel_ columns are missing",
                "a recording needs the three columns of at least one sensor",
            ));
        }
        let columns = Columns {
            step: has(Column::Step),
            temp_c: has(Column::Temperature),
            gyro: sensors[0],
            accel: sensors[1],
            reference: std::array::from_fn(|i| has(Column::Reference(i))),
        };
        Ok(Layout {
            slots,
            columns,
            warnings,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_finds_its_own_column() {
        for column in Column::all() {
            assert_eq!(Column::from_name(column.name()), Some(column));
        }
        assert_eq!(Column::all().count(), 15);
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
            (vec!["t_s", "t_s", "gyro_x", "gyro_y", "gyro_z"], "twice"),
        ] {
            let error = Layout::from_names(&names, "samples.csv").unwrap_err();
            assert!(error.to_string().contains(word), "{error}");
        }
    }
}
