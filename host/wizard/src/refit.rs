//! The calibration so far, with each parameter's uncertainty and target.

use std::sync::Arc;

use mimu::signal::stillness::STILL_FACTOR;
use mimu::{
    AXES, Angles, Estimate, Fit, Options, Prepared, Prior, STANDARD_GRAVITY, Sensor, SensorFit, fit,
};
use mimu_recording::{Batch, Manifest, Result};
use serde::Serialize;

use crate::procedure::{Missed, Targets};

/// A kind of parameter. The worst of the three axes counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, strum::IntoStaticStr)]
#[serde(rename_all = "lowercase")]
#[strum(serialize_all = "lowercase")]
pub enum Parameter {
    /// Biases.
    Bias,
    /// Scale factors.
    Scale,
    /// Angles of the axes.
    Angles,
}

impl Parameter {
    /// Name in JSON.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// Uncertainty and target of a parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Aim {
    /// The parameter.
    pub parameter: Parameter,
    /// The worst axis.
    pub axis: &'static str,
    /// Half-width of its 95 % interval.
    pub half_width: f64,
    /// Target of the half-width.
    pub target: f64,
    /// Unit of both.
    pub unit: &'static str,
}

/// Uncertainties and targets of a sensor.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Aims {
    /// The sensor.
    pub sensor: Sensor,
    /// Biases, scale factors and angles.
    pub aims: Vec<Aim>,
}

impl Aims {
    /// Whether all targets are met.
    pub fn met(&self) -> bool {
        self.aims.iter().all(|a| a.half_width <= a.target)
    }
}

/// State of the calibration after a dwell.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Progress {
    /// The sensors, as far as they are determined.
    pub sensors: Vec<Aims>,
    /// Why there is no calibration yet.
    pub not_yet: Option<String>,
}

impl Progress {
    /// Sensors that still miss a target.
    pub fn missed(&self) -> Missed {
        Sensor::BOTH.map(|sensor| {
            let found = self.sensors.iter().find(|s| s.sensor == sensor);
            found.is_none_or(|s| !s.met())
        })
    }
}

/// Fits the dwells so far, with the population of the unit's kind if it is known.
pub fn calibrate(manifest: &Manifest, samples: &Batch, prior: Option<&Prior>) -> Result<Fit> {
    let prepared = Prepared::of(manifest.clone(), samples, STILL_FACTOR)?;
    fit(of_population(prepared, prior)?, Options::IN_SAMPLE)
}

/// With this prior, if there is one.
pub fn of_population(prepared: Prepared, prior: Option<&Prior>) -> Result<Prepared> {
    match prior {
        Some(prior) => prepared.with_prior(Arc::new(prior.clone())),
        None => Ok(prepared),
    }
}

/// Uncertainty and target of each parameter.
pub fn progress(fitted: &Result<Fit>, targets: &Targets) -> Progress {
    match fitted {
        Ok(fitted) => Progress {
            sensors: fitted.sensors.iter().map(|s| aims(s, targets)).collect(),
            not_yet: None,
        },
        Err(error) => Progress {
            sensors: Vec::new(),
            not_yet: Some(error.to_string()),
        },
    }
}

fn aims(fitted: &SensorFit, targets: &Targets) -> Aims {
    let physical = fitted.estimated.triad.physical(Angles::Exact);
    let worst = |widths: [f64; 3]| {
        let all = widths.into_iter().zip(AXES);
        all.fold((0.0, AXES[0]), |a, b| {
            if b.0 > a.0 || b.0.is_nan() { b } else { a }
        })
    };
    let each =
        |of: [Estimate; 3], by: [f64; 3]| worst([0, 1, 2].map(|i| of[i].interval / by[i].abs()));
    let scale = physical.scale.map(|s| s.value);
    let (bias_unit, bias, angle, ratio) = match fitted.sensor {
        Sensor::Gyro => (
            ("deg/s", 1f64.to_degrees()),
            targets.gyro_bias_dps,
            targets.gyro_angle_urad,
            targets.gyro_scale_ppm,
        ),
        Sensor::Accel => (
            ("mg", 1e3 / STANDARD_GRAVITY),
            targets.accel_bias_mg,
            targets.accel_angle_urad,
            targets.accel_scale_ppm,
        ),
    };
    let aim = |parameter, (half_width, axis): (f64, &'static str), factor: f64, target, unit| Aim {
        parameter,
        axis,
        half_width: factor * half_width,
        target,
        unit,
    };
    let angles = [physical.misalignment, physical.non_orthogonality];
    let angles = angles.map(|a| each(a, [1.0; 3]));
    // If only gravity is known, only the turns determine the misalignment of a triad in the body frame: the triad whose frame defines the body has
    // none.
    let angles = if angles[1].0 > angles[0].0 {
        angles[1]
    } else {
        angles[0]
    };
    Aims {
        sensor: fitted.sensor,
        aims: vec![
            aim(
                Parameter::Bias,
                each(physical.bias, scale),
                bias_unit.1,
                bias,
                bias_unit.0,
            ),
            aim(
                Parameter::Scale,
                each(physical.scale, scale),
                1e6,
                ratio,
                "ppm",
            ),
            aim(Parameter::Angles, angles, 1e6, angle, "µrad"),
        ],
    }
}
