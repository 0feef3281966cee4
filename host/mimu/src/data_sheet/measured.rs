//! What a calibration and a noise file say of a unit, in the quantities and units of data sheets.

use mimu_allan::model::Term;
use mimu_core::compensation::Affine;
use nalgebra::SVector;

use super::part::{PartSensor, Property};
use crate::calibration::Calibration;
use crate::noise::noise_file::NoiseFile;
use crate::quantity::{AXES, Sensor};
use crate::readable::STANDARD_GRAVITY;
use crate::triad::{Covariance, Forward, affine, vector};
use mimu_recording::RawUnit;

/// The sensitivity is within this of the nominal one of the range that is in use, relative.
const NEAR_RANGE: f64 = 0.2;
/// A data sheet's density is one-sided, N two-sided.
const ONE_SIDED: f64 = std::f64::consts::SQRT_2;

/// A sensor of a unit.
pub(super) struct Unit<'a> {
    sensor: Sensor,
    inverse: Affine<f64>,
    covariance: Option<Covariance>,
    /// Half-width of 95 % intervals, standard deviations.
    sigmas: f64,
    /// Nominal scale factor, raw per SI; `None` if the raw unit has none.
    nominal: Option<f64>,
    /// Full scale of the range in use, deg/s or g.
    pub full_scale: Option<f64>,
    calibration: &'a Calibration,
    noise: Option<&'a NoiseFile>,
}

/// A value with half of its 95 % interval, or the reason why there is none.
type Measured = Result<(f64, Option<f64>), String>;

impl<'a> Unit<'a> {
    /// The sensor of a unit; `None` if the calibration lacks it, or is singular.
    pub fn of(
        calibration: &'a Calibration,
        noise: Option<&'a NoiseFile>,
        sensor: Sensor,
        part: &PartSensor,
    ) -> Option<Self> {
        let table = calibration.table(sensor)?;
        let inverse = calibration.inverse(sensor)?;
        let scale = scale(&Forward::of(&inverse)?);
        let per_unit = 1.0 / of_sheet(sensor, 1.0);
        let (mut nominal, mut full_scale) = (None, None);
        match table.raw_unit {
            RawUnit::Si => nominal = Some(1.0),
            RawUnit::Count => {
                let mean = scale.iter().sum::<f64>() / 3.0;
                let near = part.ranges.iter().find(|[_, counts]| {
                    (mean / (counts * of_sheet(sensor, 1.0)) - 1.0).abs() < NEAR_RANGE
                });
                if let Some([range, counts]) = near {
                    nominal = Some(counts / per_unit);
                    full_scale = Some(*range);
                }
            }
            RawUnit::Volt => {}
        }
        Some(Self {
            sensor,
            inverse,
            covariance: calibration.covariance(sensor),
            sigmas: table.interval_sigmas(),
            nominal,
            full_scale,
            calibration,
            noise,
        })
    }

    /// A property of an axis.
    pub fn value(&self, property: Property, axis: usize) -> Measured {
        match property {
            Property::Sensitivity => {
                let Some(nominal) = self.nominal else {
                    return Err("the sensitivity is that of no range of the part".into());
                };
                Ok(self.with_interval(|model| {
                    Some(100.0 * (scale(&Forward::of(model)?)[axis] / nominal - 1.0))
                }))
            }
            Property::Offset => Ok(self.with_interval(|model| {
                let forward = Forward::of(model)?;
                let si = forward.bias[axis] / forward.matrix.row(axis).norm();
                Some(
                    of_sheet(self.sensor, si)
                        * if self.sensor == Sensor::Accel {
                            1e3
                        } else {
                            1.0
                        },
                )
            })),
            Property::CrossAxis => Ok(self.cross_axis(axis)),
            Property::Nonlinearity => self.nonlinearity(axis),
            Property::NoiseDensity => self.noise_density(axis),
        }
    }

    /// The larger of what an axis reads of both others, %.
    fn cross_axis(&self, axis: usize) -> (f64, Option<f64>) {
        let others = [(axis + 1) % 3, (axis + 2) % 3];
        let each = others.map(|other| {
            self.with_interval(|model| {
                let row = Forward::of(model)?.matrix.row(axis).into_owned();
                Some(100.0 * row[other] / row[axis])
            })
        });
        let [a, b] = each;
        if a.0.abs() >= b.0.abs() { a } else { b }
    }

    /// Largest deviation from the best straight line over the range, % of full scale: half of a square's, and a quarter of a cube's, at full scale
    /// (Chebyshev).
    fn nonlinearity(&self, axis: usize) -> Measured {
        let Some(full_scale) = self.full_scale else {
            return Err("the range is not known".into());
        };
        let full_scale = full_scale / of_sheet(self.sensor, 1.0);
        let laws = [("scale_quadratic", 0.5, 1), ("scale_cubic", 0.25, 2)];
        let (mut sum, mut variance, mut known, mut found) = (0.0_f64, 0.0, true, false);
        for (law, share, power) in laws {
            let id = format!("{}_{law}", self.sensor);
            let effects = self.calibration.effects().iter().filter(|e| e.id() == id);
            for coefficient in effects.flat_map(|e| e.coefficients()) {
                if !coefficient.name.ends_with(AXES[axis]) {
                    continue;
                }
                found = true;
                let percent = 100.0 * share * full_scale.powi(power);
                sum += (coefficient.value * percent).abs();
                match coefficient.sigma {
                    Some(sigma) => variance += (sigma * percent).powi(2),
                    None => known = false,
                }
            }
        }
        match found {
            true => Ok((sum, known.then(|| self.sigmas * variance.sqrt()))),
            false => {
                Err("mimu diagnose has found none; poses and turns do not reach full scale".into())
            }
        }
    }

    fn noise_density(&self, axis: usize) -> Measured {
        let Some(noise) = self.noise else {
            return Err("give the noise at rest, --noise FILE".into());
        };
        let name = format!("{}_{}", self.sensor, AXES[axis]);
        let channels = noise.channel.iter().filter(|c| c.name == name);
        let of_sheet = |si: f64| {
            let micro = if self.sensor == Sensor::Accel {
                1e6
            } else {
                1.0
            };
            ONE_SIDED * micro * of_sheet(self.sensor, si)
        };
        let mut calibrated = channels.filter(|c| c.unit == self.sensor.unit());
        let Some(channel) = calibrated.next() else {
            return Err(
                "the noise file is not of calibrated readings: mimu allan --calibration".into(),
            );
        };
        let n = channel.get(Term::N).map_err(str::to_owned)?;
        let half = 0.5 * (n.upper - n.lower);
        Ok((of_sheet(n.value), Some(of_sheet(half))))
    }

    /// A function of the calibration with half of its 95 % interval, by its derivatives.
    fn with_interval(&self, of: impl Fn(&Affine<f64>) -> Option<f64>) -> (f64, Option<f64>) {
        let value = of(&self.inverse).unwrap_or(f64::NAN);
        let half = self.covariance.and_then(|covariance| {
            let at = vector(&self.inverse.matrix, &self.inverse.offset);
            let mut by = SVector::<f64, 12>::zeros();
            for k in 0..12 {
                let step = 0.01 * covariance[(k, k)].sqrt();
                if step > 0.0 {
                    let moved = |by: f64| {
                        let mut there = at;
                        there[k] += by;
                        of(&affine(&there))
                    };
                    by[k] = (moved(step)? - moved(-step)?) / (2.0 * step);
                }
            }
            Some(self.sigmas * (by.transpose() * covariance * by)[0].max(0.0).sqrt())
        });
        (value, half)
    }
}

/// Magnitudes of the rows: scale factors, raw per SI, signs left out.
fn scale(forward: &Forward) -> [f64; 3] {
    std::array::from_fn(|i| forward.matrix.row(i).norm())
}

/// deg/s or g.
fn of_sheet(sensor: Sensor, si: f64) -> f64 {
    sensor.pick(si.to_degrees(), si / STANDARD_GRAVITY)
}
