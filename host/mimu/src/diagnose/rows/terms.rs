//! Columns of terms and jumps. All terms are products of the same nine quantities, which are stored here as arrays. Computing them from the
//! conditions for each term took a third of the time of a diagnosis by hand, whose turns have some ten thousand segments.

use nalgebra::DMatrix;

use super::Rows;
use crate::effects::quantity::{Quantity, RATE_LAG_S};
use crate::effects::regressor::Product;
use crate::effects::temperature::Followed;

/// The quantities of terms under all conditions.
#[derive(Debug, Clone)]
pub(super) struct Quantities {
    /// Of each of [`Quantity::OF_TERMS`].
    values: [Vec<f64>; 9],
    /// Largest finite magnitude of each.
    largest: [f64; 9],
    /// Time of each of the conditions, s since its recording began.
    t_s: Vec<f64>,
}

impl Quantities {
    fn of(rows: &Rows) -> Self {
        let behind = Followed {
            lag_s: Some(RATE_LAG_S),
            without_self_heating: false,
        };
        let conditions = rows.conditions(Some(behind));
        // None of these quantities depends on the axis.
        let of = |q: Quantity| conditions.iter().map(|at| q.of(at, 0)).collect();
        let values: [Vec<f64>; 9] = Quantity::OF_TERMS.map(of);
        let largest = values.each_ref().map(|all| {
            let sizes = all.iter().map(|v| v.abs()).filter(|v| v.is_finite());
            sizes.fold(0.0, f64::max)
        });
        Self {
            values,
            largest,
            t_s: conditions.iter().map(|at| at.t_s).collect(),
        }
    }
}

/// Place of a quantity among those of terms, and its power, for each part of a product.
fn parts(product: &Product) -> impl Iterator<Item = (usize, i32)> + '_ {
    product.parts().filter_map(|(q, power)| {
        let place = Quantity::OF_TERMS.iter().position(|t| *t == q)?;
        Some((place, i32::from(power)))
    })
}

impl Rows {
    fn quantities(&self) -> &Quantities {
        self.quantities.get_or_init(|| Quantities::of(self))
    }

    /// The term `product` as an error of each of `axes`: a column for each.
    pub fn term(&self, product: &Product, axes: &[usize]) -> DMatrix<f64> {
        let mut values = vec![product.sign; self.conditions.len()];
        for (place, power) in parts(product) {
            for (value, factor) in values.iter_mut().zip(&self.quantities().values[place]) {
                *value *= factor.powi(power);
            }
        }
        self.weighted(axes, &values)
    }

    /// Upper bound of the term: the product of the largest magnitudes of its quantities.
    pub fn largest(&self, product: &Product) -> f64 {
        let largest = &self.quantities().largest;
        parts(product)
            .map(|(place, power)| largest[place].powi(power))
            .product()
    }

    /// A jump at `t_s` of recording `session` as an error of `axis`.
    pub fn jump(&self, session: usize, t_s: f64, axis: usize) -> DMatrix<f64> {
        let times = self.quantities().t_s.iter().zip(&self.block);
        let since = times.map(|(t, (of, _))| f64::from(u8::from(*of == session && *t >= t_s)));
        self.weighted(&[axis], &since.collect::<Vec<_>>())
    }

    /// First and last of the times of each recording's conditions, s since it began; zeros for one without rows.
    pub fn spans(&self) -> Vec<[f64; 2]> {
        let mut spans = vec![[f64::INFINITY, f64::NEG_INFINITY]; self.first.len() - 1];
        for (t_s, (session, _)) in self.quantities().t_s.iter().zip(&self.block) {
            let [from, to] = &mut spans[*session];
            (*from, *to) = (from.min(*t_s), to.max(*t_s));
        }
        let known = |span: [f64; 2]| if span[0] <= span[1] { span } else { [0.0; 2] };
        spans.into_iter().map(known).collect()
    }

    /// Steps of a bias of recording `session` that rise from 0 to 1 within `length_s` from each of the `starts` on, which follow each other at that
    /// distance: a column for each as an error of x, then of y and of z.
    pub fn ramps(&self, session: usize, starts: &[f64], length_s: f64) -> DMatrix<f64> {
        let count = starts.len();
        let t_s = &self.quantities().t_s;
        let mut columns = DMatrix::zeros(self.rows.len(), 3 * count);
        for (r, row) in self.rows.iter().enumerate() {
            for (k, weight) in row.conditions.clone().zip(&row.weights) {
                if self.block[k].0 != session {
                    continue;
                }
                let begun = starts.partition_point(|start| *start < t_s[k]);
                for (step, start) in starts[..begun].iter().enumerate() {
                    let risen = ((t_s[k] - start) / length_s).min(1.0);
                    for axis in 0..3 {
                        columns[(r, axis * count + step)] += weight[axis] * risen;
                    }
                }
            }
        }
        columns
    }

    /// Columns of an error of each of `axes` with `values`, one for each of the conditions.
    fn weighted(&self, axes: &[usize], values: &[f64]) -> DMatrix<f64> {
        let mut columns = DMatrix::zeros(self.rows.len(), axes.len());
        for (r, row) in self.rows.iter().enumerate() {
            for (value, weight) in values[row.conditions.clone()].iter().zip(&row.weights) {
                for (k, axis) in axes.iter().enumerate() {
                    // An unknown value (NaN) may have weight 0.
                    if weight[*axis] != 0.0 {
                        columns[(r, k)] += weight[*axis] * value;
                    }
                }
            }
        }
        columns
    }
}
