//! From candidates to a continuous region: designs between the grid's points.

use super::information::{Inverse, Rows, dot};

/// Where one can measure, and the regressor row there.
pub trait Region: Sync {
    /// A point of it.
    type Point: Clone + Send + Sync;

    /// Number of parameters.
    fn width(&self) -> usize;

    /// Appends the row of `point`.
    fn regressors(&self, point: &Self::Point, row: &mut Vec<f64>);

    /// Points of the region about `step` away from `point` (full extent 1, or 1 rad), along all directions
    /// that the region has there. Empty where it consists of single points.
    fn neighbours(&self, point: &Self::Point, step: f64) -> Vec<Self::Point>;

    /// Rows of `points`.
    fn rows(&self, points: &[Self::Point]) -> Rows {
        let mut rows = Rows::new(self.width());
        let mut row = Vec::new();
        for point in points {
            row.clear();
            self.regressors(point, &mut row);
            rows.push(&row);
        }
        rows
    }
}

/// First and last step of a search. 1e-7 from a maximum costs 1e-14 of it.
const STEPS: [f64; 2] = [0.1, 1e-7];
/// Gain in a logarithm of a determinant below which it is rounding.
const GAIN: f64 = 1e-13;
/// Least gain of a move in a climb, divided by the square of its length. A table with an axis of symmetry has whole rings of maxima: without this
/// limit a climb went round such a ring for ever.
const SUFFICIENT: f64 = 1e-2;
/// Most moves and halvings of a climb. If it ends by this, only a nearly level ridge is left to climb.
const MOVES: usize = 300;
/// Most sweeps over a design.
const SWEEPS: usize = 400;

/// Climbs from `point` to the next maximum of `value`: a pattern search, whose step halves where no neighbour
/// is better.
///
/// Derivatives would be faster, but would need every term twice; at these sizes the search takes microseconds.
fn climb<R: Region>(
    region: &R,
    point: &R::Point,
    first: f64,
    value: impl Fn(&[f64]) -> f64,
) -> (R::Point, f64) {
    let mut row = Vec::new();
    let mut at = |point: &R::Point| {
        row.clear();
        region.regressors(point, &mut row);
        value(&row)
    };
    let (mut best, mut height) = (point.clone(), at(point));
    let mut step = first;
    for _ in 0..MOVES {
        if step < STEPS[1] {
            break;
        }
        let mut moved = false;
        for next in region.neighbours(&best, step) {
            let new = at(&next);
            if new > height + GAIN.max(SUFFICIENT * step * step) {
                (best, height, moved) = (next, new, true);
                break;
            }
        }
        step = if moved {
            (2.0 * step).min(first)
        } else {
            step / 2.0
        };
    }
    (best, height)
}

/// Moves the points of a design, one after the other, until none can be moved to a larger determinant.
///
/// Returns the points and the logarithm of `det F'F`; `None` if the design does not determine the parameters.
pub fn refine<R: Region>(region: &R, mut points: Vec<R::Point>) -> Option<(Vec<R::Point>, f64)> {
    let mut rows = region.rows(&points);
    let mut inverse = Inverse::of_all(&rows)?;
    let mut first = STEPS[0];
    for _ in 0..SWEEPS {
        let before = inverse.log_det();
        for k in 0..points.len() {
            // log of the factor by which the determinant grows when row f is exchanged for row g; see
            // `exchange`.
            let f = rows.row(k);
            let (v, keep) = (inverse.times(f), 1.0 - inverse.variance(f));
            let gain = |g: &[f64]| {
                let cross = dot(&v, g);
                ((1.0 + inverse.variance(g)) * keep + cross * cross).ln()
            };
            let (moved, gained) = climb(region, &points[k], first, gain);
            if gained > GAIN {
                points[k] = moved;
                rows = region.rows(&points);
                inverse = Inverse::of_all(&rows)?;
            }
        }
        if inverse.log_det() - before < 10.0 * GAIN {
            break;
        }
        first = (first / 2.0).max(1e-3);
    }
    let log_det = inverse.log_det();
    Some((points, log_det))
}
