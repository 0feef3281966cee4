//! Position of each key in a TOML text.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range;

use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};
use toml::Spanned;

/// Keys of a table, elements of a list, or neither, with their positions in the text.
///
/// It would be possible to mark every checked value with `Spanned`, but then truths could not be compared or constructed in code.
#[derive(Debug)]
pub enum Lines {
    Table(BTreeMap<String, (Range<usize>, Lines)>),
    List(Vec<Lines>),
    Value,
}

impl Lines {
    /// Bytes of the key at the end of a dotted path (`effect.1.id`, elements counted from 0), or of the last existing key on the way.
    pub fn find(&self, path: &str) -> Range<usize> {
        let mut at = 0..0;
        let mut here = self;
        for part in path.split('.') {
            let next = match here {
                Self::Table(keys) => keys.get(part).map(|(span, next)| {
                    at = span.clone();
                    next
                }),
                Self::List(list) => part.parse::<usize>().ok().and_then(|i| list.get(i)),
                Self::Value => None,
            };
            let Some(next) = next else { break };
            here = next;
            // Tables in a list have no key: the first key within is next to their heading.
            if let (Self::Table(keys), Ok(_)) = (here, part.parse::<usize>()) {
                let first = keys
                    .values()
                    .map(|(span, _)| span.clone())
                    .min_by_key(|s| s.start);
                at = first.unwrap_or(at);
            }
        }
        at
    }
}

impl<'de> Deserialize<'de> for Lines {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Walk)
    }
}

struct Walk;

impl<'de> Visitor<'de> for Walk {
    type Value = Lines;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a TOML value")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Lines, A::Error> {
        let mut keys = BTreeMap::new();
        while let Some((key, value)) = map.next_entry::<Spanned<String>, Lines>()? {
            let span = key.span();
            keys.insert(key.into_inner(), (span, value));
        }
        Ok(Lines::Table(keys))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Lines, A::Error> {
        let mut list = Vec::new();
        while let Some(element) = seq.next_element()? {
            list.push(element);
        }
        Ok(Lines::List(list))
    }

    fn visit_bool<E>(self, _: bool) -> Result<Lines, E> {
        Ok(Lines::Value)
    }

    fn visit_i64<E>(self, _: i64) -> Result<Lines, E> {
        Ok(Lines::Value)
    }

    fn visit_f64<E>(self, _: f64) -> Result<Lines, E> {
        Ok(Lines::Value)
    }

    fn visit_str<E>(self, _: &str) -> Result<Lines, E> {
        Ok(Lines::Value)
    }
}
