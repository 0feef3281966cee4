//! The diagnosis as a page: one HTML file that needs nothing else, for a reviewer who wants to see it.
//!
//! It is XML too, so that any parser reads it. A number in it is a `data` element whose value is that of the JSON.

mod figures;
mod svg;
mod tables;

use maud::{Markup, PreEscaped, html};

use super::DiagnosisReport;
use super::text::{USUAL, by};
use mimu::diagnose::decision::{Accepted, FALSE_LEFTOVER, LEVERAGE};
use mimu::diagnose::picture::{Against, Picture};
use mimu::diagnose::rows::Figure;
use mimu::diagnose::search::{FALSE_FOUND, FALSE_LISTED};
use mimu::diagnose::{Diagnosis, SensorDiagnosis, Verdict};
use mimu::next_experiment::Next;
use mimu::quantity::Sensor;
use mimu_recording::Reference;
use mimu_recording::error::{Error, Result};

use tables::{chance, figure, number};

/// How the page came about.
#[derive(Debug, Clone)]
pub struct Made {
    /// Recording, as it was given.
    pub recording: String,
    /// Command line.
    pub command: String,
    /// Date and time.
    pub created: String,
}

const STYLE: &str = include_str!("page/style.css");
/// Elements without an end, closed as XML wants it.
const META: &str = r#"<meta charset="utf-8"/><meta name="viewport" content="width=device-width, initial-scale=1"/>"#;

/// The page of a diagnosis.
pub fn diagnosis_page(report: &DiagnosisReport, made: &Made) -> Result<String> {
    let d = &report.diagnosis;
    let pictures: Option<Vec<Picture>> = d.sensors.iter().map(Picture::of).collect();
    let pictures = pictures.ok_or_else(|| {
        let place = d.before.prepared.place.clone();
        Error::new(
            place,
            "a model of the page is singular",
            "diagnose without --page, and report this",
        )
    })?;
    let device = &d.before.prepared.manifest.device;
    let page = html! {
        (PreEscaped("<!DOCTYPE html>"))
        html lang="en" xmlns="http://www.w3.org/1999/xhtml" {
            head {
                (PreEscaped(META))
                title { "Diagnosis of " (device) ": " (d.verdict.name()) }
                style { (PreEscaped(STYLE)) }
            }
            body { main {
                (head(d, made))
                h2 { "Error before and after" }
                (tables::errors(d, &pictures))
                @if let Some((name, both)) = &report.second {
                    h2 { "A second recording" }
                    p { "Of " code { (name) } " nothing was used to find or to fit the effects." }
                    (tables::second(both))
                }
                @if d.sensors.iter().any(|s| !s.decision.leftover.is_empty()) {
                    h2 { "What is left" }
                    p { "Scatter beyond the known noise that no candidate explains:" }
                    (tables::leftover(d))
                    @if d.sensors.iter().any(|s| s.decision.leftover.iter().any(|l| l.usual)) {
                        p { "*  " (USUAL) "." }
                    }
                }
                @for (s, picture) in d.sensors.iter().zip(&pictures) { (sensor(d, s, picture)) }
                h2 { "Tried and not accepted" }
                (tables::rejected(&d.sensors))
                h2 { "Not tested: the experiment does not excite it" }
                (tables::not_excited(&d.sensors))
                (confused(&report.next))
                (recorded(report))
                (method())
                p class="dim" { "mimu " (env!("CARGO_PKG_VERSION")) ", " (made.created) ": " code { (made.command) } }
            } }
        }
    };
    Ok(page.into_string() + "\n")
}

/// Names of sensors in sentences.
fn spoken(sensor: Sensor) -> &'static str {
    match sensor {
        Sensor::Gyro => "gyro",
        Sensor::Accel => "accelerometer",
    }
}

fn head(d: &Diagnosis, made: &Made) -> Markup {
    let prepared = &d.before.prepared;
    let manifest = &prepared.manifest;
    let known = match manifest.reference {
        Reference::Table => "known from the table",
        Reference::Gravity => "only gravity is known",
    };
    let counts: Vec<String> = d
        .sensors
        .iter()
        .map(|s| {
            let (count, together) = s.rows.judged;
            let (what, of_one) = match s.rows.figure {
                Figure::Direction => ("turns", together),
                Figure::Size => ("dwells", together),
                Figure::Input | Figure::Rest => ("dwells", 3 * together),
            };
            format!("{} {what} for the {}", count / of_one, spoken(s.sensor))
        })
        .collect();
    html! {
        h1 { "Diagnosis of " (manifest.device) }
        p class={ "verdict " (d.verdict.name()) } { (verdict(d)) }
        dl {
            dt { "Recording" } dd { code { (made.recording) } }
            @for source in &d.sources {
                dt { "Samples" } dd {
                    @if d.sources.len() > 1 { code { (source.place) } ": " }
                    (source.rows) " in " (number(source.rows as f64 * source.period_s, 1.0 / 60.0, "min"))
                    " at " (number(1.0 / source.period_s, 1.0, "Hz")) ", SHA-256 " code { (source.sha256) }
                }
            }
            dt { "Input" } dd { (known) "; gravity " data value=(manifest.gravity_mps2) { (format!("{:.5}", manifest.gravity_mps2)) " m/s²" } }
            dt { "Judged by" } dd { (counts.join(", ")) }
            dt { "Diagnosed" } dd { (made.created) }
        }
    }
}

fn verdict(d: &Diagnosis) -> Markup {
    let shown = |s: &SensorDiagnosis, value: f64| {
        let (factor, unit) = figure(d, s.sensor).readable(s.sensor);
        tables::figure_of(&s.decision, value, factor, unit)
    };
    let held = |s: &SensorDiagnosis, k: usize| shown(s, s.decision.held_out_rms[k]);
    let in_sample = |s: &SensorDiagnosis| shown(s, s.decision.rms[0]);
    let floor = |s: &SensorDiagnosis| shown(s, s.decision.noise_floor);
    let left = || {
        d.sensors
            .iter()
            .filter(|s| s.decision.unexplained().next().is_some())
    };
    let said = match d.verdict {
        Verdict::Clean => "noise explains what the affine calibration leaves.",
        Verdict::Explained => "with the effects found, noise explains what is left.",
        Verdict::Unexplained if left().next().is_some() => {
            "something is left that nothing tried explains:"
        }
        Verdict::Unexplained => "what was found is explained as well by a law that is on no list.",
    };
    html! {
        strong { (d.verdict.name()) } ": " (said)
        @for (n, s) in left().enumerate() { @if n > 0 { ";" } " " (tables::leftover_words(s)) }
        @if left().next().is_some() { "." }
        @for s in &d.sensors {
            @if s.decision.accepted.is_empty() {
                " Nothing is added to the " (spoken(s.sensor)) ": held-out error " (held(s, 0)) " (in sample "
                (in_sample(s)) "), noise alone " (floor(s)) "."
            } @else {
                " With "
                @for (n, a) in s.decision.accepted.iter().enumerate() {
                    @if n > 0 { " and " } code { (a.chosen.candidate.id()) }
                }
                " taken out, the held-out error of the " (spoken(s.sensor)) " goes from " (held(s, 0)) " to " (held(s, 1))
                "; noise alone would leave " (floor(s)) "."
            }
        }
    }
}

/// What the marks of the figures mean.
fn key(class: &str, d: &str) -> Markup {
    html! { svg class="key" viewBox="0 0 24 12" xmlns="http://www.w3.org/2000/svg" { path class=(class) d=(d) {} } }
}

fn keys() -> Markup {
    html! {
        (key("dot", "M12 6h0")) "in sample, "
        (key("sigma", "M12 0V12")) "± one standard deviation of its known noise; "
        (key("held", "M12 2l4 4l-4 4l-4 -4z")) "held out, by a model that has not seen the dwell"
    }
}

fn sensor(d: &Diagnosis, s: &SensorDiagnosis, picture: &Picture) -> Markup {
    let after = !s.decision.accepted.is_empty();
    let [before, left] = &picture.omnibus;
    html! {
        h2 class="sensor" { (spoken(s.sensor)) }
        @for (one, panels) in s.decision.accepted.iter().zip(&picture.effects) {
            (effect(d, s, one, panels))
        }
        @for note in &s.decision.notes { p { strong { "Note. " } (note) "." } }
        @if !after {
            p { "No effect is accepted; residuals are those of the affine calibration." }
        }
        h3 { "Residuals in time" }
        figure {
            div class="figures" {
                @for track in &picture.tracks { (figures::in_time(s.sensor, track, &picture.blocks_s, after)) }
            }
            figcaption {
                (keys()) "."
                @if !picture.blocks_s.is_empty() { " Shading changes where the blocks do that are held out." }
                @if after { " One scale for before and after." }
            }
        }
        h3 { "What is left against noise" }
        figure class="whole" {
            div class="figures" { (figures::quantiles(picture, after)) }
            figcaption {
                "All residuals over their known noise, against what normal noise would give (line; the band holds 95 % of "
                "each point). Chi-square by the known noise: "
                (omnibus(if after { "before" } else { "" }, before))
                @if after { "; " (omnibus("after", left)) }
                ". The known noise does not hold what a bias wanders between dwells unless the noise at rest was given: "
                "the verdict allows for that, and this test does not."
            }
        }
    }
}

/// With a capital.
fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().into_iter().flat_map(char::to_uppercase);
    first.chain(letters).collect()
}

fn omnibus(when: &str, &(chi2, dof, p): &(f64, usize, f64)) -> Markup {
    html! {
        @if !when.is_empty() { (when) " " }
        (number(chi2, 1.0, "")) " for " (dof) " degrees of freedom, " (chance(p))
    }
}

fn effect(
    d: &Diagnosis,
    s: &SensorDiagnosis,
    one: &Accepted,
    panels: &[mimu::diagnose::picture::Panel],
) -> Markup {
    let candidate = &one.chosen.candidate;
    let (factor, unit) = figure(d, s.sensor).readable(s.sensor);
    let whole = panels.iter().any(|p| p.against == Against::Fitted);
    html! {
        h3 { code { (candidate.id()) } }
        p {
            (sentence(candidate.about())) ". Held-out error " (number(one.held_out[0], factor, unit)) " without it, "
            (number(one.held_out[1], factor, unit)) " with it, beside the others; " (chance(one.chosen.p))
            " after the whole search."
        }
        (tables::coefficients(one))
        figure {
            div class="figures" { @for panel in panels { (figures::against(s.sensor, panel)) } }
            figcaption {
                "Left, what is left plus the part of the effect named (its other parts and the other effects taken out), against "
                "what it depends on, less what the affine calibration takes up: the mean, and the best straight line where the variable is one that "
                "it is linear in. " (key("fit", "M0 6H24")) "effect as fitted, with its 95 % band"
                @if candidate.form().is_some() { " (for the " code { (candidate.form().map_or("", |f| f.name)) } " found)" }
                ". Right, what is left, on the same scale. " (keys()) "."
                @if whole {
                    " Where a row is a whole turn or the size of gravity, the abscissa is what the fit says that the effect does to "
                    "it beside the affine calibration: points on the diagonal are explained."
                }
            }
        }
        (tables::alternatives(s, one))
    }
}

/// What the next recording has to tell apart.
fn confused(next: &Next) -> Markup {
    html! {
        @if !next.confused.is_empty() {
            h2 { "What tells the confused ones apart" }
            dl { @for c in &next.confused {
                dt { code { (c.ids[0]) } " or " code { (c.ids[1]) } }
                dd {
                    @if c.difference < 0.0 { (by(c.difference)) } @else { "worse by " (number(c.difference, 1.0, "")) }
                    " in score; " (c.experiment)
                }
            } }
        }
    }
}

fn recorded(report: &DiagnosisReport) -> Markup {
    let d = &report.diagnosis;
    let prepared = &d.before.prepared;
    let condensed = &prepared.condensed;
    let clipped: u64 = prepared
        .dwells
        .list
        .iter()
        .flat_map(|dwell| dwell.raw.map(|m| m.clipped))
        .sum();
    let missing: u64 = condensed.missing.iter().sum();
    html! {
        h2 { "The recording: masked, gaps, warnings" }
        dl {
            dt { "Dwells" } dd {
                @for (n, s) in d.before.sensors.iter().enumerate() {
                    @if n > 0 { "; " }
                    (s.sensor) ": " (s.dwells) " used of " (prepared.dwells.list.len()) (prepared.dwells.unused(s.sensor))
                }
            }
            dt { "Gaps" } dd { (condensed.gaps.0) ", " (number(condensed.gaps.1, 1.0, "s")) " missing" }
            dt { "Repeated rows" } dd { (condensed.duplicates) }
            dt { "Empty samples" } dd { (missing) " masked" }
            dt { "Samples at a rail" } dd { (clipped) " left out of the dwell means" }
        }
        @let warnings: Vec<&String> = report.warnings().collect();
        @if warnings.is_empty() {
            p { "No warnings." }
        } @else {
            ul { @for w in warnings { li { (w) } } }
        }
    }
}

fn method() -> Markup {
    let percent = |p: f64| format!("{} %", mimu::quantity::significant(100.0 * p));
    html! {
        h2 { "How it is decided" }
        p {
            "Every effect of the library and every product of what was recorded up to third order is tried beside the affine "
            "calibration and judged by the likelihood ratio, with the noise of the residuals estimated anew for each, at a "
            "probability of chance over the whole search of " (percent(FALSE_LISTED)) " for an effect with a name and "
            (percent(FALSE_FOUND)) " for a product, for each sensor. "
            "It is accepted only if the error of dwells that the model has not seen goes down with it, and if no dwell alone "
            "holds more than " (percent(LEVERAGE)) " of what it rests on. "
            "What then scatters beyond the known noise, where chance would do so in " (percent(FALSE_LEFTOVER))
            " of clean units, is told as left over, and the verdict is unexplained whatever was found besides."
        }
    }
}
