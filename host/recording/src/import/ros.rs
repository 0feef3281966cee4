//! Messages `sensor_msgs/Imu` and `sensor_msgs/MagneticField` of ROS 1 bags (version 2.0), of ROS 2 bags in SQLite files, and of MCAP files.
//!
//! Their time is the stamp of the header, which the driver has set. Only if it sets none, the time of reception is used.
//!
//! Drivers whose gyro and accelerometer have separate clocks publish two topics, each with one half of the message: the other half is 0, or its
//! covariance begins with -1, which the definition of the message reserves for this.

mod definition;

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
use definition::Before;

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

/// One message.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Imu {
    stamp_ns: i64,
    /// Time at which it was recorded.
    received_ns: i64,
    /// Whether the covariances of angular velocity and linear acceleration say that there are no readings.
    absent: [bool; 2],
    /// Angular velocity, rad/s; linear acceleration, m/s².
    values: [f64; 6],
}

/// A message of a magnetometer.
#[derive(Debug, Clone, Copy, PartialEq)]
struct MagneticField {
    stamp_ns: i64,
    /// Time at which it was recorded.
    received_ns: i64,
    /// Tesla.
    values: [f64; 3],
}

/// Tesla in µT.
const TESLA_UT: f64 = 1e6;

/// Encoding of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Layout {
    Ros1,
    Cdr,
}

/// A topic of a file.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Topic {
    name: String,
    kind: String,
    /// `None` if the messages are of another kind or encoding.
    layout: Option<Layout>,
    /// Whether the messages are of a magnetometer.
    is_mag: bool,
    /// What stands before the `sensor_msgs/Imu` of a message that contains one.
    before: Option<Before>,
}

impl Topic {
    /// `definition` is that of the messages, if the file has it.
    fn new(name: &str, kind: &str, encoding: &str, definition: &str) -> Self {
        let imu = ["sensor_msgs/Imu", "sensor_msgs/msg/Imu"].contains(&kind);
        let mags = ["sensor_msgs/MagneticField", "sensor_msgs/msg/MagneticField"];
        let is_mag = mags.contains(&kind);
        let layout = match encoding {
            "ros1" => Some(Layout::Ros1),
            "cdr" => Some(Layout::Cdr),
            _ => None,
        };
        let before = Before::of(kind, definition).filter(|_| !imu);
        Self {
            name: name.to_owned(),
            kind: kind.to_owned(),
            layout: layout.filter(|_| imu || is_mag || before.is_some()),
            is_mag,
            before,
        }
    }

    /// Whether its messages have a gyro and an accelerometer.
    fn is_inertial(&self) -> bool {
        self.layout.is_some() && !self.is_mag
    }
}

/// Messages by topic, as they come.
#[derive(Default)]
struct Found {
    /// By the number of the topic in the file.
    topics: BTreeMap<u32, Topic>,
    messages: BTreeMap<u32, Vec<Imu>>,
    /// Of magnetometers; `None` is a message that is cut.
    mags: BTreeMap<u32, Vec<Option<MagneticField>>>,
    broken: Option<String>,
}

impl Found {
    /// All topics with a gyro or an accelerometer, each with the number of its pair: those with both first.
    fn all_pairs(&self) -> Vec<(u32, u8)> {
        let inertial = self.topics.iter().filter(|(_, topic)| topic.is_inertial());
        let has = |topic: &u32| sensors(self.messages.get(topic).map_or(&[], Vec::as_slice));
        let mut all: Vec<(u32, [bool; 2])> = inertial.map(|(t, _)| (*t, has(t))).collect();
        all.sort_by_key(|(_, has)| *has != [true; 2]);
        let mut last = [0_u8; 2];
        let mut numbered = Vec::new();
        for (topic, has) in all {
            let own = (0..2).filter(|sensor| has[*sensor]);
            let number = 1 + own.clone().map(|sensor| last[sensor]).max().unwrap_or(0);
            if number > TriadName::MOST {
                break;
            }
            own.for_each(|sensor| last[sensor] = number);
            numbered.push((topic, number));
        }
        numbered
    }

    fn message(&mut self, topic: u32, received_ns: i64, data: &[u8]) {
        let Some(Topic {
            name,
            layout: Some(layout),
            is_mag,
            before,
            ..
        }) = self.topics.get(&topic)
        else {
            return;
        };
        if *is_mag {
            let field = parse_mag(data, *layout);
            let field = field.map(|field| MagneticField {
                received_ns,
                ..field
            });
            self.mags.entry(topic).or_default().push(field);
            return;
        }
        let messages = self.messages.entry(topic).or_default();
        match parse(data, *layout, before.as_ref()) {
            Some(imu) => messages.push(Imu { received_ns, ..imu }),
            None => {
                let number = messages.len() + 1;
                self.broken
                    .get_or_insert(format!("message {number} of {name}"));
            }
        }
    }
}

/// The messages of the chosen topics; without a choice, those of the only one, or of the only gyro and the only accelerometer.
fn chosen(path: &Path, mut found: Found, choice: Choice<'_>) -> Result<Vec<Readings>> {
    if matches!(choice.instance, Some(Instance::Number(_))) {
        let problem = "an instance is given, but topics have no instances";
        let remedy = "leave it out, and choose the topic";
        return Err(Error::new(path.display(), problem, remedy).about(Argument::Topic));
    }
    let is_mag = |name: &String| found.topics.values().any(|t| t.is_mag && t.name == *name);
    let (mags, wanted): (Vec<String>, Vec<String>) =
        choice.topics.iter().cloned().partition(is_mag);
    let numbers = match choice.instance.is_some() && wanted.is_empty() {
        true => found.all_pairs(),
        false => {
            let topics = choose(path, &found, &wanted)?;
            topics.into_iter().map(|topic| (topic, 1)).collect()
        }
    };
    if let Some(message) = &found.broken {
        let problem = format!("{message} is cut or is not a sensor_msgs/Imu");
        return Err(Error::new(path.display(), problem, "record it again"));
    }
    let several = numbers.len() > 1;
    let each = numbers.iter().map(|(topic, pair)| {
        let messages = found.messages.remove(topic).unwrap_or_default();
        let topic = &found.topics[topic];
        let mut readings = readings(&topic.name, &messages, several, *pair);
        if topic.before.is_some() {
            let note = format!(
                "{}: the sensor_msgs/Imu within {} is read",
                topic.name, topic.kind
            );
            readings.notes.push(note);
        }
        (*pair, readings)
    });
    let mut all: Vec<(u8, Readings)> = each.collect();
    // The others are interpolated at the times of the first.
    all.sort_by_key(|(pair, readings)| (*pair, std::cmp::Reverse(readings.len())));
    let mut all: Vec<Readings> = all.into_iter().map(|(_, readings)| readings).collect();
    all.extend(magnetometers(&found, &mags));
    Ok(all)
}

/// The readings of the magnetometers whose topics are `wanted`, or of all. A driver whose unit has none publishes zeros.
fn magnetometers(found: &Found, wanted: &[String]) -> Vec<Readings> {
    let measured = |field: &MagneticField| field.values.iter().any(|v| *v != 0.0 && !v.is_nan());
    let mut all: Vec<Readings> = Vec::new();
    for (topic, messages) in &found.mags {
        let name = &found.topics[topic].name;
        let fields: Vec<&MagneticField> = messages.iter().flatten().collect();
        let chosen = wanted.is_empty() || wanted.contains(name);
        let number = all.len() + 1;
        let Some(number) = u8::try_from(number).ok().filter(|n| *n <= TriadName::MOST) else {
            break;
        };
        if !chosen || !fields.iter().any(|field| measured(field)) {
            continue;
        }
        let kind = TriadKind::Mag;
        let mut readings = Readings::of_triads([TriadName { kind, number }]);
        let stamped = fields
            .iter()
            .any(|field| field.stamp_ns != fields[0].stamp_ns);
        for field in &fields {
            let stamp_ns = if stamped {
                field.stamp_ns
            } else {
                field.received_ns
            };
            readings.push(stamp_ns, field.values.map(|tesla| tesla * TESLA_UT));
        }
        let (count, cut) = (messages.len(), messages.len() - fields.len());
        readings
            .notes
            .push(format!("{count} messages of {name}, a magnetometer"));
        if cut > 0 {
            readings.warnings.push(format!(
                "{cut} messages of {name} are cut, and were left out"
            ));
        }
        all.push(readings.sorted());
    }
    all
}

/// The readings of the topic `name`, which is the pair `number`; `several`: it is one of several that are joined.
fn readings(name: &str, messages: &[Imu], several: bool, number: u8) -> Readings {
    let has = sensors(messages);
    let kinds = [TriadKind::Gyro, TriadKind::Accel].into_iter().zip(has);
    let kinds = kinds.filter(|(_, has)| *has);
    let mut readings = Readings::of_triads(kinds.map(|(kind, _)| TriadName { kind, number }));
    let stamped = messages
        .iter()
        .any(|imu| imu.stamp_ns != messages[0].stamp_ns);
    if !stamped && messages.len() > 1 {
        readings.warnings.push(format!("{name}: all headers have the same stamp, so the times of reception are used, which are late by varying delays"));
    }
    for imu in messages {
        let values = (0..6)
            .filter(|channel| has[channel / 3])
            .map(|c| imu.values[c]);
        let stamp_ns = if stamped {
            imu.stamp_ns
        } else {
            imu.received_ns
        };
        readings.push(stamp_ns, values);
    }
    if several || has != [true; 2] {
        readings.notes.push(format!(
            "{} messages of {name}, of which {} is read",
            messages.len(),
            contents(has)
        ));
    }
    readings
}

/// Whether gyro and accelerometer have readings in `messages`. A half that is 0 throughout belongs to a driver that fills only the other one. If both
/// halves are empty, both count as present, so that the import refuses them with their number.
fn sensors(messages: &[Imu]) -> [bool; 2] {
    let has = [0, 1].map(|sensor| {
        messages.iter().any(|imu| {
            let values = &imu.values[3 * sensor..3 * sensor + 3];
            !imu.absent[sensor] && values.iter().any(|v| *v != 0.0 && !v.is_nan())
        })
    });
    if has == [false; 2] { [true; 2] } else { has }
}

/// Which sensors there are, for people.
fn contents(has: [bool; 2]) -> &'static str {
    match has {
        [true, false] => "the gyro",
        [false, true] => "the accelerometer",
        _ => "both sensors",
    }
}

/// The numbers of the topics to read.
fn choose(path: &Path, found: &Found, wanted: &[String]) -> Result<Vec<u32>> {
    let topics = &found.topics;
    let list = |topics: Vec<&Topic>| {
        let each = topics.iter().map(|t| format!("{} ({})", t.name, t.kind));
        each.collect::<Vec<_>>().join(", ")
    };
    let refuse = |problem: String, remedy: &str| {
        Err(Error::new(path.display(), problem, remedy).about(Argument::Topic))
    };
    let fits = topics.iter().filter(|(_, topic)| topic.is_inertial());
    let fits: Vec<(&u32, &Topic)> = fits.collect();
    let mut chosen = Vec::new();
    for name in wanted {
        match fits.iter().find(|(_, topic)| topic.name == *name) {
            Some((number, _)) => chosen.push(**number),
            None => {
                let all = list(topics.values().collect());
                let problem =
                    format!("the file has no topic {name} with sensor_msgs/Imu; it has: {all}");
                return refuse(problem, "choose another file or topic");
            }
        }
    }
    if !chosen.is_empty() {
        return Ok(chosen);
    }
    let filled = |number: &u32| found.messages.get(number).map_or(&[][..], Vec::as_slice);
    match fits.as_slice() {
        [(number, _)] => return Ok(vec![**number]),
        [] => {
            let all = list(topics.values().collect());
            let problem = format!("the file has no topic with sensor_msgs/Imu; it has: {all}");
            return refuse(problem, "choose another file or topic");
        }
        _ => {}
    }
    let has: Vec<[bool; 2]> = fits.iter().map(|(n, _)| sensors(filled(n))).collect();
    let only = |what: [bool; 2]| {
        let mut those = (0..fits.len()).filter(|k| has[*k] == what);
        those.next().filter(|_| those.next().is_none())
    };
    if let (Some(gyro), Some(accel), 2) = (only([true, false]), only([false, true]), fits.len()) {
        return Ok(vec![*fits[gyro].0, *fits[accel].0]);
    }
    let each = fits.iter().zip(&has).map(|((number, topic), has)| {
        let count = filled(number).len();
        format!(
            "{} ({}, {count} messages of {})",
            topic.name,
            topic.kind,
            contents(*has)
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
    chosen(path, guarded(path, || messages_of_bag(path))?, choice)
}

/// The reader of bags maps the file into memory, which a browser cannot.
#[cfg(target_family = "wasm")]
fn messages_of_bag(path: &Path) -> Result<Found> {
    let problem = "a browser cannot read bags of ROS 1";
    let remedy = "import it with the command mimu, or convert it to MCAP (mcap convert)";
    Err(Error::new(path.display(), problem, remedy))
}

#[cfg(not(target_family = "wasm"))]
fn messages_of_bag(path: &Path) -> Result<Found> {
    use rosbag::{ChunkRecord, IndexRecord, MessageRecord, RosBag};
    let damaged = |error: rosbag::Error| damaged(path, &error);
    File::open(path).map_err(|error| Error::io(path, &error))?;
    let bag = RosBag::new(path).map_err(|error| self::damaged(path, &error))?;
    let mut found = Found::default();
    for record in bag.index_records() {
        if let IndexRecord::Connection(connection) = record.map_err(damaged)? {
            let topic = Topic::new(
                connection.storage_topic,
                connection.tp,
                "ros1",
                connection.message_definition,
            );
            found.topics.insert(connection.id, topic);
        }
    }
    for record in bag.chunk_records() {
        let ChunkRecord::Chunk(chunk) = record.map_err(damaged)? else {
            continue;
        };
        for message in chunk.messages() {
            if let MessageRecord::MessageData(message) = message.map_err(damaged)? {
                let received_ns = i64::try_from(message.time).unwrap_or(i64::MAX);
                found.message(message.conn_id, received_ns, message.data);
            }
        }
    }
    merge(&mut found);
    Ok(found)
}

/// Merges all connections of a topic: each node that publishes has a separate one.
fn merge(found: &mut Found) {
    let mut first: BTreeMap<String, u32> = BTreeMap::new();
    let numbers: Vec<u32> = found.topics.keys().copied().collect();
    for number in numbers {
        let name = found.topics[&number].name.clone();
        let to = *first.entry(name).or_insert(number);
        if to != number {
            found.topics.remove(&number);
            let more = found.messages.remove(&number).unwrap_or_default();
            let all = found.messages.entry(to).or_default();
            all.extend(more);
            all.sort_by_key(|imu| imu.stamp_ns);
            if let Some(more) = found.mags.remove(&number) {
                found.mags.entry(to).or_default().extend(more);
            }
        }
    }
}

/// Reads an MCAP file.
fn read_mcap(path: &Path, choice: Choice<'_>) -> Result<Vec<Readings>> {
    chosen(path, guarded(path, || messages_of_mcap(path))?, choice)
}

fn messages_of_mcap(path: &Path) -> Result<Found> {
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
    let mut found = Found::default();
    let mut schemas: BTreeMap<u16, (String, String)> = BTreeMap::new();
    while let Some(event) = reader.next_event() {
        match event.map_err(damaged)? {
            LinearReadEvent::ReadRequest(wanted) => {
                let piece = reader.insert(wanted.clamp(1, PIECE));
                let read = file.read(piece).map_err(io)?;
                reader.notify_read(read);
            }
            LinearReadEvent::Record { data, opcode } => {
                match mcap::parse_record(opcode, data).map_err(damaged)? {
                    Record::Schema { header, data } => {
                        let definition = String::from_utf8_lossy(&data).into_owned();
                        schemas.insert(header.id, (header.name, definition));
                    }
                    Record::Channel(channel) => {
                        let none = Default::default();
                        let (kind, definition) = schemas.get(&channel.schema_id).unwrap_or(&none);
                        let encoding = &channel.message_encoding;
                        let topic = Topic::new(&channel.topic, kind, encoding, definition);
                        found.topics.insert(u32::from(channel.id), topic);
                    }
                    Record::Message { header, data } => {
                        let received_ns = i64::try_from(header.log_time).unwrap_or(i64::MAX);
                        found.message(u32::from(header.channel_id), received_ns, &data);
                    }
                    _ => {}
                }
            }
        }
    }
    merge(&mut found);
    Ok(found)
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
    let found = messages_of_database(path).map_err(|problem| damaged(path, &problem))?;
    chosen(path, found, choice)
}

fn messages_of_database(path: &Path) -> std::result::Result<Found, String> {
    let mut found = Found::default();
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
    // From Iron on.
    let mut definitions: BTreeMap<String, String> = BTreeMap::new();
    if let Some(table) = tables.get("message_definitions") {
        let of = table.column("topic_type")?;
        let text = table.column("encoded_message_definition")?;
        database.each_row(table, |row| {
            definitions.insert(row.text(of)?, row.text(text)?);
            Ok(())
        })?;
    }
    database.each_row(topics, |row| {
        let kind = row.text(kind)?;
        let definition = definitions.get(&kind).map_or("", String::as_str);
        let topic = Topic::new(&row.text(name)?, &kind, &row.text(encoding)?, definition);
        let number = u32::try_from(row.integer(id)?).map_err(|_| "a topic has no number")?;
        found.topics.insert(number, topic);
        Ok(())
    })?;
    let (topic, data) = (messages.column("topic_id")?, messages.column("data")?);
    let received = messages.column("timestamp")?;
    database.each_row(messages, |row| {
        let number = u32::try_from(row.integer(topic)?).map_err(|_| "a message has no topic")?;
        // Other messages, such as images, are not read.
        if found
            .topics
            .get(&number)
            .is_some_and(|topic| topic.layout.is_some())
        {
            found.message(number, row.integer(received)?, &row.bytes(data)?);
        }
        Ok(())
    })?;
    merge(&mut found);
    Ok(found)
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

/// A message of a magnetometer; `None` if it is cut.
fn parse_mag(data: &[u8], layout: Layout) -> Option<MagneticField> {
    let mut fields = fields_of(data, layout)?;
    let stamp_ns = fields.stamp_ns(layout)?;
    fields.text()?; // frame
    Some(MagneticField {
        stamp_ns,
        received_ns: 0,
        values: fields.f64s()?,
    })
}

/// A message, or the one behind the fields `before`; `None` if it is cut.
fn parse(data: &[u8], layout: Layout, before: Option<&Before>) -> Option<Imu> {
    let mut fields = fields_of(data, layout)?;
    let mut outer_ns = 0;
    if let Some(before) = before {
        if before.header {
            outer_ns = fields.stamp_ns(layout)?;
            fields.at = 0;
        }
        before.pass(&mut fields)?;
    }
    let stamp_ns = fields.stamp_ns(layout)?;
    fields.text()?; // frame
    fields.f64s::<{ 4 + 9 }>()?;
    let [rx, ry, rz] = fields.f64s()?;
    let [of_rate, ..] = fields.f64s::<9>()?;
    let [ax, ay, az] = fields.f64s()?;
    let of_force = fields.f64s::<9>().map_or(0.0, |covariance| covariance[0]);
    Some(Imu {
        stamp_ns: if stamp_ns == 0 { outer_ns } else { stamp_ns },
        received_ns: 0,
        absent: [of_rate, of_force].map(|first| first == -1.0),
        values: [rx, ry, rz, ax, ay, az],
    })
}

#[cfg(test)]
mod tests;
