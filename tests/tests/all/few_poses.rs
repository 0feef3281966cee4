//! Typical sessions of users: thirteen poses, ten on a fixture, six faces; with a disturbed dwell, or with a correct dwell that no other confirms.

use mimu::fit::{Fit, Options, fit, fit_or_faces};
use mimu::judgement::{Judgement, JudgementKind};
use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use mimu::signal::dwell::Keep;
use mimu::signal::stillness::STILL_FACTOR;
use mimu::unseen::{BEYOND_NOISE, FALSE_ALARM, Test, Unseen};
use mimu::warning::Warning;
use mimu_recording::error::Error;
use mimu_recording::{Batch, Manifest, RawUnit, Reference};
use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::random::Random;
use mimu_rig::record::samples;
use mimu_rig::rig_file::{RigFile, RigTruth};
use mimu_tests::says;
use nalgebra::{DMatrix, DVector};

const THIRTEEN: &str = include_str!("../../../rig/plans/thirteen.toml");
const FIXTURE: &str = include_str!("../../../rig/plans/fixture.toml");

/// A digital part without wander, so its zero offset is the bias of the session.
const QUIET: &str = "format = \"mimu-rig/1\"\n[unit]\ngyro = \"MPU6050-gyro\"\naccel = \"MPU6050-accel\"\n\
    [unit.gyro_axes]\ninstability_si = [0.0, 0.0, 0.0]\nwalk_si = [0.0, 0.0, 0.0]\n\
    [unit.accel_axes]\ninstability_si = [0.0, 0.0, 0.0]\nwalk_si = [0.0, 0.0, 0.0]\n[thermal]\non_before_s = inf\n";

/// The same part with a package that remembers the direction of the last stress: its dwells scatter by more than their noise.
const STRESSED: &str = "format = \"mimu-rig/1\"\n[unit]\ngyro = \"MPU6050-gyro\"\naccel = \"MPU6050-accel\"\n\
    [thermal]\non_before_s = inf\n[[effect]]\nid = \"x_accel_stress_hysteresis\"\nmg = [1.0, 1.0, 1.0]\nplay_g = 0.3\n";

/// A recording in memory, and its truth.
struct Session {
    manifest: Manifest,
    samples: Batch,
    truth: RigTruth,
}

impl Session {
    fn of(plan: &str, rig: &str, seed: u64) -> Self {
        let plan = Plan::parse(Source::new("plan", plan)).expect("a plan");
        let file = RigFile::parse(&Source::new("rig", rig)).expect("a rig file");
        let truth = RigTruth::resolve(&file, seed).expect("a rig");
        let mut batch = Batch::default();
        for row in samples(&plan, &truth, seed).expect("a run") {
            batch.t_s.push(row.stamp_s);
            let all = row.readings.gyro.iter().chain(&row.readings.accel);
            for (column, value) in batch.raw.iter_mut().zip(all) {
                column.push(*value);
            }
        }
        let (rate, gravity) = (plan.sample_rate_hz, plan.place.gravity);
        let mut manifest = Manifest::new(
            "unit-007",
            rate,
            gravity,
            RawUnit::Count,
            Reference::Gravity,
        );
        manifest.latitude_deg = Some(48.0);
        Self {
            manifest,
            samples: batch,
            truth,
        }
    }

    fn prepared(&self) -> Prepared {
        Prepared::of(self.manifest.clone(), &self.samples, STILL_FACTOR).expect("readable")
    }

    fn fit(&self) -> Result<Fit, Error> {
        fit(self.prepared(), Options::default())
    }

    /// Adds a force along gravity, m/s², during one dwell.
    fn knock(&mut self, dwell: usize, force_mps2: f64) {
        let found = self.prepared().dwells.list[dwell].clone();
        let end = (found.first_row + found.rows) as usize + 30;
        let rows = found.first_row as usize - 30..end.min(self.samples.len());
        let share = force_mps2 / self.manifest.gravity_mps2;
        for axis in 0..3 {
            let null = self.truth.unit.accel.axes[axis].null;
            let add = share * (found.raw[3 + axis].mean - null);
            for value in &mut self.samples.raw[3 + axis][rows.clone()] {
                *value = (*value + add).round();
            }
        }
    }

    /// How many of the accelerometer's scale factors and biases are inside the intervals of `fit`, and their number.
    fn inside(&self, fit: &Fit) -> [u32; 2] {
        let found = fit.sensor(Sensor::Accel).expect("recorded");
        let physical = found.estimated.triad.physical(mimu::triad::Angles::Exact);
        let held = self
            .truth
            .unit
            .accel
            .axes
            .iter()
            .enumerate()
            .map(|(k, axis)| {
                let of = [
                    (physical.scale[k], axis.sensitivity),
                    (physical.bias[k], axis.null),
                ];
                of.iter()
                    .filter(|(e, truth)| (e.value - truth).abs() <= e.interval)
                    .count() as u32
            });
        [held.sum(), 6]
    }
}

#[test]
fn a_right_dwell_that_the_few_others_happen_not_to_predict_is_kept() {
    // Of 120 sessions, these four used to lose a dwell as an outlier of 5 to 21 sigma.
    for seed in [34, 64, 84, 116] {
        let session = Session::of(THIRTEEN, STRESSED, seed);
        let found = session.fit().expect("thirteen poses");
        let left_out = &found.prepared.dwells.left_out;
        let poses = left_out.iter().filter(|l| l.sensor == Sensor::Accel);
        assert_eq!(poses.count(), 0, "seed {seed}: {left_out:?}");
    }
}

/// The unit is sound, so nothing may be called unexplained: 13 poses for nine parameters leave too little to hold out.
#[test]
fn a_sound_unit_in_few_poses_is_untested_or_good() {
    let mut held_out_beyond_noise = 0;
    for seed in 1..=10 {
        let found = Session::of(THIRTEEN, QUIET, seed)
            .fit()
            .expect("thirteen poses");
        let accel = found.sensor(Sensor::Accel).expect("recorded");
        let held_out = accel.held_out_rms().expect("held out");
        held_out_beyond_noise += u32::from(held_out > BEYOND_NOISE * accel.noise_floor());
        let judgement = Judgement::of_fit(&found);
        assert!(
            judgement.kind <= JudgementKind::Untested,
            "seed {seed}: {judgement}"
        );
    }
    // Otherwise the sessions show nothing.
    assert!(held_out_beyond_noise >= 2, "{held_out_beyond_noise} of 10");
}

/// Regressions on random designs, each quarter of the rows predicted by a fit to the others. With two degrees of freedom chance sets the limit, which is
/// stated as a rate; with many the mean square is one.
#[test]
fn errors_of_unseen_rows_exceed_the_limit_as_often_as_is_stated() {
    let mut random = Random::new(1, "regressions");
    for (rows, parameters) in [(8_usize, 6_usize), (60, 9)] {
        let (runs, mut failed, mut squares) = (20_000, 0, 0.0);
        for _ in 0..runs {
            let design = DMatrix::from_fn(rows, parameters, |_, _| random.normal());
            let noise = DVector::from_fn(rows, |_, _| random.normal());
            let parts = (0..4).map(|part| {
                let own: Vec<usize> = (part * rows / 4..(part + 1) * rows / 4).collect();
                let others: Vec<usize> = (0..rows).filter(|k| !own.contains(k)).collect();
                let by = design.select_rows(&others);
                let covariance = by.tr_mul(&by).try_inverse().expect("regular");
                let fitted = &covariance * by.tr_mul(&noise.select_rows(&others));
                let by = design.select_rows(&own);
                let errors = noise.select_rows(&own) - &by * fitted;
                let factor = covariance.cholesky().expect("regular").l();
                Unseen::of(errors, DVector::repeat(own.len(), 1.0), &by, &factor)
            });
            let parts: Vec<Unseen> = parts.collect();
            let dof = (rows - parameters) as f64;
            let test = Test::of(&parts, (dof, rows as f64), 0.0).expect("a test");
            failed += u32::from(test.fails());
            squares += test.ratio.powi(2);
        }
        let (rate, mean) = (
            f64::from(failed) / f64::from(runs),
            squares / f64::from(runs),
        );
        assert!((mean - 1.0).abs() < 0.03);
        // A quarter of the rate of a session, to what chance allows of 25; where 2.5 times the noise is the limit, fewer.
        assert!(rate < 1.6 * FALSE_ALARM / 4.0, "{rate}");
        assert!(rows > 8 || rate > 0.4 * FALSE_ALARM / 4.0, "{rate}");
    }
}

#[test]
fn a_knocked_dwell_is_left_out_and_what_that_changes_is_said_unless_it_is_to_be_kept() {
    let mut session = Session::of(THIRTEEN, QUIET, 2);
    session.knock(3, 0.3);
    let found = session.fit().expect("thirteen poses");
    let left_out = &found.prepared.dwells.left_out;
    assert_eq!(left_out.len(), 1, "{left_out:?}");
    assert_eq!(left_out[0].from, 3);
    // The added force, to within the uncertainty of its prediction.
    assert!((left_out[0].error - 0.3).abs() < 0.05, "{left_out:?}");
    let [held, all] = session.inside(&found);
    assert!(held + 1 >= all, "{held} of {all}");
    let said = found.sensors.iter().flat_map(|s| &s.warnings);
    let said = said.chain(&found.warnings).map(Warning::to_string);
    let said: Vec<String> = said.collect();
    assert!(
        said.iter()
            .any(|w| w.contains("dwell 3 is not used") && w.contains("keep dwell 3"))
    );
    assert!(
        said.iter()
            .any(|w| w.contains("leaving out dwells or turns changes"))
    );
    let moved = found
        .changes
        .iter()
        .filter(|c| (c.with_all - c.fitted.value).abs() > c.fitted.interval);
    assert!(moved.count() > 3);

    for keep in [Keep::Everything, Keep::Steps(vec![3])] {
        let mut prepared = session.prepared();
        prepared.dwells.keep = keep;
        let kept = fit(prepared, Options::default()).expect("thirteen poses");
        assert!(kept.prepared.dwells.left_out.is_empty() && kept.changes.is_empty());
        assert!(kept.sensor(Sensor::Accel).expect("recorded").rms() > 0.03);
    }
}

#[test]
fn the_only_dwell_at_its_end_of_an_axis_is_kept_however_wrong() {
    // Without the last pose, the bias of x is hardly distinguished from its scale factor.
    for force in [0.1, 0.5] {
        let mut session = Session::of(THIRTEEN, QUIET, 5);
        session.knock(12, force);
        let found = session.fit().expect("thirteen poses");
        let left_out = &found.prepared.dwells.left_out;
        assert!(
            left_out.iter().all(|l| l.sensor == Sensor::Gyro),
            "{left_out:?}"
        );
    }
}

#[test]
fn the_turns_between_ten_poses_of_a_fixture_determine_what_their_magnitudes_leave_open() {
    let (mut held, mut all) = (0, 0);
    for seed in 1..=8 {
        let session = Session::of(FIXTURE, QUIET, seed);
        // Two seeds have a dwell that is split by a knock, and then too few turns.
        let Ok(found) = session.fit() else { continue };
        let accel = found.sensor(Sensor::Accel).expect("recorded");
        let z = accel
            .estimated
            .triad
            .physical(mimu::triad::Angles::Exact)
            .scale[2];
        // From magnitudes alone the interval is 2 to 3 %, from noise alone.
        assert!(z.interval < 0.008 * z.value, "seed {seed}: {z:?}");
        let [inside, count] = session.inside(&found);
        held += inside;
        all += count;
    }
    assert!(all >= 36 && 10 * held >= 9 * all, "{held} of {all}");
}

#[test]
fn a_scale_factor_that_the_poses_leave_open_is_refused_with_the_pose_that_is_missing() {
    // Without a gyro there are no turns. With a tilt of 12 degrees the intervals are wider than the scale factor.
    let mut session = Session::of(&FIXTURE.replace("0.577", "0.21"), QUIET, 3);
    for column in &mut session.samples.raw[..3] {
        column.clear();
    }
    let refused = session.fit().expect_err("a cap of poses").to_string();
    says(&refused, &["undetermined", "-z"]);
    assert!(!refused.contains("wrong columns"), "{refused}");
}

#[test]
fn six_faces_give_scale_factors_and_biases_and_the_angles_of_data_sheets() {
    let mut steps = String::new();
    for up in [
        "1.0, 0.02, -0.01",
        "-1.0, 0.01, 0.02",
        "0.02, 1.0, 0.01",
        "-0.01, -1.0, 0.02",
        "0.02, 0.01, 1.0",
        "0.01, -0.02, -1.0",
    ] {
        steps += &format!("[[step]]\nup = [{up}]\ndwell_s = 4.0\n");
    }
    let head = THIRTEEN.split("[[step]]").next().expect("a plan");
    let plan = format!("{head}{steps}");
    let mut held = 0;
    for seed in 1..13 {
        let session = Session::of(&plan, QUIET, seed);
        assert!(matches!(session.fit(), Err(Error::Undetermined(_))));
        let fitted = fit_or_faces(session.prepared(), Options::default()).expect("six faces");
        let judgement = Judgement::of_fit(&fitted);
        assert_eq!(
            judgement.kind,
            JudgementKind::Untested,
            "{seed}: {judgement}"
        );
        let accel = fitted.sensor(Sensor::Accel).expect("an accelerometer");
        let found = accel.estimated.triad.physical(mimu::triad::Angles::Exact);
        let angle = found.non_orthogonality[0].interval;
        assert!((angle / 0.032 - 1.0).abs() < 0.3, "{angle}");
        let open = found.scale[0].interval / found.scale[0].value;
        assert!(open < 4e-3, "{open}");
        held += session.inside(&fitted)[0];
    }
    // Of 72 intervals of 95 %.
    assert!(held >= 66, "{held}");
}
