//! The page of a calibration certificate: the headings of ISO/IEC 17025:2017, 7.8, for paper first.

mod comparison;
mod results;

use maud::{Markup, html};
use mimu::certificate::{Certificate, Party};
use mimu::quantity::{Sensor, significant};
use mimu_recording::{Reference, ReferenceError};

use super::data_sheet;
use super::page::{Made, spoken, styled_page, written};
use super::table::{table, typed};

const STYLE: &str = include_str!("certificate/style.css");

/// The page of `certificate`; `file` is the calibration file that it certifies, if one is given.
pub fn certificate_page(certificate: &Certificate, file: Option<&str>, made: &Made) -> String {
    let number = &certificate.particulars.number;
    let main = html! {
        (head(certificate))
        h2 { "1 Item" } (item(certificate))
        h2 { "2 Method" } (method(certificate))
        h2 { "3 Conditions" } (conditions(certificate))
        h2 { "4 Reference and its traceability" } (reference(certificate))
        h2 { "5 Results" } (results::section(certificate))
        h2 { "6 As found and as left" } (comparison::section(certificate.as_found.as_ref()))
        h2 { "7 Budget of influences" } (results::budget(certificate))
        h2 { "8 Statement of conformity" } (conformity(certificate))
        h2 { "9 Remarks" } (remarks(certificate, file))
        (signatures(certificate))
        p class="dim end" { "End of certificate " (number) ". " (certificate.tool) ", " (made.created) ": " code { (made.command) } }
    };
    let style = format!("{STYLE}{}", numbered_pages(certificate));
    styled_page(&format!("Calibration certificate {number}"), &style, &main)
}

/// Number of the certificate and of the page on each sheet of paper.
fn numbered_pages(certificate: &Certificate) -> String {
    let p = &certificate.particulars;
    let [number, laboratory] = [&p.number, &p.laboratory.name].map(|text| css_text(text));
    format!(
        "@page{{@bottom-left{{content:\"Certificate {number}, {laboratory}\"}}@bottom-right{{content:\"page \" counter(page) \" of \" counter(pages)}}}}"
    )
}

/// Text within quotes of a style sheet: what could end it there or in XML is escaped.
fn css_text(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars() {
        match c.is_alphanumeric() || " .,;:()/-".contains(c) {
            true => out.push(c),
            false => out += &format!("\\{:x} ", u32::from(c)),
        }
    }
    out
}

fn party(heading: &str, party: &Party) -> Markup {
    html! { section { h3 { (heading) } p { strong { (party.name) } br; (lines(&party.address)) @if !party.reference.is_empty() { br; (party.reference) } } } }
}

/// Text with its line breaks.
fn lines(text: &str) -> Markup {
    html! { @for (k, line) in text.trim().lines().enumerate() { @if k > 0 { br; } (line.trim()) } }
}

fn head(certificate: &Certificate) -> Markup {
    let p = &certificate.particulars;
    html! {
        h1 { "Calibration certificate" }
        p class="number" { "No. " strong { (p.number) } }
        div class="parties" { (party("Laboratory", &p.laboratory)) (party("Customer", &p.customer)) }
        dl {
            dt { "Calibrated" } dd { (p.item.description) ", " (p.item.identification) }
            dt { "Received" } dd { (p.received) }
            dt { "Performed" } dd { (p.performed) ", " (p.location) }
            dt { "Issued" } dd { (p.issued) }
        }
        p { "The results relate only to the item described here, in the condition in which it was calibrated." }
    }
}

fn item(certificate: &Certificate) -> Markup {
    let item = &certificate.particulars.item;
    html! { dl {
        dt { "Description" } dd { (item.description) }
        dt { "Identification" } dd { (item.identification) "; in the recording " (certificate.device) @if let Some(id) = &certificate.unit_id { ", number " code { (id) } } }
        dt { "Condition" } dd { (item.condition) }
        @if !item.settings.is_empty() { dt { "Settings" } dd { (item.settings) } }
        @if let Some(settings) = &certificate.settings { @for (sensor, set) in [(Sensor::Gyro, &settings.gyro), (Sensor::Accel, &settings.accel)] {
            dt { "Part, " (spoken(sensor)) }
            dd { (set.part) ", range " (significant(set.range)) " " (sensor.unit().replace("^2", "²")) ", " (set.bits) " bits, " (set.filter) }
        } }
    } }
}

fn method(certificate: &Certificate) -> Markup {
    html! {
        p { @match certificate.reference {
            Reference::Table => "The input of each dwell is known: rates of a table, gravity in known poses.",
            Reference::Gravity => "The unit lies still in many poses and is turned from one to the next. The reference of the accelerometer is the magnitude of gravity; that of the gyro is the direction of gravity before and after each turn.",
            Reference::TurntableRate => "The unit turns on a turntable of known rates in many poses. The reference of the gyro is the magnitude of the rate, that of the accelerometer the magnitude of gravity.",
        } }
        dl {
            @for (sensor, of) in certificate.sensors.present() { dt { "Estimator, " (spoken(sensor)) } dd { (of.estimator) } }
            dt { "Model" } dd {
                "u = P x + b with P = K Mo Mp: three scale factors K, three biases b, three misalignments Mp, three non-orthogonalities Mo of each triad. "
                "u is the reading, x the input (rad/s, m/s²)."
            }
            dt { "Source" } dd {
                "B. Fang, W. Chou, L. Ding: An Optimal Calibration Method for a MEMS Inertial Measurement Unit, Int. J. Adv. Robot. Syst. 11 (2014), DOI 10.5772/57516, "
                "equations (13), (15), (17); angles exactly instead of to first order"
            }
            dt { "Uncertainty" } dd { "JCGM 100:2008 (GUM): propagation of covariances, effective degrees of freedom by G.4" }
            dt { "Program" } dd { (certificate.tool) }
        }
    }
}

fn conditions(certificate: &Certificate) -> Markup {
    let c = &certificate.conditions;
    let between = |[a, b]: [f64; 2], unit: &str| written(&format!("{a:.1} to {b:.1} {unit}"));
    html! {
        dl {
            dt { "Environment" } dd { (certificate.particulars.environment) }
            dt { "Temperature of the unit" } dd {
                @match c.temp_range_c {
                    Some(range) => { (between(range, "°C")) " by its own thermometer, over the dwells of the recording" }
                    None => "not recorded"
                }
            }
            @if let Some(rate) = c.sample_rate_hz { dt { "Sample rate" } dd { (format!("{rate:.2} Hz")) } }
            dt { "Dwells" } dd {
                @for (k, (sensor, dwells)) in c.dwells.present().enumerate() { @if k > 0 { ", " } (dwells) " (" (spoken(sensor)) ")" }
                @if let Some([shortest, longest]) = c.dwell_s {
                    @if longest - shortest < 0.1 { (format!(", of {shortest:.1} s")) } @else { ", of " (between([shortest, longest], "s")) }
                }
            }
            @if let Some(rate) = c.largest_rate { dt { "Rates" } dd { "up to " (significant(rate.to_degrees())) " deg/s" } }
            dt { "Local gravity" } dd { (format!("{:.5} m/s²", c.gravity_mps2)) }
            @if let Some(latitude) = c.latitude_deg { dt { "Latitude" } dd { (written(&latitude.to_string())) " deg; the Earth's rate is subtracted" } }
            dt { "Recording" } dd { "SHA-256 " code { (certificate.sha256) } }
        }
    }
}

/// What a key of the errors of the reference is, and its unit.
fn named(key: &str) -> (&str, &str) {
    match key {
        "gravity_mps2" => ("local gravity", "m/s²"),
        "rate" => ("rates, as a share of each", "1"),
        "mounting_deg" => (
            "orientation of the unit on its mount, about each axis",
            "deg",
        ),
        "level_deg" => ("level of each pose, about each level axis", "deg"),
        "tilt_deg" => ("base from the vertical, about each level axis", "deg"),
        "orthogonality_deg" => ("right angles between axes of the table", "deg"),
        other => (other, ""),
    }
}

fn reference(certificate: &Certificate) -> Markup {
    let error = certificate.reference_error.as_ref();
    html! {
        dl { dt { "Traceability" } dd { (lines(&certificate.traceability)) } }
        @match error {
            Some(error) => {
                @if !error.source.is_empty() { p { "Source of the figures: " (error.source) "." } }
                (uncertainties(error))
            }
            None => p { strong { "No uncertainty of the reference was stated." } " The uncertainties below contain noise and scatter only." }
        }
    }
}

fn uncertainties(error: &ReferenceError) -> Markup {
    html! { (table("Uncertainty of the reference, type B; each is common to all dwells, except the level of a pose", &html! {
        th { "quantity" } th.n { "value" } th { "unit" } th { "distribution" }
    }, &html! { @for (key, value, rectangular) in error.stated() {
        @let (name, unit) = named(key);
        tr { td { (name) } (typed(value, &format!("±{}", significant(value)))) td { (unit) } td { @if rectangular { "rectangular, limits" } @else { "normal, 95 % interval" } } }
    } })) }
}

fn conformity(certificate: &Certificate) -> Markup {
    html! {
        @match &certificate.conformity {
            Some(sheet) => {
                p {
                    "Decision rule: acceptance with a guard band of the expanded uncertainty (ILAC-G8:09/2019, w = U). A property is " strong { "passed" }
                    " if its whole 95 % interval is within the limit, " strong { "failed" } " if its whole interval is beyond it, and else "
                    strong { "undecided" } ". The probability that a passed property is beyond its limit is at most 2.5 %."
                }
                (data_sheet::section(sheet))
            }
            None => p { "None: no limits were agreed." }
        }
    }
}

fn remarks(certificate: &Certificate, file: Option<&str>) -> Markup {
    html! {
        ul {
            li { "Judgement of the program: " (certificate.judgement) "." }
            @if let Some(file) = file { li { "The calibration file " code { (file) } " contains these results." } }
            @for remark in &certificate.particulars.remarks { li { (remark) } }
            @for warning in &certificate.warnings { li { (warning) } }
        }
    }
}

fn signatures(certificate: &Certificate) -> Markup {
    let p = &certificate.particulars;
    html! { div.signatures { @for (what, who) in [("Calibrated by", &p.calibrated_by), ("Authorised by", &p.authorised_by)] {
        div { div.line {} p { (what) ": " (who) } p.dim { "Date, signature" } }
    } } }
}

#[cfg(test)]
mod tests {
    use super::css_text;

    #[test]
    fn a_name_cannot_end_the_style_sheet() {
        assert_eq!(css_text("No. 7/2026, Größe"), "No. 7/2026, Größe");
        assert_eq!(css_text("a\"}</style>"), "a\\22 \\7d \\3c /style\\3e ");
    }
}
