//! Trees of calibration files: what is read, labelled, left out and named.

use std::fs;
use std::path::Path;

use mimu::calibration::Calibration;
use mimu::data_sheet::Part;
use mimu::triad::{Part as OfCovariance, Triad};
use mimu::{RawUnit, Reference, Sensor};
use mimu_fleet::fleet;
use mimu_fleet::labels::LabelTable;
use mimu_fleet::tree::{Measurement, Search, Tree};

use crate::plant::Plant;

/// A file with the parameters of `measurement`.
pub fn file(measurement: &Measurement) -> String {
    let text = include_str!("../../../mimu/tests/all/written_files/calibration-0.1.toml");
    let mut file = Calibration::parse(text, "template").unwrap();
    file.device = measurement.unit.clone();
    file.created = measurement.day.map(|d| format!("{d}T12:00:00Z"));
    file.recording.raw_unit = RawUnit::Count;
    file.recording.reference = Some(Reference::Gravity);
    for sensor in Sensor::BOTH {
        let table = match sensor {
            Sensor::Gyro => file.gyro.as_mut().unwrap(),
            Sensor::Accel => file.accel.as_mut().unwrap(),
        };
        let (mut values, mut covariance) = measurement.of.triads[sensor].unwrap();
        if sensor == Sensor::Accel {
            for k in 3..6 {
                values[k] = 0.0;
                covariance.row_mut(k).fill(0.0);
                covariance.column_mut(k).fill(0.0);
            }
        }
        let part = OfCovariance::known(covariance);
        let triad = Triad::from_physical(&values, &[part]).unwrap();
        let by_rows =
            |m: &mimu::nalgebra::Matrix3<f64>| [0, 1, 2].map(|i| [0, 1, 2].map(|j| m[(i, j)]));
        table.raw_unit = RawUnit::Count;
        table.C = by_rows(&triad.inverse.matrix);
        table.o = triad.inverse.offset.into();
        table.covariance = triad
            .inverse_covariance
            .row_iter()
            .map(|r| r.iter().copied().collect())
            .collect();
        table.forward.P = by_rows(&triad.forward.matrix);
        table.forward.b = triad.forward.bias.into();
    }
    file.to_toml()
}

fn write(path: &Path, text: &str) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, text).unwrap();
}

fn read(root: &Path, table: Option<&LabelTable>, part: Option<&Part>) -> Tree {
    let folders = ["line".to_string()];
    let search = Search {
        folders: &folders,
        table,
        part,
    };
    Tree::read(&[root.to_path_buf()], search, &|_| ()).unwrap()
}

#[test]
fn a_tree_is_read_with_its_labels_and_what_cannot_be_read_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    let made = Plant::new(20, 1).tree().measurements;
    for (k, one) in made.iter().enumerate() {
        let path = root.join(format!("line {}/batch=b{}/{}", k % 2, k % 3, one.file));
        write(&path, &file(one));
    }
    let broken = file(&made[0]);
    write(
        &root.join("line 0/broken.toml"),
        &broken[..broken.len() / 2],
    );
    write(
        &root.join("line 0/latin.toml"),
        "format = \"mimu-calibration/1\"\n",
    );
    fs::write(root.join("line 0/latin.toml"), b"device = \"\xff\"\n").unwrap();
    write(
        &root.join("line 0/recording.toml"),
        "format = \"mimu-recording/1\"\n",
    );
    write(&root.join("line 0/Cargo.toml"), "[package]\nname = \"x\"\n");
    write(&root.join(".hidden/u.toml"), "nothing");
    write(&root.join("notes.txt"), "nothing");
    let table = LabelTable::parse(
        "unit,operator,date\nu00003,eva,2026-02-01\nu00004,max,\n",
        "t.csv",
    )
    .unwrap();
    let tree = read(root, Some(&table), None);
    assert_eq!(
        (tree.measurements.len(), tree.others, tree.unlabelled),
        (20, 2, 18)
    );
    let mut left_out: Vec<&str> = tree.left_out.iter().map(|l| l.file.as_str()).collect();
    left_out.sort_unstable();
    assert_eq!(left_out, ["line 0/broken.toml", "line 0/latin.toml"]);
    assert!(
        tree.left_out
            .iter()
            .all(|l| l.reason.contains("line") && l.reason.contains(".toml")),
        "{:?}",
        tree.left_out
    );
    let third = tree
        .measurements
        .iter()
        .find(|m| m.unit == "u00003")
        .unwrap();
    let labels: Vec<String> = third
        .labels
        .iter()
        .map(|(k, v)| format!("{k}={v}"))
        .collect();
    assert_eq!(
        labels,
        ["batch=b0", "date=2026-02-01", "line=line 1", "operator=eva"]
    );
    assert_eq!(third.day.unwrap().to_string(), "2026-02-01");
    let fourth = tree
        .measurements
        .iter()
        .find(|m| m.unit == "u00004")
        .unwrap();
    assert_eq!(fourth.day, made[4].day);
    // Parameters come back as they were written.
    for (read, made) in [(third, &made[3]), (fourth, &made[4])] {
        for sensor in Sensor::BOTH {
            let (a, b) = (
                read.of.triads[sensor].unwrap(),
                made.of.triads[sensor].unwrap(),
            );
            for k in (0..12).filter(|k| sensor == Sensor::Gyro || !(3..6).contains(k)) {
                assert!(
                    (a.0[k] - b.0[k]).abs() < 1e-6 * (1.0 + b.0[k].abs()),
                    "{sensor} {k}"
                );
                assert!(
                    (a.1[(k, k)] / b.1[(k, k)] - 1.0).abs() < 1e-3,
                    "{sensor} {k}: {} {}",
                    a.1[(k, k)],
                    b.1[(k, k)]
                );
            }
        }
    }
}

#[test]
fn calibrations_of_other_readings_and_misfits_are_left_out_with_their_reason() {
    let folder = tempfile::tempdir().unwrap();
    let made = Plant::new(12, 2).tree().measurements;
    for one in &made {
        write(&folder.path().join(&one.file), &file(one));
    }
    let other = file(&made[1]).replace("reference = \"gravity\"", "reference = \"table\"");
    write(&folder.path().join("other.toml"), &other);
    let misfit = file(&made[2]).replace(
        "\n[recording]",
        "\n[judgement]\nkind = \"misfit\"\nreason = \"the error is 3 m/s²\"\n\n[recording]",
    );
    write(&folder.path().join("misfit.toml"), &misfit);
    let result = fleet(read(folder.path(), None, None), None).unwrap();
    assert_eq!((result.units, result.left_out.len()), (12, 2));
    let reason = |name: &str| {
        result
            .left_out
            .iter()
            .find(|l| l.file == name)
            .unwrap()
            .reason
            .clone()
    };
    assert!(
        reason("other.toml")
            .contains("\"table\", most others readings in count with reference \"gravity\""),
        "{}",
        reason("other.toml")
    );
    assert!(
        reason("misfit.toml").contains("judged a misfit"),
        "{}",
        reason("misfit.toml")
    );
    let few = fleet(Tree::default(), None).unwrap_err().to_string();
    assert!(few.contains("0 comparable units"), "{few}");
}

#[test]
fn capability_is_that_of_the_values_in_the_files() {
    let folder = tempfile::tempdir().unwrap();
    let plant = Plant::new(60, 3);
    for one in &plant.tree().measurements {
        write(&folder.path().join(&one.file), &file(one));
    }
    // 940 counts a rad/s are 16.4 a deg/s: the range of 2000 deg/s.
    let part = Part::find("icm42688p").unwrap();
    let tree = read(folder.path(), None, Some(&part));
    let values: Vec<f64> = tree
        .measurements
        .iter()
        .map(|m| {
            100.0
                * (m.of.triads.gyro.unwrap().0[0] / (16.4f64 * 180.0 / std::f64::consts::PI) - 1.0)
        })
        .collect();
    let result = fleet(tree, Some(&part)).unwrap();
    let mean = values.iter().sum::<f64>() / 60.0;
    let sigma = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 59.0).sqrt();
    let found = result
        .capability
        .iter()
        .find(|c| c.axis == "x" && c.sensor == Sensor::Gyro && c.cp.is_some() && c.unit == "%")
        .unwrap();
    assert!(
        (found.mean - mean).abs() < 1e-6 && (found.sigma / sigma - 1.0).abs() < 1e-6,
        "{found:?} {mean} {sigma}"
    );
    assert!((found.cp.unwrap() - 0.5 / (3.0 * sigma)).abs() < 1e-6);
    assert!((found.cpk - (0.5 - mean.abs()) / (3.0 * sigma)).abs() < 1e-6);
    assert!(found.cpk_of_process.unwrap() > found.cpk);
    assert_eq!(
        found.beyond,
        values.iter().filter(|v| v.abs() > 0.5).count()
    );
}
