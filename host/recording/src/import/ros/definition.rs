//! Where a message that contains a `sensor_msgs/Imu` has it, by the definition of the message in the file (`.msg` files, one after the other).

use std::collections::BTreeMap;

use super::Fields;

/// Messages within messages that are followed; the deepest that are in use have five.
const DEEPEST: usize = 16;

/// A field that stands before the searched one.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Field {
    /// A number of so many bytes.
    Number(u8),
    Text,
    /// So many items, or as many as a number before them says.
    Items(Option<u32>, Vec<Field>),
}

/// The fields before the `sensor_msgs/Imu` of a message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Before {
    fields: Vec<Field>,
    /// Whether the message begins with its own header.
    pub header: bool,
}

impl Before {
    /// Of messages of `kind` by their `definition`; `None` if they contain no `sensor_msgs/Imu`, or a kind of field that is not known.
    pub fn of(kind: &str, definition: &str) -> Option<Self> {
        let mut messages: BTreeMap<String, Vec<(&str, &str)>> = BTreeMap::new();
        let mut current = short(kind);
        for line in definition.lines() {
            let line = line.split('#').next().unwrap_or_default().trim();
            if let Some(name) = line.strip_prefix("MSG:") {
                current = short(name.trim());
                continue;
            }
            let mut words = line.split_whitespace();
            // Constants have a value.
            if let (Some(kind), Some(name), false) = (
                words.next(),
                words.next(),
                line.contains('=') && !line.contains("<="),
            ) && !kind.starts_with("==")
            {
                messages
                    .entry(current.clone())
                    .or_default()
                    .push((kind, name));
            }
        }
        let kind = short(kind);
        let header = messages
            .get(&kind)?
            .first()
            .is_some_and(|(kind, _)| kind.ends_with("Header"));
        let mut fields = Vec::new();
        let found = until_imu(&messages, &kind, &mut fields, 0)?;
        found.then_some(Self { fields, header })
    }

    /// Passes them; `None` if the message is cut.
    pub fn pass(&self, message: &mut Fields<'_>) -> Option<()> {
        pass(&self.fields, message)
    }
}

/// `sensor_msgs/Imu` for `sensor_msgs/msg/Imu`.
fn short(kind: &str) -> String {
    kind.replace("/msg/", "/")
}

/// Collects the fields of message `kind` up to its `sensor_msgs/Imu`, and returns whether there is one; `None` for an unknown field.
fn until_imu(
    messages: &BTreeMap<String, Vec<(&str, &str)>>,
    kind: &str,
    fields: &mut Vec<Field>,
    depth: usize,
) -> Option<bool> {
    for (of, _) in messages.get(kind).filter(|_| depth < DEEPEST)? {
        let (of, items) = match of.split_once('[') {
            Some((of, length)) => (of, Some(length.trim_end_matches(']').parse().ok())),
            None => (*of, None),
        };
        let mut own = Vec::new();
        let number = match of.split("<=").next()? {
            "bool" | "int8" | "uint8" | "byte" | "char" => Some(1),
            "int16" | "uint16" => Some(2),
            "int32" | "uint32" | "float32" => Some(4),
            "int64" | "uint64" | "float64" => Some(8),
            _ => None,
        };
        match (number, of.split("<=").next()?) {
            (Some(size), _) => own.push(Field::Number(size)),
            (None, "string") => own.push(Field::Text),
            (None, "time" | "duration") => own.extend([Field::Number(4), Field::Number(4)]),
            (None, message) => {
                let named = short(message);
                let within = kind
                    .rsplit_once('/')
                    .map(|(package, _)| format!("{package}/{named}"));
                let ends = format!("/{named}");
                let known = |name: &&String| **name == named || Some(*name) == within.as_ref();
                let mut names = messages.keys();
                let name = names
                    .find(known)
                    .or(messages.keys().find(|name| name.ends_with(&ends)))?;
                if name == "sensor_msgs/Imu" && items.is_none() {
                    return Some(true);
                }
                if until_imu(messages, name, &mut own, depth + 1)? && items.is_none() {
                    fields.extend(own);
                    return Some(true);
                }
            }
        }
        match items {
            Some(length) => fields.push(Field::Items(length, own)),
            None => fields.extend(own),
        }
    }
    Some(false)
}

fn pass(fields: &[Field], message: &mut Fields<'_>) -> Option<()> {
    for field in fields {
        match field {
            Field::Number(1) => drop(message.take::<1>()?),
            Field::Number(2) => drop(message.take::<2>()?),
            Field::Number(4) => drop(message.take::<4>()?),
            Field::Number(_) => drop(message.take::<8>()?),
            Field::Text => message.text()?,
            Field::Items(length, items) => {
                let length = match length {
                    Some(length) => *length,
                    None => message.u32()?,
                };
                for _ in 0..length {
                    pass(items, message)?;
                }
            }
        }
    }
    Some(())
}
