//! The integral that differences are taken of: doubles while it is short, packed to 27 bits a sample when it is long.
//!
//! Three hours at 1 kHz are 86 MB of doubles a channel, most of whose digits say where the integral has got to and
//! not what it does. Packed, a block of [`BLOCK`] samples is a straight line in doubles and for each sample how far it
//! is off that line, in 2^-24 of the largest distance in the block. What that costs is measured in
//! `tests/allan_vectors/rounding.rs`: 5e-10 of the deviation of 2e6 white rates, with gravity under them or a drift
//! through a thousand sigma; 2e-9 of that of a ramp without noise, which is the smoothest thing that a line leaves.
//!
//! A line and not a constant, so that an offset or a drift, which differences do not see or hardly, does not make
//! the steps coarser; 24 bits and not 16, which would cost up to 256 times as much, so that noise keeps its digits
//! where it is smooth from sample to sample (behind a filter, a random walk); not single precision, which is 24 bits
//! too and takes 32.

use std::ops::Range;

use rayon::prelude::*;

/// Samples in a block.
pub const BLOCK: usize = 64;
/// Of a series of up to so many rates all differences are used.
pub const ALL_TERMS: usize = 1 << 20;
/// Samples that are doubles as long as there are no more: 8 MB, in which small sets keep all their digits.
pub const DOUBLES: usize = ALL_TERMS + 1;
/// Blocks that one thread packs at a time.
const AT_A_TIME: usize = 64;
/// Half of the steps that 24 bits count.
const HALF: i32 = 1 << 23;

/// Samples that can be looked up anywhere.
pub trait Samples: Sync {
    /// How many there are.
    fn len(&self) -> usize;
    /// One of them.
    fn at(&self, i: usize) -> f64;
    /// All, where they lie side by side as doubles.
    fn slice(&self) -> Option<&[f64]>;
    /// Sum of the first `count` of the block that begins at `start`.
    fn sum_in_block(&self, start: usize, count: usize) -> f64;
}

impl Samples for [f64] {
    fn len(&self) -> usize {
        self.len()
    }

    #[inline(always)]
    fn at(&self, i: usize) -> f64 {
        self[i]
    }

    fn slice(&self) -> Option<&[f64]> {
        Some(self)
    }

    fn sum_in_block(&self, start: usize, count: usize) -> f64 {
        let (rows, rest) = self[start..start + count].as_chunks::<4>();
        let mut lanes = [0.0; 4];
        for row in rows {
            for (lane, v) in lanes.iter_mut().zip(row) {
                *lane += v;
            }
        }
        lanes.iter().sum::<f64>() + rest.iter().sum::<f64>()
    }
}

/// A block of packed samples. All that one sample needs lies together: looking samples up far apart is what long
/// clusters do.
#[derive(Debug, Clone)]
struct Block {
    /// First sample, and what the line adds with each.
    start: f64,
    slope: f64,
    step: f64,
    /// Upper 16 and lower 8 bits of each sample's distance from the line plus [`HALF`], apart: a vector register
    /// takes whole lanes of either, and of three bytes together it would take none.
    upper: [u16; BLOCK],
    lower: [u8; BLOCK],
}

/// Whole blocks that are packed, and after them doubles.
#[derive(Debug, Clone, Default)]
pub struct Series {
    blocks: Vec<Block>,
    doubles: Vec<f64>,
}

impl Series {
    /// Appends what `fill` writes into `count` samples.
    pub fn append(&mut self, count: usize, fill: impl FnOnce(&mut [f64])) {
        let before = self.doubles.len();
        self.doubles.resize(before + count, 0.0);
        fill(&mut self.doubles[before..]);
        if self.packed() > 0 || self.doubles.len() > DOUBLES {
            let (whole, rest) = self.doubles.as_chunks();
            self.blocks
                .par_extend(whole.par_iter().with_min_len(AT_A_TIME).map(Block::pack));
            self.doubles = rest.to_vec();
        }
    }

    /// Replaces `out` by the samples in `range`, which starts at a block.
    pub fn read(&self, range: Range<usize>, out: &mut Vec<f64>) {
        let packed = self.packed();
        let from = range.start.min(packed)..range.end.min(packed);
        out.clear();
        out.resize(from.len(), 0.0);
        for (out, block) in out
            .chunks_mut(BLOCK)
            .zip(&self.blocks[from.start / BLOCK..])
        {
            for (k, out) in out.iter_mut().enumerate() {
                *out = block.sample(k);
            }
        }
        let [start, end] = [range.start, range.end].map(|i| i.max(packed) - packed);
        out.extend_from_slice(&self.doubles[start..end]);
    }

    /// Number of samples in blocks.
    fn packed(&self) -> usize {
        self.blocks.len() * BLOCK
    }
}

impl Samples for Series {
    fn len(&self) -> usize {
        self.packed() + self.doubles.len()
    }

    #[inline(always)]
    fn at(&self, i: usize) -> f64 {
        match self.blocks.get(i / BLOCK) {
            Some(block) => block.sample(i % BLOCK),
            None => self.doubles[i - self.packed()],
        }
    }

    fn slice(&self) -> Option<&[f64]> {
        self.blocks.is_empty().then_some(&self.doubles)
    }

    fn sum_in_block(&self, start: usize, count: usize) -> f64 {
        match self.blocks.get(start / BLOCK) {
            Some(block) => block.sum(count),
            None => self.doubles.sum_in_block(start - self.packed(), count),
        }
    }
}

impl Block {
    fn pack(samples: &[f64; BLOCK]) -> Self {
        let start = samples[0];
        let slope = (samples[BLOCK - 1] - start) / (BLOCK - 1) as f64;
        let off = |k: usize| (samples[k] - start) - slope * k as f64;
        let furthest = (0..BLOCK).fold(0.0, |most, k| {
            let distance = off(k).abs();
            if distance > most { distance } else { most }
        });
        let step = furthest / f64::from(HALF - 1);
        // A smaller step has no inverse, and no number is between such samples and the line.
        let per_step = if step.is_normal() { 1.0 / step } else { 0.0 };
        let mut block = Self {
            start,
            slope,
            step,
            upper: [0; BLOCK],
            lower: [0; BLOCK],
        };
        for k in 0..BLOCK {
            // Positive, so that cutting off the fraction is rounding down.
            let code = (off(k) * per_step + (f64::from(HALF) + 0.5)) as i32;
            block.upper[k] = (code >> 8) as u16;
            block.lower[k] = code as u8;
        }
        block
    }

    #[inline(always)]
    fn sample(&self, k: usize) -> f64 {
        let steps = (i32::from(self.upper[k]) << 8 | i32::from(self.lower[k])) - HALF;
        self.start + (self.slope * k as f64 + self.step * f64::from(steps))
    }

    /// Sum of the first `count` samples.
    fn sum(&self, count: usize) -> f64 {
        let upper: i32 = self.upper[..count].iter().map(|&u| i32::from(u)).sum();
        let lower: i32 = self.lower[..count].iter().map(|&l| i32::from(l)).sum();
        let n = count as f64;
        let steps = 256.0 * f64::from(upper) + f64::from(lower) - n * f64::from(HALF);
        n * self.start + 0.5 * n * (n - 1.0) * self.slope + self.step * steps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Twice as long as what stays doubles, and a rest.
    fn walk() -> Vec<f64> {
        let (mut random, mut sum) = (1_u64, 5e4);
        (0..2 * DOUBLES + 17)
            .map(|_| {
                random ^= random >> 12;
                random ^= random << 25;
                random ^= random >> 27;
                sum += (random >> 40) as f64 / f64::from(1 << 24) - 0.3;
                sum
            })
            .collect()
    }

    fn packed(walk: &[f64]) -> Series {
        let mut series = Series::default();
        for part in walk.chunks(100_003) {
            series.append(part.len(), |out| out.copy_from_slice(part));
        }
        assert!(series.slice().is_none());
        series
    }

    #[test]
    fn samples_are_within_half_a_step_however_they_are_read() {
        let walk = walk();
        let series = packed(&walk);
        assert_eq!(series.len(), walk.len());
        let mut read = Vec::new();
        series.read(0..walk.len(), &mut read);
        for (block, read) in walk.chunks(BLOCK).zip(read.chunks(BLOCK)) {
            let slope = (block[block.len() - 1] - block[0]) / (block.len() - 1) as f64;
            let off = |(k, x): (usize, &f64)| (x - block[0] - slope * k as f64).abs();
            let furthest = block.iter().enumerate().map(off).fold(0.0, f64::max);
            // And the last digit of 5e5.
            let half = furthest * 2f64.powi(-24) * 1.001 + 1e-10;
            assert!(block.iter().zip(read).all(|(x, r)| (x - r).abs() <= half));
        }
        let ends = [0..7, BLOCK..1000, walk.len() / BLOCK * BLOCK..walk.len()];
        for range in ends {
            let mut part = Vec::new();
            series.read(range.clone(), &mut part);
            assert_eq!(part, read[range.clone()]);
            assert!(range.clone().all(|i| series.at(i) == read[i]));
        }
    }

    #[test]
    fn sums_of_parts_of_a_block_are_those_of_its_samples() {
        let walk = walk();
        let series = packed(&walk);
        for start in [0, 640, walk.len() / BLOCK * BLOCK] {
            for count in [0, 1, 5, 17] {
                let sum: f64 = (start..start + count).map(|i| series.at(i)).sum();
                let error = series.sum_in_block(start, count) - sum;
                assert!(error.abs() <= 1e-14 * sum.abs(), "{start} {count}: {error}");
            }
        }
    }

    #[test]
    fn a_block_that_is_a_line_is_that_line() {
        let line: Vec<f64> = (0..2 * DOUBLES).map(|i| 0.25 * i as f64 - 7.0).collect();
        let series = packed(&line);
        assert!((0..line.len()).all(|i| series.at(i) == line[i]));
    }
}
