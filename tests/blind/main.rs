//! `make blind`: units with undeclared effects, and what the diagnosis says of them.

use mimu_rig::effects::specs;
use mimu_tests::blind::case;
use rayon::prelude::*;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let seeds: u64 = args.first().and_then(|s| s.parse().ok()).unwrap_or(20);
    let only: Vec<&str> = args.iter().skip(1).map(String::as_str).collect();
    let mut all: Vec<Vec<&str>> = specs().map(|s| vec![s.id]).collect();
    all.insert(0, vec![]);
    for ids in all {
        let name = if ids.is_empty() {
            "clean".into()
        } else {
            ids.join("+")
        };
        if !only.is_empty() && !only.iter().any(|o| name.contains(o)) {
            continue;
        }
        let start = std::time::Instant::now();
        let cases: Vec<_> = (0..seeds)
            .into_par_iter()
            .map(|seed| case(&ids, seed))
            .collect();
        println!("{name} ({:.1} s)", start.elapsed().as_secs_f64());
        for c in &cases {
            println!(
                "   {:7.2?} {:12} after {:.2}  {:?} {:?} - {:?}",
                c.strength, c.verdict, c.after, c.found, c.left, c.rejected
            );
        }
    }
}
