//! Gyros calibrated by hand with whole turns, beside turns between rests: errors of the scale factors, and whether the intervals hold them.

use mimu::fit::{Fit, Options, fit};
use mimu::prepared::Prepared;
use mimu::quantity::Sensor;
use mimu_recording::error::Result;
use mimu_recording::{Recording, WholeTurns};
use mimu_rig::rig_file::RigFile;

use crate::bench;
use crate::by_hand::{Grade, unit};

/// What a person does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Session {
    /// Poses, with turns between them.
    pub poses: u32,
    /// Turns each way about each axis, on a table top; 0 for none.
    pub turns: u32,
    /// Whether these are stated to be whole. If not, only gravity closes them.
    pub stated: bool,
}

impl Session {
    /// Ten poses, then ten turns each way about each axis, which are not stated to be whole.
    pub const UNSTATED: Self = Self {
        poses: 10,
        turns: 10,
        stated: false,
    };
    /// The same, stated.
    pub const POSES_AND_TURNS: Self = Self {
        stated: true,
        ..Self::UNSTATED
    };
    /// The whole turns alone.
    pub const TURNS: Self = Self {
        poses: 0,
        ..Self::POSES_AND_TURNS
    };

    /// Poses alone.
    pub const fn of_poses(poses: u32) -> Self {
        Self {
            poses,
            turns: 0,
            stated: false,
        }
    }

    /// In words.
    pub fn name(self) -> String {
        let poses = match self.poses {
            0 => String::new(),
            poses => format!("{poses} poses"),
        };
        let turns = match (self.turns, self.stated) {
            (0, _) => String::new(),
            (turns, true) => format!("6 x {turns} turns"),
            (turns, false) => format!("6 x {turns} turns, not stated"),
        };
        [poses, turns]
            .into_iter()
            .filter(|w| !w.is_empty())
            .collect::<Vec<_>>()
            .join(", ")
    }

    /// The plan for the bench.
    pub fn plan(self) -> String {
        let mut plan = "format = \"mimu-plan/1\"\nsample_rate_hz = 200.0\ncarrier = \"hands\"\nlatitude_deg = 48.0\nlead_in_s = 5.0\n".to_owned();
        if self.poses > 0 {
            plan += &format!("[[step]]\nposes = {}\ndwell_s = 2.5\n", self.poses);
        }
        let turns = self.turns;
        if turns > 0 {
            for up in ["[1.0, 0.0, 0.0]", "[0.0, 1.0, 0.0]", "[0.0, 0.0, 1.0]"] {
                plan += &format!("[[step]]\nup = {up}\ndwell_s = 2.0\n");
                for sign in ["", "-"] {
                    plan += &format!(
                        "[[step]]\nwhole_turns = {sign}{turns}\nabout = {up}\ndwell_s = 2.0\n"
                    );
                }
            }
        }
        plan
    }
}

/// The recording of a session with the unit `file`, whose whole turns are stated.
pub fn recorded(file: &RigFile, plan: &str, seed: u64, stated: Option<WholeTurns>) -> Prepared {
    let folder = bench::written(plan, file, seed);
    let recording = Recording::open(&folder.path().join("recording"));
    let mut recording = recording.expect("a recording");
    recording.manifest.whole_turns = stated;
    Prepared::read(&recording, mimu::signal::stillness::STILL_FACTOR, |_| ()).expect("readable")
}

/// Errors of the three scale factors of a gyro and the half-widths of their intervals, relative.
#[derive(Debug, Clone, Copy)]
pub struct Scales {
    /// Estimate less truth.
    pub errors: [f64; 3],
    /// Half-widths of the 95 % intervals.
    pub half_widths: [f64; 3],
    /// How many of the twelve parameters of the gyro are inside of their intervals.
    pub inside: u32,
    /// Length of the recording, s.
    pub duration_s: f64,
}

/// Those of a `fit` of the unit `file`.
pub fn scales(fit: &Fit, file: &RigFile, seed: u64, plan: &str) -> Scales {
    let gyro = fit.sensor(Sensor::Gyro).expect("a gyro");
    let stated = file.unit.gyro_affine.as_ref().expect("stated");
    let mut truth = bench::parameters(stated);
    let wander = bench::wander(plan, file, seed);
    for i in 0..3 {
        truth[9 + i] += wander[0][i];
    }
    let found = gyro.estimated.triad.forward_estimates();
    let of = |k: usize| &found[4 * k];
    let inside = (0..12).filter(|k| (found[*k].value - truth[*k]).abs() <= found[*k].interval);
    let blocks = &fit.prepared.condensed.blocks;
    Scales {
        errors: std::array::from_fn(|k| (of(k).value - truth[4 * k]) / truth[4 * k]),
        half_widths: std::array::from_fn(|k| of(k).interval / truth[4 * k].abs()),
        inside: inside.count() as u32,
        duration_s: blocks.last().map_or(0.0, |b| b.last_s) - blocks[0].start_s,
    }
}

/// A unit of `grade` carried through a session. Without poses, nobody knows the zero of readings in volts: only units whose readings are counts do that.
///
/// # Errors
/// Those of the fit.
pub fn case(grade: Grade, session: Session, seed: u64) -> Result<Scales> {
    let file = unit(&[], grade, seed);
    let plan = session.plan();
    let stated = session.stated.then(|| WholeTurns {
        turns: (session.poses == 0).then_some(session.turns),
        ..WholeTurns::default()
    });
    let fitted = fit(recorded(&file, &plan, seed, stated), Options::IN_SAMPLE)?;
    Ok(scales(&fitted, &file, seed, &plan))
}
