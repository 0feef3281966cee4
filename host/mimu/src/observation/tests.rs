//! Tests that every kind of observation passes: derivatives against finite differences, invariance under a turn of the frame, and the covariance that
//! the derivatives give against simulation.

use mimu_core::compensation::Affine;
use nalgebra::{Matrix3, Rotation3, SVector, Vector3};

use super::closure::ClosureError;
use super::magnitude::Magnitude;
use super::turn::{Turn, TurnError};
use super::{ByTriad, about, from_centre, of_output, vector};
use crate::quantity::Sensor;
use crate::signal::increment::Increment;
use crate::triad::{affine, vector as parameters};

/// A unit: both models, raw to SI.
#[derive(Clone, Copy)]
struct Unit {
    gyro: Affine<f64>,
    accel: Affine<f64>,
}

impl Unit {
    fn of(&self, sensor: Sensor) -> &Affine<f64> {
        match sensor {
            Sensor::Gyro => &self.gyro,
            Sensor::Accel => &self.accel,
        }
    }

    fn with(mut self, sensor: Sensor, model: Affine<f64>) -> Self {
        match sensor {
            Sensor::Gyro => self.gyro = model,
            Sensor::Accel => self.accel = model,
        }
        self
    }

    /// The same unit in a body frame that is turned by `by`.
    fn turned(&self, by: &Rotation3<f64>) -> Self {
        let turn = |model: &Affine<f64>| Affine {
            matrix: by * model.matrix,
            offset: by * model.offset,
        };
        Self {
            gyro: turn(&self.gyro),
            accel: turn(&self.accel),
        }
    }
}

/// Residuals, and for each the derivatives by the triads that it depends on.
type Found = Vec<(f64, Vec<(Sensor, ByTriad)>)>;

type Residuals = dyn Fn(&Unit, &Rotation3<f64>) -> Found;

/// One observation of a kind.
struct Kind {
    name: &'static str,
    /// Its residuals, none of them zero, and their derivatives, none of them zero, by the triads of a unit. What is known of it is given in the body frame
    /// turned by the rotation.
    at: Box<Residuals>,
    /// The unit at which its derivatives are compared: [`unit`], or one with small residuals if they are those of a small error.
    unit: fn() -> Unit,
}

impl Kind {
    fn new(name: &'static str, at: impl Fn(&Unit, &Rotation3<f64>) -> Found + 'static) -> Self {
        Self {
            name,
            at: Box::new(at),
            unit,
        }
    }
}

/// A unit with errors of some per cent, in volts.
fn unit() -> Unit {
    let gyro = Affine {
        matrix: Matrix3::new(3.4, 0.05, -0.08, 0.02, 3.6, 0.04, -0.03, 0.06, 3.5),
        offset: Vector3::new(-8.4, -9.1, -8.8),
    };
    let accel = Affine {
        matrix: Matrix3::new(12.0, 0.1, -0.3, 0.2, 12.5, 0.1, -0.2, 0.3, 12.2),
        offset: Vector3::new(-19.5, -20.3, -19.8),
    };
    Unit { gyro, accel }
}

/// A turn of two seconds, in four pieces, with the raw accelerometer before and after it.
fn increments() -> Vec<Increment> {
    let raw = [
        [2.51, 2.74, 2.53],
        [2.62, 2.95, 2.47],
        [2.40, 2.81, 2.60],
        [2.49, 2.63, 2.52],
    ];
    let piece = |(k, raw): (usize, &[f64; 3])| {
        let mut piece = Increment::EMPTY;
        piece.duration_s = 0.5;
        piece.end_s = 0.5 * (k + 1) as f64;
        piece.integral = raw.map(|r| 0.5 * r);
        piece
    };
    raw.iter().enumerate().map(piece).collect()
}

fn kinds() -> Vec<Kind> {
    let raw = Vector3::new(2.1, 1.4, 1.9);
    let input = Vector3::new(3.0, -2.0, 8.8);
    let of_vector = move |unit: &Unit, frame: &Rotation3<f64>| -> Found {
        let block = vector::at(&unit.accel, &raw, &(frame * input));
        let each = (0..3).map(|k| (block.residual[k], vec![(Sensor::Accel, block.by(k))]));
        each.collect()
    };
    let of_magnitude = move |unit: &Unit, _: &Rotation3<f64>| -> Found {
        let found = Magnitude::at(&unit.accel, &raw, 9.8);
        vec![(found.residual(), vec![(Sensor::Accel, found.block.by(0))])]
    };
    let of_rate = move |unit: &Unit, _: &Rotation3<f64>| -> Found {
        let found = Magnitude::at(&unit.gyro, &raw, 2.0);
        vec![(found.residual(), vec![(Sensor::Gyro, found.block.by(0))])]
    };
    let turn = Kind {
        // The derivatives of its direction error hold for a small one.
        unit: agreeing,
        ..Kind::new("turn", |unit, _| of_turn(unit))
    };
    vec![
        Kind::new("vector", of_vector),
        Kind::new("magnitude of force", of_magnitude),
        Kind::new("magnitude of rate", of_rate),
        turn,
        Kind {
            unit: agreeing,
            ..Kind::new("whole turns", |unit, _| of_whole_turns(unit))
        },
    ]
}

/// Two turns, whole in sum to within some degrees, judged by the accelerometer's readings before and after them. The first goes round about an axis that
/// no axis of the unit is parallel to.
fn of_whole_turns(unit: &Unit) -> Found {
    let gyro = self::unit().gyro;
    let raw = |rate: Vector3<f64>| {
        let inverse = gyro.matrix.try_inverse().expect("a unit");
        inverse * (rate - gyro.offset)
    };
    let rate = Vector3::new(0.4, -0.7, 1.0).normalize() * std::f64::consts::TAU;
    let pieces = |share: f64| -> Vec<Increment> {
        let piece = |k: u32| Increment {
            end_s: 0.01 * f64::from(k + 1),
            duration_s: 0.01,
            integral: (raw(rate * share) * 0.01).into(),
            ..Increment::EMPTY
        };
        (0..100).map(piece).collect()
    };
    let [first, second] = [pieces(0.62), pieces(0.39)];
    let readings = [[1.9, 1.1, 2.1], [2.0, 2.3, 1.5], [1.93, 1.08, 2.09]].map(Vector3::from);
    let turn = |increments, from: usize| {
        let raw = [readings[from], readings[from + 1]];
        let [before, after] = raw.map(|raw| unit.accel.apply(&raw));
        Turn {
            from,
            to: from + 1,
            steps: [0, 1],
            increments,
            before,
            after,
            raw,
            direction_variance: 0.0,
            earth_variance: 0.0,
            integral_variance: 0.0,
            duration_s: 1.0,
        }
    };
    let turns = [turn(&first, 0), turn(&second, 1)];
    let error = ClosureError::at(&turns, &unit.gyro, 1e-4).expect("two turns");
    let by_accel = error.by_accel(&[readings[0], readings[2]]);
    let by = vec![(Sensor::Gyro, error.block.by(0)), (Sensor::Accel, by_accel)];
    vec![(error.block.residual[0], by)]
}

/// A turn, judged by the accelerometer's readings before and after it.
fn of_turn(unit: &Unit) -> Found {
    let pieces = increments();
    let raw = [Vector3::new(1.7, 1.1, 2.2), Vector3::new(2.0, 2.3, 1.5)];
    let [before, after] = raw.map(|raw| unit.accel.apply(&raw));
    let turn = Turn {
        from: 0,
        to: 1,
        steps: [0, 1],
        increments: &pieces,
        before,
        after,
        raw,
        direction_variance: 0.0,
        earth_variance: 0.0,
        integral_variance: 0.0,
        duration_s: 2.0,
    };
    let error = TurnError::at(&turn, &unit.gyro);
    let by_accel = error.by_accel(&raw);
    let each = (0..2).map(|k| {
        let by = vec![
            (Sensor::Gyro, error.block.by(k)),
            (Sensor::Accel, by_accel[k]),
        ];
        (error.block.residual[k], by)
    });
    each.collect()
}

/// A unit whose accelerometer is turned a little so that the turn fits: its reading after the turn is where the turn takes the one before.
fn agreeing() -> Unit {
    let unit = unit();
    let mut accel = unit.accel;
    for _ in 0..50 {
        let found = of_turn(&Unit { accel, ..unit });
        // A step along the derivatives.
        let [a, b] = [&found[0], &found[1]];
        let of = |f: &(f64, Vec<(Sensor, ByTriad)>)| {
            let own = f.1.iter().find(|(sensor, _)| *sensor == Sensor::Accel);
            own.expect("a turn depends on the accelerometer").1
        };
        let (ja, jb) = (of(a), of(b));
        let normal = nalgebra::Matrix2::new(ja.dot(&ja), ja.dot(&jb), ja.dot(&jb), jb.dot(&jb));
        let step = normal.try_inverse().unwrap() * nalgebra::Vector2::new(a.0, b.0);
        let change: ByTriad = ja * step.x + jb * step.y;
        accel = affine(&(parameters(&accel.matrix, &accel.offset) - change));
    }
    Unit { accel, ..unit }
}

#[test]
fn derivatives_are_those_of_finite_differences() {
    for Kind {
        name,
        at: kind,
        unit,
    } in kinds()
    {
        let unit = unit();
        let here = Rotation3::identity();
        let found = kind(&unit, &here);
        for (row, (_, by)) in found.iter().enumerate() {
            for (sensor, by) in by {
                let model = unit.of(*sensor);
                let p = parameters(&model.matrix, &model.offset);
                for k in 0..12 {
                    let step = 1e-5;
                    let at = |sign: f64| {
                        let mut q = p;
                        q[k] += sign * step;
                        kind(&unit.with(*sensor, affine(&q)), &here)[row].0
                    };
                    let slope = (at(1.0) - at(-1.0)) / (2.0 * step);
                    assert!(
                        (slope - by[k]).abs() < 2e-3 * by.norm(),
                        "{name}, residual {row}, {sensor}, parameter {k}: {slope} and {}",
                        by[k]
                    );
                }
            }
        }
    }
}

#[test]
fn the_size_of_an_error_does_not_depend_on_the_frame() {
    let frame = Rotation3::from_euler_angles(0.4, -0.9, 2.1);
    for Kind { name, at: kind, .. } in kinds() {
        let size = |unit: &Unit, frame: &Rotation3<f64>| -> f64 {
            kind(unit, frame).iter().map(|r| r.0 * r.0).sum()
        };
        let (here, there) = (
            size(&unit(), &Rotation3::identity()),
            size(&unit().turned(&frame), &frame),
        );
        assert!(
            (here - there).abs() < 1e-12 * here,
            "{name}: {here} {there}"
        );
    }
}

#[test]
fn the_covariance_by_the_derivatives_is_that_of_a_simulation() {
    const RUNS: u32 = 4000;
    for Kind {
        name,
        at: kind,
        unit,
    } in kinds()
    {
        let unit = unit();
        let here = Rotation3::identity();
        let found = kind(&unit, &here);
        let mut state = 1u64;
        let mut uniform = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        let sigma = 1e-4;
        let mut squares = vec![0.0; found.len()];
        for _ in 0..RUNS {
            let mut other = unit;
            for sensor in Sensor::BOTH {
                let model = other.of(sensor);
                let errors = SVector::<f64, 12>::from_fn(|_, _| sigma * 12f64.sqrt() * uniform());
                let changed = parameters(&model.matrix, &model.offset) + errors;
                other = other.with(sensor, affine(&changed));
            }
            for (k, (residual, _)) in kind(&other, &here).iter().enumerate() {
                squares[k] += (residual - found[k].0).powi(2) / f64::from(RUNS);
            }
        }
        for (k, (_, by)) in found.iter().enumerate() {
            let variance: f64 = by.iter().map(|(_, by)| by.norm_squared()).sum();
            let ratio = (squares[k] / variance).sqrt() / sigma;
            // Of 4000 runs: 1.1 % is a standard deviation.
            assert!((ratio - 1.0).abs() < 0.045, "{name}, residual {k}: {ratio}");
        }
    }
}

#[test]
fn parameters_about_a_reading_are_those_about_zero() {
    let (centre, raw) = (Vector3::new(1.6, 1.5, 1.7), Vector3::new(2.1, 1.4, 1.9));
    let by = Magnitude::at(&unit().accel, &raw, 9.8).block.by(0);
    let back = from_centre(&centre).transpose() * by;
    assert!((about(&by, &centre) - back).norm() < 1e-12);
}

#[test]
fn a_model_that_follows_another_changes_what_it_gives() {
    let (model, raw) = (unit().accel, Vector3::new(2.1, 1.4, 1.9));
    let by = Magnitude::at(&model, &raw, 9.8).block.by(0);
    let of_output = of_output(&by, &model);
    let at_output = Magnitude::at(&Affine::identity(), &model.apply(&raw), 9.8);
    assert!((of_output - at_output.block.by(0)).norm() < 1e-12);
}
