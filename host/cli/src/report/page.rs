//! A page: a single, self-contained HTML file.
//!
//! A page is valid XML too, so that any parser can read it. Each number is a `data` element with the value from the JSON.

use maud::{Markup, PreEscaped, html};
use mimu::judgement::Judgement;
use mimu::quantity::{Sensor, significant};

use super::svg::raised;

/// Origin of a page.
#[derive(Debug, Clone)]
pub struct Made {
    /// Recording, as given.
    pub recording: String,
    /// Command line.
    pub command: String,
    /// Date and time.
    pub created: String,
}

pub(super) const STYLE: &str = include_str!("page/style.css");
/// Elements without an end tag, closed as XML requires.
const META: &str = r#"<meta charset="utf-8"/><meta name="viewport" content="width=device-width, initial-scale=1"/>"#;

/// The page with this title.
pub fn page(title: &str, main: &Markup) -> String {
    styled_page(title, "", main)
}

/// The page with this title, and a style beside that of all pages. The style has to be text of XML too.
pub(super) fn styled_page(title: &str, style: &str, main: &Markup) -> String {
    let page = html! {
        (PreEscaped("<!DOCTYPE html>"))
        html lang="en" xmlns="http://www.w3.org/1999/xhtml" {
            head {
                (PreEscaped(META))
                title { (title) }
                style { (PreEscaped(STYLE)) (PreEscaped(style)) }
            }
            body { main { (main) } }
        }
    };
    page.into_string() + "\n"
}

/// A judgement, as the first thing of a page.
pub(super) fn judged(judgement: &Judgement) -> Markup {
    let kind = judgement.kind.name();
    html! { p class={ "judged " (kind) } { strong { (kind) } ": " (judgement.reason) "." } }
}

/// A number in readable form, with the value from the JSON.
pub fn number(si: f64, factor: f64, unit: &str) -> Markup {
    html! {
        @if si.is_finite() {
            data value=(si) { (written(&significant(si * factor))) @if !unit.is_empty() { " " (unit) } }
        } @else { "–" }
    }
}

/// `text` with a minus sign instead of a hyphen, and powers of ten in superscript.
pub fn written(text: &str) -> String {
    let text = match text.split_once('e') {
        Some((digits, power)) if power.parse::<i32>().is_ok() => {
            format!("{digits}·10{}", raised(power))
        }
        _ => text.into(),
    };
    text.replace('-', "−")
}

/// Name of a sensor in a sentence.
pub fn spoken(sensor: Sensor) -> &'static str {
    match sensor {
        Sensor::Gyro => "gyro",
        Sensor::Accel => "accelerometer",
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn only_a_power_of_ten_is_written_as_one() {
        assert_eq!(super::written("-0.2 (fixed)"), "−0.2 (fixed)");
        assert_eq!(super::written("1.5e-7"), "1.5·10⁻⁷");
    }
}
