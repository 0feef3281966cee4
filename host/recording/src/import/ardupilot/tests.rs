//! Logs of ArduPilot. A Python program wrote `two-sensors.bin` with `struct` from the description of the format; pymavlink 2.4.50 reads it as
//! intended. It contains a board rolled over (AHRS_ORIENTATION 8) and two sensors whose known raw readings were calibrated and rotated before they
//! were written. Sensor i reads (r / 4, 1 + i, -8) m/s² and (0.5, -r / 8, i) rad/s in row r of 24, 2.5 ms apart from 10 ms on. In row 12 the offset
//! of the first gyro changes from 0.0625 to 1 rad/s.

use std::path::PathBuf;

use super::super::instance::Instance;
use super::super::table::Cells;
use super::super::time::Stamp;
use super::*;
use crate::tests::says;

fn fixture() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src/import/ardupilot/fixtures/two-sensors.bin")
}

fn open(path: &Path, topic: Option<&str>, instance: Option<u32>) -> Result<Vec<Readings>> {
    let topics: Vec<String> = topic.into_iter().map(str::to_owned).collect();
    read(
        path,
        Choice {
            topics: &topics,
            instance: instance.map(Instance::Number),
        },
    )
}

fn rows(readings: &mut Readings) -> Vec<(Stamp, Vec<f64>)> {
    let mut cells = Cells::default();
    let mut rows = Vec::new();
    while readings.next(&mut cells).is_some() {
        rows.push((cells.stamp, cells.numbers[1..].to_vec()));
    }
    rows
}

fn close(found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len(), "{found:?}");
    let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs());
    // Single precision in the file, and a factor of 2 or 1 / 0.5 to undo.
    assert!(off.fold(0.0, f64::max) < 1e-5, "{found:?} {expected:?}");
}

#[test]
fn calibration_and_mounting_are_undone_by_the_parameters_of_the_time_of_each_reading() {
    let mut all = open(&fixture(), Some("IMU"), Some(0)).unwrap();
    assert_eq!(all.len(), 1);
    let notes = &all[0].notes[0];
    says(
        notes,
        &[
            "24 messages IMU of instance 0, ArduPilot's calibration undone",
            "scale factor 1.250000 0.500000 2.000000",
        ],
    );
    let warned = all[0].warnings.join(" ");
    assert!(warned.contains("changes 1 times"), "{warned}");
    for (r, (stamp, values)) in rows(&mut all[0]).into_iter().enumerate() {
        assert_eq!(stamp, Stamp::from(10_000_000 + 2_500_000 * r as i64));
        let r = r as f64;
        close(&values, &[0.5, -r / 8.0, 0.0, r / 4.0, 1.0, -8.0, 40.5]);
    }
}

/// A log of ArduCopter 3.1 with two sensors, on a board that is rolled over: scale factors and offsets are those of the vehicle's axes.
fn before_3_3() -> Vec<u8> {
    let filled = |text: &str, length: usize| {
        let mut bytes = text.as_bytes().to_vec();
        bytes.resize(length, 0);
        bytes
    };
    let record =
        |number: u8, parts: &[&[u8]]| [&[0xA3, 0x95, number][..], &parts.concat()].concat();
    let format = |number: u8, length: u8, name: &str, kinds: &str, labels: &str| {
        record(
            128,
            &[
                &[number, length],
                &filled(name, 4),
                &filled(kinds, 16),
                &filled(labels, 64),
            ],
        )
    };
    let fields = "TimeMS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ";
    let mut log = format(64, 23, "PARM", "Nf", "Name,Value");
    log.extend(format(65, 31, "IMU", "Iffffff", fields));
    log.extend(format(66, 31, "IMU2", "Iffffff", fields));
    let mut parameter =
        |name: &str, value: f32| log.extend(record(64, &[&filled(name, 16), &value.to_le_bytes()]));
    parameter("AHRS_ORIENTATION", 8.0);
    for (number, scale) in [("", 2.0), ("2", 0.5)] {
        for axis in ["X", "Y", "Z"] {
            parameter(&format!("INS_ACC{number}SCAL_{axis}"), scale);
            parameter(&format!("INS_ACC{number}OFFS_{axis}"), 0.25);
            parameter(&format!("INS_GYR{number}OFFS_{axis}"), 0.125);
        }
    }
    for r in 0..20_u32 {
        for (number, scale) in [(65, 2.0), (66, 0.5)] {
            // Raw (0.5, r / 8, 1) rad/s and (r / 4, 1, -8) m/s²; y and z of the vehicle point against those of the board.
            let r8 = r as f32 / 8.0;
            let gyro = [0.5, -r8, -1.0].map(|rate: f32| rate - 0.125);
            let accel = [2.0 * r8, -1.0, 8.0].map(|force: f32| force * scale - 0.25);
            let values = gyro.into_iter().chain(accel).flat_map(f32::to_le_bytes);
            log.extend(record(
                number,
                &[&(1000 + 20 * r).to_le_bytes(), &values.collect::<Vec<u8>>()],
            ));
        }
    }
    log
}

#[test]
fn logs_before_3_3_count_milliseconds_and_were_calibrated_on_the_axes_of_the_vehicle() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.bin");
    std::fs::write(&path, before_3_3()).unwrap();
    for instance in [0, 1] {
        let mut all = open(&path, None, Some(instance)).unwrap();
        assert!(all[0].warnings.is_empty(), "{:?}", all[0].warnings);
        let rows = rows(&mut all[0]);
        assert_eq!((rows.len(), rows[3].0), (20, Stamp::from(1_060_000_000)));
        close(&rows[4].1, &[0.5, 0.5, 1.0, 1.0, 1.0, -8.0]);
    }
}

#[test]
fn a_sensor_with_messages_at_its_own_rate_is_read_by_them() {
    let mut all = open(&fixture(), None, Some(1)).unwrap();
    assert_eq!(all.len(), 2);
    let (gyro, accel) = (rows(&mut all[0]), rows(&mut all[1]));
    assert_eq!((gyro.len(), accel.len()), (48, 48));
    assert_eq!(
        [gyro[3].0, accel[3].0],
        [13_750_000, 14_150_000].map(Stamp::from)
    );
    close(&gyro[7].1, &[0.5, -3.0 / 8.0, 1.0]);
    close(&accel[7].1, &[0.75, 2.0, -8.0]);
    // The log contains only every second of its IMU messages.
    assert_eq!(
        rows(&mut open(&fixture(), Some("IMU"), Some(1)).unwrap()[0]).len(),
        12
    );
}

#[test]
fn a_magnetometer_is_in_microtesla_at_the_time_of_its_sample() {
    let mut log = before_3_3();
    let filled = |text: &str, length: usize| {
        let mut bytes = text.as_bytes().to_vec();
        bytes.resize(length, 0);
        bytes
    };
    log.extend([0xA3, 0x95, 128, 67, 23]);
    log.extend(filled("MAG", 4));
    log.extend(filled("QBhhhBI", 16));
    log.extend(filled("TimeUS,I,MagX,MagY,MagZ,Health,S", 64));
    for r in 0..5_u64 {
        // Logged 30 ms after the sample, by a counter of 32 bits that has wrapped.
        let logged_us = (1_u64 << 32) + 10_000 + 100_000 * r;
        log.extend([0xA3, 0x95, 67]);
        log.extend(logged_us.to_le_bytes());
        log.push(1);
        for mag in [100 + r as i16, -250, 400] {
            log.extend(mag.to_le_bytes());
        }
        log.push(1);
        log.extend(((logged_us - 30_000) as u32).to_le_bytes());
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.bin");
    std::fs::write(&path, log).unwrap();
    let mut all = open(&path, None, Some(0)).unwrap();
    assert_eq!((all.len(), all[1].roles()[1].name()), (2, "mag_x"));
    let rows = rows(&mut all[1]);
    let sampled_us = (1_i64 << 32) + 10_000 + 200_000 - 30_000;
    assert_eq!(
        (rows.len(), rows[2].0),
        (5, Stamp::from(1_000 * sampled_us))
    );
    close(&rows[2].1, &[10.2, -25.0, 40.0]);
}

/// The log without those records of kind `number`, `length` bytes long, that `keep` rejects.
fn without(number: u8, length: usize, keep: impl Fn(&[u8]) -> bool) -> Vec<u8> {
    let whole = std::fs::read(fixture()).unwrap();
    let mut left = Vec::new();
    let mut at = 0;
    while at < whole.len() {
        if whole[at..].starts_with(&[0xA3, 0x95, number]) && !keep(&whole[at..at + length]) {
            at += length;
        } else {
            left.push(whole[at]);
            at += 1;
        }
    }
    left
}

#[test]
fn of_a_log_without_its_parameters_nothing_is_undone_and_this_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.bin");
    // 3 bytes, time, name, two floats.
    std::fs::write(
        &path,
        without(64, 35, |record| !record[11..].starts_with(b"INS_ACCSCAL_Y")),
    )
    .unwrap();
    let mut all = open(&path, Some("IMU"), Some(0)).unwrap();
    assert!(
        all[0].notes[0].contains("after ArduPilot's calibration"),
        "{:?}",
        all[0].notes
    );
    assert!(
        all[0].warnings[0].contains("lacks parameters"),
        "{:?}",
        all[0].warnings
    );
    // As pymavlink reads it.
    close(
        &rows(&mut all[0])[0].1,
        &[0.4375, 0.125, -0.03125, -0.15625, -0.625, 17.0, 40.5],
    );
    // The parameters of the second sensor are complete.
    assert!(
        open(&path, Some("IMU"), Some(1)).unwrap()[0]
            .warnings
            .is_empty()
    );
}

#[test]
fn a_cut_or_damaged_log_is_read_as_far_as_it_is_whole_and_does_not_panic() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.bin");
    let whole = std::fs::read(fixture()).unwrap();
    for end in (0..whole.len()).step_by(7) {
        std::fs::write(&path, &whole[..end]).unwrap();
        match open(&path, None, Some(0)) {
            Ok(all) => assert!(all[0].len() <= 24),
            Err(error) => assert!(error.to_string().contains("log.bin"), "{error}"),
        }
    }
    for at in (0..whole.len()).step_by(7) {
        let mut damaged = whole.clone();
        damaged[at] ^= 0x55;
        std::fs::write(&path, damaged).unwrap();
        let _ = open(&path, None, Some(0));
    }
    // The middle is overwritten: the records after it are found again.
    let mut damaged = whole.clone();
    let at = whole.len() / 2;
    damaged[at..at + 60].fill(0xA3);
    std::fs::write(&path, damaged).unwrap();
    let all = open(&path, Some("IMU"), Some(1)).unwrap();
    assert!(all[0].len() >= 9, "{}", all[0].len());
    assert!(
        all[0]
            .warnings
            .iter()
            .any(|w| w.contains("do not belong to a record")),
        "{:?}",
        all[0].warnings
    );
    for other in [&b"ms,x,y\n"[..], b"", &[0; 4000]] {
        std::fs::write(&path, other).unwrap();
        let error = open(&path, None, None).unwrap_err().to_string();
        assert!(error.contains("not a DataFlash log"), "{error}");
    }
}
