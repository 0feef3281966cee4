//! The device's computations, shared with the PC: compensation of raw readings, removal of effects, and recursive estimation of a
//! calibration.
//!
//! | module           | what it is                                                        |
//! |------------------|-------------------------------------------------------------------|
//! | [`Sensor`], [`PerSensor`] | the two triads, and what there is of each                   |
//! | [`compensation`] | inverse model, raw to SI: `x = C u + o` for gyro and accelerometer |
//! | [`effects`]      | what the affine model lacks, removed sample by sample              |
//! | [`kalman`]       | bank of three four-state Kalman filters fed one scalar at a time  |
//! | [`table`]        | inverse models at several temperatures, and curves between them   |
//! | [`die`]          | temperature of the dies from that of the thermometer              |
//! | [`compensator`]  | all of these in their order: raw readings and a temperature in, SI out |
//! | [`single`]       | what runs with every sample, in single precision                   |
//! | [`triad`]        | what the readings of a triad are: unit, range, scale, filter       |
//! | [`stored`]       | all of this as bytes, for the device to keep                       |
//! | [`wire`]         | messages between device and host, and their frames                 |
//!
//! Everything is generic over `f32` (the target's floating-point unit) and `f64` (the PC), without
//! allocation, without `unsafe` and without a path to a panic. Parameters and state are different
//! types: a calibration is immutable and serves any number of streams.
#![no_std]

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

pub mod compensation;
pub mod compensator;
pub mod die;
pub mod effects;
pub mod kalman;
mod sensor;
pub mod single;
pub mod stored;
pub mod table;
pub mod triad;
pub mod wire;

pub use nalgebra::RealField;
pub use sensor::{PerSensor, Sensor, UnknownSensor};
