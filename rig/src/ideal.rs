//! Readings directly from a forward model, for Monte Carlo studies with dwell means instead of time series.

use crate::random::Random;
use crate::rotation::{Vector, cross, dot, scale};

/// `u = P x + b + noise`, raw; x is the true input, rows of P are sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ideal {
    /// P, raw per SI.
    pub matrix: [Vector; 3],
    /// b, raw.
    pub bias: Vector,
    /// Noise of a single reading, standard deviation, raw.
    pub sigma: Vector,
}

/// How the misalignment matrix follows from fang's angles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Angles {
    /// `Mo Rz(θz) Ry(θy) Rx(θx)` with true rotations by the right-hand rule. fang's (9) and (10) have the opposite sense of rotation to his (11). All
    /// his later equations use (12), which is the small-angle form of this product.
    Exact,
    /// `Mo Mp` with Mp as in (12): the middle of (14).
    Small,
    /// The end of (14), without products of two angles: (16) and (18).
    Linear,
}

/// fang's parameters of a triad, (13) to (18).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fang {
    /// Diagonal of K.
    pub scale: Vector,
    /// b.
    pub bias: Vector,
    /// Package misalignment θx, θy, θz, rad.
    pub theta: Vector,
    /// Non-orthogonality βyz, βzy, βzx, rad.
    pub beta: Vector,
}

/// fang, table 3; all dimensionless. Its noise is that of (35): 0.001.
pub const FANG_TABLE_3: Fang = Fang {
    scale: [0.01, 0.05, 0.09],
    bias: [2.0, 2.5, 2.9],
    theta: [0.01, 0.05, 0.1],
    beta: [0.5, 0.5, 0.8],
};

/// An inverse model `x = C u + o`, xu (1) and (2).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inverse {
    /// C, SI per raw.
    pub matrix: [Vector; 3],
    /// o, SI.
    pub offset: Vector,
}

/// Degree per second, rad/s.
const DPS: f64 = std::f64::consts::PI / 180.0;

/// xu, table 1, averages of the gyros: raw in rad/s, to rad/s. The offsets are printed in rad/s; in deg/s, as here, the table agrees with
/// table 3.
pub const XU_TABLE_1: Inverse = Inverse {
    matrix: [
        [0.99972, -0.01199, -0.00059],
        [0.02394, 1.00046, 0.01053],
        [0.01087, 0.01490, 1.00579],
    ],
    offset: [-0.04317 * DPS, -0.12395 * DPS, -0.35153 * DPS],
};

/// xu, table 2, averages of the accelerometers: raw in m/s², to m/s². The printed unit of the offsets, mg, contradicts their scatter. The table does
/// not show whether they are in g or m/s²; here they are in m/s², the unit of the model.
pub const XU_TABLE_2: Inverse = Inverse {
    matrix: [
        [0.96667, 0.01434, -0.00180],
        [-0.01760, 0.96965, -0.00851],
        [0.01476, -0.01494, 0.99326],
    ],
    offset: [-0.16417, 0.10724, 0.26508],
};

impl Ideal {
    /// Mean of `samples` readings of the input x.
    pub fn read(&self, x: Vector, samples: u32, random: &mut Random) -> Vector {
        let per_mean = 1.0 / f64::from(samples).sqrt();
        std::array::from_fn(|i| {
            dot(self.matrix[i], x) + self.bias[i] + per_mean * self.sigma[i] * random.normal()
        })
    }
}

impl Fang {
    /// M, rows are sensors.
    pub fn misalignment(&self, angles: Angles) -> [Vector; 3] {
        let ([x, y, z], [yz, zy, zx]) = (self.theta, self.beta);
        let package = match angles {
            Angles::Exact => product(&product(&about_z(z), &about_y(y)), &about_x(x)),
            Angles::Small => [[1.0, -z, y], [z, 1.0, -x], [-y, x, 1.0]],
            Angles::Linear => {
                return [[1.0, -z, y], [yz + z, 1.0, -x], [-zy - y, zx + x, 1.0]];
            }
        };
        product(&[[1.0, 0.0, 0.0], [yz, 1.0, 0.0], [-zy, zx, 1.0]], &package)
    }

    /// The forward model `K M x + b`.
    pub fn forward(&self, angles: Angles, sigma: Vector) -> Ideal {
        let m = self.misalignment(angles);
        Ideal {
            matrix: std::array::from_fn(|i| scale(self.scale[i], m[i])),
            bias: self.bias,
            sigma,
        }
    }
}

impl Inverse {
    /// The forward model to which this model is the inverse; `None` if C is singular.
    pub fn forward(&self, sigma: Vector) -> Option<Ideal> {
        let matrix = invert(&self.matrix)?;
        let bias = matrix.map(|row| -dot(row, self.offset));
        Some(Ideal {
            matrix,
            bias,
            sigma,
        })
    }
}

fn about_x(a: f64) -> [Vector; 3] {
    let (s, c) = a.sin_cos();
    [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]
}

fn about_y(a: f64) -> [Vector; 3] {
    let (s, c) = a.sin_cos();
    [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]
}

fn about_z(a: f64) -> [Vector; 3] {
    let (s, c) = a.sin_cos();
    [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]
}

fn product(a: &[Vector; 3], b: &[Vector; 3]) -> [Vector; 3] {
    a.map(|row| std::array::from_fn(|j| (0..3).map(|k| row[k] * b[k][j]).sum()))
}

/// The columns of the inverse are the vector products of the rows, divided by their volume.
pub(crate) fn invert(m: &[Vector; 3]) -> Option<[Vector; 3]> {
    let columns = [cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1])];
    let volume = dot(m[0], columns[0]);
    (volume != 0.0).then(|| std::array::from_fn(|i| columns.map(|c| c[i] / volume)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_rotations_agree_with_equation_12_to_second_order() {
        for size in [1e-2, 1e-3] {
            let fang = Fang {
                theta: [size, -0.7 * size, 0.4 * size],
                beta: [0.0; 3],
                ..FANG_TABLE_3
            };
            let (exact, small) = (
                fang.misalignment(Angles::Exact),
                fang.misalignment(Angles::Small),
            );
            for (e, s) in exact.as_flattened().iter().zip(small.as_flattened()) {
                assert!((e - s).abs() < size * size, "{e} {s}");
            }
        }
    }

    #[test]
    fn the_exact_package_misalignment_is_a_rotation() {
        let fang = Fang {
            beta: [0.0; 3],
            ..FANG_TABLE_3
        };
        let m = fang.misalignment(Angles::Exact);
        for i in 0..3 {
            assert!((dot(m[i], m[i]) - 1.0).abs() < 1e-15);
            let next = cross(m[i], m[(i + 1) % 3]);
            for j in 0..3 {
                assert!((next[j] - m[(i + 2) % 3][j]).abs() < 1e-15);
            }
        }
    }

    #[test]
    fn table_3_gives_the_products_of_equation_14() {
        // Computed by hand from Mo Mp. The printed (14) has βyz θz in its element (3,2), but the product gives βzy θz; in table 3 the two are equal.
        let m = FANG_TABLE_3.misalignment(Angles::Small);
        let expected = [[1.0, -0.1, 0.05], [0.6, 0.95, 0.015], [-0.47, 0.86, 0.967]];
        for (a, b) in m.as_flattened().iter().zip(expected.as_flattened()) {
            assert!((a - b).abs() < 1e-15, "{a} {b}");
        }
    }

    #[test]
    fn the_forward_model_of_an_inverse_one_reads_what_it_brings_back() {
        for (inverse, x) in [
            (XU_TABLE_1, [1.0, -2.0, 60.0]),
            (XU_TABLE_2, [9.8, -3.0, 0.5]),
        ] {
            let u = inverse
                .forward([0.0; 3])
                .unwrap()
                .read(x, 1, &mut Random::new(1, "none"));
            for i in 0..3 {
                let back = dot(inverse.matrix[i], u) + inverse.offset[i];
                assert!((back - x[i]).abs() < 1e-13, "{back}");
            }
        }
    }

    #[test]
    fn the_mean_of_n_readings_scatters_by_sigma_over_root_n() {
        let ideal = FANG_TABLE_3.forward(Angles::Linear, [0.001; 3]);
        let mut random = Random::new(7, "readings");
        let runs = 4000;
        let mut squares = 0.0;
        for _ in 0..runs {
            let u = ideal.read([0.0; 3], 25, &mut random);
            squares += (0..3).map(|i| (u[i] - ideal.bias[i]).powi(2)).sum::<f64>();
        }
        // Chi-square with 12 000 degrees of freedom: the sigma of the variance is 1.3 %.
        let ratio = squares / f64::from(3 * runs) / (0.001_f64.powi(2) / 25.0);
        assert!((ratio - 1.0).abs() < 4.0 * 0.013, "{ratio}");
    }
}
