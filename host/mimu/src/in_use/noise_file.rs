//! The noise file of a unit in use, for the exports.

use super::estimates::SIGMAS;
use super::likelihood::{Model, Session};
use crate::judgement::Judgement;
use crate::noise::noise_file::{FileCoefficient, NoiseChannel, NoiseFile};
use crate::quantity::Sensor;
use mimu_allan::model::Term;
use mimu_recording::RAW_COLUMNS;

/// The noise at rest with what motion adds to every axis.
pub(super) fn of(
    at_rest: &NoiseFile,
    session: &Session,
    model: &Model,
    ranges: &[[f64; 2]],
    judgement: &Judgement,
) -> NoiseFile {
    let mut file = at_rest.clone();
    file.judgement = Some(judgement.clone());
    file.confidence = 0.95;
    for channel in &mut file.channel {
        let Some((sensor, axis)) = place(channel) else {
            continue;
        };
        // In the unit of calibrated readings already, as the densities are.
        let n = channel.get(Term::N).map_or(0.0, |c| c.value.powi(2));
        // An axis whose walk the rest does not show has that of the worst axis: a filter takes one number for three axes, and its end would be the largest.
        let own = session.walks[sensor];
        let walk = match own[axis] > 0.0 {
            true => own[axis],
            false => own.into_iter().fold(0.0, f64::max),
        };
        let with = |known: f64, k: usize| {
            let of = |value: f64| (known + value * session.components[k].unit).sqrt();
            let [lower, upper] = ranges[k].map(of);
            (of(model.values[k]), lower, upper)
        };
        let unit = |term: Term| {
            let own = channel.get(term).map(|c| c.unit.clone());
            own.unwrap_or_else(|_| match term {
                Term::K => format!("{}/s/sqrt(Hz)", sensor.unit()),
                _ => format!("{}/sqrt(Hz)", sensor.unit()),
            })
        };
        let coefficient = |(value, lower, upper): (f64, f64, f64), term| FileCoefficient {
            value,
            sigma: (upper - lower) / (2.0 * SIGMAS),
            lower,
            upper,
            unit: unit(term),
        };
        let white = coefficient(with(n, sensor as usize), Term::N);
        let bias = with(walk, 2 + sensor as usize);
        let walked = (bias.0 > 0.0).then(|| coefficient(bias, Term::K));
        (channel.n, channel.n_reason) = (Some(white), None);
        (channel.k_reason, channel.k_at_most) = match &walked {
            Some(_) => (None, None),
            None => (Some("motion shows none".into()), Some(bias.2)),
        };
        channel.k = walked;
    }
    file
}

fn place(channel: &NoiseChannel) -> Option<(Sensor, usize)> {
    let at = RAW_COLUMNS.iter().position(|name| *name == channel.name)?;
    Some((Sensor::BOTH[at / 3], at % 3))
}
