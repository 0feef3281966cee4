//! Messages `sensor_msgs/Imu` and `sensor_msgs/MagneticField` of ROS 1 bags (version 2.0), of ROS 2 bags in SQLite files, and of MCAP files.
//!
//! Their time is the stamp of the header, which the driver has set. Only if it sets none, the time of reception is used. Messages of other types are not read,
//! even if they contain one of these.
//!
//! Drivers whose gyro and accelerometer have separate clocks publish two topics, each with one half of the message: the other half is 0, or its
//! covariance begins with -1, which the definition of the message reserves for this.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::decimal::Decimal;
use super::instance::Instance;
use super::readings::{Choice, LogFormat, Readings, guarded};
use super::sqlite::Database;
use crate::error::{Argument, Error, Result};
use crate::triad_name::{TriadKind, TriadName};

/// Bags of ROS 1.
pub(super) const BAG: LogFormat = LogFormat {
    name: "ROS 1",
    ending: "bag",
    unit: Decimal::Nanosecond,
    read: read_bag,
};

/// Bags of ROS 2 in MCAP.
pub(super) const MCAP: LogFormat = LogFormat {
    name: "ROS 2",
    ending: "mcap",
    unit: Decimal::Nanosecond,
    read: read_mcap,
};

/// Bags of ROS 2 in SQLite.
pub(super) const DB3: LogFormat = LogFormat {
    name: "ROS 2",
    ending: "db3",
    unit: Decimal::Nanosecond,
    read: read_db3,
};

/// Bytes that are read at a time.
const PIECE: usize = 1 << 18;

/// Longest record or chunk of an MCAP file, bytes. Without a limit, a damaged length would be allocated.
const LONGEST_RECORD: usize = 1 << 30;

/// Tesla in µT.
const TESLA_UT: f64 = 1e6;

/// Kinds of messages that are read, by their names in both systems.
const KINDS: [(Kind, [&str; 2]); 2] = [
    (Kind::Imu, ["sensor_msgs/Imu", "sensor_msgs/msg/Imu"]),
    (
        Kind::Mag,
        ["sensor_msgs/MagneticField", "sensor_msgs/msg/MagneticField"],
    ),
];

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Imu,
    Mag,
}

/// Encoding of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Layout {
    Ros1,
    Cdr,
}

/// One message.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Message {
    stamp_ns: i64,
    /// Time at which it was recorded.
    received_ns: i64,
    /// Whether the covariances of angular velocity and linear acceleration say that there are no readings.
    absent: [bool; 2],
    /// Angular velocity, rad/s, and linear acceleration, m/s²; or the field, µT, and zeros.
    values: [f64; 6],
}

/// A topic of a file.
#[derive(Debug, Clone, PartialEq)]
struct Topic {
    name: String,
    kind: String,
    /// What its messages are; `None` if they are of another kind or encoding.
    read: Option<(Kind, Layout)>,
    messages: Vec<Message>,
    /// Messages that end early.
    cut: u64,
}

impl Topic {
    fn new(name: &str, kind: &str, encoding: &str) -> Self {
        let layout = match encoding {
            "ros1" => Some(Layout::Ros1),
            "cdr" => Some(Layout::Cdr),
            _ => None,
        };
        let known = KINDS.iter().find(|(_, names)| names.contains(&kind));
        Self {
            name: name.to_owned(),
            kind: kind.to_owned(),
            read: known.and_then(|(kind, _)| Some((*kind, layout?))),
            messages: Vec::new(),
            cut: 0,
        }
    }

    fn is(&self, kind: Kind) -> bool {
        self.read.is_some_and(|(own, _)| own == kind)
    }

    fn take(&mut self, received_ns: i64, data: &[u8]) {
        let Some((kind, layout)) = self.read else {
            return;
        };
        match parse(data, kind, layout) {
            Some(message) => self.messages.push(Message {
                received_ns,
                ..message
            }),
            None => self.cut += 1,
        }
    }

    /// Whether gyro and accelerometer have readings. A half that is 0 throughout belongs to a driver that fills only the other one. If both halves are
    /// empty, both count as present, so that the import refuses them with their number.
    fn sensors(&self) -> [bool; 2] {
        let has = [0, 1].map(|sensor| {
            self.messages.iter().any(|message| {
                let values = &message.values[3 * sensor..3 * sensor + 3];
                !message.absent[sensor] && values.iter().any(|v| *v != 0.0 && !v.is_nan())
            })
        });
        if has == [false; 2] { [true; 2] } else { has }
    }

    /// What it has, for people.
    fn contents(&self) -> &'static str {
        match self.sensors() {
            [true, false] => "the gyro",
            [false, true] => "the accelerometer",
            _ => "both sensors",
        }
    }

    /// Its readings, as triads of this `number`; `noted`: it is one of several, or the only one and not whole.
    fn readings(&self, number: u8, noted: bool) -> Readings {
        let kinds = [(0, TriadKind::Gyro), (1, TriadKind::Accel)].into_iter();
        let has = self.sensors();
        let halves: Vec<(usize, TriadKind)> = match self.is(Kind::Mag) {
            true => vec![(0, TriadKind::Mag)],
            false => kinds.filter(|(half, _)| has[*half]).collect(),
        };
        let triads = halves.iter().map(|(_, kind)| TriadName {
            kind: *kind,
            number,
        });
        let mut readings = Readings::of_triads(triads);
        let (messages, name) = (&self.messages, &self.name);
        let stamped = messages.iter().any(|m| m.stamp_ns != messages[0].stamp_ns);
        if !stamped && messages.len() > 1 {
            readings.warnings.push(format!("{name}: all headers have the same stamp, so the times of reception are used, which are late by varying delays"));
        }
        if self.cut > 0 {
            readings.warnings.push(format!(
                "{} messages of {name} are cut, and were left out",
                self.cut
            ));
        }
        for message in messages {
            let stamp_ns = if stamped {
                message.stamp_ns
            } else {
                message.received_ns
            };
            let values = halves
                .iter()
                .flat_map(|(half, _)| &message.values[3 * half..3 * half + 3]);
            readings.push(stamp_ns, values.copied());
        }
        let count = messages.len() as u64 + self.cut;
        match self.is(Kind::Mag) {
            true => readings
                .notes
                .push(format!("{count} messages of {name}, a magnetometer")),
            false if noted || halves.len() < 2 => {
                let what = self.contents();
                readings.notes.push(format!(
                    "{count} messages of {name}, of which {what} is read"
                ));
            }
            false => {}
        }
        readings
    }
}

/// The topics of a file by their numbers in it.
type Topics = BTreeMap<u32, Topic>;

/// The readings of the chosen topics; without a choice, those of the only one, or of the only gyro and the only accelerometer. Beside them, those of the
/// chosen magnetometers, or of all.
fn chosen(path: &Path, topics: &Topics, choice: Choice<'_>) -> Result<Vec<Readings>> {
    if matches!(choice.instance, Some(Instance::Number(_))) {
        let problem = "an instance is given, but topics have no instances";
        let remedy = "leave it out, and choose the topic";
        return Err(Error::new(path.display(), problem, remedy).about(Argument::Topic));
    }
    let all_mags: Vec<&Topic> = topics
        .values()
        .filter(|topic| topic.is(Kind::Mag))
        .collect();
    let is_mag = |name: &&String| all_mags.iter().any(|topic| topic.name == **name);
    let (mags, wanted): (Vec<&String>, Vec<&String>) = choice.topics.iter().partition(is_mag);
    let pairs = match choice.instance.is_some() && wanted.is_empty() {
        true => all_pairs(topics),
        false => choose(path, topics, &wanted)?
            .into_iter()
            .map(|topic| (topic, 1))
            .collect(),
    };
    let several = pairs.len() > 1;
    let each = pairs
        .iter()
        .map(|(topic, number)| (*number, topic.readings(*number, several)));
    let mut all: Vec<(u8, Readings)> = each.collect();
    // The others are interpolated at the times of the first.
    all.sort_by_key(|(number, readings)| (*number, std::cmp::Reverse(readings.len())));
    let mut all: Vec<Readings> = all.into_iter().map(|(_, readings)| readings).collect();
    // A driver whose unit has no magnetometer publishes zeros.
    let measured = |topic: &&&Topic| {
        let mut values = topic.messages.iter().flat_map(|message| message.values);
        values.any(|v| v != 0.0 && !v.is_nan())
    };
    let wanted = all_mags
        .iter()
        .filter(|topic| mags.is_empty() || mags.contains(&&topic.name));
    let numbered = (1..=TriadName::MOST).zip(wanted.filter(measured));
    all.extend(numbered.map(|(number, topic)| topic.readings(number, false).sorted()));
    Ok(all)
}

/// All topics with a gyro or an accelerometer, each with the number of its pair: those with both first.
fn all_pairs(topics: &Topics) -> Vec<(&Topic, u8)> {
    let mut all: Vec<&Topic> = topics
        .values()
        .filter(|topic| topic.is(Kind::Imu))
        .collect();
    all.sort_by_key(|topic| topic.sensors() != [true; 2]);
    let mut last = [0_u8; 2];
    let numbered = all.into_iter().map(|topic| {
        let has = topic.sensors();
        let own = || (0..2).filter(|sensor| has[*sensor]);
        let number = 1 + own().map(|sensor| last[sensor]).max().unwrap_or(0);
        own().for_each(|sensor| last[sensor] = number);
        (topic, number)
    });
    numbered
        .take_while(|(_, number)| *number <= TriadName::MOST)
        .collect()
}

/// The topics of gyro and accelerometer to read.
fn choose<'a>(path: &Path, topics: &'a Topics, wanted: &[&String]) -> Result<Vec<&'a Topic>> {
    let refuse = |problem: String, remedy: &str| {
        Err(Error::new(path.display(), problem, remedy).about(Argument::Topic))
    };
    let fits: Vec<&Topic> = topics
        .values()
        .filter(|topic| topic.is(Kind::Imu))
        .collect();
    let named = |name: &&String| fits.iter().copied().find(|topic| topic.name == **name);
    let missing = wanted.iter().find(|name| named(name).is_none());
    if missing.is_some() || fits.is_empty() {
        let of = missing.map_or(String::new(), |name| format!(" {name}"));
        let each = topics.values().map(|t| format!("{} ({})", t.name, t.kind));
        let all = each.collect::<Vec<_>>().join(", ");
        let problem = format!("the file has no topic{of} with sensor_msgs/Imu; it has: {all}");
        return refuse(problem, "choose another file or topic");
    }
    if !wanted.is_empty() {
        return Ok(wanted.iter().filter_map(named).collect());
    }
    let only_halves = fits.len() == 2
        && [[true, false], [false, true]]
            .iter()
            .all(|half| fits.iter().filter(|topic| topic.sensors() == *half).count() == 1);
    if fits.len() == 1 || only_halves {
        return Ok(fits);
    }
    let each = fits.iter().map(|topic| {
        let (count, what) = (topic.messages.len(), topic.contents());
        format!(
            "{} ({}, {count} messages of {what})",
            topic.name, topic.kind
        )
    });
    let all = each.collect::<Vec<_>>().join(", ");
    refuse(
        format!("several topics have sensor_msgs/Imu: {all}"),
        "choose one of them, or one with the gyro and one with the accelerometer",
    )
}

fn damaged(path: &Path, error: &dyn std::fmt::Display) -> Error {
    let problem = format!("the file cannot be read as a bag ({error})");
    Error::new(
        path.display(),
        problem,
        "record it again, or recover it with the tools of ROS",
    )
}

/// Reads a bag of ROS 1.
fn read_bag(path: &Path, choice: Choice<'_>) -> Result<Vec<Readings>> {
    chosen(path, &guarded(path, || messages_of_bag(path))?, choice)
}

/// The reader of bags maps the file into memory, which a browser cannot.
#[cfg(target_family = "wasm")]
fn messages_of_bag(path: &Path) -> Result<Topics> {
    let problem = "a browser cannot read bags of ROS 1";
    let remedy = "import it with the command mimu, or convert it to MCAP (mcap convert)";
    Err(Error::new(path.display(), problem, remedy))
}

#[cfg(not(target_family = "wasm"))]
fn messages_of_bag(path: &Path) -> Result<Topics> {
    use rosbag::{ChunkRecord, IndexRecord, MessageRecord, RosBag};
    let damaged = |error: rosbag::Error| damaged(path, &error);
    File::open(path).map_err(|error| Error::io(path, &error))?;
    let bag = RosBag::new(path).map_err(|error| self::damaged(path, &error))?;
    let mut topics = Topics::new();
    for record in bag.index_records() {
        if let IndexRecord::Connection(connection) = record.map_err(damaged)? {
            let topic = Topic::new(connection.storage_topic, connection.tp, "ros1");
            topics.entry(connection.id).or_insert(topic);
        }
    }
    for record in bag.chunk_records() {
        let ChunkRecord::Chunk(chunk) = record.map_err(damaged)? else {
            continue;
        };
        for message in chunk.messages() {
            if let MessageRecord::MessageData(message) = message.map_err(damaged)? {
                let received_ns = i64::try_from(message.time).unwrap_or(i64::MAX);
                take(&mut topics, message.conn_id, received_ns, message.data);
            }
        }
    }
    Ok(merged(topics))
}

fn take(topics: &mut Topics, number: u32, received_ns: i64, data: &[u8]) {
    if let Some(topic) = topics.get_mut(&number) {
        topic.take(received_ns, data);
    }
}

/// The topics, each with the messages of all of its connections: each node that publishes has a separate one.
fn merged(topics: Topics) -> Topics {
    let mut all = Topics::new();
    for (number, topic) in topics {
        match all.values_mut().find(|first| first.name == topic.name) {
            Some(first) => {
                first.messages.extend(topic.messages);
                first.messages.sort_by_key(|message| message.stamp_ns);
                first.cut += topic.cut;
            }
            None => drop(all.insert(number, topic)),
        }
    }
    all
}

/// Reads an MCAP file.
fn read_mcap(path: &Path, choice: Choice<'_>) -> Result<Vec<Readings>> {
    chosen(path, &guarded(path, || messages_of_mcap(path))?, choice)
}

fn messages_of_mcap(path: &Path) -> Result<Topics> {
    use mcap::records::Record;
    use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
    let io = |error: std::io::Error| Error::io(path, &error);
    let damaged = |error: mcap::McapError| match error {
        mcap::McapError::UnsupportedCompression(codec) => Error::new(
            path.display(),
            format!("its chunks are compressed with {codec}, which this program does not read"),
            "compress it with zstd (mcap compress --compression zstd)",
        ),
        error => damaged(path, &error),
    };
    let mut file = File::open(path).map_err(io)?;
    let options = LinearReaderOptions::default().with_record_length_limit(LONGEST_RECORD);
    let mut reader = LinearReader::new_with_options(options);
    let mut topics = Topics::new();
    let mut schemas: BTreeMap<u16, String> = BTreeMap::new();
    while let Some(event) = reader.next_event() {
        match event.map_err(damaged)? {
            LinearReadEvent::ReadRequest(wanted) => {
                let piece = reader.insert(wanted.clamp(1, PIECE));
                let read = file.read(piece).map_err(io)?;
                reader.notify_read(read);
            }
            LinearReadEvent::Record { data, opcode } => {
                match mcap::parse_record(opcode, data).map_err(damaged)? {
                    Record::Schema { header, .. } => {
                        schemas.insert(header.id, header.name);
                    }
                    Record::Channel(channel) => {
                        let kind = schemas.get(&channel.schema_id).map_or("", String::as_str);
                        let topic = Topic::new(&channel.topic, kind, &channel.message_encoding);
                        // A channel occurs again at the end of the file.
                        topics.entry(u32::from(channel.id)).or_insert(topic);
                    }
                    Record::Message { header, data } => {
                        let received_ns = i64::try_from(header.log_time).unwrap_or(i64::MAX);
                        take(
                            &mut topics,
                            u32::from(header.channel_id),
                            received_ns,
                            &data,
                        );
                    }
                    _ => {}
                }
            }
        }
    }
    Ok(merged(topics))
}

/// Reads a bag of ROS 2 in an SQLite file.
fn read_db3(path: &Path, choice: Choice<'_>) -> Result<Vec<Readings>> {
    // The last messages of a database that was not closed are in a file beside it.
    let mut beside = path.as_os_str().to_owned();
    beside.push("-wal");
    if std::fs::metadata(&beside).is_ok_and(|beside| beside.len() > 0) {
        let problem = "the bag was not closed: some of its messages are in the file beside it that ends in -wal";
        let remedy =
            "open the bag once with ros2 bag info or sqlite3, which moves them into the bag";
        return Err(Error::new(path.display(), problem, remedy));
    }
    File::open(path).map_err(|error| Error::io(path, &error))?;
    let topics = messages_of_database(path).map_err(|problem| damaged(path, &problem))?;
    chosen(path, &topics, choice)
}

fn messages_of_database(path: &Path) -> std::result::Result<Topics, String> {
    let mut found = Topics::new();
    let database = Database::open(path)?;
    let tables = database.tables()?;
    let table = |name: &str| {
        tables
            .get(name)
            .ok_or_else(|| format!("it has no table {name}"))
    };
    let (topics, messages) = (table("topics")?, table("messages")?);
    let columns = ["id", "name", "type", "serialization_format"].map(|name| topics.column(name));
    let [id, name, kind, encoding] = columns;
    let (id, name, kind, encoding) = (id?, name?, kind?, encoding?);
    database.each_row(topics, |row| {
        let topic = Topic::new(&row.text(name)?, &row.text(kind)?, &row.text(encoding)?);
        let number = u32::try_from(row.integer(id)?).map_err(|_| "a topic has no number")?;
        found.insert(number, topic);
        Ok(())
    })?;
    let (topic, data) = (messages.column("topic_id")?, messages.column("data")?);
    let received = messages.column("timestamp")?;
    database.each_row(messages, |row| {
        let number = u32::try_from(row.integer(topic)?).map_err(|_| "a message has no topic")?;
        // Other messages, such as images, are not read.
        if let Some(topic) = found.get_mut(&number).filter(|topic| topic.read.is_some()) {
            topic.take(row.integer(received)?, &row.bytes(data)?);
        }
        Ok(())
    })?;
    Ok(merged(found))
}

/// Takes numbers from the bytes of a message.
struct Fields<'a> {
    bytes: &'a [u8],
    at: usize,
    big_endian: bool,
    /// Whether each number begins at a multiple of its size, as in CDR.
    aligned: bool,
}

impl Fields<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        if self.aligned {
            self.at = self.at.next_multiple_of(N);
        }
        let mut taken: [u8; N] = self.bytes.get(self.at..self.at + N)?.try_into().ok()?;
        self.at += N;
        if self.big_endian {
            taken.reverse();
        }
        Some(taken)
    }

    /// Passes a text.
    fn text(&mut self) -> Option<()> {
        let length = self.u32()? as usize;
        self.at = self.at.checked_add(length)?;
        Some(())
    }

    fn u32(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    /// The stamp of a header.
    fn stamp_ns(&mut self, layout: Layout) -> Option<i64> {
        if layout == Layout::Ros1 {
            self.u32()?; // seq
        }
        let (seconds, nanoseconds) = (self.u32()?, self.u32()?);
        let seconds = match layout {
            Layout::Ros1 => i64::from(seconds),
            Layout::Cdr => i64::from(seconds.cast_signed()),
        };
        Some(seconds * 1_000_000_000 + i64::from(nanoseconds))
    }

    fn f64s<const N: usize>(&mut self) -> Option<[f64; N]> {
        let mut all = [0.0; N];
        for value in &mut all {
            *value = f64::from_le_bytes(self.take()?);
        }
        Some(all)
    }
}

/// The fields of a message.
fn fields_of(data: &[u8], layout: Layout) -> Option<Fields<'_>> {
    Some(match layout {
        Layout::Ros1 => Fields {
            bytes: data,
            at: 0,
            big_endian: false,
            aligned: false,
        },
        Layout::Cdr => Fields {
            bytes: data.get(4..)?, // encapsulation
            at: 0,
            big_endian: data[1] & 1 == 0,
            aligned: true,
        },
    })
}

/// A message; `None` if it is cut.
fn parse(data: &[u8], kind: Kind, layout: Layout) -> Option<Message> {
    let mut fields = fields_of(data, layout)?;
    let stamp_ns = fields.stamp_ns(layout)?;
    fields.text()?; // frame
    let (values, absent) = match kind {
        Kind::Mag => {
            let [x, y, z] = fields.f64s()?.map(|tesla: f64| tesla * TESLA_UT);
            ([x, y, z, 0.0, 0.0, 0.0], [false; 2])
        }
        Kind::Imu => {
            fields.f64s::<{ 4 + 9 }>()?;
            let [rx, ry, rz] = fields.f64s()?;
            let [of_rate, ..] = fields.f64s::<9>()?;
            let [ax, ay, az] = fields.f64s()?;
            let of_force = fields.f64s::<9>().map_or(0.0, |covariance| covariance[0]);
            let absent = [of_rate, of_force].map(|first| first == -1.0);
            ([rx, ry, rz, ax, ay, az], absent)
        }
    };
    Some(Message {
        stamp_ns,
        received_ns: 0,
        absent,
        values,
    })
}

#[cfg(test)]
mod tests;
