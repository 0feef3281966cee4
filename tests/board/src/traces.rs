//! Traces of the device: its output, byte by byte, and the calibration in use. They are kept in `tests/traces` and computed again by `core`.
//!
//! A trace is two files. `NAME.wire`: all bytes of the line from the first call on, as received. `NAME.calibration`: the stored calibration
//! ([`mimu_core::stored`]). A trace contains the compensated stream and the reports of the Kalman banks. `core` computes both from the raw stream,
//! and they are compared bit by bit with the results of the device's processor.

mod replay;

pub use replay::{Replayed, replay};

use std::fs;
use std::path::PathBuf;

use mimu_board::front::Front;
use mimu_board::running::Board;
use mimu_board::schematic::Volts;
use mimu_core::compensation::{Affine, Compensation};
use mimu_core::effects::{DeviceEffect, Variable};
use mimu_core::stored::{self, Curves};
use mimu_core::table::Node;
use mimu_core::wire::{BATCH, Prior, Request};
use mimu_core::{PerSensor, Sensor};
use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::rig_file::{RigFile, RigTruth};
use nalgebra::{Matrix3, Vector3};

use crate::conversation::{Answer, Conversation};
use crate::{MS, STARTED, image};

/// A kind of step, and how it is recorded.
pub struct Step {
    /// Name of its files.
    pub name: &'static str,
    /// Motion of the unit, from `carrier` on.
    plan: &'static str,
    /// The calibration stored on the device.
    calibration: fn() -> Vec<u8>,
    /// Streamed segments: number, length, and pause between them, ms. Without pauses a trace of several seconds would be too large to keep.
    stretches: (u32, u64, u64),
    /// The banks run, and the compensated stream is not sent.
    banks: bool,
}

/// Variances given to the banks, V².
const NOISE: [f32; 3] = [1.2e-5; 3];
/// Inputs given to them: rad/s, m/s².
const INPUTS: [[f32; 3]; 2] = [[0.0, 0.0, 1.745_329_3], [0.0, 0.0, 9.793]];
/// Sizes of their diffuse priors.
const SPANS: [f32; 2] = [1.745_329_3, 9.793];

/// The steps. All traces together stay below 300 kB.
pub const STEPS: [Step; 6] = [
    Step {
        name: "poses",
        plan: "carrier = \"table\"\nlead_in_s = 0.3\n[[step]]\nup = [0.0, 0.0, 1.0]\ndwell_s = 1.0\n\
               [[step]]\nup = [1.0, 0.0, 0.0]\ndwell_s = 1.0\n[[step]]\nup = [0.0, -1.0, 0.0]\ndwell_s = 1.0\n",
        calibration: affine,
        stretches: (5, 200, 1000),
        banks: false,
    },
    Step {
        name: "rates",
        plan: "carrier = \"table\"\nlead_in_s = 0.0\n[[step]]\nup = [0.0, 0.0, 1.0]\nrate_dps = 100.0\ndwell_s = 1.0\n\
               [[step]]\nup = [0.0, 0.0, 1.0]\nrate_dps = -200.0\ndwell_s = 2.0\n",
        calibration: affine,
        stretches: (5, 200, 700),
        banks: false,
    },
    Step {
        name: "by-hand",
        plan: "carrier = \"hands\"\nlead_in_s = 0.0\n[[step]]\nposes = 4\ndwell_s = 0.2\n",
        calibration: affine,
        stretches: (1, 1000, 0),
        banks: false,
    },
    Step {
        // After power-on the gyros warm up by some degrees, through several nodes; the dies lag.
        name: "temperature",
        plan: "carrier = \"table\"\nlead_in_s = 0.3\n[[step]]\nup = [0.0, 0.0, 1.0]\ndwell_s = 20.0\n",
        calibration: nodes,
        stretches: (5, 200, 1500),
        banks: false,
    },
    Step {
        name: "effects",
        plan: "carrier = \"hands\"\nlead_in_s = 0.0\n[[step]]\nposes = 4\ndwell_s = 0.2\n",
        calibration: with_effects,
        stretches: (1, 1000, 0),
        banks: false,
    },
    Step {
        name: "kalman",
        plan: "carrier = \"table\"\nlead_in_s = 0.0\n[[step]]\nup = [0.0, 0.0, 1.0]\nrate_dps = 100.0\ndwell_s = 20.0\n",
        calibration: affine,
        stretches: (1, 1300, 0),
        banks: true,
    },
];

/// Inverse of the unit of fang's table 4, rounded to single precision.
fn model(warmth: f64) -> Compensation<f32> {
    let gyro = Matrix3::new(
        0.290489602,
        -0.0007605,
        0.0002535,
        0.0074823,
        0.291635518,
        0.0009162,
        -0.005687,
        0.0050149,
        0.29621918,
    );
    let accel = Matrix3::new(
        0.0808,
        -0.000267943,
        0.000282045,
        0.000279741,
        0.08014,
        -0.000083922,
        -0.000253966,
        0.000070546,
        0.08084,
    );
    let inverse = |p: Matrix3<f64>, b: Vector3<f64>, per_c: f64| {
        let c = (p * (1.0 + per_c * warmth)).try_inverse().expect("regular");
        Affine {
            matrix: c.map(|v| v as f32),
            offset: (-c * b.add_scalar(per_c * warmth)).map(|v| v as f32),
        }
    };
    Compensation {
        gyro: inverse(gyro, Vector3::new(2.51, 2.52, 2.48), 1e-4),
        accel: inverse(accel, Vector3::new(1.79, 1.66, 1.74), -2e-4),
    }
}

fn stored(temps: &[f64], lags_s: Option<PerSensor<f32>>, effects: &[DeviceEffect<f32>]) -> Vec<u8> {
    let slope = |before: &Affine<f32>, after: &Affine<f32>| Affine {
        matrix: after.matrix - before.matrix,
        offset: after.offset - before.offset,
    };
    let node = |&temp_c: &f64| {
        let warmth = temp_c - 25.0;
        if temps.len() == 1 {
            return Node::constant(temp_c as f32, model(warmth));
        }
        // Derivatives from the difference over one kelvin.
        let (before, after) = (model(warmth - 0.5), model(warmth + 0.5));
        Node {
            temp_c: temp_c as f32,
            model: model(warmth),
            slope: Compensation {
                gyro: slope(&before.gyro, &after.gyro),
                accel: slope(&before.accel, &after.accel),
            },
        }
    };
    let nodes: Vec<_> = temps.iter().map(node).collect();
    let found_with = model(0.0);
    let mut bytes = vec![0; stored::MAX_LENGTH];
    let matrices = found_with.as_ref().map(|model| &model.matrix);
    let length = stored::encode(
        &stored::Origin::UNKNOWN,
        matrices,
        &Curves {
            lags_s,
            ..Curves::of(&nodes)
        },
        effects,
        &mut bytes,
    )
    .expect("there is room");
    bytes.truncate(length);
    bytes
}

fn affine() -> Vec<u8> {
    stored(&[25.0], None, &[])
}

fn nodes() -> Vec<u8> {
    let temps: Vec<f64> = (0..16).map(|k| 24.0 + f64::from(k)).collect();
    stored(&temps, Some([5.0, 9.0].into()), &[])
}

/// One effect of every kind of law. Lags are left out, because their state at the start of the stream is not on the line. The warm-up is left out,
/// because its exponential comes from the PC's library here and may differ from the device's in the last bit.
fn with_effects() -> Vec<u8> {
    let effects = [
        DeviceEffect::named(
            "gyro_g_sensitivity",
            &[2e-4, 0.0, 1e-4, 0.0, -3e-4, 0.0, 5e-5, 0.0, 2e-4],
            None,
        ),
        DeviceEffect::named("gyro_scale_cubic", &[1e-3, -2e-3, 1e-3], None),
        DeviceEffect::named("gyro_thermal_bias", &[1e-4; 6], None),
        DeviceEffect::named("accel_scale_quadratic", &[2e-4, 1e-4, -3e-4], None),
        DeviceEffect::named(
            "accel_size_effect",
            &[4e-3, 1e-3, -2e-3, 0.0, 3e-3, 1e-3, -1e-3, 2e-3, 4e-3],
            None,
        ),
        DeviceEffect::term(Sensor::Accel, 0, 1e-5, &[Variable::Time]),
        DeviceEffect::term(Sensor::Accel, 1, 1e-3, &[Variable::RateX, Variable::ForceY]),
    ]
    .map(|effect| effect.expect("its numbers make sense"));
    stored(&[20.0, 30.0, 40.0], None, &effects)
}

/// A trace.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Trace {
    /// Bytes of the line, from the device.
    pub wire: Vec<u8>,
    /// Bytes of the calibration.
    pub calibration: Vec<u8>,
}

fn path(name: &str, end: &str) -> PathBuf {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/traces");
    PathBuf::from(folder).join(format!("{name}.{end}"))
}

impl Trace {
    /// Reads a stored trace.
    ///
    /// # Panics
    ///
    /// If there is none.
    pub fn read(name: &str) -> Self {
        let bytes = |end| {
            let path = path(name, end);
            fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
        };
        Self {
            wire: bytes("wire"),
            calibration: bytes("calibration"),
        }
    }

    /// Stores it.
    pub fn write(&self, name: &str) {
        fs::write(path(name, "wire"), &self.wire).unwrap();
        fs::write(path(name, "calibration"), &self.calibration).unwrap();
    }
}

impl Step {
    /// Has the release image carry it out on the emulated board.
    pub fn record(&self) -> Trace {
        let head = "format = \"mimu-plan/1\"\ndevice = \"unit-007\"\nsample_rate_hz = 1000.0\n\
                    latitude_deg = 30.5\ngravity_mps2 = 9.793\n";
        let plan = Plan::parse(Source::new(self.name, format!("{head}{}", self.plan))).unwrap();
        let rig = concat!(env!("CARGO_MANIFEST_DIR"), "/../../rig/rigs/fang.toml");
        let truth = RigTruth::resolve(&RigFile::read(rig.as_ref()).unwrap(), 7).unwrap();
        // The motion begins with the second start, when the calibration is stored.
        let rest = Front::Still(Volts::GROUND);
        let mut device = Conversation::new(Board::new(&image(), rest).unwrap());
        device.greeting();
        let calibration = (self.calibration)();
        device.upload(&calibration);
        assert_eq!(device.ask(Request::UploadCommit), Answer::Done);
        device.board.reset_by_pin(1).unwrap();
        let began = device.board.state().ns;
        let front = Front::bench(&plan, &truth, 7).unwrap().begun_at(began);
        device.board.set_front(front).unwrap();
        device.greeting();
        device.run_for(STARTED);
        device.kept = Some(Vec::new());
        // Asks for the time since power-on, on which the effects depend.
        device.ask(Request::Hello);
        let stream = Request::Stream {
            raw: true,
            compensated: !self.banks,
        };
        let (count, ms, pause_ms) = self.stretches;
        for _ in 0..count {
            assert_eq!(device.ask(stream), Answer::Done);
            if self.banks {
                start_banks(&mut device);
            }
            device.run_for(ms * MS);
            assert_eq!(device.ask(Request::Stop), Answer::Done);
            device.run_for(pause_ms * MS);
        }
        assert_eq!(device.lost, (0, 0));
        Trace {
            wire: device.kept.take().unwrap(),
            calibration,
        }
    }
}

fn start_banks(device: &mut Conversation) {
    // Waits for a batch before the first sample that a bank processes.
    device.run_for(2 * BATCH as u64 * MS);
    for (i, sensor) in Sensor::BOTH.into_iter().enumerate() {
        let prior = Prior::Diffuse { span: SPANS[i] };
        let start = Request::KalmanStart {
            sensor,
            noise: NOISE,
            prior,
        };
        assert_eq!(device.ask(start), Answer::Done);
        let input = Some(INPUTS[i]);
        assert_eq!(
            device.ask(Request::KalmanInput { sensor, input }),
            Answer::Done
        );
    }
}
