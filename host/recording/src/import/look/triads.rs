//! Further triads among the columns of a file: a magnetometer, and the second and later sensors of a kind.
//!
//! Only a number in their names distinguishes two sensors of a kind: `gx1` and `gx2`, `imu0.accel.x` and `imu1.accel.x`. Names that
//! differ in words may be one sensor before and after a filter, so of these the first is used, unless a person names the others.

use crate::columns::Column;
use crate::import::names::AxisName;
use crate::triad_name::{TriadKind, TriadName};

/// Columns of a triad by axis, and the number in their names.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Named {
    number: String,
    at: [usize; 3],
}

/// Gives the columns of further triads their roles. `roles` has those of the first triad of each kind.
pub(super) fn take_further(names: &[String], roles: &mut [&'static str]) {
    let axes: Vec<Option<AxisName>> = names.iter().map(|name| AxisName::of(name)).collect();
    let exact = |(name, axis): (&String, &Option<AxisName>)| {
        axis.is_none() || Column::from_name(name).is_some()
    };
    // A recording's own names.
    if names.iter().zip(&axes).all(exact) {
        for (k, name) in names.iter().enumerate() {
            let column = Column::from_name(name).filter(|c| c.triad().is_some());
            if let Some(column) = column {
                // Of two with one name, the first is used.
                let again = names[..k].contains(name);
                roles[k] = if again { "-" } else { column.name() };
            }
        }
        return drop_incomplete(roles);
    }
    let [mut gyro, mut accel, mag] =
        TriadKind::ALL.map(|kind| triads_of(kind, &axes, roles).unwrap_or_default());
    // The first pair is one sensor's, if there is one of which both are known.
    let both = |named: &&Named| accel.iter().any(|other| other.number == named.number);
    let pair = gyro.iter().find(both).map(|named| named.number.clone());
    for triads in [&mut gyro, &mut accel] {
        let at = triads
            .iter()
            .position(|named| Some(&named.number) == pair.as_ref());
        let first = at.map(|at| triads.remove(at));
        triads.splice(0..0, first);
    }
    // `gyro2` and `accel2` are one sensor's too.
    let mut numbers: Vec<String> = Vec::new();
    for named in gyro.iter().skip(1).chain(accel.iter().skip(1)) {
        if !numbers.contains(&named.number) {
            numbers.push(named.number.clone());
        }
    }
    for (kind, triads) in [(TriadKind::Gyro, gyro), (TriadKind::Accel, accel)] {
        for (k, named) in triads.iter().enumerate() {
            let place = numbers.iter().position(|number| *number == named.number);
            let number = place.filter(|_| k > 0).map_or(1, |place| place + 2);
            put(kind, number, named, roles);
        }
    }
    for (k, named) in mag.iter().enumerate() {
        put(TriadKind::Mag, k + 1, named, roles);
    }
    drop_incomplete(roles);
}

/// The triads of `kind` that differ from the first in a number only, the first before the others; `None` if there is no first.
fn triads_of(
    kind: TriadKind,
    axes: &[Option<AxisName>],
    roles: &[&'static str],
) -> Option<Vec<Named>> {
    let first = [0, 1, 2].map(|axis| {
        let role = Column::of(TriadName::first(kind), axis).name();
        let at = roles.iter().position(|own| *own == role)?;
        Some((at, axes[at].as_ref().filter(|a| a.kind == kind)?))
    });
    let [Some(x), Some(y), Some(z)] = first else {
        return None;
    };
    let first = [x, y, z];
    if first.iter().any(|(_, axis)| axis.number != x.1.number) {
        return None;
    }
    let mut others: Vec<(String, [Option<usize>; 3])> = Vec::new();
    let alike = |axis: &&AxisName| {
        let of = first[axis.axis].1;
        axis.kind == kind && axis.bare == of.bare && axis.number != of.number
    };
    for (at, axis) in axes.iter().enumerate() {
        let Some(axis) = axis.as_ref().filter(alike).filter(|_| roles[at] == "-") else {
            continue;
        };
        let own = others.iter().position(|(number, _)| *number == axis.number);
        let own = own.unwrap_or_else(|| {
            others.push((axis.number.clone(), [None; 3]));
            others.len() - 1
        });
        others[own].1[axis.axis].get_or_insert(at);
    }
    let mut triads = vec![Named {
        number: x.1.number.clone(),
        at: first.map(|(at, _)| at),
    }];
    for (number, at) in others {
        if let [Some(x), Some(y), Some(z)] = at {
            triads.push(Named {
                number,
                at: [x, y, z],
            });
        }
    }
    Some(triads)
}

/// Gives the columns of a triad their roles; none if there are too many triads.
fn put(kind: TriadKind, number: usize, named: &Named, roles: &mut [&'static str]) {
    let number = u8::try_from(number).ok().filter(|n| *n <= TriadName::MOST);
    for (axis, at) in named.at.iter().enumerate() {
        roles[*at] = number.map_or("-", |number| {
            Column::of(TriadName { kind, number }, axis).name()
        });
    }
}

/// Leaves out further triads of which an axis is missing: gyro and accelerometer are enough for a recording.
fn drop_incomplete(roles: &mut [&'static str]) {
    let whole: Vec<bool> = roles
        .iter()
        .map(|role| match Column::from_name(role) {
            Some(Column::More(triad, _)) => {
                (0..3).all(|axis| roles.contains(&Column::of(triad, axis).name()))
            }
            _ => true,
        })
        .collect();
    for (role, whole) in roles.iter_mut().zip(whole) {
        if !whole {
            *role = "-";
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::guess;

    fn roles(names: &str) -> String {
        let names: Vec<String> = names.split(' ').map(str::to_owned).collect();
        guess("log.csv", &names, &[], &[], None).roles.join(" ")
    }

    #[test]
    fn a_magnetometer_and_sensors_with_other_numbers_are_further_triads() {
        for (names, wanted) in [
            (
                "t gx gy gz ax ay az mx my mz",
                "t_s gyro_x gyro_y gyro_z accel_x accel_y accel_z mag_x mag_y mag_z",
            ),
            (
                "t ax1 ay1 az1 gx1 gy1 gz1 ax2 ay2 az2 gx2 gy2 gz2",
                "t_s accel_x accel_y accel_z gyro_x gyro_y gyro_z accel2_x accel2_y accel2_z gyro2_x gyro2_y gyro2_z",
            ),
            // Sensor 0 has no gyro: the first pair is that of sensor 1.
            (
                "t imu0.acc.x imu0.acc.y imu0.acc.z imu1.acc.x imu1.acc.y imu1.acc.z imu1.gyr.x imu1.gyr.y imu1.gyr.z",
                "t_s accel2_x accel2_y accel2_z accel_x accel_y accel_z gyro_x gyro_y gyro_z",
            ),
            // A recording's own names.
            (
                "t_s gyro_x gyro_y gyro_z gyro3_x gyro3_y gyro3_z mag2_x mag2_y mag2_z",
                "t_s gyro_x gyro_y gyro_z gyro3_x gyro3_y gyro3_z mag2_x mag2_y mag2_z",
            ),
            (
                "t gyro0_x gyro0_y gyro0_z gyro1_x gyro1_y gyro1_z gyro2_x gyro2_y gyro2_z",
                "t_s gyro_x gyro_y gyro_z gyro2_x gyro2_y gyro2_z gyro3_x gyro3_y gyro3_z",
            ),
        ] {
            assert_eq!(roles(names), wanted, "{names}");
        }
    }

    #[test]
    fn other_words_and_missing_axes_are_no_further_triads() {
        for (names, wanted) in [
            (
                "t gyroADC[0] gyroADC[1] gyroADC[2] gyroUnfilt[0] gyroUnfilt[1] gyroUnfilt[2]",
                "t_s gyro_x gyro_y gyro_z - - -",
            ),
            (
                "t gx gy gz mx my temp",
                "t_s gyro_x gyro_y gyro_z - - temp_c",
            ),
            ("t gx1 gy1 gz1 gx2 gy2", "t_s gyro_x gyro_y gyro_z - -"),
        ] {
            assert_eq!(roles(names), wanted, "{names}");
        }
    }
}
