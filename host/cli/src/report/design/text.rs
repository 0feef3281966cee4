//! A design as text.

use std::fmt::Write as _;

use super::DesignReport;
use crate::report::text::{COLUMNS, wrap};
use mimu::design::budget::{Budget, Spending};
use mimu::design::judgement::{HALF_95, Judgement};
use mimu::design::lack_of_fit::Notice;
use mimu::design::plan::round;
use mimu::design::schemes::Scheme;
use mimu::design::tour::Order;
use mimu::quantity::plural;
use mimu::quantity::significant;

/// Dwells listed: as many as the longest design.
pub(super) const LISTED: usize = 200;

/// Result of `mimu design`.
pub fn design_text(report: &DesignReport) -> String {
    let mut out = String::new();
    let j = &report.judgement;
    let _ = writeln!(out, "{}", report.subject());
    let mut line = |name: &str, text: String| {
        let _ = writeln!(out, "  {name:<22}{text}");
    };
    line("design", report.title.clone());
    let n = j.settings.len();
    let best = (report.problem.optimum.log_det).exp();
    line(
        "D-efficiency",
        format!(
            "{:.4}, of the continuous optimum over the reach",
            j.d_efficiency
        ),
    );
    line(
        "det(F'F/n)",
        format!(
            "{}, optimum {}{}",
            significant(j.determinant),
            significant(best),
            match report.problem.reach.model.distinct_regressions() {
                1 => "",
                _ => ": product over the three sensors",
            }
        ),
    );
    line(
        "condition",
        if j.condition.is_finite() {
            significant(j.condition)
        } else {
            "singular".into()
        },
    );
    line(
        "time",
        format!(
            "{}: {} of {} s, moves {}",
            minutes(report.time_s()),
            plural(n as u64, "dwell"),
            significant(report.dwell_s),
            minutes(report.moves_s())
        ),
    );
    line("order", order(report));
    line("sigma of a dwell mean", sigma(report));
    line(
        "left over",
        format!(
            "{} of freedom to notice a wrong model, {} from repetitions",
            match j.lack_of_fit_dof {
                1 => "1 degree".into(),
                dof => format!("{dof} degrees"),
            },
            j.repetition_dof
        ),
    );
    for (name, text) in noticed(report) {
        line(name, text);
    }
    if let Some(filters) = report.filters() {
        let shares = filters
            .each_ref()
            .map(|f| format!("{:.4}", f.d_efficiency))
            .join(", ");
        let gain = filters[0].mean_sigma / j.mean_sigma;
        let text = format!(
            "the filters for x, y and z see four of the nine positions each, fang (26)-(28): \
             D-efficiency {shares}, and sigmas {} times those of all nine for each",
            significant(gain)
        );
        wrapped(&mut out, "as published", &text);
    }
    if let Some(assumed) = report.scheme.and_then(Scheme::assumed) {
        wrapped(&mut out, "assumed", assumed);
    }
    if report.turned_over {
        let text = "the unit stands the other way up than published, turned by a half turn about x: y and z \
                    change sign, and the table reaches all poses";
        wrapped(&mut out, "mounted", text);
    }
    if let Some((budget_s, budget)) = &report.budget {
        spent(&mut out, report, *budget_s, budget);
    }
    settings(&mut out, report);
    parameters(&mut out, j);
    out
}

/// Text in lines beside a name.
pub(super) fn wrapped(out: &mut String, name: &str, text: &str) {
    wrap(out, &format!("  {name:<22}"), text);
}

pub(super) fn minutes(seconds: f64) -> String {
    match seconds.round() {
        s if s < 120.0 => format!("{} s", significant(seconds)),
        s => format!("{} min {} s", (s / 60.0).floor(), s % 60.0),
    }
}

fn sigma(report: &DesignReport) -> String {
    let (_, unit, factor) = report.problem.reach.model.bias_unit();
    let shown = |v: f64| significant(v * factor);
    let mean = shown(report.judgement.sigma);
    match report.noise {
        None => format!("{mean} {unit}, given"),
        Some(noise) => {
            let walk = match noise.k {
                0.0 => String::new(),
                k => format!(", K = {} {unit}/√s", shown(k)),
            };
            format!(
                "{mean} {unit} (N = {} {unit}/√Hz, B = {} {unit}{walk})",
                shown(noise.n),
                shown(noise.b)
            )
        }
    }
}

/// Order of the dwells, and what it costs.
fn order(report: &DesignReport) -> String {
    let name = match report.order {
        None => "as published",
        Some(Order::Shortest) => {
            return "shortest found; neighbours share drift (see --order)".into();
        }
        Some(Order::Lot) => "drawn by lot",
    };
    let longer = report.moves_s() - report.shortest_moves_s;
    match longer >= 0.05 {
        true => format!("{name}, {} longer than the shortest found", minutes(longer)),
        false => format!("{name}, as short as the shortest found"),
    }
}

/// What is noticed and what is not, as lines.
fn noticed(report: &DesignReport) -> Vec<(&'static str, String)> {
    let mut lines = Vec::new();
    for notice in &report.judgement.notices {
        let (factor, unit) = report.noticed(notice);
        let name = notice.term.name();
        let text = match notice.size {
            None => ("cannot notice", format!("{name}: aliased with the model")),
            Some(size) => {
                let all = notice.noticed == notice.parameters;
                let part = match all {
                    true => String::new(),
                    false => format!("; {} of {} directions", notice.noticed, notice.parameters),
                };
                let label = if all {
                    "can notice"
                } else {
                    "can notice in part"
                };
                (
                    label,
                    format!(
                        "{name} from {} {unit} on (9 times in 10){part}",
                        significant(size * factor)
                    ),
                )
            }
        };
        lines.push(text);
    }
    lines
}

/// Order of the dwells.
fn settings(out: &mut String, report: &DesignReport) {
    let rate = if report.gyro() { "  rate, deg/s" } else { "" };
    let _ = writeln!(
        out,
        "\n  {:<7}{:>9}{:>9}{:>9}{rate}",
        "dwell", "up: x", "y", "z"
    );
    let all = &report.judgement.settings;
    for (k, s) in all.iter().enumerate().take(LISTED) {
        let [x, y, z] = <[f64; 3]>::from(s.up).map(|c| round(c, 1e4));
        let _ = write!(out, "  {:<7}{x:>9.4}{y:>9.4}{z:>9.4}", k + 1);
        if report.gyro() {
            let _ = write!(out, "{:>13.2}", round(s.rate.to_degrees(), 1e2));
        }
        let _ = writeln!(out);
    }
    if all.len() > LISTED {
        let _ = writeln!(
            out,
            "  ... and {} more: -o and --json have them",
            all.len() - LISTED
        );
    }
}

fn parameters(out: &mut String, j: &Judgement) {
    let cells: Vec<String> = j
        .parameters
        .iter()
        .map(|p| match p.sigma * p.parameter.shown {
            s if s.is_finite() => {
                format!(
                    "{} ± {} {}",
                    p.parameter.name,
                    significant(HALF_95 * s),
                    p.parameter.shown_unit
                )
            }
            _ => format!("{} undetermined", p.parameter.name),
        })
        .collect();
    let width = 2 + cells.iter().map(|c| c.chars().count()).max().unwrap_or(0);
    // A column for each sensor where they fit.
    let across = if 3 * width <= COLUMNS {
        3
    } else {
        COLUMNS / width
    };
    let rows = cells.len().div_ceil(across);
    let _ = writeln!(
        out,
        "\n  95 % intervals if the noise is known (FS: full scale, the effect at full input)"
    );
    for row in 0..rows {
        let line: String = (0..across)
            .filter_map(|c| cells.get(c * rows + row))
            .map(|cell| format!("{cell:<width$}"))
            .collect();
        let _ = writeln!(out, "  {}", line.trim_end());
    }
    for (name, inflation) in j.weak() {
        let _ = writeln!(
            out,
            "warning: {name} is all but unobservable: sigma {} times what it were with the others known",
            significant(inflation)
        );
    }
}

/// How a budget is spent, and what else was looked at.
fn spent(out: &mut String, report: &DesignReport, budget_s: f64, budget: &Budget) {
    let best = &budget.best;
    let moving = best.moves_s / budget_s;
    if let Some(noise) = report.noise {
        let [white, floor, walk] = noise.shares(best.dwell_s).map(|s| 100.0 * s);
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
                "{limit} would help; variance of a dwell mean: white noise {white:.0} %, \
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
    let is_best = |s: &Spending| s.each_pass() == best.each_pass();
    for s in &budget.by_size {
        if is_best(s) || shown.contains(&s.each_pass()) {
            let _ = writeln!(
                out,
                "  {:<10}{:>8}{:>10}{:>7.0} %{:>16.3}{}",
                s.each_pass(),
                s.passes,
                significant(s.dwell_s),
                100.0 * s.moves_s / budget_s,
                s.mean_sigma / best.mean_sigma,
                if is_best(s) { "  <" } else { "" }
            );
        }
    }
}

/// Result of `mimu design --compare`: one design a line.
pub fn comparison_text(reports: &[DesignReport], out_of_reach: &[Scheme]) -> String {
    let mut out = String::new();
    if let Some(first) = reports.first() {
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
    for r in reports {
        let j = &r.judgement;
        // Geometric mean of the spans: for the range of each axis alike.
        let full = r.problem.reach.model.span.product().cbrt();
        let ppm = match j.mean_sigma / full * 1e6 {
            v if v.is_finite() => format!("{} ppm", significant(v)),
            _ => "-".into(),
        };
        let noticed = |n: &&Notice| n.noticed == n.parameters;
        let names: Vec<&str> = j
            .notices
            .iter()
            .filter(noticed)
            .map(|n| n.term.name())
            .collect();
        let notices = match names.len() {
            0 => "-".into(),
            all if all > 1 && all == j.notices.len() => "all terms".into(),
            _ => names.join(", "),
        };
        let _ = writeln!(
            out,
            "  {:<19}{:>6}{:>13.4}{:>14}{:>15}{:>5}  {notices}",
            r.title,
            j.settings.len(),
            j.d_efficiency,
            ppm,
            minutes(r.time_s()),
            j.lack_of_fit_dof,
        );
    }
    let _ = writeln!(
        out,
        "\n  mean sigma: geometric mean over the parameters, of full scale; dof: left to notice a wrong model;\n  \
         can notice: terms beyond the model that show in the residuals in every direction"
    );
    if !out_of_reach.is_empty() {
        let names: Vec<&str> = out_of_reach.iter().map(|s| s.name()).collect();
        let _ = writeln!(out, "  out of this table's reach: {}", names.join(", "));
    }
    for scheme in reports.iter().filter_map(|r| r.scheme) {
        if let Some(assumed) = scheme.assumed() {
            wrapped(&mut out, scheme.name(), assumed);
        }
    }
    out
}
