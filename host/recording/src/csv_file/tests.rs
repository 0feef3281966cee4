//! What a CSV recording may look like, and the message where it may not.

use std::cell::RefCell;

use proptest::prelude::*;

use super::super::{Batch, ReadSummary, Recording};
use crate::error::Result;
use crate::tests::says;

const MANIFEST: &str = "format = \"mimu-recording/1\"\ndevice = \"d\"\nsample_rate_hz = 10\n\
    gravity_mps2 = 9.8\nraw_unit = \"V\"\nreference = \"table\"\n";

/// Reads `text` as samples.csv, `piece` rows at a time; all rows in one batch.
fn read(text: &[u8], piece: usize) -> Result<(Batch, ReadSummary)> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("recording.toml"), MANIFEST).unwrap();
    std::fs::write(folder.path().join("samples.csv"), text).unwrap();
    let recording = Recording::open(folder.path())?;
    let mut all = Batch::default();
    let last = RefCell::new(0.0);
    let summary = recording.in_pieces(
        piece,
        1,
        |share| assert!(share >= last.replace(share) && share <= 1.0),
        |batch| {
            assert_eq!(batch.first_row, all.len() as u64);
            assert!(!batch.is_empty());
            assert_eq!(batch.ragged(&recording.columns), None);
            all.t_s.extend(&batch.t_s);
            all.step.extend(&batch.step);
            all.temp_c.extend(&batch.temp_c);
            for i in 0..6 {
                all.raw[i].extend(&batch.raw[i]);
                all.reference[i].extend(&batch.reference[i]);
            }
            Ok(())
        },
    )?;
    assert_eq!(*last.borrow(), 1.0);
    assert_eq!(summary.rows, all.len() as u64);
    Ok((all, summary))
}

fn refused(text: &str) -> String {
    let whole = read(text.as_bytes(), 1 << 20).unwrap_err().to_string();
    // However many rows are handed on at a time, the message is about the first bad row.
    for piece in [1, 7, 64] {
        let cut = read(text.as_bytes(), piece).unwrap_err().to_string();
        let tail = |message: &str| message.split("samples.csv").nth(1).map(str::to_owned);
        assert_eq!(tail(&cut), tail(&whole));
    }
    assert!(!whole.contains('\n'));
    whole
}

const HEADER: &str = "t_s,step,temp_c,gyro_x,gyro_y,gyro_z,ref_rate_z_dps\n";

fn table(rows: u32) -> String {
    let row = |i: u32| format!("{i}.5,{},{},{i},1e-{},-{i}.25,\n", i / 7, i % 3, i % 20);
    HEADER.to_owned() + &(0..rows).map(row).collect::<String>()
}

#[test]
fn pieces_neither_lose_nor_double_a_row() {
    let text = table(300);
    let (whole, summary) = read(text.as_bytes(), 1 << 20).unwrap();
    assert_eq!(whole.len(), 300);
    for piece in [1, 2, 7, 100, 299, 300, 301] {
        let (cut, cut_summary) = read(text.as_bytes(), piece).unwrap();
        assert_eq!(cut.t_s, whole.t_s, "pieces of {piece} rows");
        assert_eq!(cut.step, whole.step);
        assert_eq!(cut.raw, whole.raw);
        assert_eq!(cut_summary, summary);
    }
}

#[test]
fn line_endings_quotes_byte_order_marks_and_blank_lines_change_nothing() {
    let plain = table(20);
    let (expected, _) = read(plain.as_bytes(), 100).unwrap();
    let variants = [
        plain.replace('\n', "\r\n"),
        format!("\u{feff}{plain}"),
        plain.replace("\n5.5,", "\n\"5.5\","),
        plain.replace('\n', "\n\n"),
        plain
            .replace("t_s", " \"t_s\" ")
            .replace("\" ", "\"")
            .replace(" \"", "\""),
        plain.trim_end().to_owned(),
        plain.replace(',', " , "),
    ];
    for text in variants {
        for piece in [3, 1 << 20] {
            let (batch, _) = read(text.as_bytes(), piece).unwrap();
            assert_eq!(batch.t_s, expected.t_s, "{text}");
            assert_eq!(batch.raw, expected.raw);
        }
    }
}

#[test]
fn empty_cells_and_nan_are_nan_and_an_empty_step_is_in_transit() {
    let text =
        "t_s,step,accel_x,accel_y,accel_z,temp_c\n0,,,nan,NaN,\n1,-1,1,2,3,4\n2,5,1,2,3,nan\n";
    let (batch, _) = read(text.as_bytes(), 10).unwrap();
    assert_eq!(batch.step, [-1, -1, 5]);
    assert!((3..6).all(|i| batch.raw[i][0].is_nan() && !batch.raw[i][1].is_nan()));
    assert!(batch.temp_c[0].is_nan() && batch.temp_c[2].is_nan());
    assert!(batch.raw[0].is_empty() && batch.reference[0].is_empty());
}

#[test]
fn a_bad_cell_is_told_with_row_and_column() {
    let rows = table(40);
    for (bad, column, word) in [
        ("1.5,0,0,oops,1,1,", "gyro_x", "\"oops\""),
        ("1.5,0,0,1,inf,1,", "gyro_y", "infinite"),
        ("1.5,0,0,1,1e999,1,", "gyro_y", "infinite"),
        ("1.5,0.5,0,1,1,1,", "step", "0.5"),
        ("1.5,x_a,0,1,1,1,", "step", "x_a"),
        (",0,0,1,1,1,", "t_s", "empty"),
        ("nan,0,0,1,1,1,", "t_s", "nan"),
        ("1.5,0,warm,1,1,1,", "temp_c", "warm"),
        ("1.5,0,0,1,1,1,--", "ref_rate_z_dps", "--"),
        ("1.5,0,0,1 2,1,1,", "gyro_x", "1 2"),
        ("1.5,0,0,\"zzz\",1,1,", "gyro_x", "zzz"),
    ] {
        let text = refused(&format!("{rows}{bad}\n2.5,0,0,also,bad,rows,\n"));
        assert!(
            text.contains(&format!("row 42, column {column}: ")),
            "{text}"
        );
        assert!(text.contains(word), "{text}");
    }
}

#[test]
fn a_row_of_the_wrong_width_is_told_with_its_row() {
    let rows = table(3);
    for (bad, cells) in [("1.5,0,0,1,1,1", 6), ("1.5,0,0,1,1,1,2,3", 8), ("1;2;3", 1)] {
        let text = refused(&format!("{rows}{bad}\n{}", &rows[HEADER.len()..]));
        assert!(
            text.contains(&format!("row 5: the row has {cells} cells")),
            "{text}"
        );
    }
}

#[test]
fn a_truncated_last_row_is_called_truncated() {
    for end in ["3.5,0,0,1", "3.5,0,0,-", "3", "3.5,0,0,1,2,3"] {
        let text = refused(&format!("{}{end}", table(3)));
        says(&text, &["row 5", "truncated"]);
    }
}

#[test]
fn files_without_rows_are_refused() {
    for (text, word) in [
        ("", "empty"),
        (HEADER, "no row"),
        (HEADER.trim_end(), "no row"),
        ("\n\n\n", "t_s"),
        ("t_s,t_s,gyro_x,gyro_y,gyro_z\n0,0,0,0,0\n", "twice"),
        ("PAR1\0\0\0", "Parquet"),
    ] {
        let error = read(text.as_bytes(), 10).unwrap_err().to_string();
        assert!(error.contains(word), "{error}");
    }
    let blank = format!("{HEADER}{}", "\n".repeat(10));
    assert!(
        read(blank.as_bytes(), 3)
            .unwrap_err()
            .to_string()
            .contains("no row")
    );
}

#[test]
fn a_line_without_end_is_refused_with_its_row() {
    let text = format!("{}{}", table(3), "1,".repeat(1 << 20));
    for piece in [1000, 1 << 20] {
        let error = read(text.as_bytes(), piece).unwrap_err().to_string();
        assert!(error.contains("row 5"), "{error}");
    }
    let error = read("x".repeat(2 << 20).as_bytes(), 100).unwrap_err();
    assert!(error.to_string().contains("line break"), "{error}");
}

#[test]
fn an_unclosed_quote_or_a_quoted_line_break_is_an_error_of_its_own_row() {
    let text = refused(&format!("{HEADER}0,0,0,\"1,1,1,\n1,0,0,1,1,1,\n"));
    assert!(text.contains("row 2"), "{text}");
    let text = refused(&format!("{HEADER}0,0,0,\"1\n\",1,1,\n"));
    assert!(text.contains("row 2"), "{text}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn near_misses_never_panic_and_never_lose_a_row(
        text in "([0-9.,\"nae\r-]{0,12}\n){0,20}",
        chunk in 1_usize..50,
    ) {
        let text = format!("t_s,gyro_x,gyro_y,gyro_z\n{text}");
        let whole = read(text.as_bytes(), 1 << 20).map(|(batch, _)| batch.len());
        let cut = read(text.as_bytes(), chunk).map(|(batch, _)| batch.len());
        prop_assert_eq!(whole.map_err(|e| e.refused().problem.clone()), cut.map_err(|e| e.refused().problem.clone()));
    }

    #[test]
    fn values_come_back_as_they_were_written(values in prop::collection::vec(any::<f64>(), 1..50), chunk in 1_usize..200) {
        let finite: Vec<f64> = values.into_iter().map(|v| if v.abs() > 1e30 { 0.0 } else { v }).collect();
        let mut text = "t_s,gyro_x,gyro_y,gyro_z\n".to_owned();
        for value in &finite {
            text.push_str(&format!("0,{value},{value:e},{value:?}\n"));
        }
        let (batch, _) = read(text.as_bytes(), chunk).unwrap();
        for axis in 0..3 {
            for (read, written) in batch.raw[axis].iter().zip(&finite) {
                prop_assert!(read.to_bits() == written.to_bits() || read.is_nan() && written.is_nan());
            }
        }
    }
}
