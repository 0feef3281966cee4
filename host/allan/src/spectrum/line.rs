//! A spectral line, steady or wide.

/// What stands above the floor of a spectrum.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// Frequency, Hz: of a bump, that with half of its power below.
    pub frequency_hz: f64,
    /// Band that holds the middle half of its power, Hz; `None` for a steady sinusoid, which is narrower than the record can tell.
    pub width_hz: Option<f64>,
    /// Effective value, unit of the series; of a bump, within [`Line::band_hz`].
    pub rms: f64,
    /// Ends of the confidence interval of it.
    pub interval: [f64; 2],
    /// Highest density over that of the floor, at the resolution of [`Line::resolution_hz`].
    pub above_floor: f64,
    /// Noise bandwidth of the spectrum that it was found in, Hz: a steady line stands the higher the finer it is.
    pub resolution_hz: f64,
    /// Band within which it was set aside, Hz.
    pub band_hz: [f64; 2],
}
