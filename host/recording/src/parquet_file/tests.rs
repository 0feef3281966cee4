//! Parquet files by other programs: types, nulls, row groups, damage.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use parquet::basic::Compression;
use parquet::data_type::{DataType, DoubleType, FloatType, Int32Type, Int64Type};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::parser::parse_message_type;

use super::super::{Batch, Manifest, RawUnit, Recording, Reference};
use crate::error::Result;

type Group<'a> = SerializedRowGroupWriter<'a, File>;

/// A recording whose samples have the given schema; `write` fills one row group a call.
fn recording(schema: &str, groups: usize, write: impl Fn(usize, &mut Group)) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let manifest = Manifest::new("d", 10.0, 9.8, RawUnit::Count, Reference::Table);
    let text = manifest.to_toml().unwrap();
    std::fs::write(folder.path().join("recording.toml"), text).unwrap();
    let file = File::create(folder.path().join("samples.parquet")).unwrap();
    let properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_data_page_size_limit(512)
        .set_write_batch_size(64)
        .build();
    let schema = Arc::new(parse_message_type(schema).unwrap());
    let mut writer = SerializedFileWriter::new(file, schema, Arc::new(properties)).unwrap();
    for index in 0..groups {
        let mut group = writer.next_row_group().unwrap();
        write(index, &mut group);
        group.close().unwrap();
    }
    writer.close().unwrap();
    folder
}

fn column<T: DataType>(group: &mut Group, values: &[T::T], levels: Option<&[i16]>) {
    let mut writer = group.next_column().unwrap().unwrap();
    let typed = writer.typed::<T>();
    typed.write_batch(values, levels, None).unwrap();
    writer.close().unwrap();
}

fn read(folder: &Path, slice: usize) -> Result<Batch> {
    let mut all = Batch::default();
    let recording = Recording::open(folder)?;
    let summary = recording.in_pieces(
        1,
        slice,
        |_| (),
        |batch| {
            assert_eq!(batch.first_row, all.len() as u64);
            assert!(batch.len() <= slice);
            all.t_s.extend(&batch.t_s);
            all.step.extend(&batch.step);
            for i in 0..6 {
                all.raw[i].extend(&batch.raw[i]);
            }
            Ok(())
        },
    )?;
    assert_eq!(Some(summary.rows), recording.rows());
    Ok(all)
}

const MIXED: &str = "message m { required double t_s; optional int64 step;
    optional int32 gyro_x (INTEGER(16, true)); required int32 gyro_y (INTEGER(16, false));
    optional float gyro_z; required binary note (UTF8); }";

fn mixed(groups: usize, rows: usize) -> tempfile::TempDir {
    recording(MIXED, groups, |index, group| {
        let number = |row: usize| index * rows + row;
        let t_s: Vec<f64> = (0..rows).map(|row| number(row) as f64).collect();
        column::<DoubleType>(group, &t_s, None);
        // Every third step and every other reading is null.
        let levels = |n: usize| -> Vec<i16> {
            (0..rows)
                .map(|row| i16::from(!number(row).is_multiple_of(n)))
                .collect()
        };
        let kept = |n: usize| (0..rows).map(number).filter(move |i| !i.is_multiple_of(n));
        let steps: Vec<i64> = kept(3).map(|i| i as i64 / 10).collect();
        column::<Int64Type>(group, &steps, Some(&levels(3)));
        let x: Vec<i32> = kept(2).map(|i| -(i as i32)).collect();
        column::<Int32Type>(group, &x, Some(&levels(2)));
        let y: Vec<i32> = (0..rows).map(|row| 40_000 + number(row) as i32).collect();
        column::<Int32Type>(group, &y, None);
        let z: Vec<f32> = kept(5).map(|i| i as f32 * 0.5).collect();
        column::<FloatType>(group, &z, Some(&levels(5)));
        let notes = vec![parquet::data_type::ByteArray::from("a"); rows];
        column::<parquet::data_type::ByteArrayType>(group, &notes, None);
    })
}

#[test]
fn integers_floats_and_nulls_become_numbers_whatever_the_row_groups_and_slices() {
    for (groups, rows) in [(1, 1000), (7, 100), (1000, 1)] {
        let folder = mixed(groups, rows);
        for slice in [1, 33, 100, 512, 5000] {
            let batch = read(folder.path(), slice).unwrap();
            assert_eq!(batch.len(), groups * rows);
            for i in 0..batch.len() {
                assert_eq!(batch.t_s[i], i as f64);
                let step = if i % 3 == 0 { -1 } else { i as i32 / 10 };
                assert_eq!(batch.step[i], step);
                let same = |value: f64, null: bool, expected: f64| {
                    assert!(
                        if null {
                            value.is_nan()
                        } else {
                            value == expected
                        },
                        "row {i}"
                    );
                };
                same(batch.raw[0][i], i % 2 == 0, -(i as f64));
                same(batch.raw[1][i], false, 40_000.0 + i as f64);
                same(batch.raw[2][i], i % 5 == 0, i as f64 * 0.5);
            }
        }
    }
}

const THREE: &str = "message m { required double t_s; required double step;
    required double gyro_x; required double gyro_y; required double gyro_z; }";

/// A recording of 100 rows in which one value is `bad`.
fn with_bad(column_index: usize, row: usize, bad: f64) -> tempfile::TempDir {
    recording(THREE, 1, |_, group| {
        for index in 0..5 {
            let mut values = vec![1.0; 100];
            if index == column_index {
                values[row] = bad;
            }
            if index == 4 {
                // A later mistake, which must not be reported.
                values[99] = f64::INFINITY;
            }
            column::<DoubleType>(group, &values, None);
        }
    })
}

#[test]
fn a_bad_value_is_told_with_row_and_column() {
    for (index, value, name) in [
        (0, f64::NAN, "t_s"),
        (0, f64::INFINITY, "t_s"),
        (1, 0.5, "step"),
        (1, -2.0, "step"),
        (2, f64::NEG_INFINITY, "gyro_x"),
    ] {
        let folder = with_bad(index, 57, value);
        for slice in [1, 10, 1000] {
            let error = read(folder.path(), slice).unwrap_err().to_string();
            assert!(
                error.contains(&format!("row 58, column {name}: ")),
                "{error}"
            );
        }
    }
}

#[test]
fn columns_that_hold_no_plain_numbers_are_refused_by_name() {
    for (kind, word) in [
        ("required binary gyro_z (UTF8)", "text"),
        ("required boolean gyro_z", "BOOLEAN"),
        (
            "required int64 gyro_z (TIMESTAMP(MILLIS, true))",
            "Timestamp",
        ),
        ("required int32 gyro_z (DECIMAL(5, 2))", "Decimal"),
        ("repeated double gyro_z", "repeated"),
        ("required group gyro_z { required double value; }", "nested"),
    ] {
        let three = "required double t_s; required double gyro_x; required double gyro_y;";
        // A group ends with its brace, all else with a semicolon.
        let end = if kind.ends_with('}') { "" } else { ";" };
        let schema = format!("message m {{ {three} {kind}{end} }}");
        let folder = recording(&schema, 1, |_, group| {
            for _ in 0..3 {
                column::<DoubleType>(group, &[1.0], None);
            }
            let mut last = group.next_column().unwrap().unwrap();
            use parquet::column::writer::ColumnWriter as Any;
            match last.untyped() {
                Any::ByteArrayColumnWriter(w) => {
                    w.write_batch(&[parquet::data_type::ByteArray::from("a")], None, None)
                }
                Any::BoolColumnWriter(w) => w.write_batch(&[true], None, None),
                Any::Int64ColumnWriter(w) => w.write_batch(&[1], None, None),
                Any::Int32ColumnWriter(w) => w.write_batch(&[1], None, None),
                Any::DoubleColumnWriter(w) => w.write_batch(&[1.0], Some(&[1]), Some(&[0])),
                _ => unreachable!(),
            }
            .unwrap();
            last.close().unwrap();
        });
        let error = Recording::open(folder.path()).unwrap_err().to_string();
        assert!(
            error.contains("column gyro_z") && error.contains(word),
            "{error}"
        );
    }
}

#[test]
fn a_file_without_rows_is_refused() {
    let folder = recording(THREE, 0, |_, _| ());
    let error = Recording::open(folder.path()).unwrap_err().to_string();
    assert!(error.contains("no row"), "{error}");
}

#[test]
fn a_damaged_file_is_an_error_or_other_numbers_but_no_panic_of_the_caller() {
    let folder = mixed(2, 300);
    let path = folder.path().join("samples.parquet");
    let whole = std::fs::read(&path).unwrap();
    for length in [0, 3, 8, 12, whole.len() / 2, whole.len() - 1] {
        std::fs::write(&path, &whole[..length]).unwrap();
        assert!(read(folder.path(), 100).is_err());
    }
    for at in (0..whole.len()).step_by(97) {
        let mut damaged = whole.clone();
        damaged[at] ^= 0x55;
        std::fs::write(&path, &damaged).unwrap();
        let _ = read(folder.path(), 100);
    }
}
