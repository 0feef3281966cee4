//! The bench against closed forms, data sheets and its own page.
//!
//! One binary, because linking one for each subject took longer than running it.

mod body;
mod curves;
mod effects;
mod extremes;
mod flaws;
mod history;
mod motion;
mod noise;
mod page;
mod plan;
mod record;
mod rig_file;
mod sensors;
