//! An analog inertial unit on an STM32H743: sampled at exactly 1 kHz, compensated, streamed, calibrated.
//!
//! | module                | what it is                                                       |
//! |-----------------------|------------------------------------------------------------------|
//! | [`board`]             | pins, clocks, converter's timing, line, flash sectors: one file a board |
//! | [`design_parameters`] | sensors, front end and timing, each constant with its reason     |
//! | [`channels`]          | the channels of a sample, and their order in a scan              |
//! | [`convert`]           | sums of converter codes, and what they stand for                 |
//! | [`temperature`]       | which of the gyros' TEMP pins count                              |
//! | [`front_end`]         | what a calibration is tied to: the converter's factors, the TEMP pins' offsets |
//! | [`pipeline`]          | what happens to a sample: compensation, batches, Kalman banks    |
//! | [`bank`]              | a Kalman bank that is given its input and fed from the stream     |
//! | [`upload`]            | a calibration on its way to the device                           |
//! | [`slots`]             | where calibrations are kept, safe against a failing supply       |
//! | `adc`                 | the converter's driver, the only place with its registers        |
//! | `flash`               | the same of the flash memory                                     |
//! | `sampling`            | the task that takes samples, above all others                    |
//! | `link`                | the line to the host: serial, or USB                             |
//! | `commands`            | what the host asks, and what it is answered                      |
//! | [`self_test`]         | what the sensors make of their test inputs, against their data sheets |
//! | `supply`              | the supply, by the part's internal reference                     |
//! | `restart`             | why the device started, and the record that a panic leaves       |
//!
//! Those with links compile for the PC as well and are tested there.
#![no_std]

#[cfg(target_os = "none")]
pub mod adc;
pub mod bank;
pub mod board;
pub mod channels;
#[cfg(target_os = "none")]
pub mod commands;
pub mod convert;
pub mod design_parameters;
#[cfg(target_os = "none")]
pub mod flash;
pub mod front_end;
#[cfg(target_os = "none")]
pub mod link;
pub mod pipeline;
#[cfg(target_os = "none")]
pub mod restart;
#[cfg(target_os = "none")]
pub mod sampling;
pub mod self_test;
pub mod slots;
#[cfg(target_os = "none")]
pub mod supply;
pub mod temperature;
pub mod upload;
