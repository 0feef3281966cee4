//! The effects that the device removes by name: a table with one row for each.

use nalgebra::{Matrix3, RealField, Vector3, convert};

use crate::Sensor;

/// Most coefficients of an effect.
pub(super) const COEFFICIENTS: usize = 9;

/// Most variables of a term.
pub(super) const FACTORS: usize = 3;

/// Values of the variables, indexed by their numbers; the first is 1, for products of fewer than three.
pub(super) type Values<T> = [T; 10];

/// Quantities from which the error of a sample is computed, SI, body frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Conditions<T: RealField> {
    /// Rate, rad/s, force, m/s², and the slow ones.
    pub values: Values<T>,
    /// Angular acceleration, rad/s².
    pub angular_acceleration: Vector3<T>,
    /// The triad's own input along its three sensitive directions, rad/s or m/s².
    pub sensed: Vector3<T>,
}

/// An effect that runs with every sample, with its numbers.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fast<T: RealField> {
    pub law: FastLaw<T>,
    pub coefficients: [T; COEFFICIENTS],
    /// For a term: the numbers of its variables.
    pub factors: [u8; FACTORS],
}

/// Ordinary inputs, which every part measures: 1 rad/s, and a little more than gravity, m/s². No coefficient of a correction makes an error as large as these. At
/// the end of a range it may: a cubic error of 1 % at 1 g is 100 g at 100 g.
const ORDINARY: [f64; 2] = [1.0, 10.0];
/// Difference from the reference temperature at which the same holds, °C, and time, s.
const TEMPERATURE: f64 = 10.0;
const TIME: f64 = 1e3;

fn ordinary<T: RealField>(sensor: Sensor) -> T {
    let [rate, force] = ORDINARY;
    convert(match sensor {
        Sensor::Gyro => rate,
        Sensor::Accel => force,
    })
}

/// Whether an error at ordinary inputs is one that a correction may have.
pub(super) fn is_bounded<T: RealField + Copy>(error: T, sensor: Sensor) -> bool {
    error <= ordinary::<T>(sensor)
}

/// The largest error of an axis by `law` at ordinary inputs.
pub(super) fn ordinary_error<T: RealField + Copy>(law: &Fast<T>, sensor: Sensor) -> T {
    let [rate, force]: [T; 2] = ORDINARY.map(convert);
    let both = [rate, rate, rate, force, force, force];
    let mut values = [T::one(); 10];
    for (value, end) in values.iter_mut().skip(1).zip(both) {
        *value = end;
    }
    // Temperature, its rate in °C/s, and time.
    for (value, end) in values.iter_mut().skip(7).zip([TEMPERATURE, 1.0, TIME]) {
        *value = convert(end);
    }
    let at = Conditions {
        values,
        angular_acceleration: Vector3::repeat(convert(10.0)),
        sensed: Vector3::repeat(ordinary(sensor)),
    };
    let mut error = Vector3::zeros();
    (law.law)(law, &at, &mut error);
    error.amax()
}

/// Adds an effect to the error of the three sensors, SI.
pub(super) type FastLaw<T> = fn(&Fast<T>, &Conditions<T>, &mut Vector3<T>);

/// An effect that depends on temperature and time only.
#[derive(Debug, Clone, Copy)]
pub(super) enum Slowly<T: RealField> {
    Law {
        law: SlowLaw<T>,
        coefficients: [T; COEFFICIENTS],
        nonlinear: T,
        lags: bool,
    },
    /// A term of slow variables, which is a bias.
    Term(Fast<T>),
}

/// Quantities from which slow errors are computed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ambient<T> {
    /// Time since power-on, s.
    pub time: T,
    /// Decays after power-on count as over, whatever the time.
    pub settled: bool,
    /// Temperature above the reference, °C.
    pub temperature_offset: T,
    /// Lagged temperature minus the temperature, °C.
    pub lag: T,
}

/// A slow error. For sensor i it is `bias_i + along_i s_i + (across x)_i`, with s the input along
/// the sensitive directions and x in the body frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slow<T: RealField> {
    pub bias: Vector3<T>,
    pub along: Vector3<T>,
    pub across: Matrix3<T>,
}

/// Adds an effect from its coefficients, its nonlinear constant and the ambient quantities.
pub(super) type SlowLaw<T> = fn(&[T; COEFFICIENTS], T, &Ambient<T>, &mut Slow<T>);

/// How an effect is evaluated: its contribution to the errors of the three sensors, SI.
#[derive(Debug, Clone, Copy)]
pub(super) enum Evaluation<T: RealField> {
    /// With every sample.
    Fast(FastLaw<T>),
    /// Several times per second.
    Slow(SlowLaw<T>),
}

/// Nonlinear constant of an effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Nonlinear {
    /// It has none.
    None,
    /// A time constant, s.
    TimeConstant,
    /// The time constant of [`Ambient::lag`], s.
    Lag,
}

/// A row of the table.
#[derive(Debug, Clone, Copy)]
pub(super) struct Law<T: RealField> {
    /// Id of the effect without the `gyro_` or `accel_` before it.
    pub name: &'static str,
    /// Number of coefficients. A matrix is by rows; rows are sensors.
    pub coefficients: usize,
    pub nonlinear: Nonlinear,
    pub evaluation: Evaluation<T>,
}

/// A name has one row.
impl<T: RealField> PartialEq for Law<T> {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl<T: RealField + Copy> Law<T> {
    /// The row of this name.
    pub fn named(name: &str) -> Option<&'static Self> {
        Self::TABLE.iter().find(|law| law.name == name)
    }

    /// All effects that the device can remove by name. Each law applies to both triads; a law that one of them never uses costs nothing. A
    /// new effect is added only here.
    const TABLE: &'static [Self] = &[
        Self::fast("g_sensitivity", 9, g_sensitivity),
        Self::fast("g_squared", 9, g_squared),
        Self::fast("scale_quadratic", 3, scale_quadratic),
        Self::fast("scale_cubic", 3, scale_cubic),
        Self::fast("scale_asymmetry", 3, scale_asymmetry),
        Self::fast("cross_axis_product", 9, cross_axis_product),
        Self::fast("size_effect", 9, size_effect),
        Self::slow(
            "warm_up",
            3,
            Nonlinear::TimeConstant,
            |c, time_constant, at, e| {
                // Not `exp`: it is used nowhere else and would be linked into the image for this line.
                let left = (-at.time / time_constant).exp_m1() + T::one();
                if !at.settled {
                    e.bias += each(c) * left;
                }
            },
        ),
        Self::slow("thermal_bias", 6, Nonlinear::None, |c, _, at, e| {
            let bend = Vector3::new(c[3], c[4], c[5]);
            e.bias += (each(c) + bend * at.temperature_offset) * at.temperature_offset;
        }),
        Self::slow("thermal_scale", 3, Nonlinear::None, |c, _, at, e| {
            e.along += each(c) * at.temperature_offset;
        }),
        Self::slow("thermal_misalignment", 6, Nonlinear::None, |c, _, at, e| {
            let none = T::zero();
            let tilt = Matrix3::new(none, c[0], c[1], c[2], none, c[3], c[4], c[5], none);
            e.across += tilt * at.temperature_offset;
        }),
        Self::slow("thermal_lag", 3, Nonlinear::Lag, |c, _, at, e| {
            e.bias += each(c) * at.lag;
        }),
    ];

    /// Whether the errors by each coefficient alone [are bounded](is_bounded).
    pub fn is_bounded(&self, sensor: Sensor, coefficients: &[T; COEFFICIENTS]) -> bool {
        let ordinary = ordinary(sensor);
        coefficients.iter().enumerate().all(|(k, coefficient)| {
            // Alone, because two may cancel at one input and not at another.
            let mut alone = [T::zero(); COEFFICIENTS];
            if let Some(one) = alone.get_mut(k) {
                *one = *coefficient;
            }
            let error = match self.evaluation {
                Evaluation::Fast(law) => {
                    let law = Fast {
                        law,
                        coefficients: alone,
                        factors: [0; FACTORS],
                    };
                    ordinary_error(&law, sensor)
                }
                Evaluation::Slow(law) => {
                    let mut slow = Slow {
                        bias: Vector3::zeros(),
                        along: Vector3::zeros(),
                        across: Matrix3::zeros(),
                    };
                    let at = Ambient {
                        time: T::zero(),
                        settled: false,
                        temperature_offset: convert(TEMPERATURE),
                        lag: convert(TEMPERATURE),
                    };
                    law(&alone, T::one(), &at, &mut slow);
                    slow.bias.amax() + (slow.along.amax() + slow.across.amax()) * ordinary
                }
            };
            is_bounded(error, sensor)
        })
    }

    const fn fast(name: &'static str, coefficients: usize, law: FastLaw<T>) -> Self {
        Self {
            name,
            coefficients,
            nonlinear: Nonlinear::None,
            evaluation: Evaluation::Fast(law),
        }
    }

    const fn slow(
        name: &'static str,
        coefficients: usize,
        nonlinear: Nonlinear,
        law: SlowLaw<T>,
    ) -> Self {
        Self {
            name,
            coefficients,
            nonlinear,
            evaluation: Evaluation::Slow(law),
        }
    }
}

fn each<T: RealField + Copy>(c: &[T; COEFFICIENTS]) -> Vector3<T> {
    Vector3::new(c[0], c[1], c[2])
}

// The laws that run with every sample.

/// `e = M x`, M by rows.
fn product<T: RealField + Copy>(c: &[T; COEFFICIENTS], x: &Vector3<T>, e: &mut Vector3<T>) {
    e.gemv(T::one(), &Matrix3::from_row_slice(c), x, T::one());
}

/// `e = G f`.
fn g_sensitivity<T: RealField + Copy>(law: &Fast<T>, at: &Conditions<T>, e: &mut Vector3<T>) {
    let [_, _, _, _, x, y, z, ..] = at.values;
    product(&law.coefficients, &Vector3::new(x, y, z), e);
}

/// `e = G (f_x², f_y², f_z²)`.
fn g_squared<T: RealField + Copy>(law: &Fast<T>, at: &Conditions<T>, e: &mut Vector3<T>) {
    let [_, _, _, _, x, y, z, ..] = at.values;
    product(&law.coefficients, &Vector3::new(x * x, y * y, z * z), e);
}

/// `e_i = c_i s_i²`.
fn scale_quadratic<T: RealField + Copy>(law: &Fast<T>, at: &Conditions<T>, e: &mut Vector3<T>) {
    let s = &at.sensed;
    *e += each(&law.coefficients).component_mul(&s.component_mul(s));
}

/// `e_i = c_i s_i³`.
fn scale_cubic<T: RealField + Copy>(law: &Fast<T>, at: &Conditions<T>, e: &mut Vector3<T>) {
    let s = &at.sensed;
    *e += each(&law.coefficients).component_mul(&s.component_mul(s).component_mul(s));
}

/// `e_i = c_i |s_i|`.
fn scale_asymmetry<T: RealField + Copy>(law: &Fast<T>, at: &Conditions<T>, e: &mut Vector3<T>) {
    *e += each(&law.coefficients).component_mul(&at.sensed.abs());
}

/// `e = Q (s_x s_y, s_y s_z, s_z s_x)`.
fn cross_axis_product<T: RealField + Copy>(law: &Fast<T>, at: &Conditions<T>, e: &mut Vector3<T>) {
    let s = &at.sensed;
    product(&law.coefficients, &s.component_mul(&s.yzx()), e);
}

/// `e_i = (α × r_i + ω × (ω × r_i))_i`, with r_i the sensing point of sensor i, m.
///
/// Rows of `[α]× + [ω]×²` times the positions: the three sensors share the matrix.
fn size_effect<T: RealField + Copy>(law: &Fast<T>, at: &Conditions<T>, e: &mut Vector3<T>) {
    let (c, a) = (&law.coefficients, &at.angular_acceleration);
    let [_, x, y, z, ..] = at.values;
    let (xx, yy, zz) = (x * x, y * y, z * z);
    let (xy, yz, zx) = (x * y, y * z, z * x);
    e.x = e.x + (zx + a.y) * c[2] + (xy - a.z) * c[1] - (yy + zz) * c[0];
    e.y = e.y + (yz - a.x) * c[5] + (xy + a.z) * c[3] - (zz + xx) * c[4];
    e.z = e.z + (yz + a.x) * c[7] + (zx - a.y) * c[6] - (xx + yy) * c[8];
}

/// `e_i = c_i v_1 v_2 v_3`, where exactly one c_i is not zero: this selects the axis without an index and without a branch.
pub(super) fn term<T: RealField + Copy>(law: &Fast<T>, at: &Conditions<T>, e: &mut Vector3<T>) {
    let value = |factor: u8| {
        let value = at.values.get(usize::from(factor));
        value.copied().unwrap_or(T::zero())
    };
    let [first, second, third] = law.factors.map(value);
    *e += each(&law.coefficients) * (first * second * third);
}
