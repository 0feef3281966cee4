//! TOML that a person wrote: every complaint is one line with the file, the line, and what to do.

use std::fmt::Display;
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::ops::Range;
use std::path::Path;

use serde::de::DeserializeOwned;

/// Units by the suffix that keys carry, as a person reads them. The first of equal length that fits counts.
const UNITS: [(&str, &str); 39] = [
    ("s", "seconds"),
    ("ms", "milliseconds"),
    ("us", "microseconds"),
    ("min", "minutes"),
    ("h", "hours"),
    ("hz", "hertz"),
    ("khz", "kilohertz"),
    ("rpm", "revolutions per minute"),
    ("deg", "degrees"),
    ("rad", "radians"),
    ("mrad", "milliradians"),
    ("arcsec", "arcseconds"),
    ("dps", "degrees per second"),
    ("dph", "degrees per hour"),
    ("rads", "radians per second"),
    ("rps", "radians per second"),
    ("radps", "radians per second"),
    ("rad_s", "radians per second"),
    ("rad_per_s", "radians per second"),
    ("deg_s", "degrees per second"),
    ("deg_per_s", "degrees per second"),
    ("dps2", "degrees per second squared"),
    ("g", "standard gravities"),
    ("mg", "thousandths of standard gravity"),
    ("ug", "millionths of standard gravity"),
    ("ms2", "metres per second squared"),
    ("mps2", "metres per second squared"),
    ("m_s2", "metres per second squared"),
    ("m", "metres"),
    ("cm", "centimetres"),
    ("mm", "millimetres"),
    ("um", "micrometres"),
    ("c", "degrees Celsius"),
    ("k", "kelvins"),
    ("f", "degrees Fahrenheit"),
    ("ppm", "millionths"),
    ("v", "volts"),
    ("mv", "millivolts"),
    ("uv", "microvolts"),
];

/// Most bytes that a file may have: ten thousand times what a person writes. More is another file, or a device.
const LARGEST: u64 = 16 << 20;

/// A text file and its name, for complaints that point into it.
#[derive(Debug, Clone)]
pub struct Source {
    name: String,
    text: String,
}

impl Source {
    /// Text that is already here, under the name that complaints shall give it.
    pub fn new(name: impl Into<String>, text: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            text: text.into(),
        }
    }

    /// Reads a file. A missing one, a directory, or one that is no UTF-8 text is refused in one line.
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
                return Err(format!("{name}: there is no such file; check the path"));
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
        // A span may begin at the very end; the last line is then the one to look at.
        let text = self.text.trim_end().as_bytes();
        let before = &text[..at.start.min(text.len())];
        let line = 1 + before.iter().filter(|&&b| b == b'\n').count();
        format!("{}:{line}: {problem}; {remedy}", self.name)
    }

    /// Reads the text as `T`, which should refuse unknown fields and mark with [`toml::Spanned`] what is
    /// checked later.
    ///
    /// `synonyms` are words that people use for a key, without unit, and the key that is meant:
    /// `("temperature", "chamber_c")`. What is known beside it is taken from `T`, table by table;
    /// `serde(flatten)` would lose that and the lines.
    pub fn parse<T: DeserializeOwned>(&self, synonyms: &[(&str, &str)]) -> Result<T, String> {
        toml::from_str(&self.text).map_err(|e| {
            // Without a span it is about the file as a whole.
            let span = e.span().unwrap_or(0..0);
            let (problem, remedy) = self.explain(e.message(), &span, synonyms);
            self.error(&span, problem, remedy)
        })
    }

    /// What serde and toml say, in words for the person who wrote the file: the problem, and what to do.
    fn explain(
        &self,
        message: &str,
        span: &Range<usize>,
        synonyms: &[(&str, &str)],
    ) -> (String, String) {
        let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
        if message.starts_with("unknown field")
            && let Some((key, known)) = quoted.split_first()
        {
            return (
                format!("unknown key `{key}`"),
                suggestion(key, known, synonyms),
            );
        }
        if message.starts_with("unknown variant")
            && let Some((value, known)) = quoted.split_first()
        {
            let known: Vec<String> = known.iter().map(|k| format!("\"{k}\"")).collect();
            return (
                format!("{}unknown value \"{value}\"", self.key_before(span)),
                format!("write {}", known.join(" or ")),
            );
        }
        if let Some(key) = message.strip_prefix("missing field").and(quoted.first()) {
            let unit = split(key)
                .1
                .map_or(String::new(), |unit| format!(", in {unit}"));
            return (
                format!("`{key}` is missing"),
                format!("add `{key} = ...`{unit}"),
            );
        }
        if let Some((what, expected)) = message.rsplit_once(", expected ")
            && message.starts_with("invalid")
        {
            let wanted = match expected {
                "f64" | "f32" => "a number",
                "u8" | "u16" | "u32" | "u64" | "usize" => "a whole number, zero or more",
                "i8" | "i16" | "i32" | "i64" | "isize" => "a whole number",
                "a string" => "text in quotes",
                "a boolean" => "true or false",
                "a sequence" => "a list in square brackets",
                other if other.starts_with("struct ") => {
                    "a table of keys, in [brackets] above them"
                }
                other => other,
            };
            let what = what
                .replace(": map", ": table")
                .replace(": sequence", ": list");
            return (
                format!("{}{what}", self.key_before(span)),
                format!("give {wanted}"),
            );
        }
        // Good TOML: then it is what a type of its own says that it expects.
        if self.text.parse::<toml::Table>().is_ok() {
            return (
                format!("{}invalid value", self.key_before(span)),
                format!("give {message}"),
            );
        }
        let message = message.trim().replace('\n', ", ");
        (
            format!("not valid TOML: {message}"),
            "correct the line".to_owned(),
        )
    }

    /// "`key`: " where the line has a key before the value at `span`, or is a table's heading.
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

/// A number without three hundred zeros.
pub(crate) fn written(x: f64) -> String {
    if x == 0.0 || x.is_infinite() || (1e-4..1e7).contains(&x.abs()) {
        x.to_string()
    } else {
        format!("{x:e}")
    }
}

/// Stem and unit of a key: `dwell_s` is `dwell` in seconds.
fn split(key: &str) -> (&str, Option<&'static str>) {
    let mut found = (key, None);
    for (suffix, unit) in UNITS {
        if let Some(stem) = key.strip_suffix(suffix).and_then(|k| k.strip_suffix('_'))
            && stem.len() < found.0.len()
        {
            found = (stem, Some(unit));
        }
    }
    found
}

/// What to write instead of an unknown key.
fn suggestion(key: &str, known: &[&str], synonyms: &[(&str, &str)]) -> String {
    let (stem, unit) = split(key);
    let meant = known
        .iter()
        .find(|k| split(k).0 == stem)
        .copied()
        .or_else(|| {
            let (_, meant) = synonyms
                .iter()
                .find(|(word, meant)| *word == stem && known.contains(meant))?;
            Some(*meant)
        });
    if let Some(meant) = meant {
        return match (unit, split(meant).1) {
            (_, Some(right)) if unit != Some(right) => format!("write `{meant}`, in {right}"),
            (Some(_), None) => format!("write `{meant}`, which has no unit"),
            _ => format!("write `{meant}`"),
        };
    }
    let nearest = known.iter().min_by_key(|k| distance(key, k));
    match nearest {
        // A third of the letters: more is another word.
        Some(near) if 3 * distance(key, near) <= key.len().max(near.len()) => {
            format!("did you mean `{near}`?")
        }
        _ if known.is_empty() => "remove it".to_owned(),
        _ => format!("remove it; known here: {}", known.join(", ")),
    }
}

/// Letters to insert, remove or change to get from one word to another (Levenshtein).
fn distance(a: &str, b: &str) -> usize {
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.bytes().enumerate() {
        let mut corner = row[0];
        row[0] = i + 1;
        for (j, y) in b.bytes().enumerate() {
            let change = corner + usize::from(x != y);
            corner = row[j + 1];
            row[j + 1] = change.min(corner + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
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

    fn complaint(text: &str) -> String {
        let synonyms = [("temp", "chamber_c")];
        Source::new("a.toml", text)
            .parse::<Example>(&synonyms)
            .unwrap_err()
    }

    #[test]
    fn a_complaint_names_file_line_key_and_remedy() {
        let head = "format = \"x\"\n\n[[step]]\ndwell_s = 1.0\n";
        for (line, complaint_tail) in [
            (
                "rate_rads = 1.0",
                "5: unknown key `rate_rads`; write `rate_dps`, in degrees per second",
            ),
            (
                "rate_rps = 1.0",
                "5: unknown key `rate_rps`; write `rate_dps`, in degrees per second",
            ),
            (
                "dwel_s = 1.0",
                "5: unknown key `dwel_s`; did you mean `dwell_s`?",
            ),
            (
                "dwell_ms = 1.0",
                "5: unknown key `dwell_ms`; write `dwell_s`, in seconds",
            ),
            (
                "up_deg = 1.0",
                "5: unknown key `up_deg`; write `up`, which has no unit",
            ),
            (
                "colour = 1.0",
                "5: unknown key `colour`; remove it; known here: up, rate_dps, dwell_s",
            ),
            (
                "rate_dps = \"a\"",
                "5: `rate_dps`: invalid type: string \"a\"; give a number",
            ),
            (
                "rate_dps = ",
                "5: not valid TOML: string values must be quoted, expected literal string; correct the line",
            ),
            (
                "[[step]]",
                "5: `dwell_s` is missing; add `dwell_s = ...`, in seconds",
            ),
        ] {
            assert_eq!(
                complaint(&format!("{head}{line}\n")),
                format!("a.toml:{complaint_tail}")
            );
        }
        assert_eq!(
            complaint("format = \"x\"\ntemp_f = 3.0"),
            "a.toml:2: unknown key `temp_f`; write `chamber_c`, in degrees Celsius"
        );
        assert_eq!(
            complaint(""),
            "a.toml:1: `format` is missing; add `format = ...`"
        );
    }
}
