//! Bodies that change from one power-on to the next: whether one body of several sessions says what the next power-on will be.

use mimu::fit::{Options, fit};
use mimu::prepared::Prepared;
use mimu::signal::stillness::STILL_FACTOR;
use mimu_body::Body;
use mimu_recording::Recording;
use mimu_rig::catalog::MeasuredQuantity;
use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::random::Random;
use mimu_rig::record::{Output, write};
use mimu_rig::rig_file::{RigFile, RigTruth};
use mimu_rig::rotation::{add, norm, scale};
use mimu_rig::sensor::TriadTruth;
use rayon::prelude::*;

use crate::body::{Bandwidth, Disturbance, Found, body, found, plan};

/// Standard deviations of what a power-on changes, as in the study of single units: scale factors, angles (rad), and biases in SI, 0.15 deg/s, 3 mg and 0.5 µT.
fn sizes(of: MeasuredQuantity) -> [f64; 3] {
    match of {
        MeasuredQuantity::Gyro => [8e-4, 8e-4, 2.6e-3],
        MeasuredQuantity::Accel => [3e-4, 3e-4, 0.03],
        MeasuredQuantity::Mag => [1e-3, 1e-3, 0.5],
    }
}

/// Changes a triad as a power-on does.
fn change(triad: &mut TriadTruth, of: MeasuredQuantity, random: &mut Random) {
    let [scales, angles, biases] = sizes(of);
    for axis in &mut triad.axes {
        axis.null += axis.sensitivity * biases * random.normal();
        axis.sensitivity *= 1.0 + scales * random.normal();
        let by = [0; 3].map(|_| angles * random.normal());
        let direction = add(axis.direction, by);
        axis.direction = scale(1.0 / norm(direction), direction);
    }
}

/// A body at a power-on. Its biases do not wander: what they would be at the next one has no true value otherwise.
fn at_power_on(number: u64, seed: u64) -> RigTruth {
    let mut file: RigFile = body(Disturbance::None, Bandwidth::OfParts, seed);
    let further = file.triad.iter_mut().map(|triad| &mut triad.axes);
    let first = [&mut file.unit.gyro_axes, &mut file.unit.accel_axes];
    for axes in further.chain(first) {
        axes.instability_si = Some([0.0; 3]);
        axes.walk_si = Some([0.0; 3]);
    }
    let mut truth = RigTruth::resolve(&file, seed).expect("a rig");
    let mut random = Random::new(seed, &format!("power-on {number}"));
    let random = &mut random;
    change(&mut truth.unit.gyro, MeasuredQuantity::Gyro, random);
    change(&mut truth.unit.accel, MeasuredQuantity::Accel, random);
    for triad in &mut truth.further {
        change(&mut triad.triad, triad.kind, random);
    }
    truth
}

/// What a recording by hand after this power-on shows.
fn session(truth: &RigTruth, seed: u64) -> Body {
    let plan = Plan::parse(Source::new("plan", plan(seed))).expect("a plan");
    let folder = tempfile::tempdir().expect("a folder");
    let output = Output::new(&folder.path().join("recording"), &plan).expect("a place");
    write(&plan, truth, seed, &output).expect("a run");
    let recording = Recording::open(&output.folder).expect("a recording");
    let prepared = Prepared::read(&recording, STILL_FACTOR, |_| ()).expect("readable");
    let unit = fit(prepared, Options::IN_SAMPLE).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
    let options = mimu_body::Options {
        field_ut: Some(truth.field.size_ut),
    };
    let body = Body::of(&recording, &unit, &options).expect("readable");
    body.expect("further triads")
}

/// The first so many bodies, each by so many sessions, against the truth of the power-on after these.
pub fn lives(bodies: u64, sessions: u64) -> Vec<Vec<Found>> {
    let one = |seed| {
        let each = (0..sessions).map(|k| session(&at_power_on(k, seed), 1000 * k + seed));
        let together = Body::combined(&each.collect::<Vec<_>>());
        let next = at_power_on(sessions, seed);
        found(together, &next, &[[0.0; 3]; 3])
    };
    (0..bodies).into_par_iter().map(one).collect()
}
