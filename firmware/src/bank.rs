//! A Kalman bank of `core` with its known input, fed from the stream.

use mimu_core::Sensor;
use mimu_core::kalman::{self, Filter};
use mimu_core::single;
use mimu_core::wire::{KalmanAxis, KalmanState, Prior};
use nalgebra::Vector3;

/// Samples between two reports of a state: five a second.
const REPORT: u32 = 200;

/// A running bank.
#[derive(Clone, Copy, Debug)]
pub struct Bank {
    sensor: Sensor,
    noise: Vector3<f32>,
    filters: kalman::Bank<f32>,
    /// Saved filters and number of updates.
    kept: (kalman::Bank<f32>, u32),
    input: Option<Vector3<f32>>,
    last: u32,
    updates: u32,
    rejected: u32,
    skipped: u32,
    until_report: u32,
}

impl Bank {
    /// A bank with the host's settings; `None` if a number is not finite or a variance not positive.
    pub fn new(sensor: Sensor, noise: [f32; 3], prior: Prior) -> Option<Self> {
        let positive = |v: &f32| *v > 0.0 && v.is_finite();
        let noise_is = noise.iter().all(positive);
        let noise = Vector3::from(noise);
        let filters = match prior {
            Prior::Diffuse { span } => {
                positive(&span).then(|| kalman::Bank::diffuse(&noise, span))?
            }
            Prior::Known { mean, variance } => {
                let finite = mean.as_flattened().iter().all(|v| v.is_finite())
                    && variance.as_flattened().iter().all(positive);
                let [x, y, z] = mean;
                let [vx, vy, vz] = variance;
                finite.then(|| kalman::Bank {
                    axes: [(x, vx), (y, vy), (z, vz)].map(|(m, v)| Filter::with_prior(m, v)),
                })?
            }
        };
        noise_is.then_some(Self {
            sensor,
            noise,
            kept: (filters, 0),
            filters,
            input: None,
            last: 0,
            updates: 0,
            rejected: 0,
            skipped: 0,
            until_report: REPORT,
        })
    }

    /// Sets the triad's input from the next sample on. If it is not finite, returns `false` and changes nothing.
    pub fn set_input(&mut self, input: Option<[f32; 3]>) -> bool {
        let finite = input.iter().flatten().all(|v| v.is_finite());
        if finite {
            self.input = input.map(Vector3::from);
        }
        finite
    }

    /// Saves the state.
    pub fn keep(&mut self) {
        self.kept = (self.filters, self.updates);
    }

    /// Restores the saved state; uses no sample before the input is set.
    pub fn back(&mut self) {
        (self.filters, self.updates) = self.kept;
        self.input = None;
    }

    /// Counts lost samples.
    pub fn skip(&mut self, samples: u32) {
        self.skipped = self.skipped.wrapping_add(samples);
    }

    /// Processes a sample, V; returns whether a report is due.
    pub fn offer(&mut self, number: u32, raw: &Vector3<f32>) -> bool {
        self.last = number;
        match &self.input {
            None => self.skipped = self.skipped.wrapping_add(1),
            Some(input) => match single::update(&mut self.filters, input, raw, &self.noise) {
                Ok(()) => self.updates = self.updates.wrapping_add(1),
                Err(_) => self.rejected = self.rejected.wrapping_add(1),
            },
        }
        self.until_report -= 1;
        let due = self.until_report == 0;
        if due {
            self.until_report = REPORT;
        }
        due
    }

    /// Its present state.
    pub fn state(&self) -> KalmanState {
        KalmanState {
            sensor: self.sensor,
            last: self.last,
            updates: self.updates,
            rejected: self.rejected,
            skipped: self.skipped,
            axes: self.filters.axes.map(|filter| {
                let p = filter.covariance();
                KalmanAxis {
                    mean: filter.mean().into(),
                    covariance: [
                        p.m11, p.m12, p.m13, p.m14, p.m22, p.m23, p.m24, p.m33, p.m34, p.m44,
                    ],
                }
            }),
        }
    }
}
