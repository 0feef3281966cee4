//! The problems of a recording form one typed list, which comes first in the text, one line per kind.

use mimu::fit::{Fit, Options, fit};
use mimu::recording_problem::RecordingProblem;
use mimu::result::fit::FitResult;
use mimu_cli::report::fit_text;
use mimu_recording::RawUnit;
use mimu_rig::rig_file::RigFile;
use mimu_tests::bench;
use mimu_tests::says;

const FIXTURE: &str = include_str!("../../../rig/plans/fixture.toml");
const SEED: u64 = 4;

fn unit() -> RigFile {
    bench::drawn(SEED, "unit")
}

fn fitted(plan: &str) -> Fit {
    let prepared = bench::recorded(plan, &unit(), SEED);
    fit(prepared, Options::default()).expect("a fit")
}

fn ids(fit: &Fit) -> Vec<&'static str> {
    RecordingProblem::of(fit)
        .iter()
        .map(RecordingProblem::id)
        .collect()
}

#[test]
fn a_good_recording_has_no_problem() {
    assert_eq!(ids(&fitted(&bench::hand_plan(30))), [""; 0]);
}

#[test]
fn twenty_samples_a_second_are_too_few_for_turns_by_hand() {
    let slow = bench::hand_plan(30).replace("sample_rate_hz = 100.0", "sample_rate_hz = 20.0");
    let fit = fitted(&slow);
    assert_eq!(ids(&fit), ["slow_for_turns"]);
    let said = RecordingProblem::of(&fit)[0].to_string();
    says(&said, &["20.0 Hz", "50 Hz or more"]);
}

#[test]
fn a_face_that_no_pose_had_up_is_named() {
    let fit = fitted(FIXTURE);
    let all = RecordingProblem::of(&fit);
    let missing = all
        .iter()
        .find(|p| p.id() == "missing_poses")
        .expect("is named");
    assert!(missing.to_string().contains("-z"), "{missing}");
}

#[test]
fn an_offset_that_no_part_has_and_a_wrong_unit_are_said() {
    let mut prepared = bench::recorded(&bench::hand_plan(30), &unit(), SEED);
    // Volts declared as m/s²: 1.65 V at rest, 0.08 V per m/s².
    prepared.manifest.raw_unit = RawUnit::Si;
    let fit = fit(prepared, Options::default()).expect("a fit");
    let found = ids(&fit);
    assert!(found.contains(&"unit"), "{found:?}");
    assert_eq!(
        found.iter().filter(|id| **id == "offset").count(),
        3,
        "{found:?}"
    );
}

#[test]
fn the_list_is_first_and_a_summary_has_at_most_25_lines_of_100_columns() {
    for plan in [bench::hand_plan(30), FIXTURE.to_owned()] {
        let fit = fitted(&plan);
        let result = FitResult::of(&fit);
        let [summary, all] = [false, true].map(|verbose| fit_text(&result, verbose));
        assert!(summary.lines().count() <= 25, "{summary}");
        // A sentence is one line; tables keep to the columns.
        let sentences = ["  - ", "warning:", "next:", "judgement:"];
        for line in summary
            .lines()
            .filter(|l| !sentences.iter().any(|s| l.starts_with(s)))
        {
            assert!(line.chars().count() <= 100, "{line}");
        }
        assert!(all.lines().count() > summary.lines().count(), "{all}");
        let problems = RecordingProblem::of(&fit);
        let headed = summary
            .lines()
            .position(|l| l == "problems of this recording:");
        assert_eq!(headed.is_some(), !problems.is_empty());
        let judgement = summary.lines().position(|l| l.starts_with("judgement:"));
        assert!(headed < judgement, "{summary}");
        let json = serde_json::to_value(&result).expect("JSON");
        let listed = json["recording_problems"].as_array().expect("a list");
        assert_eq!(listed.len(), problems.len());
        for (json, problem) in listed.iter().zip(&problems) {
            assert_eq!(json["id"], problem.id());
            assert_eq!(json["text"], problem.to_string());
        }
    }
}
