//! A procedure over temperature and its predicted uncertainty.

use maud::html;
use mimu::{Sensor, duration, readable};
use mimu_thermal::plan::Planned;

use super::table::{number, table};
use super::terminal::text;

/// Duration, sigmas by temperature, and parameters that cannot be separated.
pub fn thermal_plan_text(planned: &Planned) -> String {
    let [from, to] = planned.range_c;
    let cell = |value: Option<f64>, factor: f64| {
        value.map_or(html! { td.n { "not determined" } }, |v| number(v, factor))
    };
    text(&html! {
        p { "procedure " (planned.procedure.name()) ", " (from) " to " (to) " °C: " (duration(planned.duration_s)) ", " (planned.dwells) " dwells and turns" }
        p { "standard deviations of the " (planned.curves) " curves, of the worst axis:" }
        hr;
        (table("Standard deviations by temperature of the die, of the worst axis", &html! {
            th {} th.n { "die, °C" } th.n { "bias" } th {} th.n { "scale factor, ppm" } th.n { "cross terms, µrad" }
        }, &html! { @for sensor in &planned.sensors {
            @let bias = readable::parameter(sensor.unit);
            @for at in &sensor.at { tr {
                td { (sensor.sensor) } td.n { (format!("{:.1}", at.temp_c)) } (cell(at.bias, bias.factor)) td { (bias.unit) } (cell(at.scale, 1e6)) (cell(at.cross, 1e6))
            } }
        } }))
        hr;
        @for sensor in Sensor::BOTH {
            @let noise = &planned.noise[sensor as usize];
            @let bias = readable::parameter(sensor.unit());
            p { (sensor) ": noise " (bias.write(noise.n)) "/√Hz, bias instability " (bias.write(noise.b)) ", random walk " (bias.write(noise.k)) "/√s" }
        }
        p { "From the information matrix of the estimate. Assumed: one curve of this kind for each parameter, dies at the temperature of the chamber, a bias that wanders as flicker noise of up to 10 000 s. The contribution of a lag of the dies is not predicted." }
        @for what in &planned.inseparable { p data-head="inseparable: " { (what) } }
    })
}
