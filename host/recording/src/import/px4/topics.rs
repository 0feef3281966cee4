//! The topics with readings, sample by sample.

use px4_ulog::stream_parser::ParseableFieldType;
use px4_ulog::stream_parser::model::DataMessage;

/// A topic with readings and its fields. A topic of a FIFO lists no field: its messages are batches.
pub(super) struct TopicFields {
    pub name: &'static str,
    fields: &'static [&'static str],
}

const fn topic(name: &'static str, fields: &'static [&'static str]) -> TopicFields {
    TopicFields { name, fields }
}

const XYZ: &[&str] = &["x", "y", "z"];

/// The topics that are read.
pub(super) const TOPICS: [TopicFields; 7] = [
    topic("sensor_gyro", XYZ),
    topic("sensor_accel", XYZ),
    topic("sensor_gyro_fifo", &[]),
    topic("sensor_accel_fifo", &[]),
    topic("sensor_mag", XYZ),
    topic(
        "vehicle_magnetometer",
        &[
            "magnetometer_ga[0]",
            "magnetometer_ga[1]",
            "magnetometer_ga[2]",
        ],
    ),
    topic(
        "sensor_combined",
        &[
            "gyro_rad[0]",
            "gyro_rad[1]",
            "gyro_rad[2]",
            "accelerometer_m_s2[0]",
            "accelerometer_m_s2[1]",
            "accelerometer_m_s2[2]",
        ],
    ),
];

/// Samples of one instance of a topic.
#[derive(Default)]
pub(super) struct Topic {
    pub stamps_ns: Vec<i64>,
    /// Three readings a sample, and those of the accelerometer in `sensor_combined`.
    pub values: Vec<[f64; 3]>,
    pub accel: Vec<[f64; 3]>,
    pub temp_c: Vec<f64>,
    /// Ids of the sensor in order, each with the number of its first sample.
    pub devices: Vec<(usize, u32)>,
    /// Whether its readings are calibrated. Those of PX4 before 1.11 are; they have no `timestamp_sample`.
    pub calibrated: bool,
}

impl Topic {
    /// Name of its sensor, for people.
    pub fn named(&self) -> String {
        self.devices
            .first()
            .map_or("no device id".into(), |(_, id)| format!("device {id}"))
    }

    /// Takes a message of the topic; `None` if it lacks a field.
    pub fn take(&mut self, of: &TopicFields, data: &DataMessage<'_>) -> Option<()> {
        if let Some(id) = field(data, "device_id")
            && self.devices.last().is_none_or(|(_, before)| *before != id)
        {
            self.devices.push((self.values.len(), id));
        }
        if of.fields.is_empty() {
            return self.take_fifo(data);
        }
        let sampled = field(data, "timestamp_sample");
        let stamp_ns = nanoseconds(sampled.or_else(|| field(data, "timestamp"))?)?;
        let readings = of.fields.iter().map(|field| f32_in(data, field));
        let readings: Vec<f64> = readings.collect::<Option<_>>()?;
        let (gyro, accel) = readings.split_first_chunk()?;
        self.calibrated |= sampled.is_none();
        self.stamps_ns.push(stamp_ns);
        self.values.push(*gyro);
        self.accel.extend(accel.first_chunk());
        self.temp_c
            .push(f32_in(data, "temperature").unwrap_or(f64::NAN));
        Some(())
    }

    /// Takes a batch of the sensor's FIFO; its last sample has the time of the message.
    fn take_fifo(&mut self, data: &DataMessage<'_>) -> Option<()> {
        let last_ns = nanoseconds(field(data, "timestamp_sample")?)?;
        let (step_us, scale) = (f32_in(data, "dt")?, f32_in(data, "scale")?);
        let count = usize::from(field::<u8>(data, "samples")?);
        for i in 0..count {
            let count_of =
                |axis: &str| Some(f64::from(field::<i16>(data, &format!("{axis}[{i}]"))?));
            let counts = [count_of("x")?, count_of("y")?, count_of("z")?];
            let before_ns = (count - 1 - i) as f64 * step_us * 1e3;
            self.stamps_ns.push(last_ns - before_ns.round() as i64);
            self.values.push(counts.map(|value| value * scale));
            self.temp_c.push(f64::NAN);
        }
        Some(())
    }
}

pub(super) fn field<T: ParseableFieldType>(data: &DataMessage<'_>, name: &str) -> Option<T> {
    let parser = data.flattened_format.get_field_parser::<T>(name).ok()?;
    Some(parser.parse(data.data))
}

fn f32_in(data: &DataMessage<'_>, name: &str) -> Option<f64> {
    field::<f32>(data, name).map(f64::from)
}

/// Converts from microseconds; `None` on overflow.
fn nanoseconds(microseconds: u64) -> Option<i64> {
    i64::try_from(microseconds).ok()?.checked_mul(1000)
}
