//! Whether 95 % intervals contain the truth in 95 % of the cases, parameter by parameter, from recording to fit.

use std::sync::Mutex;

use mimu::fit::{Fit, Options, fit};
use mimu::quantity::Sensor;
use mimu::triad::Triad;
use mimu_recording::{Turntable, TurntableRate};
use mimu_rig::random::Random;
use mimu_rig::rig_file::{RigFile, RigTruth};
use nalgebra::SVector;
use rayon::prelude::*;

use crate::bench;

/// How often the interval of each parameter contained the truth, and the mean squared error in sigmas.
#[derive(Debug, Clone)]
pub struct Tally {
    /// Estimator, sensor and experiment.
    pub name: String,
    /// Indices of the parameters, of the twelve of the forward model, that the estimator determines.
    pub free: Vec<usize>,
    inside: [u32; 12],
    squared: [f64; 12],
    /// Number of cases.
    pub runs: u32,
}

impl Tally {
    /// A tally without cases.
    pub fn new(name: impl Into<String>, free: &[usize]) -> Self {
        Self {
            name: name.into(),
            free: free.to_vec(),
            inside: [0; 12],
            squared: [0.0; 12],
            runs: 0,
        }
    }

    /// Compares the forward model with the truth.
    pub fn add(&mut self, triad: &Triad, truth: &SVector<f64, 12>) {
        self.runs += 1;
        for (i, found) in triad.forward_estimates().iter().enumerate() {
            let error = found.value - truth[i];
            self.inside[i] += u32::from(error.abs() <= found.interval);
            if found.sigma > 0.0 {
                self.squared[i] += (error / found.sigma).powi(2);
            }
        }
    }

    /// Share of the cases in which the interval of each free parameter contained the truth.
    pub fn shares(&self) -> Vec<f64> {
        let share = |i: &usize| f64::from(self.inside[*i]) / f64::from(self.runs);
        self.free.iter().map(share).collect()
    }

    /// Mean, lowest and highest of the shares.
    pub fn summary(&self) -> [f64; 3] {
        let shares = self.shares();
        let mean = shares.iter().sum::<f64>() / shares.len() as f64;
        let lowest = shares.iter().copied().fold(1.0, f64::min);
        [mean, lowest, shares.iter().copied().fold(0.0, f64::max)]
    }

    /// Rms error in claimed sigmas.
    pub fn rms(&self) -> f64 {
        let sum: f64 = self.free.iter().map(|i| self.squared[*i]).sum();
        (sum / f64::from(self.runs) / self.free.len() as f64).sqrt()
    }

    fn merge(&mut self, other: &Self) {
        self.runs += other.runs;
        for i in 0..12 {
            self.inside[i] += other.inside[i];
            self.squared[i] += other.squared[i];
        }
    }
}

fn triad(fit: &Fit, sensor: Sensor) -> &Triad {
    &fit.sensor(sensor).expect("recorded").estimated.triad
}

/// Forward models of gyro and accelerometer with the average biases of the recording.
pub(crate) fn of_the_session(plan: &str, file: &RigFile, seed: u64) -> [SVector<f64, 12>; 2] {
    let wander = bench::wander(plan, file, seed);
    let models = [&file.unit.gyro_affine, &file.unit.accel_affine];
    std::array::from_fn(|k| {
        let mut truth = bench::parameters(models[k].as_ref().expect("stated"));
        for i in 0..3 {
            truth[9 + i] += wander[k][i];
        }
        truth
    })
}

/// Runs the cases of many seeds in parallel and adds them up.
fn over(runs: u64, empty: &[Tally], case: impl Fn(u64, &mut [Tally]) + Sync) -> Vec<Tally> {
    let merged = |mut a: Vec<Tally>, b: Vec<Tally>| {
        a.iter_mut().zip(&b).for_each(|(a, b)| a.merge(b));
        a
    };
    (0..runs)
        .into_par_iter()
        .map(|seed| {
            let mut tallies = empty.to_vec();
            case(seed, &mut tallies);
            tallies
        })
        .reduce(|| empty.to_vec(), merged)
}

/// How the recordings from a table are made and fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dwells {
    /// In a randomised order.
    Randomised,
    /// As listed, axis by axis: neighbouring dwells share the wander of the bias and differ along one axis only.
    AsListed,
    /// As listed, fitted with the noise of the unit at rest.
    AsListedWithNoise,
}

/// Least squares for both sensors on recordings from a table.
pub fn with_a_table(runs: u64, dwells: Dwells) -> Vec<Tally> {
    let all: Vec<usize> = (0..12).collect();
    let empty = Sensor::BOTH.map(|s| Tally::new(format!("known inputs, {s}"), &all));
    over(runs, &empty, |seed, tallies| {
        let plan = bench::table_plan((dwells == Dwells::Randomised).then_some(seed));
        let file = bench::drawn(seed, "unit");
        let truths = of_the_session(&plan, &file, seed);
        let mut prepared = bench::recorded(&plan, &file, seed);
        if dwells == Dwells::AsListedWithNoise {
            let noise = bench::noise_file(&file, seed, prepared.condensed.period_s);
            prepared = prepared.with_noise(&noise).expect("a noise file");
        }
        let fitted = fit(prepared, Options::IN_SAMPLE)
            .unwrap_or_else(|e| panic!("known inputs, seed {seed}: {e}"));
        for (k, sensor) in Sensor::BOTH.into_iter().enumerate() {
            tallies[k].add(triad(&fitted, sensor), &truths[k]);
        }
    })
}

/// Least squares for both sensors on recordings from a table that turns gravity through the accelerometer. Also returns the errors of the delays in
/// sigmas, gyro and accelerometer; a first-order filter delays a slow input by its time constant.
pub fn with_turning_inputs(runs: u64) -> (Vec<Tally>, [Vec<f64>; 2]) {
    let all: Vec<usize> = (0..12).collect();
    let empty = Sensor::BOTH.map(|s| Tally::new(format!("inputs that turn, {s}"), &all));
    let delays = Mutex::new([Vec::new(), Vec::new()]);
    let tallies = over(runs, &empty, |seed, tallies| {
        let plan = bench::turning_plan(seed);
        let file = bench::drawn(seed, "unit");
        let truths = of_the_session(&plan, &file, seed);
        let unit = RigTruth::resolve(&file, seed).expect("a rig").unit;
        let fitted = fit(bench::recorded(&plan, &file, seed), Options::IN_SAMPLE)
            .unwrap_or_else(|e| panic!("inputs that turn, seed {seed}: {e}"));
        for (k, sensor) in Sensor::BOTH.into_iter().enumerate() {
            tallies[k].add(triad(&fitted, sensor), &truths[k]);
            let found = fitted.sensor(sensor).expect("recorded").estimated.delays;
            let found = found.expect("inputs move");
            let axes = [&unit.gyro, &unit.accel][k].axes.iter();
            let errors = axes.enumerate().map(|(i, axis)| {
                let filters = [axis.bandwidth_hz, axis.rc_hz];
                let known: f64 = filters
                    .map(|hz| 1.0 / (std::f64::consts::TAU * hz))
                    .iter()
                    .sum();
                (found.value[i] - known) / found.sigma[i]
            });
            delays.lock().expect("nobody panics with it")[k].extend(errors);
        }
    });
    (tallies, delays.into_inner().expect("nobody panics with it"))
}

/// Both sensors on recordings by hand; only the magnitude of gravity is known. All turns share the errors of the accelerometer's calibration. A gyro
/// that is `quiet` compared with the accelerometer shows whether its intervals include them.
pub fn by_hand(runs: u64, quiet: bool) -> Vec<Tally> {
    let note = if quiet { ", quiet gyro" } else { "" };
    let all: Vec<usize> = (0..12).collect();
    // The accelerometer defines the frame.
    let lower = [0, 3, 4, 6, 7, 8, 9, 10, 11];
    let empty = [
        Tally::new(format!("by hand, gyro{note}"), &all),
        Tally::new(format!("by hand, accel{note}"), &lower),
    ];
    let plan = bench::hand_plan(30);
    over(runs, &empty, |seed, tallies| {
        let mut file = bench::drawn(seed, "unit");
        if quiet {
            file.unit.gyro_axes.white_si = Some([0.005f64.to_radians(); 3]);
            file.unit.gyro_axes.instability_si = Some([0.0; 3]);
            file.unit.gyro_axes.walk_si = Some([0.0; 3]);
        }
        let truths = of_the_session(&plan, &file, seed);
        let fitted = fit(bench::recorded(&plan, &file, seed), Options::IN_SAMPLE)
            .unwrap_or_else(|e| panic!("by hand, seed {seed}: {e}"));
        for (k, sensor) in Sensor::BOTH.into_iter().enumerate() {
            tallies[k].add(triad(&fitted, sensor), &truths[k]);
        }
    })
}

/// Gyro and accelerometer on a record player. The magnitudes of its rates are known to within `rate_error` (95 %); each recording's two rates have
/// errors of that size, which limit the gyro's scale factors.
pub fn on_a_record_player(runs: u64, rate_error: f64) -> Vec<Tally> {
    // A triad whose input is known only by its magnitude defines the frame.
    let lower = [0, 3, 4, 6, 7, 8, 9, 10, 11];
    let empty = Sensor::BOTH.map(|s| Tally::new(format!("record player, {s}"), &lower));
    over(runs, &empty, |seed, tallies| {
        let mut random = Random::new(seed, "unit");
        let (gyro, accel) = (
            bench::in_own_frame(bench::gyro(&mut random)),
            bench::accel(&mut random),
        );
        let file = bench::clean(gyro, accel);
        let sigma = rate_error / 1.96;
        let off = std::array::from_fn(|_| sigma * random.normal());
        let plan = bench::record_player_plan(14, off, seed);
        let rates: Vec<TurntableRate> = ["200", "270"].map(|r| r.parse().expect("a rate")).into();
        let turntable = Turntable::new(&rates, rate_error);
        let truths = of_the_session(&plan, &file, seed);
        let prepared = bench::on_a_turntable(&plan, &file, seed, turntable);
        let fitted = fit(prepared, Options::IN_SAMPLE)
            .unwrap_or_else(|e| panic!("record player, seed {seed}: {e}"));
        for (k, sensor) in Sensor::BOTH.into_iter().enumerate() {
            tallies[k].add(triad(&fitted, sensor), &truths[k]);
        }
    })
}
