//! Compatibility of two versions: longer records, and additional variants.
//!
//! Used as `#[serde(with = "extensible")]`, a field is written as its length followed by its bytes in postcard. A reader that does not know
//! the variant gets the default of the type, and continues after the field.

use postcard::Error;
use postcard::de_flavors::Flavor;
use serde::de::{Deserialize, Deserializer};
use serde::ser::{Error as _, Serialize, Serializer};

/// Most bytes of a field with its length in front: the end of a path, of 40 bytes, and some numbers.
const ROOM: usize = 64;

pub(super) fn serialize<T: Serialize, S: Serializer>(value: &T, to: S) -> Result<S::Ok, S::Error> {
    let mut room = [0; ROOM];
    let bytes = postcard::to_slice(value, &mut room);
    let bytes = bytes.map_err(|_| S::Error::custom("longer than the room for it"))?;
    to.serialize_bytes(bytes)
}

pub(super) fn deserialize<'de, T, D>(from: D) -> Result<T, D::Error>
where
    T: Deserialize<'de> + Default,
    D: Deserializer<'de>,
{
    let bytes = <&'de [u8]>::deserialize(from)?;
    let read = postcard::take_from_bytes::<T>(bytes);
    Ok(read.map_or_else(|_| T::default(), |(value, _)| value))
}

/// The same for two fields in a row, each after its own length.
pub(super) mod pair {
    use serde::de::{Deserialize, Deserializer};
    use serde::ser::{Serialize, Serializer};

    struct One<T>(T);

    impl<T: Serialize> Serialize for One<&T> {
        fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
            super::serialize(self.0, to)
        }
    }

    impl<'de, T: Deserialize<'de> + Default> Deserialize<'de> for One<T> {
        fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
            super::deserialize(from).map(Self)
        }
    }

    pub(in super::super) fn serialize<T: Serialize, S: Serializer>(
        [a, b]: &[T; 2],
        to: S,
    ) -> Result<S::Ok, S::Error> {
        [One(a), One(b)].serialize(to)
    }

    pub(in super::super) fn deserialize<'de, T, D>(from: D) -> Result<[T; 2], D::Error>
    where
        T: Deserialize<'de> + Default,
        D: Deserializer<'de>,
    {
        let [One(a), One(b)] = <[One<T>; 2]>::deserialize(from)?;
        Ok([a, b])
    }
}

/// An optional last field: `None` is written as no bytes, like a version that does not know the field.
pub(super) mod last {
    use serde::de::{Deserialize, Deserializer};
    use serde::ser::{Serialize, Serializer};

    pub(in super::super) fn serialize<T: Serialize, S: Serializer>(
        value: &Option<T>,
        to: S,
    ) -> Result<S::Ok, S::Error> {
        match value {
            Some(_) => value.serialize(to),
            None => to.serialize_unit(),
        }
    }

    pub(in super::super) fn deserialize<'de, T, D>(from: D) -> Result<Option<T>, D::Error>
    where
        T: Deserialize<'de>,
        D: Deserializer<'de>,
    {
        Option::deserialize(from)
    }
}

/// Bytes followed by zeros without end. In postcard a zero is 0, false, `None`, the first variant, or an empty text.
pub(super) struct Tolerant<'de> {
    rest: &'de [u8],
    cut: bool,
}

/// Zeros that one read can get after the end; no read needs more.
static ZEROS: [u8; 16] = [0; 16];

impl<'de> Tolerant<'de> {
    /// Reads from the beginning of `bytes`.
    pub fn read<T: Deserialize<'de>>(bytes: &'de [u8]) -> postcard::Result<(T, Self)> {
        let begin = Self {
            rest: bytes,
            cut: false,
        };
        let mut from = postcard::Deserializer::from_flavor(begin);
        let value = T::deserialize(&mut from)?;
        Ok((value, from.finalize()?))
    }

    /// Whether the bytes ended before the value did.
    pub fn is_cut(&self) -> bool {
        self.cut
    }

    /// Whether bytes and value ended together.
    pub fn is_exact(&self) -> bool {
        !self.cut && self.rest.is_empty()
    }
}

impl<'de> Flavor<'de> for Tolerant<'de> {
    type Remainder = Self;
    type Source = &'de [u8];

    fn pop(&mut self) -> postcard::Result<u8> {
        match self.rest.split_first() {
            Some((byte, rest)) => {
                self.rest = rest;
                Ok(*byte)
            }
            None => {
                self.cut = true;
                Ok(0)
            }
        }
    }

    fn try_take_n(&mut self, count: usize) -> postcard::Result<&'de [u8]> {
        if let Some((taken, rest)) = self.rest.split_at_checked(count) {
            self.rest = rest;
            return Ok(taken);
        }
        // The value is cut in the middle, which no version sends.
        let behind = self.rest.is_empty();
        self.cut = true;
        let zeros = ZEROS.get(..count).filter(|_| behind);
        zeros.ok_or(Error::DeserializeUnexpectedEnd)
    }

    fn finalize(self) -> postcard::Result<Self> {
        Ok(self)
    }
}
