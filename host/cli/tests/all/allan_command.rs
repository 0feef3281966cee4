//! The commands `mimu allan` and `mimu export`: their output and their refusals.

use std::fmt::Write as _;
use std::path::Path;

use mimu::noise::noise_file::NoiseFile;
use mimu_rig::noise::{Coefficients, Noise};
use mimu_rig::plan::Plan;
use mimu_rig::rig_file::{RigFile, RigTruth};

use super::command::{self, refused};

/// Standard output of a successful command, with `--verbose` for `allan`.
fn done(folder: &Path, arguments: &str) -> String {
    let verbose = match arguments.strip_prefix("allan ") {
        Some(rest) => &format!("allan --verbose {rest}"),
        None => arguments,
    };
    command::done(folder, verbose)
}

const RATE_HZ: f64 = 100.0;
const N: f64 = 1e-3;
const K: f64 = 2e-4;

/// Rows of six channels at rest: white noise, and a random walk in the accelerometers.
fn at_rest(rows: usize) -> Vec<[f64; 7]> {
    let channel = |i: usize| {
        let walk = if i < 3 { 0.0 } else { K };
        let of = Coefficients {
            white: N,
            instability: 0.0,
            walk,
        };
        Noise::new(&of, &i.to_string(), 1.0 / RATE_HZ, 3)
    };
    let mut noise: Vec<Noise> = (0..6).map(channel).collect();
    let row = |k: usize| -> [f64; 7] {
        std::array::from_fn(|i| match i {
            0 => k as f64 / RATE_HZ,
            i => noise[i - 1].step() + if i == 6 { 9.8 } else { 0.0 },
        })
    };
    (0..rows).map(row).collect()
}

/// Writes the recording `r` in SI.
fn write(folder: &Path, rows: &[[f64; 7]]) {
    write_as(folder, "r", rows, None);
}

/// Writes a recording in SI into a separate folder, with a temperature if there is one.
fn write_as(folder: &Path, name: &str, rows: &[[f64; 7]], temp_c: Option<f64>) {
    let folder = folder.join(name);
    std::fs::create_dir_all(&folder).unwrap();
    let manifest = format!(
        "format = \"mimu-recording/1\"\ndevice = \"u\"\nsample_rate_hz = {RATE_HZ:?}\n\
         gravity_mps2 = 9.8\nraw_unit = \"SI\"\nreference = \"gravity\"\n"
    );
    std::fs::write(folder.join("recording.toml"), manifest).unwrap();
    let mut csv = "t_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z".to_string();
    csv.push_str(if temp_c.is_some() { ",temp_c\n" } else { "\n" });
    for row in rows {
        let cell = |v: &f64| match v.is_finite() {
            true => v.to_string(),
            false => String::new(),
        };
        let cells: Vec<String> = row.iter().chain(&temp_c).map(cell).collect();
        let _ = writeln!(csv, "{}", cells.join(","));
    }
    std::fs::write(folder.join("samples.csv"), csv).unwrap();
}

#[test]
fn json_has_the_agreed_keys_and_the_truth_within_its_intervals() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), &at_rest(60_000));
    let text = done(
        folder.path(),
        "allan r --json a.json --plot a.svg -o noise.toml",
    );
    let json = std::fs::read(folder.path().join("a.json")).unwrap();
    let json: serde_json::Value = serde_json::from_slice(&json).unwrap();
    assert_eq!(json["format"], "mimu-allan/1");
    let channels = json["channels"].as_array().unwrap();
    assert_eq!(channels.len(), 6);
    let mut outside = 0;
    for channel in channels {
        let name = channel["name"].as_str().unwrap();
        let points = channel["tau_s"].as_array().unwrap().len();
        for key in ["adev", "lower", "upper", "sigma_independent"] {
            assert_eq!(channel[key].as_array().unwrap().len(), points);
        }
        let mut check = |key: &str, truth: f64, unit: &str| {
            let c = &channel[key];
            assert_eq!(c["unit"], unit);
            assert!(c["sigma"].is_number());
            let ends = ["lower", "upper"].map(|e| c[e].as_f64().unwrap());
            outside += usize::from(!(ends[0]..=ends[1]).contains(&truth));
        };
        if name.starts_with("gyro") {
            check("n", N, "rad/s/sqrt(Hz)");
            assert!(channel["k"].is_null());
            let why = channel["reasons"]["k"].as_str().unwrap();
            assert!(
                why.contains("record at least") && why.contains("deg/h/√h"),
                "{why}"
            );
        } else {
            check("n", N, "m/s^2/sqrt(Hz)");
            check("k", K, "m/s^2/sqrt(s)");
        }
    }
    // Nine intervals of 95 %.
    assert!(outside <= 2, "{outside} outside");
    assert!(
        text.contains("deg/√h") && text.contains("µg/√Hz") && text.contains("textbook one-sigma")
    );
    let svg = std::fs::read_to_string(folder.path().join("a.svg")).unwrap();
    assert!(svg.starts_with("<svg") && svg.contains("gyro_x") && svg.contains("Accelerometers"));
}

#[test]
fn recordings_at_several_temperatures_stand_in_one_file_with_theirs() {
    let folder = tempfile::tempdir().unwrap();
    let rows = at_rest(12_000);
    write_as(folder.path(), "cold", &rows[..6000], Some(-10.0));
    write_as(folder.path(), "warm", &rows[6000..], Some(40.5));
    write_as(folder.path(), "unknown", &rows[..6000], None);
    let text = done(folder.path(), "allan cold warm -o noise.toml --json a.json");
    assert!(text.contains("u in cold") && text.contains("-10.0 °C") && text.contains("40.5 °C"));
    let json = std::fs::read(folder.path().join("a.json")).unwrap();
    let json: serde_json::Value = serde_json::from_slice(&json).unwrap();
    let channels = json["channels"].as_array().unwrap();
    let of = |c: &serde_json::Value| (c["recording"].clone(), c["temp_c"].as_f64().unwrap());
    assert_eq!(channels.len(), 12);
    assert_eq!(of(&channels[5]), ("cold".into(), -10.0));
    assert_eq!(of(&channels[6]), ("warm".into(), 40.5));
    let file = NoiseFile::read(&folder.path().join("noise.toml")).unwrap();
    let temperatures: Vec<_> = file.channel.iter().map(|c| c.temp_c.unwrap()).collect();
    assert_eq!(temperatures, [[-10.0; 6], [40.5; 6]].concat());

    for (arguments, says) in [
        ("allan cold warm --plot a.svg", "one recording at a time"),
        ("allan cold unknown", "unknown: it has no temp_c"),
        ("allan cold cold", "given twice"),
    ] {
        let error = refused(folder.path(), arguments);
        assert!(error.contains(says), "{error}");
    }
    for (key, other) in [
        ("device = \"u\"", "device = \"v\""),
        ("raw_unit = \"SI\"", "raw_unit = \"V\""),
    ] {
        let manifest = folder.path().join("warm/recording.toml");
        let text = std::fs::read_to_string(&manifest).unwrap();
        std::fs::write(&manifest, text.replace(key, other)).unwrap();
        let error = refused(folder.path(), "allan cold warm");
        let what = key.split(' ').next().unwrap();
        assert!(error.contains(&format!("its {what} is")), "{error}");
        std::fs::write(&manifest, text).unwrap();
    }
}

/// Spoils a row, given its number.
type Spoil = fn(usize, &mut [f64; 7]);

#[test]
fn what_is_not_at_rest_or_not_alive_is_refused_with_its_place() {
    let rest = at_rest(6000);
    let cases: [(&str, Spoil, &[&str]); 3] = [
        (
            "moving",
            |k, row| {
                if (4000..4300).contains(&k) {
                    row[1] += (k as f64).sin()
                }
            },
            &["40.0 s", "gyro_x", "from 0.0 to 40.0 s (--from, --to)"],
        ),
        (
            "turning slowly",
            |k, row| {
                if k >= 5000 {
                    row[3] += 0.5
                }
            },
            &["50.0 s", "gyro_z"],
        ),
        (
            "stuck",
            |k, row| {
                if (2000..2400).contains(&k) {
                    row[5] = 0.25
                }
            },
            &["accel_y", "stuck at 0.25", "20.00 s"],
        ),
    ];
    for (name, spoil, says) in cases {
        let folder = tempfile::tempdir().unwrap();
        let mut rows = rest.clone();
        rows.iter_mut()
            .enumerate()
            .for_each(|(k, row)| spoil(k, row));
        write(folder.path(), &rows);
        let error = refused(folder.path(), "allan r -o n.toml");
        for word in says {
            assert!(error.contains(word), "{name}: {error}");
        }
        assert!(!folder.path().join("n.toml").exists());
    }
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), &rest[..7]);
    assert!(refused(folder.path(), "allan r").contains("7 samples, and at least 64 are needed"));
    write(folder.path(), &rest);
    assert!(refused(folder.path(), "allan r --from 70").contains("--from"));
    assert!(
        refused(folder.path(), "allan r --from 30 --to 20").contains("30 s is not before 20 s")
    );
    assert!(refused(folder.path(), "allan r --step 2").contains("no column step"));
}

#[test]
fn a_dead_channel_is_named_and_the_others_are_as_without_it() {
    let folder = tempfile::tempdir().unwrap();
    let run = |rows: &[[f64; 7]]| -> (serde_json::Value, String) {
        write(folder.path(), rows);
        let text = done(
            folder.path(),
            "allan r -o n.toml --plot n.svg --json n.json",
        );
        let json = std::fs::read_to_string(folder.path().join("n.json")).unwrap();
        (serde_json::from_str(&json).unwrap(), text)
    };
    let rows = at_rest(6000);
    let (whole, _) = run(&rows);
    for dead in [0, 1, 4] {
        let mut rows = rows.clone();
        rows.iter_mut().for_each(|row| row[1 + dead] = -0.0);
        let (found, text) = run(&rows);
        let channels = found["channels"].as_array().unwrap();
        assert_eq!(channels.len(), 6);
        for (k, channel) in channels.iter().enumerate() {
            let why = "the channel is stuck at 0 throughout";
            match k == dead {
                true => {
                    assert_eq!(channel["n"], serde_json::Value::Null);
                    assert_eq!(channel["reasons"]["n"], why);
                    let name = channel["name"].as_str().unwrap();
                    assert!(
                        text.contains(&format!("{name}: {why}")) && !text.contains("-0 "),
                        "{text}"
                    );
                    let noise = std::fs::read_to_string(folder.path().join("n.toml")).unwrap();
                    assert_eq!(noise.matches("[[channel]]").count(), 5, "{noise}");
                    assert!(!noise.contains(&format!("name = \"{name}\"")), "{noise}");
                }
                false => assert_eq!(channel, &whole["channels"][k]),
            }
        }
    }
}

#[test]
fn a_short_knock_is_masked_and_counted_and_leaves_the_coefficients_as_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let still = at_rest(60_000);
    let mut knocked = still.clone();
    // 100 standard deviations of a sample, for 60 ms.
    for row in &mut knocked[31_230..31_236] {
        row[1..].iter_mut().for_each(|u| *u += 1000.0 * N);
    }
    let json = |rows: &[[f64; 7]]| -> serde_json::Value {
        write(folder.path(), rows);
        serde_json::from_str(&done(folder.path(), "allan r --json -")).unwrap()
    };
    let (before, after) = (json(&still), json(&knocked));
    for (a, b) in before["channels"]
        .as_array()
        .unwrap()
        .iter()
        .zip(after["channels"].as_array().unwrap())
    {
        assert_eq!(a["masked_samples"], 0);
        // Two windows of one second: the one with the knock, and the one in which the mean returns.
        assert_eq!(b["masked_samples"], 200, "{b}");
        let n = |c: &serde_json::Value| c["n"]["value"].as_f64().unwrap();
        assert!((n(b) / n(a) - 1.0).abs() < 0.01, "{} {}", n(a), n(b));
    }
    let said = after["warnings"].to_string();
    assert!(
        said.contains(
            "gyro_x: 200 samples, 0.333 % of the time, are disturbed, first at 312.0 s: masked"
        ),
        "{said}"
    );
    // A disturbance that leaves the unit in another pose is not a passing one.
    for row in &mut knocked[31_236..] {
        row[4] += 50.0 * N;
    }
    write(folder.path(), &knocked);
    let error = refused(folder.path(), "allan r");
    assert!(
        error.contains("2 of 600 windows of 1.00 s, 0.333 % of the time"),
        "{error}"
    );
}

#[test]
fn short_gaps_and_empty_cells_are_bridged_and_a_long_gap_divides_the_record() {
    let folder = tempfile::tempdir().unwrap();
    let mut rows = at_rest(6000);
    rows[1500][2] = f64::NAN;
    rows.drain(2000..2010);
    write(folder.path(), &rows);
    let json = || -> serde_json::Value {
        serde_json::from_str(&done(folder.path(), "allan r --json -")).unwrap()
    };
    let samples =
        |json: &serde_json::Value, i: usize| json["channels"][i]["samples"].as_u64().unwrap();
    let bridged = json();
    assert_eq!([samples(&bridged, 0), samples(&bridged, 1)], [6000, 6000]);
    let warnings = bridged["warnings"].to_string();
    assert!(
        warnings.contains("1 gap with 10 lost samples")
            && warnings.contains("1 gap with 1 lost sample,"),
        "{warnings}"
    );
    for row in &mut rows[4990..] {
        row[0] += 3.0;
    }
    write(folder.path(), &rows);
    let json = json();
    assert_eq!(samples(&json, 0), 5000);
    let warnings = json["warnings"].to_string();
    assert!(warnings.contains("before data row 2001"), "{warnings}");
    // `--from` selects the end instead.
    let json: serde_json::Value =
        serde_json::from_str(&done(folder.path(), "allan r --from 53 --json -")).unwrap();
    assert_eq!(json["channels"][0]["samples"], 1000);
    assert_eq!(json["warnings"].as_array().unwrap().len(), 0);
}

#[test]
fn a_bound_that_is_exported_and_codes_coarser_than_the_noise_are_untested() {
    let folder = tempfile::tempdir().unwrap();
    let judgement = || {
        let json: serde_json::Value =
            serde_json::from_str(&done(folder.path(), "allan r --json -")).unwrap();
        let own = &json["judgement"];
        (
            own["kind"].as_str().unwrap().to_owned(),
            own["reason"].to_string(),
        )
    };
    write(folder.path(), &at_rest(1000));
    let (kind, reason) = judgement();
    assert!(
        kind == "untested" && reason.contains("random walk K"),
        "{kind}: {reason}"
    );
    let mut rows = at_rest(6000);
    let column: Vec<f64> = rows.iter().map(|row| row[1]).collect();
    let mean = column.iter().sum::<f64>() / column.len() as f64;
    let variance = column.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / column.len() as f64;
    let step = 4.0 * variance.sqrt();
    for row in &mut rows {
        row[1] = (row[1] / step).round() * step;
    }
    write(folder.path(), &rows);
    let (kind, reason) = judgement();
    assert!(
        kind == "untested" && reason.contains("neighbouring codes"),
        "{kind}: {reason}"
    );
}

#[test]
fn a_swaying_building_is_named_and_the_white_noise_beneath_is_exported() {
    let folder = tempfile::tempdir().unwrap();
    let mut rows = at_rest(60_000);
    for row in &mut rows {
        // 2 mg, as some tower blocks in the wind.
        row[4] += 0.02 * (std::f64::consts::TAU * 0.56 * row[0]).sin();
    }
    write(folder.path(), &rows);
    let text = done(
        folder.path(),
        "allan r -o noise.toml --json a.json --plot a.svg",
    );
    let says = [
        "accel_x: line of the spectrum: 0.560",
        "Hz, narrower than",
        "rms 1.4",
        "dB above",
        "accel_x: lines of the spectrum at 0.560 Hz are not noise of the sensor",
    ];
    assert!(says.iter().all(|s| text.contains(s)), "{text}");
    let json = std::fs::read(folder.path().join("a.json")).unwrap();
    let json: serde_json::Value = serde_json::from_slice(&json).unwrap();
    for (i, channel) in json["channels"].as_array().unwrap().iter().enumerate() {
        let lines = channel["lines"].as_array().unwrap();
        assert_eq!(lines.len(), usize::from(i == 3), "{lines:?}");
        let n = ["lower", "upper"].map(|e| channel["n"][e].as_f64().unwrap());
        // A 99.9 % bound for six channels: a margin of a tenth of the width of a 95 % interval.
        assert!(n[0] < 1.005 * N && n[1] > 0.995 * N, "{i}: {n:?}");
    }
    let line = &json["channels"][3]["lines"][0];
    let ends = [0, 1].map(|k| line["rms_interval"][k].as_f64().unwrap());
    assert!(
        ends[0] < 0.02 / 2f64.sqrt() && 0.02 / 2f64.sqrt() < ends[1],
        "{line}"
    );
    assert!(
        (line["frequency_hz"].as_f64().unwrap() - 0.56).abs()
            < line["resolution_hz"].as_f64().unwrap(),
        "{line}"
    );
    let svg = std::fs::read_to_string(folder.path().join("a.svg")).unwrap();
    assert!(svg.contains("0.560 Hz"));
    done(
        folder.path(),
        "export kalibr -o imu.yaml --noise noise.toml",
    );
}

#[test]
fn readings_in_volts_become_si_by_the_calibration_of_the_unit() {
    let folder = tempfile::tempdir().unwrap();
    let plan = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../rig/plans/table.toml");
    let plan = Plan::read(&plan).unwrap();
    let truth = RigTruth::resolve(&RigFile::default(), 5).unwrap();
    let output = mimu_rig::record::Output::new(&folder.path().join("r"), &plan).unwrap();
    mimu_rig::record::write(&plan, &truth, 5, &output).unwrap();
    let error = refused(folder.path(), "allan r");
    assert!(
        error.contains("moves") && error.contains("--from, --to"),
        "{error}"
    );
    done(folder.path(), "fit r -o cal.toml");
    let rest = "allan r --step 2 --json -";
    let raw: serde_json::Value = serde_json::from_str(&done(folder.path(), rest)).unwrap();
    assert_eq!(raw["channels"][0]["unit"], "V");
    let si = done(folder.path(), &format!("{rest} --calibration cal.toml"));
    let si: serde_json::Value = serde_json::from_str(&si).unwrap();
    // Twenty seconds behind a filter of 40 Hz; the converter adds its own noise.
    let mut outside = 0;
    for (i, sensor) in [(0, &truth.unit.gyro), (3, &truth.unit.accel)] {
        for axis in 0..3 {
            let n = &si["channels"][i + axis]["n"];
            let known = sensor.axes[axis].noise.white;
            let [lower, upper] = ["lower", "upper"].map(|e| n[e].as_f64().unwrap() / known);
            assert!(lower > 0.7 && upper < 1.4, "{i} {axis}: {lower} {upper}");
            outside += usize::from(!(lower..=upper).contains(&1.0));
        }
    }
    assert!(outside <= 1, "{outside} of six");
    one_noise_file_serves_all(folder.path());
    let error = refused(folder.path(), "export kalibr -o imu.yaml --noise cal.toml");
    assert!(error.contains("cal.toml: this is a calibration"), "{error}");
}

/// With a calibration, the file still serves commands that read volts, and also those that need SI.
fn one_noise_file_serves_all(folder: &Path) {
    done(folder, "allan r --step 2 -o raw.toml");
    done(
        folder,
        "allan r --step 2 --calibration cal.toml -o both.toml",
    );
    for command in ["fit r", "verify r --calibration cal.toml", "diagnose r"] {
        let [raw, both] = ["raw", "both"].map(|n| {
            let text = done(folder, &format!("{command} --noise {n}.toml"));
            let text = text.replace(&format!("{n}.toml"), "the file");
            // Terms at the level of chance may be listed or not, depending on the rounding in the two files.
            let lines = text.lines().filter(|line| !line.starts_with("  - "));
            lines.collect::<Vec<_>>().join("\n")
        });
        assert_eq!(raw, both, "{command}");
        assert_ne!(raw, done(folder, command), "{command}: the noise is used");
    }
    let kalibr = "export kalibr -o imu.yaml --gyro-walk 1e-6 --accel-walk 1e-6";
    let design = "design -n 12 --sensor accel";
    for command in [kalibr, design] {
        done(folder, &format!("{command} --noise both.toml"));
        let error = refused(folder, &format!("{command} --noise raw.toml"));
        let says = "its unit is V";
        assert!(
            error.contains(says) && error.contains("--calibration"),
            "{error}"
        );
    }
}
