//! Uploads, downloads, tests and comparisons.

use mimu_core::stored;
use mimu_core::wire::{EFFECTS, Refusal, flags};

use super::calibration::{EFFECTS as ALL_EFFECTS, forward};
use super::peer::{Peer, Script};
use super::{Place, mimu};
use crate::command::says;

/// The bytes that a device receives for this calibration file.
fn uploaded(place: &Place, calibration: &str) -> Vec<u8> {
    let peer = Peer::new(Script::default());
    #[rustfmt::skip]
    let arguments = ["device", "upload", calibration, "--port", &peer.path, "--json", "-"];
    mimu(place, &arguments).json();
    let seen = peer.seen.lock().unwrap();
    seen.stored.clone().unwrap()
}

#[test]
fn a_calibration_arrives_whole_over_a_line_that_loses_and_garbles() {
    let place = Place::new();
    let calibration = place.calibration("V", ALL_EFFECTS);
    let peer = Peer::new(Script {
        losing: 4,
        ..Script::default()
    });
    #[rustfmt::skip]
    let upload = ["device", "upload", &calibration, "--port", &peer.path, "--json", "-"];
    let result = mimu(&place, &upload).json();
    assert_eq!(result["was_there"], false);
    assert!(result["repeated"].as_u64().unwrap() > 0, "{result}");
    let held = peer.seen.lock().unwrap().stored.clone().unwrap();
    assert_eq!(result["hash"], format!("{:016x}", stored::hash(&held)));

    // The received bytes are the file's numbers: C by rows from the inverse of the hand-written P, little-endian after 260 bytes.
    let [(p, b), _] = forward();
    let c = p.try_inverse().unwrap();
    let float = |at: usize| f32::from_le_bytes(held[at..at + 4].try_into().unwrap());
    assert_eq!(float(260), 26.5, "temperature of the node");
    for i in 0..3 {
        for j in 0..3 {
            assert_eq!(float(264 + 4 * (3 * i + j)), c[(i, j)] as f32);
        }
        assert_eq!(float(300 + 4 * i), -(c * b)[i] as f32);
    }

    let download = [
        "device", "download", "--bytes", "back.bin", "--port", &peer.path, "--json", "-",
    ];
    let back = mimu(&place, &download).json();
    assert_eq!(std::fs::read(place.path("back.bin")).unwrap(), held);
    assert_eq!(back["effects"][0]["id"], "gyro_g_sensitivity");
    let g = &back["effects"][0]["coefficients"];
    assert_eq!(g.as_array().unwrap().len(), 9);
    assert_eq!(g[2].as_f64().unwrap() as f32, 0.0004);
    assert_eq!(back["effects"][2]["id"], "term:accel_y~rate_x*force_y");
    assert_eq!(
        back["nodes"][0]["gyro"]["C"][0][1].as_f64().unwrap() as f32,
        c[(0, 1)] as f32
    );

    // Sent again: only the device knows whether what lies beside it in the flash is whole.
    let commits = peer.count("UploadCommit");
    let again = mimu(&place, &upload).json();
    assert_eq!(again["was_there"], true);
    assert!(peer.count("UploadCommit") > commits);
}

#[test]
fn a_device_that_restarts_in_the_middle_of_an_upload_gets_all_of_it_again() {
    let place = Place::new();
    let calibration = place.calibration("V", ALL_EFFECTS);
    let whole = uploaded(&place, &calibration);
    let peer = Peer::new(Script {
        restart_at_chunk: Some(256),
        ..Script::default()
    });
    #[rustfmt::skip]
    let upload = ["device", "upload", &calibration, "--port", &peer.path, "--json", "-"];
    let result = mimu(&place, &upload).json();
    assert_eq!(result["restarts"], 1);
    assert_eq!(
        peer.seen.lock().unwrap().stored.as_deref(),
        Some(&whole[..])
    );
}

#[test]
fn what_the_device_cannot_use_is_named_before_anything_is_sent() {
    let place = Place::new();
    let calibration = place.calibration("V", ALL_EFFECTS);
    let quadratic = EFFECTS
        .iter()
        .position(|id| *id == "accel_scale_quadratic")
        .unwrap();
    let peer = Peer::new(Script {
        effects: Script::default().effects & !(1 << quadratic),
        ..Script::default()
    });
    mimu(
        &place,
        &["device", "upload", &calibration, "--port", &peer.path],
    )
    .refused(&["accel_scale_quadratic", "cannot remove it", "9.8.7"]);
    let counts = place.calibration("count", "");
    mimu(&place, &["device", "upload", &counts, "--port", &peer.path])
        .refused(&["raw readings in count", "device's are in V"]);
    assert_eq!(peer.count("UploadBegin"), 0);
    assert_eq!(peer.count("UploadChunk"), 0);
}

#[test]
fn a_refused_upload_says_what_the_device_holds() {
    let place = Place::new();
    let old = uploaded(&place, &place.calibration("V", ""));
    let hash = format!("{:016x}", stored::hash(&old));
    let calibration = place.calibration("V", ALL_EFFECTS);
    let peer = Peer::new(Script {
        stored: Some(old.clone()),
        refuse_commit: Some(Refusal::FlashFailed),
        ..Script::default()
    });
    mimu(
        &place,
        &["device", "upload", &calibration, "--port", &peer.path],
    )
    .refused(&["flash", &format!("keeps the calibration {hash}")]);
    assert_eq!(peer.seen.lock().unwrap().stored, Some(old));
    let empty = Peer::new(Script::default());
    mimu(
        &place,
        &["device", "download", "-o", "x.toml", "--port", &empty.path],
    )
    .refused(&["stores no calibration"]);
    assert!(!place.path("x.toml").exists());
}

#[test]
fn counters_are_told_and_reset() {
    let place = Place::new();
    let peer = Peer::new(Script::default());
    let counters = [
        "device", "counters", "--reset", "--port", &peer.path, "--json", "-",
    ];
    assert_eq!(mimu(&place, &counters).json()["counters"]["late"], 17);
    assert_eq!(peer.count("ResetCounters"), 1);
}

#[test]
fn a_self_test_names_what_failed_and_what_the_pose_did_not_show() {
    let place = Place::new();
    let peer = Peer::new(Script {
        self_test_fails: &["temperature y", "supply"],
        ..Script::default()
    });
    let run = mimu(&place, &["device", "self-test", "--port", &peer.path]);
    for line in [
        "gyro z, ST1     passed       -0.270 V, limits -0.450 to -0.150",
        "accel x, null   not shown     1.650 V",
        "temperature y   FAILED       26.000 °C",
        "supply          FAILED        3.300 V",
        "not shown in this pose: accel x, null",
    ] {
        assert!(run.stdout.contains(line), "{line}: {}", run.stdout);
    }
    run.refused(&["self-test failed: temperature y; supply"]);
}

#[test]
fn samples_that_carry_a_flag_are_counted_and_told() {
    let place = Place::new();
    let script = || Script {
        flags: flags::TEMPERATURE_LEFT_OUT[1] | flags::POWER_ON_UNKNOWN,
        speed: 4.0,
        ..Script::default()
    };
    let peer = Peer::new(script());
    let stream = [
        "device", "stream", "raw", "--for", "500ms", "--port", &peer.path,
    ];
    let told = mimu(&place, &[&stream[..], &["--json", "-"]].concat()).json();
    assert_eq!(told["temperature_left_out"], serde_json::json!([0, 500, 0]));
    assert_eq!(told["power_on_unknown"], 500);
    assert_eq!(
        told["thermometers"][1],
        serde_json::json!({ "place": "gyro_y", "temp_c": 31.25 })
    );
    drop(peer);
    let peer = Peer::new(script());
    let record = [
        "record", "--port", &peer.path, "-o", "rec", "--for", "500ms",
    ];
    let text = mimu(&place, &record);
    let all = text.stdout + &text.stderr;
    says(&all, &["500 samples whose temperature ignores gyro y"]);
    says(&all, &["500 samples without a known power-on"]);
}

#[test]
fn a_warm_up_is_compared_by_the_time_since_power_on_that_the_device_tells() {
    let place = Place::new();
    let calibration = place.calibration("V", WARM_UP);
    let held = uploaded(&place, &calibration);
    for powered_for_ms in [Some(0), Some(250_000), None] {
        let peer = Peer::new(Script {
            stored: Some(held.clone()),
            powered_for_ms,
            speed: 4.0,
            ..Script::default()
        });
        #[rustfmt::skip]
        let arguments = ["device", "check", "--calibration", &calibration, "--for", "500ms", "--port", &peer.path, "--json", "-"];
        let result = mimu(&place, &arguments).json();
        // The device sums its time batch by batch. The PC begins with the first batch that it receives, which on a busy machine is a later one.
        let ulps = result["gyro"]["ulps"].as_u64().unwrap();
        assert!(ulps <= 4, "{powered_for_ms:?}: {result}");
        assert_eq!(result["holds"], true, "{powered_for_ms:?}: {result}");
    }
}

/// Of 0.1 rad/s, with a time constant of 200 s.
const WARM_UP: &str = r#"
[[effect]]
id = "gyro_warm_up"
sensor = "gyro"
about = ""
formula = "x = C (u - S e) + o, e_i = sum of coefficient * regressor"
direction = "raw to SI"
nonlinear_parameter = { name = "time_constant_s", value = 200.0 }
coefficients = [{ name = "x", value = 0.1, sigma = 1e-6, unit = "rad/s" }]
"#;

#[test]
fn the_compensated_stream_is_compared_sample_by_sample() {
    let place = Place::new();
    for (effects, bent) in [("", 0.0), (ALL_EFFECTS, 0.0), ("", 1e-4)] {
        let calibration = place.calibration("V", effects);
        let peer = Peer::new(Script {
            stored: Some(uploaded(&place, &calibration)),
            bent,
            speed: 2.0,
            ..Script::default()
        });
        #[rustfmt::skip]
        let fixed = ["device", "check", "--calibration", &calibration, "--for", "2s"];
        let run = mimu(
            &place,
            &[&fixed[..], &["--port", &peer.path, "--json", "-"]].concat(),
        );
        if bent > 0.0 {
            run.refused(&["differs from the PC's"]);
            continue;
        }
        let result = run.json();
        assert!(result["samples"].as_u64().unwrap() >= 1990, "{result}");
        for sensor in ["gyro", "accel"] {
            // The same operations on the same numbers.
            assert_eq!(result[sensor]["ulps"], 0, "{result}");
            let double = result[sensor]["double"].as_f64().unwrap();
            // Terms of up to 9 rad/s and 21 m/s² with 24 bits: there is rounding, and nothing else.
            assert!(double > 0.0 && double < 2e-5, "{result}");
        }
        assert_eq!(result["holds"], true);
    }
    // A different calibration from the stored one.
    let held = uploaded(&place, &place.calibration("V", ALL_EFFECTS));
    let other = place.calibration("V", "");
    let peer = Peer::new(Script {
        stored: Some(held),
        ..Script::default()
    });
    mimu(
        &place,
        &[
            "device",
            "check",
            "--calibration",
            &other,
            "--port",
            &peer.path,
        ],
    )
    .refused(&["another calibration", "upload"]);
}
