//! Problems of several recordings are listed under the name of each, also if the command refuses them; and `--still` of a report.

use serde_json::Value;

use super::answer::*;
use super::generator::*;

/// By hand, with `gaps` gaps of half a second in different poses.
fn with_gaps(seed: u64, poses: usize, gaps: usize) -> Samples {
    let mut samples = by_hand_at(poses, seed, Random::direction);
    for dwell in (0..gaps).rev() {
        let from = samples.dwells[dwell].start + 100;
        samples.rows.drain(from..from + 50);
    }
    samples
}

/// The head of the list, and its lines.
fn listed(text: &str) -> (&str, Vec<&str>) {
    let mut lines = text.lines().skip_while(|l| !l.starts_with("problems of"));
    let head = lines.next().expect("a list");
    (head, lines.take_while(|l| l.starts_with("  - ")).collect())
}

#[test]
fn each_of_several_recordings_is_named_with_what_is_wrong_with_it() {
    let place = Place::new();
    for (name, seed, gaps) in [
        ("one", 1, 1),
        ("two", 2, 2),
        ("good", 3, 0),
        ("judge", 4, 3),
    ] {
        with_gaps(seed, 20, gaps).write(&place.path(name));
    }
    let [one, two, good, judge] = ["one", "two", "good", "judge"].map(|name| place.text(name));
    let (json, page) = (place.text("d.json"), place.text("d.html"));
    let run = mimu([
        "diagnose", &one, &two, &good, "--verify", &judge, "--json", &json, "--page", &page,
    ]);
    assert_eq!(run.status, Some(0), "{}", run.stderr);
    let (head, lines) = listed(&run.stdout);
    assert_eq!(head, "problems of these recordings:");
    let samples = |folder: &str| format!("{folder}/samples.csv");
    let found: Value = serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
    let problems = found["recording_problems"].as_array().unwrap();
    let of = |folder: &str| -> Vec<&Value> {
        let named = |p: &&Value| p["recording"] == samples(folder).as_str();
        problems.iter().filter(named).collect()
    };
    for folder in [&one, &two, &judge] {
        let [problem] = of(folder)[..] else {
            panic!("{folder}: {problems:#?}");
        };
        assert_eq!(problem["id"], "gaps");
        let text = problem["text"].as_str().unwrap();
        let line = format!("  - {}: {text}", samples(folder));
        assert!(
            lines.contains(&line.as_str()),
            "{line} is not in {lines:#?}"
        );
        let page = std::fs::read_to_string(&page).unwrap();
        assert!(page.contains(&format!("{}: {text}", samples(folder))));
    }
    assert!(of(&good).is_empty(), "{problems:#?}");
    assert_eq!(lines.len(), problems.len());

    // The same in the terminal output of a report.
    let run = mimu(["report", &one, &good, "-o", &place.text("unit.html")]);
    let (head, lines) = listed(&run.stdout);
    assert_eq!(head, "problems of these recordings:", "{}", run.stdout);
    assert!(
        lines.iter().all(|l| l.contains(&samples(&one))),
        "{lines:?}"
    );
    // A single recording is listed without its name.
    let run = mimu(["diagnose", &one]);
    let (head, lines) = listed(&run.stdout);
    assert_eq!(head, "problems of this recording:");
    assert!(
        lines.iter().all(|l| !l.contains("samples.csv")),
        "{lines:?}"
    );
}

#[test]
fn a_recording_that_is_refused_is_listed_above_the_error() {
    let place = Place::with(&with_gaps(1, 3, 1));
    with_gaps(2, 3, 2).write(&place.path("more"));
    let (rec, more, json) = (place.text("rec"), place.text("more"), place.text("f.json"));
    let page = place.text("unit.html");
    let several = ["diagnose", &rec, &more, "--json", "-"];
    for (arguments, named) in [
        (&["fit", &rec, "--json", "-"][..], false),
        (&["fit", &rec, "--json", &json], false),
        (&["diagnose", &rec, "--json", "-"], false),
        (&several, true),
        (&["report", &rec, &more, "-o", &page], true),
    ] {
        let run = mimu(arguments);
        let line = run.refusal();
        let (head, lines) = listed(&run.stderr);
        assert!(
            run.stderr.find(head) < run.stderr.find(line),
            "{}",
            run.stderr
        );
        assert_eq!(lines.len(), if named { 2 } else { 1 }, "{}", run.stderr);
        for listed in &lines {
            assert!(listed.contains("gap"), "{listed}");
            assert_eq!(listed.contains("samples.csv: "), named, "{listed}");
        }
        if arguments.contains(&"-") {
            let told: Value = serde_json::from_str(&run.stdout).unwrap();
            let problems = told["recording_problems"].as_array().unwrap();
            assert_eq!(problems.len(), lines.len(), "{told}");
            assert!(problems.iter().all(|p| p["id"] == "gaps"), "{told}");
        } else {
            assert_eq!(run.stdout, "");
        }
        assert_eq!(place.names(), ["more", "rec"], "no result was written");
    }
}

#[test]
fn the_stillness_factor_of_a_report_reaches_its_diagnosis() {
    let place = Place::with(&by_hand());
    let (rec, page) = (place.text("rec"), place.text("unit.html"));
    let figures = |still: &[&str]| -> Vec<f64> {
        let fixed = ["diagnose", &rec, "--json", "-"];
        let found = mimu(fixed.iter().chain(still)).json();
        let of = |sensor: &str| {
            found["sensors"][sensor]["held_out_rms_after"]
                .as_f64()
                .unwrap()
        };
        ["gyro", "accel"].map(of).into()
    };
    let numbers = |still: &[&str]| -> Vec<f64> {
        let run = mimu(["report", &rec, "-o", &page].iter().chain(still));
        assert_eq!(run.status, Some(0), "{}", run.stderr);
        let text = std::fs::read_to_string(&page).unwrap();
        let values = text.split("<data value=\"").skip(1);
        values
            .filter_map(|v| v.split('"').next()?.parse().ok())
            .collect()
    };
    let asked = ["--still", "30"];
    let (usual, other) = (figures(&[]), figures(&asked));
    assert_ne!(usual, other, "the factor changes what is found");
    for (still, has, lacks) in [(&[][..], &usual, &other), (&asked[..], &other, &usual)] {
        let all = numbers(still);
        // The JSON parser may round the last digit differently.
        let on_page = |figure: &f64| all.iter().any(|v| (v / figure - 1.0).abs() < 1e-12);
        for (has, lacks) in has.iter().zip(lacks) {
            assert!(on_page(has), "{still:?}: {has} is not on the page");
            assert!(!on_page(lacks), "{still:?}: {lacks} is on the page");
        }
    }
}
