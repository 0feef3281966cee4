//! Everything that is measured in one rest.

use mimu::{STANDARD_GRAVITY, Sensor};
use mimu_device::Verdict;
use mimu_recording::error::Result;
use mimu_recording::health::is_coarse;
use nalgebra::Vector3;

use crate::bits::{codes, equal_run, stuck_bits};
use crate::gather::Samples;
use crate::measured::Measured;
use crate::noise::{density, rms};
use crate::own_limit::OwnLimit;
use crate::quantity::Quantity;
use crate::rate::Rate;
use crate::rest::Rest;
use crate::scale::{Scale, si_per_sheet};
use crate::side::{direction, side_up};

/// The Earth's rate, rad/s. A gyro at rest senses a part of it that depends on its heading.
const EARTH: f64 = 7.292_115e-5;
/// Standard uncertainty of a component of the Earth's rate in an unknown direction, over the rate.
const COMPONENT: f64 = 0.577_350_269;
/// Standard uncertainty of a thermometer in an inertial part, °C: data sheets state 1 to 5 °C at most.
const THERMOMETER_C: f64 = 1.0;
/// mg and µg for one g.
const MILLI: f64 = 1e3;
const MICRO: f64 = 1e6;

/// What one rest of a unit shows.
#[derive(Debug, Clone)]
pub struct Quantities {
    /// The quantities, in a fixed order.
    pub measured: Vec<Measured>,
    /// Limits that belong to the measurement itself: runs by chance, the board's own self-test.
    pub own_limits: Vec<OwnLimit>,
    /// What could not be measured, with the reason.
    pub not_measured: Vec<String>,
    /// The side that is up, such as `+z`; `None` without an accelerometer.
    pub up: Option<String>,
    /// Mean specific force, m/s², with the variances of its components.
    pub force: Option<[Vector3<f64>; 2]>,
    /// Length of the rest, s.
    pub duration_s: f64,
}

/// Measures `samples`. `expected_up`: the side that has to be up, such as `+z`.
///
/// # Errors
/// The unit moved, or the measurement is too short.
pub fn measure(samples: &Samples, scale: &Scale, expected_up: Option<&str>) -> Result<Quantities> {
    let by_stamps = Rate::of(&samples.batch.t_s)
        .map_err(|e| e.map(|e| e.place = format!("{}, t_s", samples.place)))?;
    let rate = match samples.rate_hz {
        Some([hz, sigma_hz]) => Rate {
            hz,
            sigma_hz,
            ..by_stamps
        },
        None => by_stamps,
    };
    let rest = Rest::of(samples, rate.hz, scale)?;
    let mut all = Quantities {
        measured: Vec::new(),
        own_limits: Vec::new(),
        not_measured: Vec::new(),
        up: None,
        force: None,
        duration_s: rest.duration_s,
    };
    if samples.has(Sensor::Accel as usize) {
        all.gravity(samples, &rest, scale, expected_up);
    }
    if samples.has(Sensor::Gyro as usize) {
        all.offsets(&rest, scale);
    }
    for sensor in Sensor::BOTH {
        if !samples.has(sensor as usize) {
            all.not_measured
                .push(format!("{sensor}: the unit sends no readings of it"));
        } else {
            all.noise(samples, &rest, scale, sensor, rate.hz);
            all.codes(samples, &rest, scale, sensor);
        }
    }
    all.add(Quantity::SampleRate, None, rate.hz, rate.sigma_hz);
    let (lost, sigma) = rate.lost_percent();
    all.add(Quantity::LostSamples, None, lost, sigma);
    all.temperature(samples, &rest);
    all.self_test(samples);
    Ok(all)
}

impl Quantities {
    fn add(&mut self, of: Quantity, axis: Option<usize>, value: f64, sigma: f64) {
        self.measured.push(of.measured(axis, value, sigma));
    }

    fn missing(&mut self, of: Quantity, axis: Option<usize>, why: &str) {
        self.not_measured.push(format!("{}: {why}", of.name(axis)));
    }

    /// Magnitude of the specific force, and the side that is up.
    fn gravity(&mut self, samples: &Samples, rest: &Rest, scale: &Scale, expected: Option<&str>) {
        let force = scale.apply(Sensor::Accel, &rest.raw(Sensor::Accel));
        let per_raw = scale.si_per_raw(Sensor::Accel);
        let variance = Vector3::from_fn(|k, _| rest.variance[3 + k] * per_raw[k].powi(2));
        let up = force.normalize();
        let along = up.component_mul(&up).dot(&variance).sqrt();
        let mg = MILLI / STANDARD_GRAVITY;
        let [gravity, sigma] = samples.gravity;
        let off = force.norm() - gravity;
        let error = Quantity::GravityError.measured(None, off * mg, along * mg);
        self.measured.push(error.with_common(sigma * mg));
        let (side, nearest) = side_up(&force);
        let meant = expected.and_then(direction).unwrap_or(nearest);
        let across = variance.max().sqrt() / force.norm();
        let tilt = force.angle(&meant).to_degrees();
        self.add(Quantity::Tilt, None, tilt, across.to_degrees());
        self.up = Some(side);
        self.force = Some([force, variance]);
    }

    fn offsets(&mut self, rest: &Rest, scale: &Scale) {
        let rate = scale.apply(Sensor::Gyro, &rest.raw(Sensor::Gyro));
        let per_raw = scale.si_per_raw(Sensor::Gyro);
        for axis in 0..3 {
            let sigma = (rest.variance[axis].sqrt() * per_raw[axis]).to_degrees();
            let offset = rate[axis].to_degrees();
            let offset = Quantity::GyroOffset.measured(Some(axis), offset, sigma);
            let earth = (COMPONENT * EARTH).to_degrees();
            self.measured.push(offset.with_common(earth));
        }
    }

    fn noise(&mut self, samples: &Samples, rest: &Rest, scale: &Scale, sensor: Sensor, hz: f64) {
        let per_raw = scale.si_per_raw(sensor);
        let (of_rms, of_density, by) = sensor.pick(
            (Quantity::GyroNoise, Quantity::GyroDensity, [1.0, 1.0]),
            (Quantity::AccelNoise, Quantity::AccelDensity, [MILLI, MICRO]),
        );
        for (axis, c) in sensor.channels().enumerate() {
            let readings = &samples.batch.raw[c][rest.rows.clone()];
            let sheet = per_raw[axis] / si_per_sheet(sensor);
            let (value, sigma) = rms(readings);
            let factor = by[0] * sheet;
            self.add(of_rms, Some(axis), factor * value, factor * sigma);
            match density(readings, 1.0 / hz) {
                Some((value, sigma)) => {
                    let factor = by[1] * sheet;
                    self.add(of_density, Some(axis), factor * value, factor * sigma);
                }
                None => self.missing(
                    of_density,
                    Some(axis),
                    "the record is too short, or its rate too low, for the band of 5 to 20 Hz",
                ),
            }
        }
    }

    /// Stuck bits, and runs of equal readings.
    fn codes(&mut self, samples: &Samples, rest: &Rest, scale: &Scale, sensor: Sensor) {
        let (of_bits, of_run) = sensor.pick(
            (Quantity::GyroBits, Quantity::GyroRun),
            (Quantity::AccelBits, Quantity::AccelRun),
        );
        let lsb = scale.lsb[sensor as usize];
        let of = |c: usize| &samples.batch.raw[c][rest.rows.clone()];
        for (axis, c) in sensor.channels().enumerate() {
            let readings = of(c);
            let step = lsb.or(rest.step[c]);
            match step
                .and_then(|step| codes(readings, step))
                .map(|codes| stuck_bits(&codes))
            {
                Some(Some(count)) => self.add(of_bits, Some(axis), count.into(), 0.0),
                Some(None) => self.missing(of_bits, Some(axis), "the codes do not change"),
                None => self.missing(of_bits, Some(axis), "the readings are no whole codes"),
            }
            let (run, mut by_chance) = (equal_run(readings), rest.longest_run[c]);
            if run == readings.len() {
                let mut others = sensor.channels().filter(|o| *o != c);
                let coarse =
                    lsb.is_some_and(|step| others.any(|o| is_coarse(rms(of(o)).0.powi(2), step)));
                if coarse {
                    let why = "its value never changes: it is dead, or its steps are coarser than its noise";
                    self.missing(of_run, Some(axis), why);
                    continue;
                }
                let others = sensor.channels().map(|o| rest.longest_run[o]);
                let longest = others.filter(|run| run.is_finite()).reduce(f64::max);
                by_chance = longest.unwrap_or(readings.len() as f64 - 1.0);
            }
            self.add(of_run, Some(axis), run as f64, 0.0);
            if by_chance.is_finite() {
                self.own_limits.push(OwnLimit {
                    name: of_run.name(Some(axis)),
                    lower: None,
                    upper: Some(by_chance),
                    source: "longest run that chance explains".into(),
                });
            }
        }
    }

    fn temperature(&mut self, samples: &Samples, rest: &Rest) {
        let all = samples.batch.temp_c.get(rest.rows.clone()).unwrap_or(&[]);
        let known: Vec<f64> = all.iter().copied().filter(|t| t.is_finite()).collect();
        if known.is_empty() {
            self.missing(Quantity::Temperature, None, "the unit sends none");
            return;
        }
        let n = known.len() as f64;
        let mean = known.iter().sum::<f64>() / n;
        let sigma = if known.len() > 2 {
            rms(&known).0 / n.sqrt()
        } else {
            0.0
        };
        let measured = Quantity::Temperature.measured(None, mean, sigma);
        self.measured.push(measured.with_common(THERMOMETER_C));
    }

    /// The rows of the board's own self-test, with the board's limits.
    fn self_test(&mut self, samples: &Samples) {
        for row in &samples.self_test {
            let name = format!("self_test_{}", row.name.replace([' ', '-', ','], "_"));
            if row.verdict == Verdict::NotShown {
                let why = "this pose does not show whether it works";
                self.not_measured.push(format!("{name}: {why}"));
                continue;
            }
            self.measured
                .push(Measured::new(&name, row.value, &row.unit, 0.0));
            self.own_limits.push(OwnLimit {
                name,
                lower: Some(row.limits[0]),
                upper: Some(row.limits[1]),
                source: "the board's self-test".into(),
            });
        }
    }
}
