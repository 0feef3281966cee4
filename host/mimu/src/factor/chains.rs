//! Chains of dwells that turns connect: they determine the Earth's rate across the vertical.

use std::collections::BTreeMap;

use mimu_core::compensation::Affine;
use nalgebra::{Matrix3, Vector3};

use crate::observation::turn::{Rest, Turn, TurnError, across};
use crate::observation::{ByTriad, vector};

/// Dwells that turns connect one to the next. Within a chain the heading is known except for one angle. So the Earth's rate across the vertical is
/// known except for two numbers, which are estimated.
#[derive(Debug, Clone, Default)]
pub struct Chains {
    /// Chain to which each turn belongs.
    pub of_turn: Vec<Option<usize>>,
    /// Chain of each dwell at rest.
    pub of_rest: Vec<Option<usize>>,
    /// How many there are.
    pub count: usize,
}

/// Dwells from which on a chain estimates its two numbers; in shorter chains the Earth's rate across the vertical is noise.
const CHAIN: usize = 6;

/// A residual of a gyro by hand: a component of a turn's direction error, or of the rate at rest.
#[derive(Debug, Clone, Copy)]
pub struct GyroRow {
    /// Residual, rad or rad/s.
    pub residual: f64,
    /// Derivatives by the gyro.
    pub by: ByTriad,
    /// Its chain, and the derivatives by the Earth's level rate in it.
    level: Option<(usize, [f64; 2])>,
}

impl GyroRow {
    /// Place of each level rate among those of all chains, and the derivative by it.
    pub fn by_level(&self) -> impl Iterator<Item = (usize, f64)> {
        let each = self.level.into_iter();
        each.flat_map(|(chain, by)| [(2 * chain, by[0]), (2 * chain + 1, by[1])])
    }
}

impl Chains {
    /// Two rows of each turn, with these errors, then three of each rest under `model`, whose o is the rate at the reading `centre`.
    pub fn rows(
        &self,
        turns: &[Turn],
        errors: &[TurnError],
        rest: &[Rest],
        model: &Affine<f64>,
        centre: &Vector3<f64>,
    ) -> Vec<GyroRow> {
        let level = self.level(turns, errors.iter().map(|e| e.rotation));
        let mut rows = Vec::with_capacity(2 * turns.len() + 3 * rest.len());
        for (t, (turn, error)) in turns.iter().zip(errors).enumerate() {
            let earth = self.of_turn[t].zip(level.get(&turn.to));
            rows.extend([0, 1].map(|k| GyroRow {
                residual: error.block.residual[k],
                by: error.block.by(k),
                level: earth.map(|(chain, l)| {
                    let by = error.by_level(l, turn.duration_s).row(k).transpose();
                    (chain, by.into())
                }),
            }));
        }
        for (r, o) in rest.iter().enumerate() {
            let block = vector::at(model, &(o.raw - centre), &o.rate);
            let earth = self.of_rest[r].zip(level.get(&o.dwell));
            rows.extend([0, 1, 2].map(|axis| GyroRow {
                residual: block.residual[axis],
                by: block.by(axis),
                level: earth.map(|(chain, l)| (chain, l.map(|level| -level[axis]))),
            }));
        }
        rows
    }

    /// The chains of turns, which are in order of time.
    pub fn of(turns: &[Turn], rest: &[Rest]) -> Self {
        let mut out = Self {
            of_turn: Vec::with_capacity(turns.len()),
            of_rest: vec![None; rest.len()],
            count: 0,
        };
        for links in turns.chunk_by(|a, b| a.to == b.from) {
            let long = links.len() + 1 >= CHAIN;
            out.of_turn
                .extend(links.iter().map(|_| long.then_some(out.count)));
            if let (true, [first, .., last]) = (long, links) {
                for (chain, rest) in out.of_rest.iter_mut().zip(rest) {
                    if (first.from..=last.to).contains(&rest.dwell) {
                        *chain = Some(out.count);
                    }
                }
                out.count += 1;
            }
        }
        out
    }

    /// Two level directions, fixed in the world, in the body frame of each dwell of a chain; `rotations` are those of the turns.
    pub(super) fn level(
        &self,
        turns: &[Turn],
        rotations: impl Iterator<Item = Matrix3<f64>>,
    ) -> BTreeMap<usize, [Vector3<f64>; 2]> {
        let mut level: BTreeMap<usize, [Vector3<f64>; 2]> = BTreeMap::new();
        for ((turn, rotation), chain) in turns.iter().zip(rotations).zip(&self.of_turn) {
            if chain.is_none() {
                continue;
            }
            let before = level
                .entry(turn.from)
                .or_insert_with(|| across(&turn.before.normalize()));
            let up = turn.after.normalize();
            let north = rotation * before[0];
            let north = (north - up * up.dot(&north)).normalize();
            level.insert(turn.to, [north, up.cross(&north)]);
        }
        level
    }
}
