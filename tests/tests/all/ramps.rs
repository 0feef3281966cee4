//! Fit and diagnosis of recordings with temperature ramps: the noise floor, the warning and the effects found. The bench knows the truth.

use std::sync::Arc;

use mimu::diagnose::{Recordings, diagnose};
use mimu::fit::{Options, fit};
use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use mimu::result::diagnosis::DiagnosisResult;
use mimu::warning::Warning;
use mimu_rig::rig_file::RigFile;
use mimu_tests::bench;
use mimu_tests::ramp::{plan, thermal, unit};

fn floors(prepared: Prepared) -> [f64; 2] {
    let fitted = fit(prepared, Options::IN_SAMPLE).expect("a fit");
    Sensor::BOTH.map(|s| fitted.sensor(s).expect("recorded").noise_floor())
}

#[test]
fn a_drift_with_a_temperature_that_ramps_is_not_taken_for_noise() {
    // 3 K/min up and down.
    let ramp = plan(5, 20.0, &[[0.0, 0.0], [700.0, 35.0], [1400.0, 0.0]]);
    for seed in [1, 2, 3] {
        let still = floors(bench::recorded(&ramp, &unit(seed), seed));
        let drifting = floors(bench::recorded(&ramp, &thermal(seed), seed));
        // 2 mg/K over one kelvin per dwell is 20 mm/s²; the noise of a dwell mean is below 1 mm/s².
        for (a, b) in still.iter().zip(&drifting) {
            assert!((b / a - 1.0).abs() < 0.02, "{still:?} {drifting:?}");
        }
    }
}

#[test]
fn at_a_constant_temperature_the_noise_floor_is_that_of_two_successive_means() {
    // Only the thermometer could make the two variances differ: none, and one that shows a constant temperature with its own noise.
    let constant = plan(3, 20.0, &[[0.0, 25.0]]);
    for seed in [1, 2, 3] {
        let with = bench::recorded(&constant, &unit(seed), seed);
        let mut without = with.clone();
        for block in &mut Arc::make_mut(&mut without.condensed).blocks {
            block.temp_c.mean = f64::NAN;
        }
        let floor = |p: &Prepared| {
            let noise = mimu::noise::Noise::within(&p.dwells.list, &p.condensed, &p.dwells.rails);
            [0, 3].map(|c| noise.channels[c].variance(20.0).sqrt())
        };
        assert_eq!(floor(&with), floor(&without));
    }
}

#[test]
fn a_diagnosis_that_accepted_thermal_effects_does_not_say_that_the_model_has_no_temperature() {
    let ramp = plan(5, 10.0, &[[0.0, 0.0], [350.0, 35.0], [700.0, 0.0]]);
    let of = |file: &RigFile| {
        let diagnosis = diagnose(
            Recordings::from(bench::recorded(&ramp, file, 4)),
            Options::IN_SAMPLE,
        );
        let diagnosis = diagnosis.expect("a diagnosis");
        let next = mimu::plan::next_experiment::next(&diagnosis);
        DiagnosisResult::of(&diagnosis, &next, None)
    };
    let said = |result: &DiagnosisResult| {
        let said = result.warnings.iter().map(Warning::to_string);
        let said = said.filter(|w| w.contains("does not depend on temperature"));
        said.collect::<Vec<_>>()
    };
    let both = of(&thermal(4));
    assert!(both.effects.len() >= 2);
    assert_eq!(said(&both), Vec::<String>::new());
    let mut gyro = thermal(4);
    gyro.curves.accel.bias_mg = None;
    let one = of(&gyro);
    assert_eq!(said(&one).len(), 1, "{:?}", one.warnings);
    assert!(
        said(&one)[0].ends_with("but the accelerometer's model does not depend on temperature")
    );
    let none = of(&unit(4));
    assert!(said(&none)[0].ends_with("but the model does not depend on temperature"));
}
