//! Deviations, intervals and models against published answers and noise that other code makes.

mod model;
mod spectrum;
mod vectors;
