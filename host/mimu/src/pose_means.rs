//! Prepares tables of means for a fit, without samples.
//!
//! Each row is a dwell, with the noise that the table gives. Nothing is judged that only samples show (stillness, rails, stuck channels).
//! Time-dependent quantities are unknown: turns, drifts and bias wander.

use crate::noise::Noise;
use crate::prepared::Prepared;
use crate::quantity::{PerSensor, Sensor};
use crate::signal::blocks::{Block, Condensed, Level, Moments};
use crate::signal::dwell::{Dwell, Dwells, Fault, Keep, Mean};
use crate::signal::jump::Jump;
use crate::warning::Warning;
use mimu_recording::{Column, PoseMean, PoseMeans, Reference, Result};

impl Prepared {
    /// The dwells of a table of means, ready for [`fit`](fn@crate::fit::fit) and for nothing else.
    ///
    /// The variance of a mean is that of its samples over their number, as for white noise. If the table does not give it, it is zero, and
    /// the scatter about the fit is the only known noise.
    ///
    /// Errors: those of the manifest.
    pub fn of_means(means: &PoseMeans) -> Result<Self> {
        let manifest = means.manifest.clone();
        manifest.check(&means.place)?;
        let period_s = 1.0 / manifest.sample_rate_hz;
        let has_raw = [0, 1, 2, 3, 4, 5].map(|c| means.columns.has(Column::Raw(c)));
        let poses = means.poses.iter().enumerate();
        let (blocks, list): (Vec<Block>, Vec<Dwell>) = poses
            .map(|(i, pose)| {
                let dwell = dwell(i, pose, period_s, &has_raw);
                (block(&dwell, pose), dwell)
            })
            .unzip();
        let condensed = Condensed {
            blocks,
            increments: Vec::new(),
            rows: means.poses.len() as u64,
            quantisation_step: [None; 6],
            signed_low_byte: Vec::new(),
            no_temperatures: None,
            has_raw,
            has_reference: means.columns.reference,
            has_steps: true,
            period_s,
            gaps: (0, 0.0),
            duplicates: 0,
            missing: [0; 6],
            sha256: means.sha256.clone(),
            warnings: Vec::new(),
        };
        let dwells = Dwells {
            warnings: warnings(&list, means, &has_raw),
            list,
            detection: None,
            fault: None,
            rails: Default::default(),
            longest_run: [f64::INFINITY; 6],
            left_out: Vec::new(),
            keep: Keep::default(),
        };
        let prepared = Self {
            reference_error: manifest.reference_error.clone(),
            manifest,
            condensed: condensed.into(),
            dwells,
            noise: Noise::of_table(
                Sensor::BOTH.map(|s| means.poses.iter().all(|p| knows_noise(p, s))),
            ),
            place: means.place.clone(),
            bias_removal: None,
            power_ons: Default::default(),
            earth_on_table: None,
            prior: None,
        };
        Ok(prepared.with_earth())
    }
}

fn dwell(i: usize, pose: &PoseMean, period_s: f64, has_raw: &[bool; 6]) -> Dwell {
    let raw = [0, 1, 2, 3, 4, 5].map(|c| match pose.raw[c] {
        mean if mean.is_nan() => Mean::default(),
        mean => Mean {
            n: pose.averaged[c].unwrap_or(1),
            mean,
            variance: match pose.deviation[c] {
                unknown if unknown.is_nan() => 0.0,
                deviation => deviation * deviation,
            },
            clipped: 0,
        },
    });
    let fault = |sensor: Sensor| {
        let mut own = sensor.channels().filter(|&c| has_raw[c]);
        own.find(|&c| raw[c].n == 0).map(Fault::Missing)
    };
    let rows = raw.iter().map(|mean| mean.n).max().unwrap_or(0);
    let mut reference = pose.reference;
    for rate in &mut reference[Sensor::Gyro.channels()] {
        *rate = rate.to_radians();
    }
    Dwell {
        // A table has far fewer rows than an i32 counts.
        step: i as i32,
        first_row: i as u64,
        rows,
        start_s: f64::NAN,
        last_s: f64::NAN,
        duration_s: match pose.averaged.iter().any(Option::is_some) {
            true => rows as f64 * period_s,
            false => f64::NAN,
        },
        blocks: i..i + 1,
        faults: PerSensor::from_fn(fault),
        raw,
        reference,
        temp_c: pose.temp_c,
        turn: false,
        moves: [false; 2],
        turns_slowly: false,
    }
}

/// The one block of a dwell.
fn block(dwell: &Dwell, pose: &PoseMean) -> Block {
    let level = |value: f64| Level {
        mean: value,
        min: value,
        max: value,
    };
    Block {
        first_row: dwell.first_row,
        rows: 1,
        start_s: f64::NAN,
        last_s: f64::NAN,
        step: dwell.step,
        after_gap: true,
        raw: dwell.raw.map(|mean| Moments {
            n: u32::from(mean.n > 0),
            mean: mean.mean,
            min: mean.mean,
            max: mean.mean,
            ..Moments::default()
        }),
        jump: Jump::default(),
        reference: pose.reference.map(level),
        temp_c: level(pose.temp_c),
    }
}

/// Whether every mean of `sensor` has its standard deviation.
fn knows_noise(pose: &PoseMean, sensor: Sensor) -> bool {
    let mut own = sensor.channels().filter(|&c| !pose.raw[c].is_nan());
    own.all(|c| !pose.deviation[c].is_nan())
}

/// The warnings about the table.
fn warnings(list: &[Dwell], means: &PoseMeans, has_raw: &[bool; 6]) -> Vec<Warning> {
    let mut warnings = Vec::new();
    for sensor in Sensor::BOTH {
        let channels = || sensor.channels().filter(|&c| has_raw[c]);
        if channels().next().is_none() {
            continue;
        }
        let noise = match means.poses.iter().all(|p| knows_noise(p, sensor)) {
            false => Warning::MeansWithoutNoise,
            true => Warning::WhiteMeans,
        };
        warnings.push(noise.of(sensor));
        let without = list.iter().filter(|d| d.faults[sensor].is_some()).count();
        if without > 0 {
            warnings.push(
                Warning::MeansMissing {
                    missing: without,
                    rows: list.len(),
                }
                .of(sensor),
            );
        }
        if sensor == Sensor::Gyro && means.manifest.reference == Reference::Gravity {
            warnings.push(Warning::MeansOfTurns.of(sensor));
        }
    }
    warnings
}

#[cfg(test)]
mod tests;
