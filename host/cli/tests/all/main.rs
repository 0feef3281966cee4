//! The command, from its arguments to its exit status.

mod accept;
mod allan_command;
mod bad_input;
mod biases_at_rest;
mod body_command;
mod certificate;
mod command;
mod design_command;
mod design_with_a_prior;
mod device;
mod diagnosis_page;
mod diagnosis_text;
mod doubtful_input;
mod effects;
mod export_over_temperature;
mod first_minutes;
mod fuzz;
mod import_command;
mod manual;
mod over_temperature;
mod pocket_calculator;
mod random;
mod readme;
mod thermal_plan_command;
mod thermal_record_command;
mod wizard;
