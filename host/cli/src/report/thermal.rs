//! A fit over temperature as text.

use std::fmt::Write as _;

use mimu::parameter::ParameterKind;
use mimu::quantity::{Sensor, plural, significant};
use mimu::readable;
use mimu_thermal::compare::{Comparison, Difference};
use mimu_thermal::fit::FitVerdict;
use mimu_thermal::result::{CurveResult, SensorResult, ThermalResult};

use crate::hint;
use crate::report::table::{Cell, Table};
use crate::report::text::{warn, warn_within, wrap};

/// Number of temperatures at which curves are shown.
pub(super) const SHOWN: usize = 5;

/// Description of the verdict `one-way`.
pub(super) const VERDICT_ONE_WAY: &str = "the temperature goes one way only: lag and slope cannot be distinguished, and the intervals allow for any lag. A whole cycle of heating and cooling distinguishes them.";

/// Description of the verdict `misfit`.
pub(super) const VERDICT_MISFIT: &str = "the remaining errors far exceed the noise: something that these curves and the lag do not contain changes the readings, and the intervals do not include it.";

/// Number of temperatures per line in a table of 100 columns.
const ACROSS: usize = 3;

/// Result of `mimu thermal fit`: a summary, or with `verbose` everything.
pub fn thermal_text(result: &ThermalResult, verbose: bool) -> String {
    match verbose {
        true => everything(result),
        false => summary(result),
    }
}

fn recorded(result: &ThermalResult) -> String {
    let [from, to] = result.range_c;
    format!(
        "{}: {}, dies at {from:.1} to {to:.1} °C, estimator {}",
        result.device,
        plural(result.recordings.len() as u64, "recording"),
        result.estimator,
    )
}

fn summary(result: &ThermalResult) -> String {
    let mut out = recorded(result) + "\n";
    let meaning = match result.verdict {
        // The judgement says it with the figures.
        FitVerdict::Fitted => None,
        FitVerdict::OneWay => Some(VERDICT_ONE_WAY),
        FitVerdict::Misfit => Some(VERDICT_MISFIT),
    };
    if let Some(meaning) = meaning {
        let _ = writeln!(out, "verdict: {}: {meaning}", result.verdict.name());
    }
    let _ = writeln!(out, "judgement: {}\n", result.judgement);
    out += &errors(result).text("");
    for why in without_lag(result) {
        wrap(&mut out, "lag: ", why);
    }
    for (name, sensor) in result.sensors.present() {
        if let Some(what) = sensor.inseparable {
            wrap(&mut out, &format!("{name}, inseparable: "), what);
        }
    }
    for (name, _) in result.sensors.present() {
        let _ = writeln!(out);
        curves_text(&mut out, name, result, false);
    }
    // Two more lines follow: the next step, and the file of the calibration.
    warn_within(&mut out, result.warnings.iter().map(hint::of_thermal), 2);
    out += "next: --page shows all curves, --verify judges them on another recording; --verbose prints more\n";
    out
}

/// Errors and lags of both sensors.
pub(super) fn errors(result: &ThermalResult) -> Table {
    // Held out of a verification recording, because the biases change with every power-on.
    let without_bias = |s: &SensorResult| s.held_out_rms_without_session_bias;
    let verified = result
        .sensors
        .present()
        .any(|(_, s)| without_bias(s).is_some());
    let mut table = Table::new(
        "Root mean square error of the dwells (of segments of 30 s if only biases are estimated), and the lag of the dies behind the thermometer with its 95 % interval",
        "rms error",
    )
    .numbers(["held out"])
    .numbers(verified.then_some("minus its bias"))
    .numbers(["in sample", "noise"])
    .words("lag of the dies, s");
    for (name, s) in result.sensors.present() {
        let unit = readable::error(&s.unit);
        let known = |v: Option<f64>| Cell::known(v, unit.factor);
        let lag = match &s.lag_s {
            Some(lag) => Cell::Between {
                si: lag.value,
                ends: [lag.lower, lag.upper],
            },
            None => "-".into(),
        };
        let first = [
            format!("{name}, {}", unit.unit).into(),
            known(s.held_out_rms),
        ];
        let without = verified.then(|| known(without_bias(s)));
        let last = [known(s.rms), known(s.noise_floor), lag];
        table.row(first.into_iter().chain(without).chain(last));
    }
    table
}

/// Why lags are not known, each reason once.
pub(super) fn without_lag(result: &ThermalResult) -> Vec<&str> {
    let mut reasons: Vec<&str> = Vec::new();
    for (_, s) in result.sensors.present() {
        let why = s.lag_reason.as_deref().filter(|_| s.lag_s.is_none());
        reasons.extend(why.filter(|why| !reasons.contains(why)));
    }
    reasons
}

fn everything(result: &ThermalResult) -> String {
    let mut out = String::new();
    let _ = writeln!(out, "{}: {}", recorded(result), result.verdict.name());
    match result.verdict {
        FitVerdict::Fitted => {}
        FitVerdict::OneWay => wrap(&mut out, "", VERDICT_ONE_WAY),
        FitVerdict::Misfit => wrap(&mut out, "", VERDICT_MISFIT),
    }
    let _ = writeln!(out, "judgement: {}", result.judgement);
    for (name, sensor) in result.sensors.present() {
        let _ = writeln!(out);
        sensor_text(&mut out, name, sensor);
        curves_text(&mut out, name, result, true);
    }
    if !result.warnings.is_empty() {
        let _ = writeln!(out);
        warn(&mut out, result.warnings.iter().map(hint::of_thermal));
    }
    out
}

fn sensor_text(out: &mut String, name: Sensor, sensor: &SensorResult) {
    let unit = readable::error(&sensor.unit);
    let _ = writeln!(out, "{name}");
    if let Some(used) = &sensor.used {
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
    if !sensor.bins.is_empty() {
        *out += &bins(sensor).text("  ");
    }
    if sensor.hysteresis.is_some() {
        *out += &hysteresis(sensor).text("  ");
    }
}

/// Difference between heating and cooling by axis.
pub(super) fn hysteresis(sensor: &SensorResult) -> Table {
    let unit = readable::error(&sensor.unit);
    let mut table = Table::new(
        "Hysteresis: difference between heating and cooling that remains after the lag; it is reported, not fitted",
        format!("hysteresis, {}", unit.unit),
    )
    .numbers(["rms", "as K", "largest", "at, °C", "heating - cooling"]);
    for h in sensor.hysteresis.iter().flatten() {
        let [mean, largest] = [(h.value, h.half_width), (h.largest, h.largest_half_width)];
        let interval = |(si, half)| Cell::Interval {
            si,
            half,
            factor: unit.factor,
        };
        table.row([
            Cell::from(h.axis),
            Cell::number(h.rms, unit.factor),
            Cell::known(h.kelvin, 1.0),
            interval(largest),
            Cell::from(format!("{:.0}", h.largest_at_c)),
            interval(mean),
        ]);
    }
    table
}

/// Errors by temperature of the die.
pub(super) fn bins(sensor: &SensorResult) -> Table {
    let unit = readable::error(&sensor.unit);
    let mut table = Table::new(
        "Error by temperature of the die, rms; noise: what noise alone would cause",
        format!("error, {}", unit.unit),
    )
    .numbers(["heating", "cooling", "noise", sensor.judged_by]);
    for b in &sensor.bins {
        let known = |v: Option<f64>| Cell::known(v, unit.factor);
        table.row([
            format!("{:.0} to {:.0} °C", b.from_c, b.to_c).into(),
            known(b.heating),
            known(b.cooling),
            known(Some(b.noise_floor)),
            Cell::Count(b.dwells as u64),
        ]);
    }
    table
}

/// Whether a curve is a physical parameter of `sensor`; elements of C and o are not.
pub(super) fn physical(curve: &CurveResult, sensor: Sensor) -> bool {
    curve.sensor == sensor && curve.of.0 != ParameterKind::Inverse
}

/// Physical parameters of a sensor at some temperatures. Unless `verbose`, only scale factors and biases at three. JSON contains more temperatures
/// and the inverse model.
fn curves_text(out: &mut String, name: Sensor, result: &ThermalResult, verbose: bool) {
    let count = if verbose { SHOWN } else { ACROSS };
    for from in (0..count).step_by(ACROSS) {
        let shown = from..count.min(from + ACROSS);
        if let Some(table) = curves(name, result, (shown, count), verbose) {
            *out += &table.text(if verbose { "  " } else { "" });
        }
    }
}

/// Parameters of a sensor with their intervals, at those of `count` temperatures that are `shown`. `all`: not only scale factors and biases.
pub(super) fn curves(
    name: Sensor,
    result: &ThermalResult,
    (shown, count): (std::ops::Range<usize>, usize),
    all: bool,
) -> Option<Table> {
    let main = |c: &&CurveResult| {
        let kind = c.of.0;
        let of_axis = [
            ParameterKind::Scale,
            ParameterKind::Bias,
            ParameterKind::BiasAndGravity,
        ];
        all || of_axis.contains(&kind)
    };
    let own = result.curves.iter().filter(|c| physical(c, name));
    let curves: Vec<&CurveResult> = own.filter(main).collect();
    let temp_c = &curves.first()?.temp_c;
    let at = shown.map(|k| k * (temp_c.len() - 1) / (count - 1));
    let at: Vec<usize> = at.collect();
    let mut table = Table::new(
        "Parameters with 95 % intervals, by temperature of the die",
        format!("{name}, ± of 95 %"),
    )
    .numbers(at.iter().map(|k| format!("{:.1} °C", temp_c[*k])));
    for curve in curves {
        let unit = readable::parameter(&curve.unit);
        let first = Cell::from(format!("  {}, {}", curve.of, unit.unit));
        let cells = at.iter().map(|&k| Cell::Interval {
            si: curve.value[k],
            half: 0.5 * (curve.upper[k] - curve.lower[k]),
            factor: unit.factor,
        });
        table.row(std::iter::once(first).chain(cells));
    }
    Some(table)
}

/// Rows of a comparison. A summary contains scale factors, biases, and the elements of C and o that differ most in sigmas.
fn compared(result: &Comparison, verbose: bool) -> Vec<&Difference> {
    let inverse = |c: &Difference| c.name.contains("_C_") || c.name.contains("_o_");
    let most = |sensor: &str| {
        let own = result.curves.iter().filter(|c| c.name.starts_with(sensor));
        own.filter(|c| inverse(c) && c.sigmas.is_some())
            .max_by(|a, b| a.sigmas.unwrap_or(0.0).total_cmp(&b.sigmas.unwrap_or(0.0)))
            .map(|c| c.name.clone())
    };
    let most = Sensor::BOTH.map(|sensor| most(sensor.name()));
    let shown = |c: &&Difference| {
        verbose || !inverse(c) || most.iter().flatten().any(|name| *name == c.name)
    };
    result.curves.iter().filter(shown).collect()
}

/// Result of `mimu thermal compare`: a summary, or with `verbose` everything.
pub fn thermal_comparison_text(result: &Comparison, verbose: bool) -> String {
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
    let lags = format!(
        "dies at {from:.1} to {to:.1} °C; lags {} and {}",
        lag(0),
        lag(1)
    );
    wrap(&mut out, "second minus first, ", &lags);
    let _ = writeln!(
        out,
        "{:<16}{:>12}{:>14}{:>12}{:>10}  unit",
        "", "rms", "largest", "at °C", "sigmas"
    );
    let shown = compared(result, verbose);
    for c in &shown {
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
    if verbose {
        warn(&mut out, result.warnings.iter());
        return out;
    }
    let warnings = result.warnings.iter().map(ToString::to_string);
    warn_within(&mut out, warnings, 1);
    let more = (result.curves.len() - shown.len()) as u64;
    if more > 0 {
        let _ = writeln!(out, "next: --verbose prints {more} more numbers of C and o");
    }
    out
}
