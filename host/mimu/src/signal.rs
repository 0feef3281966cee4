//! From samples to the dwells and turns that a calibration is made of.

pub mod bias_removal;
pub mod blocks;
pub(crate) mod contrast;
pub(crate) mod course;
pub mod dwell;
pub mod increment;
pub(crate) mod no_temperature;
pub mod quantisation_step;
pub mod rails;
pub(crate) mod ramp;
pub mod rest;
pub mod signed_low_byte;
pub(crate) mod slow_turns;
pub mod stillness;
pub(crate) mod unit_in_si;
