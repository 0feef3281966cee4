//! Plans: every mistake is refused in one line that names the file, the line and what to do.

use std::fs;
use std::path::{Path, PathBuf};

use mimu_rig::hands::{Hands, HandsTruth};
use mimu_rig::located::Source;
use mimu_rig::plan::{CarriedBy, Plan};
use mimu_rig::rig_file::RigFile;
use mimu_rig::table::{Table, TableTruth};

mod mistakes;

const HEAD: &str = "format = \"mimu-plan/1\"\nsample_rate_hz = 1000.0\ncarrier = \"table\"\n";
const STEP: &str = "[[step]]\nup = [0.0, 0.0, 1.0]\ndwell_s = 2.0\n";

fn parse(text: &str) -> Result<Plan, String> {
    Plan::parse(Source::new("PLAN.toml", text))
}

/// Beginning of the error message, and words that the rest must contain.
type Complaint = (&'static str, &'static str);

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
    #[rustfmt::skip]
    let cases: [(&TableTruth, &str, &str); 8] = [
        (&three, "up = [0, 0, -1]\ndwell_s = 1", "PLAN.toml:5: `up` needs the middle axis at 180.0 degrees, but its range is -100.0 to 100.0"),
        (&three, "up = [0, 0, 1]\nrate_dps = 400.1\ndwell_s = 1", "PLAN.toml:6: `rate_dps`: 400.1 is more than the table's 400; slow down"),
        (&three, "up = [0, 0, 1]\nspin_dps = -1e4\ndwell_s = 1", "PLAN.toml:6: `spin_dps`: 10000 is more than the table's 400"),
        (&two, "up = [0, 1, -0.5]\ndwell_s = 1", "PLAN.toml:5: `up` needs the middle axis at 116.6 degrees"),
        (&two, "up = [0, 1, 0]\ndwell_s = 1\nrate_dps = 10", "PLAN.toml:7: `rate_dps` is about the vertical, but the table has no vertical axis"),
        (&two, "up = [0, 1, 0]\ndwell_s = 1\nheading_deg = 10", "PLAN.toml:7: `heading_deg` needs an outer axis"),
        (&two, "poses = 9\ndwell_s = 1\nrate_dps = 10", "PLAN.toml:7: `rate_dps` is about the vertical"),
        (&two, "up = [0, 0, 1]\nrate_dps = 300\nspin_dps = 101\ndwell_s = 1", "PLAN.toml:7: `spin_dps`: 401 is more"),
    ];
    for (truth, step, beginning) in cases {
        let error =
            Table::new(&parse(&format!("{HEAD}[[step]]\n{step}\n")).unwrap(), truth).unwrap_err();
        assert!(error.starts_with(beginning), "{error}");
        assert!(error.contains("; ") && !error.contains('\n'), "{error}");
    }
    // The limits themselves are allowed.
    let edge = "up = [0, 0.99619469809, -0.08715574274]\nspin_dps = 400\ndwell_s = 1";
    Table::new(&parse(&format!("{HEAD}[[step]]\n{edge}\n")).unwrap(), &two).unwrap();
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
        // One plan needs the table of a paper, which is in that paper's rig file.
        let table = match path.ends_with("niu-ramp.toml") {
            true => {
                let rig = path.with_file_name("../rigs/niu-mtig.toml");
                RigFile::read(&rig).unwrap().table
            }
            false => TableTruth::default(),
        };
        match plan.carrier {
            CarriedBy::Table => drop(Table::new(&plan, &table).unwrap()),
            CarriedBy::Hands => drop(Hands::new(&plan, &HandsTruth::default(), 1).unwrap()),
        }
    }
}
