//! Bad files, arguments and outputs: damaged, missing, occupied, of another unit.

use std::fs;
use std::path::Path;
use std::process::Command;

use super::answer::*;
use super::generator::*;

#[test]
fn an_output_that_cannot_be_written_is_refused_before_anything_appears() {
    let place = Place::with(&by_hand());
    let recording = place.text("rec");
    let (new, good) = (place.text("new/er/x.toml"), place.text("cal.toml"));
    fs::write(place.path("file"), "").unwrap();
    let below = place.text("file/x.toml");
    let fit = |arguments: &[&str]| {
        let fixed = ["fit", recording.as_str()];
        mimu(fixed.into_iter().chain(arguments.iter().copied()))
    };
    fit(&["-o", &below]).refused(&["file/x.toml", "cannot be created: not a directory"]);
    fit(&["-o", &good, "--json", &below]).refused(&["file/x.toml", "cannot be created"]);
    // Folders that were made for a result are removed with it.
    fit(&["-o", &new, "--json", &below]).refused(&["file/x.toml"]);
    let none = place.text("none.toml");
    fit(&["-o", &new, "--noise", &none]).refused(&["none.toml"]);
    fit(&["-o", &recording]).refused(&["rec", "directory"]);
    fit(&["-o", &good, "--json", &good]).refused(&["cal.toml", "another result"]);
    let samples = place.recording().join("samples.csv");
    let before = fs::read(&samples).unwrap();
    fit(&["-o", &samples.display().to_string()]).refused(&["samples.csv", "an input"]);
    assert_eq!(fs::read(&samples).unwrap(), before);
    // The kernel's file system, which refuses even root.
    if Path::new("/proc/version").exists() {
        fit(&["-o", "/proc/cal.toml"]).refused(&["/proc/cal.toml"]);
    }
    assert_eq!(place.names(), ["file", "rec"]);
}

#[cfg(unix)]
#[test]
fn a_pipe_is_written_to_and_not_replaced() {
    use std::os::unix::fs::FileTypeExt as _;
    let place = Place::with(&by_hand());
    let pipe = place.path("pipe");
    let made = Command::new("mkfifo").arg(&pipe).status();
    assert!(made.unwrap().success());
    let reader = std::thread::spawn({
        let pipe = pipe.clone();
        move || fs::read_to_string(pipe).unwrap()
    });
    let run = mimu(["fit", &place.text("rec"), "-o", &place.text("pipe")]);
    assert_eq!(run.status, Some(0), "{}", run.stderr);
    assert!(reader.join().unwrap().contains("mimu-calibration/1"));
    assert!(fs::metadata(pipe).unwrap().file_type().is_fifo());
}

#[test]
fn a_damaged_calibration_file_is_refused_with_its_place() {
    let place = Place::with(&by_hand());
    let path = place.text("cal.toml");
    let run = mimu(["fit", &place.text("rec"), "-o", &path]);
    assert_eq!(run.status, Some(0), "{}", run.stderr);
    let good = fs::read_to_string(&path).unwrap();
    let verify = || mimu(["verify", &place.text("rec"), "--calibration", &path]);
    assert_eq!(verify().status, Some(0));
    let line = |start: &str| {
        good.lines()
            .find(|l| l.starts_with(start))
            .unwrap()
            .to_string()
    };
    let offset = line("o = ");
    let digit = offset.replacen("0.", "1.", 1);
    assert_ne!(offset, digit);
    let cut = good.find("[accel.judged]").unwrap();
    #[rustfmt::skip]
    let cases: Vec<(String, &[&str])> = vec![
        (good.replacen("[gyro]\n", "[gyro]\nscale = 3\n", 1), &["cal.toml, line", "scale"]),
        (good.replacen(&offset, "o = [nan, 0.0, 0.0]", 1), &["[gyro]", "not a number"]),
        (good.replacen(&offset, &digit, 1), &["[gyro]", "edited"]),
        (good.replacen("calibration/1", "calibration/9", 1), &["calibration/9", "version of mimu"]),
        (good.replacen("direction = \"raw to SI\"", "direction = \"SI to raw\"", 1), &["[gyro]", "SI to raw"]),
        (good[..cut].to_string(), &["cal.toml, line", "forward", "cut"]),
        (good[..good.len() - 9].to_string(), &["cal.toml, line"]),
        (String::new(), &["cal.toml", "the file is empty"]),
        (place.text("rec"), &["cal.toml, line 1"]),
    ];
    for (text, words) in cases {
        assert_ne!(text, good);
        fs::write(&path, text).unwrap();
        verify().refused(words);
    }
    fs::write(&path, [0xff, 0x00]).unwrap();
    verify().refused(&["cal.toml, line 1", "UTF-8"]);
    fs::remove_file(&path).unwrap();
    verify().refused(&["cal.toml", "no such file"]);
}

#[test]
fn a_recording_that_does_not_fit_its_calibration_is_told_apart() {
    let place = Place::with(&by_hand());
    let calibration = place.text("cal.toml");
    let run = mimu(["fit", &place.text("rec"), "-o", &calibration]);
    assert_eq!(run.status, Some(0), "{}", run.stderr);
    let verify = |samples: &Samples| {
        samples.write(&place.path("other"));
        mimu([
            "verify",
            &place.text("other"),
            "--calibration",
            &calibration,
            "--json",
            "-",
        ])
    };
    let fresh = by_hand_at(12, 9, Random::direction);
    let result = verify(&fresh).json();
    assert_eq!(warnings(&result), [""; 0]);
    for sensor in ["gyro", "accel"] {
        let figure = |key: &str| result["sensors"][sensor][key].as_f64().unwrap();
        assert!(figure("rms") < 2.0 * figure("noise_floor"), "{result:#}");
        assert!(figure("rms_raw") > 5.0 * figure("rms"), "{result:#}");
    }
    let mut other = fresh.clone();
    other.set("device", "\"unit-8\"");
    warned(
        &verify(&other).json(),
        &["belongs to \"unit-7\", the recording to \"unit-8\""],
    );
    warned(
        &verify(&by_hand()).json(),
        &["the calibration was made from this recording"],
    );
    let mut other = fresh.clone();
    other.set("raw_unit", "\"V\"");
    verify(&other).refused(&["raw unit is V", "for count"]);
    let mut table = on_table();
    table.names.truncate(11);
    table.rows.iter_mut().for_each(|row| row.truncate(11));
    let gyro_only = verify(&table).json();
    assert!(gyro_only["sensors"]["accel"].is_null());
    verify(&by_hand_at(1, 1, Random::direction)).json();
    let mut blank = on_table();
    for name in blank.names.clone().iter().filter(|n| n.starts_with("ref_")) {
        let all = blank.all();
        blank.edit(name, all, |_| f64::NAN);
    }
    verify(&blank).refused(&["no data"]);
}

#[test]
fn an_import_that_fails_leaves_nothing_behind() {
    let place = Place::new();
    let mut table = on_table();
    table.rows.truncate(500);
    fs::write(place.path("good.csv"), table.csv()).unwrap();
    let word = table.csv().replacen("\n2.5,", "\n2.5,x", 1);
    fs::write(place.path("word.csv"), word).unwrap();
    fs::write(place.path("inputs.csv"), "step,turn_x_deg\n0,90\n0,180\n").unwrap();
    let before = place.names();
    let import = |file: &str, arguments: &[&str]| {
        let (file, out) = (place.text(file), place.text("out"));
        #[rustfmt::skip]
        let fixed = ["import", &file, "--raw-unit", "count", "--reference", "gravity", "-o", &out];
        mimu(fixed.into_iter().chain(arguments.iter().copied()))
    };
    let inputs = place.text("inputs.csv");
    let below = place.text("word.csv/x.json");
    import("word.csv", &[]).refused(&["word.csv, row 252, column step", "x"]);
    import("good.csv", &["--inputs", &inputs])
        .refused(&["inputs.csv, row 3, column step", "twice"]);
    import("good.csv", &["--json", &below]).refused(&["word.csv/x.json", "cannot be created"]);
    import("nothing.csv", &[]).refused(&["nothing.csv", "no such file"]);
    assert_eq!(
        import("good.csv", &["--columns", "t_s,acc_x"]).status,
        Some(2)
    );
    assert_eq!(place.names(), before);
    assert_eq!(import("good.csv", &[]).status, Some(0));
    import("good.csv", &[]).refused(&["out", "exists already"]);
}
