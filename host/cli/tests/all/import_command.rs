//! `mimu import` of what makers and people have: their layouts, and tables of means.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

fn mimu(folder: &Path, arguments: &str) -> (bool, String, String) {
    let out = Command::new(env!("CARGO_BIN_EXE_mimu"))
        .current_dir(folder)
        .args(arguments.split_whitespace())
        .output()
        .unwrap();
    let [stdout, stderr] = [out.stdout, out.stderr].map(|o| String::from_utf8(o).unwrap());
    (out.status.success(), stdout, stderr)
}

fn right(folder: &Path, arguments: &str) -> String {
    let (done, stdout, stderr) = mimu(folder, arguments);
    assert!(done, "mimu {arguments}: {stderr}");
    stdout
}

/// The one line that `arguments` are refused with.
fn refused(folder: &Path, arguments: &str) -> String {
    let (done, _, stderr) = mimu(folder, arguments);
    let last = stderr.lines().last().unwrap_or_default().to_owned();
    assert!(
        !done && last.starts_with("mimu: "),
        "mimu {arguments}: {stderr}"
    );
    last
}

#[test]
fn a_preset_is_reported_and_what_it_leaves_open_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut phyphox = String::from(
        "\"Time (s)\"\t\"Acceleration x (m/s^2)\"\t\"Acceleration y (m/s^2)\"\t\"Acceleration z (m/s^2)\"\n",
    );
    let mut plain = String::new();
    for i in 0..20 {
        let t = 0.01 * f64::from(i);
        writeln!(phyphox, "{t:.3}\t0.1\t0.2\t9.8").unwrap();
        writeln!(plain, "{t:.3} 1 2 3").unwrap();
    }
    std::fs::write(folder.join("Raw Data.csv"), phyphox).unwrap();
    std::fs::write(folder.join("acc.txt"), plain).unwrap();
    let gravity = "--reference gravity --gravity 9.81 -o";
    let text = right(folder, &format!("import . {gravity} recording"));
    assert!(
        text.contains("preset phyphox, recognised by the header"),
        "{text}"
    );
    let json = right(folder, &format!("import . --json - {gravity} again"));
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["preset"]["name"], "phyphox");
    assert_eq!(json["preset"]["recognised"], true);
    let error = refused(
        folder,
        &format!("import acc.txt --preset imu_tk {gravity} tk"),
    );
    assert!(
        error.contains("the unit of the readings is not known"),
        "{error}"
    );
    let error = refused(
        folder,
        &format!("import acc.txt --preset phyphox {gravity} tk"),
    );
    assert!(
        error.contains("Time (s)") && error.contains("(--columns)"),
        "{error}"
    );
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
        // Nothing repeats exactly.
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
fn a_table_of_means_is_fitted_and_everything_that_needs_samples_refuses_it() {
    for with_noise in [true, false] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        std::fs::write(folder.join("poses.csv"), means(with_noise)).unwrap();
        let noise = match with_noise {
            true => ",accel_x_sd=sx,accel_y_sd=sy,accel_z_sd=sz,averaged=n",
            false => "",
        };
        let list = format!("step=pose,accel_x=ax,accel_y=ay,accel_z=az{noise}");
        let text = right(
            folder,
            &format!(
                "import poses.csv --means --columns {list} --raw-unit count --reference gravity --gravity 9.81 -o poses"
            ),
        );
        assert!(text.contains("means of 12 poses"), "{text}");
        let text = right(folder, "fit poses --dwells");
        assert!(text.contains("means of 12 poses, gravity 9.81"), "{text}");
        assert_eq!(text.contains("the only noise"), !with_noise, "{text}");
        assert!(!text.contains("NaN"), "{text}");
        let json = right(folder, "fit poses --json - -o cal.toml");
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
        for command in [
            "verify poses --calibration cal.toml",
            "diagnose poses",
            "allan poses",
            "apply poses --calibration cal.toml -o out",
        ] {
            let error = refused(folder, command);
            assert!(
                error.contains("poses: it holds the means of poses"),
                "{command}: {error}"
            );
        }
    }
}
