//! The page of a diagnosis: its drawings against the unit, and its numbers against the JSON.

use std::fmt::Write as _;
use std::path::Path;

use mimu::diagnose::diagnose;
use mimu::diagnose::picture::Against;
use mimu::fit::Options;
use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use mimu::signal::stillness::STILL_FACTOR;
use mimu_recording::Recording;
use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::rig_file::{RigFile, RigTruth};

use super::command::run;

/// A name that would break a page without escaping.
const DEVICE: &str = r#"<b>unit</b> & "7""#;
/// Cubic of the gyros at 300 deg/s, deg/s.
const CUBIC_DPS: [f64; 3] = [1.2, -0.9, 1.5];

/// Faces and corners at rest, and eight rates about each axis, 4 s each.
fn plan() -> String {
    let mut plan = format!(
        "format = \"mimu-plan/1\"\ndevice = {DEVICE:?}\nsample_rate_hz = 100.0\ncarrier = \"table\"\n"
    );
    let mut step = |up: [f64; 3], rate: f64| {
        let _ = writeln!(
            plan,
            "[[step]]\nup = {up:?}\nrate_dps = {rate:?}\ndwell_s = 4.0"
        );
    };
    for rate in [30.0, -30.0, 280.0, -280.0, 100.0, -100.0, 200.0, -200.0] {
        for axis in 0..3 {
            step(
                std::array::from_fn(|i| f64::from(u8::from(i == axis))),
                rate,
            );
        }
        step([-1.0, 0.0, 0.0], 0.0);
        step([0.0, -1.0, 0.0], 0.0);
        step([0.0, 0.0, -1.0], 0.0);
        step([1.0, -1.0, rate.signum()], 0.0);
    }
    plan
}

/// Records a unit with white noise, whose only error beyond an affine model is `effect`.
pub fn record(folder: &Path, name: &str, effect: &str, seed: u64) {
    let still = "instability_si = [0.0, 0.0, 0.0]\nwalk_si = [0.0, 0.0, 0.0]\n";
    let rig = format!(
        "format = \"mimu-rig/1\"\nearth_rate = false\n[unit.gyro_axes]\n{still}[unit.accel_axes]\n{still}\
         [thermal]\non_before_s = inf\n{effect}"
    );
    let file = RigFile::parse(&Source::new("rig", rig)).unwrap();
    let plan = Plan::parse(Source::new("plan", plan())).unwrap();
    // The same unit for every noise seed.
    let truth = RigTruth::resolve(&file, 3).unwrap();
    let output = mimu_rig::record::Output::new(&folder.join(name), &plan).unwrap();
    mimu_rig::record::write(&plan, &truth, seed, &output).unwrap();
}

pub fn cubic() -> String {
    format!("[[effect]]\nid = \"gyro_scale_cubic\"\ndps_at_300dps = {CUBIC_DPS:?}\n")
}

#[test]
fn the_effect_that_is_drawn_is_the_one_that_the_unit_has() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), "r", &cubic(), 1);
    let recording = Recording::open(&folder.path().join("r")).unwrap();
    let prepared = Prepared::read(&recording, STILL_FACTOR, |_| ()).unwrap();
    let found = diagnose(prepared.into(), Options::IN_SAMPLE).unwrap();
    let gyro = found
        .sensors
        .iter()
        .find(|s| s.sensor == Sensor::Gyro)
        .unwrap();
    let picture = &gyro.picture;
    assert_eq!(
        gyro.decision.accepted[0].chosen.candidate.id(),
        "gyro_scale_cubic"
    );
    assert_eq!(picture.effects[0].len(), 3);
    for (panel, size) in picture.effects[0].iter().zip(CUBIC_DPS) {
        let Against::Variable(abscissa) = &panel.against else {
            panic!("{panel:?}");
        };
        assert_eq!(abscissa.unit, "deg/s");
        let truth = |x: f64| size.to_radians() * (x.to_degrees() / 300.0).powi(3);
        // Minus the best straight line, which scale factor and bias absorb.
        let n = panel.points.len() as f64;
        let mean = |f: &dyn Fn(f64) -> f64| panel.points.iter().map(|p| f(p.x)).sum::<f64>() / n;
        let (mx, mt) = (mean(&|x| x), mean(&truth));
        let slope = mean(&|x| (x - mx) * truth(x)) / mean(&|x| (x - mx).powi(2));
        let straightened = |x: f64| truth(x) - mt - slope * (x - mx);
        let chi2: f64 = panel
            .points
            .iter()
            .map(|p| ((p.partial - straightened(p.x)) / p.sigma).powi(2))
            .sum();
        // 56 dwells, and four parameters estimated with the line: three sigmas are 0.7 to 1.35.
        assert!(
            (0.65..1.4).contains(&(chi2 / n)),
            "{}: {}",
            panel.title,
            chi2 / n
        );
        // The band is 95 %, and the errors of the whole curve are correlated: nowhere above three sigmas.
        for c in &panel.curve {
            assert!(
                (c.value - straightened(c.x)).abs() < 1.6 * c.half + 1e-12,
                "{c:?}"
            );
        }
        let most = panel
            .points
            .iter()
            .map(|p| p.partial.abs())
            .fold(0.0, f64::max);
        let left = panel
            .points
            .iter()
            .map(|p| p.after.abs())
            .fold(0.0, f64::max);
        // The largest of 56 residuals of noise is at three sigmas; the cubic minus its best line is at some eight.
        assert!(most > 2.0 * left, "{}: {most} {left}", panel.title);
    }
    // All residuals are drawn. Their weights are those of the search, while the figures are of the fit.
    for k in 0..2 {
        let model = &gyro.decision.models[k];
        let of = |left: &nalgebra::DVector<f64>| (left.norm_squared() / left.len() as f64).sqrt();
        let all = || picture.tracks.iter().flat_map(|t| &t.samples);
        let rms = |of: &dyn Fn(&mimu::diagnose::picture::Sample) -> f64| {
            (all().map(|s| of(s).powi(2)).sum::<f64>() / all().count() as f64).sqrt()
        };
        let held_out = model.held_out.as_ref().unwrap();
        assert!((rms(&|s| s.residual[k]) / of(&model.residuals) - 1.0).abs() < 1e-9);
        assert!((rms(&|s| s.held_out[k]) / of(held_out) - 1.0).abs() < 1e-9);
        assert!((rms(&|s| s.residual[k]) / gyro.decision.rms[k] - 1.0).abs() < 0.1);
    }
}

/// Text of an element and its descendants.
fn text(node: roxmltree::Node) -> String {
    node.descendants()
        .filter_map(|n| n.is_text().then(|| n.text()).flatten())
        .collect()
}

#[test]
fn the_page_needs_nothing_else_and_escapes_names() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), "a & <b>", "", 1);
    let out = run(folder.path(), ["diagnose", "a & <b>", "--page", "p.html"]);
    assert_eq!(out.status, Some(0), "{out:?}");
    let page = std::fs::read_to_string(folder.path().join("p.html")).unwrap();
    let options = roxmltree::ParsingOptions {
        allow_dtd: true,
        ..Default::default()
    };
    let document = roxmltree::Document::parse_with_options(&page, options).unwrap();
    let named = |name: &'static str| {
        document
            .descendants()
            .filter(move |n| n.tag_name().name() == name)
    };
    assert_eq!(
        text(named("h1").next().unwrap()),
        format!("Diagnosis of {DEVICE}")
    );
    assert!(named("code").any(|n| text(n) == "a & <b>"));
    assert!(named("code").any(|n| text(n) == "mimu diagnose \"a & <b>\" --page p.html"));
    for name in ["script", "link", "img", "iframe", "b"] {
        assert_eq!(named(name).count(), 0, "{name}");
    }
    for node in document.descendants() {
        assert!(
            node.attributes()
                .all(|a| !["src", "href"].contains(&a.name()))
        );
    }
    let style = text(named("style").next().unwrap());
    assert!(!style.contains("url(") && !style.contains("@import"));
    let drawings = || named("svg").filter(|n| n.attribute("role").is_some());
    assert!(drawings().count() >= 6);
    // Drawings contain only pixel coordinates, without NaN.
    for path in named("path") {
        let d = path.attribute("d").unwrap();
        assert!(!d.contains("NaN") && !d.contains("inf"), "{d}");
    }
}
