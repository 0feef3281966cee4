//! One list of factors: what a recording says of the parameters of a unit, and how surely.
//!
//! A factor has residuals, their derivatives by named blocks of parameters ([`ParameterBlock`]), their known variances, the group whose scatter is estimated, and
//! the dwells it comes from. Residuals and derivatives are those of [`crate::observation`]. A list is in groups: the factors of one stand together. A fit
//! ([`crate::estimate::factor_fit`]) chooses which blocks are free and in which coordinates; a judgement evaluates the same list at given [`Values`].

pub mod chains;

use std::collections::BTreeMap;
use std::ops::Range;

use mimu_core::compensation::Affine;
use nalgebra::{
    DMatrix, DVector, Dim, Matrix, Matrix3, Matrix3x2, RawStorage, SMatrix, U12, Vector3,
};

use crate::observable::Observable;
use crate::observation::closure::{Closure, ClosureError, Closures};
use crate::observation::magnitude::Magnitude;
use crate::observation::turn::{Rest, Rotations, Turn, TurnError, Turned};
use crate::observation::{ByTriad, vector};
use crate::prior::TriadPrior;
use crate::quantity::{PerSensor, Sensor};
use crate::signal::power_ons::PowerOns;
use crate::triad::{affine, vector as parameters};
use chains::Chains;

/// A block of parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ParameterBlock {
    /// C by rows, then o of a triad, raw to SI: twelve.
    Triad(Sensor),
    /// The Earth's rate along the two level directions of a chain of dwells, rad/s.
    LevelRate(usize),
    /// Relative error of a magnitude that is given, such as the rate of a turntable.
    GivenMagnitude(usize),
    /// By what the bias o of a power-on differs from that of the triad, SI: of which triad, and the number of the power-on.
    BiasStep(Sensor, usize),
}

impl ParameterBlock {
    /// Number of its parameters.
    pub fn size(self) -> usize {
        match self {
            Self::Triad(_) => 12,
            Self::LevelRate(_) => 2,
            Self::GivenMagnitude(_) => 1,
            Self::BiasStep(..) => 3,
        }
    }
}

/// Steps of a bias from power-on to power-on, standard deviation, rad/s and m/s²: 1 deg/s, and 10 mg. Data sheets of consumer parts give a tenth to a half of
/// these. A power-on of one pose, which cannot show its bias, is then of little use and does no harm.
const BIAS_STEP: PerSensor<f64> = PerSensor {
    gyro: 0.017,
    accel: 0.098,
};

/// Values of blocks, one behind the other.
#[derive(Debug, Clone)]
pub struct Values {
    blocks: Vec<ParameterBlock>,
    /// The numbers.
    pub all: DVector<f64>,
}

impl Values {
    /// Of these blocks.
    pub fn new(blocks: Vec<ParameterBlock>, all: DVector<f64>) -> Self {
        Self { blocks, all }
    }

    /// Where a block is, if it is among them.
    pub fn range(&self, block: ParameterBlock) -> Option<Range<usize>> {
        let before = self.blocks.iter().take_while(|b| **b != block);
        let first = before.map(|b| b.size()).sum::<usize>();
        (first < self.all.len()).then(|| first..first + block.size())
    }

    /// The calibration of a triad, raw to SI.
    pub fn triad(&self, sensor: Sensor) -> Option<Affine<f64>> {
        let of = self.range(ParameterBlock::Triad(sensor))?;
        Some(affine(&self.all.fixed_rows::<12>(of.start).into_owned()))
    }
}

/// Residuals and their derivatives at some parameters.
pub struct Linearized {
    /// Residuals.
    pub residuals: DVector<f64>,
    /// Derivatives of the residuals, rows by parameters.
    pub jacobian: DMatrix<f64>,
}

impl Linearized {
    /// So many residuals by so many parameters, all zero.
    pub fn zeros(rows: usize, parameters: usize) -> Self {
        Self {
            residuals: DVector::zeros(rows),
            jacobian: DMatrix::zeros(rows, parameters),
        }
    }

    /// Each row times its weight.
    pub fn weighted(mut self, weights: &[f64]) -> Self {
        for (k, weight) in weights.iter().enumerate() {
            self.residuals[k] *= weight;
            self.jacobian.row_mut(k).scale_mut(*weight);
        }
        self
    }

    /// Covariance of the parameters, for weighted rows; `None` if it is singular.
    pub fn covariance(&self) -> Option<DMatrix<f64>> {
        (self.jacobian.transpose() * &self.jacobian).try_inverse()
    }

    /// The part of that `covariance` by the errors of some rows.
    pub fn part(&self, covariance: &DMatrix<f64>, rows: &Range<usize>) -> DMatrix<f64> {
        let j = self.jacobian.rows(rows.start, rows.len());
        covariance * (j.transpose() * j) * covariance
    }
}

/// What a factor observes.
#[derive(Debug, Clone)]
pub enum Kind<'a> {
    /// The magnitude of a triad's input.
    Magnitude {
        /// The triad.
        sensor: Sensor,
        /// Its mean reading.
        raw: Vector3<f64>,
        /// The magnitude, SI.
        known: f64,
        /// The given magnitude whose error it has.
        given: Option<usize>,
        /// Variance by noise, SI squared.
        variance: f64,
    },
    /// The input of a triad: of a table, or the rate of a gyro at rest.
    Input {
        /// The triad.
        sensor: Sensor,
        /// Its mean reading.
        raw: Vector3<f64>,
        /// The input, SI.
        known: Vector3<f64>,
        /// Variances of the reading by noise, raw units squared.
        noise: Vector3<f64>,
        /// Variances of the input, SI squared.
        variance: Vector3<f64>,
        /// The chain of a dwell at rest.
        chain: Option<usize>,
    },
    /// The direction of gravity after a turn, by its number, and its chain.
    Turn(usize, Option<usize>),
    /// The heading after whole turns, which are neighbours, and the variance without the noise of the gyro, rad².
    Closure(Closure, f64),
    /// Sums of a block's parameters that are known beforehand: values, matrix of the sums (a row for each) and variance of each.
    Stated(ParameterBlock, DVector<f64>, DMatrix<f64>, f64),
    /// The population of a triad's kind.
    Population(Sensor, &'a TriadPrior),
}

/// An observation of a unit.
#[derive(Debug, Clone)]
pub struct Factor<'a> {
    /// What it observes.
    pub kind: Kind<'a>,
    /// The group whose scatter its residuals share; `None` if the known variance is all.
    pub group: Option<Observable>,
    /// First and last of the dwells it comes from; `None` if it is known from elsewhere.
    pub dwells: Option<[usize; 2]>,
}

impl Factor<'_> {
    /// Number of residuals.
    pub fn rows(&self) -> usize {
        match &self.kind {
            Kind::Magnitude { .. } | Kind::Closure(..) => 1,
            Kind::Turn(..) => 2,
            Kind::Input { .. } => 3,
            Kind::Stated(_, _, sums, _) => sums.nrows(),
            Kind::Population(_, prior) => prior.rows(),
        }
    }
}

/// The turns that a factor is over, and the derivatives of each of its residuals by the rotation vectors of their increments, rad/rad, body frame.
pub type ByIncrements = (Range<usize>, Vec<Vec<Vector3<f64>>>);

/// A list of factors, with the turns that they refer to.
#[derive(Default, Clone)]
pub struct Factors<'a> {
    /// The factors, those of a group together.
    pub list: Vec<Factor<'a>>,
    turns: Vec<Turn<'a>>,
    rotations: Rotations,
    chains: Chains,
    power_ons: PowerOns,
    /// Known rate of the Earth about the vertical, rad/s.
    vertical: f64,
}

impl<'a> Factors<'a> {
    /// Without factors yet; they may refer to `turns`. Within `chains` the Earth's level rate is a block, and no noise.
    pub fn among(turns: &[Turn<'a>], chains: Chains) -> Self {
        let mut own = turns.to_vec();
        for (turn, chain) in own.iter_mut().zip(&chains.of_turn) {
            if chain.is_some() {
                turn.earth_variance = 0.0;
            }
        }
        Self {
            list: Vec::new(),
            turns: own,
            rotations: Rotations::new(turns),
            chains,
            power_ons: PowerOns::default(),
            vertical: 0.0,
        }
    }

    /// The directions after `turns`, where the Earth's level rate is noise.
    pub fn of_turns(turns: &[Turn<'a>]) -> Self {
        let mut factors = Self::among(turns, Chains::default());
        factors.directions(Observable::Turns, |_| true);
        factors
    }

    fn push(&mut self, kind: Kind<'a>, group: Observable, dwells: [usize; 2]) {
        self.list.push(Factor {
            kind,
            group: Some(group),
            dwells: Some(dwells),
        });
    }

    /// Adds the magnitude that a triad reads in a dwell.
    pub fn magnitude(
        &mut self,
        sensor: Sensor,
        (dwell, raw): (usize, Vector3<f64>),
        (known, given): (f64, Option<usize>),
        variance: f64,
    ) {
        let kind = Kind::Magnitude {
            sensor,
            raw,
            known,
            given,
            variance,
        };
        self.push(kind, Observable::Magnitude, [dwell; 2]);
    }

    /// Adds the known input of a triad in a dwell, with the variances of its reading, raw units squared.
    pub fn input(
        &mut self,
        sensor: Sensor,
        (dwell, raw): (usize, Vector3<f64>),
        known: Vector3<f64>,
        noise: Vector3<f64>,
    ) {
        self.list.push(Factor {
            kind: Kind::Input {
                sensor,
                raw,
                known,
                noise,
                variance: Vector3::zeros(),
                chain: None,
            },
            group: None,
            dwells: Some([dwell; 2]),
        });
    }

    /// Adds the directions after those of the turns that are `of` this group.
    pub fn directions(&mut self, group: Observable, of: impl Fn(usize) -> bool) {
        for t in (0..self.turns.len()).filter(|t| of(*t)) {
            let dwells = [self.turns[t].from, self.turns[t].to];
            let chain = self.chains.of_turn.get(t).copied().flatten();
            self.push(Kind::Turn(t, chain), group, dwells);
        }
    }

    /// Adds the headings after whole turns.
    pub fn headings(&mut self, whole: &Closures) {
        self.vertical = whole.vertical[0];
        for closure in &whole.list {
            let own = &self.turns[closure.turns.clone()];
            let dwells = [own[0].from, own[own.len() - 1].to];
            let kind = Kind::Closure(closure.clone(), whole.variance(own, 0.0));
            self.push(kind, Observable::WholeTurns, dwells);
        }
    }

    /// Adds the rates at rest.
    pub fn rests(&mut self, rest: &[Rest]) {
        let chains = self.chains.of_rest.clone();
        let chains = chains.into_iter().chain(std::iter::repeat(None));
        for (rest, chain) in rest.iter().zip(chains) {
            // Within a chain the level part of the rate is a parameter.
            let level = match chain {
                Some(_) => Vector3::zeros(),
                None => rest.rate_variance,
            };
            let kind = Kind::Input {
                sensor: Sensor::Gyro,
                raw: rest.raw,
                known: rest.rate,
                noise: rest.variance,
                variance: level + rest.vertical_variance,
                chain,
            };
            self.push(kind, Observable::Rest, [rest.dwell; 2]);
        }
    }

    /// Adds what is known beforehand.
    pub fn known(&mut self, kind: Kind<'a>, group: Option<Observable>) {
        self.list.push(Factor {
            kind,
            group,
            dwells: None,
        });
    }

    /// Adds what is known of the steps of the biases of `sensor` between the power-ons that factors come from; returns their blocks.
    pub fn bias_steps(&mut self, sensor: Sensor, power_ons: &PowerOns) -> Vec<ParameterBlock> {
        self.power_ons.clone_from(power_ons);
        let dwells = self.list.iter().filter_map(|factor| factor.dwells);
        let seen: Vec<usize> = dwells.map(|of| power_ons.number(of[0])).collect();
        let steps = (1..=power_ons.others()).filter(|step| seen.contains(step));
        let blocks: Vec<_> = steps
            .map(|step| ParameterBlock::BiasStep(sensor, step))
            .collect();
        let variance = BIAS_STEP[sensor].powi(2);
        for block in &blocks {
            let (none, each) = (DVector::zeros(3), DMatrix::identity(3, 3));
            self.known(Kind::Stated(*block, none, each, variance), None);
        }
        blocks
    }

    /// Values with these calibrations, raw to SI, in this order; the Earth's level rates behind them are zero.
    pub fn values(&self, triads: &[(Sensor, &Affine<f64>)]) -> Values {
        let levels = 0..self.chains.count;
        let blocks = triads.iter().map(|t| ParameterBlock::Triad(t.0));
        let numbers = triads.iter().map(|t| parameters(&t.1.matrix, &t.1.offset));
        let numbers = numbers.flat_map(<[f64; 12]>::from);
        let numbers: Vec<f64> = numbers
            .chain(levels.clone().flat_map(|_| [0.0; 2]))
            .collect();
        let blocks = blocks.chain(levels.map(ParameterBlock::LevelRate));
        Values::new(blocks.collect(), numbers.into())
    }

    /// Number of residuals so far.
    pub fn rows(&self) -> usize {
        self.list.iter().map(Factor::rows).sum()
    }

    /// The rows of each factor.
    pub fn ranges(&self) -> impl Iterator<Item = Range<usize>> {
        ranges(self.list.iter().map(Factor::rows))
    }

    /// The groups and their rows.
    pub fn groups(&self) -> impl Iterator<Item = (Option<Observable>, Range<usize>)> {
        let groups = self.list.chunk_by(|a, b| a.group == b.group);
        let rows = groups.clone().map(|g| g.iter().map(Factor::rows).sum());
        groups.map(|g| g[0].group).zip(ranges(rows))
    }

    /// Residuals, and derivatives by all `values`. A block that has no values is known without error.
    pub fn at(&self, values: &Values) -> Linearized {
        let at = State::of(self, values);
        let mut out = Linearized::zeros(self.rows(), values.all.len());
        for (factor, rows) in self.list.iter().zip(self.ranges()) {
            let (first, out) = (rows.start, &mut out);
            at.evaluate(self, factor, &mut Rows { first, values, out });
        }
        out
    }

    /// What a kind of factor over turns depends on; `None` of one in a dwell, where an error of all readings is one of o.
    pub fn by_increments(&self, kind: &Kind, gyro: &Affine<f64>) -> Option<ByIncrements> {
        match kind {
            Kind::Turn(t, _) => {
                let (_, by) = TurnError::with_increments(&self.turns[*t], gyro);
                let side = |k: usize| by.iter().map(|by| by[k]).collect();
                Some((*t..t + 1, vec![side(0), side(1)]))
            }
            Kind::Closure(closure, _) => {
                let own = closure.turns.clone();
                let by = ClosureError::by_increments(&self.turns[own.clone()], gyro);
                Some((own, vec![by.unwrap_or_default().concat()]))
            }
            Kind::Magnitude { .. }
            | Kind::Input { .. }
            | Kind::Stated(..)
            | Kind::Population(..) => None,
        }
    }

    /// Known variances of the residuals.
    pub fn variances(&self, values: &Values) -> Vec<f64> {
        let squared = PerSensor::from_fn(|sensor| {
            let c = values.triad(sensor).map(|triad| triad.matrix);
            c.map_or_else(Matrix3::zeros, |c| c.component_mul(&c))
        });
        let mean = squared.gyro.sum() / 3.0;
        let each = self.list.iter().flat_map(|factor| match &factor.kind {
            Kind::Magnitude { variance, .. } => vec![*variance],
            Kind::Input {
                sensor,
                noise,
                variance,
                ..
            } => (squared[*sensor] * noise + variance).as_slice().to_vec(),
            Kind::Turn(t, _) => vec![self.turns[*t].variance(mean); 2],
            Kind::Closure(closure, known) => {
                let noise = self.turns[closure.turns.clone()].iter();
                vec![known + mean * noise.map(|turn| turn.integral_variance).sum::<f64>()]
            }
            Kind::Stated(_, _, sums, variance) => vec![*variance; sums.nrows()],
            Kind::Population(_, prior) => vec![1.0; prior.rows()],
        });
        // Readings without noise have none; any positive number then weights all of them alike.
        each.map(|v| v.max(1e-20)).collect()
    }
}

/// Ranges of these lengths, one behind the other.
fn ranges(lengths: impl Iterator<Item = usize>) -> impl Iterator<Item = Range<usize>> {
    lengths.scan(0, |end, length| {
        *end += length;
        Some(*end - length..*end)
    })
}

/// Rows of a factor, to be filled.
struct Rows<'b> {
    first: usize,
    values: &'b Values,
    out: &'b mut Linearized,
}

impl Rows<'_> {
    fn residuals(&mut self, all: &[f64]) {
        for (k, residual) in all.iter().enumerate() {
            self.out.residuals[self.first + k] = *residual;
        }
    }

    /// Derivatives of all rows by a triad whose bias differs by this `step` from that of the last power-on; 0: by none.
    fn by_triad<R: Dim, S: RawStorage<f64, R, U12>>(
        &mut self,
        sensor: Sensor,
        step: usize,
        by: &Matrix<f64, R, U12, S>,
    ) {
        self.by(ParameterBlock::Triad(sensor), by);
        if step > 0 {
            let block = ParameterBlock::BiasStep(sensor, step);
            self.by(block, &by.fixed_columns::<3>(9));
        }
    }

    /// Derivatives of all rows by a block.
    fn by<R: Dim, C: Dim, S: RawStorage<f64, R, C>>(
        &mut self,
        block: ParameterBlock,
        by: &Matrix<f64, R, C, S>,
    ) {
        let columns = self.values.range(block).unwrap_or_default();
        for (k, column) in columns.enumerate() {
            for row in 0..by.nrows() {
                self.out.jacobian[(self.first + row, column)] = by[(row, k)];
            }
        }
    }
}

/// What factors share at some values.
struct State<'a> {
    /// The turns with their forces.
    turns: Vec<Turn<'a>>,
    turned: Vec<Turned>,
    errors: Vec<TurnError>,
    /// Level directions in the body frame of each dwell of a chain.
    level: BTreeMap<usize, [Vector3<f64>; 2]>,
}

impl<'a> State<'a> {
    fn of(factors: &Factors<'a>, values: &Values) -> Self {
        let gyro = values.triad(Sensor::Gyro).unwrap_or_else(Affine::identity);
        let accel = values.triad(Sensor::Accel);
        let turned = factors.rotations.at(&gyro);
        let turns = factors.turns.iter().map(|turn| match &accel {
            Some(accel) => turn.with(accel),
            None => *turn,
        });
        let turns: Vec<Turn> = turns.collect();
        let errors = turns.iter().zip(&turned);
        let errors: Vec<_> = errors.map(|(turn, by)| TurnError::of(turn, by)).collect();
        Self {
            level: (factors.chains).level(&turns, turned.iter().map(|by| by.rotation)),
            turns,
            turned,
            errors,
        }
    }

    fn evaluate(&self, factors: &Factors, factor: &Factor, rows: &mut Rows) {
        let model = |sensor| rows.values.triad(sensor).unwrap_or_else(Affine::identity);
        let step = factor
            .dwells
            .map_or(0, |of| factors.power_ons.number(of[0]));
        match &factor.kind {
            Kind::Magnitude {
                sensor,
                raw,
                known,
                given,
                ..
            } => {
                let found = Magnitude::at(&model(*sensor), raw, *known);
                rows.residuals(&[found.residual()]);
                rows.by_triad(*sensor, step, &found.block.by);
                if let Some(given) = given {
                    rows.by(
                        ParameterBlock::GivenMagnitude(*given),
                        &SMatrix::from([[-known]]),
                    );
                }
            }
            Kind::Input {
                sensor,
                raw,
                known,
                chain,
                ..
            } => {
                let found = vector::at(&model(*sensor), raw, known);
                rows.residuals(found.residual.as_slice());
                rows.by_triad(*sensor, step, &found.by);
                let level = factor.dwells.and_then(|of| self.level.get(&of[0]));
                if let Some((chain, level)) = chain.zip(level) {
                    rows.by(
                        ParameterBlock::LevelRate(chain),
                        &-Matrix3x2::from_columns(level),
                    );
                }
            }
            Kind::Turn(t, chain) => {
                let (turn, error) = (&self.turns[*t], &self.errors[*t]);
                rows.residuals(error.block.residual.as_slice());
                rows.by_triad(Sensor::Gyro, step, &error.block.by);
                rows.by_triad(Sensor::Accel, step, &stacked(&error.by_accel(&turn.raw)));
                if let Some((chain, level)) = chain.zip(self.level.get(&turn.to)) {
                    let by = error.by_level(level, turn.duration_s);
                    rows.by(ParameterBlock::LevelRate(chain), &by);
                }
            }
            Kind::Closure(closure, _) => {
                let turns = || closure.turns.clone();
                let (own, turned) = (&self.turns[turns()], &self.turned[turns()]);
                if let Some(error) = ClosureError::of(own, turned, factors.vertical) {
                    let raw = [own[0].raw[0], own[own.len() - 1].raw[1]];
                    rows.residuals(error.block.residual.as_slice());
                    rows.by_triad(Sensor::Gyro, step, &error.block.by);
                    rows.by_triad(Sensor::Accel, step, &stacked(&[error.by_accel(&raw)]));
                }
            }
            Kind::Stated(block, about, by, _) => {
                if let Some(own) = rows.values.range(*block) {
                    let moved = rows.values.all.rows_range(own) - about;
                    rows.residuals((by * moved).as_slice());
                    rows.by(*block, by);
                }
            }
            Kind::Population(sensor, prior) => {
                match prior.residuals(&model(*sensor)) {
                    Some((residuals, by)) => {
                        rows.residuals(residuals.as_slice());
                        rows.by(ParameterBlock::Triad(*sensor), &by);
                    }
                    // No unit: a step that leads here is taken back.
                    None => rows.residuals(&vec![f64::INFINITY; prior.rows()]),
                }
            }
        }
    }
}

/// Derivatives as rows.
fn stacked<const N: usize>(by: &[ByTriad; N]) -> SMatrix<f64, N, 12> {
    SMatrix::from_rows(&by.map(|by| by.transpose()))
}
