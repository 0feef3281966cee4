//! How well the true input of a recording is known: errors of a table, of levelled faces, of gravity. Type B, as a certificate or a level gives them (JCGM
//! 100:2008, 4.3).

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// Half of a 95 % interval of a normal variable, in standard deviations.
pub const NORMAL_95: f64 = 1.959_963_984_540_054;

/// Errors of the reference, each half of a 95 % interval about zero unless [`rectangular`](Self::rectangular) names it. All dwells share an error, but [`level_deg`](Self::level_deg). 0: none.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ReferenceError {
    /// Where they come from: number and date of a certificate, or how they were measured.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub source: String,
    /// The chain of calibrations that leads from the reference to the SI: who calibrated it, when, against what.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub traceability: String,
    /// Keys whose number is the limit of a rectangular distribution, as of a tolerance, instead of half of a 95 % interval.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub rectangular: Vec<String>,
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

    /// Keys, the numbers of the stated errors, and whether each is the limit of a rectangular distribution.
    pub fn stated(&self) -> impl Iterator<Item = (&'static str, f64, bool)> {
        let all = self
            .fields()
            .into_iter()
            .filter(|(_, value, _)| *value > 0.0);
        all.map(|(key, value, _)| (key, value, self.is_rectangular(key)))
    }

    /// The same errors as standard uncertainties: those of a normal or of a rectangular distribution (JCGM 100:2008, 4.3.4, 4.3.7).
    #[must_use]
    pub fn standard(&self) -> Self {
        let of = |key: &str, value: f64| {
            value
                / match self.is_rectangular(key) {
                    true => 3.0_f64.sqrt(),
                    false => NORMAL_95,
                }
        };
        Self {
            gravity_mps2: of("gravity_mps2", self.gravity_mps2),
            rate: of("rate", self.rate),
            mounting_deg: of("mounting_deg", self.mounting_deg),
            level_deg: of("level_deg", self.level_deg),
            tilt_deg: of("tilt_deg", self.tilt_deg),
            orthogonality_deg: of("orthogonality_deg", self.orthogonality_deg),
            ..self.clone()
        }
    }

    fn is_rectangular(&self, key: &str) -> bool {
        self.rectangular.iter().any(|k| k == key)
    }

    /// All errors: key, number, largest number.
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
        for key in &self.rectangular {
            if !self
                .fields()
                .iter()
                .any(|(k, value, _)| k == key && *value > 0.0)
            {
                return Err(Error::new(
                    place,
                    format!("rectangular names {key:?}, which is not stated"),
                    "name keys of this table, such as \"level_deg\", and give their numbers",
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
    fn the_standard_uncertainty_is_that_of_the_distribution() {
        let error = ReferenceError {
            tilt_deg: 0.1,
            level_deg: 0.1,
            rectangular: vec!["level_deg".into()],
            ..ReferenceError::default()
        };
        // Printed factors of both distributions: 1.96 and 1.732.
        assert!((error.standard().tilt_deg - 0.1 / 1.96).abs() < 1e-6);
        assert!((error.standard().level_deg - 0.1 / 1.732_05).abs() < 1e-6);
        let stated: Vec<_> = error.stated().map(|(key, _, r)| (key, r)).collect();
        assert_eq!(stated, [("level_deg", true), ("tilt_deg", false)]);
    }

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
            (
                "format = \"mimu-reference/1\"\ntilt_deg = 0.01\nrectangular = [\"level_deg\"]\n",
                "rectangular names \"level_deg\"",
            ),
        ] {
            let error = read(text).unwrap_err().to_string();
            assert!(error.contains(said), "{error}");
        }
    }
}
