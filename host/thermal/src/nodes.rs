//! The nodes of a calibration file: inverse models and their derivatives at temperatures of the dies, between which a device follows
//! cubic Hermite pieces.

use mimu::calibration::{NodeTable, OverTemperature, TemperatureNode};
use mimu::quantity::Sensor;
use mimu::triad::Forward;
use mimu_core::compensation::Affine;
use mimu_recording::error::{Error, Result};

use crate::curves::TriadCurves;
use crate::joint::Joint;

/// Most nodes of a file.
const MOST: usize = 16;
const FEWEST: usize = 3;
/// Error of the pieces between the nodes over the standard deviation, at most.
const SHARE_OF_SIGMA: f64 = 0.05;
/// Temperatures between two nodes at which that is looked at.
const BETWEEN: usize = 4;

/// `[temperature]` of a calibration file by `joint`: as few nodes, evenly over the range of the dies, as keep the Hermite error of C and
/// o below a twentieth of their standard deviations, or sixteen.
///
/// # Errors
/// Curves of biases alone, which are no calibration; a matrix that is singular somewhere.
pub fn over_temperature(joint: &Joint) -> Result<OverTemperature> {
    let curves = [0, 1].map(|k| joint.curves[k].as_ref().filter(|c| !c.biases_only()));
    let ranges = curves.iter().flatten().map(|c| c.range_c);
    let range_c = ranges.fold([f64::INFINITY, f64::NEG_INFINITY], |r, c| {
        [r[0].min(c[0]), r[1].max(c[1])]
    });
    if !(range_c[0] <= range_c[1]) {
        return Err(Error::undetermined(
            "calibration",
            "only biases were estimated, and a calibration needs scale factors and misalignments too",
            "fit a recording with a table (reference = \"table\"), or leave -o out",
        ));
    }
    let mut best = None;
    for count in FEWEST..=MOST {
        let nodes = nodes(&curves, range_c, count)?;
        let error = hermite_error(&curves, &nodes)?;
        best = Some(nodes);
        if error < SHARE_OF_SIGMA {
            break;
        }
    }
    let lag = joint.lag().filter(|_| joint.profile.points.len() > 1);
    Ok(OverTemperature {
        range_c,
        lag_s: lag.map(|l| l.value),
        interval_lag_s: lag.map(|l| [l.lower, l.upper]),
        nodes: best.unwrap_or_default(),
    })
}

fn nodes(
    curves: &[Option<&TriadCurves>; 2],
    [from, to]: [f64; 2],
    count: usize,
) -> Result<Vec<TemperatureNode>> {
    let at = |k: usize| from + (to - from) * k as f64 / (count - 1) as f64;
    let node = |temp_c: f64| {
        let table = |k: usize| {
            curves[k]
                .map(|c| table(c, temp_c).ok_or_else(|| singular(k, temp_c)))
                .transpose()
        };
        Ok(TemperatureNode {
            temp_c,
            gyro: table(0)?,
            accel: table(1)?,
        })
    };
    (0..count).map(|k| node(at(k))).collect()
}

fn singular(sensor: usize, temp_c: f64) -> Error {
    Error::undetermined(
        Sensor::BOTH[sensor],
        format!("its scale factors vanish at {temp_c:.1} °C"),
        "excite every axis at all temperatures",
    )
}

/// C, o and their derivatives at `temp_c`: of `u = P x + b` they are `C = P⁻¹`, `C' = -C P' C`, `o = -C b`, `o' = -C' b - C b'`.
pub fn inverse(curves: &TriadCurves, temp_c: f64) -> Option<[Affine<f64>; 2]> {
    let [model, slope] = curves.forward(temp_c);
    let matrix = Forward::inverse(&model)?;
    let by_k = -(matrix.matrix * slope.matrix * matrix.matrix);
    let derivative = Affine {
        matrix: by_k,
        offset: -(by_k * model.bias) - matrix.matrix * slope.bias,
    };
    Some([matrix, derivative])
}

fn table(curves: &TriadCurves, temp_c: f64) -> Option<NodeTable> {
    let [model, slope] = inverse(curves, temp_c)?;
    let estimates = curves.triad(temp_c)?.inverse_estimates();
    let rows = |a: &Affine<f64>| [0, 1, 2].map(|i| [0, 1, 2].map(|j| a.matrix[(i, j)]));
    Some(NodeTable {
        C: rows(&model),
        o: model.offset.into(),
        slope_C: rows(&slope),
        slope_o: slope.offset.into(),
        sigma_C: Some([0, 1, 2].map(|i| [0, 1, 2].map(|j| estimates[3 * i + j].sigma))),
        sigma_o: Some([0, 1, 2].map(|i| estimates[9 + i].sigma)),
    })
}

/// Largest error of the Hermite pieces between `nodes`, over the standard deviation of each number.
fn hermite_error(curves: &[Option<&TriadCurves>; 2], nodes: &[TemperatureNode]) -> Result<f64> {
    let mut worst = 0f64;
    for pair in nodes.windows(2) {
        let h = pair[1].temp_c - pair[0].temp_c;
        for step in 1..=BETWEEN {
            let w = step as f64 / (BETWEEN + 1) as f64;
            let temp_c = pair[0].temp_c + w * h;
            for sensor in Sensor::BOTH {
                let Some(curve) = curves[sensor as usize] else {
                    continue;
                };
                let ends = [pair[0].table(sensor), pair[1].table(sensor)];
                let [Some(a), Some(b)] = ends else { continue };
                let off = || singular(sensor as usize, temp_c);
                let [exact, _] = inverse(curve, temp_c).ok_or_else(off)?;
                let triad = curve.triad(temp_c).ok_or_else(off)?;
                let sigma = triad.inverse_estimates().map(|e| e.sigma);
                let piece = hermite(a, b, h, w);
                for k in 0..12 {
                    let exact = match k {
                        0..9 => exact.matrix[(k / 3, k % 3)],
                        _ => exact.offset[k - 9],
                    };
                    worst = worst.max((piece[k] - exact).abs() / sigma[k].max(f64::MIN_POSITIVE));
                }
            }
        }
    }
    Ok(worst)
}

/// C by rows and o at the share `w` between two nodes `h` apart.
fn hermite(a: &NodeTable, b: &NodeTable, h: f64, w: f64) -> [f64; 12] {
    let r = 1.0 - w;
    let weights = [
        (1.0 + 2.0 * w) * r * r,
        w * w * (3.0 - 2.0 * w),
        h * w * r * r,
        -h * w * w * r,
    ];
    std::array::from_fn(|k| {
        let of = |t: &NodeTable| match k {
            0..9 => [t.C[k / 3][k % 3], t.slope_C[k / 3][k % 3]],
            _ => [t.o[k - 9], t.slope_o[k - 9]],
        };
        let ([p0, s0], [p1, s1]) = (of(a), of(b));
        weights[0] * p0 + weights[1] * p1 + weights[2] * s0 + weights[3] * s1
    })
}
