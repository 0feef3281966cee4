//! Unlisted alternative models: laws that may explain the same residuals as a listed effect.
//!
//! If such a law explains the rows as well as an effect, the effect is still accepted, because it reduces the error. But the recording does not show
//! which of the two is the cause, and the verdict says so.

use super::effect::{Coefficient, Effect, NonlinearParameter, Role, each, matrix, times};
use super::quantity::Quantity::{Force, Input, RateMagnitude, Time};
use super::regressor::Regressor;
use crate::quantity::Sensor;

/// An unlisted law and the effects whose residuals it may explain.
pub struct Alternative {
    /// The law, written as an effect that is on no list.
    pub law: Effect,
    /// Ids of the effects whose residuals it may explain.
    pub of: &'static [&'static str],
    /// The experiment that would distinguish them.
    pub discriminating_experiment: &'static str,
}

/// Mouldings and glue relax from seconds after power-on to minutes.
const ONSET: Option<NonlinearParameter> = Some(NonlinearParameter {
    name: "onset_s",
    from: 5.0,
    to: 200.0,
    role: Role::Scale,
    limit: None,
});

const CREEP: [Coefficient; 3] = each(Regressor::Logarithm(Time), 1.0);

/// Each axis senses the specific force along the body axis of the same name.
const FIELD: [Coefficient; 3] = [
    Coefficient::of(0, "x", Regressor::linear(Force(0)), 1.0),
    Coefficient::of(1, "y", Regressor::linear(Force(1)), 1.0),
    Coefficient::of(2, "z", Regressor::linear(Force(2)), 1.0),
];

/// A supply that sags with the motor's current, or a bearing that shakes. The unit measures neither. But an axis also reads a few per cent of the
/// rates about the other axes, so the fine bits of its codes can distinguish turning from rest.
const TURNING: [Coefficient; 9] = matrix(
    [
        Regressor::linear(RateMagnitude),
        Regressor::power(RateMagnitude, 2),
        times(Input, RateMagnitude),
    ],
    1.0,
);

const fn law(
    id: &'static str,
    sensor: Sensor,
    about: &'static str,
    coefficients: &'static [Coefficient],
    parameter: Option<NonlinearParameter>,
) -> Effect {
    Effect {
        id,
        sensor,
        about,
        coefficients,
        parameter,
        size: "",
        needs: "",
        taken_for: "",
    }
}

const fn creep(sensor: Sensor) -> Effect {
    let about = "a bias that creeps with the logarithm of time";
    law("creep", sensor, about, &CREEP, ONSET)
}

const fn by_turning(sensor: Sensor) -> Effect {
    let about = "a bias and a scale factor that follow the magnitude of the rate";
    law("by_turning", sensor, about, &TURNING, None)
}

const BY_HAND: &str = "the same rates from another supply, and turned by hand: errors of the readings do not depend on what turns the unit";

const LONGER: &str =
    "a cold start recorded for several hours: an exponential ends, a logarithm does not";

static ALTERNATIVES: [Alternative; 5] = [
    Alternative {
        law: by_turning(Sensor::Gyro),
        of: &["gyro_scale_asymmetry", "gyro_scale_quadratic"],
        discriminating_experiment: BY_HAND,
    },
    Alternative {
        law: by_turning(Sensor::Accel),
        of: &["accel_size_effect"],
        discriminating_experiment: BY_HAND,
    },
    Alternative {
        law: creep(Sensor::Gyro),
        of: &["gyro_warm_up", "gyro_thermal_lag"],
        discriminating_experiment: LONGER,
    },
    Alternative {
        law: creep(Sensor::Accel),
        of: &["accel_warm_up", "accel_thermal_lag"],
        discriminating_experiment: LONGER,
    },
    // A field along the vertical, above all the Earth's magnetic field, acts on each axis only by its component along it. A proof mass that sags also
    // responds to some force across its axis.
    Alternative {
        law: law(
            "vertical_field",
            Sensor::Gyro,
            "a field along the vertical, such as the Earth's magnetic field, sensed along each axis",
            &FIELD,
            None,
        ),
        of: &["gyro_g_sensitivity"],
        discriminating_experiment: "the same poses far from iron, or with a magnet near",
    },
];

/// Effects that cannot be distinguished while the input along an axis is constant, as in one pose: temperature then changes the bias and the scale
/// factor alike.
const ONE_AT_A_CONSTANT_INPUT: [[&str; 2]; 2] = [
    ["gyro_thermal_bias", "gyro_thermal_scale"],
    ["accel_thermal_bias", "accel_thermal_scale"],
];

/// The effect that cannot be distinguished from `id` while the input is constant, if there is one.
pub fn one_at_a_constant_input(id: &str) -> Option<&'static str> {
    ONE_AT_A_CONSTANT_INPUT.iter().find_map(|[a, b]| match id {
        _ if id == *a => Some(*b),
        _ if id == *b => Some(*a),
        _ => None,
    })
}

/// Alternatives to the effect `id`.
pub fn alternatives(id: &str) -> impl Iterator<Item = &'static Alternative> {
    ALTERNATIVES.iter().filter(move |r| r.of.contains(&id))
}
