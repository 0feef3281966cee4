//! Logs of ArduPilot (DataFlash, `.bin`), with ArduPilot's own calibration undone.
//!
//! `IMU` contains the readings of sensor number `I` at the rate of the main loop or below, `GYR` and `ACC` those at the sensor's own rate. All are
//! calibrated and rotated to the vehicle's axes: `R ((raw - INS_ACCOFFS) INS_ACCSCAL)` and `R (raw - INS_GYROFFS)`, with R given by
//! `AHRS_ORIENTATION` (`_rotate_and_correct_accel` of AP_InertialSensor_Backend). Before version 3.3, whose logs count ms (`TimeMS`), the readings were
//! calibrated on the vehicle's axes: `INS_ACCSCAL (R raw) - INS_ACCOFFS` (`_rotate_and_offset_accel`).

mod records;

use std::collections::BTreeMap;
use std::path::Path;

use super::decimal::Decimal;
use super::readings::{Choice, LogFormat, Readings};
use super::rotation::{Correction, listed, orientation};
use crate::columns::Column;
use crate::error::{Argument, Error, Result};
use crate::triad_name::{TriadKind, TriadName};
use records::{Record, Records};

/// Logs of ArduPilot.
pub(super) const BIN: LogFormat = LogFormat {
    name: "ArduPilot",
    ending: "bin",
    unit: Decimal::Microsecond,
    read,
};

/// Messages of gyro and accelerometer. [`Log::inertial`] prefers `GYR` with `ACC`, then `IMU`.
const MESSAGES: [&str; 3] = ["IMU", "GYR", "ACC"];
/// Messages of magnetometers, in mG, and the size of this unit in µT. Their readings are after ArduPilot's calibration: which parts of it apply depends on
/// more than the log has, and it is affine, so that another one absorbs it.
const MAG: &str = "MAG";
const MILLIGAUSS_UT: f64 = 0.1;
/// Longest time between a magnetometer's sample and its message, µs.
const LATEST_US: f64 = 1e6;

/// Readings of one sensor in messages of one kind.
#[derive(Default)]
struct Samples {
    stamps_ns: Vec<i64>,
    gyro: Vec<[f64; 3]>,
    accel: Vec<[f64; 3]>,
    temp_c: Vec<f64>,
    /// Whether some readings came without known parameters of the calibration.
    uncorrected: bool,
    changes: u64,
    last: Option<[Correction; 2]>,
}

#[derive(Default)]
struct Log {
    /// By message and number of the sensor, counted from 0.
    samples: BTreeMap<(&'static str, u32), Samples>,
    /// Of magnetometers by number, with its row's stamp in ns and readings in µT.
    mags: BTreeMap<u32, Vec<(i64, [f64; 3])>>,
    parameters: BTreeMap<String, f64>,
    /// Whether parameters have changed since the corrections were computed.
    stale: bool,
    corrections: BTreeMap<u32, Option<[Correction; 2]>>,
}

/// Reads a log.
fn read(path: &Path, choice: Choice<'_>) -> Result<Vec<Readings>> {
    let bytes = std::fs::read(path).map_err(|error| Error::io(path, &error))?;
    let mut records = Records::new(&bytes);
    let mut log = Log::default();
    while let Some(record) = records.next() {
        log.take(&record);
    }
    if records.formats() == 0 {
        let problem = "this is not a DataFlash log: it has no FMT record";
        return Err(Error::new(
            path.display(),
            problem,
            "give the .bin file of ArduPilot",
        ));
    }
    let mut all = log.chosen(path, choice)?;
    if records.skipped > 0
        && let Some(first) = all.first_mut()
    {
        first.warnings.push(format!(
            "{} bytes do not belong to a record (the log is cut or damaged) and were skipped",
            records.skipped
        ));
    }
    Ok(all)
}

impl Log {
    fn take(&mut self, record: &Record<'_>) {
        if record.name() == "PARM" {
            if let (Some(name), Some(value)) = (record.text("Name"), record.number("Value")) {
                let about = name.starts_with("INS") || name == "AHRS_ORIENTATION";
                self.stale |= about && self.parameters.insert(name, value) != Some(value);
            }
            return;
        }
        // Older logs have no instances, but messages IMU2, ACC3 and so on.
        let name = record.name();
        let (kind, number) = match name.strip_suffix(['1', '2', '3']) {
            Some(kind) => (kind, name[kind.len()..].parse().ok()),
            None => (name, None),
        };
        let instance = record.number("I").map(|i| i as u32);
        let instance = instance
            .or(number.map(|n: u32| n.saturating_sub(1)))
            .unwrap_or(0);
        if kind == MAG {
            let all = self.mags.entry(instance).or_default();
            all.extend(mag_of(record));
            return;
        }
        let Some(kind) = MESSAGES.into_iter().find(|message| *message == kind) else {
            return;
        };
        if self.stale {
            self.corrections.clear();
            self.stale = false;
        }
        let parameters = &self.parameters;
        let correction = self.corrections.entry(instance).or_insert_with(|| {
            let in_vehicle = record.number("TimeMS").is_some();
            corrections(parameters, instance, in_vehicle)
        });
        let samples = self.samples.entry((kind, instance)).or_default();
        samples.take(kind, record, correction.as_ref());
    }

    /// The messages to choose from.
    fn listed(&self) -> String {
        let one = |((kind, instance), samples): (&(&str, u32), &Samples)| {
            format!(
                "{kind} instance {instance} ({} messages)",
                samples.stamps_ns.len()
            )
        };
        match self.samples.is_empty() {
            true => "no messages of inertial sensors".into(),
            false => self.samples.iter().map(one).collect::<Vec<_>>().join(", "),
        }
    }

    /// The readings that `choice` selects, and those of all magnetometers.
    fn chosen(&self, path: &Path, choice: Choice<'_>) -> Result<Vec<Readings>> {
        let mut there: BTreeMap<u32, [bool; 2]> = BTreeMap::new();
        for (kind, instance) in self.samples.keys() {
            let has = there.entry(*instance).or_default();
            has[0] |= *kind != "ACC";
            has[1] |= *kind != "GYR";
        }
        let mut all = Vec::new();
        let instances = choice.instances_of(path, &there, &self.listed())?;
        for (number, instance) in (1..=TriadName::MOST).zip(instances) {
            match self.inertial(path, choice, instance, number) {
                // A topic that only some of all sensors have.
                Err(_) if number > 1 => {}
                readings => all.extend(readings?),
            }
        }
        let mags = (1..=TriadName::MOST).zip(&self.mags);
        all.extend(mags.map(|(number, (instance, rows))| {
            let count = rows.len();
            let note = format!(
                "{count} messages {MAG} of instance {instance}, after ArduPilot's calibration"
            );
            Readings::of_mag(number, rows.iter().copied(), note)
        }));
        Ok(all)
    }

    /// The readings of the sensor `instance`, which is the pair `number` of the recording.
    fn inertial(
        &self,
        path: &Path,
        choice: Choice<'_>,
        instance: u32,
        number: u8,
    ) -> Result<Vec<Readings>> {
        let kinds = self.samples.keys().filter(|(_, i)| *i == instance);
        let there: Vec<&str> = kinds.map(|(kind, _)| *kind).collect();
        let both_fast = there.contains(&"GYR") && there.contains(&"ACC");
        let topic = choice.topic_of(path, &[&["GYR", "ACC"]])?;
        let kinds: &[&str] = match topic {
            None if both_fast => &["GYR", "ACC"],
            Some("GYR" | "ACC") => &["GYR", "ACC"],
            None | Some("IMU") => &["IMU"],
            Some(_) => &[],
        };
        let mut found: Vec<(&str, &Samples)> = kinds
            .iter()
            .filter_map(|kind| Some((*kind, self.samples.get(&(*kind, instance))?)))
            .collect();
        if found.is_empty() {
            let what = topic.unwrap_or("IMU");
            let problem = format!(
                "the log has no {what} of instance {instance}; it has: {}",
                self.listed()
            );
            let error = Error::new(path.display(), problem, "choose one of these");
            return Err(error.about(Argument::Topic).about(Argument::Instance));
        }
        // The others are interpolated at the times of the first.
        found.sort_by_key(|(_, samples)| std::cmp::Reverse(samples.stamps_ns.len()));
        let mut all: Vec<Readings> = found
            .into_iter()
            .map(|(kind, samples)| samples.readings(kind, instance, number))
            .collect();
        let thermal = format!("INS_TCAL{}_ENABLE", instance + 1);
        if self.parameters.get(&thermal) == Some(&1.0)
            && let Some(first) = all.first_mut()
        {
            first.warnings.push(format!(
                "instance {instance}: ArduPilot's calibration over temperature is on ({thermal}) and is not undone"
            ));
        }
        Ok(all)
    }
}

impl Samples {
    fn take(
        &mut self,
        kind: &str,
        record: &Record<'_>,
        correction: Option<&[Correction; 2]>,
    ) -> Option<()> {
        let three = |names: [&str; 3]| -> Option<[f64; 3]> {
            Some([
                record.number(names[0])?,
                record.number(names[1])?,
                record.number(names[2])?,
            ])
        };
        let raw = |sensor: usize, reading: [f64; 3]| match correction {
            Some(both) => both[sensor].undo(reading),
            None => reading,
        };
        let time = record
            .number("SampleUS")
            .or_else(|| record.number("TimeUS"))
            .or_else(|| Some(1e3 * record.number("TimeMS")?))?;
        let (gyro, accel) = match kind {
            "GYR" => (Some(three(["GyrX", "GyrY", "GyrZ"])?), None),
            "ACC" => (None, Some(three(["AccX", "AccY", "AccZ"])?)),
            _ => (
                Some(three(["GyrX", "GyrY", "GyrZ"])?),
                Some(three(["AccX", "AccY", "AccZ"])?),
            ),
        };
        if let Some(correction) = correction {
            let changed = self
                .last
                .as_ref()
                .is_some_and(|before| before != correction);
            self.changes += u64::from(changed);
            if changed || self.last.is_none() {
                self.last = Some(correction.clone());
            }
        }
        self.uncorrected |= correction.is_none();
        self.stamps_ns.push((time * 1e3).round() as i64);
        self.gyro.extend(gyro.map(|reading| raw(0, reading)));
        self.accel.extend(accel.map(|reading| raw(1, reading)));
        self.temp_c.push(record.number("T").unwrap_or(f64::NAN));
        Some(())
    }

    fn readings(&self, kind: &str, instance: u32, number: u8) -> Readings {
        let sensors = [&self.gyro, &self.accel];
        let both = [TriadKind::Gyro, TriadKind::Accel].into_iter().zip(sensors);
        let has = both.filter(|(_, all)| !all.is_empty());
        let triads = has.map(|(kind, _)| TriadName { kind, number });
        let columns = triads.flat_map(|t| [0, 1, 2].map(|axis| Column::of(t, axis)));
        // A sensor without a thermometer reports 0, and a recording has the temperature of its first pair.
        let measured = self.temp_c.iter().any(|t| t.is_finite() && *t != 0.0);
        let temperature = measured && number == 1;
        let mut readings = Readings::of(
            columns
                .chain(temperature.then_some(Column::Temperature))
                .collect(),
        );
        for (row, stamp) in self.stamps_ns.iter().enumerate() {
            let raw = sensors
                .into_iter()
                .filter_map(|sensor| sensor.get(row))
                .flatten()
                .copied();
            readings.push(*stamp, raw.chain(temperature.then(|| self.temp_c[row])));
        }
        let done = match (&self.last, self.uncorrected) {
            (Some([gyro, accel]), false) => format!(
                "ArduPilot's calibration undone: gyro offset {}, accelerometer offset {} and scale factor {}",
                listed(gyro.offset),
                listed(accel.offset),
                listed(accel.scale)
            ),
            _ => "after ArduPilot's calibration".into(),
        };
        readings.notes.push(format!(
            "{} messages {kind} of instance {instance}, {done}",
            self.stamps_ns.len()
        ));
        if self.uncorrected {
            readings.warnings.push(format!(
                "instance {instance}: the log lacks parameters of its calibration (INS_, AHRS_ORIENTATION), or its mounting is unknown here: ArduPilot's calibration is not undone"
            ));
        }
        if self.changes > 0 {
            readings.warnings.push(format!(
                "instance {instance}: the calibration changes {} times during the log; each reading is corrected for the one that was in use",
                self.changes
            ));
        }
        readings
    }
}

/// Stamp, ns, and readings, µT, of a magnetometer's message. Since 4.0 `S` has the lower 32 bits of the time of the sample, which may be a tenth of a second
/// before that of the message.
fn mag_of(record: &Record<'_>) -> Option<(i64, [f64; 3])> {
    let milliseconds = || Some(1e3 * record.number("TimeMS")?);
    let logged_us = record.number("TimeUS").or_else(milliseconds)?;
    let sampled = record.number("S").filter(|sampled| *sampled > 0.0);
    let late_us = sampled.map(|sampled| (logged_us - sampled).rem_euclid(2_f64.powi(32)));
    let late_us = late_us.filter(|late| *late < LATEST_US).unwrap_or(0.0);
    let axis = |name: &str| Some(MILLIGAUSS_UT * record.number(name)?);
    let values = [axis("MagX")?, axis("MagY")?, axis("MagZ")?];
    Some((((logged_us - late_us) * 1e3).round() as i64, values))
}

/// ArduPilot's calibration of gyro and accelerometer number `instance`; `None` if the log does not contain it.
fn corrections(
    parameters: &BTreeMap<String, f64>,
    instance: u32,
    in_vehicle: bool,
) -> Option<[Correction; 2]> {
    // Parameters of sensors 2 and 3 have the number within the name, those of further sensors before it.
    let (before, within) = match instance {
        0 => ("INS".to_owned(), String::new()),
        1 | 2 => ("INS".to_owned(), (instance + 1).to_string()),
        _ => (format!("INS{}", instance + 1), String::new()),
    };
    let three = |what: &str| -> Option<[f64; 3]> {
        let get = |axis: &str| parameters.get(&format!("{before}_{what}_{axis}")).copied();
        Some([get("X")?, get("Y")?, get("Z")?])
    };
    let mounting = parameters.get("AHRS_ORIENTATION").copied().unwrap_or(0.0);
    let rotation = orientation(mounting)?;
    let scale = three(&format!("ACC{within}SCAL"))?;
    if scale.contains(&0.0) {
        return None;
    }
    let accel = three(&format!("ACC{within}OFFS"))?;
    Some([
        Correction {
            rotation,
            offset: three(&format!("GYR{within}OFFS"))?,
            scale: [1.0; 3],
            in_vehicle,
        },
        Correction {
            rotation,
            offset: accel,
            scale,
            in_vehicle,
        },
    ])
}

#[cfg(test)]
mod tests;
