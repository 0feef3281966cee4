//! Biases that move slowly: as which effect each kind is identified.

use std::collections::BTreeMap;

use mimu_tests::by_hand::{Case, Grade};
use mimu_tests::slow_bias::Kind;
use rayon::prelude::*;

/// Effects that may be named first, by the end of their id.
const NAMED: [(&str, &str); 4] = [
    ("bias_drift", "drift"),
    ("warm_up", "warm-up"),
    ("thermal_bias", "thermal bias"),
    ("thermal_lag", "thermal lag"),
];

#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    cases: u32,
    right: u32,
    right_verdict: u32,
    alike: u32,
    named: [u32; NAMED.len()],
    products: u32,
    other: u32,
    nothing: u32,
    refused: u32,
}

impl Tally {
    fn add(&mut self, case: &Case) {
        self.cases += 1;
        let first: Vec<&str> = case.found.iter().map(|f| f[0].as_str()).collect();
        let all = case.truth.iter().all(|t| first.contains(t));
        let alone = all && first.len() == case.truth.len();
        self.right += u32::from(alone);
        self.right_verdict += u32::from(alone && case.has_right_verdict());
        self.alike += u32::from(!alone && case.is_named_alone());
        for (count, (end, _)) in self.named.iter_mut().zip(NAMED) {
            *count += u32::from(first.iter().any(|f| f.ends_with(end)));
        }
        self.products += u32::from(first.iter().any(|f| f.starts_with("term:")));
        let is_other =
            |f: &&str| !f.starts_with("term:") && !NAMED.iter().any(|n| f.ends_with(n.0));
        self.other += u32::from(first.iter().any(is_other));
        self.nothing += u32::from(first.is_empty() && case.verdict != "refused");
        self.refused += u32::from(case.verdict == "refused");
    }

    fn row(&self, name: &str) -> String {
        let Self {
            cases,
            right,
            right_verdict,
            alike,
            named,
            products,
            other,
            nothing,
            refused,
        } = self;
        let named: String = named.iter().map(|n| format!(" {n} |")).collect();
        format!(
            "| {name} | {cases} | {right} | {right_verdict} | {alike} |{named} {products} | {other} | {nothing} | {refused} |"
        )
    }
}

/// Runs `seeds` seeds of each kind in each grade. `chosen` contains parts of the kinds' names or of their effects' ids.
pub fn run(seeds: u64, chosen: &[&str]) {
    let is_chosen = |kind: &Kind| {
        let name = format!("{} {}", kind.name(), kind.effects().join(" "));
        chosen.is_empty() || chosen.iter().any(|c| name.contains(c))
    };
    let mut jobs: Vec<(Kind, Grade, u64)> = Vec::new();
    for kind in Kind::ALL.into_iter().filter(is_chosen) {
        for grade in Grade::ALL {
            jobs.extend((0..seeds).map(|seed| (kind, grade, seed)));
        }
    }
    if jobs.is_empty() {
        return;
    }
    let cases: Vec<(Kind, u64, Case)> = jobs
        .into_par_iter()
        .map(|(kind, grade, seed)| (kind, seed, kind.case(grade, seed)))
        .collect();
    let mut rows: BTreeMap<(Kind, Option<Grade>), Tally> = BTreeMap::new();
    for (kind, seed, case) in &cases {
        if !case.is_named_alone() || !case.has_right_verdict() {
            println!("{}, seed {seed}: {case:?}", kind.name());
        }
        for grade in [Some(case.grade), None] {
            rows.entry((*kind, grade)).or_default().add(case);
        }
    }
    let names: String = NAMED.iter().map(|n| format!(" {} |", n.1)).collect();
    println!(
        "\nbiases that move slowly, many times the noise, and what is named first\n\n\
         | | cases | right, alone | and the right verdict | right among those told to be alike |{names} product | other | nothing | refused |\n\
         |---|{}",
        "---:|".repeat(8 + NAMED.len())
    );
    for ((kind, grade), tally) in rows {
        let grade = grade.map_or("all".to_string(), |g| format!("{g:?}"));
        println!("{}", tally.row(&format!("{}, {grade}", kind.name())));
    }
}
