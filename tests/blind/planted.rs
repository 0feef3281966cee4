//! Effects planted in recordings by other people.

use std::collections::BTreeMap;

use mimu::quantity::Sensor;
use mimu_rig::effects::specs;
use mimu_tests::blind::is_listed;
use mimu_tests::planted::{Ground, Outcome, Planting, Untouched, grounds};
use rayon::prelude::*;

/// Classes of strength in the tables: size of the effect over the predicted standard deviation of its coefficients.
const CLASSES: [(f64, &str); 4] = [
    (3.0, "below 3"),
    (5.0, "3 to 5"),
    (10.0, "5 to 10"),
    (f64::INFINITY, "above 10"),
];

#[derive(Debug, Clone, Default)]
struct Tally {
    plantings: u32,
    outcomes: BTreeMap<Outcome, u32>,
    /// Named without another effect beside it.
    alone: u32,
    /// Of named ones: what remains of the planted error with the effects, over what remains after the affine calibration.
    ratios: Vec<f64>,
    /// Effects named that are not there.
    not_there: u32,
    strengths: Vec<f64>,
}

impl Tally {
    fn add(&mut self, planting: &Planting) {
        self.plantings += 1;
        let outcome = planting.outcome();
        *self.outcomes.entry(outcome).or_default() += 1;
        let named = outcome == Outcome::Named;
        let not_there = planting.not_there().count() as u32;
        self.alone += u32::from(named && not_there == 0);
        if named {
            self.ratios.push(planting.errors[2] / planting.errors[1]);
        }
        self.not_there += not_there;
        self.strengths.push(planting.strength);
    }

    fn row(&self, name: &str) -> String {
        let of = |outcome| self.outcomes.get(&outcome).copied().unwrap_or(0);
        let figures = [
            self.plantings,
            of(Outcome::Named),
            self.alone,
            of(Outcome::Unexplained),
            of(Outcome::AnotherAndUnexplained),
            of(Outcome::NamedWrong),
            of(Outcome::Missed),
            of(Outcome::Refused),
            self.not_there,
        ];
        let figures = figures.map(|n| n.to_string()).join(" | ");
        let [strength, ratio] = [&self.strengths, &self.ratios].map(|all| match median(all) {
            Some(m) => format!("{m:.2}"),
            None => "-".into(),
        });
        format!("| {name} | {figures} | {strength} | {ratio} |")
    }
}

pub(super) fn median(values: &[f64]) -> Option<f64> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied()
}

const HEAD: &str = "| | plantings | named | named alone | `unexplained` | another named, `unexplained` | another named, `explained` | missed | refused | effects named that are not there | strength, median | error with effects over affine, median of the named |\n|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|";

/// Plants each effect `seeds` times at `times` the size of data sheets. `chosen` are parts of the names of effects or recordings.
pub fn run(seeds: u64, times: f64, chosen: &[&str]) {
    let grounds = grounds();
    if grounds.is_empty() {
        return;
    }
    let is_chosen = |ground: &Ground, id: &str| {
        let of = |c: &&str| id.contains(c) || ground.name.contains(c);
        chosen.is_empty() || chosen.iter().any(of)
    };
    // Without the thermometer, and with it.
    let untouched: Vec<[Untouched; 2]> = grounds
        .par_iter()
        .map(|ground| [false, true].map(|heated| ground.untouched(heated).expect("not refused")))
        .collect();
    println!("| untouched | verdict | named | with the made thermometer |\n|---|---|---|---|");
    for (ground, [plain, heated]) in grounds.iter().zip(&untouched) {
        let found = |u: &Untouched| match u.found.is_empty() {
            true => "-".to_owned(),
            false => u.found.join(", "),
        };
        println!(
            "| {} | {} | {} | {}: {} |",
            ground.name,
            plain.verdict,
            found(plain),
            heated.verdict,
            found(heated)
        );
    }
    // Each effect in one recording first, then in the next one, so that a run that is ended early has tried all effects.
    let mut jobs = Vec::new();
    let ids: Vec<&str> = specs().map(|s| s.id).collect();
    for seed in 0..seeds {
        for turn in 0..grounds.len() {
            for (k, id) in ids.iter().enumerate() {
                let which = (turn + k) % grounds.len();
                let ground = &grounds[which];
                let reference = &untouched[which][usize::from(id.contains("thermal"))];
                let has_it = reference.found.iter().any(|f| f == id);
                if is_chosen(ground, id) && ground.takes(id) && !has_it {
                    jobs.push((ground, reference, *id, seed));
                }
            }
        }
    }
    let mut plantings: Vec<Planting> = jobs
        .into_iter()
        .par_bridge()
        .filter_map(|(ground, reference, id, seed)| ground.plant(id, times, seed, reference))
        .inspect(|planting| eprintln!("{}", row(planting)))
        .collect();
    let place = |p: &Planting| (p.ground.clone(), ids.iter().position(|id| *id == p.truth));
    plantings.sort_by_key(place);
    cases(&plantings);
    tables(&plantings);
}

/// One row for each planting.
fn cases(plantings: &[Planting]) {
    println!(
        "\n| recording | planted | strength | outcome | verdict | named | planted error | affine | with effects | why |\n|---|---|---:|---|---|---|---:|---:|---:|---|"
    );
    for planting in plantings {
        println!("{}", row(planting));
    }
}

fn row(p: &Planting) -> String {
    let (unit, factor) = match p.sensor {
        Sensor::Gyro => ("deg/s", 1f64.to_degrees()),
        Sensor::Accel => ("mm/s²", 1e3),
    };
    let [planted, before, after] = p.errors.map(|e| format!("{:.3}", factor * e));
    let found = p.found.iter().map(|f| f.join(" or "));
    let found = found.collect::<Vec<_>>().join(", ");
    format!(
        "| {} | `{}` | {:.1} | {:?} | {} | {found} | {planted} {unit} | {before} | {after} | {} |",
        p.ground,
        p.truth,
        p.strength,
        p.outcome(),
        p.verdict,
        p.reasons.join("; "),
    )
}

fn tables(plantings: &[Planting]) {
    for (title, listed) in [("listed effects", true), ("effects on no list", false)] {
        let of = || plantings.iter().filter(|p| is_listed(p.truth) == listed);
        let mut by_class = vec![Tally::default(); CLASSES.len()];
        let mut by_effect: BTreeMap<&str, Tally> = BTreeMap::new();
        let mut all = Tally::default();
        for planting in of() {
            // That of a refused recording is not a number.
            if let Some(class) = CLASSES.iter().position(|c| planting.strength < c.0) {
                by_class[class].add(planting);
            }
            by_effect.entry(planting.truth).or_default().add(planting);
            all.add(planting);
        }
        if all.plantings == 0 {
            continue;
        }
        println!("\n{title}, by strength\n\n{HEAD}");
        for (tally, (_, name)) in by_class.iter().zip(CLASSES) {
            if tally.plantings > 0 {
                println!("{}", tally.row(name));
            }
        }
        println!("{}", all.row("all"));
        println!("\n{title}, by effect\n\n{HEAD}");
        for (id, tally) in &by_effect {
            println!("{}", tally.row(&format!("`{id}`")));
        }
    }
}
