//! `mimu-fit-sessions/1`: a calibration of several sessions, with what is common, what belongs to a session, and what the next power-on makes of it.

use mimu_recording::RawUnit;
use serde::Serialize;

use super::TOOL;
use crate::calibration::{Combined, Judged, SessionOrigin};
use crate::parameter::{ParameterKind, TriadParameter};
use crate::quantity::{PerSensor, Sensor, present, raw_unit, scale_unit};
use crate::sessions::together::Direction;
use crate::sessions::{CommonTriad, Sessions};
use crate::triad::Angles;

/// Result of a fit of several sessions.
#[derive(Debug, Clone, Serialize)]
pub struct SessionsResult {
    /// `mimu-fit-sessions/1`.
    pub format: &'static str,
    /// Program and version.
    pub tool: &'static str,
    /// Unit under test.
    pub device: String,
    /// The judgement.
    pub judgement: crate::judgement::Judgement,
    /// Unit of the raw readings.
    pub raw_unit: RawUnit,
    /// The sessions, in the order in which they took place.
    pub sessions: Vec<SessionResult>,
    /// The class of parts whose prior was used for fewer than three sessions; null if none was.
    pub prior: Option<PriorResult>,
    /// Values of left-out sessions inside the 95 % intervals that the others predict, and of how many.
    pub predicted: Predicted,
    /// What does not fit one set of constant parameters, in sentences.
    pub findings: Vec<String>,
    /// The direction along which the biases of all axes move; null if there is none.
    pub moving_together: Option<Direction>,
    /// The triads.
    #[serde(serialize_with = "present")]
    pub sensors: PerSensor<Option<SensorSessions>>,
}

/// A session.
#[derive(Debug, Clone, Serialize)]
pub struct SessionResult {
    /// Its recording.
    pub recording: String,
    /// What its file says of it.
    #[serde(flatten)]
    pub origin: SessionOrigin,
    /// Why the calibration is not made from it: `contradicts_itself`, `contradicts_others` or `before_step`; null if it is.
    pub not_used: Option<&'static str>,
}

/// The prior of a class of parts.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct PriorResult {
    /// Name.
    pub class: &'static str,
    /// Where its figures come from.
    pub source: &'static str,
}

/// How well sessions predict one that was left out.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Predicted {
    /// Values inside.
    pub inside: usize,
    /// Of how many.
    pub of: usize,
}

/// A triad of all sessions.
#[derive(Debug, Clone, Serialize)]
pub struct SensorSessions {
    /// Error figures: in sample over all sessions, and of each session by the others.
    #[serde(flatten)]
    pub judged: Judged,
    /// The physical parameters.
    pub parameters: Vec<SessionParameter>,
}

/// A parameter of all sessions.
#[derive(Debug, Clone, Serialize)]
pub struct SessionParameter {
    /// The parameter.
    #[serde(skip)]
    pub of: TriadParameter,
    /// Name.
    pub name: String,
    /// Value expected at the next power-on.
    pub value: f64,
    /// Standard deviation of this expectation.
    pub sigma: f64,
    /// Lower end of its 95 % interval.
    pub lower: f64,
    /// Upper end.
    pub upper: f64,
    /// 95 % interval of the value that the next power-on will have; null for parameters that define the frame.
    pub next_power_on: Option<[f64; 2]>,
    /// Standard deviation between sessions, by REML; null for a single session, which says nothing of it.
    pub between_sigma: Option<f64>,
    /// Its 95 % interval.
    pub between_sigma_interval: Option<[f64; 2]>,
    /// Whether it drifts from session to session, so that the value is extrapolated.
    pub drifts: bool,
    /// Unit of all these.
    pub unit: String,
    /// The value in each session; null for a session without it.
    pub sessions: Vec<Option<OfSession>>,
}

/// A parameter in one session.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct OfSession {
    /// Estimate of the session alone.
    pub value: f64,
    /// Lower end of its 95 % interval: that of the session.
    pub lower: f64,
    /// Upper end.
    pub upper: f64,
    /// Prediction by the other sessions, and half of the 95 % interval of the difference; null without others.
    pub predicted: Option<[f64; 2]>,
}

impl SessionsResult {
    /// The result of `sessions` and their calibration.
    pub fn of(sessions: &Sessions, combined: &Combined) -> Self {
        let manifest = &sessions.fits[0].prepared.manifest;
        let origins = sessions.fits.iter().zip(&combined.calibration.sessions);
        let [inside, of] = sessions.predicted();
        let sensor = |sensor| {
            let common = sessions.triads[sensor].as_ref()?;
            Some(SensorSessions {
                judged: combined.judged[sensor].clone()?,
                parameters: parameters(sessions, sensor, common, manifest.raw_unit),
            })
        };
        Self {
            format: "mimu-fit-sessions/1",
            tool: TOOL,
            device: manifest.device.clone(),
            judgement: combined.judgement.clone(),
            raw_unit: manifest.raw_unit,
            sessions: origins
                .enumerate()
                .map(|(s, (fit, origin))| SessionResult {
                    recording: fit.prepared.place.clone(),
                    origin: origin.clone(),
                    not_used: sessions.not_used(s),
                })
                .collect(),
            prior: sessions.prior.map(|class| PriorResult {
                class: class.name(),
                source: class.source(),
            }),
            predicted: Predicted { inside, of },
            findings: sessions.sentences(),
            moving_together: sessions.together.clone(),
            sensors: PerSensor::from_fn(sensor),
        }
    }
}

fn parameters(
    sessions: &Sessions,
    sensor: Sensor,
    common: &CommonTriad,
    raw: RawUnit,
) -> Vec<SessionParameter> {
    let [expected, next] = [&common.common, &common.next].map(|t| t.physical(Angles::Exact));
    let own: Vec<_> = sessions
        .fits
        .iter()
        .map(|fit| Some(fit.sensor(sensor)?.estimated.triad.physical(Angles::Exact)))
        .collect();
    let each = TriadParameter::physical().into_iter().enumerate();
    each.map(|(k, of)| {
        let TriadParameter(kind, i) = of;
        let pick = |p: &crate::triad::Physical| match kind {
            ParameterKind::Scale => p.scale[i],
            ParameterKind::Misalignment => p.misalignment[i],
            ParameterKind::NonOrthogonality => p.non_orthogonality[i],
            _ => p.bias[i],
        };
        let (value, tomorrow) = (pick(&expected), pick(&next));
        let free = common.free.iter().position(|f| *f == k);
        // One session says nothing about the scatter between several: the likelihood of it is flat.
        let several = common.left_out.len() > 1;
        let between = free
            .filter(|_| several)
            .map(|f| &common.between.parameters[f]);
        let session = |(s, own): (usize, &Option<crate::triad::Physical>)| {
            let own = pick(own.as_ref()?);
            let left_out = common.left_out[s].as_ref();
            let predicted = left_out.and_then(|l| l.parameters.get(free?));
            Some(OfSession {
                value: own.value,
                lower: own.value - own.interval,
                upper: own.value + own.interval,
                predicted: predicted.map(|p| [p.predicted, p.half_width]),
            })
        };
        SessionParameter {
            of,
            name: of.to_string(),
            value: value.value,
            sigma: value.sigma,
            lower: value.value - value.interval,
            upper: value.value + value.interval,
            next_power_on: free
                .map(|_| [-1.0, 1.0].map(|sign| tomorrow.value + sign * tomorrow.interval)),
            between_sigma: between.map(|b| b.variance.sqrt()),
            between_sigma_interval: between.map(|b| b.sigma_interval),
            drifts: free.is_some_and(|f| common.drifting.contains(&f)),
            unit: match kind {
                ParameterKind::Scale => scale_unit(raw, sensor.unit()),
                ParameterKind::Bias => raw_unit(raw, sensor.unit()),
                _ => "rad".into(),
            },
            sessions: own.iter().enumerate().map(session).collect(),
        }
    })
    .collect()
}
