//! Plots of an effect against the quantity that it depends on.
//!
//! Component plus residual instead of an added-variable plot, which shows two residuals against each other, not against a rate or a
//! temperature. As in the added-variable plot, the part of the component that the affine calibration absorbs is subtracted: of a function of one quantity
//! its mean, and its best straight line if the calibration is linear in the quantity. Otherwise a cubic would be drawn with a scale factor that the recording
//! does not show.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::{ResidualKind, Track};
use crate::diagnose::decision::Accepted;
use crate::diagnose::rows::Rows;
use crate::diagnose::search::Search;
use crate::diagnose::variance::Fitted;
use crate::effects::candidate::Candidate;
use crate::effects::quantity::{Conditions, Quantity, REFERENCE_C};
use crate::quantity::{AXES, Sensor};
use crate::signal::blocks::extent;

/// Abscissa of a drawing.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Abscissa {
    /// Name.
    pub name: String,
    /// Unit for display.
    pub unit: String,
    /// From SI to this unit: `factor * x + offset`.
    pub factor: f64,
    /// See `factor`.
    pub offset: f64,
}

/// Abscissa of a panel.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub enum Against {
    /// The one quantity that the effect depends on.
    Variable(Abscissa),
    /// The effect's contribution to the row beside the affine calibration: a product, a whole turn and the magnitude of gravity are functions of several.
    Fitted,
}

/// A row in a panel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct At {
    /// Abscissa, SI.
    pub x: f64,
    /// Standard deviation by the known noise.
    pub sigma: f64,
    /// Residual plus the fitted effect.
    pub partial: f64,
    /// Prediction of that by the model fitted without the row; NaN if there is none.
    pub predicted: f64,
    /// Residual, in sample.
    pub after: f64,
    /// Residual, held out.
    pub held_out: f64,
}

/// The effect as fitted.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Curve {
    /// Abscissa, SI.
    pub x: f64,
    /// Its value.
    pub value: f64,
    /// Half of its 95 % interval, by the covariance of the coefficients for the nonlinear parameter found.
    pub half: f64,
}

/// The part of an effect on one axis that depends on one quantity, or all of it in rows that several axes move.
#[derive(Debug, Clone, Serialize)]
pub struct Panel {
    /// Axis, and coefficients.
    pub title: String,
    /// Quantity of the ordinate.
    pub kind: ResidualKind,
    /// Abscissa.
    pub against: Against,
    /// Rows.
    pub points: Vec<At>,
    /// At the rows, ascending in x.
    pub curve: Vec<Curve>,
}

/// The quantity that each regressor is a function of; `None` if it is one of several, or of none that can be drawn.
fn quantities(candidate: &Candidate) -> Vec<Option<Quantity>> {
    let each = candidate.slot_regressors().into_iter();
    let alone = each.map(|regressor| match regressor.quantities()[..] {
        // The first is infinite in all recordings but the first, and the others are made of several.
        [Quantity::RecordingTime | Quantity::Up | Quantity::RateMagnitude] => None,
        [alone] => Some(alone),
        _ => None,
    });
    alone.collect()
}

/// The coefficients of `candidate` that are drawn on a track, by the quantity that they depend on: the linear and the quadratic part of a thermal bias
/// together.
fn groups(candidate: &Candidate, axis: Option<usize>) -> Vec<(Option<Quantity>, Vec<usize>)> {
    let slots = candidate.slots();
    if axis.is_none() {
        return vec![(None, (0..candidate.active.len()).collect())];
    }
    let mut groups: Vec<(Option<Quantity>, Vec<usize>)> = Vec::new();
    let all = slots.into_iter().zip(quantities(candidate));
    for ((member, _), on) in all.filter(|((_, of), _)| Some(*of) == axis) {
        match groups.iter_mut().find(|group| group.0 == on) {
            Some(group) => group.1.push(member),
            None => groups.push((on, vec![member])),
        }
    }
    groups
}

/// Panels of an accepted effect. `None` where its columns are singular.
pub(super) fn panels(
    rows: &Rows,
    search: &Search,
    last: &Fitted,
    one: &Accepted,
    tracks: &[Track],
) -> Option<Vec<Panel>> {
    let white = search.variance.whitener(&last.components)?;
    let (basis, columns) = (&search.basis, &one.chosen.columns);
    let share = white
        .whiten(basis)
        .svd(true, true)
        .solve(&white.whiten(columns), 1e-12)
        .ok()?;
    let candidate = &one.chosen.candidate;
    let drawn = Drawn {
        rows,
        one,
        across: columns - basis * share,
        basis,
        conditions: &rows.conditions(candidate.followed(one.chosen.parameter)),
    };
    let each = tracks.iter().flat_map(|track| {
        let groups = groups(candidate, track.axis).into_iter();
        groups.filter_map(|(on, members)| drawn.panel(track, on, &members))
    });
    Some(each.collect())
}

/// An effect to be drawn.
struct Drawn<'a> {
    rows: &'a Rows,
    one: &'a Accepted,
    /// Its columns without what the affine calibration absorbs.
    across: DMatrix<f64>,
    /// Basis of the columns of the affine calibration.
    basis: &'a DMatrix<f64>,
    conditions: &'a [Conditions],
}

impl Drawn<'_> {
    /// The coefficients `members` on a track; `None` if they do not move it, or if the quantity `on` that they depend on is constant in the recording.
    fn panel(&self, track: &Track, on: Option<Quantity>, members: &[usize]) -> Option<Panel> {
        let columns = &self.one.chosen.columns;
        let mut moves = track
            .rows
            .iter()
            .flat_map(|r| members.iter().map(|k| columns[(*r, *k)]));
        if !moves.any(|v| v != 0.0) {
            return None;
        }
        let count = members.len();
        let of = |k: usize| self.one.effect.values[members[k]];
        let values = DVector::from_fn(count, |k, _| of(k));
        let covariance = self
            .one
            .conditional
            .select_rows(members)
            .select_columns(members);
        let axis = track.axis.unwrap_or_default();
        let mean = |r: &usize, on: Quantity| {
            let conditions = self.conditions;
            self.rows.mean(*r, conditions, |at| on.of(at, axis))
        };
        let x: Option<Vec<f64>> = on.map(|on| track.rows.iter().map(|r| mean(r, on)).collect());
        let of_track = |m: &DMatrix<f64>| m.select_rows(&track.rows).select_columns(members);
        let beside = match &x {
            Some(x) => self.beside_line(of_track(columns), x, track),
            None => of_track(&self.across),
        };
        let (mut points, mut curve) = (Vec::new(), Vec::new());
        for (i, sample) in track.samples.iter().enumerate() {
            let by = beside.row(i).transpose();
            let value = by.dot(&values);
            let x = x.as_ref().map_or(value, |x| x[i]);
            let partial = sample.residual[1] + value;
            points.push(At {
                x,
                sigma: sample.sigma,
                partial,
                predicted: partial - sample.held_out[1],
                after: sample.residual[1],
                held_out: sample.held_out[1],
            });
            curve.push(Curve {
                x,
                value,
                half: 2.0 * by.dot(&(&covariance * &by)).max(0.0).sqrt(),
            });
        }
        curve.sort_by(|a, b| a.x.total_cmp(&b.x));
        let [low, high] = extent(points.iter().map(|at| at.x));
        let constant = !(high - low > 1e-9 * high.abs().max(low.abs()));
        let candidate = &self.one.chosen.candidate;
        (on.is_none() || !constant).then(|| Panel {
            title: title(candidate, track, members),
            kind: track.kind,
            against: on.map_or(Against::Fitted, |on| {
                Against::Variable(abscissa(on, candidate.sensor, axis))
            }),
            points,
            curve,
        })
    }

    /// `columns` of the rows of a track without their best straight lines in `x`, or without their means if the affine calibration cannot absorb a line.
    fn beside_line(&self, columns: DMatrix<f64>, x: &[f64], track: &Track) -> DMatrix<f64> {
        let x = DVector::from_column_slice(x);
        let x = x.add_scalar(-x.mean());
        let mut line = DVector::zeros(self.across.nrows());
        for (r, x) in track.rows.iter().zip(x.iter()) {
            line[*r] = *x;
        }
        let left = &line - self.basis * self.basis.tr_mul(&line);
        // Within 1 %: the input is known for each dwell only, and the reading is along the sensor's own direction.
        let sloped = left.norm() < 0.01 * line.norm();
        let mut beside = columns;
        for mut column in beside.column_iter_mut() {
            let mean = column.mean();
            column.add_scalar_mut(-mean);
            if sloped {
                let slope = column.dot(&x) / x.norm_squared();
                column.axpy(-slope, &x, 1.0);
            }
        }
        beside
    }
}

/// Axis and coefficient, or what the rows of a track are.
fn title(candidate: &Candidate, track: &Track, members: &[usize]) -> String {
    let Some(axis) = track.axis.map(|axis| AXES[axis]) else {
        return track.name.clone();
    };
    let name = &candidate.names()[members[0]].0;
    match members.len() == 1 && name != axis {
        true => format!("{} {axis}, {name}", candidate.sensor),
        false => format!("{} {axis}", candidate.sensor),
    }
}

/// The abscissa of a quantity in the error of `axis`.
fn abscissa(of: Quantity, sensor: Sensor, axis: usize) -> Abscissa {
    let (factor, unit) = match of {
        Quantity::Temperature => (1.0, "°C"),
        of => of.readable(sensor),
    };
    Abscissa {
        name: of.in_words(sensor, axis),
        unit: unit.into(),
        factor,
        offset: match of {
            Quantity::Temperature => REFERENCE_C,
            _ => 0.0,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects;
    use crate::effects::candidate::CandidateKind;

    #[test]
    fn regressors_tell_what_they_are_functions_of() {
        let cases = [
            ("gyro_g_sensitivity", 5, Some(("force z", "g"))),
            (
                "gyro_scale_asymmetry",
                1,
                Some(("rate along gyro y", "deg/s")),
            ),
            ("accel_scale_cubic", 2, Some(("force along accel z", "g"))),
            ("gyro_warm_up", 0, Some(("time", "min"))),
            ("accel_thermal_bias", 4, Some(("temperature", "°C"))),
            ("gyro_thermal_scale", 0, None),
            ("accel_size_effect", 0, None),
        ];
        for (id, k, drawn) in cases {
            let effect = effects::by_id(id).unwrap();
            let candidate = Candidate::new(effect.sensor, CandidateKind::Effect(effect));
            let axis = effect.coefficients[k].axis.unwrap();
            let found = quantities(&candidate)[k].map(|of| abscissa(of, effect.sensor, axis));
            let found = found.as_ref().map(|a| (a.name.as_str(), a.unit.as_str()));
            assert_eq!(found, drawn, "{id}");
        }
    }
}
