//! The result of a station for one unit, `mimu-measurements/1`.

use mimu::data_sheet::Part;
use mimu::quantity::Sensor;
use mimu_recording::error::{Error, Refused, Result};
use serde::{Deserialize, Serialize};

use crate::decision::Decision;
use crate::gather::Samples;
use crate::limits::{Limits, is_for};
use crate::measured::Measured;
use crate::quantities::Quantities;
use crate::scale::Scale;

/// Version of the result.
pub const FORMAT: &str = "mimu-measurements/1";
/// This program and its version.
const TOOL: &str = concat!("mimu ", env!("CARGO_PKG_VERSION"));

/// What follows for the unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Every limit is kept.
    Passed,
    /// At least one is not.
    Failed,
    /// The measurement says nothing about the unit.
    NotMeasured,
}

impl Verdict {
    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Passed => "passed",
            Self::Failed => "FAILED",
            Self::NotMeasured => "not measured",
        }
    }
}

/// A measured quantity beside its limits.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Measurement {
    /// Value with its uncertainty.
    #[serde(flatten)]
    pub measured: Measured,
    /// Smallest value that passes; null if there is none.
    pub lower: Option<f64>,
    /// Largest value that passes; null if there is none.
    pub upper: Option<f64>,
    /// Whether it passes; null without limits.
    pub passed: Option<bool>,
    /// Where the limits are from; null without limits.
    pub limits_of: Option<String>,
}

/// The same unit by the calibration that it came with.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AsFound {
    /// File of the calibration.
    pub calibration: String,
    /// Verdict.
    pub verdict: Verdict,
    /// What was measured.
    pub measurements: Vec<Measurement>,
}

/// The result for one unit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Document {
    /// `mimu-measurements/1`.
    pub format: &'static str,
    /// This program and its version.
    pub tool: &'static str,
    /// When it was measured, RFC 3339.
    pub time: String,
    /// Name of the unit.
    pub unit: String,
    /// Product, by the file of limits.
    pub product: Option<String>,
    /// Part, if its data sheet is used.
    pub part: Option<String>,
    /// The recordings or the port.
    pub source: Vec<String>,
    /// Verdict.
    pub verdict: Verdict,
    /// Why it could not be measured.
    pub problem: Option<Refused>,
    /// Which values pass.
    pub decision: Decision,
    /// How readings became SI.
    pub scale: Option<String>,
    /// The side that was up.
    pub up: Option<String>,
    /// Length of the rest, s.
    pub duration_s: Option<f64>,
    /// What was measured.
    pub measurements: Vec<Measurement>,
    /// What could not be measured, with the reason.
    pub not_measured: Vec<String>,
    /// The same by the calibration that the unit came with; the measurements above are then as left.
    pub as_found: Option<AsFound>,
}

impl Document {
    /// The result of a unit before anything is measured.
    pub fn new(
        unit: &str,
        source: Vec<String>,
        time: &str,
        limits: &Limits,
        part: Option<&Part>,
    ) -> Self {
        Self {
            format: FORMAT,
            tool: TOOL,
            time: time.into(),
            unit: unit.into(),
            product: limits.product.clone(),
            part: part.map(|part| part.name.clone()),
            source,
            verdict: Verdict::NotMeasured,
            problem: None,
            decision: limits.decision(),
            scale: None,
            up: None,
            duration_s: None,
            measurements: Vec::new(),
            not_measured: Vec::new(),
            as_found: None,
        }
    }

    /// With what was measured.
    ///
    /// # Errors
    /// Every limit is kept, but the file names a quantity that was not measured, or the data sheet limits a sensor that is silent: the unit can be neither
    /// accepted nor rejected.
    pub fn judge(
        mut self,
        found: &Quantities,
        samples: &Samples,
        limits: &Limits,
        part: Option<&Part>,
        scale: &Scale,
    ) -> Result<Self> {
        self.scale = Some(scale.by.clone());
        self.up.clone_from(&found.up);
        self.duration_s = Some(found.duration_s);
        self.not_measured.clone_from(&found.not_measured);
        self.measurements = judged(found, samples, limits, part, scale)?;
        self.verdict = verdict(&self.measurements);
        // A unit that is beyond one limit has failed, whatever else was not measured.
        if self.verdict == Verdict::Failed {
            return Ok(self);
        }
        let silent = |sensor: &Sensor| {
            let limited = part.is_some_and(|part| part.sensor(*sensor).is_some());
            limited && !samples.has(*sensor as usize)
        };
        if let Some(sensor) = Sensor::BOTH.iter().find(|sensor| silent(sensor)) {
            return Err(Error::undetermined(
                &samples.place,
                format!("the data sheet limits the {sensor}, and the unit sends no readings of it"),
                "check the columns and the wiring; or write the limits of the other sensor to a file, without the part",
            ));
        }
        let names: Vec<&str> = found.measured.iter().map(|m| m.name.as_str()).collect();
        if let Some(row) = limits.not_met(&names).first() {
            let reasons = found.not_measured.iter();
            let mut reasons = reasons.filter(|why| {
                let name = why.split(':').next().unwrap_or_default();
                is_for(&row.name, name)
            });
            let why = reasons.next().and_then(|why| why.split_once(": "));
            let why = why.map_or("it needs other data".to_owned(), |(_, why)| why.to_owned());
            return Err(Error::undetermined(
                &samples.place,
                format!("{} has limits and was not measured: {why}", row.name),
                "measure longer, or with --faces for offsets and sensitivities of the accelerometer; or remove the row from the limits",
            ));
        }
        Ok(self)
    }

    /// With the reason why the unit could not be measured.
    pub fn refused(mut self, error: &Error) -> Self {
        self.verdict = Verdict::NotMeasured;
        self.problem = Some(error.refused().clone());
        self
    }

    /// The measurements that do not pass.
    pub fn failed(&self) -> impl Iterator<Item = &Measurement> {
        self.measurements.iter().filter(|m| m.passed == Some(false))
    }
}

/// What was measured beside its limits.
///
/// # Errors
/// The population of the limits reads in another unit.
pub fn judged(
    found: &Quantities,
    samples: &Samples,
    limits: &Limits,
    part: Option<&Part>,
    scale: &Scale,
) -> Result<Vec<Measurement>> {
    let decision = limits.decision();
    let all = limits.of(found, part, scale, samples.raw_unit)?;
    let judge = |measured: &Measured| {
        let measured = limits.wander.apply(measured.clone());
        // The last one that is for it counts; one for this axis before one for all axes.
        let fits = all
            .iter()
            .filter(|limit| is_for(&limit.name, &measured.name));
        let of_file = |source: &str| source == limits.place;
        let limit = fits.max_by_key(|limit| (of_file(&limit.source), limit.name == measured.name));
        let (lower, upper) = limit.map_or((None, None), |limit| (limit.lower, limit.upper));
        Measurement {
            passed: limit.map(|_| decision.passes(measured.value, measured.sigma, lower, upper)),
            lower,
            upper,
            limits_of: limit.map(|limit| limit.source.clone()),
            measured,
        }
    };
    Ok(found.measured.iter().map(judge).collect())
}

/// The verdict of measurements.
pub fn verdict(measurements: &[Measurement]) -> Verdict {
    match measurements.iter().any(|m| m.passed == Some(false)) {
        true => Verdict::Failed,
        false => Verdict::Passed,
    }
}
