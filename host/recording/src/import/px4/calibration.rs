//! PX4's own calibration from its log, and readings with it undone.

use std::collections::BTreeMap;

use super::super::rotation::{Correction, Rotation, from_euler, listed, orientation, product};

/// Number of sensors of each kind whose calibration PX4 stores.
const MOST_SENSORS: usize = 4;

/// Prefixes of the parameters of gyros and of accelerometers.
const PREFIXES: [&str; 2] = ["CAL_GYRO", "CAL_ACC"];
/// The parameters that enable their compensation over temperature.
const THERMAL: [&str; 2] = ["TC_G_ENABLE", "TC_A_ENABLE"];

/// Parameters by name.
type Values = BTreeMap<String, f64>;

/// The parameters of calibration and mounting, as they change.
#[derive(Debug, Default)]
pub(super) struct Parameters {
    /// Values, each with the number of the first sample to which they apply.
    epochs: Vec<(usize, Values)>,
}

/// Readings without PX4's calibration, or with it if it cannot be undone.
pub(super) struct Undone {
    pub values: Vec<[f64; 3]>,
    /// What was done, for people.
    pub said: String,
    pub warnings: Vec<String>,
}

impl Parameters {
    /// Sets a parameter from sample `row` on.
    pub fn set(&mut self, row: usize, name: &str, value: f64) {
        const ABOUT: [&str; 5] = [
            "CAL_ACC",
            "CAL_GYRO",
            "SENS_BOARD_",
            "TC_A_ENABLE",
            "TC_G_ENABLE",
        ];
        if !ABOUT.iter().any(|beginning| name.starts_with(beginning)) {
            return;
        }
        let mut values = self
            .epochs
            .last()
            .map_or_else(Values::new, |(_, values)| values.clone());
        if values.insert(name.to_owned(), value) == Some(value) {
            return;
        }
        match self.epochs.last_mut() {
            Some((from, last)) if *from == row => *last = values,
            _ => self.epochs.push((row, values)),
        }
    }

    /// Id of the calibrated sensor, if only one is calibrated.
    pub fn only_id(&self, sensor: usize) -> Option<u32> {
        let (_, values) = self.epochs.last()?;
        let id = |n: usize| values.get(&format!("{}{n}_ID", PREFIXES[sensor])).copied();
        let mut ids = (0..MOST_SENSORS).filter_map(id).filter(|id| *id != 0.0);
        let only = ids.next()?;
        ids.next().is_none().then(|| device_id(only))
    }

    /// The `readings` of `sensor` before calibration. `devices` are its ids, each with the number of its first reading; the first id applies to
    /// earlier readings too. `mounted`: whether the readings are on the vehicle's axes instead of the board's.
    pub fn undo(
        &self,
        sensor: usize,
        devices: &[(usize, u32)],
        readings: &[[f64; 3]],
        mounted: bool,
    ) -> Undone {
        let as_they_are = |why: String| Undone {
            values: readings.to_vec(),
            said: "after PX4's calibration".into(),
            warnings: vec![format!("{why}: PX4's calibration is not undone")],
        };
        if devices.is_empty() {
            return as_they_are(
                "the log does not name the device that its calibration belongs to".into(),
            );
        }
        if self.epochs.is_empty() {
            return as_they_are("the log has no parameters".into());
        }
        // Which of a list of values holds for a reading.
        let holds = |starts: &[usize], row: usize| {
            starts
                .partition_point(|from| *from <= row)
                .saturating_sub(1)
        };
        let starts = [
            devices
                .iter()
                .map(|(from, _)| *from)
                .collect::<Vec<usize>>(),
            self.epochs.iter().map(|(from, _)| *from).collect(),
        ];
        let (mut values, mut said) = (Vec::with_capacity(readings.len()), Vec::<String>::new());
        let mut last = None;
        for (row, reading) in readings.iter().enumerate() {
            let now = [holds(&starts[0], row), holds(&starts[1], row)];
            let correction = match &last {
                Some((before, correction)) if *before == now => correction,
                _ => {
                    let (device, epoch) = (devices[now[0]].1, &self.epochs[now[1]].1);
                    let (correction, name) = match correction(sensor, device, epoch, mounted) {
                        Ok(found) => found,
                        Err(why) => return as_they_are(why),
                    };
                    if said.last() != Some(&name) {
                        said.push(name);
                    }
                    &last.insert((now, correction)).1
                }
            };
            values.push(correction.undo(*reading));
        }
        let mut warnings = Vec::new();
        if said.len() > 1 {
            let changes = said.len() - 1;
            warnings.push(format!("the sensor in use or its calibration changes {changes} times during the log: import a log of one sensor"));
        }
        if self
            .epochs
            .iter()
            .any(|(_, values)| values.get(THERMAL[sensor]) == Some(&1.0))
        {
            warnings.push(format!(
                "PX4's compensation over temperature is on ({}) and is not undone",
                THERMAL[sensor]
            ));
        }
        Undone {
            values,
            said: said.join(", then "),
            warnings,
        }
    }
}

/// Some versions log ids as signed numbers.
fn device_id(parameter: f64) -> u32 {
    (parameter as i64 & 0xffff_ffff) as u32
}

/// PX4's calibration of the sensor with id `device`, and a description of it; or why it is unknown.
fn correction(
    sensor: usize,
    device: u32,
    values: &Values,
    mounted: bool,
) -> Result<(Correction, String), String> {
    let prefix = PREFIXES[sensor];
    let is_own = |n: &usize| {
        values
            .get(&format!("{prefix}{n}_ID"))
            .is_some_and(|id| device_id(*id) == device)
    };
    let own = (0..MOST_SENSORS).find(is_own);
    let get = |key: &str, default: f64| {
        own.and_then(|n| values.get(&format!("{prefix}{n}_{key}")).copied())
            .unwrap_or(default)
    };
    let three = |what: &str, default: f64| {
        ["X", "Y", "Z"].map(|axis| get(&format!("{axis}{what}"), default))
    };
    let (offset, scale) = (three("OFF", 0.0), three("SCALE", 1.0));
    if scale.contains(&0.0) {
        return Err(format!(
            "{prefix}{}_XSCALE or another of its factors is 0",
            own.unwrap_or(0)
        ));
    }
    // A sensor off the board has its own orientation; -1 means that of the board.
    let rotation = match (mounted, get("ROT", -1.0)) {
        (false, _) => orientation(0.0),
        (true, own) if own >= 0.0 => orientation(own),
        (true, _) => board(values),
    };
    let Some(rotation) = rotation else {
        return Err(
            "the mounting of the board (SENS_BOARD_ROT, CAL_..._ROT) is unknown here".into(),
        );
    };
    let name = match own {
        Some(n) => format!(
            "{prefix}{n} of device {device} undone: offset {}, scale factor {}",
            listed(offset),
            listed(scale)
        ),
        None => format!("device {device}, for which PX4 has no calibration"),
    };
    Ok((
        Correction {
            rotation,
            offset,
            scale,
            in_vehicle: false,
        },
        name,
    ))
}

/// From the axes of the board to those of the vehicle.
fn board(values: &Values) -> Option<Rotation> {
    let get = |name: &str| values.get(name).copied().unwrap_or(0.0);
    let mounting = orientation(get("SENS_BOARD_ROT"))?;
    let fine = ["X", "Y", "Z"].map(|axis| get(&format!("SENS_BOARD_{axis}_OFF")));
    Some(product(&from_euler(fine), &mounting))
}
