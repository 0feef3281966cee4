//! A cubesat's gyro in a chamber that only cools (`pan_tvac_gyro`): lines against curves, judged on bursts that were not fitted.
//!
//! The program refuses to fit curvature over a span below 20 K. Here the curves of the estimators are fitted to the means of the bursts all the same,
//! beside bare polynomials. Outside the fitted temperatures the polynomials continue to bend, and the estimators' curves continue along their slope.

use mimu::quantity::Sensor;
use mimu_tests::page::{Block, Table};
use mimu_tests::recordings::data_set;
use mimu_thermal::basis::Shape;
use mimu_thermal::points::{Point, curves};
use nalgebra::{DMatrix, DVector, Vector3};

/// A pause of this length separates two bursts, ms.
const APART_MS: f64 = 10_000.0;
/// Parts that are held out in turn: the bursts k, k + 4, k + 8 and so on.
const PARTS: usize = 4;
/// Noise of a burst's mean, rad/s, against which the estimators weigh smoothness.
const BURST: f64 = 2e-5;

/// Mean of a burst.
struct Burst {
    temp_c: f64,
    rate: Vector3<f64>,
    /// Variance of the mean by noise, from neighbouring samples.
    variance: Vector3<f64>,
}

/// The bursts of the recording; `None` if the data are missing.
fn bursts() -> Option<Vec<Burst>> {
    let file = data_set("pan_tvac_gyro")?.join("TVCtest3_7_20.csv");
    let text = std::fs::read_to_string(file).ok()?;
    let mut samples: Vec<Vec<(f64, Vector3<f64>)>> = Vec::new();
    let mut before = f64::NEG_INFINITY;
    for line in text.lines().skip(1) {
        let cells = line.split(',').filter_map(|c| c.trim().parse().ok());
        let &[ms, _, _, _, x, y, z, counts] = cells.collect::<Vec<f64>>().as_slice() else {
            continue;
        };
        if ms - before > APART_MS {
            samples.push(Vec::new());
        }
        before = ms;
        // Signed 16-bit counts, 172 per kelvin, from an unrecorded origin; the driver's rates are twice the true ones.
        let signed = if counts > 32767.0 {
            counts - 65536.0
        } else {
            counts
        };
        let burst = samples.last_mut()?;
        burst.push((25.0 + signed / 172.0, 0.5 * Vector3::new(x, y, z)));
    }
    let burst = |all: &Vec<(f64, Vector3<f64>)>| {
        let n = all.len() as f64;
        let steps = all.windows(2).map(|w| (w[1].1 - w[0].1).map(|d| d * d));
        Burst {
            temp_c: all.iter().map(|s| s.0).sum::<f64>() / n,
            rate: all.iter().map(|s| s.1).sum::<Vector3<f64>>() / n,
            variance: steps.sum::<Vector3<f64>>() / (2.0 * (n - 1.0) * n),
        }
    };
    Some(samples.iter().map(burst).collect())
}

/// Curves that are compared.
#[derive(Clone, Copy)]
enum Curve {
    /// A bare polynomial of this degree.
    Polynomial(usize),
    /// One of the estimators'.
    Of(Shape),
}

/// Values of `curve`, fitted to `fitted`, at the temperatures of `held`.
fn predicted(curve: Curve, fitted: &[&Burst], held: &[&Burst]) -> Vec<Vector3<f64>> {
    match curve {
        Curve::Polynomial(degree) => {
            let power = |b: &Burst, k: usize| ((b.temp_c - 25.0) / 10.0).powi(k as i32);
            let design = DMatrix::from_fn(fitted.len(), degree + 1, |i, k| power(fitted[i], k));
            let solver = design.svd(true, true);
            let axes = [0, 1, 2].map(|axis| {
                let rates = DVector::from_fn(fitted.len(), |i, _| fitted[i].rate[axis]);
                solver.solve(&rates, 1e-12).expect("both factors are there")
            });
            let value = |b: &&Burst, axis: usize| {
                let terms = (0..=degree).map(|k| power(b, k) * axes[axis][k]);
                terms.sum::<f64>()
            };
            held.iter()
                .map(|b| Vector3::from_fn(|axis, _| value(b, axis)))
                .collect()
        }
        Curve::Of(shape) => {
            let point = |b: &&Burst| Point {
                temp_c: b.temp_c,
                numbers: [
                    1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, b.rate.x, b.rate.y, b.rate.z,
                ],
                // Scale factors are unknown and not needed. All points have the same weight, because their errors are not noise.
                variances: [BURST.powi(2); 12],
            };
            let points: Vec<Point> = fitted.iter().map(point).collect();
            let found = curves(Sensor::Gyro, &points, shape).expect("enough bursts");
            held.iter()
                .map(|b| found.forward(b.temp_c)[0].bias)
                .collect()
        }
    }
}

/// Place of the table in the document.
pub const NAMES: [&str; 1] = ["thermal, cooling"];

/// Errors of lines and curves on the bursts. Without the recording the document keeps its table.
pub fn blocks(_runs: u64) -> Vec<Block> {
    let text = bursts().map(|bursts| {
        let variances = bursts.iter().map(|b| b.variance.sum() / 3.0).sum::<f64>();
        let noise = (variances / bursts.len() as f64).sqrt().to_degrees();
        eprintln!("{} bursts, noise of a mean {noise:.4} deg/s", bursts.len());
        table(&bursts).markdown()
    });
    vec![Block {
        name: NAMES[0],
        text,
    }]
}

fn table(bursts: &[Burst]) -> Table {
    let interleaved = (0..PARTS).map(|part| (0..bursts.len()).map(|k| k % PARTS == part).collect());
    let interleaved: Vec<Vec<bool>> = interleaved.collect();
    let mut table = Table::new(&[
        "curve",
        "every fourth burst",
        "last 7",
        "last 8",
        "last 9",
        "last 10",
    ]);
    let mut of_line = [f64::NAN; 5];
    for (name, curve) in [
        ("line", Curve::Polynomial(1)),
        ("parabola", Curve::Polynomial(2)),
        ("cubic", Curve::Polynomial(3)),
        (
            "`cubic`, extended by its slope at the ends",
            Curve::Of(Shape::Cubic),
        ),
        ("penalised spline", Curve::Of(Shape::Spline)),
    ] {
        let miss = |masks: &[Vec<bool>]| {
            let (mut squares, mut n) = (Vector3::zeros(), 0.0);
            for mask in masks {
                let part = |held: bool| -> Vec<&Burst> {
                    let all = bursts.iter().zip(mask);
                    all.filter(|(_, m)| **m == held).map(|(b, _)| b).collect()
                };
                let held = part(true);
                let said = predicted(curve, &part(false), &held);
                for (b, said) in held.iter().zip(said) {
                    squares += (b.rate - said).map(|e| e * e);
                    n += 1.0;
                }
            }
            squares.map(|s| f64::sqrt(s / n).to_degrees())
        };
        let rms = [0, 7, 8, 9, 10].map(|last| {
            let end = vec![
                (0..bursts.len())
                    .map(|k| k >= bursts.len() - last)
                    .collect(),
            ];
            let masks = if last == 0 { &interleaved } else { &end };
            (miss(masks).norm_squared() / 3.0).sqrt()
        });
        if of_line[0].is_nan() {
            of_line = rms;
        }
        let cells = rms.iter().zip(of_line).map(|(r, line)| match name {
            "line" => format!("{r:.4}"),
            _ => format!("{r:.4} ({})", ratio(r / line)),
        });
        table.row([name.to_string()].into_iter().chain(cells));
    }
    table
}

/// Two significant digits.
fn ratio(x: f64) -> String {
    if x < 1.0 {
        format!("{x:.2}")
    } else {
        format!("{x:.1}")
    }
}
