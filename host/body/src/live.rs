//! The field while a person turns the body: whether it is that of the poses so far.
//!
//! Raw readings vary in size by the hard iron, which is often larger than the field. So they are judged by the calibration of the field so far, and with its
//! uncertainty at these readings: before it is determined nothing contradicts it.

use mimu::fit::Fit;
use mimu::quantity::PerSensor;
use mimu::triad::half_width_95;
use mimu_core::compensation::Affine;
use mimu_recording::error::Result;
use mimu_recording::{Recording, TriadName};
use nalgebra::{SMatrix, Vector3};

use crate::carrier::{Carrier, Unit, read};
use crate::field::{CONTRADICTED, FEWEST_RESTS, Field, by_calibration, scatter};
use crate::{FEWEST, judge};

/// A smaller departure is not worth a person's attention, as a share of the field: it moves its direction by less than 2 degrees.
const LEAST: f64 = 0.03;
/// Rests from which on the field is looked at although its direction is not determined: an undisturbed one is after nine to twelve. Errors of its size are not
/// hidden by that, since what is open in a fit makes its residuals smaller.
const MANY_RESTS: usize = 14;

/// The field of a body by its poses so far, in units of its size.
#[derive(Debug, Clone)]
pub struct FieldSoFar {
    /// Raw to the field, and its covariance.
    calibration: Affine<f64>,
    covariance: SMatrix<f64, 12, 12>,
    /// Raw specific force to SI.
    accel: Affine<f64>,
    /// Whether other poses can be judged by it.
    is_determined: bool,
    /// Of its size and of its part along up, at the rests so far: median and scatter.
    at_rest: [[f64; 2]; 2],
    /// Part along up.
    along_up: f64,
}

/// By how much the field departs from that of the rests so far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Departure {
    /// Its size, as a share.
    pub size: f64,
    /// The angle by which it points steeper, degrees; `None` in motion.
    pub steeper_deg: Option<f64>,
    /// The departure in multiples of what is tolerated, of the size and of the part along up.
    pub ratio: [f64; 2],
}

impl FieldSoFar {
    /// Of a recording with a magnetometer, whose gyro and accelerometer have the calibration `unit`. `None` until its poses are enough.
    ///
    /// # Errors
    /// The samples cannot be read.
    pub fn of(recording: &Recording, unit: &Fit) -> Result<Option<Self>> {
        let unit = Unit::fitted(unit);
        let models = PerSensor::from_fn(|sensor| Some(unit.triads[sensor].as_ref()?.inverse));
        let carrier = Carrier::read(recording, &models)?;
        let raw = read(recording, TriadName::MAG)?.without_repeats();
        let Some((motion, accel)) = carrier.motion().zip(models.accel) else {
            return Ok(None);
        };
        if raw.len() < FEWEST {
            return Ok(None);
        }
        let field = Field::of(&raw, motion, &unit.rests, (1.0, unit.rate_bias), None);
        let found = field.map(|field| (judge::determines(&field).is_ok(), field));
        let enough = |is: bool| if is { FEWEST_RESTS } else { MANY_RESTS };
        let found = found.filter(|(is, field)| field.rests >= enough(*is));
        Ok(found.map(|(is, field)| Self {
            is_determined: is,
            ..Self::by(&field, accel)
        }))
    }

    fn by(field: &Field, accel: Affine<f64>) -> Self {
        let solution = &field.relation.solution;
        // Few pieces of time give a covariance that is itself badly known.
        let wider = half_width_95([(1.0, solution.dof)].into_iter()) / 1.96;
        let own = solution.covariance.fixed_view::<12, 12>(0, 0);
        let levels = field.at_rest.each_ref().map(|errors| {
            let median = mimu_recording::units::median(errors.clone()).unwrap_or(f64::NAN);
            [median, scatter(errors.iter().map(|e| e - median))]
        });
        Self {
            calibration: field.relation.calibration(),
            covariance: own * wider.powi(2),
            accel,
            is_determined: true,
            // The error of the part along up is expected minus measured.
            along_up: -field.sine_of_dip() - levels[1][0],
            at_rest: levels,
        }
    }

    /// Scatter of the size of the field from rest to rest, as a share of it.
    pub fn scatter(&self) -> f64 {
        self.at_rest[0][1]
    }

    /// The departure of raw readings within a second; `force`: mean raw specific force, if the body rests. `None` without readings, and where the field is not determined.
    pub fn departure(
        &self,
        readings: &[[f64; 3]],
        force: Option<Vector3<f64>>,
    ) -> Option<Departure> {
        let each = || readings.iter().map(|u| Vector3::from(*u));
        let count = each().count() as f64;
        let sizes = each().map(|u| self.calibration.apply(&u).norm());
        let size = sizes.sum::<f64>() / count;
        let [size_at_rest, scatter] = self.at_rest[0];
        let off = size - 1.0 - size_at_rest;
        // Uncertain where the field has not pointed yet.
        let variance = |u: &Vector3<f64>, along: &Vector3<f64>| {
            let by = by_calibration(u).transpose() * along;
            (by.transpose() * self.covariance * by)[0]
        };
        let of_size = each().map(|u| variance(&u, &self.calibration.apply(&u).normalize()));
        let of_size = of_size.fold(0.0, f64::max);
        let tolerated = |scatter: f64, variance: f64| {
            LEAST.max(CONTRADICTED * (scatter * scatter + variance).sqrt())
        };
        let mut departure = Departure {
            size: off,
            steeper_deg: None,
            ratio: [off.abs() / tolerated(scatter, of_size), 0.0],
        };
        if let Some(up) = force.and_then(|raw| self.accel.apply(&raw).try_normalize(1.0)) {
            let mean = each().sum::<Vector3<f64>>() / count;
            let along = up.dot(&self.calibration.apply(&mean));
            let dip = |along: f64, size: f64| -(along / size).clamp(-1.0, 1.0).asin();
            let steeper = dip(along, size) - dip(self.along_up, 1.0 + size_at_rest);
            departure.steeper_deg = Some(steeper.to_degrees());
            let tolerated = tolerated(self.at_rest[1][1], variance(&mean, &up));
            departure.ratio[1] = (along - self.along_up).abs() / tolerated;
        }
        (count > 0.0 && self.is_determined).then_some(departure)
    }
}

impl Departure {
    /// The larger of its ratios: beyond 1 it is more than chance.
    pub fn worst(&self) -> f64 {
        self.ratio[0].max(self.ratio[1])
    }

    /// What a person should know, in a line.
    pub fn words(&self) -> String {
        let percent = |share: f64| format!("{:.0} %", 100.0 * share.abs());
        let is = match self.steeper_deg.filter(|_| self.ratio[1] > self.ratio[0]) {
            Some(deg) if deg > 0.0 => format!("points {deg:.0} degrees steeper"),
            Some(deg) => format!("points {:.0} degrees flatter", -deg),
            None if self.size > 0.0 => format!("is {} stronger", percent(self.size)),
            None => format!("is {} weaker", percent(self.size)),
        };
        format!("the field {is} here than in the poses before: move away from the desk")
    }
}
