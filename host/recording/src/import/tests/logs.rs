//! Logs of autopilots as recordings.

use super::*;

fn log(name: &str, bytes: &[u8]) -> (Bench, ImportOptions) {
    let bench = Bench::new(&[]);
    std::fs::write(bench.path(name), bytes).unwrap();
    let mut options = bench.options(&[name], &[]);
    options.raw_unit = RawUnit::Si;
    (bench, options)
}

/// See the tests of ArduPilot's logs: sensor 1 has gyro and accelerometer at 800 Hz, the latter 0.4 ms later; it reads (r / 4, 2, -8) m/s² and
/// (0.5, -r / 8, 1) rad/s in rows r of 2.5 ms.
const ARDUPILOT: &[u8] = include_bytes!("../ardupilot/fixtures/two-sensors.bin");

#[test]
fn the_two_sensors_of_a_log_are_joined_on_the_times_of_one() {
    let (bench, mut options) = log("flight.bin", ARDUPILOT);
    options.log.instance = Some(Instance::Number(1));
    let (summary, batch, manifest) = bench.import(&options).unwrap();
    assert_eq!((summary.sample_rate_hz, summary.time.len()), (800.0, 2));
    // Its times are TimeUS and SampleUS.
    assert!(
        summary
            .time
            .iter()
            .all(|time| time.unit == Some(Decimal::Microsecond))
    );
    assert_eq!(summary.rows, 47);
    assert!(batch.raw[0].iter().all(|x| (x - 0.5).abs() < 1e-6));
    assert!(batch.raw[4].iter().all(|y| (y - 2.0).abs() < 1e-6));
    // The first gyro sample is before the accelerometer's first. The gyro's first sample of r = 10 is 0.85 ms after the accelerometer's last of r =
    // 9: 0.68 of the interval of 1.25 ms.
    assert_eq!((summary.dropped_outside, summary.interpolated), (1, 47));
    let [gyro, accel] = [batch.raw[1][19] * -8.0, batch.raw[3][19] * 4.0];
    assert!(
        (gyro - 10.0).abs() < 1e-5 && (accel - 9.68).abs() < 1e-5,
        "{gyro} {accel}"
    );
    assert!(
        summary.notes[0].starts_with("flight.bin: 48 messages ") && summary.notes.len() == 2,
        "{:?}",
        summary.notes
    );
    let with = manifest.imported_with.join(" ");
    assert!(with.contains("--instance 1"), "{with}");
    options.log.instance = None;
    let error = bench.refused(&options);
    says(&error, &["IMU instance 0", "IMU instance 1"]);
}

#[test]
fn what_does_not_go_with_a_log_is_refused() {
    let (bench, mut options) = log("flight.bin", ARDUPILOT);
    options.log.instance = Some(Instance::Number(0));
    options.log.filters = vec!["channel=3".parse().unwrap()];
    says(
        &bench.refused(&options),
        &["messages of a log have no columns"],
    );
    options.log.filters.clear();
    options.log.columns = vec!["t_s,accel_x,accel_y,accel_z".parse().unwrap()];
    says(
        &bench.refused(&options),
        &["list of columns is given, but the messages of a log"],
    );
    let (bench, options) = log("flight.ulg", ARDUPILOT);
    assert!(bench.refused(&options).contains("not a ULog"));
}

#[test]
fn a_real_log_of_px4_is_a_recording() {
    let beside = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data"));
    let all = std::env::var_os("MIMU_DATA").map_or(beside, PathBuf::from);
    let path = all.join("px4_ulog/sample_px4_events.ulg");
    let Ok(bytes) = std::fs::read(path) else {
        println!("skipped: no recordings (set MIMU_DATA)");
        return;
    };
    let (bench, options) = log("flight.ulg", &bytes);
    let (summary, batch, _) = bench.import(&options).unwrap();
    // By pyulog: 7783 samples, 4 ms apart throughout, from 1710773350.354 s on.
    assert_eq!((summary.rows, summary.sample_rate_hz), (7783, 250.0));
    assert!((batch.t_s[7782] - batch.t_s[0] - 31.128).abs() < 1e-9);
    let time = &summary.time[0];
    assert_eq!((time.gaps, time.unit), (0, Some(Decimal::Microsecond)));
    // The last sample (-0.0232, 0.0091, -9.8122) m/s² with the calibration undone: no mounting, factors of 1, offsets (-0.0390, 0.0257, 0.0032) m/s².
    let last = [3, 4, 5].map(|c| batch.raw[c][7782]);
    let raw = [-0.062_249_2, 0.034_716_1, -9.809_044_8];
    assert!(
        last.iter().zip(raw).all(|(a, b)| (a - b).abs() < 1e-6),
        "{last:?}"
    );
}
