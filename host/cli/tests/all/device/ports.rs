//! The device at the port, and the messages if there is none, or another one.

use std::os::unix::process::CommandExt as _;

use mimu_core::wire::{PROTOCOL, Version};

use super::peer::{Behaviour, Peer, Script};
use super::terminal::Terminal;
use super::{Place, command, mimu};
use crate::command::{ran, says};

fn info(script: Script, extra: &[&str]) -> super::Ran {
    let peer = Peer::new(script);
    let arguments = [&["device", "info", "--port", &peer.path][..], extra].concat();
    mimu(&Place::new(), &arguments)
}

/// Where no answer comes, patience is in vain.
fn unanswered(behaviour: Behaviour) -> super::Ran {
    let script = Script {
        behaviour,
        ..Script::default()
    };
    let peer = Peer::new(script);
    let place = Place::new();
    let mut command = command(&place, &["device", "info", "--port", &peer.path]);
    ran(command.env("MIMU_PATIENCE", "1"))
}

#[test]
fn a_device_says_who_it_is() {
    let result = info(Script::default(), &["--json", "-"]).json();
    assert_eq!(result["format"], "mimu-device/1");
    assert_eq!(result["unit_id"], "000102030405060708090aab");
    assert_eq!(result["firmware"], "9.8.7");
    assert_eq!(result["start"]["reason"], "panic");
    assert_eq!(result["start"]["line"], 7);
    assert_eq!(result["raw_unit"], "V");
    assert!(result["stored"].is_null());
    let text = info(Script::default(), &[]).stdout;
    says(
        &text,
        &[
            "a script",
            "panic in src/x.rs, line 7",
            "3 starts",
            "calibration   none",
        ],
    );
}

fn speaking(major: u8, minor: u8) -> Script {
    Script {
        protocol: Version { major, minor },
        ..Script::default()
    }
}

#[test]
fn an_older_a_newer_and_a_foreign_device_are_told_apart() {
    let (major, minor) = (PROTOCOL.major, PROTOCOL.minor);
    let newer = info(speaking(major + 1, 0), &[]);
    let speaks = format!("protocol {}.0", major + 1);
    newer.refused(&["the device is newer", &speaks, "update mimu"]);
    let older = info(speaking(0, 9), &[]);
    older.refused(&["the device is older", "protocol 0.9", "flash"]);
    let warned = info(speaking(major, minor + 1), &["--json", "-"]).json();
    let warning = warned["warnings"][0].as_str().unwrap().to_owned();
    assert!(warning.contains("newer"), "{warning}");
    let foreign = Script {
        magic: *b"nimu",
        ..Script::default()
    };
    info(foreign, &[]).refused(&["wrong firmware", "nimu"]);
}

#[test]
fn silence_garbage_and_another_protocol_are_told_apart() {
    unanswered(Behaviour::Silence).refused(&["nothing answers"]);
    unanswered(Behaviour::Garbage).refused(&["garbage", "not a mimu device"]);
    unanswered(Behaviour::Stranger).refused(&["no greeting"]);
}

#[test]
fn a_port_that_cannot_be_opened_is_named_with_the_reason() {
    let place = Place::new();
    mimu(&place, &["device", "info", "--port", "/nowhere/ttyACM9"])
        .refused(&["/nowhere/ttyACM9", "the port does not exist"]);
    let file = place.calibration("V", "");
    mimu(&place, &["device", "info", "--port", &file]).refused(&["not a serial port"]);

    let peer = Peer::new(Script::default());
    let held = serialport::new(&peer.path, 1_000_000)
        .open_native()
        .unwrap();
    mimu(&place, &["device", "info", "--port", &peer.path]).refused(&["busy"]);
    drop(held);
    // A program that another test has started meanwhile inherits the open port until it ends.
    let free = || mimu(&place, &["device", "info", "--port", &peer.path]);
    let is_free = (0..3000).any(|_| {
        std::thread::sleep(std::time::Duration::from_millis(100));
        free().status == Some(0)
    });
    assert!(is_free, "{}", free().stderr);
}

#[test]
fn a_port_without_permission_is_told_apart() {
    let (_side, path) = Terminal::open();
    let nobody_may = std::os::unix::fs::PermissionsExt::from_mode(0o000);
    std::fs::set_permissions(&path, nobody_may).unwrap();
    let place = Place::new();
    let mut command = command(&place, &["device", "info", "--port", &path]);
    command.current_dir("/").env("MIMU_PATIENCE", "1");
    // Root may open everything and must change its user; others cannot and need not.
    let nobody = 65534;
    let as_nobody = command.uid(nobody).gid(nobody).output();
    let arguments = ["device", "info", "--port", &path];
    let line = match as_nobody {
        Ok(out) => String::from_utf8(out.stderr).unwrap(),
        Err(_) => mimu(&place, &arguments).stderr,
    };
    if line.contains("nothing answers") {
        println!("skipped: this is root, and nobody else may run the program from here");
        return;
    }
    assert!(line.contains("no permission to open the port"), "{line}");
}
