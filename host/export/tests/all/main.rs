//! Exports whose truth is the compiler, the device, or a published file.

mod body;
mod conventions;
mod judged;
mod lists;
mod noise_of_one_axis;
mod public_files;
mod read_back;
mod rust_source;
mod schema;
mod stream;
mod unit;
