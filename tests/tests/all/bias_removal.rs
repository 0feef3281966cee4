//! Firmware that removes the gyro's bias before the log sees it: it is named, and the scale factors are right.
//!
//! The firmware is written here, sample by sample, as a driver would: it acts on the counts that the bench's converter puts out.

use mimu::bias_removal::BiasRemoval;
use mimu::calibration::{Calibration, TriadTable};
use mimu::fit::{Fit, Options, fit};
use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use mimu::recording_problem::RecordingProblem;
use mimu::result::fit::FitResult;
use mimu::signal::stillness::STILL_FACTOR;
use mimu_recording::{Batch, Manifest, RawUnit, Reference};
use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::record::samples;
use mimu_rig::rig_file::{RigFile, RigTruth};
use mimu_tests::bench;
use mimu_tests::by_hand::{Grade, unit};
use mimu_tests::recordings::{mikoff, xsens};

const SEED: u64 = 11;
const RATE_HZ: f64 = 100.0;

/// The samples of 35 poses by hand. `firmware` changes the gyro of each sample; its second argument is the change of the accelerometer, counts.
fn recorded(
    file: &RigFile,
    seed: u64,
    mut firmware: impl FnMut([f64; 3], f64) -> [f64; 3],
) -> Prepared {
    let text = "format = \"mimu-plan/1\"\nsample_rate_hz = 100.0\ncarrier = \"hands\"\nlatitude_deg = 48.0\nlead_in_s = 6.0\n\
                [[step]]\nposes = 35\ndwell_s = 3.0\n";
    let plan = Plan::parse(Source::new("plan", text)).expect("a plan");
    let truth = RigTruth::resolve(file, seed).expect("a rig");
    let mut batch = Batch::default();
    let mut before: Option<[f64; 3]> = None;
    for row in samples(&plan, &truth, seed).expect("a run") {
        let accel = row.readings.accel;
        let moved = before.replace(accel).map_or(0.0, |b| {
            (0..3).map(|k| (accel[k] - b[k]).abs()).fold(0.0, f64::max)
        });
        let gyro = firmware(row.readings.gyro, moved);
        batch.t_s.push(row.stamp_s);
        for k in 0..3 {
            batch.raw[k].push(gyro[k]);
            batch.raw[3 + k].push(accel[k]);
        }
    }
    let gravity = plan.place.gravity;
    let manifest = Manifest::new("u", RATE_HZ, gravity, RawUnit::Count, Reference::Gravity);
    Prepared::of(manifest, &batch, STILL_FACTOR).expect("readable")
}

/// A first-order high-pass filter by the bilinear transform, rounded to a count. Its gain at high frequencies is 1; with `y[n] = a (y[n-1] + x[n] - x[n-1])`
/// it is lower by half a sample period over τ, and the scale factors are those of that gain.
fn high_pass(time_constant_s: f64, bilinear: bool) -> impl FnMut([f64; 3], f64) -> [f64; 3] {
    let half = 0.5 / RATE_HZ / time_constant_s;
    let [of_input, of_output] = match bilinear {
        true => [1.0 / (1.0 + half), (1.0 - half) / (1.0 + half)],
        false => [1.0 / (1.0 + 2.0 * half); 2],
    };
    let mut state: Option<([f64; 3], [f64; 3])> = None;
    move |x, _| {
        let y = match state {
            None => [0.0; 3],
            Some((before, y)) => {
                [0, 1, 2].map(|k| of_output * y[k] + of_input * (x[k] - before[k]))
            }
        };
        state = Some((x, y));
        y.map(f64::round)
    }
}

/// Subtracts a bias that it follows, with a time constant of 0.7 s, once the readings have changed little for a second.
fn zeroed() -> impl FnMut([f64; 3], f64) -> [f64; 3] {
    let (mut bias, mut last, mut still) = ([0.0; 3], [0.0; 3], 0);
    move |x, moved| {
        let turned = (0..3).map(|k| (x[k] - last[k]).abs()).fold(0.0, f64::max);
        last = x;
        still = if moved < 400.0 && turned < 60.0 && (0..3).all(|k| (x[k] - bias[k]).abs() < 800.0)
        {
            still + 1
        } else {
            0
        };
        if still > 100 {
            for k in 0..3 {
                bias[k] += (x[k] - bias[k]) / (0.7 * RATE_HZ);
            }
        }
        [0, 1, 2].map(|k| (x[k] - bias[k]).round())
    }
}

/// Largest error of the gyro's matrix behind a filter of this `gain`, relative to its largest element, and how many of its nine intervals contain the
/// truth.
fn judged(fit: &Fit, file: &RigFile, gain: f64) -> (f64, usize) {
    let truth = gain * bench::parameters(file.unit.gyro_affine.as_ref().expect("given"));
    let gyro = fit.sensor(Sensor::Gyro).expect("a gyro");
    let found = gyro.estimated.triad.forward_estimates();
    let largest = (0..9).map(|k| truth[k].abs()).fold(0.0, f64::max);
    let error = (0..9).map(|k| (found[k].value - truth[k]).abs() / largest);
    let inside = (0..9).filter(|k| (found[*k].value - truth[*k]).abs() <= found[*k].interval);
    (error.fold(0.0, f64::max), inside.count())
}

fn names_no_bias_of_the_gyro(fit: &Fit) {
    let result = FitResult::of(fit);
    let gyro = result.sensors.gyro.as_ref().expect("a gyro");
    let names: Vec<&str> = gyro.parameters.iter().map(|p| p.name.as_str()).collect();
    assert!(names.contains(&"scale_x") && names.contains(&"C_xx"));
    assert!(
        !names
            .iter()
            .any(|n| n.starts_with("bias_") || n.starts_with("o_")),
        "{names:?}"
    );
    let accel = result.sensors.accel.as_ref().expect("an accelerometer");
    assert!(accel.parameters.iter().any(|p| p.name == "bias_x"));
    let problems = RecordingProblem::of(fit);
    assert!(
        problems.iter().any(|p| p.id() == "bias_removed"),
        "{problems:?}"
    );
}

#[test]
fn a_high_pass_filter_is_found_with_its_time_constant_and_the_scale_factors_are_those_without_it() {
    for (time_constant_s, grade, bilinear) in [
        (15.0, Grade::Consumer, true),
        (4.0, Grade::Consumer, false),
        (60.0, Grade::Tactical, true),
    ] {
        let file = unit(&[], grade, SEED);
        let prepared = recorded(&file, SEED, high_pass(time_constant_s, bilinear));
        let Some(BiasRemoval::HighPass(filter)) = prepared.bias_removal else {
            panic!("{time_constant_s} s: {:?}", prepared.bias_removal);
        };
        // The pole of the usual form is τ / (τ + T), that of a slightly longer time constant.
        let decays_s = match bilinear {
            true => time_constant_s,
            false => (1.0 / RATE_HZ) / (1.0 / RATE_HZ / time_constant_s).ln_1p(),
        };
        let off = (filter.time_constant_s - decays_s).abs();
        assert!(off <= filter.half_width_s, "{filter:?} for {decays_s} s");
        assert!(filter.half_width_s < 0.02 * time_constant_s, "{filter:?}");
        let with = fit(prepared, Options::default()).expect("a fit");
        let without = fit(
            recorded(&file, SEED, |x, _| x.map(f64::round)),
            Options::default(),
        )
        .expect("a fit");
        let gain = match bilinear {
            true => 1.0,
            false => 1.0 - 0.5 / RATE_HZ / time_constant_s,
        };
        let (error, inside) = judged(&with, &file, gain);
        let (usual, _) = judged(&without, &file, 1.0);
        assert!(
            inside >= 8 && error < 3.0 * usual,
            "{time_constant_s} s: {error} for {usual}, {inside} of 9"
        );
        names_no_bias_of_the_gyro(&with);
    }
}

#[test]
fn a_bias_learnt_at_rest_is_named_and_the_scale_factors_stay() {
    let file = unit(&[], Grade::Consumer, SEED);
    let prepared = recorded(&file, SEED, zeroed());
    let Some(BiasRemoval::Zeroed(found)) = prepared.bias_removal else {
        panic!("{:?}", prepared.bias_removal);
    };
    let truth = file.unit.gyro_affine.as_ref().expect("given").bias;
    for (found, truth) in found.bias.iter().zip(truth) {
        assert!((found - truth).abs() < 5.0, "{found} for {truth}");
    }
    let fit = fit(prepared, Options::default()).expect("a fit");
    // This firmware also learns the end of a slow turn, and then errs by up to 1.4 deg/s for a turn: the intervals have to contain that.
    let (error, inside) = judged(&fit, &file, 1.0);
    assert!(inside >= 8, "{error}, {inside} of 9");
    names_no_bias_of_the_gyro(&fit);
    let file = Calibration::of(&fit, &[], "2026-01-01T00:00:00Z").expect("a file");
    let removed = |table: &Option<TriadTable>| table.as_ref().and_then(|t| t.bias_removed.clone());
    assert!(removed(&file.gyro).is_some() && removed(&file.accel).is_none());
}

#[test]
fn no_sensor_that_keeps_its_bias_is_said_to_lose_it() {
    let effects: [&[&'static str]; 6] = [
        &[],
        &["gyro_bias_drift"],
        &["gyro_warm_up"],
        &["gyro_g_sensitivity"],
        &["gyro_scale_cubic"],
        &["gyro_thermal_bias"],
    ];
    for (seed, ids) in effects.into_iter().enumerate() {
        for grade in Grade::ALL {
            let mut file = unit(ids, grade, seed as u64);
            // Ten times the usual size.
            for effect in &mut file.effect {
                for (_, value) in effect.parameters.iter_mut() {
                    if let toml::Value::Array(all) = value {
                        for one in all.iter_mut() {
                            if let toml::Value::Float(x) = one {
                                *x *= 10.0;
                            }
                        }
                    }
                }
            }
            let prepared = recorded(&file, seed as u64, |x, _| x);
            assert_eq!(prepared.bias_removal, None, "{ids:?} {grade:?}");
            // A sensor without bias.
            let bias = file.unit.gyro_affine.as_ref().expect("given").bias;
            let prepared = recorded(&file, seed as u64, |x, _| [0, 1, 2].map(|k| x[k] - bias[k]));
            assert_eq!(
                prepared.bias_removal, None,
                "{ids:?} {grade:?} without bias"
            );
        }
    }
}

#[test]
fn no_published_recording_by_hand_is_said_to_lose_its_bias() {
    let fits = (0..5).map(mikoff).chain([xsens()]);
    for fit in fits.flatten() {
        assert_eq!(fit.prepared.bias_removal, None, "{}", fit.prepared.place);
    }
}
