//! Curves over temperature from recordings of a unit with known curves, and recordings that are refused.

mod at_rest;
mod base;
#[allow(dead_code)] // the studies use the rest
#[path = "../../../../tests/thermal/classic.rs"]
mod classic;
mod coverage;
mod estimates;
mod judged;
mod plan;
#[path = "../../../../tests/thermal/points.rs"]
mod points;
mod refused;
#[path = "../../../../tests/thermal/simulation.rs"]
mod simulation;
#[path = "../../../../tests/thermal/soak.rs"]
mod soak;
mod soaked;

use mimu::prepared::Prepared;
use mimu::signal::stillness::STILL_FACTOR;
use mimu::{Manifest, Samples};
use mimu_thermal::session::Session;

/// A session as a user's recording becomes one.
fn session((manifest, samples): (Manifest, Samples)) -> Result<Session, mimu::Error> {
    Session::of(&Prepared::of(manifest, &samples, STILL_FACTOR)?)
}

/// Checks that `text` contains all these words.
#[track_caller]
pub fn says(text: &str, words: &[&str]) {
    for word in words {
        assert!(text.contains(word), "{word:?} is not in: {text}");
    }
}
