//! Several sessions of one unit diagnosed together, and their calibration file applied to another session.

use std::collections::BTreeMap;

use mimu_tests::by_hand::Grade;
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

/// Runs `sets` sets from the seed `first` on. With `warm_up`, each set has that many sessions of a digital unit by hand, whose only effect is a
/// warm-up of the accelerometer.
pub fn run(sets: u64, first: u64, warm_up: Option<usize>) {
    let of = |seed| match warm_up {
        Some(sessions) => Set::of_warm_up(sessions, seed),
        None => Set::of(seed),
    };
    let cases: Vec<(u64, Case)> = (first..first + sets)
        .into_par_iter()
        .map(|seed| {
            let case = case(&of(seed));
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

/// Cubics of an accelerometer, mg/g³ along x, y, z.
const CUBICS: [(&str, [f64; 3]); 4] = [
    ("mg_per_g3 = [12.0, 12.0, 12.0]", [12.0; 3]),
    ("mg_per_g3 = [12.0, -12.0, 12.0]", [12.0, -12.0, 12.0]),
    ("mg_per_g3 = [12.0, 0.0, 0.0]", [12.0, 0.0, 0.0]),
    ("mg_per_g3 = [4.0, 4.0, 4.0]", [4.0; 3]),
];
/// Poses in all directions, and within so many degrees of a face.
const POSES: [Option<f64>; 3] = [None, Some(15.0), Some(10.0)];
/// 1 m/s² per (m/s²)³ in mg/g³.
const MG_PER_G3: f64 = 1e3 * 9.806_65 * 9.806_65;

/// What became of the cubics of one size and grade, over their seeds.
#[derive(Debug, Clone, Copy, Default)]
struct Cubics {
    sets: u32,
    accepted: u32,
    /// Coefficients of accepted effects inside their 95 % intervals, and number of all; one that the file lacks is 0 without an interval.
    inside: [u32; 2],
    /// Sum of the squares of their errors, (mg/g³)².
    squares: f64,
    /// Sums of the squares of the errors on another session without effects and with them: force as a vector (m/s²), rate over turns (deg),
    /// direction of gravity after turns (deg).
    errors: [[f64; 2]; 3],
    /// Files with effects that err more there by each of these.
    worse: [u32; 3],
}

impl Cubics {
    fn add(&mut self, case: &Case, truth: [f64; 3]) {
        self.sets += 1;
        let found = case.effects.iter().find(|e| e.id() == "accel_scale_cubic");
        if let Some(found) = found {
            self.accepted += 1;
            for (axis, truth) in truth.iter().enumerate() {
                let at = found.candidate.active.iter().position(|k| *k == axis);
                let value = at.map_or(0.0, |at| MG_PER_G3 * found.values[at]);
                let half = at.map_or(0.0, |at| 1.96 * MG_PER_G3 * found.sigmas[at]);
                self.inside[0] += u32::from((value - truth).abs() <= half);
                self.inside[1] += 1;
                self.squares += (value - truth).powi(2);
            }
        }
        let (Some(judged), Some(directions)) = (case.as_written, case.directions) else {
            return;
        };
        let judged = judged.of_files;
        let all = [judged.map(|of| of[1]), judged.map(|of| of[0]), directions];
        for (k, [without, with]) in all.into_iter().enumerate() {
            self.errors[k][0] += without * without;
            self.errors[k][1] += with * with;
            self.worse[k] += u32::from(with > 1.02 * without);
        }
    }

    fn row(&self, name: &str) -> String {
        let rms = |sum: f64| (sum / f64::from(self.sets)).sqrt();
        let [force, rate, direction] = self.errors.map(|e| e.map(rms));
        format!(
            "| {name} | {} | {} | {:.1} | {} of {} | {:.1} to {:.1} ({}) | {:.4} to {:.4} ({}) | {:.4} to {:.4} ({}) |",
            self.sets,
            self.accepted,
            (self.squares / f64::from(self.inside[1].max(1))).sqrt(),
            self.inside[0],
            self.inside[1],
            1e3 * force[0],
            1e3 * force[1],
            self.worse[0],
            rate[0],
            rate[1],
            self.worse[1],
            direction[0],
            direction[1],
            self.worse[2],
        )
    }
}

/// Runs `sets` seeds, from the seed `first` on, of the cubics, poses and grades whose names contain all of `chosen`.
pub fn run_cubics(sets: u64, first: u64, chosen: &[&str]) {
    println!(
        "| cubic, grade | sets | accepted | error, rms, mg/g³ | inside the 95 % interval | force on another session, mm/s² (worse) | turns, deg (worse) | direction after turns, deg (worse) |\n|---|---:|---:|---:|---:|---:|---:|---:|"
    );
    let kinds = CUBICS.into_iter().flat_map(|c| POSES.map(|near| (c, near)));
    for ((size, truth), near_faces_deg) in kinds {
        for grade in Grade::ALL {
            let poses = near_faces_deg.map_or("all".into(), |d| format!("within {d}° of a face"));
            let name = format!("{truth:?}, {poses}, {grade:?}");
            if !chosen.iter().all(|c| name.contains(c)) {
                continue;
            }
            let cases: Vec<Case> = (first..first + sets)
                .into_par_iter()
                .map(|seed| case(&Set::of_cubic(size, near_faces_deg, grade, seed)))
                .collect();
            let mut all = Cubics::default();
            for (case, seed) in cases.iter().zip(first..) {
                all.add(case, truth);
                let cubic = |r: &&String| r.starts_with("accel_scale_cubic");
                for rejected in case.rejected.iter().filter(cubic) {
                    println!("{name}, seed {seed}: {rejected}");
                }
            }
            println!("{}", all.row(&name));
        }
    }
}
