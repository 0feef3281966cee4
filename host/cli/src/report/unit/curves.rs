//! The curves of a calibration over temperature.

use maud::{Markup, html};
use mimu::calibration::{Calibration, Curves, OverTemperature, TemperatureNode};
use mimu::{AXES, Forward, ParameterKind, Sensor, readable};

use crate::report::page::{shown, spoken};
use crate::report::thermal_plot::{changes, panel};

const POINTS: usize = 81;
/// Half-width of a 95 % interval in standard deviations. Curves are estimated from so many rows that their errors are Gaussian.
const NORMAL_95: f64 = 1.959_964;

/// Scale factors and biases over temperature, and the lags of the dies.
pub fn section(calibration: &Calibration) -> Markup {
    let (Some(over), Some(curves)) = (&calibration.temperature, calibration.curves()) else {
        return html! {};
    };
    let [from, to] = over.range_c;
    let known = |n: &TemperatureNode| {
        [&n.gyro, &n.accel]
            .into_iter()
            .flatten()
            .all(|t| t.sigma_bias.is_some())
    };
    let kinds: &[ParameterKind] = if over.biases_only {
        &[ParameterKind::Bias]
    } else {
        &[ParameterKind::Scale, ParameterKind::Bias]
    };
    html! {
        p {
            "From " (shown(from, 1.0, "")) " to " (shown(to, 1.0, "°C")) " of the dies"
            @for sensor in Sensor::BOTH {
                @if let Some(lag_s) = over.dies[sensor].lag_s {
                    "; the dies of the " (spoken(sensor)) " follow the thermometer with " (shown(lag_s, 1.0, "s"))
                    @if let Some([low, high]) = over.dies[sensor].interval_lag_s { " (95 %: " (shown(low, 1.0, "")) " to " (shown(high, 1.0, "s")) ")" }
                }
            }
            "."
            @if over.biases_only { " Only the biases depend on temperature; scale factors and cross terms are those of one temperature." }
        }
        figure {
            div class="figures" { @for sensor in Sensor::BOTH.into_iter().filter(|sensor| over.has(*sensor)) {
                @for kind in kinds { (drawn(over, &curves, sensor, *kind)) }
            } }
            figcaption {
                "Change of each scale factor and bias from the middle of the range"
                @if over.nodes.iter().all(known) {
                    ", with its 95 % interval: those of the calibration's " (over.nodes.len()) " nodes, and straight lines between them."
                } @else { ". The calibration has no intervals at its nodes." }
            }
        }
    }
}

/// Relative scale factors, or biases in SI, converted by the scale factors in the middle of the range.
fn drawn(over: &OverTemperature, curves: &Curves, sensor: Sensor, kind: ParameterKind) -> Markup {
    let [from, to] = over.range_c;
    let temperature = |k: usize| from + (to - from) * k as f64 / (POINTS - 1) as f64;
    let at = |temp_c: f64| Forward::of(&curves.inverse(sensor, temp_c)?);
    let models: Option<Vec<Forward>> = (0..POINTS).map(|k| at(temperature(k))).collect();
    let Some(models) = models else {
        return html! {};
    };
    let middle = &models[POINTS / 2];
    let unit = readable::parameter(sensor.unit());
    let scale = kind == ParameterKind::Scale;
    let curve = |axis: usize| {
        let gain = |m: &Forward| m.matrix.row(axis).norm();
        let of = |m: &Forward| if scale { gain(m) } else { m.bias[axis] };
        let factor = if scale { 1e6 } else { unit.factor } / gain(middle);
        let points = models.iter().enumerate().map(|(k, model)| {
            let (temp_c, value) = (temperature(k), (of(model) - of(middle)) * factor);
            let sigmas = over.sigmas(sensor, temp_c, |t| {
                [t.sigma_bias, t.sigma_scale_factor][usize::from(scale)]
            });
            let half = sigmas.map(|s| NORMAL_95 * s[axis] * factor);
            (temp_c, value, half.map(|half| [value - half, value + half]))
        });
        (AXES[axis].to_string(), points.collect())
    };
    let name = if scale { "ppm" } else { &unit.unit };
    let curves: Vec<_> = (0..3).map(curve).collect();
    let what = kind.words();
    let drawn = changes(&format!("{sensor} {what}"), name, over.range_c, &curves);
    panel(&format!("{sensor}: {what} over temperature"), &drawn)
}
