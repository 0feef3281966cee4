//! What the columns of a foreign file become, with which factors and offsets.

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
    /// Every role there is.
    pub fn all() -> impl Iterator<Item = Role> {
        Column::all()
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
        Role::all().find(|role| role.name() == name)
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
                        format!("write - to skip a column, or one of {}", all.join(", ")),
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

/// A factor for a column, or for the three columns of a sensor, as in `gyro=57.2958`.
#[derive(Debug, Clone, PartialEq)]
pub struct Scale {
    /// `gyro`, `accel` or the name of a column.
    target: String,
    factor: f64,
}

impl Scale {
    /// Whether `column` is to be multiplied.
    fn applies_to(&self, column: Column) -> bool {
        let name = column.name();
        match self.target.as_str() {
            "gyro" | "accel" => {
                matches!(column, Column::Raw(_)) && name.starts_with(self.target.as_str())
            }
            target => name == target,
        }
    }

    /// Whether it holds for readings of a sensor, not only for the time or the temperature.
    pub fn is_of_readings(&self) -> bool {
        Column::all().any(|column| matches!(column, Column::Raw(_)) && self.applies_to(column))
    }

    /// The scales of those columns for which `by_hand` has none. If it has some axes of a sensor, the scale is kept for the others.
    pub(super) fn beside(scales: &[Scale], by_hand: &[Scale]) -> Vec<Scale> {
        let free = |column: &Column| Self::given(by_hand, *column).is_none();
        let mut beside = Vec::new();
        for scale in scales {
            let columns: Vec<Column> = Column::all().filter(|c| scale.applies_to(*c)).collect();
            match columns.iter().all(free) {
                true => beside.push(scale.clone()),
                false => beside.extend(columns.into_iter().filter(free).map(|column| Scale {
                    target: column.name().to_owned(),
                    factor: scale.factor,
                })),
            }
        }
        beside
    }

    /// Product of the factors for `column`, if there are any.
    pub(super) fn given(scales: &[Scale], column: Column) -> Option<f64> {
        let any = scales.iter().any(|scale| scale.applies_to(column));
        any.then(|| Self::product(scales, column))
    }

    /// Product of the factors that apply to `column`.
    pub(super) fn product(scales: &[Scale], column: Column) -> f64 {
        let applicable = scales.iter().filter(|scale| scale.applies_to(column));
        applicable.map(|scale| scale.factor).product()
    }
}

impl FromStr for Scale {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let refuse = |problem: String, remedy: &str| Err(Error::new("scale", problem, remedy));
        let shown = shorten(text.as_bytes());
        let Some((target, factor)) = text.split_once('=') else {
            return refuse(
                format!("{shown} has no factor"),
                "write it like gyro=57.2958",
            );
        };
        let target = target.trim();
        let known = Column::from_name(target).is_some_and(|column| column != Column::Step);
        if !known && target != "gyro" && target != "accel" {
            return refuse(
                format!("{shown} does not name a column of numbers"),
                "scale gyro, accel, temp_c, t_s or a single column such as gyro_x",
            );
        }
        match factor.trim().parse::<f64>() {
            Ok(factor) if factor.is_finite() && factor != 0.0 => Ok(Scale {
                target: target.to_owned(),
                factor,
            }),
            _ => refuse(
                format!("{shown} has no finite factor other than 0"),
                "write it like gyro=57.2958",
            ),
        }
    }
}

impl fmt::Display for Scale {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.target, self.factor)
    }
}

/// What is added to a column after its factor, as in `temp_c=36.53`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Offset {
    column: Column,
    value: f64,
}

impl Offset {
    /// Sum of the offsets of `column`.
    pub(super) fn sum(offsets: &[Offset], column: Column) -> f64 {
        let own = offsets.iter().filter(|offset| offset.column == column);
        own.map(|offset| offset.value).sum()
    }
}

impl FromStr for Offset {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let parts = text.split_once('=');
        let column = parts.and_then(|(name, _)| Column::from_name(name.trim()));
        let column = column.filter(|column| !matches!(column, Column::Time | Column::Step));
        let value = parts.and_then(|(_, value)| value.trim().parse::<f64>().ok());
        match (column, value.filter(|value| value.is_finite())) {
            (Some(column), Some(value)) => Ok(Offset { column, value }),
            _ => Err(Error::new(
                "offset",
                format!(
                    "{} is not a column of numbers with an offset",
                    shorten(text.as_bytes())
                ),
                "write it like temp_c=36.53, one column at a time",
            )),
        }
    }
}

impl fmt::Display for Offset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.column.name(), self.value)
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

    #[test]
    fn factors_multiply_and_reach_the_axes_of_their_sensor_only() {
        let scales: Vec<Scale> = ["gyro=2", "gyro_x=3", "t_s=0.001"]
            .iter()
            .map(|text| text.parse().unwrap())
            .collect();
        assert_eq!(Scale::product(&scales, Column::Raw(0)), 6.0);
        assert_eq!(Scale::product(&scales, Column::Raw(1)), 2.0);
        assert_eq!(Scale::product(&scales, Column::Raw(3)), 1.0);
        assert_eq!(Scale::product(&scales, Column::Time), 0.001);
        for text in ["gyro", "gyro=x", "gyro=0", "mag=1", "step=2", "gyro=inf"] {
            assert!(text.parse::<Scale>().is_err(), "{text}");
        }
    }
}
