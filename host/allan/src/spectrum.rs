//! Spectrum of a channel at rest: lines and bumps that are not noise of the sensor, and the band in which it is white.
//!
//! An Allan variance is the spectrum through a filter an octave wide: a building that sways at 0.56 Hz bends it over a decade of averaging
//! times, without showing the cause. In the spectrum the sway is a few frequencies of ten thousand.
//!
//! | module         | what                                                       |
//! |----------------|------------------------------------------------------------|
//! | `welch`        | averaged periodograms, two-sided densities                 |
//! | `floor`        | local floor of one, from the medians beside each frequency |
//! | `search`       | which frequencies stand above it, by more than chance      |
//! | `lines`        | their frequency, width and effective value                 |
//! | `white`        | N from the band in which the spectrum is flat              |

mod floor;
mod lines;
mod search;
mod welch;
mod white;

pub use self::lines::{Line, Lines};
pub use self::welch::density_in;
pub(crate) use self::welch::sum_over;
pub use self::white::White;
