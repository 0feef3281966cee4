//! Judgements of clean sessions and of sessions with an effect.

use std::time::Instant;

use mimu::judgement::JudgementKind::{self, Good, Misfit, Suspect, Unexplained, Untested};
use mimu_tests::judged::{Clean, Judged, Kind, Pair, WithEffect, pairs_of_array};
use mimu_tests::sessions::ARRAY_UNITS;
use mimu_tests::study::{Figure, Table, counted};
use rayon::prelude::*;

/// Judgements from the best to the worst, and a refusal.
const KINDS: [Option<JudgementKind>; 6] = [
    Some(Good),
    Some(Untested),
    Some(Suspect),
    Some(Unexplained),
    Some(Misfit),
    None,
];

/// Of clean sessions, %.
const CLEAN: [&str; 10] = [
    "good",
    "untested",
    "suspect",
    "unexplained",
    "misfit",
    "refused",
    "good or untested",
    "gyro intervals",
    "accelerometer intervals",
    "verified: good or untested",
];

/// Power: how often a fit objects, how often the effect is found, how often a calibration is still called good.
const POWER: [(&str, Figure); 5] = [
    ("with an effect", Figure::Sum),
    ("effect over noise, median", Figure::Median),
    ("fit: unexplained or worse", Figure::Percent),
    ("found", Figure::Percent),
    ("its file verified: good", Figure::Percent),
];

fn of_clean(clean: &Clean) -> [f64; 10] {
    let mut values = [f64::NAN; 10];
    for (value, kind) in values.iter_mut().zip(KINDS) {
        *value = counted(clean.judged.kind == kind);
    }
    values[6] = counted(clean.judged.is_unobjected());
    let verified = clean.verified.as_ref();
    values[9] = verified.map_or(f64::NAN, |of| counted(of.is_unobjected()));
    values
}

fn power(with: &WithEffect) -> [f64; 5] {
    // A refusal is no better than the worst judgement.
    let worse = with.judged.kind.is_none_or(|kind| kind >= Unexplained);
    let good = |judged: &Judged| counted(judged.kind == Some(Good));
    [
        1.0,
        with.strength,
        counted(worse),
        with.is_right().map_or(f64::NAN, counted),
        with.verified.as_ref().map_or(f64::NAN, good),
    ]
}

/// `sessions` sessions of each kind whose name contains one of `chosen`. A line for each session goes to standard error.
pub fn run(sessions: u64, chosen: &[&str]) {
    let started = Instant::now();
    let mut kinds = Kind::all();
    kinds.retain(|k| chosen.is_empty() || chosen.iter().any(|c| k.name().contains(c)));
    let columns = CLEAN.map(|c| (c, Figure::Percent)).into_iter().chain(POWER);
    let mut by_kind = Table::new(&columns.collect::<Vec<_>>());
    let mut by_effect = Table::new(&POWER);
    for kind in &kinds {
        let (began, name) = (Instant::now(), kind.name());
        let of = |seed| {
            let clean = kind.clean(seed);
            let with_effect = kind.with_effect(seed, true);
            eprintln!("{}", told(kind, seed, &clean, with_effect.as_ref()));
            (clean, with_effect)
        };
        let all: Vec<_> = (0..sessions).into_par_iter().map(of).collect();
        for (clean, with_effect) in &all {
            let power = with_effect.as_ref().map_or([f64::NAN; 5], power);
            by_kind.add(&name, &[&of_clean(clean)[..], &power].concat());
            for (sensor, [held, all]) in clean.inside.into_iter().enumerate() {
                let mut values = [f64::NAN; 15];
                for k in 0..all {
                    values[7 + sensor] = counted(k < held);
                    by_kind.add(&name, &values);
                }
            }
            if let Some(with) = with_effect {
                by_effect.add(format!("`{}`", with.id), &power);
            }
        }
        eprintln!("# {name}: {:.0} s", began.elapsed().as_secs_f64());
    }
    by_kind.print(&format!("{sessions} sessions of each kind, %"));
    by_effect.print("by effect, %");
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
            KINDS.map(|kind| count(kind).to_string()).join(" | ")
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
            out += &format!("; diagnosis {} {:?}", found.verdict, found.ids());
        }
    }
    out
}
