//! The unit that a calibration belongs to, and the file fetched back from the device.

use super::calibration::{EFFECTS, text};
use super::peer::{Peer, Script, UNIT_ID};
use super::{Place, Ran, mimu};

const OTHER: &str = "ffeeddccbbaa998877665544";

/// Unit id of the peer.
fn unit() -> String {
    UNIT_ID.iter().map(|b| format!("{b:02x}")).collect()
}

/// A calibration file for the unit with this id.
fn of_unit(place: &Place, unit_id: &str) -> String {
    let path = place.path("of-unit.toml");
    let id = format!("unit_id = \"{unit_id}\"\ncreated");
    let sha = format!("sha256 = \"{}\"", "c0ffee12".repeat(8));
    let text = text("V", EFFECTS).replace("created", &id);
    std::fs::write(&path, text.replace("sha256 = \"00\"", &sha)).unwrap();
    path.display().to_string()
}

fn device(place: &Place, peer: &Peer, arguments: &[&str]) -> Ran {
    let all = [&["device"], arguments, &["--port", &peer.path]].concat();
    mimu(place, &all)
}

#[test]
fn a_calibration_of_another_unit_is_refused_unless_somebody_insists() {
    let place = Place::new();
    let peer = Peer::new(Script::default());
    let other = of_unit(&place, OTHER);
    let refused = device(&place, &peer, &["upload", &other]);
    refused.refused(&["of-unit.toml", OTHER, &unit(), "(--other-unit)"]);
    assert_eq!(peer.count("UploadBegin"), 0, "before anything is sent");

    let insisted = ["upload", &other, "--other-unit", "--json", "-"];
    let stored = device(&place, &peer, &insisted).json();
    assert_eq!(stored["unit_id"], OTHER);
    let shown = device(&place, &peer, &["info"]).stdout;
    let words = format!("of ANOTHER unit, {OTHER}, made 2026-01-01T00:00:00Z");
    assert!(shown.contains(&words), "{shown}");

    let own = of_unit(&place, &unit());
    let stored = device(&place, &peer, &["upload", &own, "--json", "-"]).json();
    let warnings = stored["warnings"].as_array().unwrap();
    let [only] = &warnings[..] else {
        panic!("{warnings:?}")
    };
    let only = only.as_str().unwrap();
    assert!(only.contains("does not contain the range"), "{only}");
    let shown = device(&place, &peer, &["info"]).stdout;
    assert!(shown.contains("of this unit, made 2026"), "{shown}");
}

#[test]
fn what_is_fetched_and_stored_again_is_the_same_to_the_last_byte() {
    let place = Place::new();
    let peer = Peer::new(Script::default());
    let file = of_unit(&place, &unit());
    let sent = device(&place, &peer, &["upload", &file, "--json", "-"]).json();
    let held = peer.seen.lock().unwrap().stored.clone();
    let fetched = ["download", "-o", "back.toml", "--json", "-"];
    let fetched = device(&place, &peer, &fetched).json();
    assert_eq!(fetched["samples_sha256"], "c0ffee12".repeat(8));
    assert_eq!(fetched["created"], "2026-01-01T00:00:00Z");
    let back = std::fs::read_to_string(place.path("back.toml")).unwrap();
    assert!(
        back.contains(&format!("device = \"mimu-{}\"", unit())),
        "{back}"
    );
    assert!(!back.contains("sigma") && !back.contains("covariance ="));

    // The device has it already, and decides itself whether it has to write it again.
    let again = ["upload", "back.toml", "--json", "-"];
    assert_eq!(device(&place, &peer, &again).json()["was_there"], true);
    assert_eq!(peer.count("UploadBegin"), 2);
    let said = device(&place, &peer, &["upload", "back.toml"]).stdout;
    assert!(said.contains("already stored"), "{said}");
    // A device that does not have it receives the same bytes.
    let empty = Peer::new(Script::default());
    let twin = device(&place, &empty, &again).json();
    assert_eq!(
        (&twin["was_there"], &twin["hash"]),
        (&false.into(), &sent["hash"])
    );
    assert_eq!(empty.seen.lock().unwrap().stored, held);
}

#[test]
fn a_file_with_half_of_its_uncertainty_is_refused() {
    let place = Place::new();
    let peer = Peer::new(Script::default());
    let file = place.path("cal.toml");
    let whole = text("V", "");
    let lines = whole.lines().filter(|l| !l.starts_with("sigma_o"));
    std::fs::write(&file, lines.collect::<Vec<_>>().join("\n")).unwrap();
    let refused = device(&place, &peer, &["upload", "cal.toml"]);
    refused.refused(&["[gyro]", "it has sigma_C but not sigma_o", "cut"]);
    std::fs::write(
        &file,
        whole.replacen("device", "unit_id = \"12\"\ndevice", 1),
    )
    .unwrap();
    let refused = device(&place, &peer, &["upload", "cal.toml"]);
    refused.refused(&["unit_id", "\"12\" is not a unit's number", "24 hexadecimal"]);
}

#[test]
fn a_device_at_a_temperature_that_the_calibration_is_not_for_is_reported() {
    let place = Place::new();
    let peer = Peer::new(Script::default());
    let upload = |range: &str| {
        let file = of_unit(&place, &unit());
        let text = std::fs::read_to_string(&file).unwrap();
        let range = format!("temp_c = 26.5\ntemp_range_c = {range}");
        std::fs::write(&file, text.replace("temp_c = 26.5", &range)).unwrap();
        let sent = device(&place, &peer, &["upload", &file, "--json", "-"]).json();
        // A calibration that was written by hand also lacks the settings of its sensors.
        sent["warnings"].as_array().unwrap().len() - 1
    };
    let seen = device(&place, &peer, &["stream", "--for", "100ms", "--json", "-"]).json();
    let temp_c = seen["temp_c"].as_f64().unwrap();
    let range = |from: f64| format!("[{from:?}, {:?}]", from + 1.0);
    assert_eq!(upload(&range(temp_c)), 0);
    assert_eq!(upload(&range(temp_c + 4.0)), 0);
    assert_eq!(upload(&range(temp_c + 6.0)), 1);
    assert_eq!(upload(&range(temp_c - 8.0)), 1);
}
