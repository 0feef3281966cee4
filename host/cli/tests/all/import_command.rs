//! `mimu import` of files from makers and users: their layouts, and tables of means.

use std::fmt::Write as _;

use crate::random::congruential;

use super::command::{done, refused};

#[test]
fn a_preset_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut phyphox = String::from(
        "\"Time (s)\"\t\"Acceleration x (m/s^2)\"\t\"Acceleration y (m/s^2)\"\t\"Acceleration z (m/s^2)\"\n",
    );
    for i in 0..20 {
        let t = 0.01 * f64::from(i);
        writeln!(phyphox, "{t:.3}\t0.1\t0.2\t9.8").unwrap();
    }
    std::fs::write(folder.join("Raw Data.csv"), phyphox).unwrap();
    let gravity = "--reference gravity --gravity 9.81 -o";
    let text = done(folder, &format!("import . {gravity} recording"));
    assert!(
        text.contains("preset phyphox, recognised by the header"),
        "{text}"
    );
    let json = done(folder, &format!("import . --json - {gravity} again"));
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["preset"]["name"], "phyphox");
    assert_eq!(json["preset"]["recognised"], true);
}

#[test]
fn the_triads_of_a_file_are_named_beside_the_pair() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut log = String::from(
        "time (ms),ax1,ay1,az1,gx1,gy1,gz1,ax2,ay2,az2,gx2,gy2,gz2,mx (mG),my (mG),mz (mG)\n",
    );
    let mut noise = noise();
    for i in 0..200 {
        let mut reading = |rest: f64, size: f64| format!("{:.6}", rest + size * noise());
        let [force, rate] = [[0.1, 0.2, 9.8], [0.01, -0.02, 0.0]];
        let pair = force
            .map(|f| reading(f, 0.01))
            .into_iter()
            .chain(rate.map(|w| reading(w, 1e-3)));
        let pair: Vec<String> = pair.collect();
        let field = [200.0, -10.0, 400.0].map(|f| reading(f, 1.0));
        let all = [pair.clone(), pair, field.to_vec()].concat().join(",");
        writeln!(log, "{},{all}", 10 * i).unwrap();
    }
    std::fs::write(folder.join("log.csv"), log).unwrap();
    let options = "--units m/s2,rad/s --gravity 9.81";
    let text = done(folder, &format!("import log.csv {options} -o rec"));
    assert!(
        text.contains("triads: gyro, accel, mag, gyro2, accel2"),
        "{text}"
    );
    assert!(text.contains("magnetometer in mG"), "{text}");
    let json = done(
        folder,
        &format!("import log.csv {options} --json - -o again"),
    );
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["triads"].as_array().unwrap().len(), 5);
    // A pair is fitted and surveyed as before: the others are no part of it.
    done(folder, "allan rec");
}

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

/// Readings of a unit on a face: factors 1.02, 0.98 and 1.01, biases of 0.1, -0.2 and 0.05 m/s², and `noise`.
fn face(axis: usize, sign: f64, noise: &mut impl FnMut() -> f64) -> String {
    let mut force = [0.1, -0.2, 0.05];
    force[axis] += sign * 9.81 * [1.02, 0.98, 1.01][axis];
    let mut text = String::from("t,gx,gy,gz,ax,ay,az\n");
    for i in 0..400 {
        let [x, y, z] = force.map(|f| f + 0.01 * noise());
        let rates = [0.01, -0.02, 0.005].map(|rate| rate + 0.001 * noise());
        let [gx, gy, gz] = rates;
        writeln!(
            text,
            "{:.2},{gx},{gy},{gz},{x},{y},{z}",
            0.01 * f64::from(i)
        )
        .unwrap();
    }
    text
}

#[test]
fn a_file_for_each_face_calibrates_the_accelerometer_and_says_why_there_is_no_gyro() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut noise = noise();
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        for (sign, up) in [(1.0, "up"), (-1.0, "down")] {
            let text = face(axis, sign, &mut noise);
            std::fs::write(folder.join(format!("{name}_{up}.csv")), text).unwrap();
        }
    }
    let columns = "--columns t_s=t,gyro_x=gx,gyro_y=gy,gyro_z=gz,accel_x=ax,accel_y=ay,accel_z=az --raw-unit SI --gravity 9.81";
    let faces =
        "--faces +x=x_up.csv -x=x_down.csv +y=y_up.csv -y=y_down.csv +z=z_up.csv -z=z_down.csv";
    let text = done(
        folder,
        &format!("import {faces} {columns} --reference table -o six"),
    );
    assert!(
        text.contains("does not determine its scale factors"),
        "{text}"
    );
    assert!(!text.contains("have no file"), "{text}");
    let json = done(folder, "fit six --json -");
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let sensors: Vec<&String> = json["sensors"].as_object().unwrap().keys().collect();
    assert_eq!(sensors, ["accel"]);
    let text = done(folder, "fit six");
    let factors = text
        .lines()
        .find(|line| line.contains("scale factor"))
        .unwrap();
    for (found, truth) in factors
        .split_whitespace()
        .filter(|w| w.contains('.'))
        .step_by(2)
        .zip([1.02, 0.98, 1.01])
    {
        // 400 samples of 0.01 m/s² on each face give a factor to 0.0005 / 9.81.
        assert!(
            (found.parse::<f64>().unwrap() - truth).abs() < 3e-4,
            "{factors}"
        );
    }
    assert!(
        text.contains("warning: gyro: not calibrated: no usable dwell has a known input"),
        "{text}"
    );

    let text = done(
        folder,
        &format!(
            "import --faces +x=x_up.csv -x=x_down.csv -z=z_down.csv {columns} --reference table -o three"
        ),
    );
    assert!(text.contains("the faces +y, -y, +z have no file"), "{text}");
    let text = done(
        folder,
        &format!("import {faces} {columns} --reference gravity -o by_gravity"),
    );
    assert!(text.contains("six faces do not determine"), "{text}");
    let text = done(folder, "fit by_gravity");
    assert!(text.contains("judgement: untested"), "{text}");
    assert!(
        text.contains("accel: not calibrated, because nothing here shows it: non-orthogonality"),
        "{text}"
    );
    for (faces, says) in [
        ("x_up.csv", "write it like +x=x_up.csv"),
        ("+w=x_up.csv", "is not a face"),
        ("+x= -x=x_down.csv", "+x: no file is given for this face"),
        (
            "+y=y_up.csv -y=y_up.csv",
            "it is given for the faces +y and -y",
        ),
    ] {
        let error = refused(
            folder,
            &format!("import --faces {faces} {columns} --reference table -o bad"),
        );
        assert!(error.contains(says), "{error}");
    }
}
