//! Noise in use as text.

use std::fmt::Write as _;

use mimu::in_use::{Estimate, Nees, NoiseInUse};
use mimu::quantity::{Sensor, significant};

use crate::report::table::{Cell, Table};
use crate::report::text::{warn, wrap};

/// Result of `mimu noise`.
pub fn noise_in_use_text(result: &NoiseInUse) -> String {
    let mut out = format!("judgement: {}\n", result.judgement);
    let vibration = result
        .vibration_rms_mps2
        .map(|rms| format!(", vibration above 10 Hz {} m/s² rms", significant(rms)));
    let _ = writeln!(
        out,
        "{} segments of {} s, {} deg of turn{}, against {}{}\n",
        result.segments,
        significant(result.segment_s),
        significant(result.turn_rad.to_degrees()),
        vibration.unwrap_or_default(),
        match result.reference {
            "rests" => "rests before and after",
            _ => "a trajectory",
        },
        match result.segments_left_out {
            0 => String::new(),
            n => format!("; {n} left out"),
        }
    );
    for table in tables(result) {
        out += &table.text("");
        let _ = writeln!(out);
    }
    for sentence in &result.sentences {
        wrap(&mut out, "", sentence);
    }
    warn(&mut out, result.warnings.iter());
    out
}

/// What its page and its text show.
pub(super) fn tables(result: &NoiseInUse) -> [Table; 3] {
    [densities(result), estimates(result), consistency(result)]
}

/// Biases, and how the trajectory is mounted and timed.
fn estimates(result: &NoiseInUse) -> Table {
    let mut table = Table::new(
        "Estimated beside the noise, with halves of the 95 % intervals",
        "beyond the calibration",
    )
    .numbers(["x", "y", "z"]);
    let mut row = |name: &str, own: &[Estimate], factor: f64| {
        let cells = (0..3).map(|k| match own.get(k) {
            Some(own) => Cell::Interval {
                si: own.value,
                half: own.half(),
                factor,
            },
            None => Cell::Empty,
        });
        table.row(std::iter::once(Cell::from(name)).chain(cells));
    };
    row("gyro bias, deg/s", &result.biases.gyro, 1_f64.to_degrees());
    row("accel bias, mm/s²", &result.biases.accel, 1e3);
    if let Some(mounted) = &result.mounted {
        row("mounting, deg", &mounted.rotation_rad, 1_f64.to_degrees());
        row("lever arm, mm", &mounted.lever_m, 1e3);
        row("add to the trajectory's times, ms", &[mounted.clock_s], 1e3);
    }
    table
}

fn densities(result: &NoiseInUse) -> Table {
    let mut table = Table::new(
        "Noise that explains the errors in motion, with 95 % intervals",
        "density",
    )
    .numbers(["in use", "Allan's", "factor"]);
    for density in &result.densities {
        let name = match (density.sensor, density.term) {
            (Sensor::Gyro, "white") => "gyro N, rad/s/√Hz",
            (Sensor::Gyro, _) => "gyro K, rad/s²/√Hz",
            (Sensor::Accel, "white") => "accel N, m/s²/√Hz",
            (Sensor::Accel, _) => "accel K, m/s³/√Hz",
        };
        let (si, ends) = (density.value, density.interval);
        let factor = match (density.factor, density.factor_interval) {
            (Some(si), Some(ends)) => Cell::Between { si, ends },
            _ => Cell::known(None, 1.0),
        };
        let figures = [
            Cell::Between { si, ends },
            Cell::known(density.allan, 1.0),
            factor,
        ];
        let row = std::iter::once(Cell::from(name)).chain(figures);
        table.row(row);
    }
    table
}

fn consistency(result: &NoiseInUse) -> Table {
    let mut table = Table::new(
        "Squared errors of held-out segments over what a filter believes; 1 is right",
        "filter with",
    )
    .numbers(["NEES", "by chance from", "to"]);
    let rows: [(&str, &Nees); 3] = [
        ("Allan's noise alone", &result.nees.allan),
        (
            "and the calibration's uncertainty",
            &result.nees.with_calibration,
        ),
        ("the noise in use", &result.nees.in_use),
    ];
    for (name, nees) in rows {
        let figures = [nees.value, nees.by_chance[0], nees.by_chance[1]];
        let row = std::iter::once(Cell::from(name));
        table.row(row.chain(figures.map(|v| Cell::known(Some(v), 1.0))));
    }
    table
}
