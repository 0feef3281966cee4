//! Estimators and designs against answers that come from elsewhere.

mod allan_model;
mod allan_vectors;
mod comparison;
mod design;
mod held_out;
mod lever_arm;
mod moving_input;
mod off_level;
mod over_temperature;
mod spectrum;
mod written_files;
