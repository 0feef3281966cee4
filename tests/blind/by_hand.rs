//! Units recorded by hand.

use mimu_tests::by_hand::{Case, Grade, SHOWN, case};
use mimu_tests::study::{Figure, Table, counted};
use rayon::prelude::*;

/// Ratio of effect to noise above which a case counts: no test needs to see a smaller effect.
const STRONG: f64 = 5.0;

const COLUMNS: [&str; 6] = [
    "cases",
    "named",
    "named alone",
    "alone, and the right verdict",
    "something named that is not there",
    "refused",
];

fn outcome(case: &Case) -> [f64; 6] {
    let said = &case.said;
    [
        true,
        case.truth.iter().all(|t| said.names(t)),
        case.is_named_alone(),
        case.has_right_verdict() && case.is_named_alone(),
        said.found.iter().any(|f| !case.is_right(f)),
        said.verdict == "refused",
    ]
    .map(counted)
}

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
    let cases = jobs
        .into_par_iter()
        .map(|(ids, grade, seed)| (seed, case(&ids, grade, seed, seed % 2 == 1)));
    let cases: Vec<(u64, Case)> = cases.collect();
    let columns = COLUMNS.map(|c| (c, Figure::Sum));
    let (mut weaker, mut strong) = (Table::new(&columns), Table::new(&columns));
    let percent = ["gyro", "accelerometer"].map(|c| (c, Figure::Percent));
    let mut inside = Table::new(&percent);
    for (seed, case) in &cases {
        let is_clean = case.truth.is_empty();
        let is_strong = is_clean || case.strength > STRONG;
        let outcome = outcome(case);
        if is_strong && outcome[3] == 0.0 || outcome[4] > 0.0 {
            println!("seed {seed}: {case:?}");
        }
        let name = match is_clean {
            true => "clean".into(),
            false => format!("`{}`", case.truth.join(" + ")),
        };
        let flaws = if case.flawed { "flawed" } else { "no flaws" };
        let kind = if is_clean { "clean" } else { "with an effect" };
        for row in [
            name.clone(),
            format!("{kind}, {:?}", case.grade),
            format!("{kind}, {flaws}"),
            format!("{kind}, all"),
        ] {
            let table = if is_strong { &mut strong } else { &mut weaker };
            table.add(row, &outcome);
        }
        // Where the model has exactly the right effects.
        for row in [name, format!("{kind}, {:?}", case.grade)] {
            for (sensor, [held, all]) in case.inside.into_iter().enumerate() {
                for k in 0..if case.is_named_alone() { all } else { 0 } {
                    let mut values = [f64::NAN; 2];
                    values[sensor] = counted(k < held);
                    inside.add(&row, &values);
                }
            }
        }
    }
    strong.print("above five times the noise, and clean units");
    weaker.print("weaker");
    inside.print("intervals of 95 % that hold the truth, %");
}
