//! niu, section 5: three tests at 10 deg/s and three at rest while the chamber goes from -10 to 70 °C in an hour, compensated as a device does.
//!
//! The units are niu's, behind sensors with outputs in volts, as on the device. `mimu thermal fit` on niu's own ramp makes the calibration. It is
//! encoded and decoded as for the device, and applied in single precision by the code that the firmware runs.

use mimu::quantity::Sensor;
use mimu_core::compensation::Sample;
use mimu_core::stored::Stored;
use mimu_device::Image;
use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::record::samples;
use mimu_rig::rig_file::{RigFile, RigTruth};
use mimu_tests::niu::{Row, TABLE_10, TABLE_11};
use mimu_tests::page::{Block, Table};
use mimu_thermal::fit::{Options, fit};
use nalgebra::Vector3;
use rayon::prelude::*;

use crate::on_bench::{read, session, unit};

/// Volts per rad/s and per m/s² of the replacement parts, and their volts without input.
const GAIN: [f64; 2] = [0.2865, 0.08];
const NULL_V: [f64; 2] = [2.5, 1.65];
/// Samples between two temperature updates: 20 ms, a batch of the device.
const FOLLOW: usize = 2;
const RATE_HZ: usize = 100;
/// Length of a test, s.
const HOUR_S: f64 = 3600.0;
/// Lag of the dies behind the thermometer, s, gyro and accelerometer, as in the rig files.
const DIE_LAG_S: [f64; 2] = [60.0, 30.0];
/// deg/h and µg.
const UNITS: [f64; 2] = [180.0 / std::f64::consts::PI * 3600.0, 1e6 / 9.80665];

/// Mean and rms of one test: raw, compensated, and by the curves of Table 9 at the temperatures of the test.
struct Outcome {
    name: String,
    raw: [f64; 2],
    compensated: [f64; 2],
    curves: [f64; 2],
}

/// Place of the table in the document.
pub const NAMES: [&str; 1] = ["thermal, compensation"];

/// The tests of both units.
pub fn blocks(_runs: u64) -> Vec<Block> {
    let mut table = Table::new(&[
        "unit, test",
        "Table 9",
        "raw",
        "compensated",
        "printed, raw",
        "printed, compensated",
    ]);
    for (name, rig, printed) in UNITS_TESTED {
        let file = unit(&on_board(&read(&format!("rigs/{rig}.toml"))), 1);
        let recorded = session(&read("plans/niu-ramp.toml"), &file, 1);
        let found = fit(vec![recorded], &[], Options::default()).expect("it is fitted");
        let calibration = found
            .calibration("2026-01-01T00:00:00Z")
            .expect("it has scale factors");
        let image = Image::new(&calibration, name).expect("the device takes it");
        let stored = image.stored().expect("it reads what it stores");
        let tests = (0..6).into_par_iter().map(|k| test(&file, &stored, k));
        let outcomes: Vec<Outcome> = tests.collect();
        let two = |v: [f64; 2]| format!("{:.0}, {:.0}", v[0], v[1]);
        for (o, (_, [rms, mean, rms_before, mean_before])) in outcomes.iter().zip(printed) {
            table.row([
                format!("{name}, {}", o.name),
                two(o.curves),
                two(o.raw),
                format!("{:.1}, {:.0}", o.compensated[0], o.compensated[1]),
                two([*mean_before, *rms_before]),
                two([*mean, *rms]),
            ]);
        }
    }
    vec![Block::table(NAMES[0], &table)]
}

/// Names, rig files and printed results (Tables 10 and 11).
const UNITS_TESTED: [(&str, &str, &[Row<4>; 6]); 2] = [
    ("MTi-G", "niu-mtig", &TABLE_10),
    ("NV-IMU100", "niu-nv", &TABLE_11),
];

/// niu's unit behind parts with outputs in volts, with nominal supply and reference, on a table that turns about any axis.
fn on_board(rig: &str) -> String {
    let matrix =
        |gain: f64| format!("[[{gain:?}, 0.0, 0.0], [0.0, {gain:?}, 0.0], [0.0, 0.0, {gain:?}]]");
    let mut section = "";
    let lines = rig.lines().map(|line| {
        if line.starts_with('[') {
            section = line.split(']').next().unwrap_or_default();
        }
        let sensor = usize::from(section == "[unit.accel_affine");
        match (section, line.split('=').next().unwrap_or_default().trim()) {
            ("[unit", "gyro") => {
                "gyro = \"ADXRS300\"\ngyro_reference_v = [2.5, 2.5, 2.5]\nsupply_error_ppm = 0.0"
                    .into()
            }
            ("[unit", "accel") => "accel = \"MMA7260QT\"".into(),
            ("[unit.gyro_affine" | "[unit.accel_affine", "matrix") => {
                format!("matrix = {}", matrix(GAIN[sensor]))
            }
            ("[unit.gyro_affine" | "[unit.accel_affine", "bias") => {
                format!("bias = {:?}", [NULL_V[sensor]; 3])
            }
            _ => line.to_owned(),
        }
    });
    let lines: Vec<String> = lines.collect();
    format!(
        "{}\n[converter]\nreference_error_ppm = 0.0\n",
        lines.join("\n")
    )
}

/// Gyro x, y, z at 10 deg/s about that axis upright, then accelerometer x, y, z at rest with that axis down, as in the text of 5.1. (Table 8 has it
/// up, which agrees worse with the means of Tables 10 and 11: docs/papers/niu.md.)
fn plan(test: usize) -> String {
    let (rate_dps, along) = if test < 3 { (10.0, 1.0) } else { (0.0, -1.0) };
    let up: [f64; 3] = std::array::from_fn(|i| if i == test % 3 { along } else { 0.0 });
    format!(
        "format = \"mimu-plan/1\"\nsample_rate_hz = {RATE_HZ}.0\ncarrier = \"table\"\nlatitude_deg = 30.5\ngravity_mps2 = 9.793\n\
         chamber_c = [[0.0, -10.0], [{HOUR_S:?}, 70.0]]\n[[step]]\nup = {up:?}\nrate_dps = {rate_dps:?}\ndwell_s = {HOUR_S:?}\n"
    )
}

fn test(file: &RigFile, stored: &Stored, k: usize) -> Outcome {
    let (sensor, axis) = (k / 3, k % 3);
    let mut file = file.clone();
    // niu's table has two axes, on which x and y cannot be upright and turn.
    file.table.axes = 3;
    let truth = RigTruth::resolve(&file, 1).expect("a rig");
    let plan = Plan::parse(Source::new("plan", plan(k))).expect("a plan");
    let compensator = &stored.compensator;
    let mut state = compensator.state(RATE_HZ as f32);
    let mut warm = f64::NAN;
    let mut sums = [[0.0; 3]; 2];
    let mut second = ([0.0; 3], 0);
    let mut seconds = 0.0;
    for (n, row) in samples(&plan, &truth, 100 + k as u64)
        .expect("a run")
        .enumerate()
    {
        let temp_c = row.readings.temp_c;
        if n.is_multiple_of(FOLLOW) {
            let dt_s = FOLLOW as f32 / RATE_HZ as f32;
            let read_c = Some(temp_c as f32).filter(|c| c.is_finite());
            compensator.follow(&mut state, dt_s, read_c);
        }
        warm = if warm.is_nan() {
            temp_c
        } else {
            warm + (temp_c - warm) / DIE_LAG_S[sensor] / RATE_HZ as f64
        };
        if row.instant.step.is_none() {
            continue;
        }
        let volts = |v: [f64; 3]| Vector3::from(v.map(|x| x as f32));
        let raw = Sample {
            gyro: volts(row.readings.gyro),
            accel: volts(row.readings.accel),
        };
        let out = state.models().apply(&raw);
        let motion = &row.instant.motion;
        let (input, read, out) = match sensor {
            0 => (motion.rate[axis], row.readings.gyro[axis], out.gyro[axis]),
            _ => (
                motion.force[axis],
                row.readings.accel[axis],
                out.accel[axis],
            ),
        };
        let nominal = (read - NULL_V[sensor]) / GAIN[sensor];
        for (sum, error) in second.0.iter_mut().zip([
            nominal - input,
            f64::from(out) - input,
            curve(&file, k, warm, input),
        ]) {
            *sum += error * UNITS[sensor];
        }
        second.1 += 1;
        if second.1 == RATE_HZ {
            for (i, sum) in second.0.iter().enumerate() {
                let mean = sum / RATE_HZ as f64;
                sums[0][i] += mean;
                sums[1][i] += mean * mean;
            }
            second = ([0.0; 3], 0);
            seconds += 1.0;
        }
    }
    let of = |i: usize| [sums[0][i] / seconds, f64::sqrt(sums[1][i] / seconds)];
    let name = match Sensor::BOTH[sensor] {
        Sensor::Gyro => format!("gyro {}, deg/h", ["x", "y", "z"][axis]),
        Sensor::Accel => format!("accel {}, µg", ["x", "y", "z"][axis]),
    };
    Outcome {
        name,
        raw: of(0),
        compensated: of(1),
        curves: of(2),
    }
}

/// Error along the axis of a test by bias and scale factor of Table 9, SI.
fn curve(file: &RigFile, test: usize, temp_c: f64, input: f64) -> f64 {
    let cubic = |a: [f64; 4]| a[0] + temp_c * (a[1] + temp_c * (a[2] + temp_c * a[3]));
    let (axis, curves) = (test % 3, &file.curves);
    let (bias, scale) = match test < 3 {
        true => (
            curves.gyro.bias_deg_per_h.expect("given")[axis].map(|a| a / UNITS[0]),
            curves.gyro.scale_ppm,
        ),
        false => (
            curves.accel.bias_mg.expect("given")[axis].map(|a| 1e3 * a / UNITS[1]),
            curves.accel.scale_ppm,
        ),
    };
    cubic(bias) + 1e-6 * cubic(scale.expect("given")[axis]) * input
}
