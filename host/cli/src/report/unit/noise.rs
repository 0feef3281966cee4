//! Noise at rest: the coefficients, and the Allan deviation of their model.

use maud::{Markup, html};
use mimu::noise::noise_file::{NoiseChannel, NoiseFile};
use mimu::{Sensor, readable};
use mimu_allan::model::{FLOOR, Term};

use crate::report::page::{shown, spoken};
use crate::report::svg::{AXIS_CLASSES, Chart, Panel};
use crate::report::table::{between, table};

/// Number of points of a curve.
const POINTS: usize = 60;

/// The table and the curves.
pub fn section(noise: &NoiseFile) -> Markup {
    let (by, unit) = if noise.duration_s < 7200.0 {
        (60.0, "min")
    } else {
        (3600.0, "h")
    };
    let sensors = Sensor::BOTH.map(|sensor| (sensor, noise.of(sensor)));
    let sensors = || sensors.iter().filter(|(_, channels)| !channels.is_empty());
    html! {
        p { "From " (shown(noise.duration_s, 1.0 / by, unit)) " at rest at " (shown(noise.sample_rate_hz, 1.0, "Hz")) ", of the unit " (noise.device) "." }
        @for (sensor, channels) in sensors() { (coefficients(*sensor, channels, noise.confidence)) }
        figure {
            div class="figures" { @for (sensor, channels) in sensors() { (drawn(*sensor, channels, noise)) } }
            figcaption { "Allan deviation computed from the coefficients in the table: N, B, K and Q. Coefficients that the record does not show are left out." }
        }
    }
}

fn coefficients(sensor: Sensor, channels: &[&NoiseChannel], confidence: f64) -> Markup {
    let terms = [Term::N, Term::B, Term::K];
    let caption = format!(
        "{}: noise coefficients with {:.0} % intervals",
        spoken(sensor),
        100.0 * confidence
    );
    html! { (table(&caption, &html! { th { "channel" } @for term in terms {
        // All channels of a sensor have the same unit.
        th.n { (term.letter()) ", " (term.name()) @if let Some(c) = channels.iter().find_map(|c| c.get(term).ok()) { ", " (readable::noise(&c.unit)[0].unit) } }
    } }, &html! { @for channel in channels { tr {
        td { (channel.name) @if let Some(t) = channel.temp_c { (format!(", {t:.1} °C")) } }
        @for term in terms { @match channel.get(term) {
            Ok(c) => (between(c.value, [c.lower, c.upper], readable::noise(&c.unit)[0].factor)),
            // The noise file says how to determine it.
            Err(why) => td { span.dim { (why.split(';').next().unwrap_or(why)) } },
        } }
    } } })) }
}

fn deviation(channel: &NoiseChannel, tau_s: f64) -> f64 {
    let squared = |term| channel.get(term).map_or(0.0, |c| c.value.powi(2));
    let (quantization, white) = (
        3.0 * squared(Term::Q) / tau_s.powi(2),
        squared(Term::N) / tau_s,
    );
    (quantization + white + FLOOR * squared(Term::B) + squared(Term::K) * tau_s / 3.0).sqrt()
}

fn drawn(sensor: Sensor, channels: &[&NoiseChannel], noise: &NoiseFile) -> Markup {
    let unit = readable::noise(&channels[0].unit).remove(0);
    let (from, to) = (2.0 / noise.sample_rate_hz, noise.duration_s / 8.0);
    let at = |k: usize| from * (to / from).powf(k as f64 / (POINTS - 1) as f64);
    let curve = |channel: &&NoiseChannel| {
        (0..POINTS)
            .map(|k| (at(k), deviation(channel, at(k)) * unit.factor))
            .collect()
    };
    let curves: Vec<Vec<(f64, f64)>> = channels.iter().map(curve).collect();
    let values = || curves.iter().flatten().map(|p| p.1).filter(|v| *v > 0.0);
    let (low, high) = (
        values().fold(f64::INFINITY, f64::min) / 1.4,
        values().fold(0.0, f64::max) * 1.4,
    );
    let y_name = format!("Allan deviation, {}", unit.unit);
    let names = [spoken(sensor), "averaging time, s", &y_name];
    let classes = || AXIS_CLASSES.into_iter().cycle();
    let chart = Chart::new(Panel::ONE.logarithmic(from..to, low..high), names)
        .keyed(classes().zip(channels.iter().map(|c| c.name.as_str())));
    let inside = html! { @for (class, curve) in classes().zip(&curves) { (chart.frame.line(class, curve.iter().copied())) } };
    let label = format!("Allan deviation of the {sensor}");
    Panel::ONE.drawing(&label, None, &chart.drawn(&html! {}, &inside))
}
