//! Magnetometers: the Earth's field keeps its size and its direction in space while the body turns.
//!
//! For the calibrated field `x = C u + o` in the frame of the body, soft iron in C and hard iron in o, three things hold. Its size is one constant. After a
//! turn by R, as the gyro integrates it, it is `Rᵀ x`: this gives the rotation of the magnetometer on the body, and its delay. At rest its angle to
//! gravity is one constant, the dip. An ellipsoid alone, the usual calibration, is the first of these: it leaves a rotation open, and a field that differs by place bends it
//! unnoticed, where the turns contradict it.

use std::ops::Range;

use mimu::triad::{Estimate, affine};
use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, SMatrix, SVector, Vector3};

use crate::carrier::Rest;
use crate::clustered::Clusters;
use crate::errors::Errors;
use crate::fitted::Known;
use crate::iron::{Iron, Warmth, is_there};
use crate::pieces::{Groups, Pieces, joined};
use crate::relation::{DELAY, Equations, Relation};
use crate::series::{Motion, Series};
use crate::standing::Standing;

/// Time between two readings that are compared, s: long enough to turn far, and short enough that a gyro's bias of 0.1 deg/s is a tenth of a degree.
pub(crate) const TURN_S: f64 = 1.0;
/// Least time between readings that are used, s; more of them see the same.
const APART_S: f64 = 0.04;
/// A smaller turn tells nothing, rad.
const LEAST_TURN: f64 = 0.05;
/// What is known of a delay beforehand, standard deviation, s.
const DELAY_S: f64 = 0.1;
/// Step of the derivative by the delay, s.
const DELAY_STEP_S: f64 = 1e-3;
/// A rest whose size or dip of the field is off by this many times the scatter of all rests is left out.
pub(crate) const CONTRADICTED: f64 = 6.0;
/// Fewest rests that show a scatter.
pub(crate) const FEWEST_RESTS: usize = 6;
/// How often rests that the others contradict are looked for.
const ROUNDS: usize = 3;

/// The parameters behind the delay: sine of the dip, what remains of the gyro's bias (rad/s), and where it is tried how iron moves with the temperature.
const DIP: usize = 13;
const BIAS: usize = 14;
const COUNT: usize = 17;
const IRON: Range<usize> = COUNT..COUNT + 3;
/// Groups of residuals.
const TURNS: usize = 0;
const SIZES: usize = 1;
const DIPS: usize = 2;

/// A calibrated magnetometer.
pub(crate) struct Field {
    /// Its relation to the gyro.
    pub relation: Relation,
    /// Number of rests that show the dip.
    pub rests: usize,
    /// Rms error of its size, in its unit: what differs by place changes little during a turn, and shows here.
    pub size_rms: f64,
    /// What was left out.
    pub left_out: LeftOut,
    /// By how much the field differs between the calibrations of the two halves of the recording, rms, rad.
    pub halves_rad: f64,
    /// Worst standard deviation of the field's direction, over all poses, rad.
    pub worst_rad: f64,
    /// Errors at all rests: of its size, and of its part along up.
    pub at_rest: [Vec<f64>; 2],
    /// The temperature for which the offset is, °C, if iron that moves with it was tried.
    temp_c: Option<f64>,
}

/// Time in which the rest contradicts the field.
#[derive(Debug, Clone, Default)]
pub(crate) struct LeftOut {
    /// Pieces of time and rests, s.
    pub spans: Vec<[f64; 2]>,
    /// Their share of the time.
    pub share: f64,
    /// Rms error of the size of the field there, as a share of it, and of its direction after a turn or at a rest, rad.
    pub size: f64,
    pub angle_rad: f64,
}

struct Problem<'a> {
    motion: &'a Motion,
    raw: Series,
    /// Samples that are used.
    used: Vec<usize>,
    /// Pairs of samples that a turn lies between.
    pairs: Vec<[usize; 2]>,
    /// Mean readings at rests.
    rests: Vec<(Reading, Rest)>,
    pieces: Pieces,
    size: f64,
    /// Standard deviation of what remains of the gyro's bias, rad/s.
    bias: f64,
    /// Variance of a raw reading by white noise.
    noise: f64,
    /// How much warmer than [`Field::temp_c`] each sample is, K; `None` where iron does not move.
    warmer: Option<Vec<f64>>,
}

/// A raw reading, and how much warmer than [`Field::temp_c`] it was, K.
struct Reading {
    u: Vector3<f64>,
    warmer: f64,
}

/// What a magnetometer's readings are made of.
struct Model {
    calibration: Affine<f64>,
    /// By how much the field of iron grows per kelvin.
    iron: Vector3<f64>,
}

impl Model {
    fn of(at: &DVector<f64>) -> Self {
        let mut iron = Vector3::zeros();
        if at.len() > COUNT {
            iron = at.fixed_rows::<3>(IRON.start).into_owned();
        }
        Self {
            calibration: affine(&at.fixed_rows::<12>(0).into_owned()),
            iron,
        }
    }

    /// The field of a reading.
    fn apply(&self, of: &Reading) -> Vector3<f64> {
        self.calibration.apply(&of.u) - self.iron * of.warmer
    }
}

impl Reading {
    /// Derivatives of the field of this reading along `to` by so many parameters.
    fn along(&self, to: &Vector3<f64>, count: usize) -> DVector<f64> {
        let mut by = DVector::zeros(count);
        by.fixed_rows_mut::<12>(0)
            .copy_from(&(by_calibration(&self.u).transpose() * to));
        if count > COUNT {
            by.fixed_rows_mut::<3>(IRON.start)
                .copy_from(&(to * -self.warmer));
        }
        by
    }
}

/// A temperature, and the one for which the offset is, °C.
type Warm<'a> = Option<(&'a Warmth, f64)>;

impl Field {
    /// Of raw readings. `size`: that of the field, in the unit of the result; `bias`: standard deviation of what remains of the gyro's, rad/s; with `warm`, iron moves with the
    /// temperature. `None` if too little of it turns.
    pub fn of(
        raw: &Series,
        motion: &Motion,
        rests: &[Rest],
        (size, bias): (f64, f64),
        warm: Warm,
    ) -> Option<Self> {
        let mut left: Vec<[f64; 2]> = Vec::new();
        for round in 0.. {
            let problem = Problem::new(raw.without(&left), motion, rests, (size, bias), warm)?;
            let relation = Relation::of(&problem, problem.start()?)?;
            let more = problem.contradicted(&relation);
            if more.is_empty() || round == ROUNDS {
                let all = Problem::new(raw.clone(), motion, rests, (size, bias), warm)?;
                let left_out = all.left_out(&relation, left);
                let field = problem.field(relation, left_out)?;
                let temp_c = warm.map(|(_, temp_c)| temp_c);
                return (warm.is_none() || problem.iron_is_there(&field))
                    .then_some(Self { temp_c, ..field });
            }
            left.extend(more.iter().map(Rest::span));
        }
        None
    }

    /// Sine of the angle of the field below the level.
    pub fn sine_of_dip(&self) -> f64 {
        self.relation.at[DIP]
    }

    /// Angle of the field below the level, degrees.
    pub fn dip_deg(&self) -> Known<Estimate> {
        if self.rests == 0 {
            return Err("no rest shows where up is".into());
        }
        let sine = self.sine_of_dip().clamp(-0.999_999, 0.999_999);
        let by_sine = (1.0 - sine * sine).sqrt().recip().to_degrees();
        Ok(Estimate {
            value: sine.asin().to_degrees(),
            ..self.relation.estimate(DIP, by_sine)
        })
    }

    /// How its iron moves with the temperature, if it does; `rotation` leads from its own frame to that of the gyro.
    pub fn iron(&self, rotation: &Rotation3<f64>) -> Option<Iron> {
        let found = (&self.relation.at, &self.relation.solution, IRON.start);
        Some(Iron::of(found, rotation, self.temp_c?))
    }

    /// Errors of a magnetometer that stands so; the rms error of the size of the field, and that size: `size`, or else the mean that it reads. `None` if nothing
    /// turns.
    pub fn errors(
        raw: Series,
        motion: &Motion,
        standing: &Standing,
        size: Option<f64>,
        warmth: Option<&Warmth>,
    ) -> Option<(Errors, [f64; 2])> {
        let raw = raw.without_repeats();
        let warm = warmth.zip(standing.iron.map(|(_, temp_c)| temp_c));
        let sizes = standing.compensated(raw.clone(), warmth).x.into_iter();
        let size = size.unwrap_or(sizes.map(|x| x.norm()).sum::<f64>() / raw.len() as f64);
        let problem = Problem::new(raw, motion, &[], (size, 1e-9), warm)?;
        let all = vec![true; problem.pieces.count];
        let mut at = standing.parameters(problem.count());
        if let Some((per_k, _)) = standing.iron.filter(|_| warm.is_some()) {
            at.fixed_rows_mut::<3>(IRON.start).copy_from(&per_k);
        }
        let errors = problem.errors(&at, &all)?;
        let size_rms = problem.size_rms(&at, |_| true);
        Some((errors, [size_rms, size]))
    }
}

/// Scatter of errors of which some may be large: the median of the sizes of errors with a normal distribution is 0.67 of its standard deviation.
pub(crate) fn scatter(errors: impl Iterator<Item = f64>) -> f64 {
    let sizes = errors.map(f64::abs).collect();
    mimu_recording::units::median(sizes).unwrap_or(f64::NAN) / 0.6745
}

/// Derivatives of `C u + o` by C (rows) and o.
pub(crate) fn by_calibration(u: &Vector3<f64>) -> SMatrix<f64, 3, 12> {
    let mut by = SMatrix::zeros();
    for axis in 0..3 {
        for k in 0..3 {
            by[(axis, 3 * axis + k)] = u[k];
        }
        by[(axis, 9 + axis)] = 1.0;
    }
    by
}

impl<'a> Problem<'a> {
    fn new(
        raw: Series,
        motion: &'a Motion,
        rests: &[Rest],
        (size, bias): (f64, f64),
        warm: Warm,
    ) -> Option<Self> {
        let pieces = Pieces::over(&raw.t)?;
        let mut used: Vec<usize> = Vec::new();
        for (k, t) in raw.t.iter().enumerate() {
            if used.last().is_none_or(|last| t - raw.t[*last] >= APART_S) {
                used.push(k);
            }
        }
        let mut pairs = Vec::new();
        for (n, &from) in used.iter().enumerate() {
            let later = used[n..].partition_point(|k| raw.t[*k] - raw.t[from] < TURN_S);
            let Some(&to) = used.get(n + later) else {
                break;
            };
            let near = raw.t[to] - raw.t[from] < 1.5 * TURN_S;
            let turn = motion.turn(raw.t[from], raw.t[to]);
            if near && turn.is_some_and(|turn| turn.angle() > LEAST_TURN) {
                pairs.push([from, to]);
            }
        }
        let mean = |rest: &Rest| {
            let own = raw.x.get(raw.within(rest.span()))?;
            let own = Some(own).filter(|own| !own.is_empty())?;
            let u = own.iter().sum::<Vector3<f64>>() / own.len() as f64;
            let warmer = warm.map_or(0.0, |(of, temp_c)| of.at(rest.middle()) - temp_c);
            Some((Reading { u, warmer }, *rest))
        };
        let warmer =
            |(of, temp_c): (&Warmth, f64)| raw.t.iter().map(|t| of.at(*t) - temp_c).collect();
        Some(Self {
            rests: rests.iter().filter_map(mean).collect(),
            noise: raw.noise(),
            warmer: warm.map(warmer),
            bias,
            motion,
            used,
            pairs,
            pieces,
            size,
            raw,
        })
    }

    /// Number of parameters.
    fn count(&self) -> usize {
        self.warmer.as_ref().map_or(COUNT, |_| IRON.end)
    }

    fn reading(&self, k: usize) -> Reading {
        Reading {
            u: self.raw.x[k],
            warmer: self.warmer.as_ref().map_or(0.0, |all| all[k]),
        }
    }

    fn iron_is_there(&self, field: &Field) -> bool {
        let Relation {
            at, solution, used, ..
        } = &field.relation;
        let clusters = self.clusters(at, &mut field.relation.groups.clone(), used);
        is_there(&clusters, (at, solution, IRON), used).unwrap_or(false)
    }

    /// C and o by the turns alone, which are linear in them but for a common factor; sizes give it. The axes are taken to be right-handed: turns and sizes
    /// hold for the opposite field too.
    fn start(&self) -> Option<DVector<f64>> {
        let count = self.used.len() as f64;
        let mean = self
            .used
            .iter()
            .map(|k| self.raw.x[*k])
            .sum::<Vector3<f64>>()
            / count;
        let squares = self
            .used
            .iter()
            .map(|k| (self.raw.x[*k] - mean).norm_squared());
        let scale = (squares.sum::<f64>() / count / 3.0).sqrt();
        if !(scale > 0.0) || self.pairs.len() < COUNT {
            return None;
        }
        let u = |k: usize| (self.raw.x[k] - mean) / scale;
        let mut normal = SMatrix::<f64, 12, 12>::zeros();
        for [from, to] in &self.pairs {
            let turn = self.motion.turn(self.raw.t[*from], self.raw.t[*to])?;
            let by = by_calibration(&u(*to))
                - turn.to_rotation_matrix().matrix() * by_calibration(&u(*from));
            normal += by.transpose() * by;
        }
        let eigen = normal.symmetric_eigen();
        let least = eigen.eigenvalues.imin();
        let found = affine(&eigen.eigenvectors.column(least).into_owned());
        let sizes = self.used.iter().map(|k| found.apply(&u(*k)).norm());
        let factor = self.size / (sizes.sum::<f64>() / count) * found.matrix.determinant().signum();
        let matrix = found.matrix * factor / scale;
        let offset = found.offset * factor - matrix * mean;
        let mut at = DVector::zeros(self.count());
        for k in 0..9 {
            at[k] = matrix[(k / 3, k % 3)];
        }
        at.fixed_rows_mut::<3>(9).copy_from(&offset);
        let calibration = Affine { matrix, offset };
        let sines = self
            .rests
            .iter()
            .map(|(of, rest)| -rest.up.dot(&calibration.apply(&of.u)) / self.size);
        at[DIP] = sines.sum::<f64>() / self.rests.len().max(1) as f64;
        at.iter().all(|x| x.is_finite()).then_some(at)
    }

    /// Residual after a turn, and its derivatives, an axis each.
    fn turn(
        &self,
        [from, to]: [usize; 2],
        at: &DVector<f64>,
    ) -> Option<(Vector3<f64>, DMatrix<f64>)> {
        let model = Model::of(at);
        let between = |delay: f64| {
            let turn = self
                .motion
                .turn(self.raw.t[from] - delay, self.raw.t[to] - delay)?;
            Some(*turn.to_rotation_matrix().matrix())
        };
        let [t0, t1] = [from, to].map(|k| self.raw.t[k] - at[DELAY]);
        let whole = self.motion.turn(t0, t1)?;
        let turn: Matrix3<f64> = *whole.to_rotation_matrix().matrix();
        let later = between(at[DELAY] + DELAY_STEP_S)? - between(at[DELAY] - DELAY_STEP_S)?;
        let [of0, of1] = [from, to].map(|k| self.reading(k));
        let [x0, x1] = [&of0, &of1].map(|of| model.apply(of));
        let mut by = DMatrix::zeros(3, at.len());
        let by_own = by_calibration(&of1.u) - turn * by_calibration(&of0.u);
        by.fixed_view_mut::<3, 12>(0, 0).copy_from(&by_own);
        if at.len() > COUNT {
            let by_iron = turn * of0.warmer - Matrix3::identity() * of1.warmer;
            by.fixed_view_mut::<3, 3>(0, IRON.start).copy_from(&by_iron);
        }
        by.column_mut(DELAY)
            .copy_from(&(-(later * x0) / (2.0 * DELAY_STEP_S)));
        // A rate that reads more has turned the field back too far: by the bias, as seen from the middle of the turn.
        let seen = turn * x0;
        let middle: Matrix3<f64> = *whole.powf(0.5).to_rotation_matrix().matrix();
        let by_bias = (t1 - t0) * seen.cross_matrix() * middle;
        by.fixed_view_mut::<3, 3>(0, BIAS).copy_from(&by_bias);
        let bias = at.fixed_rows::<3>(BIAS).into_owned();
        Some((seen - by_bias * bias - x1, by))
    }

    /// Rms error of the size of the field in the samples for which `of` holds.
    fn size_rms(&self, at: &DVector<f64>, of: impl Fn(usize) -> bool) -> f64 {
        let model = Model::of(at);
        let own = self.used.iter().filter(|k| of(**k));
        let errors = own.map(|k| model.apply(&self.reading(*k)).norm() - self.size);
        mimu_recording::statistics::root_mean_square(errors)
    }

    /// Rests whose size or dip of the field the others contradict, of those in pieces of time that are used.
    fn contradicted(&self, relation: &Relation) -> Vec<Rest> {
        let own = self.rests.iter();
        let own: Vec<_> = own
            .filter(|(_, rest)| relation.used[self.pieces.of(rest.middle())])
            .collect();
        if own.len() < FEWEST_RESTS {
            return Vec::new();
        }
        let is_off = self.errors_at(&own, relation).map(|errors: Vec<f64>| {
            let sigma = scatter(errors.iter().copied());
            errors
                .into_iter()
                .map(|e| e.abs() > CONTRADICTED * sigma)
                .collect::<Vec<_>>()
        });
        let off = own
            .iter()
            .enumerate()
            .filter(|(k, _)| is_off[0][*k] || is_off[1][*k]);
        off.map(|(_, (_, rest))| *rest).collect()
    }

    /// Errors at these rests: of the size of the field, and of its part along up.
    fn errors_at(&self, rests: &[&(Reading, Rest)], relation: &Relation) -> [Vec<f64>; 2] {
        let model = Model::of(&relation.at);
        let size = |of: &Reading| model.apply(of).norm() - self.size;
        let dip = |of, rest| self.dip(&model, of, rest, relation.at[DIP]);
        [
            rests.iter().map(|(of, _)| size(of)).collect(),
            rests.iter().map(|(of, rest)| dip(of, rest)).collect(),
        ]
    }

    /// By how much the field along up differs from that of its dip.
    fn dip(&self, model: &Model, of: &Reading, rest: &Rest, sine: f64) -> f64 {
        -self.size * sine - rest.up.dot(&model.apply(of))
    }

    /// What `relation` leaves out of these readings, besides `rests`.
    fn left_out(&self, relation: &Relation, rests: Vec<[f64; 2]>) -> LeftOut {
        let spans = joined([relation.left_out.clone(), rests].concat());
        let is_out = |k: usize| spans.iter().any(|[a, b]| (*a..*b).contains(&self.raw.t[k]));
        let model = Model::of(&relation.at);
        let turns = self
            .pairs
            .iter()
            .filter(|pair| pair.iter().any(|k| is_out(*k)));
        let turns = turns.filter_map(|pair| Some(self.turn(*pair, &relation.at)?.0.norm()));
        let at_rest = self.rests.iter();
        let at_rest = at_rest
            .filter(|(_, rest)| spans.iter().any(|[a, b]| (*a..*b).contains(&rest.middle())));
        let dips = at_rest.map(|(of, rest)| self.dip(&model, of, rest, relation.at[DIP]));
        let [turns, dips] = [turns.collect::<Vec<_>>(), dips.collect()]
            .map(mimu_recording::statistics::root_mean_square);
        let total = self
            .raw
            .t
            .last()
            .zip(self.raw.t.first())
            .map_or(f64::NAN, |(b, a)| b - a);
        LeftOut {
            share: spans.iter().map(|[a, b]| b - a).sum::<f64>() / total,
            size: self.size_rms(&relation.at, is_out) / self.size,
            // NaN, without a turn or a rest, is the lesser.
            angle_rad: turns.max(dips) / self.size,
            spans,
        }
    }

    fn field(&self, relation: Relation, left_out: LeftOut) -> Option<Field> {
        let calibration = relation.calibration();
        let used = &relation.used;
        let clusters = self.clusters(&relation.at, &mut relation.groups.clone(), used);
        let half = self.pieces.count / 2;
        let halves = [true, false].map(|first| clusters.moved(|g| used[g] && (g < half) == first));
        let halves_rad = match halves {
            [Some(a), Some(b)] => {
                let apart = Model::of(&(a - b));
                let each = self.used.iter();
                let each = each.map(|k| apart.apply(&self.reading(*k)).norm_squared());
                (each.sum::<f64>() / self.used.len() as f64).sqrt() / self.size
            }
            _ => f64::INFINITY,
        };
        let is_used = |k: usize| used[self.pieces.of(self.raw.t[k])];
        Some(Field {
            worst_rad: self.worst(&calibration, &relation.solution.covariance)?,
            rests: self.rests.len(),
            at_rest: self.errors_at(&self.rests.iter().collect::<Vec<_>>(), &relation),
            size_rms: self.size_rms(&relation.at, is_used),
            temp_c: None,
            left_out,
            halves_rad,
            relation,
        })
    }

    /// Worst standard deviation of the field's direction, over fields along the axes and the corners of the body, rad.
    fn worst(&self, calibration: &Affine<f64>, covariance: &DMatrix<f64>) -> Option<f64> {
        let forward = calibration.matrix.try_inverse()?;
        let own = covariance.fixed_view::<12, 12>(0, 0);
        let mut worst = 0.0;
        for code in 0..27 {
            let to = Vector3::new(code % 3, code / 3 % 3, code / 9).map(|c| f64::from(c) - 1.0);
            let Some(to) = to.try_normalize(0.5) else {
                continue;
            };
            let by = by_calibration(&(forward * (to * self.size - calibration.offset)));
            let across = Matrix3::identity() - to * to.transpose();
            let error = across * by * own * by.transpose() * across;
            worst = f64::max(worst, error.trace());
        }
        Some(worst.sqrt() / self.size)
    }
}

impl Equations for Problem<'_> {
    fn known(&self) -> DVector<f64> {
        let mut known = DVector::repeat(self.count(), f64::INFINITY);
        known[DELAY] = DELAY_S;
        known[DIP] = 1.0;
        known.fixed_rows_mut::<3>(BIAS).fill(self.bias);
        known
    }

    fn pieces(&self) -> &Pieces {
        &self.pieces
    }

    /// Residuals of turns, sizes and dips. Readings stand on both sides of a turn, and their noise makes C smaller than it is, by the square
    /// of noise over field; what it adds to the gradient is known and taken out again.
    fn add_to(
        &self,
        clusters: &mut Clusters,
        at: &DVector<f64>,
        groups: &mut Groups,
        used: &[bool],
    ) {
        let model = Model::of(at);
        let matrix = model.calibration.matrix;
        for pair in &self.pairs {
            let Some((residual, by)) = self.turn(*pair, at) else {
                continue;
            };
            let piece = self.pieces.of(self.raw.t[pair[0]]);
            if used[piece] {
                groups.count(TURNS, residual.norm_squared(), 3.0);
            }
            let weight = groups.weight(TURNS);
            for axis in 0..3 {
                clusters.add(piece, residual[axis], &by.row(axis).transpose(), weight);
            }
            clusters.correct(
                piece,
                &of_matrix(&(2.0 * weight * self.noise * matrix), at.len()),
            );
        }
        let shift = self.noise * matrix.norm_squared() / 3.0 / self.size;
        for &k in &self.used {
            let reading = self.reading(k);
            let x = model.apply(&reading);
            let along = x.normalize();
            let by = reading.along(&along, at.len());
            let residual = self.size + shift - x.norm();
            let piece = self.pieces.of(self.raw.t[k]);
            if used[piece] {
                groups.count(SIZES, residual * residual, 1.0);
            }
            let weight = groups.weight(SIZES);
            clusters.add(piece, residual, &by, weight);
            let own = weight * self.noise * along * along.transpose() * matrix;
            clusters.correct(piece, &of_matrix(&own, at.len()));
        }
        for (of, rest) in &self.rests {
            let mut by = of.along(&rest.up, at.len());
            by[DIP] = self.size;
            let residual = self.dip(&model, of, rest, at[DIP]);
            let piece = self.pieces.of(rest.middle());
            if used[piece] {
                groups.count(DIPS, residual * residual, 1.0);
            }
            clusters.add(piece, residual, &by, groups.weight(DIPS));
        }
    }

    fn errors(&self, at: &DVector<f64>, used: &[bool]) -> Option<Errors> {
        let calibration = affine(&at.fixed_rows::<12>(0).into_owned());
        let per_axis = self.noise * calibration.matrix.norm_squared() / 3.0;
        let own = |pair: &&[usize; 2]| used[self.pieces.of(self.raw.t[pair[0]])];
        let squares = self.pairs.iter().filter(own);
        let squares = squares.filter_map(|p| Some(self.turn(*p, at)?.0.norm_squared() / 3.0));
        let squares: Vec<f64> = squares.collect();
        Errors::of(&squares, 2.0 * per_axis)
    }
}

/// A matrix in the place of C among so many parameters.
fn of_matrix(matrix: &Matrix3<f64>, count: usize) -> DVector<f64> {
    let mut all = DVector::zeros(count);
    let rows: SVector<f64, 9> = SVector::from_fn(|k, _| matrix[(k / 3, k % 3)]);
    all.fixed_rows_mut::<9>(0).copy_from(&rows);
    all
}
