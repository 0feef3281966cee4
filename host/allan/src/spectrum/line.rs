//! A spectral line, steady or wide.

/// What stands above the floor of a spectrum.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// Frequency, Hz; for a bump, that with half of its power below.
    pub frequency_hz: f64,
    /// Band that contains the middle half of its power, Hz; `None` for a steady sinusoid, which is narrower than the record resolves.
    pub width_hz: Option<f64>,
    /// Effective value, unit of the series; for a bump, within [`Line::band_hz`].
    pub rms: f64,
    /// Ends of its confidence interval.
    pub interval: [f64; 2],
    /// Highest density over that of the floor, at the resolution of [`Line::resolution_hz`].
    pub above_floor: f64,
    /// Noise bandwidth of the spectrum in which it was found, Hz: a finer one shows a steady line higher above the floor.
    pub resolution_hz: f64,
    /// Band within which it was removed, Hz.
    pub band_hz: [f64; 2],
}
