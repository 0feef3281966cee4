//! Errors of the reference in a fit with known inputs: what a table, a levelled face or the assumed gravity does wrong.
//!
//! Each stated error changes the true inputs of the dwells by a known pattern times an unknown number. As with a lever arm, its covariance is added to that
//! of the dwell means. Generalized least squares is then the joint estimate of parameters and errors: the data bound an error where its pattern is none
//! that parameters make (a tilt of the base under many poses), and where it is (the mounting, gravity), the intervals widen by all of it.

use nalgebra::{DMatrix, Matrix3, SVector, Vector3};
use serde::Serialize;

use crate::estimate::{Estimated, Observation, known_input};
use crate::prepared::Prepared;
use crate::quantity::Sensor;
use crate::signal::dwell::Dwell;
use crate::triad::{Covariance, Part, Triad, vector};
use mimu_recording::{Error, NORMAL_95, Reference, ReferenceError, Result};

/// What errs in the reference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, strum::IntoStaticStr)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum Cause {
    /// The assumed local gravity.
    Gravity,
    /// The rates of the table, all by one factor.
    Rate,
    /// The orientation of the unit on its mount.
    Mounting,
    /// The level of each pose or face.
    Level,
    /// The base of the table, off the vertical.
    Tilt,
    /// The right angles between the axes of the table.
    Orthogonality,
    /// The clock of the samples.
    Time,
}

impl Cause {
    /// In words.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// One unknown number of the reference: change of the true input of each dwell by one standard deviation of it, SI.
struct Source {
    cause: Cause,
    inputs: Vec<Vector3<f64>>,
}

/// What an error of the reference adds to the covariance of a triad.
#[derive(Debug, Clone, PartialEq)]
pub struct Influence {
    /// What errs.
    pub cause: Cause,
    /// Its part of the covariance of P by rows and b.
    pub covariance: Covariance,
}

/// The unknown numbers of the reference, for one sensor and its forward matrix, raw/SI.
pub(super) struct Influences {
    sources: Vec<Source>,
    forward: Matrix3<f64>,
}

impl Influences {
    /// `None` if nothing stated is seen by `sensor`.
    pub(super) fn of(
        prepared: &Prepared,
        sensor: Sensor,
        error: &ReferenceError,
        forward: Matrix3<f64>,
    ) -> Option<Self> {
        let sigma = error.standard();
        let dwells = &prepared.dwells.list;
        // A body that is not mounted as it should be senses the Earth turned too.
        let sensed = |i: usize| {
            let input = dwells[i].input(sensor).unwrap_or_else(Vector3::zeros);
            input + prepared.earth_rate(sensor, i, None).known
        };
        let mut sources = Vec::new();
        let mut push = |cause, sigma: f64, by: &dyn Fn(&Dwell, &Vector3<f64>) -> Vector3<f64>| {
            if sigma > 0.0 {
                let input = |(i, dwell): (usize, &Dwell)| match cause {
                    Cause::Rate => dwell.input(sensor).unwrap_or_else(Vector3::zeros) * sigma,
                    _ => by(dwell, &sensed(i)) * sigma,
                };
                let inputs = dwells.iter().enumerate().map(input).collect();
                sources.push(Source { cause, inputs });
            }
        };
        let is_accel = sensor == Sensor::Accel;
        if is_accel {
            push(Cause::Gravity, sigma.gravity_mps2, &|_, f| {
                f.try_normalize(1e-9).unwrap_or_else(Vector3::zeros)
            });
        } else {
            push(Cause::Rate, sigma.rate, &|_, rate| *rate);
        }
        for axis in 0..3 {
            let unit = Vector3::ith(axis, 1.0);
            let by = sigma.mounting_deg.to_radians();
            push(Cause::Mounting, by, &|_, x| unit.cross(x));
        }
        let right = sigma.orthogonality_deg.to_radians();
        push(Cause::Orthogonality, right, &|dwell, x| {
            inner_axis_off(dwell).cross(x)
        });
        if is_accel {
            for axis in 0..2 {
                let unit = Vector3::ith(axis, 1.0);
                let by = sigma.tilt_deg.to_radians();
                push(Cause::Tilt, by, &|dwell, x| match dwell.spins() {
                    // A turn about the vertical averages it.
                    true => Vector3::zeros(),
                    false => in_body(dwell, &unit).cross(x),
                });
            }
            let by = sigma.level_deg.to_radians();
            for dwell in 0..dwells.len() {
                for axis in 0..3 {
                    let unit = Vector3::ith(axis, 1.0);
                    let own = dwells[dwell].start_s;
                    push(Cause::Level, by, &|other, x| match other.start_s == own {
                        true => unit.cross(x),
                        false => Vector3::zeros(),
                    });
                }
            }
        } else {
            // The outer axis leans in the base, which turns with the body below it.
            push(Cause::Orthogonality, right, &|dwell, x| {
                in_body(dwell, &Vector3::y()).cross(x)
            });
        }
        (!sources.is_empty()).then_some(Self { sources, forward })
    }

    /// Covariance of the mean readings over the dwells, raw units squared, axis by axis.
    pub(super) fn covariance(&self) -> [DMatrix<f64>; 3] {
        let n = self.sources.first().map_or(0, |s| s.inputs.len());
        let mut all = [0; 3].map(|_| DMatrix::zeros(n, n));
        for source in &self.sources {
            for (axis, sum) in all.iter_mut().enumerate() {
                let readings = self.readings(source, axis);
                let seen: Vec<usize> = (0..n).filter(|i| readings[*i] != 0.0).collect();
                for &i in &seen {
                    for &j in &seen {
                        sum[(i, j)] += readings[i] * readings[j];
                    }
                }
            }
        }
        all
    }

    fn readings(&self, source: &Source, axis: usize) -> Vec<f64> {
        let row = self.forward.row(axis);
        source.inputs.iter().map(|x| (row * x)[0]).collect()
    }

    /// Separates what the errors of the reference add to the covariance of `estimated` from what noise adds, and adds what they do to several axes at
    /// once: least squares took the axes one by one. `shared` are the covariances of the means with those of the reference.
    pub(super) fn separate(
        &self,
        estimated: &mut Estimated,
        observations: &[Observation],
        shared: &[DMatrix<f64>; 3],
    ) -> Option<Vec<Influence>> {
        let gains: Vec<DMatrix<f64>> = (0..3)
            .map(|axis| {
                let extra = estimated.scatter.get(axis)?.1.extra_variance;
                known_input::gain(observations, axis, Some(shared), &self.forward, extra)
            })
            .collect::<Option<_>>()?;
        let mut influences: Vec<Influence> = Vec::new();
        for source in &self.sources {
            let mut by = SVector::<f64, 12>::zeros();
            for (axis, gain) in gains.iter().enumerate() {
                let readings = self.readings(source, axis);
                for (k, place) in [9 + axis, 3 * axis, 3 * axis + 1, 3 * axis + 2]
                    .into_iter()
                    .enumerate()
                {
                    let of = observations.iter().enumerate();
                    by[place] = of.map(|(i, o)| gain[(k, i)] * readings[o.dwell]).sum();
                }
            }
            let covariance = by * by.transpose();
            match influences.iter_mut().find(|i| i.cause == source.cause) {
                Some(known) => known.covariance += covariance,
                None => influences.push(Influence {
                    cause: source.cause,
                    covariance,
                }),
            }
        }
        let mut parts = estimated.triad.forward_parts.clone();
        for (axis, part) in parts.iter_mut().enumerate().take(3) {
            let places = [9 + axis, 3 * axis, 3 * axis + 1, 3 * axis + 2];
            let by_reference: Covariance = influences.iter().map(|i| i.covariance).sum();
            for a in places {
                for b in places {
                    part.covariance[(a, b)] -= by_reference[(a, b)];
                }
                // Rounding, where noise adds next to nothing.
                part.covariance[(a, a)] = part.covariance[(a, a)].max(0.0);
            }
        }
        parts.extend(influences.iter().map(|i| Part::known(i.covariance)));
        estimated.triad = Triad::from_forward(estimated.triad.forward, parts)?;
        Some(influences)
    }
}

/// Refuses errors of the reference that a fit cannot count, instead of making intervals that lack them.
///
/// # Errors
/// The keys that do not apply, and why.
pub(super) fn refuse_unused(prepared: &Prepared) -> Result<()> {
    let Some(stated) = &prepared.reference_error else {
        return Ok(());
    };
    let why = match prepared.manifest.reference {
        Reference::Table => return Ok(()),
        Reference::Gravity => {
            "by hand neither a pose nor a rate is taken as known: only gravity_mps2 applies"
        }
        Reference::TurntableRate => {
            "on a turntable only the magnitude of the rate is known, and [turntable] states its rate_error: only gravity_mps2 applies"
        }
    };
    let keys = stated.stated().map(|(key, ..)| key);
    let unused: Vec<&str> = keys.filter(|key| *key != "gravity_mps2").collect();
    match unused.is_empty() {
        true => Ok(()),
        false => Err(Error::new(
            format!("{}, errors of the reference", prepared.place),
            format!("this fit cannot count {}: {why}", unused.join(", ")),
            "leave them out of recording.toml or of the file, and know that no interval includes them",
        )),
    }
}

/// An accelerometer whose reference is the magnitude of gravity, and what the error of the assumed gravity adds to its covariance: every scale factor errs
/// by the same share, which no pose shows. `None` if no such error is stated.
pub(super) fn with_gravity(triad: &Triad, prepared: &Prepared) -> Option<(Triad, Influence)> {
    let sigma = prepared.reference_error.as_ref()?.standard().gravity_mps2;
    scaled(
        triad,
        Cause::Gravity,
        sigma / prepared.manifest.gravity_mps2,
    )
}

/// A gyro whose reference are angles between rests, and what the error of the clock adds: an angle is a rate times a time. `None` if the clock was compared
/// with no other. Known rates need no clock.
pub(super) fn with_clock(triad: &Triad, prepared: &Prepared) -> Option<(Triad, Influence)> {
    let clock = prepared.manifest.clock?;
    scaled(triad, Cause::Time, clock.half_width / NORMAL_95)
}

/// All scale factors err by one share, of this standard deviation.
fn scaled(triad: &Triad, cause: Cause, share: f64) -> Option<(Triad, Influence)> {
    let by = vector(&(triad.forward.matrix * share), &Vector3::zeros());
    let covariance = by * by.transpose();
    let mut parts = triad.forward_parts.clone();
    parts.push(Part::known(covariance));
    let triad = Triad::from_forward(triad.forward, parts).filter(|_| share > 0.0)?;
    Some((triad, Influence { cause, covariance }))
}

/// Angles of the table by the direction that is up, rad: tilt about the level axis, turn about the body's z axis. `None` without a force. The body is first
/// turned by `inner` about its z axis and then tilted by `middle` about the base's x axis, so up is (sin i sin m, cos i sin m, cos m) in the body.
fn angles(dwell: &Dwell) -> Option<[f64; 2]> {
    let up = dwell.input(Sensor::Accel)?.try_normalize(1e-9)?;
    let level = up.x.hypot(up.y);
    let inner = if level < 1e-6 { 0.0 } else { up.x.atan2(up.y) };
    Some([level.atan2(up.z), inner])
}

/// A direction of the base in the body.
fn in_body(dwell: &Dwell, base: &Vector3<f64>) -> Vector3<f64> {
    let Some([middle, inner]) = angles(dwell) else {
        return Vector3::zeros();
    };
    let (s, c) = middle.sin_cos();
    let tilted = Vector3::new(base.x, c * base.y + s * base.z, c * base.z - s * base.y);
    about_z(&tilted, inner)
}

/// The axis, in the body, about which the body leans if the inner axis is not at right angles with the middle one.
fn inner_axis_off(dwell: &Dwell) -> Vector3<f64> {
    angles(dwell).map_or_else(Vector3::zeros, |[_, inner]| about_z(&Vector3::y(), inner))
}

/// `x` in axes that are turned by `angle` about z.
fn about_z(x: &Vector3<f64>, angle: f64) -> Vector3<f64> {
    let (s, c) = angle.sin_cos();
    Vector3::new(c * x.x + s * x.y, c * x.y - s * x.x, x.z)
}
