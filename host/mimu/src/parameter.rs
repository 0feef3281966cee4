//! The parameters of a triad: kind, name and unit.

use std::fmt;

use mimu_recording::RawUnit;
use serde::{Serialize, Serializer};

use crate::quantity::{AXES, Sensor, inverse_names, raw_unit, scale_unit};
use crate::triad::{Angles, Estimate, Triad};

/// Kind of a parameter of a triad.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ParameterKind {
    /// Element of the inverse model: of C by rows, then of o.
    Inverse,
    /// Scale factor.
    Scale,
    /// Bias.
    Bias,
    /// Bias plus the contribution of gravity, in a recording with a single pose.
    BiasAndGravity,
    /// Package misalignment.
    Misalignment,
    /// Non-orthogonality.
    NonOrthogonality,
}

/// A parameter of a triad: its kind, and which of that kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TriadParameter(pub ParameterKind, pub usize);

impl ParameterKind {
    /// The physical kinds.
    pub const PHYSICAL: [Self; 4] = [
        Self::Scale,
        Self::Bias,
        Self::Misalignment,
        Self::NonOrthogonality,
    ];

    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Inverse => "inverse model",
            Self::Scale => "scale factor",
            Self::Bias => "bias",
            Self::BiasAndGravity => "bias and gravity",
            Self::Misalignment => "misalignment",
            Self::NonOrthogonality => "non-orthogonality",
        }
    }
}

impl TriadParameter {
    /// The physical parameters in the order of [`Triad::physical_parts`].
    pub fn physical() -> [Self; 12] {
        use ParameterKind::{Bias, Misalignment, NonOrthogonality, Scale};
        let kinds = [Scale, Misalignment, NonOrthogonality, Bias];
        std::array::from_fn(|i| Self(kinds[i / 3], i % 3))
    }

    /// Whether it is a bias, in either direction of the model.
    pub fn is_bias(self) -> bool {
        let Self(kind, k) = self;
        match kind {
            ParameterKind::Bias | ParameterKind::BiasAndGravity => true,
            ParameterKind::Inverse => k >= 9,
            _ => false,
        }
    }

    /// Axis, or the pair of axes; for the inverse model the name of the element.
    pub fn axis(self) -> String {
        let Self(kind, k) = self;
        match kind {
            ParameterKind::Inverse => inverse_names()[k].clone(),
            ParameterKind::NonOrthogonality => ["yz", "zy", "zx"][k].into(),
            _ => AXES[k].into(),
        }
    }
}

/// Its name in files: `C_xy`, `scale_x`.
impl fmt::Display for TriadParameter {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let name = match self.0 {
            ParameterKind::Inverse => return f.write_str(&self.axis()),
            ParameterKind::Scale => "scale",
            ParameterKind::Bias => "bias",
            ParameterKind::BiasAndGravity => "bias_and_gravity",
            ParameterKind::Misalignment => "misalignment",
            ParameterKind::NonOrthogonality => "non_orthogonality",
        };
        write!(f, "{name}_{}", self.axis())
    }
}

impl Serialize for TriadParameter {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// All parameters of a triad with their units, in the order in which they are listed: the inverse model, then the physical parameters.
pub fn parameters(
    triad: &Triad,
    sensor: Sensor,
    raw: RawUnit,
) -> Vec<(TriadParameter, Estimate, String)> {
    let si = sensor.unit();
    let inverse_unit = match raw {
        RawUnit::Si => "1".to_string(),
        other => format!("({si})/{other}"),
    };
    let inverse = triad.inverse_estimates().into_iter().enumerate();
    let inverse = inverse.map(|(k, estimate)| {
        let unit = if k < 9 { &inverse_unit } else { si };
        (
            TriadParameter(ParameterKind::Inverse, k),
            estimate,
            unit.to_string(),
        )
    });
    let physical = triad.physical(Angles::Exact);
    let physical = ParameterKind::PHYSICAL.into_iter().flat_map(|kind| {
        let (estimates, unit) = match kind {
            ParameterKind::Scale => (physical.scale, scale_unit(raw, si)),
            ParameterKind::Misalignment => (physical.misalignment, "rad".into()),
            ParameterKind::NonOrthogonality => (physical.non_orthogonality, "rad".into()),
            _ => (physical.bias, raw_unit(raw, si)),
        };
        let each = estimates.into_iter().enumerate();
        each.map(move |(k, estimate)| (TriadParameter(kind, k), estimate, unit.clone()))
    });
    inverse.chain(physical).collect()
}
