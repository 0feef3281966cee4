//! `mimu record`: gaps, restarts, kills, and a port that disappears.

use std::io::Write as _;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use mimu_core::wire::Start;
use mimu_recording::{Batch, Recording};

use super::peer::{ACCEL_VOLTS, Act, GYRO_VOLTS, Peer, Script, TEMP_C, sums};
use super::{Place, command, mimu, start};

/// All rows of a recording, with their inputs.
pub fn rows(place: &Place, name: &str) -> (Recording, Batch) {
    let recording = Recording::open(&place.path(name)).unwrap();
    let mut all = Batch::default();
    let read = recording.for_each_batch(
        |_| {},
        |batch| {
            all.t_s.extend_from_slice(&batch.t_s);
            all.step.extend_from_slice(&batch.step);
            all.temp_c.extend_from_slice(&batch.temp_c);
            for (all, more) in all.raw.iter_mut().zip(&batch.raw) {
                all.extend_from_slice(more);
            }
            for (all, more) in all.reference.iter_mut().zip(&batch.reference) {
                all.extend_from_slice(more);
            }
            Ok(())
        },
    );
    read.unwrap();
    (recording, all)
}

/// Checks that every row is what the script sends for the sample at its time, and that times increase.
fn check_rows(rows: &Batch) {
    for (i, t_s) in rows.t_s.iter().enumerate() {
        let n = (t_s * 1000.0).round();
        assert_eq!(*t_s, n / 1000.0, "times are n/1000 s to the last bit");
        assert!(i == 0 || *t_s > rows.t_s[i - 1]);
        let sums = sums(n as u32);
        for axis in 0..6 {
            let step = if axis < 3 { GYRO_VOLTS } else { ACCEL_VOLTS };
            // To the last bit of the device's single-precision values.
            assert_eq!(
                rows.raw[axis][i] as f32,
                sums[axis] as f32 * step,
                "sample {n}"
            );
        }
        assert_eq!(rows.temp_c[i], f64::from(TEMP_C));
    }
}

/// Last sample before a gap and first after it, ms since the first.
fn gaps(rows: &Batch) -> Vec<(f64, f64)> {
    let pairs = rows.t_s.windows(2);
    let ms = |t: f64| (t * 1000.0).round();
    let gaps = pairs.filter(|p| ms(p[1]) - ms(p[0]) > 1.0);
    let first = ms(rows.t_s[0]);
    gaps.map(|p| (ms(p[0]) - first, ms(p[1]) - first)).collect()
}

#[test]
fn lost_and_garbled_batches_are_gaps_that_are_counted_and_never_closed() {
    let place = Place::new();
    let peer = Peer::new(Script {
        speed: 4.0,
        acts: vec![
            (12_000, Act::Drop),
            (13_000, Act::Garble),
            (13_020, Act::Drop),
        ],
        ..Script::default()
    });
    let arguments = [
        "record", "--port", &peer.path, "-o", "rec", "--for", "20s", "--json", "-",
    ];
    let result = mimu(&place, &arguments).json();
    assert_eq!(result["format"], "mimu-record/1");
    assert_eq!(
        (&result["missing"], &result["gaps"]),
        (&60.into(), &2.into())
    );
    assert_eq!(result["line"]["garbled"], 1);
    let (recording, rows) = rows(&place, "rec");
    check_rows(&rows);
    assert_eq!(gaps(&rows), [(11_999.0, 12_020.0), (12_999.0, 13_040.0)]);
    assert_eq!(rows.t_s.len() as u64, result["samples"].as_u64().unwrap());
    assert_eq!(rows.t_s.len(), 20_000 - 60);
    // A time of 5 digits, a temperature of 5, six readings of up to 9 digits and a point, and the separators.
    let samples = std::fs::metadata(place.path("rec/samples.csv")).unwrap();
    assert!(samples.len() < 80 * 20_000, "{} bytes", samples.len());
    assert!(recording.warnings.is_empty(), "{:?}", recording.warnings);
    let recorded = recording.manifest.recorded.unwrap();
    assert_eq!(
        (recorded.missing, recorded.firmware.as_str()),
        (60, "9.8.7")
    );
    assert!(!recording.manifest.unfinished);
}

/// Waits until the recording `rec` has so many bytes of samples. Returns how many it has.
fn wait_for(place: &Place, bytes: u64) -> u64 {
    let until = Instant::now() + Duration::from_secs(600);
    loop {
        let has = std::fs::metadata(place.path("rec/samples.csv")).map_or(0, |m| m.len());
        if has >= bytes {
            return has;
        }
        assert!(Instant::now() < until, "only {has} bytes were recorded");
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn interrupt(child: &Child) {
    let pid = rustix::process::Pid::from_child(child);
    rustix::process::kill_process(pid, rustix::process::Signal::INT).unwrap();
}

#[test]
fn lines_on_standard_input_begin_and_end_dwells_and_ctrl_c_the_recording() {
    let place = Place::new();
    let peer = Peer::new(Script::default());
    let arguments = ["record", "--port", &peer.path, "-o", "rec", "--steps"];
    let mut command = command(&place, &arguments);
    let mut child = command
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut keys = child.stdin.take().unwrap();
    let mut bytes = 0;
    let mut more = |times: usize| (0..times).for_each(|_| bytes = wait_for(&place, bytes + 1));
    for _ in 0..3 {
        more(2);
        keys.write_all(b"\n").unwrap();
    }
    more(2);
    interrupt(&child);
    assert!(child.wait().unwrap().success());
    let (recording, rows) = rows(&place, "rec");
    assert!(!recording.manifest.unfinished);
    check_rows(&rows);
    assert_eq!(peer.count("Stop"), 1);
    let mut runs = rows.step.clone();
    runs.dedup();
    assert_eq!(runs, [-1, 0, -1, 1]);
}

#[test]
fn a_killed_recording_is_there_up_to_the_last_second() {
    let place = Place::new();
    let peer = Peer::new(Script {
        acts: vec![(5_500, Act::Hold)],
        ..Script::default()
    });
    let mut child = start(&place, &["record", "--port", &peer.path, "-o", "rec"]);
    let samples = place.path("rec/samples.csv");
    // Of 5.5 s all but the last second are in the file, however slowly they come.
    let mut bytes = 0;
    let lines = || std::fs::read_to_string(&samples).map_or(0, |text| text.lines().count());
    while lines() < 4_500 {
        bytes = wait_for(&place, bytes + 1);
    }
    // SIGKILL: no code of the program runs any more.
    child.kill().unwrap();
    child.wait().unwrap();
    let (recording, rows) = rows(&place, "rec");
    check_rows(&rows);
    assert!(gaps(&rows).is_empty());
    assert!(recording.manifest.unfinished);
    let warning = recording.warnings[0].to_string();
    assert!(warning.contains("unfinished"), "{warning}");

    // A power failure may leave half a row, whose last number looks complete.
    let whole = std::fs::read(&samples).unwrap();
    let end = whole.iter().rposition(|b| *b == b'\n').unwrap();
    let cut = whole[..end].iter().rposition(|b| *b == b'\n').unwrap() + 1;
    std::fs::write(&samples, &whole[..end - 3]).unwrap();
    let (recording, fewer) = self::rows(&place, "rec");
    assert!(recording.warnings[0].to_string().contains("cut"));
    check_rows(&fewer);
    let lines = whole[..cut].iter().filter(|b| **b == b'\n').count();
    assert_eq!(fewer.t_s.len(), lines - 1);

    // The other commands accept it.
    let out = mimu(&place, &["allan", "rec", "--json", "-"]);
    assert!(
        out.status == Some(0) || out.stderr.contains("; "),
        "{}",
        out.stderr
    );
}

#[test]
fn a_recording_goes_on_over_a_restart_and_tells_it() {
    let place = Place::new();
    let peer = Peer::new(Script {
        acts: vec![(6_000, Act::Restart)],
        speed: 2.0,
        ..Script::default()
    });
    let arguments = [
        "record", "--port", &peer.path, "-o", "rec", "--for", "9s", "--json", "-",
    ];
    let result = mimu(&place, &arguments).json();
    let restart = &result["restarts"][0];
    assert!(
        restart["start"].as_str().unwrap().contains("panic"),
        "{result}"
    );
    let (recording, rows) = rows(&place, "rec");
    let [(before, after)] = gaps(&rows)[..] else {
        panic!("one gap: {:?}", gaps(&rows));
    };
    let t_s = restart["t_s"].as_f64().unwrap() - rows.t_s[0];
    assert!((after / 1000.0 - t_s).abs() < 1e-9);
    assert!(before < 6_000.0 && rows.t_s.windows(2).all(|p| p[1] > p[0]));
    assert_eq!(recording.manifest.recorded.unwrap().restarts.len(), 1);
}

#[test]
fn a_recording_counts_from_power_on_over_a_reset_as_long_as_the_device_knows_it() {
    let recorded = |start, powered_for_ms| {
        let place = Place::new();
        let peer = Peer::new(Script {
            speed: 4.0,
            start,
            powered_for_ms,
            ..Script::default()
        });
        let arguments = [
            "record", "--port", &peer.path, "-o", "rec", "--for", "1s", "--json", "-",
        ];
        mimu(&place, &arguments).json();
        rows(&place, "rec").0.manifest
    };
    let by_power = recorded(Start::PowerOn, Some(70));
    assert_eq!(by_power.power_on_s, Some(-0.07));
    assert_eq!(by_power.start_without_power_on(), None);
    // Pressing the button does not cool the die.
    let by_button = recorded(Start::ResetPin, Some(600_500));
    assert_eq!(by_button.power_on_s, Some(-600.5));
    assert_eq!(by_button.start_without_power_on(), None);
    let forgotten = recorded(Start::ResetPin, None);
    assert_eq!(forgotten.power_on_s, None);
    assert_eq!(forgotten.start_without_power_on(), Some("reset pin"));
}

#[test]
fn a_port_that_vanishes_ends_the_recording_with_what_there_is() {
    let place = Place::new();
    let peer = Peer::new(Script {
        acts: vec![(8_000, Act::Vanish)],
        speed: 2.0,
        ..Script::default()
    });
    #[rustfmt::skip]
    let arguments = ["record", "--port", &peer.path, "-o", "rec", "--reconnect", "300ms"];
    let run = mimu(&place, &arguments);
    run.refused(&[
        &peer.path,
        "vanished, and has not come back within 0.3 s",
        "samples are kept in rec",
    ]);
    let (recording, rows) = rows(&place, "rec");
    assert!(!recording.manifest.unfinished);
    check_rows(&rows);
    assert!(rows.t_s.last().unwrap() - rows.t_s[0] > 7.5);
}

#[test]
fn a_recording_goes_on_after_the_cable_was_pulled_and_the_device_s_clock_measures_the_gap() {
    let place = Place::new();
    let peer = Peer::new(Script {
        acts: vec![(1_000, Act::Unplug { away_ms: 700 })],
        link: Some(place.path("port")),
        start: Start::PowerOn,
        ..Script::default()
    });
    let arguments = [
        "record", "--port", &peer.path, "-o", "rec", "--for", "3s", "--json", "-",
    ];
    let result = mimu(&place, &arguments).json();
    assert_eq!(result["reconnected"], 1);
    assert_eq!(result["restarts"], serde_json::json!([]));
    let (recording, rows) = rows(&place, "rec");
    // Every row is the sample of its time, also after the gap.
    check_rows(&rows);
    let [(before, after)] = gaps(&rows)[..] else {
        panic!("one gap: {:?}", gaps(&rows));
    };
    assert!(
        before < 1_000.0 && after - before > 700.0,
        "{before} {after}"
    );
    let missing = recording.manifest.recorded.unwrap().missing;
    assert_eq!(result["missing"], missing);
    assert_eq!(missing as f64, after - before - 1.0);
    let length = rows.t_s.last().unwrap() - rows.t_s[0];
    assert!((length - 2.999).abs() < 1e-9, "{length}");
}

#[test]
fn a_plan_by_time_gives_every_sample_of_a_dwell_its_input() {
    let place = Place::new();
    let plan = "format = \"mimu-plan/1\"\ndevice = \"unit-9\"\nsample_rate_hz = 1000.0\ncarrier = \"table\"\n\
                gravity_mps2 = 9.793\nlead_in_s = 0.25\n\
                [[step]]\nup = [0.0, 0.0, 1.0]\ndwell_s = 0.5\n\
                [[step]]\nup = [0.0, -2.0, 0.0]\nrate_dps = 50.0\ndwell_s = 0.25\nrepeat = 2\n";
    std::fs::write(place.path("plan.toml"), plan).unwrap();
    let peer = Peer::new(Script {
        speed: 4.0,
        ..Script::default()
    });
    #[rustfmt::skip]
    let record = ["record", "--port", &peer.path, "-o", "rec", "--plan", "plan.toml"];
    let nothing = mimu(&place, &record);
    nothing.refused(&["--plan", "beginnings and ends", "--transit"]);
    let by_time = [&record[..], &["--transit", "250ms", "--json", "-"]].concat();
    let result = mimu(&place, &by_time).json();
    assert_eq!(
        (&result["dwells"], &result["samples"]),
        (&3.into(), &1750.into())
    );
    let (recording, rows) = rows(&place, "rec");
    let manifest = &recording.manifest;
    assert_eq!(manifest.reference, mimu_recording::Reference::Table);
    assert_eq!(
        (manifest.device.as_str(), manifest.gravity_mps2),
        ("unit-9", 9.793)
    );
    let none = [None; 6];
    let up = [0.0, 0.0, 0.0, 0.0, 0.0, 9.793].map(Some);
    let turning = [0.0, -50.0, 0.0, 0.0, -9.793, 0.0].map(Some);
    let spans = [
        (250, -1, none),
        (500, 0, up),
        (250, -1, none),
        (250, 1, turning),
        (250, -1, none),
        (250, 2, turning),
    ];
    let mut row = 0;
    for (length, step, input) in spans {
        for _ in 0..length {
            assert_eq!(rows.step[row], step, "row {row}");
            let found: [Option<f64>; 6] =
                std::array::from_fn(|i| Some(rows.reference[i][row]).filter(|v| !v.is_nan()));
            assert_eq!(found, input, "row {row}");
            row += 1;
        }
    }
    assert_eq!(row, 1750);
}
