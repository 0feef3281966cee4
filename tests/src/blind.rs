//! Units with an effect that is not declared to the diagnosis.
//!
//! The bench makes the truth; its physics share no code with the diagnosis. The size of an effect is the difference of two recordings of the same
//! unit, with and without the effect and otherwise equal bit by bit.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::sync::{Arc, Mutex};

use mimu::diagnose::{Diagnosis, diagnose};
use mimu::effects;
use mimu::estimate::Observation;
use mimu::fit::Options;
use mimu::plan::next_experiment::next;
use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use mimu::result::diagnosis::DiagnosisResult;
use mimu_cli::report::{Detail, Made, diagnosis_page, diagnosis_text};
use mimu_rig::random::Random;
use mimu_rig::rig_file::{EffectFile, RigFile, RigTruth};
use nalgebra::{DMatrix, DVector};

use crate::bench;
use crate::study::Said;

/// Plan of half an hour on a table in a chamber: faces, edges, corners and eight rates about each axis, all twice, in random order by the seed, while
/// the chamber warms by 15 °C and cools again.
pub fn plan(seed: u64) -> String {
    written_plan(seed, false)
}

/// The same with rates about the edges, and with turns about the body's z axis, level and slanted, with and without a rate about the vertical.
pub fn turning_plan(seed: u64) -> String {
    written_plan(seed, true)
}

fn written_plan(seed: u64, turning: bool) -> String {
    let mut steps: Vec<([f64; 3], f64, f64)> = Vec::new();
    for x in [-1.0, 0.0, 1.0] {
        for y in [-1.0, 0.0, 1.0] {
            for z in [-1.0, 0.0, 1.0] {
                if (x, y, z) != (0.0, 0.0, 0.0) {
                    steps.push(([x, y, z], 0.0, 0.0));
                }
            }
        }
    }
    for axis in 0..3 {
        let up: [f64; 3] = std::array::from_fn(|i| f64::from(u8::from(i == axis)));
        steps.extend(
            [-280.0, -200.0, -100.0, -30.0, 30.0, 100.0, 200.0, 280.0].map(|r| (up, r, 0.0)),
        );
    }
    if turning {
        for up in [[1.0, 1.0, 0.0], [0.0, 1.0, 1.0], [1.0, 0.0, 1.0]] {
            steps.extend([-200.0, 200.0].map(|rate| (up, rate, 0.0)));
        }
        for up in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 1.0]] {
            steps.extend([-180.0, -60.0, 60.0, 180.0].map(|spin| (up, 0.0, spin)));
        }
        for (rate, spin) in [(60.0, 45.0), (-60.0, 45.0), (120.0, -90.0), (-120.0, 90.0)] {
            steps.push(([0.0, 1.0, 0.0], rate, spin));
        }
    }
    let mut random = Random::new(seed, "order of the steps");
    let mut plan = String::from(
        "format = \"mimu-plan/1\"\nsample_rate_hz = 100.0\ncarrier = \"table\"\nlead_in_s = 5.0\n\
         chamber_c = [[0.0, 20.0], [200.0, 20.0], [800.0, 35.0], [1000.0, 35.0], [1600.0, 20.0]]\n",
    );
    for _ in 0..2 {
        for k in (1..steps.len()).rev() {
            steps.swap(k, (random.uniform() * (k + 1) as f64) as usize);
        }
        for (up, rate_dps, spin_dps) in &steps {
            let heading = random.within(180.0);
            let _ = writeln!(
                plan,
                "[[step]]\nup = {up:?}\nheading_deg = {heading:?}\nrate_dps = {rate_dps:?}\nspin_dps = {spin_dps:?}\ndwell_s = 10.0"
            );
        }
    }
    plan
}

/// A unit with the effects `ids`. The size of each is drawn from a log-uniform distribution over a decade around the data-sheet size.
pub fn unit(ids: &[&str], seed: u64) -> RigFile {
    let file = bench::drawn(seed, "unit");
    with_effects(file, ids, seed)
}

/// `file` with the effects `ids`, sizes drawn as in [`unit()`].
pub fn with_effects(mut file: RigFile, ids: &[&str], seed: u64) -> RigFile {
    file.effect = ids
        .iter()
        .map(|id| EffectFile {
            id: (*id).into(),
            parameters: toml::Table::new(),
        })
        .collect();
    let mut drawn = RigTruth::resolve(&file, seed).expect("a rig").file;
    let mut size = Random::new(seed, "size of the effect");
    for effect in &mut drawn.effect {
        resize(effect, 10f64.powf(size.within(0.5)));
    }
    drawn
}

/// Multiplies the size of `effect` by `factor`.
pub(crate) fn resize(effect: &mut EffectFile, factor: f64) {
    let spec = mimu_rig::effects::spec(&effect.id).expect("an effect");
    if let Some(value) = effect.parameters.get_mut(spec.parameters[0].key) {
        scale(value, factor);
    }
}

fn scale(value: &mut toml::Value, factor: f64) {
    match value {
        toml::Value::Float(v) => *v *= factor,
        toml::Value::Integer(v) => *value = toml::Value::Float(*v as f64 * factor),
        toml::Value::Array(all) => all.iter_mut().for_each(|v| scale(v, factor)),
        _ => {}
    }
}

/// Whether the diagnosis knows this effect of the bench by name.
pub fn is_listed(id: &str) -> bool {
    effects::by_id(id).is_some()
}

/// One unit of the suite.
#[derive(Debug, Clone)]
pub struct Case {
    /// Effects that it has.
    pub truth: Vec<String>,
    /// For each effect, the rms of its residuals in the dwell means after an affine fit, over the noise floor.
    pub strength: Vec<f64>,
    /// What the diagnosis says.
    pub said: Said,
    /// Sensor of the first effect.
    pub judged: Sensor,
    /// Its held-out error with the effects, over the noise floor.
    pub after: f64,
    /// The same with every fourth dwell held out instead of blocks of time.
    pub interleaved: f64,
    /// Held-out error with the effects, of gyro and accelerometer, SI.
    pub held_out: [f64; 2],
}

/// Rms of the difference between two recordings after an affine model, over the noise floor, for the sensor where it is larger.
pub(crate) fn strength(with: &Prepared, without: &Prepared) -> (Sensor, f64) {
    let of = |sensor: Sensor| {
        let (a, all) = (with.observations(sensor), without.observations(sensor));
        // A dwell that the effect makes unusable is in only one of the recordings.
        let step = |p: &Prepared, o: &Observation| p.dwells.list[o.dwell].step;
        let pairs = a.into_iter().filter_map(|a| {
            let same = |b: &&Observation| step(without, b) == step(with, &a);
            Some((a, *all.iter().find(same)?))
        });
        let (mut a, mut b): (Vec<Observation>, Vec<Observation>) = pairs.unzip();
        let means = a.len();
        // How the readings follow inputs that move; both recordings have the same inputs.
        let within = [with, without].map(|p| p.within_dwells(sensor));
        if within[0].len() == within[1].len() {
            let [of_with, of_without] = within;
            a.extend(of_with);
            b.extend(of_without);
        }
        let n = a.len();
        let design = DMatrix::from_fn(n, 4, |i, j| match j {
            0 => f64::from(u8::from(i < means)),
            _ => a[i].input[j - 1],
        });
        let q = design.qr().q();
        let mut sum = 0.0;
        let mut noise = 0.0;
        for axis in 0..3 {
            let y = DVector::from_fn(n, |i, _| a[i].raw[axis] - b[i].raw[axis]);
            sum += (&y - &q * q.tr_mul(&y)).norm_squared();
            noise += b.iter().map(|o| o.variance[axis]).sum::<f64>();
        }
        (sensor, (sum / noise).sqrt())
    };
    let [g, a] = Sensor::BOTH.map(of);
    if g.1 > a.1 { g } else { a }
}

/// Recording of the seed's unit without any effect; every effect of that seed is compared with it.
fn clean(plan: &str, file: &RigFile, seed: u64) -> Arc<Prepared> {
    // Each seed has one plan of each kind, and the kinds differ in length.
    type Recorded = BTreeMap<(u64, usize), Arc<Prepared>>;
    static RECORDED: Mutex<Recorded> = Mutex::new(BTreeMap::new());
    let known = || RECORDED.lock().expect("nobody panics with it");
    let key = (seed, plan.lines().count());
    if let Some(recorded) = known().get(&key) {
        return recorded.clone();
    }
    let recorded = Arc::new(bench::recorded(plan, file, seed));
    known().entry(key).or_insert(recorded).clone()
}

/// A diagnosis whose text and drawings were all made: each must succeed, whatever was found.
pub fn reported(diagnosis: Diagnosis) -> Diagnosis {
    let report = DiagnosisResult::of(&diagnosis, &next(&diagnosis), None);
    let made = Made {
        recording: "blind".into(),
        command: "mimu diagnose blind".into(),
        created: "2026-01-01T00:00:00Z".into(),
    };
    let page = diagnosis_page(&report, &made);
    let text = diagnosis_text(
        &report,
        Detail {
            all: true,
            next: true,
        },
    );
    let json = serde_json::to_string(&report).expect("JSON");
    for effect in &diagnosis.effects {
        let id = effect.candidate.id();
        assert!(
            [&page, &text, &json].iter().all(|said| said.contains(&id)),
            "{id}"
        );
    }
    diagnosis
}

/// Records and diagnoses a unit with `ids`.
pub fn case(ids: &[&str], seed: u64) -> Case {
    case_on(&plan(seed), ids, seed)
}

/// The same on another plan.
pub fn case_on(plan: &str, ids: &[&str], seed: u64) -> Case {
    let file = unit(ids, seed);
    let with = bench::recorded(plan, &file, seed);
    let mut strengths = Vec::new();
    let mut sensors = Vec::new();
    for k in 0..ids.len() {
        let mut less = file.clone();
        less.effect.remove(k);
        let less = match less.effect.is_empty() {
            true => clean(plan, &less, seed),
            false => Arc::new(bench::recorded(plan, &less, seed)),
        };
        let (sensor, s) = strength(&with, &less);
        strengths.push(s);
        sensors.push(sensor);
    }
    let noise = bench::noise_file(&file, seed, with.condensed.period_s);
    let with = with.with_noise(&noise).expect("its noise");
    let found = diagnose(with.into(), Options::IN_SAMPLE).map(reported);
    let judged = sensors.first().copied().unwrap_or(Sensor::Gyro);
    let of = |sensor: Sensor| {
        let all = &found.as_ref().ok()?.sensors;
        Some(&all.iter().find(|s| s.sensor == sensor)?.decision)
    };
    let held_out = |s| of(s).map_or(f64::NAN, |d| d.held_out_rms[1]);
    let floor = of(judged).map_or(f64::NAN, |d| d.noise_floor);
    Case {
        truth: ids.iter().map(|id| (*id).into()).collect(),
        strength: strengths,
        said: Said::of(&found),
        judged,
        after: held_out(judged) / floor,
        interleaved: of(judged).map_or(f64::NAN, |d| d.interleaved_rms) / floor,
        held_out: Sensor::BOTH.map(held_out),
    }
}
