//! Bags that the Python package `rosbags` 0.11.9 has written: 24 messages with header stamps 5 ms apart from 1700000000.123456789 s on,
//! received some 3 to 4.4 ms later; angular velocity (0.5 + i, -0.25 i, 3), linear acceleration (100 + i, 200, -9.5), frame `imu`. `imu.bag` is
//! compressed with LZ4 and has a second topic, `/imu/raw`, with two messages; both have one more, of strings.

use std::path::PathBuf;

use super::*;

fn fixture(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/import/ros/fixtures");
    folder.join(name)
}

fn check(name: &str, topic: Option<&str>) {
    let mut messages = ImuTopic::open(&fixture(name), topic).unwrap();
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
fn the_messages_of_a_bag_and_of_an_mcap_file_are_those_that_were_written() {
    check("imu.bag", Some("/imu/data"));
    check("imu.mcap", None);
}

#[test]
fn topics_are_listed_where_several_fit_or_none_does() {
    let refused = |name: &str, topic| {
        ImuTopic::open(&fixture(name), topic)
            .unwrap_err()
            .to_string()
    };
    let several = refused("imu.bag", None);
    assert!(
        several.contains("/imu/data") && several.contains("/imu/raw"),
        "{several}"
    );
    assert!(!several.contains("/chatter"), "{several}");
    let none = refused("imu.mcap", Some("/chatter"));
    assert!(
        none.contains("/chatter (std_msgs/msg/String)") && none.contains("/imu ("),
        "{none}"
    );
}

#[test]
fn a_cut_or_damaged_file_is_refused_and_does_not_panic() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["imu.bag", "imu.mcap"] {
        let whole = std::fs::read(fixture(name)).unwrap();
        let path = folder.path().join(name);
        for end in (0..whole.len()).step_by(101) {
            std::fs::write(&path, &whole[..end]).unwrap();
            let error = ImuTopic::open(&path, Some("/imu")).unwrap_err().to_string();
            assert!(error.contains(name), "{error}");
        }
        for at in (0..whole.len()).step_by(13) {
            let mut damaged = whole.clone();
            damaged[at] ^= 0x55;
            std::fs::write(&path, damaged).unwrap();
            let _ = ImuTopic::open(&path, Some("/imu"));
        }
    }
}
