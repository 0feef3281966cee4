//! How well curves compensate a recording: errors of the dwells, by temperature, separately for heating and cooling, compared with the
//! noise.

use std::cmp::Ordering;

use mimu::quantity::Sensor;
use mimu_recording::statistics::root_mean_square;
use nalgebra::Vector3;
use serde::{Serialize, Serializer};

use crate::curves::TriadCurves;
use crate::joint::Joint;
use crate::nodes::inverse;
use crate::path::{Way, direction, fastest};
use crate::regression::{AxisNoise, Normal};
use crate::row::Row;
use crate::session::Session;
use crate::smoothness::{Penalties, fixed};
use crate::thermometer::Die;

/// Length of a piece of a recording at rest, s.
const PIECE_S: f64 = 30.0;
/// Width of the bins, K.
const BIN_K: f64 = 10.0;
/// Parts of the time that are held out one after the other, and pieces that each consists of: a piece is shorter than a sweep, so that
/// the rest covers all temperatures.
const FOLDS: usize = 4;
const PIECES: usize = 10;

/// Error of one dwell.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct DwellError {
    /// Number of its recording, from 0: among the verifying ones if there are any, else among the fitted ones.
    pub recording: usize,
    /// Its middle, s of its recording.
    pub middle_s: f64,
    /// Mean temperature of the die, °C.
    pub die_c: f64,
    /// Direction of the temperature.
    #[serde(rename = "temperature")]
    pub way: Way,
    /// Compensated mean minus known input, x, y, z, SI.
    #[serde(serialize_with = "three")]
    pub error: Vector3<f64>,
    /// Variance that noise alone gives the error of an axis, SI².
    #[serde(skip)]
    pub floor: f64,
}

fn three<S: Serializer>(error: &Vector3<f64>, to: S) -> Result<S::Ok, S::Error> {
    <[f64; 3]>::from(*error).serialize(to)
}

/// A recording that curves are judged by.
#[derive(Debug, Clone, Copy)]
pub struct Judging<'a> {
    /// Its number, from 0.
    pub recording: usize,
    /// The recording.
    pub session: &'a Session,
    /// The triad.
    pub sensor: Sensor,
    /// Temperature of the die.
    pub die: &'a Die,
    /// The curves.
    pub curves: &'a TriadCurves,
    /// Whether the curves were fitted to it: then its bias offsets are known and subtracted.
    pub fitted: bool,
}

impl Judging<'_> {
    /// Errors of all dwells. If only biases were estimated, raw errors of pieces of half a minute: readings minus the curves, in that pose.
    pub fn errors(&self) -> Vec<DwellError> {
        self.errors_of(|_| true)
    }

    fn errors_of(&self, used: impl Fn(usize) -> bool) -> Vec<DwellError> {
        let Self { session, die, .. } = self;
        let at_rest = self.curves.biases_only();
        let all = session.rows[self.sensor].iter().enumerate();
        let rows: Vec<(&Row, Vector3<f64>)> = all
            .filter(|(k, r)| used(*k) && (at_rest || r.input.iter().all(|x| x.is_finite())))
            .filter_map(|(_, r)| {
                let [at, _] = inverse(self.curves, die.at(r.middle_s))?;
                let offset = match self.fitted {
                    true => self.offset(r),
                    false => Vector3::zeros(),
                };
                let input = if at_rest { Vector3::zeros() } else { r.input };
                Some((r, at.apply(&(r.raw - offset)) - input))
            })
            .collect();
        let variance = sample_variance(&rows);
        let fastest = fastest(session);
        let piece = |r: &Row| {
            if at_rest {
                (r.middle_s / PIECE_S) as u64
            } else {
                0
            }
        };
        let dwells = rows.chunk_by(|(a, _), (b, _)| a.step == b.step && piece(a) == piece(b));
        let each = dwells.map(|dwell| {
            let n: f64 = dwell.iter().map(|(r, _)| r.samples).sum();
            let middle_s = dwell
                .iter()
                .map(|(r, _)| r.samples * r.middle_s)
                .sum::<f64>()
                / n;
            let sum = dwell.iter().map(|(r, e)| e * r.samples);
            DwellError {
                recording: self.recording,
                middle_s,
                error: sum.sum::<Vector3<f64>>() / n,
                die_c: die.at(middle_s),
                way: direction(session, fastest, middle_s),
                floor: variance / n,
            }
        });
        each.collect()
    }

    fn offset(&self, row: &Row) -> Vector3<f64> {
        let moves = self.session.poses_before(self.sensor, row.middle_s);
        self.curves.pose_offset(self.recording, moves)
    }
}

/// Variance of one sample, mean of the axes, from differences of neighbouring rows, which the slope of the temperature hardly affects.
fn sample_variance(rows: &[(&Row, Vector3<f64>)]) -> f64 {
    let (mut sum, mut n) = (0.0, 0.0);
    for pair in rows.windows(2) {
        let ([(a, x), (b, y)], true) = ([pair[0], pair[1]], pair[0].0.step == pair[1].0.step)
        else {
            continue;
        };
        sum += (y - x).norm_squared() / 3.0 / (1.0 / a.samples + 1.0 / b.samples);
        n += 1.0;
    }
    sum / f64::max(n, 1.0)
}

/// Root mean square over dwells and axes, and that of noise alone.
pub fn rms(errors: &[DwellError]) -> [f64; 2] {
    let n = errors.len().max(1) as f64;
    let squares: f64 = errors.iter().map(|e| e.error.norm_squared() / 3.0).sum();
    let floor: f64 = errors.iter().map(|e| e.floor).sum();
    [(squares / n).sqrt(), (floor / n).sqrt()]
}

/// Errors in a bin of temperature, SI.
#[derive(Debug, Clone, Serialize)]
pub struct Bin {
    /// Its lower end, °C of the die.
    pub from_c: f64,
    /// Its upper end.
    pub to_c: f64,
    /// Rms of the dwells in which the temperature rises; null where there is none.
    pub heating: Option<f64>,
    /// Rms of those in which it falls; null where there is none.
    pub cooling: Option<f64>,
    /// Rms by noise alone.
    pub noise_floor: f64,
    /// Dwells.
    pub dwells: usize,
}

/// `errors` in bins of 10 K.
pub fn bins(errors: &[DwellError]) -> Vec<Bin> {
    let bin = |e: &DwellError| (e.die_c / BIN_K).floor() as i64;
    let Some(first) = errors.iter().map(bin).min() else {
        return Vec::new();
    };
    let last = errors.iter().map(bin).max().unwrap_or(first);
    let each = (first..=last).filter_map(|k| {
        let own: Vec<DwellError> = errors.iter().copied().filter(|e| bin(e) == k).collect();
        let way = |w: Way| {
            let of: Vec<DwellError> = own.iter().copied().filter(|e| e.way == w).collect();
            (!of.is_empty()).then(|| rms(&of)[0])
        };
        (!own.is_empty()).then(|| Bin {
            from_c: k as f64 * BIN_K,
            to_c: (k + 1) as f64 * BIN_K,
            heating: way(Way::Heating),
            cooling: way(Way::Cooling),
            noise_floor: rms(&own)[1],
            dwells: own.len(),
        })
    });
    each.collect()
}

/// Remaining difference between heating and cooling after the lag: hysteresis, which is reported but never fitted.
#[derive(Debug, Clone, Serialize)]
pub struct Hysteresis {
    /// Axis.
    pub axis: &'static str,
    /// Mean error when heating minus that when cooling, at the same temperatures, SI. A loop that crosses itself has a small one.
    pub value: f64,
    /// Half of its 95 % interval, SI.
    pub half_width: f64,
    /// Root mean square of the differences over the bins of temperature, SI.
    pub rms: f64,
    /// Largest difference of a bin, SI, with its sign.
    pub largest: f64,
    /// Half of its 95 % interval, SI.
    pub largest_half_width: f64,
    /// Middle of that bin, °C of the die.
    pub largest_at_c: f64,
    /// [`Self::rms`] as a difference of temperature, K, by the mean slope of the bias; null if the bias shows no slope.
    pub kelvin: Option<f64>,
}

/// A bias has a slope if it changes over the range by more than this many standard deviations.
const SLOPE_SIGMAS: f64 = 3.0;

/// Difference between heating and cooling of each axis, over the bins that have both.
pub fn hysteresis(errors: &[DwellError], curves: &TriadCurves) -> Option<Vec<Hysteresis>> {
    let bin = |e: &DwellError| (e.die_c / BIN_K).floor() as i64;
    let mut keys: Vec<i64> = errors.iter().map(bin).collect();
    keys.sort_unstable();
    keys.dedup();
    // Middle of a bin, difference, and its variance by noise.
    let mut bins: Vec<(f64, Vector3<f64>, f64)> = Vec::new();
    for key in keys {
        let mean = |way: Way| {
            let own = errors.iter().filter(|e| bin(e) == key && e.way == way);
            let own: Vec<&DwellError> = own.collect();
            let count = own.len() as f64;
            let mean = own.iter().map(|e| e.error).sum::<Vector3<f64>>() / count;
            let floor = own.iter().map(|e| e.floor).sum::<f64>() / (count * count);
            (count > 0.0).then_some((mean, floor))
        };
        if let (Some((up, a)), Some((down, b))) = (mean(Way::Heating), mean(Way::Cooling)) {
            bins.push(((key as f64 + 0.5) * BIN_K, up - down, a + b));
        }
    }
    let n = bins.len() as f64;
    let [from, to] = curves.range_c;
    let [model, _] = curves.forward(0.5 * (from + to));
    let (change, covariance) = curves.bias_change(from, to);
    let of = |k: usize| {
        let largest = bins
            .iter()
            .max_by(|a, b| a.1[k].abs().total_cmp(&b.1[k].abs()))?;
        let variance: f64 = bins.iter().map(|b| b.2).sum();
        let rms = root_mean_square(bins.iter().map(|b| b.1[k]));
        let seen = change[k].abs() > SLOPE_SIGMAS * covariance[(k, k)].max(0.0).sqrt();
        let by_kelvin = change[k].abs() / (to - from) / model.matrix.row(k).norm();
        Some(Hysteresis {
            axis: mimu::quantity::AXES[k],
            value: bins.iter().map(|b| b.1[k]).sum::<f64>() / n,
            half_width: 1.96 * variance.sqrt() / n,
            rms,
            largest: largest.1[k],
            largest_half_width: 1.96 * largest.2.sqrt(),
            largest_at_c: largest.0,
            kelvin: (seen && by_kelvin > 0.0).then(|| rms / by_kelvin),
        })
    };
    (0..3).map(of).collect()
}

/// Errors of the dwells of `sensor`, each by curves without it: four parts of the time are held out in turn; lag, noise and smoothness are
/// kept.
pub fn held_out(
    sessions: &[Session],
    joint: &Joint,
    sensor: Sensor,
    noise: &[AxisNoise; 3],
) -> Option<Vec<DwellError>> {
    let curves = joint.curves[sensor].as_ref()?;
    let problem = curves.problem();
    let dies = joint.dies(sessions, sensor);
    let temps: Vec<f64> = problem
        .rows
        .iter()
        .map(|r| dies[r.session].at(r.middle_s))
        .collect();
    let fold = |session: usize, t_s: f64| {
        let s = &sessions[session].thermometer;
        let share = (t_s - s.start_s()) / s.duration_s().max(1.0);
        (share * (FOLDS * PIECES) as f64) as usize % FOLDS
    };
    let penalties = Penalties::of(problem);
    let smoothness = curves.smoothness()?;
    let mut all = Vec::new();
    for part in 0..FOLDS {
        let seen = |k: usize| {
            let row = &problem.rows[k];
            fold(row.session, row.middle_s) != part
        };
        let normals = [0, 1, 2].map(|a| Normal::of(problem, a, &temps, &noise[a], seen));
        let fit = fixed(problem, &penalties, &normals, &smoothness)?;
        let part_curves = TriadCurves::of_one(problem.clone(), fit, curves.range_c);
        for (k, session) in sessions.iter().enumerate() {
            let rows = &session.rows[sensor];
            let judging = Judging {
                recording: k,
                session,
                sensor,
                die: &dies[k],
                curves: &part_curves,
                fitted: true,
            };
            all.extend(judging.errors_of(|i| fold(k, rows[i].middle_s) == part));
        }
    }
    all.sort_by(|a, b| {
        (a.recording, a.middle_s)
            .partial_cmp(&(b.recording, b.middle_s))
            .unwrap_or(Ordering::Equal)
    });
    Some(all)
}
