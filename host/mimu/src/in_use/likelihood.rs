//! The likelihood of variance components: a Kalman filter over the segments of a session, whose state is what they have in common.
//!
//! The innovations of such a filter are independent, so their likelihood is that of all errors together (Schweppe 1965). Unknowns of the session enter
//! with a wide prior, and cost degrees of freedom as in restricted maximum likelihood (Patterson and Thompson 1971).

use nalgebra::{Cholesky, DMatrix, DVector, Matrix3};

use super::closure::{Closure, scales};
use super::component::{Component, Kind};
use super::estimates::{Smoothed, SmoothedState};
use super::state::{CLOCK, G_SENSITIVITY, GRAVITY, LEVER, MOUNTING, STATES, offset};
use crate::estimate::earth;
use crate::quantity::{PerSensor, Sensor};
use crate::readable::STANDARD_GRAVITY;

/// Standard deviations of what a filter knows nothing of: biases (rad/s, m/s²), and how a reference is mounted (m, rad, m/s², s).
const BIAS: [f64; 2] = [0.2, 1.0];
const MOUNTED: [f64; 4] = [0.1, 0.1, 0.3, 0.1];

/// The errors of a session, and what is known beforehand.
pub(super) struct Session {
    /// In order of time.
    pub closures: Vec<Closure>,
    pub components: Vec<Component>,
    /// Squares of the random walks by the noise file, SI²/s, on every axis of gyro and accelerometer.
    pub walks: PerSensor<[f64; 3]>,
    /// Covariance of the calibration: C by rows and o of the gyro, then of the accelerometer.
    pub calibration: DMatrix<f64>,
    pub matrices: PerSensor<Matrix3<f64>>,
    /// Whether a trajectory is the reference.
    pub mounted: bool,
    /// Whether the latitude is known, and the Earth's rate about the vertical with it.
    pub earth_is_known: bool,
}

/// A model of the errors.
#[derive(Debug, Clone)]
pub(super) struct Model {
    /// Values of all components, in their units; 0 for those that it lacks.
    pub values: Vec<f64>,
    /// Whether the filter knows that the calibration is uncertain.
    pub calibration: bool,
}

/// Squared innovation of a segment by its covariance, and its number of errors.
#[derive(Debug, Clone, Copy)]
pub(super) struct Innovation {
    pub segment: usize,
    pub squared: f64,
    pub count: usize,
}

/// A filter's knowledge after a segment.
struct Updated<'a> {
    segment: usize,
    squared: f64,
    log_det: f64,
    x: &'a DVector<f64>,
    p: &'a DMatrix<f64>,
}

/// The state that a model uses, and its covariance at the beginning.
struct Prior {
    states: Vec<usize>,
    covariance: DMatrix<f64>,
}

impl Session {
    /// Log-likelihood of the segments that `counts` accepts (by index), rests included; `None` if a covariance is singular.
    pub fn log_likelihood(&self, model: &Model, counts: impl Fn(usize) -> bool) -> Option<f64> {
        let mut sum = 0.0;
        self.filter(model, &counts, |own| {
            sum -= 0.5 * (own.squared + own.log_det)
        })?;
        sum.is_finite().then_some(sum)
    }

    /// The innovations of the segments in motion, each predicted by all before it.
    pub fn innovations(&self, model: &Model) -> Option<Vec<Innovation>> {
        let mut all = Vec::new();
        self.filter(model, &|_| true, |own| {
            all.push(Innovation {
                segment: own.segment,
                squared: own.squared,
                count: self.closures[own.segment].residual.len(),
            });
        })?;
        all.retain(|own| self.closures[own.segment].moves);
        Some(all)
    }

    /// The state by all segments, those before and after each (Rauch, Tung and Striebel 1965); `None` if a covariance is singular.
    pub fn smoothed(&self, model: &Model) -> Option<Smoothed> {
        let mut updated = Vec::new();
        self.filter(model, &|_| true, |own| {
            updated.push((own.segment, own.x.clone(), own.p.clone()));
        })?;
        let Prior { states, .. } = self.prior(model);
        let walks = self.walks_of(model, &states);
        let (last, mut x, mut p) = updated.pop()?;
        let smoothed = |segment: usize, x: &DVector<f64>, p: &DMatrix<f64>| {
            let mut own = SmoothedState {
                at_s: self.closures[segment].at_s,
                value: DVector::zeros(STATES),
                sigma: DVector::zeros(STATES),
            };
            for (k, state) in states.iter().enumerate() {
                own.value[*state] = x[k];
                own.sigma[*state] = p[(k, k)].max(0.0).sqrt();
            }
            own
        };
        let mut each = vec![smoothed(last, &x, &p)];
        let mut after_s = self.closures[last].at_s;
        for (segment, own, of_own) in updated.into_iter().rev() {
            let before_s = std::mem::replace(&mut after_s, self.closures[segment].at_s);
            let mut predicted = of_own.clone();
            for (k, walk) in walks.iter().enumerate() {
                predicted[(k, k)] += walk * (before_s - after_s);
            }
            let back = Cholesky::new(predicted.clone())?.solve(&of_own);
            x = &own + back.transpose() * (x - &own);
            p = &of_own + back.transpose() * (p - predicted) * back;
            each.push(smoothed(segment, &x, &p));
        }
        each.reverse();
        Some(Smoothed(each))
    }

    /// Runs the filter; `each` receives what it knows after each segment.
    fn filter(
        &self,
        model: &Model,
        counts: &impl Fn(usize) -> bool,
        mut each: impl FnMut(Updated),
    ) -> Option<()> {
        let Prior {
            states,
            covariance: mut p,
        } = self.prior(model);
        let mut x = DVector::zeros(states.len());
        let walks = self.walks_of(model, &states);
        let mut before_s = self.closures.first()?.at_s;
        for (index, closure) in self.closures.iter().enumerate() {
            let dt = closure.at_s - before_s;
            before_s = closure.at_s;
            for (k, walk) in walks.iter().enumerate() {
                p[(k, k)] += walk * dt;
            }
            if !counts(index) {
                continue;
            }
            let by = closure.by.select_columns(&states);
            let s = self.covariance(closure, model) + &by * &p * by.transpose();
            let root = Cholesky::new(s)?;
            let innovation = &closure.residual - &by * &x;
            let white = root.solve(&innovation);
            let log_det = 2.0
                * root
                    .l_dirty()
                    .diagonal()
                    .iter()
                    .map(|d| d.ln())
                    .sum::<f64>();
            let squared = innovation.dot(&white);
            let gain = root.solve(&(&by * &p));
            x += gain.transpose() * &innovation;
            p -= (&by * &p).transpose() * gain;
            p = (&p + p.transpose()) * 0.5;
            each(Updated {
                segment: index,
                squared,
                log_det,
                x: &x,
                p: &p,
            });
        }
        Some(())
    }

    /// Covariance of the errors of a segment without the state.
    pub fn covariance(&self, closure: &Closure, model: &Model) -> DMatrix<f64> {
        let mut sum = closure.known.clone();
        for (component, value) in self.components.iter().zip(&model.values) {
            if let Kind::Share(share) = &component.kind
                && *value > 0.0
            {
                sum += closure.share(*share) * (value * component.unit);
            }
        }
        // Errors of rounding, and of the linearisation: 1 µrad, 1 µm/s.
        for k in 0..sum.nrows() {
            sum[(k, k)] += 1e-12;
        }
        sum
    }

    /// What component `k` adds to the errors of a segment at a value of 1, for a filter that learns nothing of it.
    pub fn unlearned(&self, closure: &Closure, k: usize) -> DMatrix<f64> {
        let component = &self.components[k];
        match &component.kind {
            Kind::Share(share) => closure.share(*share) * component.unit,
            Kind::Matrix(sensor) => {
                let by = scales(&closure.by, *sensor, &self.matrices[*sensor]);
                &by * by.transpose() * component.unit
            }
            Kind::Session(range) => {
                let by = closure.by.columns(range.start, range.len()).into_owned();
                &by * by.transpose() * component.unit
            }
            Kind::Walk(_) => DMatrix::zeros(closure.residual.len(), closure.residual.len()),
        }
    }

    fn walks_of(&self, model: &Model, states: &[usize]) -> Vec<f64> {
        let more = |sensor: Sensor| -> f64 {
            let own = self.components.iter().zip(&model.values);
            own.filter(|(c, _)| c.kind == Kind::Walk(sensor))
                .map(|(c, value)| c.unit * value)
                .sum()
        };
        let more = Sensor::BOTH.map(more);
        let walk = |state: &usize| {
            Sensor::BOTH.into_iter().find_map(|s| {
                let own = offset(s);
                own.contains(state)
                    .then(|| self.walks[s][state - own.start] + more[s as usize])
            })
        };
        states.iter().map(|s| walk(s).unwrap_or(0.0)).collect()
    }

    fn prior(&self, model: &Model) -> Prior {
        let mut all = DMatrix::<f64>::zeros(STATES, STATES);
        if model.calibration {
            all.view_mut((0, 0), (24, 24)).copy_from(&self.calibration);
        }
        for sensor in Sensor::BOTH {
            for k in offset(sensor) {
                all[(k, k)] += BIAS[sensor as usize].powi(2);
            }
        }
        if !self.earth_is_known && !self.mounted {
            // The Earth turns about the vertical, as if the gyro sensed gravity.
            for k in G_SENSITIVITY {
                all[(k, k)] += (earth::RATE / STANDARD_GRAVITY).powi(2) / 3.0;
            }
        }
        if self.mounted {
            let ranges = [LEVER, MOUNTING, GRAVITY, CLOCK..CLOCK + 1];
            for (range, sigma) in ranges.into_iter().zip(MOUNTED) {
                for k in range {
                    all[(k, k)] = sigma * sigma;
                }
            }
        }
        for (component, value) in self.components.iter().zip(&model.values) {
            let variance = value * component.unit;
            match &component.kind {
                Kind::Session(range) => {
                    for k in range.clone() {
                        all[(k, k)] += variance;
                    }
                }
                Kind::Matrix(sensor) if variance > 0.0 => {
                    let from = super::state::matrix(*sensor).start;
                    let c = &self.matrices[*sensor];
                    // E C: the rows of E are independent, so those of its product are, with covariance C' C.
                    let row = c.transpose() * c * variance;
                    for i in 0..3 {
                        let mut block = all.view_mut((from + 3 * i, from + 3 * i), (3, 3));
                        block += row;
                    }
                }
                _ => {}
            }
        }
        let states: Vec<usize> = (0..STATES).filter(|k| all[(*k, *k)] > 0.0).collect();
        let covariance = all.select_rows(&states).select_columns(&states);
        Prior { states, covariance }
    }
}
