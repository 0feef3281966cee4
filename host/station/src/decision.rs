//! The decision about a measured value near its limit.
//!
//! JCGM 106:2012 names two rules. By *simple acceptance* (8.2) a value within the limits passes: of units at a limit half pass. By *guarded acceptance*
//! (8.3.2) the value has to be `k` standard uncertainties within the limits, as a producer proves conformity by ISO 14253-1: with `k` = 2 a unit at a limit
//! passes in 2.3 %.

use serde::{Deserialize, Serialize};

/// Which values pass.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Rule {
    /// Those that are `k` standard uncertainties within the limits.
    #[default]
    Guarded,
    /// Those within the limits.
    Simple,
}

/// A rule with its guard band.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Decision {
    /// Which values pass.
    pub rule: Rule,
    /// Width of the guard band, standard uncertainties; 0 for simple acceptance.
    pub k: f64,
}

impl Default for Decision {
    fn default() -> Self {
        Self {
            rule: Rule::Guarded,
            k: 2.0,
        }
    }
}

impl Decision {
    /// Simple acceptance.
    pub const SIMPLE: Self = Self {
        rule: Rule::Simple,
        k: 0.0,
    };

    /// Whether a `value` with the standard uncertainty `sigma` passes. A value that is not a number does not.
    pub fn passes(&self, value: f64, sigma: f64, lower: Option<f64>, upper: Option<f64>) -> bool {
        let guard = self.k * sigma;
        lower.is_none_or(|lower| value - guard >= lower)
            && upper.is_none_or(|upper| value + guard <= upper)
            && value.is_finite()
    }

    /// In words, with the standard.
    pub fn words(&self) -> String {
        match self.rule {
            Rule::Guarded => format!(
                "guarded acceptance (JCGM 106, 8.3.2): a value passes {} standard uncertainties within its limits",
                self.k
            ),
            Rule::Simple => {
                "simple acceptance (JCGM 106, 8.2): a value passes within its limits".into()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_guard_band_lies_within_both_limits() {
        let (guarded, simple) = (Decision::default(), Decision::SIMPLE);
        for (value, by_guarded, by_simple) in [
            (0.0, true, true),
            (0.79, true, true),
            (0.81, false, true),
            (-0.9, false, true),
            (1.01, false, false),
            (f64::NAN, false, false),
        ] {
            let limits = (Some(-1.0), Some(1.0));
            assert_eq!(guarded.passes(value, 0.1, limits.0, limits.1), by_guarded);
            assert_eq!(simple.passes(value, 0.1, limits.0, limits.1), by_simple);
        }
        assert!(guarded.passes(-50.0, 0.1, None, Some(1.0)));
    }
}
