//! Polynomials on the interval and the square: optima that have been known for half a century.

use mimu::plan::design::exchange;
use mimu::plan::design::information::Rows;
use mimu::plan::design::refinement::{Region, refine};
use nalgebra::DMatrix;

use super::close;

/// Polynomials up to a degree on the interval or the square from -1 to 1.
struct Cube {
    factors: usize,
    degree: i32,
}

impl Region for Cube {
    type Point = Vec<f64>;

    fn width(&self) -> usize {
        let d = self.degree as usize;
        match self.factors {
            1 => d + 1,
            _ => (d + 1) * (d + 2) / 2,
        }
    }

    fn regressors(&self, x: &Vec<f64>, row: &mut Vec<f64>) {
        for i in 0..=self.degree {
            match x[..] {
                [x] => row.push(x.powi(i)),
                [x, y] => row.extend((0..=i).map(|j| x.powi(i - j) * y.powi(j))),
                _ => unreachable!(),
            }
        }
    }

    fn neighbours(&self, x: &Vec<f64>, step: f64) -> Vec<Vec<f64>> {
        let each = (0..x.len()).flat_map(|k| [(k, step), (k, -step)]);
        each.map(|(k, step)| {
            let mut next = x.clone();
            next[k] = (next[k] + step).clamp(-1.0, 1.0);
            next
        })
        .collect()
    }
}

impl Cube {
    fn grid(&self, steps: i32) -> Vec<Vec<f64>> {
        let levels = || (0..=steps).map(move |i| f64::from(2 * i - steps) / f64::from(steps));
        match self.factors {
            1 => levels().map(|x| vec![x]).collect(),
            _ => levels()
                .flat_map(|x| levels().map(move |y| vec![x, y]))
                .collect(),
        }
    }

    /// Determinant of F'F of the best exact design.
    fn best(&self, n: usize, steps: i32) -> (Vec<Vec<f64>>, f64) {
        let grid = self.grid(steps);
        let found = exchange::search(&self.rows(&grid), n, 20, 1);
        let refined = found
            .iter()
            .take(6)
            .filter_map(|f| refine(self, f.points.iter().map(|&i| grid[i].clone()).collect()));
        let (points, log_det) = refined.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        (points, log_det.exp())
    }
}

#[test]
fn quadratic_regression_on_an_interval_is_measured_at_both_ends_and_the_middle() {
    // Gaffke and Krafft, J. R. Statist. Soc. B 44 (1982): for any n, as evenly as possible. Then det F'F is 4 n1 n2 n3.
    for (n, det) in [
        (3, 4.0),
        (4, 8.0),
        (5, 16.0),
        (6, 32.0),
        (7, 48.0),
        (9, 108.0),
    ] {
        let (points, found) = Cube {
            factors: 1,
            degree: 2,
        }
        .best(n, 11);
        assert!(close(found, det, 1e-9), "{n}: {found} at {points:?}");
        for point in points {
            assert!(point[0].abs() < 1e-5 || point[0].abs() == 1.0, "{point:?}");
        }
    }
}

#[test]
fn cubic_regression_on_an_interval_is_measured_where_the_grid_has_no_point() {
    // Guest (1958), Hoel (1958): the ends and the roots of P3', ±1/√5; det F'F is the square of the Vandermonde determinant.
    let a = 0.2_f64.sqrt();
    let vandermonde = 2.0 * (2.0 * a) * (1.0 - a * a).powi(2);
    let (points, found) = Cube {
        factors: 1,
        degree: 3,
    }
    .best(4, 12);
    assert!(close(found, vandermonde.powi(2), 1e-10), "{found}");
    let mut at: Vec<f64> = points.into_iter().flatten().collect();
    at.sort_by(f64::total_cmp);
    for (found, known) in at.iter().zip([-1.0, -a, a, 1.0]) {
        assert!((found - known).abs() < 1e-5, "{at:?}");
    }
}

/// Determinant of F'F for points on the square, by the textbook formula.
fn of_square(points: &[[f64; 2]]) -> f64 {
    let f = DMatrix::from_fn(points.len(), 6, |i, j| {
        let [x, y] = points[i];
        [1.0, x, y, x * x, x * y, y * y][j]
    });
    (f.transpose() * f).determinant()
}

#[test]
fn the_quadratic_on_the_square_has_box_and_drapers_exact_designs() {
    // Technometrics 13 (1971). n = 6: α = (4 - √13)/3. n = 9: the 3x3 factorial.
    let a = (4.0 - 13.0_f64.sqrt()) / 3.0;
    let six = of_square(&[
        [-1.0, -1.0],
        [1.0, -1.0],
        [-1.0, 1.0],
        [-a, -a],
        [1.0, 3.0 * a],
        [3.0 * a, 1.0],
    ]);
    let levels = [-1.0, 0.0, 1.0];
    let factorial: Vec<[f64; 2]> = levels
        .into_iter()
        .flat_map(|x| levels.map(|y| [x, y]))
        .collect();
    let nine = of_square(&factorial);
    assert!(close(nine, 5184.0, 1e-12), "{nine}");
    for (n, det) in [(6, six), (9, nine)] {
        let (points, found) = Cube {
            factors: 2,
            degree: 2,
        }
        .best(n, 10);
        assert!(
            close(found, det, 1e-9),
            "{n}: {found}, not {det}: {points:?}"
        );
    }
}

#[test]
fn rows_that_determine_nothing_have_no_design() {
    let mut rows = Rows::new(2);
    rows.push(&[1.0, 1.0]);
    rows.push(&[1.0, 1.0]);
    assert!(exchange::search(&rows, 4, 3, 1).is_empty());
}
