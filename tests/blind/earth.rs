//! The Earth's rate in the biases of gyros on a table.

use mimu_tests::earth::{DEG_PER_H, Experiment, Summary, study};

/// Prints the table for `runs` runs of each experiment whose name contains one of `chosen`, with the latitude and without it.
pub fn run(runs: u64, chosen: &[&str]) {
    println!(
        "| experiment | latitude | bias error, rms, deg/h | mean square over sigma | inside 95 % | largest residual over noise | named | misfits |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let wanted = |e: &Experiment| chosen.is_empty() || chosen.iter().any(|c| e.name().contains(c));
    for experiment in Experiment::ALL.into_iter().filter(wanted) {
        for latitude in [true, false] {
            let Summary {
                runs,
                rms,
                mean_square,
                coverage,
                over_noise,
                warned,
                misfits,
            } = study(experiment, latitude, runs);
            println!(
                "| {} | {} | {:.3} | {mean_square:.2} | {:.1} % | {over_noise:.2} | {warned} of {runs} | {misfits} |",
                experiment.name(),
                if latitude { "given" } else { "unknown" },
                rms / DEG_PER_H,
                100.0 * coverage,
            );
        }
    }
}
