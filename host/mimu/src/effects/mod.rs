//! Effects: the errors that an affine calibration lacks, by name, as data.
//!
//! | module | what |
//! |---|---|
//! | [`quantity`] | what an error can be a function of |
//! | [`regressor`] | products of powers, absolute values, decays: what an error is proportional to |
//! | [`effect`] | coefficients of regressors, with what excites and what removes them |
//! | `gyro`, `accel`, `drift`, `thermal` | the effects, one list each |
//! | [`alternatives`] | unlisted laws that may explain the same residuals as an effect |
//! | [`candidate`] | an effect, a product found from the data or a jump, with the choice of its coefficients |
//! | [`temperature`] | the temperature that an effect follows |
//! | [`fitted`] | an effect with its numbers: from the decision to the file, the result and the device |
//! | [`removal`] | removing effects from readings |
//!
//! A new effect needs one entry in one of the lists, one arm in `core`, which removes it, and one simulated truth in `rig`. Its quantities, its
//! units, how the device evaluates it and its line in docs/effects.md follow from the entry. Tests loop over [`all`] and report what is missing
//! elsewhere.

pub mod alternatives;
pub mod candidate;
pub mod effect;
pub mod fitted;
pub mod quantity;
pub mod regressor;
pub mod removal;
pub mod temperature;

mod accel;
mod drift;
mod gyro;
mod thermal;

use effect::Effect;

/// All of them, in the order of docs/effects.md.
pub fn all() -> impl Iterator<Item = &'static Effect> {
    static LISTS: &[&[Effect]] = &[
        gyro::EFFECTS,
        accel::EFFECTS,
        drift::EFFECTS,
        thermal::EFFECTS,
    ];
    LISTS.iter().copied().flatten()
}

/// The effect of this name.
pub fn by_id(id: &str) -> Option<&'static Effect> {
    all().find(|e| e.id == id)
}

#[cfg(test)]
mod tests;
