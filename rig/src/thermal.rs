//! Temperatures of the board and of the dies on it: chamber air → board → die, one heat capacity each.

use crate::filter::LowPass;

/// The thermal network. Temperatures in °C, times in s.
///
/// `lag T' + T = temperature of what it sits on + heating`: the heating is the rise in still air of a part
/// that is switched on.
#[derive(Debug, Clone, PartialEq)]
pub struct ThermalTruth {
    /// Lag of the board behind the chamber's air, s.
    pub board_lag_s: f64,
    /// Lag of each die behind the board, s: gyros x, y, z, then the accelerometer.
    pub die_lag_s: [f64; 4],
    /// Rise of the board over the air by its own power, K.
    pub board_heating_c: f64,
    /// Rise of each die over the board by its own power, K, in the same order.
    pub die_heating_c: [f64; 4],
    /// Switched on so long before the recording begins, s. Infinity is warmed up.
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
/// Partial fractions make a cascade of two lags a weighted difference of two single ones, `1/((1+sa)(1+sb)) =
/// (a/(1+sa) - b/(1+sb))/(a-b)`, each of which [`LowPass`] discretises exactly. A chain of two filters would
/// be exact for the board only: the board's temperature is not straight between the steps.
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
    /// What the single lag's input has above the board's: the die's own heat, through `of_own`.
    heat: f64,
    lag_s: f64,
    own: LowPass,
}

impl Thermal {
    /// A network that takes its first chamber temperature as the one at which it has stood, switched off,
    /// since long ago.
    pub fn new(truth: &ThermalTruth, dt_s: f64) -> Self {
        let a = truth.board_lag_s;
        let die = std::array::from_fn(|i| {
            // At equal lags the fractions have no value; a millionth apart, the temperature is off by less
            // than that.
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

    /// Temperatures one step on, where the chamber's air is at `chamber_c`; straight since the last step. The
    /// first call gives those at the start.
    pub fn step(&mut self, chamber_c: f64) -> Temperatures {
        let truth = &self.truth;
        let air = chamber_c + truth.board_heating_c;
        if !self.started {
            self.started = true;
            let on = truth.on_before_s;
            let cold = |lag: f64| (-on / lag).exp();
            let board = air - truth.board_heating_c * cold(truth.board_lag_s);
            // One step of constant input brings the state from a step before the start to the start.
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
