//! The best use of a limited time: how many dwells, how long, and how many passes.

use rayon::prelude::*;
use serde::Serialize;

use super::model::Setting;
use super::problem::Problem;
use super::tour::{Motion, randomised};
use crate::noise::noise_file::NoiseFile;
use crate::quantity::Sensor;
use mimu_allan::model::FLOOR;
use mimu_allan::variance::AllanModel;
use mimu_recording::error::{Error, Result};

/// Noise of a sensor as density and floor, from which the sigma of a dwell mean follows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DwellNoise {
    /// White noise N, SI unit times √s (the same as per √Hz).
    pub n: f64,
    /// Bias instability B, SI unit.
    pub b: f64,
    /// Rate random walk K, SI unit per √s.
    pub k: f64,
}

/// Time up to which fang, section 3, finds noise white, s.
const FANG_WHITE_S: f64 = 20.0;
/// Samples per second, fang, section 3.
const FANG_RATE_HZ: f64 = 1000.0;

impl DwellNoise {
    /// Of fang's sensors: N from the variances of Table 5 at 25 °C and the scale factors of Table 4, averaged over the axes; B
    /// such that the floor is reached at 20 s (section 3: white noise within, drift beyond; no number for B is given); K = 0.
    ///
    /// The parts filter their outputs, so samples at 1 kHz repeat each other, and a mean over a dwell averages less than their
    /// number suggests. N is the density that such samples have at low frequencies (`filtered_density`): 0.065 deg/s/√Hz and
    /// 0.29 mg/√Hz. Independent samples with these variances would have 0.023 and 0.23. The data sheets give 0.1 deg/s/√Hz
    /// and 0.35 mg/√Hz one-sided, which are an N of 0.071 and 0.25.
    ///
    /// The paper does not give the filters: 40 Hz is that of the ADXRS300 with the capacitor of its data sheet; 350, 350 and
    /// 150 Hz are those inside the MMA7260QT.
    pub fn fang(sensor: Sensor) -> Self {
        let (variances, scales, filters_hz, si) = match sensor {
            Sensor::Gyro => (
                [1.27, 0.92, 1.92],
                [5.07, 5.09, 5.17],
                [40.0; 3],
                1f64.to_radians(),
            ),
            Sensor::Accel => (
                [3.57, 4.23, 2.47],
                [80.80, 80.14, 80.84],
                [350.0, 350.0, 150.0],
                1.0,
            ),
        };
        let densities = variances.iter().zip(filters_hz);
        let density = densities
            .map(|(v, hz)| filtered_density(v * 1e-5, hz, FANG_RATE_HZ))
            .sum::<f64>();
        let volts_per_unit = scales.iter().sum::<f64>() / 3.0 * 1e-3;
        let n = (density / 3.0).sqrt() / volts_per_unit * si;
        Self {
            n,
            b: n / (FANG_WHITE_S * FLOOR).sqrt(),
            k: 0.0,
        }
    }

    /// The largest of each coefficient over all axes of `sensor` in a noise file, and over all temperatures.
    ///
    /// Errors: the file lacks the sensor, or is of raw readings without a scale factor.
    pub fn from_file(file: &NoiseFile, sensor: Sensor) -> Result<Self> {
        let mut worst = Self {
            n: 0.0,
            b: 0.0,
            k: 0.0,
        };
        let channels = file.of(sensor);
        if channels.is_empty() {
            return Err(Error::new(
                &file.place,
                format!("it has no channel of the {sensor}"),
                "run `mimu allan` on a recording that has this channel",
            ));
        }
        for channel in channels {
            let model = channel.model_in(sensor.unit(), &file.place)?;
            let AllanModel {
                white,
                flicker,
                walk,
            } = model;
            worst.n = worst.n.max(white.sqrt());
            worst.b = worst.b.max((flicker / FLOOR).sqrt());
            worst.k = worst.k.max((3.0 * walk).sqrt());
        }
        Ok(worst)
    }

    /// Dwell beyond which a longer one is not worth it, s: its sigma is within 5 % of the smallest possible. That is fang's
    /// argument (section 3) for 20 s. `None` if all noise is white.
    pub fn useful_s(&self) -> Option<f64> {
        let AllanModel {
            white,
            flicker,
            walk,
        } = self.allan();
        // Least at √(white/walk), 2 √(white walk) above the floor. Solves white/t + walk t + flicker = (1.05)² least.
        let over = 1.05 * 1.05 * (flicker + 2.0 * (white * walk).sqrt()) - flicker;
        (over > 0.0 && white > 0.0)
            .then(|| 2.0 * white / (over + (over * over - 4.0 * white * walk).max(0.0).sqrt()))
    }

    /// The three terms, as an Allan variance.
    fn allan(&self) -> AllanModel {
        AllanModel {
            white: self.n.powi(2),
            flicker: FLOOR * self.b.powi(2),
            walk: self.k.powi(2) / 3.0,
        }
    }

    /// Sigma of the mean over `dwell_s`, SI unit: `√(N²/T + (0.664 B)² + K² T/3)`.
    pub fn sigma(&self, dwell_s: f64) -> f64 {
        self.allan().variance(dwell_s).sqrt()
    }

    /// Dwell beyond which the mean gets worse, s.
    fn longest_s(&self) -> f64 {
        (self.allan().white / self.allan().walk).sqrt()
    }

    /// Shares of white noise, floor and random walk in the variance of a dwell mean.
    pub fn shares(&self, dwell_s: f64) -> Shares {
        let a = self.allan();
        let all = a.variance(dwell_s);
        Shares {
            white: a.white / dwell_s / all,
            instability: a.flicker / all,
            walk: a.walk * dwell_s / all,
        }
    }
}

/// N² of samples with `variance` at `rate_hz` of white noise behind a single-pole filter of `corner_hz`.
///
/// Neighbouring samples correlate by `a = exp(-2π f_c/f_s)`, so the mean of many has `(1 + a)/(1 - a)` times the variance that
/// independent ones would have. The factor is 8.0 for 40 Hz at 1 kHz.
fn filtered_density(variance: f64, corner_hz: f64, rate_hz: f64) -> f64 {
    let a = (-std::f64::consts::TAU * corner_hz / rate_hz).exp();
    variance / rate_hz * (1.0 + a) / (1.0 - a)
}

/// Shares in the variance of a dwell mean; their sum is 1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Shares {
    /// White noise.
    pub white: f64,
    /// Bias instability.
    pub instability: f64,
    /// Rate random walk.
    pub walk: f64,
}

/// One way to spend the time.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Spending {
    /// Settings in their order, all passes.
    #[serde(skip)]
    pub settings: Vec<Setting>,
    /// Dwells of one pass.
    pub dwells_a_pass: usize,
    /// Passes over the design.
    pub passes: usize,
    /// Length of each dwell, s.
    pub dwell_s: f64,
    /// Time of all moves, s.
    pub moves_s: f64,
    /// Sigma of a dwell mean, SI.
    #[serde(skip)]
    pub sigma: f64,
    /// Mean sigma of the parameters, over all passes.
    pub mean_sigma: f64,
}

impl Spending {
    /// Time of all dwells and moves, s.
    pub fn time_s(&self) -> f64 {
        self.settings.len() as f64 * self.dwell_s + self.moves_s
    }
}

/// The ways that were compared.
#[derive(Debug, Clone, PartialEq)]
pub struct Budget {
    /// The one with the smallest mean sigma.
    pub best: Spending,
    /// The best with each number of dwells in a pass, ascending.
    pub by_size: Vec<Spending>,
}

/// Most dwells in a pass.
const MOST: usize = 40;
/// Most passes.
const PASSES: usize = 50;
/// Shortest dwell, s: a controller and a settling filter allow no shorter ones.
const SHORTEST_S: f64 = 1.0;

/// Time and equipment of a session.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Session {
    /// Time for all dwells and moves, s.
    pub time_s: f64,
    /// Noise of the sensor.
    pub noise: DwellNoise,
    /// Moves between the dwells.
    pub motion: Motion,
}

impl Session {
    /// The number of dwells in a pass, the number of passes and the length of a dwell that make the parameters' mean sigma
    /// smallest. `seed` is that of the searches and of the randomised orders, which differ between passes: on the same way
    /// back, two dwells in a row at the same setting would share the drift.
    pub fn spend(&self, problem: &Problem, seed: u64) -> Result<Budget> {
        let least = problem.fewest();
        let sizes: Vec<usize> = (least..=MOST.max(least)).collect();
        let ways: Vec<Option<Spending>> = sizes
            .into_par_iter()
            .map(|n| {
                // Beside a population, the best poses depend on the noise, if weakly: that of a single pass without moves.
                let dwell_s = (self.time_s / n as f64).min(self.noise.longest_s());
                let sigma = self.noise.sigma(dwell_s.max(SHORTEST_S));
                let settings = problem.at_sigma(sigma).best(n, seed)?;
                let ways = (1..=PASSES).filter_map(|k| self.passes(problem, &settings, k, seed));
                Ok(ways.min_by(|a, b| a.mean_sigma.total_cmp(&b.mean_sigma)))
            })
            .collect::<Result<_>>()?;
        let by_size: Vec<Spending> = ways.into_iter().flatten().collect();
        let best = by_size
            .iter()
            .min_by(|a, b| a.mean_sigma.total_cmp(&b.mean_sigma));
        match best.cloned() {
            Some(best) => Ok(Budget { best, by_size }),
            None => Err(Error::new(
                format!("budget of {} min", self.time_s / 60.0),
                format!("{least} dwells of {SHORTEST_S} s and the moves between them take longer"),
                "allow more time, or use a table that moves faster",
            )),
        }
    }

    /// So many passes over the settings. `None` if there is no time for them.
    fn passes(
        &self,
        problem: &Problem,
        pass: &[Setting],
        passes: usize,
        seed: u64,
    ) -> Option<Spending> {
        let settings: Vec<Setting> = (0..passes as u64)
            .flat_map(|k| randomised(pass, seed.wrapping_add(k)))
            .collect();
        let moves_s = self.motion.moves_s(&settings);
        let most_s = (self.time_s - moves_s) / settings.len() as f64;
        let dwell_s = most_s.min(self.noise.longest_s().max(SHORTEST_S));
        let sigma = self.noise.sigma(dwell_s);
        if !(dwell_s >= SHORTEST_S) {
            return None;
        }
        // A pass over dwells with the sigma of a mean over all passes.
        let mean = sigma / (passes as f64).sqrt();
        Some(Spending {
            dwells_a_pass: pass.len(),
            passes,
            dwell_s,
            moves_s,
            sigma,
            mean_sigma: problem.mean_sigma(pass, mean),
            settings,
        })
    }
}
