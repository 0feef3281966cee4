//! The first gyro and accelerometer of a body, compensated: what its further triads are compared with.

use mimu::fit::Fit;
use mimu::quantity::{PerSensor, Sensor};
use mimu::signal::dwell::Dwell;
use mimu::triad::{Covariance, Part, Triad};
use mimu_core::compensation::Affine;
use mimu_recording::error::Result;
use mimu_recording::{Column, Recording, TriadKind, TriadName};
use nalgebra::{Matrix3, SVector, Vector3};

use crate::series::{Motion, Series};

/// A rest: its times, s, and the direction up in the frame of the body.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rest {
    pub from_s: f64,
    pub to_s: f64,
    pub up: Vector3<f64>,
}

impl Rest {
    /// Its times, s.
    pub fn span(&self) -> [f64; 2] {
        [self.from_s, self.to_s]
    }

    /// The instant in its middle, s.
    pub fn middle(&self) -> f64 {
        0.5 * (self.from_s + self.to_s)
    }
}

/// Compensated readings, SI.
pub(crate) struct Carrier {
    motion: Option<Motion>,
    force: Option<Series>,
}

/// What a further gyro or accelerometer is compared with.
pub(crate) struct Reference<'a> {
    /// Motion by the first gyro; an accelerometer without one has no arm.
    pub motion: Option<&'a Motion>,
    /// Compensated readings of the first triad of its kind, SI.
    pub series: &'a Series,
}

impl Reference<'_> {
    /// Variance of the noise of a mean over so long, SI².
    pub fn noise_of_means(&self, time_s: f64) -> f64 {
        let count = (time_s / self.series.period).round() as usize;
        self.series.noise_of_means(count)
    }

    /// Rms of an axis, SI.
    pub fn signal(&self) -> f64 {
        let squares = self.series.x.iter().map(|x| x.norm_squared());
        (squares.sum::<f64>() / self.series.len() as f64 / 3.0).sqrt()
    }
}

/// The name of the first triad of `sensor`.
pub(crate) fn first(sensor: Sensor) -> TriadName {
    TriadName::first(match sensor {
        Sensor::Gyro => TriadKind::Gyro,
        Sensor::Accel => TriadKind::Accel,
    })
}

/// Raw readings of a triad.
pub(crate) fn read(recording: &Recording, name: TriadName) -> Result<Series> {
    let columns = [0, 1, 2].map(|axis| Column::of(name, axis));
    let columns = [Column::Time, columns[0], columns[1], columns[2]];
    let all = recording.read_columns(&columns, |_| ())?;
    Ok(Series::new(&all[0], [&all[1], &all[2], &all[3]]))
}

/// The first two triads of a unit: their calibrations, as far as there are any, and its rests.
pub(crate) struct Unit {
    /// Calibrations with their uncertainty.
    pub triads: PerSensor<Option<Triad>>,
    /// Standard deviation of what remains of the gyro's bias, rad/s.
    pub rate_bias: f64,
    /// Its rests.
    pub rests: Vec<Rest>,
}

/// How a gyro's bias wanders within a session, standard deviation, rad/s: 0.02 deg/s; and what it may be where it is not calibrated: 1 deg/s.
const WANDER: f64 = 3.5e-4;
const UNKNOWN: f64 = 0.017;

/// How wrong a unit's readings in SI may be, standard deviations: of each element of C, and of o, rad/s and m/s². These are a percent, half a degree, and a bias at
/// rest.
const NOMINAL: f64 = 0.01;
const NOMINAL_BIAS: PerSensor<f64> = PerSensor {
    gyro: 0.001,
    accel: 0.1,
};

impl Unit {
    /// As a fit has calibrated it.
    pub fn fitted(fit: &Fit) -> Self {
        let triads = PerSensor::from_fn(|sensor| {
            let found = fit.sensor(sensor)?;
            Some(found.estimated.triad.clone())
        });
        Self::of(&fit.prepared.dwells.list, triads, WANDER)
    }

    /// As it reads, in SI, less what the gyro reads in these dwells.
    pub fn nominal(dwells: &[Dwell], has: PerSensor<bool>) -> Self {
        let triads = PerSensor::from_fn(|sensor| {
            has[sensor].then_some(())?;
            let mut at_rest = Vector3::zeros();
            if sensor == Sensor::Gyro {
                let means = dwells.iter().filter(|d| !d.spins() && !d.turn);
                let means: Vec<_> = means.map(|d| d.raw_mean(sensor)).collect();
                let sum: Vector3<f64> = means.iter().sum();
                at_rest = sum / means.len().max(1) as f64;
            }
            let variances = SVector::<f64, 12>::from_fn(|k, _| match k {
                0..9 => NOMINAL.powi(2),
                _ => NOMINAL_BIAS[sensor].powi(2),
            });
            let part = Part::known(Covariance::from_diagonal(&variances));
            let inverse = Affine {
                matrix: Matrix3::identity(),
                offset: -at_rest,
            };
            Triad::from_inverse(inverse, vec![part])
        });
        // A slow turn passes for a rest where there is none.
        Self::of(dwells, triads, UNKNOWN)
    }

    fn of(dwells: &[Dwell], triads: PerSensor<Option<Triad>>, rate_bias: f64) -> Self {
        let own = dwells.iter();
        let own = own.filter(|d| d.faults.accel.is_none() && !d.spins() && !d.turn);
        let rest = |d: &Dwell| {
            let model = triads.accel.as_ref()?.inverse;
            Some(Rest {
                from_s: d.start_s,
                to_s: d.start_s + d.duration_s,
                up: model.apply(&d.raw_mean(Sensor::Accel)).try_normalize(1.0)?,
            })
        };
        Self {
            rate_bias,
            rests: own.filter_map(rest).collect(),
            triads,
        }
    }
}

impl Carrier {
    /// Of the first triads, as far as they have models, raw to SI.
    pub fn read(recording: &Recording, models: &PerSensor<Option<Affine<f64>>>) -> Result<Self> {
        let there = recording.triads();
        let series = |sensor: Sensor| -> Result<Option<Series>> {
            let model = models[sensor].filter(|_| there.contains(&first(sensor)));
            let Some(model) = model else {
                return Ok(None);
            };
            let raw = read(recording, first(sensor))?;
            Ok(Some(raw.map(|u| model.apply(u))))
        };
        Ok(Self {
            motion: series(Sensor::Gyro)?.map(Motion::new),
            force: series(Sensor::Accel)?,
        })
    }

    /// Its motion by the gyro.
    pub fn motion(&self) -> Option<&Motion> {
        self.motion.as_ref()
    }

    /// What a further triad of this kind is compared with.
    pub fn reference(&self, sensor: Sensor) -> Option<Reference<'_>> {
        let series = match sensor {
            Sensor::Gyro => &self.motion()?.rate,
            Sensor::Accel => self.force.as_ref()?,
        };
        Some(Reference {
            motion: self.motion(),
            series,
        })
    }
}
