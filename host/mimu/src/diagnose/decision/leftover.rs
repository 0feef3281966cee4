//! Residual structure that nothing explains.

use nalgebra::{DMatrix, DVector};
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

use crate::diagnose::rows::{Rows, Session};
use crate::diagnose::search::{Chosen, Search};
use crate::diagnose::variance::{Fitted, LikelihoodKind, VarianceModel};
use crate::effects::candidate::Candidate;
use crate::observable::{Observable, StratumName};
use crate::quantity::{AXES, Sensor, significant};
use crate::triad::directions;

/// A bias that wanders by more than this many times the noise of a dwell mean is unusual, and the verdict reports it even if the wander of
/// this unit was not recorded. Usual sensors wander by up to three times the noise in half an hour, not only by a random walk but also by
/// flicker, so that dwells of clean units scatter more than their samples.
pub const WANDERS: f64 = 4.0;
/// Probability that structure is reported for a clean sensor.
pub const FALSE_LEFTOVER: f64 = 1e-3;

/// Residual structure: scatter beyond the known noise that nothing explains.
#[derive(Debug, Clone)]
pub struct Leftover {
    /// Sensor.
    pub sensor: Sensor,
    /// Stratum.
    pub stratum: StratumName,
    /// Axis, if it belongs to one.
    pub axis: Option<usize>,
    /// What it correlates with.
    pub against: CorrelatesWith,
    /// Root mean square beyond the noise, in [`Self::unit`].
    pub strength: f64,
    /// Whether the biases of usual sensors wander as much, and the wander of this unit at rest was not recorded. It is then reported, not
    /// judged.
    pub usual: bool,
}

/// What residuals correlate with.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CorrelatesWith {
    /// A product or a jump that is reported and not removed, by its id.
    #[error("{0}")]
    Effect(String),
    /// The reading.
    #[error("reading")]
    Reading,
    /// Time.
    #[error("time: the bias wanders")]
    Time,
    /// Nothing that was recorded: the dwells do not repeat.
    #[error("no recorded quantity: the dwells do not repeat")]
    Nothing,
    /// Nothing that was recorded: within the dwells the channel is so many times as noisy as the noise file says.
    #[error("no recorded quantity: within the dwells it is {} times as noisy as the noise file says", significant(*.0))]
    Noisier(f64),
}

impl Serialize for Leftover {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut out = serializer.serialize_struct("Leftover", 7)?;
        out.serialize_field("sensor", &self.sensor)?;
        out.serialize_field("axis", &self.axis.map(|axis| AXES[axis]))?;
        out.serialize_field("rows", &self.stratum.to_string())?;
        out.serialize_field("against", &self.against.to_string())?;
        out.serialize_field("usual", &self.usual)?;
        out.serialize_field("strength", &self.strength)?;
        out.serialize_field("unit", self.unit())?;
        out.end()
    }
}

impl Leftover {
    /// SI unit of the strength.
    pub fn unit(&self) -> &'static str {
        self.stratum.0.figure().unit(self.sensor)
    }

    /// A suggested term as residual structure; `change` is how it changes the fitted rows.
    pub(super) fn suggested(term: &Candidate, rows: &Rows, change: &DVector<f64>) -> Self {
        let axis = term.axes().first().copied();
        let ours = rows.strata.iter().find(|s| s.axis() == axis);
        let range = ours.map_or(0..rows.y.len(), |s| s.rows.clone());
        let mean_square = change.rows(range.start, range.len()).norm_squared() / range.len() as f64;
        Self {
            sensor: rows.sensor,
            stratum: StratumName(Observable::Axis(axis.unwrap_or_default()), None),
            axis,
            against: CorrelatesWith::Effect(term.id()),
            strength: mean_square.sqrt(),
            usual: false,
        }
    }
}

/// Scatter beyond the known noise, stratum by stratum, and what it correlates with.
pub(super) fn leftover(
    search: &Search,
    model: &DMatrix<f64>,
    last: &Fitted,
    jumps: &[Chosen],
) -> Vec<Leftover> {
    let rows = search.rows;
    let mut left = Vec::new();
    let variance = VarianceModel::new(rows, true);
    let Some(last) = variance.fit(model, &last.components, LikelihoodKind::Likelihood) else {
        return left;
    };
    for (s, stratum) in rows.strata.iter().enumerate() {
        let [extra_white, random_walk] = last.components[s];
        let unit = stratum
            .random_walk
            .as_ref()
            .map_or(0.0, |w| w.diagonal().mean());
        let strength = (extra_white + random_walk * unit).sqrt();
        let jump = jumps
            .iter()
            .find(|j| j.candidate.axes().first().copied() == stratum.axis());
        // Without the components of this stratum: is the known noise enough? A random walk stays if the wander was not recorded, because
        // every bias wanders.
        let mut bare = last.components.clone();
        bare[s][0] = 0.0;
        if stratum.wander_known {
            bare[s][1] = 0.0;
        }
        let Some(bare) = variance.fit_at(model, &bare) else {
            continue;
        };
        let worse = bare.deviance - last.deviance;
        // Both components are at their bound under the null hypothesis, so chi-square of two degrees of freedom is conservative.
        let p = (-0.5 * worse).exp() * rows.strata.len() as f64;
        let floor = stratum.known_variances().mean().sqrt();
        let far = strength > WANDERS * floor;
        if p > FALSE_LEFTOVER && jump.is_none() && (stratum.wander_known || !far) {
            continue;
        }
        let against = match jump {
            Some(jump) => CorrelatesWith::Effect(jump.candidate.id()),
            None if random_walk * unit > extra_white => CorrelatesWith::Time,
            None => CorrelatesWith::Nothing,
        };
        left.push(Leftover {
            sensor: rows.sensor,
            stratum: stratum.name,
            axis: stratum.axis(),
            against,
            strength,
            usual: !stratum.wander_known && !far && jump.is_none(),
        });
    }
    left
}

/// Noise of a channel beyond that recorded at rest. Its cause is in no model, and it hides smaller effects.
pub(in crate::diagnose) fn noisier(session: &Session, sensor: Sensor) -> Vec<Leftover> {
    let scale = session.model(sensor).and_then(|m| directions(&m));
    let Some((_, scale, _)) = scale else {
        return Vec::new();
    };
    let of = |axis: usize| {
        let channel = sensor.channels().start + axis;
        let (beyond, times) = session.prepared.noise.beyond_noise_at_rest(channel)?;
        Some(Leftover {
            sensor,
            stratum: StratumName(Observable::Second(axis), None),
            axis: Some(axis),
            against: CorrelatesWith::Noisier(times),
            strength: beyond / scale[axis],
            usual: false,
        })
    };
    (0..3).filter_map(of).collect()
}
