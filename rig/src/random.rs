//! Random numbers that are equal on every machine, with an independent stream for each physical cause.

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

use crate::rotation::Rotation;

/// Random numbers for one cause.
#[derive(Debug, Clone)]
pub struct Random(Pcg64Mcg);

impl Random {
    /// Stream of `cause` under a seed. It does not depend on how much other causes draw.
    pub fn new(seed: u64, cause: &str) -> Self {
        // FNV-1a: any hash of the name will do, because the generator mixes its seed itself.
        let name = cause.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |h, b| {
            (h ^ u64::from(b)).wrapping_mul(0x0000_0100_0000_01b3)
        });
        Self(Pcg64Mcg::seed_from_u64(
            seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ name,
        ))
    }

    /// Uniform from 0 to 1.
    pub fn uniform(&mut self) -> f64 {
        self.0.random()
    }

    /// Random 64 bits.
    pub fn word(&mut self) -> u64 {
        self.0.random()
    }

    /// Normal, zero mean, unit variance.
    pub fn normal(&mut self) -> f64 {
        self.0.sample(StandardNormal)
    }

    /// Uniform between `-size` and `size`.
    pub fn within(&mut self, size: f64) -> f64 {
        size * (2.0 * self.uniform() - 1.0)
    }

    /// A random attitude, uniformly distributed.
    pub fn attitude(&mut self) -> Rotation {
        Rotation::of(std::array::from_fn(|_| self.normal()))
    }
}
