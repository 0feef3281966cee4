//! Designs side by side, as text.

use std::fmt::Write as _;

use super::text::sigma;
use super::wrapped;
use mimu::quantity::{minutes, significant};
use mimu::result::design::{Comparison, Noticed};

/// Result of `mimu design --compare`: one line per design.
pub fn comparison_text(comparison: &Comparison) -> String {
    let mut out = String::new();
    if let Some(first) = comparison.designs.first() {
        let _ = writeln!(
            out,
            "{}: {} s a dwell",
            first.subject(),
            significant(first.dwell_s)
        );
        let _ = writeln!(out, "  sigma of a dwell mean {}", sigma(first));
    }
    let _ = writeln!(
        out,
        "\n  {:<19}{:>6}{:>13}{:>14}{:>15}{:>5}  can notice",
        "design", "dwells", "D-efficiency", "mean sigma", "time", "dof"
    );
    for design in &comparison.designs {
        let ppm = match 1e6 * design.mean_sigma_of_full_scale {
            v if v.is_finite() => format!("{} ppm", significant(v)),
            _ => "-".into(),
        };
        let noticed = |n: &&Noticed| n.noticed == n.parameters;
        let notices = design.notices.iter();
        let names: Vec<&str> = notices.filter(noticed).map(|n| n.term).collect();
        let notices = match names.len() {
            0 => "-".into(),
            all if all > 1 && all == design.notices.len() => "all terms".into(),
            _ => names.join(", "),
        };
        let _ = writeln!(
            out,
            "  {:<19}{:>6}{:>13.4}{:>14}{:>15}{:>5}  {notices}",
            design.title,
            design.positions.len(),
            design.d_efficiency,
            ppm,
            minutes(design.time_s),
            design.dof.lack_of_fit,
        );
    }
    let _ = writeln!(
        out,
        "\n  mean sigma: geometric mean over the parameters, of full scale; dof: residual degrees of freedom;\n  \
         can notice: terms beyond the model that the residuals show in every direction"
    );
    if !comparison.out_of_reach.is_empty() {
        let names = comparison.out_of_reach.join(", ");
        let _ = writeln!(out, "  out of this table's reach: {names}");
    }
    for design in &comparison.designs {
        if let (Some(scheme), Some(assumed)) = (design.scheme, design.assumed) {
            wrapped(&mut out, scheme, assumed);
        }
    }
    out
}
