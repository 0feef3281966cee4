//! A unit beside a reference trajectory: motion capture, a robot's arm, an inertial navigation system.
//!
//! The gyro is compared with the turns between two attitudes, the accelerometer with the second difference of three positions and with gravity (`compared.rs`). Where the instrument
//! sees the body, how it is turned to it, its clock, the tilt of its frame, and its noise are found with the calibration, for each recording.

mod compared;
mod poses;
mod several;

use mimu::calibration::of_fit::{FIGURE_DIGITS, triad_table};
use mimu::calibration::{Calibration, Judged, TriadTable};
use mimu::in_use::Trajectory;
use mimu::quantity::{PerSensor, Sensor, rounded};
use mimu::triad::{Covariance, Estimate, Triad, affine, vector};
use mimu_core::compensation::Affine;
use mimu_recording::error::{Error, Result};
use mimu_recording::{RawUnit, Recording};
use nalgebra::{DVector, Rotation3, SMatrix, SVector};
use serde::Serialize;

use crate::carrier::{first, read};
use crate::fitted::FittedTriad;
use crate::relation::{DELAY, Relation};
use crate::result::EstimateResult;
use crate::series::Series;
use crate::{Body, TriadVerification, arm_of, judge};
pub use several::{ByTrajectories, HeldOut, TrajectoriesResult};

use compared::{ARM, CLOCK, Compared, TILT, TURN_S, Up};
use poses::Poses;

/// A gyro and an accelerometer by a trajectory.
#[derive(Debug, Clone)]
pub struct ByTrajectory {
    /// Their calibrations, in the frame of the accelerometer (x along its x, y in the plane of its first two), or without one in that of the gyro. Rotation, arm and
    /// delay are against the trajectory.
    pub body: Body,
    /// How much faster the clock of the recording runs than that of the trajectory, ppm.
    pub clock_ppm: Estimate,
    /// Tilt of the frame of the trajectory, degrees, about two of its level axes.
    pub tilt_deg: Option<[Estimate; 2]>,
    /// The axis of the trajectory's frame that points up, as `z` or `-y`.
    pub up: Option<&'static str>,
    /// Whether its quaternions turn from the reference to the unit.
    pub reversed: bool,
    /// White noise of an attitude, degrees, and of a position, mm, an axis.
    pub attitude_noise_deg: f64,
    /// The same of a position.
    pub position_noise_mm: Option<f64>,
}

/// What is found of the instrument, as JSON.
#[derive(Debug, Clone, Serialize)]
pub struct TrajectoryResult {
    /// Its file.
    pub file: String,
    /// How much faster the clock of the recording runs, ppm.
    pub clock_ppm: EstimateResult,
    /// The axis of its frame that points up.
    pub up: Option<&'static str>,
    /// Tilt of that axis from up, degrees, about two level axes.
    pub tilt_deg: Option<[EstimateResult; 2]>,
    /// What its quaternions turn: `unit to reference` or `reference to unit`.
    pub quaternions: &'static str,
    /// White noise of an attitude, an axis, degrees.
    pub attitude_noise_deg: f64,
    /// White noise of a position, an axis, mm.
    pub position_noise_mm: Option<f64>,
}

impl TrajectoryResult {
    /// Of a fit by the trajectory in `file`.
    pub fn of(of: &ByTrajectory, file: String) -> Self {
        Self {
            file,
            clock_ppm: of.clock_ppm.into(),
            up: of.up,
            tilt_deg: of.tilt_deg.map(|tilt| tilt.map(Into::into)),
            quaternions: match of.reversed {
                true => "reference to unit",
                false => "unit to reference",
            },
            attitude_noise_deg: of.attitude_noise_deg,
            position_noise_mm: of.position_noise_mm,
        }
    }
}

/// Axes that may point up.
const UPS: [(&str, usize, f64); 6] = [
    ("z", 2, 1.0),
    ("y", 1, 1.0),
    ("x", 0, 1.0),
    ("-z", 2, -1.0),
    ("-y", 1, -1.0),
    ("-x", 0, -1.0),
];

/// The gyro beside the poses: as their quaternions read, or reversed if they fit so by far better.
struct Turns {
    poses: Poses,
    /// How much later the recording's times are, s, and C and o.
    later_s: f64,
    start: DVector<f64>,
    reversed: bool,
}

impl Turns {
    fn of(trajectory: &Trajectory, raw: &Series) -> Result<Self> {
        let as_read = Poses::of(trajectory, false);
        let refused = |problem: &str, remedy: &str| Error::new(&trajectory.place, problem, remedy);
        if let Some(between) = as_read.is_sparse() {
            let problem = format!("its poses are {between:.2} s apart");
            return Err(refused(
                &problem,
                "record ten poses a second, better a hundred",
            ));
        }
        let delay = as_read.clock(raw).ok_or_else(|| {
            refused(
                "its turns are not those of the recording, whatever their clocks differ by up to 30 s",
                "check that both are of one motion, and where the recording begins in the trajectory",
            )
        })?;
        let start = |poses: &Poses| Compared::new(raw, poses, None, delay)?.start_of_turns();
        let turned = Poses::of(trajectory, true);
        let [a, b] = [&as_read, &turned].map(start);
        let (reversed, poses, found) = match (a, b) {
            (Some(a), Some(b)) if 2.0 * b.1 < a.1 => (true, turned, b),
            (Some(a), _) => (false, as_read, a),
            (None, Some(b)) => (true, turned, b),
            (None, None) => {
                return Err(refused(
                    "the body turns too little for a gyro's scale factors",
                    "turn it about all three axes, by half a turn and more",
                ));
            }
        };
        Ok(Self {
            poses,
            later_s: delay,
            start: found.0,
            reversed,
        })
    }
}

/// A recording beside the poses of its trajectory.
struct Beside<'a> {
    recording: &'a Recording,
    /// The file of the trajectory.
    place: &'a str,
    gyro: Series,
    accel: Option<Series>,
    turns: Turns,
}

impl<'a> Beside<'a> {
    fn read(recording: &'a Recording, trajectory: &'a Trajectory) -> Result<Self> {
        let gyro = read_first(recording, Sensor::Gyro)?.ok_or_else(|| {
            let remedy = "a trajectory is found in time by the rates: record the gyro too";
            Error::new(&recording.place, "there is no gyro", remedy)
        })?;
        Ok(Self {
            recording,
            place: &trajectory.place,
            turns: Turns::of(trajectory, &gyro)?,
            gyro,
            accel: read_first(recording, Sensor::Accel)?,
        })
    }

    fn fitted(&self) -> Result<ByTrajectory> {
        let turns = &self.turns;
        let compared = Compared::new(&self.gyro, &turns.poses, None, turns.later_s);
        let found = compared.and_then(|c| Some((c.solved(turns.start.clone())?, c.signal())));
        let ((found, noise), signal) = found.ok_or_else(|| {
            let problem = "the body turns too little for a gyro's scale factors";
            Error::new(
                self.place,
                problem,
                "turn it about all three axes, by half a turn and more",
            )
        })?;
        let mut all = ByTrajectory {
            body: Body {
                triads: Vec::new(),
                refused: Vec::new(),
            },
            clock_ppm: found.estimate(CLOCK, 1e6),
            tilt_deg: None,
            up: None,
            reversed: turns.reversed,
            attitude_noise_deg: noise.to_degrees(),
            position_noise_mm: None,
        };
        if let Some(raw) = &self.accel {
            let gravity = self.recording.manifest.gravity_mps2;
            all.accelerometer(raw, gravity, &turns.poses, &found);
        }
        match fitted(Sensor::Gyro, &found, signal) {
            Some(mut gyro) => {
                if let Some(accel) = all.body.triads.first()
                    && let Some(triad) = in_frame(&found, &accel.rotation)
                {
                    (gyro.triad, gyro.rotation) = (triad, accel.rotation);
                    gyro.rotation_deg = accel.rotation_deg;
                }
                all.body.triads.insert(0, gyro);
            }
            None => all.body.refused.push((
                first(Sensor::Gyro),
                judge::undetermined("two of its axes read the same"),
            )),
        }
        Ok(all)
    }

    /// What these calibrations err by, and the signal, if the axis that points `up` is known or not: the scale factors and the angles between the axes are theirs; where the instrument sees the body, clock, tilt and biases are found anew.
    fn judged(
        &self,
        models: &PerSensor<Option<Affine<f64>>>,
        up: Option<&str>,
    ) -> PerSensor<Option<(TriadVerification, f64)>> {
        let mut all = PerSensor::from_fn(|_| None);
        let turns = &self.turns;
        let by_turns = models.gyro.and_then(|own| {
            let compared = Compared::new(&self.gyro, &turns.poses, None, turns.later_s)?;
            judged(compared, &turns.start, &own)
        });
        let Some((by_turns, signal)) = by_turns else {
            return all;
        };
        all.gyro = Some((verification(&by_turns, signal, Sensor::Gyro), signal));
        if turns.poses.position.is_some()
            && let Some((raw, own)) = self.accel.as_ref().zip(models.accel)
        {
            let gravity = self.recording.manifest.gravity_mps2;
            let beside = upright(raw, &turns.poses, (gravity, up), &by_turns);
            let found = beside.and_then(|(_, compared, start)| judged(compared, &start, &own));
            all.accel = found.map(|(found, signal)| {
                let errors = verification(&found, signal, Sensor::Accel);
                (errors, signal)
            });
        }
        all
    }
}

impl ByTrajectory {
    /// The calibration of a recording's gyro and accelerometer by `trajectory`, whose times are of the recording's clock within 30 s.
    ///
    /// # Errors
    /// The samples cannot be read; the recording lacks a gyro; the trajectory is not of this motion, or turns too little.
    pub fn of(recording: &Recording, trajectory: &Trajectory) -> Result<Self> {
        Beside::read(recording, trajectory)?.fitted()
    }

    /// Adds the accelerometer.
    fn accelerometer(&mut self, raw: &Series, gravity: f64, poses: &Poses, gyro: &Relation) {
        let name = first(Sensor::Accel);
        if poses.position.is_none() {
            let why = "the trajectory has attitudes alone, and an accelerometer is compared with its positions";
            self.body.refused.push((name, judge::undetermined(why)));
            return;
        }
        let found = upright(raw, poses, (gravity, None), gyro).and_then(|(up, compared, start)| {
            let (relation, noise) = compared.solved(start)?;
            let mut triad = fitted(Sensor::Accel, &relation, compared.signal())?;
            triad.lever_arm_mm = arm_of(&relation, ARM);
            Some((up, relation, noise, triad))
        });
        let Some((up, relation, noise, triad)) = found else {
            let why = "its scale factors and angles are not determined: bring each axis up, down and in between";
            self.body.refused.push((name, judge::undetermined(why)));
            return;
        };
        self.up = Some(up);
        self.position_noise_mm = Some(1e3 * noise);
        self.tilt_deg = Some([TILT, TILT + 1].map(|k| relation.estimate(k, 1f64.to_degrees())));
        self.body.triads.push(triad);
    }
}

/// The tables of gyro and accelerometer in a calibration file.
pub fn tables(body: &Body, raw: RawUnit) -> PerSensor<Option<TriadTable>> {
    let has_accel = body.triads.iter().any(|of| of.name == first(Sensor::Accel));
    PerSensor::from_fn(|sensor| {
        let of = body.triads.iter().find(|of| of.name == first(sensor))?;
        let frame = match has_accel {
            true => "body: x along the accelerometer's x, xy plane through its y",
            false => "body: x along the gyro's x, xy plane through its y",
        };
        let figure = |x: f64| rounded(x, FIGURE_DIGITS);
        let judged = Judged {
            estimator: "trajectory".into(),
            figure: match sensor {
                Sensor::Gyro => "mean rate of turns of a second".into(),
                Sensor::Accel => "mean specific force over half a second".into(),
            },
            unit: of.unit.into(),
            rms: figure(of.rms),
            held_out_rms: Some(figure(of.held_out_rms)),
            noise_floor: Some(figure(of.noise_floor)),
            dwells: of.windows,
            condition: condition(&of.triad.inverse_covariance),
        };
        Some(triad_table(&of.triad, sensor, raw, frame, judged))
    })
}

/// How well the motion determines all parameters: ratio of the largest to the smallest axis of the ellipsoid of their errors, each in its standard deviation.
fn condition(covariance: &Covariance) -> f64 {
    let sigma = covariance.diagonal().map(f64::sqrt);
    let scaled = Covariance::from_fn(|i, j| covariance[(i, j)] / sigma[i] / sigma[j]);
    let eigen = scaled.symmetric_eigenvalues();
    rounded((eigen.max() / eigen.min()).sqrt(), 5)
}

/// A triad by its relation to the poses.
fn fitted(sensor: Sensor, relation: &Relation, signal: f64) -> Option<FittedTriad> {
    let window_s = match sensor {
        Sensor::Gyro => TURN_S,
        Sensor::Accel => compared::FORCE_S,
    };
    let unit = sensor.unit();
    let judgement = judge::same_body(&relation.errors, signal, "the trajectory", unit);
    let judgement = judge::of_one_recording(judgement);
    let parts = (relation, Vec::new());
    let of = FittedTriad::of(first(sensor), parts, (unit, window_s), judgement)?;
    Some(FittedTriad {
        reference: None,
        ..of
    })
}

/// An accelerometer beside the poses with the axis that points up, the one that is known or else by which it fits best, and its first parameters.
fn upright<'a>(
    raw: &'a Series,
    poses: &'a Poses,
    (gravity, known): (f64, Option<&str>),
    gyro: &Relation,
) -> Option<(&'static str, Compared<'a>, DVector<f64>)> {
    let asked = UPS.iter().filter(|of| known.is_none_or(|up| of.0 == up));
    let begun = asked.filter_map(|(up, axis, sign)| {
        let up_by = Up::axis(*axis, *sign, gravity);
        let compared = Compared::new(raw, poses, Some(up_by), gyro.at[DELAY])?;
        let (start, squares) = compared.start_of_forces(gyro.at[CLOCK])?;
        Some((*up, compared, start, squares))
    });
    let best = begun.min_by(|a, b| a.3.total_cmp(&b.3));
    best.map(|(up, compared, start, _)| (up, compared, start))
}

fn read_first(recording: &Recording, sensor: Sensor) -> Result<Option<Series>> {
    match recording.triads().contains(&first(sensor)) {
        true => Ok(Some(read(recording, first(sensor))?)),
        false => Ok(None),
    }
}

/// The gyro in a frame that `rotation` takes to that of the trajectory.
fn in_frame(found: &Relation, rotation: &Rotation3<f64>) -> Option<Triad> {
    let back = rotation.inverse();
    let turned = |of: &Affine<f64>| Affine {
        matrix: back.matrix() * of.matrix,
        offset: back * of.offset,
    };
    let mut by = SMatrix::<f64, 12, 12>::zeros();
    for k in 0..12 {
        let moved = turned(&affine(&SVector::ith(k, 1.0)));
        by.set_column(k, &vector(&moved.matrix, &moved.offset));
    }
    Triad::from_inverse(
        turned(&found.calibration()),
        vec![found.part().seen_by(&by)],
    )
}

/// Errors of a calibration against the trajectory of another recording: the scale factors and the angles between the axes are those of the file; where the instrument sees the body, clock,
/// tilt and biases are found anew.
///
/// # Errors
/// As of [`ByTrajectory::of`].
pub fn verify(
    recording: &Recording,
    trajectory: &Trajectory,
    calibration: &Calibration,
) -> Result<PerSensor<Option<TriadVerification>>> {
    let models = PerSensor::from_fn(|sensor| calibration.inverse(sensor));
    let judged = Beside::read(recording, trajectory)?.judged(&models, None);
    Ok(judged.map(|of| Some(of?.0)))
}

/// The relation of a calibration that is judged to the poses, and the signal.
fn judged(of: Compared, start: &DVector<f64>, own: &Affine<f64>) -> Option<(Relation, f64)> {
    let (compared, start) = of.judging(start, &own.matrix);
    Some((compared.solved(start)?.0, compared.signal()))
}

fn verification(found: &Relation, signal: f64, sensor: Sensor) -> TriadVerification {
    TriadVerification {
        rms: found.errors.held_out_rms,
        noise_floor: found.errors.noise_floor,
        unit: sensor.unit().into(),
        windows: found.errors.windows,
        judgement: judge::same_body(&found.errors, signal, "the trajectory", sensor.unit()),
    }
}
