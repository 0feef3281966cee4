//! The biases of a calibration over temperature as cubics, for programs that compensate nothing else over temperature, and the error that remains
//! without scale factors, cross terms and the lag of the dies.

mod at_rest;

use nalgebra::{DMatrix, DVector, Vector3};
use serde::Serialize;

use crate::calibration::{Calibration, Curves};
use crate::quantity::{AXES, Sensor};
use crate::readable::STANDARD_GRAVITY;
use crate::triad::Forward;
use mimu_recording::{Error, RawUnit, Result};

/// Temperatures at which a cubic is fitted and judged.
const POINTS: usize = 401;
/// Narrowest range, K: over less, a cubic would follow the errors of the curves.
const NARROWEST_K: f64 = 10.0;
/// Largest share of an axis' sensitivity that may lie along the other two: beyond it, the axes are permuted.
const MOST_ACROSS: f64 = 0.3;
/// Assumed rate of change of the thermometer, K/s, to judge the lag of the dies: 2 K/min, as in a chamber.
const RAMP_K_PER_S: f64 = 2.0 / 60.0;

/// How the program converts a raw reading, axis by axis: `v_i = si_per_raw_i (u_i - zero_i)`, raw to SI.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Conversion {
    /// rad/s or m/s² per raw unit.
    pub si_per_raw: [f64; 3],
    /// Raw reading that it takes as zero input.
    pub zero_raw: [f64; 3],
}

/// The given part of a conversion; the rest follows from the calibration.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct KnownConversion {
    /// One factor for the three axes, rad/s or m/s² per raw unit.
    pub si_per_raw: Option<f64>,
    /// One zero reading for the three axes, raw.
    pub zero_raw: Option<f64>,
}

/// A remaining error, over the range of temperatures and the three axes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Remainder {
    /// Where it comes from.
    pub source: &'static str,
    /// Input or state for which it holds.
    pub condition: &'static str,
    /// Root of the mean square, SI; `None` if it is not known.
    pub rms: Option<f64>,
    /// Largest size, SI.
    pub max: Option<f64>,
}

/// Bias of a triad as cubics: `bias_i(T) = Σ_k coefficients[i][k] (T - reference_c)^k` in SI, in the program's readings.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BiasCubics {
    /// The triad.
    pub sensor: Sensor,
    /// rad/s or m/s².
    pub unit: &'static str,
    /// °C.
    pub reference_c: f64,
    /// °C.
    pub range_c: [f64; 2],
    /// SI/K^k, in single precision, as programs store them.
    pub coefficients: [[f64; 4]; 3],
    /// How the program converts the readings.
    pub conversion: Conversion,
    /// Errors that remain once the cubic is subtracted and the program is calibrated at `settled_c`.
    pub remains: Vec<Remainder>,
    /// Temperature at which the program's own scale factors hold, °C; `None` if the calibration does not contain them.
    pub settled_c: Option<f64>,
}

impl BiasCubics {
    /// The cubics of `sensor` over `range_c`, about `reference_c`; `None` if the calibration has no curves of it.
    ///
    /// # Errors
    /// A range of less than 10 K; readings that are not those of the sensor's own axes, which a bias for each axis cannot correct.
    pub fn of(
        calibration: &Calibration,
        sensor: Sensor,
        known: &KnownConversion,
        range_c: [f64; 2],
        reference_c: f64,
    ) -> Result<Option<Self>> {
        let (Some(curves), Some(over)) = (calibration.curves(), &calibration.temperature) else {
            return Ok(None);
        };
        if !over.has(sensor) {
            return Ok(None);
        }
        wide_enough(sensor, range_c)?;
        let [from, to] = range_c;
        let settled_c = match calibration.recording.temp_c {
            Some(temp_c) if (from..=to).contains(&temp_c) => temp_c,
            _ => 0.5 * (from + to),
        };
        let at = |temp_c: f64| forward(&curves, sensor, temp_c);
        let conversion = Conversion::of(calibration, sensor, known, &at(settled_c)?)?;
        let models: Vec<Forward> = temperatures(range_c).map(at).collect::<Result<_>>()?;
        let bias = |model: &Forward| conversion.bias(model);
        let biases: Vec<Vector3<f64>> = models.iter().map(bias).collect();
        let mut cubics = Self::nearest(sensor, range_c, reference_c, conversion, &biases);
        cubics.settled_c = Some(settled_c);
        cubics.remains.push(cubics.misses(&biases));
        cubics
            .remains
            .extend(linear(&models, &at(settled_c)?, sensor, over.biases_only));
        let lag_s = over.lags_s().map(|lags_s| lags_s[sensor]);
        let late = cubics.late(&biases, lag_s, |t| Ok(bias(&at(t)?)))?;
        cubics.remains.push(late);
        let own = models.first().map(|m| m.matrix.diagonal());
        cubics.remains.push(hysteresis(
            over.dies[sensor].hysteresis.as_ref().zip(own),
            &conversion,
        ));
        Ok(Some(cubics))
    }

    /// The cubics nearest to `biases` at [`temperatures`], without remainders.
    fn nearest(
        sensor: Sensor,
        range_c: [f64; 2],
        reference_c: f64,
        conversion: Conversion,
        biases: &[Vector3<f64>],
    ) -> Self {
        let coefficients = [0, 1, 2].map(|axis| {
            let values = biases.iter().map(|b| b[axis]);
            cubic(values.collect(), range_c, reference_c)
        });
        Self {
            sensor,
            unit: sensor.unit(),
            reference_c,
            range_c,
            coefficients,
            conversion,
            remains: Vec::new(),
            settled_c: None,
        }
    }

    /// The deviation of `biases` from the cubics.
    fn misses(&self, biases: &[Vector3<f64>]) -> Remainder {
        let misses = temperatures(self.range_c).zip(biases);
        let misses: Vec<_> = misses.map(|(t, b)| b - self.at(t)).collect();
        Remainder::of(
            "bias that the cubic does not describe",
            "without input",
            &misses,
        )
    }

    /// The change of the biases if the dies follow the thermometer by `lag_s`; `bias` gives the bias at a temperature of the dies.
    fn late(
        &self,
        biases: &[Vector3<f64>],
        lag_s: Option<f64>,
        bias: impl Fn(f64) -> Result<Vector3<f64>>,
    ) -> Result<Remainder> {
        let Some(lag_s) = lag_s else {
            return Ok(Remainder::unknown(LAG, "lag not determined"));
        };
        let [from, to] = self.range_c;
        let late = temperatures(self.range_c).zip(biases).map(|(t, b)| {
            let die_c = (t - lag_s * RAMP_K_PER_S).clamp(from, to);
            Ok(b - bias(die_c)?)
        });
        let late = late.collect::<Result<Vec<_>>>()?;
        Ok(Remainder::of(LAG, "at 2 K/min", &late))
    }

    /// The biases at `temp_c`, held outside the range, SI.
    pub fn at(&self, temp_c: f64) -> Vector3<f64> {
        let t = temp_c.clamp(self.range_c[0], self.range_c[1]) - self.reference_c;
        Vector3::from(
            self.coefficients
                .map(|[a, b, c, d]| a + t * (b + t * (c + t * d))),
        )
    }

    /// Largest input that the remainders are given for, SI.
    pub fn input(sensor: Sensor) -> f64 {
        sensor.pick(100f64.to_radians(), STANDARD_GRAVITY)
    }
}

const LAG: &str = "lag of the dies";

impl Remainder {
    fn of(source: &'static str, condition: &'static str, errors: &[Vector3<f64>]) -> Self {
        let last = errors.len().saturating_sub(1);
        // Ends count half, so that the mean over the range is an integral.
        let weights = (0..=last).map(|k| {
            if last > 0 && (k == 0 || k == last) {
                0.5
            } else {
                1.0
            }
        });
        let (squares, sum) = errors
            .iter()
            .zip(weights)
            .fold((0.0, 0.0), |(squares, sum), (e, w)| {
                (squares + w * e.norm_squared(), sum + 3.0 * w)
            });
        let max = errors.iter().map(|e| e.amax()).fold(0.0, f64::max);
        Self {
            source,
            condition,
            rms: Some(f64::sqrt(squares / sum)),
            max: Some(max),
        }
    }

    fn unknown(source: &'static str, condition: &'static str) -> Self {
        Self {
            source,
            condition,
            rms: None,
            max: None,
        }
    }
}

impl Conversion {
    /// Unknown parts follow from the unit of the readings, or else from the model `settled` at which the program is calibrated.
    ///
    /// # Errors
    /// Readings that are not those of the sensor's own axes, which an offset and a factor for each axis cannot correct.
    pub fn of(
        calibration: &Calibration,
        sensor: Sensor,
        known: &KnownConversion,
        settled: &Forward,
    ) -> Result<Self> {
        let si = calibration.recording.raw_unit == RawUnit::Si;
        let conversion = Self {
            si_per_raw: [0, 1, 2].map(|i| match known.si_per_raw {
                Some(factor) => factor,
                None if si => 1.0,
                None => 1.0 / settled.matrix[(i, i)],
            }),
            zero_raw: [known.zero_raw.unwrap_or(0.0); 3],
        };
        for (i, axis) in AXES.iter().enumerate() {
            let row = settled.matrix.row(i);
            let along = row[i] * conversion.si_per_raw[i];
            let across = (row.norm_squared() - row[i] * row[i]).sqrt() / row.norm();
            if !(across <= MOST_ACROSS && (0.5..=2.0).contains(&along)) {
                return Err(Error::new(
                    format!("{sensor}, axis {axis}"),
                    format!(
                        "a reading changes by {along:.3} along its own axis and by {across:.3} of its sensitivity across it; the program needs 1 and 0"
                    ),
                    "order the columns as the program orders its axes, or give its conversion",
                ));
            }
        }
        Ok(conversion)
    }

    /// Change of a reading with the input of its axis: 1 if the conversion is right.
    pub fn gain(&self, model: &Forward) -> Vector3<f64> {
        let factor = Vector3::from(self.si_per_raw);
        model.matrix.diagonal().component_mul(&factor)
    }

    /// Bias of the readings, SI.
    pub fn bias(&self, model: &Forward) -> Vector3<f64> {
        let off = model.bias - Vector3::from(self.zero_raw);
        off.component_mul(&Vector3::from(self.si_per_raw))
    }
}

/// Refuses a range too narrow for a cubic.
fn wide_enough(sensor: Sensor, [from, to]: [f64; 2]) -> Result<()> {
    if to - from >= NARROWEST_K {
        return Ok(());
    }
    let problem =
        format!("{from:.1} to {to:.1} °C is less than {NARROWEST_K} K, too little for a cubic");
    Err(Error::new(
        sensor,
        problem,
        "fit a recording over a wider range",
    ))
}

/// Temperatures at which a cubic is fitted and judged, °C.
fn temperatures([from, to]: [f64; 2]) -> impl Iterator<Item = f64> {
    (0..POINTS).map(move |k| from + (to - from) * k as f64 / (POINTS - 1) as f64)
}

/// Model of the sensor at a temperature of the die, SI to raw.
fn forward(curves: &Curves, sensor: Sensor, temp_c: f64) -> Result<Forward> {
    let inverse = curves.inverse(sensor, temp_c);
    inverse.as_ref().and_then(Forward::of).ok_or_else(|| {
        let problem = format!("C is singular at {temp_c:.1} °C");
        Error::new(sensor, problem, "fit the recordings over temperature again")
    })
}

/// Coefficients, about `reference_c`, of the cubic nearest to evenly spaced `values` over `range_c`, in single precision.
fn cubic(values: Vec<f64>, range_c: [f64; 2], reference_c: f64) -> [f64; 4] {
    let n = values.len();
    let half = 0.5 * (range_c[1] - range_c[0]);
    let unit = |k: usize| 2.0 * k as f64 / (n - 1) as f64 - 1.0;
    // Ends count half, so that sums are integrals.
    let weight = |k: usize| if k == 0 || k == n - 1 { 0.5 } else { 1.0 };
    let powers = DMatrix::from_fn(n, 4, |k, p| unit(k).powi(p as i32));
    let weighted = DMatrix::from_fn(n, 4, |k, p| weight(k) * powers[(k, p)]);
    let with = weighted.transpose() * DVector::from_vec(values);
    let gram = weighted.transpose() * &powers;
    // Powers of evenly spaced points from -1 to 1: never singular.
    let a = gram
        .cholesky()
        .map_or(DVector::zeros(4), |c| c.solve(&with));
    // Σ a_k ((T - reference + d) / half)^k, expanded.
    let d = (reference_c - 0.5 * (range_c[0] + range_c[1])) / half;
    let expanded = [
        a[0] + d * (a[1] + d * (a[2] + d * a[3])),
        (a[1] + d * (2.0 * a[2] + 3.0 * d * a[3])) / half,
        (a[2] + 3.0 * d * a[3]) / half.powi(2),
        a[3] / half.powi(3),
    ];
    expanded.map(|c| f64::from(c as f32))
}

/// Remaining errors of scale factors and cross terms, relative to the model `settled` at which the program is calibrated.
fn linear(
    models: &[Forward],
    settled: &Forward,
    sensor: Sensor,
    biases_only: bool,
) -> [Remainder; 3] {
    let input = BiasCubics::input(sensor);
    let gain = settled.matrix.diagonal();
    let across = |matrix: &nalgebra::Matrix3<f64>| {
        Vector3::from_fn(|i, _| {
            let row = matrix.row(i);
            input * (row.norm_squared() - row[i] * row[i]).max(0.0).sqrt() / gain[i].abs()
        })
    };
    let scale = |m: &Forward| {
        let off = m.matrix.diagonal() - gain;
        off.component_div(&gain) * input
    };
    let cross = |m: &Forward| across(&(m.matrix - settled.matrix));
    let condition = sensor.pick("at 100 deg/s", "at 1 g");
    let scales: Vec<_> = models.iter().map(scale).collect();
    let crosses: Vec<_> = models.iter().map(cross).collect();
    let over = |source, errors: &[Vector3<f64>]| match biases_only {
        // C is the same at all temperatures because it was measured at one only: its error elsewhere is unknown, not zero.
        true => Remainder::unknown(source, "calibrated at one temperature"),
        false => Remainder::of(source, condition, errors),
    };
    [
        over("scale factors over temperature", &scales),
        over("cross terms over temperature", &crosses),
        Remainder::of(
            "cross terms, constant",
            condition,
            &[across(&settled.matrix)],
        ),
    ]
}

/// Error of the biases while the unit heats or cools: half of the difference between the two. `found` has the rms and the largest difference of the
/// axes, and raw units per unit of these.
fn hysteresis(found: Option<(&[[f64; 3]; 2], Vector3<f64>)>, conversion: &Conversion) -> Remainder {
    const SOURCE: &str = "hysteresis";
    let Some(([rms, largest], raw)) = found else {
        return Remainder::unknown(SOURCE, "heating and cooling have no temperature in common");
    };
    // By the program's scale factors, which may differ from those of the calibration.
    let half =
        |sizes: &[f64; 3], k: usize| 0.5 * sizes[k] * (raw[k] * conversion.si_per_raw[k]).abs();
    let squares: f64 = (0..3).map(|k| half(rms, k).powi(2)).sum();
    let max = (0..3).map(|k| half(largest, k)).fold(0.0, f64::max);
    Remainder {
        source: SOURCE,
        condition: "heating or cooling",
        rms: Some((squares / 3.0).sqrt()),
        max: Some(max),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_is_found_as_it_is_about_any_reference() {
        let truth = |t: f64| 0.3 - 0.02 * t + 4e-4 * t * t - 5e-6 * t * t * t;
        let values = (0..POINTS).map(|k| truth(-40.0 + 110.0 * k as f64 / 400.0));
        let found = cubic(values.collect(), [-40.0, 70.0], 35.0);
        for t in [-40.0, -3.0, 35.0, 70.0f64] {
            let d = t - 35.0;
            let value = found[0] + d * (found[1] + d * (found[2] + d * found[3]));
            assert!((value - truth(t)).abs() < 1e-6, "{t}");
        }
    }
}
