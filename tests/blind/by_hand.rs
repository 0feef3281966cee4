//! Units recorded by hand.

use std::collections::BTreeMap;

use mimu_tests::by_hand::{Case, Grade, SHOWN, case};
use rayon::prelude::*;

/// Ratio of effect to noise above which a case counts: no test needs to see a smaller effect.
const STRONG: f64 = 5.0;

#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    cases: u32,
    named: u32,
    alone: u32,
    right_verdict: u32,
    /// An effect was named that the unit lacks.
    not_there: u32,
    refused: u32,
}

impl Tally {
    fn add(&mut self, case: &Case) {
        self.cases += 1;
        let named = |t: &&str| case.found.iter().any(|f| f.iter().any(|f| f == t));
        self.named += u32::from(case.truth.iter().all(named));
        self.alone += u32::from(case.is_named_alone());
        self.right_verdict += u32::from(case.has_right_verdict() && case.is_named_alone());
        self.not_there += u32::from(case.found.iter().any(|f| !case.is_right(f)));
        self.refused += u32::from(case.verdict == "refused");
    }

    fn row(&self, name: &str) -> String {
        let Self {
            cases,
            named,
            alone,
            right_verdict,
            not_there,
            refused,
        } = self;
        format!(
            "| {name} | {cases} | {named} | {alone} | {right_verdict} | {not_there} | {refused} |"
        )
    }
}

const HEAD: &str = "| | cases | named | named alone | alone, and the right verdict | something named that is not there | refused |\n|---|---:|---:|---:|---:|---:|---:|";

/// Runs `seeds` seeds of each effect and `clean` clean units in each grade. Every second case has the flaws of real recordings.
pub fn run(seeds: u64, clean: u64, chosen: &[&str]) {
    let mut jobs: Vec<(Vec<&'static str>, Grade, u64)> = Vec::new();
    for grade in Grade::ALL {
        jobs.extend((0..clean).map(|seed| (Vec::new(), grade, seed)));
        for id in SHOWN {
            if chosen.is_empty() || chosen.iter().any(|c| id.contains(c)) {
                jobs.extend((0..seeds).map(|seed| (vec![id], grade, seed)));
            }
        }
    }
    let cases: Vec<(u64, Case)> = jobs
        .into_par_iter()
        .map(|(ids, grade, seed)| (seed, case(&ids, grade, seed, seed % 2 == 1)))
        .collect();
    for (seed, case) in &cases {
        let strong = case.truth.is_empty() || case.strength > STRONG;
        if strong && !(case.is_named_alone() && case.has_right_verdict())
            || case.found.iter().any(|f| !case.is_right(f))
        {
            println!("seed {seed}: {case:?}");
        }
    }
    tables(&cases);
}

fn tables(cases: &[(u64, Case)]) {
    for (title, strong) in [
        ("above five times the noise, and clean units", true),
        ("weaker", false),
    ] {
        let mut rows: BTreeMap<String, Tally> = BTreeMap::new();
        for (_, case) in cases {
            let is_strong = case.truth.is_empty() || case.strength > STRONG;
            if is_strong != strong {
                continue;
            }
            let name = match case.truth.is_empty() {
                true => "clean".to_string(),
                false => format!("`{}`", case.truth.join(" + ")),
            };
            let flaws = if case.flawed { "flawed" } else { "no flaws" };
            let kind = if case.truth.is_empty() {
                "clean"
            } else {
                "with an effect"
            };
            let sums = [
                name,
                format!("{kind}, {:?}", case.grade),
                format!("{kind}, {flaws}"),
                format!("{kind}, all"),
            ];
            for name in sums {
                rows.entry(name).or_default().add(case);
            }
        }
        println!("\n{title}\n\n{HEAD}");
        for (name, tally) in rows {
            println!("{}", tally.row(&name));
        }
    }
    println!(
        "\nintervals of 95 % that hold the truth\n\n| | gyro | accelerometer |\n|---|---:|---:|"
    );
    for grade in Grade::ALL {
        for clean in [true, false] {
            let what = if clean { "clean" } else { "effect named" };
            let of = |c: &Case| c.grade == grade && c.truth.is_empty() == clean;
            coverage(&format!("{grade:?}, {what}"), cases, of);
        }
    }
    for id in SHOWN {
        coverage(&format!("`{id}`"), cases, |c: &Case| c.truth == [id]);
    }
}

/// How often the intervals contained the truth in the cases that `is_counted` selects: those whose model has exactly the right effects.
fn coverage(name: &str, cases: &[(u64, Case)], is_counted: impl Fn(&Case) -> bool) {
    let mut sums = [[0; 2]; 2];
    let each = cases.iter().map(|c| &c.1);
    for case in each.filter(|c| is_counted(c) && c.is_named_alone()) {
        for (sum, inside) in sums.iter_mut().flatten().zip(case.inside.iter().flatten()) {
            *sum += inside;
        }
    }
    let share = |[held, all]: [u32; 2]| match all {
        0 => "-".into(),
        _ => format!("{:.1} %", 100.0 * f64::from(held) / f64::from(all)),
    };
    println!("| {name} | {} | {} |", share(sums[0]), share(sums[1]));
}
