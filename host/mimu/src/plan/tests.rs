use super::*;

fn dwells(steps: &str, carrier: &str) -> Result<Vec<Planned>> {
    let folder = std::env::temp_dir().join(format!("mimu-plan-{}", std::process::id()));
    let name = format!("{carrier}-{}.toml", steps.len());
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join(name);
    let head = "format = \"mimu-plan/1\"\nsample_rate_hz = 1000.0\n";
    let text = format!("{head}carrier = \"{carrier}\"\n{steps}");
    std::fs::write(&path, text).unwrap();
    let plan = Plan::read(&path)?;
    plan.dwells(9.8, "plan.toml")
}

#[test]
fn a_rate_about_the_vertical_is_along_the_direction_that_points_up() {
    let all = dwells(
        "[[step]]\nup = [0.0, -2.0, 0.0]\nrate_dps = 100.0\ndwell_s = 2.0\nrepeat = 2\n\
         [[step]]\nup = [0.0, 0.0, -1.0]\nspin_dps = 10.0\ndwell_s = 1.5\n",
        "table",
    )
    .unwrap();
    assert_eq!(all.len(), 3);
    assert_eq!(all[0], all[1]);
    assert_eq!(all[0].input, [0.0, -100.0, 0.0, 0.0, -9.8, 0.0]);
    assert_eq!(all[0].length, Duration::from_secs(2));
    // About the body's own z, whichever way that points.
    assert_eq!(all[2].input, [0.0, 0.0, 10.0, 0.0, 0.0, -9.8]);
}

#[test]
fn by_hand_no_input_is_known() {
    let all = dwells("[[step]]\nposes = 3\ndwell_s = 1.0\n", "hands").unwrap();
    assert_eq!(all.len(), 3);
    assert!(all[2].input.iter().all(|v| v.is_nan()));
}

#[test]
fn what_has_no_input_is_refused_by_its_step() {
    #[rustfmt::skip]
    let cases = [
        ("[[step]]\nposes = 3\ndwell_s = 1.0\n", "[[step]] 1: poses"),
        ("[[step]]\nup = [1.0, 0.0, 0.0]\nspin_dps = 1.0\ndwell_s = 1.0\n", "not constant"),
        ("[[step]]\ndwell_s = 1.0\n", "up or poses"),
        ("[[step]]\nup = [0.0, 0.0, 1.0]\ndwell_s = -1.0\n", "dwell_s"),
        ("[[step]]\nup = [0.0, 0.0, 1.0]\ndwel = 1.0\n", "line 6"),
        ("rounds = 0\n[[step]]\nup = [0.0, 0.0, 1.0]\ndwell_s = 1.0\n", "rounds is 0"),
        ("[[step]]\nstay = true\ndwell_s = 1.0\n", "no pose to begin in"),
        ("[[step]]\nup = [0.0, 0.0, 1.0]\nturn_axis = \"inner\"\nturn_deg = 0.0\nturn_dps = 5.0\n", "an angle and a rate"),
        ("[[step]]\nup = [0.0, 0.0, 1.0]\nturn_deg = 10.0\ndwell_s = 5.0\n", "without turn_axis"),
    ];
    for (steps, words) in cases {
        let line = dwells(steps, "table").unwrap_err().to_string();
        assert!(line.contains(words), "{line}");
    }
}

#[test]
fn a_turn_ends_where_the_step_after_it_stays_and_rounds_go_on_from_there() {
    let steps = "rounds = 2\n[[step]]\nup = [0.0, 0.0, 1.0]\ndwell_s = 2.0\n\
                 [[step]]\nturn_axis = \"middle\"\nturn_deg = -90.0\nturn_dps = 10.0\n\
                 [[step]]\nstay = true\ndwell_s = 1.5\n";
    let all = dwells(steps, "table").unwrap();
    assert_eq!(all.len(), 6);
    assert_eq!([&all[0], &all[2]], [&all[3], &all[5]]);
    assert_eq!(all[1].length, Duration::from_secs(9));
    // The mean rate is the angle over the time that the turn took; the force during a turn is not
    // given.
    assert_eq!(all[1].input_over(10.0)[..3], [-9.0, 0.0, 0.0]);
    assert!(all[1].input[3..].iter().all(|f| f.is_nan()));
    assert_eq!(all[2].input, [0.0, 0.0, 0.0, 0.0, -9.8, 0.0]);
    assert!(dwells(steps, "hands").is_err());
}
