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

use mimu_rig::effects::specs;
use mimu_tests::blind::{Case, case_on, is_listed, plan};
use mimu_tests::study::{Figure, Table, class, counted};
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

const LISTED: [&str; 9] = [
    "cases",
    "detected",
    "named right",
    "right and more",
    "named wrong",
    "missed",
    "right, error after at most 1.2 floors",
    "the same, every fourth dwell held out",
    "at most 1.2 times that without the effect",
];

/// Of a case with listed effects, in the columns [`LISTED`]. `clean`: the same unit with the same noise that lacks them.
fn of_listed(case: &Case, clean: Option<&Case>) -> [f64; 9] {
    let (said, ids) = (&case.said, case.said.ids());
    let all = case.truth.iter().all(|t| ids.contains(&t.as_str()));
    let right = all && ids.len() == case.truth.len();
    let missed = !all && said.verdict == "clean";
    let of = |c: &Case| c.held_out[case.judged as usize];
    [
        true,
        said.verdict != "clean",
        right,
        all && !right,
        // Nothing may be named, while the verdict reports an error.
        !all && !missed && !ids.is_empty(),
        missed,
        right && case.after <= 1.2,
        right && case.interleaved <= 1.2,
        right && clean.is_some_and(|c| of(case) <= 1.2 * of(c)),
    ]
    .map(counted)
}

const UNLISTED: [&str; 6] = [
    "cases",
    "unexplained",
    "clean",
    "named rightly",
    "explained by another effect",
    "refused",
];

/// Of a case with effects on no list, in the columns [`UNLISTED`].
fn of_unlisted(case: &Case) -> [f64; 6] {
    let (verdict, ids) = (case.said.verdict, case.said.ids());
    let right = |f: &&str| case.truth.iter().any(|t| t == f);
    let wrong = |f: &&str| !f.starts_with("term:") && !right(f);
    let explained = verdict == "explained";
    let rightly = explained && !ids.iter().any(wrong) && ids.iter().any(right);
    [
        true,
        verdict == "unexplained",
        verdict == "clean",
        rightly,
        explained && !rightly,
        verdict == "refused",
    ]
    .map(counted)
}

fn main() {
    let mut args: Vec<String> = std::env::args().skip(1).collect();
    let studies = ["by-hand", "planted", "earth", "judged"];
    let study = args.first().filter(|a| studies.contains(&a.as_str()));
    let study = study.cloned().unwrap_or_default();
    if !study.is_empty() {
        args.remove(0);
    }
    let number = |k: usize, default| args.get(k).and_then(|s| s.parse().ok()).unwrap_or(default);
    let chosen =
        |from: usize| -> Vec<&str> { args.iter().skip(from).map(String::as_str).collect() };
    match study.as_str() {
        "earth" => earth::run(number(0, 100), &chosen(1)),
        "judged" if chosen(0) == ["array"] => judged::array(),
        "judged" => judged::run(number(0, 100), &chosen(1)),
        "planted" => {
            let times = args.get(1).and_then(|s| s.parse().ok()).unwrap_or(1.0);
            planted::run(number(0, 1), times, &chosen(2));
        }
        "by-hand" => by_hand::run(number(0, 20), number(1, 200), &chosen(2)),
        _ => on_table(number(0, 20), number(1, 200), &chosen(2)),
    }
}

fn on_table(seeds: u64, clean: u64, chosen: &[&str]) {
    let mut kinds: Vec<Vec<&str>> = specs().map(|s| vec![s.id]).collect();
    kinds.extend(PAIRS.iter().map(|p| p.to_vec()));
    kinds.retain(|ids| chosen.is_empty() || chosen.iter().any(|c| ids.join("+").contains(c)));
    let mut jobs: Vec<(Vec<&str>, u64)> = (0..clean).map(|seed| (Vec::new(), seed)).collect();
    for ids in &kinds {
        jobs.extend((0..seeds).map(|seed| (ids.clone(), seed)));
    }
    let cases = jobs.into_par_iter().map(|(ids, seed)| {
        let case = case_on(&plan(seed), &ids, seed);
        if !chosen.is_empty() {
            println!("{}, seed {seed}: {case:?}", ids.join(" + "));
        }
        (seed, case)
    });
    let cases: Vec<(u64, Case)> = cases.collect();
    let (clean, others): (Vec<_>, Vec<_>) = cases.iter().partition(|c| c.1.truth.is_empty());
    let alarms = || clean.iter().filter(|c| c.1.said.verdict != "clean");
    println!(
        "clean units: {} false alarms of {}",
        alarms().count(),
        clean.len()
    );
    alarms().for_each(|(_, case)| println!("  {case:?}"));
    let listed = || Table::new(&LISTED.map(|c| (c, Figure::Sum)));
    let (mut by_class, mut by_effect) = ([listed(), listed()], listed());
    let mut unlisted = Table::new(&UNLISTED.map(|c| (c, Figure::Sum)));
    for (seed, case) in others {
        let name = format!("`{}`", case.truth.join(" + "));
        if !case.truth.iter().all(|id| is_listed(id)) {
            unlisted.add(name, &of_unlisted(case));
            continue;
        }
        let without = clean.iter().find(|c| c.0 == *seed);
        let values = of_listed(case, without.map(|c| &c.1));
        by_effect.add(name, &values);
        // The weaker effect determines the strength of a pair.
        let strength = case.strength.iter().copied().fold(f64::INFINITY, f64::min);
        let class = class(strength, &CLASSES).unwrap_or("refused");
        by_class[usize::from(case.truth.len() > 1)].add(class, &values);
    }
    by_class[0].print("one effect, by strength");
    by_class[1].print("two effects, by strength");
    by_effect.print("by effect");
    unlisted.print("effects on no list");
}
