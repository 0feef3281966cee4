//! `make blind`: units with effects that are not declared to the diagnosis, and what it finds, as tables.
//!
//! `blind SEEDS CLEAN [NAME...]`: SEEDS seeds of each effect and pair, and CLEAN clean units. Names select effects, and print each case. Every case
//! has its own recording.
//!
//! | | |
//! |---|---|
//! | `blind by-hand SEEDS CLEAN [NAME...]` | the same for units by hand, for each grade |
//! | `blind earth RUNS [NAME...]` | the Earth's rate in the biases of gyros on a table, with the latitude and without it |
//! | `blind judged SESSIONS [NAME...]` | judgements of clean sessions of each kind, and of sessions with an effect of five times the noise: false alarms and power; NAMEs select kinds |
//! | `blind judged array` | judgements of an array of eight units, recorded by other people in nine sessions, with a planted quadratic and without it |
//! | `blind planted SEEDS TIMES [NAME...]` | each effect planted SEEDS times, at TIMES the size of data sheets, in recordings by other people; NAMEs also select recordings |

mod by_hand;
mod earth;
mod judged;
mod planted;

use std::collections::BTreeMap;

use mimu_rig::effects::specs;
use mimu_tests::blind::{Case, case_on, is_listed, plan};
use rayon::prelude::*;

/// Pairs of effects, in one sensor and in both.
const PAIRS: [[&str; 2]; 10] = [
    ["gyro_g_sensitivity", "gyro_scale_cubic"],
    ["gyro_g_sensitivity", "gyro_thermal_bias"],
    ["gyro_scale_quadratic", "gyro_bias_drift"],
    ["gyro_scale_asymmetry", "gyro_warm_up"],
    ["gyro_thermal_scale", "gyro_g_sensitivity"],
    ["accel_scale_quadratic", "accel_size_effect"],
    ["accel_scale_cubic", "accel_thermal_scale"],
    ["accel_cross_axis_product", "accel_bias_drift"],
    ["accel_scale_quadratic", "gyro_g_sensitivity"],
    ["accel_warm_up", "gyro_scale_cubic"],
];

/// Classes of strength (effect over the noise of a dwell mean) in the tables.
const CLASSES: [(f64, &str); 5] = [
    (0.5, "below 0.5"),
    (1.0, "0.5 to 1"),
    (2.0, "1 to 2"),
    (5.0, "2 to 5"),
    (f64::INFINITY, "above 5"),
];

/// Results of several cases.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    cases: u32,
    detected: u32,
    right: u32,
    /// All effects named, and others besides.
    more: u32,
    wrong: u32,
    missed: u32,
    /// Right ones whose held-out error with the effects is at most 1.2 times the noise floor.
    at_floor: u32,
    /// The same with every fourth dwell held out instead of blocks of time.
    between: u32,
    /// Right ones whose held-out error is at most 1.2 times that of the same unit, with the same noise, that lacks the effect.
    at_clean: u32,
}

impl Tally {
    fn add(&mut self, case: &Case, clean: Option<&Case>) {
        self.cases += 1;
        let all = case.truth.iter().all(|t| case.found.contains(t));
        self.detected += u32::from(case.verdict != "clean");
        match (all, case.found.len() == case.truth.len(), case.verdict) {
            (true, true, _) => {
                self.right += 1;
                self.at_floor += u32::from(case.after <= 1.2);
                self.between += u32::from(case.interleaved <= 1.2);
                let of = |c: &Case| c.held_out[case.judged as usize];
                self.at_clean += u32::from(clean.is_some_and(|c| of(case) <= 1.2 * of(c)));
            }
            (true, false, _) => self.more += 1,
            (false, _, "clean") => self.missed += 1,
            // Nothing is named, but the verdict reports an error.
            (false, _, _) if case.found.is_empty() => {}
            (false, ..) => self.wrong += 1,
        }
    }

    fn row(&self, name: &str) -> String {
        let Self {
            cases,
            detected,
            right,
            more,
            wrong,
            missed,
            at_floor,
            between,
            at_clean,
        } = self;
        format!(
            "| {name} | {cases} | {detected} | {right} | {more} | {wrong} | {missed} | {at_floor} | {between} | {at_clean} |"
        )
    }
}

const HEAD: &str = "| | cases | detected | named right | right and more | named wrong | missed | right, error after at most 1.2 floors | the same, every fourth dwell held out | at most 1.2 times that without the effect |\n|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|";

fn main() {
    let mut args: Vec<String> = std::env::args().skip(1).collect();
    let in_hands = args.first().is_some_and(|a| a == "by-hand");
    let planted = args.first().is_some_and(|a| a == "planted");
    if in_hands || planted {
        args.remove(0);
    }
    if args.first().is_some_and(|a| a == "earth") {
        let runs = args.get(1).and_then(|s| s.parse().ok()).unwrap_or(100);
        let chosen: Vec<&str> = args.iter().skip(2).map(String::as_str).collect();
        return earth::run(runs, &chosen);
    }
    if args.first().is_some_and(|a| a == "judged") {
        let chosen: Vec<&str> = args.iter().skip(2).map(String::as_str).collect();
        if args.get(1).is_some_and(|a| a == "array") {
            return judged::array();
        }
        let sessions = args.get(1).and_then(|s| s.parse().ok()).unwrap_or(100);
        return judged::run(sessions, &chosen);
    }
    let number = |k: usize, default| args.get(k).and_then(|s| s.parse().ok()).unwrap_or(default);
    let (seeds, clean): (u64, u64) = (number(0, 20), number(1, 200));
    let chosen: Vec<&str> = args.iter().skip(2).map(String::as_str).collect();
    if planted {
        let times = args.get(1).and_then(|s| s.parse().ok()).unwrap_or(1.0);
        return planted::run(number(0, 1), times, &chosen);
    }
    if in_hands {
        return by_hand::run(seeds, clean, &chosen);
    }
    let mut kinds: Vec<Vec<&str>> = specs().map(|s| vec![s.id]).collect();
    kinds.extend(PAIRS.iter().map(|p| p.to_vec()));
    kinds.retain(|ids| chosen.is_empty() || chosen.iter().any(|c| ids.join("+").contains(c)));
    let mut jobs: Vec<(Vec<&str>, u64)> = (0..clean).map(|seed| (Vec::new(), seed)).collect();
    for ids in &kinds {
        jobs.extend((0..seeds).map(|seed| (ids.clone(), seed)));
    }
    let cases: Vec<(String, u64, Case)> = jobs
        .into_par_iter()
        .map(|(ids, seed)| {
            let name = ids.join(" + ");
            let case = case_on(&plan(seed), &ids, seed);
            if !chosen.is_empty() {
                println!("{name}, seed {seed}: {case:?}");
            }
            (name, seed, case)
        })
        .collect();
    tables(&cases);
}

fn tables(cases: &[(String, u64, Case)]) {
    let mut by_kind: BTreeMap<&str, Tally> = BTreeMap::new();
    let mut by_class = [[Tally::default(); 2]; CLASSES.len()];
    let mut unlisted: BTreeMap<&str, [u32; 6]> = BTreeMap::new();
    let mut false_alarms = Vec::new();
    let mut clean = 0;
    let without = |seed: u64| cases.iter().find(|c| c.1 == seed && c.2.truth.is_empty());
    for (name, seed, case) in cases {
        let without = without(*seed).map(|c| &c.2);
        if case.truth.is_empty() {
            clean += 1;
            if case.verdict != "clean" {
                false_alarms.push(case);
            }
        } else if !case.truth.iter().all(|id| is_listed(id)) {
            let right = |f: &String| case.truth.contains(f);
            let wrong = |f: &String| !f.starts_with("term:") && !right(f);
            let listed = case.found.iter().any(wrong);
            let count = unlisted.entry(name).or_default();
            count[0] += 1;
            count[1] += u32::from(case.verdict == "unexplained");
            count[2] += u32::from(case.verdict == "clean");
            let explained = case.verdict == "explained";
            let rightly = explained && !listed && case.found.iter().any(right);
            count[3] += u32::from(rightly);
            count[4] += u32::from(explained && !rightly);
            count[5] += u32::from(case.verdict == "refused");
        } else {
            by_kind.entry(name).or_default().add(case, without);
            // The weaker effect determines the strength of a pair.
            let strength = case.strength.iter().copied().fold(f64::INFINITY, f64::min);
            let class = CLASSES
                .iter()
                .position(|c| strength < c.0)
                .unwrap_or(CLASSES.len() - 1);
            by_class[class][usize::from(case.truth.len() > 1)].add(case, without);
        }
    }
    println!(
        "clean units: {} false alarms of {clean}",
        false_alarms.len()
    );
    for case in false_alarms {
        println!("  {case:?}");
    }
    for (k, title) in ["one effect", "two effects"].iter().enumerate() {
        println!("\n{title}, by strength\n\n{HEAD}");
        for (class, (_, name)) in by_class.iter().zip(CLASSES) {
            println!("{}", class[k].row(name));
        }
    }
    println!("\nby effect\n\n{HEAD}");
    for (name, tally) in &by_kind {
        println!("{}", tally.row(&format!("`{name}`")));
    }
    println!(
        "\neffects on no list\n\n| | cases | unexplained | clean | named rightly | explained by another effect | refused |\n|---|---:|---:|---:|---:|---:|---:|"
    );
    for (name, [cases, unexplained, missed, rightly, passed, refused]) in &unlisted {
        println!(
            "| `{name}` | {cases} | {unexplained} | {missed} | {rightly} | {passed} | {refused} |"
        );
    }
}
