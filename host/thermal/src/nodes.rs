//! The nodes of a calibration file: inverse models and their derivatives at temperatures of the dies, between which a device interpolates
//! by cubic Hermite pieces.

use mimu::calibration::{DieTable, NodeTable, OverTemperature, TemperatureNode};
use mimu::signal::blocks::extent;
use mimu::{Angles, Forward, PerSensor, Sensor, Triad};
use mimu_core::compensation::Affine;
use mimu_core::die::LEAST_LAG_S;
use mimu_recording::error::{Argument, Error, Result};

use crate::curves::TriadCurves;
use crate::joint::Joint;
use crate::profile::Lag;

/// Most nodes of a file.
const MOST: usize = 16;
const FEWEST: usize = 3;
/// Largest error of the pieces between the nodes, relative to the standard deviation.
const SHARE_OF_SIGMA: f64 = 0.05;
/// Number of temperatures between two nodes at which the error is checked.
const BETWEEN: usize = 4;

/// An inverse model at one temperature of the dies.
#[derive(Debug, Clone, Copy)]
pub struct Inverse {
    /// `x = C u + o`, raw to SI.
    pub model: Affine<f64>,
    /// Its derivative by temperature, per kelvin.
    pub slope: Affine<f64>,
    /// Standard deviations of C by rows, then of o.
    pub sigma: [f64; 12],
    /// Those of the scale factors and of the biases, raw.
    pub physical: Option<[[f64; 3]; 2]>,
}

/// Standard deviations of scale factors and biases.
pub fn physical(triad: &Triad) -> [[f64; 3]; 2] {
    let physical = triad.physical(Angles::Exact);
    [physical.scale, physical.bias].map(|of| of.map(|e| e.sigma))
}

/// `[temperature]` of a calibration file by `joint`.
///
/// # Errors
/// Curves of biases alone, which are no calibration; a matrix that is singular somewhere.
pub fn over_temperature(joint: &Joint) -> Result<OverTemperature> {
    let curves = joint.curves.as_ref();
    let curves = curves.map(|c| c.as_ref().filter(|c| !c.biases_only()));
    let range_c = extent(curves.present().flat_map(|(_, c)| c.range_c));
    if !(range_c[0] <= range_c[1]) {
        return Err(Error::undetermined(
            "calibration",
            "only biases were estimated, but a calibration needs scale factors and misalignments too",
            "give the unit's calibration at one temperature, fit a recording with a table, or write no calibration",
        )
        .about(Argument::Base));
    }
    let of = |sensor: Sensor, temp_c: f64| with_sigma(curves[sensor]?, temp_c);
    let has = curves.map(|c| c.is_some());
    Ok(with_lags(joint, range_c, fewest(of, has, range_c)?))
}

/// `nodes` with the range and the lags of `joint`.
pub fn with_lags(joint: &Joint, range_c: [f64; 2], nodes: Vec<TemperatureNode>) -> OverTemperature {
    let given = joint.profiles.gyro.is_given();
    // A given lag of zero counts as no lag.
    let of = |sensor: Sensor| joint.lag(sensor).filter(|l| !given || l.value != 0.0);
    // The device does not follow a lag shorter than a sample.
    let followed = |lag: Lag| match lag.value.abs() < LEAST_LAG_S {
        true => 0.0,
        false => lag.value,
    };
    OverTemperature {
        range_c,
        biases_only: joint.recorded().all(TriadCurves::biases_only),
        dies: PerSensor::from_fn(|sensor| {
            let lag = of(sensor);
            DieTable {
                lag_s: lag.map(followed),
                interval_lag_s: lag.filter(|_| !given).map(|l| [l.lower, l.upper]),
                ..DieTable::default()
            }
        }),
        nodes,
    }
}

/// The fewest evenly spaced nodes that keep the Hermite error of C and o below a twentieth of their standard deviations, at most sixteen.
/// `of`: the model of a sensor at a temperature of the dies, for those that it `has`.
///
/// # Errors
/// A matrix that is singular somewhere.
pub fn fewest(
    of: impl Fn(Sensor, f64) -> Option<Inverse>,
    has: PerSensor<bool>,
    range_c: [f64; 2],
) -> Result<Vec<TemperatureNode>> {
    let at = |sensor: Sensor, temp_c: f64| {
        of(sensor, temp_c).ok_or_else(|| {
            Error::undetermined(
                sensor,
                format!("its scale factors vanish at {temp_c:.1} °C"),
                "excite every axis at all temperatures",
            )
        })
    };
    let mut best = Vec::new();
    for count in FEWEST..=MOST {
        best = nodes(&at, has, range_c, count)?;
        if hermite_error(&at, &best)? < SHARE_OF_SIGMA {
            break;
        }
    }
    Ok(best)
}

fn nodes(
    at: &impl Fn(Sensor, f64) -> Result<Inverse>,
    has: PerSensor<bool>,
    [from, to]: [f64; 2],
    count: usize,
) -> Result<Vec<TemperatureNode>> {
    let node = |k: usize| {
        let temp_c = from + (to - from) * k as f64 / (count - 1) as f64;
        let table = |s: Sensor| has[s].then(|| at(s, temp_c).map(table)).transpose();
        Ok(TemperatureNode {
            temp_c,
            gyro: table(Sensor::Gyro)?,
            accel: table(Sensor::Accel)?,
        })
    };
    (0..count).map(node).collect()
}

/// C, o and their derivatives at `temp_c`: for `u = P x + b` they are `C = P⁻¹`, `C' = -C P' C`, `o = -C b`, `o' = -C' b - C b'`.
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

fn with_sigma(curves: &TriadCurves, temp_c: f64) -> Option<Inverse> {
    let [model, slope] = inverse(curves, temp_c)?;
    let triad = curves.triad(temp_c)?;
    let estimates = triad.inverse_estimates();
    Some(Inverse {
        model,
        slope,
        sigma: estimates.map(|e| e.sigma),
        physical: Some(physical(&triad)),
    })
}

fn table(at: Inverse) -> NodeTable {
    let rows = |a: &Affine<f64>| [0, 1, 2].map(|i| [0, 1, 2].map(|j| a.matrix[(i, j)]));
    NodeTable {
        C: rows(&at.model),
        o: at.model.offset.into(),
        slope_C: rows(&at.slope),
        slope_o: at.slope.offset.into(),
        sigma_C: Some([0, 1, 2].map(|i| [0, 1, 2].map(|j| at.sigma[3 * i + j]))),
        sigma_o: Some([0, 1, 2].map(|i| at.sigma[9 + i])),
        sigma_scale_factor: at.physical.map(|[scale, _]| scale),
        sigma_bias: at.physical.map(|[_, bias]| bias),
    }
}

/// Largest error of the Hermite pieces between `nodes`, over the standard deviation of each number.
fn hermite_error(
    at: &impl Fn(Sensor, f64) -> Result<Inverse>,
    nodes: &[TemperatureNode],
) -> Result<f64> {
    let mut worst = 0f64;
    for pair in nodes.windows(2) {
        let h = pair[1].temp_c - pair[0].temp_c;
        for step in 1..=BETWEEN {
            let w = step as f64 / (BETWEEN + 1) as f64;
            let temp_c = pair[0].temp_c + w * h;
            for sensor in Sensor::BOTH {
                let ends = [pair[0].table(sensor), pair[1].table(sensor)];
                let [Some(a), Some(b)] = ends else { continue };
                let at = at(sensor, temp_c)?;
                let piece = hermite(a, b, h, w);
                for k in 0..12 {
                    let exact = match k {
                        0..9 => at.model.matrix[(k / 3, k % 3)],
                        _ => at.model.offset[k - 9],
                    };
                    worst =
                        worst.max((piece[k] - exact).abs() / at.sigma[k].max(f64::MIN_POSITIVE));
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
