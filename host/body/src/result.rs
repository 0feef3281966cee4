//! The further triads in `mimu-fit/1`, and in a calibration file.

use std::collections::BTreeMap;

use mimu::calibration::body::{BodyTriad, MovingIron};
use mimu::judgement::Judgement;
use mimu::parameter::{ParameterKind, TriadParameter};
use mimu::quantity::{raw_unit, rounded, scale_unit};
use mimu::triad::{Angles, Estimate};
use mimu_recording::{RawUnit, TriadName};
use serde::Serialize;

use crate::{Body, FittedTriad, Known};

/// What a body adds to the result of a fit.
#[derive(Debug, Clone, Serialize)]
pub struct BodyResult {
    /// Joins those of the first gyro and accelerometer.
    pub sensors: BTreeMap<String, TriadResult>,
    /// How each stands on the body.
    pub body: Vec<PlaceResult>,
    /// Triads that the recording does not determine.
    pub refused: Vec<Refused>,
}

/// Calibration of a further triad.
#[derive(Debug, Clone, Serialize)]
pub struct TriadResult {
    /// `C_xx` to `o_z` in its own frame, then scale factors, biases and non-orthogonalities.
    pub parameters: Vec<ParameterResult>,
    /// Rms error over windows, in sample, in [`Self::unit`].
    pub rms: f64,
    /// The same in pieces of time that the fit has not used.
    pub held_out_rms: f64,
    /// The same by white noise.
    pub noise_floor: f64,
    /// Unit of the figures: SI, `uT`, or `field` where the size of the field is 1.
    pub unit: &'static str,
    /// Length of a window, s: means over it are compared, or fields before and after it.
    pub window_s: f64,
    /// Number of windows.
    pub windows: usize,
    /// Times that are left out because the rest contradicts them, s.
    pub left_out_s: Vec<[f64; 2]>,
    /// Its judgement.
    pub judgement: Judgement,
}

/// A parameter with its uncertainty.
#[derive(Debug, Clone, Serialize)]
pub struct ParameterResult {
    /// Kind.
    #[serde(skip)]
    pub kind: ParameterKind,
    /// Name.
    pub name: String,
    /// The estimate.
    #[serde(flatten)]
    pub estimate: EstimateResult,
    /// Unit of all.
    pub unit: String,
}

/// A number with its uncertainty.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct EstimateResult {
    /// Estimate.
    pub value: f64,
    /// Standard deviation.
    pub sigma: f64,
    /// Lower end of the 95 % interval.
    pub lower: f64,
    /// Upper end.
    pub upper: f64,
}

impl From<Estimate> for EstimateResult {
    fn from(of: Estimate) -> Self {
        Self {
            value: of.value,
            sigma: of.sigma,
            lower: of.value - of.interval,
            upper: of.value + of.interval,
        }
    }
}

/// How a triad stands on the body.
#[derive(Debug, Clone, Serialize)]
pub struct PlaceResult {
    /// The triad.
    pub triad: TriadName,
    /// What it stands to: a triad, or `trajectory`.
    pub reference: String,
    /// Rotation vector from the frame of the triad to that of the reference, degrees.
    pub rotation_deg: [EstimateResult; 3],
    /// By how much its readings are later, ms; null if the reasons say why.
    pub delay_ms: Option<EstimateResult>,
    /// From the reference to the triad, in the frame of the reference, mm; null if the reasons say why.
    pub lever_arm_mm: Option<[EstimateResult; 3]>,
    /// Angle of the field below the level, degrees; of a magnetometer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dip_deg: Option<EstimateResult>,
    /// How the hard iron of a magnetometer moves with the temperature, where it does.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub iron: Option<IronResult>,
    /// Why a number is null.
    pub reasons: BTreeMap<&'static str, String>,
}

/// Hard iron that moves with the temperature.
#[derive(Debug, Clone, Serialize)]
pub struct IronResult {
    /// By how much its field grows per kelvin, in the triad's own frame.
    pub per_k: [EstimateResult; 3],
    /// Per kelvin.
    pub unit: String,
    /// The temperature at which o holds, °C.
    pub temp_c: f64,
}

/// A triad without a calibration.
#[derive(Debug, Clone, Serialize)]
pub struct Refused {
    /// The triad.
    pub triad: TriadName,
    /// Why.
    pub judgement: Judgement,
}

impl BodyResult {
    /// Of a body whose readings are in `raw`.
    pub fn of(body: &Body, raw: RawUnit) -> Self {
        let sensors = body.triads.iter();
        let sensors = sensors.map(|t| (t.name.to_string(), TriadResult::of(t, raw)));
        let refused = body.refused.iter().map(|(triad, judgement)| Refused {
            triad: *triad,
            judgement: judgement.clone(),
        });
        Self {
            sensors: sensors.collect(),
            body: Self::places(body),
            refused: refused.collect(),
        }
    }

    /// How each triad stands on a body.
    pub fn places(body: &Body) -> Vec<PlaceResult> {
        body.triads.iter().map(PlaceResult::of).collect()
    }
}

impl TriadResult {
    fn of(of: &FittedTriad, raw: RawUnit) -> Self {
        let inverse = of.triad.inverse_estimates().into_iter().enumerate();
        let inverse = inverse.map(|(k, estimate)| {
            let unit = match raw {
                _ if k > 8 => of.unit.to_string(),
                RawUnit::Si => "1".to_string(),
                other => format!("({})/{other}", of.unit),
            };
            (TriadParameter(ParameterKind::Inverse, k), estimate, unit)
        });
        let physical = of.triad.physical(Angles::Exact);
        let kinds = [
            (
                ParameterKind::Scale,
                physical.scale,
                scale_unit(raw, of.unit),
            ),
            (
                ParameterKind::NonOrthogonality,
                physical.non_orthogonality,
                "rad".into(),
            ),
            (ParameterKind::Bias, physical.bias, raw_unit(raw, of.unit)),
        ];
        // The axes of a further triad define its frame; a gyro by a trajectory has the accelerometer's frame.
        let by_frame = match of.reference {
            Some(_) => None,
            None => Some((
                ParameterKind::Misalignment,
                physical.misalignment,
                "rad".into(),
            )),
        };
        let kinds = kinds.into_iter().chain(by_frame);
        let physical = kinds.into_iter().flat_map(|(kind, estimates, unit)| {
            let each = estimates.into_iter().enumerate();
            each.map(move |(k, estimate)| (TriadParameter(kind, k), estimate, unit.clone()))
        });
        let parameters = inverse
            .chain(physical)
            .map(|(name, estimate, unit)| ParameterResult {
                kind: name.0,
                name: name.to_string(),
                estimate: estimate.into(),
                unit,
            });
        Self {
            parameters: parameters.collect(),
            rms: of.rms,
            held_out_rms: of.held_out_rms,
            noise_floor: of.noise_floor,
            unit: of.unit,
            window_s: of.window_s,
            windows: of.windows,
            left_out_s: of.left_out.clone(),
            judgement: of.judgement.clone(),
        }
    }
}

impl PlaceResult {
    fn of(of: &FittedTriad) -> Self {
        fn known<T: Clone>(
            reasons: &mut BTreeMap<&'static str, String>,
            name: &'static str,
            of: &Known<T>,
        ) -> Option<T> {
            of.clone().map_err(|why| reasons.insert(name, why)).ok()
        }
        let mut reasons = BTreeMap::new();
        let delay_ms = known(&mut reasons, "delay_ms", &of.delay_ms).map(Into::into);
        let arm = known(&mut reasons, "lever_arm_mm", &of.lever_arm_mm);
        let dip = of.dip_deg.as_ref();
        let dip_deg = dip
            .and_then(|dip| known(&mut reasons, "dip_deg", dip))
            .map(Into::into);
        Self {
            triad: of.name,
            reference: of
                .reference
                .map_or("trajectory".into(), |of| of.to_string()),
            rotation_deg: of.rotation_deg.map(Into::into),
            delay_ms,
            lever_arm_mm: arm.map(|arm| arm.map(Into::into)),
            dip_deg,
            iron: of.iron.map(|iron| IronResult {
                per_k: iron.per_k.map(Into::into),
                unit: format!("{}/K", of.unit),
                temp_c: iron.temp_c,
            }),
            reasons,
        }
    }
}

/// Digits of a standard deviation in a file.
const DIGITS: usize = 4;

impl Body {
    /// The tables of a calibration file. Triads that are judged a misfit are left out: they would make the readings worse.
    pub fn tables(&self, raw: RawUnit) -> Vec<BodyTriad> {
        let written = self.triads.iter();
        let written = written.filter(|t| t.judgement.needs_consent().is_none());
        written.map(|t| table(t, raw)).collect()
    }
}

fn table(of: &FittedTriad, raw: RawUnit) -> BodyTriad {
    let estimates = of.triad.inverse_estimates();
    let rows = |value: fn(&Estimate) -> f64| {
        [0, 3, 6].map(|i| [i, i + 1, i + 2].map(|k| rounded(value(&estimates[k]), DIGITS)))
    };
    let last =
        |value: fn(&Estimate) -> f64| [9, 10, 11].map(|k| rounded(value(&estimates[k]), DIGITS));
    let (delay, arm) = (of.delay_ms.as_ref().ok(), of.lever_arm_mm.as_ref().ok());
    let interval = |e: &Estimate| rounded(e.interval, DIGITS);
    BodyTriad {
        triad: of.name,
        reference: of.reference.unwrap_or(of.name),
        formula: "x = C u + o".into(),
        direction: "raw to SI".into(),
        raw_unit: raw,
        unit: of.unit.into(),
        C: [0, 1, 2].map(|i| [0, 1, 2].map(|j| of.triad.inverse.matrix[(i, j)])),
        o: of.triad.inverse.offset.into(),
        sigma_C: rows(|e| e.sigma),
        sigma_o: last(|e| e.sigma),
        interval_C: rows(|e| e.interval),
        interval_o: last(|e| e.interval),
        rotation_deg: Some(of.rotation_deg.map(|e| e.value)),
        interval_rotation_deg: Some(of.rotation_deg.map(|e| interval(&e))),
        delay_ms: delay.map(|e| e.value),
        interval_delay_ms: delay.map(interval),
        lever_arm_mm: arm.map(|arm| arm.map(|e| e.value)),
        interval_lever_arm_mm: arm.map(|arm| arm.map(|e| interval(&e))),
        judgement: Some(of.judgement.clone()),
        iron: of.iron.map(|iron| MovingIron {
            per_k: iron.per_k.map(|e| e.value),
            interval_per_k: iron.per_k.map(|e| interval(&e)),
            temp_c: iron.temp_c,
        }),
    }
}
