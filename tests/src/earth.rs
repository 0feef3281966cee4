//! The Earth's rate in the bias of a gyro on a table: whether intervals contain the truth, at random latitudes and headings.

use std::fmt::Write as _;

use mimu::fit::{Fit, Options, fit};
use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use mimu::signal::stillness::STILL_FACTOR;
use mimu::triad::Triad;
use mimu_recording::Recording;
use mimu_rig::random::Random;
use mimu_rig::rig_file::{AffineFile, RigFile};
use mimu_thermal::fit::ThermalFit;
use mimu_thermal::session::Session;
use nalgebra::Vector3;
use rayon::prelude::*;

use crate::bench;

/// Scale factor of the gyros, V per rad/s.
const VOLTS: f64 = 5e-3 * 180.0 / std::f64::consts::PI;
/// Degrees per hour in rad/s.
pub const DEG_PER_H: f64 = std::f64::consts::PI / 180.0 / 3600.0;

/// An experiment whose bias the Earth's rate would falsify.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Experiment {
    /// Six faces, corners and rates about each axis on a table, by a good MEMS gyro.
    Table,
    /// Six faces and six turns of exactly 360 degrees, by a fibre gyro.
    Fibre,
    /// niu's scheme while the temperature rises and falls, all curves together.
    Ramp,
}

impl Experiment {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Table, Self::Fibre, Self::Ramp];

    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Table => "table",
            Self::Fibre => "fibre gyro, six exact turns",
            Self::Ramp => "ramp",
        }
    }

    /// White noise of the gyro, deg/√h.
    fn white(self) -> f64 {
        match self {
            Self::Table => 0.3,
            Self::Fibre => 0.01,
            Self::Ramp => 0.15,
        }
    }

    /// Largest bias, deg/h.
    fn bias(self) -> f64 {
        match self {
            Self::Table => 100.0,
            Self::Fibre => 0.5,
            Self::Ramp => 20.0,
        }
    }
}

/// Errors of the three biases, rad/s, in one or several estimates, with their standard deviations and whether they are within the intervals.
#[derive(Debug, Clone, Default)]
pub struct Errors {
    /// Error, standard deviation, half of the interval.
    pub all: Vec<[f64; 3]>,
    /// Rms of the residuals over the noise.
    pub over_noise: f64,
    /// Verdict of a thermal fit; empty otherwise.
    pub verdict: String,
    /// What the fit warns of.
    pub warnings: Vec<String>,
}

/// The unit of `experiment` with this seed: its rig file, and the true biases, V.
pub fn unit(experiment: Experiment, random: &mut Random) -> (RigFile, Vector3<f64>) {
    let mut matrix = [[0.0; 3]; 3];
    for (i, row) in matrix.iter_mut().enumerate() {
        for (k, element) in row.iter_mut().enumerate() {
            *element = VOLTS * (f64::from(u8::from(i == k)) + random.within(0.01));
        }
    }
    let mut bias = || 2.5 + VOLTS * DEG_PER_H * random.within(experiment.bias());
    let bias = [bias(), bias(), bias()];
    let gyro = AffineFile { matrix, bias };
    let mut file = bench::clean(gyro, bench::accel(random));
    let axes = &mut file.unit.gyro_axes;
    axes.white_si = Some([experiment.white().to_radians() / 60.0; 3]);
    axes.instability_si = Some([0.0; 3]);
    axes.walk_si = Some([0.0; 3]);
    // A step of 16 bits is 60 deg/h.
    file.converter.bits = Some(24);
    // z down is the middle axis at 180 degrees, and niu's table tilts by 95 degrees either way.
    file.table.middle_min_deg = 0.0;
    file.table.middle_max_deg = 275.0;
    // Ramps of two seconds: at 50 Hz a ramp of a tenth of a second ends within a sample, and 20 deg/s times that sample is 0.3 degrees.
    file.table.max_acceleration_dps2 = [10.0; 3];
    (file, bias.into())
}

/// The plan of `experiment` at a latitude, degrees, with the table turned by a random heading.
pub fn plan(experiment: Experiment, latitude_deg: f64, random: &mut Random) -> String {
    let heading = random.within(180.0);
    let mut plan = format!(
        "format = \"mimu-plan/1\"\nsample_rate_hz = 50\ncarrier = \"table\"\nlatitude_deg = {latitude_deg}\n"
    );
    let faces = [0, 1, 2].into_iter().flat_map(|axis| {
        [1.0, -1.0]
            .map(|sign| -> [f64; 3] { std::array::from_fn(|k| if k == axis { sign } else { 0.0 }) })
    });
    match experiment {
        Experiment::Table => {
            for up in faces {
                let _ = writeln!(
                    plan,
                    "[[step]]\nup = {up:?}\nheading_deg = {heading}\ndwell_s = 10.0"
                );
                for rate in [-60.0, 60.0] {
                    let _ = writeln!(
                        plan,
                        "[[step]]\nup = {up:?}\nheading_deg = {heading}\nrate_dps = {rate:?}\ndwell_s = 10.0"
                    );
                }
            }
        }
        Experiment::Fibre => {
            for up in faces {
                let sign: f64 = up.iter().sum();
                let _ = writeln!(
                    plan,
                    "[[step]]\nup = {up:?}\nheading_deg = {heading}\ndwell_s = 60.0\n\
                     [[step]]\nturn_axis = \"outer\"\nturn_deg = {:?}\nturn_dps = 20.0",
                    360.0 * sign
                );
            }
        }
        Experiment::Ramp => {
            let _ = writeln!(
                plan,
                "chamber_c = [[0.0, 10.0], [200.0, 10.0], [1700.0, 50.0], [3200.0, 10.0]]\nlead_in_s = 5.0\nrounds = 20"
            );
            let rest = "[[step]]\nstay = true\ndwell_s = 9.0";
            let _ = writeln!(
                plan,
                "[[step]]\nup = [0.0, 0.0, -1.0]\nheading_deg = {heading}\ndwell_s = 9.0"
            );
            let turns = [
                ("middle", 90.0),
                ("inner", 90.0),
                ("middle", -90.0),
                ("inner", -90.0),
                ("middle", -90.0),
                ("inner", 90.0),
                ("middle", 90.0),
                ("inner", -90.0),
            ];
            for (k, (axis, angle)) in turns.into_iter().enumerate() {
                let _ = writeln!(
                    plan,
                    "[[step]]\nturn_axis = \"{axis}\"\nturn_deg = {angle:?}\nturn_dps = 10.0"
                );
                if k + 1 < turns.len() {
                    let _ = writeln!(plan, "{rest}");
                }
            }
        }
    }
    plan
}

/// One run: the errors of the biases of `experiment` with this seed, with or without the latitude in the manifest.
pub fn run(experiment: Experiment, latitude_known: bool, seed: u64) -> Errors {
    let mut random = Random::new(seed, "the Earth's rate");
    let (file, bias) = unit(experiment, &mut random);
    // Even over the sphere, up to 75 degrees.
    let latitude_deg = random.within(0.966).asin().to_degrees();
    let plan = plan(experiment, latitude_deg, &mut random);
    let folder = bench::written(&plan, &file, seed);
    let mut recording = Recording::open(&folder.path().join("recording")).expect("a recording");
    if !latitude_known {
        recording.manifest.latitude_deg = None;
    }
    let prepared = Prepared::read(&recording, STILL_FACTOR, |_| ()).expect("readable");
    match experiment {
        Experiment::Table | Experiment::Fibre => of_fit(&fitted(prepared), &bias),
        Experiment::Ramp => of_ramp(&ramp(&prepared), &bias),
    }
}

fn fitted(prepared: Prepared) -> Fit {
    let options = Options {
        only: Some(Sensor::Gyro),
        ..Options::IN_SAMPLE
    };
    fit(prepared, options).expect("a fit")
}

fn of_fit(fit: &Fit, bias: &Vector3<f64>) -> Errors {
    let gyro = fit.sensor(Sensor::Gyro).expect("a gyro");
    let triad = &gyro.estimated.triad;
    Errors {
        all: errors(triad, bias),
        over_noise: gyro.rms() / gyro.noise_floor(),
        verdict: String::new(),
        warnings: gyro.warnings.iter().map(|w| format!("{w:?}")).collect(),
    }
}

/// Errors of the biases, rad/s.
fn errors(triad: &Triad, bias: &Vector3<f64>) -> Vec<[f64; 3]> {
    let estimates = triad.forward_estimates();
    let error = |axis: usize| {
        let of = &estimates[9 + axis];
        [of.value - bias[axis], of.sigma, of.interval].map(|v| v / VOLTS)
    };
    (0..3).map(error).collect()
}

fn ramp(prepared: &Prepared) -> ThermalFit {
    let session = Session::of(prepared).expect("a session");
    let options = mimu_thermal::fit::Options {
        lag_s: Some(0.0),
        range_c: None,
    };
    mimu_thermal::fit::fit(vec![session], &[], options).expect("curves")
}

fn of_ramp(fit: &ThermalFit, bias: &Vector3<f64>) -> Errors {
    let curves = fit.joint.curves[Sensor::Gyro].as_ref().expect("curves");
    let mut all = Vec::new();
    for temp_c in [15.0, 25.0, 35.0, 45.0] {
        let triad = curves.triad(temp_c).expect("determined");
        all.extend(errors(&triad, bias));
    }
    let judged = fit.judged[Sensor::Gyro].as_ref().expect("judged");
    let [own, floor] = mimu_thermal::judge::rms(&judged.errors);
    Errors {
        all,
        over_noise: own / floor,
        verdict: fit.verdict.name().into(),
        warnings: fit.warnings.iter().map(|w| format!("{w:?}")).collect(),
    }
}

/// Figures of many runs.
#[derive(Debug, Clone, Default)]
pub struct Summary {
    /// Runs.
    pub runs: usize,
    /// Rms of the bias errors, rad/s.
    pub rms: f64,
    /// Mean square of the errors over their standard deviations.
    pub mean_square: f64,
    /// Share of the intervals that contain the truth.
    pub coverage: f64,
    /// Largest rms of the residuals over the noise.
    pub over_noise: f64,
    /// Runs that warn of the Earth's rate.
    pub warned: usize,
    /// Runs with the verdict `misfit`.
    pub misfits: usize,
}

/// `runs` runs of `experiment`.
pub fn study(experiment: Experiment, latitude_known: bool, runs: u64) -> Summary {
    let each: Vec<Errors> = (1..=runs)
        .into_par_iter()
        .map(|seed| run(experiment, latitude_known, seed))
        .collect();
    let errors: Vec<[f64; 3]> = each.iter().flat_map(|e| e.all.iter().copied()).collect();
    let n = errors.len() as f64;
    let warns = |e: &&Errors| {
        let named = |w: &String| w.contains("NoLatitude") || w.contains("HeadingLost");
        e.warnings.iter().any(named)
    };
    Summary {
        runs: each.len(),
        rms: (errors.iter().map(|e| e[0] * e[0]).sum::<f64>() / n).sqrt(),
        mean_square: errors.iter().map(|e| (e[0] / e[1]).powi(2)).sum::<f64>() / n,
        coverage: errors.iter().filter(|e| e[0].abs() <= e[2]).count() as f64 / n,
        over_noise: each.iter().map(|e| e.over_noise).fold(0.0, f64::max),
        warned: each.iter().filter(warns).count(),
        misfits: each.iter().filter(|e| e.verdict == "misfit").count(),
    }
}
