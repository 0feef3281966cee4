//! As found and as left: the calibration that the unit had, and the new one.

use serde::Serialize;

use crate::calibration::comparison::{ComparedParameter, compare};
use crate::calibration::verify::verify;
use crate::calibration::{Calibration, TriadTable};
use crate::fit::Fit;
use crate::parameter::{TriadParameter, parameters};
use crate::quantity::Sensor;
use mimu_recording::are_two_units;
use mimu_recording::error::{Error, Result};

/// The calibration that the unit had, beside the new one.
#[derive(Debug, Clone, Serialize)]
pub struct AsFound {
    /// Its file.
    pub file: String,
    /// When it was made, if the file says.
    pub created: Option<String>,
    /// Parameters that both have.
    pub rows: Vec<AsFoundRow>,
    /// Errors of the recording that is certified, by sensor.
    pub errors: Vec<AsFoundError>,
    /// Why the old calibration was not applied to the recording.
    pub not_applied: Option<String>,
    /// What a person should know.
    pub notes: Vec<String>,
}

/// Root mean square errors of the recording with the old and with the new calibration, SI.
#[derive(Debug, Clone, Serialize)]
pub struct AsFoundError {
    /// Sensor.
    pub sensor: Sensor,
    /// With the calibration that the unit had.
    pub found: f64,
    /// With the new one.
    pub left: f64,
    /// SI unit of both.
    pub unit: &'static str,
    /// The quantity that they describe.
    pub figure: String,
}

/// A parameter in both calibrations.
#[derive(Debug, Clone, Serialize)]
pub struct AsFoundRow {
    /// Sensor.
    pub sensor: Sensor,
    /// Parameter.
    pub name: String,
    /// Value as found, in [`Self::unit`].
    pub found: f64,
    /// Value as left.
    pub left: f64,
    /// Expanded uncertainties of both; null if a file has none.
    pub expanded: Option<[f64; 2]>,
    /// Unit of the values and uncertainties.
    pub unit: String,
}

impl AsFoundRow {
    /// What changed: as left minus as found.
    pub fn change(&self) -> f64 {
        self.left - self.found
    }

    /// The change over the root of the sum of the squared expanded uncertainties (ISO 13528:2022, 9.7): beyond 1 in size, the uncertainties do not explain
    /// it. `None` if one is unknown.
    pub fn normalised_error(&self) -> Option<f64> {
        let [found, left] = self.expanded?;
        Some(self.change() / found.hypot(left)).filter(|e| e.is_finite())
    }

    /// Whether the uncertainties of both explain the change. `None` if one is unknown.
    pub fn is_within(&self) -> Option<bool> {
        Some(self.normalised_error()?.abs() <= 1.0)
    }
}

impl AsFound {
    /// The calibration `old` from the file `file` beside `made`, which is that of `fit`.
    ///
    /// # Errors
    /// Calibrations of two units, of readings in different units, or without a common sensor.
    pub fn of(fit: &Fit, made: &Calibration, old: &Calibration, file: &str) -> Result<Self> {
        let numbers = old.unit_id.as_ref().zip(made.unit_id.as_ref());
        let other = match numbers {
            Some((old, new)) => !old.eq_ignore_ascii_case(new),
            None => are_two_units(&old.device, &made.device),
        };
        if other {
            let problem = format!(
                "it is of {:?}, and the recording of {:?}",
                old.device, made.device
            );
            return Err(Error::new(
                file,
                problem,
                "give the calibration that this unit had",
            ));
        }
        let both = [
            (file.to_owned(), old.clone()),
            ("the new calibration".to_owned(), made.clone()),
        ];
        let compared = compare(&both)?;
        let rows = compared.parameters.iter();
        let rows = rows.filter(|p| !is_of_frame(p, [old, made]));
        // A certificate is about the first two triads.
        let rows = rows.filter_map(|p| Some((p.of_first()?, p)));
        let rows = rows.map(|(sensor, p)| {
            let table = old.table(sensor);
            let factor = table.map_or(1.96, TriadTable::interval_sigmas);
            row((sensor, p), factor, expanded(fit, sensor, p))
        });
        let (mut errors, mut not_applied) = (Vec::new(), None);
        match (verify(&fit.prepared, old), verify(&fit.prepared, made)) {
            (Err(why), _) | (_, Err(why)) => not_applied = Some(why.to_string()),
            (Ok(found), Ok(left)) => {
                for (sensor, of) in found.sensors.present() {
                    errors.extend(left.sensors[sensor].as_ref().map(|left| AsFoundError {
                        sensor,
                        found: of.rms,
                        left: left.rms,
                        unit: of.unit,
                        figure: of.figure.description().to_owned(),
                    }));
                }
            }
        }
        Ok(Self {
            file: file.to_owned(),
            created: old.created.clone(),
            rows: rows.collect(),
            errors,
            not_applied,
            notes: compared.notes,
        })
    }
}

/// Whether a parameter defines the frame in both: then it has no uncertainty and cannot change.
fn is_of_frame(p: &ComparedParameter, both: [&Calibration; 2]) -> bool {
    p.sigmas.is_none() && both.iter().all(|c| c.is_uncertain())
}

/// Expanded uncertainty of a parameter by the fit: its coverage factor is its own.
fn expanded(fit: &Fit, sensor: Sensor, p: &ComparedParameter) -> Option<f64> {
    let triad = &fit.sensor(sensor)?.estimated.triad;
    let all = parameters(triad, sensor, fit.prepared.manifest.raw_unit);
    let named = |of: &TriadParameter| format!("{} {}", of.0.words(), of.axis()) == p.name;
    let (_, estimate, _) = all.into_iter().find(|(of, ..)| named(of))?;
    Some(estimate.interval)
}

fn row((sensor, p): (Sensor, &ComparedParameter), factor: f64, left: Option<f64>) -> AsFoundRow {
    let found = p.sigmas.as_ref().map(|s| factor * s[0]);
    AsFoundRow {
        sensor,
        name: p.name.clone(),
        found: p.values[0],
        left: p.values[1],
        expanded: found.zip(left).map(|(found, left)| [found, left]),
        unit: p.unit.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_is_within_if_the_uncertainties_of_both_explain_it() {
        let row = |left: f64, expanded| AsFoundRow {
            sensor: Sensor::Gyro,
            name: "bias x".into(),
            found: 1.0,
            left,
            expanded,
            unit: "rad/s".into(),
        };
        // 3, 4, 5: the root of the sum of the squares is 0.5.
        let both = Some([0.3, 0.4]);
        assert_eq!(row(1.5, both).is_within(), Some(true));
        assert!((row(0.5, both).normalised_error().unwrap() + 1.0).abs() < 1e-12);
        assert_eq!(row(1.51, both).is_within(), Some(false));
        assert_eq!(row(1.5, None).is_within(), None);
    }
}
