//! Both triads under a known input: on a table, or in steps of known rate and force.

use std::borrow::Cow;

use nalgebra::{DMatrix, DVector, Vector3};

use super::hold_out::{Refits, Split, determined};
use super::judged::Judged;
use super::predicted::LinearAxis;
use super::reference_error::{Influence, Influences};
use super::sensor::{Residual, SensorFit, typical};
use super::{Options, finish, lever_arm, refuse_wrong_gravity};
use crate::estimate::{Estimated, Failure, Observation, known_input};
use crate::judging::rms;
use crate::observable::Observable;
use crate::observation::slope;
use crate::prepared::{Prepared, si_covariance};
use crate::quantity::{Figure, Sensor};
use crate::unseen::Unseen;
use crate::warning::Warning;
use mimu_recording::error::{Argument, Error, Result};

/// Rates that differ by less are the same, rad/s: a thousandth of the Earth's, whose subtraction leaves rounding errors.
const SAME_RATE: f64 = 7e-8;

pub(super) fn fit_known(
    prepared: &Prepared,
    options: Options,
    warnings: &mut Vec<Warning>,
) -> Result<Vec<SensorFit>> {
    let mut sensors = Vec::new();
    let mut missing = Vec::new();
    let wanted = |s: &Sensor| prepared.has(*s) && options.wants(*s);
    for sensor in Sensor::BOTH.into_iter().filter(wanted) {
        let observations = prepared.observations(sensor);
        if observations.is_empty() {
            let unused = prepared.dwells.unused(sensor);
            missing.push(Warning::NoInput { why: unused }.of(sensor));
            continue;
        }
        refuse_wrong_gravity(prepared, sensor, &observations)?;
        let known = Known::of(prepared, options, sensor, observations);
        let estimated = match known.estimate(&known.weighed, &known.within) {
            Ok(estimated) => estimated,
            // A level cube does not determine the gyro, and a rate table hardly the accelerometer.
            Err(_) if known.has_one_input() => {
                missing.push(Warning::OneInput.of(sensor));
                continue;
            }
            Err(failure) => {
                let error = prepared.refused(failure, sensor);
                let other = Sensor::BOTH.into_iter().find(|s| *s != sensor && wanted(s));
                return Err(match other {
                    Some(other) => error
                        .map(|e| e.remedy += &format!("; or fit the {other} alone"))
                        .about(Argument::Only),
                    None => error,
                });
            }
        };
        warnings.extend(known.warnings().into_iter().map(|w| w.of(sensor)));
        sensors.push(known.judged(estimated)?);
    }
    if sensors.is_empty() {
        let why: Vec<String> = missing.iter().map(Warning::to_string).collect();
        let error = Error::new(
            &prepared.place,
            why.join(", "),
            "give the inputs of dwells of a second or more in the ref_ columns, or set reference = \"gravity\" if there was no table",
        );
        let judged = Sensor::BOTH.into_iter().filter(wanted);
        let mut judged = judged.filter(|s| prepared.dwells.are_judged_not_still(*s));
        return Err(match judged.next() {
            Some(sensor) => prepared.with_steps_as_given(error, sensor),
            None => error,
        });
    }
    warnings.extend(missing);
    Ok(sensors)
}

/// The dwells of one sensor with known inputs, and what errs in them.
struct Known<'a> {
    /// The recording, where it can be without the force of a lever arm.
    prepared: Cow<'a, Prepared>,
    options: Options,
    sensor: Sensor,
    observations: Vec<Observation>,
    /// Sums within dwells whose input moves.
    within: Vec<Observation>,
    /// The observations with the variance that the force of a lever arm adds.
    weighed: Vec<Observation>,
    /// Errors of the reference, if they are stated.
    reference: Option<Influences>,
    /// Covariances of the means of each axis by causes that dwells share: wander of the bias, the lever arm, and errors of the reference.
    shared: Option<[DMatrix<f64>; 3]>,
    /// Where on the table the accelerometer is, if that is found.
    place: Option<Warning>,
}

impl<'a> Known<'a> {
    fn of(
        prepared: &'a Prepared,
        options: Options,
        sensor: Sensor,
        observations: Vec<Observation>,
    ) -> Self {
        let dwells = &prepared.dwells.list;
        let mut known = Self {
            within: prepared.within_dwells(sensor),
            weighed: observations.clone(),
            shared: prepared.noise.wander(sensor, dwells),
            place: None,
            reference: None,
            prepared: Cow::Borrowed(prepared),
            options,
            sensor,
            observations,
        };
        if sensor == Sensor::Accel {
            known.free_arm();
        }
        if let Some(error) = &prepared.reference_error
            && let Ok(first) = known.estimate(&known.weighed, &known.within)
        {
            let forward = first.triad.forward.matrix;
            known.reference = Influences::of(prepared, sensor, error, forward);
            if let Some(covariance) = known.reference.as_ref().map(Influences::covariance) {
                known.share(covariance);
            }
        }
        known
    }

    /// Allows for a lever arm, and removes what all axes have in common of it: the sums within dwells are then right too.
    fn free_arm(&mut self) {
        let fitted = |known: &Self| {
            let found = known.estimate(&known.weighed, &[]);
            found.ok().map(|first| first.triad)
        };
        if !self.prepared.noise.is_known(self.sensor) {
            return;
        }
        let forward = fitted(self).map(|triad| triad.forward.matrix);
        let lever = forward.and_then(|f| lever_arm::covariance(&self.prepared, &f));
        let Some(lever) = lever else { return };
        self.share(lever);
        let clean = fitted(self).map(|triad| triad.inverse);
        let clean = clean.and_then(|inverse| lever_arm::without_arm(&self.prepared, &inverse));
        if let Some((prepared, place)) = clean {
            self.observations = prepared.observations(self.sensor);
            self.within = prepared.within_dwells(self.sensor);
            for (wide, o) in self.weighed.iter_mut().zip(&self.observations) {
                wide.raw = o.raw;
            }
            self.prepared = Cow::Owned(prepared);
            self.place = Some(place);
        }
    }

    /// Adds the covariance of an error that dwells share.
    fn share(&mut self, covariance: [DMatrix<f64>; 3]) {
        self.weighed = lever_arm::widened(&self.weighed, &covariance);
        self.shared = Some(match &self.shared {
            Some(others) => [0, 1, 2].map(|k| &others[k] + &covariance[k]),
            None => covariance,
        });
    }

    /// What each error of the reference adds to the covariance, if dwell means alone were used. The parts of `estimated` are separated.
    fn influences(&self, estimated: &mut Estimated) -> Vec<Influence> {
        match (&self.reference, &self.shared) {
            (Some(reference), Some(shared)) if self.within.is_empty() => reference
                .separate(estimated, &self.weighed, shared)
                .unwrap_or_default(),
            _ => Vec::new(),
        }
    }

    fn estimate(
        &self,
        o: &[Observation],
        within: &[Observation],
    ) -> std::result::Result<Estimated, Failure> {
        known_input::least_squares(o, within, self.shared.as_ref())
    }

    fn has_one_input(&self) -> bool {
        let first = &self.observations[0];
        self.within.is_empty()
            && self.observations.iter().all(|o| {
                let [a, b] = [o, first].map(|o| o.without_earth().input);
                (a - b).norm() < SAME_RATE
            })
    }

    fn warnings(&self) -> Vec<Warning> {
        let mut warnings = Vec::from_iter(self.place.clone());
        let turn = |o: &Observation| self.prepared.dwells.list[o.dwell].turn;
        if self.sensor == Sensor::Gyro && self.observations.iter().any(turn) {
            warnings.push(Warning::ExactTurns);
        }
        warnings
    }

    /// The fit with its errors, in sample and held out.
    fn judged(&self, mut estimated: Estimated) -> Result<SensorFit> {
        let influences = self.influences(&mut estimated);
        let (prepared, sensor) = (&self.prepared, self.sensor);
        let means = self.observations.iter().map(|o| (o, 1.0));
        let all: Vec<(&Observation, f64)> =
            means.chain(self.within.iter().map(|o| (o, 0.0))).collect();
        let matrix = estimated.triad.inverse.matrix;
        let floor = |o: &Observation| (si_covariance(&matrix, &o.variance).trace() / 3.0).sqrt();
        let mut residuals: Vec<Residual> = all
            .iter()
            .map(|(o, bias)| Residual {
                dwell: o.dwell,
                within: *bias == 0.0,
                value: estimated.error(o, *bias),
                held_out: None,
                floor: prepared.if_noise_known(&[sensor], floor(o)),
            })
            .collect();
        let n = self.observations.len();
        let parts = self.options.holdout_blocks.min(n);
        // The sums within a dwell are held out with its mean.
        let part_of = |split: Split, dwell: usize| {
            let at = self.observations.partition_point(|o| o.dwell < dwell);
            split.part(at.min(n - 1), n, parts)
        };
        let typical = typical(Figure::Input, &residuals);
        let held_out = Refits::of(parts, |split, part| {
            let of_part = |o: &Observation| part_of(split, o.dwell) == part;
            let kept = |all: &[Observation]| -> Vec<Observation> {
                all.iter().filter(|o| !of_part(o)).copied().collect()
            };
            let refit = self.estimate(&kept(&self.weighed), &kept(&self.within))?;
            let open = all.iter().filter(|(o, _)| of_part(o)).map(|(o, bias)| {
                let axis = |k: usize| {
                    let mut by = slope(&Vector3::ith(k, 1.0), &o.raw);
                    by.rows_mut(9, 3).scale_mut(*bias);
                    by
                };
                (0..3).map(|k| refit.triad.variance(&axis(k))).sum::<f64>() / 3.0
            });
            determined(open, typical, (Figure::Input, sensor))?;
            Ok(refit)
        });
        for (residual, (o, bias)) in residuals.iter_mut().zip(&all) {
            let refit = held_out.without(part_of(held_out.split, o.dwell));
            residual.held_out = refit.map(|refit| refit.error(o, *bias));
        }
        let unseen = match residuals.iter().any(|r| r.floor.is_nan()) {
            true => Vec::new(),
            false => self.unseen(&estimated, &all, &held_out, part_of),
        };
        let as_read = all.iter().map(|(o, _)| o.raw - o.input);
        let in_si = prepared.is_in_si();
        let judged = Judged {
            figure: Figure::Input,
            residuals,
            dwells: n,
            static_rms: None,
            held_out: held_out.into(),
            unseen,
            uncalibrated_rms: in_si.then(|| rms(Figure::Input, as_read)),
        };
        let mut fit = finish(sensor, estimated, judged);
        fit.influences = influences;
        Ok(fit)
    }
}

impl Known<'_> {
    /// Errors of the readings of each axis in each part that was held out, as means of dwells and as sums within them (`all`, with the sum of their weights).
    fn unseen(
        &self,
        estimated: &Estimated,
        all: &[(&Observation, f64)],
        held_out: &Refits<Estimated>,
        part_of: impl Fn(Split, usize) -> usize,
    ) -> Vec<Unseen> {
        let mut found = Vec::new();
        for axis in 0..3 {
            let readings = self.axis(axis, estimated, all);
            for (part, refit) in held_out.refits.iter().enumerate() {
                let Ok(refit) = refit else { continue };
                let own = |i: &usize| part_of(held_out.split, all[*i].0.dwell) == part;
                let own: Vec<usize> = (0..all.len()).filter(own).collect();
                let forward = refit.triad.forward.matrix.row(axis);
                let error = |i: &usize| (forward * refit.error(all[*i].0, all[*i].1))[0];
                let errors: Vec<f64> = own.iter().map(error).collect();
                found.extend(readings.unseen(errors.into(), &own));
            }
        }
        found
    }

    /// The readings of sensor `axis`.
    fn axis(&self, axis: usize, estimated: &Estimated, all: &[(&Observation, f64)]) -> LinearAxis {
        let forward = &estimated.triad.forward.matrix;
        let span = all
            .iter()
            .map(|(o, _)| o.input.norm())
            .fold(f64::MIN_POSITIVE, f64::max);
        let delay = usize::from(estimated.delays.is_some());
        let design = DMatrix::from_fn(all.len(), 4 + delay, |i, j| match j {
            0 => all[i].1,
            4 => -(forward.row(axis) * all[i].0.change)[0],
            _ => all[i].0.input[j - 1] / span,
        });
        let means = known_input::errors(&self.weighed, axis, self.shared.as_ref(), forward);
        let of_within = known_input::errors_of_sums(&self.within, axis, forward);
        let extra = |group| {
            let of = estimated.scatter.iter().find(|(g, _)| *g == group);
            of.map_or(0.0, |(_, s)| s.extra_variance)
        };
        let groups = [Observable::Axis(axis), Observable::Within(axis)].map(extra);
        LinearAxis {
            design,
            errors: means.beside(of_within),
            extra: DVector::from_fn(all.len(), |i, _| {
                groups[usize::from(i >= self.weighed.len())]
            }),
        }
    }
}
