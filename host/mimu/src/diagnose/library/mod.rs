//! The effects that are known by name.
//!
//! Each stands here once, with its physics, regressors and what excites it; how the device removes it stands in `core`.

mod accel;
mod drift;
mod gyro;
pub mod readout;
pub mod rivals;
mod thermal;

use super::effect::{Coefficient, Effect, Scope};

/// All of them.
pub fn all() -> impl Iterator<Item = &'static Effect> {
    [
        &gyro::EFFECTS[..],
        &accel::EFFECTS[..],
        &drift::EFFECTS[..],
        &thermal::EFFECTS[..],
        &readout::EFFECTS[..],
    ]
    .into_iter()
    .flatten()
}

/// The effect of this name.
pub fn by_id(id: &str) -> Option<&'static Effect> {
    all().find(|e| e.id == id)
}

/// A coefficient of sensor axis `axis`.
const fn of(axis: usize, name: &'static str, unit: &'static str) -> Coefficient {
    Coefficient {
        name,
        axis: Some(axis),
        unit,
        scope: Scope::Unit,
    }
}

/// A coefficient of sensor axis `axis` that is of the recording alone.
const fn at_start(axis: usize, name: &'static str, unit: &'static str) -> Coefficient {
    Coefficient {
        scope: Scope::Recording,
        ..of(axis, name, unit)
    }
}

/// A coefficient of all axes.
const fn all_axes(name: &'static str, unit: &'static str) -> Coefficient {
    Coefficient {
        name,
        axis: None,
        unit,
        scope: Scope::Unit,
    }
}

/// One coefficient for each axis.
const fn each(unit: &'static str) -> [Coefficient; 3] {
    [of(0, "x", unit), of(1, "y", unit), of(2, "z", unit)]
}

/// A matrix by rows; rows are the sensor's axes.
const fn matrix(unit: &'static str) -> [Coefficient; 9] {
    [
        of(0, "xx", unit),
        of(0, "xy", unit),
        of(0, "xz", unit),
        of(1, "yx", unit),
        of(1, "yy", unit),
        of(1, "yz", unit),
        of(2, "zx", unit),
        of(2, "zy", unit),
        of(2, "zz", unit),
    ]
}

/// Regressors of one coefficient for each axis.
fn per_axis(out: &mut [f64], value: impl Fn(usize) -> f64) {
    for (i, out) in out.iter_mut().enumerate() {
        *out = value(i);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_is_there_once_and_says_the_size_of_each_coefficient() {
        let mut ids: Vec<&str> = all().map(|e| e.id).collect();
        let count = ids.len();
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.len(), count);
        for effect in all() {
            assert_eq!(
                effect.coefficients.len(),
                effect.typical.len(),
                "{}",
                effect.id
            );
            assert!(effect.id.starts_with(effect.sensor.name()) || !effect.is_error());
        }
    }
}
