//! Units of one population by hand on the bench: what a prior of the population adds to few poses, and units that are none of it.

use std::fmt::Write as _;
use std::sync::Arc;

use mimu::fit::{Fit, Options, fit};
use mimu::plan::design::Problem;
use mimu::plan::design::budget::DwellNoise;
use mimu::plan::design::population::Population;
use mimu::plan::design::reach::Fixture;
use mimu::prior::Prior;
use mimu::{Angles, Calibration, Sensor};
use mimu_fleet::measured::OfCalibration;
use mimu_fleet::tree::{Measurement, Tree};
use mimu_recording::error::Result;
use mimu_recording::{NORMAL_95, Reference};
use mimu_rig::hands::HandsTruth;
use mimu_rig::located::Source;
use mimu_rig::random::Random;
use mimu_rig::rig_file::{AffineFile, CurvesFile, RigFile};
use rayon::prelude::*;

use crate::bench;
use crate::sessions::Shares;

/// Standard deviations between units: scale factors (relative), misalignments and non-orthogonalities (rad), biases (SI).
const SIZES: [[f64; 4]; 2] = [[0.01, 0.01, 0.005, 0.02], [0.008, 0.0, 0.004, 0.2]];
/// Means: scale factors, raw/SI.
const SCALE: [f64; 2] = [3750.0, 1665.0];

/// A unit with its true parameters: scale factors, misalignments, non-orthogonalities, biases, of gyro and accelerometer, in raw, raw/SI and rad.
pub struct Drawn {
    /// The unit for the bench.
    pub file: RigFile,
    /// Its parameters.
    pub truth: [[f64; 12]; 2],
}

/// What sets a unit apart from the population: a parameter (of gyro or accelerometer, by its number among the twelve), and by how many standard deviations it is off.
pub type Stranger = ([usize; 2], f64);
/// A unit of the population.
pub const OF_IT: Stranger = ([0; 2], 0.0);

/// Unit `seed` of the population. Scale factors of a triad have a correlation of a half.
pub fn unit(seed: u64, stranger: Stranger) -> Drawn {
    let text = include_str!("../../rig/rigs/sessions.toml");
    let mut file = RigFile::parse(&Source::new("sessions.toml", text)).expect("a rig");
    file.curves = CurvesFile::default();
    file.effect.clear();
    // The wander of biases within a recording has no true value.
    for axes in [&mut file.unit.gyro_axes, &mut file.unit.accel_axes] {
        axes.instability_si = Some([0.0; 3]);
        axes.walk_si = Some([0.0; 3]);
    }
    let mut random = Random::new(seed, "unit of a fleet");
    let truth = [0, 1].map(|s| {
        let common = random.normal();
        std::array::from_fn(|k| {
            let z = random.normal();
            let size = SIZES[s][k / 3];
            match k / 3 {
                0 => SCALE[s] * (1.0 + size * 0.5f64.sqrt() * (common + z)),
                3 => SCALE[s] * size * z,
                _ => size * z,
            }
        })
    });
    let mut truth: [[f64; 12]; 2] = truth;
    let ([s, k], off) = stranger;
    let raw = if matches!(k / 3, 0 | 3) {
        SCALE[s]
    } else {
        1.0
    };
    truth[s][k] += off * raw * SIZES[s][k / 3];
    file.unit.gyro_affine = Some(affine(&truth[0]));
    file.unit.accel_affine = Some(affine(&truth[1]));
    Drawn { file, truth }
}

/// `P = K Mo Mp`, `Mp = Rz Ry Rx`, and the bias: docs/estimation, written out here.
fn affine(t: &[f64; 12]) -> AffineFile {
    let [x, y, z] = [t[3], t[4], t[5]];
    let (rx, ry, rz) = (
        [
            [1.0, 0.0, 0.0],
            [0.0, x.cos(), -x.sin()],
            [0.0, x.sin(), x.cos()],
        ],
        [
            [y.cos(), 0.0, y.sin()],
            [0.0, 1.0, 0.0],
            [-y.sin(), 0.0, y.cos()],
        ],
        [
            [z.cos(), -z.sin(), 0.0],
            [z.sin(), z.cos(), 0.0],
            [0.0, 0.0, 1.0],
        ],
    );
    let [yz, zy, zx] = [t[6].sin(), t[7].sin(), t[8].sin()];
    let mo = [
        [1.0, 0.0, 0.0],
        [yz, (1.0 - yz * yz).sqrt(), 0.0],
        [-zy, zx, (1.0 - zy * zy - zx * zx).sqrt()],
    ];
    let product = |a: &[[f64; 3]; 3], b: &[[f64; 3]; 3]| -> [[f64; 3]; 3] {
        std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
    };
    let m = product(&mo, &product(&rz, &product(&ry, &rx)));
    AffineFile {
        matrix: std::array::from_fn(|i| std::array::from_fn(|j| t[i] * m[i][j])),
        bias: [t[9], t[10], t[11]],
    }
}

/// A fit of so many poses of a unit.
///
/// # Errors
/// Those of the fit.
pub fn fitted(drawn: &Drawn, poses: usize, seed: u64, prior: Option<&Arc<Prior>>) -> Result<Fit> {
    fitted_by(drawn, &bench::hand_plan(poses), seed, prior)
}

/// A fit of the poses of a plan.
fn fitted_by(drawn: &Drawn, plan: &str, seed: u64, prior: Option<&Arc<Prior>>) -> Result<Fit> {
    let mut prepared = bench::recorded(plan, &drawn.file, seed);
    if let Some(prior) = prior {
        prepared = prepared.with_prior(Arc::clone(prior))?;
    }
    fit(prepared, Options::IN_SAMPLE)
}

/// The prior of `units` units, each fitted to twenty poses, as its file is read.
pub fn prior(units: u64) -> Arc<Prior> {
    let one = |seed: u64| {
        let made = fitted(&unit(seed, OF_IT), 20, seed, None).ok()?;
        let calibration = Calibration::of(&made, &[], "2026-01-05T12:00:00Z").ok()?;
        Some(Measurement {
            file: format!("u{seed}.toml"),
            unit: format!("u{seed}"),
            labels: Default::default(),
            day: None,
            of: OfCalibration::of(&calibration).expect("comparable"),
            properties: Vec::new(),
        })
    };
    let measurements: Vec<Measurement> = (1..=units).into_par_iter().filter_map(one).collect();
    let tree = Tree {
        measurements,
        ..Tree::default()
    };
    let (_, prior) = mimu_fleet::fleet_and_prior(tree, None).expect("a fleet");
    Arc::new(Prior::parse(&prior.to_toml(), "prior.toml").expect("it reads what it writes"))
}

/// Which intervals of a fit contain the truth, and the half-widths in units of the population's standard deviations.
#[derive(Debug, Clone, Default)]
pub struct Judged {
    /// Shares inside.
    pub shares: Shares,
    /// Names and half-widths.
    pub widths: Vec<(String, f64)>,
}

impl Judged {
    /// Adds the parameters of a fit.
    pub fn add(&mut self, fit: &Fit, truth: &[[f64; 12]; 2]) {
        for (s, sensor) in Sensor::BOTH.into_iter().enumerate() {
            let Some(found) = fit.sensor(sensor) else {
                continue;
            };
            let p = found.estimated.triad.physical(Angles::Exact);
            let all = [p.scale, p.misalignment, p.non_orthogonality, p.bias].concat();
            for (k, estimate) in all.iter().enumerate() {
                let size = SIZES[s][k / 3]
                    * if matches!(k / 3, 0 | 3) {
                        SCALE[s]
                    } else {
                        1.0
                    };
                if size == 0.0 {
                    continue;
                }
                let kind = ["scale", "angle", "angle", "bias"][k / 3];
                let name = format!("{sensor} {kind}");
                let inside = (estimate.value - truth[s][k]).abs() <= estimate.interval;
                self.shares.add(name.clone(), inside);
                self.widths.push((name, estimate.interval / size));
            }
        }
    }

    /// Both together.
    pub fn merge(mut self, other: Self) -> Self {
        self.shares = self.shares.merge(other.shares);
        self.widths.extend(other.widths);
        self
    }

    /// Median half-width of the parameters whose name begins so.
    pub fn width(&self, start: &str) -> f64 {
        let mut all: Vec<f64> = self
            .widths
            .iter()
            .filter(|w| w.0.starts_with(start))
            .map(|w| w.1)
            .collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied().unwrap_or(f64::NAN)
    }

    /// A line of median half-widths, as that of [`Shares::line`].
    pub fn line_of_widths(&self) -> String {
        let names = [
            "gyro scale",
            "gyro angle",
            "gyro bias",
            "accel scale",
            "accel angle",
            "accel bias",
        ];
        names.map(|n| format!(" {:5.3} |", self.width(n))).concat()
    }
}

/// Units `seeds` fitted to so many poses: those that could be fitted, judged; how many could not; and how many gave a prior up.
pub fn study(
    seeds: std::ops::Range<u64>,
    poses: usize,
    prior: Option<&Arc<Prior>>,
    stranger: Stranger,
) -> (Judged, usize, usize) {
    let one = |seed: u64| {
        let drawn = unit(seed, stranger);
        let mut judged = Judged::default();
        match fitted(&drawn, poses, 7_000_000 + seed, prior) {
            Ok(fit) => {
                judged.add(&fit, &drawn.truth);
                let given_up = fit
                    .warnings
                    .iter()
                    .any(|w| w.to_string().contains("not of the population"));
                (judged, 0, usize::from(given_up))
            }
            Err(error) => {
                let given_up = error.to_string().contains("not of the population");
                (judged, 1, usize::from(given_up))
            }
        }
    };
    let nothing = || (Judged::default(), 0, 0);
    let all: Vec<_> = seeds.into_par_iter().map(one).collect();
    all.into_iter()
        .fold(nothing(), |a, b| (a.0.merge(b.0), a.1 + b.1, a.2 + b.2))
}

/// Length of a designed dwell, s.
const DWELL_S: f64 = 3.0;
/// Density of the accelerometers of `rig/rigs/sessions.toml`, m/s²/√Hz.
const WHITE: f64 = 2.6e-3;

/// Half-widths of the accelerometer that a design beside a prior predicts, and those that fits of its poses state: scale factors (relative), angles
/// between the axes (rad), biases (m/s²), three of each.
#[derive(Debug, Clone)]
pub struct Promise {
    /// By the design.
    pub predicted: [f64; 9],
    /// By the prior alone.
    pub alone: [f64; 9],
    /// By the fit of each unit.
    pub stated: Vec<[f64; 9]>,
    /// Units that could not be fitted, or lost the prior of the accelerometer.
    pub without: usize,
}

/// Which parameter of a design, C_xx, C_yx, C_yy, C_zx, C_zy, C_zz, o, is which scale factor, angle and bias: to first order C is the inverse of `K Mo`.
const OF_DESIGN: [usize; 9] = [0, 2, 5, 1, 3, 4, 6, 7, 8];

impl Promise {
    /// The best design of so many poses beside a prior, for a person who errs by `aim_deg` in a pose; recorded by such a person with the units `seeds`, and
    /// fitted with the prior.
    pub fn of(prior: &Arc<Prior>, poses: usize, aim_deg: f64, seeds: std::ops::Range<u64>) -> Self {
        let noise = DwellNoise {
            n: WHITE,
            b: 0.0,
            k: 0.0,
        };
        // The person rests before and after a dwell, and a fit uses this rest too.
        let [shortest, longest] = HandsTruth::default().pause_s;
        let sigma = noise.sigma(DWELL_S + shortest + longest);
        let population = Population::of(prior, "prior.toml").expect("a population");
        let problem = Problem::accel(Reference::Gravity, Fixture::Hand).expect("determined");
        let problem = problem
            .beside(population, sigma, aim_deg.to_radians())
            .expect("by hand");
        let settings = problem.best(poses, 1).expect("a design");
        let halves = |settings| {
            let judged = problem.judge(settings, sigma);
            OF_DESIGN.map(|k| {
                let of = &judged.parameters[k];
                NORMAL_95 * of.sigma * of.parameter.si
            })
        };
        let mut plan =
            String::from("format = \"mimu-plan/1\"\nsample_rate_hz = 100.0\ncarrier = \"hands\"\n");
        for setting in &settings {
            let up: [f64; 3] = setting.up.into();
            let _ = writeln!(plan, "[[step]]\nup = {up:?}\ndwell_s = {DWELL_S:?}");
        }
        let one = |seed: u64| {
            let mut drawn = unit(seed, OF_IT);
            drawn.file.hands.aim_deg = aim_deg;
            let fit = fitted_by(&drawn, &plan, 8_000_000 + seed, Some(prior)).ok()?;
            let kept = fit.estimator(Sensor::Accel).ends_with("and a prior");
            let found = &fit.sensor(Sensor::Accel)?.estimated.triad;
            let p = found.physical(Angles::Exact);
            let all = [p.scale, p.non_orthogonality, p.bias].concat();
            kept.then(|| {
                std::array::from_fn(|k| {
                    let per = if k / 3 == 1 { 1.0 } else { SCALE[1] };
                    all[k].interval / per
                })
            })
        };
        let count = seeds.end - seeds.start;
        let stated: Vec<[f64; 9]> = seeds.into_par_iter().filter_map(one).collect();
        Self {
            predicted: halves(&settings),
            alone: halves(&[]),
            without: count as usize - stated.len(),
            stated,
        }
    }

    /// Median over the units of what the fits state of parameter `k`.
    pub fn median(&self, k: usize) -> f64 {
        let mut all: Vec<f64> = self.stated.iter().map(|s| s[k]).collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied().unwrap_or(f64::NAN)
    }

    /// Median stated half-width over the predicted one, of each parameter.
    pub fn ratios(&self) -> [f64; 9] {
        std::array::from_fn(|k| self.median(k) / self.predicted[k])
    }

    /// Largest of scale factors in ppm, angles in µrad, biases in mg: by the prior alone, predicted, stated.
    pub fn line(&self) -> String {
        let kinds = [(0, 1e6), (3, 1e6), (6, 1e3 / 9.80665)];
        kinds
            .map(|(from, factor)| {
                let most = |of: &dyn Fn(usize) -> f64| {
                    factor * (from..from + 3).map(of).fold(0.0, f64::max)
                };
                let values: [f64; 3] = [
                    most(&|k| self.alone[k]),
                    most(&|k| self.predicted[k]),
                    most(&|k| self.median(k)),
                ];
                let [alone, predicted, stated] = values.map(mimu::quantity::significant);
                format!(" {alone}, {predicted}, {stated} |")
            })
            .concat()
    }
}
