//! Dead reckoning over a segment, with the derivatives of its result by the state of the session and the covariance that each source of noise
//! gives it.
//!
//! The errors obey `φ' = R δω`, `v' = φ × R f + R δf`, `p' = v` (Savage, Strapdown Analytics, 12; frame of navigation, estimate minus truth), which
//! is linear. So the covariance of the result is a sum over the sources of noise, each times its Gramian, and the Gramians are accumulated once. The
//! likelihood of any densities then needs no sample.

use nalgebra::{Matrix3, Rotation3, SMatrix, Vector3};

use super::state::{By, Readings, STATES};
use crate::quantity::{PerSensor, Sensor};

/// Attitude, velocity, position, and the position at the middle of the segment.
const ERRORS: usize = 12;
/// Time over which readings are added up before covariances follow, s: the force turns by 0.1 rad in it at 10 rad/s.
const COARSE_S: f64 = 0.008;

pub(super) type Errors = SMatrix<f64, ERRORS, ERRORS>;
type ErrorsBy = SMatrix<f64, ERRORS, STATES>;

/// Attitude, velocity and position since the beginning of a segment.
#[derive(Debug, Clone)]
pub(super) struct DeadReckoning {
    /// Body to navigation.
    pub rotation: Matrix3<f64>,
    pub velocity: Vector3<f64>,
    pub position: Vector3<f64>,
    /// Position at the call of [`Self::mark`].
    pub marked: Vector3<f64>,
    pub duration_s: f64,
    /// Angle that the unit has turned on its way, rad.
    pub turned: f64,
    /// Integral of the square of the acceleration above 10 Hz, m²/s³.
    pub vibration: f64,
    /// Derivatives of attitude, velocity, position and marked position by the state.
    pub by: ErrorsBy,
    /// Covariances of the same: by white noise as the noise file has it, then by the first four of the shares of a segment.
    pub gramians: [Errors; 5],
    /// Biases that are taken off the readings, rad/s and m/s².
    pub biases: PerSensor<Vector3<f64>>,
    gravity: f64,
    densities: PerSensor<Vector3<f64>>,
    open: Open,
}

/// What has been added up since covariances last followed.
#[derive(Debug, Clone)]
struct Open {
    duration_s: f64,
    force: Vector3<f64>,
    vibration: f64,
    by: PerSensor<By>,
    known: PerSensor<Matrix3<f64>>,
}

impl Open {
    fn new() -> Self {
        Self {
            duration_s: 0.0,
            force: Vector3::zeros(),
            vibration: 0.0,
            by: PerSensor::both(By::zeros()),
            known: PerSensor::both(Matrix3::zeros()),
        }
    }
}

impl DeadReckoning {
    /// Begins at the attitude `rotation`, at rest. `densities` are the squares of N of the axes; `biases` are taken off the readings.
    pub fn new(
        rotation: Matrix3<f64>,
        gravity: f64,
        densities: PerSensor<Vector3<f64>>,
        biases: PerSensor<Vector3<f64>>,
    ) -> Self {
        Self {
            rotation,
            velocity: Vector3::zeros(),
            position: Vector3::zeros(),
            marked: Vector3::zeros(),
            duration_s: 0.0,
            turned: 0.0,
            vibration: 0.0,
            by: ErrorsBy::zeros(),
            gramians: [Errors::zeros(); 5],
            gravity,
            densities,
            biases,
            open: Open::new(),
        }
    }

    /// Follows `readings`, the means over their time.
    pub fn follow(&mut self, readings: &Readings) {
        let readings = readings.without(&self.biases);
        let dt = readings.duration_s;
        let half = Rotation3::from_scaled_axis(readings.rate * (0.5 * dt)).into_inner();
        let middle = self.rotation * half;
        let force = middle * readings.force;
        let acceleration = force - Vector3::z() * self.gravity;
        self.position += (self.velocity + acceleration * (0.5 * dt)) * dt;
        self.velocity += acceleration * dt;
        self.rotation = middle * half;
        self.duration_s += dt;
        self.turned += readings.rate.norm() * dt;
        self.vibration += readings.vibration * dt;
        let open = &mut self.open;
        open.duration_s += dt;
        open.force += force * dt;
        open.vibration += readings.vibration * dt;
        for sensor in Sensor::BOTH {
            readings.add_errors(&mut open.by[sensor], sensor, &middle, dt);
            let density = Matrix3::from_diagonal(&self.densities[sensor]);
            open.known[sensor] += middle * density * middle.transpose() * dt;
        }
        if self.open.duration_s >= COARSE_S {
            self.close();
        }
    }

    /// Keeps the position, and its errors, of this instant.
    pub fn mark(&mut self) {
        self.close();
        self.marked = self.position;
        for row in 0..3 {
            let kept = self.by.row(6 + row).into_owned();
            self.by.set_row(9 + row, &kept);
        }
        for gramian in &mut self.gramians {
            for row in 0..3 {
                let kept = gramian.row(6 + row).into_owned();
                gramian.set_row(9 + row, &kept);
            }
            for column in 0..3 {
                let kept = gramian.column(6 + column).into_owned();
                gramian.set_column(9 + column, &kept);
            }
        }
    }

    /// Lets derivatives and covariances follow to the present instant.
    pub fn close(&mut self) {
        let open = std::mem::replace(&mut self.open, Open::new());
        let dt = open.duration_s;
        if dt <= 0.0 {
            return;
        }
        let cross = open.force.cross_matrix();
        let turned = open.by.gyro;
        let attitude = self.by.fixed_rows::<3>(0) + turned * 0.5;
        let velocity = -cross * attitude + open.by.accel;
        let moved = (self.by.fixed_rows::<3>(3) + velocity * 0.5) * dt;
        for (row, more) in [(0, &turned), (3, &velocity), (6, &moved)] {
            let mut rows = self.by.fixed_rows_mut::<3>(row);
            rows += more;
        }
        let none = Matrix3::zeros();
        let [white, shaken] = [dt, open.vibration].map(|amount| Matrix3::identity() * amount);
        let sources = [
            [open.known.gyro, open.known.accel],
            [white, none],
            [none, white],
            [shaken, none],
            [none, shaken],
        ];
        for ([gyro, accel], gramian) in sources.into_iter().zip(&mut self.gramians) {
            transported(gramian, &cross, dt);
            for (row, more) in [(0, gyro), (3, accel)] {
                let mut block = gramian.fixed_view_mut::<3, 3>(row, row);
                block += more;
            }
        }
    }
}

/// `A P Aᵀ` for the errors that a force with the integral of `cross` moves in `dt`.
fn transported(gramian: &mut Errors, cross: &Matrix3<f64>, dt: f64) {
    let mut rows = *gramian;
    let by_attitude = cross * gramian.fixed_rows::<3>(0);
    let velocity = gramian.fixed_rows::<3>(3).into_owned();
    let mut own = rows.fixed_rows_mut::<3>(3);
    own -= by_attitude;
    let mut own = rows.fixed_rows_mut::<3>(6);
    own += velocity * dt - by_attitude * (0.5 * dt);
    let by_attitude = rows.fixed_columns::<3>(0) * cross.transpose();
    let velocity = rows.fixed_columns::<3>(3).into_owned();
    *gramian = rows;
    let mut own = gramian.fixed_columns_mut::<3>(3);
    own -= by_attitude;
    let mut own = gramian.fixed_columns_mut::<3>(6);
    own += velocity * dt - by_attitude * (0.5 * dt);
}

#[cfg(test)]
mod tests {
    use super::super::state;
    use super::*;

    const G: f64 = 9.81;

    /// Ten seconds level and at rest.
    fn at_rest() -> DeadReckoning {
        let none = PerSensor::both(Vector3::zeros());
        let mut reckoned = DeadReckoning::new(Matrix3::identity(), G, none, none);
        let readings = Readings {
            duration_s: 0.005,
            force: Vector3::z() * G,
            ..Readings::default()
        };
        for _ in 0..2000 {
            reckoned.follow(&readings);
        }
        reckoned.close();
        reckoned
    }

    #[test]
    fn white_noise_makes_random_walks_of_the_textbook() {
        let reckoned = at_rest();
        let t = reckoned.duration_s;
        let of = |source: usize, row: usize| reckoned.gramians[source][(row, row)];
        // Titterton and Weston, 12.5: attitude N² t, velocity N² t and position N² t³/3; by the gyro through gravity g² N² t³/3 and g² N² t⁵/20.
        for (found, expected) in [
            (of(1, 0), t),
            (of(2, 3), t),
            (of(2, 6), t.powi(3) / 3.0),
            (of(1, 3), G * G * t.powi(3) / 3.0),
            (of(1, 6), G * G * t.powi(5) / 20.0),
            (of(1, 5), 0.0),
        ] {
            // A sum over 2000 samples: of each power of the time, it is one sample short.
            assert!(
                (found - expected).abs() < 2.6e-3 * expected + 1e-4,
                "{found} {expected}"
            );
        }
    }

    #[test]
    fn a_bias_of_the_gyro_moves_a_resting_unit_by_a_sixth_of_g_t_cubed() {
        let reckoned = at_rest();
        let t = reckoned.duration_s;
        let y = state::offset(Sensor::Gyro).start + 1;
        assert!((reckoned.by[(1, y)] - t).abs() < 1e-9);
        // The body believes that it turns about y: up leans to x.
        assert!((reckoned.by[(3, y)] - G * t * t / 2.0).abs() < 1e-2);
        assert!((reckoned.by[(6, y)] - G * t.powi(3) / 6.0).abs() < 1e-1);
    }
}
