//! Variance components: what the errors of dead reckoning may have beyond Allan's noise, and what each may come from.

use std::ops::Range;

use serde::Serialize;

use super::closure::Share;
use super::state;
use crate::quantity::Sensor;

/// Causes of errors in motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// White noise beyond that at rest.
    White,
    /// The bias wanders more than at rest.
    Walk,
    /// The scale factors and angles of the calibration are wrong: the same error throughout the session.
    Scale,
    /// Errors that grow with the turn, or the force, but differ from motion to motion: nonlinearity, different scale factors in both directions, delays.
    Motion,
    /// The gyro senses specific force.
    GSensitivity,
    /// Vibration shifts the bias.
    Rectification,
    /// Vibration adds white noise.
    Vibration,
    /// The reference itself is uncertain.
    Reference,
}

/// How a component enters.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Kind {
    /// Within each segment.
    Share(Share),
    /// The bias of a sensor takes steps from segment to segment.
    Walk(Sensor),
    /// An unknown of the session, the same in all segments.
    Session(Range<usize>),
    /// An unknown relative error of the matrix, the same in all segments.
    Matrix(Sensor),
}

/// A variance component.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Component {
    pub cause: Cause,
    /// Sensor that errs; `None` for the reference.
    pub sensor: Option<Sensor>,
    pub kind: Kind,
    /// Variance at a value of 1.
    pub unit: f64,
    /// Largest value.
    pub most: f64,
}

/// Sizes at a value of 1, from which a search begins: 0.01 % of scale, 10 µrad/s per m/s², 1 mg per g², ...
const SCALE: f64 = 1e-8;
const G_SENSITIVITY: f64 = 1e-10;
const RECTIFICATION: [f64; 2] = [1e-12, 1e-8];
const ATTITUDE: f64 = 1e-8;
/// Of a velocity, m/s, and of a position, m.
const REFERENCE: [f64; 2] = [1e-6, 1e-8];

/// Largest errors of a rest as a reference, rad and m/s: a hand that trembles turns and moves no further. Without these ends the reference would
/// explain a scale factor that is wrong by 0.3 % (the factor of the gyro's noise would be 21, and as well 1).
const OF_REST: [f64; 2] = [2e-3, 5e-3];

/// The four densities that a filter has: white noise and random walk of both sensors.
pub(super) const FILTER: usize = 4;
/// What the reference errs by follows them.
pub(super) const REFERENCE_COUNT: usize = 2;

/// All components: [`FILTER`], the reference's, then causes. `white` are the mean squares of Allan's N; `by_rests`: rests are the reference.
pub(super) fn all(white: [f64; 2], has_positions: bool, by_rests: bool) -> Vec<Component> {
    let [gyro, accel] = Sensor::BOTH;
    let of = |cause, sensor, kind, unit| Component {
        cause,
        sensor: Some(sensor),
        kind,
        unit,
        most: f64::INFINITY,
    };
    let each = |sensor: Sensor| {
        let n2 = white[sensor as usize];
        [
            of(Cause::Scale, sensor, Kind::Matrix(sensor), SCALE),
            of(
                Cause::Motion,
                sensor,
                Kind::Share(Share::Turned(sensor)),
                SCALE,
            ),
            of(
                Cause::Rectification,
                sensor,
                Kind::Session(state::rectification(sensor)),
                RECTIFICATION[sensor as usize],
            ),
            of(
                Cause::Vibration,
                sensor,
                Kind::Share(Share::Shaken(sensor)),
                n2,
            ),
        ]
    };
    let white_of = |sensor: Sensor| {
        of(
            Cause::White,
            sensor,
            Kind::Share(Share::White(sensor)),
            white[sensor as usize],
        )
    };
    // White noise of a hundred seconds moves the bias as far as this in a second.
    let walk_of = |sensor: Sensor| {
        of(
            Cause::Walk,
            sensor,
            Kind::Walk(sensor),
            1e-4 * white[sensor as usize],
        )
    };
    let reference = |share, unit: f64, of_rest: f64| Component {
        cause: Cause::Reference,
        sensor: None,
        kind: Kind::Share(share),
        unit,
        most: if by_rests {
            of_rest * of_rest / unit
        } else {
            f64::INFINITY
        },
    };
    let mut all = vec![
        white_of(gyro),
        white_of(accel),
        walk_of(gyro),
        walk_of(accel),
        reference(Share::Attitude, ATTITUDE, OF_REST[0]),
        reference(
            Share::Reference,
            REFERENCE[usize::from(has_positions)],
            OF_REST[1],
        ),
    ];
    all.extend(each(gyro));
    all.push(of(
        Cause::GSensitivity,
        gyro,
        Kind::Session(state::G_SENSITIVITY),
        G_SENSITIVITY,
    ));
    all.extend(each(accel));
    all
}
