//! The Earth's rate through a recording on a table.
//!
//! The reference columns hold the rate against the ground, and the ground turns with the Earth. If the latitude is known and a force shows the
//! vertical, the vertical component is known: niu (a.8). The horizontal component has an unknown direction on the ground, and the table keeps that
//! direction from dwell to dwell. So it is two unknown numbers of the session, rotated into the body by the attitude. Tilt comes from the known
//! forces. Heading comes from the known rates and, where the table moves without reference, from the integrated gyro: a heading that errs by five
//! degrees changes 0.004 deg/s by a tenth.
//!
//! The unknown numbers have a known size: Ω cos(latitude). As random numbers of this size they correlate the errors of the dwell means, and least
//! squares with that covariance estimates them together with the parameters. Where the heading is lost, other unknown numbers begin. A dwell by
//! itself then has two of its own, whose size goes into the intervals.

use std::ops::Range;

use mimu_core::compensation::Affine;
use mimu_recording::Manifest;
use nalgebra::{Matrix3, Rotation3, Unit, Vector3};

use super::earth::{Earth, poses};
use crate::quantity::Sensor;
use crate::signal::blocks::{Block, Condensed};
use crate::signal::dwell::{Dwell, Dwells};

/// A known force shows the vertical if its magnitude differs from gravity by less than this share: on a centrifuge it does not.
const OF_GRAVITY: f64 = 0.02;
/// Largest angle, rad, between the predicted vertical and that of a known force: 5 degrees. A larger one means that the motion between two dwells was
/// not followed, and the heading is lost.
const FOLLOWED: f64 = 0.087;
/// Largest angle, rad, that samples may lack: 2 degrees.
const MISSING: f64 = 0.035;
/// Slower than this, rad/s, a unit is at rest; five times the Earth's rate.
const AT_REST: f64 = 0.02;

/// The Earth's rate in an observation; by default none.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct EarthShare {
    /// The known part, rad/s in body axes.
    pub known: Vector3<f64>,
    /// The heading that the rest depends on: observations with the same number share three unknown numbers.
    pub heading: usize,
    /// The rate, rad/s in body axes, by one standard deviation of each of the three numbers.
    pub by: Matrix3<f64>,
}

impl EarthShare {
    /// Of an observation that does not depend on the Earth's rate.
    pub const NONE: Self = Self {
        known: Vector3::new(0.0, 0.0, 0.0),
        heading: 0,
        by: Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    };

    /// Whether the observation depends on the unknown part.
    pub fn is_unknown(&self) -> bool {
        self.by != Matrix3::zeros()
    }
}

/// The Earth's rate, or a sum of it: as in [`EarthShare`].
#[derive(Debug, Clone, Copy, PartialEq)]
struct Rate {
    known: Vector3<f64>,
    by: Matrix3<f64>,
}

impl Rate {
    const ZERO: Self = Self {
        known: Vector3::new(0.0, 0.0, 0.0),
        by: EarthShare::NONE.by,
    };

    fn add(&mut self, other: &Self, weight: f64) {
        self.known += other.known * weight;
        self.by += other.by * weight;
    }

    /// The mean over whole turns of a table that turns, about its axis: what is across that axis averages out.
    fn over_whole_turns(&mut self, dwell: &Dwell) {
        let turning = dwell.input(Sensor::Gyro).filter(|r| r.norm() > AT_REST);
        if let Some(axis) = turning.map(|rate| rate.normalize()) {
            let along = axis * axis.transpose();
            self.known = along * self.known;
            self.by = along * self.by;
        }
    }

    fn with_heading(self, heading: usize) -> EarthShare {
        let Self { known, by } = self;
        EarthShare { known, heading, by }
    }
}

/// The Earth's rate in one dwell.
#[derive(Debug, Clone)]
struct InDwell {
    heading: usize,
    mean: Rate,
    /// Block by block, if the attitude changes within the dwell.
    blocks: Vec<Rate>,
}

/// The Earth's rate in the dwells of a recording on a table.
#[derive(Debug, Clone)]
pub struct EarthOnTable {
    dwells: Vec<InDwell>,
    /// Number of headings: 1 if none is lost.
    pub headings: usize,
}

impl EarthOnTable {
    /// The Earth's rate in `dwells`. `gyro` is a first calibration (raw to rad/s), which follows the motion between dwells; an error of a per cent does
    /// not matter. `accel` is a first calibration (raw to m/s²), which shows the vertical at rest where no force is known.
    pub fn of(
        manifest: &Manifest,
        condensed: &Condensed,
        dwells: &Dwells,
        gyro: Option<&Affine<f64>>,
        accel: Option<&Affine<f64>>,
    ) -> Self {
        let mut path = Path {
            gravity_mps2: manifest.gravity_mps2,
            means: manifest.means,
            condensed,
            dwells,
            gyro,
            accel,
        };
        let (mut attitudes, mut headings) = path.attitudes();
        if accel.is_some() {
            // An accelerometer whose axes are not those of the table contradicts the known rates, and the headings seem lost.
            path.accel = None;
            let (without, headings_without) = path.attitudes();
            match headings.last() > headings_without.last() {
                true => (attitudes, headings) = (without, headings_without),
                false => path.accel = accel,
            }
        }
        path.share_by_pose(&mut attitudes, &mut headings);
        let ups: Vec<Option<Vector3<f64>>> = dwells.list.iter().map(|d| path.up(d)).collect();
        // Without a vertical the direction of the Earth's rate is unknown altogether.
        let by_force = ups.iter().any(Option::is_some);
        let earth = Earth::at(manifest.latitude_deg.filter(|_| by_force));
        let [known, sigma] = earth.on_the_ground();
        // In a body with this attitude, body to ground.
        let rate = |attitude: &Rotation3<f64>| {
            let to_body = attitude.inverse();
            Rate {
                known: to_body * known,
                by: to_body.matrix() * Matrix3::from_diagonal(&sigma),
            }
        };
        let in_dwell = |i: usize| {
            let dwell = &dwells.list[i];
            let start = attitudes[i];
            let each = path.through(dwell, &start);
            let mut mean = Rate::ZERO;
            for (attitude, share) in &each {
                mean.add(&rate(attitude), *share);
            }
            if path.means {
                mean.over_whole_turns(dwell);
            }
            let turns = each.windows(2).any(|pair| pair[0].0 != pair[1].0);
            let blocks = match turns {
                true => each.iter().map(|(a, _)| rate(a)).collect(),
                false => Vec::new(),
            };
            InDwell {
                heading: headings[i],
                mean,
                blocks,
            }
        };
        let count = headings.iter().max().map_or(0, |last| last + 1);
        Self {
            dwells: (0..dwells.list.len()).map(in_dwell).collect(),
            headings: count,
        }
    }

    /// Mean over dwell `dwell`.
    pub fn mean(&self, dwell: usize) -> EarthShare {
        let InDwell { heading, mean, .. } = &self.dwells[dwell];
        mean.with_heading(*heading)
    }

    /// Mean over block `block` of dwell `dwell`, counted from its first.
    pub fn at(&self, dwell: usize, block: usize) -> EarthShare {
        let of = &self.dwells[dwell];
        let rate = of.blocks.get(block).unwrap_or(&of.mean);
        rate.with_heading(of.heading)
    }

    /// Sum over the blocks of dwell `dwell` with these weights.
    pub fn weighted(&self, dwell: usize, weights: &[f64]) -> EarthShare {
        let of = &self.dwells[dwell];
        let mut sum = Rate::ZERO;
        for (k, weight) in weights.iter().enumerate() {
            sum.add(of.blocks.get(k).unwrap_or(&of.mean), *weight);
        }
        sum.with_heading(of.heading)
    }
}

/// The motion of the unit through a recording.
struct Path<'a> {
    gravity_mps2: f64,
    /// Whether the dwells are means without samples: they show no motion, neither within them nor in between.
    means: bool,
    condensed: &'a Condensed,
    dwells: &'a Dwells,
    gyro: Option<&'a Affine<f64>>,
    accel: Option<&'a Affine<f64>>,
}

impl Path<'_> {
    /// Direction up in body axes at the beginning of a dwell, if a force shows it.
    fn up(&self, dwell: &Dwell) -> Option<Vector3<f64>> {
        if dwell.moves(Sensor::Accel) {
            let block = self.condensed.blocks.get(dwell.blocks.start)?;
            let [rate, force] =
                [0, 3].map(|c| Vector3::from_fn(|k, _| block.reference[c + k].mean));
            let half_s = 0.5 * f64::from(block.rows) * self.condensed.period_s;
            let since = Rotation3::new(rate.map(f64::to_radians) * half_s);
            let usable = self.is_gravity(&force) && rate.iter().all(|r| r.is_finite());
            return usable.then(|| since * force.normalize());
        }
        let known = dwell.input(Sensor::Accel);
        let at_rest = || {
            dwell
                .input(Sensor::Gyro)
                .is_some_and(|r| r.norm() < AT_REST)
        };
        let measured = || {
            let usable = dwell.faults.accel.is_none() && at_rest();
            let force = self.accel?.apply(&dwell.raw_mean(Sensor::Accel));
            usable.then_some(force)
        };
        let force = known.or_else(measured)?;
        (known.is_none() || self.is_gravity(&force)).then(|| force.normalize())
    }

    fn is_gravity(&self, force: &Vector3<f64>) -> bool {
        (force.norm() / self.gravity_mps2 - 1.0).abs() < OF_GRAVITY
    }

    /// Attitude at the beginning of each dwell, body to ground, and the number of its heading.
    fn attitudes(&self) -> (Vec<Rotation3<f64>>, Vec<usize>) {
        let list = &self.dwells.list;
        let mut attitudes: Vec<Rotation3<f64>> = Vec::with_capacity(list.len());
        let mut headings: Vec<usize> = Vec::with_capacity(list.len());
        for (i, dwell) in list.iter().enumerate() {
            let up = self.up(dwell);
            let followed = i
                .checked_sub(1)
                .and_then(|before| self.after(&list[before], dwell, &attitudes[before]));
            let levelled = followed.and_then(|attitude| levelled(attitude, up.as_ref()));
            headings.push(match (levelled, headings.last()) {
                (Some(_), Some(last)) => *last,
                (_, last) => last.map_or(0, |last| last + 1),
            });
            attitudes.push(levelled.unwrap_or_else(|| upright(up.as_ref())));
        }
        (attitudes, headings)
    }

    /// Gives dwells whose headings are all unknown one heading in each pose. The heading may be the same in a pose, and then so is the Earth's rate: as
    /// independent errors they would average out.
    fn share_by_pose(&self, attitudes: &mut [Rotation3<f64>], headings: &mut [usize]) {
        let alone = |k: usize, headings: &[usize]| {
            headings.iter().filter(|h| **h == headings[k]).count() == 1
        };
        let single: Vec<usize> = (0..headings.len())
            .filter(|k| alone(*k, headings))
            .collect();
        let up = |k: &usize| Some((*k, self.up(&self.dwells.list[*k])?));
        let (dwells, ups): (Vec<usize>, Vec<Vector3<f64>>) = single.iter().filter_map(up).unzip();
        for (k, leader) in dwells.iter().zip(poses(&ups)) {
            (attitudes[*k], headings[*k]) = (attitudes[dwells[leader]], headings[dwells[leader]]);
        }
    }

    /// Attitude at the beginning of `next`, from that at the beginning of `dwell`; `None` if the motion in between is unknown.
    fn after(&self, dwell: &Dwell, next: &Dwell, start: &Rotation3<f64>) -> Option<Rotation3<f64>> {
        let blocks = &self.condensed.blocks;
        if self.means || dwell.blocks.is_empty() || next.blocks.is_empty() {
            return None;
        }
        let offset = self.offset(dwell, next);
        let mut attitude = *start;
        for i in dwell.blocks.start..next.blocks.start {
            let within = dwell.blocks.contains(&i);
            let rate = self.rate(&blocks[i], within.then_some(dwell), &offset)?;
            let period_s = self.condensed.period_s;
            let until_s = blocks[i + 1].start_s - blocks[i].start_s;
            let missing_s = until_s - f64::from(blocks[i].rows) * period_s;
            let lacks = blocks[i + 1].after_gap || missing_s > 1.5 * period_s;
            // An unknown motion within a gap: at rest on both sides it is taken to be none, for as long as samples are lost.
            if lacks && rate.norm() * missing_s > MISSING || missing_s > 1.0 {
                return None;
            }
            attitude *= Rotation3::new(rate * until_s);
        }
        Some(attitude)
    }

    /// Rate against the ground over a block, rad/s: that of the table, or by the gyro where the table gives none. A turn by an angle gives only the
    /// mean rate, so its course comes from the gyro.
    fn rate(&self, block: &Block, dwell: Option<&Dwell>, offset: &Offset) -> Option<Vector3<f64>> {
        let known = Vector3::from_fn(|k, _| block.reference[k].mean.to_radians());
        let turn = dwell.is_some_and(|d| d.turn);
        if known.iter().all(|x| x.is_finite()) && !turn {
            return Some(known);
        }
        let mean = || dwell.and_then(|d| d.input(Sensor::Gyro));
        let whole = Sensor::Gyro.channels().all(|c| {
            let moments = &block.raw[c];
            moments.n == block.rows && !self.dwells.rails[c].touched_by(moments)
        });
        let read = || {
            let raw = Vector3::from_fn(|k, _| block.raw[k].mean);
            let (matrix, offset) = (self.gyro?.matrix, offset.0?);
            Some(matrix * raw + offset)
        };
        match whole {
            true => read().or_else(mean),
            false => mean(),
        }
    }

    /// Offset of the gyro between two dwells, from their readings: a bias over temperature moves by degrees per second, and over a transit of five
    /// seconds that would be the whole heading.
    fn offset(&self, a: &Dwell, b: &Dwell) -> Offset {
        let of = |d: &Dwell| {
            let input = d.input(Sensor::Gyro)?;
            let usable = d.faults.gyro.is_none() && !d.moves(Sensor::Gyro);
            let offset = input - self.gyro?.matrix * d.raw_mean(Sensor::Gyro);
            usable.then_some((input.norm(), offset))
        };
        let mut both: Vec<(f64, Vector3<f64>)> = [of(a), of(b)].into_iter().flatten().collect();
        both.sort_by(|a, b| a.0.total_cmp(&b.0));
        Offset(match both[..] {
            [(_, a), (rate, b)] if rate < AT_REST => Some((a + b) * 0.5),
            [(_, a), ..] => Some(a),
            [] => self.gyro.map(|g| g.offset),
        })
    }

    /// Attitude in the middle of each block of `dwell`, and the share of the block; `start` is that at its beginning.
    fn through(&self, dwell: &Dwell, start: &Rotation3<f64>) -> Vec<(Rotation3<f64>, f64)> {
        let range: Range<usize> = dwell.blocks.clone();
        let blocks = self.condensed.blocks.get(range).unwrap_or(&[]);
        let total: f64 = blocks.iter().map(|b| f64::from(b.rows)).sum();
        if self.means || blocks.is_empty() {
            return vec![(*start, 1.0)];
        }
        let offset = self.offset(dwell, dwell);
        let mut attitude = *start;
        let mut out = Vec::with_capacity(blocks.len());
        for (k, block) in blocks.iter().enumerate() {
            let rate = self.rate(block, Some(dwell), &offset);
            let rate = rate.unwrap_or_else(Vector3::zeros);
            let rows_s = f64::from(block.rows) * self.condensed.period_s;
            let middle = attitude * Rotation3::new(rate * (0.5 * rows_s));
            out.push((middle, f64::from(block.rows) / total));
            let until_s = blocks
                .get(k + 1)
                .map_or(rows_s, |b| b.start_s - block.start_s);
            attitude *= Rotation3::new(rate * until_s);
        }
        out
    }
}

/// Offset of a gyro, rad/s; `None` without a calibration.
struct Offset(Option<Vector3<f64>>);

/// An attitude with this direction up, and any heading.
fn upright(up: Option<&Vector3<f64>>) -> Rotation3<f64> {
    let Some(up) = up else {
        return Rotation3::identity();
    };
    Rotation3::rotation_between(up, &Vector3::z()).unwrap_or_else(|| {
        let x = Unit::new_normalize(Vector3::x());
        Rotation3::from_axis_angle(&x, std::f64::consts::PI)
    })
}

/// `attitude` with the tilt of a known force; `None` if the two differ by more than [`FOLLOWED`].
fn levelled(attitude: Rotation3<f64>, up: Option<&Vector3<f64>>) -> Option<Rotation3<f64>> {
    let Some(up) = up else {
        return Some(attitude);
    };
    let predicted = attitude.inverse() * Vector3::z();
    let tilt = Rotation3::rotation_between(up, &predicted)?;
    (tilt.angle() < FOLLOWED).then(|| attitude * tilt)
}
