//! The curves of a calibration over temperature.

use maud::{Markup, html};
use mimu::calibration::Calibration;
use mimu::quantity::{AXES, Sensor};
use mimu::readable;
use mimu::triad::Forward;

use crate::report::page::{number, spoken};
use crate::report::svg::{Panel, range};

const POINTS: usize = 81;
const CLASSES: [&str; 3] = ["axis-x", "axis-y", "axis-z"];

/// Scale factors and biases over temperature, and what is known of the dies.
pub fn section(calibration: &Calibration) -> Markup {
    let (Some(over), Some(curves)) = (&calibration.temperature, calibration.curves()) else {
        return html! {};
    };
    let [from, to] = over.range_c;
    let temperatures: Vec<f64> = (0..POINTS)
        .map(|k| from + (to - from) * k as f64 / (POINTS - 1) as f64)
        .collect();
    html! {
        p {
            "From " (number(from, 1.0, "")) " to " (number(to, 1.0, "°C")) " of the dies"
            @for sensor in Sensor::BOTH {
                @if let Some(lag_s) = over.dies[sensor].lag_s {
                    "; the dies of the " (spoken(sensor)) " follow the thermometer with " (number(lag_s, 1.0, "s"))
                    @if let Some([low, high]) = over.dies[sensor].interval_lag_s {
                        " (95 %: " (number(low, 1.0, "")) " to " (number(high, 1.0, "s")) ")"
                    }
                }
            }
            "."
            @if over.biases_only { " Only the biases depend on temperature; scale factors and cross terms are those of one temperature." }
        }
        figure {
            div class="figures" {
                @for sensor in Sensor::BOTH {
                    @if over.has(sensor) {
                        @let models: Vec<Forward> = temperatures.iter().filter_map(|t| Forward::of(&curves.inverse(sensor, *t)?)).collect();
                        @if models.len() == POINTS {
                            @if !over.biases_only {
                                (changes(sensor, "scale factor, ppm", &temperatures, &models, |m, i, middle| {
                                    1e6 * (m.matrix[(i, i)] / middle.matrix[(i, i)] - 1.0)
                                }))
                            }
                            @let unit = readable::parameter(sensor.unit());
                            (changes(sensor, &format!("bias, {}", unit.unit), &temperatures, &models, |m, i, middle| {
                                (m.bias[i] - middle.bias[i]) / middle.matrix[(i, i)] * unit.factor
                            }))
                        }
                    }
                }
            }
            figcaption { "Change of each scale factor and bias from the middle of the range. `mimu thermal fit --page` draws them with their intervals." }
        }
    }
}

fn changes(
    sensor: Sensor,
    what: &str,
    temperatures: &[f64],
    models: &[Forward],
    of: impl Fn(&Forward, usize, &Forward) -> f64,
) -> Markup {
    let middle = &models[models.len() / 2];
    let curve = |axis: usize| -> Vec<(f64, f64)> {
        let each = temperatures.iter().zip(models);
        each.map(|(t, m)| (*t, of(m, axis, middle))).collect()
    };
    let curves: Vec<_> = (0..3).map(curve).collect();
    let panel = Panel::ONE;
    let frame = panel.frame(
        range(temperatures.iter().copied()),
        range(curves.iter().flatten().map(|p| p.1)),
    );
    let entries: Vec<(&str, &str)> = CLASSES.into_iter().zip(AXES).collect();
    panel.drawing(
        &format!("{sensor}: {what} over temperature"),
        &html! {
            (frame.axes(spoken(sensor), true))
            (frame.y_name(what))
            (frame.x_name("temperature of the dies, °C", &frame))
            @for (class, curve) in CLASSES.iter().zip(&curves) { (frame.line(class, curve.iter().copied())) }
            (frame.legend(&entries))
        },
    )
}
