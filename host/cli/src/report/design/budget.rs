//! How a limited time is spent, as text.

use std::fmt::Write as _;

use super::wrapped;
use mimu::quantity::significant;
use mimu::result::design::{Spent, Way};

/// Use of a budget, and the alternatives that were considered.
pub(super) fn spent(out: &mut String, by_noise: bool, budget: &Spent) {
    let best = &budget.best;
    let moving = best.moves_s / budget.time_s;
    if by_noise {
        let shares = [
            budget.shares.white,
            budget.shares.instability,
            budget.shares.walk,
        ];
        let [white, floor, walk] = shares.map(|s| 100.0 * s);
        let limit = match (moving > 0.5, white >= floor.max(walk), floor >= walk) {
            (true, ..) => "moves: a faster table",
            (_, true, _) => "white noise: more time",
            (_, _, true) => "the bias instability: more dwells",
            _ => "the random walk: shorter dwells",
        };
        wrapped(
            out,
            "limited by",
            &format!(
                "{limit} would help. Shares in the variance of a dwell mean: white noise {white:.0} %, \
                 bias instability {floor:.0} %, random walk {walk:.0} %; moves take {:.0} % of the time",
                100.0 * moving
            ),
        );
    }
    let _ = writeln!(
        out,
        "\n  {:<10}{:>8}{:>10}{:>9}{:>16}",
        "a pass", "passes", "dwell, s", "moves", "sigma over best"
    );
    let shown = [4, 5, 6, 8, 9, 10, 12, 14, 16, 20, 25, 30, 35, 40];
    let is_best = |w: &Way| w.dwells_a_pass == best.dwells_a_pass;
    for way in &budget.ways {
        if is_best(way) || shown.contains(&way.dwells_a_pass) {
            let _ = writeln!(
                out,
                "  {:<10}{:>8}{:>10}{:>7.0} %{:>16.3}{}",
                way.dwells_a_pass,
                way.passes,
                significant(way.dwell_s),
                100.0 * way.moves_s / budget.time_s,
                way.mean_sigma / best.mean_sigma,
                if is_best(way) { "  <" } else { "" }
            );
        }
    }
}
