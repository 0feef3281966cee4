//! A calibration file can be applied by hand, with only the numbers in it.

use std::path::{Path, PathBuf};

use super::command::{done, json};

/// Imports and fits the small recording of the demo in `folder`; returns the JSON of the fit.
fn fitted(folder: &Path) -> serde_json::Value {
    let demo = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../tests/example");
    let files = ["accel.txt", "gyro.txt"].map(|f| demo.join(f).to_str().unwrap().to_string());
    let columns = "--columns t_s,accel_x,accel_y,accel_z --columns t_s,gyro_x,gyro_y,gyro_z";
    let [accel, gyro] = files;
    done(
        folder,
        &format!(
            "import {accel} {gyro} {columns} --raw-unit count --reference gravity -o recording"
        ),
    );
    json(folder, "fit recording -o cal.toml")
}

/// The numbers between the brackets after `key`, read as by a person: without a TOML parser or project code.
fn numbers(text: &str, section: &str, key: &str) -> Vec<f64> {
    let section = text.split(&format!("\n[{section}]\n")).nth(1).unwrap();
    let value = section.split(&format!("\n{key} = [")).nth(1).unwrap();
    let mut depth = 1;
    let end = value
        .find(|c| {
            depth += i32::from(c == '[') - i32::from(c == ']');
            depth == 0
        })
        .unwrap();
    let digits = value[..end].replace(['[', ']', '\n'], " ");
    digits
        .split(',')
        .filter_map(|n| n.trim().parse().ok())
        .collect()
}

#[test]
fn raw_readings_become_gravity_with_the_numbers_in_the_file_alone() {
    let folder = tempfile::tempdir().unwrap();
    let fit = fitted(folder.path());
    let text = std::fs::read_to_string(folder.path().join("cal.toml")).unwrap();
    let (c, o) = (numbers(&text, "accel", "C"), numbers(&text, "accel", "o"));
    let (p, b) = (
        numbers(&text, "accel.forward", "P"),
        numbers(&text, "accel.forward", "b"),
    );
    assert_eq!([c.len(), o.len(), p.len(), b.len()], [9, 3, 9, 3]);
    let residuals = fit["sensors"]["accel"]["residuals"].as_array().unwrap();
    for (dwell, residual) in fit["dwells"].as_array().unwrap().iter().zip(residuals) {
        let u: Vec<f64> = (3..6)
            .map(|i| dwell["raw_mean"][i].as_f64().unwrap())
            .collect();
        let x: Vec<f64> = (0..3)
            .map(|i| c[3 * i] * u[0] + c[3 * i + 1] * u[1] + c[3 * i + 2] * u[2] + o[i])
            .collect();
        let size = (x[0] * x[0] + x[1] * x[1] + x[2] * x[2]).sqrt();
        // The residual of this dwell according to the fit, apart from rounding.
        let left = residual["value"][0].as_f64().unwrap();
        assert!((size - 9.80665 - left).abs() < 1e-11, "{size} {left}");
        // The way back gives the reading again.
        for i in 0..3 {
            let again = p[3 * i] * x[0] + p[3 * i + 1] * x[1] + p[3 * i + 2] * x[2] + b[i];
            assert!((again - u[i]).abs() < 1e-9 * u[i].abs(), "{again} {}", u[i]);
        }
    }
}

#[test]
fn covariance_in_the_file_is_that_of_the_sigmas_and_has_no_negative_direction() {
    let folder = tempfile::tempdir().unwrap();
    fitted(folder.path());
    let text = std::fs::read_to_string(folder.path().join("cal.toml")).unwrap();
    for sensor in ["gyro", "accel"] {
        let covariance = numbers(&text, sensor, "covariance");
        assert_eq!(covariance.len(), 144);
        let sigmas = [
            numbers(&text, sensor, "sigma_C"),
            numbers(&text, sensor, "sigma_o"),
        ]
        .concat();
        for (i, sigma) in sigmas.iter().enumerate() {
            // Sigmas are written to four digits.
            assert!(
                (covariance[13 * i].sqrt() - sigma).abs() <= 6e-4 * sigma,
                "{sensor} {i}"
            );
        }
        let unit = |i: usize| covariance[13 * i].sqrt().max(f64::MIN_POSITIVE);
        let scaled =
            nalgebra::DMatrix::from_fn(12, 12, |i, j| covariance[12 * i + j] / unit(i) / unit(j));
        let smallest = scaled.symmetric_eigenvalues().min();
        assert!(smallest > -1e-9, "{sensor}: {smallest:e}");
    }
}
