//! Random errors of one axis, with the coefficients of an Allan deviation.
//!
//! IEEE Std 952, annex C: for a two-sided spectral density `N² + B²/(2π f) + K²/(2π f)²`, the Allan deviation is the root of the sum of the squares
//! of `N/√τ`, `B √(2 ln 2/π) = 0.664 B` and `K √(τ/3)`. So `B` is the coefficient, and the floor in a plot is 0.664 of it. A data sheet's noise
//! density is one-sided, the rms per root hertz of positive frequency: `N` is that over √2.

use crate::random::Random;

/// Coefficients of one axis, in the unit of its input (rad/s or m/s²).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coefficients {
    /// White noise N (angle or velocity random walk), unit/√Hz.
    pub white: f64,
    /// Bias instability B, unit: the coefficient, which exceeds the floor of the plot.
    pub instability: f64,
    /// Rate random walk K, unit/√s.
    pub walk: f64,
}

/// Ratio of neighbouring correlation times of the flicker noise. [`Noise::new`] gives the measured ripple of the floor.
const RATIO: f64 = 3.162_277_660_168_379_5;

/// Longest correlation time, s. For times above a hundredth of it the flicker noise is too small.
const LONGEST_S: f64 = 1e7;

/// Variance of the fastest process relative to the others. It represents all processes that are faster than a step and therefore white, `1 + 1/(r -
/// 1)` times its own power at low frequency. Its own power when sampled is already `coth(1/2)/2` times that.
const FASTEST: f64 = 1.351_6;

/// Number of times that a slow process is redrawn in its correlation time; each redraw is exact for the time since the last.
const REDRAWS: f64 = 16.0;

/// One first-order Gauss–Markov process.
#[derive(Debug, Clone, Copy)]
struct Markov {
    /// Redrawn when the step number has none of these bits: every `mask + 1` steps, a power of two.
    mask: u64,
    keep: f64,
    draw: f64,
    value: f64,
}

/// Random error of one axis.
#[derive(Debug, Clone)]
pub struct Noise {
    white: f64,
    instability: f64,
    walk: f64,
    walked: f64,
    markov: Vec<Markov>,
    sum: f64,
    step: u64,
    white_stream: Random,
    flicker_stream: Random,
    walk_stream: Random,
}

impl Noise {
    /// Noise of the axis `name` at steps of `dt_s`.
    ///
    /// White noise enters as its mean over the step, with variance `N²/dt`: power above the step's rate is not aliased, as in a chain that averages
    /// over the sample. Flicker noise is a sum of Gauss–Markov processes of equal variance `B² ln r/π`, with correlation times in ratio r from one
    /// step up. An integral over the logarithm of the correlation time would give `B²/(2π f)` exactly; the sum of Lorentzians at r = √10 follows it
    /// with a ripple of `2/cosh(π²/ln r)`, 8e-4. The processes start stationary. From 10 steps to 1e5 s the floor is flat within 0.5 %
    /// (`the_flicker_floor_is_flat_over_seven_decades`). The random walk starts at zero.
    pub fn new(of: &Coefficients, name: &str, dt_s: f64, seed: u64) -> Self {
        let mut flicker_stream = Random::new(seed, &format!("{name} flicker noise"));
        let mut markov = Vec::new();
        let mut tau_s = dt_s;
        while of.instability > 0.0 && tau_s < LONGEST_S {
            let every = ((tau_s / (REDRAWS * dt_s)).max(1.0) as u64 + 1).next_power_of_two() / 2;
            let keep = (-(every as f64) * dt_s / tau_s).exp();
            let sigma = if markov.is_empty() {
                FASTEST.sqrt()
            } else {
                1.0
            };
            markov.push(Markov {
                mask: every - 1,
                keep,
                draw: sigma * (1.0 - keep * keep).sqrt(),
                value: sigma * flicker_stream.normal(),
            });
            tau_s *= RATIO;
        }
        Self {
            white: of.white / dt_s.sqrt(),
            instability: of.instability * (RATIO.ln() / std::f64::consts::PI).sqrt(),
            walk: of.walk * dt_s.sqrt(),
            walked: 0.0,
            sum: markov.iter().map(|m| m.value).sum(),
            markov,
            step: 0,
            white_stream: Random::new(seed, &format!("{name} white noise")),
            flicker_stream,
            walk_stream: Random::new(seed, &format!("{name} random walk")),
        }
    }

    /// Mean error over the next step.
    #[inline]
    pub fn step(&mut self) -> f64 {
        let mut error = 0.0;
        if self.white > 0.0 {
            error += self.white * self.white_stream.normal();
        }
        if self.instability > 0.0 {
            self.step += 1;
            // The masks grow, so the first one that shares a bit with the step number ends the round. At 1 kHz, 4 of 20 are redrawn on average.
            for m in &mut self.markov {
                if self.step & m.mask != 0 {
                    break;
                }
                let value = m.keep * m.value + m.draw * self.flicker_stream.normal();
                self.sum += value - m.value;
                m.value = value;
            }
            error += self.instability * self.sum;
        }
        if self.walk > 0.0 {
            self.walked += self.walk * self.walk_stream.normal();
            error += self.walked;
        }
        error
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Allan variance of a Gauss–Markov process of unit variance and correlation time `t`, averaged over
    /// `tau`.
    fn allan_of_markov(t: f64, tau: f64) -> f64 {
        let x = tau / t;
        // 2 - (3 - 4 e^-x + e^-2x)/x loses digits at small x, so its series 2x²/3 (1 - 3x/4 + 7x²/20 ...)/x is used there.
        if x < 1e-3 {
            return 2.0 / 3.0 * x * (1.0 - 0.75 * x);
        }
        let e = (-x).exp();
        (2.0 - (3.0 - 4.0 * e + e * e) / x) / x
    }

    #[test]
    fn the_flicker_floor_is_flat_over_seven_decades() {
        let dt = 1e-3;
        let of = Coefficients {
            white: 0.0,
            instability: 1.0,
            walk: 0.0,
        };
        let noise = Noise::new(&of, "a", dt, 1);
        let floor = (2.0 * 2_f64.ln() / std::f64::consts::PI).sqrt();
        let mut worst = 0.0_f64;
        let mut tau = 10.0 * dt;
        while tau <= 1e5 {
            // Beyond ten steps the fastest is white, with the strength `FASTEST`.
            let fastest = (1.0 + 1.0 / (RATIO - 1.0)) * allan_of_markov(dt, tau);
            let others =
                (1..noise.markov.len()).map(|k| allan_of_markov(dt * RATIO.powi(k as i32), tau));
            let variance = fastest + others.sum::<f64>();
            let ratio = noise.instability * variance.sqrt() / floor;
            worst = worst.max((ratio - 1.0).abs());
            tau *= 1.05;
        }
        assert!(worst < 0.005, "{worst}");
    }
}
