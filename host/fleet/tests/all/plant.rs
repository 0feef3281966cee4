//! A plant that makes units and calibrates them: true parameters of a normal population, estimates with the errors that their covariances state.

use std::collections::BTreeMap;

use jiff::civil::Date;
use mimu::nalgebra::{DMatrix, SVector};
use mimu::triad::Covariance;
use mimu::{PerSensor, RawUnit, Reference, Sensor};
use mimu_fleet::measured::{OfCalibration, Setting};
use mimu_fleet::tree::{Measurement, Tree};
use mimu_rig::random::Random;

/// Standard deviations between units: scale factors (relative), misalignments and non-orthogonalities (rad), biases (SI).
pub const GYRO: [f64; 4] = [5e-3, 6e-3, 3e-3, 0.01];
pub const ACCEL: [f64; 4] = [3e-3, 0.0, 2e-3, 0.2];
/// Scale factors, raw/SI.
pub const SCALE: [f64; 2] = [940.0, 1670.0];

/// Processor time of this program, s: user and system, from Linux; elapsed time elsewhere says the same on an idle machine.
pub fn processor_time() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after = stat.rsplit(')').next().unwrap_or_default();
    let ticks = |k: usize| {
        after
            .split_whitespace()
            .nth(k)
            .and_then(|t| t.parse::<f64>().ok())
            .unwrap_or(0.0)
    };
    // Fields 14 and 15 of proc(5), in hundredths of a second.
    (ticks(11) + ticks(12)) / 100.0
}

/// Faults of the production.
#[derive(Debug, Clone, Copy, Default)]
pub struct Faults {
    /// Shift of batch 7 in gyro scale factors x and y, standard deviations.
    pub batch: f64,
    /// Drift of the accelerometer's bias z over the last 40 % of the days, standard deviations.
    pub drift: f64,
    /// Shift of gyro misalignment z since the middle on fixture C, standard deviations.
    pub fixture: f64,
    /// The golden unit, which is measured every day on fixture A: change of its gyro's scale factor x over the last 40 % of the days, standard deviations of units.
    /// `None` if there is no such unit.
    pub golden: Option<f64>,
    /// Every how many-th unit is none of the population; 0 for none.
    pub stranger: usize,
    /// Distance of these in all scale factors of the gyro, standard deviations; all in the same direction.
    pub far: f64,
}

/// A plant.
#[derive(Debug, Clone)]
pub struct Plant {
    pub units: usize,
    pub days: usize,
    pub seed: u64,
    pub faults: Faults,
    /// Units that are calibrated by three operators, twice each.
    pub repeated: usize,
    /// Standard deviations of operators and of repetitions, over that of units.
    pub operator: f64,
    pub repetition: f64,
    /// Standard deviation of a fit over that of units; each fit has between half and twice of it.
    pub fit: f64,
}

impl Plant {
    pub fn new(units: usize, seed: u64) -> Self {
        Self {
            units,
            days: 120,
            seed,
            faults: Faults::default(),
            repeated: 0,
            operator: 0.0,
            repetition: 0.0,
            fit: 0.2,
        }
    }

    /// Whether unit `k` is none of the population.
    pub fn is_stranger(&self, k: usize) -> bool {
        self.faults.stranger > 0 && k % self.faults.stranger == self.faults.stranger / 2
    }

    /// Batch of unit `k`: twenty of them.
    pub fn batch(&self, k: usize) -> usize {
        20 * k / self.units
    }

    /// Its day, as a number.
    pub fn day(&self, k: usize) -> usize {
        self.days * k / self.units
    }

    /// The calibrations.
    pub fn tree(&self) -> Tree {
        let mut random = Random::new(self.seed, "plant");
        let mut measurements = Vec::new();
        let factors =
            [correlation(&mut random), correlation(&mut random)].map(|c| c.cholesky().unwrap().l());
        let operators: Vec<[SVector<f64, 12>; 2]> = (0..3)
            .map(|_| [0, 1].map(|_| standard(&mut random)))
            .collect();
        for k in 0..self.units {
            let truth = [0, 1].map(|s| factors[s].clone() * standard(&mut random));
            let truth = truth.map(|t| SVector::<f64, 12>::from_fn(|i, _| t[i]));
            let own = ["A", "B", "C", "D"][(4.0 * random.uniform()) as usize % 4];
            let runs = if k < self.repeated { 6 } else { 1 };
            for run in 0..runs {
                let operator = if k < self.repeated {
                    run / 2
                } else {
                    (3.0 * random.uniform()) as usize % 3
                };
                let each = [0, 1].map(|s| {
                    let repetition = standard(&mut random) * self.repetition;
                    truth[s]
                        + operators[operator][s] * self.operator
                        + repetition
                        + self.fault(k, s, own)
                });
                measurements.push(self.measurement(
                    &mut random,
                    (k, run),
                    &each,
                    [own, ["eva", "max", "ida"][operator]],
                ));
            }
        }
        if let Some(change) = self.faults.golden {
            let truth = [0, 1].map(|s| &factors[s] * standard(&mut random));
            let truth = truth.map(|t| SVector::<f64, 12>::from_fn(|i, _| t[i]));
            for day in 0..self.days {
                let mut each = truth;
                let late = (day as f64 / self.days as f64 - 0.6) / 0.4;
                each[0][0] += change * late.max(0.0);
                // Units are numbered by the day on which they are made.
                let k = (self.units * day).div_ceil(self.days);
                let mut one = self.measurement(&mut random, (k, day), &each, ["A", "eva"]);
                one.unit = "golden".into();
                one.file = format!("golden-{day}.toml");
                measurements.push(one);
            }
        }
        Tree {
            measurements,
            ..Tree::default()
        }
    }

    /// What faults add to the parameters of unit `k`, standard deviations of units.
    fn fault(&self, k: usize, sensor: usize, fixture: &str) -> SVector<f64, 12> {
        let mut out = SVector::zeros();
        let (day, days) = (self.day(k) as f64, self.days as f64);
        if sensor == 0 {
            if self.batch(k) == 7 {
                out[0] += self.faults.batch;
                out[1] += self.faults.batch;
            }
            if fixture == "C" && day >= 0.5 * days {
                out[5] += self.faults.fixture;
            }
            if self.is_stranger(k) {
                (0..3).for_each(|i| out[i] += self.faults.far);
            }
        } else {
            out[11] += self.faults.drift * ((day / days - 0.6) / 0.4).max(0.0);
        }
        out
    }

    /// Estimates of parameters that are given in standard deviations of units.
    fn measurement(
        &self,
        random: &mut Random,
        (k, run): (usize, usize),
        truth: &[SVector<f64, 12>; 2],
        labels: [&str; 2],
    ) -> Measurement {
        let mut triads = PerSensor::default();
        for (s, sensor) in Sensor::BOTH.into_iter().enumerate() {
            let sizes = [GYRO, ACCEL][s];
            let raw = |i: usize| match i / 3 {
                0 => SCALE[s] * sizes[0],
                3 => SCALE[s] * sizes[3],
                kind => sizes[kind],
            };
            let mean = |i: usize| if i < 3 { SCALE[s] } else { 0.0 };
            // A covariance with correlations: that of twelve numbers from sixteen random ones.
            let quality = self.fit * 2f64.powf(random.within(1.0));
            let root = DMatrix::from_fn(12, 16, |_, _| 0.25 * quality * random.normal());
            let errors = &root * DMatrix::from_fn(16, 1, |_, _| random.normal());
            let covariance = &root * root.transpose();
            let values = SVector::from_fn(|i, _| mean(i) + raw(i) * (truth[s][i] + errors[i]));
            triads[sensor] = Some((
                values,
                Covariance::from_fn(|i, j| covariance[(i, j)] * raw(i) * raw(j)),
            ));
        }
        let labels = [
            ("fixture", labels[0].to_string()),
            ("operator", labels[1].to_string()),
            ("batch", format!("{:02}", self.batch(k))),
        ];
        let first = jiff::civil::date(2026, 1, 5);
        let day: Date = first
            .checked_add(jiff::Span::new().days(self.day(k) as i64))
            .unwrap();
        Measurement {
            file: format!("u{k:05}-{run}.toml"),
            unit: format!("u{k:05}"),
            labels: labels
                .map(|(a, b)| (a.to_string(), b))
                .into_iter()
                .collect::<BTreeMap<_, _>>(),
            day: Some(day),
            of: OfCalibration {
                setting: Setting {
                    raw_unit: "count".into(),
                    reference: "gravity".into(),
                },
                raw_unit: RawUnit::Count,
                reference: Some(Reference::Gravity),
                triads,
            },
            properties: Vec::new(),
        }
    }
}

/// Twelve standard normal numbers.
fn standard(random: &mut Random) -> SVector<f64, 12> {
    SVector::from_fn(|_, _| random.normal())
}

/// A random correlation matrix.
fn correlation(random: &mut Random) -> DMatrix<f64> {
    let root = DMatrix::from_fn(12, 24, |_, _| random.normal());
    let c = &root * root.transpose();
    DMatrix::from_fn(12, 12, |i, j| c[(i, j)] / (c[(i, i)] * c[(j, j)]).sqrt())
}
