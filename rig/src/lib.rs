//! The virtual bench: inertial units with known truth, and the equipment that moves and heats them.
//!
//! Physics from data sheets and kinematics, so that estimators can be judged by it; it shares no model code with them. `docs/bench.md` describes the
//! command and all keys of its files. The crate `mimu-board` puts the firmware on an emulated microcontroller behind the pins of such a unit.
//!
//! | the experiment                 |                                                                   |
//! |--------------------------------|-------------------------------------------------------------------|
//! | [`plan`], [`located`]          | PLAN.toml; error messages with the line                           |
//! | [`place`], [`field`]           | gravity and the Earth's rotation; the magnetic field              |
//! | [`table`], [`axis`]            | a turntable with its flaws                                        |
//! | [`hands`]                      | a person                                                          |
//! | [`flaws`]                      | flaws of real recordings                                          |
//! | [`command`]                    | commands to a table and a person, instead of a plan               |
//! | [`motion`], [`chain`], [`rotation`] | motion of the board, as the sensors get it                   |
//! | [`record`]                     | recordings in memory or as files                                  |
//!
//! | the unit                       |                                                                   |
//! |--------------------------------|-------------------------------------------------------------------|
//! | [`mod@unit`], [`sensor`], [`filter`] | from motion and chamber to the voltages at the pins         |
//! | [`body`]                       | triads beyond the first gyro and accelerometer                    |
//! | [`noise`], [`thermal`]         | disturbances of every sensor                                      |
//! | [`effects`]                    | errors that the affine model lacks, enabled one by one            |
//! | [`curves`]                     | each sensor over the temperature of its die                       |
//! | [`pins`], [`converter`]        | from the pins to the readings of a recording                      |
//! | [`history`]                    | what happened to a unit before a session                          |
//! | [`catalog`], [`rig_file`], [`refusal`] | sensors by their data sheets; RIG.toml, and the truth drawn by it |
//! | [`ideal`]                      | forward models of papers, for Monte Carlo studies                 |

pub mod axis;
pub mod body;
pub mod catalog;
pub mod chain;
pub mod command;
pub mod converter;
pub mod curves;
pub mod effects;
pub mod field;
pub mod filter;
pub mod flaws;
pub mod hands;
pub mod history;
pub mod ideal;
pub mod located;
pub mod motion;
pub mod noise;
pub mod pins;
pub mod place;
pub mod plan;
pub mod random;
pub mod record;
pub mod refusal;
pub mod rig_file;
pub mod rotation;
pub mod sensor;
pub mod table;
pub mod thermal;
pub mod unit;
