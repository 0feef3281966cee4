//! Calibration of inertial units made of analog MEMS sensors.
//!
//! | in order of use | what                                                                          |
//! |-----------------|-------------------------------------------------------------------------------|
//! | [`quantity`]    | sensors, axes, SI units, and how numbers are written                         |
//! | `no_temperature` | samples of the thermometer that are no temperatures                      |
//! | [`blocks`], [`increment`] | one pass over the samples condenses them to 0.1 s blocks and 10 ms integrals |
//! | [`rails`], [`stillness`], [`rest`], [`dwell`] | which samples and which stretches can be averaged           |
//! | `course`, `contrast` | a known input that moves within a dwell, and what the dwell then shows beside its mean |
//! | [`reading_step`] | the step that readings are multiples of                                       |
//! | [`signed_low_byte`] | a firmware that takes the low byte of a reading for a signed number        |
//! | [`noise`]       | how well a dwell mean is known                                                |
//! | [`observable`]  | what observations that share their noise are of                               |
//! | [`warning`]     | what a person should know of any of these, by kind                            |
//! | [`prepared`]    | all of these for one recording                                                |
//! | [`pose_means`]  | the same of a table of means, without samples                                 |
//! | [`estimate`]    | the estimators                                                                |
//! | [`triad`]       | calibration of one triad: both directions, covariances, physical quantities   |
//! | [`parameter`]   | the names and units of its parameters                                         |
//! | [`mod@fit`]     | both triads, judged on what they have not seen; what cannot be right is refused |
//! | [`calibration`], [`verify`] | the file, and judging it by another recording                     |
//! | [`mod@apply`]   | the recording that it compensates                                             |
//! | [`bias_cubic`]  | its biases over temperature as cubics, and the error that these leave         |
//! | [`diagnose`]    | the effect behind a residual: found, added, proved on other data              |
//! | [`design`]      | experiments: which attitudes and rates, how many, for how long                |
//! | [`next_experiment`] | what to record next, where a diagnosis leaves something open              |
//! | [`plan`]        | the file of an experiment, which a table or a person carries out              |
//! | [`chamber`]     | the course of a chamber in a plan                                             |
//! | [`allan`], [`survey`] | Allan deviation and noise model of a series; of the channels of a recording at rest |
//! | [`spectrum`]    | lines that are no noise of the sensor, and the band in which it is white     |
//! | [`noise_file`]  | its result for the other commands                                             |
//! | [`result`]      | what a fit, a verification and a survey found: one type each, which JSON is    |
//! | [`readable`]    | from SI to the units of data sheets                                           |

//!
//! A recording from arrays, calibrated, and the calibration applied to a reading:
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
//! let prepared = Prepared::of(manifest, &samples, options.still_factor)?; // its dwells are found
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

pub mod allan;
pub mod apply;
pub mod bias_cubic;
pub mod blocks;
pub mod calibration;
pub mod chamber;
mod contrast;
mod course;
pub mod design;
pub mod diagnose;
pub mod die_temperature;
pub mod dwell;
pub mod effects;
pub mod estimate;
mod fault;
pub mod fit;
pub mod increment;
pub mod next_experiment;
mod no_temperature;
pub mod noise;
pub mod noise_file;
pub mod observable;
pub mod parameter;
pub mod plan;
pub mod pose_means;
pub mod prepared;
pub mod quantity;
pub mod rails;
mod ramp;
pub mod readable;
pub mod reading_step;
pub mod rest;
pub mod result;
pub mod signed_low_byte;
mod slow_turns;
pub mod spectrum;
pub mod stillness;
pub mod survey;
mod toml_layout;
pub mod triad;
mod unit_in_si;
pub mod verify;
pub mod warning;

pub use calibration::Calibration;
pub use fit::{Fit, Options, fit};
pub use mimu_recording::error::Error;
pub use mimu_recording::{Batch as Samples, Manifest, RawUnit, Recording, Reference};
pub use nalgebra;
pub use prepared::Prepared;
pub use quantity::Sensor;
