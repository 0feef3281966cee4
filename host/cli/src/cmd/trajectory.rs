//! A reference trajectory in place of poses at rest: of `mimu fit`, `mimu verify` and `mimu noise`.

use std::path::PathBuf;

use clap::Args;
use mimu::calibration::Calibration;
use mimu::in_use::Trajectory;
use mimu::judgement::{Judgement, JudgementKind};
use mimu_body::result::BodyResult;
use mimu_body::trajectory::{ByTrajectory, TrajectoryResult};
use mimu_body::{TriadVerification, trajectory};
use mimu_recording::Recording;
use mimu_recording::error::Result;
use serde_json::{Value, json};

use crate::output::now;
use crate::report;

/// Poses of the unit by another instrument.
#[derive(Args)]
pub(crate) struct TrajectoryArgs {
    /// Poses of the unit by another instrument (motion capture, arm, INS): ground truth of EuRoC, or of TUM's benchmarks (time, position, quaternion x y z w)
    ///
    /// The quaternion turns from the unit to a frame with a vertical axis. How the instrument is mounted and timed is estimated (docs/trajectory.md).
    #[arg(long, value_name = "FILE.csv")]
    pub(crate) trajectory: Option<PathBuf>,
    /// Time of the trajectory at which the recording's t_s is 0, s: `mimu import` prints what stamps are counted from
    #[arg(
        long,
        value_name = "S",
        requires = "trajectory",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    trajectory_zero: f64,
}

impl TrajectoryArgs {
    /// The trajectory by the clock of the recording, if one is given.
    pub(crate) fn read(&self) -> Result<Option<Trajectory>> {
        let read = |path: &PathBuf| Ok(Trajectory::read(path)?.counted_from(self.trajectory_zero));
        self.trajectory.as_ref().map(read).transpose()
    }
}

/// What a recording beside a trajectory gives: text, JSON, judgement, and the calibration.
pub(crate) struct Made {
    pub text: String,
    pub json: Value,
    pub judgement: Judgement,
    found: ByTrajectory,
}

impl Made {
    /// The calibration of `recording`.
    ///
    /// # Errors
    /// No triad is determined.
    pub fn calibration(&self, recording: &Recording) -> Result<Calibration> {
        let manifest = &recording.manifest;
        let tables = self.found.tables(manifest.raw_unit);
        Calibration::of_body(manifest, tables, Vec::new(), self.judgement.clone(), &now())
    }
}

/// Calibrates `recording` by `by`.
///
/// # Errors
/// The trajectory is not of its motion.
pub(crate) fn fitted(recording: &Recording, by: &Trajectory) -> Result<Made> {
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
        found,
    })
}

/// Judges `calibration` by `recording` and `by`: text, JSON and judgement.
///
/// # Errors
/// As of [`fitted`].
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
