//! Channels that do not follow their input: at a rail of the converter, stuck, or dead.

use crate::signal::blocks::{Condensed, Moments, Rails, extent, quantile};
use crate::warning::Warning;
use mimu_recording::error::{Error, Result};
use mimu_recording::health::{Constant, Fault, RUN_LOG_ODDS, channel_run_by_chance, run_by_chance};
use mimu_recording::{Manifest, RAW_COLUMNS, RawUnit};

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
    let blocks: Vec<Moments> = blocks_of(c).collect();
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

/// Natural logarithm of the odds against an extreme that coincides by chance with the end of some converter.
const FULL_SCALE_LOG_ODDS: f64 = 8.0;

/// Natural logarithm of the odds against `value` being an extreme by chance; readings are multiples of `step`.
///
/// Almost all digital parts have 16 bits. A motion over thousands of codes that ends exactly at an end of their range was clipped there.
fn full_scale_log_odds(value: f64, step: Option<f64>) -> f64 {
    let codes = value / step.unwrap_or(1.0);
    let whole = codes.round();
    // The scale factor of an import rounds the last digits.
    if (codes - whole).abs() > 1e-6 * whole.abs() {
        return 0.0;
    }
    if [-32768.0, 32767.0, 65535.0].contains(&whole) {
        return f64::INFINITY;
    }
    let is_end = |bits: i32| whole == 2f64.powi(bits) - 1.0 || whole == -(2f64.powi(bits));
    match (7..=24).any(is_end) {
        true => FULL_SCALE_LOG_ODDS,
        false => 0.0,
    }
}

/// Full scales of gyros, deg/s, and of accelerometers, g, by data sheets.
const FULL_SCALES_DPS: [f64; 13] = [
    62.5, 75.0, 125.0, 150.0, 245.0, 250.0, 300.0, 450.0, 500.0, 1000.0, 2000.0, 2400.0, 4000.0,
];
const FULL_SCALES_G: [f64; 12] = [
    1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 16.0, 20.0, 24.0,
];
/// What drivers multiply g by, m/s².
const GRAVITIES: [f64; 4] = [9.806_65, 9.80, 9.81, 9.807];
/// Largest relative difference from a full scale: drivers and imports round their factors to six digits.
const FULL_SCALE_SHARE: f64 = 3e-6;

/// Whether a reading in SI is the full scale of a part. Readings in SI have no codes, but a motion seldom ends at exactly 250 deg/s.
fn is_full_scale(value: f64, c: usize) -> bool {
    let is = |full: f64| (value.abs() / full - 1.0).abs() < FULL_SCALE_SHARE;
    match c < 3 {
        true => FULL_SCALES_DPS.iter().any(|dps| is(dps.to_radians())),
        false => GRAVITIES
            .iter()
            .any(|gravity| FULL_SCALES_G.iter().any(|g| is(g * gravity))),
    }
}

/// Natural logarithm of the odds against readings in SI whose extreme `value` is a full scale by chance. Each axis of the sensor with the same extreme
/// is evidence: before its first sample a part may read its full scale on all of them.
fn si_log_odds(condensed: &Condensed, c: usize, value: f64) -> f64 {
    if !is_full_scale(value, c) {
        return 0.0;
    }
    let same = |o: &usize| {
        let known = condensed.blocks.iter().map(|b| &b.raw[*o]);
        let [low, high] = extent(known.filter(|m| m.n > 0).flat_map(|m| [m.min, m.max]));
        let near = |end: f64| (end.abs() / value.abs() - 1.0).abs() < FULL_SCALE_SHARE;
        near(low) || near(high)
    };
    let axes = (c / 3 * 3..c / 3 * 3 + 3).filter(|o| condensed.has_raw[*o]);
    FULL_SCALE_LOG_ODDS * axes.filter(same).count() as f64
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

/// The warning that the extreme `value` of channel `c` is a rail of the converter, if it is one.
fn converter_rail(
    condensed: &Condensed,
    in_si: bool,
    c: usize,
    value: f64,
    high: bool,
) -> Option<Warning> {
    let moments = condensed.blocks.iter().map(|b| b.raw[c]);
    let (all, longest) = count(moments.filter(|m| m.n > 0), value);
    let of_codes = full_scale_log_odds(value, condensed.quantisation_step[c]);
    let of_si = if in_si {
        si_log_odds(condensed, c, value)
    } else {
        0.0
    };
    let full_scale = of_codes.max(of_si);
    if of_codes > RUN_LOG_ODDS {
        return Some(Warning::EndOfConverter { count: all, value }.of_channel(c));
    }
    if of_si > RUN_LOG_ODDS || of_si > 0.0 && longest > 1.0 {
        return Some(Warning::FullScale { count: all, value }.of_channel(c));
    }
    // Only runs at the extreme are tested, so the length of the recording does not matter.
    let chance = run_by_chance(share_of_repeats(condensed, c)?, RUN_LOG_ODDS - full_scale)?;
    (longest > chance).then(|| {
        Warning::RunAtEnd {
            high,
            value,
            longest,
            by_chance: chance.floor(),
        }
        .of_channel(c)
    })
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
        let moments = || condensed.blocks.iter().map(|b| &b.raw[c]);
        let known = || moments().filter(|m| m.n > 0);
        let [low, high] = extent(known().flat_map(|m| [m.min, m.max]));
        if low == high {
            continue;
        }
        let ends = [(high, true, &mut rail.high), (low, false, &mut rail.low)];
        for (value, is_high, end) in ends {
            if let Some(remark) = converter_rail(condensed, in_si, c, value, is_high) {
                warnings.push(remark);
                *end = Some(value);
            } else if let Some(inner) =
                calm_end(condensed, c, if is_high { 1.0 } else { -1.0 }, [low, high])
            {
                warnings.push(
                    Warning::CalmEnd {
                        high: is_high,
                        from: inner,
                    }
                    .of_channel(c),
                );
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
        let known = || {
            condensed
                .blocks
                .iter()
                .map(|b| &b.raw[o])
                .filter(|m| m.n > 0)
        };
        let [low, high] = extent(known().flat_map(|m| [m.min, m.max]));
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
