//! Changes of level within a still segment: poses that follow one another so closely that no motion shows between them.
//!
//! The means of a second before and after each block are compared. What is usual for this difference is known from the recording itself:
//! it contains the noise, whatever its colour, and the drift of a bias or of a hand over a second. A change of pose is far larger, and
//! abrupt.

use std::ops::Range;

use crate::signal::blocks::{Condensed, pool, quantile};

/// Least change of level, in robust standard deviations of the usual difference.
const SIGMAS: f64 = 10.0;
/// Standard deviation of normal deviations over the lower quartile of their magnitudes. The median would not do: in two poses of 2.4 s, most
/// of the differences contain the change between them.
const OF_QUARTILE: f64 = 3.138;
/// Number of blocks on either side that must contain half of the change: a creep or a drift takes longer.
const ABRUPT: usize = 2;

/// Splits the segments of blocks at abrupt changes of level in one of `channels`; `width` blocks on either side are compared.
pub(crate) fn split(
    segments: &mut Vec<Range<usize>>,
    condensed: &Condensed,
    channels: Range<usize>,
    width: usize,
) {
    let recorded = channels.filter(|c| condensed.has_raw[*c]);
    let channels: Vec<Channel> = recorded
        .map(|c| Channel::of(segments, condensed, c, width))
        .collect();
    let mut out = Vec::with_capacity(segments.len());
    for segment in segments.drain(..) {
        let mut from = segment.start;
        for at in changes(&segment, &channels, width) {
            out.push(from..at);
            from = at;
        }
        out.push(from..segment.end);
    }
    *segments = out;
}

/// The block means of a channel, and the usual difference between those of two seconds.
struct Channel {
    /// Sums of the block means before each block.
    sums: Vec<f64>,
    usual: f64,
}

impl Channel {
    fn of(segments: &[Range<usize>], condensed: &Condensed, c: usize, width: usize) -> Self {
        let blocks = &condensed.blocks;
        // From the mean of all, so that the sums keep their digits.
        let all = pool(blocks.iter().map(|b| b.raw[c])).mean;
        let mut sums = vec![0.0];
        let mut sum = 0.0;
        for block in blocks {
            sum += block.raw[c].mean - all;
            sums.push(sum);
        }
        let mut channel = Self { sums, usual: 0.0 };
        let step = condensed.quantisation_step[c].unwrap_or(0.0);
        let usual = channel.usual(segments.iter().flat_map(|s| inner(s, width)), width);
        channel.usual = usual.max(0.1 * step);
        channel
    }

    /// Robust standard deviation of the difference at the `blocks`.
    fn usual(&self, blocks: impl Iterator<Item = usize>, width: usize) -> f64 {
        let mut sizes: Vec<f64> = blocks.map(|i| self.step(i, width).abs()).collect();
        OF_QUARTILE * quantile(&mut sizes, 0.25).unwrap_or(0.0)
    }

    /// Mean of the `width` blocks from `i` on, minus that of the `width` blocks before.
    fn step(&self, i: usize, width: usize) -> f64 {
        let [before, at, after] = [i - width, i, i + width].map(|i| self.sums[i]);
        (after - 2.0 * at + before) / width as f64
    }
}

/// The blocks of `segment` that have `width` blocks on either side.
fn inner(segment: &Range<usize>, width: usize) -> Range<usize> {
    let from = segment.start + width;
    from..(segment.end + 1).saturating_sub(width).max(from)
}

/// The blocks at which the level of a channel changes, in order.
fn changes(segment: &Range<usize>, channels: &[Channel], width: usize) -> Vec<usize> {
    // What is usual in this segment: the platter of a turntable wobbles more than a unit at rest.
    let limits: Vec<f64> = channels
        .iter()
        .map(|channel| {
            SIGMAS
                * channel
                    .usual(inner(segment, width), width)
                    .max(channel.usual)
        })
        .collect();
    let size = |i: usize| {
        let each = channels.iter().zip(&limits);
        each.filter(|(_, limit)| **limit > 0.0)
            .map(|(channel, limit)| {
                let step = channel.step(i, width);
                let abrupt = (channel.step(i, ABRUPT) / step).abs() >= 0.5;
                if abrupt { step.abs() / limit } else { 0.0 }
            })
            .fold(0.0, f64::max)
    };
    let sizes: Vec<(usize, f64)> = inner(segment, width).map(|i| (i, size(i))).collect();
    let mut found: Vec<(usize, f64)> = Vec::new();
    for (i, size) in sizes.into_iter().filter(|(_, size)| *size > 1.0) {
        match found.last_mut() {
            // Of the positions around one change, the largest difference is at the change.
            Some(last) if i - last.0 < width => {
                if size > last.1 {
                    *last = (i, size);
                }
            }
            _ => found.push((i, size)),
        }
    }
    found.into_iter().map(|(i, _)| i).collect()
}
