//! A soak: the temperature is constant, is measured, and changes again at once.

use mimu::quantity::Sensor;
use mimu_thermal::classic::Classic;
use mimu_thermal::fit::{Estimator, Options, fit};
use nalgebra::Matrix3;

use crate::session;
use crate::simulation::{GAIN, truth};
use crate::soak;

#[test]
fn the_end_of_a_soak_is_a_plateau_though_the_next_ramp_follows_at_once() {
    let recording = session(soak::record(60.0, 1)).unwrap();
    assert!((recording.thermometer.duration_s() - 3600.0 * soak::HOURS).abs() < 1.0);
    let options = Options {
        estimator: Estimator::Classic(Classic::Soak),
        lag_s: None,
        range_c: None,
    };
    let found = fit(vec![recording], &[], options).unwrap();
    for sensor in [0, 1] {
        let curves = found.joint.curves[Sensor::BOTH[sensor]].as_ref().unwrap();
        let [low, high] = curves.range_c;
        assert!((low + 10.0).abs() < 0.1 && (high - 70.0).abs() < 0.1);
        for temp_c in [-10.0, 30.0, 70.0] {
            let off: Matrix3<f64> = curves.forward(temp_c)[0].matrix - truth(sensor, temp_c).0;
            // Six sigmas of two dwells of 15 s at 50 deg/s of the noise of the gyro, 183 ppm; the accelerometer's are a sixth.
            assert!(
                off.amax() / GAIN[sensor] < 1.1e-3,
                "{sensor} {temp_c}: {off}"
            );
        }
    }
}
