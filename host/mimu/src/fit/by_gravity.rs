//! Both triads with gravity as the only reference: the accelerometer by its magnitude, the gyro by the turns between dwells.

use mimu_core::compensation::Affine;
use nalgebra::{Matrix3, Vector3};

use super::determined::{faces_not_up, unseen_poses};
use super::hold_out::Split;
use super::judged::{InSample, Parts, Refit};
use super::sensor::SensorFit;
use super::{Fit, Options, finish, refuse_wrong_gravity};
use crate::estimate::rotation::Data;
use crate::estimate::with_turns::JointFit;
use crate::estimate::{Estimated, Failure, Observation, magnitude, rotation};
use crate::judging::{Both, Judging, Models};
use crate::observation::turn::{Rest, Turn};
use crate::observation::{ByTriad, place};
use crate::prepared::Prepared;
use crate::prior::{Prior, TriadPrior};
use crate::quantity::{AXES, PerSensor, Sensor};
use crate::signal::blocks::quantile;
use crate::signal::dwell::Fault;
use crate::triad::{Covariance, Part, Triad};
use crate::warning::Warning;
use mimu_recording::{Error, RawUnit, Reference, Result};

pub(super) fn fit_gravity(
    prepared: &Prepared,
    options: Options,
    warnings: &mut Vec<Warning>,
) -> Result<Vec<SensorFit>> {
    let g = prepared.manifest.gravity_mps2;
    let poses = poses(prepared)?;
    let variances = |accel: &Affine<f64>| prepared.magnitude_variances(accel, &poses);
    let prior = prior(prepared, Sensor::Accel);
    let middle = prior.as_ref().and_then(TriadPrior::middle);
    let first = middle.or_else(|| magnitude::first_guess(&poses, g));
    let by_sphere = first.map_or_else(|| vec![0.0; poses.len()], |a| variances(&a));
    let by_poses = ByPoses {
        prior: prior.as_ref(),
        prepared,
        poses: &poses,
        variances: &by_sphere,
    };
    let estimated = by_poses.estimate();
    // Whole turns do not need the accelerometer, and the turns that would help it are few.
    if !matches!(&estimated, Ok((_, None)))
        && let Some(accel) = by_poses.as_delivered()
    {
        return turns_alone(prepared, options, accel, warnings);
    }
    let (accel, with_turns) =
        estimated.map_err(|f| prepared.refused(by_poses.with_faces(f), Sensor::Accel))?;
    let parts = Parts::new(
        options.holdout_blocks.min(poses.len()),
        prepared.dwells.list.len(),
    );
    let models = Models {
        gyro: None,
        accel: Some(accel.triad.inverse),
    };
    let with = |models: &Models| Judging::of(prepared, Sensor::Accel, models);
    let in_sample = InSample::of(prepared, Sensor::Accel, &with, models, parts)?;
    let errors = &in_sample.errors;
    let refit = |split: Split, part: usize| {
        let kept = |dwell: usize| parts.of(split, dwell) != part;
        let accel = by_poses.without(&kept, with_turns.as_ref())?;
        let refit = Refit::of_one(Sensor::Accel, accel.triad.clone(), ByTriad::zeros());
        Ok((accel, errors.checked(refit, split, part)?))
    };
    let judged = in_sample.held_out(|split, part| Ok(refit(split, part)?.1));
    let mut sensors = Vec::new();
    // A table of means has no turns; its warnings say so.
    if prepared.has(Sensor::Gyro) && options.wants(Sensor::Gyro) && !prepared.manifest.means {
        let without = |split, part| Ok(refit(split, part)?.0);
        let turns = fit_turns(prepared, &accel, (parts, &without), warnings);
        // If only the turns determined the accelerometer, and they do not determine the gyro, the poses are wrong.
        if let (Err(_), Some(_), Err(failure)) =
            (&turns, &with_turns, by_poses.without(&|_| true, None))
        {
            return Err(prepared.refused(by_poses.with_faces(failure), Sensor::Accel));
        }
        sensors.extend(turns?);
    }
    let not_seen = unseen_poses(g, &accel.triad, errors.typical);
    let mut fit = finish(Sensor::Accel, accel, judged);
    fit.warnings.extend(not_seen);
    sensors.push(fit);
    Ok(sensors)
}

/// The prior of `sensor`, if one is given.
fn prior(prepared: &Prepared, sensor: Sensor) -> Option<TriadPrior> {
    prepared.prior.as_ref()?.triad(sensor)
}

/// `sensor` as the poses, the turns and the `priors` together have it. Few poses do not contradict what a prior says of the angles between an accelerometer's axes, and
/// the turns between them do.
pub(super) fn with_priors(fitted: &Fit, priors: &Prior, sensor: Sensor) -> Option<Triad> {
    let prepared = &fitted.prepared;
    let of = |s: Sensor| Some(fitted.sensor(s)?.estimated.triad.inverse);
    let (gyro, accel) = (of(Sensor::Gyro)?, of(Sensor::Accel)?);
    let poses = prepared.observations(Sensor::Accel);
    let priors = Sensor::BOTH.map(|s| priors.triad(s));
    let [of_gyro, of_accel] = priors.each_ref().map(Option::as_ref);
    let joint = JointFit {
        variances: &prepared.magnitude_variances(&accel, &poses),
        poses: &poses,
        turns: &prepared.turns(&accel).0,
        rest: &prepared.rest(&accel),
        accel,
        gyro,
        gravity: prepared.manifest.gravity_mps2,
        power_ons: &prepared.power_ons,
        priors: PerSensor {
            gyro: of_gyro,
            accel: of_accel,
        },
    };
    joint.triad(sensor).ok()
}

/// The gyro alone, by whole turns, if the poses do not determine the accelerometer: its readings as delivered give the directions of gravity.
fn turns_alone(
    prepared: &Prepared,
    options: Options,
    accel: Estimated,
    warnings: &mut Vec<Warning>,
) -> Result<Vec<SensorFit>> {
    if options.only == Some(Sensor::Accel) || !prepared.has(Sensor::Gyro) {
        return Ok(Vec::new());
    }
    let dwells = prepared.dwells.list.len();
    let parts = Parts::new(options.holdout_blocks.min(dwells), dwells);
    let given = |_, _| Ok(accel.clone());
    let fit = fit_turns(prepared, &accel, (parts, &given), warnings)?;
    let fit = fit.map(|mut fit| {
        with_doubt(prepared, &mut fit, &accel);
        fit
    });
    warnings.push(Warning::AccelAsDelivered {
        doubt: DELIVERED.0.hypot(DELIVERED.1),
    });
    Ok(fit.into_iter().collect())
}

/// Adds to the floors of turns what the directions of `accel` err by. After whole turns the unit lies as before, so that these errors cancel; from pose to pose
/// they are degrees, and would pass for outliers.
fn with_doubt(prepared: &Prepared, fit: &mut SensorFit, accel: &Estimated) {
    let models = Models {
        gyro: Some(fit.estimated.triad.inverse),
        accel: Some(accel.triad.inverse),
    };
    let of_accel = Both::of_one(Sensor::Accel, accel.triad.inverse_covariance);
    let Some(judging) = Judging::of(prepared, Sensor::Gyro, &models) else {
        return;
    };
    let all = judging.unseen(&models, &of_accel, |_| true);
    let variances = all.map_or_else(Default::default, |all| all.predicted.variances());
    let of_turns = fit.residuals.iter_mut().zip(variances.as_slice().chunks(2));
    for (residual, own) in of_turns.filter(|(residual, _)| residual.floor.is_finite()) {
        residual.floor = residual.floor.max(own.iter().sum::<f64>().sqrt());
    }
}

/// The gyro by turns, and by whole turns if these are stated.
pub(super) fn by_turns(prepared: &Prepared, data: &Data) -> Outcome<Estimated> {
    match prepared.whole_turns() {
        Some(stated) => stated.estimate(data),
        None => rotation::estimate(data),
    }
}

/// Warnings about turns with clipped readings, if turns are whole: the rate that they may have.
fn clipped(prepared: &Prepared, gyro: &Affine<f64>) -> Vec<Warning> {
    if prepared.whole_turns().is_none() {
        return Vec::new();
    }
    let refused = prepared.turns(&Affine::identity()).1.into_iter();
    let each = refused.filter_map(|warning| {
        let Warning::TurnNotUsed {
            from,
            to,
            fault: Some(Fault::Saturated(axis)),
        } = warning
        else {
            return None;
        };
        let by = gyro.matrix[(axis, axis)].abs();
        let rest = -gyro.offset[axis] / gyro.matrix[(axis, axis)];
        let fastest = by * prepared.dwells.rails[axis].nearest(rest);
        let axis = AXES[axis];
        fastest.is_finite().then_some(Warning::WholeTurnClipped {
            from,
            to,
            axis,
            fastest,
        })
    });
    each.collect()
}

/// The poses of the accelerometer.
///
/// # Errors
/// No accelerometer, no pose, or another size of gravity than given.
fn poses(prepared: &Prepared) -> Result<Vec<Observation>> {
    if !prepared.has(Sensor::Accel) {
        return Err(Error::new(
            &prepared.place,
            "the recording has no accelerometer, and gravity is the only reference",
            "add the columns accel_x, accel_y, accel_z, or give the rates in ref_rate_ columns (reference = \"table\")",
        ));
    }
    let poses = prepared.observations(Sensor::Accel);
    if poses.is_empty() {
        let error = Error::new(
            &prepared.place,
            format!(
                "no dwell can be used for the accelerometer{}",
                prepared.dwells.unused(Sensor::Accel)
            ),
            "hold the unit still for some seconds in every pose, within the sensor's range",
        );
        return Err(prepared.with_steps_as_given(error, Sensor::Accel));
    }
    refuse_wrong_gravity(prepared, Sensor::Accel, &poses)?;
    Ok(poses)
}

/// Condition of the poses from which on the turns between them help to determine the accelerometer. Twenty poses all around have 2 to 5. Ten poses of
/// a fixture that tips by 60 degrees have 73 to 96: the misfit of 5 mm/s² in real recordings then becomes 4 % of a scale factor.
pub(super) const POOR_POSES: f64 = 100.0;
/// Errors of an accelerometer as delivered, standard deviations: of each element of its matrix, and of its biases in g. Data sheets of hobby parts give
/// 3 % of sensitivity, 2 % across axes, and 60 to 80 mg, as largest values.
const DELIVERED: (f64, f64) = (0.02, 0.05);
/// Fewest turns between the poses: as many as determine a gyro.
const FEWEST_TURNS: usize = 5;

/// The accelerometer by its poses and, if these determine it poorly, by the turns between them as well.
struct ByPoses<'a> {
    prior: Option<&'a TriadPrior>,
    prepared: &'a Prepared,
    poses: &'a [Observation],
    variances: &'a [f64],
}

/// First guesses of accelerometer and gyro for a fit with the turns.
struct Guesses {
    accel: Affine<f64>,
    gyro: Affine<f64>,
}

type Outcome<T> = std::result::Result<T, Failure>;

impl ByPoses<'_> {
    fn gravity(&self) -> f64 {
        self.prepared.manifest.gravity_mps2
    }

    fn estimate(&self) -> Outcome<(Estimated, Option<Guesses>)> {
        let alone = self.without(&|_| true, None);
        // What poses leave open beside a prior, the prior has.
        let poor = self.prior.is_none() && !alone.as_ref().is_ok_and(|a| a.condition <= POOR_POSES);
        let enough = self.poses.len() >= magnitude::PARAMETERS;
        if poor
            && enough
            && let Some(guesses) = self.guesses()
            && let Ok(together) = self.without(&|_| true, Some(&guesses))
        {
            return Ok((together, Some(guesses)));
        }
        Ok((alone?, None))
    }

    /// First guess: the readings as they came if they are in SI, otherwise by the sphere through them.
    fn first_accel(&self) -> Option<Affine<f64>> {
        match self.prepared.manifest.raw_unit {
            RawUnit::Si => Some(Affine::identity()),
            _ => magnitude::first_guess(self.poses, self.gravity()),
        }
    }

    fn guesses(&self) -> Option<Guesses> {
        let prepared = self.prepared;
        // On a turntable the rests are separated by turns of unknown angle.
        let by_hand = prepared.manifest.reference == Reference::Gravity;
        if !by_hand || prepared.manifest.means || !prepared.has(Sensor::Gyro) {
            return None;
        }
        let accel = self.first_accel()?;
        let (turns, _) = prepared.turns(&accel);
        if turns.len() < FEWEST_TURNS {
            return None;
        }
        let exact = Triad::from_inverse(accel, Vec::new())?;
        let (rest, motions) = (prepared.rest(&accel), prepared.motions(&accel));
        let gyro = by_turns(
            prepared,
            &Data {
                turns: &turns,
                rest: &rest,
                accel: &exact,
                motions: &motions,
                start: None,
                gravity: self.gravity(),
                prior: None,
                power_ons: &prepared.power_ons,
            },
        );
        Some(Guesses {
            accel,
            gyro: gyro.ok()?.triad.inverse,
        })
    }

    /// The accelerometer as delivered, with what data sheets allow it to err. `None` unless whole turns are to determine the gyro without it, or if the
    /// zero of its readings is not known.
    fn as_delivered(&self) -> Option<Estimated> {
        let by_turns = self.prepared.whole_turns().is_some();
        if !by_turns || self.prepared.manifest.raw_unit == RawUnit::Volt {
            return None;
        }
        let mut sizes: Vec<f64> = self.poses.iter().map(|o| o.raw.norm()).collect();
        let scale = self.gravity() / quantile(&mut sizes, 0.5)?;
        let errors = Covariance::from_fn(|i, j| match (i == j, place(i).1) {
            (false, _) => 0.0,
            (true, Some(_)) => (DELIVERED.0 * scale).powi(2),
            (true, None) => (DELIVERED.1 * self.gravity()).powi(2),
        });
        let part = Part::known(errors);
        let inverse = Affine {
            matrix: Matrix3::identity() * scale,
            offset: Vector3::zeros(),
        };
        let triad = Triad::from_inverse(inverse, vec![part])?;
        Some(Estimated::new(triad, Vec::new(), 1.0))
    }

    /// The fit to the `kept` dwells; with `guesses`, to the turns between them as well.
    fn without(
        &self,
        kept: &dyn Fn(usize) -> bool,
        guesses: Option<&Guesses>,
    ) -> Outcome<Estimated> {
        let both = self.poses.iter().zip(self.variances);
        let (poses, variances): (Vec<_>, Vec<_>) = both
            .filter(|(o, _)| kept(o.dwell))
            .map(|(o, v)| (*o, *v))
            .unzip();
        let power_ons = &self.prepared.power_ons;
        let Some(Guesses { accel, gyro }) = guesses else {
            return magnitude::by_gravity(
                &poses,
                &variances,
                self.gravity(),
                self.prior,
                power_ons,
            );
        };
        let (turns, _) = self.prepared.turns(accel);
        let turns: Vec<Turn> = turns
            .into_iter()
            .filter(|t| kept(t.from) && kept(t.to))
            .collect();
        let rest = self.prepared.rest(accel).into_iter();
        let rest: Vec<Rest> = rest.filter(|o| kept(o.dwell)).collect();
        // The rests determine the gyro's bias; poses and turns have to determine its matrix and the accelerometer.
        if poses.len() + 2 * turns.len() <= magnitude::PARAMETERS + 9 {
            return Err(Failure::Undetermined {
                parameters: "accelerometer and gyro together".into(),
                add: "add poses, and turns between them".into(),
            });
        }
        JointFit {
            poses: &poses,
            variances: &variances,
            turns: &turns,
            rest: &rest,
            accel: *accel,
            gyro: *gyro,
            gravity: self.gravity(),
            power_ons,
            priors: PerSensor::default(),
        }
        .estimate()
    }

    /// `failure`, naming the faces that no pose had up.
    fn with_faces(&self, failure: Failure) -> Failure {
        let raw: Vec<Vector3<f64>> = self.poses.iter().map(|o| o.raw).collect();
        let unseen = self
            .first_accel()
            .and_then(|guess| faces_not_up(&guess, &raw));
        let Some(faces) = unseen else { return failure };
        match failure {
            Failure::Undetermined { parameters, add } => Failure::Undetermined {
                parameters,
                add: format!("{} (no pose has {faces} up)", add.words(Sensor::Accel)).into(),
            },
            // If the poses cover only a cap of directions, the fit diverges, although the columns are right.
            Failure::NoSolution(_) => Failure::Undetermined {
                parameters: "scale factors and biases of the accelerometer".into(),
                add: format!(
                    "no pose has {faces} up: add such poses, and poses in between; if they were recorded, check for wrong columns"
                )
                .into(),
            },
        }
    }
}

/// The fit of the accelerometer without a part of the dwells.
type AccelWithout<'a> = &'a (dyn Fn(Split, usize) -> Outcome<Estimated> + Sync);

/// The fit of the gyro, and of the accelerometer whose directions it takes, without a part of the dwells.
fn refit(
    prepared: &Prepared,
    data: &Data,
    gyro: &Estimated,
    (parts, accel_without): (Parts, AccelWithout),
    (split, part): (Split, usize),
) -> Outcome<Refit> {
    let accel = accel_without(split, part).map_err(|failure| {
        let problem = failure.problem();
        Failure::NoSolution(format!("the accelerometer is not determined: {problem}"))
    })?;
    let of_part = |dwell: usize| parts.of(split, dwell) == part;
    let kept = prepared.turns(&accel.triad.inverse).0.into_iter();
    let kept: Vec<Turn> = kept
        .filter(|t| !of_part(t.from) && !of_part(t.to))
        .collect();
    let rest = data.rest.iter().filter(|o| !of_part(o.dwell));
    let rest: Vec<Rest> = rest.copied().collect();
    let refit = by_turns(
        prepared,
        &Data {
            turns: &kept,
            rest: &rest,
            accel: &accel.triad,
            motions: &[],
            start: Some(&gyro.triad.inverse),
            ..*data
        },
    )?;
    Ok(Refit::of_both(refit, &accel.triad))
}

/// The gyro from the turns. A turn belongs to the part of the dwell in which it ends. While a part is left out, no turn that touches one of its
/// dwells is used.
fn fit_turns(
    prepared: &Prepared,
    accel: &Estimated,
    (parts, accel_without): (Parts, AccelWithout),
    warnings: &mut Vec<Warning>,
) -> Result<Option<SensorFit>> {
    let g = prepared.manifest.gravity_mps2;
    let by_full = &accel.triad.inverse;
    let (turns, refused) = prepared.turns(by_full);
    warnings.extend(refused);
    let rest = prepared.rest(by_full);
    if turns.is_empty() {
        warnings.push(Warning::NoTurn.of(Sensor::Gyro));
        return Ok(None);
    }
    let motions = prepared.motions(by_full);
    let prior = prior(prepared, Sensor::Gyro);
    let data = Data {
        prior: prior.as_ref(),
        turns: &turns,
        rest: &rest,
        accel: &accel.triad,
        motions: &motions,
        start: None,
        gravity: g,
        power_ons: &prepared.power_ons,
    };
    let gyro = by_turns(prepared, &data).map_err(|f| prepared.refused(f, Sensor::Gyro))?;
    warnings.extend(clipped(prepared, &gyro.triad.inverse));
    let models = Models {
        gyro: Some(gyro.triad.inverse),
        accel: Some(*by_full),
    };
    let with = |models: &Models| Judging::of(prepared, Sensor::Gyro, models);
    let in_sample = InSample::of(prepared, Sensor::Gyro, &with, models, parts)?;
    let errors = &in_sample.errors;
    let judged = in_sample.held_out(|split, part| {
        let without = (parts, accel_without);
        let refit = refit(prepared, &data, &gyro, without, (split, part))?;
        errors.checked(refit, split, part)
    });
    let sizes = judged.residuals.iter().map(|r| r.value.norm());
    let wide = sizes.fold(0.0, f64::max);
    let mut fit = finish(Sensor::Gyro, gyro, judged);
    if wide > 20f64.to_radians() {
        fit.warnings
            .push(Warning::WideTurn { angle: wide }.of(Sensor::Gyro));
    }
    Ok(Some(fit))
}
