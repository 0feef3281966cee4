//! Logs of PX4 (ULog): the raw topics of each sensor, or `sensor_combined` with PX4's own calibration undone.
//!
//! `sensor_accel`, `sensor_gyro` and their FIFO topics contain the readings of the driver, on the board's axes, before calibration. `sensor_combined`
//! contains the calibrated readings of the sensors that PX4 has selected: `R ((raw - offset) scale)`. Offset and scale are the parameters `CAL_ACCn_`
//! and `CAL_GYROn_` with the device id of the sensor; R is the mounting of the board (`src/lib/sensor_calibration` of PX4-Autopilot).

mod calibration;
mod topics;

use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;

use px4_ulog::stream_parser::file_reader::{Message, SimpleCallbackResult};
use px4_ulog::stream_parser::model::{Completeness, DataMessage, ParameterMessage};
use px4_ulog::stream_parser::read_file_with_simple_callback;

use super::decimal::Decimal;
use super::readings::{Choice, LogFormat, Readings, guarded};
use crate::columns::Column;
use crate::error::{Argument, Error, Result};
use crate::triad_name::{TriadKind, TriadName};
use calibration::Parameters;
use topics::{TOPICS, Topic, field};

/// Logs of PX4.
pub(super) const ULG: LogFormat = LogFormat {
    name: "PX4",
    ending: "ulg",
    unit: Decimal::Microsecond,
    read,
};

/// Signature at the start of a log, and length of its header in bytes.
const SIGNATURE: &[u8] = b"ULog\x01\x12\x35";
const HEADER: u64 = 16;

/// The topics that are read.
const COMBINED: &str = "sensor_combined";
const SELECTION: &str = "sensor_selection";
/// The topics of magnetometers, in gauss, and the size of this unit in µT. The second is calibrated, and so is the first before PX4 1.11: both are affine,
/// which another calibration absorbs. The default profile of the logger writes the first once a second, the second five times.
const MAG: &str = "sensor_mag";
const VEHICLE_MAG: &str = "vehicle_magnetometer";
const GAUSS_UT: f64 = 100.0;
/// Topics of one sensor each: gyro and accelerometer.
const RAW: [&str; 2] = ["sensor_gyro", "sensor_accel"];
const FIFO: [&str; 2] = ["sensor_gyro_fifo", "sensor_accel_fifo"];

/// The default profile of the logger writes the raw topics once a second, and `sensor_combined` at 200 Hz. Without a choice, the raw topics are read
/// unless they have this many times fewer samples.
const SPARSE: usize = 4;

/// What a log contains of inertial sensors.
#[derive(Default)]
struct Log {
    /// By name and instance.
    topics: BTreeMap<(&'static str, u32), Topic>,
    /// Ids of the gyro and the accelerometer in use, each pair with the number of its first sample in `sensor_combined`.
    selected: Vec<(usize, [u32; 2])>,
    parameters: Parameters,
    dropouts: u64,
    dropouts_ms: u64,
    broken: u64,
}

/// Reads a log.
fn read(path: &Path, choice: Choice<'_>) -> Result<Vec<Readings>> {
    let place = path.to_str().ok_or_else(|| {
        let problem = "the name of the file is not UTF-8";
        Error::new(path.display(), problem, "rename it")
    })?;
    let mut beginning = Vec::new();
    let file = std::fs::File::open(path).map_err(|error| Error::io(path, &error))?;
    let read = file.take(HEADER).read_to_end(&mut beginning);
    read.map_err(|error| Error::io(path, &error))?;
    let other = || {
        let problem = "this is not a ULog, or it ends within its definitions";
        Error::new(path.display(), problem, "copy it from the vehicle again")
    };
    if beginning.len() < HEADER as usize || !beginning.starts_with(SIGNATURE) {
        return Err(other());
    }
    let (log, ended) = guarded(path, || {
        let mut log = Log::default();
        let ended = read_file_with_simple_callback(place, &mut |message| {
            log.take(message);
            SimpleCallbackResult::KeepReading
        });
        Ok((log, ended.map_err(|_| other())?))
    })?;
    let mut all = log.chosen(path, choice)?;
    if let Some(first) = all.first_mut() {
        first.warnings.extend(log.of_the_logger(&ended));
    }
    Ok(all)
}

impl Log {
    fn take(&mut self, message: &Message<'_>) {
        match message {
            Message::ParameterMessage(ParameterMessage::Float(name, value, _)) => {
                self.set(name, f64::from(*value));
            }
            Message::ParameterMessage(ParameterMessage::Int32(name, value, _)) => {
                self.set(name, f64::from(*value));
            }
            Message::DropoutMessage(dropout) => {
                self.dropouts += 1;
                self.dropouts_ms += u64::from(dropout.duration_ms);
            }
            Message::Data(data) => {
                let name = data.flattened_format.message_name();
                let taken = match TOPICS.iter().find(|topic| topic.name == name) {
                    Some(topic) => {
                        let key = (topic.name, u32::from(data.multi_id.value()));
                        self.topics.entry(key).or_default().take(topic, data)
                    }
                    None if name == SELECTION => self.select(data),
                    None => Some(()),
                };
                self.broken += u64::from(taken.is_none());
            }
            _ => {}
        }
    }

    fn set(&mut self, name: &str, value: f64) {
        self.parameters.set(self.combined_samples(), name, value);
    }

    /// Samples of `sensor_combined` so far.
    fn combined_samples(&self) -> usize {
        let combined = self.topics.get(&(COMBINED, 0));
        combined.map_or(0, |combined| combined.values.len())
    }

    /// The instances of a topic.
    fn instances(&self, name: &str) -> impl Iterator<Item = (u32, &Topic)> {
        let own = self.topics.iter().filter(move |((of, _), _)| *of == name);
        own.map(|((_, instance), topic)| (*instance, topic))
    }

    fn select(&mut self, data: &DataMessage<'_>) -> Option<()> {
        let ids = [
            field(data, "gyro_device_id")?,
            field(data, "accel_device_id")?,
        ];
        if self
            .selected
            .last()
            .is_none_or(|(_, before)| *before != ids)
        {
            self.selected.push((self.combined_samples(), ids));
        }
        Some(())
    }

    /// The readings that `choice` selects, and those of all magnetometers.
    fn chosen(&self, path: &Path, choice: Choice<'_>) -> Result<Vec<Readings>> {
        let mut all = self.inertial(path, choice)?;
        all.extend(self.magnetometers());
        Ok(all)
    }

    /// The readings of all magnetometers: before calibration, unless those have too few samples.
    fn magnetometers(&self) -> Vec<Readings> {
        let most = |name| {
            self.instances(name)
                .map(|(_, topic)| topic.values.len())
                .max()
        };
        let sparse = most(VEHICLE_MAG) > most(MAG).map(|count| SPARSE * count);
        let (name, said) = match sparse {
            true => (VEHICLE_MAG, ", after PX4's calibration"),
            false => (MAG, ""),
        };
        let each = (1..=TriadName::MOST).zip(self.instances(name));
        each.map(|(number, (instance, topic))| {
            let (count, named) = (topic.values.len(), topic.named());
            let note = format!("{count} samples of {name} instance {instance} ({named}){said}");
            let values = topic
                .values
                .iter()
                .map(|gauss| gauss.map(|gauss| gauss * GAUSS_UT));
            Readings::of_mag(number, topic.stamps_ns.iter().copied().zip(values), note)
        })
        .collect()
    }

    /// The readings of gyro and accelerometer that `choice` selects.
    fn inertial(&self, path: &Path, choice: Choice<'_>) -> Result<Vec<Readings>> {
        let has = |names: [&str; 2]| self.topics.keys().any(|(name, _)| names.contains(name));
        let combined = self.combined_samples();
        let raw = RAW.iter().flat_map(|name| self.instances(name));
        let raw = raw.map(|(_, topic)| topic.values.len()).max().unwrap_or(0);
        let topic = choice.topic_of(path, &[&RAW, &FIFO])?;
        let of_raw = match topic {
            None if has(FIFO) => FIFO,
            None if choice.instance.is_none() && combined > SPARSE * raw => {
                return self.combined_readings(path, raw > 0);
            }
            None => RAW,
            Some(COMBINED) if combined > 0 && choice.instance.is_none() => {
                return self.combined_readings(path, false);
            }
            Some(topic) if FIFO.contains(&topic) => FIFO,
            Some(topic) if RAW.contains(&topic) => RAW,
            Some(_) => ["", ""],
        };
        if !has(of_raw) {
            let what = topic.unwrap_or("sensor of its own");
            let problem = format!("the log has no {what}; it has: {}", self.listed());
            let remedy = "choose one of these, or log the raw sensors (SDLOG_PROFILE)";
            let error = Error::new(path.display(), problem, remedy);
            return Err(error.about(Argument::Topic).about(Argument::Instance));
        }
        self.raw_readings(path, of_raw, choice)
    }

    /// The topics to choose from.
    fn listed(&self) -> String {
        let raw = self
            .topics
            .iter()
            .filter(|((name, _), _)| RAW.contains(name) || FIFO.contains(name));
        let raw = raw.map(|((name, instance), topic)| {
            format!("{name} instance {instance} ({})", topic.named())
        });
        let combined = (self.combined_samples() > 0).then(|| COMBINED.to_owned());
        let all: Vec<String> = raw.chain(combined).collect();
        match all.is_empty() {
            true => "no messages of inertial sensors".into(),
            false => all.join(", "),
        }
    }

    /// The topics of gyro and accelerometer, of one instance or of all.
    fn raw_readings(
        &self,
        path: &Path,
        names: [&'static str; 2],
        choice: Choice<'_>,
    ) -> Result<Vec<Readings>> {
        let mut there: BTreeMap<u32, [bool; 2]> = BTreeMap::new();
        for (name, instance) in self.topics.keys().filter(|(name, _)| names.contains(name)) {
            there.entry(*instance).or_default()[usize::from(*name == names[1])] = true;
        }
        let instances = choice.instances_of(path, &there, &self.listed())?;
        let mut all = Vec::new();
        for (number, instance) in (1..=TriadName::MOST).zip(instances) {
            all.extend(self.instance_readings(names, instance, number));
        }
        Ok(all)
    }

    /// The topics of gyro and accelerometer of `instance`, which is the pair `number` of the recording.
    fn instance_readings(
        &self,
        names: [&'static str; 2],
        instance: u32,
        number: u8,
    ) -> Vec<Readings> {
        let mut both: Vec<(usize, &'static str, &Topic)> = (0..)
            .zip(names)
            .filter_map(|(sensor, name)| Some((sensor, name, self.topics.get(&(name, instance))?)))
            .collect();
        // The others are interpolated at the times of the first.
        both.sort_by_key(|(_, _, topic)| std::cmp::Reverse(topic.values.len()));
        let mut all: Vec<Readings> = Vec::new();
        for (sensor, name, topic) in &both {
            let first = all.is_empty() && number == 1;
            let temperature = first && topic.temp_c.iter().any(|t| t.is_finite());
            let kind = [TriadKind::Gyro, TriadKind::Accel][*sensor];
            let columns = (0..3).map(|axis| Column::of(TriadName { kind, number }, axis));
            let mut readings = Readings::of(
                columns
                    .chain(temperature.then_some(Column::Temperature))
                    .collect(),
            );
            // Drivers that calibrate do so on the board's axes.
            let undone = match topic.calibrated {
                true => Some(
                    self.parameters
                        .undo(*sensor, &topic.devices, &topic.values, false),
                ),
                false => None,
            };
            for (row, stamp) in topic.stamps_ns.iter().enumerate() {
                let values = undone
                    .as_ref()
                    .map_or(topic.values[row], |undone| undone.values[row]);
                readings.push(
                    *stamp,
                    values
                        .into_iter()
                        .chain(temperature.then(|| topic.temp_c[row])),
                );
            }
            if let Some(undone) = &undone {
                let all = undone.warnings.iter();
                (readings.warnings).extend(all.map(|w| format!("{name} instance {instance}: {w}")));
            }
            let is = match &undone {
                Some(undone) => undone.said.clone(),
                None => "before PX4's calibration".into(),
            };
            readings.notes.push(format!(
                "{} samples of {name} instance {instance} ({}), {is}",
                topic.values.len(),
                topic.named()
            ));
            if topic.devices.len() > 1 {
                readings.warnings.push(format!("{name} instance {instance} changes its device during the log: import a log of one device"));
            }
            all.push(readings);
        }
        // The lower 16 bits of an id are the bus and the address on it.
        if let [(_, _, a), (_, _, b)] = both.as_slice()
            && let (Some((_, a)), Some((_, b))) = (a.devices.first(), b.devices.first())
            && a & 0xffff != b & 0xffff
        {
            all[0].warnings.push(format!(
                "gyro and accelerometer of instance {instance} are on different devices"
            ));
        }
        all
    }

    /// The readings of `sensor_combined`; `sparse`: the raw topics exist, but have too few samples.
    fn combined_readings(&self, path: &Path, sparse: bool) -> Result<Vec<Readings>> {
        let Some(combined) = self.topics.get(&(COMBINED, 0)) else {
            let problem = "the log has no messages of inertial sensors";
            return Err(Error::new(path.display(), problem, "choose another log"));
        };
        let undone = [0, 1].map(|sensor| {
            let selected = self.selected.iter();
            let mut ids: Vec<(usize, u32)> =
                selected.map(|(from, ids)| (*from, ids[sensor])).collect();
            if ids.is_empty() {
                // Older logs do not name the sensor: if only one is calibrated, it is that one.
                ids.extend(self.parameters.only_id(sensor).map(|id| (0, id)));
            }
            let readings = [&combined.values, &combined.accel][sensor];
            self.parameters.undo(sensor, &ids, readings, true)
        });
        let mut readings = Readings::of_unit();
        for (row, stamp) in combined.stamps_ns.iter().enumerate() {
            readings.push(*stamp, undone.iter().flat_map(|undone| undone.values[row]));
        }
        let why = match sparse {
            true => {
                ", because the topics of the single sensors have too few samples (SDLOG_PROFILE)"
            }
            false => "",
        };
        let count = readings.len();
        readings
            .notes
            .push(format!("{count} samples of {COMBINED}{why}"));
        for (name, undone) in ["gyro", "accel"].into_iter().zip(undone) {
            readings.notes.push(format!("{name}: {}", undone.said));
            let warnings = undone
                .warnings
                .iter()
                .map(|warning| format!("{name}: {warning}"));
            readings.warnings.extend(warnings);
        }
        Ok(vec![readings])
    }

    /// Warnings about what the logger lost and how the file ended.
    fn of_the_logger(&self, ended: &Completeness) -> Vec<String> {
        let mut warnings = Vec::new();
        if self.dropouts > 0 {
            warnings.push(format!(
                "dropouts of the logger: {}, {} ms in all; missing readings are gaps",
                self.dropouts, self.dropouts_ms
            ));
        }
        match ended {
            Completeness::Complete => {}
            Completeness::Truncated => warnings
                .push("the log is cut within a record: everything before it was read".into()),
            Completeness::MalformedRecord(what) => warnings.push(format!(
                "a record of the log is damaged: everything before it was read ({what})"
            )),
        }
        if self.broken > 0 {
            warnings.push(format!(
                "{} messages lack a field of their topic, and were left out",
                self.broken
            ));
        }
        warnings
    }
}

#[cfg(test)]
mod tests;
