//! Errors of a further triad over windows of time.

/// Rms errors over windows.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Errors {
    /// In sample.
    pub rms: f64,
    /// In pieces of time that a fit has not used.
    pub held_out_rms: f64,
    /// By white noise alone.
    pub noise_floor: f64,
    /// Number of windows.
    pub windows: usize,
}

impl Errors {
    /// Of the mean squares of windows, where white noise has this variance; held out is as in sample. `None` without windows.
    pub fn of(squares: &[f64], noise: f64) -> Option<Self> {
        let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        (!squares.is_empty()).then(|| Self {
            rms,
            held_out_rms: rms,
            noise_floor: noise.sqrt(),
            windows: squares.len(),
        })
    }
}
