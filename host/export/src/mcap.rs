//! An MCAP file for Foxglove: raw and compensated samples of a recording, and its poses on the sphere of gravity with their residuals.
//!
//! All messages are JSON, which Foxglove plots and every MCAP reader decodes. The alternative, sensor_msgs/Imu of ROS 2, has no field for raw
//! readings, and 216 of its 320 bytes are covariances that repeat in each message.
//!
//! | topic | schema | contents |
//! |---|---|---|
//! | `/raw` | `mimu.Raw` | recorded readings |
//! | `/compensated` | `mimu.Compensated` | the same sample as `mimu apply` writes it: rad/s and m/s² |
//! | `/dwells` | `foxglove.SceneUpdate` | each dwell of the accelerometer: a point on the sphere, with its residual as an arrow |
//!
//! A dwell's force is the mean of its compensated samples, in units of gravity. Its residual is that mean minus the known force. If only gravity is
//! known, it is that mean minus a force of this magnitude in the same direction. All arrows are enlarged by one factor, given in the metadata.

mod scene;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::PathBuf;

use mcap::records::MessageHeader;
use mcap::write::Metadata;
use mcap::{McapError, WriteOptions, Writer};
use mimu::calibration::apply::Compensated;
use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use mimu::signal::stillness::STILL_FACTOR;
use mimu_recording::error::{Argument, Error, Result};
use mimu_recording::{Batch, Recording};
use serde_json::{Map, Value, json};

use crate::remaining::{self, Places};
use crate::{Export, Sources, heading};
use scene::Dwells;

/// Options of the file.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
pub struct Options {
    /// Recording to compensate
    #[cfg_attr(feature = "clap", arg(long, value_name = "REC"))]
    pub recording: PathBuf,
    /// Write only every Nth sample; each needs about 480 bytes
    #[cfg_attr(feature = "clap", arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..)))]
    pub every: u32,
}

/// Bytes of the file.
///
/// # Errors
/// The calibration is missing, the recording cannot be read, or an error of `mimu apply`.
pub fn export(from: &Sources, options: &Options) -> Result<Export> {
    let (calibration, _) = from.calibration()?;
    let recording = Recording::open(&options.recording)?;
    let place = recording.samples.display().to_string();
    let prepared = Prepared::read(&recording, STILL_FACTOR, |_| ())?;
    let mut export = Export::new("mcap", from);
    export.formulas.push(
        "x = C u + o, raw to SI, and the other parts of the calibration, as `mimu apply` computes it."
            .into(),
    );
    let places = Places {
        cross_terms: true,
        temperature: true,
        effects: true,
    };
    export.remaining = remaining::of(calibration, places)?;
    let mut compensated = Compensated::new(&recording, calibration, |_| ())?;
    export
        .notes
        .extend(compensated.warnings().iter().map(ToString::to_string));
    let mut file = File::new(&place)?;
    let mut dwells = Dwells::of(&prepared);
    let unit = calibration.recording.raw_unit.to_string();
    compensated.for_each(
        |_| (),
        |raw, clean| {
            for row in 0..raw.len() {
                let number = raw.first_row + row as u64;
                let force = Sensor::Accel.channels().map(|c| cell(clean, c, row));
                dwells.add(number, force);
                if number.is_multiple_of(u64::from(options.every)) {
                    let t_s = raw.t_s[row];
                    file.write(RAW, t_s, &sample(raw, row, t_s, Some(&unit)))?;
                    file.write(COMPENSATED, t_s, &sample(clean, row, t_s, None))?;
                }
            }
            Ok(())
        },
    )?;
    match calibration.accel.is_some() && recording.columns.accel {
        true => {
            let (messages, note) = dwells.scenes(&prepared);
            export.notes.extend(note);
            for (t_s, message) in messages {
                file.write(DWELLS, t_s, &message)?;
            }
        }
        false => export.notes.push(
            "The scene is left out: it shows the accelerometer, which is not calibrated.".into(),
        ),
    }
    let head = heading::of_calibration(calibration, &export);
    export.content = file.finish(&head)?;
    Ok(export)
}

/// Topic, name of the schema, and schema.
type Topic = (&'static str, &'static str, fn() -> Value);

const TOPICS: [Topic; 3] = [
    ("/raw", "mimu.Raw", || sample_schema("raw readings", true)),
    ("/compensated", "mimu.Compensated", || {
        sample_schema("rad/s and m/s^2, body frame", false)
    }),
    ("/dwells", "foxglove.SceneUpdate", scene::schema),
];
const RAW: usize = 0;
const COMPENSATED: usize = 1;
const DWELLS: usize = 2;

/// The file is built in memory, so that it is written complete or not at all.
struct File {
    writer: Writer<Cursor<Vec<u8>>>,
    channels: [u16; 3],
    sequence: u32,
    place: String,
}

impl File {
    fn new(place: &str) -> Result<Self> {
        let options = WriteOptions::new().compression(None).library("mimu");
        let make = || -> std::result::Result<_, McapError> {
            let mut writer = options.create(Cursor::new(Vec::new()))?;
            let mut channels = [0; 3];
            for ((topic, name, schema), channel) in TOPICS.iter().zip(&mut channels) {
                let text = schema().to_string();
                let id = writer.add_schema(name, "jsonschema", text.as_bytes())?;
                *channel = writer.add_channel(id, topic, "json", &BTreeMap::new())?;
            }
            Ok((writer, channels))
        };
        let (writer, channels) = make().map_err(|e| refused(place, &e))?;
        Ok(Self {
            writer,
            channels,
            sequence: 0,
            place: place.into(),
        })
    }

    fn write(&mut self, topic: usize, t_s: f64, message: &Value) -> Result<()> {
        let log_time = nanoseconds(t_s);
        let header = MessageHeader {
            channel_id: self.channels[topic],
            sequence: self.sequence,
            log_time,
            publish_time: log_time,
        };
        self.sequence = self.sequence.wrapping_add(1);
        let text = message.to_string();
        let written = self.writer.write_to_known_channel(&header, text.as_bytes());
        written.map_err(|e| refused(&self.place, &e))
    }

    fn finish(mut self, head: &[String]) -> Result<Vec<u8>> {
        let lines = head.iter().enumerate();
        let metadata = Metadata {
            name: "mimu".into(),
            metadata: lines
                .map(|(k, line)| (format!("{k:02}"), line.clone()))
                .collect(),
        };
        let place = self.place;
        let written = self.writer.write_metadata(&metadata);
        written.map_err(|e| refused(&place, &e))?;
        self.writer.finish().map_err(|e| refused(&place, &e))?;
        Ok(self.writer.into_inner().into_inner())
    }
}

fn refused(place: &str, error: &McapError) -> Error {
    let problem = format!("it cannot be written as MCAP: {error}");
    Error::new(place, problem, "write fewer samples").about(Argument::Every)
}

/// Time since the zero of the time stamps, ns. MCAP has no negative times.
fn nanoseconds(t_s: f64) -> u64 {
    // The conversion saturates.
    (t_s * 1e9).round() as u64
}

/// Time in Foxglove's representation.
fn time(t_s: f64) -> Value {
    let ns = nanoseconds(t_s);
    json!({"sec": ns / 1_000_000_000, "nsec": ns % 1_000_000_000})
}

fn cell(batch: &Batch, channel: usize, row: usize) -> f64 {
    batch.raw[channel].get(row).copied().unwrap_or(f64::NAN)
}

/// A sample; a missing reading is null.
fn sample(batch: &Batch, row: usize, t_s: f64, unit: Option<&str>) -> Value {
    let mut all = Map::new();
    all.insert("timestamp".into(), time(t_s));
    for sensor in Sensor::BOTH {
        let from = sensor.channels().start;
        if batch.raw[from].is_empty() {
            continue;
        }
        let [x, y, z] = [0, 1, 2].map(|i| cell(batch, from + i, row));
        let name: Cow<str> = match (unit, sensor) {
            (Some(_), sensor) => sensor.name().into(),
            (None, Sensor::Gyro) => "angular_velocity".into(),
            (None, Sensor::Accel) => "linear_acceleration".into(),
        };
        all.insert(name.into(), json!({"x": x, "y": y, "z": z}));
    }
    if let Some(temp_c) = batch.temp_c.get(row) {
        all.insert("temp_c".into(), json!(temp_c));
    }
    if let Some(unit) = unit {
        all.insert("unit".into(), json!(unit));
    }
    Value::Object(all)
}

fn sample_schema(description: &str, raw: bool) -> Value {
    let axis = json!({"type": ["number", "null"]});
    let triad = json!({"type": "object", "properties": {"x": axis, "y": axis, "z": axis}});
    let mut properties = json!({
        "timestamp": scene::time_schema(),
        "temp_c": {"type": ["number", "null"], "description": "Thermometer, degrees Celsius"},
    });
    let [gyro, accel] = match raw {
        true => ["gyro", "accel"],
        false => ["angular_velocity", "linear_acceleration"],
    };
    properties[gyro] = triad.clone();
    properties[accel] = triad;
    if raw {
        properties["unit"] = json!({"type": "string", "description": "Unit of the readings"});
    }
    json!({"type": "object", "description": description, "properties": properties})
}
