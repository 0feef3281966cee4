//! The curves of a calibration over temperature.

use maud::{Markup, html};
use mimu::calibration::{Calibration, Curves, OverTemperature, TemperatureNode};
use mimu::parameter::ParameterKind;
use mimu::quantity::{AXES, Sensor};
use mimu::readable;
use mimu::triad::Forward;

use crate::report::page::{number, spoken};
use crate::report::thermal_plot::{Changes, Point, panel};

const POINTS: usize = 81;
/// Half-width of a 95 % interval in standard deviations. Curves are estimated from so many rows that their errors are Gaussian.
const NORMAL_95: f64 = 1.959_964;

/// Scale factors and biases over temperature, and the lags of the dies.
pub fn section(calibration: &Calibration) -> Markup {
    let (Some(over), Some(curves)) = (&calibration.temperature, calibration.curves()) else {
        return html! {};
    };
    let [from, to] = over.range_c;
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
                        @if !over.biases_only { (drawn(calibration, &curves, sensor, ParameterKind::Scale)) }
                        (drawn(calibration, &curves, sensor, ParameterKind::Bias))
                    }
                }
            }
            figcaption {
                "Change of each scale factor and bias from the middle of the range"
                @if over.nodes.iter().all(|n| [&n.gyro, &n.accel].into_iter().flatten().all(|t| t.sigma_bias.is_some())) {
                    ", with its 95 % interval: those of the calibration's " (over.nodes.len()) " nodes, and straight lines between them."
                } @else {
                    ". The calibration has no intervals at its nodes."
                }
            }
        }
    }
}

/// Relative scale factors, or biases in SI, converted by the scale factors in the middle of the range.
fn drawn(
    calibration: &Calibration,
    curves: &Curves,
    sensor: Sensor,
    kind: ParameterKind,
) -> Markup {
    let Some(over) = &calibration.temperature else {
        return html! {};
    };
    let [from, to] = over.range_c;
    let temperature = |k: usize| from + (to - from) * k as f64 / (POINTS - 1) as f64;
    let at = |temp_c: f64| Forward::of(&curves.inverse(sensor, temp_c)?);
    let models: Option<Vec<Forward>> = (0..POINTS).map(|k| at(temperature(k))).collect();
    let Some(models) = models else {
        return html! {};
    };
    let middle = &models[POINTS / 2];
    let unit = readable::parameter(sensor.unit());
    let curve = |axis: usize| {
        let gain = |m: &Forward| m.matrix.row(axis).norm();
        // The plotted value, and the factor to its unit.
        let (of, factor): (&dyn Fn(&Forward) -> f64, f64) = match kind {
            ParameterKind::Scale => (&gain, 1e6 / gain(middle)),
            _ => (&|m: &Forward| m.bias[axis], unit.factor / gain(middle)),
        };
        let points = models.iter().enumerate().map(|(k, model)| {
            let temp_c = temperature(k);
            let value = (of(model) - of(middle)) * factor;
            let half = sigma(over, sensor, kind, axis, temp_c).map(|s| NORMAL_95 * s * factor);
            Point {
                temp_c,
                value,
                interval: half.map(|half| [value - half, value + half]),
            }
        });
        (AXES[axis].to_string(), points.collect())
    };
    let changes = Changes {
        heading: format!("{sensor} {}", kind.words()),
        unit: match kind {
            ParameterKind::Scale => "ppm".into(),
            _ => unit.unit.to_string(),
        },
        range_c: over.range_c,
        curves: (0..3).map(curve).collect(),
    };
    panel(
        &format!("{sensor}: {} over temperature", kind.words()),
        &changes.draw(),
    )
}

/// Standard deviation, raw, interpolated linearly between the nodes next to `temp_c`.
fn sigma(
    over: &OverTemperature,
    sensor: Sensor,
    kind: ParameterKind,
    axis: usize,
    temp_c: f64,
) -> Option<f64> {
    let of = |node: &TemperatureNode| {
        let table = node.table(sensor)?;
        let sigma = match kind {
            ParameterKind::Scale => table.sigma_scale_factor?,
            _ => table.sigma_bias?,
        };
        Some((node.temp_c, sigma[axis]))
    };
    let after = over.nodes.partition_point(|node| node.temp_c < temp_c);
    let last = over.nodes.len().checked_sub(1)?;
    let (cold, warm) = (
        of(&over.nodes[after.saturating_sub(1)])?,
        of(&over.nodes[after.min(last)])?,
    );
    let span = warm.0 - cold.0;
    let share = if span > 0.0 {
        (temp_c - cold.0) / span
    } else {
        0.0
    };
    Some(cold.1 + share.clamp(0.0, 1.0) * (warm.1 - cold.1))
}
