//! The parameters of calibrations, in units that a fleet has in common.

use mimu::nalgebra::{DMatrix, DVector, SVector};
use mimu::sessions::between::Estimates;
use mimu::triad::{Covariance, Part, Triad};
use mimu::{Calibration, ParameterKind, PerSensor, RawUnit, Sensor, TriadParameter};
use mimu_recording::Reference;

/// How the name of an estimator ends that has used a prior.
const WITH_PRIOR: &str = " and a prior";

/// Physical parameters of a triad and the covariance of their fit, in the order of [`TriadParameter::physical`]: raw, raw/SI and rad.
pub type Physical = (SVector<f64, 12>, Covariance);

/// What makes calibrations comparable.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Setting {
    /// Unit of the readings.
    pub raw_unit: String,
    /// What was known of the input: it defines the frame.
    pub reference: String,
}

/// The parameters of a calibration.
#[derive(Debug, Clone)]
pub struct OfCalibration {
    /// What it can be compared with.
    pub setting: Setting,
    /// Unit of the readings.
    pub raw_unit: RawUnit,
    /// Reference of its recording.
    pub reference: Option<Reference>,
    /// Parameters.
    pub triads: PerSensor<Option<Physical>>,
}

impl OfCalibration {
    /// The parameters of `calibration`, at the temperature of its recording.
    ///
    /// # Errors
    /// A sentence: it is a misfit, has no uncertainty, or its matrix is singular.
    pub fn of(calibration: &Calibration) -> Result<Self, String> {
        let judged = calibration.judgement.as_ref();
        if let Some(misfit) = judged.filter(|j| j.kind == mimu::JudgementKind::Misfit) {
            return Err(format!("it was judged a {misfit}"));
        }
        if !calibration.is_uncertain() {
            return Err("it has no standard deviations: it was fetched from a device".into());
        }
        let mut triads = PerSensor::default();
        for sensor in Sensor::BOTH {
            let Some(inverse) = calibration.inverse(sensor) else {
                continue;
            };
            let judged = calibration.table(sensor).and_then(|t| t.judged.as_ref());
            if judged.is_some_and(|j| j.estimator.ends_with(WITH_PRIOR)) {
                return Err(format!(
                    "its {sensor} was fitted with a prior, and would confirm the population of that"
                ));
            }
            let covariance = calibration.covariance(sensor);
            let covariance = covariance.ok_or_else(|| format!("its {sensor} has no covariance"))?;
            let part = Part::known(covariance);
            let triad = Triad::from_inverse(inverse, vec![part]);
            let triad = triad.ok_or_else(|| format!("the matrix of its {sensor} is singular"))?;
            let (values, parts) = triad.physical_parts();
            let zero = Covariance::zeros();
            let covariance = parts.iter().fold(zero, |sum, p| sum + p.covariance);
            if !values
                .iter()
                .chain(covariance.iter())
                .all(|v| v.is_finite())
            {
                return Err(format!("a number of its {sensor} is not finite"));
            }
            triads[sensor] = Some((values, covariance));
        }
        if triads.present().next().is_none() {
            return Err("it has neither gyro nor accelerometer".into());
        }
        let reference = calibration.recording.reference;
        let raw_unit = calibration.recording.raw_unit;
        Ok(Self {
            setting: Setting {
                raw_unit: raw_unit.to_string(),
                reference: reference.map_or_else(|| "unknown".into(), |r| r.to_string()),
            },
            raw_unit,
            reference,
            triads,
        })
    }
}

/// How the parameters of a triad are written in a fleet.
#[derive(Debug, Clone)]
pub struct Basis {
    /// Sensor.
    pub sensor: Sensor,
    /// Numbers of the free parameters in the order of [`TriadParameter::physical`]; the others define the frame.
    pub free: Vec<usize>,
    /// Median scale factors, raw per SI.
    pub scale: [f64; 3],
}

impl Basis {
    /// The basis of a triad in all calibrations. `None` if none has it.
    pub fn of(
        sensor: Sensor,
        reference: Option<Reference>,
        all: &[Option<Physical>],
    ) -> Option<Self> {
        let free = mimu::sessions::free(all).into_iter();
        let free: Vec<usize> = free
            .filter(|k| !defines_frame(sensor, reference, *k))
            .collect();
        let median = |axis: usize| {
            let mut values: Vec<f64> = all.iter().flatten().map(|(v, _)| v[axis]).collect();
            values.sort_by(f64::total_cmp);
            values.get(values.len() / 2).copied()
        };
        let scale = [median(0)?, median(1)?, median(2)?];
        let usable = !free.is_empty() && scale.iter().all(|s| *s != 0.0);
        usable.then_some(Self {
            sensor,
            free,
            scale,
        })
    }

    /// Factor from the unit of the files to that of the fleet, for parameter `k` of the twelve.
    fn factor(&self, k: usize) -> f64 {
        match k {
            0..3 | 9..12 => 1.0 / self.scale[k % 3],
            _ => 1.0,
        }
    }

    /// Estimates of the free parameters in the units of the fleet.
    pub fn estimates(&self, (values, covariance): &Physical) -> Estimates {
        let n = self.free.len();
        let by = |i: usize| self.factor(self.free[i]);
        let relative = |k: usize| if k < 3 { 1.0 } else { 0.0 };
        Estimates {
            values: DVector::from_fn(n, |i, _| {
                values[self.free[i]] * by(i) - relative(self.free[i])
            }),
            covariance: DMatrix::from_fn(n, n, |i, j| {
                covariance[(self.free[i], self.free[j])] * by(i) * by(j)
            }),
        }
    }

    /// Factor from the unit of the fleet to that of the files, for the free parameter `i`.
    pub fn to_file(&self, i: usize) -> f64 {
        1.0 / self.factor(self.free[i])
    }

    /// The free parameter `i` of this value in the unit of the files.
    pub fn in_file(&self, i: usize, value: f64) -> f64 {
        let relative = if self.free[i] < 3 { 1.0 } else { 0.0 };
        (value + relative) * self.to_file(i)
    }

    /// The free parameter `i`.
    pub fn parameter(&self, i: usize) -> TriadParameter {
        TriadParameter::physical()[self.free[i]]
    }

    /// SI unit of the free parameter `i`: `1`, `rad`, `rad/s` or `m/s^2`.
    pub fn unit(&self, i: usize) -> &'static str {
        match self.parameter(i).0 {
            ParameterKind::Scale => "1",
            ParameterKind::Bias => self.sensor.unit(),
            _ => "rad",
        }
    }

    /// Name for people: `gyro scale factor x`.
    pub fn name(&self, i: usize) -> String {
        let parameter = self.parameter(i);
        format!(
            "{} {} {}",
            self.sensor,
            parameter.0.words(),
            parameter.axis()
        )
    }
}

/// Whether parameter `k` of the twelve defines the frame of the triad, if only magnitudes of its input are known. Digits that a file has rounded away would give it an uncertainty.
fn defines_frame(sensor: Sensor, reference: Option<Reference>, k: usize) -> bool {
    let by_magnitude = match reference {
        Some(Reference::Gravity) => sensor == Sensor::Accel,
        Some(Reference::TurntableRate) => true,
        Some(Reference::Table) | None => false,
    };
    by_magnitude && (3..6).contains(&k)
}
