//! Calibration of a triad from the magnitude of its input alone, over many orientations.
//!
//! At rest `|C u + o| = g` in every pose of an accelerometer (references 14 of fang and 19 of xu, among many). For a gyro in any orientation on a
//! turntable, `|C u + o|` is the rate, and `C u + o = 0` at rest. Magnitudes do not change if the whole triad is rotated, so the frame has to be
//! chosen: C is lower triangular with a positive diagonal. So the body frame has its x axis along the sensor x and its xy plane through the sensor y,
//! fang (13) with `Mp = 1`. The nine parameters need at least nine poses, or rests and six orientations. Magnitudes do not show the sign of an axis
//! either: it is taken from the raw readings.

use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::factor_fit::{Coordinates, FactorFit};
use super::least_squares::{Observability, minimize};
use super::{Estimated, Failure, Observation};
use crate::factor::{Factors, Kind, Linearized, ParameterBlock};
use crate::observation::turn::Rest;
use crate::observation::{LOWER, place};
use crate::prior::TriadPrior;
use crate::quantity::{AXES, Sensor, plural};
use crate::signal::power_ons::PowerOns;
use crate::triad::{Covariance, Forward, Triad, affine, vector};
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
    /// Index of the level of each observation; empty if there is one level.
    pub level_of: &'a [usize],
    /// Dwells whose input vector is known, such as a gyro at rest.
    pub rests: &'a [Rest],
    /// What is known of the parameters beforehand.
    pub prior: Option<&'a TriadPrior>,
    /// The power-ons that the dwells are of.
    pub power_ons: &'a PowerOns,
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

impl Sphere {
    /// The triad with one scale factor for all axes that reads the `magnitude` on this sphere.
    fn model(&self, magnitude: f64) -> Affine<f64> {
        let matrix = Matrix3::from_diagonal_element(magnitude / self.radius);
        Affine {
            matrix,
            offset: -(matrix * self.centre),
        }
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
    Some(sphere.model(gravity))
}

/// The same for several magnitudes: one scale factor for all axes, by the spheres through the readings and the rests at their centre.
pub fn rough(observations: &[Observation], known: &KnownMagnitudes) -> Option<Affine<f64>> {
    let (unit, shares) = known.shares(observations.len());
    Some(Sphere::through(observations, &shares, known.rests)?.model(unit))
}

impl<'a> KnownMagnitudes<'a> {
    /// Of an accelerometer: `gravity`, m/s².
    fn gravity(gravity: &'a f64, prior: Option<&'a TriadPrior>, power_ons: &'a PowerOns) -> Self {
        Self {
            sensor: Sensor::Accel,
            levels: std::slice::from_ref(gravity),
            level_sigma: 0.0,
            level_of: &[],
            rests: &[],
            prior,
            power_ons,
        }
    }

    fn level(&self, observation: usize) -> usize {
        self.level_of.get(observation).copied().unwrap_or(0)
    }

    /// The largest level, and the magnitudes of so many observations over it.
    fn shares(&self, count: usize) -> (f64, Vec<f64>) {
        let unit = self.levels.iter().copied().fold(0.0, f64::max);
        let share = |k| self.levels[self.level(k)] / unit;
        (unit, (0..count).map(share).collect())
    }
}

/// Fits C and o of an accelerometer to `|C u + o| = gravity` (m/s²) over all observations, and to a `prior`; see [`estimate`].
pub fn by_gravity(
    observations: &[Observation],
    variances: &[f64],
    gravity: f64,
    prior: Option<&TriadPrior>,
    power_ons: &PowerOns,
) -> Result<Estimated, Failure> {
    let known = KnownMagnitudes::gravity(&gravity, prior, power_ons);
    estimate(observations, variances, &known)
}

/// By what the accelerometer's bias differs in the other power-ons, m/s²: as many as [`PowerOns::others`].
///
/// # Errors
/// As those of [`by_gravity`].
pub fn bias_steps(
    observations: &[Observation],
    variances: &[f64],
    gravity: f64,
    power_ons: &PowerOns,
) -> Result<Vec<Vector3<f64>>, Failure> {
    let known = KnownMagnitudes::gravity(&gravity, None, power_ons);
    refuse_too_little(observations, &known)?;
    let by = ByMagnitudes::of(observations, variances, &known)?;
    let solved = by.fit.solve(by.solved()?, &|_, _| 0.0, &|_| Ok(()))?;
    let steps = solved.bias_steps(known.sensor, power_ons);
    Ok(steps.into_iter().map(|[step, _]| step).collect())
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

/// A fit by magnitudes: rows of dwells and rests, then of the errors of the levels and of the prior.
struct ByMagnitudes<'a> {
    known: &'a KnownMagnitudes<'a>,
    fit: FactorFit<'a>,
    /// Number of the rows of dwells and rests, and of those and the errors of the levels.
    rows: [usize; 2],
    /// The largest magnitude, SI.
    unit: f64,
}

impl<'a> ByMagnitudes<'a> {
    /// `variances` are those of the magnitudes by noise, SI squared.
    fn of(
        observations: &[Observation],
        variances: &[f64],
        known: &'a KnownMagnitudes<'a>,
    ) -> Result<Self, Failure> {
        let (unit, shares) = known.shares(observations.len());
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
        let first = sphere.model(unit);
        let err = known.level_sigma > 0.0;
        // A reading at the end of the range has no noise, and would be believed against all others.
        let floor = 1e-12 * variances.iter().copied().fold(0.0, f64::max);
        let mut factors = Factors::default();
        for (k, (o, variance)) in observations.iter().zip(variances).enumerate() {
            let level = known.level(k);
            let magnitude = (known.levels[level], err.then_some(level));
            let variance = variance.max(floor);
            factors.magnitude(known.sensor, (o.dwell, o.raw), magnitude, variance);
        }
        factors.rests(known.rests);
        let of_dwells = factors.rows();
        let lower = Coordinates::triad(known.sensor, &first, &LOWER, &sphere.centre, unit);
        let mut coordinates = vec![lower];
        for level in (0..known.levels.len()).filter(|_| err) {
            let block = ParameterBlock::GivenMagnitude(level);
            let (zero, one) = (DVector::zeros(1), DMatrix::identity(1, 1));
            let stated = Kind::Stated(block, zero, one, known.level_sigma.powi(2));
            factors.known(stated, None);
            coordinates.push(Coordinates::around_zero(block));
        }
        let rows = [of_dwells, factors.rows()];
        let steps = factors.bias_steps(known.sensor, known.power_ons);
        coordinates.extend(steps.into_iter().map(Coordinates::around_zero));
        if let Some(prior) = known.prior {
            factors.known(Kind::Population(known.sensor, prior), None);
        }
        let magnitude = match known.sensor {
            Sensor::Accel => "magnitude of gravity",
            Sensor::Gyro => "magnitude of the rate",
        };
        let lost = format!("the fit to the {magnitude} does not converge");
        Ok(Self {
            known,
            fit: FactorFit::new(factors, coordinates, (1e-6, 1), lost),
            rows,
            unit,
        })
    }

    /// Observability of the nine at known levels: the levels can worsen it only by their error.
    fn shape(&self, p: &DVector<f64>) -> Observability {
        let all = self.fit.linearize(p).jacobian;
        Observability::of(&all.view((0, 0), (self.rows[0], PARAMETERS)).into_owned())
    }

    /// The first solution: all rows weighted alike but the levels.
    fn solved(&self) -> Result<DVector<f64>, Failure> {
        let start = self.fit.start();
        let of_one = self.known.prior.map_or(1.0, |_| BY_HAND.recip()) / self.unit;
        let alike = |p: &DVector<f64>| {
            let all = self.fit.linearize(p);
            let mut weights = vec![of_one; self.rows[0]];
            weights.resize(self.rows[1], self.known.level_sigma.recip());
            weights.resize(all.residuals.len(), 1.0);
            all.weighted(&weights)
        };
        let shape = self.shape(&start);
        if !shape.is_complete() && self.known.prior.is_none() {
            return Err(undetermined(&shape, self.known.sensor));
        }
        let first = minimize(start.clone(), alike);
        // If the poses do not determine the angles between the sensors, the fit diverges towards C = 0 and |o| = g, which fits every pose.
        let is_triad = |p: &DVector<f64>| {
            let triad = self.fit.values(p).triad(self.known.sensor);
            triad.is_some_and(|triad| is_triad(&triad.matrix))
        };
        match first.filter(|(p, _)| is_triad(p)) {
            Some((p, _)) => Ok(p),
            None => Err(match weak_beside_scatter(&start, alike) {
                Some(shape) if self.known.prior.is_none() => {
                    undetermined(&shape, self.known.sensor)
                }
                _ => self.fit.failure(),
            }),
        }
    }

    /// A level that the others contradict.
    fn contradicted(&self, p: &DVector<f64>) -> Option<Warning> {
        let levels = self.rows[1] - self.rows[0];
        let off = p.iter().skip(PARAMETERS).take(levels).enumerate();
        let worst = off.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        let (l, off) = worst.filter(|w| w.1.abs() > CONTRADICTED * self.known.level_sigma)?;
        Some(Warning::RatesContradict {
            rate: self.known.levels[l],
            off: *off,
        })
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
    let by = ByMagnitudes::of(observations, variances, known)?;
    let solved = by.fit.solve(by.solved()?, &|_, _| 0.0, &|_| Ok(()))?;
    let p = &solved.found.parameters;
    let shape = by.shape(p);
    if !shape.is_complete() && known.prior.is_none() {
        return Err(undetermined(&shape, known.sensor));
    }
    let condition = match known.prior {
        None => shape.condition,
        // Of data and prior together, in their parameters of order one.
        Some(_) => solved.condition(PARAMETERS),
    };
    let inverse = solved
        .values
        .triad(known.sensor)
        .ok_or_else(|| by.fit.failure())?;
    // Magnitudes do not show the sign of a row, and a flipped row keeps them: the raw reading decides, by a positive diagonal.
    let signs = Vector3::from_fn(|row, _| inverse.matrix[(row, row)].signum());
    let flips = vector(&Matrix3::from_fn(|row, _| signs[row]), &signs);
    let parts = solved.parts(known.sensor).into_iter();
    let parts = parts.map(|part| part.seen_by(&Covariance::from_diagonal(&flips)));
    let inverse = affine(&vector(&inverse.matrix, &inverse.offset).component_mul(&flips));
    let triad = Triad::from_inverse(inverse, parts.collect())
        .ok_or_else(|| Failure::NoSolution("C is singular".into()))?;
    Ok(Estimated {
        notes: by.contradicted(p).into_iter().collect(),
        ..Estimated::new(triad, solved.scatter(true).collect(), condition)
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
