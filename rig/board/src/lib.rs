//! The emulated board: the release image of the firmware, unmodified, on an emulated NUCLEO-H743ZI2 with the
//! bench's physics in front of its pins.
//!
//! The emulator is the crate `rigless`. The bench adds:
//!
//! | module        |                                                                               |
//! |---------------|-------------------------------------------------------------------------------|
//! | [`schematic`] | what is wired to which pin                                                    |
//! | [`front`]     | voltages at the converter's pins at any time                                  |
//! | [`sampler`]   | the converter, which gets the voltages at the time of each conversion         |
//! | [`inertial`]  | a digital sensor, which gets the unit's state at the time of each sample      |
//! | [`flash`]     | what is being written, and the contents after a cut of the supply             |
//! | `watchdog`    | a model that the emulator lacks                                               |
//! | `line`        | the serial line                                                               |
//! | [`image`]     | the ELF file                                                                  |
//! | [`fault`]     | an instruction that differs from the image                                    |
//! | [`findings`]  | the emulator's findings about the firmware                                    |
//! | [`running`]   | a board that runs: time, bytes, supply, reset, counters                       |
//! | [`serve`], [`terminal`], `port` | the same behind a pseudo-terminal                            |
//! | [`commanded`] | the same in a thread, under command                                         |
//! | `control`, `interference` | commands over TCP; garbled bytes                                  |

pub mod commanded;
mod control;
mod driver;
pub mod fault;
pub mod findings;
pub mod flash;
pub mod front;
pub mod image;
pub mod inertial;
mod interference;
mod line;
mod memory;
mod part;
mod port;
pub mod running;
pub mod sampler;
pub mod schematic;
pub mod serve;
pub mod terminal;
mod watchdog;
