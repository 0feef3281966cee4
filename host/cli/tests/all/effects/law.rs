//! The device evaluates every effect according to its definition, for any inputs.

use mimu::effects;
use mimu::effects::candidate::{Candidate, CandidateKind};
use mimu::effects::effect::OnDevice;
use mimu::effects::quantity::{Conditions, REFERENCE_C};
use mimu::effects::temperature::lagged;
use mimu::quantity::Sensor;
use mimu_core::compensation::Sample;
use mimu_core::effects::{DeviceEffect, Directions, Effects, State};
use nalgebra::{Matrix3, Vector3};

use crate::random::congruential;

/// Smaller effects vanish in the rounding of the readings, rad/s or m/s².
const ROUNDING: f64 = 1e-9;

/// Random inputs of each effect.
const DRAWS: usize = 20;

/// At this fraction of the data-sheet size the inputs are practically undisturbed. This is needed because the device evaluates each law after
/// removing the error of the previous sample.
const SMALL: f64 = 1e-3;

#[test]
fn every_effect_is_evaluated_by_the_device_as_its_data_say() {
    let matrix = Matrix3::new(1.0, 0.03, -0.02, 0.01, 1.0, 0.04, -0.03, 0.02, 1.0);
    let directions = Directions::<f64>::of(&matrix).unwrap();
    let mut uniform = congruential(1);
    let mut random = || 2.0 * uniform() - 1.0;
    for effect in effects::all() {
        if !matches!(effect.on_device(), OnDevice::EverySample | OnDevice::Folded) {
            continue;
        }
        let parameter = effect.parameter.map(|p| 2.0 * p.from);
        let mut compared = 0;
        for _ in 0..DRAWS {
            let size =
                |c: &effects::effect::Coefficient, r: f64| SMALL * c.typical * (1.5 + 0.5 * r);
            let values: Vec<f64> = effect.of_unit().map(|c| size(c, random())).collect();
            let mut device = Effects::<f64, 8>::of(mimu_core::PerSensor::both(directions));
            device
                .push(DeviceEffect::named(effect.id, &values, parameter).unwrap())
                .unwrap();

            // Two samples, a second apart, at two temperatures.
            let mut vector = |size: f64| Vector3::from_fn(|_, _| size * random());
            let samples = [(); 2].map(|()| Sample {
                gyro: vector(4.0),
                accel: vector(20.0),
            });
            let temp_c = [(); 2].map(|()| 25.0 + 20.0 * random());
            let [first_s, step_s] = [50.0, 20.0].map(|s| s * (1.5 + random()));
            let mut state = State::new(1.0);
            device.slow(&mut state, first_s, temp_c[0]);
            device.slow(&mut state, step_s, temp_c[1]);
            device.remove(&mut state, &samples[0]);
            let clean = device.remove(&mut state, &samples[1]);

            let offsets = temp_c.map(|t| t - REFERENCE_C);
            let signal = [(0.0, offsets[0]), (step_s, offsets[1])];
            let [own, of_device] = match effect.sensor {
                Sensor::Gyro => [samples[1].gyro, samples[1].gyro - clean.gyro],
                Sensor::Accel => [samples[1].accel, samples[1].accel - clean.accel],
            };
            let at = Conditions {
                session: 0,
                t_s: first_s + step_s,
                on_s: first_s + step_s,
                from_middle_s: first_s + step_s,
                duration_s: 1.0,
                rate: samples[1].gyro,
                force: samples[1].accel,
                angular_acceleration: samples[1].gyro - samples[0].gyro,
                sensed: directions.sensed * own,
                temperature_offset: offsets[1],
                lagged_temperature: lagged(&signal, parameter.unwrap_or(1.0))[1],
            };
            let candidate = Candidate::new(effect.sensor, CandidateKind::Effect(effect));
            let mut error = Vector3::zeros();
            candidate.add_error(&at, parameter.unwrap_or(0.0), &values, &mut error);
            let of_host = directions.to_body * error;
            let off = (of_device - of_host).norm();
            // A high power is almost zero for some inputs.
            if of_host.norm() < ROUNDING {
                continue;
            }
            compared += 1;
            assert!(
                off < 1e-3 * of_host.norm(),
                "{}: the device removes {of_device:?}, and its data say {of_host:?}: the row in core/src/effects/law.rs is another law",
                effect.id
            );
        }
        assert!(
            2 * compared > DRAWS,
            "{}: only {compared} of {DRAWS} random inputs, up to 4 rad/s and 20 m/s², give an error above {ROUNDING}: is the typical size too small?",
            effect.id
        );
    }
}
