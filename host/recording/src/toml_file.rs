//! Files of TOML: what is wrong with one, by file, line and key.

use std::path::Path;

use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::error::{Error, Result};

/// Reads a file that must be UTF-8, and says in which line it is not.
pub fn read_text(path: &Path) -> Result<String> {
    let bytes = std::fs::read(path).map_err(|error| Error::io(path, &error))?;
    String::from_utf8(bytes).map_err(|error| {
        let before = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        Error::new(
            format!("{}, line {}", path.display(), line_after(before)),
            "this is not UTF-8 text",
            "save the file as UTF-8",
        )
    })
}

/// Files of this program, by the name in their key `format`, with what makes them.
const FILES: [(&str, &str); 8] = [
    ("mimu-calibration", "a calibration (`mimu fit -o`)"),
    ("mimu-noise", "a noise file (`mimu allan -o`)"),
    ("mimu-plan", "a plan (`mimu design -o`)"),
    (
        "mimu-recording",
        "the manifest of a recording (`mimu import`)",
    ),
    ("mimu-prior", "a prior (`mimu fleet --prior`)"),
    ("mimu-driver", "a description of a turntable"),
    (
        "mimu-reference",
        "the errors of a reference (--reference-error)",
    ),
    (
        "mimu-thermal-biases",
        "biases over temperature (`mimu thermal fit --at-rest -o`)",
    ),
];

/// Refuses `text` if it is another file of this program than the one of this `name`, before its keys are compared with those of that one.
///
/// # Errors
/// What the file is, and what is wanted.
pub fn check_kind(text: &str, place: &str, name: &str) -> Result<()> {
    #[derive(Deserialize)]
    struct Format {
        format: String,
    }
    let found = toml::from_str::<Format>(text).ok();
    let found = found.as_ref().and_then(|f| f.format.split('/').next());
    let of = |name: &str| {
        FILES
            .iter()
            .find(|(n, _)| *n == name)
            .map(|(_, what)| *what)
    };
    match (found.filter(|f| *f != name).and_then(of), of(name)) {
        (Some(is), Some(wanted)) => Err(Error::new(
            place,
            format!("this is {is}"),
            format!("give {wanted}"),
        )),
        _ => Ok(()),
    }
}

/// Parses the text of the file `place`. What is wrong is in the words of serde and of the parser, which name the keys and values that
/// are possible. `again`: what makes the file anew, if a program wrote it.
pub fn parse_toml<T: DeserializeOwned>(text: &str, place: &str, again: Option<&str>) -> Result<T> {
    toml::from_str(text).map_err(|error| {
        let message = error.message().trim().replace('\n', ", ");
        let span = error.span().unwrap_or(0..text.len());
        let before = text.get(..span.start).unwrap_or_default();
        let line = before.rsplit('\n').next().unwrap_or_default();
        // Only a missing key is an error of a whole table: the span is its heading, or empty for the keys before the first heading.
        let whole_file = span == (0..0);
        let heading = text.get(span).is_some_and(|s| s.starts_with('['));
        let missing = whole_file || heading && line.trim().is_empty();
        let remedy = match (again, missing) {
            (Some(again), true) => {
                format!("the file is cut or was edited: copy it again, or {again}")
            }
            (Some(again), false) => format!("correct the line, or {again}"),
            (None, true) => "add the key".to_owned(),
            (None, false) => "correct the line".to_owned(),
        };
        let place = if whole_file {
            place.to_owned()
        } else {
            let key = line
                .split_once('=')
                .map_or(String::new(), |(key, _)| format!(", {}", key.trim()));
            format!("{place}, line {}{key}", line_after(before.as_bytes()))
        };
        Error::new(place, message, remedy)
    })
}

/// Number of the line that what follows `before` is in.
fn line_after(before: &[u8]) -> usize {
    1 + before.iter().filter(|&&byte| byte == b'\n').count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct File {
        rate_hz: f64,
        part: Part,
    }

    #[derive(Debug, serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Part {
        axis: [f64; 3],
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line_and_key_and_a_missing_key_with_its_table() {
        let refused = |text: &str| {
            let error = parse_toml::<File>(text, "a.toml", Some("make it again")).unwrap_err();
            error.to_string()
        };
        let lacks_a_key = |text: &str| refused(text).contains("the file is cut or was edited");
        for (text, begins, contains) in [
            ("rate_hz = \"a\"\n", "a.toml, line 1, rate_hz: ", "f64"),
            ("rate_hz = 1\nrate = 2\n", "a.toml, line 2: ", "`rate`"),
            ("rate_hz = 1\n", "a.toml: ", "`part`"),
            ("rate_hz = 1\n\n[part]\n", "a.toml, line 3: ", "`axis`"),
            ("rate_hz = 1\nx", "a.toml, line 2: ", "no value"),
            ("", "a.toml: ", "`rate_hz`"),
            (
                "# Note.\n[part]\naxis = [1.0, 2.0, 3.0]\n",
                "a.toml",
                "`rate_hz`",
            ),
        ] {
            let line = refused(text);
            assert!(
                line.starts_with(begins) && line.contains(contains),
                "{line}"
            );
            assert!(
                line.ends_with("or make it again") && !line.contains('\n'),
                "{line}"
            );
            assert_eq!(lacks_a_key(text), line.contains("missing field"), "{line}");
        }
    }
}
