//! Results for people: fixed-width tables with units and intervals.

use std::fmt::Write as _;

use mimu::dwell::Dwell;
use mimu::fit::{Fit, SensorFit};
use mimu::quantity::Figure;
use mimu::quantity::Sensor;
use mimu::quantity::{plural, plus_minus, raw_unit, scale_unit, significant};
use mimu::triad::{Angles, Estimate};
use mimu::verify::Verification;
use mimu_recording::{ImportSummary, Manifest, Reference};

/// Width that text keeps to, characters.
pub(crate) const COLUMNS: usize = 98;

/// `head` and `text` in lines, the later ones below the beginning of the text, or a little in where the head is long.
pub(super) fn wrap(out: &mut String, head: &str, text: &str) {
    let first = head.chars().count();
    let spaces = head.chars().take_while(|c| *c == ' ').count();
    let indent = if first > COLUMNS / 3 {
        spaces + 2
    } else {
        first
    };
    let (mut line, mut begun) = (head.to_string(), false);
    for word in text.split(' ') {
        let longer = line.chars().count() + usize::from(begun) + word.chars().count();
        if begun && longer > COLUMNS {
            let _ = writeln!(out, "{line}");
            (line, begun) = (" ".repeat(indent), false);
        }
        if begun {
            line.push(' ');
        }
        line.push_str(word);
        begun = true;
    }
    let _ = writeln!(out, "{line}");
}

pub(crate) fn warn(out: &mut String, warnings: impl Iterator<Item = impl AsRef<str>>) {
    for warning in warnings {
        let _ = writeln!(out, "warning: {}", warning.as_ref());
    }
}

/// Result of `mimu fit`.
pub fn fit_text(fit: &Fit) -> String {
    let mut out = String::new();
    let (condensed, manifest) = (&fit.prepared.condensed, &fit.prepared.manifest);
    let _ = writeln!(
        out,
        "{}: {} samples, {:.1} s at {:.2} Hz, gravity {} m/s²",
        manifest.device,
        condensed.rows,
        condensed.rows as f64 * condensed.period_s,
        1.0 / condensed.period_s,
        manifest.gravity_mps2
    );
    let dwells = &fit.prepared.dwells;
    let lengths = || dwells.list.iter().map(|d| d.duration_s);
    let (shortest, longest) = (
        lengths().fold(f64::INFINITY, f64::min),
        lengths().fold(0.0, f64::max),
    );
    let length = match (format!("{shortest:.1}"), format!("{longest:.1}")) {
        (a, b) if a == b => format!("{a} s long"),
        (a, b) => format!("{a} to {b} s long"),
    };
    let n = dwells.list.len() as u64;
    match dwells.detection {
        None => {
            let _ = writeln!(out, "{} by the step column, {length}", plural(n, "dwell"));
        }
        Some(d) => {
            let _ = writeln!(out, "{} found, {length}", plural(n, "dwell"));
            let _ = writeln!(
                out,
                "  still: variance over {:.1} s at most that of the quietest twentieth times {} (accel), {} (gyro);\n  {:.1} s left out at both ends; shorter than {} s not used",
                d.window_s, d.still_factor, d.gyro_still_factor, d.guard_s, d.shortest_s
            );
        }
    }
    for sensor in &fit.sensors {
        let _ = writeln!(out);
        sensor_text(&mut out, fit, sensor);
    }
    let warnings: Vec<_> = fit
        .warnings
        .iter()
        .chain(fit.sensors.iter().flat_map(|s| &s.warnings))
        .collect();
    if !warnings.is_empty() {
        let _ = writeln!(out);
        warn(&mut out, warnings.into_iter());
    }
    out
}

fn sensor_text(out: &mut String, fit: &Fit, sensor: &SensorFit) {
    let (factor, unit) = sensor.figure.readable(sensor.sensor);
    let used = match sensor.figure {
        Figure::Direction => format!(
            "{} between {}",
            plural(sensor.residuals.len() as u64, "turn"),
            plural(sensor.dwells as u64, "dwell")
        ),
        _ => plural(sensor.dwells as u64, "dwell"),
    };
    let _ = writeln!(
        out,
        "{} ({}, {used}, condition {})",
        sensor.sensor,
        fit.estimator(sensor.sensor),
        significant(sensor.estimated.condition)
    );
    let _ = writeln!(out, "  error: {}", sensor.figure.description());
    let mut line = |name: &str, value: Option<f64>, note: &str| {
        let shown = value.map_or("-".into(), |v| {
            format!("{} {unit}", significant(v * factor))
        });
        let _ = writeln!(out, "    {name:<12}{shown:>16}  {note}");
    };
    let blocks = fit.options.holdout_blocks.min(sensor.dwells);
    if blocks > 0 {
        let missing = sensor.not_held_out.len();
        let note = match missing {
            0 => format!("rms over {blocks} contiguous blocks"),
            m if m == blocks => "no block can be left out, see the warnings".into(),
            m => format!("rms over {} of {blocks} contiguous blocks", blocks - m),
        };
        line("held out", sensor.held_out_rms(), &note);
    } else {
        line("held out", None, "not asked for (--holdout blocks=4)");
    }
    line("in sample", Some(sensor.rms()), "rms");
    line(
        "noise floor",
        Some(sensor.noise_floor()),
        "rms if noise were all",
    );
    if let Some((rms, held)) = sensor.static_rms {
        let shown = |v: f64| format!("{} deg/s", significant(v.to_degrees()));
        let _ = writeln!(out, "  calibrated rate at rest, rms over dwells and axes:");
        if let Some(held) = held {
            let _ = writeln!(out, "    {:<12}{:>16}", "held out", shown(held));
        }
        let _ = writeln!(out, "    {:<12}{:>16}", "in sample", shown(rms));
    }
    for (name, s) in &sensor.estimated.scatter {
        if s.is_significant() {
            let (factor, unit) = match (sensor.figure, name.as_str()) {
                (Figure::Direction, "rest") => (1f64.to_degrees(), "deg/s".to_string()),
                (Figure::Direction | Figure::GravitySize, _) => (factor, unit.to_string()),
                // Axes of the forward form are in raw units, of the inverse form in SI.
                (Figure::Input, _) if matches!(fit.options.method, mimu::fit::Method::Xu) => {
                    (factor, unit.to_string())
                }
                (Figure::Input, _) => (
                    1.0,
                    raw_unit(fit.prepared.manifest.raw_unit, sensor.sensor.unit()),
                ),
            };
            let _ = writeln!(
                out,
                "  noise does not explain the residual ({name}): {} {unit} more is there, and in the intervals",
                significant(s.excess.sqrt() * factor)
            );
        }
    }
    let triad = &sensor.estimated.triad;
    let physical = triad.physical(Angles::Exact);
    let (raw, si) = (fit.prepared.manifest.raw_unit, sensor.sensor.unit());
    let mut rows = Vec::new();
    let mut table = |name: &str, unit: &str, triple: &[Estimate; 3], by: f64| {
        let cells = triple.map(|e| plus_minus(e.value * by, e.interval * by));
        // A ratio has no unit to show.
        let label = match unit {
            "1" => name.to_string(),
            _ => format!("{name}, {unit}").replace("m/s^2", "m/s²"),
        };
        rows.push((label, cells));
    };
    table("scale factor", &scale_unit(raw, si), &physical.scale, 1.0);
    table("bias", &raw_unit(raw, si), &physical.bias, 1.0);
    let degrees = 1f64.to_degrees();
    let by_choice =
        fit.prepared.manifest.reference == Reference::Gravity && sensor.sensor == Sensor::Accel;
    if !by_choice {
        table("misalignment", "deg", &physical.misalignment, degrees);
    }
    table(
        "non-orthogonality yz, zy, zx",
        "deg",
        &physical.non_orthogonality,
        degrees,
    );
    let cells = rows.iter().flat_map(|(_, cells)| cells);
    let width = 2 + cells.map(|c| c.chars().count()).max().unwrap_or(0);
    let _ = writeln!(
        out,
        "  {:<34}{:>width$}{:>width$}{:>width$}   95 %",
        "", "x", "y", "z"
    );
    for (label, [x, y, z]) in &rows {
        let _ = writeln!(out, "  {label:<34}{x:>width$}{y:>width$}{z:>width$}");
    }
}

/// List of the dwells: `mimu fit --dwells`.
pub fn dwell_table(dwells: &[Dwell], manifest: &Manifest) -> String {
    let mut out = String::new();
    let head = [
        "gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z",
    ];
    let _ = write!(
        out,
        "{:>10} {:>9} {:>9} {:>8}",
        "step", "first row", "start s", "length s"
    );
    for name in head {
        let _ = write!(out, " {name:>10}");
    }
    let _ = writeln!(out, "  not used");
    for d in dwells {
        let name = manifest
            .step_labels
            .get(d.step as usize)
            .cloned()
            .unwrap_or_else(|| d.step.to_string());
        let _ = write!(
            out,
            "{name:>10} {:>9} {:>9.2} {:>8.2}",
            d.first_row + 1,
            d.start_s,
            d.duration_s
        );
        for mean in d.raw {
            let _ = write!(
                out,
                " {:>10}",
                if mean.n > 0 {
                    six(mean.mean)
                } else {
                    "-".into()
                }
            );
        }
        let faults: Vec<String> = match (d.gyro_fault, d.accel_fault) {
            (Some(a), Some(b)) if a == b => vec![a.to_string()],
            (a, b) => a.into_iter().chain(b).map(|f| f.to_string()).collect(),
        };
        let _ = writeln!(out, "  {}", faults.join(", "));
    }
    out
}

/// Six significant digits.
fn six(value: f64) -> String {
    let digits = (5 - value.abs().max(1e-9).log10().floor() as i32).clamp(0, 6) as usize;
    format!("{value:.digits$}")
}

/// Result of `mimu verify`.
pub fn verify_text(verification: &Verification) -> String {
    let mut out = String::new();
    let _ = writeln!(
        out,
        "{:<7}{:>14}{:>14}{:>14}{:>14}{:>12}",
        "", "uncalibrated", "calibrated", "largest", "noise floor", "over"
    );
    for s in &verification.sensors {
        let (factor, unit) = s.figure.readable(s.sensor);
        let [raw, rms, max, floor] = [s.rms_raw, s.rms, s.max, s.noise_floor]
            .map(|v| format!("{} {unit}", significant(v * factor)));
        let noun = if s.figure == Figure::Direction {
            "turns"
        } else {
            "dwells"
        };
        let _ = writeln!(
            out,
            "{:<7}{raw:>14}{rms:>14}{max:>14}{floor:>14}{:>12}",
            s.sensor.name(),
            format!("{} {noun}", s.count).as_str()
        );
        if let Some(affine) = s.rms_affine {
            let _ = writeln!(
                out,
                "{:<7}{:>14}{:>14}",
                "",
                "effects left in",
                format!("{} {unit}", significant(affine * factor))
            );
        }
        if let Some(rest) = s.static_rms {
            let _ = writeln!(
                out,
                "{:<7}{:>14}{:>14}",
                "",
                "at rest",
                format!("{} deg/s", significant(rest.to_degrees()))
            );
        }
    }
    for s in &verification.sensors {
        let _ = writeln!(out, "{}: {}, rms", s.sensor, s.figure.description());
    }
    warn(&mut out, verification.warnings.iter());
    out
}

/// Result of `mimu import`.
pub fn import_text(summary: &ImportSummary) -> String {
    let mut out = String::new();
    let _ = writeln!(
        out,
        "{}: {} at {} Hz",
        summary.recording.display(),
        plural(summary.rows, "row"),
        summary.sample_rate_hz
    );
    let skipped = summary.skipped;
    let counts = [
        (skipped.header, "header line", "skipped"),
        (skipped.comment, "comment line", "skipped"),
        (skipped.blank, "empty line", "skipped"),
        (
            summary.dropped_outside,
            "row",
            "dropped: outside the time that all files cover",
        ),
        (
            summary.dropped_in_gaps,
            "row",
            "dropped: in a gap of another file",
        ),
        (
            summary.interpolated,
            "row",
            "interpolated from another file",
        ),
        (summary.empty_cells, "raw cell", "empty"),
    ];
    for (n, noun, what) in counts {
        if n > 0 {
            let _ = writeln!(out, "  {} {what}", plural(n, noun));
        }
    }
    warn(&mut out, summary.warnings.iter());
    out
}
