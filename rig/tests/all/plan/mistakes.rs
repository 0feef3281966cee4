//! Mistakes within a plan, independent of the table.

use super::{Complaint, HEAD, STEP, assert_complaint, parse};

#[test]
fn mistakes_in_the_head_are_named_with_their_line() {
    #[rustfmt::skip]
    let cases: [(&str, Complaint); 20] = [
        ("", ("PLAN.toml:1: missing field `format`", "add")),
        ("\u{1}\u{2}garbage", ("PLAN.toml:1: ", "correct the line")),
        ("a,b,c\n1,2,3\n", ("PLAN.toml:1: ", "correct the line")),
        ("format = \"mimu-recording/1\"\nsample_rate_hz = 1.0\ncarrier = \"table\"", ("PLAN.toml:1: format", "mimu-plan/1")),
        ("format = \"mimu-plan/1\"\ncarrier = \"table\"", ("PLAN.toml:1: missing field `sample_rate_hz`", "add")),
        (
            "format = \"mimu-plan/1\"\ncarrier = \"robot\"",
            (
                "PLAN.toml:2: `carrier`: unknown variant `robot`, expected `table` or `hands`",
                "correct the line",
            ),
        ),
        ("format = \"mimu-plan/1\"\nsamples = \"xls\"", ("PLAN.toml:2: `samples`: unknown variant `xls`, expected `parquet` or `csv`", "correct the line")),
        ("HEADsample_rate_hz = 3.0", ("PLAN.toml:4: duplicate key", "correct")),
        ("HEADlatitude_rad = 0.5", ("PLAN.toml:4: unknown field `latitude_rad`, expected one of `format`, ", "remove the key")),
        ("HEADlatitude_deg = 95", ("PLAN.toml:4: `latitude_deg` is 95", "-90 to 90 degrees")),
        ("HEADgravity_mps2 = 1.0", ("PLAN.toml:4: `gravity_mps2` is 1", "9.7 to 9.9 m/s²")),
        ("HEADchamber_c = [[0, 25],\n [5, 26],\n [5, 27]]", ("PLAN.toml:6: `chamber_c`: time 5 s", "in order of time")),
        ("HEADchamber_c = [[0, 298.15]]", ("PLAN.toml:4: `chamber_c`: 298.15 °C", "degrees Celsius")),
        ("HEADchamber_c = [[0, nan]]", ("PLAN.toml:4: `chamber_c`: NaN °C", "degrees Celsius")),
        ("HEADchamber_c = [0, 25]", ("PLAN.toml:4: `chamber_c`: invalid type", "correct the line")),
        ("HEADlead_in_s = -1", ("PLAN.toml:4: `lead_in_s` is -1", "give 0")),
        ("HEADchamber_c = [[-1e308, 20], [1e308, 30]]", ("PLAN.toml:4: `chamber_c`: time -1e308 s", "48 h")),
        ("HEADdevice = \"a\\nb\"", ("PLAN.toml:4: `device` is not a name", "in one line")),
        ("HEADdevice = \" \"", ("PLAN.toml:4: `device`", "name the unit")),
        ("HEADlead_in_s = 1\n\n", ("PLAN.toml:4: the plan has no entry", "[[step]]")),
    ];
    for (text, complaint) in cases {
        // If the mistake is in the head, a step is added, so that the missing step is not the error.
        let step = if text.contains("HEAD") && !text.ends_with("\n\n") {
            STEP
        } else {
            ""
        };
        assert_complaint(
            &format!("{}\n{step}", text.replace("HEAD", HEAD)),
            complaint,
        );
    }
    for rate in ["0.5", "0", "-100", "20001", "inf", "nan"] {
        let text = format!(
            "format = \"mimu-plan/1\"\nsample_rate_hz = {rate}\ncarrier = \"table\"\n{STEP}"
        );
        assert_complaint(
            &text,
            ("PLAN.toml:2: `sample_rate_hz` is", "give 1 to 20000 Hz"),
        );
    }
}

#[test]
fn mistakes_in_a_step_are_named_with_their_line() {
    #[rustfmt::skip]
    let cases: [(&str, Complaint); 20] = [
        ("dwell_s = 1", ("PLAN.toml:4: `up` is missing", "`poses")),
        ("up = [0, 0, 1]", ("PLAN.toml:4: `dwell_s` is missing", "in seconds")),
        ("up = [0, 0, 1]\nposes = 3\ndwell_s = 1", ("PLAN.toml:6: `up` and `poses`", "keep one")),
        ("up = [0, 0, 0]\ndwell_s = 1", ("PLAN.toml:5: `up` has no length", "direction")),
        ("up = [0, 0, inf]\ndwell_s = 1", ("PLAN.toml:5: `up` is not finite", "three numbers")),
        ("up = [0, 1]\ndwell_s = 1", ("PLAN.toml:5: `up`: invalid length 2, expected an array of length 3", "correct the line")),
        ("up = \"z\"\ndwell_s = 1", ("PLAN.toml:5: `up`: invalid type: string \"z\", expected an array of length 3", "correct the line")),
        ("up_deg = [0, 0, 1]\ndwell_s = 1", ("PLAN.toml:5: unknown field `up_deg`, expected one of `up`, ", "remove the key")),
        ("up = [0, 0, 1]\ndwell_s = 0", ("PLAN.toml:6: `dwell_s` is 0", "in seconds")),
        ("up = [0, 0, 1]\ndwell_s = -3", ("PLAN.toml:6: `dwell_s` is -3", "in seconds")),
        ("up = [0, 0, 1]\ndwell_s = nan", ("PLAN.toml:6: `dwell_s` is NaN", "in seconds")),
        ("up = [0, 0, 1]\ndwell_s = \"2 s\"", ("PLAN.toml:6: `dwell_s`: invalid type: string", "correct the line")),
        ("up = [0, 0, 1]\nrate_dps = inf\ndwell_s = 1", ("PLAN.toml:6: `rate_dps` is inf", "-36000 to 36000")),
        ("up = [0, 0, 1]\nheading_deg = nan\ndwell_s = 1", ("PLAN.toml:6: `heading_deg` is NaN", "-360 to 360 degrees")),
        ("up = [0, 0, 1]\ndwell_s = 1\nrepeat = 0", ("PLAN.toml:7: `repeat` is 0", "one or more")),
        ("up = [0, 0, 1]\ndwell_s = 1\nrepeat = -1", ("PLAN.toml:7: `repeat`: invalid value", "correct the line")),
        ("poses = 0\ndwell_s = 1", ("PLAN.toml:5: `poses` is 0", "one or more")),
        ("poses = 4000000000\ndwell_s = 0.001", ("PLAN.toml:5: up to this entry the plan has 4000000000 dwells", "100000 dwells")),
        ("[[step.up]]\nx = 1", ("PLAN.toml:5: `[[step.up]]`: invalid type", "correct the line")),
        ("up = [0, 0, 1]\nrepeat = 3\ndwell_s = 90000", ("PLAN.toml:5: up to this entry the plan has 3 dwells, 75.0 h", "48 h")),
    ];
    for (step, complaint) in cases {
        assert_complaint(&format!("{HEAD}[[step]]\n{step}\n"), complaint);
    }
    for key in ["rate_dps", "spin_dps"] {
        let head = HEAD.replace("table", "hands");
        let error = parse(&format!(
            "{head}[[step]]\nup = [0, 0, 1]\n{key} = 10\ndwell_s = 1\n"
        ))
        .unwrap_err();
        assert!(
            error.starts_with(&format!("PLAN.toml:6: `{key}` by hand")),
            "{error}"
        );
    }
    let tumble = "tumble_s = 60\ndwell_s = 1";
    assert_complaint(
        &format!("{HEAD}[[step]]\n{tumble}\n"),
        ("PLAN.toml:5: `tumble_s` on a table", "hands"),
    );
    let head = HEAD.replace("table", "hands");
    for (step, complaint) in [
        (
            format!("up = [0, 0, 1]\n{tumble}"),
            ("PLAN.toml:6: `tumble_s` beside a pose", "separate"),
        ),
        (
            tumble.to_owned(),
            ("PLAN.toml:4: the first entry has no pose", "add `up`"),
        ),
        (
            "tumble_s = 0.5\ndwell_s = 1".to_owned(),
            ("PLAN.toml:5: `tumble_s` is 0.5", "1 to 3600 s"),
        ),
    ] {
        assert_complaint(&format!("{head}[[step]]\n{step}\n"), complaint);
    }
}
