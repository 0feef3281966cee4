//! Results as a piece of HTML within another page, for notebooks: the tables and plots of the pages, with a style that applies to this piece only.

use std::fmt::Write as _;

use maud::{Markup, PreEscaped, html};
use mimu::in_use::NoiseInUse;
use mimu::result::allan::AllanResult;
use mimu::result::sessions::SessionsResult;
use mimu::{Calibration, DiagnosisResult, Fit, FitResult, Sensor, Verification};
use mimu_thermal::result::ThermalResult;

use super::page::{Level, Made, STYLE};
use super::{allan, allan_plot, diagnosis, fit, noise_in_use, sessions, thermal, unit, verify};

/// A fit, with the matrices of its calibration, poses and readings.
pub fn of_fit(fit: &Fit, result: &FitResult, calibration: &Calibration) -> String {
    fragment(&html! {
        (fit::document(result, Level::Page))
        @for sensor in Sensor::BOTH {
            @if let Some(table) = calibration.table(sensor) { (unit::model::matrix(sensor, table, &calibration.effects_of(sensor))) }
        }
        (unit::poses::figure(&fit.prepared, calibration, None))
        (unit::trace::figure(&fit.prepared))
    })
}

/// A diagnosis, as on its page.
pub fn of_diagnosis(result: &DiagnosisResult, made: &Made) -> String {
    fragment(&diagnosis::body(result, made))
}

/// Noise: coefficients and curves.
pub fn of_allan(result: &AllanResult) -> String {
    fragment(&html! {
        (allan::document(result, Level::Page))
        // As an image: otherwise the drawing's style would apply to the whole page.
        @if result.recordings.len() == 1 {
            img alt="Allan deviation with its fitted model" style="max-width:100%" src=(data_url(&allan_plot::svg(result))) {}
        }
    })
}

/// Noise in use: densities, consistency and causes.
pub fn of_noise_in_use(result: &NoiseInUse) -> String {
    fragment(&noise_in_use::document(result))
}

/// A calibration of several sessions.
pub fn of_sessions(result: &SessionsResult) -> String {
    fragment(&sessions::document(result, Level::Page))
}

/// A fit over temperature, as on its page.
pub fn of_thermal(result: &ThermalResult, made: &Made) -> String {
    fragment(&thermal::document(result, Level::Page, Some(made)))
}

/// A result as the command prints it.
pub fn of_text(text: &str) -> String {
    fragment(&html! { pre { (text) } })
}

/// A verification with the recording `name`.
pub fn of_verification(name: &str, verification: &Verification) -> String {
    fragment(&verify::document(
        &[(name.to_owned(), verification.clone())],
        Level::Page,
    ))
}

/// A calibration: its parameters, and its curves over temperature.
pub fn of_calibration(calibration: &Calibration) -> String {
    fragment(&html! {
        h1 { "Calibration of " (calibration.device) }
        (unit::model::section(calibration))
        @if !calibration.body.is_empty() {
            h2 { "Body" }
            (unit::body::section(calibration))
        }
        @if calibration.temperature.is_some() {
            h2 { "Over temperature" }
            (unit::curves::section(calibration))
        }
    })
}

/// Terms and their descriptions.
pub fn of_terms(title: &str, terms: &[(&str, String)]) -> String {
    fragment(&html! {
        h3 { (title) }
        dl { @for (term, known) in terms { dt { (term) } dd { (known) } } }
    })
}

/// `main` with the style of a page, limited to this piece.
fn fragment(main: &Markup) -> String {
    // A nested style sheet applies to the element of the outer rule and its contents. This element takes the place of the page's root and body.
    let style = STYLE.replace(":root{", "&{").replace("\nbody{", "\n&{");
    // A notebook's theme colours text and rows, whatever the system prefers.
    let palettes: Vec<&str> = STYLE
        .split(":root{")
        .skip(1)
        .filter_map(|s| s.split('}').next())
        .collect();
    let themes = [
        r#"body[data-jp-theme-light="true"] &,.vscode-light &"#,
        r#"body[data-jp-theme-light="false"] &,.vscode-dark &"#,
    ];
    let themes: String = std::iter::zip(themes, palettes)
        .map(|(theme, palette)| format!("{theme}{{{palette}}}"))
        .collect();
    let all = html! {
        div class="mimu" {
            style { (PreEscaped(format!(".mimu{{{style}\n{themes}padding:1rem 1.5rem}}"))) }
            (main)
        }
    };
    all.into_string()
}

/// A drawing as a data URL.
fn data_url(svg: &str) -> String {
    let mut url = String::from("data:image/svg+xml,");
    for byte in svg.bytes() {
        match byte {
            b'%' | b'#' | b'"' | b'<' | b'>' | 0..=b' ' | 0x7f.. => {
                let _ = write!(url, "%{byte:02X}");
            }
            plain => url.push(char::from(plain)),
        }
    }
    url
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_style_of_a_piece_holds_for_nothing_beside_it() {
        let piece = of_terms("log", &[("rate", "50 Hz".into())]);
        let style = piece.split("<style>").nth(1).unwrap();
        let style = style.split("</style>").next().unwrap();
        assert!(style.starts_with(".mimu{") && style.ends_with('}'));
        assert!(
            !style.contains(":root") && !style.contains("body{"),
            "{style}"
        );
        let dark = STYLE.split("scheme:dark){:root{").nth(1).unwrap();
        let dark = dark.split('}').next().unwrap();
        let theme = format!("body[data-jp-theme-light=\"false\"] &,.vscode-dark &{{{dark}}}");
        assert!(style.contains(&theme), "{style}");
        let open = style.matches('{').count();
        assert_eq!(open, style.matches('}').count());
        // The outermost rule ends at the last brace.
        let mut depth = 0;
        for (i, c) in style.char_indices().skip(".mimu".len()) {
            depth += i32::from(c == '{') - i32::from(c == '}');
            assert!(depth > 0 || i == style.len() - 1, "{}", &style[..i]);
        }
    }

    #[test]
    fn a_drawing_is_an_address_without_what_would_end_it() {
        assert_eq!(
            data_url("<a b=\"1\">é#"),
            "data:image/svg+xml,%3Ca%20b=%221%22%3E%C3%A9%23"
        );
    }
}
