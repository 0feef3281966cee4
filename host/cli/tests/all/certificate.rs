//! `mimu report --certificate`: the page of a unit has what the file states.

use std::path::Path;

use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::record;
use mimu_rig::rig_file::{RigFile, RigTruth};

use super::command::{done, mimu, says};

const PARTICULARS: &str = r#"
format = "mimu-particulars/1"
number = "2026-117"
received = 2026-11-20
performed = 2026-11-26
location = "room 12"
environment = "23.0 °C ± 0.5 K, 41 % relative humidity"
calibrated_by = "A. Weber, calibration engineer"
authorised_by = "B. Roth, head of laboratory"
remarks = ["The unit was fastened with the customer's bracket."]
traceability = "rate: frequency standard, PTB 2026-3; level: K-17"
[laboratory]
name = "Inertial \"Laboratory\" <Ltd>"
address = "1 Long Road"
[customer]
name = "Example Ltd"
address = "2 Short Road"
[item]
description = "inertial unit"
identification = "SN 4711"
condition = "no damage"
"#;

/// A recording on the bench's table in `folder`.
fn on_table(folder: &Path) {
    let mut plan =
        String::from("format = \"mimu-plan/1\"\nsample_rate_hz = 100.0\ncarrier = \"table\"\n");
    for axis in 0..3 {
        for (sign, rate) in [(1, 100), (-1, 0), (1, -100), (-1, 40), (1, 0)] {
            let up: [i32; 3] = std::array::from_fn(|i| if i == axis { sign } else { 0 });
            plan += &format!("[[step]]\nup = {up:?}\nrate_dps = {rate}.0\ndwell_s = 3.0\n");
        }
    }
    let plan = Plan::parse(Source::new("plan", &plan)).unwrap();
    let truth = RigTruth::resolve(&RigFile::default(), 1).unwrap();
    let output = record::Output::new(&folder.join("rec"), &plan).unwrap();
    record::write(&plan, &truth, 1, &output).unwrap();
}

#[test]
fn the_page_of_a_unit_becomes_a_certificate_by_what_a_file_states() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    on_table(at);
    std::fs::write(at.join("lab.toml"), PARTICULARS).unwrap();
    done(at, "fit rec -o cal.toml");
    done(
        at,
        "report --calibration cal.toml --certificate lab.toml -o page.html",
    );
    let page = std::fs::read_to_string(at.join("page.html")).unwrap();
    says(
        &page,
        &[
            "Calibration certificate 2026-117",
            "Inertial &quot;Laboratory&quot; &lt;Ltd&gt;",
            "1 Long Road",
            "SN 4711",
            "2026-11-20",
            "rate: frequency standard, PTB 2026-3; level: K-17",
            "A. Weber, calibration engineer",
            "The unit was fastened",
            "Inertial unit",
        ],
    );
    let text = PARTICULARS.replace("number = \"2026-117\"", "");
    std::fs::write(at.join("lab.toml"), text).unwrap();
    let command = "report --calibration cal.toml --certificate lab.toml -o other.html";
    says(&mimu(at, command).stderr, &["lab.toml", "number"]);
    assert!(!at.join("other.html").exists());
}
