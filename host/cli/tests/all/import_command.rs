//! `mimu import` of files from makers and users: their layouts, and tables of means.

use std::fmt::Write as _;

use crate::random::congruential;

use super::command::{done, refused};

/// Six faces and six edges of an accelerometer of 800 counts per m/s² with a bias of 50 counts on x.
fn means(with_noise: bool) -> String {
    let (g, half) = (9.81, 0.5_f64.sqrt());
    let mut poses: Vec<[f64; 3]> = Vec::new();
    for axis in 0..3 {
        for sign in [1.0, -1.0] {
            let mut up = [0.0; 3];
            up[axis] = sign;
            poses.push(up);
            let mut edge = [0.0; 3];
            edge[axis] = sign * half;
            edge[(axis + 1) % 3] = half;
            poses.push(edge);
        }
    }
    let noise = ["", ",sx,sy,sz,n"][usize::from(with_noise)];
    let mut table = format!("pose,ax,ay,az{noise}\n");
    for (i, up) in poses.iter().enumerate() {
        // Pseudo-noise, so that no value repeats exactly.
        let error = 0.4 * (2.4 * i as f64).sin();
        let raw = [50.0, 0.0, 0.0]
            .iter()
            .zip(up)
            .map(|(b, up)| b + 800.0 * g * up + error);
        let raw: Vec<String> = raw.map(|u| format!("{u:.3}")).collect();
        let noise = ["", ",6.0,6.0,6.0,200"][usize::from(with_noise)];
        writeln!(table, "p{i},{}{noise}", raw.join(",")).unwrap();
    }
    table
}

#[test]
fn a_table_of_means_is_fitted_and_verified_and_everything_that_needs_samples_refuses_it() {
    for with_noise in [true, false] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        std::fs::write(folder.join("poses.csv"), means(with_noise)).unwrap();
        let noise = match with_noise {
            true => ",accel_x_sd=sx,accel_y_sd=sy,accel_z_sd=sz,averaged=n",
            false => "",
        };
        let list = format!("step=pose,accel_x=ax,accel_y=ay,accel_z=az{noise}");
        let text = done(
            folder,
            &format!(
                "import poses.csv --means --columns {list} --raw-unit count --reference gravity --gravity 9.81 -o poses"
            ),
        );
        assert!(text.contains("means of 12 poses"), "{text}");
        let text = done(folder, "fit poses --dwells");
        assert!(text.contains("means of 12 poses, gravity 9.81"), "{text}");
        assert_eq!(text.contains("taken as the noise"), !with_noise, "{text}");
        assert!(!text.contains("NaN"), "{text}");
        let json = done(folder, "fit poses --json - -o cal.toml");
        let json: serde_json::Value = serde_json::from_str(&json).unwrap();
        assert_eq!(json["means"], true);
        assert_eq!(json["dwells"][3]["label"], "p3");
        let parameters = json["sensors"]["accel"]["parameters"].as_array().unwrap();
        let value = |name: &str, axis: &str| {
            let is = |p: &&serde_json::Value| p["name"] == format!("{name}_{axis}");
            parameters.iter().find(is).unwrap()["value"]
                .as_f64()
                .unwrap()
        };
        assert!((value("scale", "y") / 800.0 - 1.0).abs() < 2e-4);
        assert!((value("bias", "x") - 50.0).abs() < 1.0);
        // Other poses of a unit whose x has since shifted by 8 counts: 10 mm/s² along x, and 1/√3 of that on the corners.
        let corner = |signs: [f64; 3]| {
            let raw = signs.map(|s| s * 800.0 * 9.81 / 3_f64.sqrt());
            format!("{:.3},{:.3},{:.3}\n", raw[0] + 58.0, raw[1], raw[2])
        };
        let mut corners = String::from("accel_x,accel_y,accel_z\n");
        for code in 0..8 {
            corners += &corner([1, 2, 4].map(|bit| if code & bit == 0 { 1.0 } else { -1.0 }));
        }
        std::fs::write(folder.join("corners.csv"), corners).unwrap();
        done(
            folder,
            "import corners.csv --means --raw-unit count --reference gravity --gravity 9.81 --replace -o corners",
        );
        let json = done(folder, "verify corners --calibration cal.toml --json -");
        let json: serde_json::Value = serde_json::from_str(&json).unwrap();
        let rms = json["sensors"]["accel"]["rms"].as_f64().unwrap();
        let expected = 8.0 / 800.0 / 3_f64.sqrt();
        assert!(
            (rms / expected - 1.0).abs() < 0.2,
            "{rms} and not {expected}"
        );
        for command in [
            "diagnose poses",
            "allan poses",
            "apply poses --calibration cal.toml -o out",
        ] {
            let error = refused(folder, command);
            assert!(
                error.contains("poses: it contains means of poses"),
                "{command}: {error}"
            );
        }
    }
}

/// Numbers from -0.5 to 0.5, uniformly distributed.
fn noise() -> impl FnMut() -> f64 {
    let mut uniform = congruential(5);
    move || uniform() - 0.5
}

/// A gyro that rests for 20 s before each of three turns of 360 degrees, with a different bias each time.
#[test]
fn rests_between_turns_of_known_angle_show_the_noise_and_are_no_outliers() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let (mut noise, mut log) = (noise(), String::from("step,x,y,z\n"));
    for axis in 0..3 {
        let bias = [0.03, -0.05, 0.11][axis];
        for (rows, rate) in [(2000, 0.0), (500, 72.0)] {
            let step = 2 * axis + usize::from(rate != 0.0);
            for _ in 0..rows {
                // Uniform from -0.5 to 0.5: a standard deviation of 0.289 deg/s.
                let mut read = [0; 3].map(|_| bias + noise());
                read[axis] += 1.01 * rate;
                writeln!(log, "{step},{:.5},{:.5},{:.5}", read[0], read[1], read[2]).unwrap();
            }
        }
    }
    std::fs::write(folder.join("log.csv"), log).unwrap();
    std::fs::write(
        folder.join("inputs.csv"),
        "step,turn_x_deg,turn_y_deg,turn_z_deg\n0,0,0,0\n1,360,0,0\n2,0,0,0\n3,0,360,0\n4,0,0,0\n5,0,0,360\n",
    )
    .unwrap();
    done(
        folder,
        "import log.csv --columns step,gyro_x,gyro_y,gyro_z --scale gyro=0.01745329252 --rate-hz 100 --raw-unit SI --reference table --inputs inputs.csv --gravity 9.81 -o turns",
    );
    let json = done(folder, "fit turns --json -");
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let floor = json["sensors"]["gyro"]["noise_floor"].as_f64();
    let floor = floor.expect("rests of 20 s show the noise").to_degrees();
    // Means of 2000 and of 500 samples, equally often.
    let expected = 0.289 * (0.5 * (1.0 / 2000.0 + 1.0 / 500.0_f64)).sqrt();
    assert!(
        (floor / expected - 1.0).abs() < 0.2,
        "{floor} and not {expected}"
    );
    let text = done(folder, "fit turns --verbose");
    // The three turns are fitted exactly, and the rests differ by their biases: neither is an outlier.
    assert!(!text.contains("times the median"), "{text}");
    assert!(text.contains("the residual exceeds the noise"), "{text}");
}
