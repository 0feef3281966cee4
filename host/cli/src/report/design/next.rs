//! The next experiment as text.

use std::fmt::Write as _;

use super::text::LISTED;
use super::wrapped;
use mimu::quantity::{Figure, minutes, significant};
use mimu::result::next_experiment::NextExperiment;

/// Result of `mimu design --effects`.
pub fn next_text(report: &NextExperiment) -> String {
    let mut out = String::new();
    let _ = writeln!(out, "{}", report.title);
    wrapped(&mut out, "experiment", &report.experiment);
    let mut line = |name: &str, text: String| {
        let _ = writeln!(out, "  {name:<28}{text}");
    };
    line("time", minutes(report.time_s));
    for of in &report.dwell_sigma {
        let (factor, unit) = Figure::Input.readable(of.sensor);
        line(
            "sigma of a dwell mean",
            format!("{} {} {unit}", of.sensor, significant(of.value * factor)),
        );
    }
    for effect in &report.effects {
        let [share, wanted] = [effect.sigmas, effect.wanted].map(|s| 100.0 / s);
        line(
            &effect.id,
            format!("sigma at most {share:.1} % of the typical size, {wanted:.0} % wanted"),
        );
    }
    let _ = writeln!(
        out,
        "\n  {:<6}{:>10}{:>9}{:>9}{:>9}{:>11}",
        "dwell", "up: x", "y", "z", "deg/s", "begins, s"
    );
    let dwells = report.positions.iter().zip(&report.rates_dps);
    for (i, ((up, rate), begin_s)) in dwells.zip(&report.begin_s).enumerate().take(LISTED) {
        let [x, y, z] = up.map(|c| c + 0.0);
        let _ = writeln!(
            out,
            "  {:<6}{x:>10.4}{y:>9.4}{z:>9.4}{rate:>9.1}{begin_s:>11.0}",
            i + 1,
        );
    }
    let more = report.positions.len().saturating_sub(LISTED);
    if more > 0 {
        let _ = writeln!(out, "  ... and {more} more: -o and --json have them");
    }
    out
}
