//! A design as a plan: the file that a turntable, or a person, carries out step by step.

use std::fmt::Write as _;

use super::model::Setting;
use super::reach::Fixture;

/// Sample rate of the recording that the plan asks for, Hz.
const SAMPLE_RATE_HZ: f64 = 1000.0;

/// What a plan says.
#[derive(Debug, Clone)]
pub struct Sheet<'a> {
    /// Put in front as a comment, line by line.
    pub about: &'a str,
    /// Name of the unit; without it none is written.
    pub device: Option<&'a str>,
    /// Sample rate, Hz.
    pub sample_rate_hz: f64,
    /// What carries the unit.
    pub fixture: Fixture,
    /// Chamber, s and °C; empty where it does not matter.
    pub chamber_c: &'a [(f64, f64)],
    /// Attitudes and rates, in this order.
    pub settings: &'a [Setting],
    /// Length of each dwell, s.
    pub dwell_s: f64,
    /// Whether the same setting several times in a row is one step: the unit is left where it is.
    pub left_there: bool,
}

/// Plan `mimu-plan/1` as TOML: `settings` in this order, `dwell_s` seconds each.
///
/// `about` is put in front as a comment, line by line.
pub fn to_toml(about: &str, fixture: Fixture, settings: &[Setting], dwell_s: f64) -> String {
    sheet(&Sheet {
        about,
        device: None,
        sample_rate_hz: SAMPLE_RATE_HZ,
        fixture,
        chamber_c: &[],
        settings,
        dwell_s,
        left_there: false,
    })
}

/// The plan `mimu-plan/1` as TOML.
pub fn sheet(sheet: &Sheet) -> String {
    let mut out = String::new();
    for line in sheet.about.lines() {
        let _ = writeln!(out, "# {line}");
    }
    let hands = match sheet.fixture {
        Fixture::Hand => "hands",
        _ => "table",
    };
    let _ = writeln!(out, "format = \"mimu-plan/1\"");
    if let Some(device) = sheet.device {
        let _ = writeln!(out, "device = {}", toml::Value::from(device));
    }
    let rate = round(sheet.sample_rate_hz, 1e6);
    let _ = writeln!(out, "sample_rate_hz = {rate:?}\ncarrier = \"{hands}\"");
    if !sheet.chamber_c.is_empty() {
        let points = sheet.chamber_c.iter();
        let points: Vec<String> = points
            .map(|(t, c)| format!("[{:?}, {:?}]", round(*t, 1e3), round(*c, 1e3)))
            .collect();
        let _ = writeln!(out, "chamber_c = [{}]", points.join(", "));
    }
    for same in sheet.settings.chunk_by(|a, b| sheet.left_there && a == b) {
        let setting = &same[0];
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
        let _ = writeln!(out, "dwell_s = {:?}", round(sheet.dwell_s, 1e3));
        if same.len() > 1 {
            let _ = writeln!(out, "repeat = {}", same.len());
        }
    }
    out
}

/// To a whole number of 1/`per`, without a negative zero.
pub fn round(value: f64, per: f64) -> f64 {
    (value * per).round() / per + 0.0
}
