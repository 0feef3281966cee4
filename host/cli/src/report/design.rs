//! A design, and the next experiment.

mod prior;

use maud::{Markup, html};
use mimu::plan::design::budget::Spending;
use mimu::plan::design::judgement::WEAK;
use mimu::plan::round;
use mimu::quantity::{Figure, minutes, plural, significant};
use mimu::readable;
use mimu::result::design::{Design, Spent};
use mimu::result::next_experiment::NextExperiment;
use mimu_equipment::step::words;

use super::page::Level;
use super::table::{number, table};
use super::terminal::{columns, text};

/// Largest number of dwells listed: that of the longest design.
const LISTED: usize = 200;
/// Columns and rows of dwells in a summary, and rows of parameters.
const ACROSS: usize = 3;
const ROWS: usize = 8;
const PARAMETERS: usize = 6;

/// Result of `mimu design`: a summary, or with `verbose` everything.
pub fn design_text(report: &Design, verbose: bool) -> String {
    let level = Level::of(verbose);
    text(&html! {
        p { (report.subject()) }
        section {
            (properties(report, level))
            @if let (Some(budget), true) = (&report.budget, verbose) { hr; (ways(budget)) }
            @if verbose { hr; (settings(&report.positions, report.rates_dps.as_deref(), None)) }
        }
        @if !verbose { hr; (dwells(report)) }
        section {
            (parameters(report, level))
            @if let Some(prior) = &report.prior { (prior::by_dwells(report, prior, level)) }
        }
        (weak(report))
        @if !verbose { p.line { "next: -o plan.toml writes it for mimu wizard and mimu record; --verbose prints more" } }
    })
}

fn properties(report: &Design, level: Level) -> Markup {
    let all = level.has_all();
    html! { dl.aligned {
        dt { "design" } dd { (report.title) @if report.prior.is_none() && !all { (format!(", D-efficiency {:.4}", report.d_efficiency)) } }
        @if let Some(prior) = &report.prior {
            dt { "prior" } dd { (prior::population(prior)) }
            dt { "without the prior" } dd { (prior::without(prior)) }
        } @else if all {
            dt { "D-efficiency" } dd { (format!("{:.4}, of the continuous optimum over the reach", report.d_efficiency)) }
            dt { "det(F'F/n)" } dd { (significant(report.determinant)) }
        }
        @if all { dt { "condition" } dd { @if report.condition.is_finite() { (significant(report.condition)) } @else { "singular" } } }
        dt { "time" } dd {
            (minutes(report.time_s)) ": " (plural(report.positions.len() as u64, "dwell")) " of " (significant(report.dwell_s)) " s" @if all { ", moves " (minutes(report.moves_s)) }
        }
        @if all { dt { "order" } dd { (report.order) } }
        dt { "sigma of a dwell mean" } dd { @match report.assumed_noise {
            Some(part) if !all => { (readable::parameter(report.dwell_sigma.unit).write(report.dwell_sigma.value)) ", if the noise is that of " (part) ": --noise takes yours" }
            _ => (sigma(report)),
        } }
        @if let (Some(part), true) = (report.assumed_noise, all) { dt { "noise" } dd { "that of " (part) " is assumed: --noise takes yours" } }
        dt { "spare" } dd { @match report.prior {
            None => { (plural(report.dof.lack_of_fit as u64, "dwell")) " beyond the parameters, which alone reveal a wrong model" @if all { ", and " (report.dof.repetition) " from repetitions" } }
            Some(_) => { (report.dof.lack_of_fit) " values beyond the parameters, which reveal a unit of another kind" }
        } }
        @if let (Some(budget), true) = (&report.budget, all && report.noise.is_some()) { (limit(budget)) }
    } }
}

/// What limits a design of a limited time.
fn limit(budget: &Spent) -> Markup {
    let moving = 100.0 * budget.best.moves_s / budget.time_s;
    let shares = &budget.shares;
    let [white, floor, walk] = [shares.white, shares.instability, shares.walk].map(|s| 100.0 * s);
    html! {
        dt { "limited by" } dd {
            @match (moving > 50.0, white >= floor.max(walk), floor >= walk) {
                (true, ..) => "moves: a faster table",
                (_, true, _) => "white noise: more time",
                (_, _, true) => "the bias instability: more dwells",
                _ => "the random walk: shorter dwells",
            }
            " would help. Shares in the variance of a dwell mean: "
            (format!("white noise {white:.0} %, bias instability {floor:.0} %, random walk {walk:.0} %; moves take {moving:.0} % of the time"))
        }
    }
}

/// How a limited time can be spent.
fn ways(budget: &Spent) -> Markup {
    let best = &budget.best;
    let shown = [4, 5, 6, 8, 9, 10, 12, 14, 16, 20, 25, 30, 35, 40];
    let is_best = |w: &Spending| w.dwells_a_pass == best.dwells_a_pass;
    let listed = |way: &&Spending| is_best(way) || shown.contains(&way.dwells_a_pass);
    html! { (table("Ways to spend the time", &html! { th { "dwells a pass" } th.n { "passes" } th.n { "dwell, s" } th.n { "moves" } th.n { "sigma over best" } th {} }, &html! {
        @for way in budget.ways.iter().filter(listed) { tr {
            td { (way.dwells_a_pass) } td.n { (way.passes) } (number(way.dwell_s, 1.0)) td.n { (format!("{:.0} %", 100.0 * way.moves_s / budget.time_s)) }
            td.n { (format!("{:.3}", way.mean_sigma / best.mean_sigma)) } td { @if is_best(way) { "<" } }
        } }
    })) }
}

/// The dwells of a summary, some of them on a line.
fn dwells(report: &Design) -> Markup {
    let n = report.positions.len();
    let rate = |k: usize| report.rates_dps.as_ref().and_then(|rates| rates.get(k));
    let cell = |k: usize| {
        html! {
            (format!("{:>3}:", k + 1))
            @if report.is_by_hand() { (format!(" {:<26}", words(&report.positions[k].into()))) } @else {
                // Three cells with a rate and their gaps fill exactly a hundred columns.
                @for c in report.positions[k] { (format!("{:>7.3}", round(c, 1e3))) } @if let Some(rate) = rate(k) { (format!("{:>7.1}", round(*rate, 10.0))) }
            }
        }
    };
    let rows = n.div_ceil(ACROSS);
    html! {
        @if report.is_by_hand() {
            p data-head="dwells: " { "hold each still; up to 25 degrees off a pose does not matter, because only the size of gravity is used. +x is up where the accelerometer's x reads most; on an edge two axes read alike, on a corner three. The turns between the poses calibrate the gyro: turn by a quarter or more, about each axis both ways" }
        } @else { p { "dwell: direction that is up, x y z" @if report.rates_dps.is_some() { ", rate in deg/s" } } }
        @for row in 0..rows.min(ROWS) {
            pre { @for (c, k) in (0..ACROSS).map(|c| (c, c * rows + row)).filter(|(_, k)| *k < n) { @if c > 0 { "  " } (cell(k)) } }
        }
        @if rows > ROWS { p { "the other dwells: --verbose, -o, --json" } }
    }
}

/// The dwells in their order.
fn settings(positions: &[[f64; 3]], rates: Option<&[f64]>, begins: Option<&[f64]>) -> Markup {
    html! {
        (table("Dwells", &html! { th { "dwell" } th.n { "up: x" } th.n { "y" } th.n { "z" } @if rates.is_some() { th.n { "rate, deg/s" } } @if begins.is_some() { th.n { "begins, s" } } }, &html! {
            @for (k, up) in positions.iter().enumerate().take(LISTED) { tr {
                td { (k + 1) } @for c in up { td.n { (format!("{:.4}", round(*c, 1e4))) } }
                @if let Some(rate) = rates.and_then(|rates| rates.get(k)) { td.n { (format!("{:.2}", round(*rate, 1e2))) } }
                @if let Some(begin) = begins.and_then(|begins| begins.get(k)) { td.n { (format!("{begin:.0}")) } }
            } }
        }))
        @if positions.len() > LISTED { p { "... and " (positions.len() - LISTED) " more: -o and --json have them" } }
    }
}

fn sigma(report: &Design) -> Markup {
    let unit = readable::parameter(report.dwell_sigma.unit);
    html! {
        (unit.write(report.dwell_sigma.value))
        @match report.noise {
            None => ", given",
            Some(noise) => {
                " (N = " (unit.write(noise.n)) "/√Hz, B = " (unit.write(noise.b)) @if noise.k != 0.0 { ", K = " (unit.write(noise.k)) "/√s" } ")"
            }
        }
    }
}

/// Intervals of the parameters, one column for each sensor if they fit.
fn parameters(report: &Design, level: Level) -> Markup {
    let most = if level.has_all() {
        usize::MAX
    } else {
        PARAMETERS
    };
    let cells = report.sigma_per_parameter.iter().map(|p| {
        let sheet = &p.data_sheet;
        let (name, half, unit) = (&p.name, significant(sheet.half_width_95), &sheet.unit);
        let alone = sheet.population_half_width_95.map(prior::alone);
        match sheet.half_width_95.is_finite() {
            true => format!("{name} ± {half} {unit}{}", alone.unwrap_or_default()),
            false => format!("{name} undetermined"),
        }
    });
    let cells: Vec<String> = cells.collect();
    let width = 2 + cells.iter().map(|c| c.chars().count()).max().unwrap_or(0);
    let across = (columns() / width).clamp(1, 3);
    let rows = cells.len().div_ceil(across);
    let beside = match report.prior {
        None => "",
        Some(_) => " [in brackets: by the population alone, without dwells]",
    };
    html! {
        hr;
        p { "95 % intervals if the noise is known" (beside) }
        @for row in 0..rows.min(most) {
            @let line = (0..across).filter_map(|c| cells.get(c * rows + row)).map(|cell| format!("{cell:<width$}"));
            pre { (line.collect::<String>().trim_end()) }
        }
        @if rows > most { p { "the other parameters: --verbose, --json" } }
    }
}

/// Parameters that the dwells hardly show. Beside a prior they have the half-width in brackets.
fn weak(report: &Design) -> Markup {
    let weak = report.sigma_per_parameter.iter();
    let weak =
        weak.filter(|p| report.prior.is_none() && p.inflation >= WEAK && p.value.is_finite());
    html! { ul class="lines" data-head="warning: " { @for p in weak {
        li { (p.name) " is hardly observable: sigma " (significant(p.inflation)) " times that with the others known" }
    } } }
}

/// Result of `mimu design --effects`.
pub fn next_text(report: &NextExperiment) -> String {
    text(&html! {
        p { (report.title) }
        section {
            dl class="aligned" {
                dt { "experiment" } dd { (report.experiment) }
                dt { "time" } dd { (minutes(report.time_s)) }
                @for of in &report.dwell_sigma {
                    @let (factor, unit) = Figure::Input.readable(of.sensor);
                    dt { "sigma of a dwell mean" } dd { (of.sensor) " " (significant(of.value * factor)) " " (unit) }
                }
                @for effect in &report.effects {
                    @let [share, wanted] = [effect.sigmas, effect.wanted].map(|s| 100.0 / s);
                    dt { (effect.id) } dd { (format!("sigma at most {share:.1} % of the typical size, {wanted:.0} % wanted")) }
                }
            }
            hr;
            (settings(&report.positions, Some(&report.rates_dps), Some(&report.begin_s)))
        }
    })
}
