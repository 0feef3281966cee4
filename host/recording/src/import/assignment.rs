//! What the columns of a foreign file become.

use std::fmt;
use std::str::FromStr;

use super::super::cell::shorten;
use super::super::columns::Column;
use crate::error::{Error, Result};

/// What a column of a foreign file becomes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// A column of the recording.
    Column(Column),
    /// A running number, from which the time follows with the sample rate.
    Sample,
    /// Nanoseconds beside the whole seconds of the time, as ROS writes them.
    Nanoseconds,
    /// In a table of means: standard deviation of one sample of a raw column, index into [`RAW_COLUMNS`](crate::RAW_COLUMNS).
    Deviation(usize),
    /// In a table of means: how many samples were averaged, of one raw column or of all.
    Averaged(Option<usize>),
}

const DEVIATION_COLUMNS: [&str; 6] = [
    "gyro_x_sd",
    "gyro_y_sd",
    "gyro_z_sd",
    "accel_x_sd",
    "accel_y_sd",
    "accel_z_sd",
];

const AVERAGED_COLUMNS: [&str; 6] = [
    "gyro_x_averaged",
    "gyro_y_averaged",
    "gyro_z_averaged",
    "accel_x_averaged",
    "accel_y_averaged",
    "accel_z_averaged",
];

impl Role {
    /// Every role except those of further triads.
    pub fn all() -> impl Iterator<Item = Role> {
        Column::fixed()
            .map(Role::Column)
            .chain([Role::Sample, Role::Nanoseconds, Role::Averaged(None)])
            .chain((0..6).map(Role::Deviation))
            .chain((0..6).map(|c| Role::Averaged(Some(c))))
    }

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Role::Column(column) => column.name(),
            Role::Sample => "sample",
            Role::Nanoseconds => "t_ns",
            Role::Deviation(c) => DEVIATION_COLUMNS[c],
            Role::Averaged(None) => "averaged",
            Role::Averaged(Some(c)) => AVERAGED_COLUMNS[c],
        }
    }

    /// The role with this name.
    pub fn from_name(name: &str) -> Option<Role> {
        let mut all = Role::all();
        let further = || Column::from_name(name).map(Role::Column);
        all.find(|role| role.name() == name).or_else(further)
    }
}

/// The columns of one foreign file: by position, or by the names in its header.
///
/// As text: `t_s,accel_x,-,accel_y` by position, where `-` skips a column, or `gyro_x=wx,t_s=time`
/// by name in any order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ColumnList {
    /// Role of each column from the left; `None` skips it.
    ByPosition(Vec<Option<Role>>),
    /// Role and name in the header.
    ByName(Vec<(Role, String)>),
}

impl ColumnList {
    /// Roles of the listed columns.
    pub fn roles(&self) -> Vec<Role> {
        match self {
            ColumnList::ByPosition(items) => items.iter().flatten().copied().collect(),
            ColumnList::ByName(items) => items.iter().map(|(role, _)| *role).collect(),
        }
    }

    /// The name of the role of each column of a file whose header has these `names`; `-` for those that are skipped.
    pub fn roles_among(&self, names: &[String]) -> Vec<&'static str> {
        let roles: Vec<Option<Role>> = match self {
            ColumnList::ByPosition(items) => items.clone(),
            ColumnList::ByName(items) => {
                let of = |name: &String| items.iter().find(|(_, own)| own == name);
                let roles = names.iter().map(|name| of(name).map(|(role, _)| *role));
                roles.collect()
            }
        };
        let names = roles.into_iter().map(|role| role.map_or("-", Role::name));
        names.collect()
    }
}

impl FromStr for ColumnList {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        const PLACE: &str = "list of columns";
        let mut positions = Vec::new();
        let mut names = Vec::new();
        for item in text.split(',').map(str::trim) {
            let known = item.split_once('=').map_or(item, |(known, _)| known.trim());
            let role = match known {
                "-" => None,
                _ => Some(Role::from_name(known).ok_or_else(|| {
                    let all: Vec<&str> = Role::all().map(Role::name).collect();
                    Error::new(
                        PLACE,
                        format!(
                            "{} is not a column of a recording",
                            shorten(known.as_bytes())
                        ),
                        format!(
                            "write - to skip a column, or one of {}, or that of a further triad, such as mag_x or gyro2_x",
                            all.join(", ")
                        ),
                    )
                })?),
            };
            let before = positions.iter().flatten();
            if role.is_some()
                && before
                    .chain(names.iter().map(|(role, _)| role))
                    .any(|&r| Some(r) == role)
            {
                let problem = format!("{known} is given twice");
                return Err(Error::new(PLACE, problem, "write - to skip one of the two"));
            }
            match (item.split_once('='), role) {
                (Some((_, name)), Some(role)) => names.push((role, name.trim().to_owned())),
                _ => positions.push(role),
            }
        }
        match (positions.is_empty(), names.is_empty()) {
            (_, true) => Ok(ColumnList::ByPosition(positions)),
            (true, false) => Ok(ColumnList::ByName(names)),
            // A plain name among named ones may mean a position or a name.
            (false, false) => Err(Error::new(
                PLACE,
                "some columns are given by position, others by name",
                "write all of them as name=header_name, or all by position",
            )),
        }
    }
}

impl fmt::Display for ColumnList {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let items: Vec<String> = match self {
            ColumnList::ByPosition(items) => items
                .iter()
                .map(|role| role.map_or("-", Role::name).to_owned())
                .collect(),
            ColumnList::ByName(items) => items
                .iter()
                .map(|(role, name)| format!("{}={name}", role.name()))
                .collect(),
        };
        f.write_str(&items.join(","))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_of_columns_is_read_and_printed_alike() {
        for text in [
            "t_s,accel_x,-,accel_y",
            "gyro_x=wx,t_s=time (ms)",
            "sample,step",
            "t_s,mag_x,mag_y,mag_z,gyro2_x,accel12_z",
        ] {
            assert_eq!(text.parse::<ColumnList>().unwrap().to_string(), text);
        }
    }

    #[test]
    fn unknown_doubled_and_mixed_columns_are_refused() {
        for (text, word) in [
            ("t_s,acc_x", "acc_x"),
            ("t_s,gyro_x,t_s", "twice"),
            ("t_s=a,t_s=b", "twice"),
            ("t_s,gyro_x=wx", "by position, others by name"),
            ("", "not a column"),
        ] {
            let error = text.parse::<ColumnList>().unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
        }
    }
}
