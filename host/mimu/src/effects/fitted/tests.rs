use super::*;
use crate::effects;
use crate::effects::effect::{Effect, OnDevice as HowRemoved};
use crate::effects::fitted::NotOnDevice;
use crate::effects::quantity::{RATE_LAG_S, REFERENCE_C};
use crate::effects::regressor::Product;
use mimu_core::effects as of_core;

#[test]
fn every_term_is_found_again_by_its_id() {
    for sensor in Sensor::BOTH {
        for term in Product::terms() {
            for axis in 0..3 {
                let id = Candidate::new(sensor, CandidateKind::Term(axis, term)).id();
                let found = candidate(&id).unwrap();
                assert_eq!((found.id(), found.sensor), (id, sensor));
                assert!(
                    matches!(&found.kind, CandidateKind::Term(a, m) if *a == axis && *m == term)
                );
            }
        }
    }
}

#[test]
fn what_is_no_id_names_nothing() {
    for id in [
        "earth_rate",
        "gyro_magnetic",
        "gyro_scale_cubic ",
        "term:gyro_x~",
        "term:gyro_w~rate_x",
        "term:baro_x~rate_x",
        "term:gyro_x~rate_x^0",
        "term:gyro_x~rate_x^4",
        "term:gyro_x~rate_x*rate_x",
        "term:gyro_x~force_x*rate_x",
        "term:gyro_x~rate_x*rate_y*rate_z*time",
        "term:gyro_x~speed",
        "jump of gyro_x at 9 s",
    ] {
        assert!(candidate(id).is_none(), "{id}");
    }
}

#[test]
fn conditions_of_an_effect_are_those_of_its_physics() {
    let depends_on = |id: &str| {
        let candidate = candidate(id).unwrap();
        [Need::Rate, Need::Force, Need::Temperature].map(|need| candidate.needs(need))
    };
    assert_eq!(depends_on("gyro_g_sensitivity"), [false, true, false]);
    assert_eq!(depends_on("gyro_scale_asymmetry"), [true, false, false]);
    assert_eq!(depends_on("accel_size_effect"), [true, false, false]);
    assert_eq!(depends_on("accel_thermal_scale"), [false, true, true]);
    assert_eq!(depends_on("accel_thermal_lag"), [false, false, true]);
    assert_eq!(depends_on("gyro_warm_up"), [false, false, false]);
    assert_eq!(depends_on("term:gyro_x~temp_rate"), [false, false, true]);
    assert_eq!(
        depends_on("term:gyro_x~rate_x*force_y^2"),
        [true, true, false]
    );
}

#[test]
fn both_sides_count_warmth_from_the_same_temperature_and_filter_its_rate_alike() {
    assert_eq!(of_core::REFERENCE_C, REFERENCE_C);
    assert_eq!(of_core::RATE_LAG_S, RATE_LAG_S);
}

#[test]
fn every_effect_that_a_calibration_holds_can_be_removed_by_the_device() {
    for effect in effects::all().filter(|e| e.on_device() != HowRemoved::Never) {
        let candidate = Candidate::new(effect.sensor, CandidateKind::Effect(effect));
        let values = vec![1e-6; candidate.active.len()];
        let fitted = FittedEffect::new(candidate, 60.0, values);
        assert!(fitted.on_device::<f32>().is_ok(), "{}", effect.id);
    }
}

#[test]
fn an_effect_that_the_device_lacks_is_refused() {
    static MAGNETIC: Effect = Effect {
        id: "gyro_magnetic",
        sensor: Sensor::Gyro,
        about: "an error by the magnetic field",
        coefficients: &[],
        parameter: None,
        size: "",
        needs: "a compass",
        taken_for: "",
    };
    let jump = CandidateKind::Jump {
        axis: 0,
        session: 0,
        t_s: 9.0,
    };
    for (kind, why) in [
        (CandidateKind::Effect(&MAGNETIC), NotOnDevice::NoLaw),
        (jump, NotOnDevice::Jump),
    ] {
        let candidate = Candidate::new(Sensor::Gyro, kind);
        let fitted = FittedEffect::new(candidate, 0.0, Vec::new());
        assert_eq!(fitted.on_device::<f32>(), Err(why));
    }
}

#[test]
fn a_number_that_no_correction_has_is_refused_by_its_name_and_value() {
    let refused = |id: &str, values: &[f64], parameter: f64| {
        let fitted = FittedEffect::new(candidate(id).unwrap(), parameter, values.to_vec());
        fitted.on_device::<f32>().unwrap_err().to_string()
    };
    for (why, number) in [
        (
            refused("accel_scale_quadratic", &[1e-4, 0.2, 0.0], 0.0),
            "y = 0.2 ",
        ),
        (
            refused("gyro_thermal_bias", &[0.0, 0.0, 1.0, 0.0, 0.0, 0.0], 0.0),
            "z = 1.0 rad/s/",
        ),
        (refused("gyro_warm_up", &[1e-3; 3], -60.0), "= -60.0 s"),
        (
            refused("term:accel_y~rate_x*force_y", &[3.0], 0.0),
            "y = 3.0 ",
        ),
    ] {
        assert!(
            why.contains(number) && why.contains("is impossible"),
            "{why}"
        );
    }
}

#[test]
fn an_effect_that_is_found_again_adds_to_what_is_known() {
    let fitted = |id: &str, value: f64, parameter: f64| {
        let candidate = candidate(id).unwrap();
        let values = vec![value; candidate.active.len()];
        FittedEffect {
            sigmas: vec![3e-6; values.len()],
            ..FittedEffect::new(candidate, parameter, values)
        }
    };
    let mut all = vec![fitted("gyro_g_sensitivity", 1e-4, 0.0)];
    all[0].candidate.active.remove(0);
    all[0].values.remove(0);
    all[0].sigmas.remove(0);
    fitted("gyro_g_sensitivity", 2e-5, 0.0).join(&mut all);
    assert_eq!(all.len(), 1);
    let coefficients = all[0].coefficients();
    let of = |name: &str| {
        let found = coefficients.iter().find(|c| c.name == name);
        found.map(|c| (c.value, c.sigma.unwrap())).unwrap()
    };
    assert_eq!(of("xx"), (2e-5, 3e-6));
    let (value, sigma) = of("zy");
    assert!((value - 1.2e-4).abs() < 1e-18 && (sigma - 18_f64.sqrt() * 1e-6).abs() < 1e-18);
    // Exponentials with different time constants are separate effects.
    fitted("gyro_warm_up", 1e-3, 60.0).join(&mut all);
    fitted("gyro_warm_up", 1e-3, 90.0).join(&mut all);
    assert_eq!(all.len(), 3);
    fitted("gyro_warm_up", 1e-3, 90.0).join(&mut all);
    assert_eq!(all[2].values[0], 2e-3);
}

#[test]
fn an_interval_that_reaches_the_end_of_what_was_searched_is_open_there() {
    let interval = |lower, upper| {
        let lag = FittedEffect {
            interval: Some(Interval { lower, upper }),
            ..FittedEffect::new(candidate("gyro_thermal_lag").unwrap(), 60.0, vec![0.0; 3])
        };
        lag.nonlinear_parameter().unwrap().interval()
    };
    assert_eq!(interval(Some(55.0), Some(66.0)), "55.0 to 66.0");
    assert_eq!(interval(None, Some(66.0)), "at most 66.0");
    assert_eq!(interval(Some(55.0), None), "at least 55.0");
    assert_eq!(interval(None, None), "the whole searched range");
}

#[test]
fn an_effect_in_a_file_is_the_one_that_was_fitted() {
    let lag = FittedEffect {
        interval: Some(Interval {
            lower: Some(55.0),
            upper: None,
        }),
        sigmas: vec![1e-6, 2e-6, 3e-6],
        ..FittedEffect::new(
            candidate("gyro_thermal_lag").unwrap(),
            60.0,
            vec![1e-3, 0.0, -2e-3],
        )
    };
    let text = toml::to_string(&lag).unwrap();
    let read: FittedEffect = toml::from_str(&text).unwrap();
    assert_eq!(read, lag);
    assert_eq!(read.interval, lag.interval);
    // The same holds for an effect that comes back from a device, except for what the device does not store.
    let kept = FittedEffect::all_of_device(&[lag.on_device().unwrap()]).unwrap();
    assert_eq!(kept[0].candidate.active, [0, 2]);
    assert_eq!(kept[0].values, [f64::from(1e-3_f32), f64::from(-2e-3_f32)]);
    assert_eq!(kept[0].parameter, 60.0);
}
