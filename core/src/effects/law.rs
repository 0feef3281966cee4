//! The effects that the device removes by name, each in one row of one table.

use nalgebra::{Matrix3, RealField, Vector3, convert};

/// Most coefficients of an effect.
pub(super) const COEFFICIENTS: usize = 9;

/// Values of the variables by their numbers; the first is 1, for products of fewer than three.
pub(super) type Values<T> = [T; 10];

/// What the error of a sample is computed from, SI, body frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Conditions<T: RealField> {
    /// Rate, rad/s.
    pub rate: Vector3<T>,
    /// Specific force, m/s².
    pub force: Vector3<T>,
    /// Angular acceleration, rad/s².
    pub angular_acceleration: Vector3<T>,
    /// The triad's own input along its three sensitive directions, rad/s or m/s².
    pub sensed: Vector3<T>,
}

/// What the errors are computed from that move with temperature and time.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ambience<T> {
    /// Time since power-on, s.
    pub time: T,
    /// Temperature above the reference, °C.
    pub warm: T,
    /// The same behind the lag of the effect, less itself, °C.
    pub lag: T,
}

/// An error that moves with temperature and time: of sensor i, `bias_i + along_i s_i + (across x)_i`, with s the input along
/// the sensitive directions and x in the body frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slow<T: RealField> {
    pub bias: Vector3<T>,
    pub along: Vector3<T>,
    pub across: Matrix3<T>,
}

/// How an effect is evaluated: what it adds to the error of the three sensors, SI.
#[derive(Debug, Clone, Copy)]
pub(super) enum Evaluation<T: RealField> {
    /// With every sample, by coefficients and conditions.
    Fast(fn(&[T; COEFFICIENTS], &Conditions<T>, &mut Vector3<T>)),
    /// Now and then, by coefficients, nonlinear constant and ambience.
    Slow(fn(&[T; COEFFICIENTS], T, &Ambience<T>, &mut Slow<T>)),
    /// With every sample, by the [`Code`] of the reading.
    Code,
}

/// Nonlinear constant of an effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Form {
    /// It has none.
    None,
    /// A time constant, s.
    TimeConstant,
    /// The time constant of [`Ambience::lag`], s.
    Lag,
    /// The weight of bit 0, raw.
    Weight,
}

/// A row of the table.
#[derive(Debug, Clone, Copy)]
pub(super) struct Law<T: RealField> {
    /// Id of the effect without the `gyro_` or `accel_` before it.
    pub name: &'static str,
    /// How many coefficients it takes. A matrix is by rows; rows are sensors.
    pub coefficients: usize,
    pub form: Form,
    pub evaluation: Evaluation<T>,
}

impl<T: RealField + Copy> Law<T> {
    /// The row of this name.
    pub fn named(name: &str) -> Option<&'static Self> {
        Self::TABLE.iter().find(|law| law.name == name)
    }

    /// Everything that the device can remove. The laws hold for either triad; that some are of no use to one of them costs
    /// nothing. An effect is added here and nowhere else.
    const TABLE: &'static [Self] = &[
        Self::fast("g_sensitivity", 9, g_sensitivity),
        Self::fast("scale_quadratic", 3, scale_quadratic),
        Self::fast("scale_cubic", 3, scale_cubic),
        Self::fast("scale_asymmetry", 3, scale_asymmetry),
        Self::fast("cross_axis_product", 9, cross_axis_product),
        Self::fast("size_effect", 9, size_effect),
        Self {
            name: "readout_code",
            coefficients: COEFFICIENTS,
            form: Form::Weight,
            evaluation: Evaluation::Code,
        },
        Self::slow("bias_drift", 3, Form::None, |c, _, at, e| {
            e.bias += each(c) * at.time;
        }),
        Self::slow(
            "warm_up",
            3,
            Form::TimeConstant,
            |c, time_constant, at, e| {
                e.bias += each(c) * (-at.time / time_constant).exp();
            },
        ),
        Self::slow("thermal_bias", 6, Form::None, |c, _, at, e| {
            let bend = Vector3::new(c[3], c[4], c[5]);
            e.bias += (each(c) + bend * at.warm) * at.warm;
        }),
        Self::slow("thermal_scale", 3, Form::None, |c, _, at, e| {
            e.along += each(c) * at.warm;
        }),
        Self::slow("thermal_misalignment", 6, Form::None, |c, _, at, e| {
            let none = T::zero();
            let tilt = Matrix3::new(none, c[0], c[1], c[2], none, c[3], c[4], c[5], none);
            e.across += tilt * at.warm;
        }),
        Self::slow("thermal_lag", 3, Form::Lag, |c, _, at, e| {
            e.bias += each(c) * at.lag;
        }),
    ];

    const fn fast(
        name: &'static str,
        coefficients: usize,
        error: fn(&[T; COEFFICIENTS], &Conditions<T>, &mut Vector3<T>),
    ) -> Self {
        Self {
            name,
            coefficients,
            form: Form::None,
            evaluation: Evaluation::Fast(error),
        }
    }

    const fn slow(
        name: &'static str,
        coefficients: usize,
        form: Form,
        error: fn(&[T; COEFFICIENTS], T, &Ambience<T>, &mut Slow<T>),
    ) -> Self {
        Self {
            name,
            coefficients,
            form,
            evaluation: Evaluation::Slow(error),
        }
    }
}

fn each<T: RealField + Copy>(c: &[T; COEFFICIENTS]) -> Vector3<T> {
    Vector3::new(c[0], c[1], c[2])
}

fn matrix<T: RealField + Copy>(c: &[T; COEFFICIENTS]) -> Matrix3<T> {
    Matrix3::new(c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8])
}

// The laws that run with every sample have names, so that their instructions can be counted by them.

/// `e = G f`.
fn g_sensitivity<T: RealField + Copy>(
    c: &[T; COEFFICIENTS],
    at: &Conditions<T>,
    e: &mut Vector3<T>,
) {
    *e += matrix(c) * at.force;
}

/// `e_i = c_i s_i²`.
fn scale_quadratic<T: RealField + Copy>(
    c: &[T; COEFFICIENTS],
    at: &Conditions<T>,
    e: &mut Vector3<T>,
) {
    *e += each(c).component_mul(&at.sensed.map(|s| s * s));
}

/// `e_i = c_i s_i³`.
fn scale_cubic<T: RealField + Copy>(c: &[T; COEFFICIENTS], at: &Conditions<T>, e: &mut Vector3<T>) {
    *e += each(c).component_mul(&at.sensed.map(|s| s * s * s));
}

/// `e_i = c_i |s_i|`.
fn scale_asymmetry<T: RealField + Copy>(
    c: &[T; COEFFICIENTS],
    at: &Conditions<T>,
    e: &mut Vector3<T>,
) {
    *e += each(c).component_mul(&at.sensed.map(|s| s.abs()));
}

/// `e = Q (s_x s_y, s_y s_z, s_z s_x)`.
fn cross_axis_product<T: RealField + Copy>(
    c: &[T; COEFFICIENTS],
    at: &Conditions<T>,
    e: &mut Vector3<T>,
) {
    let s = at.sensed;
    *e += matrix(c) * Vector3::new(s.x * s.y, s.y * s.z, s.z * s.x);
}

/// `e_i = (α × r_i + ω × (ω × r_i))_i`, with r_i the place, m, where sensor i senses.
///
/// As rows of `[α]× + [ω]×²` times the places: the matrix is shared by the three sensors.
fn size_effect<T: RealField + Copy>(c: &[T; COEFFICIENTS], at: &Conditions<T>, e: &mut Vector3<T>) {
    let (w, a) = (at.rate, at.angular_acceleration);
    let (xx, yy, zz) = (w.x * w.x, w.y * w.y, w.z * w.z);
    let (xy, yz, zx) = (w.x * w.y, w.y * w.z, w.z * w.x);
    // Into the sum one by one: three instructions fewer than by the sum of each row.
    e.x = e.x + (zx + a.y) * c[2] + (xy - a.z) * c[1] - (yy + zz) * c[0];
    e.y = e.y + (yz - a.x) * c[5] + (xy + a.z) * c[3] - (zz + xx) * c[4];
    e.z = e.z + (yz + a.x) * c[7] + (zx - a.y) * c[6] - (xx + yy) * c[8];
}

/// Errors of the converter by the bits of its code, nine of them: in two tables, as a table of all would be ten times as large,
/// and with three tables of eight it takes 71 instructions.
#[derive(Debug, Clone, Copy)]
pub(super) struct Code<T> {
    /// From the input along the directions, SI, to the weight of the last bit, from [`ABOVE_ZERO`].
    gain: [T; 3],
    null: [T; 3],
    /// From fractions of the weight of bit 0 to SI.
    back: [T; 3],
    /// By bits 0 to -3, and by bits -4 to -8; the least bit of an index is the last bit.
    first: [T; 16],
    last: [T; 32],
}

/// A multiple of what nine bits can count: keeps codes with a sign above zero, and their bits the same. And half a code, where the
/// last bit is worth 128: codes that are that of a turn would be on either side by rounding.
const ABOVE_ZERO: f64 = 1024.0 + 1.0 / 256.0;

impl<T: RealField + Copy> Code<T> {
    /// Of errors in units of the weight of bit 0, `weight`, raw; readings are `scale s + bias`.
    pub fn new(
        errors: &[T; COEFFICIENTS],
        weight: T,
        scale: &Vector3<T>,
        bias: &Vector3<T>,
    ) -> Self {
        let last: T = weight / convert(256.0);
        let above: T = convert(ABOVE_ZERO);
        let (four, five) = errors.split_at(4);
        Self {
            gain: [scale.x / last, scale.y / last, scale.z / last],
            null: [
                bias.x / last + above,
                bias.y / last + above,
                bias.z / last + above,
            ],
            back: [weight / scale.x, weight / scale.y, weight / scale.z],
            first: core::array::from_fn(|bits| set(four, bits)),
            last: core::array::from_fn(|bits| set(five, bits)),
        }
    }
}

/// Sum of the errors of the bits that are set; the least bit is the last error.
fn set<T: RealField + Copy>(errors: &[T], bits: usize) -> T {
    let mut sum = T::zero();
    let mut left = bits;
    for error in errors.iter().rev() {
        if left & 1 == 1 {
            sum += *error;
        }
        left >>= 1;
    }
    sum
}

/// `e_i = weight / |P_i|` times the sum of the errors of the bits that are set in the reading.
#[inline(never)]
pub(super) fn readout_code<T: RealField + Copy>(
    code: &Code<T>,
    sensed: &Vector3<T>,
    e: &mut Vector3<T>,
) {
    let axes = code.gain.iter().zip(&code.null).zip(&code.back);
    for ((e, s), ((gain, null), back)) in e.iter_mut().zip(sensed.iter()).zip(axes) {
        let weights: f32 = (*gain * *s + *null).to_subset_unchecked();
        // Saturates: of no number it is 0.
        let bits = weights as u32;
        let first = code.first[((bits >> 5) & 15) as usize];
        *e += *back * (first + code.last[(bits & 31) as usize]);
    }
}

/// `e_i = c_i v_1 v_2 v_3`, where one c_i is not zero: an axis without an index, and without a branch.
#[inline(never)]
pub(super) fn term<T: RealField + Copy>(
    c: &Vector3<T>,
    factors: &[u8; 3],
    values: &Values<T>,
    e: &mut Vector3<T>,
) {
    let value = |factor: u8| {
        values
            .get(usize::from(factor))
            .copied()
            .unwrap_or(T::zero())
    };
    let [first, second, third] = *factors;
    *e += c * (value(first) * value(second) * value(third));
}
