//! What is written is what is read, and it appears whole or not at all.

use std::path::{Path, PathBuf};

use proptest::prelude::*;

use super::super::*;
use crate::error::Result;
use crate::tests::says;

fn manifest() -> Manifest {
    Manifest::new("unit-007", 1000.0, 9.80665, RawUnit::Volt, Reference::Table)
}

fn all_columns() -> Columns {
    Columns {
        step: true,
        temp_c: true,
        gyro: true,
        accel: true,
        reference: [true; 6],
        more: triads(&["mag", "gyro2", "accel2", "mag12"]),
    }
}

fn triads(names: &[&str]) -> Triads {
    let names = names.iter();
    names.map(|name| TriadName::parse(name).unwrap()).collect()
}

/// Rows with every kind of number, and with empty cells.
fn rows(columns: Columns, count: usize) -> Batch {
    let mut batch = Batch::default();
    let odd = [
        0.0,
        -0.0,
        1.0 / 3.0,
        f64::NAN,
        -1e-300,
        65535.0,
        f64::MIN_POSITIVE,
        1e17,
    ];
    for row in 0..count {
        for (index, column) in columns.present().enumerate() {
            match batch.values_mut(column) {
                Some(values) if column == Column::Time => values.push(row as f64 * 0.001),
                Some(values) => values.push(odd[(row + index) % odd.len()] * (1.0 + row as f64)),
                None => batch.step.push(row as i32 / 3 - 1),
            }
        }
    }
    batch
}

fn write(
    path: &Path,
    columns: Columns,
    format: SampleFormat,
    batches: &[Batch],
) -> Result<PathBuf> {
    let mut writer = Writer::create(path, columns, format, false)?;
    for batch in batches {
        writer.write(batch)?;
    }
    writer.finish(&manifest())
}

fn read(path: &Path) -> Result<Batch> {
    let recording = Recording::open(path)?;
    assert_eq!(recording.manifest, manifest());
    let mut all = Batch::default();
    recording.in_pieces(
        1 << 10,
        100,
        |_| (),
        |batch| {
            all.step.extend(&batch.step);
            for column in recording.columns.present() {
                if let (Some(all), Some(values)) = (all.values_mut(column), batch.values(column)) {
                    all.extend(values);
                }
            }
            Ok(())
        },
    )?;
    Ok(all)
}

fn assert_same(a: &Batch, b: &Batch) {
    assert_eq!(a.step, b.step);
    let more = |of: &Batch| -> Vec<TriadName> { of.more.iter().map(|(t, _)| *t).collect() };
    assert_eq!(more(a), more(b));
    let further = more(a).into_iter();
    let further = further.flat_map(|t| [0, 1, 2].map(|axis| Column::of(t, axis)));
    for column in Column::fixed().chain(further) {
        let bits = |batch: &Batch| -> Option<Vec<u64>> {
            let bits = |v: &f64| if v.is_nan() { u64::MAX } else { v.to_bits() };
            Some(batch.values(column)?.iter().map(bits).collect())
        };
        assert_eq!(bits(a), bits(b), "{}", column.name());
    }
}

#[test]
fn every_number_and_every_empty_cell_comes_back_exactly_from_both_formats() {
    let folder = tempfile::tempdir().unwrap();
    let some = Columns {
        gyro: true,
        reference: [false, false, true, false, false, false],
        ..Columns::default()
    };
    for (index, columns) in [all_columns(), some].into_iter().enumerate() {
        for format in [SampleFormat::Csv, SampleFormat::Parquet] {
            let batch = rows(columns, 1000);
            let path = folder
                .path()
                .join(format!("{index}-{}", format.file_name()));
            assert_eq!(
                write(&path, columns, format, std::slice::from_ref(&batch)).unwrap(),
                path
            );
            assert_same(&read(&path).unwrap(), &batch);
            assert_eq!(Recording::open(&path).unwrap().columns, columns);
        }
    }
}

/// Samples of [`rows`] in memory.
#[derive(Debug)]
struct Arrays(Columns, Batch);

impl InMemory for Arrays {
    fn rows(&self) -> usize {
        self.1.len()
    }

    fn columns(&self) -> Columns {
        self.0
    }

    fn append(
        &self,
        column: Column,
        rows: std::ops::Range<usize>,
        values: &mut Vec<f64>,
    ) -> Result<()> {
        match self.1.values(column) {
            Some(all) => values.extend_from_slice(&all[rows]),
            None => values.extend(self.1.step[rows].iter().copied().map(f64::from)),
        }
        Ok(())
    }
}

#[test]
fn a_pair_is_a_recording_of_its_two_triads_whatever_the_samples_are_in() {
    let folder = tempfile::tempdir().unwrap();
    let columns = Columns {
        more: triads(&["mag", "gyro2", "accel2", "accel3"]),
        ..all_columns()
    };
    let batch = rows(columns, 1000);
    let mut recordings: Vec<Recording> = [SampleFormat::Csv, SampleFormat::Parquet]
        .into_iter()
        .map(|format| {
            let path = folder.path().join(format.file_name());
            write(&path, columns, format, std::slice::from_ref(&batch)).unwrap();
            Recording::open(&path).unwrap()
        })
        .collect();
    let arrays = std::sync::Arc::new(Arrays(columns, batch.clone()));
    recordings.push(Recording::in_memory(manifest(), arrays).unwrap());
    let bits = |values: &[f64]| -> Vec<u64> {
        let bits = |v: &f64| if v.is_nan() { u64::MAX } else { v.to_bits() };
        values.iter().map(bits).collect()
    };
    for recording in &recordings {
        let pair = recording.pair(2).unwrap();
        assert_eq!(pair.triads(), [TriadName::GYRO, TriadName::ACCEL]);
        assert!(pair.name().ends_with("pair 2"), "{}", pair.name());
        let of = |name: &str, axis| Column::of(TriadName::parse(name).unwrap(), axis);
        let asked = [Column::Time, Column::Raw(1), Column::Raw(5), Column::Step];
        let behind = [Column::Time, of("gyro2", 1), of("accel2", 2), Column::Step];
        let (viewed, whole) = (
            pair.read_columns(&asked, |_| {}).unwrap(),
            recording.read_columns(&behind, |_| {}).unwrap(),
        );
        for (viewed, whole) in viewed.iter().zip(&whole) {
            assert_eq!(bits(viewed), bits(whole));
            assert_eq!(viewed.len(), 1000);
        }
        let mut seen = 0;
        let read = pair.for_each_batch(
            |_| {},
            |part| {
                let at = seen..seen + part.len();
                seen = at.end;
                assert!(part.more.is_empty());
                assert_eq!(
                    bits(&part.raw[3]),
                    bits(&batch.values(of("accel2", 0)).unwrap()[at.clone()])
                );
                assert_eq!(
                    bits(&part.reference[0]),
                    bits(&batch.reference[0][at.clone()])
                );
                assert_eq!(part.step, batch.step[at]);
                Ok(())
            },
        );
        assert_eq!((read.unwrap().rows, seen), (1000, 1000));
        assert_eq!(recording.pair(3).unwrap().triads(), [TriadName::ACCEL]);
        let error = recording.pair(4).unwrap_err().to_string();
        says(
            &error,
            &[
                "neither gyro4 nor accel4",
                "gyro, accel, mag, gyro2, accel2, accel3",
            ],
        );
    }
}

#[test]
fn many_batches_and_row_groups_read_back_as_one_recording() {
    let folder = tempfile::tempdir().unwrap();
    let columns = all_columns();
    let whole = rows(columns, 1000);
    for (name, row_group) in [("small", 64), ("one", 1 << 20)] {
        let path = folder.path().join(name);
        std::fs::create_dir(&path).unwrap();
        std::fs::write(path.join(MANIFEST_FILE), manifest().to_toml().unwrap()).unwrap();
        let samples = path.join("samples.parquet");
        let properties = Default::default();
        let mut writer = parquet_writer::ParquetWriter::with_properties(
            &samples, columns, properties, row_group,
        )
        .unwrap();
        writer.write(&whole).unwrap();
        writer.finish().unwrap();
        assert_same(&read(&path).unwrap(), &whole);
    }
    let path = folder.path().join("batches");
    let single = |row: usize| {
        let mut batch = Batch::default();
        for column in columns.present() {
            if let (Some(one), Some(values)) = (batch.values_mut(column), whole.values(column)) {
                one.push(values[row]);
            }
        }
        batch.step.push(whole.step[row]);
        batch
    };
    let batches: Vec<Batch> = (0..1000).map(single).collect();
    write(&path, columns, SampleFormat::Csv, &batches).unwrap();
    assert_same(&read(&path).unwrap(), &whole);
}

fn entries(path: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(path).unwrap();
    let mut names: Vec<String> = entries
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

#[test]
fn a_recording_that_is_given_up_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("r");
    let columns = all_columns();
    let mut writer = Writer::create(&path, columns, SampleFormat::Csv, false).unwrap();
    writer.write(&rows(columns, 10)).unwrap();
    assert!(!path.exists());
    drop(writer);
    assert!(entries(folder.path()).is_empty());
    let writer = Writer::create(&path, columns, SampleFormat::Parquet, false).unwrap();
    let error = writer.finish(&manifest()).unwrap_err();
    assert!(error.to_string().contains("no row"), "{error}");
    let mut writer = Writer::create(&path, columns, SampleFormat::Parquet, false).unwrap();
    writer.write(&rows(columns, 10)).unwrap();
    let mut bad = manifest();
    bad.gravity_mps2 = 1.0;
    assert!(writer.finish(&bad).is_err());
    assert!(entries(folder.path()).is_empty());
}

#[test]
fn an_existing_recording_is_replaced_only_when_told_and_other_files_never() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("r");
    let columns = all_columns();
    write(&path, columns, SampleFormat::Csv, &[rows(columns, 5)]).unwrap();
    let error = write(&path, columns, SampleFormat::Csv, &[rows(columns, 6)]).unwrap_err();
    assert!(error.to_string().contains("exists already"), "{error}");
    assert_eq!(read(&path).unwrap().len(), 5);
    let mut writer = Writer::create(&path, columns, SampleFormat::Parquet, true).unwrap();
    writer.write(&rows(columns, 7)).unwrap();
    assert_eq!(read(&path).unwrap().len(), 5);
    writer.finish(&manifest()).unwrap();
    assert_eq!(read(&path).unwrap().len(), 7);
    assert_eq!(entries(&path), ["recording.toml", "samples.parquet"]);
    assert_eq!(entries(folder.path()), ["r"]);
    std::fs::write(path.join("thesis.tex"), "years of work").unwrap();
    let error = Writer::create(&path, columns, SampleFormat::Csv, true).unwrap_err();
    assert!(error.to_string().contains("thesis.tex"), "{error}");
    let file = path.join("thesis.tex");
    assert!(Writer::create(&file, columns, SampleFormat::Csv, true).is_err());
    // Missing folders are created, and removed again with an abandoned recording.
    drop(Writer::create(&folder.path().join("a/b"), columns, SampleFormat::Csv, true).unwrap());
    assert_eq!(entries(folder.path()), ["r"]);
    assert!(Writer::create(Path::new(".."), columns, SampleFormat::Csv, true).is_err());
}

#[test]
fn what_a_reader_would_refuse_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("r");
    let columns = all_columns();
    let refused = |change: fn(&mut Batch), words: &str| {
        let mut writer = Writer::create(&path, columns, SampleFormat::Csv, false).unwrap();
        writer.write(&rows(columns, 3)).unwrap();
        let mut batch = rows(columns, 10);
        change(&mut batch);
        let error = writer.write(&batch).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    };
    refused(
        |batch| batch.raw[1][4] = f64::INFINITY,
        "row 8, column gyro_y",
    );
    refused(|batch| batch.t_s[0] = f64::NAN, "row 4, column t_s");
    refused(|batch| batch.step[9] = -2, "row 13, column step");
    refused(|batch| batch.temp_c.truncate(3), "column temp_c");
    refused(|batch| batch.step.clear(), "column step");
}

#[test]
fn a_directory_that_is_no_recording_says_why() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |words: &str| {
        let error = Recording::open(folder.path()).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    };
    refused("no recording.toml");
    std::fs::write(
        folder.path().join(MANIFEST_FILE),
        manifest().to_toml().unwrap(),
    )
    .unwrap();
    refused("neither");
    let csv = "t_s,gyro_x,gyro_y,gyro_z\n0,1,2,3\n";
    std::fs::write(folder.path().join("samples.csv"), csv).unwrap();
    Recording::open(folder.path()).unwrap();
    std::fs::write(folder.path().join("samples.parquet"), "").unwrap();
    refused("both");
    std::fs::remove_file(folder.path().join("samples.csv")).unwrap();
    refused("samples.parquet");
    let nowhere = Recording::open(&folder.path().join("x"))
        .unwrap_err()
        .to_string();
    says(&nowhere, &["there is no such file or directory"]);
    let file = Recording::open(&folder.path().join(MANIFEST_FILE))
        .unwrap_err()
        .to_string();
    assert!(file.contains("a recording is a directory"), "{file}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn any_finite_number_survives_both_formats(bits in prop::collection::vec(any::<u64>(), 6..60)) {
        let columns = Columns { gyro: true, ..Columns::default() };
        let mut batch = Batch::default();
        for chunk in bits.as_chunks::<3>().0 {
            batch.t_s.push(batch.t_s.len() as f64);
            for (axis, &bits) in chunk.iter().enumerate() {
                let value = f64::from_bits(bits);
                batch.raw[axis].push(if value.abs() > 1e30 { f64::NAN } else { value });
            }
        }
        let folder = tempfile::tempdir().unwrap();
        for format in [SampleFormat::Csv, SampleFormat::Parquet] {
            let path = folder.path().join(format.file_name());
            write(&path, columns, format, std::slice::from_ref(&batch)).unwrap();
            assert_same(&read(&path).unwrap(), &batch);
        }
    }
}
