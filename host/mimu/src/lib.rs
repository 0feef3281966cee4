//! Calibration of inertial units, digital or analog: biases, scale factors, angles, noise, and the effect behind what then still errs.
//!
//! | to | use |
//! |---|---|
//! | read a recording, or make one from arrays | [`Recording`]; [`Manifest`] and [`Samples`]; [`Prepared`] finds the dwells |
//! | calibrate | [`fit`]: a [`Fit`] with a [`SensorFit`] for gyro and accelerometer, held-out errors, and its [`Judgement`] |
//! | keep a calibration, and use it | [`Calibration`], [`apply`] |
//! | judge a calibration by another recording | [`verify`]: a [`Verification`] |
//! | find the physical effect behind a residual | [`diagnose`]: a [`Diagnosis`] of [`Recordings`], with the effects as [`FittedEffect`] |
//! | know the noise of a unit at rest | [`allan`]: a [`Survey`], kept as a [`NoiseFile`] |
//! | design an experiment | [`DesignProblem`] |
//!
//! Rates are in rad/s, specific forces in m/s² (at rest they point up), temperatures in °C, times in s. *Inverse* is raw to SI, *forward* SI to raw.
//! An [`Error`] names the thing, what is wrong and what to do. The modules below these items are hidden here; they may change at any time.
//!
//! Calibrate a recording from arrays, and apply the calibration to a reading:
//!
//! ```
//! use mimu::{Angles, DwellSearch, Manifest, Options, Prepared, RawUnit, Reference, Samples, Sensor, fit};
//!
//! // An accelerometer of 300 mV/g with a bias of 1.65 V, held for two seconds in each of twelve poses, 100 samples a second.
//! let g = 9.80665;
//! let mut samples = Samples::default();
//! let noise = |k: usize| 1e-4 * ((k as f64 * 0.618_034).fract() - 0.5);
//! for pose in 0..12 {
//!     let (z, turn) = (1.0 - (2 * pose + 1) as f64 / 12.0, 2.4 * pose as f64);
//!     let across = (1.0 - z * z).sqrt();
//!     let up = [across * turn.cos(), across * turn.sin(), z];
//!     for k in 0..200 {
//!         samples.t_s.push(samples.t_s.len() as f64 / 100.0);
//!         samples.step.push(pose);
//!         for axis in 0..3 {
//!             let volts = 1.65 + 0.3 * up[axis] + noise(3 * samples.t_s.len() + axis);
//!             samples.raw[3 + axis].push(volts); // gyro x, y, z stand before it
//!         }
//!     }
//! }
//! let manifest = Manifest::new("my unit", 100.0, g, RawUnit::Volt, Reference::Gravity);
//! let options = Options::default();
//!
//! let prepared = Prepared::of(manifest, &samples, DwellSearch::default())?; // its dwells are found
//! assert_eq!(prepared.dwells.list.len(), 12);
//! let fitted = fit(prepared, options)?;
//! let accel = fitted.sensor(Sensor::Accel).unwrap();
//! let scale = accel.estimated.triad.physical(Angles::Exact).scale[0];
//! assert!((scale.value - 0.3 / g).abs() < scale.interval); // V/(m/s²), with its 95 % interval
//! let force = accel.estimated.triad.inverse.apply(&mimu::nalgebra::Vector3::new(1.65, 1.65, 1.95));
//! assert!((force.z - g).abs() < 0.01);
//!
//! let file = mimu::Calibration::of(&fitted, &[], "2026-01-01T00:00:00Z")?.to_toml();
//! assert!(file.contains("direction = \"raw to SI\""));
//! # Ok::<(), mimu::Error>(())
//! ```
//!
//! `Cargo.toml` needs this crate alone: `mimu = { path = "mimu/host/mimu" }`. Vectors and matrices are those of [`nalgebra`].

#[doc(hidden)]
pub mod bias_removal;
#[doc(hidden)]
pub mod calibration;
#[doc(hidden)]
pub mod data_sheet;
#[doc(hidden)]
pub mod diagnose;
#[doc(hidden)]
pub mod diagnosed;
#[doc(hidden)]
pub mod effects;
#[doc(hidden)]
pub mod estimate;
#[doc(hidden)]
pub mod factor;
mod fault;
#[doc(hidden)]
pub mod fit;
#[doc(hidden)]
pub mod in_use;
#[doc(hidden)]
pub mod judge;
#[doc(hidden)]
pub mod judgement;
mod judging;
#[doc(hidden)]
pub mod noise;
#[doc(hidden)]
pub mod observable;
#[doc(hidden)]
pub mod observation;
#[doc(hidden)]
pub mod one_unit;
#[doc(hidden)]
pub mod parameter;
#[doc(hidden)]
pub mod plan;
#[doc(hidden)]
pub mod pose_means;
#[doc(hidden)]
pub mod prepared;
#[doc(hidden)]
pub mod prior;
#[doc(hidden)]
pub mod quantity;
#[doc(hidden)]
pub mod readable;
#[doc(hidden)]
pub mod recording_problem;
#[doc(hidden)]
pub mod result;
#[doc(hidden)]
pub mod sessions;
#[doc(hidden)]
pub mod signal;
#[doc(hidden)]
pub mod spun;
#[doc(hidden)]
pub mod survey;
mod toml_layout;
#[doc(hidden)]
pub mod triad;
#[doc(hidden)]
pub mod turntable;
#[doc(hidden)]
pub mod unseen;
#[doc(hidden)]
pub mod variance_search;
#[doc(hidden)]
pub mod warning;

pub use calibration::Calibration;
pub use calibration::apply::{Applied, apply};
pub use calibration::verify::{SensorVerification, Verification, verify};
pub use diagnose::decision::Accepted;
pub use diagnose::{Diagnosis, Recordings, SensorDiagnosis, Verdict, diagnose};
pub use effects::effect::Effect;
pub use effects::fitted::FittedEffect;
pub use fit::{Fit, Options, Residual, SensorFit, Split, fit, fit_biases};
pub use judgement::{Judgement, JudgementKind};
pub use judging::known_size;
pub use mimu_core::PerSensor;
pub use mimu_core::compensation::Affine;
pub use mimu_recording::{
    Batch as Samples, Error, Manifest, RawUnit, Recording, Reference, SampleFormat, Turntable,
};
pub use nalgebra;
pub use noise::noise_file::NoiseFile;
pub use plan::Plan;
pub use plan::design::Problem as DesignProblem;
pub use plan::design::reach::Fixture;
pub use prepared::Prepared;
pub use quantity::Sensor;
pub use signal::stillness::DwellSearch;
pub use survey::{Options as AllanOptions, Part, Survey, survey as allan};
pub use triad::{Angles, Estimate, Forward, Physical, Triad};
pub use warning::Warning;

// What the other crates of the host use of the modules above.
#[doc(hidden)]
pub use {
    calibration::body::BodyTriad,
    data_sheet::DataSheet,
    parameter::{ParameterKind, TriadParameter},
    prior::Prior,
    quantity::{AXES, Figure, duration, normal_gravity, plural, plus_minus, significant},
    readable::{Readable, STANDARD_GRAVITY},
    recording_problem::OfRecording,
    result::{diagnosis::DiagnosisResult, fit::FitResult},
    signal::dwell::Dwell,
};
