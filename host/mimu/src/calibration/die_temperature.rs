//! A recording under a calibration over temperature: the temperatures of the dies, how far they are outside the calibration's range, and what the
//! sensors would have read at one temperature.

use std::sync::Arc;

use mimu_core::compensation::Affine;
use mimu_core::die::{BEYOND_C, DieLag, State};
use nalgebra::{Matrix3, Vector3};

use crate::calibration::{Calibration, Curves};
use crate::prepared::Prepared;
use crate::quantity::{PerSensor, Sensor};
use crate::signal::blocks::Block;
use crate::warning::Warning;

/// Temperatures of the dies, °C, in the middle of each block: those of the thermometer behind the lag. A block without a reading has that of the
/// block before; blocks before the first reading have the first. `None` without any reading.
pub fn of_blocks(blocks: &[Block], lag: &DieLag<f64>) -> Option<Vec<f64>> {
    let first = blocks
        .iter()
        .map(|b| b.temp_c.mean)
        .find(|t| t.is_finite())?;
    let mut state = State::new();
    let mut before_s = None;
    let each = blocks.iter().map(|block| {
        let middle_s = 0.5 * (block.start_s + block.last_s);
        let dt_s = before_s.map_or(0.0, |before| middle_s - before);
        before_s = Some(middle_s);
        lag.follow(&mut state, dt_s, block.temp_c.mean)
            .unwrap_or(first)
    });
    Some(each.collect())
}

/// The same of both triads, by the lags of a calibration.
pub fn of_triads(blocks: &[Block], curves: &Curves) -> Option<PerSensor<Vec<f64>>> {
    let lags = curves.lags().as_ref();
    lags.map(|lag| of_blocks(blocks, lag)).transpose()
}

/// A warning about samples at temperatures for which a calibration is not valid; `None` if there are none, or if its range is not known.
///
/// Curves are valid for the dies in their range, without a margin. A calibration at one temperature is also valid near it: samples count if the
/// thermometer is more than 5 K outside the range of its recording.
pub fn outside(calibration: &Calibration, blocks: &[Block]) -> Option<Warning> {
    let curves = calibration.curves();
    let (temperatures, [from, to], margin_c) = match &curves {
        Some(curves) => (of_triads(blocks, curves)?, curves.table().limits()?, 0.0),
        None => (
            PerSensor {
                gyro: of_blocks(blocks, &DieLag::none())?,
                accel: Vec::new(),
            },
            calibration.recording.temp_range_c?,
            BEYOND_C,
        ),
    };
    let away = |t: f64| (from - t).max(t - to);
    let (mut count, mut all, mut farthest) = (0_u64, 0_u64, 0.0_f64);
    for (at, block) in blocks.iter().enumerate() {
        let rows = u64::from(block.rows);
        all += rows;
        let each = temperatures.iter().filter_map(|(_, t)| t.get(at));
        let off = each.map(|t| away(*t)).fold(0.0, f64::max);
        if off > margin_c {
            count += rows;
            farthest = farthest.max(off);
        }
    }
    if count == 0 {
        return None;
    }
    let beyond = curves.is_some().then_some(BEYOND_C);
    Some(Warning::OutOfRange {
        samples: [count, all],
        range_c: [from, to],
        farthest_k: farthest,
        beyond_k: beyond,
    })
}

/// The recording as its sensors would have read at the one temperature for which `[gyro]` and `[accel]` of the calibration hold. A reading u under
/// the model C(T), o(T) of its temperature becomes the reading that has the same input under C, o. So whatever judges it by the one model judges it
/// by the curves. `None` if the recording has no temperature or the calibration is singular.
pub fn at_one_temperature(
    prepared: &Prepared,
    calibration: &Calibration,
    curves: &Curves,
) -> Option<Prepared> {
    let blocks = &prepared.condensed.blocks;
    let temperatures = of_triads(blocks, curves)?;
    let mut out = prepared.clone();
    for sensor in Sensor::BOTH {
        let Some(model) = calibration.inverse(sensor) else {
            continue;
        };
        let back = model.matrix.try_inverse()?;
        let from = sensor.channels().start;
        let moved: Vec<Affine<f64>> = temperatures[sensor]
            .iter()
            .filter_map(|t| {
                let at = curves.inverse(sensor, *t)?;
                Some(Affine {
                    matrix: back * at.matrix,
                    offset: back * (at.offset - model.offset),
                })
            })
            .collect();
        move_sensor(&mut out, prepared, from, &moved);
    }
    Some(out)
}

/// Moves the readings of a triad, from channel `from` on, block by block.
fn move_sensor(out: &mut Prepared, prepared: &Prepared, from: usize, moved: &[Affine<f64>]) {
    let blocks = &prepared.condensed.blocks;
    let corrected = Arc::make_mut(&mut out.condensed);
    for (block, by) in corrected.blocks.iter_mut().zip(moved) {
        let raw = Vector3::from_fn(|i, _| block.raw[from + i].mean);
        let new = by.apply(&raw);
        for i in 0..3 {
            block.raw[from + i].mean = new[i];
        }
    }
    if from == Sensor::Gyro.channels().start {
        for piece in &mut corrected.increments {
            let t_s = piece.end_s - 0.5 * piece.duration_s;
            let at = blocks.partition_point(|b| b.last_s < t_s);
            let by = &moved[at.min(moved.len() - 1)];
            let new = by.matrix * Vector3::from(piece.integral) + by.offset * piece.duration_s;
            piece.integral = new.into();
        }
    }
    for dwell in &mut out.dwells.list {
        let range = dwell.blocks.clone();
        // The temperature hardly changes within a dwell. So the mean of its blocks' models, applied to its mean reading, is the mean of their results.
        let (mut matrix, mut offset) = (Matrix3::zeros(), Vector3::zeros());
        let share = 1.0 / range.len().max(1) as f64;
        for by in &moved[range] {
            matrix += by.matrix * share;
            offset += by.offset * share;
        }
        let raw = Vector3::from_fn(|i, _| dwell.raw[from + i].mean);
        let new = matrix * raw + offset;
        for i in 0..3 {
            dwell.raw[from + i].mean = new[i];
        }
    }
}
