//! The command `mimu design --prior`: its output and its refusals.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use super::command::{self, all_refused};

/// 0.8 % of 1665 counts per m/s², 4 mrad, 0.2 m/s².
const SIZES: [f64; 9] = [13.32, 13.32, 13.32, 4e-3, 4e-3, 4e-3, 333.0, 333.0, 333.0];
#[rustfmt::skip]
const NAMES: [&str; 9] = [
    "scale_x", "scale_y", "scale_z", "non_orthogonality_yz", "non_orthogonality_zy", "non_orthogonality_zx", "bias_x", "bias_y", "bias_z",
];

/// A prior of `sensor` whose parameters are independent.
fn kind(sensor: &str, reference: &str, biases: bool) -> String {
    let mean = [1665.0, 1665.0, 1665.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let mut text = format!(
        "format = \"mimu-prior/1\"\ntool = \"test\"\nraw_unit = \"count\"\nreference = \"{reference}\"\nbiases = {biases}\n[{sensor}]\nunits = 60\n\
         parameters = {NAMES:?}\nparameter_units = {:?}\nmean = {mean:?}\nsigma = {SIZES:?}\ncovariance = [\n",
        [""; 9]
    );
    for (i, size) in SIZES.iter().enumerate() {
        let row: [f64; 9] = std::array::from_fn(|j| if i == j { size * size } else { 0.0 });
        writeln!(text, "{row:?},").unwrap();
    }
    text + "]\n"
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let files = [
        ("kind.toml", kind("accel", "gravity", true)),
        ("unbiased.toml", kind("accel", "gravity", false)),
        ("gyro.toml", kind("gyro", "gravity", true)),
        ("table.toml", kind("accel", "table", true)),
        ("plan.toml", "format = \"mimu-plan/1\"\n".into()),
        (
            "negative.toml",
            kind("accel", "gravity", true).replace("177.4", "-177.4"),
        ),
    ];
    for (name, text) in files {
        fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

fn text(folder: &Path, arguments: &str) -> String {
    command::done(folder, &format!("design {arguments}"))
}

fn json(folder: &Path, arguments: &str) -> serde_json::Value {
    command::json(folder, &format!("design {arguments}"))
}

#[test]
fn without_a_number_the_plan_has_the_fewest_dwells_for_the_targets() {
    let folder = folder();
    let of = |arguments: &str| {
        let design = json(
            folder.path(),
            &format!("--prior kind.toml --sigma 0.0015{arguments}"),
        );
        let dwells = design["positions"].as_array().unwrap().len();
        let widest = |start: &str, wanted: &dyn Fn(&str) -> bool| {
            let all = design["sigma_per_parameter"].as_array().unwrap().iter();
            all.filter(|p| {
                let name = p["name"].as_str().unwrap();
                name.starts_with(start) && wanted(name)
            })
            .map(|p| p["half_width_95"].as_f64().unwrap())
            .fold(0.0, f64::max)
        };
        let scale = widest("C_", &|n| n.as_bytes()[2] == n.as_bytes()[3]);
        (dwells, scale, widest("o_", &|_| true))
    };
    let (dwells, scale, bias) = of("");
    assert!(scale <= 1e-3 && bias <= 1e-3 * 9.80665, "{scale} {bias}");
    let (fewer, coarse, _) =
        of(" --target accel-scale=5000 --target accel-angle=9000 --target accel-bias=5");
    assert!(
        fewer < dwells && coarse <= 5e-3,
        "{fewer} {dwells} {coarse}"
    );
    // The plan is that of a person, as without a prior.
    text(
        folder.path(),
        "--prior kind.toml --sigma 0.0015 -o made.toml",
    );
    let plan: toml::Table = fs::read_to_string(folder.path().join("made.toml"))
        .unwrap()
        .parse()
        .unwrap();
    assert_eq!(plan["carrier"].as_str(), Some("hands"));
    assert_eq!(plan["step"].as_array().unwrap().len(), dwells);
}

#[test]
fn what_a_prior_is_not_for_is_refused_by_its_name() {
    let folder = folder();
    #[rustfmt::skip]
    let cases = [
        ("--prior kind.toml --table three-axis", 1, "--table three-axis with --prior"),
        ("--prior kind.toml --table faces -n 9", 1, "leave --table out"),
        ("--prior kind.toml --reference table", 1, "--reference table with --prior"),
        ("--prior kind.toml --sensor gyro", 1, "turns between dwells"),
        ("--prior kind.toml --effects accel_warm_up", 1, "leave --prior out"),
        ("--prior kind.toml -n 12 --rates 100", 1, "at rest"),
        ("--prior kind.toml -n 2", 1, "at least 3"),
        ("--prior gyro.toml", 1, "gyro.toml: it has no accelerometer"),
        ("--prior table.toml", 1, "table.toml: its reference"),
        ("--prior plan.toml", 1, "this is a plan"),
        ("--prior negative.toml", 1, "negative.toml, [accel]"),
        ("--prior kind.toml -o kind.toml", 1, "kind.toml"),
        ("--prior kind.toml --target accel-scale=0.001", 1, "--dwell"),
        ("--prior kind.toml --target gyro-bias=1", 1, "mimu wizard"),
        ("--prior kind.toml -n 6 --target accel-bias=1", 2, "cannot be used with"),
    ];
    all_refused(folder.path(), "design", &cases);
    assert_eq!(
        fs::read_to_string(folder.path().join("kind.toml")).unwrap(),
        kind("accel", "gravity", true)
    );
}
