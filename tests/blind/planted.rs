//! Effects planted in recordings by other people.

use mimu::quantity::Sensor;
use mimu_rig::effects::specs;
use mimu_tests::blind::is_listed;
use mimu_tests::planted::{Ground, Outcome, Planting, Untouched, grounds};
use mimu_tests::study::{Figure, Table, class, counted};
use rayon::prelude::*;

/// Classes of strength in the tables: size of the effect over the predicted standard deviation of its coefficients.
const CLASSES: [(f64, &str); 4] = [
    (3.0, "below 3"),
    (5.0, "3 to 5"),
    (10.0, "5 to 10"),
    (f64::INFINITY, "above 10"),
];

const COLUMNS: [&str; 9] = [
    "plantings",
    "named",
    "named alone",
    "`unexplained`",
    "another named, `unexplained`",
    "another named, `explained`",
    "missed",
    "refused",
    "effects named that are not there",
];

/// In the columns [`COLUMNS`], then the strength, and of a named effect what remains of its error with the effects over what remains after the affine
/// calibration.
fn values(p: &Planting) -> [f64; 11] {
    let (outcome, others) = (p.outcome(), p.not_there().count());
    let is = |of| counted(outcome == of);
    let named = outcome == Outcome::Named;
    [
        1.0,
        counted(named),
        counted(named && others == 0),
        is(Outcome::Unexplained),
        is(Outcome::AnotherAndUnexplained),
        is(Outcome::NamedWrong),
        is(Outcome::Missed),
        is(Outcome::Refused),
        others as f64,
        p.strength,
        if named {
            p.errors[2] / p.errors[1]
        } else {
            f64::NAN
        },
    ]
}

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
        let [plain, heated] = [plain, heated].map(|u| (u.said.verdict, u.said.ids().join(", ")));
        let name = &ground.name;
        println!(
            "| {name} | {} | {} | {}: {} |",
            plain.0, plain.1, heated.0, heated.1
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
                let has_it = reference.said.ids().contains(id);
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
    let found = p.said.found.iter().map(|f| f.join(" or "));
    let found = found.collect::<Vec<_>>().join(", ");
    format!(
        "| {} | `{}` | {:.1} | {:?} | {} | {found} | {planted} {unit} | {before} | {after} | {} |",
        p.ground,
        p.truth,
        p.strength,
        p.outcome(),
        p.said.verdict,
        p.said.reasons.join("; "),
    )
}

fn tables(plantings: &[Planting]) {
    let mut columns = COLUMNS.map(|c| (c, Figure::Sum)).to_vec();
    columns.push(("strength, median", Figure::Median));
    columns.push((
        "error with effects over affine, median of the named",
        Figure::Median,
    ));
    for (title, listed) in [("listed effects", true), ("effects on no list", false)] {
        let (mut by_class, mut by_effect) = (Table::new(&columns), Table::new(&columns));
        for planting in plantings.iter().filter(|p| is_listed(p.truth) == listed) {
            let values = values(planting);
            by_class.add("all", &values);
            // That of a refused recording is not a number.
            if let Some(class) = class(planting.strength, &CLASSES) {
                by_class.add(class, &values);
            }
            by_effect.add(format!("`{}`", planting.truth), &values);
        }
        by_class.print(&format!("{title}, by strength"));
        by_effect.print(&format!("{title}, by effect"));
    }
}
