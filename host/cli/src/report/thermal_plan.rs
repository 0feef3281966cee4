//! A procedure over temperature and its predicted uncertainty, as text.

use std::fmt::Write as _;

use mimu::quantity::{Sensor, duration, significant};
use mimu::readable;
use mimu_thermal::plan::Planned;

use super::text::wrap;

/// Duration, sigmas by temperature, and parameters that cannot be separated.
pub fn thermal_plan_text(planned: &Planned) -> String {
    let [from, to] = planned.range_c;
    let mut out = format!(
        "procedure {}, {from} to {to} °C: {}, {} dwells and turns\n\
         standard deviations of the {} curves, of the worst axis:\n\n",
        planned.procedure.name(),
        duration(planned.duration_s),
        planned.dwells,
        planned.curves,
    );
    let _ = writeln!(
        out,
        "{:<6} {:>8} {:>16} {:>14} {:>14}",
        "", "die", "bias", "scale factor", "cross terms"
    );
    for sensor in &planned.sensors {
        let bias = readable::parameter(sensor.unit);
        for at in &sensor.at {
            let bias = at.bias.map_or(NOT.into(), |b| bias.write(b));
            let millionths = |value: Option<f64>, unit: &str| {
                value.map_or(NOT.into(), |v| format!("{} {unit}", significant(1e6 * v)))
            };
            let _ = writeln!(
                out,
                "{:<6} {:>5.1} °C {bias:>16} {:>14} {:>14}",
                sensor.sensor.name(),
                at.temp_c,
                millionths(at.scale, "ppm"),
                millionths(at.cross, "µrad"),
            );
        }
    }
    out.push('\n');
    for sensor in Sensor::BOTH {
        let noise = &planned.noise[sensor as usize];
        let bias = readable::parameter(sensor.unit());
        let _ = writeln!(
            out,
            "{sensor}: noise {}/√Hz, bias instability {}, random walk {}/√s",
            bias.write(noise.n),
            bias.write(noise.b),
            bias.write(noise.k)
        );
    }
    wrap(
        &mut out,
        "",
        "From the information matrix of the estimate. Assumed: one curve of this kind for each parameter, dies at the temperature of the chamber, a bias that wanders as flicker noise of up to 10 000 s. The contribution of a lag of the dies is not predicted.",
    );
    for what in &planned.inseparable {
        wrap(&mut out, "inseparable: ", what);
    }
    out
}

const NOT: &str = "not determined";
