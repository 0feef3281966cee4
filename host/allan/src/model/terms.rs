//! The terms of the model and what was found of each.

use super::differences::{RAMP, TERMS};
use crate::Deviation;

/// Floor of a flicker noise over its coefficient, squared: `2 ln 2/π`.
pub const FLOOR: f64 = 2.0 * std::f64::consts::LN_2 / std::f64::consts::PI;

/// A coefficient that the curve shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coefficient {
    /// Estimate, in the unit of its [`Term`].
    pub value: f64,
    /// Standard deviation of the estimate. The interval is not symmetric: it is what to use.
    pub sigma: f64,
    /// Lower end of the confidence interval.
    pub lower: f64,
    /// Upper end.
    pub upper: f64,
}

/// A coefficient that the curve does not show.
#[derive(Debug, Clone, PartialEq)]
pub struct Unseen {
    /// Upper end of the confidence interval, in the unit of its [`Term`]; `None` if the curve gives none.
    pub at_most: Option<f64>,
    /// Why it is not shown.
    pub why: Reason,
}

/// Why a curve does not show a term.
#[derive(Debug, Clone, PartialEq)]
pub enum Reason {
    /// At short times the curve is below white noise, as behind a low-pass filter.
    Filtered,
    /// At short times the curve does not have the shape of any term, which would hide this one.
    Hidden,
    /// Models without the term fit the curve as well.
    Small {
        /// Terms that these have in its place; none if the term is simply small.
        instead: Vec<Term>,
        /// Additional length of the record that would show a term of half the upper end, s; `None` if a longer record does not help.
        longer_s: Option<f64>,
    },
    /// The curve is bent, and the spectrum, which gives a higher upper end, does not show the term either.
    NotInSpectrum,
}

/// Terms of the model, in the order of their powers of τ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Term {
    /// Quantization Q, unit·s (angle or velocity).
    Q,
    /// White noise N: angle or velocity random walk, unit·√s (unit/√Hz).
    N,
    /// Bias instability B, unit.
    B,
    /// Rate random walk K, unit/√s.
    K,
    /// Rate ramp R, unit/s.
    R,
}

impl Unseen {
    /// Raises an upper end that is below that of the spectrum.
    pub fn raise(&mut self, by_spectrum: f64) {
        if self.at_most.is_none_or(|bound| bound < by_spectrum) {
            self.at_most = Some(by_spectrum);
            self.why = Reason::NotInSpectrum;
        }
    }
}

impl Term {
    /// All of them, by powers of τ.
    pub const ALL: [Self; TERMS] = [Self::Q, Self::N, Self::B, Self::K, Self::R];

    /// Name of the coefficient.
    pub fn letter(self) -> &'static str {
        ["Q", "N", "B", "K", "R"][self as usize]
    }

    /// What it is.
    pub fn name(self) -> &'static str {
        [
            "quantization",
            "white noise",
            "bias instability",
            "rate random walk",
            "rate ramp",
        ][self as usize]
    }

    /// Deviation at `tau_s` of the term with coefficient 1.
    pub fn deviation(self, tau_s: f64) -> f64 {
        match self {
            Self::Q => 3f64.sqrt() / tau_s,
            Self::N => 1.0 / tau_s.sqrt(),
            Self::B => FLOOR.sqrt(),
            Self::K => (tau_s / 3.0).sqrt(),
            Self::R => tau_s / 2f64.sqrt(),
        }
    }

    /// Coefficient whose Allan variance at τ = m samples has the amplitude `a` in units of the sample period.
    pub(super) fn coefficient(self, a: f64, dt_s: f64) -> f64 {
        a.sqrt() / self.deviation(dt_s)
    }
}

/// The noise of one channel.
#[derive(Debug, Clone, PartialEq)]
pub struct NoiseModel {
    /// Coefficients by [`Term`].
    pub coefficients: [Result<Coefficient, Unseen>; TERMS],
    /// Whether the short end falls below white noise as behind a low-pass filter: of a first-order one with time constant T
    /// the variance is `N²/τ (1 - 3 T/(2 τ))` from a few T on.
    pub filtered: bool,
    /// Shortest and longest averaging time that it was fitted to, s.
    pub range_s: [f64; 2],
    /// Misfit over its expectation, if the terms do not describe the curve: the intervals are wider by its square root.
    pub excess: Option<f64>,
    /// Amplitudes of the terms, as in [`basis`].
    pub(super) amplitudes: [f64; TERMS],
    pub(super) dt_s: f64,
}

impl NoiseModel {
    /// The coefficient of `term`, or the reason why it is absent.
    pub fn get(&self, term: Term) -> Result<&Coefficient, &Unseen> {
        self.coefficients[term as usize].as_ref()
    }

    /// Upper end of the confidence interval of `term`, whether it is shown or not.
    pub fn at_most(&self, term: Term) -> Option<f64> {
        match &self.coefficients[term as usize] {
            Ok(shown) => Some(shown.upper),
            Err(unseen) => unseen.at_most,
        }
    }

    /// Allan deviation of the model at `tau_s`, unit of the channel. Below [`NoiseModel::range_s`] it may differ from the measurement.
    pub fn deviation(&self, tau_s: f64) -> f64 {
        let terms = Deviation::Allan.basis(tau_s / self.dt_s);
        let variance: f64 = terms.iter().zip(&self.amplitudes).map(|(b, a)| b * a).sum();
        variance.max(0.0).sqrt()
    }

    /// Shortest averaging time whose deviation is within 5 % of the best, s: a longer dwell gains little (fang, section 3, finds 20 s).
    ///
    /// The minimum itself is not used: about it the curve is flat, and without a random walk there is none. `None` if the deviation still
    /// decreases at the longest fitted time.
    pub fn useful_average_s(&self) -> Option<f64> {
        let [from, to] = self.range_s;
        let times = || {
            let steps = (200.0 * (to / from).log10()) as usize;
            (0..=steps).map(move |i| from * 10f64.powf(i as f64 / 200.0))
        };
        let inside = times()
            .map(|t| self.deviation(t))
            .fold(f64::INFINITY, f64::min);
        let rises = self.amplitudes[Term::K as usize] + self.amplitudes[RAMP] > 0.0;
        // Beyond the fitted times only a constant floor is certain.
        let least = match rises {
            true if inside < self.deviation(to) => inside,
            true => return None,
            false => self.amplitudes[Term::B as usize].sqrt(),
        };
        times().find(|t| self.deviation(*t) <= 1.05 * least)
    }
}
