//! A sensor over the temperature of its die: cubic curves, a bias that changes from power-on to power-on, hysteresis that is not a lag, and noise.
//!
//! The curves are those of niu (2013), (1) to (3): the error before the sensor is `b(T) + (S(T) + N(T)) x`, with x the true input in body axes and
//! each element of b, S and N a cubic polynomial.

use crate::motion::Motion;
use crate::rotation::Vector;
use crate::thermal::Temperatures;

/// Cubic polynomial: coefficients of 1, ΔT, ΔT², ΔT³.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Cubic(pub [f64; 4]);

impl Cubic {
    /// Its value at a temperature difference, K.
    pub fn at(self, warm: f64) -> f64 {
        let [a, b, c, d] = self.0;
        a + warm * (b + warm * (c + warm * d))
    }
}

/// Triad over the temperature of its dies. SI: rad/s or m/s².
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TriadCurves {
    /// Bias of each axis, SI.
    pub bias: [Cubic; 3],
    /// Error over input, relative: scale factor errors on the diagonal, misalignments off it. Rows are sensors, columns body axes.
    pub matrix: [[Cubic; 3]; 3],
    /// Bias that applies to this power-on only, SI.
    pub power_on: Vector,
    /// Half the height of the hysteresis loop of the bias, SI.
    pub hysteresis: Vector,
    /// Width of the loop, K: after a reversal, the bias passes from one branch to the other over this temperature change.
    pub width_c: f64,
    /// Standard deviation of each reading, raw, over the die's temperature: °C, then axes x, y, z. Temperatures increase; values are linear between
    /// them and constant outside. If empty, the standard deviation of the axis applies.
    pub noise: Vec<[f64; 4]>,
}

/// Both triads.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CurvesTruth {
    /// Temperature from which the cubics count, °C.
    pub reference_c: f64,
    /// Gyros.
    pub gyro: TriadCurves,
    /// Accelerometer.
    pub accel: TriadCurves,
}

/// A stop operator (the complement of the play operator, elements of Prandtl and Ishlinskii). Its state depends on the path of the temperature, but
/// on neither its rate nor the time.
#[derive(Debug, Clone, Copy, Default)]
struct Stop {
    /// Centre of the play, °C.
    rest: Option<f64>,
}

impl Stop {
    /// From -1, on the branch of falling temperature, to 1, on that of rising temperature. It begins at 0, between them.
    fn step(&mut self, temperature: f64, width_c: f64) -> f64 {
        let half = 0.5 * width_c;
        let rest = self.rest.get_or_insert(temperature);
        *rest = rest.clamp(temperature - half, temperature + half);
        (temperature - *rest) / half
    }
}

/// State of the curves of a triad.
#[derive(Debug, Clone)]
struct Triad {
    truth: TriadCurves,
    stops: [Stop; 3],
    /// Whether there is no error to add.
    idle: bool,
}

impl Triad {
    fn new(truth: &TriadCurves) -> Self {
        let quiet = TriadCurves {
            noise: truth.noise.clone(),
            width_c: truth.width_c,
            ..TriadCurves::default()
        };
        Self {
            idle: *truth == quiet,
            truth: truth.clone(),
            stops: [Stop::default(); 3],
        }
    }

    fn add(&mut self, reference_c: f64, dies: [f64; 3], input: Vector, error: &mut Vector) {
        if self.idle {
            return;
        }
        for i in 0..3 {
            let warm = dies[i] - reference_c;
            let mut sum = self.truth.bias[i].at(warm) + self.truth.power_on[i];
            for (cubic, x) in self.truth.matrix[i].iter().zip(input) {
                sum += cubic.at(warm) * x;
            }
            if self.truth.hysteresis[i] != 0.0 {
                sum += self.truth.hysteresis[i] * self.stops[i].step(dies[i], self.truth.width_c);
            }
            error[i] += sum;
        }
    }
}

/// The curves of a running unit, with their state.
#[derive(Debug, Clone)]
pub(crate) struct Curves {
    reference_c: f64,
    gyro: Triad,
    accel: Triad,
}

impl Curves {
    pub(crate) fn new(truth: &CurvesTruth) -> Self {
        Self {
            reference_c: truth.reference_c,
            gyro: Triad::new(&truth.gyro),
            accel: Triad::new(&truth.accel),
        }
    }

    /// Advances one step: adds the errors at the inputs of gyros (rad/s) and accelerometer (m/s²).
    pub(crate) fn add(
        &mut self,
        motion: &Motion,
        temperatures: Temperatures,
        gyro: &mut Vector,
        accel: &mut Vector,
    ) {
        let [x, y, z, a] = temperatures.die;
        self.gyro
            .add(self.reference_c, [x, y, z], motion.rate, gyro);
        self.accel
            .add(self.reference_c, [a; 3], motion.force, accel);
    }

    /// Standard deviation of a reading of the gyros and of the accelerometer, raw, if it depends on temperature.
    pub(crate) fn noise(&self, temperatures: Temperatures) -> [Option<Vector>; 2] {
        let [x, y, z, a] = temperatures.die;
        [
            noise(&self.gyro.truth.noise, [x, y, z]),
            noise(&self.accel.truth.noise, [a; 3]),
        ]
    }
}

fn noise(points: &[[f64; 4]], dies: [f64; 3]) -> Option<Vector> {
    let (first, last) = (points.first()?, points.last()?);
    Some(std::array::from_fn(|i| {
        let t = dies[i];
        let after = points.partition_point(|p| p[0] <= t);
        match (after.checked_sub(1).map(|k| points[k]), points.get(after)) {
            (Some(a), Some(b)) => a[i + 1] + (b[i + 1] - a[i + 1]) * (t - a[0]) / (b[0] - a[0]),
            (None, _) => first[i + 1],
            (_, None) => last[i + 1],
        }
    }))
}
