//! A fit as text: fixed-width tables with units and intervals.

use std::cmp::Reverse;
use std::fmt::Write as _;

use mimu::fit::Split;
use mimu::judge::input;
use mimu::judgement::JudgementKind;
use mimu::parameter::ParameterKind;
use mimu::quantity::{Sensor, plural, plus_minus, significant};
use mimu::readable;
use mimu::result::fit::{DwellResult, FitResult, Parameter, SensorFitResult};
use mimu::warning::Warning;
use mimu_recording::Reference;

use crate::hint;
use crate::report::table::{Cell, Table};
use crate::report::text::{counted, kinds, problems, warn, warn_within};

/// Result of `mimu fit`: a summary, or with `verbose` everything.
pub fn fit_text(fit: &FitResult, verbose: bool) -> String {
    let mut out = String::new();
    if fit.means {
        let _ = writeln!(
            out,
            "{}: means of {}, gravity {:.5} m/s²",
            fit.device,
            plural(fit.rows, "pose"),
            fit.gravity_mps2
        );
    } else {
        recorded(&mut out, fit, verbose);
    }
    problems(&mut out, &fit.recording_problems, false, verbose);
    if verbose {
        let _ = writeln!(out, "judgement: {}", fit.judgement);
        for (name, sensor) in fit.sensors.present() {
            let _ = writeln!(out);
            sensor_text(&mut out, fit, name, sensor);
        }
    } else {
        let _ = writeln!(out, "judgement: {}\n", fit.judgement);
        out += &errors(fit).text("");
        for (name, sensor) in fit.sensors.present() {
            let _ = writeln!(out);
            let head = format!("{name}, ± of 95 %");
            parameters_text(&mut out, fit, name, sensor, &head);
        }
    }
    let decisive = |w: &Warning| w.to_string() == fit.judgement.reason;
    let others = fit.warnings.iter();
    let others = others.filter(|w| !w.is_of_recording() && !decisive(w));
    match verbose {
        true => {
            let all: Vec<String> = others.map(hint::of_warning).collect();
            if !all.is_empty() {
                let _ = writeln!(out);
                warn(&mut out, all.iter());
            }
        }
        false => {
            // Those that matter most come first, because the summary may lack room for the others.
            let mut others: Vec<&Warning> = others.collect();
            others.sort_by_key(|w| Reverse(input::of_warning(w)));
            let kinds = kinds(others.into_iter(), Warning::is_like);
            let shown = kinds.map(|(warning, more)| counted(hint::of_warning(warning), more));
            warn_within(&mut out, shown, 1);
            let _ = writeln!(out, "next: {}", next(fit));
        }
    }
    out
}

/// Next step after the fit.
fn next(fit: &FitResult) -> String {
    let judge = "judge it on another recording (mimu verify OTHER --calibration FILE)";
    let contradict = |w: &Warning| match w {
        Warning::Of { warning: w, .. } => matches!(**w, Warning::RatesContradict { .. }),
        _ => false,
    };
    if fit.warnings.iter().any(contradict) {
        return "correct the rates or their error (mimu import --rate-dps, --rate-error), and fit again; --verbose prints more".into();
    }
    match fit.judgement.kind {
        JudgementKind::Misfit => "correct range, columns or unit of the readings (mimu import), or record again; --verbose prints the dwells".into(),
        JudgementKind::Suspect => format!("correct what the judgement names (mimu import), and fit again; or {judge}"),
        _ if !fit.recording_problems.is_empty() => {
            format!("correct the problems of the recording, and record again; or {judge}")
        }
        JudgementKind::Unexplained if fit.reference != Reference::TurntableRate => {
            format!("find what the model lacks (mimu diagnose), then {judge}")
        }
        JudgementKind::Untested => format!("record more poses, each of them twice, and fit again; or {judge}"),
        JudgementKind::Good | JudgementKind::Unexplained => {
            format!("{judge}; --verbose prints how it was found")
        }
    }
}

/// Errors of both sensors.
pub(super) fn errors(fit: &FitResult) -> Table {
    let all = || fit.sensors.present();
    let came = all().any(|(_, s)| s.uncalibrated_rms.is_some());
    let mut table = Table::new(
        "Root mean square error; held out: on dwells that the fit has not used; noise: what noise alone would cause",
        "rms error",
    )
    .numbers(["held out", "in sample", "noise"])
    .numbers(came.then_some("uncalibrated"))
    .words("")
    .on_page("error of");
    for (name, s) in all() {
        let unit = readable::error(s.unit);
        let known = |value: Option<f64>| Cell::known(value, unit.factor);
        let uncalibrated = came.then(|| known(s.uncalibrated_rms));
        let figures = [s.held_out_rms, Some(s.rms), Some(s.noise_floor)].map(known);
        let row = std::iter::once(format!("{name}, {}", unit.unit).into());
        let words = [used(s).into(), s.figure.description().into()];
        table.row(row.chain(figures).chain(uncalibrated).chain(words));
        if let Some(rms) = s.static_rms {
            let unit = readable::error("rad/s");
            table.row([
                format!("  at rest, {}", unit.unit).into(),
                Cell::known(s.static_held_out_rms.flatten(), unit.factor),
                Cell::number(rms, unit.factor),
            ]);
        }
    }
    table
}

/// Kind and number of the errors.
fn used(sensor: &SensorFitResult) -> String {
    let n = sensor.residuals.len() as u64;
    match sensor.unit {
        "rad" => plural(n, "turn"),
        _ => plural(sensor.dwells as u64, "dwell"),
    }
}

/// Length of the recording, and its dwells.
fn recorded(out: &mut String, fit: &FitResult, verbose: bool) {
    let _ = writeln!(
        out,
        "{}: {} samples, {:.1} s at {:.2} Hz, gravity {:.5} m/s²",
        fit.device,
        fit.rows,
        fit.rows as f64 * fit.period_s,
        1.0 / fit.period_s,
        fit.gravity_mps2
    );
    if let Some(clock) = fit.clock {
        let _ = writeln!(out, "time: {}", clock.described());
    }
    let lengths = || fit.dwells.iter().map(|d| d.duration_s);
    let (shortest, longest) = (
        lengths().fold(f64::INFINITY, f64::min),
        lengths().fold(0.0, f64::max),
    );
    let length = match (format!("{shortest:.1}"), format!("{longest:.1}")) {
        (a, b) if a == b => format!("{a} s long"),
        (a, b) => format!("{a} to {b} s long"),
    };
    let n = plural(fit.dwells.len() as u64, "dwell");
    match &fit.detection {
        None => {
            let _ = writeln!(out, "{n} numbered in the step column, {length}");
        }
        Some(d) => {
            let _ = writeln!(out, "{n} found, {length}");
            if !verbose {
                return;
            }
            let _ = writeln!(
                out,
                "  still: variance over {:.1} s at most that of the quietest twentieth times {} (accel), {} (gyro);\n  {:.1} s left out at both ends; shorter than {} s not used",
                d.window_s, d.still_factor, d.gyro_still_factor, d.guard_s, d.shortest_s
            );
        }
    }
}

/// Half-width of a 95 % interval in sigmas.
const INTERVAL: f64 = 1.96;

fn sensor_text(out: &mut String, fit: &FitResult, name: Sensor, sensor: &SensorFitResult) {
    let dwells = plural(sensor.dwells as u64, "dwell");
    let used = match sensor.unit {
        "rad" => format!(
            "{} between {dwells}",
            plural(sensor.residuals.len() as u64, "turn")
        ),
        _ => dwells,
    };
    let _ = writeln!(
        out,
        "{name} ({}, {used}, condition {})",
        sensor.estimator,
        significant(sensor.condition)
    );
    let _ = writeln!(out, "  error: {}", sensor.figure.description());
    let figure = readable::error(sensor.unit);
    let mut line = |name: &str, value: Option<f64>, note: &str| {
        let shown = value.map_or("-".into(), |v| figure.write(v));
        let _ = writeln!(out, "    {name:<12}{shown:>16}  {note}");
    };
    let blocks = fit.holdout_blocks.min(sensor.dwells);
    if blocks > 0 {
        let note = match (sensor.held_out, sensor.held_out_parts) {
            (Split::Interleaved, held) if held < blocks => {
                format!("rms over {held} of {blocks} parts, one dwell in {blocks} each")
            }
            (Split::Interleaved, _) => format!("rms, one dwell in {blocks} held out in turn"),
            (_, 0) => "no block can be held out, see the warnings".into(),
            (_, held) if held < blocks => {
                format!("rms over {held} of {blocks} contiguous blocks")
            }
            _ if blocks < fit.holdout_blocks => format!(
                "rms over {blocks} blocks of a dwell each; {} were requested",
                fit.holdout_blocks
            ),
            _ => format!("rms over {blocks} contiguous blocks"),
        };
        line("held out", sensor.held_out_rms, &note);
    } else {
        line("held out", None, "not requested (--holdout blocks=4)");
    }
    line("in sample", Some(sensor.rms), "rms");
    match sensor.noise_floor.is_finite() {
        true => line("noise floor", Some(sensor.noise_floor), "noise-only rms"),
        false => line("noise floor", None, "unknown: no dwell shows the noise"),
    }
    if let Some(came) = sensor.uncalibrated_rms {
        line(
            "uncalibrated",
            Some(came),
            "rms of the readings in SI, without the calibration",
        );
    }
    if let Some(rms) = sensor.static_rms {
        let rate = readable::error("rad/s");
        let _ = writeln!(out, "  calibrated rate at rest, rms over dwells and axes:");
        if let Some(held) = sensor.static_held_out_rms.flatten() {
            let _ = writeln!(out, "    {:<12}{:>16}", "held out", rate.write(held));
        }
        let _ = writeln!(out, "    {:<12}{:>16}", "in sample", rate.write(rms));
    }
    if let Some(delay) = &sensor.delay_s {
        let of = |k: usize| plus_minus(1e3 * delay.value[k], 1e3 * INTERVAL * delay.sigma[k]);
        let _ = writeln!(
            out,
            "  delay behind the reference, removed: x {}, y {}, z {} ms",
            of(0),
            of(1),
            of(2)
        );
    }
    for (group, scatter) in &sensor.scatter {
        if scatter.significant {
            let _ = writeln!(
                out,
                "  the residual exceeds the noise ({group}) by {}; the intervals include this",
                readable::error(&scatter.unit).write(scatter.excess_sigma)
            );
        }
    }
    parameters_text(out, fit, name, sensor, "  ± of 95 %");
}

/// The physical quantities by axis, under `head`.
fn parameters_text(
    out: &mut String,
    fit: &FitResult,
    name: Sensor,
    sensor: &SensorFitResult,
    head: &str,
) {
    // If only a magnitude is known, the triad's own axes define the frame.
    let by_choice = match fit.reference {
        Reference::Table => false,
        Reference::Gravity => name == Sensor::Accel,
        Reference::TurntableRate => true,
    };
    let mut rows = Vec::new();
    for kind in ParameterKind::PHYSICAL {
        if kind == ParameterKind::Misalignment && by_choice {
            continue;
        }
        let triple: Vec<&Parameter> = sensor.of_kind(kind).collect();
        let Some(first) = triple.first() else {
            continue;
        };
        let label = match kind {
            ParameterKind::NonOrthogonality => "non-orthogonality yz, zy, zx",
            other => other.words(),
        };
        let shown = readable::parameter(&first.unit);
        let cell = |p: &&Parameter| {
            let half = 0.5 * (p.upper - p.lower);
            plus_minus(p.value * shown.factor, half * shown.factor)
        };
        let label = match shown.unit.is_empty() {
            true => label.to_string(),
            false => format!("{label}, {}", shown.unit),
        };
        rows.push((label, triple.iter().map(cell).collect::<Vec<_>>()));
    }
    let cells = rows.iter().flat_map(|(_, cells)| cells);
    let width = 2 + cells.map(|c| c.chars().count()).max().unwrap_or(0);
    let _ = writeln!(
        out,
        "{head:<36}{:>width$}{:>width$}{:>width$}",
        "x", "y", "z"
    );
    for (label, cells) in &rows {
        let _ = write!(out, "  {label:<34}");
        for cell in cells {
            let _ = write!(out, "{cell:>width$}");
        }
        let _ = writeln!(out);
    }
}

/// List of the dwells: `mimu fit --dwells`.
pub fn dwell_table(dwells: &[DwellResult]) -> String {
    let mut out = String::new();
    let _ = write!(
        out,
        "{:>10} {:>9} {:>9} {:>8}",
        "step", "first row", "start s", "length s"
    );
    for name in mimu_recording::RAW_COLUMNS {
        let _ = write!(out, " {name:>10}");
    }
    let _ = writeln!(out, "  not used");
    for d in dwells {
        let name = d.label.clone().unwrap_or_else(|| d.step.to_string());
        let _ = write!(
            out,
            "{name:>10} {:>9} {:>9} {:>8}",
            d.first_row + 1,
            known(d.start_s),
            known(d.duration_s)
        );
        for (mean, n) in d.raw_mean.iter().zip(d.averaged) {
            let shown = if n > 0 { six(*mean) } else { "-".into() };
            let _ = write!(out, " {shown:>10}");
        }
        let mut faults: Vec<&String> = [&d.gyro_not_used, &d.accel_not_used]
            .into_iter()
            .flatten()
            .collect();
        faults.dedup();
        let faults: Vec<&str> = faults.into_iter().map(String::as_str).collect();
        let _ = writeln!(out, "  {}", faults.join(", "));
    }
    out
}

/// Seconds, if they are known.
fn known(seconds: f64) -> String {
    match seconds.is_nan() {
        true => "-".into(),
        false => format!("{seconds:.2}"),
    }
}

/// Six significant digits.
fn six(value: f64) -> String {
    let digits = (5 - value.abs().max(1e-9).log10().floor() as i32).clamp(0, 6) as usize;
    format!("{value:.digits$}")
}
