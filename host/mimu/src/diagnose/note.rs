//! Notes on accepted effects for the user.

use std::fmt;

use serde::{Serialize, Serializer};

/// A note on an accepted effect for the user. In JSON it is one string.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Note {
    /// What was found.
    pub found: String,
    /// What follows from it, or what to do about it; empty where that is in [`Self::found`].
    pub advice: String,
}

impl Note {
    pub(super) fn new(found: String, advice: impl Into<String>) -> Self {
        let advice = advice.into();
        Self { found, advice }
    }
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self.advice.is_empty() {
            true => f.write_str(&self.found),
            false => write!(f, "{}; {}", self.found, self.advice),
        }
    }
}

impl Serialize for Note {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}
