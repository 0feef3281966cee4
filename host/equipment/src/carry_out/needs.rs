//! Checks that the drivers can carry out a procedure. Everything is refused here, before anything moves.

use mimu_device::record::Procedure;
use mimu_recording::error::{Argument, Error, Result};

use crate::drive::{Abilities, Driver};

/// Drivers that can carry out the procedure.
pub struct Equipped {
    pub(super) drivers: Vec<Box<dyn Driver>>,
    /// Indices of the driver that moves the unit and of the one with the chamber.
    pub(super) table: Option<usize>,
    pub(super) chamber: Option<usize>,
    /// Temperature in the chamber, °C, if it can be read.
    pub(super) chamber_c: Option<f64>,
}

impl Equipped {
    /// Refuses a procedure that these drivers cannot carry out; `place` is its plan. Without drivers a person changes the temperature of a unit at
    /// rest.
    pub fn new(
        procedure: &Procedure,
        place: &str,
        mut drivers: Vec<Box<dyn Driver>>,
    ) -> Result<Self> {
        let abilities: Vec<Abilities> = drivers.iter().map(|d| d.abilities()).collect();
        let table = only(&abilities, |a| a.moves, "`move`")?;
        let chamber = only(&abilities, |a| a.chamber.is_some(), "[chamber]")?;
        let given = |lacking: &str| match abilities.as_slice() {
            [] => format!("the plan {lacking}, but no driver is given"),
            [one] => format!("the plan {lacking}, but {} has none", one.place),
            all => {
                let names: Vec<&str> = all.iter().map(|a| a.place.as_str()).collect();
                format!(
                    "the plan {lacking}, but none of {} has one",
                    names.join(", ")
                )
            }
        };
        match table.map(|k| &abilities[k]) {
            Some(table) => check_table(procedure, place, table)?,
            None if procedure.is_at_rest() => {}
            None => {
                let problem = given("moves the unit, which needs a table (`move`)");
                let remedy = "give the driver file of a table";
                return Err(Error::new(place, problem, remedy).about(Argument::Driver));
            }
        }
        match chamber.map(|k| &abilities[k]) {
            Some(chamber) => check_chamber(procedure, place, chamber)?,
            None if drivers.is_empty() => {}
            None => {
                let problem = given("has temperatures, which need a chamber ([chamber])");
                let remedy = "give the driver file of a chamber";
                return Err(Error::new(place, problem, remedy).about(Argument::Driver));
            }
        }
        let chamber_c = match chamber {
            Some(k) => drivers[k].chamber_c()?,
            None => None,
        };
        for (driver, ability) in drivers.iter_mut().zip(&abilities) {
            if let Some(why) = driver.interlock()? {
                return Err(Error::device(&ability.place, why, "close it"));
            }
        }
        Ok(Self {
            drivers,
            table,
            chamber,
            chamber_c,
        })
    }

    /// Whether a table moves the unit, so that the input is known.
    pub fn has_table(&self) -> bool {
        self.table.is_some()
    }

    /// Whether a chamber is driven.
    pub fn has_chamber(&self) -> bool {
        self.chamber.is_some()
    }

    /// Rest temperature of the chamber, °C.
    pub(super) fn rest_c(&self) -> Option<f64> {
        let chamber = self.drivers[self.chamber?].abilities().chamber;
        chamber.map(|c| c.rest_c)
    }
}

/// The only driver with this ability; with two the choice would be ambiguous.
fn only(
    abilities: &[Abilities],
    has: impl Fn(&Abilities) -> bool,
    what: &str,
) -> Result<Option<usize>> {
    let mut all = (0..abilities.len()).filter(|k| has(&abilities[*k]));
    match (all.next(), all.next()) {
        (Some(first), Some(second)) => {
            let problem = format!("{} has {what} too", abilities[first].place);
            let remedy = "give one of the two, or leave that part out of one file";
            Err(Error::new(&abilities[second].place, problem, remedy))
        }
        (first, _) => Ok(first),
    }
}

fn check_table(procedure: &Procedure, place: &str, table: &Abilities) -> Result<()> {
    for (k, dwell) in procedure.dwells.iter().enumerate() {
        let at = format!("{place}, dwell {k}");
        let lacks = |what: &str, remedy: String| {
            let problem = format!("{what}, but {} lacks the command", table.place);
            Err(Error::new(&at, problem, remedy))
        };
        let within = |beyond: Option<String>| match beyond {
            Some(what) => {
                let problem = format!("{what} of {}", table.place);
                let remedy = "plan within what the table does, or correct [limits]";
                Err(Error::new(&at, problem, remedy))
            }
            None => Ok(()),
        };
        let Some(up) = dwell.up else {
            let problem = "the plan leaves the pose open, but a table needs one";
            return Err(Error::new(&at, problem, "write up = [x, y, z]"));
        };
        let limits = table.limits;
        let tilt = |up: [f64; 3]| up[0].hypot(up[1]).atan2(up[2]).to_degrees();
        within(limits.beyond(dwell.rate_dps, tilt(up), 0.0))?;
        if dwell.rate_dps != 0.0 && !table.rates {
            return lacks("it turns at a rate", "add `rate` to the driver file".into());
        }
        if let Some(turn) = &dwell.turn {
            let middle = tilt(turn.from_up).max(turn.to_deg[0].abs());
            within(limits.beyond(0.0, middle, turn.rate_dps))?;
            if !table.turns.contains(&turn.axis) {
                let name = turn.axis.name();
                let what = format!("the {name} axis turns by an angle");
                return lacks(&what, format!("add `turn.{name}` to the driver file"));
            }
        }
    }
    Ok(())
}

fn check_chamber(procedure: &Procedure, place: &str, chamber: &Abilities) -> Result<()> {
    let Some(limits) = chamber.chamber else {
        return Ok(());
    };
    let at = format!("{place}, chamber_c");
    let [low, high] = procedure.range_c();
    let remedy = "plan within what the chamber does, or correct [chamber]";
    if low < limits.from_c || high > limits.to_c {
        let problem = format!(
            "{low} to {high} °C, but the chamber of {} has {} to {}",
            chamber.place, limits.from_c, limits.to_c
        );
        return Err(Error::new(at, problem, remedy));
    }
    let ramp = procedure.steepest_c_per_min();
    match limits.c_per_min {
        // Times in a plan are rounded to a millisecond.
        Some(limit) if ramp > limit * (1.0 + 1e-3) => {
            let problem = format!(
                "a ramp of {ramp:.2} K/min, but the chamber of {} has c_per_min = {limit}",
                chamber.place
            );
            Err(Error::new(at, problem, remedy))
        }
        _ => Ok(()),
    }
}
