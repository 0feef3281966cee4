//! Compensation of raw readings: the inverse model.

use nalgebra::{Matrix3, RealField, Vector3, convert};

use crate::PerSensor;

/// Allowed length of a column of C, SI per raw unit. A 32-bit converter over 250 deg/s has 2e-9 rad/s per code; a gyro of 30 000 deg/s read
/// in volts has 200 rad/s per volt.
pub const SCALE_RANGE: [f64; 2] = [1e-12, 1e4];

/// Largest entry of o, SI: full scale of the most insensitive sensors is below 1e4 rad/s and 1e6 m/s².
pub const MOST_OFFSET: f64 = 1e6;

/// Smallest volume spanned by the three columns of C at unit length; 1 if they are orthogonal. Two sensors 0.06° apart have this volume.
pub const LEAST_VOLUME: f64 = 1e-3;

/// Inverse model of one triad, raw to SI.
///
/// `x = C u + o` (xu (1) for the gyro, (2) for the accelerometer), where
///
/// * `u` is the raw reading of the three sensors, in volts or in counts,
/// * `x` is the input in the body frame: rad/s for a gyro, m/s² of specific force for an
///   accelerometer (at rest it points up),
/// * `C` is in SI per raw unit, `o` in SI.
///
/// The device uses the inverse model instead of the forward one, `u = P x + b`, because it then needs no matrix inverse: nine
/// multiplications and nine additions per sample.
///
/// ```
/// # use mimu_core::compensation::Affine;
/// # use nalgebra::{Matrix3, Vector3};
/// // An accelerometer of 0.08 V per m/s² with its null at 1.65 V, standing upright:
/// let accel = Affine::<f64> {
///     matrix: Matrix3::from_diagonal_element(1.0 / 0.08),
///     offset: Vector3::repeat(-1.65 / 0.08),
/// };
/// let force = accel.apply(&Vector3::new(1.65, 1.65, 1.65 + 0.08 * 9.80665));
/// assert!((force - Vector3::new(0.0, 0.0, 9.80665)).norm() < 1e-12);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Affine<T: RealField> {
    /// `C`, SI per raw unit. Row: axis of the body frame. Column: sensor.
    pub matrix: Matrix3<T>,
    /// `o`, SI.
    pub offset: Vector3<T>,
}

/// Why an inverse model is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Implausible {
    /// An entry is not a finite number.
    NotFinite,
    /// A column of C has a length outside [`SCALE_RANGE`], SI per raw unit.
    Scale,
    /// C is singular: its columns span less than [`LEAST_VOLUME`].
    Singular,
    /// An entry of o is beyond [`MOST_OFFSET`], SI.
    Offset,
    /// Within a kelvin the largest entry of a column of C changes by more than its own size, or o by more than [`MOST_OFFSET`].
    Slope,
}

impl core::fmt::Display for Implausible {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NotFinite => f.write_str("C, o or a slope has an entry that is not a number"),
            Self::Scale => {
                let [least, most] = SCALE_RANGE;
                write!(
                    f,
                    "a column of C has a length outside {least:e} to {most:e} SI per raw unit"
                )
            }
            Self::Singular => f.write_str("C is singular"),
            Self::Offset => write!(f, "o is beyond {MOST_OFFSET:e} SI"),
            Self::Slope => f.write_str(
                "within a kelvin, C would change by more than its own size, or o by an impossible amount",
            ),
        }
    }
}

impl core::error::Error for Implausible {}

impl<T: RealField + Copy> Affine<T> {
    /// The model of readings that are in SI already.
    pub fn identity() -> Self {
        Self {
            matrix: Matrix3::identity(),
            offset: Vector3::zeros(),
        }
    }

    /// Refuses a model that no sensor can have. `slope`: derivative of the model by the temperature, per kelvin.
    pub fn check(&self, slope: Option<&Self>) -> Result<(), Implausible> {
        let finite = |of: &Self| of.matrix.iter().chain(&of.offset).all(T::is_finite);
        if !finite(self) || !slope.is_none_or(finite) {
            return Err(Implausible::NotFinite);
        }
        let [least, most] = SCALE_RANGE.map(convert::<f64, T>);
        let mut unit = [Vector3::zeros(); 3];
        for (unit, column) in unit.iter_mut().zip(self.matrix.data.0) {
            let column = Vector3::from(column);
            // Divided by the largest entry first, because its square may overflow single precision.
            let largest = column.amax();
            if !(largest >= least * convert(0.5) && largest <= most) {
                return Err(Implausible::Scale);
            }
            let column = column / largest;
            let length = column.norm();
            if !(largest * length >= least && largest * length <= most) {
                return Err(Implausible::Scale);
            }
            *unit = column / length;
        }
        let [x, y, z] = unit;
        if !(x.dot(&y.cross(&z)).abs() >= convert(LEAST_VOLUME)) {
            return Err(Implausible::Singular);
        }
        let most_offset: T = convert(MOST_OFFSET);
        if self.offset.amax() > most_offset {
            return Err(Implausible::Offset);
        }
        let Some(slope) = slope else { return Ok(()) };
        let mut columns = self.matrix.data.0.into_iter().zip(slope.matrix.data.0);
        let steep =
            columns.any(|(of, slope)| Vector3::from(slope).amax() > Vector3::from(of).amax());
        match steep || slope.offset.amax() > most_offset {
            true => Err(Implausible::Slope),
            false => Ok(()),
        }
    }

    /// SI input in the body frame from the raw reading `u`. NaN in, NaN out.
    #[inline]
    pub fn apply(&self, raw: &Vector3<T>) -> Vector3<T> {
        self.matrix * raw + self.offset
    }
}

/// Inverse models of both triads of an inertial unit: gyro, raw to rad/s, accelerometer, raw to m/s².
pub type Compensation<T> = PerSensor<Affine<T>>;

/// One sample of an inertial unit, gyro x, y, z and accelerometer x, y, z: raw or SI, depending on the context.
pub type Sample<T> = PerSensor<Vector3<T>>;

impl<T: RealField + Copy> Compensation<T> {
    /// SI sample (rad/s, m/s²) in the body frame from a raw one.
    #[inline]
    pub fn apply(&self, raw: &Sample<T>) -> Sample<T> {
        Sample {
            gyro: self.gyro.apply(&raw.gyro),
            accel: self.accel.apply(&raw.accel),
        }
    }
}
