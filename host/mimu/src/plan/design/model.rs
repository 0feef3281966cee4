//! Regressors of the calibration models, their parameters and units.

use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

use nalgebra::Vector3;

use crate::observation::{LOWER, free, place, slope};
use crate::quantity::{AXES, Sensor};
use crate::readable;
use mimu_recording::Reference;

/// Standard gravity, m/s²: magnitude of the specific force at rest. Local gravity differs by parts in a
/// thousand, which changes no design.
pub const GRAVITY: f64 = readable::STANDARD_GRAVITY;

/// Input of one dwell: an attitude and, on a turntable, a rate about the vertical.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setting {
    /// Direction in the body frame that points up, of length 1. Specific force at rest is along it.
    pub up: Vector3<f64>,
    /// Rate about the upward vertical, rad/s, right-hand rule; in the body frame `rate * up`.
    pub rate: f64,
}

impl Setting {
    /// At rest with `up` (any length) pointing up.
    pub fn at_rest(up: Vector3<f64>) -> Self {
        Self {
            up: up.normalize(),
            rate: 0.0,
        }
    }
}

/// A group of parameters beyond the affine ones, fang (15), (17).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Term {
    /// Square of the input along the sensor's own axis. (Not all three squares: on the sphere of gravity they
    /// add up to a constant, which is the bias.)
    Quadratic,
    /// Cube of the input along the sensor's own axis.
    Cubic,
    /// Products of the inputs along two axes: xy, yz, zx.
    Cross,
    /// Rate bias linear in specific force; gyros only.
    GSensitivity,
}

impl Term {
    /// All terms that a sensor may have.
    pub fn of(sensor: Sensor) -> &'static [Self] {
        match sensor {
            Sensor::Gyro => &[
                Self::Quadratic,
                Self::Cubic,
                Self::Cross,
                Self::GSensitivity,
            ],
            Sensor::Accel => &[Self::Quadratic, Self::Cubic, Self::Cross],
        }
    }

    /// Name as on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Quadratic => "quadratic",
            Self::Cubic => "cubic",
            Self::Cross => "cross",
            Self::GSensitivity => "g-sensitivity",
        }
    }
}

/// Terms of a model: `affine`, then any others, separated by commas.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Terms(Vec<Term>);

impl Terms {
    /// Whether there are no others.
    pub fn is_affine(&self) -> bool {
        self.0.is_empty()
    }
}

impl FromStr for Terms {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut terms = Vec::new();
        for name in text.split(',').map(str::trim) {
            let known = Term::of(Sensor::Gyro).iter().find(|t| t.name() == name);
            match known {
                Some(term) => terms.push(*term),
                None if name == "affine" => {}
                None => {
                    return Err(format!(
                        "{name:?} is not a term; write affine, quadratic, cubic, cross or g-sensitivity"
                    ));
                }
            }
        }
        terms.sort_unstable();
        terms.dedup();
        Ok(Self(terms))
    }
}

/// A parameter and its units.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// `b_x`, `P_xy`, `C_yx`, `quadratic_z`, ...
    pub name: String,
    /// Unit in SI; "1" for a ratio.
    pub unit: &'static str,
    /// Parameter in SI over its normalised value, which is in the sensor's SI unit at full input.
    pub si: f64,
    /// Unit for display.
    pub shown_unit: Cow<'static, str>,
    /// Parameter in that unit over its normalised value.
    pub shown: f64,
}

/// A calibration model of one triad: which regressors a setting has.
///
/// Inputs are normalised by the full input, so that all regressors are of order one: that is what makes
/// determinants comparable with fang (22), r = 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// Sensor.
    pub sensor: Sensor,
    /// Known input, forward form, fang (19); or the magnitude of gravity only, linearised about a perfect triad.
    pub reference: Reference,
    /// Terms beyond the affine ones, ascending.
    pub terms: Vec<Term>,
    /// Full input along x, y, z, SI: gravity, or the largest rate.
    pub span: Vector3<f64>,
}

impl Model {
    /// Of an accelerometer.
    pub fn accel(reference: Reference, terms: &Terms) -> Self {
        Self {
            sensor: Sensor::Accel,
            reference,
            terms: terms.0.clone(),
            span: Vector3::repeat(GRAVITY),
        }
    }

    /// Of a gyro triad on a turntable, with the largest rate along each axis, rad/s.
    pub fn gyro(terms: &Terms, span: Vector3<f64>) -> Self {
        Self {
            sensor: Sensor::Gyro,
            reference: Reference::Table,
            terms: terms.0.clone(),
            span,
        }
    }

    /// Whether a gyro's reading depends on the direction of gravity as well as on the rate.
    pub fn feels_force(&self) -> bool {
        self.terms.contains(&Term::GSensitivity)
    }

    /// Number of independent regressions: one for each sensor of the triad with a known input, one for all of
    /// them where only the magnitude of gravity is known.
    pub fn regressions(&self) -> usize {
        match self.reference {
            Reference::Table => 3,
            Reference::Gravity | Reference::TurntableRate => 1,
        }
    }

    /// Number of regressions that a design has to look at: one where all three sensors have the same
    /// regressors.
    pub fn distinct_regressions(&self) -> usize {
        let own = |t: &Term| matches!(t, Term::Quadratic | Term::Cubic);
        match self.terms.iter().any(own) {
            true => self.regressions(),
            false => 1,
        }
    }

    /// Input of a setting over the full input.
    pub fn input(&self, setting: &Setting) -> Vector3<f64> {
        match self.sensor {
            Sensor::Accel => setting.up,
            Sensor::Gyro => (setting.up * setting.rate).component_div(&self.span),
        }
    }

    /// Appends the regressors of `setting` in a regression (the axis, with a known input): as many as
    /// [`Self::parameters`].
    pub fn regressors(&self, regression: usize, setting: &Setting, row: &mut Vec<f64>) {
        self.affine(setting, row);
        for term in &self.terms {
            self.term(*term, regression, setting, row);
        }
    }

    fn affine(&self, setting: &Setting, row: &mut Vec<f64>) {
        let x = self.input(setting);
        match self.reference {
            Reference::Table => row.extend([1.0, x.x, x.y, x.z]),
            Reference::Gravity | Reference::TurntableRate => {
                row.extend(&free(&slope(&setting.up, &x), &LOWER));
            }
        }
    }

    /// Appends the regressors of one term.
    pub fn term(&self, term: Term, regression: usize, setting: &Setting, row: &mut Vec<f64>) {
        let x = self.input(setting);
        let power = if term == Term::Quadratic { 2 } else { 3 };
        match (self.reference, term) {
            (Reference::Table, Term::Quadratic | Term::Cubic) => {
                row.push(x[regression].powi(power))
            }
            (Reference::Table, Term::Cross) => row.extend([x.x * x.y, x.y * x.z, x.z * x.x]),
            (Reference::Gravity | Reference::TurntableRate, Term::Quadratic | Term::Cubic) => {
                row.extend([0, 1, 2].map(|i| setting.up[i] * x[i].powi(power)));
            }
            (Reference::Gravity | Reference::TurntableRate, Term::Cross) => {
                for i in 0..3 {
                    row.extend(PRODUCTS.map(|(j, k)| setting.up[i] * x[j] * x[k]));
                }
            }
            (_, Term::GSensitivity) => row.extend([setting.up.x, setting.up.y, setting.up.z]),
        }
    }

    /// Parameters of a regression, in the order of its regressors.
    pub fn parameters(&self, regression: usize) -> Vec<Parameter> {
        let mut list = Vec::new();
        let span = self.span;
        let sensors: &[usize] = match self.reference {
            Reference::Table => &[regression][..],
            Reference::Gravity | Reference::TurntableRate => &[0, 1, 2],
        };
        let matrix = |letter: char, i: usize, j: usize| {
            let shown = if i == j { "ppm" } else { "µrad" };
            parameter(
                format!("{letter}_{}{}", AXES[i], AXES[j]),
                "1",
                1.0 / span[j],
                shown,
                1e6 / span[j],
            )
        };
        let bias = |letter: char, i: usize| {
            let unit = self.sensor.unit();
            let shown = readable::parameter(unit);
            parameter(
                format!("{letter}_{}", AXES[i]),
                unit,
                1.0,
                shown.unit,
                shown.factor,
            )
        };
        match self.reference {
            Reference::Table => {
                list.push(bias('b', regression));
                list.extend((0..3).map(|j| matrix('P', regression, j)));
            }
            Reference::Gravity | Reference::TurntableRate => {
                list.extend(LOWER.map(|k| match place(k) {
                    (i, Some(j)) => matrix('C', i, j),
                    (i, None) => bias('o', i),
                }));
            }
        }
        let full = "ppm FS";
        let gyro = self.sensor == Sensor::Gyro;
        for term in &self.terms {
            for &i in sensors {
                let own = AXES[i];
                match term {
                    Term::Quadratic => {
                        let unit = if gyro { "1/(rad/s)" } else { "1/(m/s^2)" };
                        let si = span[i].powi(-2);
                        list.push(parameter(
                            format!("quadratic_{own}"),
                            unit,
                            si,
                            full,
                            1e6 / span[i],
                        ));
                    }
                    Term::Cubic => {
                        let unit = if gyro { "1/(rad/s)^2" } else { "1/(m/s^2)^2" };
                        let si = span[i].powi(-3);
                        list.push(parameter(
                            format!("cubic_{own}"),
                            unit,
                            si,
                            full,
                            1e6 / span[i],
                        ));
                    }
                    Term::Cross => list.extend(PRODUCTS.map(|(j, k)| {
                        let unit = if gyro { "1/(rad/s)" } else { "1/(m/s^2)" };
                        let name = format!("cross_{own}_{}{}", AXES[j], AXES[k]);
                        parameter(name, unit, 1.0 / (span[j] * span[k]), full, 1e6 / span[i])
                    })),
                    Term::GSensitivity => list.extend((0..3).map(|j| {
                        let name = format!("g_sensitivity_{own}{}", AXES[j]);
                        let shown = 1f64.to_degrees();
                        parameter(name, "(rad/s)/(m/s^2)", 1.0 / GRAVITY, "(deg/s)/g", shown)
                    })),
                }
            }
        }
        list
    }
}

impl fmt::Display for Model {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("affine")?;
        self.terms
            .iter()
            .try_for_each(|t| write!(f, ",{}", t.name()))
    }
}
/// Pairs of axes of the cross terms.
const PRODUCTS: [(usize, usize); 3] = [(0, 1), (1, 2), (2, 0)];

fn parameter(
    name: String,
    unit: &'static str,
    si: f64,
    shown_unit: impl Into<Cow<'static, str>>,
    shown: f64,
) -> Parameter {
    Parameter {
        name,
        unit,
        si,
        shown_unit: shown_unit.into(),
        shown,
    }
}
