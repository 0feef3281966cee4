//! What a unit undergoes on a dwell of an experiment to come.

use nalgebra::Vector3;

use super::super::model::{GRAVITY, Setting};
use super::super::reach::{Carrier, Rates};
use super::Question;
use crate::diagnose::candidate::Candidate;
use crate::diagnose::effect::{Moment, Reading};
use crate::quantity::Sensor;
use mimu_recording::Reference;

/// A dwell of an experiment to come.
#[derive(Debug, Clone, PartialEq)]
pub struct Stop {
    /// Attitude and rate.
    pub setting: Setting,
    /// Middle, s since the recording begins.
    pub t_s: f64,
    /// Length, s.
    pub dwell_s: f64,
    /// Temperature of the unit above [`crate::diagnose::effect::REFERENCE_C`], °C.
    pub warm_c: f64,
    /// The same behind each of the lags in question: lag in s, °C.
    pub late_c: Vec<(f64, f64)>,
}

impl Stop {
    /// The moment that a diagnosis would make of it. `lag_s` is the lag that the effect wants.
    pub fn moment(&self, sensor: Sensor, lag_s: Option<f64>) -> Moment {
        let rate = self.setting.up * self.setting.rate;
        let force = self.setting.up * GRAVITY;
        let late = self.late_c.iter().find(|l| Some(l.0) == lag_s);
        Moment {
            session: 0,
            reading: Reading::NONE,
            t_s: self.t_s,
            on_s: self.t_s,
            duration_s: self.dwell_s,
            rate,
            force,
            angular_acceleration: Vector3::zeros(),
            // Of a perfect triad: what a real one adds is of second order.
            sensed: match sensor {
                Sensor::Gyro => rate,
                Sensor::Accel => force,
            },
            warm_c: self.warm_c,
            late_c: late.map_or(self.warm_c, |l| l.1),
        }
    }
}

/// What of time an effect depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Slow {
    /// On the time since the recording began.
    pub time: bool,
    /// On the temperature, now or before.
    pub temperature: bool,
}

impl Slow {
    /// Whether on either.
    pub fn any(self) -> bool {
        self.time || self.temperature
    }
}

/// Found by trying: whatever is in the library, here it is known by its regressors only.
pub fn slow(candidate: &Candidate) -> Slow {
    let form = middle(candidate);
    let at = Moment {
        session: 0,
        reading: Reading::NONE,
        t_s: 137.0,
        on_s: 137.0,
        duration_s: 1.0,
        rate: Vector3::new(1.3, -0.7, 2.1),
        force: Vector3::new(4.1, -7.3, 5.2),
        angular_acceleration: Vector3::zeros(),
        sensed: Vector3::new(1.1, -0.9, 1.7),
        warm_c: 7.3,
        late_c: 5.1,
    };
    let values = |at: &Moment| {
        let mut out = vec![0.0; candidate.axes().len()];
        candidate.regressors(at, form, &mut out);
        out
    };
    let now = values(&at);
    let later = Moment {
        t_s: 911.0,
        on_s: 911.0,
        ..at
    };
    let warmer = Moment { warm_c: 21.7, ..at };
    let before = Moment { late_c: 19.9, ..at };
    Slow {
        time: values(&later) != now,
        temperature: values(&warmer) != now || values(&before) != now,
    }
}

/// Middle of the range of the nonlinear constant, in the logarithm; 0 if there is none.
fn middle(candidate: &Candidate) -> f64 {
    forms(candidate)[1]
}

/// Values of its nonlinear constant that an experiment has to be good for: the quarters of its range, in the logarithm.
pub fn forms(candidate: &Candidate) -> [f64; 3] {
    match candidate.form_range() {
        Some((from, to)) => [0.25, 0.5, 0.75].map(|share| from * (to / from).powf(share)),
        None => [0.0; 3],
    }
}

/// Attitudes and rates that can be made: faces and rates about the axes only if `plain`.
pub fn settings(question: &Question, plain: bool) -> Vec<Setting> {
    let reached = |up: &Vector3<f64>| question.carrier.reaches(up);
    let ups: Vec<Vector3<f64>> = directions(plain).into_iter().filter(reached).collect();
    let mut all: Vec<Setting> = ups.iter().map(|up| Setting::at_rest(*up)).collect();
    let turns = matches!(question.carrier, Carrier::ThreeAxis | Carrier::Faces);
    if question.reference == Reference::Table && turns {
        let levels = match &question.rates.rates {
            Rates::Any if plain => vec![0.5, 1.0],
            Rates::Any => vec![0.25, 0.5, 0.75, 1.0],
            Rates::Levels(levels) => levels.clone(),
        };
        let largest = question.rates.largest_dps.to_radians();
        // At oblique rates faces, edges and corners are enough.
        for up in ups.iter().filter(|up| is_cubic(up)) {
            for level in &levels {
                let rate = level * largest;
                all.extend([rate, -rate].map(|rate| Setting { up: *up, rate }));
            }
        }
    }
    all
}

/// Faces; and unless `plain` edges and corners of the cube, and slants of 30 and 60 degrees between faces.
fn directions(plain: bool) -> Vec<Vector3<f64>> {
    let steps = [0.0, 1.0, -1.0];
    let mut ups: Vec<Vector3<f64>> = Vec::new();
    for z in steps {
        for y in steps {
            ups.extend(steps.map(|x| Vector3::new(x, y, z)));
        }
    }
    ups.retain(|up| up.norm() > 0.5 && (!plain || up.norm() < 1.1));
    ups.sort_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()));
    if !plain {
        let (sine, cosine) = 30f64.to_radians().sin_cos();
        for k in 0..3 {
            let [a, b] = [Vector3::ith(k, 1.0), Vector3::ith((k + 1) % 3, 1.0)];
            for (p, q) in [(sine, cosine), (cosine, sine)] {
                for (s, t) in [(p, q), (-p, q), (p, -q), (-p, -q)] {
                    ups.push(a * s + b * t);
                }
            }
        }
    }
    ups.into_iter().map(|up| up.normalize()).collect()
}

fn is_cubic(up: &Vector3<f64>) -> bool {
    let most = up.amax();
    up.iter()
        .all(|c| c.abs() < 1e-9 || (c.abs() - most).abs() < 1e-9)
}

/// Stops at one time and temperature: where neither matters.
pub fn at_once(settings: &[Setting], question: &Question) -> Vec<Stop> {
    let stop = |s: &Setting| Stop {
        setting: *s,
        t_s: 0.0,
        dwell_s: question.dwell_s,
        warm_c: 0.0,
        late_c: Vec::new(),
    };
    settings.iter().map(stop).collect()
}
