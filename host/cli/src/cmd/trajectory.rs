//! A reference trajectory in place of poses at rest: of `mimu fit`, `mimu verify` and `mimu noise`.

use std::path::PathBuf;

use clap::Args;
use mimu::calibration::{Calibration, TriadTable};
use mimu::in_use::Trajectory;
use mimu::judgement::{Judgement, JudgementKind};
use mimu::quantity::{PerSensor, plural};
use mimu_body::result::BodyResult;
use mimu_body::trajectory::{ByTrajectories, ByTrajectory, TrajectoriesResult, TrajectoryResult};
use mimu_body::{TriadVerification, trajectory};
use mimu_recording::Recording;
use mimu_recording::error::{Error, Result};
use serde_json::{Value, json};

use crate::output::now;
use crate::report;

/// Poses of the unit by another instrument.
#[derive(Args)]
pub(crate) struct TrajectoryArgs {
    /// Poses of the unit by another instrument (motion capture, arm, INS): ground truth of EuRoC, or of TUM's benchmarks (time, position, quaternion x y z w)
    ///
    /// The quaternion turns from the unit to a frame with a vertical axis. How the instrument is mounted and timed is estimated (docs/trajectory.md). `mimu fit` takes one for each recording.
    #[arg(long, value_name = "FILE.csv")]
    pub(crate) trajectory: Vec<PathBuf>,
    /// Time of the trajectory at which the recording's t_s is 0, s: `mimu import` prints what stamps are counted from. Given once, it is that of all
    #[arg(
        long,
        value_name = "S",
        requires = "trajectory",
        default_values_t = [0.0],
        allow_negative_numbers = true
    )]
    trajectory_zero: Vec<f64>,
}

impl TrajectoryArgs {
    /// The trajectory by the clock of the recording, if one is given.
    pub(crate) fn read(&self) -> Result<Option<Trajectory>> {
        Ok(self.read_all(1)?.pop())
    }

    /// The trajectories of so many recordings, each by the clock of its recording; empty if none is given.
    pub(crate) fn read_all(&self, recordings: usize) -> Result<Vec<Trajectory>> {
        let (files, zeros) = (self.trajectory.len(), self.trajectory_zero.len());
        let counted = |count: usize, what: &str| plural(count as u64, what);
        if ![0, recordings].contains(&files) {
            let [of, to] =
                [(recordings, "recording"), (files, "file")].map(|(n, of)| counted(n, of));
            let problem = format!("{to} for {of}");
            let remedy =
                "give --trajectory once for each recording, in the order of the recordings";
            return Err(Error::new("--trajectory", problem, remedy));
        }
        if ![1, files].contains(&zeros) {
            let [of, to] = [(files, "file"), (zeros, "time")].map(|(n, of)| counted(n, of));
            let problem = format!("{to} for {of} of --trajectory");
            let remedy = "give it once for all, or once for each trajectory";
            return Err(Error::new("--trajectory-zero", problem, remedy));
        }
        let zeros = self.trajectory_zero.iter().cycle();
        let each = self.trajectory.iter().zip(zeros);
        each.map(|(path, zero)| Ok(Trajectory::read(path)?.counted_from(*zero)))
            .collect()
    }
}

/// What recordings beside trajectories give: text, JSON, judgement, and the tables of the calibration.
pub(crate) struct Made {
    pub text: String,
    pub json: Value,
    pub judgement: Judgement,
    tables: PerSensor<Option<TriadTable>>,
}

impl Made {
    /// The calibration of the unit of `recording`.
    ///
    /// # Errors
    /// No triad is determined.
    pub fn calibration(&self, recording: &Recording) -> Result<Calibration> {
        let (tables, judgement) = (self.tables.clone(), self.judgement.clone());
        Calibration::of_body(&recording.manifest, tables, Vec::new(), judgement, &now())
    }
}

/// Calibrates the unit of these recordings, each by its trajectory.
///
/// # Errors
/// A trajectory is not of the motion of its recording; the recordings are not of one unit.
pub(crate) fn fitted(all: &[(Recording, Trajectory)], verbose: bool) -> Result<Made> {
    match all {
        [(recording, by)] => one(recording, by),
        _ => several(all, verbose),
    }
}

fn one(recording: &Recording, by: &Trajectory) -> Result<Made> {
    let found = ByTrajectory::of(recording, by)?;
    let manifest = &recording.manifest;
    let raw = manifest.raw_unit;
    let judgement = found.body.judgement();
    let of = BodyResult::of(&found.body, raw);
    let instrument = TrajectoryResult::of(&found, by.place.clone());
    let head = json!({
        "format": "mimu-fit/1",
        "device": manifest.device,
        "judgement": judgement,
        "raw_unit": raw,
        "trajectory": instrument,
    });
    Ok(Made {
        text: report::trajectory_text(&recording.place, &of, &instrument, &judgement),
        json: json!(report::Joined::of(&head, Some(&of))),
        judgement,
        tables: trajectory::tables(&found.body, raw),
    })
}

fn several(all: &[(Recording, Trajectory)], verbose: bool) -> Result<Made> {
    let found = ByTrajectories::of(all)?;
    let manifest = &all[0].0.manifest;
    let judgement = found.body.judgement();
    let result = TrajectoriesResult::of(&found, all);
    let head = json!({
        "format": "mimu-fit/1",
        "device": manifest.device,
        "judgement": judgement,
        "raw_unit": manifest.raw_unit,
    });
    Ok(Made {
        text: report::trajectories_text(&manifest.device, &result, &judgement, verbose),
        json: json!(report::Joined::of(&head, Some(&result))),
        judgement,
        tables: trajectory::tables(&found.body, manifest.raw_unit),
    })
}

/// Judges `calibration` by `recording` and `by`: text, JSON and judgement.
///
/// # Errors
/// The trajectory is not of its motion.
pub(crate) fn verified(
    recording: &Recording,
    by: &Trajectory,
    calibration: &Calibration,
) -> Result<(String, Value, Judgement)> {
    let found = trajectory::verify(recording, by, calibration)?;
    let sensors = found
        .present()
        .map(|(sensor, of)| (sensor.to_string(), of.clone()));
    let sensors: std::collections::BTreeMap<String, TriadVerification> = sensors.collect();
    let judged = sensors.values().map(|of| of.judgement.clone());
    let untested = || {
        Judgement::new(
            JudgementKind::Untested,
            "the trajectory determines no triad of the calibration",
        )
    };
    let judgement = Judgement::worst(judged).unwrap_or_else(untested);
    let text = format!(
        "{}: judged {judgement}\n{}",
        recording.place,
        report::body_errors_text(&sensors)
    );
    let all = json!({
        "format": "mimu-verify/1",
        "judgement": judgement,
        "trajectory": by.place,
        "sensors": sensors,
    });
    Ok((text, all, judgement))
}
