//! `mimu report --certificate`: what the page says is what the fit found and what the files state.

use std::path::Path;

use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::record;
use mimu_rig::rig_file::{RigFile, RigTruth};

use super::command::{done, json, mimu, says};

const PARTICULARS: &str = r#"
format = "mimu-particulars/1"
number = "2026-117"
received = 2026-11-20
performed = 2026-11-26
issued = 2026-11-27
location = "room 12"
environment = "23.0 °C ± 0.5 K, 41 % relative humidity"
calibrated_by = "A. Weber, calibration engineer"
authorised_by = "B. Roth, head of laboratory"
remarks = ["The unit was fastened with the customer's bracket."]
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

const STATED: &str = r#"
[reference_error]
source = "certificate K-17"
traceability = "rate: frequency standard, PTB 2026-3; level: K-17"
rate = 2e-4
mounting_deg = 0.02
level_deg = 0.01
rectangular = ["level_deg"]
"#;

/// A recording on the bench's table in `folder`, whose manifest says `more`.
fn on_table(folder: &Path, name: &str, seed: u64, more: &str) {
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
    let output = record::Output::new(&folder.join(name), &plan).unwrap();
    record::write(&plan, &truth, seed, &output).unwrap();
    let manifest = folder.join(name).join("recording.toml");
    let text = std::fs::read_to_string(&manifest).unwrap();
    std::fs::write(&manifest, text + more).unwrap();
}

/// Numbers of the rows of the results in the page, by the name in their first cell: value, U, and k.
fn row(page: &str, section: &str, name: &str) -> [f64; 3] {
    let section = page
        .split(&format!("Parameters of the {section}"))
        .nth(1)
        .unwrap();
    let row = section.split(&format!("<td>{name}</td>")).nth(1).unwrap();
    let row = row.split("</tr>").next().unwrap();
    let data: Vec<f64> = row
        .split("<data value=\"")
        .skip(1)
        .map(|rest| rest.split('"').next().unwrap().parse().unwrap())
        .collect();
    let cells = row.split("<td class=\"n\">").nth(3).unwrap();
    [
        data[0],
        data[1],
        cells.split('<').next().unwrap().parse().unwrap(),
    ]
}

#[test]
fn a_certificate_has_the_results_of_the_fit_with_their_uncertainties() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    on_table(at, "old", 1, STATED);
    on_table(at, "new", 2, STATED);
    std::fs::write(at.join("lab.toml"), PARTICULARS).unwrap();
    done(at, "fit old -o old.toml");
    let fit = json(at, "fit new -o new.toml");
    done(
        at,
        "report new --certificate lab.toml --as-found old.toml --calibration new.toml -o page.html",
    );
    let page = std::fs::read_to_string(at.join("page.html")).unwrap();
    for sensor in ["gyro", "accel"] {
        let spoken = if sensor == "gyro" {
            "gyro"
        } else {
            "accelerometer"
        };
        for (key, name) in [("scale_x", "scale factor x"), ("bias_z", "bias z")] {
            let all = fit["sensors"][sensor]["parameters"].as_array().unwrap();
            let p = all.iter().find(|p| p["name"] == key).unwrap();
            let of = |key: &str| p[key].as_f64().unwrap();
            let [value, expanded, k] = row(&page, spoken, name);
            assert_eq!(value, of("value"), "{sensor} {name}");
            let half = 0.5 * (of("upper") - of("lower"));
            assert!((expanded / half - 1.0).abs() < 1e-9, "{sensor} {name}");
            assert!((k - half / of("sigma")).abs() < 0.006, "{sensor} {name}");
        }
    }
    says(
        &page,
        &[
            "2026-117",
            "Inertial &quot;Laboratory&quot; &lt;Ltd&gt;",
            "1 Long Road",
            "SN 4711",
            "2026-11-20",
            "rate: frequency standard, PTB 2026-3; level: K-17",
            "rectangular, limits",
            "A. Weber, calibration engineer",
            "The unit was fastened",
            "new.toml",
            "What the variance of each parameter consists of",
        ],
    );
    assert!(page.contains("counter(page) \" of \" counter(pages)"));
    // The name of the laboratory is in the style sheet too, and cannot end it.
    assert_eq!(page.matches("</style>").count(), 1);
    // Two sessions of a unit that did not change.
    says(&page, &["parameters changed by more than"]);
}

#[test]
fn the_same_calibration_as_found_has_not_changed_and_another_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    on_table(at, "one", 1, STATED);
    on_table(at, "two", 2, STATED);
    std::fs::write(at.join("lab.toml"), PARTICULARS).unwrap();
    done(at, "fit one -o one.toml");
    done(at, "fit two -o two.toml");
    done(
        at,
        "report one --certificate lab.toml --as-found one.toml -o page.html",
    );
    let page = std::fs::read_to_string(at.join("page.html")).unwrap();
    assert!(page.contains("<strong>0 of "), "nothing has changed");
    let one = std::fs::read_to_string(at.join("one.toml")).unwrap();
    let lines = one.lines().map(|line| match line.starts_with("device = ") {
        true => "device = \"another\"",
        false => line,
    });
    std::fs::write(
        at.join("another.toml"),
        lines.collect::<Vec<_>>().join("\n"),
    )
    .unwrap();
    says(
        &mimu(
            at,
            "report one --certificate lab.toml --as-found another.toml -o other.html",
        )
        .stderr,
        &["another.toml: it is of \"another\""],
    );
    says(
        &mimu(
            at,
            "report one --certificate lab.toml --calibration two.toml -o other.html",
        )
        .stderr,
        &["it was made from another recording"],
    );
    assert!(!at.join("other.html").exists());
}
