//! Errors and intervals of the estimators on units whose truth is known: a 95 % interval must contain it in 95 % of
//! the cases, parameter by parameter.

use mimu::blocks::Condensed;
use mimu::dwell::Sensor;
use mimu::estimate::known_input::{
    inverse_form, kalman, least_squares, opposite_rates, six_positions,
};
use mimu::estimate::{Estimated, Failure, Observation};
use mimu::fit::{Method, Options, fit};
use mimu::prepared::Prepared;
use mimu::recording::{
    Batch, Columns, Manifest, RawUnit, Recording, Reference, SampleFormat, Writer,
};
use mimu::stillness::STILL_FACTOR;
use mimu::triad::{Triad, vector};
use mimu_tests::simulation::{ByHand, GRAVITY, Random, Sample, Unit, by_hand};
use nalgebra::{Matrix3, SVector, Vector3};

/// How often the interval of each of twelve parameters held the truth, and the mean squared error in sigmas.
struct Tally {
    inside: [u32; 12],
    squared: [f64; 12],
    runs: u32,
}

impl Tally {
    fn new() -> Self {
        Self {
            inside: [0; 12],
            squared: [0.0; 12],
            runs: 0,
        }
    }

    /// Compares the forward model with the truth. What an estimator fixes (sigma zero) counts as inside.
    fn add(&mut self, triad: &Triad, truth: &SVector<f64, 12>) {
        self.runs += 1;
        for (i, found) in triad.forward_estimates().iter().enumerate() {
            let error = found.value - truth[i];
            self.inside[i] += u32::from(error.abs() <= found.interval || found.sigma == 0.0);
            if found.sigma > 0.0 {
                self.squared[i] += (error / found.sigma).powi(2);
            }
        }
    }

    /// Every parameter within what `runs` draws of 95 % scatter by: 4 sigmas, as 12 to 60 parameters are looked at.
    /// Above, another 1.5 % for the noise that is sometimes taken for more than noise.
    fn judge(&self, name: &str, free: &[usize]) {
        let n = f64::from(self.runs);
        let margin = 4.0 * (0.95 * 0.05 / n).sqrt();
        let shares: Vec<f64> = free
            .iter()
            .map(|&i| f64::from(self.inside[i]) / n)
            .collect();
        let mean = shares.iter().sum::<f64>() / shares.len() as f64;
        let spread: f64 =
            free.iter().map(|&i| self.squared[i] / n).sum::<f64>() / free.len() as f64;
        let (low, high) = (
            shares.iter().copied().fold(1.0, f64::min),
            shares.iter().copied().fold(0.0, f64::max),
        );
        println!(
            "{name:<34}{n:>6} runs: 95 % intervals hold the truth in {:.1} % ({:.1} to {:.1} by parameter), rms error {:.3} sigma",
            100.0 * mean,
            100.0 * low,
            100.0 * high,
            spread.sqrt()
        );
        assert!(low > 0.95 - margin, "{name}: {shares:?}");
        assert!(high < 0.965 + margin, "{name}: {shares:?}");
    }
}

fn truth(triad: &mimu_tests::simulation::Triad) -> SVector<f64, 12> {
    let matrix = Matrix3::from_fn(|i, j| triad.matrix[i][j]);
    vector(&matrix, &Vector3::from(triad.bias))
}

/// Dwells of 1000 samples under known rates: the faces both ways, and rest.
fn on_a_table(unit: &Unit, random: &mut Random) -> Vec<Observation> {
    let rates = [-5.0, -2.0, 2.0, 5.0];
    let turns = (0..3).flat_map(|axis| rates.map(|r| Vector3::ith(axis, r)));
    turns
        .chain([Vector3::zeros(); 4])
        .enumerate()
        .map(|(dwell, input)| Observation {
            dwell,
            raw: unit.gyro.read(input.into(), 1000.0, random).into(),
            variance: Vector3::repeat(unit.gyro.sigma.powi(2) / 1000.0),
            input,
        })
        .collect()
}

#[test]
fn intervals_hold_the_truth_where_the_input_is_known() {
    type Estimator = fn(&[Observation]) -> Result<Estimated, Failure>;
    let all: Vec<usize> = (0..12).collect();
    let diagonal = [0, 4, 8, 9, 10, 11];
    let estimators: [(&str, Estimator, &[usize]); 5] = [
        ("least squares", least_squares, &all),
        ("Kalman bank", kalman, &all),
        ("inverse form, all dwells", inverse_form, &all),
        ("inverse form, opposite rates", opposite_rates, &all),
        ("six positions", six_positions, &diagonal),
    ];
    for (name, estimator, free) in estimators {
        let mut tally = Tally::new();
        for seed in 0..2000 {
            let mut random = Random::new(seed);
            let unit = Unit::any(&mut random);
            let estimated = estimator(&on_a_table(&unit, &mut random)).unwrap();
            tally.add(&estimated.triad, &truth(&unit.gyro));
        }
        tally.judge(name, free);
    }
}

/// A table that repeats its rates to 0.1 % only, or a bias that wanders: more than the noise says, and the intervals must know.
#[test]
fn intervals_hold_the_truth_where_dwells_scatter_more_than_the_noise() {
    type Estimator = fn(&[Observation]) -> Result<Estimated, Failure>;
    let all: Vec<usize> = (0..12).collect();
    let estimators: [(&str, Estimator, &[usize]); 5] = [
        ("least squares, scattering dwells", least_squares, &all),
        ("Kalman bank, scattering dwells", kalman, &all),
        ("inverse form, scattering dwells", inverse_form, &all),
        ("opposite rates, scattering dwells", opposite_rates, &all),
        (
            "six positions, scattering dwells",
            six_positions,
            &[0, 4, 8],
        ),
    ];
    for (name, estimator, free) in estimators {
        let mut tally = Tally::new();
        for seed in 0..2000 {
            let mut random = Random::new(seed);
            let unit = Unit::any(&mut random);
            let mut dwells = on_a_table(&unit, &mut random);
            for dwell in &mut dwells {
                for axis in 0..3 {
                    dwell.raw[axis] += 1e-3 * random.gaussian();
                }
            }
            tally.add(&estimator(&dwells).unwrap().triad, &truth(&unit.gyro));
        }
        let fewest = tally.inside.iter().min().copied().unwrap_or(0);
        assert!(fewest > 1860, "{name}: {:?}", tally.inside);
        tally.judge(name, free);
    }
}

/// Writes samples as a recording and reads it as a user's would be.
fn recorded(samples: &[Sample], rate_hz: f64) -> Prepared {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recording");
    let columns = Columns {
        gyro: true,
        accel: true,
        ..Columns::default()
    };
    let mut writer = Writer::create(&path, columns, SampleFormat::Parquet, false).unwrap();
    let mut batch = Batch::default();
    for s in samples {
        batch.t_s.push(s.t_s);
        for i in 0..3 {
            batch.raw[i].push(s.gyro[i]);
            batch.raw[3 + i].push(s.accel[i]);
        }
    }
    writer.write(&batch).unwrap();
    writer
        .finish(&Manifest::new(
            "simulated",
            rate_hz,
            GRAVITY,
            RawUnit::Volt,
            Reference::Gravity,
        ))
        .unwrap();
    Prepared::read(&Recording::open(&path).unwrap(), STILL_FACTOR, |_| ()).unwrap()
}

fn options(holdout_blocks: usize) -> Options {
    Options {
        method: Method::LeastSquares,
        holdout_blocks,
        only: None,
        still_factor: STILL_FACTOR,
    }
}

/// The whole path of a recording by hand, dwells found, turns integrated. A gyro that is quiet beside its accelerometer shows
/// whether the errors that all turns share, those of the accelerometer's calibration, are in its intervals.
#[test]
fn intervals_hold_the_truth_where_only_gravity_is_known() {
    for (name, gyro_noise) in [("", 1.0), (", quiet gyro", 0.05)] {
        let plan = ByHand {
            poses: 30,
            dwell_s: 3.0,
            turn_s: 1.5,
            rate_hz: 200.0,
        };
        let options = options(0);
        let (mut gyro, mut accel) = (Tally::new(), Tally::new());
        for seed in 0..400 {
            let mut random = Random::new(seed);
            let mut unit = Unit::any(&mut random);
            unit.gyro.sigma *= gyro_noise;
            let prepared = recorded(&by_hand(&unit, plan, &mut random), plan.rate_hz);
            assert_eq!(prepared.dwells.list.len(), plan.poses, "seed {seed}");
            let fitted = fit(prepared, options).unwrap();
            let triad = |s| &fitted.sensor(s).unwrap().estimated.triad;
            gyro.add(triad(Sensor::Gyro), &truth(&unit.gyro));
            accel.add(triad(Sensor::Accel), &truth(&unit.accel));
        }
        gyro.judge(&format!("gyro by hand{name}"), &(0..12).collect::<Vec<_>>());
        accel.judge(
            &format!("accelerometer by hand{name}"),
            &[0, 3, 4, 6, 7, 8, 9, 10, 11],
        );
    }
}

/// Held-out figures are about new data: on a unit with nothing but noise they must be a little above the noise floor,
/// and those in sample a little below.
#[test]
fn held_out_error_of_a_perfect_model_is_the_noise_and_that_of_the_parameters() {
    let plan = ByHand {
        poses: 40,
        dwell_s: 3.0,
        turn_s: 1.5,
        rate_hz: 200.0,
    };
    let options = options(4);
    let mut ratios = [[0.0; 2]; 2];
    const RUNS: u64 = 20;
    for seed in 0..RUNS {
        let mut random = Random::new(10_000 + seed);
        let unit = Unit::any(&mut random);
        let fitted = fit(
            recorded(&by_hand(&unit, plan, &mut random), plan.rate_hz),
            options,
        )
        .unwrap();
        for (k, sensor) in Sensor::BOTH.into_iter().enumerate() {
            let s = fitted.sensor(sensor).unwrap();
            ratios[k][0] += s.rms() / s.noise_floor() / RUNS as f64;
            ratios[k][1] += s.held_out_rms().unwrap() / s.noise_floor() / RUNS as f64;
        }
    }
    println!(
        "over noise floor, in sample and held out: gyro {:?}, accelerometer {:?}",
        ratios[0], ratios[1]
    );
    for [in_sample, held_out] in ratios {
        // 40 poses, 9 parameters: √(31/40) = 0.88 in sample; held out each block of 10 is predicted by 30.
        assert!((0.75..1.0).contains(&in_sample), "{in_sample}");
        assert!((1.0..1.5).contains(&held_out), "{held_out}");
    }
}

/// A sensor clipped in one pose: the dwell is left out, the rest is as good as without it.
#[test]
fn a_saturated_dwell_is_found_and_left_out() {
    let plan = ByHand {
        poses: 30,
        dwell_s: 3.0,
        turn_s: 1.5,
        rate_hz: 200.0,
    };
    let mut random = Random::new(5);
    let unit = Unit::any(&mut random);
    let mut samples = by_hand(&unit, plan, &mut random);
    let highest = samples.iter().map(|s| s.accel[2]).fold(0.0, f64::max);
    let rail = highest - 0.03;
    for s in &mut samples {
        s.accel[2] = s.accel[2].min(rail);
    }
    let prepared = recorded(&samples, plan.rate_hz);
    assert_eq!(prepared.dwells.rails[5].high, Some(rail));
    let saturated = prepared
        .dwells
        .list
        .iter()
        .filter(|d| d.accel_fault.is_some())
        .count();
    assert!((1..6).contains(&saturated), "{saturated}");
    let options = options(0);
    let fitted = fit(prepared, options).unwrap();
    let accel = fitted.sensor(Sensor::Accel).unwrap();
    // Tight enough to see a clipped dwell: its mean is off by up to 0.03 V, or 0.4 m/s².
    assert!(
        accel.rms() < 2.0 * accel.noise_floor(),
        "{} {}",
        accel.rms(),
        accel.noise_floor()
    );
    assert!(
        fitted
            .warnings
            .iter()
            .any(|w| w.contains("accel_z saturated")),
        "{:?}",
        fitted.warnings
    );
}

/// Dwell means of correlated noise scatter by more than sigma over the root of n, and the Allan deviation knows.
#[test]
fn noise_of_a_dwell_mean_is_that_of_correlated_noise() {
    let (rate_hz, dwell_s): (f64, f64) = (100.0, 10.0);
    let mut random = Random::new(3);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recording");
    let columns = Columns {
        gyro: true,
        step: true,
        ..Columns::default()
    };
    let mut writer = Writer::create(&path, columns, SampleFormat::Parquet, false).unwrap();
    let mut batch = Batch::default();
    // First-order Gauss-Markov noise of 0.5 s: a mean over 10 s scatters by σ √(2·0.5/10), ten times as much as
    // σ/√1000.
    let (keep, dwells) = ((-1.0 / (0.5 * rate_hz)).exp(), 200);
    let drive = f64::sqrt(1.0 - keep * keep);
    let mut state = [0.0; 3];
    for row in 0..(dwells as f64 * dwell_s * rate_hz) as usize {
        batch.t_s.push(row as f64 / rate_hz);
        batch.step.push((row as f64 / (dwell_s * rate_hz)) as i32);
        for (axis, state) in state.iter_mut().enumerate() {
            *state = keep * *state + drive * random.gaussian();
            batch.raw[axis].push(*state);
        }
    }
    writer.write(&batch).unwrap();
    writer
        .finish(&Manifest::new(
            "simulated",
            rate_hz,
            GRAVITY,
            RawUnit::Volt,
            Reference::Table,
        ))
        .unwrap();
    let recording = Recording::open(&path).unwrap();
    let condensed = Condensed::read(&recording, false, |_| ()).unwrap();
    let found = mimu::dwell::Dwells::find(&condensed, &recording.manifest, STILL_FACTOR).unwrap();
    let noise = mimu::noise::Noise::within(&found.list, &condensed);
    let claimed = noise.of_mean(Sensor::Gyro, &found.list[0]).mean().sqrt();
    let means = found
        .list
        .iter()
        .flat_map(|d| [0, 1, 2].map(|c| d.raw[c].mean));
    let scatter = (means.map(|m| m * m).sum::<f64>() / (3 * dwells) as f64).sqrt();
    let theory = f64::sqrt(2.0 * 0.5 / dwell_s);
    println!(
        "scatter of 10 s means {scatter:.3}, claimed {claimed:.3}, theory {theory:.3}, white {:.3}",
        1.0 / (dwell_s * rate_hz).sqrt()
    );
    // The longest octave within a dwell is 3.2 s, and what lies beyond is extrapolated.
    assert!(
        (0.8..1.25).contains(&(claimed / scatter)),
        "{claimed} {scatter}"
    );
}
