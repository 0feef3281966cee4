//! A gyro on a turntable in unknown orientations: only the magnitude of the rate is known.
//!
//! The turntable's force on an accelerometer beside the axis is unknown, so the accelerometer is fitted to gravity, from the dwells at rest.

use mimu_core::compensation::Affine;
use nalgebra::Vector3;

use super::by_gravity::fit_gravity;
use super::hold_out::{Refits, Split, determined};
use super::magnitudes::Magnitudes;
use super::sensor::{SensorFit, rms, typical};
use super::{Options, finish, uncalibrated};
use crate::estimate::magnitude::{self, KnownMagnitudes};
use crate::estimate::{Estimated, Failure, Observation};
use crate::factor::Factors;
use crate::observation::magnitude::Magnitude;
use crate::observation::turn::Rest;
use crate::prepared::{Prepared, si_covariance};
use crate::prior::TriadPrior;
use crate::quantity::{Figure, Sensor};
use crate::signal::power_ons::PowerOns;
use crate::triad::{Triad, vector};
use crate::turntable::RatedDwells;
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
    let rated = dwells.turning.iter().zip(dwells.magnitudes());
    let rated = Magnitudes(rated.collect());
    let floors = variances(&inverse, &dwells.turning).into_iter();
    let floors: Vec<f64> = floors
        .map(|v| prepared.if_noise_known(&[Sensor::Gyro], v.sqrt()))
        .collect();
    let mut residuals = rated.residuals(&gyro.triad, &floors);
    let typical = typical(Figure::RateMagnitude, &residuals);
    let parts = options.holdout_blocks.min(rated.0.len());
    let part_of = |split: Split, dwell: usize| split.part(dwell, prepared.dwells.list.len(), parts);
    // The error of the rates is common to kept and held-out dwells, so no refit is judged by it.
    let held_out = Refits::of(parts, |split, part| {
        let refit = estimate(&|dwell| part_of(split, dwell) != part)?;
        let scale = dwells.rate_sigma;
        let open = rated.of_part((split, part), &part_of).map(|(o, rate)| {
            let by = Magnitude::at(&inverse, &o.raw, rate).block.by(0);
            (refit.triad.variance(&by) - (scale * rate).powi(2)).max(0.0)
        });
        determined(open, typical, (Figure::RateMagnitude, Sensor::Gyro))?;
        Ok(refit)
    });
    let without = |dwell: usize| held_out.without(part_of(held_out.split, dwell));
    rated.hold_out(&mut residuals, &held_out, &part_of);
    let at_rest = |rate: &dyn Fn(&Rest) -> Option<Vector3<f64>>| {
        let all: Vec<Vector3<f64>> = dwells.rests.iter().filter_map(rate).collect();
        (!all.is_empty()).then(|| rms(Figure::Input, all.into_iter()))
    };
    let static_rms = at_rest(&|r| Some(inverse.apply(&r.raw)));
    let static_held_out = at_rest(&|r| Some(without(r.dwell)?.triad.inverse.apply(&r.raw)));
    let beside_the_rates = |triad: &Triad| {
        let common = vector(&triad.inverse.matrix, &triad.inverse.offset) * dwells.rate_sigma;
        triad.known_covariance() - common * common.transpose()
    };
    let unseen = rated.unseen(&held_out, &part_of, beside_the_rates, variances);
    let mut fit = finish(
        Sensor::Gyro,
        gyro,
        Figure::RateMagnitude,
        residuals,
        dwells.turning.len() + dwells.rests.len(),
        static_rms.map(|r| (r, static_held_out)),
        (held_out.into(), &unseen),
    );
    fit.uncalibrated_rms = uncalibrated::magnitudes(prepared, Figure::RateMagnitude, &rated.0);
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

/// Variances of the compensated magnitudes by noise, (rad/s)²; zero if the noise is unknown.
pub(crate) fn variances(inverse: &Affine<f64>, observations: &[Observation]) -> Vec<f64> {
    let along = |o: &Observation| {
        let up = inverse.apply(&o.raw).normalize();
        up.dot(&(si_covariance(&inverse.matrix, &o.variance) * up))
    };
    observations.iter().map(along).collect()
}

/// The magnitudes of the turning dwells, with their noise by the `gyro`.
pub(crate) fn magnitudes(dwells: &RatedDwells, gyro: &Affine<f64>) -> Factors<'static> {
    let mut factors = Factors::default();
    let known = dwells.turning.iter().zip(dwells.magnitudes());
    for ((o, rate), variance) in known.zip(variances(gyro, &dwells.turning)) {
        factors.magnitude(Sensor::Gyro, (o.dwell, o.raw), (rate, None), variance);
    }
    factors
}
