//! Logs of PX4. The expected values of real logs come from pyulog 1.3.0 and NumPy; the logs made here are written byte by byte from the description
//! of the format (docs.px4.io, "ULog File Format").

use std::path::PathBuf;

use super::super::instance::Instance;
use super::super::table::Cells;
use super::super::time::Stamp;
use super::*;
use crate::tests::says;

/// A log of PX4's makers, below `$MIMU_DATA` or beside the repository.
fn real(name: &str) -> Option<PathBuf> {
    let beside = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data"));
    let all = std::env::var_os("MIMU_DATA").map_or(beside, PathBuf::from);
    let path = all.join("px4_ulog").join(name);
    if !path.exists() {
        println!("skipped: no recordings (set MIMU_DATA)");
        return None;
    }
    Some(path)
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

/// Stamps, ns, and values of all rows.
fn rows(readings: &mut Readings) -> Vec<(Stamp, Vec<f64>)> {
    let mut cells = Cells::default();
    let mut rows = Vec::new();
    while readings.next(&mut cells).is_some() {
        rows.push((cells.stamp, cells.numbers[1..].to_vec()));
    }
    rows
}

fn close(found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len(), "{found:?}");
    let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs());
    assert!(
        off.fold(0.0, f64::max) <= tolerance,
        "{found:?} {expected:?}"
    );
}

#[test]
fn the_raw_topics_of_an_instance_are_what_pyulog_reads() {
    let Some(path) = real("sample_log_small.ulg") else {
        return;
    };
    let mut all = open(&path, None, Some(1)).unwrap();
    assert_eq!(
        all.iter().filter(|readings| !readings.is_further()).count(),
        2
    );
    let stamps_us = [
        21_310_770, 22_310_821, 23_313_270, 24_313_324, 25_310_770, 26_310_770,
    ];
    let gyro = rows(&mut all[0]);
    let stamps: Vec<Stamp> = gyro.iter().map(|(stamp, _)| *stamp).collect();
    assert_eq!(stamps, stamps_us.map(|us| Stamp::from(us * 1000)));
    close(
        &gyro[0].1,
        &[0.017_656_758, -0.000_426_106, -0.006_178_534, 28.246_023],
        1e-6,
    );
    let accel = rows(&mut all[1]);
    close(&accel[0].1, &[0.356_736_06, 0.308_612_61, -9.912_714], 1e-6);
    let notes = [&all[0].notes[0], &all[1].notes[0]];
    assert!(
        notes[0].contains(
            "6 samples of sensor_gyro instance 1 (device 3670050), before PX4's calibration"
        ),
        "{notes:?}"
    );
    let warned = all[0].warnings.join(" ");
    says(&warned, &["dropouts of the logger: 1, 30 ms"]);
}

/// The unit is at rest. The board is mounted with a yaw of 180 deg and trimmed by 0.76 and -2.94 deg. The expected values are those of pyulog, with
/// `R ((raw - offset) scale)` undone in NumPy. The raw topics confirm that PX4 calibrates so: their few samples have the mean (0.678, 0.263, -9.752)
/// m/s², (-0.0431, 0.0071, 0.0326) rad/s.
#[test]
fn the_calibration_of_sensor_combined_is_undone_down_to_the_raw_topics() {
    let Some(path) = real("sample_log_small.ulg") else {
        return;
    };
    let mut all = open(&path, None, None).unwrap();
    let readings = all.remove(0);
    assert!(all.iter().all(Readings::is_further));
    assert!(
        readings.notes[0].contains("1298 samples of sensor_combined, because the topics"),
        "{:?}",
        readings.notes
    );
    assert!(
        readings.notes[1].contains("CAL_GYRO0 of device 2424842 undone"),
        "{:?}",
        readings.notes
    );
    let mut readings = readings;
    let rows = rows(&mut readings);
    assert_eq!(rows[1297].0, Stamp::from(26_822_868_000));
    close(
        &rows[0].1,
        &[
            -0.044_051_726,
            0.005_544_07,
            0.029_984_936,
            0.650_681_025,
            0.242_906_989,
            -9.746_912_853,
        ],
        1e-6,
    );
    close(
        &rows[649].1,
        &[
            -0.049_002_518,
            0.009_817_109,
            0.028_519_705,
            0.678_000_264,
            0.252_920_98,
            -9.825_154_933,
        ],
        1e-6,
    );
    let mean = |i: usize| rows.iter().map(|(_, row)| row[i]).sum::<f64>() / 1298.0;
    close(
        &[mean(0), mean(1), mean(2)],
        &[-0.0431, 0.0071, 0.0326],
        0.003,
    );
    close(&[mean(3), mean(4), mean(5)], &[0.678, 0.263, -9.752], 0.025);
}

/// A log, record by record.
struct Written(Vec<u8>);

impl Written {
    fn new() -> Written {
        let mut bytes = b"ULog\x01\x12\x35\x01".to_vec();
        bytes.extend(1_000_u64.to_le_bytes());
        Written(bytes).record(b'B', &[0; 40])
    }

    fn record(mut self, kind: u8, data: &[u8]) -> Self {
        self.0.extend((data.len() as u16).to_le_bytes());
        self.0.push(kind);
        self.0.extend_from_slice(data);
        self
    }

    fn format(self, text: &str) -> Self {
        self.record(b'F', text.as_bytes())
    }

    fn parameter(self, key: &str, value: [u8; 4]) -> Self {
        let mut data = vec![key.len() as u8];
        data.extend(key.as_bytes());
        data.extend(value);
        self.record(b'P', &data)
    }

    fn subscribe(self, instance: u8, id: u16, name: &str) -> Self {
        let mut data = vec![instance];
        data.extend(id.to_le_bytes());
        data.extend(name.as_bytes());
        self.record(b'A', &data)
    }

    fn data(self, id: u16, fields: &[&[u8]]) -> Self {
        let mut data = id.to_le_bytes().to_vec();
        fields
            .iter()
            .for_each(|field| data.extend_from_slice(field));
        self.record(b'D', &data)
    }

    fn sensor(self, id: u16, stamp_us: u64, device: u32, xyz: [f32; 3]) -> Self {
        let [x, y, z] = xyz.map(f32::to_le_bytes);
        let (time, device) = (stamp_us.to_le_bytes(), device.to_le_bytes());
        self.data(
            id,
            &[&time, &time, &device, &x, &y, &z, &25_f32.to_le_bytes()],
        )
    }

    fn save(&self, folder: &tempfile::TempDir, name: &str) -> PathBuf {
        let path = folder.path().join(name);
        std::fs::write(&path, &self.0).unwrap();
        path
    }
}

const SENSOR: &str = "uint64_t timestamp;uint64_t timestamp_sample;uint32_t device_id;float x;float y;float z;float temperature;";

/// Gyro and accelerometer of two devices, ten samples each, with a dropout.
fn two_devices() -> Written {
    let mut log = Written::new()
        .format(&format!("sensor_gyro:{SENSOR}"))
        .format(&format!("sensor_accel:{SENSOR}"))
        .format(&format!("sensor_mag:{SENSOR}"))
        .subscribe(0, 0, "sensor_gyro")
        .subscribe(0, 1, "sensor_accel")
        .subscribe(2, 2, "sensor_accel");
    for i in 0..10_u16 {
        let (stamp, x) = (5_000 + 1_000 * u64::from(i), f32::from(i));
        log = log
            .sensor(0, stamp, 0x0011_2202, [x, 0.5, -0.5])
            .sensor(1, stamp + 300, 0x0099_2202, [x, 1.0, 9.5])
            .sensor(2, stamp, 0x0099_2233, [x, 2.0, 9.5]);
    }
    log.record(b'O', &250_u16.to_le_bytes())
}

#[test]
fn an_instance_is_asked_for_where_there_are_several_and_the_instances_are_listed() {
    let folder = tempfile::tempdir().unwrap();
    let path = two_devices().save(&folder, "log.ulg");
    let refused = |topic, instance| open(&path, topic, instance).unwrap_err().to_string();
    let error = refused(None, None);
    says(&error, &["sensor_accel instance 2 (device 10035763)"]);
    let error = refused(None, Some(7));
    says(&error, &["no instance 7", "sensor_gyro instance 0"]);
    let error = refused(Some("sensor_mag"), None);
    assert!(error.contains("no sensor_mag"), "{error}");
    // An accelerometer by itself.
    let mut all = open(&path, None, Some(2)).unwrap();
    assert_eq!(all.len(), 1);
    assert_eq!(rows(&mut all[0])[9].1, [9.0, 2.0, 9.5, 25.0]);
    let mut all = open(&path, None, Some(0)).unwrap();
    assert_eq!(all.len(), 2);
    // The samples of the two are 0.3 ms apart; joining them comes later.
    assert_eq!(
        rows(&mut all[1])[3],
        (Stamp::from(8_300_000), vec![3.0, 1.0, 9.5])
    );
    assert!(
        all[0]
            .warnings
            .iter()
            .any(|w| w.contains("logger: 1, 250 ms")),
        "{:?}",
        all[0].warnings
    );
    assert!(
        !all[0]
            .warnings
            .iter()
            .any(|w| w.contains("different devices"))
    );
}

#[test]
fn all_instances_are_pairs_with_numbers_and_magnetometers_are_in_microtesla() {
    let mut log = two_devices()
        .subscribe(0, 3, "sensor_mag")
        .subscribe(1, 4, "sensor_mag");
    for i in 0..10_u16 {
        let x = f32::from(i) / 64.0;
        // Rows of the second come in pairs that are swapped.
        let late = 1_000 * u64::from(i ^ 1);
        log = log
            .sensor(
                3,
                5_000 + 1_000 * u64::from(i),
                0x0077_2244,
                [x, 0.25, -0.5],
            )
            .sensor(4, 5_100 + late, 0x0077_2255, [0.5, x, 0.0]);
    }
    let folder = tempfile::tempdir().unwrap();
    let path = log.save(&folder, "log.ulg");
    let all = read(
        &path,
        Choice {
            topics: &[],
            instance: Some(Instance::All),
        },
    );
    let mut all = all.unwrap();
    let columns: Vec<String> = all
        .iter()
        .map(|readings| {
            let names = readings.roles().into_iter().skip(1).map(|role| role.name());
            names.collect::<Vec<_>>().join(" ")
        })
        .collect();
    assert_eq!(
        columns,
        [
            "gyro_x gyro_y gyro_z temp_c",
            "accel_x accel_y accel_z",
            "accel2_x accel2_y accel2_z",
            "mag_x mag_y mag_z",
            "mag2_x mag2_y mag2_z",
        ]
    );
    assert_eq!(rows(&mut all[3])[4].1, [6.25, 25.0, -50.0]);
    let second = rows(&mut all[4]);
    assert_eq!(
        second[4],
        (Stamp::from(9_100_000), vec![50.0, 500.0 / 64.0, 0.0])
    );
    assert!(second.is_sorted_by_key(|(stamp, _)| stamp.value));
    says(
        &all[4].notes[0],
        &["10 samples of sensor_mag instance 1 (device 7807573)"],
    );
    // Without a choice too, a magnetometer is never the question.
    let chosen = open(&path, None, Some(0)).unwrap();
    assert_eq!(chosen.len(), 4);
}

#[test]
fn the_calibrated_magnetometer_of_the_default_profile_is_read_in_place_of_a_sparse_one() {
    let field = "uint64_t timestamp;uint64_t timestamp_sample;uint32_t device_id;float[3] magnetometer_ga;uint8_t calibration_count;";
    let mut log = Written::new()
        .format(&format!("sensor_gyro:{SENSOR}"))
        .format(&format!("sensor_mag:{SENSOR}"))
        .format(&format!("vehicle_magnetometer:{field}"))
        .subscribe(0, 0, "sensor_gyro")
        .subscribe(0, 1, "sensor_mag")
        .subscribe(0, 2, "vehicle_magnetometer");
    for i in 0..20_u64 {
        let stamp = 5_000 + 200_000 * i;
        log = log.sensor(0, stamp, 77, [1.0, 2.0, 3.0]);
        if i.is_multiple_of(5) {
            log = log.sensor(1, stamp, 78, [0.5, 0.5, 0.5]);
        }
        let [time, sampled] = [stamp + 900, stamp].map(u64::to_le_bytes);
        let [x, y, z] = [0.25_f32, -0.125, i as f32 / 64.0].map(f32::to_le_bytes);
        log = log.data(
            2,
            &[&time, &sampled, &78_u32.to_le_bytes(), &x, &y, &z, &[0]],
        );
    }
    let folder = tempfile::tempdir().unwrap();
    let mut all = open(&log.save(&folder, "log.ulg"), None, None).unwrap();
    assert_eq!((all.len(), all[1].len()), (2, 20));
    says(
        &all[1].notes[0],
        &["vehicle_magnetometer instance 0 (device 78), after PX4's"],
    );
    let read = rows(&mut all[1]);
    assert_eq!(
        read[8],
        (Stamp::from(1_605_000_000), vec![25.0, -12.5, 12.5])
    );
}

#[test]
fn a_topic_that_an_old_version_calibrated_and_nothing_undoes_is_warned_of() {
    // Before PX4 1.11, `sensor_accel` was calibrated and had no time of the sample.
    let old = SENSOR.replace("uint64_t timestamp_sample;", "");
    let mut log = Written::new()
        .format(&format!("sensor_accel:{old}"))
        .subscribe(0, 1, "sensor_accel");
    for i in 0..10_u64 {
        let [time, device] = [(5_000 + 1_000 * i), 77].map(u64::to_le_bytes);
        let [x, y, z, temperature] = [0.25_f32, 1.0, 9.5, 25.0].map(f32::to_le_bytes);
        log = log.data(1, &[&time, &device[..4], &x, &y, &z, &temperature]);
    }
    let folder = tempfile::tempdir().unwrap();
    let mut readings = open(&log.save(&folder, "old.ulg"), None, None)
        .unwrap()
        .remove(0);
    let warned = readings.warnings.join(" ");
    says(
        &warned,
        &[
            "sensor_accel instance 0: ",
            "PX4's calibration is not undone",
        ],
    );
    let note = readings.notes.join(" ");
    assert!(note.contains("after PX4's calibration"), "{note}");
    assert_eq!(rows(&mut readings)[9].1[..3], [0.25, 1.0, 9.5]);
}

#[test]
fn a_batch_of_the_sensors_buffer_ends_at_the_time_of_its_message() {
    let axes = ["x", "y", "z"]
        .map(|axis| format!("int16_t[32] {axis};"))
        .concat();
    let format = format!(
        "sensor_gyro_fifo:uint64_t timestamp;uint64_t timestamp_sample;uint32_t device_id;float dt;float scale;uint8_t samples;{axes}"
    );
    let mut log = Written::new()
        .format(&format)
        .subscribe(0, 5, "sensor_gyro_fifo");
    for batch in 0..4_i16 {
        let stamp = (10_000 + 1_000 * batch as u64).to_le_bytes();
        let axis = |k: i16| -> Vec<u8> {
            (0..32)
                .flat_map(|i| (k * (4 * batch + i)).to_le_bytes())
                .collect()
        };
        let fields: [&[u8]; 9] = [
            &stamp,
            &stamp,
            &7_u32.to_le_bytes(),
            &250_f32.to_le_bytes(),
            &0.5_f32.to_le_bytes(),
            &[4],
            &axis(1),
            &axis(-2),
            &axis(3),
        ];
        log = log.data(5, &fields);
    }
    let folder = tempfile::tempdir().unwrap();
    let rows = rows(&mut open(&log.save(&folder, "fifo.ulg"), None, None).unwrap()[0]);
    assert_eq!(rows.len(), 16);
    for (i, (stamp, values)) in (0..).zip(&rows) {
        assert_eq!(*stamp, Stamp::from(9_250_000 + 250_000 * i));
        let count = 0.5 * i as f64;
        assert_eq!(values[..], [count, -2.0 * count, 3.0 * count]);
    }
}

/// `sensor_combined` of a unit whose calibration changes in the middle, as when it is calibrated while the log runs.
#[test]
fn each_sample_is_undone_by_the_calibration_of_its_time() {
    let float = |value: f32| value.to_le_bytes();
    let mut log = Written::new()
        .format("sensor_combined:uint64_t timestamp;float[3] gyro_rad;float[3] accelerometer_m_s2;")
        .format(
            "sensor_selection:uint64_t timestamp;uint32_t accel_device_id;uint32_t gyro_device_id;",
        )
        .parameter("int32_t CAL_ACC1_ID", 77_i32.to_le_bytes())
        .parameter("float CAL_ACC1_XOFF", float(0.5))
        .parameter("float CAL_ACC1_XSCALE", float(2.0))
        .parameter("int32_t CAL_GYRO0_ID", 77_i32.to_le_bytes())
        .parameter("float CAL_GYRO0_ZOFF", float(0.25))
        .subscribe(0, 0, "sensor_combined")
        .subscribe(0, 1, "sensor_selection");
    let sample = |log: Written, i: u64| {
        let ones = 1_f32.to_le_bytes();
        log.data(
            0,
            &[
                &(4_000 * i).to_le_bytes(),
                &ones,
                &ones,
                &ones,
                &ones,
                &ones,
                &ones,
            ],
        )
    };
    for i in 0..3 {
        log = sample(log, i);
    }
    let device = 77_u32.to_le_bytes();
    log = log
        .data(1, &[&0_u64.to_le_bytes(), &device, &device])
        .parameter("float CAL_ACC1_XOFF", float(0.75));
    for i in 3..6 {
        log = sample(log, i);
    }
    let folder = tempfile::tempdir().unwrap();
    let mut readings = open(&log.save(&folder, "log.ulg"), None, None)
        .unwrap()
        .remove(0);
    let warned = readings.warnings.join(" ");
    says(
        &warned,
        &["accel: the sensor in use or its calibration changes 1 times"],
    );
    let rows = rows(&mut readings);
    assert_eq!(rows[2].1, [1.0, 1.0, 1.25, 1.0, 1.0, 1.0]);
    assert_eq!(rows[3].1, [1.0, 1.0, 1.25, 1.25, 1.0, 1.0]);
    // An unknown mounting, as of a later version, is not guessed.
    let log = Written(log.0).parameter("int32_t SENS_BOARD_ROT", 99_i32.to_le_bytes());
    let readings = open(&sample(log, 6).save(&folder, "b.ulg"), None, None).unwrap();
    let warned = readings[0].warnings.join(" ");
    says(
        &warned,
        &["SENS_BOARD_ROT", "PX4's calibration is not undone"],
    );
}

#[test]
fn a_cut_or_damaged_log_is_read_up_to_there_or_refused_and_does_not_panic() {
    let folder = tempfile::tempdir().unwrap();
    let whole = two_devices().0;
    for end in (0..whole.len()).step_by(3) {
        let path = Written(whole[..end].to_vec()).save(&folder, "cut.ulg");
        match open(&path, None, Some(0)) {
            Ok(all) => assert!(all[0].len() <= 10),
            Err(error) => assert!(error.to_string().contains("cut.ulg"), "{error}"),
        }
    }
    let path = Written(whole[..whole.len() - 50].to_vec()).save(&folder, "cut.ulg");
    let all = open(&path, None, Some(0)).unwrap();
    assert!(
        all[0].warnings.iter().any(|w| w.contains("cut within")),
        "{:?}",
        all[0].warnings
    );
    for at in (0..whole.len()).step_by(3) {
        let mut damaged = whole.clone();
        damaged[at] ^= 0x55;
        let _ = open(
            &Written(damaged).save(&folder, "damaged.ulg"),
            None,
            Some(0),
        );
    }
    for other in [&b"ms,x,y,z\n1,2,3,4\n"[..], b"", b"ULog"] {
        let error = open(&Written(other.to_vec()).save(&folder, "no.ulg"), None, None).unwrap_err();
        assert!(error.to_string().contains("not a ULog"), "{error}");
    }
    let empty = Written::new()
        .format("battery:uint64_t timestamp;")
        .save(&folder, "empty.ulg");
    let error = open(&empty, None, None).unwrap_err().to_string();
    assert!(error.contains("no messages of inertial sensors"), "{error}");
}
