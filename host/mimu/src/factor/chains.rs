//! Chains of dwells that turns connect: they determine the Earth's rate across the vertical.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};

use crate::observation::turn::{Rest, Turn, across};

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

impl Chains {
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
