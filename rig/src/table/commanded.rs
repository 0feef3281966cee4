//! A table under command, move by move.

use super::controller::Controller;
use super::{Table, TableTruth};
use crate::command::{Command, Commanded, Position};
use crate::plan::{Plan, Step};

impl Table {
    /// The table `truth` at rest in the first pose of `plan`, whose steps it does not carry out. Commands during the lead-in wait for its end.
    pub fn commanded(plan: &Plan, truth: &TableTruth) -> Result<Self, String> {
        truth.check()?;
        let controller = Controller::standing(plan, truth).map_err(|e| plan.beyond(&e))?;
        Ok(Self::driven(controller, f64::INFINITY, plan, truth))
    }
}

impl Table {
    fn turn(&mut self, t_s: f64, rate: f64, spin: f64) -> Result<(), String> {
        let (up, _) = self.controller.position(t_s);
        let mut step = Step::commanded(up, None, 0.0);
        (step.rate, step.spin) = (rate, spin);
        self.check(&step)?;
        self.controller.turn(t_s, [rate, spin]);
        Ok(())
    }

    fn check(&self, step: &Step) -> Result<(), String> {
        let limits = &self.controller.limits;
        limits
            .check(step)
            .map_err(|beyond| format!("{}; {}", beyond.problem, beyond.remedy))
    }
}

impl Commanded for Table {
    fn command(&mut self, t_s: f64, command: Command) -> Result<(), String> {
        let [rate, spin] = self.controller.rates;
        match command {
            Command::Move { up, heading } => {
                self.check(&Step::commanded(up, heading, 0.0))?;
                self.controller.go(t_s, up, heading);
            }
            Command::Rate(rate) => self.turn(t_s, rate, spin)?,
            Command::Spin(spin) => self.turn(t_s, rate, spin)?,
            Command::Turn(turn) => {
                let done = self.controller.turn_from(t_s, turn);
                done.map_err(|(problem, remedy)| format!("{problem}; {remedy}"))?;
            }
            Command::Stop => self.controller.halt(t_s),
            Command::Fidget(_) | Command::Hold(_) => {
                return Err("the unit is on a table; serve a bench by hand".into());
            }
        }
        self.still = None;
        Ok(())
    }

    fn busy(&self, t_s: f64) -> bool {
        t_s < self.controller.busy_s
    }

    fn position(&self, t_s: f64) -> Position {
        let (up, heading) = self.controller.position(t_s);
        Position {
            up,
            heading: Some(heading),
        }
    }
}
