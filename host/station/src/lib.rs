//! The test of a unit on a line of production: ten seconds at rest, against limits.
//!
//! | module | contents |
//! |---|---|
//! | [`gather`] | samples at rest: from a recording, or from a unit at a port |
//! | [`boards`] | several boards at their ports, measured together |
//! | [`scale`] | readings in SI: by a calibration, a range, or the board |
//! | [`rest`] | whether the unit was at rest; the means and their noise |
//! | [`bits`] | bits of the codes that never change, and runs of equal readings |
//! | [`noise`] | rms and density of the noise |
//! | [`rate`] | sample rate and lost samples, by the time stamps |
//! | [`quantity`], [`side`] | names and units of the quantities; sides of a unit |
//! | [`quantities`] | everything that is measured in one rest |
//! | [`faces`] | offsets and sensitivities from three sides up |
//! | [`measured`] | one measured quantity: value, unit, uncertainty |
//! | [`own_limit`], [`limits`] | the file of limits, and limits of data sheets |
//! | [`population`] | limits by the units of the same kind |
//! | [`decision`] | the decision about a value near its limit (JCGM 106) |
//! | [`document`] | the result, `mimu-measurements/1` |

pub mod bits;
pub mod boards;
pub mod decision;
pub mod document;
pub mod faces;
pub mod gather;
pub mod limits;
pub mod measured;
pub mod noise;
pub mod own_limit;
pub mod population;
pub mod quantities;
pub mod quantity;
pub mod rate;
pub mod rest;
pub mod scale;
pub mod side;
