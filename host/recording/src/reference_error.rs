//! How well the true input of a recording is known: errors of a table, of levelled faces, of gravity. Type B, as a certificate or a level gives them.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// Errors of the reference, each half of a 95 % interval about zero. All dwells share an error, but [`level_deg`](Self::level_deg). 0: none.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ReferenceError {
    /// Where they come from: number and date of a certificate, or how they were measured.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub source: String,
    /// Of the local gravity, m/s².
    pub gravity_mps2: f64,
    /// Of the rates, as a share of each.
    pub rate: f64,
    /// Of the orientation of the unit on its mount, degrees about each axis of the body.
    pub mounting_deg: f64,
    /// Of the level of a single pose or face, degrees about each level axis; another one in each dwell.
    pub level_deg: f64,
    /// Of the base of a table from the vertical, degrees about each level axis. It is for a table that turns the body about its z axis and tilts that about
    /// a level axis which stays where it is.
    pub tilt_deg: f64,
    /// Of the right angles between successive axes of such a table, degrees.
    pub orthogonality_deg: f64,
}

impl ReferenceError {
    /// Largest angle, degrees: beyond it the derivatives that the intervals use are off by a per cent.
    const LARGEST_DEG: f64 = 5.0;

    /// All that are stated, with their keys.
    fn fields(&self) -> [(&'static str, f64, f64); 6] {
        let angle = Self::LARGEST_DEG;
        [
            ("gravity_mps2", self.gravity_mps2, 1.0),
            ("rate", self.rate, 0.2),
            ("mounting_deg", self.mounting_deg, angle),
            ("level_deg", self.level_deg, angle),
            ("tilt_deg", self.tilt_deg, angle),
            ("orthogonality_deg", self.orthogonality_deg, angle),
        ]
    }

    /// Refuses numbers that are no such errors; `place` names the file.
    ///
    /// # Errors
    /// Names the key, its value and its range.
    pub fn check(&self, place: &str) -> Result<()> {
        for (key, value, largest) in self.fields() {
            if !(0.0..=largest).contains(&value) {
                return Err(Error::new(
                    place,
                    format!("{key} = {value} is not within 0 to {largest}"),
                    "give half of a 95 % interval; 0 or no key: no such error",
                ));
            }
        }
        if self.fields().iter().all(|(_, value, _)| *value == 0.0) {
            return Err(Error::new(
                place,
                "no error of the reference is stated",
                "give at least one of gravity_mps2, rate, mounting_deg, level_deg, tilt_deg, orthogonality_deg",
            ));
        }
        Ok(())
    }

    /// From a TOML file: these keys, under `format = "mimu-reference/1"`.
    ///
    /// # Errors
    /// The file cannot be read, has another key, or a number out of its range.
    pub fn read(path: &std::path::Path) -> Result<Self> {
        #[derive(Deserialize)]
        struct File {
            format: String,
            #[serde(flatten)]
            rest: toml::Table,
        }
        let place = path.display().to_string();
        let wrong = |what: String| {
            Error::new(
                &place,
                what,
                "the file has format = \"mimu-reference/1\" and keys such as tilt_deg = 0.01 (docs/table.md)",
            )
        };
        let text = std::fs::read_to_string(path).map_err(|e| wrong(e.to_string()))?;
        let file: File = toml::from_str(&text).map_err(|e| wrong(e.message().to_owned()))?;
        if file.format != "mimu-reference/1" {
            return Err(wrong(format!("format {:?} is not known", file.format)));
        }
        let found: Self = file
            .rest
            .try_into()
            .map_err(|e: toml::de::Error| wrong(e.message().to_owned()))?;
        found.check(&place)?;
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_read_and_a_mistake_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table.toml");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            ReferenceError::read(&path)
        };
        let good = "format = \"mimu-reference/1\"\nsource = \"K-17, 2026-05-04\"\ntilt_deg = 0.01\nrate = 5e-5\n";
        let found = read(good).unwrap();
        assert_eq!(
            (found.tilt_deg, found.rate, found.level_deg),
            (0.01, 5e-5, 0.0)
        );
        for (text, said) in [
            (
                "format = \"mimu-reference/1\"\n",
                "no error of the reference",
            ),
            (
                "format = \"mimu-reference/1\"\ntilt = 0.01\n",
                "unknown field `tilt`",
            ),
            (
                "format = \"mimu-reference/1\"\ntilt_deg = -0.01\n",
                "tilt_deg = -0.01",
            ),
            (
                "format = \"mimu-reference/1\"\ntilt_deg = nan\n",
                "tilt_deg = NaN",
            ),
            ("format = \"mimu-limits/1\"\n", "mimu-limits/1"),
            ("tilt_deg = 0.01\n", "missing field `format`"),
        ] {
            let error = read(text).unwrap_err().to_string();
            assert!(error.contains(said), "{error}");
        }
    }
}
