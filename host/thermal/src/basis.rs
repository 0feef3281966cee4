//! What a curve over temperature is made of: a line, a cubic, or a smooth spline.

use nalgebra::DMatrix;

/// Smallest span of a die's temperature, K, that determines a slope.
pub const SLOPE_SPAN: f64 = 10.0;
/// Over a smaller span, K, noise and drift look like curvature: a plan may not rely on it, and a fit needs evidence of it.
pub const CURVATURE_SPAN: f64 = 20.0;
/// Intended spacing of the knots, K: a cubic piece over it follows the curves of sensors, and the penalty smooths the rest.
const KNOT_SPACING: f64 = 8.0;
const MOST_INTERVALS: usize = 20;

/// Shape of a curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// A straight line.
    Line,
    /// One cubic for the whole range, niu (3).
    Cubic,
    /// Cubic B-splines whose curvature is penalised.
    Spline,
}

/// Functions of a die's temperature that a curve is a sum of. Outside the range the curve continues along its slope.
#[derive(Debug, Clone, PartialEq)]
pub struct Basis {
    shape: Shape,
    low: f64,
    high: f64,
    intervals: usize,
}

impl Basis {
    /// Over the temperatures `range`, °C.
    pub fn new(shape: Shape, range: [f64; 2]) -> Self {
        let span = range[1] - range[0];
        let intervals = (span / KNOT_SPACING)
            .round()
            .clamp(3.0, MOST_INTERVALS as f64);
        Self {
            shape,
            low: range[0],
            high: range[1],
            intervals: intervals as usize,
        }
    }

    /// Shape of the curve.
    pub fn shape(&self) -> Shape {
        self.shape
    }

    /// Number of functions.
    pub fn functions(&self) -> usize {
        match self.shape {
            Shape::Line => 2,
            Shape::Cubic => 4,
            Shape::Spline => self.intervals + 3,
        }
    }

    /// How many combinations of them the penalty leaves free.
    pub fn free(&self) -> usize {
        match self.shape {
            Shape::Spline => 2,
            _ => self.functions(),
        }
    }

    /// Values at `temp_c`: index of the first that is not zero, and those from there on.
    pub fn values(&self, temp_c: f64) -> (usize, [f64; 4]) {
        let inside = self.inside(temp_c);
        let (from, mut values) = self.within(inside);
        if inside != temp_c {
            let (_, slopes) = self.slopes_within(inside);
            for (v, s) in values.iter_mut().zip(slopes) {
                *v += s * (temp_c - inside);
            }
        }
        (from, values)
    }

    /// Derivatives by temperature, 1/K, likewise.
    pub fn slopes(&self, temp_c: f64) -> (usize, [f64; 4]) {
        self.slopes_within(self.inside(temp_c))
    }

    fn inside(&self, temp_c: f64) -> f64 {
        match self.shape {
            Shape::Spline | Shape::Cubic => temp_c.clamp(self.low, self.high),
            _ => temp_c,
        }
    }

    /// Temperature from -1 to 1 over the range.
    fn unit(&self, temp_c: f64) -> f64 {
        (2.0 * temp_c - self.low - self.high) / (self.high - self.low).max(1e-9)
    }

    fn interval(&self, temp_c: f64) -> (usize, f64) {
        let x = (temp_c - self.low) / (self.high - self.low) * self.intervals as f64;
        let k = (x.max(0.0) as usize).min(self.intervals - 1);
        (k, x - k as f64)
    }

    fn within(&self, temp_c: f64) -> (usize, [f64; 4]) {
        let x = self.unit(temp_c);
        match self.shape {
            Shape::Line => (0, [1.0, x, 0.0, 0.0]),
            Shape::Cubic => (0, [1.0, x, x * x, x * x * x]),
            Shape::Spline => {
                let (k, s) = self.interval(temp_c);
                let r = 1.0 - s;
                let b = [
                    r * r * r,
                    3.0 * s * s * s - 6.0 * s * s + 4.0,
                    3.0 * r * r * r - 6.0 * r * r + 4.0,
                    s * s * s,
                ];
                (k, b.map(|v| v / 6.0))
            }
        }
    }

    fn slopes_within(&self, temp_c: f64) -> (usize, [f64; 4]) {
        let x = self.unit(temp_c);
        let per_k = 2.0 / (self.high - self.low).max(1e-9);
        match self.shape {
            Shape::Line => (0, [0.0, per_k, 0.0, 0.0]),
            Shape::Cubic => (0, [0.0, 1.0, 2.0 * x, 3.0 * x * x].map(|v| v * per_k)),
            Shape::Spline => {
                let (k, s) = self.interval(temp_c);
                let r = 1.0 - s;
                let b = [-r * r, 3.0 * s * s - 4.0 * s, 4.0 * r - 3.0 * r * r, s * s];
                let per_k = self.intervals as f64 / (self.high - self.low);
                (k, b.map(|v| 0.5 * v * per_k))
            }
        }
    }

    /// The penalties: integrals over the range of products of second derivatives, 1/K³, and of fourth derivatives, 1/K⁷, the latter by
    /// differences of the coefficients. The first leaves a line free, the second a cubic. Zero for other shapes than splines.
    pub fn penalties(&self) -> [DMatrix<f64>; 2] {
        let n = self.functions();
        let mut second = DMatrix::zeros(n, n);
        let mut fourth = DMatrix::zeros(n, n);
        if self.shape != Shape::Spline {
            return [second, fourth];
        }
        let h = (self.high - self.low) / self.intervals as f64;
        // Second derivatives are linear in a piece: Gauss's two points are exact for their products.
        for s in [0.5 - 0.5 / 3f64.sqrt(), 0.5 + 0.5 / 3f64.sqrt()] {
            let bend = [1.0 - s, 3.0 * s - 2.0, 1.0 - 3.0 * s, s].map(|v| v / (h * h));
            for k in 0..self.intervals {
                add_products(&mut second, k, &bend, 0.5 * h);
            }
        }
        let difference = [1.0, -4.0, 6.0, -4.0, 1.0].map(|v| v / h.powi(4));
        for k in 0..n - 4 {
            add_products(&mut fourth, k, &difference, h);
        }
        [second, fourth]
    }

    /// Coefficients of the constant 1 and of a line through 0 in the middle of the range, with the slope of 1 over half of it.
    pub fn lines(&self) -> DMatrix<f64> {
        match self.shape {
            Shape::Spline => {
                let h = 2.0 / self.intervals as f64;
                let line = |i: usize| -1.0 + (i as f64 - 1.0) * h;
                DMatrix::from_fn(
                    self.functions(),
                    2,
                    |i, j| if j == 0 { 1.0 } else { line(i) },
                )
            }
            _ => DMatrix::identity(self.functions(), self.functions()),
        }
    }
}

/// Adds `factor` times the products of `values`, which begin at `from`.
fn add_products(matrix: &mut DMatrix<f64>, from: usize, values: &[f64], factor: f64) {
    for (i, a) in values.iter().enumerate() {
        for (j, b) in values.iter().enumerate() {
            matrix[(from + i, from + j)] += factor * a * b;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splines_sum_to_one_and_their_slopes_are_those_of_their_values() {
        let basis = Basis::new(Shape::Spline, [-10.0, 70.0]);
        for t in [-14.0, -10.0, 3.3, 41.0, 70.0, 75.0] {
            let (_, v) = basis.values(t);
            assert!((v.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
        for t in [-9.3, 13.3, 55.5] {
            let (from, slope) = basis.slopes(t);
            let (a, below) = basis.values(t - 1e-4);
            let (b, above) = basis.values(t + 1e-4);
            assert_eq!((from, from), (a, b));
            for i in 0..4 {
                assert!(((above[i] - below[i]) / 2e-4 - slope[i]).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn the_penalty_of_a_line_is_nothing_and_that_of_a_parabola_its_curvature() {
        let basis = Basis::new(Shape::Spline, [0.0, 80.0]);
        let n = basis.functions();
        // Coefficients of a function that is quadratic are its values at the centres, up to a constant.
        let centre = |i: usize| (i as f64 - 1.0) * 80.0 / (n - 3) as f64;
        let line = nalgebra::DVector::from_fn(n, |i, _| 3.0 - 0.2 * centre(i));
        let parabola = nalgebra::DVector::from_fn(n, |i, _| 0.01 * centre(i).powi(2));
        let [second, fourth] = basis.penalties();
        assert!(line.dot(&(&second * &line)).abs() < 1e-12);
        let expected = 0.02f64.powi(2) * 80.0;
        assert!((parabola.dot(&(&second * &parabola)) / expected - 1.0).abs() < 1e-9);
        assert!(parabola.dot(&(&fourth * &parabola)).abs() < 1e-12);
        let shown = basis.lines();
        for t in [0.0, 20.0, 71.0] {
            let (from, v) = basis.values(t);
            let value = |c: usize| (0..4).map(|i| v[i] * shown[(from + i, c)]).sum::<f64>();
            assert!((value(0) - 1.0).abs() < 1e-12 && (value(1) - (t - 40.0) / 40.0).abs() < 1e-12);
        }
    }
}
