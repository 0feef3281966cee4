//! What a smoother over the segments of a session knows.

use nalgebra::DVector;

/// The state by all segments, at the time of each.
#[derive(Debug, Clone)]
pub(super) struct Smoothed {
    /// In order of time.
    pub each: Vec<SmoothedState>,
}

/// The state at an instant.
#[derive(Debug, Clone)]
pub(super) struct SmoothedState {
    pub at_s: f64,
    /// Of all states of a session; 0 for those that the model lacks.
    pub value: DVector<f64>,
    /// Their standard deviations.
    pub sigma: DVector<f64>,
}

impl SmoothedState {
    /// Element `state`; 0 if the model lacks it.
    pub fn value(&self, state: usize) -> f64 {
        self.value[state]
    }

    /// Its standard deviation; 0 if the model lacks it.
    pub fn sigma(&self, state: usize) -> f64 {
        self.sigma[state]
    }
}

impl Smoothed {
    /// The state in the middle of the session.
    pub fn middle(&self) -> &SmoothedState {
        &self.each[self.each.len() / 2]
    }
}
