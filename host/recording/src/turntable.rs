//! A turntable with known rates and an unknown axis: a record player, with the unit on it in any orientation.

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::cell::shorten;
use crate::error::{Argument, Error, Result};

/// Largest rate, deg/s: gyros of this kind end at 4000 deg/s.
const LARGEST_DPS: f64 = 1e4;
/// Largest error of a rate, as a share of it: with a larger error the rate counts as unknown.
const LARGEST_ERROR: f64 = 0.2;
/// Two rates that differ by less than this share of the larger one are refused: a recording does not distinguish them.
const ALIKE: f64 = 0.05;

/// Rates of a turntable with known magnitude.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Turntable {
    /// Magnitudes of the rates at which it turned, deg/s.
    pub rates_dps: Vec<f64>,
    /// Half of a 95 % interval of each rate, as a share of it. All dwells at one rate have the same error.
    pub rate_error: f64,
    /// Rate in a step, by its number or label, deg/s; 0 is rest. In the other steps the readings show which of the rates it was.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub step_rates_dps: BTreeMap<String, f64>,
}

/// A rate of a turntable, deg/s, as a person gives it: `200`, or that of a step, `edge=270`.
#[derive(Debug, Clone, PartialEq)]
pub struct TurntableRate {
    /// Number or label of the step; `None`: a rate of the turntable.
    pub step: Option<String>,
    /// Magnitude, deg/s; 0 is rest.
    pub dps: f64,
}

impl FromStr for TurntableRate {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let (step, number) = match text.rsplit_once('=') {
            Some((step, number)) => (Some(step.trim().to_owned()), number),
            None => (None, text),
        };
        let remedy = "write deg/s (200 for 33 1/3 rpm, 270 for 45 rpm), or STEP=RATE";
        let wrong = |what: &str| {
            Error::new(
                "rate",
                format!("{} {what}", shorten(text.as_bytes())),
                remedy,
            )
        };
        let dps: f64 = number.trim().parse().map_err(|_| wrong("is not a rate"))?;
        let at_rest = dps == 0.0 && step.is_some();
        if !(at_rest || (dps > 0.0 && dps <= LARGEST_DPS)) || step.as_deref() == Some("") {
            return Err(wrong("is not a rate of a turntable"));
        }
        Ok(Self { step, dps })
    }
}

impl fmt::Display for TurntableRate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.step {
            Some(step) => write!(f, "{step}={}", self.dps),
            None => write!(f, "{}", self.dps),
        }
    }
}

impl Turntable {
    /// The turntable with these rates, each known to within the share `rate_error` (95 %).
    pub fn new(rates: &[TurntableRate], rate_error: f64) -> Self {
        let mut rates_dps: Vec<f64> = rates.iter().map(|r| r.dps).filter(|r| *r > 0.0).collect();
        rates_dps.sort_by(f64::total_cmp);
        rates_dps.dedup();
        let of_steps = rates.iter().filter_map(|r| Some((r.step.clone()?, r.dps)));
        Self {
            rates_dps,
            rate_error,
            step_rates_dps: of_steps.collect(),
        }
    }

    /// Checks the values; `place` names where they are, by key.
    pub(crate) fn check(&self, place: impl Fn(&str) -> String) -> Result<()> {
        let refuse = |key: &str, problem: String, remedy: &str| {
            Err(Error::new(place(key), problem, remedy).about(Argument::TurntableRates))
        };
        let possible = |r: &f64| *r > 0.0 && *r <= LARGEST_DPS;
        if self.rates_dps.is_empty() {
            let remedy = "give it in deg/s: 200 for 33 1/3 rpm, 270 for 45 rpm";
            return refuse(
                "rates_dps",
                "the rate of the turntable is missing".into(),
                remedy,
            );
        }
        if let Some(wrong) = self.rates_dps.iter().find(|r| !possible(r)) {
            let remedy = "write deg/s without a sign (200 for 33 1/3 rpm)";
            return refuse(
                "rates_dps",
                format!("{wrong} is not a rate of a turntable"),
                remedy,
            );
        }
        let mut sorted = self.rates_dps.clone();
        sorted.sort_by(f64::total_cmp);
        if let Some(pair) = sorted.windows(2).find(|w| w[1] - w[0] < ALIKE * w[1]) {
            let problem = format!(
                "{} and {} deg/s are too close to be distinguished",
                pair[0], pair[1]
            );
            return refuse(
                "rates_dps",
                problem,
                "give rates that differ by at least 5 %",
            );
        }
        let known = |r: &f64| *r == 0.0 || self.rates_dps.contains(r);
        if let Some((step, rate)) = self.step_rates_dps.iter().find(|(_, r)| !known(r)) {
            let problem = format!("the rate of dwell {step}, {rate} deg/s, is not among rates_dps");
            return refuse("step_rates_dps", problem, "add it to rates_dps");
        }
        if !(0.0..=LARGEST_ERROR).contains(&self.rate_error) {
            let problem = format!(
                "{} % cannot be the error of a known rate",
                100.0 * self.rate_error
            );
            let remedy = "write the half of a 95 % interval, in % of the rate, from 0 to 20";
            return Err(Error::new(place("rate_error"), problem, remedy)
                .about(Argument::TurntableRateError));
        }
        Ok(())
    }
}

/// Error of a turntable's rates, in per cent: `0.1%`; as a share.
pub fn rate_error(text: &str) -> Result<f64> {
    let number = text.strip_suffix('%').map(str::trim);
    let percent = number.and_then(|n| n.parse::<f64>().ok());
    percent.map(|p| 0.01 * p).ok_or_else(|| {
        Error::new(
            "rate error",
            format!("{} is not a percentage", shorten(text.as_bytes())),
            "write per cent, like 0.1%",
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rates(text: &str) -> Vec<TurntableRate> {
        text.split(',').map(|r| r.parse().unwrap()).collect()
    }

    #[test]
    fn rates_of_the_turntable_and_of_steps_come_from_one_list() {
        let turntable = Turntable::new(&rates("270,flat=200,rest=0"), rate_error("0.1%").unwrap());
        assert_eq!(turntable.rates_dps, [200.0, 270.0]);
        assert_eq!(turntable.step_rates_dps["flat"], 200.0);
        assert_eq!(turntable.step_rates_dps["rest"], 0.0);
        assert_eq!(turntable.rate_error, 0.001);
        turntable.check(|key| key.to_owned()).unwrap();
    }

    #[test]
    fn what_is_no_rate_is_refused_with_what_to_write() {
        for wrong in ["-200", "0", "fast", "=200", "edge=", "1e9", "nan"] {
            let error = wrong.parse::<TurntableRate>().unwrap_err().to_string();
            assert!(error.contains("200 for 33 1/3 rpm"), "{error}");
        }
        assert!(rate_error("0.001").is_err());
        let refused = |list: &str, error: f64| {
            let checked = Turntable::new(&rates(list), error).check(|key| key.to_owned());
            checked.unwrap_err().to_string()
        };
        assert!(refused("rest=0", 0.01).contains("the rate of the turntable is missing"));
        assert!(refused("200,201", 0.01).contains("too close"));
        assert!(refused("200", 0.5).contains("50 %"));
        assert!(refused("200", f64::NAN).contains("rate_error"));
    }
}
