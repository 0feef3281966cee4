//! Whether the unit was at rest, the means of its readings, and their noise.

use std::ops::Range;

use mimu::noise::Noise;
use mimu::quantity::Sensor;
use mimu::signal::blocks::Condensed;
use mimu::signal::dwell::{Dwell, Dwells};
use mimu::signal::stillness::{DwellSearch, STILL_FACTOR, Steps};
use mimu_recording::{Batch, Error, Result};
use nalgebra::Vector3;

use crate::gather::Samples;
use crate::scale::Scale;

/// Shortest measurement, s: the noise of a mean needs several means of half a second.
const SHORTEST_S: f64 = 3.0;
/// Fewest samples.
const FEWEST: usize = 200;
/// Least share of the samples in one rest. The ends may be cut where a knock ends.
const LEAST_SHARE: f64 = 0.8;
/// Largest turn of the specific force between the first and the last third of the rest, rad: 0.1 degrees, which moves an axis by 1.7 mg.
const LARGEST_TURN: f64 = 1.75e-3;
/// And as many of its standard deviations.
const TURN_SIGMAS: f64 = 5.0;

/// A rest.
#[derive(Debug, Clone)]
pub struct Rest {
    /// Its samples.
    pub rows: Range<usize>,
    /// Mean readings, raw.
    pub mean: [f64; 6],
    /// Variances of these means, raw units squared.
    pub variance: [f64; 6],
    /// Its length without lost samples, s.
    pub duration_s: f64,
    /// Quantisation steps that the readings show, raw.
    pub step: [Option<f64>; 6],
    /// Longest runs of equal readings that chance explains; infinite where most neighbours are equal, as of a converter coarser than the noise.
    pub longest_run: [f64; 6],
}

impl Rest {
    /// The rest in `samples`, which come `rate_hz` a second.
    ///
    /// # Errors
    /// The measurement is too short, or the unit moved: then nothing that is measured belongs to the unit.
    pub fn of(samples: &Samples, rate_hz: f64, scale: &Scale) -> Result<Self> {
        let place = &samples.place;
        let n = samples.batch.len();
        let lasts_s = n as f64 / rate_hz;
        if lasts_s < SHORTEST_S || n < FEWEST {
            let problem = format!("{n} samples in {lasts_s:.1} s are too few");
            let remedy =
                format!("measure for {SHORTEST_S} s or more, and {FEWEST} samples or more");
            return Err(Error::undetermined(place, problem, remedy));
        }
        // Lost samples are measured elsewhere. Here they would only end the rest, so the times are regular.
        let regular = Batch {
            t_s: (0..n).map(|k| k as f64 / rate_hz).collect(),
            temp_c: samples.batch.temp_c.clone(),
            raw: samples.batch.raw.clone(),
            ..Batch::default()
        };
        let manifest = samples.manifest(rate_hz);
        let condensed = Condensed::of(&regular, rate_hz, false)?;
        let search = DwellSearch {
            still_factor: STILL_FACTOR,
            steps: Steps::Found,
        };
        let moved = |when: String| {
            let problem = format!("the unit moved during the measurement{when}");
            Error::undetermined(place, problem, "let it lie still, and measure again")
        };
        let dwells =
            Dwells::find(&condensed, &manifest, search).map_err(|_| moved(String::new()))?;
        let longest = dwells.list.iter().max_by_key(|d| d.rows);
        let dwell = longest.ok_or_else(|| moved(String::new()))?;
        if (dwell.rows as f64) < LEAST_SHARE * n as f64 {
            let [from, to] = [dwell.start_s, dwell.last_s];
            return Err(moved(format!(
                ": of {lasts_s:.1} s it was still from {from:.1} to {to:.1} s only"
            )));
        }
        let noise = Noise::within(std::slice::from_ref(dwell), &condensed, &dwells.rails);
        let variance = |c: usize| noise.channels[c].variance(dwell.duration_s);
        let rest = Self {
            rows: dwell.first_row as usize..(dwell.first_row + dwell.rows) as usize,
            mean: dwell.raw.map(|mean| mean.mean),
            variance: [0, 1, 2, 3, 4, 5].map(variance),
            duration_s: dwell.duration_s,
            step: condensed.quantisation_step,
            longest_run: dwells.longest_run,
        };
        match turned(dwell, &condensed, scale) {
            Some(angle) if samples.has(Sensor::Accel as usize) => Err(moved(format!(
                ": it turned by {:.2} deg",
                angle.to_degrees()
            ))),
            _ => Ok(rest),
        }
    }

    /// Mean readings of `sensor`, raw.
    pub fn raw(&self, sensor: Sensor) -> Vector3<f64> {
        let from = sensor.channels().start;
        Vector3::from_fn(|axis, _| self.mean[from + axis])
    }
}

/// The angle between the forces in the first and the last third, rad, if it is a turn.
fn turned(dwell: &Dwell, condensed: &Condensed, scale: &Scale) -> Option<f64> {
    let third = (dwell.blocks.len() / 3).max(1);
    let per_raw = scale.si_per_raw(Sensor::Accel);
    // By how neighbours differ: a slow turn is in the noise of the whole rest, and would hide itself.
    let blocks = &condensed.blocks[dwell.blocks.clone()];
    let variance = (0..3).map(|axis| {
        let steps = blocks
            .windows(2)
            .map(|b| b[1].raw[3 + axis].mean - b[0].raw[3 + axis].mean);
        let squares: f64 = steps.map(|s| s * s).sum();
        squares / (2.0 * (blocks.len() - 1).max(1) as f64) * per_raw[axis].powi(2)
    });
    let force = |blocks: Range<usize>| {
        let count = blocks.len() as f64;
        let mean = |axis: usize| {
            let blocks = condensed.blocks[blocks.clone()].iter();
            blocks.map(|b| b.raw[3 + axis].mean).sum::<f64>() / count
        };
        scale.apply(Sensor::Accel, &Vector3::from_fn(|axis, _| mean(axis)))
    };
    let first = force(dwell.blocks.start..dwell.blocks.start + third);
    let last = force(dwell.blocks.end - third..dwell.blocks.end);
    let angle = first.angle(&last);
    let sigma = (2.0 * variance.fold(0.0, f64::max) / third as f64).sqrt() / first.norm();
    (angle > LARGEST_TURN + TURN_SIGMAS * sigma).then_some(angle)
}
