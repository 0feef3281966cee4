//! Any number, anywhere in a plan or a rig file: refused with its line, or recorded without a NaN.

use std::ops::Range;

use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::record::samples;
use mimu_rig::rig_file::{RigFile, RigTruth};

#[rustfmt::skip]
const EXTREMES: [&str; 16] = [
    "nan", "inf", "-inf", "1e308", "-1e308", "1e-308", "5e-324", "-0.0", "0", "1", "-1", "1e9", "-1e9", "1e17", "4294967295",
    "9223372036854775807",
];

const TABLE: &str = "format = \"mimu-plan/1\"\nsample_rate_hz = 100.0\ncarrier = \"table\"\nlatitude_deg = 30.0\n\
                     gravity_mps2 = 9.8\nchamber_c = [[0.0, 20.0], [10.0, 30.0]]\nlead_in_s = 0.5\n\
                     [[step]]\nup = [0.0, 1.0, 0.0]\nheading_deg = 10.0\nrate_dps = 100.0\nspin_dps = 5.0\n\
                     dwell_s = 0.2\nrepeat = 2\n[[step]]\nposes = 3\ndwell_s = 0.2\n";
const HANDS: &str = "format = \"mimu-plan/1\"\nsample_rate_hz = 100.0\ncarrier = \"hands\"\n[[step]]\nposes = 3\ndwell_s = 0.3\n";

/// Positions of the numbers in a TOML text without comments.
fn numbers(text: &str) -> Vec<Range<usize>> {
    let mut found = Vec::new();
    let mut start = 0;
    for line in text.split_inclusive('\n') {
        if let Some((key, values)) = line.split_once('=')
            && !values.contains('"')
        {
            let mut at = start + key.len() + 1;
            for value in values.split_inclusive([',', '[', ']', '\n', ' ']) {
                let word = value.trim_end_matches([',', '[', ']', '\n', ' ']);
                if word.parse::<f64>().is_ok() {
                    found.push(at..at + word.len());
                }
                at += value.len();
            }
        }
        start += line.len();
    }
    found
}

/// Records a second; error messages must name a file and a line.
fn record(plan: &str, rig: &str) -> Result<usize, String> {
    let plan = Plan::parse(Source::new("PLAN.toml", plan))?;
    let file = RigFile::parse(&Source::new("RIG.toml", rig))?;
    let truth = RigTruth::resolve(&file, 1).unwrap();
    let again = RigFile::parse(&Source::new("truth.toml", truth.file.to_toml()));
    assert_eq!(again.as_ref(), Ok(&truth.file));
    let mut count = 0;
    for row in samples(&plan, &truth, 1)?.take(100) {
        let readings = row.readings;
        let [force, rate] =
            [row.instant.stated_force, row.instant.stated_rate].map(Option::unwrap_or_default);
        let all = [
            readings.gyro,
            readings.accel,
            force,
            rate,
            [readings.temp_c; 3],
        ];
        assert!(all.as_flattened().iter().all(|x| x.is_finite()), "{row:?}");
        count += 1;
    }
    Ok(count)
}

#[test]
fn no_number_makes_a_recording_that_is_not_finite_or_a_complaint_without_a_line() {
    let every = RigFile {
        draw_effects: Some(mimu_rig::effects::specs().count()),
        ..RigFile::default()
    };
    let every = RigTruth::resolve(&every, 1).unwrap().file.to_toml();
    let held = every.replace("held = false", "held = true");
    let take_out = every.replace("take_out_reference = false", "take_out_reference = true");
    let (mut recorded, mut refused) = (0, 0);
    for (plan, rig, of_plan) in [
        (TABLE, "format = \"mimu-rig/1\"", true),
        (HANDS, "format = \"mimu-rig/1\"", true),
        (TABLE, &take_out, false),
        (HANDS, &held, false),
    ] {
        let text = if of_plan { plan } else { rig };
        for at in numbers(text) {
            for extreme in EXTREMES {
                let mut changed = text.to_owned();
                changed.replace_range(at.clone(), extreme);
                let (plan, rig) = if of_plan {
                    (&*changed, rig)
                } else {
                    (plan, &*changed)
                };
                match record(plan, rig) {
                    Ok(count) => recorded += count,
                    Err(complaint) => {
                        let mut parts = complaint.splitn(3, ':');
                        let (name, line) = (parts.next(), parts.next());
                        assert!(
                            name == Some("PLAN.toml") || name == Some("RIG.toml"),
                            "{complaint}"
                        );
                        assert!(
                            line.is_some_and(|line| line.parse::<u32>().is_ok()),
                            "{complaint}"
                        );
                        assert!(
                            !complaint.contains('\n') && complaint.contains("; "),
                            "{complaint}"
                        );
                        refused += 1;
                    }
                }
            }
        }
    }
    assert!(recorded > 100_000 && refused > 1000, "{recorded} {refused}");
}
