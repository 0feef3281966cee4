//! An effect, a product found from the data or a jump of a bias, with the choice of its coefficients.

use std::borrow::Cow;

use nalgebra::Vector3;

use super::effect::{Coefficient, Effect, NonlinearParameter, Role, Scope};
use super::quantity::{Conditions, Need, Quantity, RATE_LAG_S};
use super::regressor::{Product, Regressor};
use super::temperature::Followed;
use crate::quantity::AXES;
use crate::quantity::Sensor;

/// Kind of a candidate.
#[derive(Debug, Clone, PartialEq)]
pub enum CandidateKind {
    /// A named effect.
    Effect(&'static Effect),
    /// A product found from the data, in the error of one axis.
    Term(usize, Product),
    /// A jump in the bias of one axis, within one recording.
    Jump {
        /// Axis.
        axis: usize,
        /// Index of the recording.
        session: usize,
        /// Time, s since it began.
        t_s: f64,
    },
}

impl CandidateKind {
    /// Its coefficients; a product and a jump have one, whose size no data sheet gives.
    pub fn coefficients(&self) -> Cow<'static, [Coefficient]> {
        let (axis, regressor) = match *self {
            Self::Effect(effect) => return Cow::Borrowed(effect.coefficients),
            Self::Term(axis, product) => (axis, Regressor::Product(product)),
            Self::Jump { axis, session, t_s } => (axis, Regressor::Since { session, t_s }),
        };
        let one = Coefficient::of(axis, AXES[axis], regressor, f64::NAN);
        Cow::Owned(vec![one])
    }
}

/// An effect, a product or a jump that a search tries.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Sensor.
    pub sensor: Sensor,
    /// Its kind.
    pub kind: CandidateKind,
    /// Coefficients that the experiment determines.
    pub active: Vec<usize>,
    /// As in [`Followed`].
    pub without_self_heating: bool,
    /// Coefficients that the experiment would show at data-sheet size.
    pub excited: Vec<usize>,
    /// Coefficients that the experiment shows, but does not separate from the active ones and the affine parameters.
    pub inseparable: Vec<usize>,
    /// Number of choices among which it is the best.
    pub choices: f64,
    /// Coefficients among which the search chooses.
    pub offered: Vec<usize>,
}

/// Number of values of a nonlinear parameter that are screened.
const SCREENED: usize = 9;

impl Candidate {
    /// Stable name; for a jump, a description in words.
    pub fn id(&self) -> String {
        match &self.kind {
            CandidateKind::Effect(e) => e.id.into(),
            CandidateKind::Term(axis, m) => {
                format!("term:{}_{}~{}", self.sensor, AXES[*axis], m.name())
            }
            CandidateKind::Jump { axis, session, t_s } => {
                let place = match session {
                    0 => String::new(),
                    later => format!(" of recording {}", later + 1),
                };
                format!(
                    "jump of {}_{} at {t_s:.0} s{place}",
                    self.sensor, AXES[*axis]
                )
            }
        }
    }

    /// Whether it is an effect of the library.
    pub fn is_listed(&self) -> bool {
        matches!(self.kind, CandidateKind::Effect(_))
    }

    /// Its physics in a line.
    pub fn about(&self) -> &'static str {
        match self.kind {
            CandidateKind::Effect(e) => e.about,
            CandidateKind::Term(..) => {
                "a product of recorded quantities without a physical name here"
            }
            CandidateKind::Jump { .. } => "the bias changes here",
        }
    }

    /// Its nonlinear parameter.
    pub fn parameter(&self) -> Option<NonlinearParameter> {
        match self.kind {
            CandidateKind::Effect(e) => e.parameter,
            _ => None,
        }
    }

    /// Values of its nonlinear parameter to be screened; 0 if it has none.
    pub fn parameters(&self) -> Vec<f64> {
        let Some(NonlinearParameter { from, to, .. }) = self.parameter() else {
            return vec![0.0];
        };
        let step = (to / from).powf(1.0 / (SCREENED - 1) as f64);
        (0..SCREENED).map(|k| from * step.powi(k as i32)).collect()
    }

    /// A candidate with all coefficients except those specific to the recording.
    pub fn new(sensor: Sensor, kind: CandidateKind) -> Self {
        let all = kind.coefficients();
        let lasting = |k: &usize| all[*k].scope != Scope::Recording;
        Self {
            sensor,
            active: (0..all.len()).filter(lasting).collect(),
            kind,
            without_self_heating: false,
            excited: Vec::new(),
            inseparable: Vec::new(),
            choices: 1.0,
            offered: Vec::new(),
        }
    }

    /// An effect in the place of this one: on the same axes, if it has separate coefficients for these, and following the same temperature.
    pub fn replaced_by(&self, effect: &'static Effect) -> Self {
        let axes = self.axes();
        let mut other = Self::new(self.sensor, CandidateKind::Effect(effect));
        let of_axes = |k: &usize| {
            effect.coefficients[*k]
                .axis
                .is_none_or(|a| axes.contains(&a))
        };
        other.active.retain(of_axes);
        other.without_self_heating = self.without_self_heating;
        other
    }

    /// Coefficients specific to the recording, for the axes that have an active coefficient.
    pub(crate) fn of_recording(&self) -> Vec<usize> {
        let all = self.kind.coefficients();
        let is_active = |axis| self.active.iter().any(|k| all[*k].axis == axis);
        let each = all.iter().enumerate();
        each.filter(|(_, c)| c.scope == Scope::Recording && is_active(c.axis))
            .map(|(k, _)| k)
            .collect()
    }

    /// The coefficient that `k` requires. A curvature requires the slope, because the temperature from which it counts is a convention. A coefficient
    /// specific to the recording requires the lasting one of its axis.
    pub(crate) fn rests_on(&self, k: usize) -> Option<usize> {
        let all = self.kind.coefficients();
        let own = &all[k];
        let base = |other: &Coefficient| match own.scope {
            Scope::Recording => other.scope != Scope::Recording,
            _ => other.regressor.is_slope_of(&own.regressor),
        };
        all.iter()
            .position(|other| other.axis == own.axis && base(other))
    }

    /// Excited coefficients on other axes that correspond to an active one. What acts on one axis acts on the others too, so these are fitted with it
    /// even if they are small; without them the intervals of the calibration would be too narrow.
    pub fn siblings(&self) -> Vec<usize> {
        let all = self.kind.coefficients();
        let like = |a: &usize, b: &usize| all[*a].typical == all[*b].typical;
        let new = self.excited.iter().filter(|k| !self.active.contains(k));
        new.filter(|k| self.active.iter().any(|a| like(a, k)))
            .copied()
            .collect()
    }

    /// Penalty for coefficients `values` beyond data-sheet size, in units of the deviance. Sizes are assumed log-normal, with a factor of ten at two
    /// sigmas.
    pub(crate) fn unlikely(&self, values: &[f64]) -> f64 {
        let all = self.kind.coefficients();
        let each = self.active.iter().zip(values).map(|(k, value)| {
            // A product found from the data has no size in data sheets: NaN, which max() drops.
            let ratio = value.abs() / all[*k].typical;
            (2.0 * ratio.log10().max(0.0)).powi(2)
        });
        each.sum()
    }

    /// Regressors of its active coefficients.
    fn active_regressors(&self) -> Vec<Regressor> {
        let all = self.kind.coefficients();
        self.active.iter().map(|k| all[*k].regressor).collect()
    }

    /// Regressor of each of its [slots](Self::slots).
    pub fn slot_regressors(&self) -> Vec<Regressor> {
        let all = self.active_regressors();
        self.slots().iter().map(|(k, _)| all[*k]).collect()
    }

    /// Whether it is a smooth nonlinearity of an axis: it depends only on the input along that axis.
    pub fn is_nonlinearity(&self) -> bool {
        let mut all = self.active_regressors().into_iter().peekable();
        let any = all.peek().is_some();
        any && all.all(|r| r.quantities() == [Quantity::Input])
    }

    /// Whether `need` has to be known to compute its error.
    pub(crate) fn needs(&self, need: Need) -> bool {
        let all = self.active_regressors();
        all.iter().any(|r| r.needs(need, self.sensor))
    }

    /// Whether it is an error of the readings; a true input is none.
    pub fn is_error(&self) -> bool {
        match &self.kind {
            CandidateKind::Effect(e) => e.is_error(),
            CandidateKind::Term(..) | CandidateKind::Jump { .. } => true,
        }
    }

    /// Whether it is specific to a session.
    pub fn is_of_session(&self) -> bool {
        matches!(self.kind, CandidateKind::Effect(e) if e.is_of_session())
    }

    /// The candidate and the values of its coefficients, without those specific to a recording.
    pub fn lasting(&self, values: &[f64]) -> (Self, Vec<f64>) {
        let all = self.kind.coefficients();
        let lasting = |(k, _): &(usize, f64)| all[*k].scope != Scope::Recording;
        let all = self.active.iter().copied().zip(values.iter().copied());
        let (active, values) = all.filter(lasting).unzip();
        let lasting = Self {
            active,
            without_self_heating: false,
            ..self.clone()
        };
        (lasting, values)
    }

    /// For each of its regressors: the index of the coefficient among the active ones, and the axis.
    pub fn slots(&self) -> Vec<(usize, usize)> {
        let all = self.kind.coefficients();
        let axes = self.active.iter().map(|k| all[*k].axes());
        let slots = axes.enumerate();
        let slots = slots.flat_map(|(at, axes)| axes.map(move |axis| (at, axis)));
        slots.collect()
    }

    /// Axis of each of its regressors.
    pub fn axes(&self) -> Vec<usize> {
        self.slots().into_iter().map(|s| s.1).collect()
    }

    /// Adds its errors of the three axes, SI. `values` are the coefficients in the order of the active ones.
    pub fn add_error(
        &self,
        at: &Conditions,
        parameter: f64,
        values: &[f64],
        error: &mut Vector3<f64>,
    ) {
        let slots = self.slots();
        let mut regressors = vec![0.0; slots.len()];
        self.regressors(at, parameter, &mut regressors);
        for ((coefficient, axis), regressor) in slots.iter().zip(regressors) {
            error[*axis] += values[*coefficient] * regressor;
        }
    }

    /// Name and unit of each of its active coefficients.
    pub fn names(&self) -> Vec<(String, String)> {
        let all = self.kind.coefficients();
        let of = |k: &usize| {
            let unit = match self.kind {
                CandidateKind::Term(_, product) => product.term_unit(self.sensor),
                _ => all[*k].unit(self.sensor),
            };
            (all[*k].name.into(), unit)
        };
        self.active.iter().map(of).collect()
    }

    /// Writes the values of its regressors under the conditions `at`, one for each slot.
    pub fn regressors(&self, at: &Conditions, parameter: f64, out: &mut [f64]) {
        let all = self.kind.coefficients();
        let mut out = out.iter_mut();
        for k in &self.active {
            for (axis, out) in all[*k].axes().zip(&mut out) {
                *out = all[*k].regressor.value(at, parameter, axis);
            }
        }
    }

    /// Whether it is a bias that depends only on temperature or time.
    pub fn is_slow_bias(&self) -> bool {
        let all = self.active_regressors();
        let slow = |r: &Regressor| {
            !r.quantities().is_empty() && r.quantities().iter().all(|q| q.is_slow())
        };
        !all.is_empty() && all.iter().all(slow)
    }

    /// Whether it depends on temperature or time.
    pub fn is_slow(&self) -> bool {
        self.active_regressors().iter().any(Regressor::is_slow)
    }

    /// Whether it depends on the time since power-on.
    pub fn depends_on_time(&self) -> bool {
        let mut all = self.active_regressors().into_iter();
        all.any(|r| r.quantities().contains(&Quantity::Time))
    }

    /// Whether it depends on the temperature.
    pub fn is_thermal(&self) -> bool {
        self.needs(Need::Temperature)
    }

    /// Lag of the temperature that its regressors use, s.
    pub fn lag_s(&self, parameter: f64) -> Option<f64> {
        match &self.kind {
            CandidateKind::Effect(e) if e.parameter.is_some_and(|p| p.role == Role::Lag) => {
                Some(parameter)
            }
            CandidateKind::Term(_, p) if p.parts().any(|f| f.0 == Quantity::TemperatureRate) => {
                Some(RATE_LAG_S)
            }
            _ => None,
        }
    }

    /// The temperature that its regressors use, if it is not the recorded one.
    pub fn followed(&self, parameter: f64) -> Option<Followed> {
        let (lag_s, without_self_heating) = (self.lag_s(parameter), self.without_self_heating);
        (without_self_heating || lag_s.is_some()).then_some(Followed {
            lag_s,
            without_self_heating,
        })
    }
}
