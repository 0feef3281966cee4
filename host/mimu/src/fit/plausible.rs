//! Plausibility of a fit: errors that no interval shows, because the data agree with each other.
//!
//! Swapped columns, a wrong unit, one dwell with the wrong input: each leaves a trace, and each would otherwise end in a calibration file. What
//! cannot be right is refused; what may be intended gives a warning.

use super::of_temperature::with_temperature;
use super::off_level::off_level;
use super::sensor::{Residual, SensorFit};
use crate::estimate::Failure;
use crate::judging::known_size;
use crate::prepared::Prepared;
use crate::quantity::{Figure, Sensor, significant};
use crate::signal::unit_in_si::restless;
use crate::warning::Warning;
use mimu_recording::health::{Against, accel_gain, gyro_gain, not_counts};
use mimu_recording::{Error, RawUnit, Reference, Result};

/// If the error of a fit over the spread of its inputs exceeds this, the readings do not follow the inputs. Swapped sensors are beyond one; the worst
/// table is a hundred times below.
const FOLLOWS_NOTHING: f64 = 0.3;
/// A residual this many times the median, and the noise, is an outlier.
const OUTLIER: f64 = 10.0;
/// Fewer residuals have no meaningful median.
const OUTLIER_COUNT: usize = 6;
/// A residual below this share of the largest is rounding: its dwell alone determines a parameter, so the fit meets it exactly. It must not count in the
/// median: three such among six dwells made "2385361721304 times the median" of the others.
const EXACT: f64 = 1e-9;
/// So is one below this share of its noise, which three components have by chance once in 10⁹. Errors that dwells share, as that of the Earth's
/// rate, pull a dwell that determines a parameter alone by that much from zero.
const EXACT_BY_NOISE: f64 = 1e-3;
/// Axes rotated by more than this, degrees, are more than a careless mounting.
const TURNED_DEG: f64 = 20.0;

/// Refuses readings that a firmware assembled wrongly: their errors of 256 counts do not come from a sensor.
pub fn check_readings(prepared: &Prepared) -> Result<()> {
    let found = &prepared.condensed.signed_low_byte;
    let names: Vec<&str> = found.iter().filter_map(|found| found.about).collect();
    let Some(mut all) = found.first().copied() else {
        return Ok(());
    };
    all.about = None;
    all.rows.count = found.iter().map(|found| found.rows.count).sum();
    let refusal = all.refusal(&prepared.place);
    Err(refusal
        .map(|refused| refused.problem = format!("{}: {}", names.join(", "), refused.problem)))
}

/// Refuses or adds warnings to the fit of one sensor.
pub fn check(prepared: &Prepared, fit: &mut SensorFit) -> Result<()> {
    check_numbers(fit)?;
    let found = [
        refuse_unrelated(prepared, fit)?,
        outliers(prepared, fit),
        unit(prepared, fit),
        rests(fit),
        turned(prepared, fit),
        off_level(prepared, fit),
    ];
    fit.warnings.extend(found.into_iter().flatten());
    // The limits of the device come last, because the checks above name the cause.
    match fit.estimated.triad.inverse.check(None) {
        Ok(()) => Ok(()),
        Err(_) => {
            let seen = "the fit leads to a scale factor or a bias that no sensor has".to_string();
            Err(Failure::NoSolution(seen).into_error(fit.sensor))
        }
    }
}

/// Refuses a fit with a result that is not a number.
pub fn check_numbers(fit: &SensorFit) -> Result<()> {
    let triad = &fit.estimated.triad;
    let models = triad.inverse.matrix.iter().chain(&triad.inverse.offset);
    let numbers = models
        .chain(&triad.forward.matrix)
        .chain(&triad.forward.bias)
        .chain(&triad.inverse_covariance)
        .chain(&triad.forward_covariance);
    if numbers.into_iter().all(|x| x.is_finite()) && fit.rms().is_finite() {
        return Ok(());
    }
    let seen = "the fit leads to a value that is not a number".to_string();
    Err(Failure::NoSolution(seen).into_error(fit.sensor))
}

/// Size of the input, in the unit of the figure: root mean square of the known inputs about their mean; if these are unknown, the size of the
/// quantity that the figure describes.
pub fn input_size(prepared: &Prepared, fit: &SensorFit) -> f64 {
    if let Some(size) = known_size(prepared, fit.figure) {
        return size;
    }
    let dwell = |r: &Residual| prepared.dwells.list[r.dwell].input(fit.sensor);
    let means = fit.residuals.iter().filter(|r| !r.within);
    let inputs: Vec<_> = means.filter_map(dwell).collect();
    let n = inputs.len() as f64;
    let mean = inputs.iter().sum::<nalgebra::Vector3<f64>>() / n;
    let squares = inputs.iter().map(|x| (x - mean).norm_squared());
    let within = prepared.within_dwells(fit.sensor);
    let moved: f64 = within.iter().map(|o| o.input.norm_squared()).sum();
    ((squares.sum::<f64>() + moved) / (3.0 * n)).sqrt()
}

/// Refuses readings that do not follow their inputs. If they do with temperature in the model, they are fitted, with a warning.
fn refuse_unrelated(prepared: &Prepared, fit: &SensorFit) -> Result<Option<Warning>> {
    let spread = input_size(prepared, fit);
    let share = fit.rms() / spread;
    if share <= FOLLOWS_NOTHING {
        return Ok(None);
    }
    let percent = |share: f64| format!("{} %", significant(100.0 * share));
    let with = match fit.figure {
        Figure::Input => with_temperature(prepared, fit.sensor, &fit.residuals),
        Figure::GravityMagnitude | Figure::RateMagnitude | Figure::Direction => None,
    };
    if let Some(with) = with.filter(|w| w.rms / spread <= FOLLOWS_NOTHING) {
        let warning = Warning::FollowsTemperature {
            without: share,
            with: with.rms / spread,
            mean_c: with.mean_c,
        };
        return Ok(Some(warning.of(fit.sensor)));
    }
    let against = match fit.figure {
        Figure::Input => "the known inputs",
        Figure::GravityMagnitude => "the magnitude of gravity",
        Figure::RateMagnitude => "the magnitude of the rate",
        Figure::Direction => "the turns of gravity",
    };
    let how = match share < 1.0 {
        true => format!(": {:.0} % remains unexplained", 100.0 * share),
        false => " at all".to_string(),
    };
    let with = match with {
        Some(with) => format!(
            ", {} with temperature in the model",
            percent(with.rms / spread)
        ),
        None => String::new(),
    };
    let worst = match worst_first(fit).first() {
        Some(worst) => format!(", dwell {} the least", name(prepared, worst)),
        None => String::new(),
    };
    Err(Error::new(
        format!("{}, {}", prepared.place, fit.sensor),
        format!("the readings do not follow {against}{how}{with}{worst}"),
        "check that no columns are swapped and that every dwell has its own input",
    ))
}

fn worst_first(fit: &SensorFit) -> Vec<&Residual> {
    let mut all: Vec<&Residual> = fit.residuals.iter().collect();
    all.sort_by(|a, b| b.value.norm().total_cmp(&a.value.norm()));
    all
}

fn name(prepared: &Prepared, residual: &Residual) -> String {
    let step = prepared.dwells.list[residual.dwell].step;
    prepared.manifest.step_name(step)
}

fn outliers(prepared: &Prepared, fit: &SensorFit) -> Option<Warning> {
    let mut sorted = worst_first(fit);
    let rounding = EXACT * sorted.first()?.value.norm();
    sorted.retain(|r| {
        let size = r.value.norm();
        size > rounding && !(size < EXACT_BY_NOISE * r.floor)
    });
    if sorted.len() < OUTLIER_COUNT {
        return None;
    }
    let median = sorted[sorted.len() / 2].value.norm();
    let off = |r: &&&Residual| {
        let size = r.value.norm();
        // If the noise is not known, the median alone decides.
        size > OUTLIER * median && (r.floor.is_nan() || size > OUTLIER * r.floor)
    };
    let bad: Vec<_> = sorted.iter().filter(off).collect();
    let worst = bad.first()?;
    let names = bad.iter().map(|r| name(prepared, r)).collect();
    let (turns, largest) = (fit.figure == Figure::Direction, worst.value.norm());
    let unit = fit.figure.unit(fit.sensor);
    let warning = Warning::Outliers {
        turns,
        names,
        worst: largest,
        unit,
        times: largest / median,
    };
    Some(warning.of(fit.sensor))
}

/// Whether the readings of a sensor are fractions. The quantisation step shows it: a file with decimals has a step of less than 1, or none.
fn has_fractions(prepared: &Prepared, fit: &SensorFit) -> bool {
    let steps = &prepared.condensed.quantisation_step[fit.sensor.channels()];
    // A table of means has fractions of counts.
    let whole = |step: &Option<f64>| step.is_some_and(|s| s > 0.99);
    !prepared.manifest.means && !steps.iter().any(whole)
}

/// Warns about readings in SI whose scale factor is wrong, and about counts that are in SI.
fn unit(prepared: &Prepared, fit: &SensorFit) -> Option<Warning> {
    let matrix = &fit.estimated.triad.forward.matrix;
    let scale = matrix.row_iter().map(|r| r.norm()).sum::<f64>() / 3.0;
    let against = match fit.figure {
        Figure::Input => Against::Inputs,
        Figure::GravityMagnitude => Against::Gravity,
        Figure::RateMagnitude => Against::TurntableRate,
        Figure::Direction => Against::Turns,
    };
    let found = match (prepared.manifest.raw_unit, fit.sensor) {
        (RawUnit::Volt, _) => None,
        (RawUnit::Count, _) if !has_fractions(prepared, fit) => None,
        (RawUnit::Count, sensor) => not_counts(sensor.name(), scale),
        (RawUnit::Si, Sensor::Gyro) => gyro_gain(scale, against),
        (RawUnit::Si, Sensor::Accel) => accel_gain(scale, prepared.manifest.gravity_mps2),
    };
    found.map(Warning::Health)
}

/// Warns about rests in which the gyro turns.
fn rests(fit: &SensorFit) -> Option<Warning> {
    fit.static_rms.and_then(|(rms, _)| restless(rms))
}

/// Warns about axes that are rotated far from those of the reference.
fn turned(prepared: &Prepared, fit: &SensorFit) -> Option<Warning> {
    if fit.figure.is_magnitude() {
        return None; // its axes are the frame
    }
    let svd = fit.estimated.triad.inverse.matrix.svd(true, true);
    let rotation = svd.u? * svd.v_t?;
    let angle = (0.5 * (rotation.trace() - 1.0)).clamp(-1.0, 1.0).acos();
    // Left-handed axes have a separate warning.
    if rotation.determinant() < 0.0 || angle.to_degrees() < TURNED_DEG {
        return None;
    }
    let table = prepared.manifest.reference == Reference::Table;
    Some(
        Warning::Turned {
            angle,
            to_table: table,
        }
        .of(fit.sensor),
    )
}
