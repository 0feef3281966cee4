//! A unit beside a reference trajectory: motion capture, a robot's arm, an inertial navigation system.
//!
//! The gyro is compared with the turns between two attitudes, the accelerometer with the second difference of three positions and with gravity (`compared.rs`). Where the instrument
//! sees the body, how it is turned to it, its clock, the tilt of its frame, and its noise are found with the calibration, for each recording.

mod compared;
mod poses;

use mimu::calibration::of_fit::{FIGURE_DIGITS, triad_table};
use mimu::calibration::{Calibration, Judged, TriadTable};
use mimu::in_use::Trajectory;
use mimu::quantity::{PerSensor, Sensor, rounded};
use mimu::triad::{Covariance, Estimate, Part, Triad, half_width_95, vector};
use mimu_core::compensation::Affine;
use mimu_recording::error::{Error, Result};
use mimu_recording::{RawUnit, Recording};
use nalgebra::{DVector, Matrix3, Rotation3, SMatrix, Vector3};
use serde::Serialize;

use crate::Body;
use crate::carrier::{first, read};
use crate::clustered::Solution;
use crate::errors::Errors;
use crate::fitted::{self, FittedTriad};
use crate::judge;
use crate::result::EstimateResult;
use crate::series::Series;
use compared::{ARM, ARM_M, CLOCK, Compared, DELAY, Free, TILT, TURN_S, Up};
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

/// An arm is given if the data narrow what is known beforehand to this share of it.
const DETERMINED: f64 = 0.1;

/// A triad against the poses.
struct Found {
    at: DVector<f64>,
    solution: Solution,
    errors: Errors,
    left_out: Vec<[f64; 2]>,
    signal: f64,
    /// White noise of an attitude, rad, or of a position, m.
    pose_noise: f64,
}

impl Found {
    fn of(compared: &Compared, start: DVector<f64>, free: Free) -> Option<Self> {
        let (at, solution, used) = compared.settle(start, free)?;
        let (squares, noise) = compared.errors(&at, &used);
        let mut errors = Errors::of(&squares, noise.variance)?;
        errors.held_out_rms *= solution.unseen(&used);
        Some(Self {
            errors,
            left_out: compared.left_out(&at, &used),
            signal: compared.signal(),
            pose_noise: noise.pose,
            at,
            solution,
        })
    }

    fn part(&self) -> Part {
        Part {
            covariance: self
                .solution
                .covariance
                .fixed_view::<12, 12>(0, 0)
                .into_owned(),
            dof: self.solution.dof,
            known: 0.0,
        }
    }

    fn estimate(&self, k: usize, scale: f64) -> Estimate {
        let variance = self.solution.covariance[(k, k)].max(0.0) * scale * scale;
        Estimate {
            value: self.at[k] * scale,
            sigma: variance.sqrt(),
            interval: half_width_95([(variance, self.solution.dof)].into_iter()),
        }
    }
}

fn model(at: &DVector<f64>) -> Affine<f64> {
    mimu::triad::affine(&at.fixed_rows::<12>(0).into_owned())
}

/// The gyro beside the poses: as their quaternions read, or reversed if they fit so by far better.
struct Turns {
    poses: Poses,
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
        let start = |poses: &Poses| Compared::new(raw, poses, None)?.start_of_turns(delay);
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
            start: found.0,
            reversed,
        })
    }
}

impl ByTrajectory {
    /// The calibration of a recording's gyro and accelerometer by `trajectory`, whose times are of the recording's clock within 30 s.
    ///
    /// # Errors
    /// The samples cannot be read; there is no gyro; the trajectory is not of this motion, or turns too little.
    pub fn of(recording: &Recording, trajectory: &Trajectory) -> Result<Self> {
        let gyro = read_first(recording, Sensor::Gyro)?.ok_or_else(|| {
            let remedy = "a trajectory is found in time by the rates: record the gyro too";
            Error::new(&recording.place, "there is no gyro", remedy)
        })?;
        let turns = Turns::of(trajectory, &gyro)?;
        let compared = Compared::new(&gyro, &turns.poses, None);
        let found = compared.and_then(|c| Found::of(&c, turns.start.clone(), Free::All));
        let found = found.ok_or_else(|| {
            let problem = "the body turns too little for a gyro's scale factors";
            Error::new(
                &trajectory.place,
                problem,
                "turn it about all three axes, by half a turn and more",
            )
        })?;
        let mut all = Self::alone(turns.reversed, &found);
        let accel = all.accelerometer(recording, &turns.poses, &found)?;
        let gyro = fitted::placed(&model(&found.at), &[found.part()]);
        let gyro = gyro.map(|own| match accel {
            // In the frame of the accelerometer.
            Some(rotation) => (in_frame(&found, &rotation), rotation),
            None => (Some(own.triad), own.rotation),
        });
        match gyro {
            Some((Some(triad), rotation)) => all
                .body
                .triads
                .insert(0, all.triad(Sensor::Gyro, &found, triad, rotation, None)),
            _ => all.body.refused.push((
                first(Sensor::Gyro),
                judge::undetermined("two of its axes read the same"),
            )),
        }
        Ok(all)
    }

    fn alone(reversed: bool, found: &Found) -> Self {
        Self {
            body: Body {
                triads: Vec::new(),
                refused: Vec::new(),
            },
            clock_ppm: found.estimate(CLOCK, 1e6),
            tilt_deg: None,
            up: None,
            reversed,
            attitude_noise_deg: found.pose_noise.to_degrees(),
            position_noise_mm: None,
        }
    }

    /// Adds the accelerometer; its rotation to the frame of the trajectory.
    fn accelerometer(
        &mut self,
        recording: &Recording,
        poses: &Poses,
        gyro: &Found,
    ) -> Result<Option<Rotation3<f64>>> {
        let Some(raw) = read_first(recording, Sensor::Accel)? else {
            return Ok(None);
        };
        let name = first(Sensor::Accel);
        if poses.position.is_none() {
            let why = "the trajectory has attitudes alone, and an accelerometer is compared with its positions";
            self.body.refused.push((name, judge::undetermined(why)));
            return Ok(None);
        }
        let gravity = recording.manifest.gravity_mps2;
        let begun = UPS.iter().filter_map(|(up, axis, sign)| {
            let compared = Compared::new(&raw, poses, Some(Up::axis(*axis, *sign, gravity)))?;
            let (start, squares) = compared.start_of_forces(gyro.at[DELAY], gyro.at[CLOCK])?;
            Some((*up, compared, start, squares))
        });
        let best = begun.min_by(|a, b| a.3.total_cmp(&b.3));
        let found = best.and_then(|(up, compared, start, _)| {
            Some((up, Found::of(&compared, start, Free::All)?))
        });
        let placed = found.and_then(|(up, found)| {
            let placed = fitted::placed(&model(&found.at), &[found.part()])?;
            Some((up, found, placed))
        });
        let Some((up, found, placed)) = placed else {
            let why = "its scale factors and angles are not determined: bring each axis up, down and in between";
            self.body.refused.push((name, judge::undetermined(why)));
            return Ok(None);
        };
        self.up = Some(up);
        self.position_noise_mm = Some(1e3 * found.pose_noise);
        self.tilt_deg = Some([TILT, TILT + 1].map(|k| found.estimate(k, 1f64.to_degrees())));
        let rotation = placed.rotation;
        let triad = self.triad(
            Sensor::Accel,
            &found,
            placed.triad,
            rotation,
            Some(placed.rotation_deg),
        );
        self.body.triads.push(triad);
        Ok(Some(rotation))
    }

    fn triad(
        &self,
        sensor: Sensor,
        found: &Found,
        triad: Triad,
        rotation: Rotation3<f64>,
        rotation_deg: Option<[Estimate; 3]>,
    ) -> FittedTriad {
        let weights = &found.solution.by_weights;
        let share = |k: usize| weights[(k, k)].sqrt() / ARM_M;
        let arm = match sensor {
            Sensor::Gyro => Err("a gyro reads the same everywhere on a body".to_string()),
            Sensor::Accel if (ARM..ARM + 3).map(share).fold(0.0, f64::max) < DETERMINED => {
                // The point of the trajectory is what the arm begins at.
                Ok([0, 1, 2].map(|i| found.estimate(ARM + i, 1e3)))
            }
            Sensor::Accel => Err(
                "the body turns too slowly to show a lever arm: turn it faster, about two axes"
                    .to_string(),
            ),
        };
        let degree = 1f64.to_degrees();
        let rotation_deg = rotation_deg
            .or_else(|| self.body.triads.first().map(|accel| accel.rotation_deg))
            .or_else(|| Some(fitted::placed(&model(&found.at), &[found.part()])?.rotation_deg))
            .unwrap_or_else(|| {
                let value = rotation.scaled_axis() * degree;
                [0, 1, 2].map(|i| Estimate {
                    value: value[i],
                    sigma: f64::NAN,
                    interval: f64::NAN,
                })
            });
        FittedTriad {
            name: first(sensor),
            reference: None,
            unit: sensor.unit(),
            judgement: judge::same_body(
                &found.errors,
                found.signal,
                "the trajectory",
                sensor.unit(),
            ),
            triad,
            rotation,
            rotation_deg,
            delay_ms: Ok(found.estimate(DELAY, 1e3)),
            lever_arm_mm: arm,
            dip_deg: None,
            rms: found.errors.rms,
            held_out_rms: found.errors.held_out_rms,
            noise_floor: found.errors.noise_floor,
            window_s: match sensor {
                Sensor::Gyro => TURN_S,
                Sensor::Accel => compared::FORCE_S,
            },
            windows: found.errors.windows,
            left_out: found.left_out.clone(),
        }
    }

    /// The tables of a calibration file.
    pub fn tables(&self, raw: RawUnit) -> PerSensor<Option<TriadTable>> {
        let has_accel = self
            .body
            .triads
            .iter()
            .any(|of| of.name == first(Sensor::Accel));
        PerSensor::from_fn(|sensor| {
            let of = self
                .body
                .triads
                .iter()
                .find(|of| of.name == first(sensor))?;
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
}

/// How well the motion determines all parameters: ratio of the largest to the smallest axis of the ellipsoid of their errors, each in its standard deviation.
fn condition(covariance: &Covariance) -> f64 {
    let sigma = covariance.diagonal().map(f64::sqrt);
    let scaled = Covariance::from_fn(|i, j| covariance[(i, j)] / sigma[i] / sigma[j]);
    let eigen = scaled.symmetric_eigenvalues();
    rounded((eigen.max() / eigen.min()).sqrt(), 5)
}

fn read_first(recording: &Recording, sensor: Sensor) -> Result<Option<Series>> {
    match recording.triads().contains(&first(sensor)) {
        true => Ok(Some(read(recording, first(sensor))?)),
        false => Ok(None),
    }
}

/// The gyro in a frame that `rotation` takes to that of the trajectory.
fn in_frame(found: &Found, rotation: &Rotation3<f64>) -> Option<Triad> {
    let back = rotation.inverse();
    let of = model(&found.at);
    let mut by = SMatrix::<f64, 12, 12>::zeros();
    for k in 0..12 {
        let mut one = SMatrix::<f64, 12, 1>::zeros();
        one[k] = 1.0;
        let moved = mimu::triad::affine(&one);
        by.set_column(
            k,
            &vector(&(back.matrix() * moved.matrix), &(back * moved.offset)),
        );
    }
    let inverse = Affine {
        matrix: back.matrix() * of.matrix,
        offset: back * of.offset,
    };
    Triad::from_inverse(inverse, vec![found.part().seen_by(&by)])
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
) -> Result<PerSensor<Option<crate::TriadVerification>>> {
    let gyro = read_first(recording, Sensor::Gyro)?.ok_or_else(|| {
        let remedy = "a trajectory is found in time by the rates: record the gyro too";
        Error::new(&recording.place, "there is no gyro", remedy)
    })?;
    let turns = Turns::of(trajectory, &gyro)?;
    let mut all = PerSensor::from_fn(|_| None);
    let turned = Compared::new(&gyro, &turns.poses, None);
    let by_turns = turned.and_then(|c| {
        let start = turned_to(&turns.start, &calibration.inverse(Sensor::Gyro)?);
        Found::of(&c, start, Free::Mounting)
    });
    let Some(by_turns) = by_turns else {
        return Ok(all);
    };
    let accel = match &turns.poses.position {
        Some(_) => read_first(recording, Sensor::Accel)?,
        None => None,
    };
    if let Some((raw, own)) = accel.zip(calibration.inverse(Sensor::Accel)) {
        let gravity = recording.manifest.gravity_mps2;
        let begun = UPS.iter().filter_map(|(_, axis, sign)| {
            let compared =
                Compared::new(&raw, &turns.poses, Some(Up::axis(*axis, *sign, gravity)))?;
            let (start, squares) =
                compared.start_of_forces(by_turns.at[DELAY], by_turns.at[CLOCK])?;
            Some((compared, start, squares))
        });
        let best = begun.min_by(|a, b| a.2.total_cmp(&b.2));
        let found =
            best.and_then(|(c, start, _)| Found::of(&c, turned_to(&start, &own), Free::Mounting));
        all.accel = found.map(|found| verification(&found, Sensor::Accel));
    }
    all.gyro = Some(verification(&by_turns, Sensor::Gyro));
    Ok(all)
}

fn verification(found: &Found, sensor: Sensor) -> crate::TriadVerification {
    crate::TriadVerification {
        rms: found.errors.held_out_rms,
        noise_floor: found.errors.noise_floor,
        unit: sensor.unit().into(),
        windows: found.errors.windows,
        judgement: judge::same_body(&found.errors, found.signal, "the trajectory", sensor.unit()),
    }
}

/// Parameters with this calibration, turned as is nearest to what `at` has.
fn turned_to(at: &DVector<f64>, own: &Affine<f64>) -> DVector<f64> {
    let free = model(at).matrix;
    let across: Matrix3<f64> = own
        .matrix
        .try_inverse()
        .map_or(free, |forward| free * forward);
    let rotation = Rotation3::from_matrix(&across);
    let offset: Vector3<f64> = model(at).offset;
    let mut turned = at.clone();
    turned
        .fixed_rows_mut::<12>(0)
        .copy_from(&vector(&(rotation.matrix() * own.matrix), &offset));
    turned
}
