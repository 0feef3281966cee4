//! The page of a unit: all results.

pub(super) mod body;
pub(super) mod curves;
mod heading;
pub(super) mod model;
pub(super) mod noise;
pub(super) mod poses;
pub(super) mod trace;

use maud::{Markup, html};
use mimu::calibration::verify::{Verification, WholeTurnsOfAxis};
use mimu::{Calibration, DataSheet, DiagnosisResult, NoiseFile, Prepared};

pub use heading::Particulars;

use super::page::{Level, Made, contents, judged, page};
use super::{data_sheet, diagnosis, verify};

/// Contents of the page.
pub struct UnitReport<'a> {
    /// The diagnosis of the recordings, if there are any.
    pub diagnosis: Option<&'a DiagnosisResult>,
    /// The recordings with their names.
    pub recordings: &'a [(String, Prepared)],
    /// The calibration that the page shows.
    pub calibration: &'a Calibration,
    /// File of the calibration, unless it was made for this page.
    pub calibration_file: Option<&'a str>,
    /// Verifications by recordings that the calibration was not made from, with their names.
    pub verified: &'a [(String, Verification)],
    /// What the gyro reads for whole turns, by recording: its name, whether the calibration was made from it, and the axes.
    pub whole_turns: &'a [(String, bool, Vec<WholeTurnsOfAxis>)],
    /// Recordings that could not be used for a verification, with the reason.
    pub not_judged: &'a [String],
    /// Noise at rest.
    pub noise: Option<&'a NoiseFile>,
    /// The unit against the data sheet of its part.
    pub data_sheet: Option<&'a DataSheet>,
    /// The heading that makes the page a certificate.
    pub particulars: Option<&'a Particulars>,
}

/// The page of a unit.
pub fn unit_page(unit: &UnitReport, made: &Made) -> String {
    let (calibration, found) = (unit.calibration, unit.diagnosis);
    let main = html! {
        @if let Some(particulars) = unit.particulars { (particulars.head(&made.created)) }
        h1 { "Inertial unit " (calibration.device) }
        @match (found, &calibration.judgement) {
            (Some(found), _) => (diagnosis::first(found, Level::Page)),
            (None, Some(judgement)) => (judged(judgement, "")),
            (None, None) => {}
        }
        (identity(unit, made))
        (contents(&[
            ("noise", "Noise at rest", unit.noise.is_some()),
            ("errors", "Error before and after", found.is_some() || !unit.verified.is_empty()),
            ("temperature", "Over temperature", calibration.temperature.is_some()),
            ("calibration", "Calibration", true),
            ("body", "Body", !calibration.body.is_empty()),
            ("data-sheet", "Against the data sheet", unit.data_sheet.is_some()),
            ("effects", "Effects and residuals", found.is_some()),
            ("recordings", "Recordings", found.is_some()),
        ]))
        @if let Some(noise) = unit.noise { h2 id="noise" { "Noise at rest" } (noise::section(noise)) }
        @if found.is_some() || !unit.verified.is_empty() || !unit.not_judged.is_empty() {
            h2 id="errors" { "Error before and after" }
            @if let Some(found) = found { (diagnosis::errors(found, Level::Page)) }
            @if !unit.verified.is_empty() { (verify::errors(unit.verified)) }
            @if !unit.whole_turns.is_empty() { (verify::whole_turns_table(unit.whole_turns)) }
            @for why in unit.not_judged { p { "Not judged: " (why) "." } }
        }
        @if calibration.temperature.is_some() { h2 id="temperature" { "Over temperature" } (curves::section(calibration)) }
        h2 id="calibration" { "Calibration" }
        @if let Some(file) = unit.calibration_file { p { "From " code { (file) } "." } }
        (model::section(calibration))
        @if !calibration.body.is_empty() { h2 id="body" { "Body" } (body::section(calibration)) }
        @if let Some(sheet) = unit.data_sheet { h2 id="data-sheet" { "Against the data sheet" } (data_sheet::section(sheet)) }
        @if let Some(found) = found {
            h2 id="effects" { "Effects and residuals" }
            (diagnosis::sensors(found, Level::Page))
            h2 id="recordings" { "Recordings" }
            @for (name, prepared) in unit.recordings {
                h3 { code { (name) } }
                (poses::figure(prepared, calibration, found.sensors.accel.as_ref().map(|s| &s.picture)))
                (trace::figure(prepared))
            }
            (diagnosis::recorded(found))
            (diagnosis::tried(found, Level::Page, true))
            (diagnosis::method())
        }
        @if let Some(particulars) = unit.particulars { (particulars.signatures()) }
        (made.line(concat!("mimu ", env!("CARGO_PKG_VERSION"))))
    };
    let verdict = found.map_or("calibration", |d| d.verdict.name());
    page(&format!("{}: {verdict}", calibration.device), &main)
}

/// The raw readings of a recording over time, with its dwells, as a part of a page.
pub fn trace_figure(prepared: &Prepared) -> String {
    trace::figure(prepared).into_string()
}

fn identity(unit: &UnitReport, made: &Made) -> Markup {
    let calibration = unit.calibration;
    html! { dl {
        dt { "Unit" } dd { (calibration.device) @if let Some(id) = &calibration.unit_id { ", number " code { (id) } } }
        dt { "Reported" } dd { (made.created) }
        @if let Some(created) = &calibration.created { dt { "Calibrated" } dd { (created) } }
        @for source in unit.diagnosis.iter().flat_map(|d| &d.recordings) {
            dt { "Recording" } dd { code { (source.place) } ", SHA-256 " code { (source.sha256) } }
        }
    } }
}
