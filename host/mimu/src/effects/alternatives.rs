//! Laws that are no effect of the list, but that an effect of it may be the shadow of.
//!
//! An effect that explains the rows no better than such a law is accepted, as the error goes down all the same; but which physics it is,
//! this recording does not say, and the verdict says so.

use super::effect::{Coefficient, Effect, NonlinearParameter, Role, each};
use super::quantity::Quantity::{Force, Input, RateMagnitude, Time};
use super::regressor::Regressor;
use crate::quantity::Sensor;

/// A law and the effects that may be its shadow.
pub struct Alternative {
    /// The law, in the form of an effect that is on no list.
    pub law: Effect,
    /// Ids of the effects that may be its shadow.
    pub of: &'static [&'static str],
    /// What would tell them apart.
    pub settled_by: &'static str,
}

/// Mouldings and glue relax from seconds after power-on to minutes.
const ONSET: Option<NonlinearParameter> = Some(NonlinearParameter {
    name: "onset_s",
    from: 5.0,
    to: 200.0,
    role: Role::Scale,
});

const CREEP: [Coefficient; 3] = each(Regressor::Logarithm(Time), 1.0);

/// The vertical of the body axis of the same name.
const FIELD: [Coefficient; 3] = [
    Coefficient::of(0, "x", Regressor::linear(Force(0)), 1.0),
    Coefficient::of(1, "y", Regressor::linear(Force(1)), 1.0),
    Coefficient::of(2, "z", Regressor::linear(Force(2)), 1.0),
];

/// A supply that sags with the motor's current, or a bearing that shakes: known by no reading of the unit. But an axis reads the turns
/// about the others as well, by a few per cent, so that fine bits of its codes can tell them from rest.
const TURNING: [Coefficient; 9] = {
    let [x, y, z] = [
        Regressor::linear(RateMagnitude),
        Regressor::power(RateMagnitude, 2),
        super::effect::times(Input, RateMagnitude),
    ];
    [
        Coefficient::of(0, "x", x, 1.0),
        Coefficient::of(0, "x squared", y, 1.0),
        Coefficient::of(0, "x scale", z, 1.0),
        Coefficient::of(1, "y", x, 1.0),
        Coefficient::of(1, "y squared", y, 1.0),
        Coefficient::of(1, "y scale", z, 1.0),
        Coefficient::of(2, "z", x, 1.0),
        Coefficient::of(2, "z squared", y, 1.0),
        Coefficient::of(2, "z scale", z, 1.0),
    ]
};

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

const BY_HAND: &str = "the same rates from another supply, and turned by hand: errors of codes do not depend on what turns the unit";

const LONGER: &str =
    "a cold start recorded for several hours: an exponential ends, a logarithm does not";

static ALTERNATIVES: [Alternative; 5] = [
    Alternative {
        law: by_turning(Sensor::Gyro),
        of: &[
            "gyro_readout_code",
            "gyro_scale_asymmetry",
            "gyro_scale_quadratic",
        ],
        settled_by: BY_HAND,
    },
    Alternative {
        law: by_turning(Sensor::Accel),
        of: &["accel_readout_code", "accel_size_effect"],
        settled_by: BY_HAND,
    },
    Alternative {
        law: creep(Sensor::Gyro),
        of: &["gyro_warm_up", "gyro_thermal_lag"],
        settled_by: LONGER,
    },
    Alternative {
        law: creep(Sensor::Accel),
        of: &["accel_warm_up", "accel_thermal_lag"],
        settled_by: LONGER,
    },
    // Whatever field goes with the vertical, the Earth's magnetic one first of all, is felt along the axis alone; a proof mass
    // that sags is skew to some degree.
    Alternative {
        law: law(
            "vertical_field",
            Sensor::Gyro,
            "a field along the vertical, such as the Earth's magnetic field, sensed along each axis",
            &FIELD,
            None,
        ),
        of: &["gyro_g_sensitivity"],
        settled_by: "the same poses far from iron, or with a magnet near",
    },
];

/// Effects of the list that are one where the input along an axis is always the same, as in one pose: what the temperature does to a bias
/// and to a scale factor.
const ONE_AT_A_CONSTANT_INPUT: [[&str; 2]; 2] = [
    ["gyro_thermal_bias", "gyro_thermal_scale"],
    ["accel_thermal_bias", "accel_thermal_scale"],
];

/// The effect that `id` is the same as while its input is constant, if there is such a one.
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
