//! What is tried: named effects, terms found from the data, and jumps.

mod monomial;

use nalgebra::{DMatrix, Vector3};

use super::effect::{Behind, Effect, Form, FormKind, Moment, Reading, Scope};
use super::library::readout::{self, Converter};
use super::rows::Rows;
use crate::quantity::AXES;
use crate::quantity::Sensor;

pub use monomial::{Monomial, RATE_LAG_S, Variable};

/// What a candidate is.
#[derive(Debug, Clone)]
pub enum Kind {
    /// A named effect.
    Effect(&'static Effect),
    /// A term found from the data, of one axis.
    Term(usize, Monomial),
    /// The bias of one axis is another from some time on, s, within one recording.
    Jump {
        /// Axis.
        axis: usize,
        /// Index of the recording.
        session: usize,
        /// Time, s since it began.
        t_s: f64,
    },
}

/// What is tried.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Sensor.
    pub sensor: Sensor,
    /// What it is.
    pub kind: Kind,
    /// Which of its coefficients the experiment can tell.
    pub active: Vec<usize>,
    /// Of errors by the code: the converter of each axis that has one. Two axes may share one.
    pub codes: Codes,
    /// As in [`Behind`].
    pub elsewhere: bool,
    /// How many choices it is the best of.
    pub choices: f64,
    /// Coefficients to choose from, where the choice is part of the search.
    pub offered: Vec<usize>,
}

/// Converters of the axes.
pub type Codes = [Option<Converter>; 3];

/// Errors of a converter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OfConverter {
    /// Axis that it reads; `None`: all of them.
    pub axis: Option<usize>,
    /// Its codes.
    pub converter: Converter,
    /// Of its bits from the first down, in units of the weight of the first.
    pub errors: [f64; readout::BITS],
}

/// Most regressors of an effect: nine bits of a converter of three axes, or of three.
const MOST_REGRESSORS: usize = 54;
/// Values of a nonlinear constant that are screened.
const FORMS: usize = 9;

impl Candidate {
    /// Stable name; of a jump what a person reads.
    pub fn id(&self) -> String {
        match &self.kind {
            Kind::Effect(e) => e.id.into(),
            Kind::Term(axis, m) => format!("term:{}_{}~{}", self.sensor, AXES[*axis], m.name()),
            Kind::Jump { axis, session, t_s } => {
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
        matches!(self.kind, Kind::Effect(_))
    }

    /// Its physics in a line.
    pub fn about(&self) -> &'static str {
        match self.kind {
            Kind::Effect(e) => e.about,
            Kind::Term(..) => "a product of what was recorded; no effect of this name is known",
            Kind::Jump { .. } => "the bias is another from here on",
        }
    }

    /// Its nonlinear constant.
    pub fn form(&self) -> Option<Form> {
        match self.kind {
            Kind::Effect(e) => e.form,
            _ => None,
        }
    }

    /// Range in which its nonlinear constant is searched.
    pub fn form_range(&self) -> Option<(f64, f64)> {
        match self.kind {
            Kind::Effect(Effect { form: Some(f), .. }) => Some((f.from, f.to)),
            _ => None,
        }
    }

    /// Values of its nonlinear constant to be screened; 0 if it has none.
    pub fn forms(&self) -> Vec<f64> {
        let Some((from, to)) = self.form_range() else {
            return vec![0.0];
        };
        let step = (to / from).powf(1.0 / (FORMS - 1) as f64);
        (0..FORMS).map(|k| from * step.powi(k as i32)).collect()
    }

    /// A candidate with all of its coefficients but those of the recording alone.
    pub fn new(sensor: Sensor, kind: Kind) -> Self {
        let active = match &kind {
            Kind::Effect(e) => {
                let lasting = |k: &usize| e.coefficients[*k].scope != Scope::Recording;
                (0..e.coefficients.len()).filter(lasting).collect()
            }
            Kind::Term(..) | Kind::Jump { .. } => vec![0],
        };
        Self {
            sensor,
            kind,
            active,
            codes: [None; 3],
            elsewhere: false,
            choices: 1.0,
            offered: Vec::new(),
        }
    }

    /// An effect in `rows`; `None` where it goes by codes that the steps of the readings would have to say, and they have none.
    pub fn effect_in(effect: &'static Effect, rows: &Rows) -> Option<Self> {
        let candidate = Self::new(rows.sensor, Kind::Effect(effect));
        if !candidate.reads_code() {
            return Some(candidate);
        }
        let (lowest, highest) = rows.reading_range();
        let weight = readout::first_weight(rows.step?, lowest, highest);
        Some(candidate.behind_one(Converter::of(weight, 0.0)))
    }

    /// It with one converter for all axes.
    pub fn behind_one(mut self, converter: Converter) -> Self {
        self.active = (0..readout::BITS).collect();
        self.codes = [Some(converter); 3];
        self
    }

    /// Whether its errors are a function of the converter's code.
    pub fn reads_code(&self) -> bool {
        matches!(self.kind, Kind::Effect(e) if readout::is(e))
    }

    /// The candidates that it is tried as: of the bits of a code, which are wrong has to be found as well, so each by itself
    /// and all from the first down to each. The search goes on from the best of these.
    ///
    /// What is of the recording alone is tried as well, and costs its coefficients; of what goes by the temperature, whether the
    /// thermometer is on the same die.
    pub fn variants(mut self, rows: &Rows) -> Vec<Self> {
        if !self.reads_code() {
            let mut whole = self.clone();
            whole.active.extend(self.of_recording());
            let mut all = vec![self];
            if whole.active.len() > all[0].active.len() {
                all.push(whole);
            }
            if rows.thermometer_warms_up()
                && all[0].moves_with(|at| (at.warm_c, at.late_c) = (9.0, 6.0))
            {
                let elsewhere = all.clone().into_iter().map(|c| Self {
                    elsewhere: true,
                    ..c
                });
                all.extend(elsewhere.collect::<Vec<_>>());
            }
            let choices = all.len() as f64;
            all.iter_mut().for_each(|c| c.choices = choices);
            return all;
        }
        let offered = self.active.clone();
        self.offered.clone_from(&offered);
        self.choices = (offered.len() as f64).exp2();
        let with = |active: &[usize]| Self {
            active: active.to_vec(),
            ..self.clone()
        };
        let alone = offered.chunks(1).map(with);
        let down = (2..=offered.len()).map(|k| with(&offered[..k]));
        alone.chain(down).collect()
    }

    /// Coefficients of the recording alone, of the axes that are active.
    fn of_recording(&self) -> Vec<usize> {
        let Kind::Effect(e) = &self.kind else {
            return Vec::new();
        };
        let is_active = |axis| self.active.iter().any(|k| e.coefficients[*k].axis == axis);
        let all = e.coefficients.iter().enumerate();
        all.filter(|(_, c)| c.scope == Scope::Recording && is_active(c.axis))
            .map(|(k, _)| k)
            .collect()
    }

    /// Whether it is a smooth nonlinearity of an axis: a function of the input along its own direction, and of nothing else.
    pub fn is_nonlinearity(&self) -> bool {
        const OF_SCALE: [&str; 3] = ["_scale_quadratic", "_scale_cubic", "_scale_asymmetry"];
        matches!(self.kind, Kind::Effect(e) if OF_SCALE.iter().any(|end| e.id.ends_with(end)))
    }

    /// Whether the readings err by it.
    pub fn is_error(&self) -> bool {
        match &self.kind {
            Kind::Effect(e) => e.is_error(),
            Kind::Term(..) | Kind::Jump { .. } => true,
        }
    }

    /// It and the values of its active coefficients without those that are of a recording alone.
    pub fn lasting(&self, values: &[f64]) -> (Self, Vec<f64>) {
        let Kind::Effect(e) = &self.kind else {
            return (self.clone(), values.to_vec());
        };
        let lasting = |(k, _): &(usize, f64)| e.coefficients[*k].scope != Scope::Recording;
        let all = self.active.iter().copied().zip(values.iter().copied());
        let (active, values) = all.filter(lasting).unzip();
        let lasting = Self {
            active,
            elsewhere: false,
            ..self.clone()
        };
        (lasting, values)
    }

    /// Place among the active coefficients, and axis, of each of its regressors.
    pub fn slots(&self) -> Vec<(usize, usize)> {
        match &self.kind {
            Kind::Effect(e) => {
                let axes = self.active.iter().map(|k| e.coefficients[*k].axis);
                let slots = axes.enumerate().flat_map(|(at, axis)| match axis {
                    Some(axis) => vec![(at, axis)],
                    None => (0..3).map(|axis| (at, axis)).collect(),
                });
                slots.collect()
            }
            Kind::Term(axis, _) | Kind::Jump { axis, .. } => vec![(0, *axis)],
        }
    }

    /// Axis of each of its regressors.
    pub fn axes(&self) -> Vec<usize> {
        self.slots().into_iter().map(|s| s.1).collect()
    }

    /// Adds the errors of the three axes at a moment by `values`, coefficients in the order of the active ones; SI.
    pub fn add_error(&self, at: &Moment, form: f64, values: &[f64], error: &mut Vector3<f64>) {
        let slots = self.slots();
        let mut regressors = [0.0; MOST_REGRESSORS];
        self.regressors(at, form, &mut regressors[..slots.len()]);
        for ((coefficient, axis), regressor) in slots.iter().zip(regressors) {
            error[*axis] += values[*coefficient] * regressor;
        }
    }

    /// Of errors by the code, with the values of its active coefficients: what each converter is off by; one of all axes where that is
    /// all there is to say.
    pub fn by_converter(&self, values: &[f64]) -> Vec<OfConverter> {
        let all: Vec<OfConverter> = (0..3)
            .filter_map(|axis| {
                let mut errors = [0.0; readout::BITS];
                for (k, value) in self.active.iter().zip(values) {
                    let own = k.checked_sub(readout::first_of(axis));
                    let bit = if *k < errors.len() { Some(*k) } else { own };
                    if let Some(error) = bit.and_then(|bit| errors.get_mut(bit)) {
                        *error += value;
                    }
                }
                Some(OfConverter {
                    axis: Some(axis),
                    converter: self.codes[axis]?,
                    errors,
                })
            })
            .collect();
        let first = all.first().copied();
        let alike = |one: &OfConverter| {
            first.is_some_and(|f| (f.converter, f.errors) == (one.converter, one.errors))
        };
        match first {
            Some(one) if all.len() == 3 && all.iter().all(alike) => {
                vec![OfConverter { axis: None, ..one }]
            }
            _ => all,
        }
    }

    /// Name and unit of each of its active coefficients.
    pub fn names(&self) -> Vec<(String, String)> {
        match &self.kind {
            Kind::Effect(e) => {
                let of = |k: &usize| {
                    (
                        e.coefficients[*k].name.into(),
                        e.coefficients[*k].unit.into(),
                    )
                };
                self.active.iter().map(of).collect()
            }
            Kind::Term(axis, m) => vec![(AXES[*axis].into(), m.unit(self.sensor))],
            Kind::Jump { axis, .. } => vec![(AXES[*axis].into(), self.sensor.unit().into())],
        }
    }

    /// Writes the regressors of its active coefficients at a moment.
    pub fn regressors(&self, at: &Moment, form: f64, out: &mut [f64]) {
        match &self.kind {
            Kind::Effect(e) => {
                let at = match self.reads_code() {
                    true => &at.in_bits(&self.codes),
                    false => at,
                };
                let width = |k: usize| e.coefficients[k].axis.map_or(3, |_| 1);
                let mut all = [0.0; MOST_REGRESSORS];
                let count = (0..e.coefficients.len()).map(width).sum();
                (e.regressors)(at, form, &mut all[..count]);
                // Both lists ascend.
                let (mut from, mut to, mut active) = (0, 0, self.active.iter().peekable());
                for k in 0..e.coefficients.len() {
                    if active.next_if_eq(&&k).is_some() {
                        out[to..to + width(k)].copy_from_slice(&all[from..from + width(k)]);
                        to += width(k);
                    }
                    from += width(k);
                }
            }
            Kind::Term(_, m) => out[0] = m.value(at),
            Kind::Jump { session, t_s, .. } => {
                let since = at.session == *session && at.t_s >= *t_s;
                out[0] = f64::from(u8::from(since));
            }
        }
    }

    /// Whether its regressors move with temperature or time; found by moving them, so that no effect has to say it.
    pub fn is_slow(&self) -> bool {
        self.moves_with(|at| {
            (at.t_s, at.on_s, at.warm_c, at.late_c) = (200.0, 200.0, 9.0, 6.0);
        })
    }

    /// Whether its regressors change where `change` does that to a moment at 100 s, 5 °C above the reference, 4 °C behind the lag.
    fn moves_with(&self, change: impl Fn(&mut Moment)) -> bool {
        let early = Moment {
            session: 0,
            t_s: 100.0,
            on_s: 100.0,
            duration_s: 1.0,
            rate: Vector3::new(0.3, 0.5, 0.7),
            force: Vector3::new(3.0, 5.0, 7.0),
            angular_acceleration: Vector3::new(0.2, 0.3, 0.4),
            sensed: Vector3::new(1.0, 2.0, 3.0),
            warm_c: 5.0,
            late_c: 4.0,
            reading: Reading {
                mean: Vector3::repeat(1.0),
                sd: Vector3::repeat(0.1),
                scale: Vector3::repeat(1.0),
            },
        };
        let mut late = early;
        change(&mut late);
        let form = self.forms()[0];
        let count = self.axes().len();
        let mut values = [[0.0; MOST_REGRESSORS]; 2];
        for (at, out) in [early, late].iter().zip(&mut values) {
            self.regressors(at, form, &mut out[..count]);
        }
        values[0] != values[1]
    }

    /// Lag of [`Moment::late_c`] that its regressors want, s.
    pub fn lag_s(&self, form: f64) -> Option<f64> {
        match &self.kind {
            Kind::Effect(Effect { form: Some(f), .. }) if f.kind == FormKind::Lag => Some(form),
            Kind::Term(_, m) if m.lags() => Some(RATE_LAG_S),
            _ => None,
        }
    }

    /// The temperature that its regressors want, where that is not what the thermometer shows.
    pub fn behind(&self, form: f64) -> Option<Behind> {
        let (lag_s, elsewhere) = (self.lag_s(form), self.elsewhere);
        (elsewhere || lag_s.is_some()).then_some(Behind { lag_s, elsewhere })
    }

    /// Its columns in `rows`.
    pub fn columns(&self, rows: &Rows, form: f64) -> DMatrix<f64> {
        self.columns_at(rows, &rows.moments(self.behind(form)), form)
    }

    /// Columns of the one regressor of a term or a jump as an error of each of `axes`: it takes longer to find than to weigh.
    pub fn columns_by_axis(&self, rows: &Rows, axes: &[usize]) -> DMatrix<f64> {
        let moments = rows.moments(self.behind(0.0));
        rows.columns(&moments, axes, |at, out| {
            self.regressors(at, 0.0, &mut out[..1]);
            out.fill(out[0]);
        })
    }

    /// It with all of the coefficients that its search chooses from.
    pub fn with_all_offered(&self) -> Self {
        Self {
            active: self.offered.clone(),
            ..self.clone()
        }
    }

    /// Its columns out of those [with all that are offered](Self::with_all_offered): the share of the time that a bit is set takes an
    /// error function for each moment, and a search over choices of bits asks for the same ones again and again.
    pub fn columns_of(&self, all_offered: &DMatrix<f64>) -> DMatrix<f64> {
        let places = self.active.iter();
        let places: Vec<usize> = places
            .filter_map(|k| self.offered.binary_search(k).ok())
            .collect();
        all_offered.select_columns(&places)
    }

    /// Its columns in `rows` at other moments than theirs.
    pub fn columns_at(&self, rows: &Rows, moments: &[Moment], form: f64) -> DMatrix<f64> {
        let slots = self.slots();
        let all = rows.columns(moments, &self.axes(), |at, out| {
            self.regressors(at, form, out)
        });
        if slots.len() == self.active.len() {
            return all;
        }
        let mut columns = DMatrix::zeros(all.nrows(), self.active.len());
        for (slot, (coefficient, _)) in slots.iter().enumerate() {
            let mut sum = columns.column_mut(*coefficient);
            sum += all.column(slot);
        }
        columns
    }
}
