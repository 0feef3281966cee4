//! A page: one HTML file that needs nothing else, for a reviewer who wants to see it.
//!
//! It is XML too, so that any parser reads it. A number in it is a `data` element whose value is that of the JSON.

use maud::{Markup, PreEscaped, html};
use mimu::quantity::{Sensor, significant};

use super::svg::raised;

/// How a page came about.
#[derive(Debug, Clone)]
pub struct Made {
    /// Recording, as it was given.
    pub recording: String,
    /// Command line.
    pub command: String,
    /// Date and time.
    pub created: String,
}

pub(super) const STYLE: &str = include_str!("page/style.css");
/// Elements without an end, closed as XML wants it.
const META: &str = r#"<meta charset="utf-8"/><meta name="viewport" content="width=device-width, initial-scale=1"/>"#;

/// The page with this title.
pub fn page(title: &str, main: &Markup) -> String {
    let page = html! {
        (PreEscaped("<!DOCTYPE html>"))
        html lang="en" xmlns="http://www.w3.org/1999/xhtml" {
            head {
                (PreEscaped(META))
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body { main { (main) } }
        }
    };
    page.into_string() + "\n"
}

/// A number for people, which holds that of the JSON.
pub fn number(si: f64, factor: f64, unit: &str) -> Markup {
    html! {
        @if si.is_finite() {
            data value=(si) { (written(&significant(si * factor))) @if !unit.is_empty() { " " (unit) } }
        } @else { "–" }
    }
}

/// With a minus sign in place of a hyphen, and powers of ten as people write them.
pub fn written(text: &str) -> String {
    let text = match text.split_once('e') {
        Some((digits, power)) => format!("{digits}·10{}", raised(power)),
        None => text.into(),
    };
    text.replace('-', "−")
}

/// Names of sensors in sentences.
pub fn spoken(sensor: Sensor) -> &'static str {
    match sensor {
        Sensor::Gyro => "gyro",
        Sensor::Accel => "accelerometer",
    }
}
