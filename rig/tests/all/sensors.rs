//! Heat, sensors and converter against closed forms.

use mimu_rig::converter::Converter;
use mimu_rig::filter::LowPass;
use mimu_rig::located::Source;
use mimu_rig::motion::Motion;
use mimu_rig::pins::Pins;
use mimu_rig::rig_file::{RigFile, RigTruth};
use mimu_rig::rotation::{Rotation, dot};
use mimu_rig::thermal::{Thermal, ThermalTruth};
use mimu_rig::unit::Unit;

/// All random variation in time disabled, and no filters.
const QUIET: &str = "
[unit]
temperature_noise_c = 0
[unit.gyro_axes]
white_si = [0, 0, 0]
instability_si = [0, 0, 0]
walk_si = [0, 0, 0]
bandwidth_hz = [inf, inf, inf]
rc_hz = inf
[unit.accel_axes]
white_si = [0, 0, 0]
instability_si = [0, 0, 0]
walk_si = [0, 0, 0]
bandwidth_hz = [inf, inf, inf]
rc_hz = inf
";

fn parse(text: &str) -> Result<RigFile, String> {
    RigFile::parse(&Source::new(
        "RIG.toml",
        format!("format = \"mimu-rig/1\"\n{text}"),
    ))
}

fn truth(text: &str, seed: u64) -> RigTruth {
    RigTruth::resolve(&parse(text).unwrap(), seed).unwrap()
}

fn still(rate: [f64; 3], force: [f64; 3]) -> Motion {
    Motion {
        t_s: 0.0,
        attitude: Rotation::NONE,
        position: [0.0; 3],
        rate,
        angular_acceleration: [0.0; 3],
        force,
    }
}

#[test]
fn a_low_pass_answers_a_step_with_an_exponential_and_a_ramp_with_its_lag() {
    let (tau, dt) = (0.1, 0.003);
    let mut filter = LowPass::new(tau, dt, 0.0);
    // The input is linear between the steps, so a jump is a ramp over one step.
    let first = filter.step(1.0);
    assert!((first - (1.0 - tau / dt * (1.0 - (-dt / tau).exp()))).abs() < 1e-14);
    for n in 1..200 {
        let expected = 1.0 - (1.0 - first) * (-dt * f64::from(n) / tau).exp();
        assert!((filter.step(1.0) - expected).abs() < 1e-13);
    }
    let mut filter = LowPass::new(tau, dt, 0.0);
    for n in 1..1000 {
        let t = dt * f64::from(n);
        let expected = t - tau * (1.0 - (-t / tau).exp());
        assert!((filter.step(t) - expected).abs() < 1e-12);
    }
}

fn heat(on_before_s: f64) -> ThermalTruth {
    ThermalTruth {
        board_lag_s: 300.0,
        die_lag_s: [4.0, 300.0, 40.0, 10.0],
        board_heating_c: 5.0,
        die_heating_c: [4.0, 3.0, 2.0, 0.5],
        on_before_s,
    }
}

#[test]
fn the_dies_warm_up_with_two_time_constants() {
    let (truth, dt) = (heat(60.0), 0.5);
    let mut thermal = Thermal::new(&truth, dt);
    let a = truth.board_lag_s;
    for n in 0..4000 {
        let on = 60.0 + dt * f64::from(n);
        let t = thermal.step(20.0);
        let board = 20.0 + 5.0 * (1.0 - (-on / a).exp());
        assert!((t.board - board).abs() < 1e-9);
        for (i, die) in t.die.iter().enumerate() {
            let b = truth.die_lag_s[i];
            // Step response of two lags in series; at equal lags 1 - (1 + t/a) e^(-t/a).
            let cascade = if a == b {
                1.0 - (1.0 + on / a) * (-on / a).exp()
            } else {
                1.0 - (a * (-on / a).exp() - b * (-on / b).exp()) / (a - b)
            };
            let expected = 20.0 + 5.0 * cascade + truth.die_heating_c[i] * (1.0 - (-on / b).exp());
            assert!((die - expected).abs() < 1e-5, "die {i}: {die} {expected}");
        }
    }
}

/// Computed by hand: 16 bits, 3.3 V, divider 0.65 for the gyros.
#[test]
fn codes_are_rounded_and_end_at_the_range() {
    let text = "[converter]\nbits = 16\nreference_v = 3.3\nreference_error_ppm = 0\ngyro_divider = 0.65\nnoise_codes = 0\nraw_unit = \"count\"";
    let truth = truth(text, 1);
    let mut converter = Converter::new(&truth.converter, &truth.unit, 1);
    let pins = |gyro: f64, accel: f64| Pins {
        gyro_v: [gyro; 3],
        gyro_reference_v: [2.5; 3],
        gyro_temp_v: [2.5; 3],
        accel_v: [accel; 3],
        supply_v: 3.3,
        converter_reference_v: 3.3,
        temp_c: 25.0,
    };
    for (gyro, accel, gyro_code, accel_code) in [
        (2.5, 1.65, 32272.0, 32768.0), // 2.5 · 0.65 / 3.3 · 65536 = 32271.515
        (2.4999, 1.64997, 32270.0, 32767.0), // less 1.291 and 0.596 codes
        (-0.1, -1.0, 0.0, 0.0),
        (5.1, 3.3, 65535.0, 65535.0),
        (0.0, 25.0e-6, 0.0, 0.0), // 0.4965 codes
        (0.0, 26.0e-6, 0.0, 1.0), // 0.516 codes
    ] {
        let readings = converter.read(&pins(gyro, accel));
        assert_eq!(readings.gyro, [gyro_code; 3], "{gyro}");
        assert_eq!(readings.accel, [accel_code; 3], "{accel}");
    }
    // A reference that is 1 % high lowers the codes by 1 %: 1.65/3.333 · 65536 = 32443.56.
    let high = Pins {
        converter_reference_v: 3.333,
        ..pins(2.5, 1.65)
    };
    assert_eq!(converter.read(&high).accel, [32444.0; 3]);
}

#[test]
fn without_effects_a_unit_is_affine_to_the_converters_step() {
    for seed in 0..5 {
        // During warm-up and in a changing chamber: neither has an influence.
        let truth = truth(&format!("{QUIET}\n[converter]\nnoise_codes = 0\n"), seed);
        let mut unit = Unit::new(&truth.unit, seed, 1e-3);
        let mut converter = Converter::new(&truth.converter, &truth.unit, seed);
        let reference = 1.0 + truth.unit.converter_reference.error;
        let supply = 1.0 + truth.unit.supply.error;
        let (pg, bg) = truth.unit.gyro.affine();
        let (pa, ba) = truth.unit.accel.affine();
        for n in 0..200 {
            let t = f64::from(n);
            let rate = [3.0 * (0.1 * t).sin(), 2.0 * (0.23 * t).cos(), 0.01 * t];
            let force = [
                9.0 * (0.3 * t).cos(),
                9.0 * (0.3 * t).sin(),
                4.0 * (0.7 * t).sin(),
            ];
            let readings = converter.read(&unit.step(&still(rate, force), 25.0 + t));
            for i in 0..3 {
                let gyro = (dot(pg[i], rate) + bg[i]) / reference;
                let accel = supply * (dot(pa[i], force) + ba[i]) / reference;
                assert!(
                    (readings.gyro[i] - gyro).abs()
                        <= 0.51 * 3.3 / 65536.0 / truth.converter.gyro_divider
                );
                assert!((readings.accel[i] - accel).abs() <= 0.51 * 3.3 / 65536.0);
            }
        }
    }
}

#[test]
fn outputs_stop_at_the_rails() {
    let truth = truth(QUIET, 2);
    let mut unit = Unit::new(&truth.unit, 2, 1e-3);
    let pins = unit.step(&still([20.0, -20.0, 0.0], [60.0, -60.0, 0.0]), 25.0);
    let supply = pins.supply_v / 3.3;
    assert_eq!(pins.gyro_v[..2], [4.75, 0.25]);
    assert_eq!(pins.accel_v[..2], [supply * 3.05, supply * 0.25]);
}
