//! Triads beyond the first gyro and accelerometer, and the magnetic field.

use std::fs;

use mimu_rig::field::{FieldTruth, MagnetTruth};
use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::record::{Output, Row, samples, write};
use mimu_rig::rig_file::{RigFile, RigTruth};
use mimu_rig::rotation::{Vector, add, norm, scale};
use mimu_rig::table::TableTruth;

fn parse(text: &str) -> Result<RigFile, String> {
    let text = format!("format = \"mimu-rig/1\"\n{text}");
    RigFile::parse(&Source::new("RIG.toml", text))
}

fn truth(text: &str, seed: u64) -> RigTruth {
    RigTruth::resolve(&parse(text).unwrap(), seed).unwrap()
}

fn hands(rate_hz: f64, poses: u32) -> Plan {
    let text = format!(
        "format = \"mimu-plan/1\"\nsample_rate_hz = {rate_hz}\ncarrier = \"hands\"\n[[step]]\nposes = {poses}\ndwell_s = 0.5\n"
    );
    Plan::parse(Source::new("PLAN.toml", text)).unwrap()
}

/// A triad of `name` that gives its input, without noise and quantisation.
fn pure(name: &str, keys: &str) -> String {
    let part = match name.trim_end_matches(char::is_numeric) {
        "gyro" => "MPU6050-gyro",
        "accel" => "MPU6050-accel",
        _ => "AK8963",
    };
    format!(
        "[[triad]]\nname = \"{name}\"\npart = \"{part}\"\nstep_raw = 0\n{keys}\n\
         [triad.axes]\nwhite_si = [0, 0, 0]\ninstability_si = [0, 0, 0]\nwalk_si = [0, 0, 0]\nbandwidth_hz = [inf, inf, inf]\nrc_hz = inf\n\
         [triad.affine]\nmatrix = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\nbias = [0, 0, 0]\n"
    )
}

fn assert_near(found: Vector, expected: Vector, tolerance: f64) {
    let error = norm(add(found, scale(-1.0, expected)));
    assert!(
        error <= tolerance,
        "{found:?} is not {expected:?} within {tolerance:e}"
    );
}

#[test]
fn an_accelerometer_off_the_origin_feels_the_second_derivative_of_its_own_position() {
    let triad = pure("accel2", "lever_mm = [300, -200, 100]");
    // A knock has a jerk that is too large for the numeric differences.
    let text = format!("earth_rate = false\n[hands]\njolt_probability = 0\n{triad}");
    let (plan, truth) = (hands(10_000.0, 6), truth(&text, 3));
    let rows: Vec<Row> = samples(&plan, &truth, 3).unwrap().collect();
    let place = |row: &Row| {
        let motion = &row.instant.motion;
        add(motion.position, motion.attitude.turn([0.3, -0.2, 0.1]))
    };
    let mut most = 0.0_f64;
    for three in rows.windows(3) {
        let [before, at, after] = [0, 1, 2].map(|k| place(&three[k]));
        let doubled = add(add(before, after), scale(-2.0, at));
        let level = add(scale(1e8, doubled), [0.0, 0.0, plan.place.gravity]);
        let motion = &three[1].instant.motion;
        let expected = motion.attitude.inverse().turn(level);
        // At the ends of a turn the jerk jumps by some 80 m/s³: an error of h/6 of it.
        assert_near(three[1].further[0], expected, 2e-3);
        most = most.max(norm(add(expected, scale(-1.0, motion.force))));
    }
    assert!(most > 1.0, "{most}");
}

#[test]
fn a_compass_on_a_level_board_reads_the_field_of_the_earth_by_dip_and_heading() {
    let text = "format = \"mimu-plan/1\"\nsample_rate_hz = 100.0\ncarrier = \"table\"\n[[step]]\nup = [0, 0, 1]\ndwell_s = 0.1\n";
    let plan = Plan::parse(Source::new("PLAN.toml", text)).unwrap();
    let field = "[field]\nsize_ut = 50\ndip_deg = 60\nheading_deg = 90\n";
    let mut file = parse(&format!(
        "{field}{}",
        pure("mag", "rotation_deg = [180, 0, 0]")
    ))
    .unwrap();
    file.table = TableTruth::ideal();
    let truth = RigTruth::resolve(&file, 1).unwrap();
    let row = samples(&plan, &truth, 1).unwrap().next().unwrap();
    // 50 cos 60 to the east, 50 sin 60 down, which is along its third axis.
    assert_near(row.further[0], [25.0, 0.0, 50.0 * 0.75_f64.sqrt()], 1e-9);
}

#[test]
fn a_dipole_has_twice_the_field_along_its_axis_as_across_and_falls_with_the_cube() {
    let field = FieldTruth {
        size_ut: 0.0,
        magnet: vec![MagnetTruth {
            at_m: [0.5, 0.0, 0.0],
            moment_am2: [0.0, 0.0, 2.0],
            from_s: 3.0,
            to_s: 5.0,
        }],
        ..FieldTruth::default()
    };
    // µ0 m / (2π r³), with µ0 = 4π 1e-7: 50 µT for 2 A m² at 0.2 m.
    assert_near(field.at([0.5, 0.0, 0.2], 4.0), [0.0, 0.0, 50.0], 1e-9);
    assert_near(field.at([0.5, 0.0, -0.4], 4.0), [0.0, 0.0, 6.25], 1e-9);
    assert_near(field.at([0.7, 0.0, 0.0], 4.0), [0.0, 0.0, -25.0], 1e-9);
    for t_s in [2.9, 5.0] {
        assert_near(field.at([0.5, 0.0, 0.2], t_s), [0.0; 3], 0.0);
    }
}

#[test]
fn further_triads_leave_the_first_two_unchanged_bit_by_bit() {
    let plan = hands(100.0, 3);
    let run = |text: &str| {
        let truth = truth(text, 9);
        let rows = samples(&plan, &truth, 9).unwrap();
        rows.map(|row| (row.instant, row.readings))
            .collect::<Vec<_>>()
    };
    let drawn =
        "[[triad]]\nname = \"gyro2\"\n[[triad]]\nname = \"accel2\"\n[[triad]]\nname = \"mag\"\n";
    assert!(run(drawn) == run(""));
}

#[test]
fn the_truth_of_a_body_makes_the_same_samples_again_and_lists_its_calibration() {
    let folder = tempfile::tempdir().unwrap();
    let plan = hands(100.0, 3);
    let text = "[[triad]]\nname = \"gyro2\"\nlever_mm = [1, 2, 3]\n[[triad]]\nname = \"mag\"\nevery = 10\n";
    let mut truth = truth(text, 4);
    let mut files = Vec::new();
    for name in ["first", "second"] {
        let output = Output::new(&folder.path().join(name), &plan).unwrap();
        write(&plan, &truth, 4, &output).unwrap();
        truth = RigTruth::resolve(&RigFile::read(&output.truth).unwrap(), 5).unwrap();
        let samples = fs::read(output.folder.join("samples.parquet")).unwrap();
        let said = fs::read_to_string(output.truth).unwrap();
        assert!(said.contains("# gyro2: x = C u + o"), "{said}");
        assert!(said.contains("ms later than gyro"), "{said}");
        assert!(said.contains("dip_deg = 65.0"), "{said}");
        files.push(samples);
    }
    assert!(files[0] == files[1]);
}

#[test]
fn mistakes_in_a_body_are_refused_with_their_line_and_a_remedy() {
    let names = "names no further triad; give mag, or gyro, accel or mag with a number from 2 to 64, as gyro2";
    for name in ["gyro", "accel1", "mag02", "mag65", "gyro+2", "compass"] {
        let said = parse(&format!("[[triad]]\nname = \"{name}\"")).unwrap_err();
        assert_eq!(said, format!("RIG.toml:3: \"{name}\" {names}"));
    }
    #[rustfmt::skip]
    let cases = [
        ("[[triad]]\nname = \"mag\"\npart = \"ADXRS300\"", "4: no sensor has the name \"ADXRS300\"; known are: AK8963"),
        ("[[triad]]\nname = \"mag\"\n[[triad]]\nname = \"mag\"", "5: triad `mag` occurs twice; remove one, or give another number"),
        ("[[triad]]\nname = \"mag\"\nevery = 0", "4: `every` is 0; give 1 to 1000000"),
        ("[[triad]]\nname = \"mag\"\n[triad.axes]\nwhite_si = [0, -1, 0]", "5: `white_si` is -1; give 0 to 1000"),
        ("[[triad]]\nname = \"mag\"\nbetween = \"zero\"", "4: `between`: unknown variant `zero`, expected `empty` or `repeat`; correct the line"),
        ("[field]\ndip_deg = 91", "3: `dip_deg` is 91; give -90 to 90"),
        ("[[field.magnet]]\nat_m = [0, 0, 0]", "2: missing field `moment_am2`; add the key"),
    ];
    for (text, complaint) in cases {
        assert_eq!(parse(text).unwrap_err(), format!("RIG.toml:{complaint}"));
    }
}
