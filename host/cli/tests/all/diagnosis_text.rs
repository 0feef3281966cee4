//! Output of `mimu diagnose`: one terminal page, and the rest on request.

use serde_json::Value;

use super::command;
use super::diagnosis_page::{cubic, record};

/// Two effects that a diagnosis knows, and one that it does not.
const FLAWED: &str = "[[effect]]\nid = \"gyro_g_sensitivity\"\nmatrix_dps_per_g = [[0.1, 0.0, 0.05], [0.0, -0.1, 0.0], [0.02, 0.0, 0.1]]\n\
                      [[effect]]\nid = \"accel_scale_cubic\"\n\
                      [[effect]]\nid = \"x_accel_stress_hysteresis\"\nmg = [4.0, 4.0, 4.0]\nplay_g = 0.3\n";

#[test]
fn a_diagnosis_of_an_effect_takes_at_most_25_lines_without_all() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        let out = command::run(folder.path(), arguments);
        assert_eq!(out.status, Some(0), "{out:?}");
        let printed = out.stdout;
        let wide = printed.lines().find(|l| l.chars().count() > 100);
        assert_eq!(wide, None, "{arguments:?}");
        printed
    };
    let units = [
        ("clean", String::new(), &[][..], 25),
        ("cubic", cubic(), &["gyro_scale_cubic"][..], 25),
        // Several effects, and residuals of three axes.
        ("flawed", FLAWED.into(), &["gyro_g_sensitivity"][..], 40),
    ];
    for (name, effects, found, most) in units {
        record(folder.path(), name, &effects, 1);
        let json = format!("{name}.json");
        let short = run(&["diagnose", name, "--json", &json]);
        println!("{short}");
        assert!(
            short.lines().count() <= most,
            "{name}: {} lines",
            short.lines().count()
        );
        let json = std::fs::read_to_string(folder.path().join(json)).unwrap();
        let json: Value = serde_json::from_str(&json).unwrap();
        let ids = |key: &str| -> Vec<String> {
            let list = json[key].as_array().unwrap().iter();
            list.map(|e| e["id"].as_str().unwrap().to_string())
                .collect()
        };
        if name == "flawed" {
            assert_eq!(json["verdict"], "unexplained");
            assert!(short.contains("  residual, "), "{short}");
        }
        for id in found {
            assert!(ids("effects").iter().any(|e| e == id), "{name}: {json}");
        }
        for id in ids("effects") {
            assert!(short.contains(&format!("  + {id}: ")), "{name}: {id}");
        }
        // `--next` prints the plans that the short form only counts.
        let next = run(&["diagnose", name, "--next"]);
        let not_seen = ids("not_excited");
        let counted = format!("too small to be seen here: {} effect", not_seen.len());
        assert_eq!(short.contains(&counted), !not_seen.is_empty(), "{short}");
        for id in not_seen {
            assert!(next.contains(&id), "{name}: {id} is in no experiment");
        }
        let all = run(&["diagnose", name, "--verbose"]);
        for id in ids("rejected") {
            assert!(all.contains(&format!("  - {id}: ")), "{name}: {id}");
        }
        let rejected = format!("tried and rejected: {} effect", ids("rejected").len());
        assert_eq!(
            short.contains(&rejected),
            !ids("rejected").is_empty(),
            "{short}"
        );
    }
}
