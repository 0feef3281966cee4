//! Effects that estimators do not know.

use std::f64::consts::TAU;

use mimu_rig::rotation::Rotation;

use super::{DPS, G, GYRO_LSB, MG, Pair, close, motion};

#[test]
fn a_stuck_bit_is_missing_from_every_code_that_has_it() {
    let mut pair = Pair::of(
        "format = \"mimu-rig/1\"\n[converter]\nreference_error_ppm = 0\n",
        "id = \"x_code_stuck_bit\"\nlsb = 17",
        1e-3,
    );
    let mut seen = [false; 2];
    for n in 0..200 {
        let (with, without) = pair.pins(
            &motion(0.0, [0.01 * f64::from(n), 0.0, 0.0], [0.0, 0.0, G]),
            25.0,
        );
        let code = (without.gyro_v[0] / GYRO_LSB).round() as i64;
        let expected = if code & 16 != 0 { -16.0 } else { 0.0 };
        assert!(((with.gyro_v[0] - without.gyro_v[0]) / GYRO_LSB - expected).abs() < 1e-6);
        seen[usize::from(code & 16 != 0)] = true;
    }
    assert_eq!(seen, [true; 2]);
}

#[test]
fn hum_is_a_sine_and_a_ripple_near_the_sample_rate_a_slow_one() {
    let mut hum = Pair::new(
        "id = \"x_mains_hum\"\nmv = [5, 5, 5]\nfrequency_hz = 50",
        1e-3,
    );
    let mut beat = Pair::new(
        "id = \"x_usb_beat\"\nmv = [2, 2, 2]\nfrequency_hz = 1000.01",
        1e-3,
    );
    let (mut square, mut slowest) = (0.0, 0.0_f64);
    let mut last = None;
    let mut range = [f64::INFINITY, f64::NEG_INFINITY];
    for n in 0..100_000 {
        let m = motion(1e-3 * f64::from(n), [0.0; 3], [0.0; 3]);
        let (with, without) = hum.pins(&m, 25.0);
        square += (with.gyro_v[1] - without.gyro_v[1]).powi(2) / 1e5;
        let (with, without) = beat.pins(&m, 25.0);
        let v = with.accel_v[1] - without.accel_v[1];
        slowest = slowest.max(last.map_or(0.0, |l: f64| (v - l).abs()));
        last = Some(v);
        range = [range[0].min(v), range[1].max(v)];
    }
    assert!((square.sqrt() - 5e-3 / 2_f64.sqrt()).abs() < 1e-9);
    // 0.01 Hz at 1 kHz, over one whole period of 100 s.
    assert!(slowest < 2e-3 * TAU * 0.01 * 1e-3 * 1.001);
    assert!((range[0] + 2e-3).abs() < 1e-9 && (range[1] - 2e-3).abs() < 1e-9);
}

#[test]
fn the_reference_sags_with_the_rate_of_the_table() {
    let mut pair = Pair::new("id = \"x_supply_coupling\"\nppm_per_100dps = 300", 1e-3);
    let (with, without) = pair.pins(
        &motion(0.0, [0.0, -120.0 * DPS, 160.0 * DPS], [0.0; 3]),
        25.0,
    );
    assert!(
        (with.converter_reference_v / without.converter_reference_v - (1.0 - 600e-6)).abs() < 1e-12
    );
    assert_eq!(with.gyro_v, without.gyro_v);
}

#[test]
fn vibration_is_rectified_by_its_mean_square_above_the_corner() {
    let dt = 1e-4;
    let mut pair = Pair::new(
        "id = \"x_gyro_vibration_rectification\"\ndps_per_g2 = [0.1, 0.2, -0.1]\ncorner_hz = 10",
        dt,
    );
    let (mut mean, count) = ([0.0; 3], 20_000);
    for n in 0..2 * count {
        let shake = 2.0 * (TAU * 50.0 * dt * f64::from(n)).sin();
        let (gyro, _) = pair.step(&motion(0.0, [0.0; 3], [0.0, G * shake, G]), 25.0);
        if n >= count {
            mean = std::array::from_fn(|i| mean[i] + gyro[i] / f64::from(count));
        }
    }
    // Half the square of 2 g, through a first-order high-pass: f²/(f² + fc²) = 25/26. Gravity is excluded.
    close(
        mean,
        [0.1, 0.2, -0.1].map(|c| c * DPS * 2.0 * 25.0 / 26.0),
        1e-5 * DPS,
        "mean",
    );
}

#[test]
fn anisoelasticity_is_a_product_of_two_forces() {
    let effect =
        "id = \"x_gyro_g_squared\"\nmatrix_dps_per_g2 = [[0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]]";
    let (gyro, _) =
        Pair::new(effect, 1e-2).step(&motion(0.0, [0.0; 3], [G, 2.0 * G, -3.0 * G]), 25.0);
    close(gyro, [0.2, -0.6, -0.3].map(|x| x * DPS), 1e-12, effect);
}

#[test]
fn below_the_half_width_locked_gyros_say_nothing() {
    let mut pair = Pair::new(
        "id = \"x_gyro_dead_zone\"\nhalf_width_dps = [3, 3, 3]",
        1e-2,
    );
    for (rate, out) in [(2.9, 0.0), (-1.0, 0.0), (5.0, 4.0), (-5.0, -4.0)] {
        let (gyro, _) = pair.step(&motion(0.0, [rate * DPS; 3], [0.0; 3]), 25.0);
        close(gyro.map(|g| g / DPS + rate), [out; 3], 1e-10, "out");
    }
}

#[test]
fn a_magnetic_bias_follows_the_heading() {
    let mut pair = Pair::new("id = \"x_gyro_magnetic\"\ndps_per_gauss = [1, 1, 1]", 1e-2);
    for (heading, expected) in [
        (0.0, [0.0, 0.2, -0.45]),
        (90.0, [0.2, 0.0, -0.45]),
        (180.0, [0.0, -0.2, -0.45]),
    ] {
        let mut m = motion(0.0, [0.0; 3], [0.0; 3]);
        // Body x rotated from east towards north.
        m.attitude = Rotation::about([0.0, 0.0, 1.0], heading * DPS);
        close(
            pair.step(&m, 25.0).0,
            expected.map(|x| x * DPS),
            1e-12,
            "heading",
        );
    }
}

#[test]
fn beyond_the_limit_a_bias_stays_and_decays() {
    let effect = "id = \"x_gyro_saturation_recovery\"\ndps = [1, 1, 1]\nlimit_dps = 200\ntime_constant_s = 5";
    let mut pair = Pair::new(effect, 0.1);
    let mut step = |rate: f64| {
        pair.step(&motion(0.0, [rate * DPS, 0.0, 0.0], [0.0; 3]), 25.0)
            .0
    };
    close(step(199.0), [0.0; 3], 0.0, "below");
    close(step(-201.0), [DPS, 0.0, 0.0], 1e-12, "beyond");
    for n in 1..100 {
        close(
            step(0.0),
            [DPS * (-0.1 * f64::from(n) / 5.0).exp(), 0.0, 0.0],
            1e-12,
            "after",
        );
    }
}

#[test]
fn bias_jumps_have_two_levels_and_exponential_dwell_times() {
    let mut pair = Pair::new(
        "id = \"x_gyro_bias_jumps\"\ndps = [0.2, 0.4, 0.6]\nmean_dwell_s = 2",
        0.01,
    );
    let (mut jumps, count) = (0, 400_000);
    let mut last = [0.1, 0.2, 0.3].map(|x| x * DPS);
    for _ in 0..count {
        let (gyro, _) = pair.step(&motion(0.0, [0.0; 3], [0.0; 3]), 25.0);
        close(
            gyro.map(f64::abs),
            [0.1, 0.2, 0.3].map(|x| x * DPS),
            1e-12,
            "level",
        );
        jumps += (0..3).filter(|&i| gyro[i] * last[i] < 0.0).count();
        last = gyro;
    }
    // 4000 s of three axes at 2 s: 6000 jumps, Poisson.
    assert!(
        (jumps as f64 - 6000.0).abs() < 4.0 * 6000_f64.sqrt(),
        "{jumps}"
    );
}

#[test]
fn rotation_couples_into_the_accelerometer_by_the_product_with_force() {
    let effect = "id = \"x_accel_rotation_coupling\"\nmg_per_100dps_g = [3, 3, 3]";
    let m = motion(0.0, [100.0 * DPS, 200.0 * DPS, 0.0], [G, 0.0, 2.0 * G]);
    let (_, accel) = Pair::new(effect, 1e-2).step(&m, 25.0);
    // x: ωy fz = 4, y: ωz fx = 0, z: ωx fy = 0.
    close(accel, [12.0 * MG, 0.0, 0.0], 1e-12, effect);
}

#[test]
fn stress_remembers_from_which_side_the_force_came() {
    let mut pair = Pair::new(
        "id = \"x_accel_stress_hysteresis\"\nmg = [3, 3, 3]\nplay_g = 0.2",
        1e-2,
    );
    let mut at = |fx: f64| {
        pair.step(&motion(0.0, [0.0; 3], [fx * G, 0.0, 0.0]), 25.0)
            .1[0]
            / MG
    };
    for (force, error) in [
        (0.0, 0.0),
        (0.1, 1.5),
        (1.0, 3.0),
        (0.0, -3.0),
        (-1.0, -3.0),
        (0.0, 3.0),
        (-0.2, 0.0),
    ] {
        assert!((at(force) - error).abs() < 1e-9, "{force}");
    }
}

#[test]
fn creep_is_as_large_in_each_decade_of_time() {
    let mut pair = Pair::new(
        "id = \"x_accel_creep\"\nmg_per_decade = [2, 2, 2]\nonset_s = 10",
        1e-2,
    );
    for (t, decades) in [(0.0, 0.0), (90.0, 1.0), (990.0, 2.0), (9990.0, 3.0)] {
        let (_, accel) = pair.step(&motion(t, [0.0; 3], [0.0; 3]), 25.0);
        close(accel, [2.0 * decades * MG; 3], 1e-11, "creep");
    }
}
