//! Plans: every mistake is refused in one line that names the file, the line and what to do.

use std::fs;
use std::path::{Path, PathBuf};

use mimu_rig::hands::{Hands, HandsTruth};
use mimu_rig::located::Source;
use mimu_rig::plan::{CarriedBy, Plan, Pose, Samples};
use mimu_rig::record;
use mimu_rig::rig_file::{RigFile, RigTruth};
use mimu_rig::table::{Table, TableTruth};

const HEAD: &str = "format = \"mimu-plan/1\"\nsample_rate_hz = 1000.0\ncarrier = \"table\"\n";
const STEP: &str = "[[step]]\nup = [0.0, 0.0, 1.0]\ndwell_s = 2.0\n";

fn parse(text: &str) -> Result<Plan, String> {
    Plan::parse(Source::new("PLAN.toml", text))
}

#[test]
fn a_plan_says_what_is_left_out() {
    let plan = parse(&format!("{HEAD}{STEP}")).unwrap();
    assert_eq!(plan.device, "unit");
    assert_eq!(
        (plan.samples, plan.carrier, plan.numbered),
        (Samples::Parquet, CarriedBy::Table, true)
    );
    assert_eq!(plan.place.latitude_deg, 45.0);
    // At 45 degrees, Moritz 2000 gives 9.806199203 for GRS 80, whose gravity is 1.4e-6 above that of WGS 84
    // at the equator.
    assert!((plan.place.gravity - 9.806_197_8).abs() < 1e-7);
    assert_eq!(plan.chamber_c(1e3), 25.0);
    assert_eq!(
        (plan.steps[0].repeat, plan.steps[0].rate, plan.lead_in_s),
        (1, 0.0, 0.0)
    );
    let plan = parse(
        "format = \"mimu-plan/1\"\nsample_rate_hz = 100\ncarrier = \"hands\"\n[[step]]\nposes = 5\ndwell_s = 4\n",
    );
    let plan = plan.unwrap();
    assert!(!plan.numbered && plan.steps[0].pose == Pose::Many(5));
}

#[test]
fn up_may_have_any_length_and_is_a_direction_from_then_on() {
    for up in ["[0.0, 0.0, -9.81]", "[0, 0, -1e-200]", "[0, 0, -1e300]"] {
        let plan = parse(&format!("{HEAD}[[step]]\nup = {up}\ndwell_s = 1\n")).unwrap();
        assert_eq!(plan.steps[0].pose, Pose::Up([0.0, 0.0, -1.0]));
    }
}

#[test]
fn the_chamber_is_linear_between_breakpoints_and_held_outside() {
    let plan = parse(&format!(
        "{HEAD}chamber_c = [[10.0, 25.0], [20.0, 60.0], [40.0, -10.0]]\n{STEP}"
    ))
    .unwrap();
    for (t, c) in [
        (0.0, 25.0),
        (10.0, 25.0),
        (15.0, 42.5),
        (20.0, 60.0),
        (30.0, 25.0),
        (40.0, -10.0),
        (1e6, -10.0),
    ] {
        assert_eq!(plan.chamber_c(t), c);
    }
}

/// Beginning of the complaint, and words that the rest must have.
type Complaint = (&'static str, &'static str);

#[test]
fn mistakes_in_the_head_are_named_with_their_line() {
    let cases: [(&str, Complaint); 23] = [
        ("", ("PLAN.toml:1: `format` is missing", "format")),
        (
            "\u{1}\u{2}garbage",
            ("PLAN.toml:1: not valid TOML", "correct"),
        ),
        ("a,b,c\n1,2,3\n", ("PLAN.toml:1: not valid TOML", "correct")),
        (
            "format = \"mimu-recording/1\"\nsample_rate_hz = 1.0\ncarrier = \"table\"",
            ("PLAN.toml:1: format", "mimu-plan/1"),
        ),
        (
            "format = \"mimu-plan/1\"\ncarrier = \"table\"",
            ("PLAN.toml:1: `sample_rate_hz` is missing", "hertz"),
        ),
        (
            "format = \"mimu-plan/1\"\ncarrier = \"robot\"",
            (
                "PLAN.toml:2: `carrier`: unknown value",
                "\"table\" or \"hands\"",
            ),
        ),
        (
            "format = \"mimu-plan/1\"\nsamples = \"xls\"",
            (
                "PLAN.toml:2: `samples`: unknown value",
                "\"parquet\" or \"csv\"",
            ),
        ),
        (
            "HEADsample_rate_hz = 3.0",
            ("PLAN.toml:4: not valid TOML: duplicate key", "correct"),
        ),
        (
            "HEADlatitude_rad = 0.5",
            (
                "PLAN.toml:4: unknown key `latitude_rad`",
                "`latitude_deg`, in degrees",
            ),
        ),
        (
            "HEADlatitude_deg = 95",
            ("PLAN.toml:4: `latitude_deg` is 95", "-90 to 90 degrees"),
        ),
        (
            "HEADgravity_g = 1.0",
            (
                "PLAN.toml:4: unknown key `gravity_g`",
                "`gravity_mps2`, in metres per second squared",
            ),
        ),
        (
            "HEADgravity_mps2 = 1.0",
            ("PLAN.toml:4: `gravity_mps2` is 1", "9.7 to 9.9 m/s²"),
        ),
        (
            "HEADtemp_f = 3.0",
            (
                "PLAN.toml:4: unknown key `temp_f`",
                "`chamber_c`, in degrees Celsius",
            ),
        ),
        (
            "HEADchamber_k = 3.0",
            (
                "PLAN.toml:4: unknown key `chamber_k`",
                "`chamber_c`, in degrees Celsius",
            ),
        ),
        (
            "HEADchamber_c = [[0, 25],\n [5, 26],\n [5, 27]]",
            ("PLAN.toml:6: `chamber_c`: time 5 s", "in order of time"),
        ),
        (
            "HEADchamber_c = [[0, 298.15]]",
            ("PLAN.toml:4: `chamber_c`: 298.15 °C", "degrees Celsius"),
        ),
        (
            "HEADchamber_c = [[0, nan]]",
            ("PLAN.toml:4: `chamber_c`: NaN °C", "degrees Celsius"),
        ),
        (
            "HEADchamber_c = [0, 25]",
            (
                "PLAN.toml:4: `chamber_c`: invalid type",
                "give an array of length 2",
            ),
        ),
        (
            "HEADlead_in_s = -1",
            ("PLAN.toml:4: `lead_in_s` is -1", "give 0"),
        ),
        (
            "HEADchamber_c = [[-1e308, 20], [1e308, 30]]",
            ("PLAN.toml:4: `chamber_c`: time -1e308 s", "48 h"),
        ),
        (
            "HEADdevice = \"a\\nb\"",
            ("PLAN.toml:4: `device` is no name", "in one line"),
        ),
        (
            "HEADdevice = \" \"",
            ("PLAN.toml:4: `device`", "name the unit"),
        ),
        (
            "HEADlead_in_s = 1\n\n",
            ("PLAN.toml:4: there is no step", "[[step]]"),
        ),
    ];
    for (text, complaint) in cases {
        // With a step where the head is what is wrong, so that the step's absence is not.
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
    let cases: [(&str, Complaint); 25] = [
        ("dwell_s = 1", ("PLAN.toml:4: `up` is missing", "`poses")),
        (
            "up = [0, 0, 1]",
            ("PLAN.toml:4: `dwell_s` is missing", "in seconds"),
        ),
        (
            "up = [0, 0, 1]\nposes = 3\ndwell_s = 1",
            ("PLAN.toml:6: `up` and `poses`", "keep one"),
        ),
        (
            "up = [0, 0, 0]\ndwell_s = 1",
            ("PLAN.toml:5: `up` has no length", "direction"),
        ),
        (
            "up = [0, 0, inf]\ndwell_s = 1",
            ("PLAN.toml:5: `up` is not finite", "three numbers"),
        ),
        (
            "up = [0, 1]\ndwell_s = 1",
            ("PLAN.toml:5: `up`: invalid length 2", "array of length 3"),
        ),
        (
            "up = \"z\"\ndwell_s = 1",
            (
                "PLAN.toml:5: `up`: invalid type: string \"z\"",
                "array of length 3",
            ),
        ),
        (
            "up_deg = [0, 0, 1]\ndwell_s = 1",
            (
                "PLAN.toml:5: unknown key `up_deg`",
                "`up`, which has no unit",
            ),
        ),
        (
            "up = [0, 0, 1]\ndwell_s = 0",
            ("PLAN.toml:6: `dwell_s` is 0", "in seconds"),
        ),
        (
            "up = [0, 0, 1]\ndwell_s = -3",
            ("PLAN.toml:6: `dwell_s` is -3", "in seconds"),
        ),
        (
            "up = [0, 0, 1]\ndwell_s = nan",
            ("PLAN.toml:6: `dwell_s` is NaN", "in seconds"),
        ),
        (
            "up = [0, 0, 1]\ndwell_s = \"2 s\"",
            (
                "PLAN.toml:6: `dwell_s`: invalid type: string",
                "give a number",
            ),
        ),
        (
            "up = [0, 0, 1]\ndwell_ms = 20",
            (
                "PLAN.toml:6: unknown key `dwell_ms`",
                "`dwell_s`, in seconds",
            ),
        ),
        (
            "up = [0, 0, 1]\nduration_s = 20",
            ("PLAN.toml:6: unknown key `duration_s`", "`dwell_s`"),
        ),
        (
            "up = [0, 0, 1]\nrate_rads = 2",
            (
                "PLAN.toml:6: unknown key `rate_rads`",
                "`rate_dps`, in degrees per second",
            ),
        ),
        (
            "up = [0, 0, 1]\nrate_rps = 2",
            (
                "PLAN.toml:6: unknown key `rate_rps`",
                "`rate_dps`, in degrees per second",
            ),
        ),
        (
            "up = [0, 0, 1]\nrate_rpm = 2",
            (
                "PLAN.toml:6: unknown key `rate_rpm`",
                "`rate_dps`, in degrees per second",
            ),
        ),
        (
            "up = [0, 0, 1]\nrate_dps = inf\ndwell_s = 1",
            ("PLAN.toml:6: `rate_dps` is inf", "-36000 to 36000"),
        ),
        (
            "up = [0, 0, 1]\nheading_deg = nan\ndwell_s = 1",
            ("PLAN.toml:6: `heading_deg` is NaN", "-360 to 360 degrees"),
        ),
        (
            "up = [0, 0, 1]\ndwell_s = 1\nrepeat = 0",
            ("PLAN.toml:7: `repeat` is 0", "one or more"),
        ),
        (
            "up = [0, 0, 1]\ndwell_s = 1\nrepeat = -1",
            ("PLAN.toml:7: `repeat`: invalid value", "whole number"),
        ),
        (
            "poses = 0\ndwell_s = 1",
            ("PLAN.toml:5: `poses` is 0", "one or more"),
        ),
        (
            "poses = 4000000000\ndwell_s = 0.001",
            (
                "PLAN.toml:5: up to this step the plan has 4000000000 dwells",
                "100000 dwells",
            ),
        ),
        (
            "[[step.up]]\nx = 1",
            (
                "PLAN.toml:5: `[[step.up]]`: invalid type: table",
                "give a number",
            ),
        ),
        (
            "up = [0, 0, 1]\nrepeat = 3\ndwell_s = 90000",
            (
                "PLAN.toml:5: up to this step the plan has 3 dwells, 75.0 h",
                "48 h",
            ),
        ),
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
}

fn assert_complaint(text: &str, (beginning, remedy): Complaint) {
    let error = parse(text).unwrap_err();
    assert!(error.starts_with(beginning), "{text:?}: {error}");
    let (_, rest) = error
        .rsplit_once("; ")
        .unwrap_or_else(|| panic!("{error}: says not what to do"));
    assert!(rest.contains(remedy), "{text:?}: {error}");
    assert!(!error.contains('\n'), "{error:?}");
}

#[test]
fn what_the_table_cannot_do_is_refused_with_its_limit_and_the_line_of_the_plan() {
    let three = TableTruth {
        middle_max_deg: 100.0,
        middle_min_deg: -100.0,
        ..TableTruth::default()
    };
    let two = TableTruth {
        axes: 2,
        middle_max_deg: 95.0,
        middle_min_deg: -95.0,
        ..TableTruth::default()
    };
    let cases: [(&TableTruth, &str, &str); 8] = [
        (
            &three,
            "up = [0, 0, -1]\ndwell_s = 1",
            "PLAN.toml:5: `up` needs the middle axis at 180.0 degrees, and the table has -100.0 to 100.0",
        ),
        (
            &three,
            "up = [0, 0, 1]\nrate_dps = 400.1\ndwell_s = 1",
            "PLAN.toml:6: `rate_dps`: 400.1 is more than the table's 400; slow down",
        ),
        (
            &three,
            "up = [0, 0, 1]\nspin_dps = -1e4\ndwell_s = 1",
            "PLAN.toml:6: `spin_dps`: 10000 is more than the table's 400",
        ),
        (
            &two,
            "up = [0, 1, -0.5]\ndwell_s = 1",
            "PLAN.toml:5: `up` needs the middle axis at 116.6 degrees",
        ),
        (
            &two,
            "up = [0, 1, 0]\ndwell_s = 1\nrate_dps = 10",
            "PLAN.toml:7: `rate_dps` is about the vertical, where the table has no axis",
        ),
        (
            &two,
            "up = [0, 1, 0]\ndwell_s = 1\nheading_deg = 10",
            "PLAN.toml:7: `heading_deg` needs an outer axis",
        ),
        (
            &two,
            "poses = 9\ndwell_s = 1\nrate_dps = 10",
            "PLAN.toml:7: `rate_dps` is about the vertical",
        ),
        (
            &two,
            "up = [0, 0, 1]\nrate_dps = 300\nspin_dps = 101\ndwell_s = 1",
            "PLAN.toml:7: `spin_dps`: 401 is more",
        ),
    ];
    for (truth, step, beginning) in cases {
        let error =
            Table::new(&parse(&format!("{HEAD}[[step]]\n{step}\n")).unwrap(), truth).unwrap_err();
        assert!(error.starts_with(beginning), "{error}");
        assert!(error.contains("; ") && !error.contains('\n'), "{error}");
    }
    // The limits themselves can be done.
    let edge = "up = [0, 0.99619469809, -0.08715574274]\nspin_dps = 400\ndwell_s = 1";
    Table::new(&parse(&format!("{HEAD}[[step]]\n{edge}\n")).unwrap(), &two).unwrap();
}

#[test]
fn a_plan_that_takes_too_long_with_its_moves_or_samples_is_refused_before_it_begins() {
    let truth = |text: &str| {
        let source = Source::new("RIG.toml", format!("format = \"mimu-rig/1\"\n{text}"));
        RigTruth::resolve(&RigFile::parse(&source).unwrap(), 1).unwrap()
    };
    let plan = parse(&format!("{HEAD}[[step]]\nposes = 90000\ndwell_s = 1\n")).unwrap();
    let error = record::samples(&plan, &truth("[table]\nsettle_s = 60"), 1)
        .err()
        .unwrap();
    assert!(
        error.starts_with(
            "PLAN.toml:5: with the moves from pose to pose the plan has 90000 dwells, "
        ),
        "{error}"
    );
    assert_complaint(
        &format!(
            "{}[[step]]\nposes = 1\ndwell_s = 172800\n",
            HEAD.replace("1000.0", "20000")
        ),
        (
            "PLAN.toml:5: up to this step the plan has 1 dwells, 48.0 h, 3.456e9 samples",
            "2e8 samples",
        ),
    );
}

#[test]
fn files_that_are_no_plans_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(
        at("latin.toml"),
        b"format = \"mimu-plan/1\"\ndevice = \"\xe4\"\n",
    )
    .unwrap();
    // A hole: it takes no room, and no time to write.
    let large = fs::File::create(at("large.toml")).unwrap();
    large.set_len(1 << 40).unwrap();
    for (path, beginning) in [
        (at("missing.toml"), "there is no such file"),
        (folder.path().to_path_buf(), "is a directory"),
        (at("latin.toml"), "is not UTF-8 text"),
        (at("large.toml"), "is larger than 16 MiB"),
    ] {
        let error = Plan::read(&path).unwrap_err();
        assert!(error.contains(&*path.to_string_lossy()), "{error}");
        assert!(
            error.contains(beginning) && error.contains("; ") && !error.contains('\n'),
            "{error}"
        );
    }
    assert!(
        Plan::read(&at("latin.toml"))
            .unwrap_err()
            .contains("latin.toml:2: ")
    );
}

#[test]
fn the_plans_in_the_repository_can_be_carried_out() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("plans");
    let plans: Vec<PathBuf> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    assert!(plans.len() >= 3);
    for path in plans {
        let plan = Plan::read(&path).unwrap();
        match plan.carrier {
            CarriedBy::Table => drop(Table::new(&plan, &TableTruth::default()).unwrap()),
            CarriedBy::Hands => drop(Hands::new(&plan, &HandsTruth::default(), 1).unwrap()),
        }
    }
}
