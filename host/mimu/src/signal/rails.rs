//! Channels that do not follow their input: at a rail of the converter, stuck, or dead.

use crate::signal::blocks::{Block, Condensed, Moments, Rails, extent, quantile};
use crate::warning::Warning;
use mimu_recording::health::{Constant, Extreme, Fault, Finding, channel_run_by_chance};
use mimu_recording::{Error, Manifest, RAW_COLUMNS, RawUnit, Result};

/// Longest run of equal samples that chance explains in channel `c`, from how often neighbours are equal while the channel works. `None` if
/// most are equal: then there is no limit.
pub(crate) fn longest_run_by_chance(condensed: &Condensed, c: usize) -> Option<f64> {
    channel_run_by_chance(share_of_repeats(condensed, c)?, condensed.rows)
}

/// Share of equal neighbours in channel `c`, the median over its blocks; `None` without blocks.
fn share_of_repeats(condensed: &Condensed, c: usize) -> Option<f64> {
    let blocks = condensed.blocks.iter().map(|b| b.raw[c]);
    let mut shares: Vec<f64> = blocks
        .filter(|m| m.n > 1)
        .map(|m| f64::from(m.repeats) / f64::from(m.n - 1))
        .collect();
    quantile(&mut shares, 0.5)
}

/// Number of successive blocks that must be calm at an extreme.
const CALM_BLOCKS: usize = 3;
/// Largest standard deviation of a calm block, relative to quiet ones. Quiet are the quietest tenth of the blocks of this channel away from
/// the extremes, and the quietest twentieth of the blocks of each other channel of the sensor, whose noise is similar; the smaller value
/// counts. (A gyro that is turned one way only rests at an end of its range: its other blocks all contain motion.) With ten samples of the
/// same noise per block, one block in four hundred is as calm by chance, and three in a row one in sixty million.
const CALM: f64 = 0.4;
/// Standard deviation of a block at rest, relative to the quietest twentieth of the blocks: with ten samples, one of noise alone exceeds it in a thousand.
const AT_REST: f64 = 3.0;
/// Share of the range that counts as near an extreme.
const NEAR: f64 = 0.1;

/// A calm extreme of a channel: the sensor is at its own rail, and only the converter's noise remains. `sign` is 1 for the high end and -1
/// for the low one. Returns the innermost value there.
///
/// Values do not repeat as at a converter's rail, because the converter still makes noise.
fn calm_end(condensed: &Condensed, c: usize, sign: f64, range: [f64; 2]) -> Option<f64> {
    let [low, high] = range;
    let near = NEAR * (high - low);
    let end = if sign > 0.0 { high } else { low };
    let deviation = |m: &Moments| (m.m2 / f64::from(m.n.max(2) - 1)).sqrt();
    let blocks_of = |c: usize| {
        let all = condensed.blocks.iter().map(move |b| b.raw[c]);
        all.filter(|m| m.n > 2)
    };
    // A block in which the other sensor is as calm as it ever is, is a rest: a gyro that is turned one way only rests at an end of its range, and lies on a
    // table stiller than any hand holds it.
    let others: Vec<(usize, f64)> = (if c < 3 { 3..6 } else { 0..3 })
        .filter(|o| condensed.has_raw[*o])
        .filter_map(|o| {
            let mut all: Vec<f64> = blocks_of(o).map(|m| deviation(&m)).collect();
            Some((o, AT_REST * quantile(&mut all, 0.05)?))
        })
        .collect();
    let moves = |b: &&Block| {
        others.is_empty()
            || others
                .iter()
                .any(|(o, still)| deviation(&b.raw[*o]) > *still)
    };
    let moving = condensed.blocks.iter().filter(moves).map(|b| b.raw[c]);
    let blocks: Vec<Moments> = moving.filter(|m| m.n > 2).collect();
    let elsewhere = blocks
        .iter()
        .filter(|m| m.mean > low + near && m.mean < high - near);
    let mut quiet = quantile(&mut elsewhere.map(deviation).collect::<Vec<_>>(), 0.1)?;
    let sensor = if c < 3 { 0..3 } else { 3..6 };
    for other in sensor.filter(|o| *o != c && condensed.has_raw[*o]) {
        let mut deviations: Vec<f64> = blocks_of(other).map(|m| deviation(&m)).collect();
        quiet = quiet.min(quantile(&mut deviations, 0.05)?);
    }
    let calm = |m: &Moments| deviation(m) < CALM * quiet && (m.mean - end).abs() < near;
    // The outermost calm segment: a pose near the end may be calm at another value than the rail.
    let segments = blocks.chunk_by(|a, b| calm(a) && calm(b));
    let calm_segments = segments.filter(|s| s.len() >= CALM_BLOCKS && calm(&s[0]));
    let inner = |s: &[Moments]| {
        let values = s.iter().map(|m| if sign > 0.0 { m.min } else { m.max });
        values.fold(end, |a, b| if sign > 0.0 { a.min(b) } else { a.max(b) })
    };
    let widest = calm_segments
        .map(inner)
        .max_by(|a, b| (sign * a).total_cmp(&(sign * b)))?;
    let spread = (end - widest).abs();
    // If motion went well beyond the calm value, that value is not a rail.
    (spread < 20.0 * CALM * quiet).then_some(widest)
}

/// How often the extreme `value` occurs: in all, and in a row.
fn count(moments: impl Iterator<Item = Moments>, value: f64) -> (u64, f64) {
    // Blocks are short: a run continues through blocks that contain only its value.
    let (mut all, mut longest, mut run) = (0, 0.0_f64, 0.0);
    for m in moments {
        if m.max == value {
            all += u64::from(m.at_max);
        } else if m.min == value {
            all += u64::from(m.at_min);
        }
        if m.min == m.max && m.max == value {
            run += f64::from(m.n);
        } else {
            run = 0.0;
            if m.run_value == value {
                longest = longest.max(f64::from(m.run));
            }
        }
        longest = longest.max(run);
    }
    (all, longest)
}

/// Lowest and highest reading of channel `c`; the infinities, the higher one first, without any.
fn range(condensed: &Condensed, c: usize) -> [f64; 2] {
    let known = condensed.blocks.iter().map(|b| &b.raw[c]);
    extent(known.filter(|m| m.n > 0).flat_map(|m| [m.min, m.max]))
}

/// The finding that the extreme `value` of channel `c` is a rail of the converter or of the part, if it is one.
fn converter_rail(
    condensed: &Condensed,
    in_si: bool,
    c: usize,
    value: f64,
    high: bool,
) -> Option<Finding> {
    let moments = condensed.blocks.iter().map(|b| b.raw[c]);
    let (count, longest) = count(moments.filter(|m| m.n > 0), value);
    let axes = (c / 3 * 3..c / 3 * 3 + 3).filter(|o| in_si && condensed.has_raw[*o]);
    let axes: Vec<[f64; 2]> = axes.map(|o| range(condensed, o)).collect();
    let extreme = Extreme {
        channel: c,
        high,
        value,
        count,
        longest,
        repeats: share_of_repeats(condensed, c),
    };
    extreme.rail(condensed.quantisation_step[c], &axes)
}

/// Rails of the six channels, as declared or as found. The largest or smallest value of a recording is a rail if it repeats in a row more
/// often than chance allows, if a converter ends there, or if readings there are calmer than the sensor's noise.
pub(crate) fn find(
    condensed: &Condensed,
    manifest: &Manifest,
    warnings: &mut Vec<Warning>,
) -> [Rails; 6] {
    let mut rails = [Rails::default(); 6];
    let in_si = manifest.raw_unit == RawUnit::Si;
    for (c, rail) in rails.iter_mut().enumerate() {
        if !condensed.has_raw[c] {
            continue;
        }
        let declared = manifest
            .rails
            .and_then(|r| if c < 3 { r.gyro } else { r.accel });
        if let Some([low, high]) = declared {
            *rail = Rails {
                low: Some(low),
                high: Some(high),
            };
            continue;
        }
        let [low, high] = range(condensed, c);
        if low == high {
            continue;
        }
        let ends = [(high, true, &mut rail.high), (low, false, &mut rail.low)];
        for (value, is_high, end) in ends {
            if let Some(found) = converter_rail(condensed, in_si, c, value, is_high) {
                warnings.push(Warning::Health(found));
                *end = Some(value);
            } else if let Some(inner) =
                calm_end(condensed, c, if is_high { 1.0 } else { -1.0 }, [low, high])
            {
                let (high, from) = (is_high, inner);
                let calm = Finding::new(RAW_COLUMNS[c], 0, Fault::CalmEnd { high, from });
                warnings.push(Warning::Health(calm));
                *end = Some(inner);
            }
        }
    }
    rails
}

/// Largest range of a coarse channel at rest, in quantisation steps.
const AT_REST_STEPS: f64 = 3.0;

/// The largest quantisation step of the sensor's channels other than `c`, if each stays within a few steps: then the unit was at rest and
/// its converter is coarse.
fn coarse_step_at_rest(condensed: &Condensed, c: usize) -> Option<f64> {
    let others = (c / 3 * 3..c / 3 * 3 + 3).filter(|o| *o != c && condensed.has_raw[*o]);
    let mut largest = None;
    for o in others {
        let [low, high] = range(condensed, o);
        let step = condensed.quantisation_step[o]?;
        if high - low > AT_REST_STEPS * step {
            return None;
        }
        largest = Some(step.max(largest.unwrap_or(0.0)));
    }
    largest
}

/// Refuses a recording in which a channel never changes.
pub fn refuse_dead_channels(condensed: &Condensed, place: &str) -> Result<()> {
    for c in 0..6 {
        if !condensed.has_raw[c] {
            continue;
        }
        let known = condensed.blocks.iter().map(|b| b.raw[c]);
        let extremes = known.filter(|m| m.n > 0).flat_map(|m| [m.min, m.max]);
        let channel = Constant::of(extremes);
        if channel.is_empty() {
            return Err(Error::new(
                format!("{place}, column {}", RAW_COLUMNS[c]),
                "every cell is empty or not a number",
                "leave the sensor's columns out, or import the right ones",
            ));
        }
        let Some(mut dead) = channel.found(c, condensed.rows) else {
            continue;
        };
        if let (Fault::Dead { value }, Some(step)) = (dead.fault, coarse_step_at_rest(condensed, c))
        {
            dead.fault = Fault::DeadOrCoarse { value, step };
        }
        return Err(dead.refusal(place));
    }
    Ok(())
}
