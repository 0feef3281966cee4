//! Judgements of clean sessions and of sessions with an effect.

use std::collections::BTreeMap;
use std::time::Instant;

use mimu::judgement::JudgementKind::{self, Good, Misfit, Suspect, Unexplained, Untested};
use mimu_tests::judged::{Clean, Judged, Kind, Pair, WithEffect, pairs_of_array};
use mimu_tests::sessions::ARRAY_UNITS;
use rayon::prelude::*;

use super::planted::median;

/// Results of the sessions of a kind.
#[derive(Debug, Default)]
struct Row {
    clean: Vec<Clean>,
    with_effect: Vec<WithEffect>,
}

/// Judgements from the best to the worst, and a refusal.
fn kinds() -> [Option<JudgementKind>; 6] {
    [
        Some(Good),
        Some(Untested),
        Some(Suspect),
        Some(Unexplained),
        Some(Misfit),
        None,
    ]
}

/// `part` of `all` in per cent.
fn share(part: usize, all: usize) -> String {
    match all {
        0 => "-".into(),
        _ => format!("{:.1}", 100.0 * part as f64 / all as f64),
    }
}

/// Share of the judgements that `is` selects.
fn of<'a>(all: impl Iterator<Item = &'a Judged> + Clone, is: impl Fn(&Judged) -> bool) -> String {
    share(all.clone().filter(|j| is(j)).count(), all.count())
}

/// Power: the effect's strength, how often a fit objects, how often it is found, how often a calibration is still called good.
const POWER: &str =
    "effect over noise, median | fit: unexplained or worse | found | its file verified: good";

fn power(all: &[&WithEffect]) -> String {
    let strengths: Vec<f64> = all.iter().map(|w| w.strength).collect();
    let strength = median(&strengths).map_or("-".into(), |m| format!("{m:.1}"));
    let judged = all.iter().map(|w| &w.judged);
    // A refusal is no better than the worst judgement.
    let worse = of(judged, |j| j.kind.is_none_or(|kind| kind >= Unexplained));
    let found: Vec<bool> = all
        .iter()
        .filter_map(|w| Some(w.found.as_ref()?.is_right))
        .collect();
    let found = share(found.iter().filter(|right| **right).count(), found.len());
    let verified = all.iter().filter_map(|w| w.verified.as_ref());
    let good = of(verified, |j| j.kind == Some(Good));
    format!("{strength} | {worse} | {found} | {good}")
}

impl Row {
    fn line(&self, name: &str) -> String {
        let judged = || self.clean.iter().map(|c| &c.judged);
        let kinds = kinds().map(|kind| of(judged(), |j| j.kind == kind));
        let inside = [0, 1].map(|k| {
            let sum = |part: usize| self.clean.iter().map(|c| c.inside[k][part] as usize).sum();
            share(sum(0), sum(1))
        });
        let verified = self.clean.iter().filter_map(|c| c.verified.as_ref());
        let with_effect: Vec<&WithEffect> = self.with_effect.iter().collect();
        format!(
            "| {name} | {} | {} | {} | {} | {} | {} | {} |",
            self.clean.len().max(self.with_effect.len()),
            kinds.join(" | "),
            of(judged(), Judged::is_unobjected),
            inside.join(" | "),
            of(verified, Judged::is_unobjected),
            with_effect.len(),
            power(&with_effect)
        )
    }
}

/// `sessions` sessions of each kind whose name contains one of `chosen`. A line for each session goes to standard error.
pub fn run(sessions: u64, chosen: &[&str]) {
    let started = Instant::now();
    let mut kinds = Kind::all();
    kinds.retain(|k| chosen.is_empty() || chosen.iter().any(|c| k.name().contains(c)));
    println!(
        "| kind, % | sessions | good | untested | suspect | unexplained | misfit | refused | good or untested | gyro intervals | accelerometer intervals | verified: good or untested | with an effect | {POWER} |\n|---|{}",
        "---:|".repeat(16)
    );
    let mut rows = Vec::new();
    for kind in &kinds {
        let began = Instant::now();
        let of = |seed| {
            let clean = kind.clean(seed);
            let with_effect = kind.with_effect(seed, true);
            eprintln!("{}", told(kind, seed, &clean, with_effect.as_ref()));
            (clean, with_effect)
        };
        let all: Vec<_> = (0..sessions).into_par_iter().map(of).collect();
        let (clean, with_effect): (_, Vec<_>) = all.into_iter().unzip();
        let row = Row {
            clean,
            with_effect: with_effect.into_iter().flatten().collect(),
        };
        eprintln!("# {}: {:.0} s", kind.name(), began.elapsed().as_secs_f64());
        println!("{}", row.line(&kind.name()));
        rows.push(row);
    }
    let mut by_effect: BTreeMap<&str, Vec<&WithEffect>> = BTreeMap::new();
    for with_effect in rows.iter().flat_map(|row| &row.with_effect) {
        let of_effect = by_effect.entry(&with_effect.id).or_default();
        of_effect.push(with_effect);
    }
    println!(
        "\n| effect, % | sessions | {POWER} |\n|---|{}",
        "---:|".repeat(5)
    );
    for (id, all) in by_effect {
        println!("| `{id}` | {} | {} |", all.len(), power(&all));
    }
    eprintln!("# all: {:.0} s", started.elapsed().as_secs_f64());
}

/// Fits of the sessions of an array by other people, and their files on the next session of the unit: as recorded, and with a planted quadratic.
pub fn array() {
    println!(
        "| array | pairs | of | good | untested | suspect | unexplained | misfit | refused |\n|---|---:|---|---:|---:|---:|---:|---:|---:|"
    );
    for (what, effect) in [
        ("as recorded", None),
        (
            "quadratic of 5 mg/g² planted",
            Some(("accel_scale_quadratic", 5.0)),
        ),
    ] {
        let units = (0..ARRAY_UNITS).into_par_iter();
        let pairs: Option<Vec<_>> = units.map(|unit| pairs_of_array(unit, effect)).collect();
        let Some(pairs) = pairs else {
            return;
        };
        let pairs: Vec<Pair> = pairs.into_iter().flatten().collect();
        for pair in &pairs {
            let [unit, session] = pair.of;
            eprintln!(
                "unit {unit}, session {session}, {what}: fit {} ({}); verified {} ({})",
                pair.judged.name(),
                pair.judged.reason,
                pair.verified.name(),
                pair.verified.reason
            );
        }
        let counts = |of: fn(&Pair) -> &Judged| {
            let count = |kind| pairs.iter().filter(|p| of(p).kind == kind).count();
            kinds().map(|kind| count(kind).to_string()).join(" | ")
        };
        let of_fits = counts(|p| &p.judged);
        let of_files = counts(|p| &p.verified);
        println!("| {what} | {} | fit | {of_fits} |", pairs.len());
        println!("| | | its file on the next session | {of_files} |");
    }
}

/// What is said of a session, with the reasons of what is wrong.
fn told(kind: &Kind, seed: u64, clean: &Clean, with: Option<&WithEffect>) -> String {
    let objection = |what: &str, judged: Option<&Judged>, wrong: bool| match judged {
        None => String::new(),
        Some(j) if wrong => format!("; {what} {} ({})", j.name(), j.reason),
        Some(j) => format!("; {what} {}", j.name()),
    };
    let mut out = format!("{}, seed {seed}", kind.name());
    for (what, judged) in [
        ("clean", Some(&clean.judged)),
        ("verified", clean.verified.as_ref()),
    ] {
        out += &objection(what, judged, judged.is_some_and(|j| !j.is_unobjected()));
    }
    if let Some(with) = with {
        out += &format!("; `{}` of {:.2}", with.id, with.strength);
        for (what, judged) in [
            ("fit", Some(&with.judged)),
            ("verified", with.verified.as_ref()),
        ] {
            let good = judged.is_some_and(|j| j.kind == Some(Good));
            out += &objection(what, judged, good);
        }
        if let Some(found) = &with.found {
            out += &format!("; diagnosis {} {:?}", found.verdict, found.ids);
        }
    }
    out
}
