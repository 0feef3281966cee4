//! A fit.

use std::cmp::Reverse;

use maud::{Markup, html};
use mimu::judge::input;
use mimu::readable::{self, Readable};
use mimu::result::fit::{DwellResult, FitResult, Parameter, SensorFitResult};
use mimu::{JudgementKind, ParameterKind, Sensor, Split, Warning, plural, plus_minus, significant};
use mimu_recording::Reference;

use super::page::{Level, judged, kinds, problems, warnings};
use super::table::{by_axes, interval, known, number, table, with_unit};
use super::terminal::text;
use crate::hint;

/// Result of `mimu fit`: a summary, or with `verbose` everything.
pub fn fit_text(fit: &FitResult, verbose: bool) -> String {
    text(&document(fit, Level::of(verbose)))
}

pub(super) fn document(fit: &FitResult, level: Level) -> Markup {
    let decisive = |w: &Warning| w.to_string() == fit.judgement.reason;
    let others = fit.warnings.iter();
    let others = others.filter(|w| !w.is_of_recording() && !decisive(w));
    let mut others: Vec<&Warning> = others.collect();
    // Those that matter most come first, because the summary may lack room for the others.
    others.sort_by_key(|w| Reverse(input::of_warning(w)));
    html! {
        @if level.is_page() { h1 { "Calibration of " (fit.device) } }
        @if fit.means {
            p { (fit.device) ": means of " (plural(fit.rows, "pose")) ", gravity " (format!("{:.5} m/s²", fit.gravity_mps2)) }
        } @else { (recorded(fit, level)) }
        (problems(&fit.recording_problems, false, level))
        (judged(&fit.judgement, "line"))
        h2 { "Errors" }
        (errors(fit))
        @for (name, sensor) in fit.sensors.present() {
            h2 class="sensor" { (name) }
            @if level.has_all() { (details(fit, name, sensor)) }
            (parameters(fit, name, sensor))
        }
        (warnings(&kinds(others.into_iter(), Warning::is_like, hint::of_warning, level.has_all()), level, 0))
        @if level == Level::Summary { p.line { "next: " (next(fit)) } }
    }
}

/// Next step after the fit.
fn next(fit: &FitResult) -> Markup {
    let judge = "judge it on another recording (mimu verify OTHER --calibration FILE)";
    let contradict = |w: &Warning| matches!(w, Warning::Of(_, w) if matches!(**w, Warning::RatesContradict { .. }));
    html! { @match fit.judgement.kind {
        _ if fit.warnings.iter().any(contradict) => "correct the rates or their error (mimu import --rate-dps, --rate-error), and fit again; --verbose prints more",
        JudgementKind::Misfit => "correct range, columns or unit of the readings (mimu import), or record again; --verbose prints the dwells",
        JudgementKind::Suspect => { "correct what the judgement names (mimu import), and fit again; or " (judge) }
        _ if !fit.recording_problems.is_empty() => { "correct the problems of the recording, and record again; or " (judge) }
        JudgementKind::Unexplained if fit.reference != Reference::TurntableRate => { "find what the model lacks (mimu diagnose), then " (judge) }
        JudgementKind::Untested => { "record more poses, each of them twice, and fit again; or " (judge) }
        JudgementKind::Good | JudgementKind::Unexplained => { (judge) "; --verbose prints how it was found" }
    } }
}

/// Errors of both sensors.
fn errors(fit: &FitResult) -> Markup {
    let came = fit
        .sensors
        .present()
        .any(|(_, s)| s.uncalibrated_rms.is_some());
    let caption = "Root mean square error; held out: on dwells that the fit has not used; noise: what noise alone would cause; uncalibrated: of readings in SI";
    let rest = readable::error("rad/s");
    html! { (table(caption, &html! {
        th { "rms error" } th.n { "held out" } th.n { "in sample" } th.n { "noise" } @if came { th.n { "uncalibrated" } } th {} th.page { "error of" }
    }, &html! { @for (name, s) in fit.sensors.present() {
        @let unit = readable::error(s.unit);
        tr {
            td { (with_unit(name, &unit)) }
            (known(s.held_out_rms, unit.factor)) (number(s.rms, unit.factor)) (number(s.noise_floor, unit.factor)) @if came { (known(s.uncalibrated_rms, unit.factor)) }
            td { (used(s)) } td.page { (s.figure.description()) }
        }
        @if let Some(rms) = s.static_rms {
            tr { td { "  " (with_unit("at rest", &rest)) } (known(s.static_held_out_rms.flatten(), rest.factor)) (number(rms, rest.factor)) }
        }
    } })) }
}

/// Kind and number of the errors.
fn used(sensor: &SensorFitResult) -> String {
    match sensor.unit {
        "rad" => plural(sensor.residuals.len() as u64, "turn"),
        _ => plural(sensor.dwells as u64, "dwell"),
    }
}

/// Length of the recording, and its dwells.
fn recorded(fit: &FitResult, level: Level) -> Markup {
    let lengths = || fit.dwells.iter().map(|d| d.duration_s);
    let shortest = format!("{:.1}", lengths().fold(f64::INFINITY, f64::min));
    let longest = format!("{:.1}", lengths().fold(0.0, f64::max));
    html! {
        p {
            (fit.device) ": " (fit.rows) " samples, " (format!("{:.1} s at {:.2} Hz", fit.rows as f64 * fit.period_s, 1.0 / fit.period_s))
            ", gravity " (format!("{:.5} m/s²", fit.gravity_mps2))
        }
        @if let Some(clock) = fit.clock { p { "time: " (clock.described()) } }
        p {
            (plural(fit.dwells.len() as u64, "dwell")) @if fit.detection.is_none() { " numbered in the step column, " } @else { " found, " }
            @if shortest != longest { (shortest) " to " } (longest) " s long"
        }
        @if let (Some(d), true) = (&fit.detection, level.has_all()) { section { p {
            "still: variance over " (format!("{:.1}", d.window_s)) " s at most that of the quietest twentieth times " (d.still_factor) " (accel), "
            (d.gyro_still_factor) " (gyro); " (format!("{:.1}", d.guard_s)) " s left out at both ends; shorter than " (d.shortest_s) " s not used"
        } } }
    }
}

/// Half-width of a 95 % interval in sigmas.
const INTERVAL: f64 = 1.96;

/// How a sensor was fitted and judged.
fn details(fit: &FitResult, name: Sensor, sensor: &SensorFitResult) -> Markup {
    let blocks = fit.holdout_blocks.min(sensor.dwells);
    html! {
        p { (name) ": " (sensor.estimator) ", " (plural(sensor.dwells as u64, "dwell")) ", condition " (significant(sensor.condition)) }
        section {
            p { "error of: " (sensor.figure.description()) @if sensor.static_rms.is_some() { "; at rest: the calibrated rate over dwells and axes" } }
            p { "held out: " @match (sensor.held_out, sensor.held_out_parts) {
                _ if blocks == 0 => "not requested (--holdout blocks=4)",
                (Split::Interleaved, held) if held < blocks => { (held) " of " (blocks) " parts, one dwell in " (blocks) " each" }
                (Split::Interleaved, _) => { "one dwell in " (blocks) " in turn" }
                (_, 0) => "no block can be held out, see the warnings",
                (_, held) if held < blocks => { (held) " of " (blocks) " contiguous blocks" }
                _ if blocks < fit.holdout_blocks => { (blocks) " blocks of a dwell each; " (fit.holdout_blocks) " were requested" }
                _ => { (blocks) " contiguous blocks" }
            } }
            @if !sensor.noise_floor.is_finite() { p { "noise: unknown, because no dwell shows it" } }
            @if let Some(delay) = &sensor.delay_s {
                @let of = |k: usize| plus_minus(1e3 * delay.value[k], 1e3 * INTERVAL * delay.sigma[k]);
                p { "delay behind the reference, removed: x " (of(0)) ", y " (of(1)) ", z " (of(2)) " ms" }
            }
            @for (group, scatter) in sensor.scatter.iter().filter(|(_, scatter)| scatter.significant) {
                p { "the residual exceeds the noise (" (group) ") by " (readable::error(&scatter.unit).write(scatter.excess_sigma)) "; the intervals include this" }
            }
        }
    }
}

/// Name of a kind of parameters in a table of the axes.
pub(super) fn by_axis(kind: ParameterKind, unit: &Readable) -> String {
    let words = match kind {
        ParameterKind::NonOrthogonality => "non-orthogonality yz, zy, zx",
        other => other.words(),
    };
    with_unit(words, unit)
}

/// The physical quantities by axis.
fn parameters(fit: &FitResult, name: Sensor, sensor: &SensorFitResult) -> Markup {
    // If only a magnitude is known, the triad's own axes define the frame.
    let by_choice = fit.reference == Reference::TurntableRate
        || fit.reference == Reference::Gravity && name == Sensor::Accel;
    let free = |kind: &ParameterKind| !(*kind == ParameterKind::Misalignment && by_choice);
    html! { (by_axes("Parameters with 95 % intervals", &html! { (name) ", ± of 95 %" }, &html! {
        @for kind in ParameterKind::PHYSICAL.into_iter().filter(free) {
            @let triple: Vec<&Parameter> = sensor.of_kind(kind).collect();
            @if let Some(first) = triple.first() {
                @let unit = readable::parameter(&first.unit);
                tr { td { "  " (by_axis(kind, &unit)) } @for p in &triple { (interval(p.value, 0.5 * (p.upper - p.lower), unit.factor)) } }
            }
        }
    })) }
}

/// List of the dwells: `mimu fit --dwells`.
pub fn dwell_table(dwells: &[DwellResult]) -> String {
    text(&html! { table.long {
        tr { th { "step" } th.n { "first row" } th.n { "start s" } th.n { "length s" } @for name in mimu_recording::RAW_COLUMNS { th.n { (name) } } th { "not used" } }
        @for d in dwells {
            @let [gyro, accel] = [&d.gyro_not_used, &d.accel_not_used].map(|fault| fault.as_deref());
            tr {
                td { @match &d.label { Some(label) => (label), None => (d.step) } }
                td.n { (d.first_row + 1) } @for s in [d.start_s, d.duration_s] { td.n { @if s.is_nan() { "-" } @else { (format!("{s:.2}")) } } }
                @for (mean, n) in d.raw_mean.iter().zip(d.averaged) { td.n { @if n > 0 { (six(*mean)) } @else { "-" } } }
                td { @if let Some(fault) = gyro { (fault) } @if let Some(fault) = accel.filter(|_| accel != gyro) { @if gyro.is_some() { ", " } (fault) } }
            }
        }
    } })
}

/// Six significant digits.
fn six(value: f64) -> String {
    let digits = (5 - value.abs().max(1e-9).log10().floor() as i32).clamp(0, 6) as usize;
    format!("{value:.digits$}")
}
