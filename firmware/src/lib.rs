//! An inertial unit on an STM32H743, of analog sensors or a digital one: sampled, compensated, streamed, calibrated.
//!
//! | module                | what it is                                                       |
//! |-----------------------|------------------------------------------------------------------|
//! | [`board`]             | pins, clocks, converter's timing, line, flash sectors: one file a board |
//! | [`design_parameters`] | sensors, front end and timing, each constant with its reason     |
//! | [`channels`]          | the channels of a sample, and their order in a scan              |
//! | [`source`]            | what a board measures with: integers, and what they mean         |
//! | [`chip`]              | what a driver of a digital sensor has to offer                   |
//! | [`digital`]           | a digital sensor as a source: polled, numbered by its stamps     |
//! | [`icm42688p`]         | the digital inertial sensor: registers, FIFO, self-test          |
//! | [`timebase`]          | times of a digital sensor's samples by the crystal               |
//! | [`convert`]           | the analog sensors as a source: sums of converter codes, and their conversion |
//! | [`temperature`]       | which of the gyros' TEMP pins are used                           |
//! | [`front_end`]         | state stored with a calibration: the converter's factors, the TEMP pins' offsets |
//! | [`pipeline`]          | from samples to the streams: compensation, batches, Kalman banks |
//! | [`bank`]              | a Kalman bank with its known input, fed from the stream           |
//! | [`upload`]            | an upload in progress                                            |
//! | [`slots`]             | stored calibrations, safe against a failing supply               |
//! | `board::adc`          | the converter's driver, the only place with its registers        |
//! | `spi`                 | the line to a digital sensor                                     |
//! | `flash`               | the same of the flash memory                                     |
//! | `sampling`            | the task that takes samples, with the highest priority           |
//! | `link`                | the line to the host: serial, or USB                             |
//! | `commands`            | requests of the host, and the answers                            |
//! | [`self_test`]         | responses of the sensors to their test inputs, compared with their data sheets |
//! | `supply`              | the supply, by the part's internal reference                     |
//! | `protection`          | detector of a low supply, option bytes, guard below the stack    |
//! | [`liveness`]          | whether a task that serves the host makes progress               |
//! | `restart`             | reset cause, and the record that a panic leaves                  |
//!
//! Those with links compile for the PC as well and are tested there.
#![no_std]

pub mod bank;
pub mod board;
#[cfg(not(feature = "matek-h743"))]
pub mod channels;
pub mod chip;
#[cfg(target_os = "none")]
pub mod commands;
#[cfg(not(feature = "matek-h743"))]
pub mod convert;
pub mod design_parameters;
pub mod digital;
#[cfg(target_os = "none")]
pub mod flash;
pub mod front_end;
pub mod icm42688p;
pub(crate) mod lag;
#[cfg(target_os = "none")]
pub mod link;
pub mod liveness;
pub mod pipeline;
#[cfg(target_os = "none")]
pub mod protection;
#[cfg(target_os = "none")]
pub mod restart;
#[cfg(target_os = "none")]
pub mod sampling;
#[cfg(not(feature = "matek-h743"))]
pub mod self_test;
pub mod slots;
pub mod source;
#[cfg(all(target_os = "none", feature = "matek-h743"))]
pub mod spi;
#[cfg(all(target_os = "none", not(feature = "matek-h743")))]
pub mod supply;
#[cfg(not(feature = "matek-h743"))]
pub mod temperature;
pub mod timebase;
pub mod upload;
