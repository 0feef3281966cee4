//! Laws that are no effect of the list, but that an effect of it may be the shadow of.
//!
//! An effect that explains the rows no better than such a law is accepted, as the error goes down all the same; but which physics it is,
//! this recording does not say, and the verdict says so.

use super::{each, of, per_axis};
use crate::diagnose::effect::{Coefficient, Effect, Form, FormKind};
use crate::quantity::Sensor;

const GYRO_BIASES: [Coefficient; 3] = each("rad/s");
const ACCEL_BIASES: [Coefficient; 3] = each("m/s^2");
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
        regressors: |at, onset_s, out| per_axis(out, |_| (at.on_s / onset_s).ln_1p()),
        needs: "",
    }
}

/// Coefficients of these units, for one axis after the other.
const fn by_axis<const N: usize, const UNITS: usize>(
    units: [&'static str; UNITS],
) -> [Coefficient; N] {
    let mut all = [of(0, "", ""); N];
    let mut k = 0;
    while k < N {
        all[k] = of(k / UNITS, "", units[k % UNITS]);
        k += 1;
    }
    all
}

const GYRO_TURNING: [Coefficient; 9] = by_axis(["1", "1/(rad/s)", "1/(rad/s)"]);
const ACCEL_TURNING: [Coefficient; 9] = by_axis(["m/s^2/(rad/s)", "m/s^2/(rad/s)^2", "1/(rad/s)"]);

/// A supply that sags with the motor's current, or a bearing that shakes: known by no reading of the unit. But an axis reads the turns
/// about the others as well, by a few per cent, so that fine bits of its codes can tell them from rest.
const fn by_turning(sensor: Sensor, coefficients: &'static [Coefficient]) -> Effect {
    Effect {
        id: "by_turning",
        sensor,
        about: "a bias and a scale factor that follow how fast the unit turns, whichever way",
        coefficients,
        typical: &[1.0; 9],
        form: None,
        regressors: |at, _, out| {
            let rate = at.rate.norm();
            let axes = out.as_chunks_mut::<3>().0;
            for (out, x) in axes.iter_mut().zip(at.sensed.iter()) {
                *out = [rate, rate * rate, x * rate];
            }
        },
        needs: "",
    }
}

const BY_HAND: &str =
    "the same rates from another supply, and turned by hand: codes do not mind what turns the unit";

const LONGER: &str =
    "a cold start recorded for several hours: an exponential ends, a logarithm does not";

static RIVALS: [Rival; 5] = [
    Rival {
        law: by_turning(Sensor::Gyro, &GYRO_TURNING),
        of: &[
            "gyro_readout_code",
            "gyro_scale_asymmetry",
            "gyro_scale_quadratic",
        ],
        settled_by: BY_HAND,
    },
    Rival {
        law: by_turning(Sensor::Accel, &ACCEL_TURNING),
        of: &["accel_readout_code", "accel_size_effect"],
        settled_by: BY_HAND,
    },
    Rival {
        law: creep(Sensor::Gyro, &GYRO_BIASES),
        of: &["gyro_warm_up", "gyro_thermal_lag"],
        settled_by: LONGER,
    },
    Rival {
        law: creep(Sensor::Accel, &ACCEL_BIASES),
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
