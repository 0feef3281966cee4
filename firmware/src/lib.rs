//! Sampling of an analog inertial unit by a NUCLEO-H743ZI2, at exactly 1 kHz.
//!
//! | module                | what it is                                                     |
//! |-----------------------|----------------------------------------------------------------|
//! | [`design_parameters`] | every electrical and timing constant, and why it is what it is |
//! | [`convert`]           | converter codes, their sums, and what they stand for           |
//! | `adc`                 | the converter's driver, the only place with its registers      |
//!
//! The first two compile for the PC as well and are tested there; the driver is for the target
//! only.
#![no_std]

#[cfg(target_os = "none")]
pub mod adc;
pub mod convert;
pub mod design_parameters;
