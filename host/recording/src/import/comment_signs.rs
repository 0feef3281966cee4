//! Characters that begin a comment line.

use std::fmt;
use std::str::FromStr;

use crate::cell::shorten;
use crate::error::{Error, Result};
use crate::separator::{Characters, Separator};

/// Characters of which any, at the beginning of a line, makes the line a comment. By default `#` and `%`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CommentSigns(Option<Characters>);

impl Default for CommentSigns {
    fn default() -> Self {
        Self(Characters::of("#%"))
    }
}

impl CommentSigns {
    /// No character begins a comment.
    pub(crate) const NONE: Self = Self(None);

    /// The sign by which `line` is a comment, after blanks.
    pub(super) fn begins(self, line: &[u8]) -> Option<u8> {
        let first = *line.trim_ascii().first()?;
        self.0?.contains(first).then_some(first)
    }

    /// The line after blanks and signs of a comment: names may follow them.
    pub(super) fn skipped(self, line: &[u8]) -> &[u8] {
        let is_sign = |b: &u8| b.is_ascii_whitespace() || self.begins(&[*b]).is_some();
        let from = line.iter().position(|b| !is_sign(b));
        &line[from.unwrap_or(line.len())..]
    }
}

impl FromStr for CommentSigns {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match (text, Characters::of(text)) {
            ("none", _) => Ok(Self::NONE),
            (_, Some(signs)) => Ok(Self(Some(signs))),
            (_, None) => Err(Error::new(
                "signs of comments",
                format!("{} does not begin a comment", shorten(text.as_bytes())),
                "write the characters that begin a comment line, such as '#;', or none",
            )),
        }
    }
}

impl fmt::Display for CommentSigns {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Some(signs) => signs.fmt(f),
            None => f.write_str("none"),
        }
    }
}

/// What is given about the lines of a text file.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct TextFormat {
    /// Separator of cells; detected if `None`.
    pub separator: Option<Separator>,
    pub comments: CommentSigns,
}

impl From<Option<Separator>> for TextFormat {
    fn from(separator: Option<Separator>) -> Self {
        Self {
            separator,
            ..Self::default()
        }
    }
}
