//! A plan over temperature in time: the chamber's temperatures, and when each round begins.

use mimu::plan::chamber;
use mimu::plan::{Plan, Planned};
use mimu_recording::error::{Error, Result};

/// Longest procedure, s. A longer plan probably has a wrong unit.
const LONGEST_S: f64 = 48.0 * 3600.0;

/// All rounds of a plan, and the chamber's temperatures.
#[derive(Debug, Clone, PartialEq)]
pub struct Procedure {
    /// Dwells and turns of all rounds.
    pub dwells: Vec<Planned>,
    /// Number of dwells and turns in a round.
    pub per_round: usize,
    /// Number of rounds.
    pub rounds: usize,
    /// Temperature of the chamber, s and °C: interpolated linearly, constant before the first and after the last point.
    pub chamber_c: Vec<[f64; 2]>,
    /// Time before the first round, s.
    pub lead_in_s: f64,
    /// Interval between the starts of successive rounds, s. If `None`, each round follows at once.
    pub round_s: Option<f64>,
}

impl Procedure {
    /// The dwells of a plan, the chamber's temperatures and when each round is due; `place` is the plan's path.
    pub fn of(plan: &Plan, gravity_mps2: f64, place: &str) -> Result<Self> {
        let dwells = plan.dwells(gravity_mps2, place)?;
        let rounds = plan.rounds as usize;
        Self {
            per_round: dwells.len() / rounds,
            dwells,
            rounds,
            chamber_c: plan.chamber_c.clone(),
            lead_in_s: plan.lead_in_s,
            round_s: plan.round_s,
        }
        .checked(place)
    }

    fn checked(self, place: &str) -> Result<Self> {
        let at = |key: &str| format!("{place}, {key}");
        if self.chamber_c.is_empty() {
            let problem = "the plan has no temperatures (chamber_c)";
            let remedy = "make one with `mimu thermal plan`; `mimu record` records a plan at one temperature";
            return Err(Error::new(place, problem, remedy));
        }
        let times = || self.chamber_c.iter().map(|p| p[0]);
        let in_order = times().zip(times().skip(1)).all(|(a, b)| a < b);
        if !(in_order && times().all(|t| t.abs() <= LONGEST_S)) {
            let problem = "the times are not in order, or beyond 48 h";
            let remedy = "write [time in s, °C] in order of time";
            return Err(Error::new(at("chamber_c"), problem, remedy));
        }
        let absurd = |p: &&[f64; 2]| !(-100.0..=200.0).contains(&p[1]);
        if let Some([t, c]) = self.chamber_c.iter().find(absurd) {
            let problem = format!("{c} °C at {t} s");
            let remedy = "write -100 to 200 degrees Celsius";
            return Err(Error::new(at("chamber_c"), problem, remedy));
        }
        let times_s = [self.lead_in_s, self.round_s.unwrap_or(0.0)];
        if !times_s.iter().all(|s| (0.0..=LONGEST_S).contains(s)) {
            let problem = "no time from 0 to 48 h";
            return Err(Error::new(
                at("lead_in_s or round_s"),
                problem,
                "write seconds",
            ));
        }
        Ok(self)
    }

    /// Planned temperature of the chamber, °C.
    pub fn temp_c(&self, t_s: f64) -> f64 {
        chamber::temp_c(&self.chamber_c, t_s)
    }

    /// Lowest and highest temperature, °C.
    pub fn range_c(&self) -> [f64; 2] {
        let all = self.chamber_c.iter().map(|p| p[1]);
        let (low, high) = (f64::INFINITY, f64::NEG_INFINITY);
        [all.clone().fold(low, f64::min), all.fold(high, f64::max)]
    }

    /// Steepest ramp, K/min.
    pub fn steepest_c_per_min(&self) -> f64 {
        let each = self.chamber_c.windows(2);
        let slopes = each.map(|w| (w[1][1] - w[0][1]).abs() / (w[1][0] - w[0][0]) * 60.0);
        slopes.fold(0.0, f64::max)
    }

    /// Earliest start of a dwell, s: the first dwell of a round waits for it.
    pub fn due_s(&self, dwell: usize) -> f64 {
        match self.round_s {
            Some(round_s) => self.lead_in_s + (dwell / self.per_round) as f64 * round_s,
            None => self.lead_in_s,
        }
    }

    /// Whether all dwells have one pose, at rest.
    pub fn is_at_rest(&self) -> bool {
        let first = &self.dwells[0];
        let same = |d: &Planned| d.turn.is_none() && d.rate_dps == 0.0 && d.up == first.up;
        self.dwells.iter().all(same)
    }
}
