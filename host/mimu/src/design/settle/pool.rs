//! Dwells that can be made, their information, and the fewest of them that suffice.
//!
//! As in [`crate::design::exchange`] a point is exchanged for the best candidate while that helps; but the criterion is not a
//! determinant. What counts are some columns beside all others, and of these that which is seen worst.

use nalgebra::DMatrix;

use super::layout::{Goal, Layout, What};
use super::stop::Stop;
use super::{Question, Sought};

/// The rows of one linear problem.
#[derive(Debug, Clone)]
pub struct Rows {
    /// Columns.
    pub width: usize,
    /// Rows of all candidates, one after the other, in sigmas of a dwell mean.
    pub rows: Vec<f64>,
    /// What is known beforehand: information matrix.
    pub start: DMatrix<f64>,
}

impl Rows {
    fn row(&self, i: usize) -> &[f64] {
        &self.rows[i * self.width..(i + 1) * self.width]
    }
}

/// Candidates and goals.
#[derive(Debug, Clone)]
pub struct Pool {
    blocks: Vec<Rows>,
    goals: Vec<Goal>,
    len: usize,
}

/// How one goal is reached.
#[derive(Debug, Clone, PartialEq)]
pub struct Seen {
    /// Suspect.
    pub suspect: usize,
    /// Coefficient.
    pub name: String,
    /// Root of the information.
    pub sigmas: f64,
    /// Whether nothing is left of it beside the other columns.
    pub lost: bool,
}

/// Information that each column has from nowhere, so that nothing is singular. Wanted are 0.25 and more.
const RIDGE: f64 = 1e-6;
/// Share of a column (squared) beside the others below which it is rounding.
const LOST: f64 = 1e-9;
/// Rounds of exchanges.
const ROUNDS: usize = 4;
/// Gain below which an exchange is rounding.
const GAIN: f64 = 1e-9;

impl Pool {
    /// Of given rows; all of them at least one column, and as many.
    pub fn of(blocks: Vec<Rows>, goals: Vec<Goal>) -> Self {
        let len = blocks.first().map_or(0, |b| b.rows.len() / b.width.max(1));
        Self { blocks, goals, len }
    }

    /// Of `stops` as candidates for the problems of a layout.
    pub fn new(layout: &Layout, question: &Question, stops: &[Stop]) -> Self {
        let mut blocks = Vec::new();
        for block in &layout.blocks {
            let mut rows = Vec::new();
            for stop in stops {
                block.row(question, stop, &mut rows);
            }
            let width = block.columns.len();
            let noise = question.noise_of(block.sensor);
            let sigma = noise.sigma(question.dwell_s);
            // Coefficients in units of their size; the others such that the largest regressor is a sigma.
            let units: Vec<f64> = (0..width)
                .map(|k| {
                    let most = rows
                        .iter()
                        .skip(k)
                        .step_by(width.max(1))
                        .fold(0.0, |m: f64, x| m.max(x.abs()));
                    let most = if most > 0.0 { most } else { 1.0 };
                    match block.columns[k] {
                        What::Coefficient(i, c) if question.suspects[i].sought == Sought::Each => {
                            question.suspects[i].sizes[c]
                        }
                        What::Whole(_) => 1.0,
                        _ => sigma / most,
                    }
                })
                .collect();
            for row in rows.chunks_mut(width.max(1)) {
                for (x, unit) in row.iter_mut().zip(&units) {
                    *x *= unit / sigma;
                }
            }
            let mut start = DMatrix::from_diagonal_element(width, width, RIDGE);
            if let Some(known) = question.known.filter(|_| !block.alone) {
                let told = known.information(question, block);
                start += DMatrix::from_fn(width, width, |r, c| told[(r, c)] * units[r] * units[c]);
            }
            blocks.push(Rows { width, rows, start });
        }
        let mut pool = Self::of(blocks, layout.goals.clone());
        pool.len = stops.len();
        pool
    }

    /// Information matrix of each block after `points`, each `passes` times.
    fn normal(
        &self,
        points: impl Iterator<Item = usize> + Clone,
        passes: usize,
    ) -> Vec<DMatrix<f64>> {
        let each = self.blocks.iter().map(|b| {
            let mut m = b.start.clone();
            for i in points.clone() {
                let x = b.row(i);
                for r in 0..b.width {
                    for c in 0..b.width {
                        m[(r, c)] += passes as f64 * x[r] * x[c];
                    }
                }
            }
            m
        });
        each.collect()
    }

    fn inverses(&self, points: &[usize], passes: usize) -> Vec<DMatrix<f64>> {
        let each = self.normal(points.iter().copied(), passes).into_iter();
        each.map(|m| {
            let width = m.ncols();
            // By the ridge it is never singular but for rounding.
            m.cholesky().map_or_else(
                || DMatrix::from_diagonal_element(width, width, 1.0 / RIDGE),
                |c| c.inverse(),
            )
        })
        .collect()
    }

    /// Information that all candidates together, once each, have for each goal, and whether it is lost.
    fn reached(&self) -> Vec<(f64, bool)> {
        let points: Vec<usize> = (0..self.len).collect();
        let normal = self.normal(points.iter().copied(), 1);
        let inverses = self.inverses(&points, 1);
        let of = |goal: &Goal| {
            let left = goal
                .members
                .iter()
                .map(|(b, k)| 1.0 / inverses[*b][(*k, *k)]);
            let whole = goal.members.iter().map(|(b, k)| normal[*b][(*k, *k)]);
            let (left, whole): (f64, f64) = (left.sum(), whole.sum());
            let nothing = RIDGE * goal.members.len() as f64;
            (left, left < LOST * whole + 100.0 * nothing)
        };
        self.goals.iter().map(of).collect()
    }

    /// How well all candidates together, once each, show the suspects.
    pub fn seen(&self) -> Vec<Seen> {
        let all = self.goals.iter().zip(self.reached());
        let named = all.filter_map(|(goal, (information, lost))| {
            Some(Seen {
                suspect: goal.suspect?,
                name: goal.name.clone(),
                sigmas: information.sqrt(),
                lost,
            })
        });
        named.collect()
    }

    /// Drops the goals that no number of these candidates reaches; whether there were any.
    pub fn forget_lost(&mut self) -> bool {
        let mut reached = self.reached().into_iter();
        let before = self.goals.len();
        self.goals.retain(|_| !reached.next().is_some_and(|r| r.1));
        self.goals.len() < before
    }

    /// The fewest candidates found, each measured `passes` times, that reach all goals; and whether they do, as they may
    /// not with `most`. A candidate may occur more than once.
    pub fn fewest(&self, passes: usize, most: usize) -> (Vec<usize>, bool) {
        let mut search = Search::new(self, passes);
        while !search.enough() && search.points.len() < most && self.len > 0 {
            let best = search.best();
            search.add(best);
        }
        search.improve();
        let mut best = (search.points.clone(), search.enough());
        while best.1 && !best.0.is_empty() {
            search.drop_least();
            search.improve();
            if !search.enough() {
                break;
            }
            best = (search.points.clone(), true);
        }
        best.0.sort_unstable();
        best
    }
}

/// A design on its way.
struct Search<'a> {
    pool: &'a Pool,
    passes: usize,
    points: Vec<usize>,
    inverses: Vec<DMatrix<f64>>,
    /// Goals and columns of each block.
    wanted: Vec<Vec<(usize, usize)>>,
}

impl<'a> Search<'a> {
    fn new(pool: &'a Pool, passes: usize) -> Self {
        let mut wanted = vec![Vec::new(); pool.blocks.len()];
        for (g, goal) in pool.goals.iter().enumerate() {
            for (block, column) in &goal.members {
                wanted[*block].push((g, *column));
            }
        }
        let mut search = Self {
            pool,
            passes,
            points: Vec::new(),
            inverses: Vec::new(),
            wanted,
        };
        search.anew();
        search
    }

    /// Without the rounding that updates add up.
    fn anew(&mut self) {
        self.inverses = self.pool.inverses(&self.points, self.passes);
    }

    /// Sum over the goals of the squares of what is wanted over what there is.
    fn cost(&self, information: &[f64]) -> f64 {
        let goals = self.pool.goals.iter().zip(information);
        goals.map(|(g, q)| (g.limit / q).powi(2)).sum()
    }

    /// Information of each goal after `weight` measurements more of candidate `i`.
    fn information(&self, i: usize, weight: f64, out: &mut [f64]) {
        out.fill(0.0);
        let widest = self.pool.blocks.iter().map(|b| b.width).max();
        let mut scratch = vec![0.0; widest.unwrap_or(0)];
        for (b, rows) in self.pool.blocks.iter().enumerate() {
            if self.wanted[b].is_empty() {
                continue;
            }
            let (x, a) = (rows.row(i), self.inverses[b].as_slice());
            let p = rows.width;
            let times = |k: usize| -> f64 {
                let column = &a[k * p..(k + 1) * p];
                column.iter().zip(x).map(|(a, x)| a * x).sum()
            };
            let v = &mut scratch[..p];
            for (k, v) in v.iter_mut().enumerate() {
                *v = times(k);
            }
            let d: f64 = v.iter().zip(x).map(|(v, x)| v * x).sum();
            let share = weight / (1.0 + weight * d);
            for (goal, k) in &self.wanted[b] {
                out[*goal] += 1.0 / (a[k * p + k] - share * v[*k] * v[*k]);
            }
        }
    }

    /// Candidate whose addition leaves the least cost.
    fn best(&self) -> usize {
        let mut information = vec![0.0; self.pool.goals.len()];
        let mut best = (0, f64::INFINITY);
        for i in 0..self.pool.len {
            self.information(i, self.passes as f64, &mut information);
            let cost = self.cost(&information);
            if cost < best.1 * (1.0 - GAIN) {
                best = (i, cost);
            }
        }
        best.0
    }

    fn update(&mut self, i: usize, weight: f64) {
        for (rows, a) in self.pool.blocks.iter().zip(&mut self.inverses) {
            let x = nalgebra::DVector::from_column_slice(rows.row(i));
            let v = &*a * &x;
            let share = weight / (1.0 + weight * v.dot(&x));
            a.ger(-share, &v, &v, 1.0);
        }
    }

    fn add(&mut self, i: usize) {
        self.points.push(i);
        self.update(i, self.passes as f64);
    }

    fn now(&self) -> f64 {
        let mut information = vec![0.0; self.pool.goals.len()];
        self.information(0, 0.0, &mut information);
        self.cost(&information)
    }

    fn enough(&mut self) -> bool {
        self.anew();
        let mut information = vec![0.0; self.pool.goals.len()];
        if self.pool.len > 0 {
            self.information(0, 0.0, &mut information);
        }
        let goals = self.pool.goals.iter().zip(&information);
        goals.into_iter().all(|(g, q)| *q >= g.limit * (1.0 - 1e-9))
    }

    /// Exchanges points until none helps.
    fn improve(&mut self) {
        for _ in 0..ROUNDS {
            self.anew();
            let mut moved = false;
            for k in 0..self.points.len() {
                let before = self.now();
                let out = self.points[k];
                self.update(out, -(self.passes as f64));
                let into = self.best();
                self.points[k] = into;
                self.update(into, self.passes as f64);
                if into != out && self.now() < before * (1.0 - GAIN) {
                    moved = true;
                } else if into != out {
                    self.update(into, -(self.passes as f64));
                    self.update(out, self.passes as f64);
                    self.points[k] = out;
                }
            }
            if !moved {
                break;
            }
        }
    }

    /// Leaves out the point that is missed least.
    fn drop_least(&mut self) {
        self.anew();
        let mut information = vec![0.0; self.pool.goals.len()];
        let mut least = (0, f64::INFINITY);
        for (k, i) in self.points.iter().enumerate() {
            self.information(*i, -(self.passes as f64), &mut information);
            let cost = self.cost(&information);
            if cost < least.1 && information.iter().all(|q| *q > 0.0) {
                least = (k, cost);
            }
        }
        if !self.points.is_empty() {
            self.points.remove(least.0);
        }
        self.anew();
    }
}
