//! Curves over temperature of an inertial unit, and the lag of its dies behind the thermometer.
//!
//! | in order of use | what |
//! |---|---|
//! | [`thermometer`] | the thermometer of a recording, and the temperature of a die that follows it |
//! | [`excitation`] | whether inputs distinguish all parameters |
//! | [`session`] | a recording as means of some seconds with their known input |
//! | [`coverage`], [`used`] | how much of the recordings is used |
//! | [`basis`] | the functions of temperature that a curve is a sum of |
//! | [`regression`] | the readings of a triad as a linear regression |
//! | [`smoothness`], [`noise`] | its variance components: how smooth the curves are, how the readings are disturbed |
//! | [`profile`] | likelihood of the lag |
//! | [`suitability`] | recordings that are refused |
//! | `evaluator`, [`joint`] | one triad at any lag; both, and their lags: the estimate |
//! | [`curves`], [`nodes`] | its result at any temperature, and in a calibration file |
//! | [`base`], [`biases`] | curves of the biases, added to a calibration at one temperature, and alone |
//! | [`path`] | whether a recording returns to earlier temperatures |
//! | [`judge`] | errors of dwells, by temperature, separately for heating and cooling |
//! | [`mod@fit`], [`extrapolation`] | curves, judged; whether there is curvature at all |
//! | [`judgement`] | the judgement of such a fit |
//! | [`plan`] | procedures in chamber and table, and how well the curves are known afterwards |
//! | [`result`] | the result, as written to JSON |
//! | [`warning`] | warnings for people |

pub mod base;
pub mod basis;
pub mod bias_jumps;
pub mod biases;
pub mod coverage;
pub mod curves;
mod earth;
mod evaluator;
pub mod excitation;
pub mod extrapolation;
pub mod fit;
pub mod joint;
pub mod judge;
pub mod judgement;
pub mod nodes;
pub mod noise;
pub mod path;
pub mod plan;
pub mod profile;
mod reference_error;
pub mod regression;
pub mod result;
pub mod row;
pub mod session;
pub mod smoothness;
pub mod suitability;
pub mod thermometer;
pub mod used;
pub mod warning;
