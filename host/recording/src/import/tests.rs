//! Foreign files of common shapes, and the refusal of those that cannot be read.

use std::path::{Path, PathBuf};

use super::super::{Batch, Manifest, RawUnit, Recording, Reference};
use super::*;
use crate::error::Argument;
use crate::tests::says;

mod broken;
mod clocks;
mod counters;
mod logs;
mod means;
mod one_file;
mod pauses;
mod plausibility;
mod presets;
mod rows;
mod sequence;
mod sources;
mod stamps;
mod thermometers;
mod triads;

const BOTH: &str = "t_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z";

/// Rows at 100 Hz; `readings` gives the six cells of each.
fn log<T: std::fmt::Display>(rows: usize, readings: impl Fn(usize) -> [T; 6]) -> String {
    let row = |i: usize| {
        let cells = readings(i).map(|cell| format!("{cell:.5}")).join(" ");
        format!("{} {cells}\n", 10 * i)
    };
    (0..rows).map(row).collect()
}

fn warned(summary: &ImportSummary, words: &str) -> bool {
    summary.warnings.iter().any(|w| w.contains(words))
}

#[track_caller]
fn warns(summary: &ImportSummary, words: &str) {
    assert!(warned(summary, words), "{summary:?}");
}

/// A folder with foreign files, and the recording made from them.
struct Bench(tempfile::TempDir);

impl Bench {
    fn new(files: &[(&str, &str)]) -> Bench {
        let bench = Bench(tempfile::tempdir().unwrap());
        for (name, text) in files {
            std::fs::write(bench.path(name), text).unwrap();
        }
        bench
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn options(&self, files: &[&str], columns: &[&str]) -> ImportOptions {
        let files = files.iter().map(|name| self.path(name)).collect();
        let mut options = ImportOptions::new(files, 9.81, RawUnit::Count, Reference::Gravity);
        options.log.columns = columns.iter().map(|list| list.parse().unwrap()).collect();
        options
    }

    fn import(&self, options: &ImportOptions) -> Result<(ImportSummary, Batch, Manifest)> {
        let out = self.path("out");
        let _ = std::fs::remove_dir_all(&out);
        let outcome = import(options, &out, |share| assert!((0.0..=1.0).contains(&share)));
        assert_eq!(outcome.is_ok(), out.exists());
        let summary = outcome?;
        let recording = Recording::open(&out)?;
        let mut all = Batch::default();
        recording.for_each_batch(
            |_| (),
            |batch| {
                assert!(all.is_empty(), "more rows than a test should have");
                all = batch.clone();
                Ok(())
            },
        )?;
        assert_eq!(summary.rows, all.len() as u64);
        Ok((summary, all, recording.manifest))
    }

    /// The file `a`, with its columns by name.
    fn import_one(&self, columns: &str) -> Result<(ImportSummary, Batch, Manifest)> {
        self.import(&self.options(&["a"], &[columns]))
    }

    fn refused(&self, options: &ImportOptions) -> String {
        let error = self.import(options).unwrap_err().to_string();
        assert!(!error.contains('\n'));
        error
    }
}

fn one(text: &str, columns: &str) -> Result<(ImportSummary, Batch, Manifest)> {
    let bench = Bench::new(&[("a.txt", text)]);
    let mut options = bench.options(&["a.txt"], &[columns]);
    options.log.rate_hz = Some(100.0);
    bench.import(&options)
}

fn one_refused(text: &str, columns: &str) -> String {
    one(text, columns).unwrap_err().to_string()
}

#[test]
fn metadata_headers_comments_and_blank_lines_are_skipped_and_counted() {
    let text = "Fs,100\nkind,0\n\nax,ay,az\n# made by hand\n1,2,3\n\n4,5,6\n% end\n";
    let (summary, batch, manifest) = one(text, "accel_x,accel_y,accel_z").unwrap();
    assert_eq!(
        summary.skipped,
        SkippedLines {
            header: 3,
            comment: 2,
            blank: 2
        }
    );
    assert_eq!(batch.raw[3], [1.0, 4.0]);
    assert_eq!(batch.t_s, [0.0, 0.01]);
    assert_eq!(manifest.sources[0].file, "a.txt");
    assert_eq!(manifest.device, crate::UNNAMED);
    assert!(
        manifest
            .imported_with
            .iter()
            .all(|argument| !argument.contains('/'))
    );
    assert_eq!(manifest.imported_with[..2], ["a.txt", "--columns"]);
}

#[test]
fn bytes_of_zero_around_lines_are_room_that_was_kept_and_within_them_no_text() {
    // A serial port delivers zeros between two headers, and a card has preallocated space after the last row.
    let zeros = "\0".repeat(600);
    let room = "\0".repeat(3 << 20);
    let text = format!("ax,ay,az\r\n{zeros}ax,ay,az\r\n1,2,3\r\n4,5,6\r\n{room}");
    let (summary, batch, _) = one(&text, "accel_x=ax,accel_y=ay,accel_z=az").unwrap();
    assert_eq!(batch.raw[3], [1.0, 4.0]);
    assert_eq!(summary.skipped.header, 2);
    let bytes = format!("{} bytes of 0", zeros.len() + room.len());
    assert!(summary.warnings[0].contains(&bytes), "{summary:?}");
    let wide: String = "1,2,3\n".chars().flat_map(|c| [c, '\0']).collect();
    let error = one_refused(&wide, "accel_x,accel_y,accel_z");
    assert!(error.contains("a binary file"), "{error}");
}

#[test]
fn every_separator_is_found_out() {
    for text in [
        "1,2,3\n4,5,6\n",
        "1;2;3\n4;5;6\n",
        "1\t2\t3\n4\t5\t6\n",
        "  1.0e0   2 3\n 4\t5 6",
        "1, 2, 3\r\n4, 5, 6\r\n",
        "\u{feff}1,2,3,,,\n4,5,6,,,\n",
        "\"1\",\"2\",\"3\"\n4,5,6\n",
    ] {
        let (_, batch, _) = one(text, "gyro_x,gyro_y,gyro_z").unwrap();
        let columns = [vec![1.0, 4.0], vec![2.0, 5.0], vec![3.0, 6.0]];
        assert_eq!(batch.raw[..3], columns, "{text}");
    }
}

#[test]
fn decimal_commas_names_behind_a_hash_and_empty_rows_at_the_end_are_read() {
    for text in [
        "x;y;z\n1,5;2,25;-3\n4;5,5;6e1\n;;\n;;\n",
        "# made in 2024\n1,5\t2,25\t-3\n4\t5,5\t6e1\n\t\t\n",
        "1,5 2,25 -3,0\n4 5,5 6,0e1\n \n",
    ] {
        let (_, batch, _) = one(text, "gyro_x,gyro_y,gyro_z").unwrap();
        let columns = [vec![1.5, 4.0], vec![2.25, 5.5], vec![-3.0, 60.0]];
        assert_eq!(batch.raw[..3], columns, "{text}");
    }
    let error = one_refused("1;2;3\n1;2,x;3\n", "gyro_x,gyro_y,gyro_z");
    assert!(error.contains("row 2, column gyro_y: \"2,x\""), "{error}");
    let text = "# by hand\n#wx [rad s^-1],wy,wz\n1,2,3\n4,5,6\n,,\n";
    let (summary, batch, _) = one(text, "gyro_x=wx [rad s^-1],gyro_y=wy,gyro_z=wz").unwrap();
    assert_eq!(batch.raw[0], [1.0, 4.0]);
    let skipped = SkippedLines {
        header: 1,
        comment: 1,
        blank: 1,
    };
    assert_eq!(summary.skipped, skipped);
}

#[test]
fn columns_are_chosen_by_position_by_name_or_by_the_names_of_a_recording() {
    let text = "time (ms),wx,wy,wz,T\ns,d,d,d,C\n10,1,2,3,20\n20,4,5,6,\n";
    let names = "gyro_z=wz,gyro_x=wx,gyro_y=wy,t_s=time (ms),temp_c=T";
    for list in [names, "t_s,gyro_x,gyro_y,gyro_z,temp_c"] {
        let (summary, batch, _) = one(text, list).unwrap();
        assert_eq!(summary.skipped.header, 2);
        // Ten apart at 100 Hz: milliseconds.
        assert_eq!((batch.t_s[1], batch.raw[2][1]), (0.02, 6.0));
        assert_eq!(summary.time[0].unit, Some(Decimal::Millisecond));
        assert!(batch.temp_c[1].is_nan());
    }
    let bench = Bench::new(&[(
        "a",
        "t_s,gyro_x,gyro_y,gyro_z,mag\n0,1,2,3,4\n0.5,1,2,3,4\n",
    )]);
    let (summary, batch, manifest) = bench.import(&bench.options(&["a"], &[])).unwrap();
    assert_eq!(batch.raw[1], [2.0, 2.0]);
    assert!(summary.warnings[0].contains("mag"));
    assert_eq!(manifest.sample_rate_hz, 2.0);
}

#[test]
fn time_comes_from_a_column_from_an_index_or_from_the_rate() {
    let (_, batch, _) = one("7,1,2,3\n9,1,2,3\n", "sample,gyro_x,gyro_y,gyro_z").unwrap();
    assert_eq!(batch.t_s, [0.07, 0.09]);
    let bench = Bench::new(&[
        ("a", "1,2,3\n1,2,3\n"),
        ("b", "0,1,2,3\n20,1,2,3\n40,1,2,3\n60,1,2,3\n"),
    ]);
    let error = bench.refused(&bench.options(&["a"], &["gyro_x,gyro_y,gyro_z"]));
    assert!(error.contains("give the rate"), "{error}");
    let mut options = bench.options(&["b"], &["t_s,gyro_x,gyro_y,gyro_z"]);
    options.log.scale = vec!["t_s=0.001".parse().unwrap(), "gyro=2".parse().unwrap()];
    let (_, batch, manifest) = bench.import(&options).unwrap();
    assert_eq!(manifest.sample_rate_hz, 50.0);
    assert_eq!((batch.t_s[2], batch.raw[2][0]), (0.04, 6.0));
}

#[test]
fn bad_rows_are_refused_with_file_row_and_column() {
    let rows = "a,b,c\n1,2,3\n# x\n4,5,6\n";
    for (bad, words) in [
        ("7,8\n", "row 5: the row has 2 cells"),
        ("7,8,9,10\n", "row 5: the row has 4 cells"),
        ("7,x,9\n", "row 5, column gyro_y: \"x\""),
        ("7,8,inf\n", "row 5, column gyro_z"),
    ] {
        let error = one_refused(&format!("{rows}{bad}"), "gyro_x,gyro_y,gyro_z");
        assert!(
            error.contains("a.txt, row 5") && error.contains(words),
            "{error}"
        );
    }
    // A broken cell does not make a header of the first row.
    let error = one_refused("1,2,x\n4,5,6\n", "gyro_x,gyro_y,gyro_z");
    assert!(error.contains("row 1, column gyro_z"), "{error}");
    let long = format!("1,2,3\n{}", "1".repeat(2 << 20));
    assert!(one_refused(&long, "gyro_x,gyro_y,gyro_z").contains("row 2"));
}

#[test]
fn a_list_that_does_not_fit_the_file_is_refused() {
    for (text, columns, words) in [
        (
            "1,2,3,4\n",
            "gyro_x,gyro_y,gyro_z",
            "has 4 cells, but 3 are expected",
        ),
        ("1,2\n", "gyro_x,gyro_y,gyro_z", "has 2 cells"),
        ("words\nonly\n", "gyro_x,gyro_y,gyro_z", "row 1"),
        ("", "gyro_x,gyro_y,gyro_z", "no row"),
        (
            "a,b,c\n1,2,3\n",
            "gyro_x=a,gyro_y=b,gyro_z=d",
            "column \"d\"",
        ),
        ("a,a,c\n1,2,3\n", "gyro_x=a,gyro_y=a,gyro_z=c", "twice"),
        ("1,2\n", "gyro_x,gyro_y", "gyro_z"),
        ("1,2\n", "-,-", "skipped"),
    ] {
        let error = one_refused(text, columns);
        assert!(error.contains(words), "{error}");
    }
}

#[test]
fn binary_files_are_refused_with_what_to_do() {
    for (bytes, words) in [
        (&b"MATLAB 5.0 MAT-file, Platform"[..], "save -ascii"),
        (b"\x89HDF\r\n\x1a\n", "HDF5"),
        (b"\x1f\x8b\x08", "gunzip"),
        (b"\xff\xfe1\0", "UTF-16"),
        (b"1,2\0\x07,3\n", "binary"),
    ] {
        let bench = Bench::new(&[]);
        std::fs::write(bench.path("a.mat"), bytes).unwrap();
        let mut options = bench.options(&["a.mat"], &["gyro_x,gyro_y,gyro_z"]);
        options.log.rate_hz = Some(1.0);
        let error = bench.refused(&options);
        assert!(error.contains(words), "{error}");
    }
}

const ACC: &str = "t_s,accel_x,accel_y,accel_z";
const GYR: &str = "t_s,gyro_x,gyro_y,gyro_z";

/// Rows at the given times; the first value is twice the time.
fn timed(times: &[f64]) -> String {
    times
        .iter()
        .map(|t| format!("{t:?} {} 3 1\n", 2.0 * t))
        .collect()
}

fn join(first: &[f64], second: &[f64]) -> Result<(ImportSummary, Batch, Manifest)> {
    let bench = Bench::new(&[("a", &timed(first)), ("g", &timed(second))]);
    bench.import(&bench.options(&["a", "g"], &[ACC, GYR]))
}

#[test]
fn files_with_the_same_stamps_are_joined_exactly() {
    let times: Vec<f64> = (0..50).map(|i| f64::from(i) * 0.01).collect();
    let (summary, batch, _) = join(&times, &times).unwrap();
    assert_eq!(batch.raw[0], batch.raw[3]);
    assert_eq!((summary.rows, summary.interpolated), (50, 0));
    assert!(summary.warnings.is_empty());
    // A twentieth of a period later is the same instant: the value is taken as it is.
    let late: Vec<f64> = times.iter().map(|t| t + 0.0005).collect();
    let (summary, batch, _) = join(&times, &late).unwrap();
    assert_eq!(batch.raw[0][7], 2.0 * late[7]);
    assert_eq!((summary.rows, summary.interpolated), (50, 0));
}

#[test]
fn other_stamps_are_interpolated_within_the_common_span_and_never_beyond() {
    let first: Vec<f64> = (0..20).map(|i| f64::from(i) * 0.01).collect();
    let second: Vec<f64> = (0..10).map(|i| 0.0234 + f64::from(i) * 0.01).collect();
    let (summary, batch, _) = join(&first, &second).unwrap();
    assert_eq!((summary.rows, summary.interpolated), (9, 9));
    assert_eq!(summary.dropped_outside, 11);
    assert!(summary.warnings[0].contains("white noise"));
    for (t, value) in batch.t_s.iter().zip(&batch.raw[0]) {
        assert!((value - 2.0 * t).abs() < 1e-12);
    }
    assert!(
        join(&[0.0, 0.1], &[5.0, 5.1])
            .unwrap_err()
            .to_string()
            .contains("no time in common")
    );
}

#[test]
fn an_interpolation_does_not_bridge_a_long_gap() {
    let first: Vec<f64> = (0..40).map(|i| f64::from(i) * 0.01 + 0.004).collect();
    let with_gap = |missing: std::ops::Range<i32>| -> Vec<f64> {
        let kept = (0..45).filter(|i| !missing.contains(i));
        kept.map(|i| f64::from(i) * 0.01).collect()
    };
    // Two missing rows make a gap of three periods, three make one of four.
    assert_eq!(
        join(&first, &with_gap(10..12)).unwrap().0.dropped_in_gaps,
        0
    );
    let (summary, _, _) = join(&first, &with_gap(10..13)).unwrap();
    assert_eq!((summary.dropped_in_gaps, summary.rows), (4, 36));
}

const SESSION: &str = "part,n,x,y,z\nx_a,0,1,0,0\nx_a,1,1,0,0\nx_rot,2,0,0,1\nx_rot,3,0,0,1\n\
    x_rot,4,0,0,1\nx_rot,5,0,0,1\n,6,0,0,1\nx_a,7,1,0,0\ny_a,8,0,1,0\n";

#[test]
fn labelled_steps_get_numbers_and_the_known_inputs_of_their_steps() {
    let inputs = "step,ref_force_x_mps2,turn_x_deg\nx_a,9.81,\nx_rot,,360\nghost,1,\n";
    let bench = Bench::new(&[("s.csv", SESSION), ("inputs.csv", inputs)]);
    let mut options = bench.options(&["s.csv"], &["step,sample,accel_x,accel_y,accel_z"]);
    options.log.rate_hz = Some(2.0);
    options.reference = Reference::Table;
    options.log.inputs = Some(bench.path("inputs.csv"));
    let (summary, batch, manifest) = bench.import(&options).unwrap();
    assert_eq!(manifest.step_labels, ["x_a", "x_rot", "y_a"]);
    assert_eq!(batch.step, [0, 0, 1, 1, 1, 1, -1, 0, 2]);
    // Four samples at 2 Hz last two seconds, not one and a half.
    assert_eq!(batch.reference[0][2..6], [180.0; 4]);
    assert!(batch.reference[0][0].is_nan() && batch.reference[0][6].is_nan());
    assert_eq!(batch.reference[3][7], 9.81);
    assert!(batch.reference[3][8].is_nan());
    assert!(batch.reference[1].is_empty());
    assert_eq!(manifest.sources.len(), 2);
    let warnings = summary.warnings.join("\n");
    says(&warnings, &["y_a", "ghost"]);
}

#[test]
fn inputs_without_steps_and_a_table_without_inputs_are_refused() {
    let bench = Bench::new(&[("s.csv", SESSION), ("i.csv", "step,turn_x_deg\nx_a,1\n")]);
    let mut options = bench.options(&["s.csv"], &["-,sample,accel_x,accel_y,accel_z"]);
    options.log.rate_hz = Some(2.0);
    options.log.inputs = Some(bench.path("i.csv"));
    let error = bench.refused(&options);
    assert!(error.contains("no column is step"), "{error}");
    options.log.inputs = None;
    options.reference = Reference::Table;
    let error = bench.refused(&options);
    assert!(error.contains("ref_ column"), "{error}");
}

#[test]
fn a_parquet_file_is_imported_by_name_and_equals_its_source() {
    let bench = Bench::new(&[("s.csv", SESSION)]);
    let mut options = bench.options(&["s.csv"], &["step,sample,accel_x,accel_y,accel_z"]);
    options.log.rate_hz = Some(2.0);
    let (_, expected, _) = bench.import(&options).unwrap();
    let copy = bench.path("copy.parquet");
    std::fs::copy(bench.path("out").join("samples.parquet"), copy).unwrap();
    let by_name = "gyro_x=accel_z,gyro_y=accel_y,gyro_z=accel_x,step=step,t_s=t_s";
    let (_, batch, _) = bench
        .import(&bench.options(&["copy.parquet"], &[by_name]))
        .unwrap();
    assert_eq!(batch.raw[2], expected.raw[3]);
    assert_eq!(
        (batch.step, batch.t_s),
        (expected.step.clone(), expected.t_s.clone())
    );
    let (_, batch, _) = bench
        .import(&bench.options(&["copy.parquet"], &[]))
        .unwrap();
    assert_eq!(batch, expected);
    for (list, words) in [
        ("gyro_x=nope,gyro_y=t_s,gyro_z=t_s", "nope"),
        ("t_s,gyro_x", "columns"),
    ] {
        let error = bench.refused(&bench.options(&["copy.parquet"], &[list]));
        assert!(error.contains(words), "{error}");
    }
}

#[test]
fn a_source_inside_the_recording_to_replace_is_not_deleted() {
    let bench = Bench::new(&[]);
    let out = bench.path("out");
    std::fs::create_dir(&out).unwrap();
    std::fs::write(out.join("samples.csv"), "1,2,3\n").unwrap();
    let mut options = bench.options(&["out/samples.csv"], &["gyro_x,gyro_y,gyro_z"]);
    options.log.rate_hz = Some(1.0);
    options.replace = true;
    let error = import(&options, &out, |_| ()).unwrap_err().to_string();
    assert!(error.contains("is inside the recording"), "{error}");
    assert!(Path::new(&out.join("samples.csv")).exists());
}

#[test]
fn options_that_contradict_each_other_are_refused() {
    let bench = Bench::new(&[("a", "0 1 2 3\n0.1 1 2 3\n"), ("b", "0 1 2 3\n0.1 1 2 3\n")]);
    let error = bench.refused(&bench.options(&["a", "b"], &[ACC]));
    assert!(error.contains("2 files but 1 lists"), "{error}");
    let error = bench.refused(&bench.options(&["a", "b"], &[ACC, ACC]));
    assert!(error.contains("twice"), "{error}");
    let error = bench.refused(&bench.options(&[], &[]));
    assert!(error.contains("no file"), "{error}");
    let mut options = bench.options(&["a"], &[ACC]);
    options.gravity_mps2 = 1.0;
    assert!(bench.refused(&options).contains("looks like g"));
}
