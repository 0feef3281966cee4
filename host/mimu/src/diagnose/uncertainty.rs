//! Uncertainty that the coefficients of effects add to the affine parameters beside them, and to the forces that a gyro is judged by.

use mimu_core::compensation::Affine;
use nalgebra::{DMatrix, DVector, SMatrix, Vector3};

use super::decision::Decision;
use super::rows::{ForceErrors, Rows, Session};
use super::variance::VarianceModel;
use crate::diagnose::columns::beside;
use crate::effects;
use crate::effects::candidate::{Candidate, CandidateKind};
use crate::effects::effect::Effect;
use crate::effects::quantity::Quantity;
use crate::observation::vector;
use crate::prepared::Prepared;
use crate::quantity::Sensor;
use crate::triad::{Covariance, Part};

/// Singular values below this share of the largest are rounding.
const RANK: f64 = 1e-9;

/// What the coefficients of the accepted effects add to the covariance of the inverse affine model of the first recording.
///
/// A calibration of readings without an effect takes its coefficients as known. Without the part added here, the 95 % intervals of an
/// accelerometer with a quadratic or cubic term, which by hand is nearly a scale factor, contained the truth in only 84 to 86 % of the
/// cases.
pub fn of_affine(rows: &Rows, decision: &Decision) -> Option<Part> {
    let model = decision.models.last()?;
    let effects: usize = decision
        .accepted
        .iter()
        .map(|a| a.effect.values.len())
        .sum();
    let first = model.columns.ncols().checked_sub(effects)?;
    if effects == 0 {
        return None;
    }
    let variance = VarianceModel::new(rows, false);
    let whitener = variance.whitener(&model.fitted.components)?;
    let svd = whitener.whiten(&rows.nuisance).svd(true, true);
    let columns = model.columns.columns(first, effects).into_owned();
    let columns = whitener.whiten(&beside(&columns, &decision.nonlinear.slopes));
    let by_effects = svd.solve(&columns, RANK * svd.singular_values.max()).ok()?;
    let of_first = by_effects.rows(0, rows.parameters.ncols());
    let into = &rows.parameters * of_first;
    let added = &into * &decision.nonlinear.covariance * into.transpose();
    Some(Part::known(Covariance::from_fn(|i, j| added[(i, j)])))
}

/// Errors of the forces of an accelerometer that was calibrated by the magnitude of gravity alone.
///
/// All poses share the errors of the parameters and of the nonlinearity, of which the magnitude shows only a part: of `f_y f_z` read by x,
/// `f_z f_x` by y and `f_x f_y` by z it shows the sum. The rest is taken to have data-sheet size. So a gyro is not reported to have an
/// effect that the rest could cause.
///
/// `session` is the first recording, `magnitudes` are the rows of its accelerometer (and of later ones), and `decision` is the one on these.
pub fn of_forces(session: &Session, magnitudes: &Rows, decision: &Decision) -> Option<ForceErrors> {
    let rows = Rows::forces(session)?;
    let n = rows.y.len() / 3;
    let stratum = magnitudes.strata.iter().find(|s| s.session == 0)?;
    if stratum.rows.len() != n {
        return None;
    }
    let model = decision.models.last()?;
    let variances = VarianceModel::new(magnitudes, false).variances(&model.fitted.components);
    // A prior of 1/sigma² for each column; 0 for those that the magnitudes determine.
    let mut columns = rows.nuisance.clone();
    let mut precision = vec![0.0; columns.ncols()];
    let mut add = |candidate: &Candidate, parameter: f64, prior: &dyn Fn(usize) -> f64| {
        let more = candidate.columns(&rows, parameter);
        if more.iter().all(|v| v.is_finite()) {
            precision.extend(candidate.active.iter().map(|k| prior(*k)));
            columns = beside(&columns, &more);
        }
    };
    let accepted: Vec<_> = decision.accepted.iter().map(|a| &a.chosen).collect();
    let mut slopes = Vec::new();
    for a in decision
        .accepted
        .iter()
        .filter(|a| a.effect.interval.is_some())
    {
        let one = &a.chosen;
        let values = DVector::from_column_slice(&a.effect.values);
        slopes.push(one.candidate.slope(&rows, one.parameter, &values));
    }
    for one in &accepted {
        let known = one.size.map_or(0.0, |size| size.powi(-2));
        add(&one.candidate, one.parameter, &|_| known);
    }
    for effect in effects::all().filter(|e| is_of_force(e)) {
        let candidate = Candidate::new(Sensor::Accel, CandidateKind::Effect(effect));
        if accepted.iter().all(|c| c.candidate.id() != candidate.id()) {
            let typical = |k: usize| effect.coefficients[k].typical.powi(-2);
            add(&candidate, 0.0, &typical);
        }
    }
    for slope in slopes.iter().filter(|s| s.iter().all(|v| v.is_finite())) {
        precision.push(0.0);
        columns = beside(
            &columns,
            &DMatrix::from_column_slice(slope.len(), 1, slope.as_slice()),
        );
    }
    let accel = session.accel?;
    let list = &session.prepared.dwells.list;
    let dwells: Vec<usize> = (0..n).map(|i| rows.dwells(3 * i)[0]).collect();
    let up = |d: &usize| accel.apply(&list[*d].raw_mean(Sensor::Accel)).normalize();
    let ups: Vec<Vector3<f64>> = dwells.iter().map(up).collect();
    let along = DMatrix::from_fn(n, columns.ncols(), |i, k| {
        let error = Vector3::from_fn(|r, _| columns[(3 * i + r, k)]);
        ups[i].dot(&error) / variances[stratum.rows.start + i].sqrt()
    });
    let mut normal = along.tr_mul(&along);
    for (k, precision) in precision.iter().enumerate() {
        normal[(k, k)] += precision;
    }
    let scale = DVector::from_fn(normal.nrows(), |k, _| normal[(k, k)].sqrt());
    let scaled = normal.map_with_location(|i, j, v| v / (scale[i] * scale[j]));
    // The covariance of the parameters is the inverse of L Lᵀ.
    let factor = scaled.cholesky()?.unpack();
    let one = DMatrix::identity(factor.nrows(), factor.nrows());
    let inverse = factor.solve_lower_triangular(&one)?.transpose();
    let parameters = inverse.map_with_location(|i, _, v| v / scale[i]);
    Some(ForceErrors {
        dwells,
        factor: columns * parameters,
    })
}

/// Errors of the forces of an accelerometer whose matrix is given, and whose biases are those of the recording. `covariance` is that of
/// its inverse model, C by rows and then o.
pub fn of_given_forces(prepared: &Prepared, covariance: &Covariance) -> ForceErrors {
    let poses = prepared.observations(Sensor::Accel);
    let mut by = DMatrix::zeros(3 * poses.len(), 12);
    for (i, o) in poses.iter().enumerate() {
        let error = vector::at(&Affine::identity(), &o.raw, &Vector3::zeros());
        by.rows_mut(3 * i, 3).copy_from(&error.by);
    }
    // By its eigenvalues: a parameter that is exactly known has none.
    let eigen = covariance.symmetric_eigen();
    let sigmas = eigen.eigenvalues.map(|v| v.max(0.0).sqrt());
    let factor = eigen.eigenvectors * SMatrix::from_diagonal(&sigmas);
    let factor = DMatrix::from_fn(12, 12, |i, j| factor[(i, j)]);
    ForceErrors {
        dwells: poses.iter().map(|o| o.dwell).collect(),
        factor: by * factor,
    }
}

/// Whether an effect is an error of an accelerometer that depends on the force alone.
fn is_of_force(effect: &Effect) -> bool {
    let force = |q: &Quantity| matches!(q, Quantity::Input | Quantity::Force(_));
    let mut all = effect.coefficients.iter();
    effect.sensor == Sensor::Accel
        && effect.parameter.is_none()
        && all.all(|c| c.regressor.quantities().iter().all(force))
}
