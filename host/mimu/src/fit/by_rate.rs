//! A gyro on a turntable in unknown orientations: only the magnitude of the rate is known.
//!
//! The turntable's force on an accelerometer beside the axis is unknown, so the accelerometer is fitted to gravity, from the dwells at rest.

use mimu_core::compensation::Affine;

use super::by_gravity::fit_gravity;
use super::judged::{InSample, Parts, Refit};
use super::sensor::SensorFit;
use super::{Options, finish};
use crate::estimate::magnitude::{self, KnownMagnitudes};
use crate::estimate::{Estimated, Failure, Observation};
use crate::judging::{Judging, Models};
use crate::observation::turn::Rest;
use crate::prepared::Prepared;
use crate::prior::TriadPrior;
use crate::quantity::Sensor;
use crate::signal::power_ons::PowerOns;
use crate::triad::vector;
use crate::turntable::{RatedDwells, variances};
use crate::warning::Warning;
use mimu_recording::error::{Error, Result};

pub(super) fn fit_rates(
    prepared: &Prepared,
    dwells: &RatedDwells,
    options: Options,
    warnings: &mut Vec<Warning>,
) -> Result<Vec<SensorFit>> {
    let mut sensors = Vec::new();
    if options.wants(Sensor::Gyro) {
        sensors.push(fit_gyro(prepared, dwells, options)?);
    }
    if prepared.has(Sensor::Accel) && options.wants(Sensor::Accel) {
        let alone = Options {
            only: Some(Sensor::Accel),
            ..options
        };
        match fit_gravity(prepared, alone, warnings) {
            Ok(accel) => sensors.extend(accel),
            Err(error) if sensors.is_empty() => return Err(error),
            // A turntable is there for the gyro, so the gyro's fit stays.
            Err(error) => warnings.push(
                Warning::NoRestsToFit {
                    why: error.refused().problem.clone(),
                }
                .of(Sensor::Accel),
            ),
        }
    }
    Ok(sensors)
}

fn fit_gyro(prepared: &Prepared, dwells: &RatedDwells, options: Options) -> Result<SensorFit> {
    if dwells.turning.is_empty() {
        let unused = prepared.dwells.unused(Sensor::Gyro);
        let error = Error::undetermined(
            format!("{}, gyro", prepared.place),
            format!("no dwell turns at a known rate{unused}"),
            "let the turntable run for ten seconds or more in each orientation, within the range of the gyro",
        );
        return Err(prepared.with_steps_as_given(error, Sensor::Gyro));
    }
    let prior = prepared.prior.as_ref().and_then(|p| p.triad(Sensor::Gyro));
    let prior = prior.as_ref();
    let estimate = |kept: &dyn Fn(usize) -> bool| estimate(dwells, prior, kept);
    let rates = |model: &Affine<f64>| -> Vec<f64> {
        let turning = dwells.turning.iter();
        turning.map(|o| model.apply(&o.raw).norm()).collect()
    };
    let gyro = match estimate(&|_| true) {
        Ok(gyro) => gyro,
        Err(failure) => {
            // A fit to a wrong rate need not converge.
            let known = known(dwells, None, &dwells.rate_of, &dwells.rests);
            if let Failure::NoSolution(_) = failure
                && let Some(rough) = magnitude::rough(&dwells.turning, &known)
            {
                dwells.refuse_other_rate(prepared, &rates(&rough))?;
            }
            return Err(prepared.refused(failure, Sensor::Gyro));
        }
    };
    let inverse = gyro.triad.inverse;
    dwells.refuse_other_rate(prepared, &rates(&inverse))?;
    let models = Models {
        gyro: Some(inverse),
        accel: None,
    };
    let count = options.holdout_blocks.min(dwells.turning.len());
    let parts = Parts::new(count, prepared.dwells.list.len());
    let with = |models: &Models| Judging::rated(prepared, dwells, models);
    let in_sample = InSample::of(prepared, Sensor::Gyro, &with, models, parts)?;
    let judged = in_sample.held_out(|split, part| {
        let refit = estimate(&|dwell| parts.of(split, dwell) != part)?.triad;
        // The error of the rates is common to kept and held-out dwells, so no refit is judged by it.
        let all = vector(&refit.inverse.matrix, &refit.inverse.offset);
        let refit = Refit::of_one(Sensor::Gyro, refit, all * dwells.rate_sigma);
        in_sample.errors.checked(refit, split, part)
    });
    let mut fit = finish(Sensor::Gyro, gyro, judged);
    let rates_dps = dwells.rates.iter().map(|r| r.to_degrees()).collect();
    let error = prepared
        .manifest
        .turntable
        .as_ref()
        .map_or(0.0, |t| t.rate_error);
    fit.warnings.push(
        Warning::RateError {
            rates_dps,
            share: error,
        }
        .of(Sensor::Gyro),
    );
    Ok(fit)
}

/// What is known of dwells with these rates, and of these rests.
fn known<'a>(
    dwells: &'a RatedDwells,
    prior: Option<&'a TriadPrior>,
    rate_of: &'a [usize],
    rests: &'a [Rest],
) -> KnownMagnitudes<'a> {
    KnownMagnitudes {
        power_ons: PowerOns::ONE,
        prior,
        sensor: Sensor::Gyro,
        levels: &dwells.rates,
        level_sigma: dwells.rate_sigma,
        level_of: rate_of,
        rests,
    }
}

/// The gyro by the `kept` dwells.
fn estimate(
    dwells: &RatedDwells,
    prior: Option<&TriadPrior>,
    kept: &dyn Fn(usize) -> bool,
) -> std::result::Result<Estimated, Failure> {
    let both = dwells.turning.iter().zip(&dwells.rate_of);
    let (turning, rate_of): (Vec<Observation>, Vec<usize>) = both
        .filter(|(o, _)| kept(o.dwell))
        .map(|(o, r)| (*o, *r))
        .unzip();
    let rests = dwells.rests.iter().filter(|r| kept(r.dwell));
    let rests: Vec<Rest> = rests.copied().collect();
    let known = known(dwells, prior, &rate_of, &rests);
    // Noise is in raw units; a sphere through the readings converts it to SI well enough.
    let sphere = magnitude::first_guess(&turning, dwells.rates[0]);
    let rough = sphere.map_or_else(|| vec![0.0; turning.len()], |s| variances(&s, &turning));
    let first = magnitude::estimate(&turning, &rough, &known)?;
    magnitude::estimate(&turning, &variances(&first.triad.inverse, &turning), &known)
}
