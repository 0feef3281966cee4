//! A design as JSON: `mimu-design/1`, `mimu-design-comparison/1`.

use serde_json::{Value, json};

use super::DesignReport;
use mimu::design::budget::Spending;
use mimu::design::judgement::HALF_95;
use mimu::design::schemes::Scheme;
use mimu_recording::Reference;

/// Result of `mimu design` as JSON.
pub fn design_json(report: &DesignReport) -> Value {
    let j = &report.judgement;
    let reach = &report.problem.reach;
    let positions: Vec<[f64; 3]> = j.settings.iter().map(|s| s.up.into()).collect();
    let parameters: Vec<Value> = j
        .parameters
        .iter()
        .map(|p| {
            let sigma = p.sigma * p.parameter.si;
            json!({
                "name": p.parameter.name,
                "value": sigma, // infinite is null
                "unit": p.parameter.unit,
                "half_width_95": HALF_95 * sigma,
                "inflation": p.inflation,
            })
        })
        .collect();
    let notices: Vec<Value> = j
        .notices
        .iter()
        .map(|notice| {
            let (factor, unit) = report.noticed(notice);
            json!({
                "term": notice.term.name(),
                "parameters": notice.parameters,
                "noticed": notice.noticed,
                "smallest": notice.size.map(|s| s * factor),
                "unit": unit,
            })
        })
        .collect();
    let mut value = json!({
        "format": "mimu-design/1",
        "tool": concat!("mimu ", env!("CARGO_PKG_VERSION")),
        "title": report.title,
        "sensor": reach.model.sensor.name(),
        "reference": match reach.model.reference {
            Reference::Table => "table",
            Reference::Gravity => "gravity",
        },
        "model": reach.model.to_string(),
        "table": reach.carrier.name(),
        "positions": positions,
        "d_efficiency": j.d_efficiency,
        "determinant": j.determinant,
        "optimum": {
            "determinant": report.problem.optimum.log_det.exp(),
            "excess": report.problem.optimum.excess,
        },
        "condition": j.condition,
        "sigma_per_parameter": parameters,
        "mean_sigma": j.mean_sigma,
        "undetermined": j.undetermined(),
        "dof": { "lack_of_fit": j.lack_of_fit_dof, "repetition": j.repetition_dof },
        "notices": notices,
        "dwell_s": report.dwell_s,
        "dwell_sigma": { "value": j.sigma, "unit": reach.model.bias_unit().0 },
        "order": report.order_name(),
        "turned_over": report.turned_over,
        "moves_s": report.moves_s(),
        "shortest_moves_s": report.shortest_moves_s,
        "time_s": report.time_s(),
    });
    if report.gyro() {
        let rates: Vec<f64> = j.settings.iter().map(|s| s.rate.to_degrees()).collect();
        value["rates_dps"] = json!(rates);
    }
    if let Some(filters) = report.filters() {
        value["filters"] = json!(filters.map(|f| json!({
            "d_efficiency": f.d_efficiency,
            "determinant": f.determinant,
            "mean_sigma": f.mean_sigma,
        })));
    }
    if let Some((budget_s, budget)) = &report.budget {
        let spending = |s: &Spending| {
            json!({
                "dwells_a_pass": s.each_pass(),
                "passes": s.passes,
                "dwell_s": s.dwell_s,
                "moves_s": s.moves_s,
                "mean_sigma": s.mean_sigma,
            })
        };
        let ways: Vec<Value> = budget.by_size.iter().map(spending).collect();
        value["budget"] =
            json!({ "time_s": budget_s, "best": spending(&budget.best), "ways": ways });
    }
    value
}

/// Result of `mimu design --compare` as JSON.
pub fn comparison_json(reports: &[DesignReport], out_of_reach: &[Scheme]) -> Value {
    let designs: Vec<Value> = reports.iter().map(design_json).collect();
    let names: Vec<&str> = out_of_reach.iter().map(|s| s.name()).collect();
    json!({ "format": "mimu-design-comparison/1", "designs": designs, "out_of_reach": names })
}
