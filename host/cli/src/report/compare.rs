//! Result of `mimu compare` as text.

use std::fmt::Write as _;

use mimu::calibration::comparison::{ComparedParameter, Comparison};
use mimu::quantity::{p_value, plus_minus, significant};
use mimu::readable;

/// Two files side by side with their difference, or the range of several.
pub fn compare_text(result: &Comparison, all: bool) -> String {
    let mut out = String::new();
    let changed = result.parameters.iter().filter(|p| p.changed).count();
    let judged = result.parameters.iter().filter(|p| p.p.is_some()).count();
    let _ = match (judged, changed) {
        (0, _) => writeln!(
            out,
            "{} calibrations without uncertainties: no change can be judged",
            result.files.len()
        ),
        (_, 0) => writeln!(
            out,
            "{} calibrations: none of {judged} parameters changed by more than their intervals explain",
            result.files.len()
        ),
        _ => writeln!(
            out,
            "{} calibrations: {changed} of {judged} parameters changed by more than their intervals explain (*)",
            result.files.len()
        ),
    };
    let shown = |p: &&ComparedParameter| all || judged == 0 || p.changed;
    let shown: Vec<&ComparedParameter> = result.parameters.iter().filter(shown).collect();
    if !shown.is_empty() {
        let two = result.files.len() == 2;
        let head = match two {
            true => ["first", "second", "difference"],
            false => ["mean", "spread, 1 σ", "repeatability"],
        };
        let _ = writeln!(
            out,
            "\n{:<42} {:>13} {:>13} {:>17}  chance",
            "", head[0], head[1], head[2]
        );
        for p in shown {
            let _ = writeln!(out, "{}", row(p, two));
        }
        if !two {
            out += "\nrepeatability: the spread beyond the uncertainty of the fits, 1 σ\n";
        }
    }
    for (file, judgement) in result.files.iter().zip(&result.judgements) {
        if let Some(judgement) = judgement.as_ref().filter(|j| !j.is_good()) {
            let _ = writeln!(out, "{file}: {judgement}");
        }
    }
    for note in &result.notes {
        let _ = writeln!(out, "note: {note}");
    }
    out
}

fn row(p: &ComparedParameter, two: bool) -> String {
    let effect = p.name.contains('_');
    let readable = match effect {
        true => readable::coefficient(&p.unit),
        false => readable::parameter(&p.unit),
    };
    let mark = if p.changed { "*" } else { " " };
    let unit = match readable.unit.is_empty() {
        true => String::new(),
        false => format!(", {}", readable.unit),
    };
    // An effect's id begins with its sensor.
    let name = match effect {
        true => format!("{}{unit}", p.name),
        false => format!("{} {}{unit}", p.sensor, p.name),
    };
    let by = readable.factor;
    let chance = p.p.map_or_else(String::new, p_value);
    let cells = match two {
        true => {
            let difference = (p.values[1] - p.values[0]) * by;
            let half = p.sigmas.as_ref().map(|s| 1.96 * s[0].hypot(s[1]) * by);
            let digits = |v: f64| match half {
                // With as many digits as the interval.
                Some(half) => plus_minus(v * by, half)
                    .split(' ')
                    .next()
                    .unwrap_or("")
                    .into(),
                None => significant(v * by),
            };
            let difference = match half {
                Some(half) => plus_minus(difference, half),
                None => significant(difference),
            };
            [digits(p.values[0]), digits(p.values[1]), difference]
        }
        false => [
            plus_minus(p.mean * by, p.spread * by)
                .split(' ')
                .next()
                .unwrap_or("")
                .into(),
            significant(p.spread * by),
            p.repeatability
                .map_or_else(String::new, |r| significant(r * by)),
        ],
    };
    let [a, b, c] = cells;
    format!("{mark} {name:<40} {a:>13} {b:>13} {c:>17}  {chance}")
}
