//! Laws that are no effect of the list, but that an effect of it may be the shadow of.
//!
//! An effect that explains the rows no better than such a law is accepted, as the error goes down all the same; but which physics it is,
//! this recording does not say, and the verdict says so.

use super::{each, per_axis};
use crate::diagnose::effect::{Coefficient, Effect, Form, FormKind};
use crate::dwell::Sensor;

const GYRO_CREEP: [Coefficient; 3] = each("rad/s");
const ACCEL_CREEP: [Coefficient; 3] = each("m/s^2");
const VERTICAL_FIELD: [Coefficient; 3] = each("rad/s/(m/s^2)");

/// Mouldings and glue relax from seconds after power-on to minutes.
const ONSET: Option<Form> = Some(Form {
    name: "onset_s",
    from: 5.0,
    to: 200.0,
    kind: FormKind::Free,
});

/// A law and the effects that it rivals.
pub struct Rival {
    /// The law, in the form of an effect that is on no list.
    pub law: Effect,
    /// Ids of the effects that may be its shadow.
    pub of: &'static [&'static str],
    /// What would tell them apart.
    pub settled_by: &'static str,
}

const fn creep(sensor: Sensor, coefficients: &'static [Coefficient]) -> Effect {
    Effect {
        id: "creep",
        sensor,
        about: "a bias that creeps with the logarithm of time",
        coefficients,
        typical: &[1.0; 3],
        form: ONSET,
        regressors: |at, onset_s, out| per_axis(out, |_| (at.t_s / onset_s).ln_1p()),
        needs: "",
    }
}

const LONGER: &str =
    "a cold start recorded for several hours: an exponential ends, a logarithm does not";

static RIVALS: [Rival; 3] = [
    Rival {
        law: creep(Sensor::Gyro, &GYRO_CREEP),
        of: &["gyro_warm_up", "gyro_thermal_lag"],
        settled_by: LONGER,
    },
    Rival {
        law: creep(Sensor::Accel, &ACCEL_CREEP),
        of: &["accel_warm_up", "accel_thermal_lag"],
        settled_by: LONGER,
    },
    // Whatever field goes with the vertical, the Earth's magnetic one first of all, is felt along the axis alone; a proof mass
    // that sags is skew to some degree.
    Rival {
        law: Effect {
            id: "vertical_field",
            sensor: Sensor::Gyro,
            about: "a field along the vertical, as the Earth's magnetic one, felt along each axis",
            coefficients: &VERTICAL_FIELD,
            typical: &[1.0; 3],
            form: None,
            regressors: |at, _, out| per_axis(out, |i| at.force[i]),
            needs: "",
        },
        of: &["gyro_g_sensitivity"],
        settled_by: "the same poses far from iron, or with a magnet near",
    },
];

/// Rivals of the effect `id`.
pub fn rivals(id: &str) -> impl Iterator<Item = &'static Rival> {
    RIVALS.iter().filter(move |r| r.of.contains(&id))
}
