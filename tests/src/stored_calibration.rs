//! Comparison of a calibration file with the truth of the unit. Shares no code with the program that wrote it.

use std::path::Path;

type Matrix = [[f64; 3]; 3];
type Vector = [f64; 3];

/// Forward model of a triad: raw per SI and raw; rows are sensors, columns the body's axes.
#[derive(Clone, Copy, Debug)]
pub struct Forward {
    /// Raw per SI.
    pub matrix: Matrix,
    /// Raw.
    pub bias: Vector,
}

/// Truth of a unit: gyro, accelerometer, and whether its calibration uses the accelerometer's own axes, as by hand.
#[derive(Clone, Copy, Debug)]
pub struct Truth {
    /// Gyro and accelerometer.
    pub triads: [Forward; 2],
    /// Whether the calibration uses the accelerometer's own axes.
    pub by_hand: bool,
}

/// Full inputs: 60 deg/s and gravity.
const SIZES: [f64; 2] = [60.0 / 57.295_779_513, 9.793];

fn dot(a: Vector, b: Vector) -> f64 {
    a.iter().zip(&b).map(|(a, b)| a * b).sum()
}

fn times(m: &Matrix, v: Vector) -> Vector {
    m.map(|row| dot(row, v))
}

fn cross(a: Vector, b: Vector) -> Vector {
    [0, 1, 2].map(|i| a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3])
}

fn inverse(m: &Matrix) -> Matrix {
    let columns = [0, 1, 2].map(|k| cross(m[(k + 1) % 3], m[(k + 2) % 3]));
    let determinant = dot(m[0], columns[0]);
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| columns[j][i] / determinant))
}

/// The axes of a calibration by hand, by rows: x along the accelerometer's x, and the xy plane through its y.
fn own_axes(accel: &Matrix) -> Matrix {
    let unit = |a: Vector| a.map(|v| v / dot(a, a).sqrt());
    let x = unit(accel[0]);
    let along = dot(accel[1], x);
    let y = unit([0, 1, 2].map(|i| accel[1][i] - along * x[i]));
    [x, y, cross(x, y)]
}

impl Truth {
    /// Axes of the calibration in the body frame, by rows.
    fn axes(&self) -> Matrix {
        match self.by_hand {
            true => own_axes(&self.triads[1].matrix),
            false => [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        }
    }
}

struct Table {
    c: Matrix,
    o: Vector,
    half: Option<(Matrix, Vector)>,
}

fn read(file: &Path) -> Result<[Table; 2], String> {
    let text = std::fs::read_to_string(file).map_err(|e| format!("{}: {e}", file.display()))?;
    let table: toml::Table = text
        .parse()
        .map_err(|e| format!("{}: {e}", file.display()))?;
    let number = |v: &toml::Value| {
        v.as_float()
            .or(v.as_integer().map(|i| i as f64))
            .unwrap_or(f64::NAN)
    };
    let vector = |v: &toml::Value| -> Option<Vector> {
        let all: Vec<f64> = v.as_array()?.iter().map(number).collect();
        all.try_into().ok()
    };
    let matrix = |v: &toml::Value| -> Option<Matrix> {
        let rows: Option<Vec<Vector>> = v.as_array()?.iter().map(vector).collect();
        rows?.try_into().ok()
    };
    let of = |name: &str| {
        let table = table.get(name)?;
        let half = table
            .get("interval_C")
            .and_then(matrix)
            .zip(table.get("interval_o").and_then(vector));
        Some(Table {
            c: matrix(table.get("C")?)?,
            o: vector(table.get("o")?)?,
            half,
        })
    };
    let both = of("gyro")
        .zip(of("accel"))
        .map(|(gyro, accel)| [gyro, accel]);
    both.ok_or_else(|| format!("{}: no matrices", file.display()))
}

/// Largest errors of a calibration file over zero input and full inputs along each axis: deg/s, mg.
pub fn errors(file: &Path, truth: &Truth) -> Result<[f64; 2], String> {
    let tables = read(file)?;
    let axes = truth.axes();
    let mut worst = [0.0_f64; 2];
    for ((worst, table), (triad, size)) in worst
        .iter_mut()
        .zip(&tables)
        .zip(truth.triads.iter().zip(SIZES))
    {
        for axis in 0..3 {
            for sign in [1.0, -1.0, 0.0] {
                let input: Vector =
                    std::array::from_fn(|i| if i == axis { sign * size } else { 0.0 });
                // In the body's axes, like the truth.
                let body: Vector =
                    std::array::from_fn(|j| (0..3).map(|k| axes[k][j] * input[k]).sum());
                let raw = times(&triad.matrix, body);
                let raw: Vector = std::array::from_fn(|i| raw[i] + triad.bias[i]);
                let found = times(&table.c, raw);
                let error = (0..3).map(|i| (found[i] + table.o[i] - input[i]).powi(2));
                *worst = worst.max(error.sum::<f64>().sqrt());
            }
        }
    }
    Ok([worst[0].to_degrees(), worst[1] * 1e3 / 9.80665])
}

/// Deviation of each parameter of a calibration file from the truth, in halves of its 95 % interval: gyro and accelerometer, C by rows and o.
/// Parameters that the choice of axes makes zero are left out.
pub fn half_widths(file: &Path, truth: &Truth) -> Result<[Vec<f64>; 2], String> {
    let tables = read(file)?;
    let axes = truth.axes();
    let mut all = [Vec::new(), Vec::new()];
    for (k, table) in tables.iter().enumerate() {
        let (half_c, half_o) = table.half.ok_or("the file has no intervals")?;
        let from_raw = inverse(&truth.triads[k].matrix);
        let columns = [0, 1, 2].map(|j| times(&axes, [0, 1, 2].map(|i| from_raw[i][j])));
        let bias = truth.triads[k].bias;
        for i in 0..3 {
            for j in 0..3 {
                if k == 0 || !truth.by_hand || j <= i {
                    all[k].push((table.c[i][j] - columns[j][i]).abs() / half_c[i][j]);
                }
            }
            let o: f64 = -(0..3).map(|j| columns[j][i] * bias[j]).sum::<f64>();
            all[k].push((table.o[i] - o).abs() / half_o[i]);
        }
    }
    Ok(all)
}
