//! Two calibrations over temperature, curve by curve.

use mimu::calibration::Calibration;
use mimu::quantity::{AXES, Sensor, inverse_names};
use mimu::triad::Forward;
use mimu_recording::error::{Error, Result};
use mimu_recording::statistics::root_mean_square;
use serde::Serialize;

use crate::warning::Warning;

/// Temperatures at which they are compared.
const COUNT: usize = 33;

/// `mimu-thermal-comparison/1`.
#[derive(Debug, Clone, Serialize)]
pub struct Comparison {
    /// `mimu-thermal-comparison/1`.
    pub format: &'static str,
    /// Temperatures of the dies that both cover, °C.
    pub range_c: [f64; 2],
    /// Lags of the dies of gyro and accelerometer in the two, s; null where a calibration has none.
    pub lags_s: [Option<[f64; 2]>; 2],
    /// Differences by parameter.
    pub curves: Vec<Difference>,
    /// What a person should know.
    pub warnings: Vec<Warning>,
}

/// Second calibration minus the first in one parameter.
#[derive(Debug, Clone, Serialize)]
pub struct Difference {
    /// Sensor and parameter: the inverse model as in the file, then `scale_` (ratio minus one) and `bias_` (SI).
    pub name: String,
    /// SI or raw unit of the values.
    pub unit: String,
    /// Temperatures, °C.
    pub temp_c: Vec<f64>,
    /// Differences.
    pub value: Vec<f64>,
    /// Their root mean square.
    pub rms: f64,
    /// The largest, and where it is, °C.
    pub largest: [f64; 2],
    /// Root mean square in standard deviations of both; null if a calibration has no standard deviations.
    pub sigmas: Option<f64>,
}

/// Compares `b` with `a`.
///
/// # Errors
/// Calibrations of two units, of other readings, or without a temperature in common.
pub fn compare(a: &Calibration, b: &Calibration) -> Result<Comparison> {
    if a.recording.raw_unit != b.recording.raw_unit {
        let problem = format!(
            "one is for readings in {}, the other in {}",
            a.recording.raw_unit, b.recording.raw_unit
        );
        return Err(Error::new(
            "calibrations",
            problem,
            "compare calibrations of the same readings",
        ));
    }
    let [one, other] = [a, b].map(|c| c.temperature.as_ref().map(|t| t.range_c));
    let (Some(one), Some(other)) = (one, other) else {
        let problem = "one of them has no [temperature]";
        let remedy = "compare two files of `mimu thermal fit`";
        return Err(Error::new("calibrations", problem, remedy));
    };
    let range_c = [one[0].max(other[0]), one[1].min(other[1])];
    if !(range_c[0] < range_c[1]) {
        let problem = format!(
            "they have no temperature in common: {:.1} to {:.1} °C and {:.1} to {:.1} °C",
            one[0], one[1], other[0], other[1]
        );
        return Err(Error::new(
            "calibrations",
            problem,
            "fit recordings that overlap",
        ));
    }
    let mut warnings = Vec::new();
    if a.device != b.device {
        warnings.push(Warning::TwoUnits {
            one: a.device.clone(),
            other: b.device.clone(),
        });
    }
    let curves = Sensor::BOTH
        .into_iter()
        .flat_map(|s| of_sensor(a, b, s, range_c));
    Ok(Comparison {
        format: "mimu-thermal-comparison/1",
        range_c,
        lags_s: [a, b].map(|c| {
            let lags_s = c.temperature.as_ref()?.lags_s()?;
            Some([lags_s.gyro, lags_s.accel])
        }),
        curves: curves.collect(),
        warnings,
    })
}

/// Twelve numbers of the inverse model, then three ratios of scale factors and three biases, SI.
fn numbers(c: &Calibration, sensor: Sensor, temp_c: f64) -> Option<[f64; 18]> {
    let inverse = c.inverse_at(sensor, temp_c)?;
    let forward = Forward::of(&inverse)?;
    let scale = |k: usize| forward.matrix.row(k).norm();
    Some(std::array::from_fn(|k| match k {
        0..9 => inverse.matrix[(k / 3, k % 3)],
        9..12 => inverse.offset[k - 9],
        12..15 => scale(k - 12),
        _ => forward.bias[k - 15] / scale(k - 15),
    }))
}

/// Standard deviation of number `k` of the inverse model at the node nearest to `temp_c`.
fn sigma(c: &Calibration, sensor: Sensor, temp_c: f64, k: usize) -> Option<f64> {
    let nodes = &c.temperature.as_ref()?.nodes;
    let off = |t: f64| (t - temp_c).abs();
    let node = nodes
        .iter()
        .min_by(|a, b| off(a.temp_c).total_cmp(&off(b.temp_c)))?;
    let table = node.table(sensor)?;
    match k {
        0..9 => Some(table.sigma_C?[k / 3][k % 3]),
        9..12 => Some(table.sigma_o?[k - 9]),
        _ => None,
    }
}

fn of_sensor(
    a: &Calibration,
    b: &Calibration,
    sensor: Sensor,
    range_c: [f64; 2],
) -> Vec<Difference> {
    let temp = |k: usize| range_c[0] + (range_c[1] - range_c[0]) * k as f64 / (COUNT - 1) as f64;
    let temps: Vec<f64> = (0..COUNT).map(temp).collect();
    let both: Option<Vec<[[f64; 18]; 2]>> = temps
        .iter()
        .map(|t| Some([numbers(a, sensor, *t)?, numbers(b, sensor, *t)?]))
        .collect();
    let Some(both) = both else {
        return Vec::new();
    };
    let physical = ["scale", "bias"]
        .into_iter()
        .flat_map(|n| AXES.map(|x| format!("{n}_{x}")));
    let names = inverse_names().into_iter().chain(physical);
    let si = sensor.unit();
    let each = names.enumerate().map(|(k, name)| {
        let value: Vec<f64> = both
            .iter()
            .map(|[a, b]| match k {
                12..15 => b[k] / a[k] - 1.0,
                _ => b[k] - a[k],
            })
            .collect();
        let rms = root_mean_square(value.iter().copied());
        let at = (0..COUNT)
            .max_by(|i, j| value[*i].abs().total_cmp(&value[*j].abs()))
            .unwrap_or(0);
        let squares: Option<f64> = (0..COUNT)
            .map(|i| {
                let [x, y] = [a, b].map(|c| sigma(c, sensor, temps[i], k));
                Some(value[i].powi(2) / (x?.powi(2) + y?.powi(2)))
            })
            .sum();
        Difference {
            name: format!("{sensor}_{name}"),
            unit: match k {
                0..9 => format!("({si})/{}", a.recording.raw_unit),
                12..15 => "1".into(),
                _ => si.into(),
            },
            temp_c: temps.clone(),
            rms,
            largest: [value[at], temps[at]],
            sigmas: squares
                .map(|s| (s / COUNT as f64).sqrt())
                .filter(|s| s.is_finite()),
            value,
        }
    });
    each.collect()
}
