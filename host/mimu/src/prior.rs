//! What the population of a unit's kind says of the unit before it is measured: a Gaussian prior of its physical parameters, `mimu-prior/1`.
//!
//! The prior is a group of rows of a fit like any other: in units of its standard deviations, the parameters minus their means. Few poses then determine what they can, and
//! the population the rest. Whether the unit is of the population is judged by how far the data have moved it: for a prior covariance T and a posterior one C the
//! movement has the covariance T - C (the data alone may leave parameters open), and its square over that a chi-square distribution; Hotelling's, because T is estimated from some
//! number of units.

use std::path::Path;

use mimu_core::compensation::Affine;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, SVector, SymmetricEigen};
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use crate::parameter::TriadParameter;
use crate::quantity::{PerSensor, Sensor, raw_unit, scale_unit};
use crate::triad::{Triad, physical_of};
use mimu_recording::{Error, RawUnit, Reference, Result, check_kind, parse_toml, read_text};

/// Version of the file.
const FORMAT: &str = "mimu-prior/1";
const HEADER: &str = "\
# The population of a kind of units, as a prior for the calibration of one: `mimu fit LOG --prior FILE`.
# mean and covariance are of the physical parameters in this order, in these units; the covariance is that of a further unit, the error of the mean included.
# biases = false leaves the biases out, if they change more with time or temperature than between units.
";

/// A unit is not of the population if its data move the prior so far in fewer than this share of the population's units.
pub const FALSE_STRANGER: f64 = 1e-3;

/// A prior as a file holds it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Prior {
    /// `mimu-prior/1`.
    pub format: String,
    /// Program and version that made it.
    pub tool: String,
    /// Unit of the readings.
    pub raw_unit: RawUnit,
    /// What was known of the input: it defines the frame.
    pub reference: Reference,
    /// Whether the biases are used.
    pub biases: bool,
    /// Gyro.
    pub gyro: Option<PriorTable>,
    /// Accelerometer.
    pub accel: Option<PriorTable>,
}

/// The prior of a triad as a file holds it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PriorTable {
    /// Units that it was made from.
    pub units: usize,
    /// Names of the parameters: `scale_x`.
    pub parameters: Vec<String>,
    /// Their units.
    pub parameter_units: Vec<String>,
    /// Means.
    pub mean: Vec<f64>,
    /// Standard deviations.
    pub sigma: Vec<f64>,
    /// Covariance, by rows.
    pub covariance: Vec<Vec<f64>>,
}

/// The prior of a triad, as a fit uses it.
#[derive(Debug, Clone)]
pub struct TriadPrior {
    /// All twelve means; those of parameters without a prior are zero.
    mean: SVector<f64, 12>,
    /// Numbers of the parameters with a prior.
    of: Vec<usize>,
    /// Units that it was made from.
    units: f64,
    covariance: DMatrix<f64>,
    factor: Cholesky<f64, Dyn>,
}

/// How far the data have moved a unit from the middle of its population.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Movement {
    /// Probability of a larger movement of a unit of the population.
    pub p: f64,
    /// The parameter that has moved most.
    pub most: TriadParameter,
    /// By how many standard deviations of the population.
    pub sigmas: f64,
}

impl Prior {
    /// A prior of these tables, made by `tool`.
    pub fn new(
        tool: String,
        raw_unit: RawUnit,
        reference: Reference,
        tables: PerSensor<Option<PriorTable>>,
    ) -> Self {
        let PerSensor { gyro, accel } = tables;
        Self {
            format: FORMAT.into(),
            tool,
            raw_unit,
            reference,
            biases: true,
            gyro,
            accel,
        }
    }

    /// Reads and checks a file.
    ///
    /// # Errors
    /// It cannot be read, has another format, or a covariance that is none.
    pub fn read(path: &Path) -> Result<Self> {
        let text = read_text(path)?;
        Self::parse(&text, &path.display().to_string())
    }

    /// As [`Self::read`]; `place` is the path.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn parse(text: &str, place: &str) -> Result<Self> {
        check_kind(text, place, "mimu-prior")?;
        let prior: Self = parse_toml(
            text,
            place,
            Some("make it again: mimu fleet DIR --prior FILE"),
        )?;
        if prior.format != FORMAT {
            let problem = format!(
                "format is {:?}, and this program reads {FORMAT:?}",
                prior.format
            );
            return Err(Error::new(
                place,
                problem,
                "use the version of mimu that wrote it",
            ));
        }
        for sensor in Sensor::BOTH {
            prior.triad_at(sensor, &format!("{place}, [{sensor}]"))?;
        }
        Ok(prior)
    }

    /// Text of the file.
    pub fn to_toml(&self) -> String {
        crate::toml_layout::to_toml(HEADER, self)
    }

    /// The table of a triad.
    pub fn table(&self, sensor: Sensor) -> Option<&PriorTable> {
        sensor.pick(self.gyro.as_ref(), self.accel.as_ref())
    }

    /// Sensors and numbers of units: `gyro of 60 units, accel of 60 units`. Empty if it has no table.
    pub fn words(&self) -> String {
        let of = |sensor| Some(format!("{sensor} of {} units", self.table(sensor)?.units));
        let each: Vec<String> = Sensor::BOTH.into_iter().filter_map(of).collect();
        each.join(", ")
    }

    /// Gives up the prior of a triad.
    pub fn remove(&mut self, sensor: Sensor) {
        match sensor {
            Sensor::Gyro => self.gyro = None,
            Sensor::Accel => self.accel = None,
        }
    }

    /// The prior of a triad, if the file has it. [`Self::parse`] has checked it.
    pub fn triad(&self, sensor: Sensor) -> Option<TriadPrior> {
        self.triad_at(sensor, "prior").ok().flatten()
    }

    fn triad_at(&self, sensor: Sensor, place: &str) -> Result<Option<TriadPrior>> {
        let Some(table) = self.table(sensor) else {
            return Ok(None);
        };
        let refuse = |problem: String| {
            Err(Error::new(
                place,
                problem,
                "make it again: mimu fleet DIR --prior FILE",
            ))
        };
        let n = table.parameters.len();
        if table.mean.len() != n
            || table.covariance.len() != n
            || table.covariance.iter().any(|r| r.len() != n)
        {
            return refuse(format!("mean and covariance are not of {n} parameters"));
        }
        let all = TriadParameter::physical();
        let (mut of, mut rows) = (Vec::new(), Vec::new());
        let mut mean = SVector::<f64, 12>::zeros();
        for (row, name) in table.parameters.iter().enumerate() {
            let Some(k) = all.iter().position(|p| p.to_string() == *name) else {
                return refuse(format!("no parameter is called {name:?}"));
            };
            mean[k] = table.mean[row];
            if self.biases || !all[k].is_bias() {
                of.push(k);
                rows.push(row);
            }
        }
        let covariance = DMatrix::from_fn(rows.len(), rows.len(), |i, j| {
            table.covariance[rows[i]][rows[j]]
        });
        let finite = covariance.iter().chain(mean.iter()).all(|v| v.is_finite());
        let scales = (0..3).all(|k| mean[k] != 0.0);
        match Cholesky::new(covariance.clone()).filter(|_| finite && scales) {
            Some(factor) => Ok(Some(TriadPrior {
                units: table.units as f64,
                mean,
                of,
                covariance,
                factor,
            })),
            None => refuse(
                "its covariance is not that of any population, or it lacks scale factors".into(),
            ),
        }
    }
}

impl PriorTable {
    /// Of `units` units: numbers of the parameters in the order of [`TriadParameter::physical`], their means and the covariance of a further unit, raw/SI, rad and raw.
    pub fn new(
        sensor: Sensor,
        raw: RawUnit,
        units: usize,
        of: &[usize],
        mean: &[f64],
        covariance: &DMatrix<f64>,
    ) -> Self {
        let all = TriadParameter::physical();
        let unit = |k: &usize| match k / 3 {
            0 => scale_unit(raw, sensor.unit()),
            3 => raw_unit(raw, sensor.unit()),
            _ => "rad".into(),
        };
        Self {
            units,
            parameters: of.iter().map(|k| all[*k].to_string()).collect(),
            parameter_units: of.iter().map(unit).collect(),
            mean: mean.to_vec(),
            sigma: covariance.diagonal().iter().map(|v| v.sqrt()).collect(),
            covariance: covariance
                .row_iter()
                .map(|r| r.iter().copied().collect())
                .collect(),
        }
    }
}

impl TriadPrior {
    /// The parameters that it is of.
    pub fn parameters(&self) -> impl Iterator<Item = TriadParameter> {
        let all = TriadParameter::physical();
        self.of.iter().map(move |k| all[*k])
    }

    /// Number of its rows in a fit.
    pub fn rows(&self) -> usize {
        self.of.len()
    }

    /// The unit in the middle of the population, raw to SI. `None` if it is singular.
    pub fn middle(&self) -> Option<Affine<f64>> {
        Some(Triad::from_physical(&self.mean, &[])?.inverse)
    }

    /// The parameters of a unit minus the means, decorrelated and in standard deviations; and the derivatives by C (rows) and o of the unit. `None` if it is singular.
    pub fn residuals(&self, inverse: &Affine<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let (values, by) = physical_of(inverse)?;
        let n = self.of.len();
        let from = DVector::from_fn(n, |i, _| values[self.of[i]] - self.mean[self.of[i]]);
        let by = DMatrix::from_fn(n, 12, |i, j| by[(self.of[i], j)]);
        let l = self.factor.l_dirty();
        Some((
            l.solve_lower_triangular(&from)?,
            l.solve_lower_triangular(&by)?,
        ))
    }

    /// The parameters that the data of a fit with this prior leave open, with their means and standard deviations.
    pub fn open(&self, fitted: &Triad) -> Vec<(TriadParameter, f64, f64)> {
        let (_, parts) = fitted.physical_parts();
        let each = self.of.iter().enumerate().filter_map(|(i, k)| {
            let variance: f64 = parts.iter().map(|p| p.covariance[(*k, *k)]).sum();
            let prior = self.covariance[(i, i)];
            let open = variance > (1.0 - SHOWN) * prior;
            open.then(|| (TriadParameter::physical()[*k], self.mean[*k], prior.sqrt()))
        });
        each.collect()
    }

    /// How far a fit with this prior has moved from the middle: all parameters together, and each alone. Of twelve parameters together, one that is off by eight
    /// standard deviations was not named in a third of the units.
    pub fn movement(&self, fitted: &Triad) -> Option<Movement> {
        let (values, parts) = fitted.physical_parts();
        let n = self.of.len();
        let from = DVector::from_fn(n, |i, _| values[self.of[i]] - self.mean[self.of[i]]);
        let posterior = DMatrix::from_fn(n, n, |i, j| {
            parts
                .iter()
                .map(|p| p.covariance[(self.of[i], self.of[j])])
                .sum::<f64>()
        });
        let l = self.factor.l_dirty();
        let white = l.solve_lower_triangular(&from)?;
        let half = l.solve_lower_triangular(&posterior)?;
        let decorrelated = l.solve_lower_triangular(&half.transpose())?;
        let moved = SymmetricEigen::new(DMatrix::identity(n, n) - decorrelated);
        let seen = (0..n).filter(|k| moved.eigenvalues[*k] > SEEN);
        let squares =
            seen.map(|k| moved.eigenvectors.column(k).dot(&white).powi(2) / moved.eigenvalues[k]);
        let squares: Vec<f64> = squares.collect();
        let together = self.beyond(squares.iter().sum(), squares.len() as f64);
        let each = (0..n).filter_map(|i| {
            let prior = self.covariance[(i, i)];
            let moved = prior - posterior[(i, i)];
            (moved > SEEN * prior).then(|| self.beyond(from[i].powi(2) / moved, 1.0))
        });
        let each: Vec<f64> = each.collect();
        let least = each.iter().copied().fold(1.0, f64::min) * each.len() as f64;
        let sigmas = |i: usize| from[i] / self.covariance[(i, i)].sqrt();
        let most = (0..n).max_by(|a, b| sigmas(*a).abs().total_cmp(&sigmas(*b).abs()))?;
        Some(Movement {
            p: (2.0 * together.min(least)).min(1.0),
            most: TriadParameter::physical()[self.of[most]],
            sigmas: sigmas(most),
        })
    }
}

impl TriadPrior {
    /// Probability that the square of a movement along `seen` directions is larger: Hotelling's distribution, because the covariance is estimated from the units.
    ///
    /// The file's covariance is larger than the estimate, by the bias of its inverse: `(N - 1)/(N - n - 2)`.
    fn beyond(&self, square: f64, seen: f64) -> f64 {
        let rest = (self.units - seen).max(3.0);
        if !(seen > 0.0) {
            return 1.0;
        }
        let scaled = square / seen * rest / (rest - 2.0);
        FisherSnedecor::new(seen, rest).map_or(1.0, |d| d.sf(scaled))
    }
}

/// Share of a parameter's prior variance that the data have to remove for it to count as calibrated.
const SHOWN: f64 = 0.5;
/// Share of a direction's prior variance that the data have to remove for it to count as seen. Few poses may err by more than they show, which matters where data and prior are
/// about equally certain.
const SEEN: f64 = 0.8;
