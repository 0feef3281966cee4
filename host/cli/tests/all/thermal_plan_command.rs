//! The command `mimu thermal plan`: the bench reads its output.

use std::path::Path;

use mimu_rig::plan::{Plan, Pose};
use mimu_rig::table::{Table, TableTruth};

use super::command::{self, Ran};

fn mimu(folder: &Path, arguments: &str) -> Ran {
    command::mimu(folder, &format!("thermal plan {arguments}"))
}

fn planned(folder: &Path, arguments: &str) -> (Plan, serde_json::Value) {
    let out = mimu(
        folder,
        &format!("{arguments} -o plan.toml --json plan.json"),
    );
    assert_eq!(out.status, Some(0), "{}", out.stderr);
    let json = std::fs::read(folder.join("plan.json")).unwrap();
    let plan = Plan::read(&folder.join("plan.toml")).unwrap();
    (plan, serde_json::from_slice(&json).unwrap())
}

#[test]
fn the_bench_reads_every_procedure_and_its_table_can_carry_it_out() {
    let folder = tempfile::tempdir().unwrap();
    for (procedure, dwells) in [("soak", 12), ("niu", 16), ("ramp", 12), ("rest-ramp", 1)] {
        let arguments = format!("--procedure {procedure} --range -20..60 --rate 2");
        let (plan, json) = planned(folder.path(), &arguments);
        assert_eq!(plan.steps.len(), dwells);
        assert_eq!(json["format"], "mimu-thermal-plan/1");
        assert_eq!(json["dwells"].as_u64().unwrap(), plan.dwells());
        let chamber: Vec<f64> = plan.chamber.iter().map(|c| c[1]).collect();
        let least = chamber.iter().copied().fold(f64::INFINITY, f64::min);
        let most = chamber.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        assert_eq!((least, most), (-20.0, 60.0));
        // The bench refuses rounds that take too long, and poses out of reach.
        Table::new(&plan, &TableTruth::ideal()).unwrap();
    }
}

#[test]
fn nius_cycle_is_the_published_one() {
    let folder = tempfile::tempdir().unwrap();
    let (plan, json) = planned(folder.path(), "--procedure niu --range -35..75");
    let turns: Vec<_> = plan.steps.iter().filter_map(|s| s.turn).collect();
    assert_eq!(turns.len(), 8);
    assert!(
        turns
            .iter()
            .all(|t| (t.rate.to_degrees() - 10.0).abs() < 1e-9)
    );
    let rests = plan.steps.iter().filter(|s| s.turn.is_none());
    assert!(rests.clone().count() == 8 && rests.clone().skip(1).all(|s| s.pose == Pose::Here));
    // 152 s per cycle (niu 3.2): some ninety of them in 3 h 50 min.
    let rounds = f64::from(plan.rounds);
    let round_s = (json["duration_s"].as_f64().unwrap() - plan.lead_in_s) / rounds;
    assert!((round_s - 152.0).abs() < 0.1, "{round_s}");
}

#[test]
fn a_course_and_a_soak_both_ways_reach_the_plan() {
    let folder = tempfile::tempdir().unwrap();
    let (plan, json) = planned(
        folder.path(),
        "--procedure niu --course 25,-35:30,75:60,-35:30",
    );
    // niu, Table 2, profile 1, as in the bench's plans/niu-ramp.toml: s, °C.
    let known = [
        [0.0, 25.0],
        [1800.0, -35.0],
        [3600.0, -35.0],
        [6900.0, 75.0],
        [10500.0, 75.0],
        [13800.0, -35.0],
        [15600.0, -35.0],
    ];
    assert_eq!(plan.chamber, known);
    assert_eq!(json["range_c"], serde_json::json!([-35.0, 75.0]));
    Table::new(&plan, &TableTruth::ideal()).unwrap();
    let (plan, _) = planned(
        folder.path(),
        "--procedure soak --range -30..70 --points 11 --both-ways",
    );
    assert_eq!(plan.rounds, 22);
    let refused = mimu(folder.path(), "--procedure soak --course 25,-35:30");
    assert_eq!(refused.status, Some(1));
    let usage = mimu(folder.path(), "--procedure niu --course warm");
    assert_eq!(usage.status, Some(2));
}
