//! Adds bias curves of a unit at rest to its calibration at one temperature. The curves come from the warm-up of an autopilot, for example;
//! scale factors and misalignments come from poses at room temperature.
//!
//! At rest the readings are `u(T) = P(T) x + b(T)` with an input x that is unknown and constant. If P is that of the calibration at all
//! temperatures, then `b(T) = b(T0) + u(T) - u(T0)`, and x is not needed: `o(T) = o(T0) - C (u(T) - u(T0))`. The effect of P's temperature
//! dependence on gravity in the recorded pose is counted as bias. In other poses this is wrong by up to twice the effect.

use mimu::calibration::{Calibration, reference_node};
use mimu::quantity::{PerSensor, Sensor};
use mimu::triad::{Covariance, Part, Triad};
use mimu_core::compensation::Affine;
use mimu_recording::error::{Argument, Error, Result};
use nalgebra::Matrix3;

use crate::curves::TriadCurves;
use crate::fit::{ThermalFit, range};
use crate::nodes::{Inverse, fewest, physical, with_lags};

/// The dies must have been this near to the temperature of the calibration, K.
const NEAR_C: f64 = 1.0;

/// Bias curves of one triad, and the model that they are added to.
struct Based<'a> {
    curves: &'a TriadCurves,
    model: Affine<f64>,
    sigma: [f64; 12],
    covariance: Covariance,
    at_c: f64,
}

impl Based<'_> {
    fn inverse(&self, temp_c: f64) -> Inverse {
        let Affine { matrix, offset } = self.model;
        let (change, covariance) = self.curves.bias_change(self.at_c, temp_c);
        let by_noise = (matrix * covariance * matrix.transpose()).diagonal();
        let mut sigma = self.sigma;
        for k in 0..3 {
            sigma[9 + k] = sigma[9 + k].hypot(by_noise[k].max(0.0).sqrt());
        }
        let [_, slope] = self.curves.forward(temp_c);
        Inverse {
            model: Affine {
                matrix,
                offset: offset - matrix * change,
            },
            slope: Affine {
                matrix: Matrix3::zeros(),
                offset: -(matrix * slope.bias),
            },
            sigma,
            physical: None,
        }
    }

    fn triad(&self, temp_c: f64) -> Option<Triad> {
        let matrix = self.model.matrix;
        let (_, added) = self.curves.bias_change(self.at_c, temp_c);
        let mut covariance = self.covariance;
        let mut of_offset = covariance.fixed_view_mut::<3, 3>(9, 9);
        of_offset += matrix * added * matrix.transpose();
        let part = Part::known(covariance);
        Triad::from_inverse(self.inverse(temp_c).model, vec![part])
    }
}

/// The calibration over temperature of a unit, from the bias curves `fit` at rest and the calibration `base` at one temperature; made at
/// `created` (RFC 3339).
///
/// # Errors
/// A base that is of another unit, of other readings, without a temperature or far from those of the recording, over temperature itself, or
/// with effects that follow the temperature; recordings that determine more than biases.
pub fn calibration(fit: &ThermalFit, base: &Calibration, created: &str) -> Result<Calibration> {
    let at_c = check(fit, base)?;
    let range_c = range(&fit.joint);
    let based = PerSensor::from_fn(|sensor| {
        let table = base.table(sensor)?;
        let mut sigma = [0.0; 12];
        let known = table.sigma_C.iter().flatten().flatten();
        let known = known.chain(table.sigma_o.iter().flatten());
        sigma.iter_mut().zip(known).for_each(|(s, k)| *s = *k);
        Some(Based {
            curves: fit.joint.curves[sensor].as_ref()?,
            model: base.inverse(sensor)?,
            sigma,
            covariance: base.covariance(sensor)?,
            at_c: at_c.clamp(range_c[0], range_c[1]),
        })
    });
    let of = |sensor: Sensor, temp_c: f64| {
        let based = based[sensor].as_ref()?;
        Some(Inverse {
            physical: based.triad(temp_c).as_ref().map(physical),
            ..based.inverse(temp_c)
        })
    };
    let nodes = fewest(of, based.as_ref().map(Option::is_some), range_c)?;
    let mut temperature = with_lags(&fit.joint, range_c, nodes);
    // The errors are raw. Cross terms of C, about a hundredth, are neglected.
    for (sensor, based) in based.present() {
        let own = based.model.matrix.diagonal();
        temperature.dies[sensor].hysteresis = fit.hysteresis(sensor, own.into());
    }
    let temps: Vec<f64> = temperature.nodes.iter().map(|n| n.temp_c).collect();
    let temp_c = reference_node(&temps).map_or(at_c, |k| temps[k]);
    let triads = based.as_ref().map(|b| b.as_ref()?.triad(temp_c));
    base.with_curves(temperature, temp_c, triads, fit.judgement(), created)
}

/// Refuses a base that the curves cannot be added to; returns its temperature, °C.
fn check(fit: &ThermalFit, base: &Calibration) -> Result<f64> {
    let first = &fit.sessions[0];
    let refuse = |problem: String, remedy: &str| {
        Err(Error::new("base", problem, remedy).about(Argument::Base))
    };
    if fit.joint.recorded().any(|c| !c.biases_only()) {
        let problem = "the recordings have known inputs, which determine all parameters".into();
        return refuse(problem, "leave the base out");
    }
    let alike = match (&base.unit_id, &first.unit_id) {
        (Some(a), Some(b)) => a.eq_ignore_ascii_case(b),
        _ => base.device == first.device,
    };
    if !alike {
        let problem = format!(
            "the calibration belongs to {:?}, but the recording to {:?}",
            base.device, first.device
        );
        return refuse(problem, "give the calibration of the same unit");
    }
    if base.recording.raw_unit != first.raw_unit {
        let problem = format!(
            "it is for readings in {}, but those of the recording are in {}",
            base.recording.raw_unit, first.raw_unit
        );
        return refuse(problem, "record both with the same raw unit");
    }
    if base.temperature.is_some() {
        let problem = "it contains curves over temperature already".into();
        return refuse(problem, "give the calibration at one temperature");
    }
    if !base.is_uncertain() {
        let problem = "it has no covariance, because it was read from a device".into();
        return refuse(problem, "give the file that was uploaded to the device");
    }
    let mut thermal = base.effects().iter().filter(|e| e.candidate.is_thermal());
    if let Some(effect) = thermal.next() {
        let problem = format!(
            "its effect {} depends on temperature, and so do the curves: the effect would be applied twice",
            effect.candidate.id()
        );
        return refuse(problem, "give a calibration without that effect");
    }
    if Sensor::BOTH
        .iter()
        .all(|s| base.table(*s).is_none() || fit.joint.curves[*s].is_none())
    {
        let problem = "it has none of the sensors of the recording".into();
        return refuse(problem, "give the calibration of the same unit");
    }
    let Some(at_c) = base.recording.temp_c else {
        let problem = "it does not give the temperature at which it is valid".into();
        let remedy =
            "make it from a recording with a temp_c column, or write recording.temp_c into it";
        return refuse(problem, remedy);
    };
    let [from, to] = range(&fit.joint);
    if at_c < from - NEAR_C || at_c > to + NEAR_C {
        let problem = format!(
            "it is valid at {at_c:.1} °C, but the dies were at {from:.1} to {to:.1} °C: the biases in between are unknown"
        );
        return refuse(
            problem,
            "make a recording that crosses the temperature of the calibration",
        );
    }
    Ok(at_c)
}
