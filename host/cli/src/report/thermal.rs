//! A fit over temperature for people.

use std::fmt::Write as _;

use mimu::parameter::ParameterKind;
use mimu::quantity::{Sensor, plus_minus, significant};
use mimu::readable;
use mimu_thermal::compare::Comparison;
use mimu_thermal::fit::FitVerdict;
use mimu_thermal::result::{CurveResult, SensorResult, ThermalResult};

use crate::hint;
use crate::report::text::{warn, warn_within, wrap};

/// Temperatures at which curves are shown.
pub(super) const SHOWN: usize = 5;

/// What the verdict `one-way` means.
pub(super) const VERDICT_ONE_WAY: &str = "the temperature goes one way only: lag and slope cannot be distinguished, and the intervals allow for any lag. A whole cycle of heating and cooling distinguishes them.";

/// What the verdict `misfit` means.
pub(super) const VERDICT_MISFIT: &str = "the remaining errors far exceed the noise: something other than temperature and lag changes the readings, and the intervals do not include it.";

/// Temperatures side by side in a table of 100 columns.
const ACROSS: usize = 3;

/// Result of `mimu thermal fit`: a summary, or with `verbose` everything.
pub fn thermal_text(result: &ThermalResult, verbose: bool) -> String {
    let mut out = String::new();
    let [from, to] = result.range_c;
    let _ = writeln!(
        out,
        "{}: {} recording{}, dies at {from:.1} to {to:.1} °C, estimator {}: {}",
        result.device,
        result.recordings.len(),
        if result.recordings.len() == 1 {
            ""
        } else {
            "s"
        },
        result.estimator,
        result.verdict.name()
    );
    match result.verdict {
        FitVerdict::Fitted => {}
        FitVerdict::OneWay => wrap(&mut out, "", VERDICT_ONE_WAY),
        FitVerdict::Misfit => wrap(&mut out, "", VERDICT_MISFIT),
    }
    for (name, sensor) in result.sensors.present() {
        let _ = writeln!(out);
        sensor_text(&mut out, name, sensor, verbose);
        curves_text(&mut out, name, result, verbose);
    }
    if verbose && !result.warnings.is_empty() {
        let _ = writeln!(out);
        warn(&mut out, result.warnings.iter().map(hint::of_thermal));
    }
    if !verbose {
        warn_within(&mut out, result.warnings.iter().map(hint::of_thermal), 1);
        out += "next: --page shows all curves, --verify judges them on another recording; --verbose prints more\n";
    }
    out
}

fn sensor_text(out: &mut String, name: Sensor, sensor: &SensorResult, verbose: bool) {
    let unit = readable::error(&sensor.unit);
    let _ = writeln!(out, "{name}");
    if let Some(used) = sensor.used.as_ref().filter(|_| verbose) {
        let _ = writeln!(out, "  used: {}", used.words());
    }
    match (&sensor.lag_s, &sensor.lag_reason) {
        (Some(lag), _) => {
            let _ = writeln!(
                out,
                "  lag of the die behind the thermometer: {} s, 95 % from {} to {} s",
                significant(lag.value),
                significant(lag.lower),
                significant(lag.upper)
            );
        }
        (None, reason) => wrap(out, "  lag: ", reason.as_deref().unwrap_or("none")),
    }
    if let Some(what) = sensor.inseparable {
        wrap(out, "  inseparable: ", what);
    }
    if let (Some(rms), Some(floor)) = (sensor.rms, sensor.noise_floor) {
        let _ = write!(out, "  error rms {}", unit.write(rms));
        if let Some(held_out) = sensor.held_out_rms {
            let _ = write!(out, ", held out {}", unit.write(held_out));
        }
        if let Some(without) = sensor.held_out_rms_without_session_bias {
            let _ = write!(out, " ({} without its bias)", unit.write(without));
        }
        let _ = writeln!(out, ", noise alone {}", unit.write(floor));
    }
    if !verbose {
        return;
    }
    bins_text(out, sensor);
    for h in sensor.hysteresis.iter().flatten() {
        let [mean, largest] = [(h.value, h.half_width), (h.largest, h.largest_half_width)]
            .map(|(value, half)| plus_minus(value * unit.factor, half * unit.factor));
        let kelvin = match h.kelvin {
            Some(k) => format!(" ({} K)", significant(k)),
            None => String::new(),
        };
        let text = format!(
            "rms {}{kelvin}, largest {largest} at {:.0} °C, heating minus cooling on average {mean}",
            significant(h.rms * unit.factor),
            h.largest_at_c,
        );
        wrap(
            out,
            &format!("  hysteresis {}, {}: ", h.axis, unit.unit),
            &text,
        );
    }
}

fn bins_text(out: &mut String, sensor: &SensorResult) {
    let bins = &sensor.bins;
    if bins.is_empty() {
        return;
    }
    let unit = readable::error(&sensor.unit);
    let head = format!("error, {}", unit.unit);
    let _ = writeln!(
        out,
        "  {head:<16}{:>10}{:>10}{:>10}{:>8}",
        "heating", "cooling", "noise", sensor.judged_by
    );
    let shown = |v: Option<f64>| v.map_or("-".into(), |v| significant(v * unit.factor));
    for b in bins {
        let range = format!("{:.0} to {:.0} °C", b.from_c, b.to_c);
        let _ = writeln!(
            out,
            "  {range:<16}{:>10}{:>10}{:>10}{:>8}",
            shown(b.heating),
            shown(b.cooling),
            shown(Some(b.noise_floor)),
            b.dwells
        );
    }
}

/// Whether a curve is one of `sensor`'s that people know: not of C and o.
pub(super) fn physical(curve: &CurveResult, sensor: Sensor) -> bool {
    curve.sensor == sensor && curve.of.0 != ParameterKind::Inverse
}

/// Physical parameters at some temperatures, scale factors and biases at three without `verbose`; JSON has the inverse model too, and more temperatures.
fn curves_text(out: &mut String, name: Sensor, result: &ThermalResult, verbose: bool) {
    let main = |c: &&CurveResult| {
        verbose
            || matches!(
                c.of.0,
                ParameterKind::Scale | ParameterKind::Bias | ParameterKind::BiasAndGravity
            )
    };
    let all = result.curves.iter().filter(|c| physical(c, name));
    let curves: Vec<&CurveResult> = all.filter(main).collect();
    let Some(first) = curves.first() else {
        return;
    };
    let last = first.temp_c.len() - 1;
    let count = if verbose { SHOWN } else { ACROSS };
    let shown: Vec<usize> = (0..count).map(|k| k * last / (count - 1)).collect();
    for shown in shown.chunks(ACROSS) {
        let _ = write!(out, "  {:<32}", "95 % intervals at");
        for &k in shown {
            let _ = write!(out, "{:>22}", format!("{:.1} °C", first.temp_c[k]));
        }
        let _ = writeln!(out);
        for curve in &curves {
            let unit = readable::parameter(&curve.unit);
            let label = curve.of;
            let _ = write!(out, "  {:<32}", format!("{label}, {}", unit.unit));
            for &k in shown {
                let half = 0.5 * (curve.upper[k] - curve.lower[k]) * unit.factor;
                let _ = write!(
                    out,
                    "{:>22}",
                    plus_minus(curve.value[k] * unit.factor, half)
                );
            }
            let _ = writeln!(out);
        }
    }
}

/// Result of `mimu thermal compare`.
pub fn thermal_comparison_text(result: &Comparison) -> String {
    let mut out = String::new();
    let [from, to] = result.range_c;
    let lag = |k: usize| match result.lags_s[k] {
        None => "none".into(),
        Some([both, same]) if both == same => format!("{} s", significant(both)),
        Some([gyro, accel]) => format!(
            "{} s (gyro), {} s (accelerometer)",
            significant(gyro),
            significant(accel)
        ),
    };
    let _ = writeln!(
        out,
        "second minus first, dies at {from:.1} to {to:.1} °C; lags {} and {}",
        lag(0),
        lag(1)
    );
    let _ = writeln!(
        out,
        "{:<16}{:>12}{:>14}{:>12}{:>10}  unit",
        "", "rms", "largest", "at °C", "sigmas"
    );
    for c in &result.curves {
        let sigmas = c.sigmas.map_or("-".into(), significant);
        let _ = writeln!(
            out,
            "{:<16}{:>12}{:>14}{:>12}{sigmas:>10}  {}",
            c.name,
            significant(c.rms),
            significant(c.largest[0]),
            format!("{:.1}", c.largest[1]),
            c.unit
        );
    }
    warn(&mut out, result.warnings.iter());
    out
}
