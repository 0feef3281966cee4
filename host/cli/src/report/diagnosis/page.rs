//! The diagnosis as a page.

mod figures;
mod tables;

use maud::{Markup, html};

use super::meaning;
use super::text::{USUAL, by, second_errors};
use mimu::diagnose::decision::Accepted;
use mimu::diagnose::decision::{FALSE_LEFTOVER, LEVERAGE};
use mimu::diagnose::picture::{Against, Omnibus, Panel, Picture};
use mimu::diagnose::search::{FALSE_FOUND, FALSE_LISTED};
use mimu::quantity::{Figure, Sensor};
use mimu::readable;
use mimu::recording_problem::OfRecording;
use mimu::result::diagnosis::{DiagnosisResult, SensorDiagnosisResult};
use mimu_recording::Reference;
use mimu_recording::error::{Error, Result};

use crate::hint;
use crate::report::page::{Made, judged, number, page, spoken};
use tables::chance;

/// One sensor's figures and drawings.
struct Shown<'a> {
    name: Sensor,
    figures: &'a SensorDiagnosisResult,
    picture: &'a Picture,
}

/// The sections of a page about a diagnosis.
pub struct Sections<'a> {
    d: &'a DiagnosisResult,
    shown: Vec<Shown<'a>>,
}

impl<'a> Sections<'a> {
    /// The sections of a diagnosis.
    ///
    /// # Errors
    /// A model of the diagnosis is singular, so that nothing can be drawn.
    pub fn new(d: &'a DiagnosisResult, made: &Made) -> Result<Self> {
        let shown = d.sensors.present().map(|(name, figures)| {
            let picture = figures.picture.as_ref()?;
            Some(Shown {
                name,
                figures,
                picture,
            })
        });
        let shown: Option<Vec<Shown>> = shown.collect();
        let shown = shown.ok_or_else(|| {
            Error::new(
                &made.recording,
                "a model of the page is singular",
                "diagnose without --page, and report this",
            )
        })?;
        Ok(Self { d, shown })
    }

    /// The accelerometer's data for drawings.
    pub fn accel(&self) -> Option<&Picture> {
        let accel = self.shown.iter().find(|s| s.name == Sensor::Accel);
        accel.map(|s| s.picture)
    }

    /// The judgement, faults of the recording, and the verdict, in a sentence for each sensor.
    pub fn verdict(&self) -> Markup {
        first(self.d)
    }

    /// Errors before and after, on the recording and on a second one.
    pub fn errors(&self) -> Markup {
        html! {
            (tables::errors(&self.shown))
            @if let Some(second) = &self.d.second {
                h2 { "A second recording" }
                p { @if second.fitted_to {
                    code { (second.recording) } " is the fitted recording itself, so it proves nothing."
                } @else {
                    "Of " code { (second.recording) } " was not used to find or fit the effects."
                } }
                (second_errors(second).html())
            }
        }
    }

    /// Unexplained residuals, if there are any.
    pub fn leftover(&self) -> Markup {
        html! {
            @if !self.d.leftover.is_empty() {
                h2 { "Residual errors" }
                p { "Scatter beyond the known noise that no effect explains:" }
                (tables::leftover(self.d))
                @if self.d.leftover.iter().any(|l| l.usual) {
                    p { "*  " (USUAL) "." }
                }
            }
        }
    }

    /// Effects and residuals of each sensor.
    pub fn sensors(&self) -> Markup {
        html! { @for s in &self.shown { (sensor(self.d, s)) } }
    }

    /// Effects that were not accepted, and those that this recording could not show.
    pub fn tried(&self) -> Markup {
        html! {
            h2 { "Tried and rejected" }
            (tables::rejected(self.d))
            h2 { "Too small to be seen here" }
            p { "These effects were tried too. At the sizes of data sheets this recording would not show them, so their absence proves nothing." }
            (tables::not_excited(self.d))
            (confused(self.d))
        }
    }

    /// What was masked, gaps, warnings.
    pub fn recorded(&self) -> Markup {
        recorded(self.d)
    }

    /// Description of the method.
    pub fn method(&self) -> Markup {
        method()
    }
}

/// The page of a diagnosis.
pub fn diagnosis_page(d: &DiagnosisResult, made: &Made) -> Result<String> {
    let title = format!("Diagnosis of {}: {}", d.device, d.verdict.name());
    Ok(page(&title, &body(d, made)?))
}

/// Contents of the page.
///
/// # Errors
/// See [`Sections::new`].
pub fn body(d: &DiagnosisResult, made: &Made) -> Result<Markup> {
    let sections = Sections::new(d, made)?;
    Ok(html! {
        (head(d, made))
        h2 { "Error before and after" }
        (sections.errors())
        (sections.leftover())
        (sections.sensors())
        (sections.tried())
        (sections.recorded())
        (sections.method())
        p class="dim" { (d.tool) ", " (made.created) ": " code { (made.command) } }
    })
}

/// The judgement, faults of the recording, and the verdict.
fn first(d: &DiagnosisResult) -> Markup {
    html! {
        (judged(&d.judgement))
        @if !d.recording_problems.is_empty() {
            h2 { "Problems of " (if d.has_several() { "these recordings" } else { "this recording" }) }
            ul { @for OfRecording { recording, problem } in &d.recording_problems {
                li data-problem=(problem.id()) { @if d.has_several() { (recording) ": " } (problem) }
            } }
        }
        p class={ "verdict " (d.verdict.name()) } { (verdict(d)) }
    }
}

fn head(d: &DiagnosisResult, made: &Made) -> Markup {
    let known = match d.reference {
        Reference::Table => "known from the table",
        Reference::Gravity => "only gravity is known",
        Reference::TurntableRate => "only the magnitude of the rate is known",
    };
    let counts: Vec<String> = d
        .sensors
        .present()
        .map(|(name, s)| {
            let what = if s.figure == Figure::Direction {
                "turns"
            } else {
                "dwells"
            };
            format!("{} {what} for the {}", s.judged, spoken(name))
        })
        .collect();
    html! {
        h1 { "Diagnosis of " (d.device) }
        (first(d))
        dl {
            dt { "Recording" } dd { code { (made.recording) } }
            @for source in &d.recordings {
                dt { "Samples" } dd {
                    @if d.recordings.len() > 1 { code { (source.place) } ": " }
                    (source.rows) " in " (number(source.rows as f64 * source.period_s, 1.0 / 60.0, "min"))
                    " at " (number(1.0 / source.period_s, 1.0, "Hz")) ", SHA-256 " code { (source.sha256) }
                }
            }
            dt { "Input" } dd { (known) "; gravity " data value=(d.gravity_mps2) { (format!("{:.5}", d.gravity_mps2)) " m/s²" } }
            dt { "Judged by" } dd { (counts.join(", ")) }
            dt { "Judgement" } dd { (d.judgement) }
            dt { "Diagnosed" } dd { (made.created) }
        }
    }
}

fn verdict(d: &DiagnosisResult) -> Markup {
    let unexplained = d.unexplained().next().is_some();
    let left = || {
        d.sensors
            .present()
            .filter(|(name, _)| d.unexplained().any(|l| l.sensor == *name))
    };
    html! {
        strong { (d.verdict.name()) } ": " (meaning(d)) (if unexplained { ": " } else { "." })
        @for (n, (name, _)) in left().enumerate() { @if n > 0 { ";" } " " (tables::leftover_words(d, name)) }
        @if unexplained { "." }
        @for u in &d.untestable { " The " (spoken(u.sensor)) ": " (u.reason) "." }
        @for (name, s) in d.sensors.present() {
            @let ours: Vec<&Accepted> = d.effects.iter().filter(|a| a.effect.sensor() == name).collect();
            @let shown = |value: f64| tables::figure_of(s, value);
            @if ours.is_empty() {
                " Nothing is added to the " (spoken(name)) ": held-out error " (shown(s.held_out_rms_before)) " (in sample "
                (shown(s.rms_before)) "), noise alone " (shown(s.noise_floor)) "."
            } @else {
                " With "
                @for (n, a) in ours.iter().enumerate() {
                    @if n > 0 { " and " } code { (a.effect.id()) }
                }
                " taken out, the held-out error of the " (spoken(name)) " goes from " (shown(s.held_out_rms_before)) " to "
                (shown(s.held_out_rms_after)) "; noise alone would leave " (shown(s.noise_floor)) "."
            }
        }
    }
}

/// A mark of the figures, for the legend.
fn key(class: &str, d: &str) -> Markup {
    html! { svg class="key" viewBox="0 0 24 12" xmlns="http://www.w3.org/2000/svg" { path class=(class) d=(d) {} } }
}

fn keys() -> Markup {
    html! {
        (key("dot", "M12 6h0")) "in sample, "
        (key("sigma", "M12 0V12")) "± one standard deviation of its known noise; "
        (key("held", "M12 2l4 4l-4 4l-4 -4z")) "held out, predicted by a model that was fitted without this dwell"
    }
}

fn sensor(d: &DiagnosisResult, s: &Shown) -> Markup {
    let picture = s.picture;
    let ours: Vec<&Accepted> = d
        .effects
        .iter()
        .filter(|a| a.effect.sensor() == s.name)
        .collect();
    let after = !ours.is_empty();
    let [before, left] = &picture.omnibus;
    html! {
        h2 class="sensor" { (spoken(s.name)) }
        @for (one, panels) in ours.iter().zip(&picture.effects) {
            (effect(d, s, one, panels))
        }
        @for note in &s.figures.notes { p { strong { "Note. " } (note.to_string()) "." } }
        @if !after {
            p { "No effect is accepted; residuals are those of the affine calibration." }
        }
        h3 { "Residuals in time" }
        figure {
            div class="figures" {
                @for track in &picture.tracks { (figures::in_time(picture.sensor, track, &picture.blocks_s, after)) }
            }
            figcaption {
                (keys()) "."
                @if !picture.blocks_s.is_empty() { " The shading changes at the borders of the held-out blocks." }
                @if after { " Before and after have the same scale." }
            }
        }
        h3 { "Residuals compared with noise" }
        figure class="whole" {
            div class="figures" { (figures::quantiles(picture, after)) }
            figcaption {
                "All residuals divided by their known noise, against normal quantiles (line: normal noise; band: 95 % of each "
                "point). Chi-square with the known noise: "
                (omnibus(if after { "before" } else { "" }, before))
                @if after { "; " (omnibus("after", left)) }
                ". The known noise includes the wander of a bias between dwells only if the noise at rest was given. "
                "The verdict allows for this wander; this test does not."
            }
        }
    }
}

/// `text` with a capital letter.
fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().into_iter().flat_map(char::to_uppercase);
    first.chain(letters).collect()
}

fn omnibus(when: &str, &Omnibus { chi2, dof, p }: &Omnibus) -> Markup {
    html! {
        @if !when.is_empty() { (when) " " }
        (number(chi2, 1.0, "")) " for " (dof) " degrees of freedom, " (chance(p))
    }
}

fn effect(d: &DiagnosisResult, s: &Shown, one: &Accepted, panels: &[Panel]) -> Markup {
    let readable::Readable { factor, unit } = readable::error(s.figures.unit);
    let whole = panels.iter().any(|p| p.against == Against::Fitted);
    html! {
        h3 { code { (one.effect.id()) } }
        p {
            (sentence(one.effect.candidate.about())) ". Held-out error " (number(one.held_out_rms_before, factor, &unit)) " without it, "
            (number(one.held_out_rms_after, factor, &unit)) " with it, beside the others; "
            @if let (Some(before), Some(after)) = (one.held_out_at_rest_before, one.held_out_at_rest_after) {
                @let rate = readable::error("rad/s");
                "of the rates at rest " (number(before, rate.factor, &rate.unit)) " without it, "
                (number(after, rate.factor, &rate.unit)) " with it; "
            }
            (chance(one.chosen.p))
            " after the whole search."
            @if !one.of_unit { " It is not stored in a calibration." }
        }
        (tables::coefficients(one))
        figure {
            div class="figures" { @for panel in panels { (figures::against(s.picture.sensor, panel)) } }
            figcaption {
                "Left: residuals plus the named part of the effect (its other parts and the other effects removed), against the "
                "variable that it depends on, minus the part that the affine calibration absorbs (the mean, and the best straight line if the model is "
                "linear in the variable). " (key("fit", "M0 6H24")) "fitted effect with its 95 % band"
                @if let Some(form) = one.effect.nonlinear_parameter() { " (for the " code { (form.name) } " found)" }
                ". Right: the residuals, on the same scale. " (keys()) "."
                @if whole {
                    " If a residual is that of a whole turn or of the magnitude of gravity, the abscissa is the change that the fitted effect "
                    "predicts beside the affine calibration: points on the diagonal are explained."
                }
            }
        }
        (tables::alternatives(d, s, one))
    }
}

/// Effects that the next recording has to distinguish.
fn confused(d: &DiagnosisResult) -> Markup {
    html! {
        @if !d.confused.is_empty() {
            h2 { "Experiments that distinguish the confused effects" }
            dl { @for c in &d.confused {
                dt { code { (c.ids[0]) } " or " code { (c.ids[1]) } }
                dd {
                    @if c.difference < 0.0 { (by(c.difference)) } @else { "worse by " (number(c.difference, 1.0, "")) }
                    " in score; " (c.experiment)
                }
            } }
        }
    }
}

fn recorded(d: &DiagnosisResult) -> Markup {
    let out = &d.left_out;
    html! {
        h2 { "The recording: masked, gaps, warnings" }
        dl {
            dt { "Dwells" } dd {
                @for (n, (name, s)) in d.sensors.present().enumerate() {
                    @if n > 0 { "; " }
                    (name) ": " (s.dwells_used) " used of " (s.dwells) (s.not_used)
                }
            }
            dt { "Gaps" } dd { (out.gaps) ", " (number(out.missing_s, 1.0, "s")) " missing" }
            dt { "Repeated rows" } dd { (out.repeated_rows) }
            dt { "Empty samples" } dd { (out.empty_samples) " masked" }
            dt { "Samples at a rail" } dd { (out.clipped_samples) " left out of the dwell means" }
        }
        @if d.warnings.is_empty() {
            p { "No warnings." }
        } @else {
            ul { @for w in &d.warnings { li { (hint::of_warning(w)) } } }
        }
    }
}

fn method() -> Markup {
    let percent = |p: f64| format!("{} %", mimu::quantity::significant(100.0 * p));
    html! {
        h2 { "How it is decided" }
        p {
            "Every effect of the library, and every product of recorded quantities up to third order, is fitted together with the "
            "affine calibration and judged by the likelihood ratio. The noise of the residuals is estimated anew for each. Over the "
            "whole search the probability of a false alarm is " (percent(FALSE_LISTED)) " for a named effect and "
            (percent(FALSE_FOUND)) " for a product, for each sensor. "
            "An effect is accepted only if it lowers the error of held-out dwells, and if no single dwell "
            "contains more than " (percent(LEVERAGE)) " of the information about it. "
            "Scatter beyond the known noise, of a size that chance causes in " (percent(FALSE_LEFTOVER))
            " of clean units, is reported as a residual, and the verdict is then unexplained, even if effects were found."
        }
    }
}
