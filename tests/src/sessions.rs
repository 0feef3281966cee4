//! Several sessions of one unit: whether they predict one that was left out, on the bench and with the array of H. Carlsson.

use std::fmt::Write as _;
use std::fs;

use mimu::fit::{Fit, Options, fit};
use mimu::parameter::TriadParameter;
use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use mimu::sessions::Sessions;
use mimu::sessions::between::{Design, Estimates, Kinds, VariancePrior, fit as fit_between};
use mimu::sessions::class::PartClass;
use mimu::signal::stillness::STILL_FACTOR;
use mimu_recording::{RawUnit, Recording};
use mimu_rig::history::{ChangeSizes, History};
use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::random::Random;
use mimu_rig::record::{Row, samples};
use mimu_rig::rig_file::{AffineFile, CurvesFile, RigFile, RigTruth};
use mimu_rig::rotation::norm;
use mimu_rig::table::TableTruth;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use tempfile::TempDir;

use crate::bench;
use crate::recordings::{Foreign, data_set};

/// What happens to units between sessions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Life {
    /// Every power-on changes all parameters.
    PowerOn,
    /// Also, all parameters age slowly: in eight sessions by twice what a power-on changes.
    Ageing,
    /// Also, the unit was dropped before the third session: ten times what a power-on changes.
    Dropped,
    /// Also, a temperature that nobody records moves the biases by five times as much.
    Temperature,
    /// Nothing changes.
    Constant,
}

impl Life {
    /// All.
    pub const ALL: [Self; 5] = [
        Self::PowerOn,
        Self::Ageing,
        Self::Dropped,
        Self::Temperature,
        Self::Constant,
    ];

    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Self::PowerOn => "power-on",
            Self::Ageing => "power-on and ageing",
            Self::Dropped => "power-on, dropped before the third",
            Self::Temperature => "power-on and temperature",
            Self::Constant => "nothing changes",
        }
    }

    fn history(self, unit: u64, session: u32) -> History {
        // About what the array of MPU-9150 shows.
        let power_on = ChangeSizes {
            gyro_scale_ppm: 800.0,
            gyro_angle_mrad: 0.8,
            gyro_bias_dps: 0.15,
            accel_scale_ppm: 300.0,
            accel_angle_mrad: 0.3,
            accel_bias_mg: 3.0,
        };
        let times = |by: f64| ChangeSizes {
            gyro_scale_ppm: by * power_on.gyro_scale_ppm,
            gyro_angle_mrad: by * power_on.gyro_angle_mrad,
            gyro_bias_dps: by * power_on.gyro_bias_dps,
            accel_scale_ppm: by * power_on.accel_scale_ppm,
            accel_angle_mrad: by * power_on.accel_angle_mrad,
            accel_bias_mg: by * power_on.accel_bias_mg,
        };
        let none = History {
            session,
            unit_seed: unit,
            ..History::default()
        };
        let on = History { power_on, ..none };
        match self {
            Self::PowerOn => on,
            Self::Ageing => History {
                ageing: times(0.25),
                ..on
            },
            Self::Dropped => History {
                shock: times(10.0),
                shock_before: 2,
                ..on
            },
            Self::Temperature => History {
                common: ChangeSizes {
                    gyro_bias_dps: 5.0 * power_on.gyro_bias_dps,
                    accel_bias_mg: 5.0 * power_on.accel_bias_mg,
                    ..ChangeSizes::default()
                },
                ..on
            },
            Self::Constant => none,
        }
    }
}

/// A consumer unit of its own.
pub(crate) fn unit(seed: u64) -> RigFile {
    let text = include_str!("../../rig/rigs/sessions.toml");
    let mut file = RigFile::parse(&Source::new("sessions.toml", text)).expect("a rig");
    file.curves = CurvesFile::default();
    file.effect.clear();
    let mut random = Random::new(seed, "unit of sessions");
    let mut triad = |scale: f64, across: f64, bias: f64, own: bool| AffineFile {
        matrix: std::array::from_fn(|i| {
            std::array::from_fn(|j| match (i == j, own && j > i) {
                (true, _) => scale * (1.0 + random.within(0.02)),
                (false, true) => 0.0,
                (false, false) => scale * random.within(across),
            })
        }),
        bias: std::array::from_fn(|_| random.within(bias)),
    };
    file.unit.gyro_affine = Some(triad(3750.0, 0.02, 100.0, false));
    file.unit.accel_affine = Some(triad(1665.0, 0.015, 200.0, true));
    file
}

/// A session of the unit `seed`, and the seed of its noise.
pub fn session(seed: u64, life: Life, session: u32) -> (RigFile, u64) {
    let mut file = unit(seed);
    file.history = life.history(seed, session);
    (file, 1000 * seed + u64::from(session))
}

/// Sessions of 24 poses by hand of the unit `seed`, in order of time.
pub fn on_bench(seed: u64, life: Life, sessions: u32) -> Vec<Fit> {
    let plan = bench::hand_plan(24);
    let of = |number: u32| {
        let (file, noise) = session(seed, life, number);
        let prepared = bench::recorded(&plan, &file, noise);
        fit(prepared, Options::IN_SAMPLE).expect("it can be fitted")
    };
    (0..sessions).map(of).collect()
}

/// The recordings of such sessions, each in the folder `recording` of a temporary folder.
pub fn recorded(seed: u64, life: Life, sessions: u32) -> Vec<tempfile::TempDir> {
    let plan = bench::hand_plan(24);
    let of = |number: u32| {
        let (file, noise) = session(seed, life, number);
        bench::written(&plan, &file, noise)
    };
    (0..sessions).map(of).collect()
}

/// What moves a unit whose readings have no stamps, so that nothing shows a lost sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Carrier {
    /// A table: twelve turns of 180 deg and the rests between them, gyro only.
    Table,
    /// A person: 24 poses.
    Hands,
}

impl Carrier {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Table, Self::Hands];

    /// The plan, and on a table the input of each step.
    fn plan(self) -> (String, Option<String>) {
        if self == Self::Hands {
            return (bench::hand_plan(24), None);
        }
        let mut plan =
            String::from("format = \"mimu-plan/1\"\nsample_rate_hz = 50.0\ncarrier = \"table\"\n");
        let mut inputs = String::from(
            "step,turn_x_deg,turn_y_deg,turn_z_deg,ref_rate_x_dps,ref_rate_y_dps,ref_rate_z_dps\n",
        );
        // In another order than that of the axes: a drift is no scale factor.
        for k in 0..12 {
            let up: [f64; 3] = std::array::from_fn(|i| match i == k % 3 {
                true => [1.0, -1.0][k % 2],
                false => 0.0,
            });
            let angle_deg = [180.0, -180.0][k / 6];
            let turn = up.map(|u| (u * angle_deg).to_string()).join(",");
            let _ = writeln!(
                plan,
                "[[step]]\nup = {up:?}\ndwell_s = 2.0\n[[step]]\nturn_axis = \"outer\"\nturn_deg = {angle_deg:?}\nturn_dps = 90.0"
            );
            let _ = writeln!(inputs, "{},,,,0,0,0\n{},{turn},,,", 2 * k, 2 * k + 1);
        }
        (plan, Some(inputs))
    }

    fn turns(self, row: &Row) -> bool {
        match self {
            Self::Table => row.instant.step.is_some_and(|k| k % 2 == 1),
            Self::Hands => row.instant.step.is_none(),
        }
    }
}

/// Session `number` of the unit `seed`, imported without stamps. In each of `turns` turns, evenly among all, `lost` samples are missing where the turn is fastest.
pub fn losing(
    carrier: Carrier,
    (seed, life, number): (u64, Life, u32),
    [turns, lost]: [usize; 2],
) -> Fit {
    let (mut file, noise) = session(seed, life, number);
    file.table = TableTruth::ideal();
    file.earth_rate = Some(false);
    let (plan, inputs) = carrier.plan();
    let plan = Plan::parse(Source::new("plan", &plan)).expect("a plan");
    let truth = RigTruth::resolve(&file, noise).expect("a rig");
    let rows: Vec<Row> = samples(&plan, &truth, noise).expect("a run").collect();
    let turning = rows.chunk_by(|a, b| carrier.turns(a) == carrier.turns(b));
    let mut at = 0;
    let mut fastest = Vec::new();
    for part in turning {
        let rate = |k: &usize| norm(part[*k].instant.motion.rate);
        let most = (0..part.len()).max_by(|a, b| rate(a).total_cmp(&rate(b)));
        fastest.extend(most.filter(|_| carrier.turns(&part[0])).map(|k| at + k));
        at += part.len();
    }
    let mut missing = vec![false; rows.len()];
    for k in 0..turns {
        let from = fastest[k * fastest.len() / turns];
        missing[from..from + lost].fill(true);
    }
    let mut log = String::from("step,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z\n");
    for (row, _) in rows.iter().zip(&missing).filter(|(_, missing)| !**missing) {
        let step = row.instant.step.map_or(-1, i64::from);
        let [gyro, accel] = [row.readings.gyro, row.readings.accel];
        let all = [gyro, accel].concat();
        let all: Vec<String> = all.iter().map(f64::to_string).collect();
        let _ = writeln!(log, "{step},{}", all.join(","));
    }
    let temporary = TempDir::new().expect("a folder");
    let path = temporary.path().join("log.csv");
    fs::write(&path, log).expect("writable");
    let foreign = Foreign {
        files: vec![(
            path,
            match carrier {
                Carrier::Table => "step,gyro_x,gyro_y,gyro_z,-,-,-",
                Carrier::Hands => "-,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z",
            },
        )],
        rate_hz: Some(plan.sample_rate_hz),
        gravity_mps2: plan.place.gravity,
        raw_unit: RawUnit::Count,
        scales: &[],
        inputs: inputs.as_deref(),
    };
    let recording = foreign.import(&temporary).expect("it can be imported");
    let mut prepared = Prepared::read(&recording, STILL_FACTOR, |_| {}).expect("it has dwells");
    prepared.place = format!("session {number} of unit {seed}");
    fit(prepared, Options::default()).expect("it can be fitted")
}

/// Shares of inside by sensor and kind of parameter.
#[derive(Debug, Clone, Default)]
pub struct Shares {
    /// Name, inside, and of how many.
    pub all: Vec<(String, [u32; 2])>,
}

impl Shares {
    /// Counts one value.
    pub fn add(&mut self, name: String, inside: bool) {
        let at = self.all.iter().position(|a| a.0 == name);
        let at = at.unwrap_or_else(|| {
            self.all.push((name, [0, 0]));
            self.all.len() - 1
        });
        self.all[at].1[0] += u32::from(inside);
        self.all[at].1[1] += 1;
    }

    /// Adds another's counts.
    pub fn merge(mut self, other: Self) -> Self {
        for (name, [inside, count]) in other.all {
            let at = self.all.iter().position(|a| a.0 == name);
            match at {
                Some(at) => {
                    self.all[at].1[0] += inside;
                    self.all[at].1[1] += count;
                }
                None => self.all.push((name, [inside, count])),
            }
        }
        self
    }

    /// Inside and count of the names that begin with `start`.
    pub fn of(&self, start: &str) -> [u32; 2] {
        let found = self.all.iter().filter(|a| a.0.starts_with(start));
        found.fold([0, 0], |[a, b], one| [a + one.1[0], b + one.1[1]])
    }

    /// A line of percentages: by sensor, scale factors, angles, biases.
    pub fn line(&self) -> String {
        let mut out = String::new();
        for sensor in ["gyro", "accel"] {
            for kind in ["scale", "angle", "bias"] {
                let [inside, count] = self.of(&format!("{sensor} {kind}"));
                let share = 100.0 * f64::from(inside) / f64::from(count.max(1));
                out += &format!(" {share:5.1} |");
            }
        }
        out
    }
}

/// `gyro angle misalignment_x`.
fn name(sensor: Sensor, number: usize) -> String {
    let kind = ["scale", "angle", "angle", "bias"][number / 3];
    format!("{sensor} {kind} {}", TriadParameter::physical()[number])
}

/// How often the interval of a session contains the estimate of another session: before sessions were combined.
pub fn by_single(fits: &[Fit]) -> Shares {
    let mut shares = Shares::default();
    for (a, b) in (0..fits.len()).flat_map(|a| (0..fits.len()).map(move |b| (a, b))) {
        if a == b {
            continue;
        }
        for sensor in Sensor::BOTH {
            let Some((of, other)) = fits[a].sensor(sensor).zip(fits[b].sensor(sensor)) else {
                continue;
            };
            let all = |fit: &mimu::fit::SensorFit| {
                let p = fit.estimated.triad.physical(mimu::Angles::Exact);
                [p.scale, p.misalignment, p.non_orthogonality, p.bias].concat()
            };
            for (k, (x, y)) in all(of).iter().zip(all(other)).enumerate() {
                if x.interval > 0.0 {
                    shares.add(name(sensor, k), (x.value - y.value).abs() <= x.interval);
                }
            }
        }
    }
    shares
}

/// How often the others predict each session that is used.
pub fn by_others(sessions: &Sessions) -> Shares {
    let mut shares = Shares::default();
    for (sensor, triad) in sessions.triads.present() {
        for (left_out, used) in triad.left_out.iter().zip(&sessions.used) {
            let Some(left_out) = left_out.as_ref().filter(|_| *used) else {
                continue;
            };
            for (one, k) in left_out.parameters.iter().zip(&triad.free) {
                shares.add(name(sensor, *k), one.is_inside());
            }
        }
    }
    shares
}

/// How often the sessions before predict the last: as the calibration of those says, findings considered. The estimate of the last has its own error.
pub fn of_next(mut fits: Vec<Fit>) -> (Shares, Sessions) {
    let last = fits.pop().expect("sessions");
    let sessions = Sessions::combine(fits, PartClass::Consumer).expect("one unit");
    let mut shares = Shares::default();
    for (sensor, triad) in sessions.triads.present() {
        let Some(own) = last.sensor(sensor) else {
            continue;
        };
        let (values, parts) = own.estimated.triad.physical_parts();
        for (i, k) in triad.free.iter().enumerate() {
            let own: f64 = parts.iter().map(|p| p.covariance[(*k, *k)]).sum();
            let next = triad.between.parameters[i].next.plus(own);
            let inside = (values[*k] - next.mean()).abs() <= next.half_width(0.95);
            shares.add(name(sensor, *k), inside);
        }
    }
    (shares, sessions)
}

/// Shares over units of a life: of left-out sessions, and of the session after the last.
pub fn study(life: Life, units: u64, sessions: u32) -> [Shares; 3] {
    let of = |seed: u64| {
        let fits = on_bench(seed, life, sessions);
        let single = by_single(&fits);
        let all = Sessions::combine(fits.clone(), PartClass::Consumer).expect("one unit");
        let (next, _) = of_next(fits);
        [single, by_others(&all), next]
    };
    let merge = |a: [Shares; 3], b: [Shares; 3]| {
        let [a0, a1, a2] = a;
        let [b0, b1, b2] = b;
        [a0.merge(b0), a1.merge(b1), a2.merge(b2)]
    };
    (1..=units)
        .into_par_iter()
        .map(of)
        .reduce(|| std::array::from_fn(|_| Shares::default()), merge)
}

/// The model alone: a kind of three parameters with exact normal changes, `ratio` times the error of the fits, seen by `sessions` with errors of their own.
/// Returns the shares of left-out estimates and of true values inside, and the mean half-width over that of known variances.
pub fn of_model(sessions: usize, ratio: f64, runs: u64) -> [f64; 3] {
    const N: usize = 3;
    let of = |seed: u64| {
        let mut random = Random::new(seed, "sessions of the model");
        // The class has units whose changes differ, with the distribution that its prior has.
        let typical = |random: &mut Random| {
            let square: f64 = (0..3).map(|_| random.normal().powi(2)).sum();
            ratio * (3.0 / square).sqrt()
        };
        let change: f64 = match sessions > 2 {
            true => ratio,
            false => typical(&mut random),
        };
        let drawn = |random: &mut Random| {
            let a = DMatrix::from_fn(N, N, |_, _| random.normal());
            let v = &a * a.transpose() / 3.0 + DMatrix::identity(N, N) * 0.3;
            let factor = v.clone().cholesky().expect("regular").l();
            let z = DVector::from_fn(N, |_, _| random.normal());
            let truth = DVector::from_fn(N, |_, _| 100.0 + change * random.normal());
            let values = &truth + factor * z;
            (
                truth,
                Estimates {
                    values,
                    covariance: v,
                },
            )
        };
        let all: Vec<Estimates> = (0..sessions).map(|_| drawn(&mut random).1).collect();
        let (truth, left_out) = drawn(&mut random);
        let kinds = Kinds {
            of: vec![0; N],
            size: vec![1.0; N],
        };
        let prior = VariancePrior {
            dof: 3.0,
            variance: (ratio * ratio).max(0.01),
        };
        let priors = [prior; N];
        let design = Design::constant(N, sessions, &[], (&[], 0.0));
        let few = (sessions <= 2).then_some(&priors[..]);
        let found = fit_between(&all, &design, &kinds, few).expect("determined");
        let mut out = [0.0; 3];
        for i in 0..N {
            let next = &found.parameters[i].next;
            let own = next.plus(left_out.covariance[(i, i)]);
            let inside = (left_out.values[i] - next.mean()).abs() <= own.half_width(0.95);
            out[0] += f64::from(u8::from(inside));
            let half = next.half_width(0.95);
            out[1] += f64::from(u8::from((truth[i] - next.mean()).abs() <= half));
            out[2] +=
                half / (1.96 * change.hypot(((1.3 + change * change) / sessions as f64).sqrt()));
        }
        out.map(|sum| sum / N as f64)
    };
    let add = |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|k| a[k] + b[k]);
    let sum: [f64; 3] = (0..runs).into_par_iter().map(of).reduce(|| [0.0; 3], add);
    sum.map(|x| x / runs as f64)
}

/// Bytes of a packet of the array: head, running number, length, clock, six words for each of eight units, sum.
const PACKET: usize = 106;

/// Number of units of the array of H. Carlsson.
pub const ARRAY_UNITS: usize = 8;
/// Number of its sessions that can be read.
pub const ARRAY_SESSIONS: usize = 9;

/// Recording of a session of one of the eight MPU-9150 of an array of H. Carlsson, I. Skog and J. Jaldén (IEEE Sensors J. 2021), 62.5 Hz, twenty
/// poses and turns, in a folder of its own; `None` if the data are missing.
pub fn of_array_recorded(unit: usize, session: usize) -> Option<(TempDir, Recording)> {
    let folder = data_set("carlsson_mpu9150x8")?;
    let bytes = fs::read(folder.join(format!("exp_{}/data.bin", session + 1))).ok()?;
    let temporary = TempDir::new().expect("a folder");
    let log = temporary.path().join("log.csv");
    fs::write(&log, table(&bytes, unit)).expect("writable");
    let foreign = Foreign {
        files: vec![(log, "t_s,accel_x,accel_y,accel_z,gyro_x,gyro_y,gyro_z")],
        rate_hz: None,
        // Stockholm.
        gravity_mps2: 9.818,
        raw_unit: RawUnit::Count,
        scales: &[],
        inputs: None,
    };
    let recording = foreign.import(&temporary).expect("it can be imported");
    Some((temporary, recording))
}

/// The nine sessions of a unit of the array; `None` if the data are missing.
pub fn of_array(unit: usize) -> Option<Vec<Fit>> {
    let of = |session: usize| {
        let (_folder, recording) = of_array_recorded(unit, session)?;
        let prepared = Prepared::read(&recording, STILL_FACTOR, |_| {}).expect("it has dwells");
        Some(fit(prepared, Options::default()).expect("it can be fitted"))
    };
    (0..ARRAY_SESSIONS).into_par_iter().map(of).collect()
}

/// The readings of a unit as text, by rows.
fn table(bytes: &[u8], unit: usize) -> String {
    let mut out = String::new();
    let (mut at, mut wraps, mut before) = (0, 0u64, 0u32);
    while at + PACKET <= bytes.len() {
        let packet = &bytes[at..at + PACKET];
        let word = |k: usize| u16::from_be_bytes([packet[k], packet[k + 1]]);
        let sum: u32 = packet[..PACKET - 2].iter().map(|b| u32::from(*b)).sum();
        if packet[0] != 0xaa || sum & 0xffff != u32::from(word(PACKET - 2)) {
            at += 1;
            continue;
        }
        let clock = u32::from_be_bytes([packet[4], packet[5], packet[6], packet[7]]);
        wraps += u64::from(clock < before);
        before = clock;
        // The board's clock has 64 MHz.
        let t_s = ((wraps << 32) + u64::from(clock)) as f64 / 64e6;
        out += &format!("{t_s:.6}");
        for k in 0..6 {
            out += &format!(",{}", word(8 + 12 * unit + 2 * k) as i16);
        }
        out.push('\n');
        at += PACKET;
    }
    out
}
