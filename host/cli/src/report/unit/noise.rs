//! Noise at rest: the coefficients, and the Allan deviation of their model.

use maud::{Markup, html};
use mimu::noise::noise_file::{NoiseChannel, NoiseFile};
use mimu::quantity::Sensor;
use mimu::readable;
use mimu_allan::model::{FLOOR, Term};

use crate::report::page::{number, spoken};
use crate::report::svg::{Frame, Panel, decades};

/// Number of points of a curve.
const POINTS: usize = 60;
const CLASSES: [&str; 3] = ["axis-x", "axis-y", "axis-z"];

/// The table and the curves.
pub fn section(noise: &NoiseFile) -> Markup {
    html! {
        @let (by, unit) = if noise.duration_s < 7200.0 { (60.0, "min") } else { (3600.0, "h") };
        p { "From " (number(noise.duration_s, 1.0 / by, unit)) " at rest at " (number(noise.sample_rate_hz, 1.0, "Hz")) ", of the unit " (noise.device) "." }
        @for sensor in Sensor::BOTH {
            @let channels = noise.of(sensor);
            @if !channels.is_empty() { (coefficients(sensor, &channels, noise.confidence)) }
        }
        figure {
            div class="figures" {
                @for sensor in Sensor::BOTH {
                    @let channels = noise.of(sensor);
                    @if !channels.is_empty() { (drawn(sensor, &channels, noise)) }
                }
            }
            figcaption { "Allan deviation computed from the coefficients in the table: N, B, K and Q. Coefficients that the record does not show are left out." }
        }
    }
}

fn coefficients(sensor: Sensor, channels: &[&NoiseChannel], confidence: f64) -> Markup {
    let terms = [Term::N, Term::B, Term::K];
    html! {
        div class="scroll" { table {
            caption { (spoken(sensor)) ": noise coefficients with " (format!("{:.0}", 100.0 * confidence)) " % intervals" }
            thead { tr {
                th { "channel" }
                @for term in terms { th class="n" { (term.letter()) ", " (term.name()) (unit_of(channels, term)) } }
            } }
            tbody {
                @for channel in channels {
                    tr {
                        td { (channel.name) @if let Some(t) = channel.temp_c { ", " (number(t, 1.0, "°C")) } }
                        @for term in terms {
                            @match channel.get(term) {
                                Ok(c) => td class="n" {
                                    @let unit = readable::noise(&c.unit).remove(0);
                                    (number(c.value, unit.factor, "")) " (" (number(c.lower, unit.factor, "")) " to "
                                    (number(c.upper, unit.factor, "")) ")"
                                },
                                // The noise file says how to determine it.
                                Err(why) => td { span class="dim" { (why.split(';').next().unwrap_or(why)) } },
                            }
                        }
                    }
                }
            }
        } }
    }
}

/// Unit of a column, after a comma. All channels of a sensor have the same.
fn unit_of(channels: &[&NoiseChannel], term: Term) -> String {
    let known = channels.iter().find_map(|c| c.get(term).ok());
    known.map_or_else(String::new, |c| {
        format!(", {}", readable::noise(&c.unit)[0].unit)
    })
}

fn deviation(channel: &NoiseChannel, tau_s: f64) -> f64 {
    let squared = |term| channel.get(term).map_or(0.0, |c| c.value.powi(2));
    let variance = 3.0 * squared(Term::Q) / tau_s.powi(2)
        + squared(Term::N) / tau_s
        + FLOOR * squared(Term::B)
        + squared(Term::K) * tau_s / 3.0;
    variance.sqrt()
}

fn drawn(sensor: Sensor, channels: &[&NoiseChannel], noise: &NoiseFile) -> Markup {
    let unit = readable::noise(&channels[0].unit).remove(0);
    let (from, to) = (2.0 / noise.sample_rate_hz, noise.duration_s / 8.0);
    let at = |k: usize| from * (to / from).powf(k as f64 / (POINTS - 1) as f64);
    let curve = |channel: &NoiseChannel| -> Vec<(f64, f64)> {
        let each = (0..POINTS).map(at);
        each.map(|t| (t, deviation(channel, t) * unit.factor))
            .collect()
    };
    let curves: Vec<_> = channels.iter().map(|c| curve(c)).collect();
    let values = || curves.iter().flatten().map(|p| p.1).filter(|v| *v > 0.0);
    let low = values().fold(f64::INFINITY, f64::min) / 1.4;
    let high = values().fold(0.0, f64::max) * 1.4;
    let panel = Panel::ONE;
    let frame = panel.frame(from.log10()..to.log10(), low.log10()..high.log10());
    let name = format!("Allan deviation, {}", unit.unit);
    panel.drawing(
        &format!("Allan deviation of the {sensor}"),
        None,
        &html! {
            (frame.grid(spoken(sensor), &decades(&(from..to)), &decades(&(low..high)), true))
            (frame.y_name(&name))
            (frame.x_name("averaging time, s", &frame))
            @for (k, curve) in curves.iter().enumerate() {
                (line(&frame, CLASSES[k % 3], curve))
            }
            (legend(&frame, channels))
        },
    )
}

fn line(frame: &Frame, class: &str, points: &[(f64, f64)]) -> Markup {
    frame.line(class, points.iter().map(|p| (p.0.log10(), p.1.log10())))
}

fn legend(frame: &Frame, channels: &[&NoiseChannel]) -> Markup {
    let names: Vec<&str> = channels.iter().map(|c| c.name.as_str()).collect();
    let entries: Vec<(&str, &str)> = CLASSES.into_iter().cycle().zip(names).collect();
    frame.legend(&entries)
}
