//! Variance of a mean of noise with three terms.

/// Allan variance of one raw channel as `N²/τ + B² + K² τ`: white noise, bias instability and rate
/// random walk, each at least zero.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct AllanModel {
    /// N², raw units squared times s.
    pub white: f64,
    /// Level of the flicker floor, raw units squared (that is (0.664 B)²).
    pub flicker: f64,
    /// K²/3, raw units squared per s.
    pub walk: f64,
}

impl AllanModel {
    /// Variance of the mean over `tau_s`, raw units squared.
    pub fn variance(&self, tau_s: f64) -> f64 {
        self.white / tau_s + self.flicker + self.walk * tau_s
    }
}
