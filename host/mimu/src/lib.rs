//! Calibration of inertial units made of analog MEMS sensors.
//!
//! | in order of use | what |
//! |---|---|
//! | [`quantity`], [`readable`] | sensors, axes, SI units, and how numbers are written for people |
//! | [`signal`] | from samples to dwells and turns: blocks, rails, stillness, dwells; [`prepared`] is all of it for one recording |
//! | [`noise`] | how well a dwell mean is known; [`survey`] finds it from a recording at rest, by the Allan deviation of [`mimu_allan`] |
//! | [`estimate`], [`triad`] | the estimators, and what they estimate: both directions, covariances, physical quantities |
//! | [`mod@fit`] | both triads, judged on held-out data; impossible results are refused |
//! | [`judgement`], [`judge`] | the one judgement of every result, with its reason; the rules |
//! | [`calibration`] | the file; [`calibration::verify`] judges it by another recording, [`calibration::apply`] compensates one |
//! | [`effects`], [`diagnose`], [`mod@diagnosed`] | the effect behind a residual: found, added, proved on other data |
//! | [`plan`] | experiments: [`plan::design`] chooses attitudes, rates and times, [`plan::next_experiment`] what to record next |
//! | [`result`], [`warning`] | what the commands print and write as JSON |
//!
//! Calibrate a recording from arrays, and apply the calibration to a reading:
//!
//! ```
//! use mimu::{Manifest, Options, Prepared, RawUnit, Reference, Samples, Sensor, fit};
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
//! let prepared = Prepared::of(manifest, &samples, mimu::signal::stillness::STILL_FACTOR)?; // its dwells are found
//! assert_eq!(prepared.dwells.list.len(), 12);
//! let fitted = fit(prepared, options)?;
//! let accel = fitted.sensor(Sensor::Accel).unwrap();
//! let scale = accel.estimated.triad.physical(mimu::triad::Angles::Exact).scale[0];
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

pub mod bias_removal;
pub mod calibration;
pub mod diagnose;
pub mod diagnosed;
pub mod effects;
pub mod estimate;
mod fault;
pub mod fit;
pub mod judge;
pub mod judgement;
pub mod log_fault;
pub mod noise;
pub mod observable;
pub mod observation;
pub mod parameter;
pub mod plan;
pub mod pose_means;
pub mod prepared;
pub mod quantity;
pub mod readable;
pub mod recording_problem;
pub mod result;
pub mod signal;
pub mod survey;
mod toml_layout;
pub mod triad;
pub mod turntable;
pub mod warning;

pub use calibration::Calibration;
pub use fit::{Fit, Options, fit};
pub use judgement::{Judgement, JudgementKind};
pub use mimu_recording::error::Error;
pub use mimu_recording::{Batch as Samples, Manifest, RawUnit, Recording, Reference};
pub use nalgebra;
pub use prepared::Prepared;
pub use quantity::Sensor;
