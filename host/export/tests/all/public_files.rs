//! Files of public repositories: the lines of the inertial unit, with their source and licence.

use mimu::quantity::Sensor;
use mimu_allan::model::Term;
use mimu_export::foreign::{self, Foreign};
use mimu_recording::RawUnit;

fn read(name: &str, text: &str) -> Foreign {
    let read = foreign::read(text.as_bytes(), "file").unwrap().unwrap();
    assert_eq!(read.format.name, name);
    read
}

/// White noise and walk of the worst axis, gyro and accelerometer.
fn noise(of: &Foreign, rate_hz: Option<f64>) -> [f64; 4] {
    let worst = |sensor, term| {
        let axes = of.density(sensor, term, rate_hz).unwrap();
        axes.into_iter().fold(0.0, f64::max)
    };
    [
        worst(Sensor::Gyro, Term::N),
        worst(Sensor::Gyro, Term::K),
        worst(Sensor::Accel, Term::N),
        worst(Sensor::Accel, Term::K),
    ]
}

#[track_caller]
fn assert_noise(found: [f64; 4], expected: [f64; 4]) {
    for (found, expected) in found.into_iter().zip(expected) {
        assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
    }
}

/// rpng/open_vins, config/euroc_mav/kalibr_imu_chain.yaml (1d10d125, GPL-3.0).
const OPENVINS: &str = "%YAML:1.0\n\nimu0:\n  T_i_b:\n    - [1.0, 0.0, 0.0, 0.0]\n    - [0.0, 1.0, 0.0, 0.0]\n    - [0.0, 0.0, 1.0, 0.0]\n    - [0.0, 0.0, 0.0, 1.0]
  accelerometer_noise_density: 2.0000e-3  # [ m / s^2 / sqrt(Hz) ]
  accelerometer_random_walk: 3.0000e-3    # [ m / s^3 / sqrt(Hz) ]
  gyroscope_noise_density: 1.6968e-04     # [ rad / s / sqrt(Hz) ]
  gyroscope_random_walk: 1.9393e-05
  rostopic: /imu0
  update_rate: 200.0
  model: \"kalibr\" # calibrated (same as kalibr), kalibr, rpng
  Tw:\n    - [ 1.0, 0.0, 0.0 ]\n    - [ 0.0, 1.0, 0.0 ]\n    - [ 0.0, 0.0, 1.0 ]
  R_IMUtoGYRO:\n    - [ 1.0, 0.0, 0.0 ]\n    - [ 0.0, 1.0, 0.0 ]\n    - [ 0.0, 0.0, 1.0 ]
  Ta:\n    - [ 1.0, 0.0, 0.0 ]\n    - [ 0.0, 1.0, 0.0 ]\n    - [ 0.0, 0.0, 1.0 ]\n";

#[test]
fn the_chain_of_openvins_for_euroc() {
    let file = read("openvins", OPENVINS);
    assert_noise(noise(&file, None), [1.6968e-4, 1.9393e-5, 2e-3, 3e-3]);
    let one = file.calibration(RawUnit::Si).unwrap();
    assert!((one.inverse(Sensor::Gyro).unwrap().matrix[(2, 2)] - 1.0).abs() < 1e-12);
    assert!(!file.has_bias(Sensor::Gyro));
}

/// rpng/open_vins, config/tum_vi/kalibr_imu_chain.yaml (3ae57920, GPL-3.0), without the intrinsics: the same as Kalibr's own input.
#[test]
fn the_noise_of_kalibr_for_tum_vi() {
    let file = read(
        "kalibr",
        "imu0:\n  accelerometer_noise_density: 0.0028  # [ m / s^2 / sqrt(Hz) ]\n  accelerometer_random_walk: 0.00086\n  \
         gyroscope_noise_density: 0.00016\n  gyroscope_random_walk: 2.2e-05\n  rostopic: /imu0\n  update_rate: 200.0\n",
    );
    assert_noise(noise(&file, None), [1.6e-4, 2.2e-5, 2.8e-3, 8.6e-4]);
}

/// HKUST-Aerial-Robotics/VINS-Fusion, config/euroc/euroc_stereo_imu_config.yaml (939f0128, GPL-3.0).
#[test]
fn the_noise_of_vins_is_that_of_a_sample() {
    let text = "%YAML:1.0\n\nbody_T_cam0: !!opencv-matrix\n   rows: 4\n   cols: 4\n   dt: d\n   data: [0.0148655429818, -0.999880929698,\n           0, 1]\n\
                acc_n: 0.1          # accelerometer measurement noise standard deviation. #0.2   0.04\ngyr_n: 0.01\nacc_w: 0.001\ngyr_w: 0.0001\ng_norm: 9.81007\n";
    let root = f64::sqrt(200.0);
    let expected = [0.01, 1e-4, 0.1, 1e-3].map(|n| n / root);
    assert_noise(noise(&read("vins", text), Some(200.0)), expected);
}

/// UZ-SLAMLab/ORB_SLAM3, Examples/Monocular-Inertial/EuRoC.yaml (d6573f1e, GPL-3.0).
#[test]
fn the_noise_of_orb_slam3() {
    let text = "%YAML:1.0\nFile.version: \"1.0\"\nIMU.T_b_c1: !!opencv-matrix\n   rows: 4\n   cols: 4\n   data: [0.0148655429818, -0.999880929698]\n\
                # IMU noise\nIMU.NoiseGyro: 1.7e-4 #1.6968e-04\nIMU.NoiseAcc: 2.0000e-3 #2.0e-3\nIMU.GyroWalk: 1.9393e-05 \nIMU.AccWalk: 3.0000e-03 # 3e-03\n\
                IMU.Frequency: 200.0\n";
    assert_noise(
        noise(&read("orbslam3", text), None),
        [1.7e-4, 1.9393e-5, 2e-3, 3e-3],
    );
}

/// TixiaoShan/LIO-SAM, config/params.yaml with the parameters of ROS 2 (BSD-3-Clause).
#[test]
fn the_noise_of_lio_sam_for_ros2() {
    let text = "/**:\n  ros__parameters:\n\n    # IMU Settings\n    imuAccNoise: 3.9939570888238808e-03\n    imuGyrNoise: 1.5636343949698187e-03\n    \
                imuAccBiasN: 6.4356659353532566e-05\n    imuGyrBiasN: 3.5640318696367613e-05\n\n    imuGravity: 9.80511\n";
    let found = noise(&read("liosam", text), None);
    assert_noise(
        found,
        [
            1.5636343949698187e-3,
            3.564031869636761e-5,
            0.003993957088823881,
            6.435665935353257e-5,
        ],
    );
}

/// hku-mars/FAST_LIO, config/avia.yaml (1087a724, GPL-2.0): round numbers, 0.1 (m/s²)² and 0.1 (rad/s)².
#[test]
fn the_variances_of_fast_lio() {
    let text = "common:\n    imu_topic:  \"/livox/imu\"\nmapping:\n    acc_cov: 0.1\n    gyr_cov: 0.1\n    b_acc_cov: 0.0001\n    b_gyr_cov: 0.0001\n    \
                extrinsic_R: [ 1, 0, 0,\n                   0, 1, 0,\n                   0, 0, 1]";
    let expected = [0.1f64, 1e-4, 0.1, 1e-4].map(|v| (v / 200.0).sqrt());
    assert_noise(noise(&read("fastlio", text), Some(200.0)), expected);
}

/// vectr-ucla/direct_lidar_inertial_odometry, cfg/dlio.yaml (044f8440, MIT).
#[test]
fn the_intrinsics_of_dlio_are_those_of_calibrated_readings() {
    let text = "dlio:\n\n  version: 1.1.1\n\n  imu:\n    calibration: true\n    intrinsics:\n      accel:\n        bias: [ 0.0, 0.0, 0.0 ]\n        \
                sm:   [ 1.,  0.,  0.,\n                0.,  1.,  0.,\n                0.,  0.,  1. ]\n      gyro:\n        bias: [ 0.0, 0.0, 0.0 ]\n";
    let file = read("dlio", text);
    let accel = file
        .calibration(RawUnit::Si)
        .unwrap()
        .inverse(Sensor::Accel)
        .unwrap();
    assert_eq!(accel, mimu_core::compensation::Affine::identity());
}

/// i2Nav-WHU/KF-GINS, dataset/kf-gins.yaml (014f465b, GPL-3.0): a fibre-optic unit, Leador A15.
#[test]
fn the_noise_of_kf_gins() {
    let text = "imunoise:\n  arw: [0.003, 0.003, 0.003]          # [deg/sqrt(hr)]\n  vrw: [0.03, 0.03, 0.03]          # [m/s/sqrt(hr)]\n  \
                gbstd: [0.027, 0.027, 0.027]        # [deg/hr]\n  abstd: [15.0, 15.0, 15.0]     # [mGal]\n  gsstd: [300.0, 300.0, 300.0]  # [ppm]\n  \
                corrtime: 4.0                    # [hr]\n";
    let degree = 1f64.to_radians();
    // gi_engine.cpp: the driving noise of a bias is 2 std² / corrtime.
    let walk = f64::sqrt(2.0 / (4.0 * 3600.0));
    let expected = [
        0.003 * degree / 60.0,
        0.027 * degree / 3600.0 * walk,
        0.03 / 60.0,
        15e-5 * walk,
    ];
    assert_noise(noise(&read("kf-gins", text), None), expected);
}

/// VladyslavUsenko/basalt, data/euroc_ds_calib.json (0cef943b, BSD-3-Clause): one density for three axes, as before 2020.
#[test]
fn the_biases_of_basalt_for_euroc() {
    let text = r#"{"value0": {"intrinsics": [{"camera_type": "ds", "intrinsics": {"fx": 349.7560023050409}}],
        "calib_accel_bias": [0.001725405479279035, 0.1500005286487319, 0.06708820471592454, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        "calib_gyro_bias": [-0.002186848441668376, 0.024427823167917037, 0.07668367023977922, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        "imu_update_rate": 200.0, "accel_noise_std": 0.016, "gyro_noise_std": 0.000282, "accel_bias_std": 0.001, "gyro_bias_std": 0.0001}}"#;
    let file = read("basalt", text);
    assert_noise(noise(&file, None), [2.82e-4, 1e-4, 0.016, 1e-3]);
    let gyro = file
        .calibration(RawUnit::Si)
        .unwrap()
        .inverse(Sensor::Gyro)
        .unwrap();
    assert!((gyro.offset[2] + 0.07668367023977922).abs() < 1e-15);
    assert!((gyro.matrix - nalgebra::Matrix3::identity()).amax() < 1e-15);
}

/// Lines of `diff all` of an F722 as owners post them, codes of 1/2048 g.
#[test]
fn the_codes_of_betaflight() {
    let text = "# Betaflight / STM32F7X2 (F722) 2025.12.2\nboard_name IFLIGHT_F722_TWING\nfeature GPS\n#set acc_calibration = 0,0,0,0\n\
                set acc_calibration = -88,-49,23,1\nset baro_bustype = I2C\n";
    let accel = read("betaflight", text).calibration(RawUnit::Si).unwrap();
    let offset = accel.inverse(Sensor::Accel).unwrap().offset;
    assert!((offset[0] - 88.0 * 9.80665 / 2048.0).abs() < 1e-12);
}

/// ArduPilot/ardupilot, Tools/autotest/default_params (GPL-3.0): its separators differ, and so do those of PX4's files.
#[test]
fn parameters_of_autopilots_in_their_three_layouts() {
    let lines = "# we need small INS_ACC offsets so INS is recognised as being calibrated\nINS_ACCOFFS_X   0.001\nINS_ACCOFFS_Y   0.001\n\
                 INS_ACCOFFS_Z   0.001\nINS_ACCSCAL_X   1.001\nINS_ACCSCAL_Y   1.001\nINS_ACCSCAL_Z   1.001\n";
    let tabs: String = lines
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| format!("1\t1\t{}\t9\n", line.replace("   ", "\t")))
        .collect();
    for text in [lines, &lines.replace("   ", ","), &tabs] {
        let accel = read("ardupilot", text).calibration(RawUnit::Si).unwrap();
        let accel = accel.inverse(Sensor::Accel).unwrap();
        assert!((accel.matrix[(1, 1)] - 1.001).abs() < 1e-12, "{text}");
        assert!((accel.offset[1] + 0.001001).abs() < 1e-12, "{text}");
    }
}
