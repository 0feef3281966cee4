//! Deviations, intervals and models against published results and against noise made by other code.

mod model;
mod spectrum;
mod vectors;
