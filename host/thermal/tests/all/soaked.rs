//! A soak: the temperature is constant, is measured, and changes again at once.

use mimu::quantity::Sensor;
use mimu_thermal::curves::TriadCurves;
use nalgebra::Matrix3;

use crate::classic::{Classic, estimate};
use crate::session;
use crate::simulation::{GAIN, truth};
use crate::soak;

#[test]
fn the_end_of_a_soak_is_a_plateau_though_the_next_ramp_follows_at_once() {
    let recording = session(soak::record(60.0, 1)).unwrap();
    assert!((recording.thermometer.duration_s() - 3600.0 * soak::HOURS).abs() < 1.0);
    let found = estimate(&[recording], Classic::Soak).unwrap();
    for sensor in [0, 1] {
        let curves = found.curves[Sensor::BOTH[sensor]].as_ref().unwrap();
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

#[test]
fn with_m_constant_each_row_is_that_of_25_degrees_times_a_scale_factor_that_follows_the_temperature()
 {
    let recording = session(soak::record(60.0, 1)).unwrap();
    let found = estimate(&[recording], Classic::SoakConstantM).unwrap();
    let of =
        |sensor: usize| -> &TriadCurves { found.curves[Sensor::BOTH[sensor]].as_ref().unwrap() };
    for sensor in [0, 1] {
        // The set points are 10 K apart; 20 and 30 °C are equally far from 25 °C.
        let rows = |p: Matrix3<f64>| Matrix3::from_fn(|i, j| p[(i, j)] / p[(i, i)]);
        let room = [20.0, 30.0].map(|t| rows(truth(sensor, t).0));
        for temp_c in [-10.0, 30.0, 70.0] {
            let model = of(sensor).forward(temp_c)[0];
            let (p, b) = truth(sensor, temp_c);
            let of_room = room.map(|m| (rows(model.matrix) - m).amax());
            // Six sigmas, as above.
            assert!(of_room[0].min(of_room[1]) < 1.1e-3, "{sensor}: {of_room:?}");
            // Inputs along the other axes are balanced, so a wrong M does not enter K and b.
            for i in 0..3 {
                let k = model.matrix[(i, i)] / p[(i, i)] - 1.0;
                assert!(k.abs() < 1.1e-3, "{sensor} {temp_c}: {k}");
                let b = (model.bias[i] - b[i]) / GAIN[sensor];
                assert!(b.abs() < [1e-3, 5e-3][sensor], "{sensor} {temp_c}: {b}");
            }
        }
    }
    // The gyro's n_yz is -2400 ppm at 20 °C, -1850 at 30 and -350 at 70 (niu, Table 9), which a constant M cannot follow. M is known to 180 ppm.
    let off = (of(0).forward(70.0)[0].matrix - truth(0, 70.0).0)[(1, 2)] / GAIN[0];
    assert!((-2.7e-3..-0.9e-3).contains(&off), "{off}");
}
