//! The pages in `docs/bench` against the code: exactly its keys, and the defaults.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use mimu_rig::effects::{Draw, Shape, specs};
use mimu_rig::field::FieldTruth;
use mimu_rig::flaws::FlawsTruth;
use mimu_rig::hands::HandsTruth;
use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::rig_file::RigFile;
use mimu_rig::table::TableTruth;

fn page() -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/bench");
    let read = |name| fs::read_to_string(folder.join(name)).unwrap();
    ["plan.md", "rig.md", "effects.md"].map(read).concat()
}

/// Rows of the table after the first line that begins with `heading`: keys in backticks in the first cell, and the other cells.
fn rows(page: &str, heading: &str) -> Vec<(Vec<String>, Vec<String>)> {
    let mut lines = page.lines().skip_while(|line| !line.starts_with(heading));
    assert!(lines.next().is_some(), "no {heading}");
    lines
        .skip_while(|line| !line.starts_with('|'))
        .take_while(|line| line.starts_with('|'))
        .skip(2)
        .map(|line| {
            // A literal bar is escaped with a backslash.
            let line = line.trim_matches('|').replace("\\|", "¦");
            let mut cells = line.split('|').map(|c| c.trim().to_owned());
            let keys = cells.next().unwrap();
            let keys = keys.split('`').skip(1).step_by(2).map(str::to_owned);
            (keys.collect(), cells.collect::<Vec<_>>())
        })
        .collect()
}

/// The keys that the reader knows, from its own message about an unknown one.
fn known(complaint: &str) -> BTreeSet<String> {
    let (_, list) = complaint
        .split_once(", expected ")
        .unwrap_or_else(|| panic!("{complaint}"));
    list.split('`')
        .skip(1)
        .step_by(2)
        .map(str::to_owned)
        .collect()
}

#[test]
fn the_page_has_every_key_of_both_files_and_no_other() {
    let page = page();
    let unknown = "a_key_that_nobody_would_ever_give = 1\n";
    let plan = |text: &str| Plan::parse(Source::new("PLAN.toml", text)).unwrap_err();
    let rig = |text: &str| RigFile::parse(&Source::new("RIG.toml", text)).unwrap_err();
    #[rustfmt::skip]
    let cases = [
        ("Examples: `rig/plans`", plan(unknown)),
        ("`[[step]]`", plan(&format!("[[step]]\n{unknown}"))),
        ("Examples: `rig/rigs`", rig(unknown)),
        ("`[unit]`", rig(&format!("[unit]\n{unknown}"))),
        ("`[unit.gyro_axes]`", rig(&format!("[unit.gyro_axes]\n{unknown}"))),
        ("`[unit.gyro_affine]`", rig(&format!("[unit.gyro_affine]\n{unknown}"))),
        ("`[thermal]`", rig(&format!("[thermal]\n{unknown}"))),
        ("`[curves]`", rig(&format!("[curves]\n{unknown}"))),
        ("`[curves.gyro]`", rig(&format!("[curves.gyro]\n{unknown}"))),
        ("`[curves.accel]`", rig(&format!("[curves.accel]\n{unknown}"))),
        ("`[history]`", rig(&format!("[history]\n{unknown}"))),
        ("`[history.power_on]`", rig(&format!("[history.power_on]\n{unknown}"))),
        ("`[converter]`", rig(&format!("[converter]\n{unknown}"))),
        ("`[table]`", rig(&format!("[table]\n{unknown}"))),
        ("`[table.settling]`", rig(&format!("[table.settling]\n{unknown}"))),
        ("`[hands]`", rig(&format!("[hands]\n{unknown}"))),
        ("`[flaws]`", rig(&format!("[flaws]\n{unknown}"))),
        ("`[[triad]]`", rig(&format!("[[triad]]\n{unknown}"))),
        ("`[field]`", rig(&format!("[field]\n{unknown}"))),
        ("`[[field.magnet]]`", rig(&format!("[[field.magnet]]\n{unknown}"))),
    ];
    for (heading, complaint) in cases {
        let documented: BTreeSet<_> = rows(&page, heading).into_iter().flat_map(|r| r.0).collect();
        assert_eq!(documented, known(&complaint), "{heading}");
    }
}

#[test]
fn the_defaults_of_table_hands_flaws_and_field_are_those_of_the_code() {
    let page = page();
    let settling = toml::Table::try_from(TableTruth::default().settling).unwrap();
    let mut field = toml::Table::try_from(FieldTruth::default()).unwrap();
    field.insert("magnet".into(), toml::Table::new().into());
    #[rustfmt::skip]
    let cases = [
        ("`[table]`", toml::Table::try_from(TableTruth::default()).unwrap()),
        ("`[table.settling]`", settling),
        ("`[hands]`", toml::Table::try_from(HandsTruth::default()).unwrap()),
        ("`[flaws]`", toml::Table::try_from(FlawsTruth::default()).unwrap()),
        ("`[field]`", field),
    ];
    for (heading, defaults) in cases {
        for (keys, cells) in rows(&page, heading) {
            let key = &keys[0];
            if !defaults[key].is_table() {
                assert_eq!(cells[0], format!("`{}`", defaults[key]), "{heading} {key}");
            }
        }
    }
}

#[test]
fn the_page_has_every_effect_with_its_parameters() {
    let documented: BTreeMap<_, _> = ["Known to estimators", "Unknown to estimators"]
        .into_iter()
        .flat_map(|heading| rows(&page(), heading))
        .flat_map(|(keys, cells)| keys.into_iter().map(move |key| (key, cells.clone())))
        .collect();
    let expected: BTreeMap<_, _> = specs()
        .map(|spec| {
            let parameters: Vec<_> = spec
                .parameters
                .iter()
                .map(|p| {
                    let shape = match p.shape {
                        Shape::Scalar => String::new(),
                        Shape::List(n) => format!(" × {n}"),
                        Shape::Matrix | Shape::Cross => " × 3×3".to_owned(),
                    };
                    let drawn = match p.draw {
                        Draw::Size(size) => format!("±{size}"),
                        Draw::Between(low, high) => format!("{low} to {high}"),
                    };
                    format!("`{}`{shape}: {drawn}", p.key)
                })
                .collect();
            let about = spec.about.replace('|', "¦");
            (spec.id.to_owned(), vec![about, parameters.join("; ")])
        })
        .collect();
    for (id, cells) in &expected {
        let line = format!("| `{id}` | {} |", cells.join(" | ")).replace('¦', "\\|");
        let shown = documented.get(id);
        assert_eq!(shown, Some(cells), "write to docs/bench:\n{line}\n");
    }
    for id in documented.keys() {
        assert!(
            expected.contains_key(id),
            "docs/bench/effects.md has {id}, which is no effect of the bench"
        );
    }
}
