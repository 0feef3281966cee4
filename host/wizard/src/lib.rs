//! The wizard: turns an uncalibrated board into a verified one. It requests each dwell, checks that it was carried out, fits after every dwell, and
//! stores a calibration only if poses that were not fitted confirm its accuracy.
//!
//! [`mimu_equipment`] moves the unit and changes its temperature.
//!
//! | module | contents |
//! |---|---|
//! | [`procedure`] | settings of a session; the first dwells, the most informative next one, and those for the verification |
//! | [`source`], [`device`] | sources of samples |
//! | [`text`], [`text_line`], [`regular`] | a board of another maker: its bytes, its lines, and samples at a regular rate from them |
//! | [`clock`] | its clock, compared with the computer's |
//! | [`compass`] | its magnetometer: whether the field is that of the poses before |
//! | [`text_port`], [`relay`] | its port: read by a thread, or by a caller who relays the bytes |
//! | [`station`] | a unit and its line; a thread reads the port, and reopens it if it has vanished |
//! | [`turn`] | a session pauses when it has to wait, and its caller resumes it |
//! | [`waiting`] | reasons why no dwell runs |
//! | [`watch`] | detects from the samples whether the unit is at rest, its pose and its rate |
//! | [`spin`] | whole turns that are asked for |
//! | [`refit`] | the calibration so far, each parameter with its target |
//! | [`part`] | the recordings of a session |
//! | [`folder`] | the journal and the recordings, from which a killed session resumes |
//! | [`unit_session`] | one of the units, with its accepted and discarded dwells |
//! | [`axes`] | checks that the axes match their names |
//! | [`event`] | events and questions of a session; views show them |
//! | [`wizard`] | chooses the next dwell, and records which units have completed it |
//! | [`store`] | stores a calibration on the device, reads it back, and checks that it survives a power cycle |
//! | [`verdict`] | judges a calibration by poses that were not fitted |
//! | [`resumed`] | settings that a resumed session keeps |
//! | [`session`] | the whole session, in order |

pub mod axes;
pub mod clock;
pub mod compass;
pub mod device;
pub mod event;
pub mod folder;
pub mod part;
pub mod procedure;
pub mod refit;
pub mod regular;
pub mod relay;
pub mod resumed;
pub mod session;
pub mod source;
pub mod spin;
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
