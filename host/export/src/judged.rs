//! What is known of the quality of an export's sources: their judgements, and the errors of the calibration that every program inherits.

use mimu::calibration::bias_cubic::BiasCubics;
use mimu::calibration::{Calibration, TriadTable};
use mimu::{Judgement, Sensor};
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
        let calibration = from
            .calibration
            .map(|(c, _)| ("calibration", c.judgement.clone()));
        let noise = from.noise.map(|n| ("noise", n.judgement.clone()));
        let biases = from.biases.map(|b| ("biases", Some(b.judgement.clone())));
        let all = [calibration, noise, biases].into_iter().flatten();
        let of = |(source, judgement)| Self { source, judgement };
        all.map(of).collect()
    }

    /// Whether it is judged good.
    pub fn is_good(&self) -> bool {
        self.judgement.as_ref().is_some_and(Judgement::is_good)
    }

    /// One line for comments and the terminal.
    pub fn line(&self) -> String {
        let judgement = self.judgement.as_ref().map(Judgement::to_string);
        let judgement = judgement.unwrap_or("none, its file does not contain one".into());
        format!("judgement of the {}: {judgement}", self.source)
    }
}

/// The error of the fit that `table` comes from, of unseen data if any were held out.
fn error(sensor: Sensor, table: &TriadTable) -> Option<Remaining> {
    let judged = table.judged.as_ref()?;
    let (source, rms) = match judged.held_out_rms {
        Some(rms) => ("error of unseen data", rms),
        None => ("error in sample, as nothing was held out", judged.rms),
    };
    let mut error = Remaining::of(sensor, source, judged.figure.clone(), Some(rms), None);
    if judged.unit == "rad" {
        error.unit = "rad";
    }
    Some(error)
}

/// The errors of `calibration` itself.
pub fn errors_of(calibration: &Calibration) -> Vec<Remaining> {
    let of = |sensor| error(sensor, calibration.table(sensor)?);
    Sensor::BOTH.into_iter().filter_map(of).collect()
}

/// The error of curves at rest: `rms` raw, in the unit of `cubics`.
pub fn error_of_curves(cubics: &BiasCubics, rms: f64) -> Remaining {
    let factors = cubics.conversion.si_per_raw.map(f64::abs);
    let rms = Some(rms * factors.iter().sum::<f64>() / 3.0);
    let condition = "readings at rest minus the curves";
    let error = Remaining::of(cubics.sensor, "error of unseen data", condition, rms, None);
    Remaining {
        unit: cubics.unit,
        ..error
    }
}
