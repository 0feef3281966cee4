//! Records of a DataFlash log. Each begins with two fixed bytes and a number; an earlier record `FMT` describes the records with this number.

use std::collections::BTreeMap;

/// First two bytes of each record.
const BEGINNING: [u8; 2] = [0xA3, 0x95];

/// Number of the `FMT` records, and their length including beginning and number.
const FORMAT: u8 = 128;
const FORMAT_LENGTH: usize = 89;

/// Layout of the records with one number.
#[derive(Debug, Default)]
struct Format {
    name: String,
    length: usize,
    /// Name, kind and position of each field behind beginning and number.
    fields: Vec<(String, u8, usize)>,
}

/// Reads the records of a log one after the other.
pub(super) struct Records<'a> {
    bytes: &'a [u8],
    at: usize,
    formats: BTreeMap<u8, Format>,
    /// Bytes that belong to no record.
    pub skipped: u64,
}

/// A record.
pub(super) struct Record<'a> {
    format: &'a Format,
    data: &'a [u8],
}

impl<'a> Records<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self {
            bytes,
            at: 0,
            formats: BTreeMap::new(),
            skipped: 0,
        }
    }

    /// How many kinds of records the log has described so far.
    pub fn formats(&self) -> usize {
        self.formats.len()
    }

    /// The next record whose layout is known. Bytes between records are skipped and counted.
    pub fn next(&mut self) -> Option<Record<'_>> {
        loop {
            let rest = self.bytes.get(self.at..).filter(|rest| !rest.is_empty())?;
            let length = match rest {
                [a, b, FORMAT, ..] if [*a, *b] == BEGINNING => FORMAT_LENGTH,
                [a, b, number, ..] if [*a, *b] == BEGINNING => {
                    self.formats.get(number).map_or(0, |format| format.length)
                }
                _ => 0,
            };
            if length < 3 || length > rest.len() {
                // Not a record: search for the next one byte by byte.
                self.at += 1;
                self.skipped += 1;
                continue;
            }
            self.at += length;
            let (number, data) = (rest[2], &rest[3..length]);
            if number == FORMAT {
                self.describe(data);
                continue;
            }
            // Its length was found above.
            let format = self.formats.get(&number)?;
            return Some(Record { format, data });
        }
    }

    /// Reads a record `FMT`: number and length of the records, their name, and the kinds and names of their fields.
    fn describe(&mut self, data: &[u8]) {
        let (number, length) = (data[0], usize::from(data[1]));
        let name = text(&data[2..6]);
        let kinds = text(&data[6..22]);
        let labels = text(&data[22..86]);
        let mut at = 0;
        let mut fields = Vec::new();
        for (kind, label) in kinds.bytes().zip(labels.split(',')) {
            fields.push((label.to_owned(), kind, at));
            let Some(width) = width(kind) else {
                // After a field of unknown width, positions are unknown.
                fields.pop();
                break;
            };
            at += width;
        }
        self.formats.insert(
            number,
            Format {
                name,
                length,
                fields,
            },
        );
    }
}

impl Record<'_> {
    /// Name of its kind, such as `IMU`.
    pub fn name(&self) -> &str {
        &self.format.name
    }

    fn field(&self, name: &str) -> Option<(u8, &[u8])> {
        let fields = &self.format.fields;
        let (_, kind, at) = fields.iter().find(|(own, _, _)| own == name)?;
        Some((*kind, self.data.get(*at..*at + width(*kind)?)?))
    }

    /// The number in field `name`, in the field's unit.
    pub fn number(&self, name: &str) -> Option<f64> {
        let (kind, bytes) = self.field(name)?;
        Some(match kind {
            b'b' => f64::from(i8::from_le_bytes(bytes.try_into().ok()?)),
            b'B' | b'M' => f64::from(bytes[0]),
            b'h' => f64::from(i16::from_le_bytes(bytes.try_into().ok()?)),
            b'H' => f64::from(u16::from_le_bytes(bytes.try_into().ok()?)),
            b'c' => f64::from(i16::from_le_bytes(bytes.try_into().ok()?)) / 100.0,
            b'C' => f64::from(u16::from_le_bytes(bytes.try_into().ok()?)) / 100.0,
            b'i' => f64::from(i32::from_le_bytes(bytes.try_into().ok()?)),
            b'I' => f64::from(u32::from_le_bytes(bytes.try_into().ok()?)),
            b'e' => f64::from(i32::from_le_bytes(bytes.try_into().ok()?)) / 100.0,
            b'E' => f64::from(u32::from_le_bytes(bytes.try_into().ok()?)) / 100.0,
            b'f' => f64::from(f32::from_le_bytes(bytes.try_into().ok()?)),
            b'd' => f64::from_le_bytes(bytes.try_into().ok()?),
            // Microseconds since the start: a double counts them for 285 years.
            b'q' => i64::from_le_bytes(bytes.try_into().ok()?) as f64,
            b'Q' => u64::from_le_bytes(bytes.try_into().ok()?) as f64,
            _ => return None,
        })
    }

    /// The text in field `name`.
    pub fn text(&self, name: &str) -> Option<String> {
        let (kind, bytes) = self.field(name)?;
        matches!(kind, b'n' | b'N' | b'Z').then(|| text(bytes))
    }
}

/// Bytes of a field of `kind`.
fn width(kind: u8) -> Option<usize> {
    Some(match kind {
        b'b' | b'B' | b'M' => 1,
        b'h' | b'H' | b'c' | b'C' | b'g' => 2,
        b'i' | b'I' | b'e' | b'E' | b'f' | b'L' | b'n' => 4,
        b'd' | b'q' | b'Q' => 8,
        b'N' => 16,
        b'a' | b'Z' => 64,
        _ => return None,
    })
}

/// Text up to its first zero byte.
fn text(bytes: &[u8]) -> String {
    let end = bytes
        .iter()
        .position(|byte| *byte == 0)
        .unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}
