//! A design as a plan: the file that a turntable, or a person, carries out step by step.

use std::fmt::Write as _;

use super::model::Setting;
use super::reach::Carrier;

/// Sample rate of the recording that the plan asks for, Hz.
const SAMPLE_RATE_HZ: f64 = 1000.0;

/// Plan `mimu-plan/1` as TOML: `settings` in this order, `dwell_s` seconds each.
///
/// `about` is put in front as a comment, line by line.
pub fn to_toml(about: &str, carrier: Carrier, settings: &[Setting], dwell_s: f64) -> String {
    let mut out = String::new();
    for line in about.lines() {
        let _ = writeln!(out, "# {line}");
    }
    let hands = if carrier == Carrier::Hand {
        "hands"
    } else {
        "table"
    };
    let _ = writeln!(
        out,
        "format = \"mimu-plan/1\"\nsample_rate_hz = {SAMPLE_RATE_HZ:?}\ncarrier = \"{hands}\""
    );
    for setting in settings {
        let [x, y, z] = <[f64; 3]>::from(setting.up).map(|c| round(c, 1e9));
        // Direction in the body frame that points up.
        let _ = writeln!(out, "\n[[step]]\nup = [{x:?}, {y:?}, {z:?}]");
        if setting.rate != 0.0 {
            let _ = writeln!(
                out,
                "rate_dps = {:?}",
                round(setting.rate.to_degrees(), 1e6)
            );
        }
        let _ = writeln!(out, "dwell_s = {:?}", round(dwell_s, 1e3));
    }
    out
}

/// To a whole number of 1/`per`, without a negative zero.
pub(crate) fn round(value: f64, per: f64) -> f64 {
    (value * per).round() / per + 0.0
}
