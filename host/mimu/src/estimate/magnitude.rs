//! Calibration of a triad from the magnitude of its input alone, over many orientations.
//!
//! At rest `|C u + o| = g` in every pose of an accelerometer (references 14 of fang and 19 of xu, among many). For a gyro in any orientation on a
//! turntable, `|C u + o|` is the rate, and `C u + o = 0` at rest. Magnitudes do not change if the whole triad is rotated, so the frame has to be
//! chosen: C is lower triangular with a positive diagonal. So the body frame has its x axis along the sensor x and its xy plane through the sensor y,
//! fang (13) with `Mp = 1`. The nine parameters need at least nine poses, or rests and six orientations. Magnitudes do not show the sign of an axis
//! either: it is taken from the raw readings.

use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector, Vector3};

use super::least_squares::{Grouped, Linearized, Observability, Reweighted, Scatter, minimize};
use super::{Estimated, Failure, Observation, lower_triangular};
use crate::observable::Observable;
use crate::observation::magnitude::Magnitude;
use crate::observation::turn::Rest;
use crate::observation::{LOWER, free, from_centre, place, vector};
use crate::prior::TriadPrior;
use crate::quantity::{AXES, Sensor, plural};
use crate::triad::{Forward, Part, Triad};
use crate::warning::Warning;

/// Number of parameters: six of C, three of o.
pub const PARAMETERS: usize = 9;

/// What is known of the input of a triad.
#[derive(Debug, Clone, Copy)]
pub struct KnownMagnitudes<'a> {
    /// The sensor with this input.
    pub sensor: Sensor,
    /// Magnitudes that occur, SI.
    pub levels: &'a [f64],
    /// Relative standard deviation of each level, an error that all its observations share; 0: exact.
    pub level_sigma: f64,
    /// Index of the level of each observation.
    pub level_of: &'a [usize],
    /// Dwells whose input vector is known, such as a gyro at rest.
    pub rests: &'a [Rest],
    /// What is known of the parameters beforehand.
    pub prior: Option<&'a TriadPrior>,
}

/// Readings in units in which a perfect sensor has C = 1 and o = 0 at the largest magnitude.
struct Sphere {
    centre: Vector3<f64>,
    radius: f64,
}

impl Sphere {
    /// Sphere through the readings by linear least squares; those at rest are at its centre. `shares` are the magnitudes over the largest.
    ///
    /// For unknown centre c and radius r, `|u|² = 2 c·u + r² m² - |c|²` is linear in c, r² and the constant. With one magnitude the last two merge.
    fn through(observations: &[Observation], shares: &[f64], rests: &[Rest]) -> Option<Self> {
        let readings = || {
            let spun = observations
                .iter()
                .map(|o| o.raw)
                .zip(shares.iter().copied());
            spun.chain(rests.iter().map(|r| (r.raw, 0.0)))
        };
        let count = readings().count();
        let mean = readings().map(|(u, _)| u).sum::<Vector3<f64>>() / count as f64;
        let unit = readings()
            .map(|(u, _)| (u - mean).norm())
            .fold(0.0, f64::max);
        let at: Vec<(Vector3<f64>, f64)> = readings()
            .map(|(u, share)| ((u - mean) / unit, share))
            .collect();
        let alike = at.windows(2).all(|w| w[0].1 == w[1].1);
        let columns = if alike { 4 } else { 5 };
        let a = DMatrix::from_fn(count, columns, |i, j| match j {
            0..3 => 2.0 * at[i].0[j],
            3 => 1.0,
            _ => at[i].1 * at[i].1,
        });
        let y = DVector::from_fn(count, |i, _| at[i].0.norm_squared());
        let x = a.svd(true, true).solve(&y, 1e-12).ok()?;
        let centre = Vector3::new(x[0], x[1], x[2]);
        let squared = match alike {
            true => x[3] + centre.norm_squared(),
            false => x[4],
        };
        let radius = squared.sqrt();
        (radius.is_finite() && radius > 0.0).then_some(Self {
            centre: mean + centre * unit,
            radius: radius * unit,
        })
    }
}

/// Readings whose extent across a plane is below this share of that along it lie in the plane.
const FLAT: f64 = 0.01;

/// The axes perpendicular to the readings, if these lie in a plane or on a line: some sensor has not seen the input.
fn flat(raw: &[Vector3<f64>]) -> Vec<usize> {
    let mean = raw.iter().sum::<Vector3<f64>>() / raw.len() as f64;
    let products = raw.iter().map(|u| (u - mean) * (u - mean).transpose());
    let eigen = products.sum::<Matrix3<f64>>().symmetric_eigen();
    let largest = eigen.eigenvalues.max();
    // All readings equal are flat too.
    let thin = (0..3).filter(|k| eigen.eigenvalues[*k] <= FLAT * FLAT * largest);
    // Share of each axis across the readings. If these lie on a line, the two directions themselves are arbitrary.
    let across = thin.fold(Vector3::zeros(), |sum: Vector3<f64>, k| {
        let direction = eigen.eigenvectors.column(k);
        sum + direction.component_mul(&direction)
    });
    let most = across.max();
    (0..3)
        .filter(|k| most > 0.0 && across[*k] > 0.5 * most)
        .collect()
}

/// Fewest poses beside a prior: they show the bias.
pub const FEWEST_WITH_PRIOR: usize = 3;
/// Standard deviation of a magnitude in the first solution beside a prior, over gravity: 5 mg.
const BY_HAND: f64 = 5e-3;

/// First guess, by the sphere through the readings: one scale factor for all axes. `None` if they do not lie on a sphere.
pub fn first_guess(observations: &[Observation], gravity: f64) -> Option<Affine<f64>> {
    let sphere = Sphere::through(observations, &vec![1.0; observations.len()], &[])?;
    let matrix = Matrix3::from_diagonal_element(gravity / sphere.radius);
    Some(Affine {
        matrix,
        offset: -(matrix * sphere.centre),
    })
}

/// Fits C and o of an accelerometer to `|C u + o| = gravity` (m/s²) over all observations, and to a `prior`; see [`estimate`].
pub fn by_gravity(
    observations: &[Observation],
    variances: &[f64],
    gravity: f64,
    prior: Option<&TriadPrior>,
) -> Result<Estimated, Failure> {
    let known = KnownMagnitudes {
        sensor: Sensor::Accel,
        levels: &[gravity],
        level_sigma: 0.0,
        level_of: &vec![0; observations.len()],
        rests: &[],
        prior,
    };
    estimate(observations, variances, &known)
}

/// Refuses experiments that cannot determine the nine parameters, whatever the noise.
fn refuse_too_little(observations: &[Observation], known: &KnownMagnitudes) -> Result<(), Failure> {
    let n = observations.len();
    if known.prior.is_some() && n >= FEWEST_WITH_PRIOR {
        return Ok(());
    }
    let rows = n + 3 * known.rests.len();
    // The rests determine o only.
    let needed = if known.rests.is_empty() {
        PARAMETERS
    } else {
        PARAMETERS - 3
    };
    if n < needed || rows < PARAMETERS {
        let (parameters, add) = match known.sensor {
            Sensor::Accel => (
                format!(
                    "{} of the {PARAMETERS} accelerometer parameters",
                    PARAMETERS - n
                ),
                format!(
                    "{} can be used; without a table at least {PARAMETERS} different poses are needed: add poses, each axis up, down and in between",
                    plural(n as u64, "still pose")
                ),
            ),
            Sensor::Gyro => (
                format!(
                    "{} of the {PARAMETERS} gyro parameters",
                    PARAMETERS.saturating_sub(rows).max(needed - n.min(needed))
                ),
                format!(
                    "{} at a known rate and {} can be used; at least {needed} orientations on the turntable are needed: add dwells with each axis up, down and in between",
                    plural(n as u64, "dwell"),
                    plural(known.rests.len() as u64, "rest")
                ),
            ),
        };
        return Err(Failure::Undetermined {
            parameters,
            add: add.into(),
        });
    }
    let spun = observations.iter().map(|o| o.raw);
    let raw: Vec<Vector3<f64>> = spun.chain(known.rests.iter().map(|r| r.raw)).collect();
    let axes: Vec<&str> = flat(&raw).into_iter().map(|k| AXES[k]).collect();
    if axes.is_empty() {
        return Ok(());
    }
    let names = axes.join(", ");
    let add = match known.sensor {
        Sensor::Accel => format!(
            "all poses are in one plane perpendicular to {names}: add poses with {names} up, down and slanted, and check that the column accel_{} contains this axis",
            axes[0]
        ),
        Sensor::Gyro => format!(
            "no dwell turns about {names}: lay the unit on the turntable with {names} up, down and slanted, and check that the column gyro_{} contains this axis",
            axes[0]
        ),
    };
    Err(Failure::Undetermined {
        parameters: format!("what the sensor {names} measures"),
        add: add.into(),
    })
}

/// The experiment in units of the largest magnitude, so that parameters and columns are of order one: readings on a sphere of radius one.
///
/// Rows are the magnitudes, then the rests by axes, then the errors of the levels, then the prior; parameters are the nine, then the errors of the levels.
struct Scaled<'a> {
    known: &'a KnownMagnitudes<'a>,
    sphere: Sphere,
    /// The largest magnitude, SI.
    unit: f64,
    /// Magnitude of each observation.
    shares: Vec<f64>,
    turned: Vec<Vector3<f64>>,
    resting: Vec<Vector3<f64>>,
    /// Number of levels that may err.
    levels: usize,
    /// Known variances of the rows.
    variances: Vec<f64>,
}

impl<'a> Scaled<'a> {
    /// `variances` are those of the magnitudes by noise, SI squared.
    fn of(
        observations: &[Observation],
        variances: &[f64],
        known: &'a KnownMagnitudes<'a>,
    ) -> Result<Self, Failure> {
        let unit = known.levels.iter().copied().fold(0.0, f64::max);
        let level_of = known.level_of.iter();
        let shares: Vec<f64> = level_of.map(|l| known.levels[*l] / unit).collect();
        let middle = known.prior.and_then(TriadPrior::middle);
        let sphere = match middle.as_ref().and_then(Forward::of) {
            // Few poses may be on many spheres.
            Some(forward) => Some(Sphere {
                centre: forward.bias,
                radius: unit * forward.matrix.norm() / 3f64.sqrt(),
            }),
            None => Sphere::through(observations, &shares, known.rests),
        };
        let sphere = sphere
            .ok_or_else(|| Failure::NoSolution("the dwell means do not lie on a sphere".into()))?;
        let scaled = |raw: &Vector3<f64>| (raw - sphere.centre) / sphere.radius;
        let mut scaled = Self {
            turned: observations.iter().map(|o| scaled(&o.raw)).collect(),
            resting: known.rests.iter().map(|r| scaled(&r.raw)).collect(),
            levels: match known.level_sigma > 0.0 {
                true => known.levels.len(),
                false => 0,
            },
            known,
            sphere,
            unit,
            shares,
            variances: Vec::new(),
        };
        scaled.variances = scaled.with_noise(variances);
        Ok(scaled)
    }

    /// Where the rows of the magnitudes, those of the rests, those of the levels, and all end.
    fn ends(&self) -> [usize; 4] {
        let turned = self.turned.len();
        let resting = turned + 3 * self.resting.len();
        let levels = resting + self.levels;
        [
            turned,
            resting,
            levels,
            levels + self.known.prior.map_or(0, TriadPrior::rows),
        ]
    }

    /// The unit matrix without bias, at the given levels.
    fn start(&self) -> DVector<f64> {
        let mut start = DVector::zeros(PARAMETERS + self.levels);
        for k in [0, 2, 5] {
            start[k] = 1.0;
        }
        start
    }

    /// Variances of the rows from those of the magnitudes by noise, SI squared. A noiseless recording has none; any positive number then weights all
    /// poses alike.
    fn with_noise(&self, by_noise: &[f64]) -> Vec<f64> {
        let to_si = self.unit / self.sphere.radius;
        let at_rest = self.known.rests.iter().flat_map(|r| {
            let noise = r.variance * (to_si * to_si) + r.rate_variance;
            <[f64; 3]>::from(noise)
        });
        let all: Vec<f64> = by_noise.iter().copied().chain(at_rest).collect();
        let floor = (1e-12 * all.iter().copied().fold(0.0, f64::max)).max(1e-24);
        let noise = all.iter().map(|v| (v / (self.unit * self.unit)).max(floor));
        let by_level = std::iter::repeat_n(self.known.level_sigma.powi(2), self.levels);
        let by_prior = self.known.prior.map_or(0, TriadPrior::rows);
        noise
            .chain(by_level)
            .chain(std::iter::repeat_n(1.0, by_prior))
            .collect()
    }

    /// Observability of the nine at known levels: the levels can worsen it only by their error.
    fn shape(&self, p: &DVector<f64>) -> Observability {
        let all = self.linearize(p).jacobian;
        Observability::of(&all.view((0, 0), (self.ends()[1], PARAMETERS)).into_owned())
    }

    /// The first solution: all rows weighted alike but the levels.
    fn solved(&self) -> Result<DVector<f64>, Failure> {
        let start = self.start();
        let [_, resting, levels, rows] = self.ends();
        let of_one = self.known.prior.map_or(1.0, |_| BY_HAND.recip());
        let mut alike = vec![of_one; resting];
        alike.resize(levels, self.known.level_sigma.recip());
        alike.resize(rows, 1.0);
        let alike = |p: &DVector<f64>| self.linearize(p).weighted(&alike);
        let shape = self.shape(&start);
        if !shape.is_complete() && self.known.prior.is_none() {
            return Err(undetermined(&shape, self.known.sensor));
        }
        let first = minimize(start.clone(), alike);
        // If the poses do not determine the angles between the sensors, the fit diverges towards C = 0 and |o| = g, which fits every pose.
        match first.filter(|(p, _)| is_triad(&lower_triangular(p).matrix)) {
            Some((p, _)) => Ok(p),
            None => Err(match weak_beside_scatter(&start, alike) {
                Some(shape) if self.known.prior.is_none() => {
                    undetermined(&shape, self.known.sensor)
                }
                Some(_) => self.lost(),
                None => self.lost(),
            }),
        }
    }

    /// Back: `x = m (C' (u - centre)/radius + o')`, with the derivatives of the twelve numbers by the nine parameters.
    fn to_si(&self, p: &DVector<f64>) -> (Affine<f64>, SMatrix<f64, 12, 9>) {
        let Affine {
            matrix: mut c,
            offset: mut o,
        } = lower_triangular(p);
        let scale = self.unit / self.sphere.radius;
        let mut change = SMatrix::<f64, 12, 9>::zeros();
        let about_zero = from_centre(&self.sphere.centre);
        for (k, parameter) in LOWER.into_iter().enumerate() {
            let per_unit = place(parameter).1.map_or(self.unit, |_| scale);
            change.set_column(k, &(about_zero.column(parameter) * per_unit));
        }
        // Magnitudes do not show the sign of a row, and flipping rows keeps them: the raw reading decides. The diagonal has to be positive; the start
        // (the unit matrix) makes a negative one all but impossible.
        let mut flips = SVector::<f64, 12>::repeat(1.0);
        for row in 0..3 {
            if c[(row, row)] < 0.0 {
                c.row_mut(row).neg_mut();
                o[row] = -o[row];
                for k in 0..3 {
                    flips[3 * row + k] = -1.0;
                }
                flips[9 + row] = -1.0;
            }
        }
        let matrix = c * scale;
        let inverse = Affine {
            matrix,
            offset: o * self.unit - matrix * self.sphere.centre,
        };
        (inverse, SMatrix::from_diagonal(&flips) * change)
    }

    /// A level that the others contradict.
    fn contradicted(&self, p: &DVector<f64>) -> Option<Warning> {
        let off = (0..self.levels).map(|l| p[PARAMETERS + l]);
        let worst = off
            .enumerate()
            .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        let (l, off) = worst.filter(|w| w.1.abs() > CONTRADICTED * self.known.level_sigma)?;
        Some(Warning::RatesContradict {
            rate: self.known.levels[l],
            off,
        })
    }
}

impl Grouped<2> for Scaled<'_> {
    const SHARE: f64 = 1e-6;

    fn linearize(&self, p: &DVector<f64>) -> Linearized {
        let [turned, resting, levels, rows] = self.ends();
        let model = lower_triangular(p);
        let mut out = Linearized::zeros(rows, PARAMETERS + self.levels);
        let nine = |jacobian: &mut DMatrix<f64>, row: usize, by: &SVector<f64, 12>| {
            jacobian
                .view_mut((row, 0), (1, PARAMETERS))
                .copy_from(&free(by, &LOWER).transpose());
        };
        for (i, u) in self.turned.iter().enumerate() {
            let level = self.known.level_of[i];
            let off = match self.levels {
                0 => 0.0,
                _ => p[PARAMETERS + level],
            };
            let found = Magnitude::at(&model, u, self.shares[i] * (1.0 + off));
            out.residuals[i] = found.residual();
            nine(&mut out.jacobian, i, &found.block.by(0));
            if self.levels > 0 {
                out.jacobian[(i, PARAMETERS + level)] = -self.shares[i];
            }
        }
        for (r, u) in self.resting.iter().enumerate() {
            let block = vector::at(&model, u, &(self.known.rests[r].rate / self.unit));
            for axis in 0..3 {
                let i = turned + 3 * r + axis;
                out.residuals[i] = block.residual[axis];
                nine(&mut out.jacobian, i, &block.by(axis));
            }
        }
        for l in 0..self.levels {
            out.residuals[resting + l] = p[PARAMETERS + l];
            out.jacobian[(resting + l, PARAMETERS + l)] = 1.0;
        }
        if let Some(prior) = self.known.prior {
            let (inverse, change) = self.to_si(p);
            match prior.residuals(&inverse) {
                Some((residuals, by)) => {
                    out.residuals
                        .rows_mut(levels, rows - levels)
                        .copy_from(&residuals);
                    let by = by * change;
                    out.jacobian
                        .view_mut((levels, 0), (rows - levels, PARAMETERS))
                        .copy_from(&by);
                }
                // No unit: a step that leads here is taken back.
                None => out
                    .residuals
                    .rows_mut(levels, rows - levels)
                    .fill(f64::INFINITY),
            }
        }
        out
    }

    fn variances(&self, _: &DVector<f64>) -> Vec<f64> {
        self.variances.clone()
    }

    fn lost(&self) -> Failure {
        let magnitude = match self.known.sensor {
            Sensor::Accel => "magnitude of gravity",
            Sensor::Gyro => "magnitude of the rate",
        };
        Failure::NoSolution(format!("the fit to the {magnitude} does not converge"))
    }
}

/// Fits C and o to `|C u + o| = m` over all observations and `C u + o = x` over the rests, and the levels m to within their error.
///
/// `variances` are those of the magnitudes by noise, SI squared, one for each observation. The errors of the levels are further parameters, each with
/// its standard deviation as an observation. The uncertainty of C that they cause cannot be averaged away, and is a separate part of the covariance.
pub fn estimate(
    observations: &[Observation],
    variances: &[f64],
    known: &KnownMagnitudes,
) -> Result<Estimated, Failure> {
    refuse_too_little(observations, known)?;
    let scaled = Scaled::of(observations, variances, known)?;
    let [turned, resting, levels, rows] = scaled.ends();
    let mut groups = Reweighted::new([0..turned, turned..resting], [0.0; 2]);
    let solved = groups.solve(&scaled, scaled.solved()?)?;
    let p = solved.found.parameters;
    // Under the last extra variances.
    let last = scaled
        .linearize(&p)
        .weighted(&groups.weights(&scaled.variances));
    let mut shape = scaled.shape(&p);
    if !shape.is_complete() && known.prior.is_none() {
        return Err(undetermined(&shape, known.sensor));
    }
    let covariance = last.covariance()?;
    if known.prior.is_some() {
        // Of data and prior together, in their parameters of order one.
        let eigen = covariance.symmetric_eigenvalues();
        shape.condition = (eigen.max() / eigen.min()).sqrt();
    }
    let (inverse, change) = scaled.to_si(&p);
    let mut scatter = groups.scatter;
    for (g, scatter) in scatter.iter_mut().enumerate() {
        scatter.extra_variance *= scaled.unit * scaled.unit;
        scatter.chi2 = solved.first_chi2[g];
    }
    let part = |rows: std::ops::Range<usize>| {
        let own = last.part(&covariance, &rows);
        let nine = SMatrix::<f64, 9, 9>::from_fn(|i, j| own[(i, j)]);
        Part::known(change * nine * change.transpose())
    };
    let scattered = |rows, scatter: &Scatter| Part {
        dof: scatter.variance_dof(),
        known: scatter.known,
        ..part(rows)
    };
    let mut parts = vec![scattered(0..turned, &scatter[0])];
    let mut found = vec![(Observable::Magnitude, scatter[0])];
    if !known.rests.is_empty() {
        parts.push(scattered(turned..resting, &scatter[1]));
        found.push((Observable::Rest, scatter[1]));
    }
    if scaled.levels > 0 {
        // The error of a turntable's rate is given; the dwells do not determine it.
        parts.push(part(resting..levels));
    }
    if known.prior.is_some() {
        parts.push(part(levels..rows));
    }
    let triad = Triad::from_inverse(inverse, parts)
        .ok_or_else(|| Failure::NoSolution("C is singular".into()))?;
    Ok(Estimated {
        triad,
        scatter: found,
        condition: shape.condition,
        delays: None,
        earth: Vec::new(),
        follows_accel: None,
        notes: scaled.contradicted(&p).into_iter().collect(),
    })
}

/// A level that moves by more sigmas than this contradicts the given one. With two levels each moves by half of their contradiction.
const CONTRADICTED: f64 = 2.5;

/// An off-diagonal element of C over the diagonal one from which on this is not a triad: 30 degrees from a right angle.
const SKEWED: f64 = 0.5;

/// Sigma, in units of gravity, from which on a parameter counts as not measured: 3 degrees, 5 %, 0.05 g. Assembly is better.
const USELESS_SIGMA: f64 = 0.05;

fn is_triad(c: &Matrix3<f64>) -> bool {
    let off_diagonal = [(1, 0), (2, 0), (2, 1)];
    let mut each = off_diagonal.into_iter();
    each.all(|(i, j)| c[(i, j)].abs() < SKEWED * c[(i, i)].abs())
}

/// The parameters that the poses determine, but not better than [`USELESS_SIGMA`] with their own scatter: six faces up to a degree or two. The
/// scatter is that of a fit of scale factors and biases alone, which six faces do determine.
fn weak_beside_scatter(
    start: &DVector<f64>,
    evaluate: impl Fn(&DVector<f64>) -> Linearized,
) -> Option<Observability> {
    let by_axis: Vec<usize> = (0..PARAMETERS)
        .filter(|k| matches!(place(LOWER[*k]), (i, j) if j.is_none_or(|j| i == j)))
        .collect();
    let full = |q: &DVector<f64>| {
        let mut p = start.clone();
        for (k, value) in by_axis.iter().zip(q.iter()) {
            p[*k] = *value;
        }
        p
    };
    let first = DVector::from_fn(by_axis.len(), |k, _| start[by_axis[k]]);
    let (q, at) = minimize(first, |q| {
        let all = evaluate(&full(q));
        Linearized {
            jacobian: all.jacobian.select_columns(&by_axis),
            residuals: all.residuals,
        }
    })?;
    let dof = at
        .residuals
        .len()
        .checked_sub(by_axis.len())
        .filter(|d| *d > 0)?;
    let variance = at.residuals.norm_squared() / dof as f64;
    let design = evaluate(&full(&q)).jacobian;
    let covariance = (design.transpose() * &design).try_inverse()? * variance;
    let undetermined: Vec<_> = (0..PARAMETERS)
        .map(|k| (k, covariance[(k, k)].sqrt()))
        .filter(|(_, sigma)| *sigma > USELESS_SIGMA)
        .collect();
    (!undetermined.is_empty()).then(|| Observability {
        undetermined,
        ..Observability::of(&design)
    })
}

fn undetermined(shape: &Observability, sensor: Sensor) -> Failure {
    let name = |k: usize| match place(LOWER[k]) {
        (i, Some(j)) => format!("C_{}{}", AXES[i], AXES[j]),
        (i, None) => format!("o_{}", AXES[i]),
    };
    let names: Vec<String> = shape.undetermined.iter().map(|(k, _)| name(*k)).collect();
    // Poses are missing along an axis whose scale factor or bias is undetermined.
    let weak: Vec<&str> = (0..3)
        .filter(|a| {
            let of_axis = |k: usize| matches!(place(LOWER[k]), (i, j) if i == *a && j.is_none_or(|j| j == *a));
            shape.undetermined.iter().any(|(k, _)| of_axis(*k))
        })
        .map(|a| AXES[a])
        .collect();
    let poses = match sensor {
        Sensor::Accel => "poses",
        Sensor::Gyro => "dwells on the turntable",
    };
    let add = if weak.is_empty() {
        format!("add {poses} between the axes (two or three axes off the vertical at once)")
    } else {
        format!("add {poses} with {} up, down and slanted", weak.join(", "))
    };
    Failure::Undetermined {
        parameters: names.join(", "),
        add: add.into(),
    }
}
