//! A verification as text.

use std::fmt::Write as _;

use mimu::calibration::verify::{Causes, SensorVerification, Verification, WholeTurnsOfAxis};
use mimu::judgement::JudgementKind;
use mimu::quantity::{AXES, Figure, Sensor, plural, plus_minus, significant};
use mimu::readable;
use mimu::warning::Warning;

use crate::report::table::{Cell, Table};
use crate::report::text::{counted, kinds, warn, warn_within, wrap};

/// Result of `mimu verify`: a summary, or with `verbose` all warnings.
pub fn verify_text(verification: &Verification, verbose: bool) -> String {
    let mut out = format!("judgement: {}\n", verification.judgement);
    for (name, s) in verification.sensors.present() {
        wrap(&mut out, &format!("{name}: "), &verdict(s));
    }
    let _ = writeln!(out);
    let one = [(String::new(), verification.clone())];
    out += &errors(&one, false).text("");
    for turned in &verification.whole_turns {
        wrap(&mut out, "gyro: ", &whole_turns(turned));
    }
    for (name, s) in verification.sensors.present() {
        let _ = writeln!(out, "{name}: {}, rms", s.figure.description());
    }
    wrap(
        &mut out,
        "one for all: ",
        "the error with one scale factor and one bias for all three axes, the means of the calibration's",
    );
    for (name, s) in verification.sensors.present() {
        if let Some(causes) = s.causes.as_ref().filter(|_| verbose || beyond_noise(s)) {
            causes_text(&mut out, name, causes);
        }
    }
    let all = verification.warnings.iter();
    match verbose {
        true => warn(&mut out, all),
        false => {
            let decisive = |w: &&Warning| w.to_string() == verification.judgement.reason;
            let kinds = kinds(all.filter(|w| !decisive(w)), Warning::is_like);
            warn_within(
                &mut out,
                kinds.map(|(w, more)| counted(w.to_string(), more)),
                1,
            );
        }
    }
    let _ = writeln!(out, "next: {}", next(verification));
    out
}

/// `360 deg about x read as 360.4 ± 0.1 deg (356.1 uncalibrated): 40 turns, put back 4 times`.
pub(super) fn whole_turns(turned: &WholeTurnsOfAxis) -> String {
    let WholeTurnsOfAxis {
        axis,
        times,
        turns,
        error_deg_per_turn: error,
        half_width_deg_per_turn: half,
        ..
    } = turned;
    let how = match turned.uncalibrated_deg_per_turn {
        Some(_) => "uncalibrated",
        None => "with one scale factor for all axes",
    };
    let before = turned.before_deg_per_turn();
    let before = before.map(|before| format!(" ({:.2} {how})", 360.0 + before));
    let each_way = turned.asymmetric().map(|ways| {
        let [forwards, backwards] = ways.map(|[error, half]| plus_minus(360.0 + error, half));
        format!("; forwards {forwards}, backwards {backwards} deg")
    });
    format!(
        "360 deg about {axis} read as {} deg{}: {turns} turns, put back {}{}",
        plus_minus(360.0 + error, *half),
        before.unwrap_or_default(),
        plural(*times as u64, "time"),
        each_way.unwrap_or_default()
    )
}

/// What the gyro reads for whole turns, by recording and axis; `used`: whether the calibration was made from the recording.
pub(super) fn whole_turns_table(all: &[(String, bool, Vec<WholeTurnsOfAxis>)]) -> Table {
    let each = || all.iter().flat_map(|(_, _, turned)| turned);
    let as_came = each().any(|turned| turned.uncalibrated_deg_per_turn.is_some());
    let before = match as_came {
        true => "uncalibrated",
        false => "one scale factor for all axes",
    };
    let mut table = Table::new(
        "Degrees that the gyro reads for one turn of 360 degrees, by whole turns after which the unit was put back; 95 % intervals by how well it was put back",
        "axis",
    )
    .numbers([before, "calibrated", "turns", "put back"])
    .words("used by the fit")
    .on_page("recording");
    for (name, used, turned) in all {
        for of in turned {
            let before = of.before_deg_per_turn().map(|error| 360.0 + error);
            table.row([
                of.axis.into(),
                Cell::known(before, 1.0),
                Cell::Interval {
                    si: 360.0 + of.error_deg_per_turn,
                    half: of.half_width_deg_per_turn,
                    factor: 1.0,
                },
                Cell::Count(u64::from(of.turns)),
                Cell::Count(of.times as u64),
                Cell::from(if *used { "yes" } else { "no" }),
                Cell::Code(name.clone()),
            ]);
        }
    }
    table
}

/// Errors on recordings that the calibration was not made from, by recording and sensor; `named`: with the names of the recordings.
pub(super) fn errors(all: &[(String, Verification)], named: bool) -> Table {
    type Of = dyn Fn(&SensorVerification) -> Option<f64>;
    let each = || all.iter().flat_map(|(_, v)| v.sensors.present());
    let has =
        |of: &dyn Fn(&SensorVerification) -> Option<f64>| each().any(|(_, s)| of(s).is_some());
    let optional: [(&str, &Of); 2] = [
        ("uncalibrated", &|s| s.rms_uncalibrated),
        ("effects left in", &|s| s.rms_affine),
    ];
    let optional: Vec<_> = optional.into_iter().filter(|(_, of)| has(of)).collect();
    let rest = readable::error("rad/s");
    let at_rest = has(&|s| s.static_rms);
    let mut table = Table::new(
        "Error of the calibration on other recordings, rms; noise: what noise alone would cause",
        "rms error",
    )
    .numbers(["calibrated", "noise", "largest", "one for all"])
    .numbers(optional.iter().map(|(head, _)| *head))
    .numbers(at_rest.then(|| format!("at rest, {}", rest.unit)))
    .words("over");
    if named {
        table = table.on_page("recording");
    }
    for (recording, v) in all {
        for (name, s) in v.sensors.present() {
            let unit = readable::error(s.unit);
            let noun = match s.figure {
                Figure::Direction => "turn",
                Figure::Input | Figure::GravityMagnitude | Figure::RateMagnitude => "dwell",
            };
            let figures = [s.rms, s.noise_floor, s.max, s.rms_raw].map(Some);
            let more = optional.iter().map(|(_, of)| of(s));
            let figures = figures.into_iter().chain(more);
            let figures = figures.map(|v| Cell::known(v, unit.factor));
            let still = at_rest.then(|| Cell::known(s.static_rms, rest.factor));
            let first = Cell::from(format!("{name}, {}", unit.unit));
            let over = Cell::from(plural(s.count as u64, noun));
            let name = named.then(|| Cell::Code(recording.clone()));
            let row = std::iter::once(first).chain(figures).chain(still);
            table.row(row.chain([over]).chain(name));
        }
    }
    table
}

fn beyond_noise(s: &SensorVerification) -> bool {
    s.test.is_none_or(|test| test.fails())
}

/// How much the bias has changed, and how much of the error that explains.
fn causes_text(out: &mut String, name: Sensor, causes: &Causes) {
    let unit = readable::parameter(name.unit());
    let changes = AXES.iter().enumerate().map(|(k, axis)| {
        let [change, half] =
            [causes.bias_change[k], causes.bias_change_interval[k]].map(|v| v * unit.factor);
        format!("{axis} {}", plus_minus(change, half))
    });
    let changes: Vec<String> = changes.collect();
    let text = format!(
        "the bias has changed by {} {}; of the error {}",
        changes.join(", "),
        unit.unit,
        causes.words()
    );
    wrap(out, &format!("{name}: "), &text);
}

/// Next step after the verification.
fn next(verification: &Verification) -> String {
    let again = "fit this recording (mimu fit), and compare both calibrations (mimu compare)";
    let contradicted = |w: &Warning| {
        matches!(
            w,
            Warning::OtherGravity {
                contradicted: true,
                ..
            }
        )
    };
    if verification.warnings.iter().any(contradicted) {
        return "give the recording the gravity of its place (mimu import --gravity), and verify again".into();
    }
    match verification.judgement.kind {
        JudgementKind::Good => {
            return "use the calibration: mimu export c FILE -o calibration.h, or kalibr, px4 ..."
                .into();
        }
        JudgementKind::Untested => {
            return "record more dwells or turns on another day, and verify with that recording"
                .into();
        }
        JudgementKind::Suspect => {
            return "correct what the judgement names (mimu import), and verify again".into();
        }
        JudgementKind::Unexplained | JudgementKind::Misfit => {}
    }
    let worst = verification.worst().and_then(|(_, s)| s.causes.as_ref());
    match worst {
        Some(c) if c.bias.value >= c.matrix.value.max(c.rest.value) => {
            "estimate the biases again and keep the matrices (mimu diagnose REC --calibration FILE -o NEW)".into()
        }
        Some(c) if c.rest.value >= c.matrix.value => {
            "find what the model lacks (mimu diagnose REC)".into()
        }
        _ => again.into(),
    }
}

/// Effect of the calibration on a sensor's error.
fn verdict(s: &SensorVerification) -> String {
    let figure = readable::error(s.unit);
    let (other, what) = match s.rms_uncalibrated {
        Some(came) => (came, "uncalibrated"),
        None => (s.rms_raw, "with one scale factor and bias for all axes"),
    };
    let [rms, before] = [s.rms, other].map(|v| figure.write(v));
    let how = match s.rms < other {
        true => format!("{rms} rms instead of {before} {what}"),
        false => format!("{rms} rms, not better than {before} {what}"),
    };
    let noise = match &s.test {
        Some(test) => format!(
            "{how}; {} times what noise predicts",
            significant(test.ratio)
        ),
        None => format!("{how}; the noise is unknown"),
    };
    match s.next_power_on {
        Some(next) => format!(
            "{noise}; a power-on changes it by up to {}, as the sessions showed",
            figure.write(next)
        ),
        None => match s.parameter_uncertainty {
            // Beside the noise a smaller one hardly counts.
            Some(own) if own > s.noise_floor => format!(
                "{noise}; the intervals of the calibration explain up to {}",
                figure.write(own)
            ),
            _ => noise,
        },
    }
}
