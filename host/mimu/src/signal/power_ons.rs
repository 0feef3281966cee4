//! The power-ons within a recording: after each of them the biases are others.

use nalgebra::Vector3;

use crate::quantity::Sensor;
use crate::signal::blocks::{Condensed, quantile};
use crate::signal::dwell::{Dwell, Dwells};
use mimu_recording::{Manifest, Result};

/// To which power-on the dwells of a recording belong.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PowerOns {
    /// The times between restarts; empty if there is one.
    spans: Vec<Span>,
    /// Of each dwell: the number of its power-on, 0 for the one whose biases are those of the triads. Empty if there is one.
    number: Vec<usize>,
}

/// A time between restarts.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Span {
    /// From the first sample after a restart to the next restart, s.
    pub between_s: [f64; 2],
    /// What was added to the readings of the gyro, raw.
    pub gyro: Vector3<f64>,
}

impl PowerOns {
    /// A recording of one power-on.
    pub const ONE: &Self = &Self {
        spans: Vec::new(),
        number: Vec::new(),
    };

    /// Of dwells in these times. The triads have the biases of the last.
    pub(crate) fn of(dwells: &[Dwell], spans: Vec<Span>) -> Self {
        let span = |dwell: &Dwell| spans.partition_point(|s| s.between_s[1] <= dwell.start_s);
        let own: Vec<usize> = dwells.iter().map(span).collect();
        let mut with_dwells = own.clone();
        with_dwells.dedup();
        let later = |span: &usize| with_dwells.iter().filter(|other| *other > span).count();
        Self {
            number: match spans.is_empty() {
                true => Vec::new(),
                false => own.iter().map(later).collect(),
            },
            spans,
        }
    }

    /// The same for triads whose biases are those before the first restart, whether there are dwells before it or not.
    pub(crate) fn since(&self, dwells: &[Dwell]) -> Self {
        let first = self.spans.first().zip(dwells.first());
        let before = first.is_some_and(|(span, dwell)| span.between_s[1] <= dwell.start_s);
        let from = self
            .number
            .first()
            .map_or(0, |most| most + usize::from(before));
        Self {
            spans: self.spans.clone(),
            number: self.number.iter().map(|later| from - later).collect(),
        }
    }

    /// Number of the power-on of this dwell: 0 for the one whose biases are those of the triads.
    pub fn number(&self, dwell: usize) -> usize {
        self.number.get(dwell).copied().unwrap_or(0)
    }

    /// Number of power-ons with other biases.
    pub fn others(&self) -> usize {
        self.number.iter().copied().max().unwrap_or(0)
    }

    /// The times between restarts; empty if there is one.
    pub(crate) fn spans(&self) -> &[Span] {
        &self.spans
    }

    /// When the power-on with this number was, s, and its end. `None` without a dwell in it.
    pub(crate) fn between_s(&self, dwells: &[Dwell], number: usize) -> Option<[f64; 2]> {
        let dwell = self.number.iter().position(|n| *n == number)?;
        let start_s = dwells[dwell].start_s;
        let own = self.spans.iter().map(|span| span.between_s);
        own.into_iter()
            .find(|[from_s, to_s]| (*from_s..*to_s).contains(&start_s))
    }
}

/// Instants of the restarts in a manifest, s.
fn restarts(manifest: &Manifest) -> Vec<f64> {
    let recorded = manifest.recorded.iter().flat_map(|r| &r.restarts);
    recorded.map(|restart| restart.t_s).collect()
}

/// `condensed` with the gyro's readings before the last power-on moved by what their biases differ from the last, raw, and the times between restarts:
/// otherwise dwells of one power-on seem to turn beside those of another. `find` finds the dwells of one power-on. A few degrees an hour of the Earth's
/// rate do not matter here: the fit finds the rest.
pub(crate) fn with_one_bias(
    mut condensed: Condensed,
    manifest: &Manifest,
    find: impl Fn(&Condensed) -> Result<Dwells>,
) -> (Condensed, Vec<Span>) {
    let times = restarts(manifest);
    if times.is_empty() {
        return (condensed, Vec::new());
    }
    let edges = std::iter::once(f64::NEG_INFINITY).chain(times.iter().copied());
    let spans = edges.zip(times.iter().copied().chain([f64::INFINITY]));
    let bias = |[from, to]: [f64; 2]| {
        let dwells = find(&condensed.between(from, to)).ok()?.list;
        let middle = |c: usize| {
            let rests = dwells.iter().filter(|d| d.faults.gyro.is_none() && !d.turn);
            let mut means: Vec<f64> = rests.map(|d| d.raw[c].mean).collect();
            quantile(&mut means, 0.5)
        };
        let gyro = Sensor::Gyro.channels().start;
        let [x, y, z] = [0, 1, 2].map(|k| middle(gyro + k));
        Some(Vector3::new(x?, y?, z?))
    };
    let biases: Vec<_> = spans
        .map(|(from, to)| ([from, to], bias([from, to])))
        .collect();
    let last = biases.iter().rev().find_map(|(_, bias)| *bias);
    let moved = biases.into_iter().map(|(between_s, bias)| Span {
        between_s,
        gyro: last
            .zip(bias)
            .map_or_else(Vector3::zeros, |(last, bias)| last - bias),
    });
    let spans: Vec<Span> = moved.collect();
    for span in &spans {
        condensed.add_to_gyro(&span.gyro, span.between_s);
    }
    (condensed, spans)
}
