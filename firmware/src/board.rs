//! The board: everything that differs on another board, and only that.
//!
//! # Another board
//!
//! A board with an STM32H743 needs one more file, `board/<name>.rs`, modelled on `nucleo_h743zi2.rs` for analog sensors and on
//! `matek_h743.rs` for a digital one, a feature in `Cargo.toml`, and the lines at the end of this file that name it. The file defines
//!
//! | item                                        | what it is                                             |
//! |---------------------------------------------|--------------------------------------------------------|
//! | `NAME`                                      | name in the greeting                                   |
//! | `REFERENCE_V`                               | voltage at VREF+                                       |
//! | `ADC_HZ`, `SAMPLING_HALF_CYCLES`, `SCANS`   | for analog sensors: timing of the converter, 1 kHz in all |
//! | `CALIBRATION_SECTORS`                       | flash sectors of bank 2 that hold calibrations         |
//! | `Source`, `Acquisition`, `Sensors`          | its sensors: what their integers mean, what takes them, and what it is made from |
//! | `SelfTest`, `CAPABILITIES`                  | what the self-test needs, and whether there is one     |
//! | `Irqs`                                      | interrupts of the peripherals that it hands out        |
//! | `Board`, `Board::start`                     | starts the clocks, and hands out pins and parts by name |
//!
//! All other files use these names. `memory.x` gives the addresses of flash and RAM, and has to agree with `CALIBRATION_SECTORS`; the
//! firmware checks this at its start. A board with another microcontroller also needs drivers instead of `board::adc` and `flash`, which use the
//! registers of this one.

#[cfg(all(target_os = "none", not(feature = "matek-h743")))]
pub mod adc;
pub mod clocks;

#[cfg(feature = "matek-h743")]
mod matek_h743;
#[cfg(feature = "matek-h743")]
pub use matek_h743::*;
#[cfg(not(feature = "matek-h743"))]
mod nucleo_h743zi2;
#[cfg(not(feature = "matek-h743"))]
pub use nucleo_h743zi2::*;
