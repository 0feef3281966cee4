//! The thermometer over a whole recording: refused where it sticks, jumps or is missing, evenly spaced and smoothed.

use mimu::quantity::{duration, significant};
use mimu::signal::blocks::extent;
use mimu::signal::blocks::{Block, Condensed};
use mimu_recording::error::{Argument, Error, Result};
use mimu_recording::health::Finding;
use mimu_recording::units::median;

/// Spacing of the series, s. A die's lag is tens of seconds.
const STEP_S: f64 = 1.0;
/// Width (one sigma) of the smoothing, s, where the thermometer is fine enough.
const SMOOTHING_S: f64 = 5.0;
/// Longest time without a temperature, s, that is interpolated: at 5 K/min the rate of the fastest chambers, 1 K.
const LONGEST_GAP_S: f64 = 12.0;
/// A thermometer that is constant for less than this, s, does not stick.
const SHORTEST_STUCK_S: f64 = 60.0;
/// It sticks if it is constant for this many times as long as usual.
const STUCK_FACTOR: f64 = 50.0;
/// Smallest change within a second, K, that can be a jump.
const SMALLEST_JUMP: f64 = 0.5;
/// For this long after power-on, s, nothing counts as a jump: self-heating warms a die by kelvins within seconds.
const POWERED_UP_S: f64 = 60.0;
/// A jump is this many times the change that only one second in two hundred exceeds.
const JUMP_FACTOR: f64 = 12.0;

/// Refuses values that cannot be temperatures: curves over the rest would come from samples that only happen to look plausible.
fn check_possible(found: Option<&Finding>, place: &str) -> Result<()> {
    let Some(problem) = found.map(Finding::problem) else {
        return Ok(());
    };
    let remedy = "import the readings again, with a factor and an offset for temp_c";
    Err(Error::new(place, problem, remedy)
        .about(Argument::Scale)
        .about(Argument::Offset))
}

/// Temperatures of the thermometer in even steps of time, with their slope.
#[derive(Debug, Clone)]
pub struct Thermometer {
    start_s: f64,
    temp_c: Vec<f64>,
    slope: Vec<f64>,
    /// Whether it begins at the power-on, so that dies and thermometer begin at the same temperature.
    from_power_on: bool,
}

impl Thermometer {
    /// From `condensed`, whose samples are at `place`; `power_on_s` as in the manifest.
    ///
    /// # Errors
    /// Temperatures that are missing, jump or stick.
    pub fn of(condensed: &Condensed, power_on_s: Option<f64>, place: &str) -> Result<Self> {
        let place = format!("{place}, temp_c");
        let blocks = || condensed.blocks.iter();
        let middle = |b: &Block| 0.5 * (b.start_s + b.last_s);
        let known: Vec<(f64, f64)> = blocks()
            .filter(|b| b.temp_c.mean.is_finite())
            .map(|b| (middle(b), b.temp_c.mean))
            .collect();
        let (Some(first), Some(last)) = (blocks().next(), blocks().last()) else {
            return Err(missing(&place, "there is none"));
        };
        check_possible(condensed.no_temperatures.as_ref(), &place)?;
        if known.is_empty() {
            return Err(missing(&place, "temp_c is empty throughout"));
        }
        check_gaps(&condensed.blocks, &place)?;
        check_stuck(&known, &place)?;
        let mut series = Self::evenly(&known, first.start_s, last.last_s);
        // If the power-on is unknown, it may have been at the beginning.
        check_jumps(&series, power_on_s.unwrap_or(first.start_s), &place)?;
        series.from_power_on = power_on_s.is_some_and(|p| first.start_s - p < LONGEST_GAP_S);
        series.smooth(smoothing(&known));
        Ok(series)
    }

    /// Means over even steps; a step without a value lies on the line between its neighbours.
    fn evenly(known: &[(f64, f64)], start_s: f64, end_s: f64) -> Self {
        let n = ((end_s - start_s) / STEP_S).ceil().max(1.0) as usize + 1;
        let mut sums = vec![(0.0, 0.0); n];
        for &(t, temp) in known {
            let k = (((t - start_s) / STEP_S).round() as usize).min(n - 1);
            sums[k].0 += temp;
            sums[k].1 += 1.0;
        }
        let at: Vec<(usize, f64)> = sums
            .iter()
            .enumerate()
            .filter(|(_, s)| s.1 > 0.0)
            .map(|(k, s)| (k, s.0 / s.1))
            .collect();
        let mut temp_c = Vec::with_capacity(n);
        let mut next = 0;
        for k in 0..n {
            while next < at.len() && at[next].0 < k {
                next += 1;
            }
            temp_c.push(match (next.checked_sub(1).map(|i| at[i]), at.get(next)) {
                (Some((i, a)), Some(&(j, b))) => a + (b - a) * (k - i) as f64 / (j - i) as f64,
                (Some((_, only)), None) | (None, Some(&(_, only))) => only,
                (None, None) => f64::NAN,
            });
        }
        Self {
            start_s,
            slope: vec![0.0; n],
            temp_c,
            from_power_on: false,
        }
    }

    /// Local lines under a Gaussian window: value and slope. A mean would be biased at both ends of the record.
    fn smooth(&mut self, sigma_s: f64) {
        let n = self.temp_c.len();
        let reach = (3.0 * sigma_s / STEP_S).ceil() as usize;
        let window: Vec<f64> = (0..=reach)
            .map(|k| (-0.5 * (k as f64 * STEP_S / sigma_s).powi(2)).exp())
            .collect();
        let (mut level, mut slope) = (Vec::with_capacity(n), Vec::with_capacity(n));
        for k in 0..n {
            let (from, to) = (k.saturating_sub(reach), (k + reach).min(n - 1));
            let (mut s0, mut s1, mut s2, mut y0, mut y1) = (0.0, 0.0, 0.0, 0.0, 0.0);
            for i in from..=to {
                let (w, x) = (window[i.abs_diff(k)], (i as f64 - k as f64) * STEP_S);
                let y = self.temp_c[i] - self.temp_c[k];
                s0 += w;
                s1 += w * x;
                s2 += w * x * x;
                y0 += w * y;
                y1 += w * x * y;
            }
            let det = s0 * s2 - s1 * s1;
            if det > 0.0 {
                level.push(self.temp_c[k] + (s2 * y0 - s1 * y1) / det);
                slope.push((s0 * y1 - s1 * y0) / det);
            } else {
                level.push(self.temp_c[k]);
                slope.push(0.0);
            }
        }
        (self.temp_c, self.slope) = (level, slope);
    }

    /// Smoothed temperature and slope (K/s) at `t_s`.
    pub fn at(&self, t_s: f64) -> (f64, f64) {
        let (k, share) = self.place(t_s);
        (
            between(&self.temp_c, k, share),
            between(&self.slope, k, share),
        )
    }

    /// Lowest and highest temperature, °C.
    pub fn range(&self) -> [f64; 2] {
        extent(self.temp_c.iter().copied())
    }

    /// Smoothed temperatures, one a second, °C.
    pub fn values(&self) -> &[f64] {
        &self.temp_c
    }

    /// Beginning of the record, s.
    pub fn start_s(&self) -> f64 {
        self.start_s
    }

    /// Duration of the record, s.
    pub fn duration_s(&self) -> f64 {
        (self.temp_c.len() - 1) as f64 * STEP_S
    }

    /// Temperature of a die that follows the thermometer with the time constant `lag_s`, or leads it if that is negative.
    ///
    /// `lag · dT_die/dt + T_die = T_thermometer` for a positive one; `T_die = T_thermometer + |lag| · dT_thermometer/dt` for a negative
    /// one, with the slope of the smoothed thermometer. `start` is its state at the beginning.
    pub fn die(&self, lag_s: f64, start: Start) -> Die {
        if lag_s <= 0.0 {
            let led = self.temp_c.iter().zip(&self.slope);
            return Die {
                start_s: self.start_s,
                temp_c: led.map(|(t, slope)| t - lag_s * slope).collect(),
            };
        }
        let first = self.temp_c[0];
        let mut die = match start {
            Start::OnRamp if !self.from_power_on => first - lag_s * self.slope[0],
            _ => first,
        };
        // Exact for a thermometer that is linear between its values.
        let keep = (-STEP_S / lag_s).exp();
        let mut temp_c = Vec::with_capacity(self.temp_c.len());
        temp_c.push(die);
        for pair in self.temp_c.windows(2) {
            let behind = lag_s / STEP_S * (pair[1] - pair[0]);
            die = pair[1] - behind + keep * (die - pair[0] + behind);
            temp_c.push(die);
        }
        Die {
            start_s: self.start_s,
            temp_c,
        }
    }

    fn place(&self, t_s: f64) -> (usize, f64) {
        place(self.start_s, self.temp_c.len(), t_s)
    }
}

/// State of a die when the record began.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// At the temperature of the thermometer: after a soak, or at the power-on.
    Settled,
    /// Behind by lag times slope: the ramp had lasted for long.
    OnRamp,
}

/// Temperature of a die through a recording.
#[derive(Debug, Clone)]
pub struct Die {
    start_s: f64,
    temp_c: Vec<f64>,
}

impl Die {
    /// Temperature at `t_s`, °C.
    pub fn at(&self, t_s: f64) -> f64 {
        let (k, share) = place(self.start_s, self.temp_c.len(), t_s);
        between(&self.temp_c, k, share)
    }

    /// Lowest and highest temperature, °C.
    pub fn range(&self) -> [f64; 2] {
        extent(self.temp_c.iter().copied())
    }
}

fn place(start_s: f64, n: usize, t_s: f64) -> (usize, f64) {
    let x = ((t_s - start_s) / STEP_S).clamp(0.0, (n - 1) as f64);
    let k = (x as usize).min(n.saturating_sub(2));
    (k, x - k as f64)
}

fn between(values: &[f64], k: usize, share: f64) -> f64 {
    match values.get(k + 1) {
        Some(next) => values[k] + share * (next - values[k]),
        None => values[k],
    }
}

fn missing(place: &str, problem: &str) -> Error {
    let remedy =
        "record the thermometer with every sample: curves over temperature need it throughout";
    Error::new(place, problem, remedy)
}

/// Refuses samples without a temperature for longer than can be interpolated. Pauses of the recording do not count.
fn check_gaps(blocks: &[Block], place: &str) -> Result<()> {
    let runs = blocks.chunk_by(|a, b| a.temp_c.mean.is_nan() == b.temp_c.mean.is_nan());
    let without = runs.filter(|run| run[0].temp_c.mean.is_nan());
    let longest = without
        .map(|run| [run[0].start_s, run[run.len() - 1].last_s])
        .max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])));
    match longest {
        Some([from, to]) if to - from > LONGEST_GAP_S => {
            let problem = format!("temp_c has no value from {from:.1} s to {to:.1} s");
            Err(missing(place, &problem))
        }
        _ => Ok(()),
    }
}

/// Runs of the same value: their first and last instants.
fn runs(known: &[(f64, f64)]) -> Vec<[f64; 2]> {
    let mut runs: Vec<[f64; 2]> = Vec::new();
    let mut value = f64::NAN;
    for &(t, temp) in known {
        match runs.last_mut() {
            Some(run) if temp == value => run[1] = t,
            _ => {
                runs.push([t, t]);
                value = temp;
            }
        }
    }
    runs
}

/// Median length of the runs, s; 0 without any.
fn usual_length(runs: &[[f64; 2]]) -> f64 {
    median(runs.iter().map(|r| r[1] - r[0]).collect()).unwrap_or(0.0)
}

fn check_stuck(known: &[(f64, f64)], place: &str) -> Result<()> {
    let runs = runs(known);
    // The usual length by number of runs: a coarse thermometer repeats its value for a while everywhere.
    let usual = usual_length(&runs).max(STEP_S);
    let longest = runs
        .iter()
        .max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])));
    match longest {
        Some([from, to]) if to - from > SHORTEST_STUCK_S.max(STUCK_FACTOR * usual) => {
            let problem = format!(
                "the thermometer sticks: from {from:.1} s on it repeats one value for {}, usually for {} only",
                duration(to - from),
                duration(usual)
            );
            let remedy = "repair the thermometer and record again, or cut the recording there";
            Err(Error::new(place, problem, remedy))
        }
        _ => Ok(()),
    }
}

fn check_jumps(series: &Thermometer, power_on_s: f64, place: &str) -> Result<()> {
    let powered_up = (power_on_s + POWERED_UP_S - series.start_s) / STEP_S;
    let mut steps: Vec<f64> = series
        .temp_c
        .windows(2)
        .map(|p| (p[1] - p[0]).abs())
        .collect();
    let Some((at, jump)) = steps
        .iter()
        .copied()
        .enumerate()
        .filter(|(k, _)| *k as f64 >= powered_up)
        .max_by(|a, b| a.1.total_cmp(&b.1))
    else {
        return Ok(());
    };
    steps.sort_by(f64::total_cmp);
    let usual = steps[steps.len() * 199 / 200];
    if steps.len() > 200 && jump > SMALLEST_JUMP.max(JUMP_FACTOR * usual) {
        // A jump in the middle of a step is spread over two.
        let around = [at.saturating_sub(1), (at + 2).min(series.temp_c.len() - 1)];
        let whole = (series.temp_c[around[1]] - series.temp_c[around[0]]).abs();
        let problem = format!(
            "the thermometer jumps by {} K at {:.0} s; in all but one of two hundred seconds it changes by less than {} K",
            significant(whole.max(jump)),
            series.start_s + at as f64 * STEP_S,
            significant(usual)
        );
        let remedy = "repair the thermometer and record again, or cut the recording there";
        return Err(Error::new(place, problem, remedy));
    }
    Ok(())
}

/// A coarse thermometer is smoothed over the time that it takes from one of its values to the next.
fn smoothing(known: &[(f64, f64)]) -> f64 {
    usual_length(&runs(known)).clamp(SMOOTHING_S, 12.0 * SMOOTHING_S)
}
