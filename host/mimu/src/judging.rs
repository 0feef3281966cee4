//! What judges a triad in a recording: its dwells or turns as a list of factors, and their errors by given models. A fit judges its own models by it, and a
//! verification those of a file.

use mimu_core::compensation::Affine;
use mimu_recording::Reference;
use nalgebra::{DMatrix, DVector, Vector3};

use crate::estimate::least_squares::root;
use crate::estimate::{Estimated, earth_shared};
use crate::factor::{Factors, Linearized};
use crate::observation::ByTriad;
use crate::observation::turn::Rest;
use crate::prepared::Prepared;
use crate::quantity::{Figure, PerSensor, Sensor};
use crate::triad::{Covariance, Forward, Triad};
use crate::turntable::RatedDwells;
use crate::unseen::Unseen;
use crate::warning::Warning;

/// Calibrations, raw to SI, as far as there are any.
pub(crate) type Models = PerSensor<Option<Affine<f64>>>;

/// The observations that judge a triad.
pub(crate) struct Judging<'a> {
    /// The triad.
    pub sensor: Sensor,
    /// The quantity of its errors.
    pub figure: Figure,
    /// A factor for each dwell or turn.
    pub factors: Factors<'a>,
    /// The rates of a gyro at rest, where no table gives its inputs.
    pub rests: Vec<Rest>,
    /// Warnings about what cannot be used.
    pub refused: Vec<Warning>,
    is_noise_known: bool,
}

/// How uncertain a gyro and an accelerometer are by what is known: of one, of the other, and how the gyro follows the accelerometer.
pub(crate) struct Both {
    /// Of the gyro: C by rows, then o.
    pub gyro: Covariance,
    /// Of the accelerometer.
    pub accel: Covariance,
    /// What a unit of error of each parameter of the accelerometer adds to those of the gyro.
    pub follows: Covariance,
}

impl Both {
    /// Of one triad.
    pub fn of_one(sensor: Sensor, covariance: Covariance) -> Self {
        let of = |s| match s == sensor {
            true => covariance,
            false => Covariance::zeros(),
        };
        Self {
            gyro: of(Sensor::Gyro),
            accel: of(Sensor::Accel),
            follows: Covariance::zeros(),
        }
    }

    /// Of two triads of one fit.
    pub fn of(gyro: &Estimated, accel: &Triad) -> Self {
        Self {
            gyro: gyro.triad.known_covariance(),
            accel: accel.known_covariance(),
            follows: gyro.follows_accel.unwrap_or_else(Covariance::zeros),
        }
    }

    /// A root of the covariance of the parameters of these triads.
    fn root(&self, of: &[Sensor]) -> DMatrix<f64> {
        let with = self.follows * self.accel;
        let block = |a, b| match (a, b) {
            (Sensor::Gyro, Sensor::Gyro) => self.gyro,
            (Sensor::Gyro, Sensor::Accel) => with,
            (Sensor::Accel, Sensor::Gyro) => with.transpose(),
            (Sensor::Accel, Sensor::Accel) => self.accel,
        };
        let n = 12 * of.len();
        root(&DMatrix::from_fn(n, n, |i, j| {
            block(of[i / 12], of[j / 12])[(i % 12, j % 12)]
        }))
    }
}

impl<'a> Judging<'a> {
    /// Of `sensor` in `prepared`, with noise and directions by `models`. `None` if nothing judges it: without its model, without a dwell or a turn, or for a gyro whose
    /// turns no accelerometer shows.
    pub fn of(prepared: &'a Prepared, sensor: Sensor, models: &Models) -> Option<Self> {
        let model = models[sensor].as_ref()?;
        let (mut rests, mut refused) = (Vec::new(), Vec::new());
        let known = |of: &[Sensor]| of.iter().all(|s| prepared.noise.is_known(*s));
        let (figure, factors, is_noise_known) = match (prepared.manifest.reference, sensor) {
            (Reference::Table, _) => {
                let matrix = Forward::of(model)?.matrix;
                let mut factors = Factors::default();
                for o in earth_shared::likely(&prepared.observations(sensor), &matrix) {
                    factors.input(sensor, (o.dwell, o.raw), o.input, o.variance);
                }
                (Figure::Input, factors, known(&[sensor]))
            }
            (Reference::Gravity | Reference::TurntableRate, Sensor::Accel) => {
                let (factors, is_known) = prepared.magnitudes(model);
                (Figure::GravityMagnitude, factors, is_known)
            }
            (Reference::TurntableRate, Sensor::Gyro) => {
                return Self::rated(prepared, &RatedDwells::of(prepared).ok()?, models);
            }
            // Means of poses do not show how the unit turned between them.
            (Reference::Gravity, Sensor::Gyro) if prepared.manifest.means => return None,
            (Reference::Gravity, Sensor::Gyro) => {
                let accel = models.accel.as_ref()?;
                let (turns, not_used) = prepared.turns(accel);
                refused = not_used;
                rests = prepared.rest(accel);
                let factors = Factors::of_turns(&turns);
                (Figure::Direction, factors, known(&Sensor::BOTH))
            }
        };
        (!factors.list.is_empty()).then_some(Self {
            sensor,
            figure,
            factors,
            rests,
            refused,
            is_noise_known,
        })
    }

    /// Of a gyro on a turntable, by these dwells.
    pub fn rated(prepared: &Prepared, dwells: &RatedDwells, models: &Models) -> Option<Self> {
        let factors = dwells.factors(models.gyro.as_ref()?);
        (!factors.list.is_empty()).then(|| Self {
            sensor: Sensor::Gyro,
            figure: Figure::RateMagnitude,
            factors,
            rests: dwells.rests.clone(),
            refused: Vec::new(),
            is_noise_known: prepared.noise.is_known(Sensor::Gyro),
        })
    }

    /// The triads whose models its errors depend on.
    pub fn triads(&self) -> &[Sensor] {
        match (self.figure, self.sensor) {
            (Figure::Direction, _) => &Sensor::BOTH,
            (_, Sensor::Gyro) => &Sensor::BOTH[..1],
            (_, Sensor::Accel) => &Sensor::BOTH[1..],
        }
    }

    fn at(&self, models: &Models) -> Option<(Linearized, Vec<f64>)> {
        let triads = self.triads().iter();
        let triads: Option<Vec<_>> = triads.map(|s| Some((*s, models[*s].as_ref()?))).collect();
        let values = self.factors.values(&triads?);
        Some((self.factors.at(&values), self.factors.variances(&values)))
    }

    /// The error of each dwell or turn; of a magnitude it is the first component. `None` without a model.
    pub fn errors(&self, models: &Models) -> Option<Vec<Vector3<f64>>> {
        let (at, _) = self.at(models)?;
        let error = |rows: std::ops::Range<usize>| {
            Vector3::from_fn(|k, _| {
                let row = rows.start + k;
                if row < rows.end {
                    at.residuals[row]
                } else {
                    0.0
                }
            })
        };
        Some(self.factors.ranges().map(error).collect())
    }

    /// The dwell of each, or the one that a turn ends in.
    pub fn dwells(&self) -> impl Iterator<Item = usize> {
        let each = self.factors.list.iter();
        each.filter_map(|factor| factor.dwells.map(|of| of[1]))
    }

    /// Derivatives of the errors of each by the parameters of its triad.
    pub fn derivatives(&self, models: &Models) -> Option<Vec<Vec<ByTriad>>> {
        let (at, _) = self.at(models)?;
        // Of two triads, the first is the one that is judged.
        let by = |row| at.jacobian.fixed_view::<1, 12>(row, 0).transpose();
        let each = self.factors.ranges();
        Some(each.map(|rows| rows.map(by).collect()).collect())
    }

    /// Rms of these errors.
    pub fn rms(&self, errors: &[Vector3<f64>]) -> f64 {
        rms(self.figure, errors.iter().copied())
    }

    /// Standard deviation of the error of each dwell or turn by noise alone: over its axes for an input, and of the size otherwise. Not a number if the noise is not known.
    pub fn floors(&self, models: &Models) -> Option<Vec<f64>> {
        let (_, variances) = self.at(models)?;
        let floor = |rows: std::ops::Range<usize>| {
            let own = &variances[rows];
            let sum: f64 = own.iter().sum();
            match (self.is_noise_known, self.figure) {
                (false, _) => f64::NAN,
                (true, Figure::Input) => (sum / own.len() as f64).sqrt(),
                (true, _) => sum.sqrt(),
            }
        };
        Some(self.factors.ranges().map(floor).collect())
    }

    /// Rms of the rates at rest; `None` without any.
    pub fn at_rest(&self, gyro: &Affine<f64>) -> Option<f64> {
        let rests = self.rests.iter();
        let errors = rests.map(|rest| gyro.apply(&rest.raw) - rest.rate);
        (!self.rests.is_empty()).then(|| rms(Figure::Input, errors))
    }

    /// Errors by models whose parameters are uncertain by `of`, and what is predicted of them, in the dwells or turns that end in one that is `unseen`.
    pub fn unseen(
        &self,
        models: &Models,
        of: &Both,
        unseen: impl Fn(usize) -> bool,
    ) -> Option<Unseen> {
        let (at, variances) = self.at(models)?;
        let each = self.dwells().zip(self.factors.ranges());
        let own = each.filter(|(dwell, _)| unseen(*dwell));
        let own: Vec<usize> = own.flat_map(|(_, rows)| rows).collect();
        Some(Unseen::of(
            at.residuals.select_rows(&own),
            DVector::from_vec(variances).select_rows(&own),
            &at.jacobian.select_rows(&own),
            &of.root(self.triads()),
        ))
    }
}

/// Root mean square: over axes if the input is known, otherwise of the angle or magnitude.
pub(crate) fn rms(figure: Figure, values: impl Iterator<Item = Vector3<f64>>) -> f64 {
    let (mut sum, mut n) = (0.0, 0.0);
    for v in values {
        sum += v.norm_squared();
        n += match figure {
            Figure::Input => 3.0,
            Figure::GravityMagnitude | Figure::RateMagnitude | Figure::Direction => 1.0,
        };
    }
    (sum / n).sqrt()
}

/// Size of what a figure is compared with, in its unit; `None` for inputs, which a table gives.
pub fn known_size(prepared: &Prepared, figure: Figure) -> Option<f64> {
    match figure {
        Figure::Direction => Some(1.0),
        Figure::GravityMagnitude => Some(prepared.manifest.gravity_mps2),
        Figure::RateMagnitude => {
            let table = prepared.manifest.turntable.iter();
            let rates = table.flat_map(|t| &t.rates_dps);
            Some(rates.fold(0.0, |most, rate| f64::max(most, rate.to_radians())))
        }
        Figure::Input => None,
    }
}
