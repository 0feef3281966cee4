//! Chains of dwells that turns connect: what they tell of the Earth's rate across the vertical.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};

use super::turn::{Rest, Turn, across};

/// Dwells that turns connect one to the next: in all of them the heading is known but for one angle, and so is the Earth's rate across
/// the vertical but for two numbers, which are estimated.
#[derive(Debug, Clone)]
pub struct Chains {
    /// Chain that each turn is a link of.
    pub of_turn: Vec<Option<usize>>,
    /// Chain of each dwell at rest.
    pub of_rest: Vec<Option<usize>>,
    /// How many there are.
    pub count: usize,
}

/// Dwells in a chain from which on its two numbers are worth their while; of fewer, the Earth's rate across is noise.
const CHAIN: usize = 6;

impl Chains {
    /// Of turns in order of time.
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

    /// Two level directions in the body frame of each dwell of a chain, the same ones in the world; `rotations` are those of the turns.
    pub fn level(
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
