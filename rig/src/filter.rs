//! First-order low-pass: the pole of an output stage, a cable, or a lump of heat.

/// Configuration and state of `τ y' + y = x`, discretised exactly for an input that is straight between the
/// steps.
///
/// Straight, not held: a held input makes a ramp lag by half a step too much or too little, which a rate
/// table's spin-up shows as an error of the specific force at the lever arm.
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
        // As a difference, 1 - keep loses the digits that a lag of hours at 20 kHz needs.
        let late = -(-dt_s / tau_s).exp_m1() * tau_s / dt_s;
        Self {
            keep,
            before: late - keep,
            now: 1.0 - late,
            input: start,
            output: start,
        }
    }

    /// With the -3 dB frequency in place of the time constant; infinity is no filter.
    pub fn of_bandwidth(bandwidth_hz: f64, dt_s: f64) -> Self {
        Self::new(1.0 / (std::f64::consts::TAU * bandwidth_hz), dt_s, 0.0)
    }

    /// Settled at `value`, as after a constant input for ever.
    pub fn settle(&mut self, value: f64) {
        self.start(value, value);
    }

    /// Input and output of the instant before the first step.
    pub fn start(&mut self, input: f64, output: f64) {
        self.input = input;
        self.output = output;
    }

    /// Output one step on, where the input is `input`.
    #[inline]
    pub fn step(&mut self, input: f64) -> f64 {
        self.output = self.keep * self.output + self.before * self.input + self.now * input;
        self.input = input;
        self.output
    }
}
