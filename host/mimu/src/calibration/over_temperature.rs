//! Calibration over temperature in a calibration file: nodes with derivatives, the range that they were found from, and the lag between
//! thermometer and dies.

use mimu_core::compensation::Affine;
use mimu_core::die::{DieLag, LAG_RANGE_S, LEAST_LAG_S};
use mimu_core::effects::REFERENCE_C;
use mimu_core::stored::NODES;
use mimu_core::table::{Node, Table};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::Calibration;
use super::check::{implausible, problem_of_range, problem_of_temperature};
use crate::quantity::{PerSensor, Sensor};
use mimu_recording::error::{Error, Result};

/// `[temperature]` of a calibration file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct OverTemperature {
    /// Dies' temperatures in the recordings that it was fitted to, °C.
    pub range_c: [f64; 2],
    /// Whether only the biases depend on temperature, and C is that of one temperature.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub biases_only: bool,
    /// What is known of the dies of each triad.
    #[serde(default, skip_serializing_if = "nothing")]
    #[cfg_attr(feature = "schema", schemars(with = "Dies"))]
    pub dies: PerSensor<DieTable>,
    /// One to sixteen, the coldest first.
    #[serde(rename = "node", default)]
    pub nodes: Vec<TemperatureNode>,
}

/// What is known of the dies of a triad: nothing, by default.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct DieTable {
    /// Lag behind the thermometer, s; negative: they lead. `None`: not determined, and none is applied.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lag_s: Option<f64>,
    /// 95 % interval of the lag, s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interval_lag_s: Option<[f64; 2]>,
    /// Difference of the biases between heating and cooling after the lag, axis by axis, SI: rms over the range, and the largest. `None`: not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hysteresis: Option<[[f64; 3]; 2]>,
}

/// [`PerSensor`], of a crate that has no schemas.
#[cfg(feature = "schema")]
#[derive(schemars::JsonSchema)]
#[allow(dead_code)] // only its schema is used
struct Dies {
    /// Of the gyro.
    gyro: DieTable,
    /// Of the accelerometer.
    accel: DieTable,
}

fn nothing(dies: &PerSensor<DieTable>) -> bool {
    *dies == PerSensor::default()
}

/// Inverse models at one temperature of the dies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct TemperatureNode {
    /// °C.
    pub temp_c: f64,
    /// Of the gyro.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gyro: Option<NodeTable>,
    /// Of the accelerometer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accel: Option<NodeTable>,
}

/// Inverse model `x = C u + o` of a triad at a node, raw to SI, and its derivatives by the temperature.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
#[allow(non_snake_case)] // C: the letter of the formula, in the file as in the papers
pub struct NodeTable {
    /// SI per raw unit, by rows.
    pub C: [[f64; 3]; 3],
    /// SI.
    pub o: [f64; 3],
    /// Derivatives of C, SI per raw unit and kelvin.
    pub slope_C: [[f64; 3]; 3],
    /// Derivatives of o, SI per kelvin.
    pub slope_o: [f64; 3],
    /// Standard deviations of C.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_C: Option<[[f64; 3]; 3]>,
    /// Standard deviations of o.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_o: Option<[f64; 3]>,
    /// Standard deviations of the scale factors, raw per SI. They do not follow from those of C and o, whose errors are correlated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_scale_factor: Option<[f64; 3]>,
    /// Standard deviations of the biases, raw.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_bias: Option<[f64; 3]>,
}

/// Inverse models of a calibration over temperature, ready to be evaluated as the device does, in double precision.
#[derive(Debug, Clone)]
pub struct Curves {
    table: Table<f64, NODES>,
    lags: PerSensor<DieLag<f64>>,
    has: PerSensor<bool>,
}

/// Index of the node that represents a calibration if there can be only one model, from the `temperatures` of the nodes, °C. It is nearest to the
/// temperature from which effects count, so it follows from what a device stores. `None` if there are no nodes.
pub fn reference_node(temperatures: &[f64]) -> Option<usize> {
    let off = |at: &usize| (temperatures[*at] - REFERENCE_C).abs();
    (0..temperatures.len()).min_by(|a, b| off(a).total_cmp(&off(b)))
}

impl NodeTable {
    fn affine(matrix: &[[f64; 3]; 3], offset: &[f64; 3]) -> Affine<f64> {
        Affine {
            matrix: Matrix3::from_fn(|i, j| matrix[i][j]),
            offset: Vector3::from(*offset),
        }
    }

    /// The inverse model, raw to SI.
    pub fn model(&self) -> Affine<f64> {
        Self::affine(&self.C, &self.o)
    }

    /// Its derivatives by the temperature, per kelvin.
    pub fn slope(&self) -> Affine<f64> {
        Self::affine(&self.slope_C, &self.slope_o)
    }

    /// What is wrong with it.
    fn problem(&self) -> Option<String> {
        let positive = |x: &f64| x.is_finite() && *x >= 0.0;
        let sigma_c = self.sigma_C.iter().flatten().flatten();
        let all = sigma_c.chain(self.sigma_o.iter().flatten());
        let all = all.chain(self.sigma_scale_factor.iter().flatten());
        if !all.chain(self.sigma_bias.iter().flatten()).all(positive) {
            return Some("a sigma has an entry that cannot be a standard deviation".into());
        }
        implausible(&self.model(), Some(&self.slope()))
    }
}

impl TemperatureNode {
    /// The table of `sensor`.
    pub fn table(&self, sensor: Sensor) -> Option<&NodeTable> {
        sensor.pick(self.gyro.as_ref(), self.accel.as_ref())
    }
}

impl OverTemperature {
    /// Whether its nodes have `sensor`.
    pub fn has(&self, sensor: Sensor) -> bool {
        self.nodes.iter().any(|node| node.table(sensor).is_some())
    }

    /// Standard deviations of x, y, z that `of` picks from a node, interpolated linearly between the nodes next to `temp_c`.
    pub fn sigmas(
        &self,
        sensor: Sensor,
        temp_c: f64,
        of: impl Fn(&NodeTable) -> Option<[f64; 3]>,
    ) -> Option<[f64; 3]> {
        let at = |node: &TemperatureNode| Some((node.temp_c, of(node.table(sensor)?)?));
        let after = self.nodes.partition_point(|node| node.temp_c < temp_c);
        let last = self.nodes.len().checked_sub(1)?;
        let (cold_c, cold) = at(&self.nodes[after.saturating_sub(1)])?;
        let (warm_c, warm) = at(&self.nodes[after.min(last)])?;
        let share = (temp_c - cold_c) / (warm_c - cold_c).max(f64::MIN_POSITIVE);
        let share = share.clamp(0.0, 1.0);
        Some([0, 1, 2].map(|k| cold[k] + share * (warm[k] - cold[k])))
    }

    /// Refuses what cannot be applied; a bad node is named by its number, from 1. `has`: the sensors of the calibration.
    pub(super) fn check(&self, place: &str, has: PerSensor<bool>) -> Result<()> {
        const AGAIN: &str = "fit the recordings over temperature again";
        let refuse = |what: &str, problem: String| {
            Err(Error::new(
                format!("{place}, [temperature]{what}"),
                problem,
                AGAIN,
            ))
        };
        let [from, to] = self.range_c;
        let problem = problem_of_range("range_c", self.range_c);
        if let Some(problem) = problem.or_else(|| self.problem_of_lags()) {
            return refuse("", problem);
        }
        let all = [self.dies.gyro.hysteresis, self.dies.accel.hysteresis];
        let sizes = all.iter().flatten().flatten().flatten();
        if let Some(size) = sizes.copied().find(|h| !(*h >= 0.0 && h.is_finite())) {
            return refuse(
                "",
                format!("a hysteresis is {size}; write a number that is not negative"),
            );
        }
        if self.nodes.is_empty() || self.nodes.len() > NODES {
            let problem = format!(
                "it has {} nodes, and there have to be 1 to {NODES}",
                self.nodes.len()
            );
            return refuse("", problem);
        }
        if let [first, .., last] = self.nodes.as_slice()
            && (last.temp_c < from || first.temp_c > to)
        {
            let problem = format!(
                "range_c is [{from}, {to}], and the nodes are from {} to {} °C",
                first.temp_c, last.temp_c
            );
            return refuse("", problem);
        }
        for (k, node) in self.nodes.iter().enumerate() {
            let before = k.checked_sub(1).map(|k| self.nodes[k].temp_c);
            if let Some(problem) = self.problem(node, before, has) {
                return refuse(&format!(", node {}", k + 1), problem);
            }
        }
        Ok(())
    }

    /// Lags of the dies, s; `None` if none is determined. If only one triad's is determined, the other's is 0.
    pub fn lags_s(&self) -> Option<PerSensor<f64>> {
        let lags_s = self.dies.map(|dies| dies.lag_s);
        let known = lags_s.present().next().is_some();
        known.then(|| lags_s.map(|lag_s| lag_s.unwrap_or(0.0)))
    }

    fn problem_of_lags(&self) -> Option<String> {
        let [least, most] = LAG_RANGE_S;
        self.dies.into_iter().find_map(|(sensor, dies)| {
            let problem = match (dies.lag_s, dies.interval_lag_s) {
                (Some(lag_s), _) if DieLag::new(lag_s).is_none() => format!(
                    "lag_s is {lag_s}; it has to be from {least} to {most}, and 0 or at least {LEAST_LAG_S}"
                ),
                (None, Some(_)) => "it has interval_lag_s but not lag_s".into(),
                (_, Some([lower, upper])) if !(lower <= upper) => {
                    format!("interval_lag_s is [{lower}, {upper}]; it has to increase")
                }
                _ => return None,
            };
            Some(format!("dies.{sensor}: {problem}"))
        })
    }

    /// What is wrong with a node; `before` is the temperature of the node before it.
    fn problem(
        &self,
        node: &TemperatureNode,
        before: Option<f64>,
        has: PerSensor<bool>,
    ) -> Option<String> {
        let temp_c = node.temp_c;
        if let Some(problem) = problem_of_temperature(temp_c) {
            return Some(problem);
        }
        if let Some(before) = before.filter(|before| temp_c <= *before) {
            return Some(format!(
                "temp_c is {temp_c}, and that of the node before is {before}: nodes have to be in increasing order"
            ));
        }
        for sensor in Sensor::BOTH {
            match (node.table(sensor), has[sensor]) {
                (Some(_), false) => {
                    return Some(format!(
                        "it has [{sensor}], but the calibration has no such sensor"
                    ));
                }
                (None, _) if self.has(sensor) => {
                    return Some(format!("it has no [{sensor}], but another node has one"));
                }
                (table, _) => {
                    if let Some(problem) = table.and_then(NodeTable::problem) {
                        return Some(format!("[{sensor}]: {problem}"));
                    }
                }
            }
        }
        (!self.has(Sensor::Gyro) && !self.has(Sensor::Accel))
            .then(|| "it has neither [gyro] nor [accel]".into())
    }
}

impl Curves {
    /// The curves of a calibration with nodes. A sensor without nodes has its one model at all temperatures.
    pub(super) fn of(calibration: &Calibration) -> Option<Self> {
        let temperature = calibration.temperature.as_ref()?;
        let none = Affine {
            matrix: Matrix3::zeros(),
            offset: Vector3::zeros(),
        };
        let constant = PerSensor::from_fn(|sensor| calibration.inverse(sensor));
        let nodes = temperature.nodes.iter().map(|node| {
            let of = |sensor: Sensor| match node.table(sensor) {
                Some(table) => (table.model(), table.slope()),
                None => (constant[sensor].unwrap_or(none), none),
            };
            let both = PerSensor::from_fn(of);
            Node {
                temp_c: node.temp_c,
                model: both.map(|(model, _)| model),
                slope: both.map(|(_, slope)| slope),
            }
        });
        let table = Table::new(nodes).ok()?;
        Some(Self {
            table: table.with_range(temperature.range_c).ok()?,
            lags: DieLag::of_triads(temperature.lags_s()),
            has: constant.map(|model| model.is_some()),
        })
    }

    /// The inverse model of `sensor` at this temperature of the dies, °C, raw to SI.
    pub fn inverse(&self, sensor: Sensor, die_c: f64) -> Option<Affine<f64>> {
        let mut state = self.table.state();
        self.table.follow(&mut state, PerSensor::both(die_c));
        self.has[sensor].then_some(state.model[sensor])
    }

    /// Lags of the dies behind the thermometer.
    pub fn lags(&self) -> &PerSensor<DieLag<f64>> {
        &self.lags
    }

    /// The nodes for the device's algorithms, in double precision.
    pub fn table(&self) -> &Table<f64, NODES> {
        &self.table
    }
}
