//! Further triads in a compensated recording: by numbers worked by hand.

use mimu::calibration::apply::apply;
use mimu::calibration::body::BodyTriad;
use mimu_recording::{
    Batch, Column, Columns, Manifest, RawUnit, Recording, Reference, SampleFormat, TriadName,
    Writer,
};

use crate::comparison::calibration;

fn name(text: &str) -> TriadName {
    TriadName::parse(text).unwrap()
}

/// Twice the reading minus 1 along x, turned by 90 degrees about z.
pub fn turned(triad: &str, unit: &str) -> BodyTriad {
    BodyTriad {
        triad: name(triad),
        reference: TriadName::GYRO,
        formula: "x = C u + o".into(),
        direction: "raw to SI".into(),
        raw_unit: RawUnit::Volt,
        unit: unit.into(),
        C: [[2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]],
        o: [-1.0, 0.0, 0.0],
        sigma_C: [[0.0; 3]; 3],
        sigma_o: [0.0; 3],
        interval_C: [[0.0; 3]; 3],
        interval_o: [0.0; 3],
        rotation_deg: Some([0.0, 0.0, 90.0]),
        interval_rotation_deg: None,
        delay_ms: Some(5.0),
        interval_delay_ms: None,
        lever_arm_mm: None,
        interval_lever_arm_mm: None,
        judgement: None,
        iron: None,
    }
}

/// A recording of 400 rows: the readings of every triad are 1, 2, 3, without a reading of the magnetometer in row 7.
fn recorded(folder: &std::path::Path, more: &[&str]) -> Recording {
    let columns = Columns {
        gyro: true,
        more: more.iter().map(|triad| name(triad)).collect(),
        ..Columns::default()
    };
    let mut batch = Batch::default();
    for row in 0..400 {
        for column in columns.present() {
            let value = match column.triad() {
                None => f64::from(row) * 0.01,
                Some((triad, 0)) if row == 7 && triad == TriadName::MAG => f64::NAN,
                Some((_, axis)) => 1.0 + axis as f64,
            };
            batch.values_mut(column).unwrap().push(value);
        }
    }
    batch.step = Vec::new();
    let mut writer = Writer::create(folder, columns, SampleFormat::Csv, true).unwrap();
    writer.write(&batch).unwrap();
    let manifest = Manifest::new("unit", 100.0, 9.81, RawUnit::Volt, Reference::Gravity);
    writer.finish(&manifest).unwrap();
    Recording::open(folder).unwrap()
}

#[test]
fn further_triads_are_compensated_into_the_frame_of_the_first_and_keep_their_times() {
    let folder = std::env::temp_dir().join(format!("mimu-applied-{}", std::process::id()));
    let recording = recorded(&folder.join("raw"), &["mag", "gyro2", "mag2"]);
    let mut made = calibration([0.0; 3], "unit");
    made.body = vec![turned("mag", "uT"), turned("gyro2", "rad/s")];
    let out = folder.join("out");
    let applied = apply(&recording, &made, &out, SampleFormat::Csv, true, |_| ()).unwrap();
    // The magnetometer without a calibration is left out, with a warning.
    let warned = applied
        .warnings
        .iter()
        .any(|w| w.to_string().contains("mag2"));
    assert!(warned, "{:?}", applied.warnings);
    let of: Vec<_> = applied
        .body
        .iter()
        .map(|of| (of.triad.to_string(), of.empty))
        .collect();
    assert_eq!(of, [("mag".to_string(), 1), ("gyro2".to_string(), 0)]);

    let written = Recording::open(&out).unwrap();
    assert_eq!(written.columns.triads().count(), 3);
    let mut rows = 0;
    let each = |batch: &Batch| {
        for row in 0..batch.len() {
            let at = batch.first_row as usize + row;
            assert!((batch.t_s[row] - 0.01 * at as f64).abs() < 1e-12);
            // 2 (1, 2, 3) - (1, 0, 0) = (1, 4, 6), and a quarter turn about z takes x to y, y to -x.
            for triad in ["mag", "gyro2"] {
                for (axis, expected) in [-4.0, 1.0, 6.0].into_iter().enumerate() {
                    let value = batch.values(Column::of(name(triad), axis)).unwrap()[row];
                    match triad == "mag" && at == 7 {
                        true => assert!(value.is_nan()),
                        false => assert!((value - expected).abs() < 1e-12, "{triad} {value}"),
                    }
                }
            }
            rows += 1;
        }
        Ok(())
    };
    written.for_each_batch(|_| (), each).unwrap();
    assert_eq!(rows, 400);
    std::fs::remove_dir_all(&folder).unwrap();
}
