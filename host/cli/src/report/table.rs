//! Tables of results: cells whose numbers have the value of the JSON beside their digits. `factor` converts from SI to the unit of the column or row.

use maud::{Markup, html};
use mimu::{AXES, Readable, plus_minus, significant};

use super::page::written;

/// A table. The caption is for pages. Cells of the class `n` are numbers, those of the class `page` only pages show.
pub(super) fn table(caption: &str, heads: &Markup, rows: &Markup) -> Markup {
    classed(None, caption, heads, rows)
}

/// A table by axis, which a terminal does not fold: it is never much wider than the text.
pub(super) fn by_axes(caption: &str, first: &Markup, rows: &Markup) -> Markup {
    classed(
        Some("long"),
        caption,
        &html! { th { (first) } @for axis in AXES { th.n { (axis) } } },
        rows,
    )
}

fn classed(class: Option<&str>, caption: &str, heads: &Markup, rows: &Markup) -> Markup {
    html! { div.scroll { table class=[class] { caption { (caption) } thead { tr { (heads) } } tbody { (rows) } } } }
}

/// A number whose digits are given.
pub(super) fn typed(si: f64, text: &str) -> Markup {
    html! { td.n { @if si.is_finite() { data value=(si) { (written(text)) } } @else { "–" } } }
}

/// A number in SI, unknown if it is not finite.
pub(super) fn number(si: f64, factor: f64) -> Markup {
    typed(si, &significant(si * factor))
}

/// A number, unknown if there is none.
pub(super) fn known(si: Option<f64>, factor: f64) -> Markup {
    number(si.unwrap_or(f64::NAN), factor)
}

/// A number with the half-width of its interval.
pub(super) fn interval(si: f64, half: f64, factor: f64) -> Markup {
    typed(si, &plus_minus(si * factor, half * factor))
}

/// A number with the digits that the half-width of its interval has.
pub(super) fn rounded(si: f64, half: f64, factor: f64) -> Markup {
    let both = plus_minus(si * factor, half * factor);
    typed(si, both.split(' ').next().unwrap_or_default())
}

/// A number with the ends of its interval.
pub(super) fn between(si: f64, ends: [f64; 2], factor: f64) -> Markup {
    let [value, low, high] = [si, ends[0], ends[1]].map(|v| significant(v * factor));
    typed(si, &format!("{value} ({low} to {high})"))
}

/// `rms, mm/s²`: a label with its unit, if it has one.
pub(super) fn with_unit(label: impl std::fmt::Display, unit: &Readable) -> String {
    match unit.unit.is_empty() {
        true => label.to_string(),
        false => format!("{label}, {}", unit.unit),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::terminal::text;

    #[test]
    fn text_and_html_have_the_same_digits() {
        let html = html! { (table("Errors", &html! { th { "sensor" } th.n { "held out" } th.n { "bias" } }, &html! {
            tr { td { "gyro, deg" } (number(0.0123, 180.0 / std::f64::consts::PI)) (interval(-0.5, 0.000_123, 1.0)) }
            tr { td { "accel" } (known(None, 1.0)) }
        })) };
        let lines = [
            "sensor               held out                bias",
            "gyro, deg               0.705  -0.50000 ± 0.00012",
            "accel                       -",
        ];
        assert_eq!(text(&html).lines().collect::<Vec<_>>(), lines);
        let html = html.into_string();
        assert!(
            html.contains("<data value=\"0.0123\">0.705</data>"),
            "{html}"
        );
        assert!(html.contains("−0.50000 ± 0.00012"), "{html}");
    }
}
