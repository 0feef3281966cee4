//! How fast the clock of a recording runs by a better one. Every rate of a gyro, and so its scale factor, errs by their ratio.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// Difference that is reported. Crystals keep 0.01 %, ceramic resonators 0.5 %; an oscillator on the chip keeps 1 to 2 %.
pub const REPORTED_SHARE: f64 = 0.005;
/// Difference that no oscillator has, but a period written in another unit, or a rounded one.
pub const REFUSED_SHARE: f64 = 0.05;

/// Rate of a board's clock relative to the computer's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClockRate {
    /// The ratio: above 1 the board's clock is fast.
    pub factor: f64,
    /// Half-width of its 95 % interval.
    pub half_width: f64,
    /// Time over which they were compared, s.
    pub over_s: f64,
    /// Which of the two the times follow.
    pub times: Times,
}

/// The clock that times follow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Times {
    /// The board's; whoever reads them divides them by the ratio.
    Board,
    /// The computer's: they were divided by the ratio.
    Computer,
    /// The board's, because the user trusts it.
    Trusted,
}

impl ClockRate {
    /// The least difference from 1 that is certain.
    pub fn differs_by(&self) -> f64 {
        ((self.factor - 1.0).abs() - self.half_width).max(0.0)
    }

    /// Whether the user trusts a clock that errs, by the comparison, as an oscillator may. One that runs several times as fast is a replay.
    pub fn is_doubtful(&self) -> bool {
        let differs = self.differs_by();
        self.times == Times::Trusted && differs > REPORTED_SHARE && differs <= REFUSED_SHARE
    }

    /// `the clock of its samples runs 1.031 ± 0.002 times as fast as this computer's, over 62 s`.
    pub fn words(&self) -> String {
        // Two digits of the half-width decide the digits of both.
        let digits = (1.0 - self.half_width.log10().floor()).clamp(1.0, 7.0) as usize;
        format!(
            "the clock of its samples runs {:.digits$} ± {:.digits$} times as fast as the computer's, over {:.0} s",
            self.factor, self.half_width, self.over_s
        )
    }

    /// [`Self::words`], and what follows from it.
    pub fn described(&self) -> String {
        let times = match self.times {
            Times::Trusted => "it is trusted, else the gyro's scale factors err by that factor",
            Times::Board | Times::Computer => "all times are converted to the computer's",
        };
        format!("{}: {times}", self.words())
    }

    /// Refuses impossible values; `place` names them.
    ///
    /// # Errors
    /// The ratio or its interval is no positive number.
    pub fn check(&self, place: &str) -> Result<()> {
        let possible = |value: f64| value > 0.0 && value.is_finite();
        if possible(self.factor) && possible(self.half_width) {
            return Ok(());
        }
        let problem = format!(
            "{:?} ± {:?} cannot be a ratio of clocks",
            self.factor, self.half_width
        );
        Err(Error::new(
            place,
            problem,
            "write how many seconds the board's clock advances in one second, or remove the table",
        ))
    }
}
