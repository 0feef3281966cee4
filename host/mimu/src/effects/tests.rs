use mimu_core::effects::DeviceEffect;

use super::effect::{OnDevice, Scope};
use super::quantity::Quantity;
use super::regressor::{Product, Regressor};
use super::*;
use crate::quantity::AXES;

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
    let lines: Vec<String> = all().map(table_line).collect();
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

/// The line of an effect in the table of docs/effects.md.
fn table_line(effect: &Effect) -> String {
    // Coefficients of the axes with the same law share one formula; those of a matrix are distinguished by the other axis.
    let formulas = effect.coefficients.iter().map(|c| {
        let formula = formula(&c.regressor);
        match c.scope {
            Scope::Recording => {
                format!("{formula} (specific to the session: neither written nor removed)")
            }
            _ => formula,
        }
    });
    let units = effect.of_unit().map(|c| c.unit(effect.sensor));
    let parameter = effect.parameter.map_or(String::new(), |p| {
        format!("; τ from {} to {} s", p.from, p.to)
    });
    let units = match each_once(units) {
        none if none.is_empty() => vec![effect.coefficients[0].unit(effect.sensor)],
        units => units,
    };
    let device = match effect.on_device() {
        OnDevice::Never if effect.is_error() => "never: it is specific to a session",
        OnDevice::Never => "never: it is a true input",
        OnDevice::EverySample => "with every sample",
        OnDevice::Folded => "when temperature or time changes",
    };
    let lasting = effect.coefficients.iter();
    format!(
        "| `{}` | {} | {}{parameter} | {} in {} | {} | {device} | {} | {} |",
        effect.id,
        effect.about,
        each_once(formulas).join("; "),
        lasting.filter(|c| c.scope != Scope::Recording).count(),
        units.join(", "),
        effect.size,
        effect.needs,
        effect.taken_for
    )
}

fn each_once(all: impl Iterator<Item = String>) -> Vec<String> {
    all.fold(Vec::new(), |mut kept, one| {
        if !kept.contains(&one) {
            kept.push(one);
        }
        kept
    })
}

/// In the error of axis i.
fn formula(regressor: &Regressor) -> String {
    match regressor {
        Regressor::Product(p) => product(p),
        Regressor::Sum(a, b) => {
            let sign = |p: &Product, plus: &'static str| if p.sign < 0.0 { "-" } else { plus };
            let (first, then) = (sign(a, ""), sign(b, "+"));
            format!("{first}{} {then} {}", product(a), product(b))
        }
        Regressor::Absolute(q) => format!("abs {}", symbol(*q)),
        Regressor::Decay(q) => format!("exp(-{}/τ)", symbol(*q)),
        Regressor::Logarithm(q) => format!("ln(1 + {}/τ)", symbol(*q)),
        Regressor::Since { .. } => "a jump is no effect".into(),
    }
}

fn product(of: &Product) -> String {
    let power = |p: u8| ["", "", "²", "³", "⁴", "⁵"][usize::from(p)];
    let each = of.parts().map(|(q, p)| symbol(q) + power(p));
    each.collect::<Vec<_>>().join(" ")
}

fn symbol(of: Quantity) -> String {
    match of {
        Quantity::Rate(i) => format!("ω_{}", AXES[i]),
        Quantity::Force(i) => format!("f_{}", AXES[i]),
        Quantity::Temperature => "ΔT".into(),
        Quantity::TemperatureRate => "dT/dt".into(),
        Quantity::Time | Quantity::SessionTime => "t".into(),
        Quantity::TemperatureLag => "(T behind a lag - T)".into(),
        Quantity::RecordingTime => "t in the first recording".into(),
        Quantity::Input => "s_i".into(),
        Quantity::InputAlong(i) => format!("s_{}", AXES[i]),
        Quantity::AngularAcceleration(i) => format!("α_{}", AXES[i]),
        Quantity::Up => "up_i".into(),
        Quantity::RateMagnitude => "‖ω‖".into(),
    }
}
