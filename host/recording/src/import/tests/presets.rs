//! Layouts of well-known makers. The files are written here, with made-up numbers, in the layout that the sources cited in `preset/table.rs`
//! describe.

use super::*;

/// `n` lines; `line` makes each from its number.
fn rows(n: u32, line: impl Fn(u32) -> String) -> String {
    (0..n).map(|i| line(i) + "\n").collect()
}

impl Bench {
    fn preset(&self, named: Option<&str>, files: &[&str]) -> Result<Option<Chosen>> {
        let files: Vec<PathBuf> = files.iter().map(|name| self.path(name)).collect();
        let named = named.map(|name| name.parse().unwrap());
        Preset::choose(named, &files, None)
    }

    /// Imports `files`, in SI or in the unit of the preset.
    fn import_with(
        &self,
        named: Option<&str>,
        files: &[&str],
    ) -> Result<(ImportSummary, Batch, Manifest)> {
        let chosen = self.preset(named, files)?.expect("no preset");
        let mut options = self.options(files, &[]);
        options.raw_unit = chosen.raw_unit.unwrap_or(RawUnit::Count);
        self.import(&options.with_preset(chosen))
    }
}

/// Six different readings.
const READINGS: [f64; 6] = [0.125, -0.25, 0.375, 1.5, -2.5, 9.75];

/// Checks that the first row reads `READINGS` in SI, at `rate_hz`, by the preset `name`.
fn right(outcome: Result<(ImportSummary, Batch, Manifest)>, name: &str, rate_hz: f64) {
    let (summary, batch, manifest) = outcome.unwrap();
    assert_eq!(summary.preset.as_ref().unwrap().name, name);
    for (c, reading) in READINGS.into_iter().enumerate() {
        let error = (batch.raw[c][0] - reading).abs();
        assert!(error < 1e-12, "{name}: channel {c} {}", batch.raw[c][0]);
    }
    assert!((summary.sample_rate_hz / rate_hz - 1.0).abs() < 1e-6);
    assert_eq!(manifest.raw_unit, RawUnit::Si);
    assert!(manifest.imported_with.contains(&"--preset".to_owned()));
}

fn euroc() -> String {
    String::from(
        "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\r\n",
    ) + &rows(20, |i| {
        format!(
            "{},0.125,-0.25,0.375,1.5,-2.5,9.75",
            1_600_000_000_000_000_000_u64 + 5_000_000 * u64::from(i)
        )
    })
}

#[test]
fn a_euroc_file_is_recognised_alone_and_in_its_folder() {
    let bench = Bench::new(&[]);
    std::fs::create_dir_all(bench.path("mav0/imu0")).unwrap();
    std::fs::write(bench.path("mav0/imu0/data.csv"), euroc()).unwrap();
    let outcome = bench.import_with(None, &["mav0/imu0/data.csv"]);
    assert!(
        outcome
            .as_ref()
            .unwrap()
            .0
            .preset
            .as_ref()
            .unwrap()
            .recognised
    );
    right(outcome, "euroc", 200.0);
    for folder in [".", "mav0", "mav0/imu0"] {
        right(bench.import_with(Some("euroc"), &[folder]), "euroc", 200.0);
        right(bench.import_with(None, &[folder]), "euroc", 200.0);
    }
}

/// The three axes as Sensor Logger orders them, at 100 Hz from an epoch.
fn logged(x: f64, y: f64, z: f64) -> String {
    String::from("time,seconds_elapsed,z,y,x\n")
        + &rows(20, |i| {
            let ns = 1_700_000_000_000_000_000_u64 + 10_000_000 * u64::from(i);
            format!("{ns},{},{z},{y},{x}", 0.01 * f64::from(i) - 0.03)
        })
}

#[test]
fn sensor_logger_goes_by_the_names_of_its_columns_and_by_the_convention_of_the_phone() {
    let (g, gyro) = (9.80665, logged(0.125, -0.25, 0.375));
    let android = Bench::new(&[
        ("Gyroscope.csv", &gyro),
        ("TotalAcceleration.csv", &logged(1.5, -2.5, 9.75)),
        ("Accelerometer.csv", &logged(0.0, 0.0, 0.0)),
    ]);
    let files = ["Gyroscope.csv", "TotalAcceleration.csv"];
    right(android.import_with(None, &files), "sensor-logger", 100.0);
    right(android.import_with(None, &["."]), "sensor-logger", 100.0);
    let useless = android.preset(None, &["Gyroscope.csv", "Accelerometer.csv"]);
    let error = useless.unwrap_err().to_string();
    assert!(
        error.contains("Accelerometer.csv: it contains the acceleration without gravity"),
        "{error}"
    );

    // In g, and with the opposite sign.
    let ios = Bench::new(&[
        ("GyroscopeUncalibrated.csv", &gyro),
        (
            "AccelerometerUncalibrated.csv",
            &logged(-1.5 / g, 2.5 / g, -9.75 / g),
        ),
    ]);
    let files = ["GyroscopeUncalibrated.csv", "AccelerometerUncalibrated.csv"];
    let error = ios.preset(None, &files).unwrap_err().to_string();
    says(&error, &["sensor-logger and of sensor-logger-ios"]);
    right(
        ios.import_with(Some("sensor-logger-ios"), &files),
        "sensor-logger-ios",
        100.0,
    );
    let metadata = |standardised: bool| {
        let text = format!(
            "version,device name,platform,standardisation\n3,\"a, phone\",ios,{standardised}\n"
        );
        std::fs::write(ios.path("Metadata.csv"), text).unwrap();
    };
    metadata(false);
    right(ios.import_with(None, &["."]), "sensor-logger-ios", 100.0);
    let chosen = ios.preset(Some("sensor-logger"), &files).unwrap().unwrap();
    assert!(
        chosen.warnings[0].contains("Metadata.csv"),
        "{:?}",
        chosen.warnings
    );
    metadata(true);
    let chosen = ios.preset(None, &files).unwrap().unwrap();
    assert_eq!(chosen.used.name, "sensor-logger");
}

/// Export of phyphox, of a quantity and its unit, with a separator and a decimal point.
fn exported(quantity: &str, unit: &str, xyz: [f64; 3], separator: char, point: char) -> String {
    let header = ["x", "y", "z"].map(|axis| format!("{separator}\"{quantity} {axis} ({unit})\""));
    let header = format!(
        "\"Time (s)\"{}{separator}\"Absolute ({unit})\"\n",
        header.concat()
    );
    let number = |x: f64| format!("{x:.9E}").replace('.', &point.to_string());
    header
        + &rows(20, |i| {
            let cells = [0.02 * f64::from(i), xyz[0], xyz[1], xyz[2], 0.0];
            cells.map(number).join(&separator.to_string())
        })
}

#[test]
fn phyphox_is_read_with_every_separator_that_it_exports() {
    for (separator, point) in [(',', '.'), ('\t', '.'), (';', '.'), ('\t', ','), (';', ',')] {
        let file = |quantity, unit, xyz| exported(quantity, unit, xyz, separator, point);
        let bench = Bench::new(&[
            (
                "Accelerometer.csv",
                &file("Acceleration", "m/s^2", [1.5, -2.5, 9.75]),
            ),
            (
                "Gyroscope.csv",
                &file("Gyroscope", "rad/s", [0.125, -0.25, 0.375]),
            ),
            (
                "Raw Data.csv",
                &file("Linear Acceleration", "m/s^2", [0.0; 3]),
            ),
            ("other.csv", &file("Pressure", "hPa", [0.0; 3])),
        ]);
        right(bench.import_with(None, &["."]), "phyphox", 50.0);
        let field = file("Magnetic field", "µT", [20.5, -1.25, 40.0]);
        std::fs::write(bench.path("Magnetometer.csv"), field).unwrap();
        let (summary, batch, _) = bench.import_with(None, &["."]).unwrap();
        assert_eq!(summary.triads.last(), Some(&crate::TriadName::MAG));
        let y = batch.values(crate::Column::of(crate::TriadName::MAG, 1));
        assert!(y.unwrap().iter().all(|y| *y == -1.25));
        let files = ["Accelerometer.csv", "Gyroscope.csv"];
        right(bench.import_with(Some("phyphox"), &files), "phyphox", 50.0);
        let error = bench
            .preset(None, &["Raw Data.csv"])
            .unwrap_err()
            .to_string();
        assert!(error.contains("without gravity"), "{error}");
        let error = bench.preset(Some("phyphox"), &["other.csv"]);
        let error = error.unwrap_err().to_string();
        assert!(
            error.contains("its header lacks Acceleration x (m/s^2)"),
            "{error}"
        );
        assert!(bench.preset(None, &["other.csv"]).unwrap().is_none());
    }
}

/// Export of MT Manager, with the time of each row as `time` writes it.
fn xsens(above: &str, names: &str, time: impl Fn(u32) -> String) -> String {
    format!(
        "{above}PacketCounter\tSampleTimeFine\tAcc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z{names}\n"
    ) + &rows(12, |i| {
        let more = if names.is_empty() { "" } else { "\t24.5" };
        format!("{}\t1.5\t-2.5\t9.75\t0.125\t-0.25\t0.375{more}", time(i))
    })
}

const MT_MANAGER: &str = "// General information:\n//  MT Manager version: 2022.2.0\n// Device settings:\n//  Update Rate: 400.0Hz\n";

#[test]
fn xsens_goes_by_its_clock_or_where_that_is_empty_by_its_counter_and_the_rate_above() {
    let clock = xsens(MT_MANAGER, "\tTemperature", |i| {
        format!("{i}\t{}", 40_000 + 25 * i)
    });
    // The counter of a wireless unit wraps at 65535, and one packet is lost.
    let counted = xsens(MT_MANAGER, "", |i| {
        format!("{}\t", (65_530 + i + u32::from(i > 8)) % 65_536)
    });
    let bare = xsens("", "", |i| format!("{i}\t{}", 2500 * i));
    let bench = Bench::new(&[
        ("clock.txt", &clock),
        ("counted.txt", &counted),
        ("bare.txt", &bare),
    ]);
    right(bench.import_with(None, &["clock.txt"]), "xsens", 400.0);
    let (_, batch, _) = bench.import_with(None, &["clock.txt"]).unwrap();
    assert_eq!(batch.temp_c, [24.5; 12]);
    right(bench.import_with(None, &["counted.txt"]), "xsens", 400.0);
    let (summary, batch, _) = bench.import_with(None, &["counted.txt"]).unwrap();
    assert!((batch.t_s[11] - batch.t_s[0] - 12.0 / 400.0).abs() < 1e-9);
    assert!(
        summary
            .warnings
            .iter()
            .any(|w| w.contains("wrapped to 0 once"))
    );
    // Xsens DOT has the same names, but degrees and microseconds.
    assert!(bench.preset(None, &["bare.txt"]).unwrap().is_none());
    let error = bench
        .preset(Some("xsens"), &["bare.txt"])
        .unwrap_err()
        .to_string();
    says(&error, &["\"Update Rate:\" with the sample rate"]);
}

#[test]
fn what_is_given_by_hand_goes_before_a_preset() {
    let bench = Bench::new(&[("data.csv", &euroc())]);
    let chosen = bench.preset(None, &["data.csv"]).unwrap().unwrap();
    let mut options = bench.options(
        &["data.csv"],
        &["t_s,gyro_z,gyro_y,gyro_x,accel_x,accel_y,accel_z"],
    );
    options.log.scale = vec!["accel_x=2".parse().unwrap(), "t_s=2e-9".parse().unwrap()];
    let (summary, batch, manifest) = bench.import(&options.with_preset(chosen)).unwrap();
    assert_eq!(batch.raw[2][0], 0.125);
    assert_eq!(batch.raw[3][0], 3.0);
    assert_eq!(summary.sample_rate_hz, 100.0);
    assert_eq!(manifest.raw_unit, RawUnit::Count);

    let scales =
        |list: &[&str]| -> Vec<Scale> { list.iter().map(|s| s.parse().unwrap()).collect() };
    let left = Scale::beside(
        &scales(&["accel=-9.80665", "t_s=1e-9"]),
        &scales(&["accel_y=1"]),
    );
    assert_eq!(
        left,
        scales(&["accel_x=-9.80665", "accel_z=-9.80665", "t_s=1e-9"])
    );
}

#[test]
fn every_preset_stands_in_the_documentation_and_its_lists_and_factors_are_those_of_the_command_line()
 {
    let page = include_str!("../../../../../docs/import.md");
    for preset in Preset::all() {
        assert!(
            page.contains(&format!("| `{}` |", preset.name)),
            "{}",
            preset.name
        );
        let bench = Bench::new(&[("nothing.csv", "1,2\n")]);
        let error = bench
            .preset(Some(preset.name), &["nothing.csv"])
            .unwrap_err();
        assert!(error.to_string().contains("nothing.csv: "), "{error}");
    }
    assert!(
        "kitti"
            .parse::<Preset>()
            .unwrap_err()
            .to_string()
            .contains("euroc")
    );
}
