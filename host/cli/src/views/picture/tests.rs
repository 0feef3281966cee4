//! Compares the whole screen with files of its text. `MIMU_WRITE=1` rewrites the files; check them afterwards.

mod svg;

use std::path::Path;

use mimu::quantity::Sensor;
use mimu_equipment::step::Step;
use mimu_wizard::event::UnitState;
use mimu_wizard::refit::{Aim, Aims, Parameter};
use mimu_wizard::waiting::{Interruption, Waiting};
use nalgebra::Vector3;
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::buffer::Buffer;

use super::*;

fn drawn(shown: &Shown, size: [u16; 2]) -> Buffer {
    let mut terminal = Terminal::new(TestBackend::new(size[0], size[1])).unwrap();
    terminal.draw(|frame| draw(frame, shown)).unwrap();
    terminal.backend().buffer().clone()
}

fn as_text(buffer: &Buffer) -> String {
    let mut text = String::new();
    for y in 0..buffer.area.height {
        let row: String = (0..buffer.area.width)
            .map(|x| buffer[(x, y)].symbol())
            .collect();
        text.push_str(row.trim_end());
        text.push('\n');
    }
    text
}

fn compare(file: &Path, is: &str) {
    if std::env::var_os("MIMU_WRITE").is_some() {
        std::fs::write(file, is).unwrap();
    }
    let wanted = std::fs::read_to_string(file).unwrap_or_default();
    assert_eq!(is, wanted, "{}\n{is}", file.display());
}

fn is_as_in(name: &str, shown: &Shown, size: [u16; 2]) -> String {
    let is = as_text(&drawn(shown, size));
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/views/picture");
    compare(&folder.join(format!("{name}.txt")), &is);
    is
}

fn aims(sensor: Sensor, half_widths: [f64; 3]) -> Aims {
    let (targets, unit) = match sensor {
        Sensor::Gyro => ([0.05, 2000.0, 2000.0], "deg/s"),
        Sensor::Accel => ([1.0, 1000.0, 1000.0], "mg"),
    };
    let aim = |k: usize| Aim {
        parameter: [Parameter::Bias, Parameter::Scale, Parameter::Angles][k],
        axis: ["x", "z", "y"][k],
        half_width: half_widths[k],
        target: targets[k],
        unit: [unit, "ppm", "µrad"][k],
    };
    Aims {
        sensor,
        aims: vec![aim(0), aim(1), aim(2)],
    }
}

fn progress(gyro: [f64; 3], accel: [f64; 3]) -> Progress {
    Progress {
        sensors: vec![aims(Sensor::Gyro, gyro), aims(Sensor::Accel, accel)],
        not_yet: None,
    }
}

fn unit(name: &str) -> UnitState {
    UnitState {
        unit: name.into(),
        motion: Some([0.31, 0.44]),
        motion_limits: [1.0, 1.0],
        tilt_deg: Some(3.12),
        up: Some([0.0, 0.0, 1.0]),
        tilt_limit_deg: 17.0,
        rate_dps: Some(0.04),
        rate_limit_dps: 2.0,
        temp_c: Some(26.31),
        trend_c_per_min: Some(0.08),
        trend_limit_c_per_min: Some(0.5),
        samples: 412_733,
        lost: 0,
        clipped: 0,
        waiting: None,
        left_s: Some(1.4),
        spin: None,
    }
}

fn standing(units: Vec<UnitState>) -> SessionState {
    let progress = progress([0.0312, 2410.0, 1530.0], [0.412, 806.0, 1220.0]);
    SessionState {
        phase: Phase::Calibration,
        step: Some(Step::at_rest(Vector3::new(1.0, 0.0, -1.0), 4.0)),
        dwells: [11, 12],
        discarded: 2,
        elapsed_s: 412.7,
        progress: vec![progress; units.len()],
        units,
    }
}

fn log() -> Vec<String> {
    [
        "mimu, firmware 0.1.0, unit 1f3a5c7e",
        "it stores no calibration",
        "self-test: all sensors respond as in their data sheets",
        "warm-up: until the temperature changes by less than 0.5 °C/min; leave the unit at rest",
        "calibration: 12 dwells are planned",
        "waiting: it moves (accel 3.2 times the limit)",
        "discarded, repeat: it moves (accel 1.8 times the limit)",
        "waiting: wrong pose: +z face up, 90 degrees from the requested one",
    ]
    .map(String::from)
    .to_vec()
}

fn shown<'a>(standing: &'a SessionState, log: &'a [String]) -> Shown<'a> {
    Shown {
        standing,
        log,
        question: None,
    }
}

#[test]
fn a_dwell_is_measured_on_the_narrowest_screen() {
    let (standing, log) = (standing(vec![unit("mimu-1f3a5c7e")]), log());
    is_as_in("measures", &shown(&standing, &log), LEAST);
}

#[test]
fn the_picture_of_the_docs_is_this_screen() {
    let (standing, log) = (standing(vec![unit("mimu-1f3a5c7e")]), log());
    let picture = svg::of(&drawn(&shown(&standing, &log), LEAST));
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/wizard");
    compare(&docs.join("screen.svg"), &picture);
    roxmltree::Document::parse(&picture).unwrap();
}

#[test]
fn what_keeps_a_table_from_a_dwell_is_said_in_words_and_not_by_colour_alone() {
    let mut one = unit("mimu-1f3a5c7e");
    one.motion = Some([7.2, 0.6]);
    one.motion_limits = [5.0, 1.0];
    one.rate_dps = Some(61.3);
    one.rate_limit_dps = 22.0;
    (one.tilt_deg, one.lost, one.left_s) = (Some(32.0), 1204, None);
    one.waiting = Some(Waiting::OtherRate(61.3, 100.0));
    let mut standing = standing(vec![one]);
    standing.step = Some(Step {
        up: [0.0, -1.0, 0.0],
        rate_dps: 100.0,
        dwell_s: 4.0,
    });
    let log = log();
    let is = is_as_in("waits", &shown(&standing, &log), LEAST);
    for word in ["uneven", "wrong", "1 204 lost", "not", "met"] {
        assert!(is.contains(word), "{word}");
    }
}

#[test]
fn before_the_first_sample_there_is_a_screen_already() {
    let mut one = UnitState {
        unit: "mimu-1f3a5c7e".into(),
        ..UnitState::default()
    };
    let mut standing = SessionState {
        phase: Phase::Start,
        units: vec![one.clone()],
        ..SessionState::default()
    };
    is_as_in("nothing-yet", &shown(&standing, &[]), LEAST);

    one = unit("mimu-1f3a5c7e");
    (one.tilt_deg, one.left_s, one.trend_c_per_min) = (None, None, Some(1.72));
    one.waiting = Some(Waiting::Warming(1.72, 0.5));
    standing.units = vec![one];
    standing.phase = Phase::WarmUp;
    standing.progress = vec![Progress {
        sensors: Vec::new(),
        not_yet: Some("accel: 3 poses at rest, and 9 are needed".into()),
    }];
    is_as_in("warm-up", &shown(&standing, &log()), LEAST);
}

#[test]
fn a_question_lies_above_all_else_with_its_answers() {
    let (standing, log) = (standing(vec![unit("mimu-1f3a5c7e")]), log());
    let question = "unplug the board, plug it in again, and answer yes; no skips this test";
    let shown = Shown {
        question: Some(question),
        ..shown(&standing, &log)
    };
    is_as_in("question", &shown, LEAST);
}

#[test]
fn several_units_have_two_lines_each_where_there_is_no_room_and_those_that_wait_come_first() {
    let mut units: Vec<UnitState> = (1..=3).map(|k| unit(&format!("mimu-000{k}"))).collect();
    units[2].waiting = Some(Waiting::Moves(Sensor::Accel, 1.8));
    units[2].left_s = None;
    let mut three = standing(units);
    three.progress[1].sensors[0].aims[0].half_width = 1.5;
    let log = log();
    is_as_in("three-units", &shown(&three, &log), LEAST);
    let many = (1..=9).map(|k| unit(&format!("mimu-000{k}"))).collect();
    let many = standing(many);
    let is = as_text(&drawn(&shown(&many, &log), LEAST));
    assert!(is.contains("5 more: make the terminal larger"), "{is}");
}

#[test]
fn four_units_stand_side_by_side_on_a_large_screen() {
    let mut units: Vec<UnitState> = (1..=4).map(|k| unit(&format!("mimu-000{k}"))).collect();
    units[2].waiting = Some(Waiting::Moves(Sensor::Accel, 1.8));
    (units[2].motion, units[2].left_s) = (Some([0.4, 1.8]), None);
    let (standing, log) = (standing(units), log());
    is_as_in("four-units", &shown(&standing, &log), [200, 60]);
}

#[test]
fn one_unit_has_the_whole_width_of_a_large_screen() {
    let (standing, log) = (standing(vec![unit("mimu-1f3a5c7e")]), log());
    is_as_in("large", &shown(&standing, &log), [200, 60]);
}

#[test]
fn no_size_of_a_terminal_and_no_figure_is_a_panic() {
    let mut odd = unit("a name of a unit that is longer than all that there is room for, by far");
    odd.motion = Some([f64::NAN, f64::INFINITY]);
    (odd.temp_c, odd.left_s) = (Some(-273.15), Some(-1e9));
    odd.waiting = Some(Waiting::Interrupted(Interruption::Restarted(
        "w".repeat(300),
    )));
    let mut standing = standing(vec![odd; 20]);
    standing.progress[0].sensors[0].aims[0].half_width = f64::INFINITY;
    standing.progress[0].sensors[0].aims[1].half_width = f64::NAN;
    standing.dwells = [5, 3];
    let log = [String::new(), "x".repeat(1000), "°".repeat(50)];
    let question = "long ".repeat(400);
    for w in [1, 2, 5, 79, 80, 81, 120, 200, 500] {
        for h in [1, 2, 23, 24, 25, 40, 60, 100] {
            let shown = Shown {
                question: (w % 2 == 0).then_some(question.as_str()),
                ..shown(&standing, &log)
            };
            drawn(&shown, [w, h]);
        }
    }
}

#[test]
fn too_small_a_terminal_says_what_it_needs() {
    let standing = standing(vec![unit("mimu-1f3a5c7e")]);
    let is = as_text(&drawn(&shown(&standing, &[]), [60, 10]));
    let words = "has 60 x 10 characters, but 80 x 24 are";
    assert!(is.contains(words), "{is}");
}

#[test]
fn lines_are_broken_at_blanks_and_never_longer_than_the_room() {
    assert_eq!(wrapped("one two three", 9), ["one two", "  three"]);
    assert_eq!(wrapped("abcdefghij", 4), ["abcd", "  ef", "  gh", "  ij"]);
    assert_eq!(wrapped("", 4), [""]);
    assert_eq!(wrapped("a °°°°", 5), ["a", "  °°°", "  °"]);
}
