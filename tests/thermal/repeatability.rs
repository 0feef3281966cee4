//! niu's comparison of three ramps with a soak both ways (Tables 2, 4 to 7 and 12, Figs. 6, 8 and 9), on units of the bench with his curves.
//!
//! Every recording is another power-on of the same unit. Once the unit has only the noise of niu's Table 3, once also what his units surely had and
//! he does not give: instability, scatter from power-on to power-on, hysteresis. Their sizes are assumed.

use mimu::quantity::Sensor;
use mimu_rig::random::Random;
use mimu_rig::rig_file::RigFile;
use mimu_tests::niu::{Row, TABLE_4, TABLE_6};
use mimu_tests::page::{Block, Table, significant};
use nalgebra::SVector;
use rayon::prelude::*;

use crate::classic::{Classic, estimate};
use crate::on_bench::{read, session, unit};

/// Place of the table in the document.
pub const NAMES: [&str; 1] = ["thermal, repeatability"];

/// Temperatures of Tables 4 and 6, °C.
const TEMPS_C: [f64; 5] = [-10.0, 10.0, 30.0, 50.0, 70.0];
const DEG_PER_H: f64 = std::f64::consts::PI / 180.0 / 3600.0;
const MG: f64 = 9.80665e-3;

/// Table 2's soak, eleven set points of an hour each, heating and cooling; and niu's scheme of 152 s while the chamber follows one of his three profiles at
/// 2 K/min.
const PLANS: [&str; 4] = [
    include_str!("plans/soak.toml"),
    include_str!("plans/profile-1.toml"),
    include_str!("plans/profile-2.toml"),
    include_str!("plans/profile-3.toml"),
];

/// Assumed sizes of what is not in niu's tables, of gyro (deg/h) and accelerometer (mg).
struct Unstable {
    instability: [f64; 2],
    power_on: [f64; 2],
    /// Half the height of the loop; it is 10 K wide.
    hysteresis: [f64; 2],
}

/// Name, rig file, printed table, and assumed sizes: of the MTi-G those of silicon gyros of its time, of the NV-IMU100 those of vibrating
/// rings whose biases stay within 15 deg/h, and of an accelerometer with the noise of Table 3.
const UNITS: [(&str, &str, &[Row<6>; 24], Unstable); 2] = [
    (
        "MTi-G",
        "niu-mtig",
        &TABLE_4,
        Unstable {
            instability: [40.0, 0.05],
            power_on: [150.0, 0.5],
            hysteresis: [100.0, 0.3],
        },
    ),
    (
        "NV-IMU100",
        "niu-nv",
        &TABLE_6,
        Unstable {
            instability: [1.0, 0.1],
            power_on: [2.0, 2.0],
            hysteresis: [1.0, 0.5],
        },
    ),
];

/// Parameters of one kind.
struct Kind {
    name: &'static str,
    sensor: usize,
    /// Among the twelve numbers of a triad.
    numbers: &'static [usize],
    /// Rows of niu's tables, from and to.
    rows: [usize; 2],
    /// Unit of the tables in SI.
    si: f64,
}

impl Kind {
    const fn new(
        name: &'static str,
        sensor: usize,
        numbers: &'static [usize],
        rows: [usize; 2],
        si: f64,
    ) -> Self {
        Self {
            name,
            sensor,
            numbers,
            rows,
            si,
        }
    }
}

const KINDS: [Kind; 6] = {
    let (bias, scale, cross) = (&[9, 10, 11], &[0, 4, 8], &[1, 2, 3, 5, 6, 7]);
    [
        Kind::new("gyro bias, deg/h", 0, bias, [0, 3], DEG_PER_H),
        Kind::new("gyro scale factor, ppm", 0, scale, [3, 6], 1e-6),
        Kind::new("gyro non-orthogonality, ppm", 0, cross, [6, 12], 1e-6),
        Kind::new("accel bias, µg", 1, bias, [12, 15], MG / 1000.0),
        Kind::new("accel scale factor, ppm", 1, scale, [15, 18], 1e-6),
        Kind::new("accel non-orthogonality, ppm", 1, cross, [18, 24], 1e-6),
    ]
};

/// Numbers of gyro and accelerometer relative to the nominal gain, at each of the temperatures.
type Curves = [[SVector<f64, 12>; TEMPS_C.len()]; 2];

/// The table. A unit has one soak and one ramp of each profile, as niu's had, so `runs` is not used.
pub fn blocks(_: u64) -> Vec<Block> {
    let mut table = Table::new(&[
        "worst of axes and temperatures",
        "ramps about the soak, printed",
        "with Table 3's noise",
        "with instability, scatter and hysteresis",
        "noise alone: soak about the truth",
        "ramps about the truth",
    ]);
    for (name, rig, printed, unstable) in &UNITS {
        let mut file = unit(&read(&format!("rigs/{rig}.toml")), 1);
        // The plans are for three axes; the table's errors stay.
        file.table.axes = 3;
        file.table.middle_min_deg = -180.0;
        file.table.middle_max_deg = 180.0;
        let truth = truth(&file);
        let [quiet, real] = [None, Some(unstable)].map(|unstable| recorded(&file, unstable));
        for Kind {
            name: kind,
            sensor,
            numbers,
            rows: [from, to],
            si,
        } in KINDS
        {
            let worst = |estimates: &[Curves], reference: &Curves| {
                let each = numbers
                    .iter()
                    .flat_map(|k| (0..TEMPS_C.len()).map(move |t| (*k, t)));
                let rms = each.map(|(k, t)| {
                    let error = |c: &Curves| (c[sensor][t][k] - reference[sensor][t][k]) / si;
                    let squares = estimates.iter().map(|c| error(c).powi(2)).sum::<f64>();
                    (squares / estimates.len() as f64).sqrt()
                });
                significant(rms.fold(0.0, f64::max))
            };
            let largest = printed[from..to].iter().flat_map(|r| &r.1[..5]);
            table.row([
                format!("{name}, {kind}"),
                significant(largest.copied().fold(0.0, f64::max)),
                worst(&quiet.1, &quiet.0),
                worst(&real.1, &real.0),
                worst(&[quiet.0], &truth),
                worst(&quiet.1, &truth),
            ]);
        }
    }
    vec![Block::table(NAMES[0], &table)]
}

/// Estimates of the soak, each plateau fitted, and of the three ramps, by niu's own computation.
fn recorded(file: &RigFile, unstable: Option<&Unstable>) -> (Curves, Vec<Curves>) {
    let each = PLANS.into_par_iter().enumerate().map(|(k, text)| {
        let classic = match k {
            0 => Classic::Soak,
            _ => Classic::RampNiu,
        };
        // niu takes the Earth's rate out, by (a.7) and (a.8).
        let key = "\nsample_rate_hz";
        let text = text.replacen(key, &format!("\nlatitude_deg = 30.5{key}"), 1);
        assert!(text.contains("latitude_deg"), "{text:.300}");
        let powered = unstable.map_or_else(|| file.clone(), |u| power_on(file, u, k as u64));
        let recorded = session(&text, &powered, 10 + k as u64);
        let found = estimate(&[recorded], classic).expect("it is fitted");
        curves(file, |sensor, temp_c| {
            let curves = found.curves[Sensor::BOTH[sensor]]
                .as_ref()
                .expect("recorded");
            let [model, _] = curves.forward(temp_c);
            mimu::triad::vector(&model.matrix, &model.bias)
        })
    });
    let mut each: Vec<Curves> = each.collect();
    (each.remove(0), each)
}

/// The unit with `unstable` at its power-on number `k`.
fn power_on(file: &RigFile, unstable: &Unstable, k: u64) -> RigFile {
    let mut file = file.clone();
    let mut random = Random::new(k, "power-on");
    let mut draw = |sigma: f64| Some(std::array::from_fn(|_| sigma * random.normal()));
    let [g, a] = unstable.instability;
    file.unit.gyro_axes.instability_si = Some([g * DEG_PER_H; 3]);
    file.unit.accel_axes.instability_si = Some([a * MG; 3]);
    file.curves.gyro.power_on_deg_per_h = draw(unstable.power_on[0]);
    file.curves.accel.power_on_mg = draw(unstable.power_on[1]);
    file.curves.gyro.hysteresis_deg_per_h = Some([unstable.hysteresis[0]; 3]);
    file.curves.accel.hysteresis_mg = Some([unstable.hysteresis[1]; 3]);
    file
}

/// The truth, from the rig file's cubics.
fn truth(file: &RigFile) -> Curves {
    curves(file, |sensor, t| {
        let (bias, si, scale, cross) = match sensor {
            0 => {
                let c = &file.curves.gyro;
                (c.bias_deg_per_h, DEG_PER_H, c.scale_ppm, c.misalignment_ppm)
            }
            _ => {
                let c = &file.curves.accel;
                (c.bias_mg, MG, c.scale_ppm, c.misalignment_ppm)
            }
        };
        let [bias, scale] = [bias, scale].map(|c| c.expect("in the rig file"));
        let cross = cross.expect("in the rig file");
        let at = |a: &[f64; 4]| a[0] + t * (a[1] + t * (a[2] + t * a[3]));
        let gain = gain(file, sensor);
        SVector::from_fn(|k, _| match k {
            0 | 4 | 8 => gain * (1.0 + 1e-6 * at(&scale[k / 3])),
            9.. => gain * si * at(&bias[k - 9]),
            _ => gain * 1e-6 * at(&cross[k - 1 - k / 4]),
        })
    })
}

/// Nominal gain of a sensor, raw per SI.
fn gain(file: &RigFile, sensor: usize) -> f64 {
    let affine = [&file.unit.gyro_affine, &file.unit.accel_affine][sensor];
    affine.as_ref().expect("in the rig file").matrix[0][0]
}

/// `model` of each sensor at each temperature, relative to the gain and without the nominal matrix and bias.
fn curves(file: &RigFile, model: impl Fn(usize, f64) -> SVector<f64, 12>) -> Curves {
    [0, 1].map(|sensor| TEMPS_C.map(|t| model(sensor, t) / gain(file, sensor)))
}
