//! The judgement of noise at rest.

use super::{Channel, Survey};
use crate::judge::input;
use crate::judgement::{Judgement, JudgementKind};
use crate::quantity::{Sensor, duration, plural, significant};
use crate::unseen::BEYOND_NOISE;
use crate::warning::Warning;
use mimu_allan::model::Term;

/// Largest share by which the upper end of the interval of white noise may exceed it: estimators are tuned by its size.
const WIDEST_WHITE: f64 = 0.1;

impl Judgement {
    /// The judgement of the noise of a unit in one or more recordings: the worst that their warnings and their channels lead to. `None` without a
    /// recording.
    ///
    /// `Untested`: a channel is too short for a model, its white noise is not seen or not to within 10 %, its codes are coarser than its noise, or what an export gets as the random walk of
    /// a sensor is but the upper end of its interval. `Unexplained`: the terms of the model do not describe its curve.
    pub fn of_surveys(surveys: &[Survey]) -> Option<Self> {
        let by_input = surveys
            .iter()
            .flat_map(|s| &s.warnings)
            .filter_map(of_warning);
        let channels = || surveys.iter().flat_map(|s| &s.channels);
        let by_channel = channels().filter_map(of_channel);
        let by_bound = Sensor::BOTH.into_iter().filter_map(|sensor| {
            let own: Vec<&Channel> = channels().filter(|c| c.sensor == sensor).collect();
            of_bound(sensor, &own)
        });
        let shortest_s = surveys.iter().map(|s| s.span_s[1] - s.span_s[0]);
        let good = Self::new(
            JudgementKind::Good,
            format!(
                "the model describes the noise of {} in {} at rest",
                plural(channels().count() as u64, "channel"),
                duration(shortest_s.reduce(f64::min)?)
            ),
        );
        Self::worst(by_input.chain(by_channel).chain(by_bound).chain([good]))
    }
}

fn of_warning(warning: &Warning) -> Option<Judgement> {
    let kind = match warning {
        // Recordings and calibrations of one unit often have different names; another unit shows in the specific force.
        Warning::OtherDevice { .. } => None,
        Warning::Moves { .. } => Some(JudgementKind::Suspect),
        Warning::Channel(_, warning) if matches!(**warning, Warning::CoarseReadings { .. }) => {
            Some(JudgementKind::Untested)
        }
        other => input::of_warning(other),
    };
    Some(Judgement::new(kind?, warning))
}

fn of_channel(channel: &Channel) -> Option<Judgement> {
    if channel.dead.is_some() {
        return None; // there is a warning about it
    }
    let Some(model) = &channel.model else {
        let reason = format!(
            "{}: the record is too short for a noise model",
            channel.name
        );
        return Some(Judgement::new(JudgementKind::Untested, reason));
    };
    if let Some(factor) = model.excess.map(f64::sqrt).filter(|f| *f > BEYOND_NOISE) {
        let reason = format!(
            "{}: the terms of the noise model miss the curve by {} times its uncertainty",
            channel.name,
            significant(factor)
        );
        return Some(Judgement::new(JudgementKind::Unexplained, reason));
    }
    let reason = match model.get(Term::N) {
        Ok(n) => {
            let wider = n.upper / n.value - 1.0;
            if wider <= WIDEST_WHITE {
                return None;
            }
            format!(
                "white noise may be {} % larger (95 %): record for longer",
                significant(100.0 * wider)
            )
        }
        Err(unseen) => format!("no white noise: {}", channel.unit.reason(Term::N, unseen)),
    };
    let reason = format!("{}: {reason}", channel.name);
    Some(Judgement::new(JudgementKind::Untested, reason))
}

/// Time, s, from which on a walk may exceed the white noise for its bound to do no harm in a filter: those of MEMS gyros do so after 20 s and more. The bound of a record does so
/// after about a fortieth of its length.
const HARMLESS_S: f64 = 10.0;

/// The judgement of the random walk that exports get, of the worst axis, if that is a bound, and a loose one.
fn of_bound(sensor: Sensor, channels: &[&Channel]) -> Option<Judgement> {
    let seen = |c: &Channel| Some(c.model.as_ref()?.get(Term::K).ok()?.value);
    let largest = channels.iter().filter_map(|c| seen(c)).fold(0.0, f64::max);
    let bounds = channels.iter().filter(|c| seen(c).is_none());
    let bounds = bounds.filter_map(|c| Some((c, c.model.as_ref()?.at_most(Term::K)?)));
    let (channel, bound) = bounds.max_by(|a, b| a.1.total_cmp(&b.1))?;
    let reason = format!(
        "{}: the record does not show the {sensor}'s random walk K; exports get the upper end of its interval, {} {}: record for longer, or give it to the export",
        channel.name,
        significant(bound),
        channel.unit.coefficient(Term::K)
    );
    let white = channel.model.as_ref()?.get(Term::N).ok()?.value;
    let exceeds_s = 3f64.sqrt() * white / bound;
    (bound > largest && exceeds_s < HARMLESS_S)
        .then(|| Judgement::new(JudgementKind::Untested, reason))
}
