//! The sensors over temperature, against curves and branches written out here.

use mimu_rig::located::Source;
use mimu_rig::motion::Motion;
use mimu_rig::rig_file::{RigFile, RigTruth};
use mimu_rig::rotation::Rotation;
use mimu_rig::unit::Unit;

/// Degrees per hour and thousandths of standard gravity, in SI.
const DEG_PER_H: f64 = std::f64::consts::PI / 180.0 / 3600.0;
const MG: f64 = 9.80665e-3;

/// A unit without noise, filters, rails or self-heating, whose dies have the chamber's temperature: 1 raw per SI.
const PLAIN: &str = "format = \"mimu-rig/1\"
[unit]
supply_error_ppm = 0
temperature_offset_c = 0
temperature_noise_c = 0
[unit.gyro_affine]
matrix = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
bias = [0, 0, 0]
[unit.accel_affine]
matrix = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
bias = [0, 0, 0]
[unit.gyro_axes]
white_si = [0, 0, 0]
instability_si = [0, 0, 0]
walk_si = [0, 0, 0]
bandwidth_hz = [inf, inf, inf]
low_raw = -1e9
high_raw = 1e9
[unit.accel_axes]
white_si = [0, 0, 0]
instability_si = [0, 0, 0]
walk_si = [0, 0, 0]
bandwidth_hz = [inf, inf, inf]
rc_hz = inf
low_raw = -1e9
high_raw = 1e9
[thermal]
board_lag_s = 0.01
die_lag_s = [0.01, 0.01, 0.01, 0.01]
board_heating_c = 0
die_heating_c = [0, 0, 0, 0]
";

fn truth(curves: &str, seed: u64) -> RigTruth {
    let source = Source::new("RIG.toml", format!("{PLAIN}{curves}"));
    RigTruth::resolve(&RigFile::parse(&source).unwrap(), seed).unwrap()
}

/// Steps of one second: the lags of 0.01 s have settled.
fn unit(curves: &str) -> Unit {
    Unit::new(&truth(curves, 1).unit, 1, 1.0)
}

fn motion(rate: [f64; 3], force: [f64; 3]) -> Motion {
    Motion {
        t_s: 0.0,
        attitude: Rotation::NONE,
        position: [0.0; 3],
        rate,
        angular_acceleration: [0.0; 3],
        force,
    }
}

/// Readings after the chamber has been at a temperature for three seconds.
fn at(unit: &mut Unit, motion: &Motion, chamber_c: f64) -> ([f64; 3], [f64; 3]) {
    let mut last = ([0.0; 3], [0.0; 3]);
    for _ in 0..3 {
        let pins = unit.step(motion, chamber_c);
        last = (pins.gyro_v, pins.accel_v);
    }
    last
}

fn near(found: f64, expected: f64, within: f64) {
    assert!(
        (found - expected).abs() <= within,
        "{found:e}, expected {expected:e}"
    );
}

#[test]
fn each_axis_errs_by_its_cubics_of_bias_scale_and_misalignment() {
    let mut unit = unit(
        "[curves]
reference_c = 10
[curves.gyro]
bias_deg_per_h = [[1, 2, 3, 4], [0, 0, 0, 0], [-5, 0.1, 0, 0]]
scale_ppm = [[100, 0, 0, 0], [0, 10, 0, 0], [0, 0, 1, 0.5]]
misalignment_ppm = [[1000, 0, 0, 0], [0, 20, 0, 0], [300, 0, 0, 0], [0, 0, 0, 0.1], [0, 0, 0, 0], [7, 7, 7, 0]]
[curves.accel]
bias_mg = [[2, 0, 0, 0], [0, -0.5, 0, 0], [0, 0, 0, 0.001]]
scale_ppm = [[0, 30, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]]
misalignment_ppm = [[0, 0, 0, 0], [50, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0], [0, 40, 0, 0], [0, 0, 0, 0]]",
    );
    let (w, f) = ([0.3, -0.7, 1.1], [2.0, -5.0, 8.0]);
    for chamber_c in [-40.0, 10.0, 25.0, 70.0] {
        let (gyro, accel) = at(&mut unit, &motion(w, f), chamber_c);
        let t = chamber_c - 10.0;
        let ppm = 1e-6;
        let expected = [
            w[0] + DEG_PER_H * (1.0 + 2.0 * t + 3.0 * t * t + 4.0 * t * t * t)
                + ppm * (100.0 * w[0] + 1000.0 * w[1] + 20.0 * t * w[2]),
            w[1] + ppm * (10.0 * t * w[1] + 300.0 * w[0] + 0.1 * t * t * t * w[2]),
            w[2] + DEG_PER_H * (0.1 * t - 5.0)
                + ppm * ((t * t + 0.5 * t * t * t) * w[2] + (7.0 + 7.0 * t + 7.0 * t * t) * w[1]),
        ];
        for i in 0..3 {
            near(gyro[i], expected[i], 1e-12);
        }
        let expected = [
            f[0] + 2.0 * MG + ppm * (30.0 * t * f[0] + 50.0 * f[2]),
            f[1] - 0.5 * t * MG,
            f[2] + 1e-3 * t * t * t * MG + ppm * 40.0 * t * f[0],
        ];
        for i in 0..3 {
            near(accel[i], expected[i], 1e-12);
        }
    }
}

#[test]
fn hysteresis_goes_by_the_path_of_the_temperature_and_not_by_its_rate() {
    let curves = "[curves.gyro]\nhysteresis_deg_per_h = [30, -60, 0]\nhysteresis_width_c = 8";
    let rest = motion([0.0; 3], [0.0; 3]);
    // Up by 20 K, down by 4 (half the width: between the branches), down by 16 more, up by 2, and down by 2 again: a small loop within the play
    // leaves the state unchanged.
    let path = [0.0, 20.0, 16.0, 0.0, 2.0, 0.0];
    let branch = [0.0, 1.0, 0.0, -1.0, -0.5, -1.0];
    for steps in [1, 7, 400] {
        let mut unit = unit(curves);
        let mut from = path[0];
        for (to, expected) in path.into_iter().zip(branch) {
            for k in 1..=steps {
                let c = from + (to - from) * f64::from(k) / f64::from(steps);
                unit.step(&rest, c);
            }
            from = to;
            let gyro = at(&mut unit, &rest, to).0;
            near(gyro[0], 30.0 * DEG_PER_H * expected, 1e-12);
            near(gyro[1], -60.0 * DEG_PER_H * expected, 1e-12);
            near(gyro[2], 0.0, 1e-15);
        }
    }
}

#[test]
fn what_is_wrong_with_curves_and_thermometer_is_named_with_its_line() {
    #[rustfmt::skip]
    let cases = [
        ("[curves.gyro]\nbias_mg = [[0, 0, 0, 0]]", "3: unknown field `bias_mg`, expected one of `bias_deg_per_h`"),
        ("[curves.gyro]\nhysteresis_width_c = 0", "3: `hysteresis_width_c` is 0; give 0.01 to 300"),
        ("[curves.accel]\npower_on_sigma_mg = [1, -1, 1]", "3: `power_on_sigma_mg` is -1; give 0 to 1000000"),
        (
            "[curves.accel]\nnoise_at_c_raw = [[10, 1, 1, 1], [0, 1, 1, 1]]",
            "3: `noise_at_c_raw`: 0 °C follows 10 °C; give [°C, x, y, z] in order of temperature",
        ),
        ("[flaws]\nthermometer_sticks_s = [30, 20]", "3: `thermometer_sticks_s` ends at 20 s, before it begins; give [from, to]"),
        ("[unit]\ntemperature_lag_s = -1", "3: `temperature_lag_s` is -1; give 0 to 1000000"),
    ];
    for (text, complaint) in cases {
        let source = Source::new("RIG.toml", format!("format = \"mimu-rig/1\"\n{text}"));
        let found = RigFile::parse(&source).unwrap_err();
        assert!(found.contains(complaint), "{found}");
    }
}
