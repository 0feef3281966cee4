//! Many runs of one experiment, and their errors.

use mimu::prepared::Prepared;
use mimu::quantity::{PerSensor, Sensor};
use mimu::signal::stillness::STILL_FACTOR;
use mimu_thermal::curves::TriadCurves;
use mimu_thermal::joint::{Choice, Joint, estimate};
use mimu_thermal::session::Session;
use nalgebra::SVector;
use rayon::prelude::*;

use crate::simulation::{Experiment, GAIN, bounds, truth};

/// Temperatures at which curves are judged, °C: every 5 K over the range of the die in all experiments.
pub fn temps() -> Vec<f64> {
    (0..=14).map(|k| -4.0 + 5.0 * f64::from(k)).collect()
}

/// One experiment.
pub struct Study {
    name: String,
    experiment: Experiment,
}

/// Of one run: squared errors relative to the gain, and whether the interval contained the truth, by sensor, temperature and number.
pub struct Errors {
    squared: [Vec<[f64; 12]>; 2],
    inside: [Vec<[bool; 12]>; 2],
}

/// Of one run of the joint estimate.
struct Outcome {
    errors: Errors,
    lag: f64,
    lag_width: f64,
    lag_inside: bool,
}

/// What many runs of one estimator on one experiment give, in the units of the table.
pub struct Summary {
    /// Share of the 95 % intervals that contain the truth, %: bias, scale factors, cross terms of gyro and accelerometer.
    pub held: [f64; 6],
    /// Mean, scatter and mean interval width of the lag, s.
    pub lag_s: [f64; 3],
    /// Share of its intervals that contain the truth, %.
    pub lag_held: f64,
}

impl Study {
    /// A study with its name in the table.
    pub fn new(name: &str, experiment: Experiment) -> Self {
        Self {
            name: name.into(),
            experiment,
        }
    }

    /// As in the table.
    pub fn name(&self) -> String {
        self.name.clone()
    }

    /// The joint estimate.
    pub fn joint(&self, runs: u64) -> Summary {
        self.summary(&self.run(runs))
    }

    fn run(&self, runs: u64) -> Vec<Outcome> {
        let each = (0..runs).into_par_iter();
        each.map(|seed| self.once(seed)).collect()
    }

    fn once(&self, seed: u64) -> Outcome {
        let (manifest, batch) = self.experiment.record(seed);
        let prepared = Prepared::of(manifest, &batch, STILL_FACTOR).expect("it is prepared");
        let session = Session::of(&prepared).expect("its thermometer works");
        let joint = estimate(&[session], Choice::JOINT).expect("it is estimated");
        self.judge(&joint)
    }

    fn judge(&self, joint: &Joint) -> Outcome {
        let (lag, true_lag) = (joint.profiles.gyro.lag, self.experiment.lag_s);
        Outcome {
            errors: Errors::of(&joint.curves),
            lag: lag.value,
            lag_width: lag.upper - lag.lower,
            lag_inside: (lag.lower..=lag.upper).contains(&true_lag),
        }
    }

    fn summary(&self, outcomes: &[Outcome]) -> Summary {
        let n = outcomes.len() as f64;
        let each: Vec<&Errors> = outcomes.iter().map(|o| &o.errors).collect();
        let mean = |of: &dyn Fn(&Outcome) -> f64| outcomes.iter().map(of).sum::<f64>() / n;
        let lag = mean(&|o| o.lag);
        Summary {
            held: shares(&each),
            lag_s: [
                lag,
                mean(&|o| (o.lag - lag).powi(2)).sqrt(),
                mean(&|o| o.lag_width),
            ],
            lag_held: mean(&|o| 100.0 * f64::from(u8::from(o.lag_inside))),
        }
    }
}

impl Errors {
    /// Of the curves of gyro and accelerometer.
    pub fn of(found: &PerSensor<Option<TriadCurves>>) -> Self {
        let mut squared = [Vec::new(), Vec::new()];
        let mut inside = [Vec::new(), Vec::new()];
        for sensor in 0..2 {
            let curves = found[Sensor::BOTH[sensor]]
                .as_ref()
                .expect("both were recorded");
            for t in temps() {
                let (matrix, bias) = truth(sensor, t);
                let [found, _] = curves.forward(t);
                let truth: SVector<f64, 12> = mimu::triad::vector(&matrix, &bias);
                let error = mimu::triad::vector(&found.matrix, &found.bias) - truth;
                let covariance = curves.covariance(t);
                let relative = |k: usize| (error[k] / GAIN[sensor]).powi(2);
                squared[sensor].push(std::array::from_fn(relative));
                let held = |k: usize| error[k].abs() <= 1.96 * covariance[(k, k)].sqrt();
                inside[sensor].push(std::array::from_fn(held));
            }
        }
        Self { squared, inside }
    }
}

/// Errors of many runs, rms over runs and temperatures, in the units of the table.
pub fn rms(runs: &[&Errors]) -> [f64; 6] {
    let n = runs.len() as f64;
    let mean = [0, 1].map(|s| {
        let at = |t: usize| {
            std::array::from_fn(|k| runs.iter().map(|o| o.squared[s][t][k]).sum::<f64>() / n)
        };
        (0..temps().len()).map(at).collect::<Vec<[f64; 12]>>()
    });
    worst(&mean)
}

/// Share of the intervals of 95 % that hold the truth, in %.
pub fn shares(runs: &[&Errors]) -> [f64; 6] {
    let kinds = kinds();
    std::array::from_fn(|kind| {
        let (sensor, numbers) = &kinds[kind];
        let held = runs.iter().flat_map(|o| &o.inside[*sensor]);
        let each = held.flat_map(|t| numbers.iter().map(|k| t[*k]));
        let (sum, all) = each.fold((0.0, 0.0), |(s, a), h| {
            (s + f64::from(u8::from(h)), a + 1.0)
        });
        100.0 * sum / all
    })
}

/// Cramér-Rao bound of `experiment` with an unknown lag, in the units of the table.
pub fn bound(experiment: &Experiment) -> [f64; 6] {
    let bound = bounds(experiment, &temps());
    worst(&[0, 1].map(|s| bound[s].iter().map(|b| b.map(|v| v * v)).collect()))
}

/// Bias, scale factors and cross terms of gyro and accelerometer among the twelve numbers.
fn kinds() -> [(usize, Vec<usize>); 6] {
    let of = |sensor| {
        [
            (sensor, vec![9, 10, 11]),
            (sensor, vec![0, 4, 8]),
            (sensor, vec![1, 2, 3, 5, 6, 7]),
        ]
    };
    let [a, b, c] = of(0);
    let [d, e, f] = of(1);
    [a, b, c, d, e, f]
}

/// Root mean square over temperature of the worst number of each kind, in the units of the table.
fn worst(squared: &[Vec<[f64; 12]>; 2]) -> [f64; 6] {
    let units = [
        180.0 / std::f64::consts::PI * 3600.0,
        1e6,
        1e6,
        1e6 / 9.80665,
        1e6,
        1e6,
    ];
    let kinds = kinds();
    std::array::from_fn(|k| {
        let (sensor, numbers) = &kinds[k];
        let all = &squared[*sensor];
        let rms = |n: &usize| (all.iter().map(|t| t[*n]).sum::<f64>() / all.len() as f64).sqrt();
        units[k] * numbers.iter().map(rms).fold(0.0, f64::max)
    })
}
