//! The wizard: from an uncalibrated board to a verified one. It says what to do, watches whether that was done, fits after every dwell,
//! and stores only what kept its promise in poses that were not used.
//!
//! What turns and warms the unit is [`mimu_equipment`].
//!
//! | module | what it is |
//! |---|---|
//! | [`procedure`] | what is asked of a session; the steps to begin with, the next best one, those that verify |
//! | [`source`], [`device`] | where samples come from |
//! | [`text`], [`text_line`], [`regular`] | a board of another maker: its bytes, its lines, and their times as a regular rate |
//! | [`text_port`], [`relay`] | its port: read by a thread, or held by a caller who relays the bytes |
//! | [`station`] | a unit at the end of its line; a port with a separate thread, reopened when it has vanished |
//! | [`turn`] | a session pauses where it has to wait, and its caller resumes it |
//! | [`waiting`] | why no dwell runs |
//! | [`watch`] | is the unit still, which way is up, how fast does it turn |
//! | [`refit`] | the calibration so far, every parameter beside its target |
//! | [`folder`] | the journal and the recordings, from which a killed session resumes |
//! | [`unit_session`] | one of the units: its dwells, accepted or discarded |
//! | [`axes`] | whether the axes are those that their names say |
//! | [`bank`] | the device's own Kalman filters beside it |
//! | [`event`] | events and questions of a session; views show them |
//! | [`wizard`] | the next dwell, and the units that have completed it |
//! | [`store`] | into the device, back, and over a loss of the supply |
//! | [`verdict`] | whether a calibration keeps what it promises |
//! | [`resumed`] | settings that a resumed session keeps |
//! | [`session`] | all of it, in order |

pub mod axes;
pub mod bank;
pub mod device;
pub mod event;
pub mod folder;
pub mod procedure;
pub mod refit;
pub mod regular;
pub mod relay;
pub mod resumed;
pub mod session;
pub mod source;
pub mod station;
pub mod store;
pub mod text;
pub mod text_line;
pub mod text_port;
pub mod turn;
pub mod unit_session;
pub mod verdict;
pub mod waiting;
pub mod watch;
pub mod wizard;
