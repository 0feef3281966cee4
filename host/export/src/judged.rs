//! What is known of the quality of an export's sources: their judgements, and the errors of the calibration that every program inherits.

use mimu::calibration::bias_cubic::BiasCubics;
use mimu::calibration::{Calibration, TriadTable};
use mimu::judgement::Judgement;
use mimu::quantity::Sensor;
use serde::Serialize;

use crate::Sources;
use crate::remaining::Remaining;

/// The judgement of a source.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JudgedSource {
    /// The source: `calibration`, `biases` or `noise`.
    pub source: &'static str,
    /// Its judgement; null if its file contains none, like a calibration that was read from a device.
    pub judgement: Option<Judgement>,
}

impl JudgedSource {
    /// Those of all sources.
    pub fn all(from: &Sources) -> Vec<Self> {
        let calibration = from.calibration.map(|(c, _)| ("calibration", &c.judgement));
        let noise = from.noise.map(|n| ("noise", &n.judgement));
        let mut all: Vec<Self> = [calibration, noise]
            .into_iter()
            .flatten()
            .map(|(source, judgement)| Self {
                source,
                judgement: judgement.clone(),
            })
            .collect();
        all.extend(from.biases.map(|b| Self {
            source: "biases",
            judgement: Some(b.judgement.clone()),
        }));
        all
    }

    /// Whether it is judged good.
    pub fn is_good(&self) -> bool {
        self.judgement.as_ref().is_some_and(Judgement::is_good)
    }

    /// One line for comments and the terminal.
    pub fn line(&self) -> String {
        match &self.judgement {
            Some(judgement) => format!("judgement of the {}: {judgement}", self.source),
            None => format!(
                "judgement of the {}: none, its file does not contain one",
                self.source
            ),
        }
    }
}

/// The error of the fit that `table` comes from, of unseen data if any were held out.
fn error(sensor: Sensor, table: &TriadTable) -> Option<Remaining> {
    let judged = table.judged.as_ref()?;
    let (source, rms) = match judged.held_out_rms {
        Some(rms) => ("error of unseen data", rms),
        None => ("error in sample, as nothing was held out", judged.rms),
    };
    Some(Remaining {
        sensor,
        source: source.into(),
        condition: judged.figure.clone(),
        unit: if judged.unit == "rad" {
            "rad"
        } else {
            sensor.unit()
        },
        rms: Some(rms),
        max: None,
    })
}

/// The errors of `calibration` itself.
pub fn errors_of(calibration: &Calibration) -> Vec<Remaining> {
    let of = |sensor| error(sensor, calibration.table(sensor)?);
    Sensor::BOTH.into_iter().filter_map(of).collect()
}

/// The error of curves at rest: `rms` raw, in the unit of `cubics`.
pub fn error_of_curves(cubics: &BiasCubics, rms: f64) -> Remaining {
    let factors = cubics.conversion.si_per_raw.map(f64::abs);
    Remaining {
        sensor: cubics.sensor,
        source: "error of unseen data".into(),
        condition: "readings at rest minus the curves".into(),
        unit: cubics.unit,
        rms: Some(rms * factors.iter().sum::<f64>() / 3.0),
        max: None,
    }
}
