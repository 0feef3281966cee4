//! Each effect in the simplest experiment that shows it, against its closed form.

mod listed;
mod unlisted;

use std::f64::consts::TAU;

use mimu_rig::effects::{draw, specs};
use mimu_rig::located::Source;
use mimu_rig::motion::Motion;
use mimu_rig::pins::Pins;
use mimu_rig::rig_file::{RigFile, RigTruth};
use mimu_rig::rotation::Rotation;
use mimu_rig::unit::Unit;

const DPS: f64 = TAU / 360.0;
const G: f64 = 9.80665;
const MG: f64 = 1e-3 * G;

/// No filters and no rails; the dies follow the chamber within seconds and do not heat themselves.
const PLAIN: &str = "format = \"mimu-rig/1\"
[unit]
supply_error_ppm = 0
[unit.gyro_axes]
bandwidth_hz = [inf, inf, inf]
low_raw = -1e9
high_raw = 1e9
[unit.accel_axes]
bandwidth_hz = [inf, inf, inf]
rc_hz = inf
low_raw = -1e9
high_raw = 1e9
[thermal]
board_lag_s = 2
die_lag_s = [1, 1, 1, 1]
board_heating_c = 0
die_heating_c = [0, 0, 0, 0]
";

/// Axes exactly along the body's axes.
const STRAIGHT: &str = "directions = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\n";

/// Quantisation step of a 16-bit converter at the pins of the gyros: 3.3 V through 0.65.
const GYRO_LSB: f64 = 3.3 / 0.65 / 65536.0;

/// The same unit with and without the effect, including the noise.
struct Pair {
    truth: RigTruth,
    with: Unit,
    without: Unit,
}

impl Pair {
    fn new(effect: &str, dt_s: f64) -> Self {
        Self::of(
            &PLAIN.replace("low_raw", &format!("{STRAIGHT}low_raw")),
            effect,
            dt_s,
        )
    }

    fn of(rig: &str, effect: &str, dt_s: f64) -> Self {
        let source = Source::new("RIG.toml", format!("{rig}\n[[effect]]\n{effect}\n"));
        let truth = RigTruth::resolve(&RigFile::parse(&source).unwrap(), 1).unwrap();
        let with = Unit::new(&truth.unit, 1, dt_s);
        let mut clean = truth.unit.clone();
        clean.effects.clear();
        let without = Unit::new(&clean, 1, dt_s);
        Self {
            truth,
            with,
            without,
        }
    }

    fn pins(&mut self, motion: &Motion, chamber_c: f64) -> (Pins, Pins) {
        (
            self.with.step(motion, chamber_c),
            self.without.step(motion, chamber_c),
        )
    }

    /// Error that the effect adds at the inputs: rad/s and m/s².
    fn step(&mut self, motion: &Motion, chamber_c: f64) -> ([f64; 3], [f64; 3]) {
        let (with, without) = self.pins(motion, chamber_c);
        let unit = &self.truth.unit;
        (
            std::array::from_fn(|i| {
                (with.gyro_v[i] - without.gyro_v[i]) / unit.gyro.axes[i].sensitivity
            }),
            std::array::from_fn(|i| {
                (with.accel_v[i] - without.accel_v[i]) / unit.accel.axes[i].sensitivity
            }),
        )
    }
}

fn motion(t_s: f64, rate: [f64; 3], force: [f64; 3]) -> Motion {
    Motion {
        t_s,
        attitude: Rotation::NONE,
        position: [0.0; 3],
        rate,
        angular_acceleration: [0.0; 3],
        force,
    }
}

fn close(found: [f64; 3], expected: [f64; 3], within: f64, what: &str) {
    for (f, e) in found.iter().zip(expected) {
        assert!(
            (f - e).abs() <= within,
            "{what}: {found:?}, expected {expected:?}"
        );
    }
}

#[test]
fn an_effect_of_size_zero_changes_nothing_at_all() {
    for spec in specs() {
        let truth = RigTruth::resolve(&RigFile::default(), 3).unwrap().unit;
        let mut off = truth.clone();
        off.effects = draw(&[spec.id], 0.0, 5).unwrap();
        let mut on = truth.clone();
        on.effects = draw(&[spec.id], 1.0, 5).unwrap();
        let [mut clean, mut zero, mut full] = [&truth, &off, &on].map(|t| Unit::new(t, 3, 1e-2));
        let mut changed = false;
        for n in 0..2000 {
            let t = 1e-2 * f64::from(n);
            let mut m = motion(
                t,
                [6.0 * (0.5 * t).sin(), 4.0 * (0.7 * t).cos(), 1.0],
                [G * (2.0 * t).sin(), 3.0, G * (2.0 * t).cos()],
            );
            m.angular_acceleration = [1.0, 2.0, 3.0];
            let expected = clean.step(&m, 30.0 + t);
            // A power of two cannot be zero; these have their own tests.
            let by_power = spec.id == "x_code_stuck_bit" || spec.id.ends_with("_sign_extension");
            if !by_power {
                assert_eq!(zero.step(&m, 30.0 + t), expected, "{}", spec.id);
            }
            changed |= full.step(&m, 30.0 + t) != expected;
        }
        assert!(changed, "{} does nothing", spec.id);
    }
}

#[test]
fn an_effect_leaves_the_noise_as_it_was() {
    // Default noise, filters and rails: apart from the effect itself, only rounding remains.
    let effect = "id = \"gyro_bias_drift\"\ndps_per_hour = [3600, 0, 0]";
    let mut pair = Pair::of(
        "format = \"mimu-rig/1\"\n[unit.gyro_axes]\nbandwidth_hz = [inf, inf, inf]",
        effect,
        1e-3,
    );
    for n in 0..1000 {
        let t = 1e-3 * f64::from(n);
        let (gyro, accel) = pair.step(&motion(t, [0.0; 3], [0.0, 0.0, G]), 25.0);
        close(gyro, [t * DPS, 0.0, 0.0], 1e-12, "gyro");
        close(accel, [0.0; 3], 0.0, "accel");
    }
}
