//! Several sessions of one unit diagnosed together, and their calibration file applied to another session.

use std::collections::BTreeMap;

use mimu_tests::joint::{Case, Judged, Set, case};
use rayon::prelude::*;

#[derive(Debug, Clone, Copy)]
struct Tally {
    sets: u32,
    named: u32,
    not_there: u32,
    refused: u32,
    /// Files as written, gyro and accelerometer; then with a constant error removed.
    worse: [[u32; 2]; 2],
    worst: [[f64; 2]; 2],
}

impl Tally {
    const NONE: Self = Self {
        sets: 0,
        named: 0,
        not_there: 0,
        refused: 0,
        worse: [[0; 2]; 2],
        worst: [[0.0; 2]; 2],
    };

    fn add(&mut self, case: &Case) {
        self.sets += 1;
        let truth = &case.set.effects;
        let named = |t: &&&str| case.found.iter().any(|f| f.iter().any(|f| f == **t));
        self.named += u32::from(truth.iter().filter(named).count() == truth.len());
        self.not_there += u32::from(case.found.iter().any(|f| !case.is_right(f)));
        self.refused += u32::from(case.as_written.is_none());
        for (i, judged) in both(case).into_iter().enumerate() {
            let Some(judged) = judged else { continue };
            for k in 0..2 {
                self.worse[i][k] += u32::from(judged.is_worse()[k]);
                self.worst[i][k] = self.worst[i][k].max(judged.ratio()[k]);
            }
        }
    }

    fn row(&self, name: &str) -> String {
        let Self {
            sets,
            named,
            not_there,
            refused,
            worse,
            worst,
        } = self;
        let judged: String = (0..2)
            .flat_map(|i| (0..2).map(move |k| (i, k)))
            .map(|(i, k)| format!(" {} ({:.2}) |", worse[i][k], worst[i][k]))
            .collect();
        format!("| {name} | {sets} | {named} | {not_there} | {refused} |{judged}")
    }
}

fn both(case: &Case) -> [Option<Judged>; 2] {
    [case.as_written, case.without_offset]
}

const HEAD: &str = "| | sets | all effects named | something named that is not there | refused | gyro worse, as written (worst ratio) | accelerometer | gyro worse, without a constant error | accelerometer |\n|---|---:|---:|---:|---:|---:|---:|---:|---:|";

/// Runs `sets` sets from the seed `first` on.
pub fn run(sets: u64, first: u64) {
    let cases: Vec<(u64, Case)> = (first..first + sets)
        .into_par_iter()
        .map(|seed| {
            let case = case(&Set::of(seed));
            println!("{}", line(seed, &case));
            (seed, case)
        })
        .collect();
    let mut rows: BTreeMap<String, Tally> = BTreeMap::new();
    for (_, case) in &cases {
        let set = &case.set;
        let what = match set.effects.is_empty() {
            true => "no effect".to_string(),
            false => format!("`{}`", set.effects.join(" + ")),
        };
        let carrier = if set.on_table {
            "on a table"
        } else {
            "by hand"
        };
        let names = [
            "all".to_string(),
            format!("{} sessions", set.sessions),
            format!("{:?}, {carrier}", set.grade),
            what,
        ];
        for name in names {
            rows.entry(name).or_insert(Tally::NONE).add(case);
        }
    }
    println!("\n{HEAD}");
    for (name, tally) in rows {
        println!("{}", tally.row(&name));
    }
    let seeds = |of: &dyn Fn(&Case) -> bool| {
        let seeds = cases.iter().filter(|c| of(&c.1)).map(|c| c.0.to_string());
        seeds.collect::<Vec<_>>().join(" ")
    };
    println!("\nworse than without effects: {}", seeds(&Case::is_worse));
    let wrong = |c: &Case| c.found.iter().any(|f| !c.is_right(f));
    println!("something named that is not there: {}", seeds(&wrong));
    println!("refused: {}", seeds(&|c| c.as_written.is_none()));
}

fn line(seed: u64, case: &Case) -> String {
    let set = &case.set;
    let carrier = if set.on_table { "table" } else { "hands" };
    let found: Vec<String> = case.found.iter().map(|f| f.join(" or ")).collect();
    let ratios: String = [
        ("as written", case.as_written),
        ("without a constant error", case.without_offset),
        ("biases of its own", case.own_biases),
    ]
    .into_iter()
    .filter_map(|(name, judged)| Some((name, judged?)))
    .map(|(name, judged)| {
        let [gyro, accel] = [0, 1].map(|k| {
            let [without, with] = judged.of_files.map(|e| e[k]);
            let worse = if judged.is_worse()[k] { ", worse" } else { "" };
            format!(
                "{without:.3e} to {with:.3e} (noise {:.1e}{worse})",
                judged.noise[k]
            )
        });
        format!("; {name}: gyro {gyro}, accel {accel}")
    })
    .collect();
    format!(
        "seed {seed}: {} sessions, {:?}, {carrier}, {:.0} % cold, {:?}: {}, {found:?}{ratios}",
        set.sessions,
        set.grade,
        100.0 * set.cold,
        set.effects,
        case.verdict,
    )
}
