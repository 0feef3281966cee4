//! JSON with the contents of a calibration file under the same names, and its schema.
//!
//! The file is complete: C, o, P and b, the physical quantities, standard deviations, intervals, covariance, effects and curves. Units are in the
//! names, or next to the values as `unit` and `raw_unit`.

use mimu::calibration::Calibration;
use mimu_recording::error::{Error, Result};
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::{Map, Value};

use crate::format::Whole;
use crate::remaining::{Places, Remaining};
use crate::{Export, Nothing, Page, Sources, Target, heading};

/// The file.
#[derive(Serialize, JsonSchema)]
#[schemars(title = "Calibration of an inertial unit, by `mimu export json`")]
struct CalibrationJson<'a> {
    /// What a person has to know, line by line.
    about: Vec<String>,
    #[serde(flatten)]
    calibration: &'a Calibration,
    /// Errors of the calibration itself.
    calibration_errors: Vec<Remaining>,
    /// What the format adds to those errors, as far as it is known.
    remaining: Vec<Remaining>,
}

/// The format.
pub struct Json;

impl Target for Json {
    type Options = Nothing;
    const NAME: &str = "json";
    const ABOUT: &str = "JSON with the contents of the calibration file, and a schema";
    const CONTENTS: &str = "everything, with the uncertainty";
    const READERS: &str = "any program; [its schema](calibration.schema.json)";
    const FURTHER_TRIADS: bool = true;
    const WHOLE: Option<Whole> = Some(whole);
    const PAGES: &[Page] = &[Page::of("JSON", "calibration.json")];

    /// # Errors
    /// The calibration is missing.
    fn export(from: &Sources, _: &Nothing) -> Result<Export> {
        let (calibration, place) = from.calibration()?;
        let mut export = Export::new::<Self>(from);
        export.formula("x = C u + o, raw to SI, and u = P x + b, SI to raw; C and P by rows.");
        if !calibration.body.is_empty() {
            export.formula("body: x = C u + o in the triad's own frame, in its unit; R x is in the frame of its reference, R the rotation by the vector rotation_deg.");
        }
        if calibration.temperature.is_some() {
            export.formula("Over temperature a number p and its slope s are (1+2w)(1-w)^2 p0 + w^2(3-2w) p1 + h w(1-w)^2 s0 - h w^2(1-w) s1 between two nodes, h apart, w from 0 to 1.");
        }
        export.leaves(calibration, Places::Effects);
        let file = CalibrationJson {
            about: heading::of(&export, from),
            calibration,
            calibration_errors: export.calibration_errors.clone(),
            remaining: export.remaining.clone(),
        };
        let text = serde_json::to_string_pretty(&file).map_err(|e| {
            let problem = format!("it cannot be written as JSON: {e}");
            Error::new(place, problem, "fit the recording again")
        })?;
        Ok(export.with(text + "\n"))
    }
}

/// The calibration of such a file.
fn whole(bytes: &[u8], place: &str) -> Option<Result<Calibration>> {
    let mut file: Map<String, Value> = serde_json::from_slice(bytes).ok()?;
    let format = file.get("format")?.as_str()?;
    if !format.starts_with("mimu-calibration/") {
        return None;
    }
    for key in ["about", "calibration_errors", "remaining"] {
        file.remove(key);
    }
    let refused = |e: serde_json::Error| Error::new(place, e, "export the calibration again");
    let read = serde_json::from_value::<Calibration>(file.into()).map_err(refused);
    // Checked as the text that it is the same as.
    Some(read.and_then(|read| Calibration::parse(&read.to_toml(), place)))
}

/// The schema of the file, as text: `docs/calibration.schema.json`.
pub fn schema() -> String {
    let settings = schemars::generate::SchemaSettings::draft2020_12().for_serialize();
    let schema = settings
        .into_generator()
        .into_root_schema_for::<CalibrationJson>();
    // Serialising cannot fail: all keys are strings.
    serde_json::to_string_pretty(&schema).unwrap_or_default() + "\n"
}
