//! Temperatures of the board and of the dies on it: chamber air → board → die, one heat capacity each.

use crate::filter::LowPass;

/// The thermal network. Temperatures in °C, times in s.
///
/// `lag T' + T = temperature of its support + heating`: the heating is the rise of a powered part in still air.
#[derive(Debug, Clone, PartialEq)]
pub struct ThermalTruth {
    /// Lag of the board behind the chamber's air, s.
    pub board_lag_s: f64,
    /// Lag of each die behind the board, s: gyros x, y, z, then the accelerometer.
    pub die_lag_s: [f64; 4],
    /// Rise of the board over the air by self-heating, K.
    pub board_heating_c: f64,
    /// Rise of each die over the board by self-heating, K, in the same order.
    pub die_heating_c: [f64; 4],
    /// Time since switch-on at the start of the recording, s. Infinity is warmed up.
    pub on_before_s: f64,
}

/// Temperatures at one instant, °C.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Temperatures {
    /// The board.
    pub board: f64,
    /// The dies: gyros x, y, z, then the accelerometer.
    pub die: [f64; 4],
}

/// State of the network.
///
/// Partial fractions make a cascade of two lags a weighted difference of two single ones, `1/((1+sa)(1+sb)) = (a/(1+sa) - b/(1+sb))/(a-b)`, each of
/// which [`LowPass`] discretises exactly. A chain of two filters would be exact for the board only, because the board's temperature is not linear
/// between the steps.
#[derive(Debug, Clone)]
pub struct Thermal {
    truth: ThermalTruth,
    dt_s: f64,
    board: LowPass,
    die: [Die; 4],
    started: bool,
}

#[derive(Debug, Clone, Copy)]
struct Die {
    /// Weights of the board's response and of the single lag's.
    of_board: f64,
    of_own: f64,
    /// Excess of the single lag's input over the board's: the die's own heat, divided by `of_own`.
    heat: f64,
    lag_s: f64,
    own: LowPass,
}

impl Thermal {
    /// A network that has been switched off at its first chamber temperature for a long time.
    pub fn new(truth: &ThermalTruth, dt_s: f64) -> Self {
        let a = truth.board_lag_s;
        let die = std::array::from_fn(|i| {
            // The fractions are undefined at equal lags. With lags that differ by a millionth, the error of the temperature is below a millionth.
            let b = truth.die_lag_s[i];
            let b = if (a - b).abs() < 1e-6 * a {
                b * (1.0 - 1e-6)
            } else {
                b
            };
            let (of_board, of_own) = (a / (a - b), -b / (a - b));
            Die {
                of_board,
                of_own,
                heat: truth.die_heating_c[i] / of_own,
                lag_s: b,
                own: LowPass::new(b, dt_s, 0.0),
            }
        });
        Self {
            truth: truth.clone(),
            dt_s,
            board: LowPass::new(a, dt_s, 0.0),
            die,
            started: false,
        }
    }

    /// Temperatures after the next step, when the chamber's air is at `chamber_c`; linear since the last step. The first call returns those at the
    /// start.
    pub fn step(&mut self, chamber_c: f64) -> Temperatures {
        let truth = &self.truth;
        let air = chamber_c + truth.board_heating_c;
        if !self.started {
            self.started = true;
            let on = truth.on_before_s;
            let cold = |lag: f64| (-on / lag).exp();
            let board = air - truth.board_heating_c * cold(truth.board_lag_s);
            // One step of constant input advances the state from one step before the start to the start.
            self.board
                .start(air, before(air, board, truth.board_lag_s, self.dt_s));
            for die in &mut self.die {
                let input = air + die.heat;
                let own = input - (truth.board_heating_c + die.heat) * cold(die.lag_s);
                die.own
                    .start(input, before(input, own, die.lag_s, self.dt_s));
            }
        }
        let board = self.board.step(air);
        let die = self
            .die
            .each_mut()
            .map(|d| d.of_board * board + d.of_own * d.own.step(air + d.heat));
        Temperatures { board, die }
    }
}

/// Output one step before `output`, at constant input.
fn before(input: f64, output: f64, lag_s: f64, dt_s: f64) -> f64 {
    input + (output - input) * (dt_s / lag_s).exp()
}
