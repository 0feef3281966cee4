//! Estimators of the literature, for comparison: each assumes that the die has the temperature of the thermometer.

use mimu::quantity::{PerSensor, Sensor};
use mimu_recording::error::{Error, Result};
use mimu_thermal::basis::Shape;
use mimu_thermal::curves::TriadCurves;
use mimu_thermal::joint::Joint;
use mimu_thermal::path::{fastest, is_one_way, stands};
use mimu_thermal::profile::Profile;
use mimu_thermal::row::Row;
use mimu_thermal::session::Session;
use mimu_thermal::thermometer::Start;
use nalgebra::{Matrix3, Matrix4, Matrix4x3, Vector3};

use crate::points::{Point, curves};

/// Cosine of the angle to an axis within which a pose or a turn is along it.
const ALONG: f64 = 0.98;
/// Rates below this, rad/s, are rest: fifty times the Earth's.
const REST: f64 = 0.004;
/// Time between two plateaus of a soak, s, and the shortest plateau.
const PLATEAU_S: f64 = 120.0;
/// Temperature at which the constant misalignments are measured, °C: fang, section 4.1.
const CONSTANT_C: f64 = 25.0;

/// An estimator of the literature.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Classic {
    /// The ramp of niu: every cycle of the scheme by itself, cubics through them.
    RampNiu,
    /// Soak, fang section 4.4: one fit per plateau; all 18 scalars of a triad's six poses.
    Soak,
    /// The same by fang (33), (34) as printed: one scalar per pose, misalignments taken from elsewhere.
    SoakAsPrinted,
    /// fang (31), (32): `K(T) M + b(T)`. M comes from all scalars of the plateau nearest 25 °C; at the others only K and b are fitted.
    SoakConstantM,
}

/// Curves of both triads by `classic`, without a lag.
///
/// # Errors
/// Too few temperatures at which the inputs determine everything.
pub fn estimate(sessions: &[Session], classic: Classic) -> Result<Joint> {
    let mut curves = PerSensor::default();
    for sensor in Sensor::BOTH {
        curves[sensor] = triad(sessions, sensor, classic)?;
    }
    let settled = |s: &Session| s.thermometer.die(0.0, Start::Settled);
    let dies: Vec<_> = sessions.iter().map(settled).collect();
    Ok(Joint {
        curves,
        profiles: PerSensor::both(Profile::fixed(0.0, 0.0)),
        one_way: is_one_way(sessions, &dies),
        apart: None,
        contradicted: PerSensor::default(),
        noise: PerSensor::default(),
        starts: vec![Start::Settled; sessions.len()],
        warnings: Vec::new(),
    })
}

/// Curves of `sensor`; `None` if it was not recorded.
fn triad(sessions: &[Session], sensor: Sensor, classic: Classic) -> Result<Option<TriadCurves>> {
    let rows = |s: &Session| s.rows[sensor].len();
    if sessions.iter().map(rows).sum::<usize>() == 0 {
        return Ok(None);
    }
    let constant = match classic {
        Classic::SoakConstantM => misalignment(sessions, sensor),
        _ => None,
    };
    let mut points = Vec::new();
    for session in sessions {
        let groups = match classic {
            Classic::RampNiu => cycles(session, sensor),
            Classic::Soak | Classic::SoakAsPrinted | Classic::SoakConstantM => {
                plateaus(session, sensor)
            }
        };
        points.extend(groups.iter().filter_map(|group| {
            let numbers = match (classic, sensor) {
                (Classic::RampNiu, Sensor::Gyro) => gyro_of_cycle(group),
                (Classic::SoakAsPrinted, _) => six_positions(group),
                (Classic::SoakConstantM, _) => scale_and_bias(group, constant.as_ref()?),
                _ => affine(group),
            };
            let (numbers, variances) = numbers?;
            Some(Point {
                temp_c: mean_temperature(session, group),
                numbers,
                variances,
            })
        }));
    }
    let shape = match classic {
        Classic::RampNiu => Shape::Cubic,
        _ => Shape::Spline,
    };
    let count = points.len();
    curves(sensor, &points, shape).map(Some).ok_or_else(|| {
        Error::undetermined(
            format!("{sensor}, {classic:?}"),
            format!("only {count} temperatures have all poses and turns that this estimator needs"),
            "repeat the whole scheme at five temperatures or more",
        )
    })
}

fn mean_temperature(session: &Session, rows: &[&Row]) -> f64 {
    let n: f64 = rows.iter().map(|r| r.samples).sum();
    let sum = rows
        .iter()
        .map(|r| r.samples * session.thermometer.at(r.middle_s).0);
    sum.sum::<f64>() / n
}

/// Segments in which the temperature is constant, whether the dies have settled or not.
fn plateaus(session: &Session, sensor: Sensor) -> Vec<Vec<&Row>> {
    let fastest = fastest(session);
    let rows = session.rows[sensor].iter();
    let still: Vec<&Row> = rows
        .filter(|r| stands(session, fastest, r.middle_s))
        .collect();
    let apart = |a: &&Row, b: &&Row| b.middle_s - a.middle_s < PLATEAU_S;
    still.chunk_by(apart).map(<[_]>::to_vec).collect()
}

/// The signed axis that `v` is along.
fn along(v: &Vector3<f64>) -> Option<(usize, bool)> {
    let axis = v.iamax();
    (v[axis].abs() > ALONG * v.norm()).then_some((axis, v[axis] > 0.0))
}

/// Cycles of the scheme: each ends as soon as it has seen all that niu's computation needs of the sensor.
fn cycles(session: &Session, sensor: Sensor) -> Vec<Vec<&Row>> {
    let mut out = Vec::new();
    let mut open: Vec<&Row> = Vec::new();
    let mut faces: Vec<(usize, bool)> = session.rows[sensor].iter().filter_map(face).collect();
    faces.sort_unstable();
    faces.dedup();
    for dwell in session.rows[sensor].chunk_by(|a, b| a.step == b.step) {
        open.extend(dwell);
        let complete = match sensor {
            // Every pose of the session: an axis that points both ways does so in every cycle.
            Sensor::Gyro => {
                let seen = |of: &(usize, bool)| open.iter().any(|r| face(r) == Some(*of));
                faces.iter().all(seen) && gyro_of_cycle(&open).is_some()
            }
            // Five poses: x and y up and down, z down.
            Sensor::Accel => {
                let seen = |axis: usize, up: bool| {
                    open.iter().any(|r| along(&r.input) == Some((axis, up)))
                };
                seen(0, true)
                    && seen(0, false)
                    && seen(1, true)
                    && seen(1, false)
                    && (seen(2, true) || seen(2, false))
            }
        };
        if complete {
            out.push(std::mem::take(&mut open));
        }
    }
    out
}

/// Whether a row is at rest, but for the Earth.
fn at_rest(row: &Row) -> bool {
    (row.input - row.earth.known).norm() < REST
}

/// The signed axis that is up in a row at rest.
fn face(row: &Row) -> Option<(usize, bool)> {
    at_rest(row).then(|| along(&row.up)).flatten()
}

type Numbers = ([f64; 12], [f64; 12]);

/// Mean reading and samples of the rows that `of` picks.
fn mean(rows: &[&Row], of: impl Fn(&Row) -> bool) -> Option<(Vector3<f64>, Vector3<f64>, f64)> {
    let (mut raw, mut input, mut n) = (Vector3::zeros(), Vector3::zeros(), 0.0);
    for r in rows.iter().filter(|r| of(r)) {
        raw += r.raw * r.samples;
        input += r.input * r.samples;
        n += r.samples;
    }
    (n > 0.0).then(|| (raw / n, input / n, n))
}

/// niu (a.7) to (a.10), reconstructed from the surrounding text, which lacks the equations.
///
/// The bias of an axis comes from the rests with that axis vertical. If it points up and down in the cycle, the two are averaged, and the Earth's rate
/// cancels (a.7). If it points one way only, as z does on niu's table, the vertical component at the latitude is subtracted (a.8), which the known input
/// contains. Neither depends on the heading. Scale factors and cross terms come from turns both ways, in which the Earth's rate cancels (a.9), (a.10).
fn gyro_of_cycle(rows: &[&Row]) -> Option<Numbers> {
    let (mut numbers, mut variances) = ([0.0; 12], [0.0; 12]);
    for i in 0..3 {
        let turning = |up: bool| move |r: &Row| !at_rest(r) && along(&r.input) == Some((i, up));
        let (plus, x_plus, n_plus) = mean(rows, turning(true))?;
        let (minus, x_minus, n_minus) = mean(rows, turning(false))?;
        let change = x_plus[i] - x_minus[i];
        for j in 0..3 {
            numbers[3 * j + i] = (plus[j] - minus[j]) / change;
            variances[3 * j + i] = (1.0 / n_plus + 1.0 / n_minus) / (change * change);
        }
    }
    for j in 0..3 {
        let gain = Vector3::from_fn(|i, _| numbers[3 * j + i]);
        let both = [true, false].map(|up| mean(rows, |r| face(r) == Some((j, up))));
        // Without known forces all rests count alike.
        let any = || mean(rows, |r| at_rest(r) && r.up.x.is_nan());
        let ways: Vec<_> = both.into_iter().chain([any()]).flatten().collect();
        if ways.is_empty() {
            return None;
        }
        let count = ways.len() as f64;
        for (raw, input, n) in ways {
            numbers[9 + j] += (raw[j] - gain.dot(&input)) / count;
            variances[9 + j] += 1.0 / (n * count * count);
        }
    }
    Some(scaled(rows, numbers, variances))
}

/// Least squares of all twelve numbers, niu (a.6) for the accelerometer.
fn affine(rows: &[&Row]) -> Option<Numbers> {
    let mut gram = Matrix4::zeros();
    let mut by_table = Matrix4::zeros();
    let mut with = Matrix4x3::zeros();
    for r in rows {
        let x = r.input.push(1.0);
        gram += x * x.transpose() * r.samples;
        with += x * r.raw.transpose() * r.samples;
        let x = (r.input - r.earth.known).push(1.0);
        by_table += x * x.transpose() * r.samples;
    }
    // The Earth turns far too slowly to show a scale factor.
    let scale = by_table.diagonal().map(|d| 1.0 / d.max(1e-300).sqrt());
    let correlation = Matrix4::from_fn(|i, j| by_table[(i, j)] * scale[i] * scale[j]);
    if correlation.symmetric_eigenvalues().min() < 1e-4 {
        return None;
    }
    let inverse = gram.try_inverse()?;
    let solved = inverse * with;
    let (mut numbers, mut variances) = ([0.0; 12], [0.0; 12]);
    for j in 0..3 {
        for i in 0..4 {
            let k = if i < 3 { 3 * j + i } else { 9 + j };
            numbers[k] = solved[(i, j)];
            variances[k] = inverse[(i, i)];
        }
    }
    Some(scaled(rows, numbers, variances))
}

/// fang (33), (34): k and b of an axis from the readings of that axis with the input along it, both ways; M never enters.
fn six_positions(rows: &[&Row]) -> Option<Numbers> {
    let (mut numbers, mut variances) = ([0.0; 12], [0.0; 12]);
    for i in 0..3 {
        let pose = |up: bool| move |r: &Row| along(&r.input) == Some((i, up));
        let (plus, x_plus, n_plus) = mean(rows, pose(true))?;
        let (minus, x_minus, n_minus) = mean(rows, pose(false))?;
        let change = x_plus[i] - x_minus[i];
        let by_noise = 1.0 / n_plus + 1.0 / n_minus;
        numbers[3 * i + i] = (plus[i] - minus[i]) / change;
        numbers[9 + i] = 0.5 * (plus[i] + minus[i]);
        variances[3 * i + i] = by_noise / (change * change);
        variances[9 + i] = 0.25 * by_noise;
        for j in (0..3).filter(|j| *j != i) {
            variances[3 * i + j] = by_noise / (change * change);
        }
    }
    Some(scaled(rows, numbers, variances))
}

/// M and the variances of its elements, from the plateau nearest [`CONSTANT_C`] that determines all twelve numbers.
fn misalignment(sessions: &[Session], sensor: Sensor) -> Option<[Matrix3<f64>; 2]> {
    let each = sessions.iter().flat_map(|session| {
        let groups = plateaus(session, sensor);
        let fitted = groups.into_iter().filter_map(|group| {
            let off = (mean_temperature(session, &group) - CONSTANT_C).abs();
            Some((off, affine(&group)?))
        });
        fitted.collect::<Vec<_>>()
    });
    let (_, (p, variances)) = each.min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some([
        Matrix3::from_fn(|j, i| p[3 * j + i] / p[4 * j]),
        Matrix3::from_fn(|j, i| variances[3 * j + i] / (p[4 * j] * p[4 * j])),
    ])
}

/// fang (31), (32): k and b of each axis by least squares of its readings over `M x`, with M known.
fn scale_and_bias(rows: &[&Row], [m, m_variances]: &[Matrix3<f64>; 2]) -> Option<Numbers> {
    let (mut numbers, mut variances) = ([0.0; 12], [0.0; 12]);
    let n: f64 = rows.iter().map(|r| r.samples).sum();
    for j in 0..3 {
        let (mut sx, mut sxx, mut sy, mut sxy) = (0.0, 0.0, 0.0, 0.0);
        for r in rows {
            let (x, y) = ((m * r.input)[j], r.raw[j]);
            sx += r.samples * x;
            sxx += r.samples * x * x;
            sy += r.samples * y;
            sxy += r.samples * x * y;
        }
        let determinant = n * sxx - sx * sx;
        if !(determinant > 1e-4 * n * sxx) {
            return None;
        }
        let k = (n * sxy - sx * sy) / determinant;
        for i in 0..3 {
            numbers[3 * j + i] = k * m[(j, i)];
            variances[3 * j + i] = n / determinant * m[(j, i)] * m[(j, i)];
        }
        numbers[9 + j] = (sy - k * sx) / n;
        variances[9 + j] = sxx / determinant;
    }
    let (numbers, mut variances) = scaled(rows, numbers, variances);
    for j in 0..3 {
        for i in (0..3).filter(|i| *i != j) {
            variances[3 * j + i] += numbers[4 * j] * numbers[4 * j] * m_variances[(j, i)];
        }
    }
    Some((numbers, variances))
}

/// Variances of unit noise times that of a sample, from neighbouring rows of a dwell.
fn scaled(rows: &[&Row], numbers: [f64; 12], mut variances: [f64; 12]) -> Numbers {
    let (mut sum, mut n) = (Vector3::zeros(), 0.0);
    for pair in rows.windows(2).filter(|p| p[0].step == p[1].step) {
        let off = pair[1].raw - pair[0].raw;
        sum += off.component_mul(&off) / (1.0 / pair[0].samples + 1.0 / pair[1].samples);
        n += 1.0;
    }
    for (k, v) in variances.iter_mut().enumerate() {
        let axis = if k < 9 { k / 3 } else { k - 9 };
        *v *= (sum[axis] / f64::max(n, 1.0)).max(1e-30);
    }
    (numbers, variances)
}
