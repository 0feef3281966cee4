//! The delay of a unit's accelerometer against its gyro.
//!
//! No rest shows it, and in motion the specific force is not known. But between two rests the velocity changes by nothing, whatever the hand does: with the attitude R by
//! the gyro from the first rest on, `∫ R(t) a(t) dt = g T`. An accelerometer that is late by τ reads `a(t - τ)`, so that `∫ R(t - τ) a dt` is what equals `g T`, and a
//! turn by φ in which this is not heeded leaves a velocity of about `τ φ × g`: 15 mm/s for a quarter of a turn and 1 ms. What limits it are errors of the turn (0.1 deg over 2 s: 17 mm/s)
//! and of the accelerometer (1 mg over 2 s: 20 mm/s): about a millisecond a turn, and some tenths in two dozen. On the bench, with a calibration that is known, these give 12.02 ± 0.12 ms
//! where 12 are true.

use mimu::Sensor;
use mimu::fit::Fit;
use mimu::judgement::Judgement;
use mimu::quantity::PerSensor;
use mimu::triad::{Estimate, half_width_95};
use mimu_recording::Recording;
use mimu_recording::error::Result;
use nalgebra::Vector3;

use crate::carrier::{Carrier, Rest, Unit};
use crate::series::{Motion, Series};

/// Longest turn, s: errors of a longer one outweigh what it shows.
const LONGEST_S: f64 = 8.0;
/// Fewest turns.
const FEWEST: usize = 8;
/// Step of the derivative by the delay, s.
const STEP_S: f64 = 1e-3;
/// A delay is there beyond so many times its interval: one in ten thousand units without one would have it.
const THERE: f64 = 2.0;
/// Gauss-Newton steps: the third changes a delay of 20 ms by less than a microsecond.
const STEPS: usize = 5;
/// A turn whose velocity is off by this many times the median of all is left out.
const CONTRADICTED: f64 = 5.0;

/// By how much the accelerometer's readings are later than the gyro's, ms, by the turns between the rests of `fit`. `None` if they show none or are too few, if one of the two
/// is not calibrated, or if the fit is not `good`: a delay would follow a bias that drifts, by 6 ms where 20 mm/s² drifted.
///
/// # Errors
/// The samples cannot be read.
pub fn accel_delay_ms(recording: &Recording, fit: &Fit) -> Result<Option<Estimate>> {
    if !Judgement::of_fit(fit).is_good() {
        return Ok(None);
    }
    let unit = Unit::fitted(fit);
    let models = PerSensor::from_fn(|sensor| Some(unit.triads[sensor].as_ref()?.inverse));
    let carrier = Carrier::read(recording, &models)?;
    let both = carrier.motion().zip(carrier.reference(Sensor::Accel));
    let found = both.and_then(|(motion, accel)| delay_ms(motion, accel.series, &unit.rests));
    Ok(found.filter(|delay| delay.value.abs() > THERE * delay.interval))
}

fn delay_ms(motion: &Motion, force: &Series, rests: &[Rest]) -> Option<Estimate> {
    let turns: Vec<Turn> = rests
        .windows(2)
        .filter_map(|of| Turn::of(force, of))
        .collect();
    let mut delay_s = 0.0;
    let mut velocities = Vec::new();
    for _ in 0..STEPS {
        let of = |turn: &Turn| {
            let at = |by: f64| turn.velocity(motion, force, delay_s + by);
            Some((at(0.0)?, (at(STEP_S)? - at(-STEP_S)?) / (2.0 * STEP_S)))
        };
        velocities = kept(turns.iter().filter_map(of).collect());
        delay_s -= solved(velocities.iter())?;
    }
    if velocities.len() < FEWEST {
        return None;
    }
    // The jackknife over the turns; at the solution the step of all is nearly zero.
    let n = velocities.len() as f64;
    let without = |k: usize| {
        let others = velocities
            .iter()
            .enumerate()
            .filter(move |(other, _)| *other != k);
        solved(others.map(|(_, of)| of))
    };
    let moved: Vec<f64> = (0..velocities.len()).map(without).collect::<Option<_>>()?;
    let variance = moved.iter().map(|x| x * x).sum::<f64>() * (n - 1.0) / n;
    Some(Estimate {
        value: 1e3 * delay_s,
        sigma: 1e3 * variance.sqrt(),
        interval: 1e3 * half_width_95([(variance, n - 1.0)].into_iter()),
    })
}

/// Velocity that remains after a turn, and its derivative by the delay.
type Velocity = (Vector3<f64>, Vector3<f64>);

/// The delay by which the velocities become least.
fn solved<'a>(of: impl Iterator<Item = &'a Velocity>) -> Option<f64> {
    let [sum, weight] = of.fold([0.0; 2], |[sum, weight], (v, by)| {
        [sum + by.dot(v), weight + by.norm_squared()]
    });
    (weight > 0.0).then(|| sum / weight)
}

/// Without the turns that the others contradict: a blow, or a rest on something that moves.
fn kept(mut all: Vec<Velocity>) -> Vec<Velocity> {
    let Some(step) = solved(all.iter()) else {
        return all;
    };
    let off = |(v, by): &Velocity| (v - by * step).norm();
    let median = mimu_recording::units::median(all.iter().map(off).collect());
    all.retain(|of| off(of) <= CONTRADICTED * median.unwrap_or(f64::NAN));
    all
}

/// What lies between two rests: its times, s, and the specific force at rest before and after, in the body.
struct Turn {
    span: [f64; 2],
    at_rest: [Vector3<f64>; 2],
}

impl Turn {
    fn of(force: &Series, rests: &[Rest]) -> Option<Self> {
        let span = [rests[0].to_s, rests[1].from_s];
        let mean = |rest: &Rest| {
            let own = force.within(rest.span());
            let sum: Vector3<f64> = own.clone().map(|k| force.x[k]).sum();
            (!own.is_empty()).then(|| sum / own.len() as f64)
        };
        let at_rest = [mean(&rests[0])?, mean(&rests[1])?];
        (span[1] - span[0] < LONGEST_S).then_some(Self { span, at_rest })
    }

    /// The change of velocity by an accelerometer that is so late, in the frame of the rest before. Gravity is the mean of what the two rests read: an attitude that drifts by the
    /// turn's error at a constant rate then adds nothing.
    fn velocity(&self, motion: &Motion, force: &Series, delay_s: f64) -> Option<Vector3<f64>> {
        let from = self.span[0] - delay_s;
        let level = |t: f64, x: &Vector3<f64>| Some(motion.turn(from, t - delay_s)?.inverse() * x);
        let gravity = 0.5 * (self.at_rest[0] + level(self.span[1], &self.at_rest[1])?);
        let mut sum = Vector3::zeros();
        let mut last: Option<(usize, Vector3<f64>)> = None;
        for k in force.within(self.span) {
            let now = level(force.t[k], &force.x[k])? - gravity;
            if let Some((before, then)) = last {
                if force.is_broken(before, k) {
                    return None;
                }
                sum += 0.5 * (force.t[k] - force.t[before]) * (then + now);
            }
            last = Some((k, now));
        }
        last.map(|_| sum)
    }
}
