//! Magnetometers and further units in the files of programs, by numbers worked by hand: what a program's formula makes of a raw reading is the calibrated input.

use mimu::calibration::Calibration;
use mimu::calibration::body::BodyTriad;
use mimu_export::adafruit::{self, Adafruit, Layout};
use mimu_export::ardupilot::ArduPilot;
use mimu_export::betaflight::{self, Betaflight};
use mimu_export::c;
use mimu_export::fusion::Fusion;
use mimu_export::imu_tk::{self, ImuTk};
use mimu_export::inav::{self, Inav};
use mimu_export::json::Json;
use mimu_export::kalibr::{self, Kalibr};
use mimu_export::px4::Px4;
use mimu_export::rust::Rust;
use mimu_export::{Export, Nothing, Sources, Target, body, driver, parameters};
use mimu_recording::{RawUnit, TriadName};

use crate::noise_of_one_axis::noise;

type Matrix = [[f64; 3]; 3];

const ONE: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// µT per code, and µT. The reading [`RAW`] is a field of [`FIELD_UT`].
const SOFT: Matrix = [[0.1, 0.002, 0.0], [0.002, 0.1, 0.0], [0.0, 0.0, 0.125]];
const SHIFT: [f64; 3] = [-5.0, 0.0, 2.0];
const RAW: [f64; 3] = [100.0, 200.0, -80.0];
const FIELD_UT: [f64; 3] = [5.4, 20.2, -8.0];
/// A quarter turn about z.
const QUARTER: [f64; 3] = [0.0, 0.0, 90.0];

fn triad(name: &str, unit: &str, c: Matrix, o: [f64; 3]) -> BodyTriad {
    let triad = TriadName::parse(name).unwrap();
    let reference = if name.starts_with("accel") {
        "accel"
    } else {
        "gyro"
    };
    BodyTriad {
        triad,
        reference: TriadName::parse(reference).unwrap(),
        formula: "x = C u + o".into(),
        direction: "raw to SI".into(),
        raw_unit: RawUnit::Count,
        unit: unit.into(),
        C: c,
        o,
        sigma_C: [[0.0; 3]; 3],
        sigma_o: [0.0; 3],
        interval_C: [[0.0; 3]; 3],
        interval_o: [0.0; 3],
        rotation_deg: Some([0.0; 3]),
        interval_rotation_deg: None,
        delay_ms: None,
        interval_delay_ms: None,
        lever_arm_mm: None,
        interval_lever_arm_mm: None,
        judgement: None,
        iron: None,
    }
}

pub fn mag() -> BodyTriad {
    triad("mag", "uT", SOFT, SHIFT)
}

fn with(all: impl IntoIterator<Item = BodyTriad>) -> Calibration {
    let mut calibration = crate::unit::calibration_of("count", false);
    calibration.body = all.into_iter().collect();
    calibration
}

fn of(calibration: &Calibration) -> Sources<'_> {
    Sources {
        calibration: Some((calibration, "cal.toml")),
        ..Sources::default()
    }
}

fn autopilot(mag_ut_per_raw: Option<f64>) -> parameters::Options {
    parameters::Options {
        imu: 1,
        gyro_id: None,
        accel_id: None,
        qgc: false,
        driver: driver::Options {
            // Of 16 bits at 16 g, as the calibration of the test has it.
            accel_si_per_raw: None,
            ..driver::Options::default()
        },
        mag: body::Options { mag_ut_per_raw },
    }
}

fn value(export: &Export, name: &str) -> f64 {
    let found = export.parameters.iter().find(|p| p.name == name);
    found.unwrap_or_else(|| panic!("{name} is missing")).value
}

fn values(export: &Export, names: &str) -> [f64; 3] {
    ["X", "Y", "Z"].map(|axis| value(export, &names.replace('#', axis)))
}

fn times(m: Matrix, v: [f64; 3]) -> [f64; 3] {
    m.map(|row| (0..3).map(|k| row[k] * v[k]).sum())
}

fn symmetric([x, y, z]: [f64; 3], [xy, xz, yz]: [f64; 3]) -> Matrix {
    [[x, xy, xz], [xy, y, yz], [xz, yz, z]]
}

fn assert_near(ours: [f64; 3], expected: [f64; 3], tolerance: f64) {
    for (a, b) in ours.iter().zip(expected) {
        assert!((a - b).abs() < tolerance, "{ours:?}, expected {expected:?}");
    }
}

fn text(export: &Export) -> &str {
    std::str::from_utf8(&export.content).unwrap()
}

#[test]
fn px4_gets_the_field_in_gauss_from_the_drivers_reading() {
    let calibration = with([mag()]);
    let export = Px4::export(&of(&calibration), &autopilot(Some(0.1))).unwrap();
    let s = symmetric(
        values(&export, "CAL_MAG0_#SCALE"),
        values(&export, "CAL_MAG0_#ODIAG"),
    );
    let offset = values(&export, "CAL_MAG0_#OFF");
    // The driver reports 0.1 µT, or a thousandth of a gauss, for a code.
    let v = RAW.map(|code| 1e-3 * code);
    let gauss = times(s, [v[0] - offset[0], v[1] - offset[1], v[2] - offset[2]]);
    assert_near(gauss, FIELD_UT.map(|ut| 0.01 * ut), 1e-7);
}

#[test]
fn ardupilot_adds_its_offsets_in_milligauss() {
    let second = BodyTriad {
        triad: TriadName::parse("mag2").unwrap(),
        ..mag()
    };
    let calibration = with([mag(), second]);
    let export = ArduPilot::export(&of(&calibration), &autopilot(Some(0.1))).unwrap();
    for n in ["", "2"] {
        let s = symmetric(
            values(&export, &format!("COMPASS_DIA{n}_#")),
            values(&export, &format!("COMPASS_ODI{n}_#")),
        );
        let offset = values(&export, &format!("COMPASS_OFS{n}_#"));
        // 0.1 µT are a milligauss. Along z the field of the body's own iron reads -16 codes.
        assert!((offset[2] - 16.0).abs() < 1e-5);
        let v = RAW;
        let milligauss = times(s, [v[0] + offset[0], v[1] + offset[1], v[2] + offset[2]]);
        assert_near(milligauss, FIELD_UT.map(|ut| 10.0 * ut), 1e-4);
        assert!((value(&export, &format!("COMPASS_SCALE{n}")) - 1.0).abs() < 1e-9);
    }
}

#[test]
fn a_turned_compass_keeps_its_symmetric_matrix_and_the_file_says_how_far_it_is_turned() {
    let turned = BodyTriad {
        rotation_deg: Some(QUARTER),
        ..mag()
    };
    let [straight, turned] = [mag(), turned].map(|mag| {
        let calibration = with([mag]);
        Px4::export(&of(&calibration), &autopilot(Some(0.1))).unwrap()
    });
    for (a, b) in straight.parameters.iter().zip(&turned.parameters) {
        assert_eq!(a.name, b.name);
        assert!((a.value - b.value).abs() < 1e-6, "{}", a.name);
    }
    assert!(text(&turned).contains("roll 0.00, then pitch 0.00, then yaw 90.00 deg"));
}

#[test]
fn a_mirrored_compass_is_refused() {
    let mut mirrored = mag();
    mirrored.C[2][2] *= -1.0;
    let calibration = with([mirrored]);
    let error = Px4::export(&of(&calibration), &autopilot(None)).unwrap_err();
    assert!(error.to_string().contains("left-handed"), "{error}");
}

#[test]
fn a_field_without_a_size_is_left_out_where_gauss_are_needed_and_taken_where_directions_are_enough()
{
    let field = BodyTriad {
        unit: "field".into(),
        C: SOFT.map(|row| row.map(|c| c / 50.0)),
        o: SHIFT.map(|o| o / 50.0),
        ..mag()
    };
    let in_field = with([field]);
    let adafruit = adafruit::Options {
        layout: Layout::Lines,
        driver: driver::Options::default(),
        mag: body::Options::default(),
    };
    let needs_gauss = |calibration: &Calibration| {
        [
            Px4::export(&of(calibration), &autopilot(None)),
            ArduPilot::export(&of(calibration), &autopilot(None)),
            Adafruit::export(&of(calibration), &adafruit),
        ]
    };
    // Gyro and accelerometer are written as without a magnetometer.
    for (export, without) in needs_gauss(&in_field)
        .into_iter()
        .zip(needs_gauss(&with([])))
    {
        let (export, without) = (export.unwrap(), without.unwrap());
        let values = |export: &Export| {
            let lines = text(export)
                .lines()
                .filter(|line| !line.starts_with(['#', '/']));
            lines.map(str::to_owned).collect::<Vec<_>>()
        };
        assert_eq!(values(&export), values(&without));
        assert!(values(&export).len() > 1, "{}", text(&export));
        let said =
            |note: &String| note.starts_with("mag is not in the file") && note.contains("--field");
        assert!(export.notes.iter().any(said), "{:?}", export.notes);
    }
    let mut alone = in_field.clone();
    (alone.gyro, alone.accel) = (None, None);
    for refused in needs_gauss(&alone) {
        let error = refused.unwrap_err().to_string();
        assert!(
            error.contains("[[body]] mag") && error.contains("--field"),
            "{error}"
        );
    }
    let in_ut = with([mag()]);
    let options = inav::Options {
        acc_1g: 2048.0,
        driver: driver::Options::default(),
    };
    let lines = |calibration: &Calibration| {
        let export = Inav::export(&of(calibration), &options).unwrap();
        let lines = text(&export).lines();
        lines
            .filter(|line| line.starts_with("set mag"))
            .collect::<Vec<_>>()
            .join("\n")
    };
    assert_eq!(lines(&in_field), lines(&in_ut));
}

/// A compass with a factor for each axis: a reading of 150, 200, -110 is 10, 25, -20 µT.
fn by_axes() -> Calibration {
    let c = [[0.1, 0.0, 0.0], [0.0, 0.125, 0.0], [0.0, 0.0, 0.2]];
    with([
        triad("mag", "uT", c, [-5.0, 0.0, 2.0]),
        triad("gyro2", "rad/s", ONE, [0.0; 3]),
    ])
}

fn setting(export: &Export, name: &str) -> String {
    let set = format!("set {name} = ");
    let line = text(export)
        .lines()
        .find_map(|line| line.strip_prefix(set.as_str()));
    line.unwrap_or_else(|| panic!("{name} is missing"))
        .to_string()
}

#[test]
fn inav_and_betaflight_subtract_codes_and_inav_scales_each_axis() {
    let calibration = by_axes();
    let options = inav::Options {
        acc_1g: 2048.0,
        driver: driver::Options::default(),
    };
    let export = Inav::export(&of(&calibration), &options).unwrap();
    let of_axes = |stem: &str| {
        ["x", "y", "z"].map(|axis| {
            let number = setting(&export, &format!("{stem}_{axis}"));
            number.parse::<f64>().unwrap()
        })
    };
    let (zero, gain) = (of_axes("magzero"), of_axes("maggain"));
    let raw = [150.0, 200.0, -110.0];
    let out = [0, 1, 2].map(|i| (raw[i] - zero[i]) * 1024.0 / gain[i]);
    // 1024 for 50 µT.
    assert_near(out.map(|v| v * 50.0 / 1024.0), [10.0, 25.0, -20.0], 1e-9);
    assert!(text(&export).contains("gyro2: the format has no place for it"));

    let options = betaflight::Options {
        acc_1g: 2048.0,
        driver: driver::Options::default(),
    };
    let export = Betaflight::export(&of(&calibration), &options).unwrap();
    assert_eq!(setting(&export, "mag_calibration"), "50,0,-10");
}

/// Numbers between braces or brackets after this name.
fn numbers(text: &str, name: &str) -> Vec<f64> {
    let (_, rest) = text.split_once(name).unwrap();
    let after = &rest[rest.find(['{', '[']).unwrap()..];
    let begin = after
        .find(|c: char| c == '-' || c.is_ascii_digit())
        .unwrap();
    let end = after[begin..].find(['}', ']']).unwrap() + begin;
    let each = after[begin..end].split(',');
    each.map(|n| n.trim().trim_end_matches('f').parse().unwrap())
        .collect()
}

#[test]
fn hobby_libraries_get_the_field_in_the_frame_of_the_gyro() {
    let turned = BodyTriad {
        rotation_deg: Some(QUARTER),
        ..mag()
    };
    let calibration = with([turned]);
    let from = of(&calibration);
    // A quarter turn about z takes x to y and y to -x.
    let expected = [-FIELD_UT[1], FIELD_UT[0], FIELD_UT[2]];
    let rows = |n: &[f64]| [[n[0], n[1], n[2]], [n[3], n[4], n[5]], [n[6], n[7], n[8]]];
    let minus = |v: [f64; 3], h: &[f64]| [v[0] - h[0], v[1] - h[1], v[2] - h[2]];
    for layout in [Layout::Lines, Layout::Json] {
        let options = adafruit::Options {
            layout,
            driver: driver::Options::default(),
            mag: body::Options {
                mag_ut_per_raw: Some(0.1),
            },
        };
        let export = Adafruit::export(&from, &options).unwrap();
        let file = text(&export);
        let body = &file[file.rfind("mag_hardiron").unwrap()..];
        let hard = match layout {
            Layout::Lines => numbers(body, "mag_hardiron[3]"),
            Layout::Json => numbers(body, "mag_hardiron"),
        };
        let body = &file[file.rfind("mag_softiron").unwrap()..];
        let soft = match layout {
            Layout::Lines => numbers(body, "mag_softiron[9]"),
            Layout::Json => numbers(body, "mag_softiron"),
        };
        let microtesla = RAW.map(|code| 0.1 * code);
        let field = times(rows(&soft), minus(microtesla, &hard));
        assert_near(field, expected, 1e-5);
    }
    let export = Fusion::export(&from, &Nothing {}).unwrap();
    let soft = numbers(text(&export), "FusionMatrix softIronMatrix");
    let hard = numbers(text(&export), "FusionVector hardIronOffset");
    assert_near(times(rows(&soft), minus(RAW, &hard)), expected, 1e-5);
}

#[test]
fn kalibr_gets_the_pose_and_the_time_of_a_second_unit() {
    let placed = |name: &str, unit: &str| BodyTriad {
        rotation_deg: Some(QUARTER),
        delay_ms: Some(2.0),
        lever_arm_mm: name.starts_with("accel").then_some([100.0, 0.0, 50.0]),
        raw_unit: RawUnit::Si,
        ..triad(name, unit, ONE, [0.0; 3])
    };
    let mut calibration = with([placed("gyro2", "rad/s"), placed("accel2", "m/s^2")]);
    // The frame of imu0 is then that of the calibration.
    calibration.accel.as_mut().unwrap().C = ONE;
    let noise = noise();
    let from = Sources {
        noise: Some(&noise),
        ..of(&calibration)
    };
    let options = kalibr::Options {
        rostopic: "/imu0".into(),
        result: true,
        noise: Default::default(),
        driver: driver::Options::default(),
    };
    let export = Kalibr::export(&from, &options).unwrap();
    let (_, second) = text(&export).split_once("\nimu1:\n").unwrap();
    let rows = second.split_once("T_i_b:\n").unwrap().1.lines().take(4);
    let pose: Vec<Vec<f64>> = rows
        .map(|row| {
            let inside = row.trim().trim_start_matches("- [").trim_end_matches(']');
            inside
                .split(',')
                .map(|v| v.trim().parse().unwrap())
                .collect()
        })
        .collect();
    // Its x looks along the body's y, and it is 100 mm along the body's x and 50 mm along z.
    let expected = [
        [0.0, 1.0, 0.0, 0.0],
        [-1.0, 0.0, 0.0, 0.1],
        [0.0, 0.0, 1.0, -0.05],
        [0.0, 0.0, 0.0, 1.0],
    ];
    for (ours, theirs) in pose.iter().flatten().zip(expected.iter().flatten()) {
        assert!((ours - theirs).abs() < 1e-9, "{pose:?}");
    }
    // Its stamps are 2 ms late.
    assert!(second.contains("time_offset: -0.002"), "{second}");
}

#[test]
fn formats_without_a_place_name_what_is_missing_and_complete_ones_have_it() {
    let calibration = with([mag(), triad("gyro2", "rad/s", ONE, [0.0; 3])]);
    let from = of(&calibration);
    let imu_tk = imu_tk::Options {
        sensor: imu_tk::Triad::Gyro,
    };
    let export = ImuTk::export(&from, &imu_tk).unwrap();
    assert!(text(&export).contains("mag, gyro2: the format has a gyro and an accelerometer only"));
    let json = Json::export(&from, &Nothing {}).unwrap();
    let value: serde_json::Value = serde_json::from_slice(&json.content).unwrap();
    assert_eq!(value["body"][0]["triad"], "mag");
    let options = c::Options {
        prefix: "imu".into(),
    };
    let header = c::C::export(&from, &options).unwrap();
    assert!(text(&header).contains("static const imu_triad imu_body[2] = {"));
    let mut only_mag = with([mag()]);
    (only_mag.gyro, only_mag.accel) = (None, None);
    let header_of_mag = c::C::export(&of(&only_mag), &options).unwrap();
    let used = "Use: with every sample imu_triad_reading(&imu_body[IMU_MAG], raw, x).";
    assert!(
        text(&header_of_mag).contains(used),
        "{}",
        text(&header_of_mag)
    );
    let module = Rust::export(&from, &Nothing {}).unwrap();
    assert!(text(&module).contains("pub const BODY: [FurtherTriad; 2] = ["));

    let alone = with([]);
    let from = of(&alone);
    let all = [
        Json::export(&from, &Nothing {}),
        c::C::export(&from, &options),
        Rust::export(&from, &Nothing {}),
    ];
    for export in all {
        let export = export.unwrap();
        let lower = text(&export).to_lowercase();
        assert!(
            !lower.contains("body[") && !lower.contains("further triad"),
            "{}",
            export.to
        );
    }
}
