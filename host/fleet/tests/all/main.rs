//! Fleets with known truth: what is found, and how often something is found that is not there.

mod files;
mod plant;
mod populations;
mod production;
