//! How other programs find the scale factors of a gyro that is turned by hand, as small implementations of what they publish.
//!
//! - [`sens_auto`]: the command `sens auto` of SlimeNRF trackers, `src/sensor/calibration/cal_sens.c` of `jitingcn/SlimeVR-Tracker-nRF` at 1c49665.
//! - [`imu_tk`]: D. Tedaldi, A. Pretto, E. Menegatti, ICRA 2014, equations 6 to 18, with Runge-Kutta of the fourth order as in `imu_tk`'s `integration.h`.

use mimu_recording::{Batch, Recording};
use nalgebra::{DMatrix, DVector, Matrix3, Quaternion, Vector3};

/// Samples of a recording at a steady rate, with the numbers of its dwells (-1 in between).
pub struct Samples {
    /// Time between two samples, s.
    pub period_s: f64,
    /// Number of the dwell.
    pub step: Vec<i32>,
    /// Gyro, raw.
    pub gyro: Vec<Vector3<f64>>,
    /// Accelerometer, raw.
    pub accel: Vec<Vector3<f64>>,
}

impl Samples {
    /// Of a recording.
    pub fn read(recording: &Recording) -> Self {
        let mut all = Self {
            period_s: 1.0 / recording.manifest.sample_rate_hz,
            step: Vec::new(),
            gyro: Vec::new(),
            accel: Vec::new(),
        };
        let add = |batch: &Batch| {
            let vector = |from: usize, k: usize| Vector3::from_fn(|c, _| batch.raw[from + c][k]);
            all.step.extend(&batch.step);
            all.gyro.extend((0..batch.t_s.len()).map(|k| vector(0, k)));
            all.accel.extend((0..batch.t_s.len()).map(|k| vector(3, k)));
            Ok(())
        };
        recording.for_each_batch(|_| (), add).expect("readable");
        all
    }

    /// Rows of the dwell `step`.
    fn dwell(&self, step: i32) -> Option<std::ops::Range<usize>> {
        let first = self.step.iter().position(|s| *s == step)?;
        let last = self.step.iter().rposition(|s| *s == step)?;
        Some(first..last + 1)
    }
}

fn mean(of: &[Vector3<f64>]) -> Vector3<f64> {
    of.iter().sum::<Vector3<f64>>() / of.len() as f64
}

/// The factor that `sens auto` of SlimeNRF finds for one axis from a spin of `revolutions` after the dwell `step`; `per_dps` is the nominal reading for
/// 1 deg/s. As published it counts from the first rate above 30 deg/s on, so that slower turns before are lost to it, and refuses a spin with much motion
/// across its axis (`None`); if not `as_published`, it does neither.
pub fn sens_auto(
    samples: &Samples,
    step: i32,
    axis: usize,
    revolutions: u32,
    per_dps: f64,
    as_published: bool,
) -> Option<f64> {
    let expected = 360.0 * f64::from(revolutions);
    let rest = samples.dwell(step)?;
    let second = (1.0 / samples.period_s) as usize;
    let begins_dps = if as_published { 30.0 } else { 0.0 };
    let bias = mean(&samples.gyro[rest.end.saturating_sub(second)..rest.end]) / per_dps;
    let mut rates = samples.gyro[rest.end..]
        .iter()
        .map(|raw| raw / per_dps - bias);
    let mut spins = rates
        .by_ref()
        .skip_while(|rate| rate[axis].abs() <= begins_dps);
    let (mut measured, mut on_axis, mut off_axis, mut low) = (0.0, 0.0, 0.0, 0);
    loop {
        let rate: Vector3<f64> = spins.next()?;
        measured += rate[axis] * samples.period_s;
        on_axis += rate[axis].abs() * samples.period_s;
        let across = rate.norm_squared() - rate[axis].powi(2);
        off_axis += across.max(0.0).sqrt() * samples.period_s;
        let stopped = rate[axis].abs() < 10.0 && measured.abs() >= 0.85 * expected;
        low = if stopped { low + 1 } else { 0 };
        if low > second {
            break;
        }
    }
    let scale = expected / measured.abs();
    let accepted = off_axis / on_axis <= 0.25 && (0.9..=1.1).contains(&scale);
    (accepted || !as_published).then_some(scale)
}

/// The matrix of the gyro, rad/s by raw, that IMU-TK's method finds from the rests and the turns between them; `per_radps` is the nominal reading for
/// 1 rad/s, `gravity` in m/s². `None` if it does not converge.
pub fn imu_tk(samples: &Samples, gravity: f64, per_radps: f64) -> Option<Matrix3<f64>> {
    let last = *samples.step.iter().max()?;
    let dwells: Vec<_> = (0..=last).filter_map(|step| samples.dwell(step)).collect();
    let rests: Vec<Vector3<f64>> = dwells
        .iter()
        .map(|d| mean(&samples.accel[d.clone()]))
        .collect();
    // The accelerometer: `T K (a - b)` with T upper triangular, so that the magnitude is that of gravity.
    let accel_of = |p: &DVector<f64>, raw: &Vector3<f64>| {
        let t = Matrix3::new(1.0, -p[0], p[1], 0.0, 1.0, -p[2], 0.0, 0.0, 1.0);
        let k = Matrix3::from_diagonal(&Vector3::new(p[3], p[4], p[5]));
        t * k * (raw - Vector3::new(p[6], p[7], p[8]))
    };
    let [low, high] = [f64::min, f64::max].map(|pick: fn(f64, f64) -> f64| {
        Vector3::from_fn(|c, _| rests.iter().map(|r| r[c]).reduce(pick).unwrap_or(0.0))
    });
    let scale = (high - low).map(|range| 2.0 * gravity / range);
    let middle = (high + low) / 2.0;
    let mut start = DVector::zeros(9);
    for c in 0..3 {
        (start[3 + c], start[6 + c]) = (scale[c], middle[c]);
    }
    let magnitude = |p: &DVector<f64>| {
        let each = rests.iter().map(|raw| accel_of(p, raw).norm() - gravity);
        DVector::from_iterator(rests.len(), each)
    };
    let accel = levenberg(start, magnitude)?;
    let ups: Vec<Vector3<f64>> = rests
        .iter()
        .map(|raw| accel_of(&accel, raw).normalize())
        .collect();
    // The gyro: its bias from the first rest, then `T K (w - b)` so that each turn takes gravity to where the accelerometer sees it.
    let bias = mean(&samples.gyro[dwells[0].clone()]);
    let gyro_of = |p: &DVector<f64>| {
        let t = Matrix3::new(1.0, -p[0], p[1], p[2], 1.0, -p[3], -p[4], p[5], 1.0);
        t * Matrix3::from_diagonal(&Vector3::new(p[6], p[7], p[8]))
    };
    let directions = |p: &DVector<f64>| {
        let c = gyro_of(p);
        let turns = dwells.windows(2).zip(ups.windows(2));
        let errors = turns.flat_map(|(d, up)| {
            let turned = turn(
                &samples.gyro[d[0].end..d[1].start],
                &c,
                &bias,
                samples.period_s,
            );
            let error = turned.tr_mul(&up[0]) - up[1];
            [error.x, error.y, error.z]
        });
        DVector::from_iterator(3 * (dwells.len() - 1), errors)
    };
    let mut start = DVector::zeros(9);
    for c in 0..3 {
        start[6 + c] = 1.0 / per_radps;
    }
    Some(gyro_of(&levenberg(start, directions)?))
}

/// Rotation from the body after the turn to that before, by Runge-Kutta of the fourth order.
fn turn(raw: &[Vector3<f64>], c: &Matrix3<f64>, bias: &Vector3<f64>, dt: f64) -> Matrix3<f64> {
    let slope = |q: &Quaternion<f64>, w: &Vector3<f64>| q * Quaternion::from_imag(*w) * 0.5;
    let mut q = Quaternion::identity();
    for pair in raw.windows(2) {
        let [w0, w1] = [c * (pair[0] - bias), c * (pair[1] - bias)];
        let middle = (w0 + w1) * 0.5;
        let k1 = slope(&q, &w0);
        let k2 = slope(&(q + k1 * (dt / 2.0)), &middle);
        let k3 = slope(&(q + k2 * (dt / 2.0)), &middle);
        let k4 = slope(&(q + k3 * dt), &w1);
        q = (q + (k1 + (k2 + k3) * 2.0 + k4) * (dt / 6.0)).normalize();
    }
    nalgebra::UnitQuaternion::from_quaternion(q)
        .to_rotation_matrix()
        .into_inner()
}

/// Levenberg and Marquardt's method with derivatives by differences.
fn levenberg(
    mut p: DVector<f64>,
    residuals: impl Fn(&DVector<f64>) -> DVector<f64>,
) -> Option<DVector<f64>> {
    let typical = p.map(|x| if x == 0.0 { 1e-2 } else { x.abs() });
    let mut r = residuals(&p);
    let mut damping = 1e-4;
    for _ in 0..60 {
        let columns = (0..p.len()).map(|k| {
            let step = 1e-6 * typical[k];
            let mut moved = p.clone();
            moved[k] += step;
            (residuals(&moved) - &r) / step * typical[k]
        });
        let jacobian = DMatrix::from_columns(&columns.collect::<Vec<_>>());
        let normal = jacobian.tr_mul(&jacobian);
        let gradient = jacobian.tr_mul(&r);
        let damped = &normal + DMatrix::from_diagonal(&(normal.diagonal() * damping));
        let change = damped.cholesky()?.solve(&gradient);
        let next = &p - change.component_mul(&typical);
        let after = residuals(&next);
        match after.norm_squared() < r.norm_squared() {
            true => {
                let small = change.norm() < 1e-9;
                (p, r, damping) = (next, after, damping * 0.3);
                if small {
                    return Some(p);
                }
            }
            false if damping > 1e8 => return Some(p),
            false => damping *= 10.0,
        }
    }
    Some(p)
}
