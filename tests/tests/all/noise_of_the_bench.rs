//! Noise coefficients that `mimu allan` computes for units of the virtual bench, through their filters and converters.

use mimu::plan::design::budget::DwellNoise;
use mimu::quantity::Sensor;
use mimu::survey::{Options, Part, Survey, survey};
use mimu_allan::Deviation;
use mimu_allan::model::Term;
use mimu_recording::Recording;
use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::random::Random;
use mimu_rig::record::{Output, write};
use mimu_rig::rig_file::{RigFile, RigTruth};
use mimu_tests::bench;

/// N, B and K in SI of every gyro and every accelerometer, chosen so that half an hour shows all three: flicker exceeds white noise from two seconds
/// on, and the random walk exceeds flicker from six.
const TRUTH: [[f64; 3]; 2] = [[1.2e-3, 1.3e-3, 6e-4], [2.3e-3, 2.4e-3, 1.1e-3]];

/// Half an hour at rest at 100 Hz.
const PLAN: &str = "format = \"mimu-plan/1\"\nsample_rate_hz = 100.0\ncarrier = \"table\"\n\
                    [[step]]\nup = [0.0, 0.0, 1.0]\ndwell_s = 1800.0\n";

/// The survey of a unit, and volts per SI of its channels.
fn surveyed(seed: u64) -> (Survey, [f64; 6]) {
    let mut random = Random::new(seed, "unit");
    let models = [bench::gyro(&mut random), bench::accel(&mut random)];
    let volts = std::array::from_fn(|i| {
        let row: [f64; 3] = models[i / 3].matrix[i % 3];
        row.map(|p| p * p).iter().sum::<f64>().sqrt()
    });
    let [gyro, accel] = models;
    let mut file: RigFile = bench::clean(gyro, accel);
    let axes = [&mut file.unit.gyro_axes, &mut file.unit.accel_axes];
    for (axes, [n, b, k]) in axes.into_iter().zip(TRUTH) {
        axes.white_si = Some([n; 3]);
        axes.instability_si = Some([b; 3]);
        axes.walk_si = Some([k; 3]);
    }
    let plan = Plan::parse(Source::new("plan", PLAN)).unwrap();
    let truth = RigTruth::resolve(&file, seed).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recording");
    write(&plan, &truth, seed, &Output::new(&path, &plan).unwrap()).unwrap();
    let options = Options {
        part: Part::Whole,
        kind: Deviation::Allan,
        per_decade: 3,
        confidence: 0.95,
    };
    let survey = survey(&Recording::open(&path).unwrap(), None, options, |_| ()).unwrap();
    (survey, volts)
}

#[test]
fn white_noise_bias_instability_and_random_walk_are_within_their_intervals() {
    const UNITS: u64 = 6;
    let terms = [Term::N, Term::B, Term::K];
    let (mut told, mut inside, mut strange) = ([0; 3], [0; 3], Vec::new());
    for seed in 1..=UNITS {
        let (survey, volts) = surveyed(seed);
        for (channel, volts) in survey.channels.iter().zip(volts) {
            let model = channel.model.as_ref().unwrap();
            let known = TRUTH[usize::from(channel.sensor == Sensor::Accel)];
            for (i, term) in terms.into_iter().enumerate() {
                let Ok(c) = model.get(term) else { continue };
                told[i] += 1;
                inside[i] += usize::from((c.lower..=c.upper).contains(&(known[i] * volts)));
            }
            for term in [Term::Q, Term::R] {
                strange.extend(model.get(term).ok().map(|c| (channel.name, term, *c)));
            }
        }
    }
    // The expected number is 34 of 36 (95 %); fewer than 30 have a probability of 3e-3.
    for (i, term) in terms.into_iter().enumerate() {
        assert!(told[i] >= 34, "{term:?} told {}", told[i]);
        assert!(inside[i] + 6 >= told[i], "{term:?} inside {}", inside[i]);
    }
    assert!(strange.len() <= 2, "{strange:?}");
}

/// fang, Table 5 at 25 °C (V²) and Table 4 (V per deg/s and per m/s²).
const FANG_VARIANCES: [[f64; 3]; 2] = [[1.27e-5, 0.92e-5, 1.92e-5], [3.57e-5, 4.23e-5, 2.47e-5]];
const FANG_SCALES: [[f64; 3]; 2] = [[5.07e-3, 5.09e-3, 5.17e-3], [80.80e-3, 80.14e-3, 80.84e-3]];

#[test]
fn means_of_samples_behind_the_filters_of_fangs_parts_scatter_as_the_budget_says() {
    // The bench joins its samples by straight lines, so noise at 1 kHz would be filtered twice by a pole at 350 Hz. Eight steps between the samples
    // come within 1 % of white noise behind it.
    const STEPS: usize = 8;
    const RATE_HZ: usize = 1000;
    const SECONDS: usize = 300;
    let mut file: RigFile = bench::drawn(1, "unit");
    for axes in [&mut file.unit.gyro_axes, &mut file.unit.accel_axes] {
        (axes.instability_si, axes.walk_si) = (Some([0.0; 3]), Some([0.0; 3]));
    }
    (file.converter.bits, file.converter.noise_codes) = (Some(24), Some(0.0));
    let truth = RigTruth::resolve(&file, 1).unwrap();
    let plan = format!(
        "format = \"mimu-plan/1\"\nsample_rate_hz = {}.0\ncarrier = \"table\"\n[[step]]\nup = [0.0, 0.0, 1.0]\ndwell_s = {SECONDS}.0\n",
        STEPS * RATE_HZ
    );
    let plan = Plan::parse(Source::new("plan", plan)).unwrap();
    let rows = mimu_rig::record::samples(&plan, &truth, 1).unwrap();
    let rows: Vec<[[f64; 3]; 2]> = rows
        .filter(|r| r.instant.step.is_some())
        .step_by(STEPS)
        .map(|r| [r.readings.gyro, r.readings.accel])
        .collect();
    for sensor in Sensor::BOTH {
        let mut density = 0.0;
        for (axis, (table_5, scale)) in FANG_VARIANCES[sensor as usize]
            .iter()
            .zip(FANG_SCALES[sensor as usize])
            .enumerate()
        {
            let of = |r: &[[f64; 3]; 2]| r[sensor as usize][axis];
            let mean = rows.iter().map(of).sum::<f64>() / rows.len() as f64;
            let variance =
                rows.iter().map(|r| (of(r) - mean).powi(2)).sum::<f64>() / rows.len() as f64;
            let seconds: Vec<f64> = rows
                .as_chunks::<RATE_HZ>()
                .0
                .iter()
                .map(|second| second.iter().map(of).sum::<f64>() / RATE_HZ as f64)
                .collect();
            let steps = seconds
                .windows(2)
                .map(|w| (w[1] - w[0]).powi(2))
                .sum::<f64>();
            let of_a_second = steps / 2.0 / (seconds.len() - 1) as f64;
            density += of_a_second / variance * table_5 / scale.powi(2) / 3.0;
        }
        let n = DwellNoise::fang(sensor).n
            * if sensor == Sensor::Gyro {
                1f64.to_degrees()
            } else {
                1.0
            };
        // Three axes of 300 means scatter by 3 %; the RC filter behind the accelerometer makes 2 %, the different scale factors 1 %.
        let ratio = n / density.sqrt();
        assert!((0.9..1.1).contains(&ratio), "{sensor}: {ratio}");
    }
}
