//! TOML files written by people: every error is one line with the file, the line, and the remedy.

use std::fmt::Display;
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::ops::Range;
use std::path::Path;

use serde::de::DeserializeOwned;

/// Largest size of a file, bytes: ten thousand times what a person writes. A larger one is another file, or a device.
const LARGEST: u64 = 16 << 20;

/// A text file and its name, for error messages that name the line.
#[derive(Debug, Clone)]
pub struct Source {
    name: String,
    text: String,
}

impl Source {
    /// Text in memory, with the name for its error messages.
    pub fn new(name: impl Into<String>, text: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            text: text.into(),
        }
    }

    /// Reads a file. A missing file, a directory, or a file that is not UTF-8 text is refused in one line.
    pub fn read(path: &Path) -> Result<Self, String> {
        let name = path.display().to_string();
        let read = File::open(path).and_then(|file| {
            let mut bytes = Vec::new();
            file.take(LARGEST + 1).read_to_end(&mut bytes)?;
            Ok(bytes)
        });
        let bytes = match read {
            Ok(bytes) if bytes.len() as u64 > LARGEST => {
                return Err(format!(
                    "{name}: is larger than {} MiB; is it the right file?",
                    LARGEST >> 20
                ));
            }
            Ok(bytes) => bytes,
            Err(e) if e.kind() == ErrorKind::NotFound => {
                return Err(format!("{name}: the file does not exist; check the path"));
            }
            Err(_) if path.is_dir() => {
                return Err(format!("{name}: is a directory; name the TOML file in it"));
            }
            Err(e) => {
                return Err(format!(
                    "{name}: cannot be read: {e}; check the file and its permissions"
                ));
            }
        };
        match String::from_utf8(bytes) {
            Ok(text) => Ok(Self { name, text }),
            Err(e) => {
                let good = &e.as_bytes()[..e.utf8_error().valid_up_to()];
                let line = 1 + good.iter().filter(|&&b| b == b'\n').count();
                Err(format!(
                    "{name}:{line}: is not UTF-8 text; is it the right file? If so, save it as UTF-8"
                ))
            }
        }
    }

    /// One line: `FILE:LINE: problem; remedy`, with the line on which the bytes `at` begin.
    pub fn error(&self, at: &Range<usize>, problem: impl Display, remedy: impl Display) -> String {
        // A span may begin at the very end; then the last line is reported.
        let text = self.text.trim_end().as_bytes();
        let before = &text[..at.start.min(text.len())];
        let line = 1 + before.iter().filter(|&&b| b == b'\n').count();
        format!("{}:{line}: {problem}; {remedy}", self.name)
    }

    /// Reads the text as `T`. This type should refuse unknown fields, and mark with [`toml::Spanned`] the values that are checked later;
    /// `serde(flatten)` would lose the lines. The message is that of serde and the parser, which names the possible keys and values.
    ///
    /// The bench has a separate reader. With a shared one, a plan that the host misreads would be misread here too, and no test would show it.
    pub fn parse<T: DeserializeOwned>(&self) -> Result<T, String> {
        toml::from_str(&self.text).map_err(|e| {
            // Without a span, the error concerns the whole file.
            let span = e.span().unwrap_or(0..0);
            let message = e.message().trim().replace('\n', ", ");
            let (key, remedy) = match message.split_once(' ') {
                Some(("missing", _)) => (String::new(), "add the key"),
                Some(("unknown", rest)) if rest.starts_with("field") => {
                    (String::new(), "correct or remove the key")
                }
                _ => (self.key_before(&span), "correct the line"),
            };
            self.error(&span, format_args!("{key}{message}"), remedy)
        })
    }

    /// "`key`: " if the line has a key before the value at `span`, or is a table's heading.
    fn key_before(&self, span: &Range<usize>) -> String {
        let before = self.text.get(..span.start).unwrap_or_default();
        let begin = before.rfind('\n').map_or(0, |at| at + 1);
        let heading = self.text[begin..].lines().next().unwrap_or_default().trim();
        match before[begin..].split_once('=') {
            Some((key, _)) => format!("`{}`: ", key.trim()),
            None if heading.starts_with('[') => format!("`{heading}`: "),
            None => String::new(),
        }
    }
}

/// A number with an exponent if it would have many digits.
pub(crate) fn written(x: f64) -> String {
    if x == 0.0 || x.is_infinite() || (1e-4..1e7).contains(&x.abs()) {
        x.to_string()
    } else {
        format!("{x:e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Example {
        format: String,
        chamber_c: Option<Vec<[f64; 2]>>,
        #[serde(default)]
        step: Vec<Step>,
    }

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Step {
        up: Option<[f64; 3]>,
        rate_dps: Option<f64>,
        dwell_s: f64,
    }

    #[test]
    fn a_complaint_names_file_line_key_and_remedy() {
        let complaint = |text: &str| {
            let source = Source::new("a.toml", text);
            source.parse::<Example>().unwrap_err()
        };
        let head = "format = \"x\"\n\n[[step]]\ndwell_s = 1.0\n";
        for (line, says) in [
            (
                "dwel_s = 1.0",
                "5: unknown field `dwel_s`, expected one of `up`, `rate_dps`, `dwell_s`; correct or remove the key",
            ),
            (
                "rate_dps = \"a\"",
                "5: `rate_dps`: invalid type: string \"a\", expected f64; correct the line",
            ),
            (
                "rate_dps = ",
                "5: `rate_dps`: string values must be quoted, expected literal string; correct the line",
            ),
            ("[[step]]", "5: missing field `dwell_s`; add the key"),
        ] {
            assert_eq!(
                complaint(&format!("{head}{line}\n")),
                format!("a.toml:{says}")
            );
        }
        assert_eq!(
            complaint(""),
            "a.toml:1: missing field `format`; add the key"
        );
    }
}
