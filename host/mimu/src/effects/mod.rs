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
mod tests {
    use mimu_core::effects::DeviceEffect;

    use super::effect::{OnDevice, Scope};
    use super::*;

    #[test]
    fn every_effect_is_there_once_and_belongs_to_its_sensor() {
        let mut ids: Vec<&str> = all().map(|e| e.id).collect();
        let count = ids.len();
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.len(), count);
        for effect in all() {
            assert!(effect.id.starts_with(effect.sensor.name()) || !effect.is_error());
            // The device takes the coefficients of the unit as a list, so they come first.
            let of_unit = effect
                .coefficients
                .iter()
                .map(|c| c.scope != Scope::Recording);
            assert!(of_unit.is_sorted_by(|a, b| a >= b), "{}", effect.id);
        }
    }

    #[test]
    fn the_limit_of_an_effect_is_a_simpler_effect_of_the_same_sensor_and_axes() {
        for effect in all() {
            let Some(limit) = effect.parameter.and_then(|p| p.limit) else {
                continue;
            };
            let limit = by_id(limit).expect(effect.id);
            assert_eq!(limit.sensor, effect.sensor, "{}", effect.id);
            assert!(limit.parameter.is_none(), "{}", effect.id);
            for coefficient in effect.of_unit() {
                let mut alike = limit.of_unit().filter(|c| c.axis == coefficient.axis);
                assert!(alike.next().is_some(), "{}", effect.id);
            }
        }
    }

    /// The lists and the device agree on how often an effect has to be evaluated.
    #[test]
    fn the_device_folds_what_moves_with_temperature_and_time_only() {
        for effect in all() {
            let numbers = vec![1e-3; effect.of_unit().count()];
            let parameter = effect.parameter.map(|p| p.from);
            let of_core = DeviceEffect::<f64>::named(effect.id, &numbers, parameter);
            match effect.on_device() {
                OnDevice::Never => assert!(of_core.is_err(), "{}", effect.id),
                how => {
                    let folded = of_core.map(|e| e.is_slow());
                    assert_eq!(folded, Ok(how == OnDevice::Folded), "{}", effect.id);
                }
            }
        }
    }

    #[test]
    fn every_effect_that_the_device_removes_has_a_bit_in_its_greeting() {
        let known = mimu_core::wire::EFFECTS;
        let removed = || all().filter(|e| e.on_device() != OnDevice::Never);
        for effect in removed() {
            let bit = known.iter().position(|id| *id == effect.id);
            let bit = bit.unwrap_or_else(|| {
                panic!(
                    "append it to EFFECTS in core/src/wire/greeting.rs:\n    \"{}\",",
                    effect.id
                )
            });
            let bits = mimu_core::wire::effects_of_this_build();
            assert!(
                bits & (1 << bit) != 0,
                "{}: core does not remove it",
                effect.id
            );
        }
        assert_eq!(known.len(), removed().count());
    }

    #[test]
    fn the_table_of_the_documentation_is_that_of_the_data() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/effects.md");
        let text = std::fs::read_to_string(path).expect("docs/effects.md");
        let head = "| id | physics | regressors | coefficients | size (source) | the device removes it | seen by | taken for |\n\
                    |---|---|---|---|---|---|---|---|\n";
        let lines: Vec<String> = all().map(Effect::table_line).collect();
        let missing: Vec<&str> = lines
            .iter()
            .map(String::as_str)
            .filter(|line| !text.lines().any(|l| l == *line))
            .collect();
        assert!(
            missing.is_empty(),
            "docs/effects.md lacks of its table, in the order of the lists of effects:\n\n{}\n",
            missing.join("\n")
        );
        let table = format!("{head}{}\n", lines.join("\n"));
        assert!(
            text.contains(&table),
            "docs/effects.md: all lines are there, but not one below the other in the order of the lists of effects, or with one too many"
        );
    }
}
