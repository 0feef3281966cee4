//! Magnetometers and further sensors of a file.

use super::*;
use crate::import::look::{Given, Look};
use crate::{Column, TriadName};

/// The options by a look at files.
fn looked(bench: &Bench, files: &[&str]) -> (ImportOptions, Vec<String>) {
    let paths: Vec<PathBuf> = files.iter().map(|name| bench.path(name)).collect();
    let look = Look::at(&paths, None, &Given::default()).unwrap();
    assert_eq!(look.questions, []);
    let mut options = bench.options(files, &[]);
    options.log.columns = look.columns();
    options.log.scale.extend(look.scales.iter().cloned());
    options.log.time_unit = look.time_unit();
    options.raw_unit = look.raw_unit.unwrap();
    (options, look.words())
}

fn values<'a>(batch: &'a Batch, name: &str, axis: usize) -> &'a [f64] {
    let column = Column::of(TriadName::parse(name).unwrap(), axis);
    batch.values(column).unwrap()
}

fn names(summary: &ImportSummary) -> String {
    let names: Vec<String> = summary.triads.iter().map(ToString::to_string).collect();
    names.join(" ")
}

#[test]
fn all_triads_of_a_table_are_taken_in_si_and_a_magnetometer_in_microtesla() {
    let head = "time (ms),gx1 (deg/s),gy1 (deg/s),gz1 (deg/s),ax1 (g),ay1 (g),az1 (g),gx2 (deg/s),gy2 (deg/s),gz2 (deg/s),ax2 (g),ay2 (g),az2 (g),mx (G),my (G),mz (G)\n";
    let row = |i: usize| {
        let n = 1e-3 * (i % 7) as f64;
        // Each fourth row has a field, as of a slower sensor.
        let field = if i.is_multiple_of(4) {
            "0.25,-0.1,0.5"
        } else {
            ",,"
        };
        format!(
            "{},{n},0.5,-0.25,{n},0,1,90,{n},0,0,{n},-1,{field}\n",
            10 * i
        )
    };
    let text = head.to_owned() + &(0..200).map(row).collect::<String>();
    let bench = Bench::new(&[("log.csv", &text)]);
    let (options, words) = looked(&bench, &["log.csv"]);
    says(
        &words.join("\n"),
        &[
            "mag_x = mx (G)",
            "gyro2_y = gy2 (deg/s)",
            "magnetometer in gauss",
        ],
    );
    let (summary, batch, manifest) = bench.import(&options).unwrap();
    assert_eq!(names(&summary), "gyro accel mag gyro2 accel2");
    assert_eq!((summary.rows, manifest.raw_unit), (200, RawUnit::Si));
    let quarter = std::f64::consts::FRAC_PI_2;
    assert!((values(&batch, "gyro2", 0)[9] - quarter).abs() < 1e-12);
    assert!((values(&batch, "accel2", 2)[9] + 9.80665).abs() < 1e-12);
    assert_eq!(values(&batch, "mag", 0)[8], 25.0);
    assert!((1..4).all(|row| values(&batch, "mag", 1)[row].is_nan()));
    // Empty cells of the magnetometer are no missing readings of gyro and accelerometer.
    assert_eq!(summary.empty_cells, 0);
    // The same by the printed command, and by the names of a recording.
    let arguments = options.arguments().join(" ");
    says(&arguments, &["--scale mag=100", "--scale accel2=9.80665"]);
    let samples = "t_s,gyro_x,gyro_y,gyro_z,mag_x,mag_y,mag_z,gyro3_x,gyro3_y,gyro3_z\n0,1,2,3,4,5,6,7,8,9\n0.5,1,2,3,,,,7,8,9\n";
    let bench = Bench::new(&[("a", samples)]);
    let (summary, batch, _) = bench.import(&bench.options(&["a"], &[])).unwrap();
    assert_eq!(names(&summary), "gyro mag gyro3");
    assert!(summary.warnings.is_empty(), "{summary:?}");
    assert_eq!(values(&batch, "gyro3", 2), [9.0, 9.0]);
    let error =
        bench.refused(&bench.options(&["a"], &["t_s,gyro_x,gyro_y,gyro_z,mag_x,mag_y,-,-,-,-"]));
    assert!(error.contains("column mag_z is missing"), "{error}");
}

#[test]
fn a_magnetometer_in_its_own_file_costs_no_row_and_has_empty_cells_where_it_is_silent() {
    let inertial = |i: usize| format!("{},0.1,0.2,0.3,0,0,9.81\n", 10 * i);
    let inertial: String = (0..100).map(inertial).collect();
    // 25 Hz from 5 ms after the third row on, with a gap.
    let silent = |k: usize| (10..15).contains(&k);
    let field = |k: usize| format!("{},{k},{},0\n", 35 + 40 * k, 2 * k);
    let field: String = (0..20).filter(|k| !silent(*k)).map(field).collect();
    let bench = Bench::new(&[
        (
            "imu.csv",
            &format!(
                "time (ms),gx (rad/s),gy (rad/s),gz (rad/s),ax (m/s^2),ay (m/s^2),az (m/s^2)\n{inertial}"
            ),
        ),
        ("Magnetometer.csv", &format!("time (ms),x,y,z\n{field}")),
    ]);
    let (options, _) = looked(&bench, &["imu.csv", "Magnetometer.csv"]);
    let (summary, batch, _) = bench.import(&options).unwrap();
    assert_eq!(
        (summary.rows, names(&summary).as_str()),
        (100, "gyro accel mag")
    );
    assert_eq!(
        (
            summary.interpolated,
            summary.dropped_outside,
            summary.dropped_in_gaps
        ),
        (0, 0, 0)
    );
    let x = values(&batch, "mag", 0);
    assert!(x[..4].iter().chain(&x[80..]).all(|x| x.is_nan()), "{x:?}");
    // Row r is at 10 r ms: (10 r - 35) / 40 of an interval.
    for row in (4..39).chain(64..79) {
        let expected = (10.0 * row as f64 - 35.0) / 40.0;
        assert!((x[row] - expected).abs() < 1e-9, "{row}: {x:?}");
        assert!((values(&batch, "mag", 1)[row] - 2.0 * expected).abs() < 1e-9);
    }
    assert!(x[40..63].iter().all(|x| x.is_nan()), "{x:?}");
}

#[test]
fn a_sample_that_is_written_again_is_dropped_even_if_the_magnetometer_has_moved_on() {
    let text = "t_s,gyro_x,gyro_y,gyro_z,mag_x,mag_y,mag_z\n0,1,2,3,4,5,6\n0.01,2,2,3,4,5,6\n0.01,2,2,3,9,5,6\n0.02,4,2,3,4,5,6\n";
    let bench = Bench::new(&[("a", text)]);
    let (_, batch, _) = bench.import(&bench.options(&["a"], &[])).unwrap();
    assert_eq!(batch.raw[0], [1.0, 2.0, 4.0]);
}

#[test]
fn a_further_triad_that_is_0_in_the_whole_file_is_left_out() {
    let row = |i: usize| {
        let n = 1e-3 * (i % 7) as f64;
        format!("{},{n},0.5,-0.25,{n},0,1,0,0,0,{n},0,0\n", 10 * i)
    };
    let bench = Bench::new(&[("a.csv", &(0..200).map(row).collect::<String>())]);
    let list =
        "t_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z,mag_x,mag_y,mag_z,mag2_x,mag2_y,mag2_z";
    let (summary, _, _) = bench.import(&bench.options(&["a.csv"], &[list])).unwrap();
    assert_eq!(names(&summary), "gyro accel mag2");
    let said = summary.warnings.join("; ");
    says(
        &said,
        &["a.csv: mag: it is exactly 0 on all axes", "left out"],
    );
    assert!(!said.contains("mag2"), "{said}");
}
