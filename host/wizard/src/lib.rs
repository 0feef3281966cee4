//! The wizard: from an uncalibrated board to a verified one. It says what to do, watches whether that was done, fits after every dwell,
//! and stores only what kept its promise in poses that were not used.
//!
//! | module | what it is |
//! |---|---|
//! | [`step`] | a dwell that is wanted: which way is up, how fast it turns, how long |
//! | [`procedure`] | what is asked of a session; the steps to begin with, the next best one, those that verify |
//! | [`source`], [`device`] | where samples come from |
//! | [`text`], [`text_line`], [`regular`] | a board of another maker: what comes from it, its lines, and their times as a regular rate |
//! | [`text_port`], [`relay`] | its port: read by a thread, or held by somebody who relays what comes |
//! | [`station`] | a unit at the end of its line; a port with a thread of its own, opened again when it was gone |
//! | [`turn`] | a session pauses where it has to wait, and is gone on with from outside |
//! | [`waiting`] | why no dwell runs |
//! | [`watch`] | is the unit still, which way is up, how fast does it turn |
//! | [`refit`] | the calibration so far, every parameter beside its target |
//! | [`folder`] | the journal and the recordings, from which a killed session goes on |
//! | [`unit_session`] | one of the units: its dwells, accepted or discarded |
//! | [`axes`] | whether the axes are those that their names say |
//! | [`bank`] | the device's own Kalman filters beside it |
//! | [`drive`] | what turns and warms the unit: a person, or a table and a chamber that take text commands |
//! | [`carry_out`] | a procedure over temperature: chamber and table led through a plan, and one recording of it |
//! | [`event`] | what a session says and asks; views show it |
//! | [`wizard`] | which step comes next, and who has had it |
//! | [`store`] | into the device, back, and over a loss of the supply |
//! | [`verdict`] | whether a calibration keeps what it promises |
//! | [`resumed`] | what a session that goes on keeps |
//! | [`session`] | all of it, in order |

pub mod axes;
pub mod bank;
pub mod carry_out;
pub mod device;
pub mod drive;
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
pub mod step;
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
