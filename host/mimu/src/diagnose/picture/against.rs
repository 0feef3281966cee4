//! Plots of an effect against the quantity that it depends on.
//!
//! Component plus residual instead of an added-variable plot, which shows two residuals against each other, not against a rate or a
//! temperature. As in the added-variable plot, the part of the component that the affine calibration absorbs is subtracted: its mean,
//! and its best straight line if the calibration is linear in the variable. Otherwise a cubic would be drawn with a scale factor that
//! the recording does not show.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::abscissa::{Dependence, abscissa, dependence};
use super::{Abscissa, ResidualKind, Track};
use crate::diagnose::decision::Accepted;
use crate::diagnose::rows::Rows;
use crate::diagnose::search::Search;
use crate::diagnose::variance::Fitted;
use crate::quantity::AXES;
use crate::signal::blocks::extent;

/// Points of a curve.
const POINTS: usize = 81;

/// Abscissa of a panel.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub enum Against {
    /// What the effect depends on.
    Variable(Abscissa),
    /// The effect's contribution to the row beside the affine calibration. A row that is a whole turn, or the magnitude of gravity, is
    /// not a function of one quantity.
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

/// The part of an effect on one axis that depends on one quantity.
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
    /// Ascending in x.
    pub curve: Vec<Curve>,
}

/// Coefficients of one panel.
struct Group {
    axis: usize,
    on: Dependence,
    /// Indices of the regressors, and of the coefficients: a coefficient of all axes has three regressors.
    slots: Vec<usize>,
    members: Vec<usize>,
}

/// Groups the coefficients of one axis that depend on the same quantity, such as the linear and quadratic parts of a thermal bias.
fn groups(one: &Accepted) -> Vec<Group> {
    let candidate = &one.chosen.candidate;
    let mut groups: Vec<Group> = Vec::new();
    for (slot, (member, axis)) in candidate.slots().into_iter().enumerate() {
        let on = dependence(candidate, slot);
        let alone = matches!(on, Dependence::Alone(_));
        match groups
            .iter_mut()
            .find(|g| alone && g.axis == axis && g.on == on)
        {
            Some(group) => {
                group.slots.push(slot);
                group.members.push(member);
            }
            None => groups.push(Group {
                axis,
                on,
                slots: vec![slot],
                members: vec![member],
            }),
        }
    }
    groups
}

/// Straight line by least squares, or the mean alone.
fn line(x: &[f64], y: &[f64], sloped: bool) -> (f64, f64) {
    let n = x.len() as f64;
    let (mx, my) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let sxx: f64 = x.iter().map(|x| (x - mx).powi(2)).sum();
    let sxy: f64 = x.iter().zip(y).map(|(x, y)| (x - mx) * (y - my)).sum();
    let slope = if sloped && sxx > 0.0 { sxy / sxx } else { 0.0 };
    (my - slope * mx, slope)
}

/// Panels of an accepted effect. `None` where its columns are singular.
pub(super) fn panels(
    rows: &Rows,
    search: &Search,
    last: &Fitted,
    one: &Accepted,
    tracks: &[Track],
) -> Option<Vec<Panel>> {
    let mut panels = Vec::new();
    for group in groups(one) {
        let of_axis = tracks
            .iter()
            .filter(|t| t.kind == ResidualKind::Input && t.axis == Some(group.axis));
        for track in of_axis {
            panels.extend(variable(rows, search, one, &group, track));
        }
    }
    // Whole rows, beside the affine parameters.
    let white = search.variance.whitener(&last.components)?;
    let (basis, columns) = (&search.basis, &one.chosen.columns);
    let share = white
        .whiten(basis)
        .svd(true, true)
        .solve(&white.whiten(columns), 1e-12)
        .ok()?;
    let across = columns - basis * share;
    for track in tracks.iter().filter(|t| t.axis.is_none()) {
        // Rows of another axis are not drawn.
        let mut ours = track.rows.iter();
        if ours.any(|r| columns.row(*r).amax() > 0.0) {
            panels.push(whole(one, &across, track));
        }
    }
    Some(panels)
}

fn whole(one: &Accepted, across: &DMatrix<f64>, track: &Track) -> Panel {
    let fitted = across * DVector::from_column_slice(&one.effect.values);
    let mut curve: Vec<Curve> = track
        .rows
        .iter()
        .map(|r| {
            let by = across.row(*r).transpose();
            Curve {
                x: fitted[*r],
                value: fitted[*r],
                half: 2.0 * by.dot(&(&one.conditional * &by)).max(0.0).sqrt(),
            }
        })
        .collect();
    curve.sort_by(|a, b| a.x.total_cmp(&b.x));
    Panel {
        title: track.name.clone(),
        kind: track.kind,
        against: Against::Fitted,
        points: points(track, |i| {
            let effect = fitted[track.rows[i]];
            (effect, effect)
        }),
        curve,
    }
}

/// `at` gives abscissa and effect of each row of the track.
fn points(track: &Track, at: impl Fn(usize) -> (f64, f64)) -> Vec<At> {
    let of = |(i, s): (usize, &super::Sample)| {
        let (x, effect) = at(i);
        let partial = s.residual[1] + effect;
        At {
            x,
            sigma: s.sigma,
            partial,
            predicted: partial - s.held_out[1],
            after: s.residual[1],
            held_out: s.held_out[1],
        }
    };
    track.samples.iter().enumerate().map(of).collect()
}

/// `None` if the variable is constant in the recording.
fn variable(
    rows: &Rows,
    search: &Search,
    one: &Accepted,
    group: &Group,
    track: &Track,
) -> Option<Panel> {
    let (candidate, parameter) = (&one.chosen.candidate, one.chosen.parameter);
    let conditions = rows.conditions(candidate.followed(parameter));
    let column = |k: usize, r: usize| one.chosen.columns[(r, k)];
    let x: Vec<f64> = track
        .rows
        .iter()
        .map(|r| match &group.on {
            Dependence::Alone(field) => rows.mean(*r, &conditions, |at| field.of(at, group.axis)),
            _ => column(group.members[0], *r),
        })
        .collect();
    let [low, high] = extent(x.iter().copied());
    if !(high - low > 1e-9 * high.abs().max(low.abs())) {
        return None;
    }
    let like = *conditions.first()?;
    let values = |x: f64| match &group.on {
        Dependence::Alone(field) => {
            let mut all = vec![0.0; candidate.axes().len()];
            candidate.regressors(&field.with(like, group.axis, x), parameter, &mut all);
            group.slots.iter().map(|k| all[*k]).collect()
        }
        _ => vec![x],
    };
    let names: Vec<String> = candidate.names().into_iter().map(|n| n.0).collect();
    let members: Vec<&str> = group.members.iter().map(|k| names[*k].as_str()).collect();
    let axis = AXES[group.axis];
    let drawn = Drawn {
        one,
        track,
        members: &group.members,
        sloped: affine_in(search, &x, track),
        x,
    };
    let title = match members[..] {
        [name] if name != axis => format!("{} {axis}, {name}", candidate.sensor),
        _ => format!("{} {axis}", candidate.sensor),
    };
    Some(drawn.panel(
        title,
        abscissa(&group.on, candidate, group.members[0], group.axis),
        values,
    ))
}

/// Coefficients of an effect that are functions of one abscissa, on one track.
struct Drawn<'a> {
    one: &'a Accepted,
    track: &'a Track,
    /// Indices of the coefficients.
    members: &'a [usize],
    /// Abscissa of each row of the track.
    x: Vec<f64>,
    /// Whether the affine calibration can absorb a straight line in x.
    sloped: bool,
}

impl Drawn<'_> {
    /// `values` gives the regressors of the members at an abscissa.
    fn panel(&self, title: String, abscissa: Abscissa, values: impl Fn(f64) -> Vec<f64>) -> Panel {
        let column = |k: usize, r: usize| self.one.chosen.columns[(r, k)];
        let lines: Vec<(f64, f64)> = self
            .members
            .iter()
            .map(|k| {
                let y: Vec<f64> = self.track.rows.iter().map(|r| column(*k, *r)).collect();
                line(&self.x, &y, self.sloped)
            })
            .collect();
        let less = |m: usize, x: f64, value: f64| value - lines[m].0 - lines[m].1 * x;
        let value = |k: &usize| self.one.effect.values[*k];
        let count = self.members.len();
        let covariance = DMatrix::from_fn(count, count, |i, j| {
            self.one.conditional[(self.members[i], self.members[j])]
        });
        let [low, high] = extent(self.x.iter().copied());
        let curve = (0..POINTS).map(|i| {
            let x = low + (high - low) * i as f64 / (POINTS - 1) as f64;
            let values = values(x);
            let at = DVector::from_fn(count, |m, _| less(m, x, values[m]));
            Curve {
                x,
                value: self
                    .members
                    .iter()
                    .zip(&at)
                    .map(|(k, v)| value(k) * v)
                    .sum(),
                half: 2.0 * at.dot(&(&covariance * &at)).max(0.0).sqrt(),
            }
        });
        let effect = |i: usize| {
            let members = self.members.iter().enumerate();
            members
                .map(|(m, k)| value(k) * less(m, self.x[i], column(*k, self.track.rows[i])))
                .sum()
        };
        Panel {
            title,
            kind: self.track.kind,
            against: Against::Variable(abscissa),
            curve: curve.collect(),
            points: points(self.track, |i| (self.x[i], effect(i))),
        }
    }
}

/// Whether the affine calibration can absorb a straight line in `x`, the values of the rows of `track`.
fn affine_in(search: &Search, x: &[f64], track: &Track) -> bool {
    let mean = x.iter().sum::<f64>() / x.len() as f64;
    let mut column = DVector::zeros(search.rows.y.len());
    for (r, x) in track.rows.iter().zip(x) {
        column[*r] = x - mean;
    }
    let left = &column - &search.basis * search.basis.tr_mul(&column);
    // Within 1 %: the input is known for each dwell only, and the reading is along the sensor's own direction.
    left.norm() < 0.01 * column.norm()
}
