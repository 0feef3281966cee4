//! From samples to the dwells and turns that a calibration is made of.

pub mod bias_removal;
pub mod blocks;
pub(crate) mod change_point;
pub(crate) mod contrast;
pub(crate) mod course;
pub mod dwell;
pub(crate) mod dwells_of_files;
pub mod increment;
pub mod jump;
pub(crate) mod log_fault;
pub mod moments;
pub mod power_ons;
pub mod quantisation_step;
pub mod rails;
pub(crate) mod ramp;
pub(crate) mod rate_at_rest;
pub mod rest;
pub(crate) mod slow_turns;
pub mod stillness;
pub(crate) mod unit_in_si;
pub(crate) mod window;
