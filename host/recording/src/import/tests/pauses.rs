//! Steps separated by pauses, as in the file of a program that records only the poses, one after another.

use super::*;

/// What rs-imu-calibration.py writes with `np.savetxt(..., delimiter=',', fmt='%s')`: milliseconds since 1970 and three numbers, 40 samples at 200 Hz of
/// each of its six directions, 6 s apart.
fn directions() -> String {
    let forces = [
        [0.0, -9.8, 0.0],
        [9.8, 0.0, 0.0],
        [0.0, 9.8, 0.0],
        [-9.8, 0.0, 0.0],
        [0.0, 0.0, -9.8],
        [0.0, 0.0, 9.8],
    ];
    let mut text = String::new();
    for (k, [x, y, z]) in (0..).zip(forces) {
        for i in 0..40 {
            let ms = 1_548_242_178_612.25 + 6200.0 * f64::from(k) + 5.0 * f64::from(i);
            text += &format!("{ms},{},{y:?},{z:?}\n", x + 0.001 * f64::from(i % 2));
        }
    }
    text
}

#[test]
fn the_six_directions_of_a_realsense_camera_are_steps_with_known_inputs() {
    let inputs = "step,ref_force_x_mps2,ref_force_y_mps2,ref_force_z_mps2\n0,0,-9.81,0\n1,9.81,0,0\n2,0,9.81,0\n3,-9.81,0,0\n4,0,0,-9.81\n5,0,0,9.81\n";
    let bench = Bench::new(&[("accel_cam.txt", &directions()), ("inputs", inputs)]);
    let mut options = bench.options(&["accel_cam.txt"], &["t_s,accel_x,accel_y,accel_z"]);
    options.raw_unit = RawUnit::Si;
    options.log.step_gap_s = Some(1.0);
    options.reference = Reference::Table;
    options.log.inputs = Some(bench.path("inputs"));
    let (summary, batch, manifest) = bench.import(&options).unwrap();
    assert_eq!((summary.rows, summary.sample_rate_hz), (240, 200.0));
    assert_eq!(batch.step, (0..240).map(|i| i / 40).collect::<Vec<i32>>());
    assert_eq!(
        [batch.reference[4][0], batch.reference[5][239]],
        [-9.81, 9.81]
    );
    assert!((batch.t_s[40] - batch.t_s[0] - 6.2).abs() < 1e-9);
    assert_eq!(manifest.raw_unit, RawUnit::Si);
    assert!(
        manifest
            .imported_with
            .windows(2)
            .any(|w| w == ["--step-gap", "1"])
    );
    // Without the pause, the file has no steps for the inputs.
    options.log.step_gap_s = None;
    assert!(bench.refused(&options).contains("no column is step"));
}

#[test]
fn pauses_that_contradict_other_steps_are_refused() {
    let bench = Bench::new(&[
        (
            "a",
            "t_s,step,accel_x,accel_y,accel_z\n0,1,1,2,3\n0.01,1,1,2,3\n0.02,1,1,2,4\n",
        ),
        ("turns", "step,turn_x_deg\n0,360\n"),
    ]);
    let mut options = bench.options(&["a"], &[]);
    options.log.step_gap_s = Some(1.0);
    assert!(bench.refused(&options).contains("it has a column step"));
    options.log.columns = vec![
        "t_s=t_s,accel_x=accel_x,accel_y=accel_y,accel_z=accel_z"
            .parse()
            .unwrap(),
    ];
    options.log.time_unit = Some("s".parse().unwrap());
    options.log.inputs = Some(bench.path("turns"));
    says(&bench.refused(&options), &["pauses do not separate turns"]);
    options.log.inputs = None;
    options.sequence = true;
    assert!(bench.refused(&options).contains("a dwell already"));
    options.sequence = false;
    options.log.step_gap_s = Some(-1.0);
    assert!(bench.refused(&options).contains("-1 s is not a pause"));
}

#[test]
fn codes_become_readings_in_the_order_of_the_converter() {
    let text = "t_s,accel_x,accel_y,accel_z\n0,4095,2048,100\n0.01,4094,2047,100\n0.02,1,0,100\n";
    let bench = Bench::new(&[
        ("a", text),
        (
            "b",
            "t_s,accel_x,accel_y,accel_z\n0,4096,0,100\n0.01,1,1,1\n0.02,1,2,1\n",
        ),
    ]);
    let mut options = bench.options(&["a"], &[]);
    options.log.twos_complement = vec!["accel=12".parse().unwrap()];
    options.log.zero = vec!["accel_z=60".parse().unwrap()];
    options.log.scale = vec!["accel=0.5".parse().unwrap()];
    let (_, batch, manifest) = bench.import(&options).unwrap();
    assert_eq!(batch.raw[3], [-0.5, -1.0, 0.5]);
    assert_eq!(batch.raw[4], [-1024.0, 1023.5, 0.0]);
    assert_eq!(batch.raw[5], [20.0; 3]);
    let with = manifest.imported_with.join(" ");
    says(&with, &["--twos-complement accel=12 --zero accel_z=60"]);
    options.files = vec![bench.path("b")];
    let error = bench.refused(&options);
    says(&error, &["row 2, column accel_x", "from 0 to 4095"]);
}
