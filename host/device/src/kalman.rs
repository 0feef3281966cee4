//! Runs the Kalman bank on the device with known inputs, and the same bank in double precision here on the same samples.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use mimu_core::compensation::Sample;
use mimu_core::kalman::{Bank, STATES};
use mimu_core::wire::{Capabilities, KalmanState, Prior, Request};
use nalgebra::Vector3;
use serde::Serialize;

use super::line::patience;
use super::received::{Answer, Event};
use super::session::{PATIENCE, SILENCE, Session};
use super::stream::Stream;
use mimu::quantity::Sensor;
use mimu_recording::error::{Error, Result};

/// Shortest time under one input. The device reports five times a second, and a report during the input shows which samples were used.
pub const SHORTEST: Duration = Duration::from_secs(1);
/// Samples that give the noise if it is not given: a second.
const NOISE_SAMPLES: usize = 1000;
/// Smallest variance of a reading, steps of its integer squared: that of rounding.
const LEAST_VARIANCE: f64 = 1.0 / 12.0;

/// Inputs and settings of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct KalmanPlan {
    /// Triad to calibrate.
    pub sensor: Sensor,
    /// True inputs in order: rad/s or m/s² in the body frame (specific force at rest points up).
    pub inputs: Vec<[f32; 3]>,
    /// Duration of each input.
    pub each: Duration,
    /// Variances of single readings of the sensors x, y, z, raw units squared. `None`: estimated from a second of readings before the first input.
    pub noise: Option<[f32; 3]>,
}

impl KalmanPlan {
    /// Largest magnitude of the inputs. If they are all zero it does not matter, but it has to be positive.
    fn span(&self) -> f32 {
        let largest = |s: f32, v: &f32| s.max(v.abs());
        match self.inputs.as_flattened().iter().fold(0.0, largest) {
            span if span > 0.0 => span,
            _ => 1.0,
        }
    }
}

/// Estimate of one sensor: `[b, P1, P2, P3]`, raw units, and raw units per rad/s or per m/s².
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AxisEstimate {
    /// Means.
    pub mean: [f64; STATES],
    /// Standard deviations.
    pub sigma: [f64; STATES],
}

/// Result of `mimu device kalman`. Forward model `u = P x + b`, SI to raw.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct KalmanRun {
    /// Triad: gyro or accel.
    pub triad: Sensor,
    /// Names of the four states of a sensor.
    pub parameters: [&'static str; STATES],
    /// `SI to raw`.
    pub direction: &'static str,
    /// Units of the states.
    pub units: [String; STATES],
    /// Unit of the inputs.
    pub input_unit: &'static str,
    /// Variances used, raw units squared.
    pub noise_variance: [f32; 3],
    /// Inputs in order.
    pub inputs: Vec<Applied>,
    /// Samples that at least one filter of the device rejected.
    pub rejected: u32,
    /// Estimates by the device, sensors x, y, z.
    pub device: [AxisEstimate; 3],
    /// Estimates by this program from the same samples.
    pub host: [AxisEstimate; 3],
    /// Differences of the means, device minus host, in standard deviations of the host.
    pub distance_sigma: [[f64; STATES]; 3],
    /// The largest of these differences.
    pub largest_distance_sigma: f64,
    /// Reports during the run.
    pub history: Vec<Converging>,
}

/// An input that was applied.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Applied {
    /// rad/s or m/s², body frame.
    pub input: [f32; 3],
    /// Number of the first sample used under this input.
    pub first: u32,
    /// Number of the last.
    pub last: u32,
}

/// A report of the device during the run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Converging {
    /// Samples used so far.
    pub updates: u32,
    /// Sensors x, y, z.
    pub axes: [AxisEstimate; 3],
}

fn distances(device: &[AxisEstimate; 3], host: &[AxisEstimate; 3]) -> [[f64; STATES]; 3] {
    std::array::from_fn(|i| {
        std::array::from_fn(|k| (device[i].mean[k] - host[i].mean[k]) / host[i].sigma[k])
    })
}

fn largest(distances: &[[f64; STATES]; 3]) -> f64 {
    let sizes = distances.iter().flatten().map(|d| match d.abs() {
        d if d.is_nan() => f64::INFINITY,
        d => d,
    });
    sizes.fold(0.0, f64::max)
}

/// Runs a bank on the device. `apply` is called before each input and returns once it is applied; `progress` gets the fraction done.
pub fn kalman(
    session: &mut Session,
    plan: &KalmanPlan,
    mut apply: impl FnMut(&[f32; 3]) -> Result<()>,
    mut progress: impl FnMut(f64),
) -> Result<KalmanRun> {
    if !session.who().capabilities.contains(Capabilities::KALMAN) {
        let problem = "the device runs no Kalman bank";
        return Err(Error::device(
            session.port(),
            problem,
            "flash newer firmware",
        ));
    }
    let mut run = BankRun::new(session, plan);
    let mut ends: Vec<u32> = Vec::new();
    for (at, input) in plan.inputs.iter().enumerate() {
        apply(input)?;
        run.begin_stream()?;
        if at == 0 {
            run.start_bank()?;
        }
        let end = run.take_input(*input, |share| {
            progress((at as f64 + share) / plan.inputs.len() as f64);
        })?;
        ends.push(end);
        run.session.done(Request::Stop, "to stop streaming")?;
    }
    let last = run.end_bank()?;
    run.result(&ends, &last)
}

/// A run of a bank on the device, and everything received during it.
struct BankRun<'a> {
    session: &'a mut Session,
    plan: &'a KalmanPlan,
    /// Samples under each input.
    wanted: usize,
    /// Variances of single readings, once they are known, raw units squared.
    noise: Option<[f32; 3]>,
    samples: BTreeMap<u32, Sample<f32>>,
    /// Raw units of a step of the triad's integers.
    step: f64,
    reports: Vec<KalmanState>,
    /// When the last samples came.
    last: Instant,
}

impl<'a> BankRun<'a> {
    fn new(session: &'a mut Session, plan: &'a KalmanPlan) -> Self {
        session.forget_events();
        let rate_hz = session.who().sample_rate_hz;
        // Counts samples, that is the device's time.
        let wanted = (plan.each.max(SHORTEST).as_secs_f64() * rate_hz) as usize;
        Self {
            session,
            plan,
            wanted,
            noise: plan.noise,
            samples: BTreeMap::new(),
            step: 0.0,
            reports: Vec::new(),
            last: Instant::now(),
        }
    }

    /// Begins the stream, and waits for its first batch.
    fn begin_stream(&mut self) -> Result<()> {
        self.last = Instant::now();
        self.session.begin_stream(Stream::Raw.request())?;
        // The input is set only after the first batch: the samples before it are missing here, and the bank must not use them.
        self.listen_until(self.samples.len() + 1)
    }

    /// Starts the bank, after a second of readings if they are to give the noise.
    fn start_bank(&mut self) -> Result<()> {
        let sensor = self.plan.sensor;
        if self.noise.is_none() {
            self.listen_until(NOISE_SAMPLES)?;
        }
        let (samples, step) = (&self.samples, self.step);
        let noise = *self
            .noise
            .get_or_insert_with(|| variances(samples, sensor, step));
        let span = self.plan.span();
        let start = Request::KalmanStart {
            sensor,
            noise,
            prior: Prior::Diffuse { span },
        };
        self.session.done(start, "to start a Kalman bank")
    }

    /// Lets the bank use samples under `input`. Returns how many it has used since its start.
    fn take_input(&mut self, input: [f32; 3], mut progress: impl FnMut(f64)) -> Result<u32> {
        let sensor = self.plan.sensor;
        let set = |input| Request::KalmanInput { sensor, input };
        self.session.done(set(Some(input)), "to take an input")?;
        let (from, wanted) = (self.samples.len(), self.wanted);
        while self.samples.len() < from + wanted {
            self.listen()?;
            let share = (self.samples.len() - from) as f64 / wanted as f64;
            progress(share.min(1.0));
        }
        self.session.done(set(None), "to take no input")?;
        self.settled()
    }

    /// Ends the bank, and returns its last state.
    fn end_bank(&mut self) -> Result<Box<KalmanState>> {
        let purpose = "to end a Kalman bank";
        let end = Request::KalmanEnd {
            sensor: self.plan.sensor,
        };
        match self.session.call(end, purpose, PATIENCE)? {
            Answer::Kalman(last) => Ok(last),
            _ => Err(self.session.unexpected(purpose)),
        }
    }

    fn listen_until(&mut self, samples: usize) -> Result<()> {
        while self.samples.len() < samples {
            self.listen()?;
        }
        Ok(())
    }

    fn listen(&mut self) -> Result<()> {
        match self.session.stream_event(self.last, "raw stream")? {
            Some(Event::Raw(batch)) => {
                let scale = batch.scale.unwrap_or_default();
                self.step = f64::from(scale[self.plan.sensor]);
                let numbers = (0..).map(|k| batch.head.first.wrapping_add(k));
                self.samples.extend(numbers.zip(batch.values));
                self.last = Instant::now();
            }
            Some(Event::Kalman(state)) if state.sensor == self.plan.sensor => {
                self.reports.push(*state);
            }
            _ => {}
        }
        Ok(())
    }

    /// Waits until two successive reports have used the same number of samples, and returns that number.
    fn settled(&mut self) -> Result<u32> {
        let (from, since) = (self.reports.len(), Instant::now());
        loop {
            self.listen()?;
            if let [.., a, b] = &self.reports[from..]
                && a.updates == b.updates
            {
                return Ok(b.updates);
            }
            if since.elapsed() > SILENCE * patience() {
                let problem = "the Kalman bank does not report";
                return Err(Error::device(self.session.port(), problem, "run it again"));
            }
        }
    }

    /// Compares the bank, which ended as `last`, with the same bank here. `ends` are the numbers of samples that it had used after each input.
    fn result(self, ends: &[u32], last: &KalmanState) -> Result<KalmanRun> {
        let (port, plan) = (self.session.port(), self.plan);
        let noise = self.noise.unwrap_or_default();
        let inputs = taken_in(port, plan, ends, &self.reports)?;
        let host = replay(port, plan, &noise, &inputs, &self.samples)?;
        let device = estimates(last);
        let distance_sigma = distances(&device, &host);
        let raw = &self.session.who().raw_unit;
        let input_unit = plan.sensor.pick("rad/s", "m/s²");
        let scale = || format!("{raw}/({input_unit})");
        let converging = |report: &KalmanState| Converging {
            updates: report.updates,
            axes: estimates(report),
        };
        Ok(KalmanRun {
            triad: plan.sensor,
            parameters: ["b", "P1", "P2", "P3"],
            direction: "SI to raw",
            units: [raw.clone(), scale(), scale(), scale()],
            input_unit,
            noise_variance: noise,
            inputs,
            rejected: last.rejected,
            device,
            host,
            largest_distance_sigma: largest(&distance_sigma),
            distance_sigma,
            history: self.reports.iter().map(converging).collect(),
        })
    }
}

/// Which samples the bank used under each input, from a report during the input: it links a count of used samples to a sample number.
fn taken_in(
    port: &str,
    plan: &KalmanPlan,
    ends: &[u32],
    reports: &[KalmanState],
) -> Result<Vec<Applied>> {
    let mut before = 0;
    let mut all = Vec::new();
    for (input, end) in plan.inputs.iter().zip(ends) {
        let within = reports
            .iter()
            .find(|r| r.updates > before && r.updates < *end);
        let Some(report) = within else {
            let problem = "the bank's reports were lost on the line, so its samples are unknown";
            return Err(Error::device(port, problem, "run it again"));
        };
        let first = report.last.wrapping_sub(report.updates - before - 1);
        all.push(Applied {
            input: *input,
            first,
            last: first.wrapping_add(end - before - 1),
        });
        before = *end;
    }
    Ok(all)
}

/// Runs the same bank in double precision, with the same noise and span.
fn replay(
    port: &str,
    plan: &KalmanPlan,
    noise: &[f32; 3],
    inputs: &[Applied],
    samples: &BTreeMap<u32, Sample<f32>>,
) -> Result<[AxisEstimate; 3]> {
    let noise = Vector3::from(noise.map(f64::from));
    let mut bank = Bank::<f64>::diffuse(&noise, plan.span().into());
    let mut missing = 0;
    for Applied { input, first, last } in inputs {
        let input = Vector3::from(input.map(f64::from));
        for k in 0..=last.wrapping_sub(*first) {
            let Some(sample) = samples.get(&first.wrapping_add(k)) else {
                missing += 1;
                continue;
            };
            let reading = sample[plan.sensor].map(f64::from);
            // The device rejects NaN, and so does this bank.
            let _ = bank.update(&input, &reading, &noise);
        }
    }
    if missing > 0 {
        let problem = format!("{missing} of the bank's samples were lost on the line");
        return Err(Error::device(port, problem, "run it again"));
    }
    Ok(bank.axes.map(|filter| {
        let (mean, covariance) = (filter.mean(), filter.covariance());
        AxisEstimate {
            mean: std::array::from_fn(|k| mean[k]),
            sigma: std::array::from_fn(|k| covariance[(k, k)].sqrt()),
        }
    }))
}

/// Variances of single readings from the differences of neighbours, raw units squared: noise slower than a sample does not count. `step` is that of
/// the integers, raw units.
fn variances(samples: &BTreeMap<u32, Sample<f32>>, sensor: Sensor, step: f64) -> [f32; 3] {
    let readings: Vec<_> = samples.values().map(|s| s[sensor].map(f64::from)).collect();
    let squares: Vector3<f64> = readings
        .windows(2)
        .map(|pair| (pair[1] - pair[0]).map(|d| 0.5 * d * d))
        .sum();
    let count = readings.len().saturating_sub(1).max(1) as f64;
    std::array::from_fn(|i| (squares[i] / count).max(LEAST_VARIANCE * step * step) as f32)
}

fn estimates(state: &KalmanState) -> [AxisEstimate; 3] {
    state.axes.map(|axis| {
        let [c00, _, _, _, c11, _, _, c22, _, c33] = axis.covariance;
        AxisEstimate {
            mean: axis.mean.map(f64::from),
            sigma: [c00, c11, c22, c33].map(|v| f64::from(v).sqrt()),
        }
    })
}
