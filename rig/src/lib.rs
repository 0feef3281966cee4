//! The virtual bench: inertial units with known truth, and what moves and heats them.
//!
//! Physics from datasheets and kinematics, so that estimators can be judged by it. It shares no model code with them.
//!
//! | the experiment                 |                                                                   |
//! |--------------------------------|-------------------------------------------------------------------|
//! | [`motion`], [`rotation`]       | what passes from a carrier to the sensors                         |

pub mod motion;
pub mod random;
pub mod rotation;
