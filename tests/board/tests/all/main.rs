//! The firmware's release image on the emulated board.

mod board;
mod budget;
mod control;
mod front_end;
mod matek;
mod power;
mod restart;
mod serial;
mod terminal;
