//! Recordings by other people, found, imported and fitted as by a user.

use std::path::{Path, PathBuf};

use mimu::fit::{Fit, Options, fit};
use mimu::prepared::Prepared;
use mimu::signal::stillness::STILL_FACTOR;
use mimu::triad::half_width_95;
use mimu_core::compensation::Affine;
use mimu_recording::error::Result;
use mimu_recording::{
    Column, ImportOptions, LogOptions, RawUnit, Recording, Reference, TriadName, import,
};
use nalgebra::{DMatrix, DVector, Matrix3, UnitQuaternion, Vector3};
use tempfile::TempDir;

/// The folder of the data set `name`, below `$MIMU_DATA` or beside the repository. `None`, and a printed line, if the data are missing.
pub fn data_set(name: &str) -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let all = std::env::var_os("MIMU_DATA").map_or(beside, PathBuf::from);
    let found = all.join(name);
    if found.is_dir() {
        return Some(found);
    }
    println!("skipped: no recordings (set MIMU_DATA)");
    None
}

/// A foreign recording, described as on the command line of `mimu import`.
#[derive(Debug, Clone)]
pub struct Foreign<'a> {
    /// Files with their `--columns`.
    pub files: Vec<(PathBuf, &'a str)>,
    /// `--rate-hz`.
    pub rate_hz: Option<f64>,
    /// `--gravity`.
    pub gravity_mps2: f64,
    /// `--raw-unit`.
    pub raw_unit: RawUnit,
    /// `--scale`.
    pub scales: &'a [&'a str],
    /// Contents of the file for `--inputs`. With it the reference is a table, without it gravity.
    pub inputs: Option<&'a str>,
}

impl Foreign<'_> {
    /// Imports it into `folder`.
    pub fn import(&self, folder: &TempDir) -> Result<Recording> {
        let (files, columns): (Vec<_>, Vec<_>) = self.files.iter().cloned().unzip();
        let reference = match self.inputs {
            Some(_) => Reference::Table,
            None => Reference::Gravity,
        };
        let inputs = self.inputs.map(|text| {
            let path = folder.path().join("inputs.csv");
            std::fs::write(&path, text).expect("the temporary folder is writable");
            path
        });
        let mut options = ImportOptions::new(files, self.gravity_mps2, self.raw_unit, reference);
        options.log = LogOptions {
            columns: columns.iter().map(|c| c.parse()).collect::<Result<_>>()?,
            rate_hz: self.rate_hz,
            scale: self
                .scales
                .iter()
                .map(|s| s.parse())
                .collect::<Result<_>>()?,
            inputs,
            ..LogOptions::default()
        };
        let out = folder.path().join("recording");
        for warning in import(&options, &out, |_| {})?.warnings {
            println!("import warns: {warning}");
        }
        Recording::open(&out)
    }

    /// Its halves of time, as two recordings, with their samples.
    pub fn halves(&self) -> [(Prepared, Samples); 2] {
        let half = |second: bool| {
            let folder = TempDir::new().expect("there is a temporary folder");
            let files = self.files.iter().map(|(file, columns)| {
                let text = std::fs::read_to_string(file).expect("the file was there a moment ago");
                let lines: Vec<&str> = text.lines().collect();
                let (first, last) = lines.split_at(lines.len() / 2);
                let part = folder.path().join(file.file_name().expect("a file"));
                std::fs::write(&part, if second { last } else { first }.join("\n"))
                    .expect("written");
                (part, *columns)
            });
            let foreign = Foreign {
                files: files.collect(),
                ..self.clone()
            };
            let recording = foreign.import(&folder).expect("importable");
            let prepared = Prepared::read(&recording, STILL_FACTOR, |_| ()).expect("readable");
            (prepared, Samples::of(&recording))
        };
        [false, true].map(half)
    }

    /// Imports it, finds its dwells and fits it; four blocks are held out in turn.
    pub fn fit(&self) -> Result<Fit> {
        let folder = TempDir::new().expect("there is a temporary folder");
        let recording = self.import(&folder)?;
        let prepared = Prepared::read(&recording, STILL_FACTOR, |_| {})?;
        fit(prepared, Options::default())
    }
}

/// The session with an Xsens MTi that was published with IMU-TK; `None` if the data are missing.
pub fn xsens_session() -> Option<Foreign<'static>> {
    let folder = data_set("imu_tk_xsens")?;
    Some(Foreign {
        files: vec![
            (folder.join("xsens_acc.mat"), "t_s,accel_x,accel_y,accel_z"),
            (folder.join("xsens_gyro.mat"), "t_s,gyro_x,gyro_y,gyro_z"),
        ],
        rate_hz: Some(100.0),
        gravity_mps2: 9.81744,
        raw_unit: RawUnit::Count,
        scales: &[],
        inputs: None,
    })
}

/// [`xsens_session`], calibrated.
pub fn xsens() -> Option<Fit> {
    let fit = xsens_session()?.fit();
    Some(fit.expect("it can be fitted"))
}

/// One of the five MPU-9150 of A. Mikov et al. (ICINS 2020); `None` if the data are missing.
pub fn mikoff_session(unit: usize) -> Option<Foreign<'static>> {
    let file = data_set("mikoff_mpu9150x5")?.join(format!("imu{unit}.log"));
    Some(Foreign {
        files: vec![(file, "accel_x,accel_y,accel_z,gyro_x,gyro_y,gyro_z")],
        rate_hz: Some(100.0),
        gravity_mps2: 9.81,
        raw_unit: RawUnit::Si,
        scales: &[],
        inputs: None,
    })
}

/// [`mikoff_session`], calibrated.
pub fn mikoff(unit: usize) -> Option<Fit> {
    let fit = mikoff_session(unit)?.fit();
    Some(fit.expect("it can be fitted"))
}

/// `matrix = U Q` with U upper triangular, its diagonal positive, and Q orthogonal.
///
/// If gravity is the only reference, the frame is a convention: mimu has a lower triangular matrix, others an upper triangular one. `Q` transforms
/// mimu's frame into theirs.
pub fn upper_triangular_frame(matrix: &Matrix3<f64>) -> (Matrix3<f64>, Matrix3<f64>) {
    // Reversing rows and columns turns an upper triangle into a lower one, which the QR factorization of the transpose gives.
    let reverse = Matrix3::new(0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0);
    let qr = (reverse * matrix).transpose().qr();
    let (mut q, mut u) = (
        reverse * qr.q().transpose(),
        reverse * qr.r().transpose() * reverse,
    );
    for k in 0..3 {
        if u[(k, k)] < 0.0 {
            u.column_mut(k).neg_mut();
            q.row_mut(k).neg_mut();
        }
    }
    (u, q)
}

/// Inverse models of accelerometer and gyro with their joint covariance, for conversion to another convention.
#[derive(Debug, Clone)]
pub struct Models {
    parameters: DVector<f64>,
    covariance: DMatrix<f64>,
    /// The terms of the covariance, each with its degrees of freedom.
    parts: Vec<(DMatrix<f64>, f64)>,
}

impl Models {
    /// The models of a fit with both sensors.
    ///
    /// The gyro is fitted in the frame that the accelerometer's estimate defines, as if that frame were exact. So the two covariances are
    /// independent.
    pub fn of(fit: &Fit) -> Self {
        use mimu::quantity::Sensor::{Accel, Gyro};
        let triads = [Accel, Gyro].map(|s| {
            &fit.sensor(s)
                .expect("both sensors were recorded")
                .estimated
                .triad
        });
        let mut parameters = DVector::zeros(24);
        let mut covariance = DMatrix::zeros(24, 24);
        let mut parts = Vec::new();
        for (k, triad) in triads.iter().enumerate() {
            let vector = mimu::triad::vector(&triad.inverse.matrix, &triad.inverse.offset);
            parameters
                .rows_mut(12 * k, 12)
                .copy_from_slice(vector.as_slice());
            for part in triad.inverse_parts() {
                let mut both = DMatrix::zeros(24, 24);
                both.view_mut((12 * k, 12 * k), (12, 12))
                    .copy_from(&part.covariance);
                covariance += &both;
                parts.push((both, part.dof));
            }
        }
        Self {
            parameters,
            covariance,
            parts,
        }
    }

    fn models(parameters: &DVector<f64>) -> [Affine<f64>; 2] {
        [0, 12].map(|from| Affine {
            matrix: Matrix3::from_fn(|i, j| parameters[from + 3 * i + j]),
            offset: Vector3::from_fn(|i, _| parameters[from + 9 + i]),
        })
    }

    /// Value, sigma and half of a 95 % interval of each quantity that `convention` computes from the inverse models of accelerometer and gyro.
    pub fn in_convention(
        &self,
        convention: impl Fn(&Affine<f64>, &Affine<f64>) -> Vec<f64>,
    ) -> Vec<(f64, f64, f64)> {
        let evaluate = |p: &DVector<f64>| {
            let [accel, gyro] = Self::models(p);
            DVector::from_vec(convention(&accel, &gyro))
        };
        let values = evaluate(&self.parameters);
        let mut jacobian = DMatrix::zeros(values.len(), 24);
        for k in 0..24 {
            // The step is one sigma: if the convention is not linear over it, the interval is not either.
            let step = self.covariance[(k, k)].sqrt();
            if step == 0.0 {
                continue;
            }
            let (mut up, mut down) = (self.parameters.clone(), self.parameters.clone());
            up[k] += step;
            down[k] -= step;
            jacobian.set_column(k, &((evaluate(&up) - evaluate(&down)) / (2.0 * step)));
        }
        (0..values.len())
            .map(|i| {
                let by = jacobian.row(i);
                let along = |c: &DMatrix<f64>| (by * c * by.transpose())[0];
                let interval = half_width_95(self.parts.iter().map(|(c, dof)| (along(c), *dof)));
                (values[i], along(&self.covariance).max(0.0).sqrt(), interval)
            })
            .collect()
    }
}

/// Samples as in the foreign file, to integrate them without mimu.
#[derive(Debug, Clone, Default)]
pub struct Samples {
    /// Time, s.
    pub t_s: Vec<f64>,
    /// Raw gyro readings.
    pub gyro: Vec<Vector3<f64>>,
    /// Raw accelerometer readings.
    pub accel: Vec<Vector3<f64>>,
}

/// All numbers of a file, separated by white space or commas, row by row. Lines without numbers are skipped.
pub fn numbers(file: &Path) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(file).expect("the file was there a moment ago");
    let row = |line: &str| {
        let cells = line
            .split(|c: char| c.is_whitespace() || c == ',')
            .filter(|c| !c.is_empty());
        cells.map(|c| c.parse().ok()).collect::<Option<Vec<f64>>>()
    };
    text.lines()
        .filter_map(row)
        .filter(|r| !r.is_empty())
        .collect()
}

/// Row range of every dwell that both sensors can use.
pub fn dwell_rows(fit: &Fit) -> Vec<std::ops::Range<usize>> {
    let usable = fit.prepared.dwells.list.iter().filter(|d| {
        mimu::quantity::Sensor::BOTH
            .iter()
            .all(|s| d.faults[*s].is_none())
    });
    usable
        .map(|d| d.first_row as usize..(d.first_row + d.rows) as usize)
        .collect()
}

impl Samples {
    /// Of a recording.
    pub fn of(recording: &Recording) -> Self {
        let triad = |name: TriadName| -> Vec<Vector3<f64>> {
            let columns = [0, 1, 2].map(|axis| Column::of(name, axis));
            let all = recording.read_columns(&columns, |_| ()).expect("readable");
            let rows = (0..all[0].len()).map(|k| Vector3::new(all[0][k], all[1][k], all[2][k]));
            rows.collect()
        };
        let times = recording.read_columns(&[Column::Time], |_| ());
        Self {
            t_s: times.expect("readable").remove(0),
            gyro: triad(TriadName::GYRO),
            accel: triad(TriadName::ACCEL),
        }
    }

    /// Rotation of the body from one sample to another: a chain of quaternions with the mean rate of neighbouring samples. It transforms a vector
    /// from the frame at `to` into that at `from`.
    pub fn rotation(&self, gyro: &Affine<f64>, from: usize, to: usize) -> UnitQuaternion<f64> {
        (from..to).fold(UnitQuaternion::identity(), |q, k| {
            let rate = gyro.apply(&((self.gyro[k] + self.gyro[k + 1]) * 0.5));
            q * UnitQuaternion::from_scaled_axis(rate * (self.t_s[k + 1] - self.t_s[k]))
        })
    }

    /// Mean specific force over a dwell.
    pub fn force(&self, accel: &Affine<f64>, dwell: &std::ops::Range<usize>) -> Vector3<f64> {
        let sum: Vector3<f64> = self.accel[dwell.clone()].iter().sum();
        accel.apply(&(sum / dwell.len() as f64))
    }
}

/// Result of `mimu verify` for a calibration by other people.
#[derive(Debug, Clone, Copy)]
pub struct Verification {
    /// Error of the magnitude of specific force over dwell means, m/s².
    pub size_mps2: f64,
    /// Error of the direction of gravity after turns, rad.
    pub direction_rad: f64,
    /// Rate at rest over dwell means, rad/s.
    pub rest_rps: f64,
}

/// Judges the calibration `accel`, `gyro` (raw to SI) with the dwells and turns of `fit`.
pub fn verdict(fit: &Fit, accel: &Affine<f64>, gyro: &Affine<f64>) -> Result<Verification> {
    use mimu::calibration::Calibration;
    let mut calibration = Calibration::of(fit, &[], "2020-01-01T00:00:00Z")?;
    let tables = [&mut calibration.accel, &mut calibration.gyro];
    for (table, model) in tables.into_iter().zip([accel, gyro]) {
        let table = table.as_mut().expect("both sensors were recorded");
        table.C = [0, 1, 2].map(|i| [0, 1, 2].map(|j| model.matrix[(i, j)]));
        table.o = model.offset.into();
    }
    let verified = mimu::calibration::verify::verify(&fit.prepared, &calibration)?;
    let judged = verified.sensors.transpose();
    let judged = judged.expect("both sensors can be judged");
    let (accel, gyro) = (judged.accel, judged.gyro);
    Ok(Verification {
        size_mps2: accel.rms,
        direction_rad: gyro.rms,
        rest_rps: gyro.static_rms.expect("judged by turns"),
    })
}

/// Root mean square.
pub fn rms(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, n) = values
        .into_iter()
        .fold((0.0, 0.0), |(sum, n), v| (sum + v * v, n + 1.0));
    (sum / n).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_is_the_product_of_its_triangle_and_its_rotation() {
        let matrix = Matrix3::new(2.0, 0.1, -0.2, 0.3, 1.5, 0.1, -0.1, 0.2, 1.8);
        let (u, q) = upper_triangular_frame(&matrix);
        assert!((u * q - matrix).norm() < 1e-14);
        assert!((q * q.transpose() - Matrix3::identity()).norm() < 1e-14 && q.determinant() > 0.0);
        let below = [u[(1, 0)], u[(2, 0)], u[(2, 1)]];
        assert!(below.iter().all(|x| x.abs() < 1e-14) && u.diagonal().min() > 0.0);
    }
}
