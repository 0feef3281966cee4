//! The Xsens recording that came with IMU-TK (Tedaldi, Pretto, Menegatti, ICRA 2014), held by hand.
//!
//! Expected values: the results of IMU-TK for these files, in sample and with the same four blocks of dwells held out.

use mimu::quantity::Sensor;
use mimu_core::compensation::Affine;
use mimu_tests::recordings::{Models, upper_triangular_frame, verdict, xsens};
use nalgebra::{Matrix3, Vector3};

/// IMU-TK's direction error in degrees, in sample; held out it is 0.607. Over dwell means it errs by 1.116 mm/s², held out by 2.146.
const IMU_TK_DEG: f64 = 0.517;

/// IMU-TK's accelerometer, `x = T K (raw - b)`: 1/K in counts per m/s², T_xy T_xz T_yz, b in counts.
#[rustfmt::skip]
const IMU_TK_ACCEL: [f64; 9] = [414.4589, 412.0105, 414.6487, -0.003359299, -0.008906395, -0.021334119, 33124.1826, 33275.1794, 32364.4156];

/// IMU-TK's gyro in the same form, T by rows without its diagonal: 1/K in counts per rad/s.
#[rustfmt::skip]
const IMU_TK_GYRO: [f64; 12] = [
    4777.9558, 4764.2066, 4773.6574, 0.00593634, 0.001111009, 0.008088118, -0.053556862, 0.025306721, -0.002551303, 32777.1399, 32459.8029,
    32511.8475,
];

#[test]
fn the_dwells_of_a_recording_by_hand_are_found() {
    let Some(fit) = xsens() else { return };
    let [accel, gyro] = [Sensor::Accel, Sensor::Gyro].map(|s| fit.sensor(s).unwrap());
    // IMU-TK also finds 38, at each of its thresholds from 5 to 9. Every dwell but the first ends a turn.
    assert_eq!((accel.residuals.len(), gyro.residuals.len()), (38, 37));
}

#[test]
fn errors_in_sample_and_on_held_out_blocks_are_below_those_of_imu_tk() {
    let Some(fit) = xsens() else { return };
    let [accel, gyro] = [Sensor::Accel, Sensor::Gyro].map(|s| fit.sensor(s).unwrap());
    let size = [accel.rms(), accel.held_out_rms().unwrap()].map(|x| 1e3 * x);
    let angle = [gyro.rms(), gyro.held_out_rms().unwrap()].map(f64::to_degrees);
    // In sample the limit is IMU-TK's own figure. Held out, the limit for the accelerometer is just above its present error (1.56 mm/s²; IMU-TK,
    // given dwell means in place of its samples, reaches 1.57). For the gyro it is just below IMU-TK's error.
    assert!(size[0] <= 1.1 && size[1] <= 1.6, "{size:?} mm/s^2");
    assert!(angle[0] <= IMU_TK_DEG && angle[1] <= 0.60, "{angle:?} deg");
    assert_eq!(
        (accel.held_out.reasons.len(), gyro.held_out.reasons.len()),
        (0, 0)
    );
}

#[test]
fn parameters_agree_with_those_of_imu_tk_in_its_own_frame() {
    let Some(fit) = xsens() else { return };
    let models = Models::of(&fit);
    // x = T K (raw - b), T with a unit diagonal: a column of the inverse matrix over its diagonal element.
    let convention = |accel: &Affine<f64>, gyro: &Affine<f64>| {
        let forward = accel.matrix.try_inverse().unwrap();
        let (_, q) = upper_triangular_frame(&forward);
        let bias = |m: &Affine<f64>| -m.matrix.try_inverse().unwrap() * m.offset;
        let (a, g) = (q * accel.matrix, q * gyro.matrix);
        let mut out: Vec<f64> = (0..3).map(|i| 1.0 / a[(i, i)]).collect();
        out.extend([(0, 1), (0, 2), (1, 2)].map(|(i, j)| a[(i, j)] / a[(j, j)]));
        out.extend(&bias(accel));
        out.extend((0..3).map(|i| 1.0 / g[(i, i)]));
        let off = [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)];
        out.extend(off.map(|(i, j)| g[(i, j)] / g[(j, j)]));
        out.extend(&bias(gyro));
        out
    };
    let ours = models.in_convention(convention);
    let theirs = IMU_TK_ACCEL.iter().chain(&IMU_TK_GYRO);
    let pairs = ours.iter().zip(theirs);
    let off: Vec<f64> = pairs.map(|((value, ..), theirs)| theirs - value).collect();
    // Which gyro bias is right? IMU-TK takes it from the first rest, mimu from all rests.
    let inverse = |k: &[f64], t: Matrix3<f64>, b: &[f64]| {
        let matrix = t * Matrix3::from_diagonal(&Vector3::from_column_slice(k).map(f64::recip));
        Affine {
            matrix,
            offset: -matrix * Vector3::from_column_slice(b),
        }
    };
    let (a, g) = (&IMU_TK_ACCEL, &IMU_TK_GYRO);
    let t_accel = Matrix3::new(1.0, a[3], a[4], 0.0, 1.0, a[5], 0.0, 0.0, 1.0);
    let t_gyro = Matrix3::new(1.0, g[3], g[4], g[5], 1.0, g[6], g[7], g[8], 1.0);
    let theirs = [
        inverse(&a[..3], t_accel, &a[6..]),
        inverse(&g[..3], t_gyro, &g[9..]),
    ];
    let own = [Sensor::Accel, Sensor::Gyro].map(|s| fit.sensor(s).unwrap().estimated.triad.inverse);
    let [mimu, imu_tk] = [own, theirs].map(|[a, g]| verdict(&fit, &a, &g).unwrap());
    assert!(mimu.rest_rps < imu_tk.rest_rps && mimu.direction_rad < imu_tk.direction_rad);
    // Both use the same samples, so all nine within 95 % would be expected. One outside is chance, two are not. The gyro's biases are left out,
    // because their definitions differ.
    let outside = |from: usize| {
        let nine = from..from + 9;
        nine.filter(|&k| off[k].abs() > ours[k].2).count()
    };
    let [accel_outside, gyro_outside] = [0, 9].map(outside);
    assert!(accel_outside <= 1 && gyro_outside <= 1, "{off:?}");
    let scale = Vector3::from_fn(|i, _| ours[i].0);
    for (ours, known) in scale.iter().zip([414.5, 412.0, 414.6]) {
        assert!((ours / known - 1.0).abs() < 0.005, "{ours} for {known}");
    }
}
