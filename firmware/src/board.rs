//! The board: everything that another one would have different, and nothing else.
//!
//! # Another board
//!
//! A board with an STM32H743 is one file more, `board/<name>.rs`, written after [`nucleo_h743zi2`](self), and the two lines at the end
//! of this file that name it. It says
//!
//! | item                                        | what it is                                             |
//! |---------------------------------------------|--------------------------------------------------------|
//! | `NAME`                                      | name in the greeting                                   |
//! | `REFERENCE_V`                               | voltage at VREF+                                       |
//! | `ADC_HZ`, `SAMPLING_HALF_CYCLES`, `SCANS`   | timing of the converter, 1 kHz in all                  |
//! | `CALIBRATION_SECTORS`                       | flash sectors of bank 2 that hold calibrations         |
//! | `Irqs`                                      | interrupts of the peripherals that it hands out        |
//! | `Board`, `Board::start`                     | starts the clocks, and hands out pins and parts by name |
//!
//! Every other file is written against these names. `memory.x` says where the flash and RAM of the part are, and agrees with
//! `CALIBRATION_SECTORS`, which the firmware checks at its start. A board with another microcontroller also needs drivers in place of
//! `adc` and `flash`, which are written on the registers of this one.

mod nucleo_h743zi2;
pub use nucleo_h743zi2::*;
