//! Effects that an estimator may know.

use super::{DPS, G, GYRO_LSB, MG, PLAIN, Pair, close, motion};

#[test]
fn a_tumble_shows_the_g_sensitivity_matrix() {
    let matrix = [[0.1, -0.2, 0.3], [0.0, 0.2, -0.1], [0.25, 0.05, -0.15]];
    let effect = format!("id = \"gyro_g_sensitivity\"\nmatrix_dps_per_g = {matrix:?}");
    let mut pair = Pair::of(PLAIN, &effect, 1e-2);
    for axis in 0..3 {
        for sign in [1.0, -1.0] {
            let mut force = [0.0; 3];
            force[axis] = sign * G;
            let (gyro, accel) = pair.step(&motion(0.0, [0.0; 3], force), 25.0);
            close(
                gyro,
                matrix.map(|row| sign * DPS * row[axis]),
                1e-12,
                "gyro",
            );
            close(accel, [0.0; 3], 0.0, "accel");
        }
    }
}

#[test]
fn g_squared_is_even_in_the_force_and_grows_with_its_square() {
    let matrix = [[0.05, -0.02, 0.03], [0.0, 0.04, -0.01], [0.02, 0.05, -0.03]];
    let effect = format!("id = \"gyro_g_squared\"\nmatrix_dps_per_g2 = {matrix:?}");
    let mut pair = Pair::of(PLAIN, &effect, 1e-2);
    for axis in 0..3 {
        for g in [1.0, -1.0, 2.0] {
            let mut force = [0.0; 3];
            force[axis] = g * G;
            let (gyro, accel) = pair.step(&motion(0.0, [0.0; 3], force), 25.0);
            close(
                gyro,
                matrix.map(|row| g * g * DPS * row[axis]),
                1e-12,
                "gyro",
            );
            close(accel, [0.0; 3], 0.0, "accel");
        }
    }
}

#[test]
fn gyro_nonlinearities_are_powers_of_the_rate() {
    for (id, at_half, at_minus_half) in [
        ("gyro_scale_quadratic", 0.25, 0.25),
        ("gyro_scale_cubic", 0.125, -0.125),
        ("gyro_scale_asymmetry", 0.5, 0.5),
    ] {
        let mut pair = Pair::new(
            &format!("id = \"{id}\"\ndps_at_300dps = [0.3, -0.2, 0.1]"),
            1e-2,
        );
        for (rate, share) in [
            (150.0, at_half),
            (-150.0, at_minus_half),
            (0.0, 0.0),
            (300.0, 1.0),
        ] {
            let (gyro, _) = pair.step(&motion(0.0, [rate * DPS; 3], [0.0; 3]), 25.0);
            close(gyro, [0.3, -0.2, 0.1].map(|s| s * share * DPS), 1e-12, id);
        }
    }
}

#[test]
fn accelerometer_nonlinearities_are_powers_and_products_of_the_forces() {
    let force = [0.5 * G, -G, 1.2 * G];
    for (effect, expected) in [
        (
            "id = \"accel_scale_quadratic\"\nmg_per_g2 = [4, 4, 4]",
            [1.0, 4.0, 5.76],
        ),
        (
            "id = \"accel_scale_cubic\"\nmg_per_g3 = [8, 8, 8]",
            [1.0, -8.0, 13.824],
        ),
        // fx fy = -0.5, fy fz = -1.2, fz fx = 0.6.
        (
            "id = \"accel_cross_axis_product\"\nmatrix_mg_per_g2 = [[2, 0, 0], [0, 2, 0], [1, 1, 1]]",
            [-1.0, -2.4, -1.1],
        ),
    ] {
        let (gyro, accel) = Pair::new(effect, 1e-2).step(&motion(0.0, [0.0; 3], force), 25.0);
        close(accel, expected.map(|e| e * MG), 1e-12, effect);
        close(gyro, [0.0; 3], 0.0, effect);
    }
}

#[test]
fn in_a_centrifuge_each_accelerometer_axis_feels_its_own_arm() {
    let effect = "id = \"accel_size_effect\"\narms_mm = [[10, 0, 0], [0, 20, 0], [30, 0, 5]]";
    let mut pair = Pair::new(effect, 1e-2);
    // Steady rotation about z: the centrifugal force ω² r points outwards, so the specific force points inwards, against the arm.
    let w = 10.0;
    let (_, accel) = pair.step(&motion(0.0, [0.0, 0.0, w], [0.0, 0.0, G]), 25.0);
    close(
        accel,
        [-0.010 * w * w, -0.020 * w * w, 0.0],
        1e-12,
        "steady",
    );
    // About y, from rest: α × r, for z the arm along x gives -α x.
    let mut start = motion(0.0, [0.0; 3], [0.0, 0.0, G]);
    start.angular_acceleration = [0.0, 5.0, 0.0];
    let (_, accel) = pair.step(&start, 25.0);
    close(accel, [0.0, 0.0, -5.0 * 0.030], 1e-12, "starting");
}

#[test]
fn drifts_are_linear_and_warm_ups_exponential_since_power_on() {
    for (effect, expected) in [
        (
            "id = \"gyro_bias_drift\"\ndps_per_hour = [1, 2, -3]",
            [0.5, 1.0, -1.5].map(|x| x * DPS),
        ),
        (
            "id = \"gyro_warm_up\"\ndps = [1, 2, -3]\ntime_constant_s = 1000",
            [1.0, 2.0, -3.0].map(|x| x * DPS * (-1.9_f64).exp()),
        ),
    ] {
        let rig = PLAIN.replace("board_lag_s", "on_before_s = 100\nboard_lag_s");
        let (gyro, accel) =
            Pair::of(&rig, effect, 1e-2).step(&motion(1800.0, [0.0; 3], [0.0; 3]), 25.0);
        close(gyro, expected, 1e-12, effect);
        close(accel, [0.0; 3], 0.0, effect);
    }
    for (effect, expected) in [
        (
            "id = \"accel_bias_drift\"\nmg_per_hour = [1, 2, -3]",
            [0.5, 1.0, -1.5].map(|x| x * MG),
        ),
        (
            "id = \"accel_warm_up\"\nmg = [1, 2, -3]\ntime_constant_s = 900",
            [1.0, 2.0, -3.0].map(|x| x * MG * (-2.0_f64).exp()),
        ),
    ] {
        let (gyro, accel) =
            Pair::of(PLAIN, effect, 1e-2).step(&motion(1800.0, [0.0; 3], [0.0; 3]), 25.0);
        close(accel, expected, 1e-12, effect);
        close(gyro, [0.0; 3], 0.0, effect);
    }
}

#[test]
fn thermal_errors_follow_the_temperature_of_the_dies() {
    let m = motion(0.0, [1.0, 2.0, -1.0], [9.0, -8.0, 7.0]);
    let cross = "[[0, 10, 20], [30, 0, -10], [5, 0, 0]]";
    let tilt = |v: [f64; 3]| {
        [
            10.0 * v[1] + 20.0 * v[2],
            30.0 * v[0] - 10.0 * v[2],
            5.0 * v[0],
        ]
    };
    for warm in [-20.0, 30.0] {
        let bias = warm + 0.01 * warm * warm;
        for (effect, gyro_expected, accel_expected) in [
            (
                "id = \"gyro_thermal_bias\"\ndps_per_c = [0.1, 0.2, -0.1]\ncurvature_per_c = 0.01"
                    .to_owned(),
                [0.1, 0.2, -0.1].map(|x| x * DPS * bias),
                [0.0; 3],
            ),
            (
                "id = \"accel_thermal_bias\"\nmg_per_c = [1, 2, -1]\ncurvature_per_c = 0.01"
                    .to_owned(),
                [0.0; 3],
                [1.0, 2.0, -1.0].map(|x| x * MG * bias),
            ),
            (
                "id = \"gyro_thermal_scale\"\nppm_per_c = [100, 200, 300]".to_owned(),
                [100.0, 400.0, -300.0].map(|x| x * 1e-6 * warm),
                [0.0; 3],
            ),
            (
                "id = \"accel_thermal_scale\"\nppm_per_c = [100, 200, 300]".to_owned(),
                [0.0; 3],
                [900.0, -1600.0, 2100.0].map(|x| x * 1e-6 * warm),
            ),
            (
                format!("id = \"gyro_thermal_misalignment\"\nmatrix_urad_per_c = {cross}"),
                tilt(m.rate).map(|x| x * 1e-6 * warm),
                [0.0; 3],
            ),
            (
                format!("id = \"accel_thermal_misalignment\"\nmatrix_urad_per_c = {cross}"),
                [0.0; 3],
                tilt(m.force).map(|x| x * 1e-6 * warm),
            ),
        ] {
            let (gyro, accel) = Pair::new(&effect, 1e-2).step(&m, 25.0 + warm);
            close(gyro, gyro_expected, 1e-11, &effect);
            close(accel, accel_expected, 1e-11, &effect);
        }
    }
}

#[test]
fn a_mismatched_bit_adds_its_error_wherever_it_is_set() {
    let rig = "format = \"mimu-rig/1\"\n[unit.gyro_axes]\nwhite_si = [0, 0, 0]\ninstability_si = [0, 0, 0]\n\
               walk_si = [0, 0, 0]\nbandwidth_hz = [inf, inf, inf]\n[converter]\nreference_error_ppm = 0\n";
    let effect = "id = \"gyro_readout_code\"\nbit_errors_lsb = [8, 4, 0, 0, 0, -2]";
    let mut pair = Pair::of(rig, effect, 1e-3);
    let axis = pair.truth.unit.gyro.axes[0].clone();
    for (code, expected) in [
        (16_384.0 + 100.0, 4.0),        // top six bits 010000
        (32_768.0 + 100.0, 8.0),        // 100000
        (32_768.0 + 1024.0 + 9.0, 6.0), // 100001
        (49_152.0 + 100.0, 12.0),       // 110000
    ] {
        let volts = (code + 0.2) * GYRO_LSB;
        let rate = (volts - axis.null) / axis.sensitivity;
        // Along the axis itself, so that the pin has exactly the intended voltage.
        let (with, without) = pair.pins(
            &motion(0.0, axis.direction.map(|d| d * rate), [0.0; 3]),
            25.0,
        );
        assert!((without.gyro_v[0] / GYRO_LSB - code - 0.2).abs() < 1e-6);
        let found = (with.gyro_v[0] - without.gyro_v[0]) / GYRO_LSB;
        assert!((found - expected).abs() < 1e-6, "{code}: {found}");
    }
}

/// Difference that an effect makes to the outputs of the three gyros when the first reads a code, in codes.
fn by_code(effect: &str, code: f64) -> [f64; 3] {
    let rig = "format = \"mimu-rig/1\"\n[unit.gyro_axes]\nwhite_si = [0, 0, 0]\ninstability_si = [0, 0, 0]\n\
               walk_si = [0, 0, 0]\nbandwidth_hz = [inf, inf, inf]\n[converter]\nreference_error_ppm = 0\n";
    let mut pair = Pair::of(rig, effect, 1e-3);
    std::array::from_fn(|i| {
        let axis = pair.truth.unit.gyro.axes[i].clone();
        let rate = ((code + 0.2) * GYRO_LSB - axis.null) / axis.sensitivity;
        let along = motion(0.0, axis.direction.map(|d| d * rate), [0.0; 3]);
        let (with, without) = pair.pins(&along, 25.0);
        (with.gyro_v[i] - without.gyro_v[i]) / GYRO_LSB
    })
}

#[test]
fn where_codes_are_missing_all_above_are_too_high() {
    let effect = "id = \"gyro_missing_codes\"\ncodes = 20\nat = 0.5";
    for (code, expected) in [(32_767.0, 0.0), (32_768.0, 20.0), (50_000.0, 20.0)] {
        for found in by_code(effect, code) {
            assert!((found - expected).abs() < 1e-6, "{code}: {found}");
        }
    }
}

/// A firmware's reading of a 16-bit code whose low byte it takes for a signed number.
fn misread(code: i16) -> f64 {
    let [high, low] = code.to_be_bytes().map(|b| f64::from(b as i8));
    256.0 * high + low
}

#[test]
fn a_signed_low_byte_makes_what_such_a_firmware_makes_of_its_two_bytes() {
    let digital = "format = \"mimu-rig/1\"\n[unit]\ngyro = \"MPU6050-gyro\"\naccel = \"MPU6050-accel\"\n[unit.gyro_axes]\n\
                   white_si = [0, 0, 0]\ninstability_si = [0, 0, 0]\nwalk_si = [0, 0, 0]\nbandwidth_hz = [inf, inf, inf]\n";
    let mut pair = Pair::of(digital, "id = \"gyro_sign_extension\"\ncodes = 256", 1e-3);
    let axis = pair.truth.unit.gyro.axes[0].clone();
    for code in (-32_000..32_000).step_by(37) {
        let rate = (f64::from(code) - axis.null) / axis.sensitivity;
        let along = motion(0.0, axis.direction.map(|d| d * rate), [0.0; 3]);
        let (with, without) = pair.pins(&along, 25.0);
        assert_eq!(without.gyro_v[0].round(), f64::from(code));
        assert_eq!(with.gyro_v[0].round(), misread(code as i16), "{code}");
        assert_eq!(with.accel_v, without.accel_v);
    }
}
