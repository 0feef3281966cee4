//! Bags written by the Python package `rosbags` 0.11.9: 24 messages with header stamps 5 ms apart from 1700000000.123456789 s on, received 3 to 4.4
//! ms later; angular velocity (0.5 + i, -0.25 i, 3), linear acceleration (100 + i, 200, -9.5), frame `imu`. `imu.bag` is compressed with LZ4 and has
//! a second topic, `/imu/raw`, with two messages. Both `imu.bag` and `imu.mcap` have one more topic, of strings. `imu.db3` has the three topics of
//! `imu.bag`; its string of 9000 characters fills overflow pages.
//!
//! `halves.mcap` has the topics of a camera with separate clocks: `/gyro/sample`, 24 messages 5 ms apart with angular velocity (0.5 + i, -0.25 i, 3) and
//! a covariance of the specific force that begins with -1; `/accel/sample`, 12 messages 10 ms apart from 1 ms later on with linear acceleration (100 + i,
//! 200, -9.5) and zeros for the rest. The 12 messages of `unstamped.mcap` have headers without a stamp, and were received 5 ms apart.

use std::path::PathBuf;

use super::super::table::Cells;
use super::super::time::Stamp;
use super::*;
use crate::tests::says;

fn fixture(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/import/ros/fixtures");
    folder.join(name)
}

fn open(path: &Path, topic: Option<&str>) -> Result<Vec<Readings>> {
    let topics: Vec<String> = topic.into_iter().map(str::to_owned).collect();
    open_all(path, &topics)
}

fn open_all(path: &Path, topics: &[String]) -> Result<Vec<Readings>> {
    let choice = Choice {
        topics,
        instance: None,
    };
    match path.extension().and_then(|ending| ending.to_str()) {
        Some("bag") => read_bag(path, choice),
        Some("mcap") => read_mcap(path, choice),
        _ => read_db3(path, choice),
    }
}

fn check(name: &str, topic: Option<&str>) {
    let mut messages = open(&fixture(name), topic).unwrap().remove(0);
    let mut cells = Cells::default();
    for i in 0..24 {
        assert_eq!(messages.next(&mut cells), Some(i + 1));
        assert_eq!(
            cells.stamp,
            Stamp::from(1_700_000_000_123_456_789 + i as i64 * 5_000_000)
        );
        let i = i as f64;
        assert_eq!(
            cells.numbers[1..],
            [0.5 + i, -0.25 * i, 3.0, 100.0 + i, 200.0, -9.5]
        );
    }
    assert_eq!(messages.next(&mut cells), None);
}

#[test]
fn the_messages_of_a_bag_of_ros_1_and_of_ros_2_and_of_an_mcap_file_are_those_that_were_written() {
    check("imu.bag", Some("/imu/data"));
    check("imu.mcap", None);
    check("imu.db3", Some("/imu/data"));
}

#[test]
fn magnetometers_are_read_beside_the_topic_of_an_imu_and_zeros_are_none() {
    let message = |stamp: u32, field: [f64; 3]| {
        let header = [7, 5, stamp, 1].map(u32::to_le_bytes).concat();
        let numbers = field.into_iter().chain([0.0; 9]).flat_map(f64::to_le_bytes);
        [header, b"f".to_vec(), numbers.collect()].concat()
    };
    let kinds = ["MagneticField", "MagneticField", "MagneticField", "Imu"];
    let mut topics = Topics::new();
    for (number, name) in (0..).zip(["/mag", "/none", "/second", "/imu"]) {
        let kind = format!("sensor_msgs/{}", kinds[number as usize]);
        topics.insert(number, Topic::new(name, &kind, "ros1"));
    }
    for i in [2, 1, 3_u32] {
        let x = f64::from(i) * 1e-6;
        take(&mut topics, 0, 0, &message(i, [x, -2e-5, 4e-5]));
        take(&mut topics, 1, 0, &message(i, [0.0; 3]));
        take(&mut topics, 2, 9, &message(i, [x, 0.0, 0.0]));
    }
    take(&mut topics, 2, 9, &message(4, [0.0; 3])[..30]);
    let mut all = chosen(Path::new("b"), &topics, Choice::default()).unwrap();
    assert_eq!(all.len(), 3);
    assert_eq!(all[2].roles()[3].name(), "mag2_z");
    assert!(all[2].warnings[0].contains("1 messages of /second are cut"));
    // In order of their stamps.
    let rows = rows(&mut all[1]);
    assert_eq!(rows[0].0, Stamp::from(5_000_000_001));
    for (read, wanted) in rows[1].1.iter().zip([2.0, -20.0, 40.0]) {
        assert!((read - wanted).abs() < 1e-9, "{rows:?}");
    }
    let second = ["/second".to_owned()];
    let choice = Choice {
        topics: &second,
        instance: None,
    };
    let all = chosen(Path::new("b"), &topics, choice).unwrap();
    assert_eq!((all.len(), all[1].roles()[1].name()), (2, "mag_x"));
}

#[test]
fn all_topics_of_a_bag_are_pairs_with_numbers() {
    let choice = Choice {
        topics: &[],
        instance: Some(Instance::All),
    };
    let all = read_bag(&fixture("imu.bag"), choice).unwrap();
    let columns = |readings: &Readings| readings.roles().into_iter().map(|role| role.name());
    let columns: Vec<String> = all
        .iter()
        .map(|r| columns(r).collect::<Vec<_>>().join(" "))
        .collect();
    assert_eq!(
        columns,
        [
            "t_s gyro_x gyro_y gyro_z accel_x accel_y accel_z",
            "t_s gyro2_x gyro2_y gyro2_z accel2_x accel2_y accel2_z"
        ]
    );
}

#[test]
fn topics_are_listed_where_several_fit_or_none_does() {
    let refused = |name: &str, topic| open(&fixture(name), topic).unwrap_err().to_string();
    let several = refused("imu.bag", None);
    says(&several, &["/imu/data", "/imu/raw"]);
    assert!(!several.contains("/chatter"), "{several}");
    let none = refused("imu.mcap", Some("/chatter"));
    says(&none, &["/chatter (std_msgs/msg/String)", "/imu ("]);
}

/// Stamps and values of all rows.
fn rows(readings: &mut Readings) -> Vec<(Stamp, Vec<f64>)> {
    let mut cells = Cells::default();
    let mut rows = Vec::new();
    while readings.next(&mut cells).is_some() {
        rows.push((cells.stamp, cells.numbers[1..].to_vec()));
    }
    rows
}

#[test]
fn a_topic_of_the_gyro_and_one_of_the_accelerometer_are_read_as_two_sensors() {
    const T0: i64 = 1_700_000_000_000_000_000;
    let topics = ["/accel/sample", "/gyro/sample"].map(str::to_owned);
    for chosen in [&topics[..], &[]] {
        let mut all = open_all(&fixture("halves.mcap"), chosen).unwrap();
        let [gyro, accel] = &mut all[..] else {
            panic!("{} parts", all.len())
        };
        let (gyro, accel) = (rows(gyro), rows(accel));
        assert_eq!((gyro.len(), accel.len()), (24, 12));
        assert_eq!(
            gyro[3],
            (Stamp::from(T0 + 15_000_000), vec![3.5, -0.75, 3.0])
        );
        assert_eq!(
            accel[3],
            (Stamp::from(T0 + 31_000_000), vec![103.0, 200.0, -9.5])
        );
    }
    // One of them alone has one sensor.
    let mut alone = open(&fixture("halves.mcap"), Some("/gyro/sample")).unwrap();
    assert_eq!((alone.len(), rows(&mut alone[0])[0].1.len()), (1, 3));
    let error = open_all(
        &fixture("halves.mcap"),
        &["/gyro/sample", "/mag"].map(str::to_owned),
    );
    assert!(error.unwrap_err().to_string().contains("/mag"));
}

#[test]
fn headers_without_stamps_leave_the_times_of_reception_with_a_warning() {
    let mut all = open(&fixture("unstamped.mcap"), None).unwrap();
    assert!(all[0].warnings[0].contains("/imu"), "{:?}", all[0].warnings);
    let rows = rows(&mut all[0]);
    assert_eq!(rows[11].0, Stamp::from(1_700_000_000_055_000_000));
}

#[test]
fn a_cut_or_damaged_file_is_refused_and_does_not_panic() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["imu.bag", "imu.mcap", "imu.db3"] {
        let whole = std::fs::read(fixture(name)).unwrap();
        let path = folder.path().join(name);
        for end in (0..whole.len()).step_by((whole.len() / 120) | 1) {
            std::fs::write(&path, &whole[..end]).unwrap();
            let error = open(&path, Some("/imu")).unwrap_err().to_string();
            assert!(error.contains(name), "{error}");
        }
        for at in (0..whole.len()).step_by((whole.len() / 900) | 1) {
            let mut damaged = whole.clone();
            damaged[at] ^= 0x55;
            std::fs::write(&path, damaged).unwrap();
            let _ = open(&path, Some("/imu"));
        }
    }
}

#[test]
fn a_bag_that_was_not_closed_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("imu.db3");
    std::fs::copy(fixture("imu.db3"), &path).unwrap();
    std::fs::write(folder.path().join("imu.db3-wal"), [0; 32]).unwrap();
    let error = open(&path, Some("/imu/data")).unwrap_err().to_string();
    assert!(error.contains("-wal"), "{error}");
    let other = folder.path().join("other.db3");
    std::fs::write(&other, "a,b\n1,2\n").unwrap();
    let error = open(&other, None).unwrap_err().to_string();
    assert!(error.contains("not an SQLite file"), "{error}");
    let several = open(&fixture("imu.db3"), None).unwrap_err().to_string();
    assert!(
        several.contains("/imu/raw") && !several.contains("/chatter"),
        "{several}"
    );
}
