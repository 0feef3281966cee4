//! First-order low-pass: the pole of an output stage, a cable, or a heat capacity.

/// Configuration and state of `τ y' + y = x`, discretised exactly for an input that is linear between the steps.
///
/// A held input would change the lag of a ramp by half a step. During a rate table's spin-up, this would show as an error of the specific force at
/// the lever arm.
#[derive(Debug, Clone, Copy)]
pub struct LowPass {
    keep: f64,
    before: f64,
    now: f64,
    input: f64,
    output: f64,
}

impl LowPass {
    /// With time constant `tau_s` (0: no filter) and step `dt_s`, settled at `start`.
    pub fn new(tau_s: f64, dt_s: f64, start: f64) -> Self {
        let keep = (-dt_s / tau_s).exp();
        // Computed as 1 - keep, it would lose the digits that a lag of hours at 20 kHz needs.
        let late = -(-dt_s / tau_s).exp_m1() * tau_s / dt_s;
        Self {
            keep,
            before: late - keep,
            now: 1.0 - late,
            input: start,
            output: start,
        }
    }

    /// With a -3 dB frequency instead of the time constant; infinity means no filter.
    pub fn of_bandwidth(bandwidth_hz: f64, dt_s: f64) -> Self {
        Self::new(1.0 / (std::f64::consts::TAU * bandwidth_hz), dt_s, 0.0)
    }

    /// Settled at `value`, as after a long constant input.
    pub fn settle(&mut self, value: f64) {
        self.start(value, value);
    }

    /// Input and output one step before the first step.
    pub fn start(&mut self, input: f64, output: f64) {
        self.input = input;
        self.output = output;
    }

    /// Output after the next step, at which the input is `input`.
    #[inline]
    pub fn step(&mut self, input: f64) -> f64 {
        self.output = self.keep * self.output + self.before * self.input + self.now * input;
        self.input = input;
        self.output
    }
}
