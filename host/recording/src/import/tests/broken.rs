//! Rows that cannot be read: refused all at once, or left out and counted.

use super::*;

const NAMES: &str = "t_s,gyro_x,gyro_y,gyro_z";

/// Two hundred rows at 100 Hz, some of them broken.
fn log(broken: &[(usize, &str)]) -> String {
    let row = |i: usize| match broken.iter().find(|(row, _)| *row == i) {
        Some((_, text)) => format!("{text}\n"),
        None => format!("{:.2},{},{},{}\n", i as f64 / 100.0, i % 7, i % 5, i % 3),
    };
    format!("{NAMES}\n") + &(0..200).map(row).collect::<String>()
}

const BROKEN: [(usize, &str); 5] = [
    (10, "0.10,1,x7f,0"),
    (11, "0.11,1,2"),
    (50, "0.50,inf,2,1"),
    (90, ",1,2,3"),
    (150, "1.5,1,2,3,4"),
];

fn limited(text: &str, limit: &str) -> Result<(ImportSummary, Batch, Manifest)> {
    let bench = Bench::new(&[("a.txt", text)]);
    let mut options = bench.options(&["a.txt"], &[NAMES]);
    options.log.skip_broken = Some(limit.parse()?);
    bench.import(&options)
}

#[test]
fn all_kinds_of_broken_rows_are_named_at_once_and_the_option_that_leaves_them_out() {
    let error = one(&log(&BROKEN), NAMES).unwrap_err();
    let text = error.to_string();
    assert!(text.contains("a.txt, row 12, column gyro_y"), "{text}");
    assert!(text.contains("5 of 200 rows are broken"), "{text}");
    says(
        &text,
        &[
            "2 with a cell that is not a reading (rows 12, 52)",
            "2 with another number of cells (rows 13, 152)",
            "1 with no time (row 92)",
        ],
    );
    assert_eq!(error.refused().arguments, [Argument::SkipBroken]);
}

/// A card that is pulled out while it is written.
#[test]
fn a_last_row_without_its_end_is_left_out_with_a_note_and_no_other_row_is() {
    let whole = log(&[]);
    let (summary, batch, _) = one(&(whole.clone() + "2.00,1,2"), NAMES).unwrap();
    assert_eq!((summary.rows, batch.t_s.len()), (200, 200));
    let note = summary.broken_rows[0].to_string();
    assert_eq!(note, "1 of 201 rows are broken: 1 with a cut end (row 202)");
    let error = one(&(log(&BROKEN[..1]) + "2.00,1,2"), NAMES).unwrap_err();
    let text = error.to_string();
    says(&text, &["row 12", "2 of 201"]);
}

#[test]
fn broken_rows_are_left_out_counted_and_listed_up_to_a_limit() {
    let (summary, batch, _) = limited(&log(&BROKEN), "3%").unwrap();
    let [broken] = &summary.broken_rows[..] else {
        panic!("{summary:?}");
    };
    assert_eq!((broken.rows, broken.of, summary.rows), (5, 200, 195));
    assert_eq!(broken.kinds[0].first_rows, [12, 52]);
    assert!(broken.kinds[0].example.contains("x7f"), "{broken:?}");
    // The other rows keep their times; the missing ones are gaps.
    assert_eq!(summary.time[0].missing, 5);
    assert!((batch.t_s[194] - 1.99).abs() < 1e-9);
    assert!(limited(&log(&BROKEN), "5").is_ok());
    for limit in ["4", "2%", "0"] {
        let error = limited(&log(&BROKEN), limit).unwrap_err().to_string();
        assert!(error.contains("5 of 200 rows are broken"), "{error}");
        assert!(error.contains("may be left out"), "{error}");
    }
    for wrong in ["", "-1", "60%", "x", "5 %%"] {
        assert!(limited(&log(&[]), wrong).is_err(), "{wrong}");
    }
}

#[test]
fn a_broken_row_of_a_file_without_times_takes_its_time() {
    let text: String = (0..100)
        .map(|i| {
            if i == 40 {
                "1;2\n".into()
            } else {
                format!("{i};2;{}\n", i % 9)
            }
        })
        .collect();
    let bench = Bench::new(&[("a.txt", &text)]);
    let mut options = bench.options(&["a.txt"], &["gyro_x,gyro_y,gyro_z"]);
    options.log.rate_hz = Some(100.0);
    options.log.skip_broken = Some(BrokenLimit::Rows(1));
    let (summary, batch, _) = bench.import(&options).unwrap();
    assert_eq!(summary.rows, 99);
    assert_eq!((batch.t_s[39], batch.t_s[40]), (0.39, 0.41));
}

/// A logger that starts again writes its greeting and its header once more, and its clock begins at 0.
#[test]
fn a_header_and_a_greeting_among_the_rows_are_left_out_and_the_clock_goes_on() {
    for (clock, columns) in [(true, NAMES), (false, "-,gyro_x,gyro_y,gyro_z")] {
        let row = |i: usize| format!("{},{},{},{}\n", 10 * i, i % 7, i % 5, i % 3);
        let part = |of: std::ops::Range<usize>| of.map(row).collect::<String>();
        let again = if clock { part(2..102) } else { part(100..200) };
        let text = format!("ms,x,y,z\n{}MPU6050 ready\nms,x,y,z\n{again}", part(0..100));
        let (summary, batch, _) = one(&text, columns).unwrap();
        assert_eq!((summary.rows, summary.skipped.header), (200, 3));
        warns(
            &summary,
            "2 lines of words among the rows, the first in row 102",
        );
        assert!(
            batch.t_s.is_sorted() && batch.t_s[100] - batch.t_s[99] > 0.1,
            "{:?}",
            &batch.t_s[98..102]
        );
    }
    // Words in one cell are a broken row.
    assert!(one("10,1,2,3\n20,1,2,3\n30,ovf,2,3\n", NAMES).is_err());
}

/// Sentences in the manner of NMEA; the third has the checksum of the second.
#[test]
fn a_row_with_a_wrong_checksum_is_broken() {
    let text = "$A,10,1,2,3*70\n$A,20,1,2,3*73\n$A,30,1,2,3*73\n$A,40,1,2,3*75\n";
    let error = one(text, "-,t_s,gyro_x,gyro_y,gyro_z")
        .unwrap_err()
        .to_string();
    assert!(error.contains("row 3: its checksum is wrong"), "{error}");
}

#[test]
fn where_no_row_fits_the_first_line_of_data_is_named_with_what_is_wrong_with_it() {
    let rows = "0.01,1,2,3,4\n0.02,1,2,3,4\n0.03,1,2,3\n";
    for (above, row) in [("", 1), ("Logger 1.2\nt;x;y;z;extra\n\n", 4)] {
        let error = one(&format!("{above}{rows}"), "t_s,gyro_x,gyro_y,gyro_z,-,-").unwrap_err();
        let text = error.to_string();
        assert!(text.contains(&format!("a.txt, row {row}: ")), "{text}");
        says(&text, &["the row has 5 cells, but 6 are expected"]);
    }
    // If no line is data, the first of all lines is named.
    let error = one("no\ndata,here\n", NAMES).unwrap_err();
    let text = error.to_string();
    says(&text, &["a.txt, row 1: ", "the row has 1 cells"]);
    let error = one("a,b,c,d\nx,y,z,w,v\n", NAMES).unwrap_err();
    let text = error.to_string();
    says(&text, &["a.txt, row 1: ", "it contains words"]);
}
