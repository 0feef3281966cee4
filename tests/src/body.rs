//! Bodies of a gyro, an accelerometer, a second one of each and a magnetometer, by hand: whether the intervals of what is found of the further triads hold the
//! truth, and whether a disturbed field is noticed.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use mimu::fit::{Options, fit};
use mimu::judgement::{Judgement, JudgementKind};
use mimu::prepared::Prepared;
use mimu::signal::stillness::STILL_FACTOR;
use mimu::triad::Estimate;
use mimu_body::{Body, FittedTriad};
use mimu_recording::{Recording, TriadKind, TriadName};
use mimu_rig::body::{Between, IRON_C, Relation};
use mimu_rig::field::{FieldTruth, MagnetTruth};
use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::random::Random;
use mimu_rig::record::samples;
use mimu_rig::rig_file::{AxesFile, RigFile, RigTruth, TriadFile};
use mimu_rig::rotation::{Vector, norm, scale};
use mimu_rig::unit::TemperatureSensor;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use rayon::prelude::*;

use crate::bench;
use crate::by_hand::{self, Grade};

/// What disturbs the field, by its size where the body is put down, µT.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Disturbance {
    /// Nothing.
    None,
    /// Steel a quarter of a metre below.
    Desk(f64),
    /// A phone that is put beside it after 80 s, and stays there.
    Phone(f64),
    /// A phone that is put beside it after 80 s, and taken away after so many more.
    Passing(f64, f64),
}

/// Distance of steel and phone, m.
const AWAY_M: f64 = 0.25;
/// When the phone comes, s.
const PHONE_S: f64 = 80.0;

impl Disturbance {
    fn magnet(self, random: &mut Random) -> Option<MagnetTruth> {
        let (size_ut, from_s, to_s) = match self {
            Self::None => return None,
            Self::Desk(size_ut) => (size_ut, 0.0, f64::INFINITY),
            Self::Phone(size_ut) => (size_ut, PHONE_S, f64::INFINITY),
            Self::Passing(size_ut, stay_s) => (size_ut, PHONE_S, PHONE_S + stay_s),
        };
        let beside = random.attitude().turn([1.0, 0.0, 0.0]);
        let [x, y, z] = match self {
            Self::Desk(_) => [0.3 * beside[0], 0.3 * beside[1], -1.0],
            _ => [beside[0], beside[1], 0.3 * beside[2]],
        };
        let away = norm([x, y, z]) / AWAY_M;
        // A dipole along the line to the body: 0.2 µT m³ / (A m²) over the cube of the distance.
        let moment = size_ut * AWAY_M.powi(3) / 0.2;
        Some(MagnetTruth {
            at_m: [x / away, y / away, z / away],
            moment_am2: scale(moment / (away * AWAY_M), [x, y, z]),
            from_s,
            to_s,
        })
    }
}

/// Low-passes of the sensors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bandwidth {
    /// Those of the parts: 94 and 98 Hz, and 25 Hz of the magnetometer. At 100 samples per second, the noise of neighbouring readings is alike.
    OfParts,
    /// None: the noise is white.
    Unlimited,
}

impl Bandwidth {
    fn set(self, file: &mut RigFile) {
        if self == Self::Unlimited {
            let further = file.triad.iter_mut().map(|triad| &mut triad.axes);
            let first = [&mut file.unit.gyro_axes, &mut file.unit.accel_axes];
            for axes in further.chain(first) {
                axes.bandwidth_hz = Some([f64::INFINITY; 3]);
            }
        }
    }
}

/// A body of an MPU-6050, a second one and an AK8963. The second chip and the magnetometer are turned by a few degrees, or anyhow; they are 5 to 60 mm away,
/// and 0 to 20 ms late.
pub fn body(disturbance: Disturbance, bandwidth: Bandwidth, seed: u64) -> RigFile {
    let mut file = by_hand::unit(&[], Grade::Consumer, seed);
    let mut random = Random::new(seed, "body");
    let random = &mut random;
    let mut chip = |names: &[&str]| {
        let (axis, angle) = random.attitude().axis_angle();
        let rotation_deg = match seed % 2 {
            0 => [0; 3].map(|_| random.within(5.0)),
            _ => scale(angle.to_degrees(), axis),
        };
        let arm = random
            .attitude()
            .turn([5.0 + 55.0 * random.uniform(), 0.0, 0.0]);
        let delay_ms = 20.0 * random.uniform();
        let triads = names.iter().map(|name| TriadFile {
            name: (*name).into(),
            part: None,
            rotation_deg,
            lever_mm: arm,
            delay_ms,
            every: 1,
            between: Between::Empty,
            step_raw: None,
            iron_ut_per_c: [0.0; 3],
            axes: AxesFile::default(),
            affine: None,
        });
        triads.collect::<Vec<_>>()
    };
    file.triad = [chip(&["gyro2", "accel2"]), chip(&["mag"])].concat();
    bandwidth.set(&mut file);
    let mut random = Random::new(seed, "field");
    file.field = Some(FieldTruth {
        size_ut: 50.0,
        // The bench is in the north, where the field points down.
        dip_deg: random.within(75.0).abs(),
        heading_deg: random.within(180.0),
        magnet: disturbance.magnet(&mut random).into_iter().collect(),
    });
    file
}

/// `file` with iron that gains so much field per kelvin, µT, in a direction by the seed, a small board that follows the air in 40 s, and a thermometer
/// on it that errs by its noise only.
pub fn warming(mut file: RigFile, ut_per_c: f64, seed: u64) -> RigFile {
    let way = Random::new(seed, "iron").attitude();
    let mags = file.triad.iter_mut().filter(|triad| triad.name == "mag");
    mags.for_each(|mag| mag.iron_ut_per_c = way.turn([ut_per_c, 0.0, 0.0]));
    file.unit.temperature = Some(TemperatureSensor::Board);
    file.unit.temperature_offset_c = Some(0.0);
    file.thermal.board_lag_s = Some(40.0);
    file
}

/// [`plan`] while the air warms from 20 °C to 32, and by every third seed cools again.
pub fn warming_plan(seed: u64) -> String {
    let air = match seed % 3 {
        0 => "chamber_c = [[0.0, 20.0], [80.0, 32.0], [160.0, 22.0]]\n",
        _ => "chamber_c = [[0.0, 20.0], [120.0, 32.0]]\n",
    };
    plan(seed).replacen("[[step]]", &format!("{air}[[step]]"), 1)
}

/// A session by hand as [`by_hand::plan`]; every other one tumbles for half a minute after its poses.
pub fn plan(seed: u64) -> String {
    let tumble = match seed / 2 % 2 {
        0 => "",
        _ => "[[step]]\ntumble_s = 30.0\ndwell_s = 2.5\n",
    };
    by_hand::plan(seed) + tumble
}

/// A parameter of a triad that was found.
#[derive(Debug, Clone, Copy)]
pub struct Parameter {
    /// What it is, and the unit of the next.
    pub kind: &'static str,
    /// Its error.
    pub error: f64,
    /// Standard deviation and half of the 95 % interval.
    pub claimed: [f64; 2],
}

/// What was found of a further triad.
#[derive(Debug, Clone)]
pub struct Found {
    /// Its name.
    pub name: TriadName,
    /// Its judgement.
    pub judgement: Judgement,
    /// Its parameters; none if it was refused.
    pub parameters: Vec<Parameter>,
    /// What was not given, and why.
    pub open: Vec<String>,
    /// Times that were left out, s.
    pub left_out: Vec<[f64; 2]>,
}

impl Found {
    /// Whether a user takes it for good.
    pub fn is_good(&self) -> bool {
        !self.parameters.is_empty() && self.judgement.kind == JudgementKind::Good
    }
}

/// Mean contributions of slow noise to the readings of the further triads, raw: the biases of this session contain them.
fn wander(plan: &str, file: &RigFile, seed: u64) -> Vec<Vector> {
    let plan = Plan::parse(Source::new("plan", plan)).expect("a plan");
    let mut still = file.clone();
    for triad in &mut still.triad {
        triad.axes.instability_si = Some([0.0; 3]);
        triad.axes.walk_si = Some([0.0; 3]);
    }
    let truths = [file, &still].map(|file| RigTruth::resolve(file, seed).expect("a rig"));
    let [with, without] = truths
        .each_ref()
        .map(|truth| samples(&plan, truth, seed).expect("a run"));
    let mut sums = vec![([0.0; 3], 0.0); file.triad.len()];
    for (a, b) in with.zip(without) {
        for ((sum, count), (a, b)) in sums.iter_mut().zip(a.further.iter().zip(&b.further)) {
            if a[0].is_finite() {
                *count += 1.0;
                *sum = std::array::from_fn(|i| sum[i] + a[i] - b[i]);
            }
        }
    }
    let means = sums.into_iter().map(|(sum, count)| scale(1.0 / count, sum));
    means.collect()
}

/// Errors of a triad against its truth.
fn errors(found: &FittedTriad, truth: &Relation, wander: Vector, dip_deg: f64) -> Vec<Parameter> {
    let mut all = Vec::new();
    let mut add = |kind: &'static str, estimate: &Estimate, truth: f64, per: f64| {
        all.push(Parameter {
            kind,
            error: (estimate.value - truth) * per,
            claimed: [estimate.sigma * per, estimate.interval * per],
        });
    };
    let c = Matrix3::from_fn(|i, j| truth.inverse.matrix[i][j]);
    let mut o = Vector3::from(truth.inverse.offset) - c * Vector3::from(wander);
    let iron = Vector3::from(truth.iron_per_c);
    for (estimate, truth) in found.iron.iter().flat_map(|of| of.per_k).zip(&iron) {
        add("iron, µT/K", &estimate, *truth, 1.0);
    }
    o -= found
        .iron
        .map_or(Vector3::zeros(), |of| iron * (of.temp_c - IRON_C));
    let estimates = found.triad.inverse_estimates();
    for i in 0..3 {
        add(
            "scale factor, %",
            &estimates[3 * i + i],
            c[(i, i)],
            100.0 / c[(i, i)],
        );
        for j in 0..i {
            add(
                "angle, mrad",
                &estimates[3 * i + j],
                c[(i, j)],
                1e3 / c[(i, i)],
            );
        }
        let (kind, per) = match found.name.kind {
            TriadKind::Gyro => ("offset, deg/s", 1f64.to_degrees()),
            TriadKind::Accel => ("offset, mg", 1e3 / 9.80665),
            TriadKind::Mag => ("offset, µT", 1.0),
        };
        add(kind, &estimates[9 + i], o[i], per);
    }
    // An error of the rotation is a small rotation in the frame of the reference.
    let rotation = Vector3::from(truth.rotation_deg.map(f64::to_radians));
    let rotation = UnitQuaternion::from_scaled_axis(rotation);
    let off = (UnitQuaternion::from(found.rotation) * rotation.inverse()).scaled_axis();
    for (i, estimate) in found.rotation_deg.iter().enumerate() {
        add(
            "rotation, deg",
            estimate,
            estimate.value - off[i].to_degrees(),
            1.0,
        );
    }
    if let Ok(delay) = &found.delay_ms {
        add("delay, ms", delay, truth.delay_ms, 1.0);
    }
    for (estimate, truth) in found.lever_arm_mm.iter().flatten().zip(truth.lever_mm) {
        add("lever arm, mm", estimate, truth, 1.0);
    }
    if let Some(Ok(dip)) = &found.dip_deg {
        add("dip, deg", dip, dip_deg, 1.0);
    }
    all
}

/// Records and fits a body in a session.
pub fn case(file: &RigFile, plan: &str, seed: u64) -> Vec<Found> {
    let folder = bench::written(plan, file, seed);
    let recording = Recording::open(&folder.path().join("recording")).expect("a recording");
    let prepared = Prepared::read(&recording, STILL_FACTOR, |_| ()).expect("readable");
    let unit = fit(prepared, Options::IN_SAMPLE).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
    let truth = RigTruth::resolve(file, seed).expect("a rig");
    let options = mimu_body::Options {
        field_ut: Some(truth.field.size_ut),
    };
    let body = Body::of(&recording, &unit, &options)
        .expect("readable")
        .expect("further triads");
    found(body, &truth, &wander(plan, file, seed))
}

/// What was found of the triads of a body, against their truth. Their readings are off by `wander`, raw.
pub(crate) fn found(body: Body, truth: &RigTruth, wander: &[Vector]) -> Vec<Found> {
    let fitted = body.triads.iter().map(|triad| {
        let mut names = truth.further.iter().map(|of| &of.name);
        let k = names.position(|name| *name == triad.name.to_string());
        let k = k.expect("of the body");
        let relation = truth.further[k].relation(&truth.unit).expect("regular");
        let open = [
            triad.delay_ms.as_ref().err(),
            triad.lever_arm_mm.as_ref().err(),
        ];
        Found {
            name: triad.name,
            judgement: triad.judgement.clone(),
            parameters: errors(triad, &relation, wander[k], truth.field.dip_deg),
            open: open.into_iter().flatten().cloned().collect(),
            left_out: triad.left_out.clone(),
        }
    });
    let refused = body.refused.into_iter().map(|(name, judgement)| Found {
        name,
        judgement,
        parameters: Vec::new(),
        open: Vec::new(),
        left_out: Vec::new(),
    });
    fitted.chain(refused).collect()
}

/// The first so many bodies.
pub fn cases(disturbance: Disturbance, bandwidth: Bandwidth, bodies: u64) -> Vec<Vec<Found>> {
    (0..bodies)
        .into_par_iter()
        .map(|seed| case(&body(disturbance, bandwidth, seed), &plan(seed), seed))
        .collect()
}

/// The magnetometers of the first so many bodies in a session that warms, with iron that gains so much field per kelvin, µT.
pub fn warmed(ut_per_c: f64, bandwidth: Bandwidth, bodies: u64) -> Vec<Vec<Found>> {
    let mag = |found: &Found| found.name == TriadName::MAG;
    let one = |seed| {
        let mut file = warming(body(Disturbance::None, bandwidth, seed), ut_per_c, seed);
        file.triad.retain(|triad| triad.name == "mag");
        let found = case(&file, &warming_plan(seed), seed).into_iter();
        found.filter(mag).collect()
    };
    (0..bodies).into_par_iter().map(one).collect()
}

/// Errors of the parameters of one kind.
#[derive(Debug, Clone, Copy, Default)]
pub struct Tally {
    /// Number of parameters, and of those whose 95 % interval holds the truth.
    pub count: u32,
    /// See `count`.
    pub inside: u32,
    squares: f64,
    sigmas: f64,
}

impl Tally {
    fn add(&mut self, parameter: &Parameter) {
        let [sigma, interval] = parameter.claimed;
        self.count += 1;
        self.inside += u32::from(parameter.error.abs() <= interval);
        self.squares += parameter.error.powi(2);
        self.sigmas += (parameter.error / sigma).powi(2);
    }

    /// Share of intervals that hold the truth.
    pub fn share(&self) -> f64 {
        f64::from(self.inside) / f64::from(self.count)
    }

    /// Rms error, in its unit, and in claimed standard deviations.
    pub fn rms(&self) -> [f64; 2] {
        [self.squares, self.sigmas].map(|sum| (sum / f64::from(self.count)).sqrt())
    }
}

/// Errors of bodies by triad and kind of parameter.
pub fn tallies(bodies: &[Vec<Found>]) -> BTreeMap<(TriadName, &'static str), Tally> {
    let mut tallies: BTreeMap<_, Tally> = BTreeMap::new();
    for found in bodies.iter().flatten() {
        for parameter in &found.parameters {
            tallies
                .entry((found.name, parameter.kind))
                .or_default()
                .add(parameter);
        }
    }
    tallies
}

/// These errors, and the judgements, as a table.
pub fn table(bodies: &[Vec<Found>]) -> String {
    let mut text = String::new();
    for ((name, kind), tally) in tallies(bodies) {
        let [rms, sigmas] = tally.rms();
        let _ = writeln!(
            text,
            "{:<8}{kind:<18}{:>6} of them, 95 % intervals hold {:>5.1} %, rms error {rms:.4}, {sigmas:.2} sigma",
            name.to_string(),
            tally.count,
            100.0 * tally.share(),
        );
    }
    let mut judgements: BTreeMap<(TriadName, String), u32> = BTreeMap::new();
    for found in bodies.iter().flatten() {
        let refused = if found.parameters.is_empty() {
            "refused, "
        } else {
            ""
        };
        let said = format!("{refused}{}", found.judgement.kind.name());
        *judgements.entry((found.name, said)).or_default() += 1;
        for open in &found.open {
            let open = format!("open: {open}");
            *judgements.entry((found.name, open)).or_default() += 1;
        }
        if !found.left_out.is_empty() {
            let left_out = format!("with time left out, {}", found.judgement.kind.name());
            *judgements.entry((found.name, left_out)).or_default() += 1;
        }
    }
    for ((name, said), count) in judgements {
        let _ = writeln!(text, "{name}: {count} {said}");
    }
    text
}
