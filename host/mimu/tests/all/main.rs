//! Estimators and designs against independently known answers.

mod applied_body;
mod comparison;
mod design;
mod held_out;
mod lever_arm;
mod moving_input;
mod off_level;
mod over_temperature;
mod segmentation;
mod written_files;
