use super::*;
use crate::diagnose::effect::REFERENCE_C;
use mimu_core::effects;

#[test]
fn every_term_is_found_again_by_its_id() {
    for sensor in Sensor::BOTH {
        for monomial in Monomial::all() {
            for axis in 0..3 {
                let id = Candidate::new(sensor, Kind::Term(axis, monomial.clone())).id();
                let found = candidate(&id).unwrap();
                assert_eq!((found.id(), found.sensor), (id, sensor));
                assert!(matches!(&found.kind, Kind::Term(a, m) if *a == axis && *m == monomial));
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
        let values = vec![1.0; candidate.active.len()];
        let form = 100.0;
        let removed = Removed {
            candidate,
            form,
            values,
        };
        [Condition::Rate, Condition::Force, Condition::Temperature].map(|c| depends(&removed, c))
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
    assert_eq!(effects::REFERENCE_C, REFERENCE_C);
    assert_eq!(effects::RATE_LAG_S, crate::diagnose::candidate::RATE_LAG_S);
}

#[test]
fn every_effect_that_is_found_can_be_removed_by_the_device() {
    for effect in library::all().filter(|e| e.is_error()) {
        let candidate = Candidate::new(effect.sensor, Kind::Effect(effect));
        let values = vec![1.0; candidate.active.len()];
        let removed = Removed {
            candidate,
            form: 60.0,
            values,
        };
        assert!(on_device::<f32>(&removed).is_ok(), "{}", effect.id);
    }
}

#[test]
fn an_effect_that_the_device_lacks_is_refused() {
    static MAGNETIC: Effect = Effect {
        id: "gyro_magnetic",
        sensor: Sensor::Gyro,
        about: "an error by the magnetic field",
        coefficients: &[],
        typical: &[],
        form: None,
        regressors: |_, _, _| (),
        needs: "a compass",
    };
    for kind in [
        Kind::Effect(&MAGNETIC),
        Kind::Jump {
            axis: 0,
            session: 0,
            t_s: 9.0,
        },
    ] {
        let candidate = Candidate::new(Sensor::Gyro, kind);
        let removed = Removed {
            candidate,
            form: 0.0,
            values: Vec::new(),
        };
        assert_eq!(on_device::<f32>(&removed).unwrap_err(), Refused::Unknown);
    }
}
