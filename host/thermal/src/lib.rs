//! Curves over temperature of an inertial unit, and the lag of its dies behind the thermometer.
//!
//! | in order of use | what |
//! |---|---|
//! | [`thermometer`] | the thermometer of a recording, and the temperature of a die that follows it |
//! | [`session`] | a recording as means of some seconds with their known input |
//! | [`basis`] | the functions of temperature that a curve is a sum of |
//! | [`regression`] | the readings of a triad as a linear regression |
//! | [`smoothness`], [`noise`] | its variance components: how smooth the curves are, how the readings are disturbed |
//! | [`profile`] | likelihood of the lag |
//! | [`joint`] | all of these: the estimate |
//! | [`curves`] | its result at any temperature |
//! | [`plan`] | procedures in chamber and table, and how well the curves are known afterwards |

pub mod basis;
pub mod curves;
pub mod joint;
pub mod noise;
pub mod plan;
pub mod profile;
pub mod regression;
pub mod session;
pub mod smoothness;
pub mod thermometer;
