//! Recordings that no curves can be estimated from: what is wrong with them, and what to do.

use mimu::quantity::{duration, significant};
use mimu::signal::blocks::extent;
use mimu_recording::{Argument, Error, Result, are_two_units};

use crate::basis::SLOPE_SPAN;
use crate::path::fastest;
use crate::profile::Lag;
use crate::session::Session;
use crate::warning::Warning;

/// Largest difference between die and thermometer, as a share of the range. Beyond it, a first-order lag with an error of a tenth shifts
/// curves by kelvins.
const BEHIND_SHARE: f64 = 0.25;

/// Temperatures farther apart than this, K, leave a gap: the change of the biases across it is a matter of curves, not of noise.
const GAP_K: f64 = 3.0;

/// Refuses recordings of two units, or of different readings.
pub fn check_alike(sessions: &[Session]) -> Result<()> {
    let Some(first) = sessions.first() else {
        return Err(Error::new(
            "recordings",
            "there is none",
            "give at least one",
        ));
    };
    for other in &sessions[1..] {
        let alike = match (&first.unit_id, &other.unit_id) {
            (Some(a), Some(b)) => a.eq_ignore_ascii_case(b),
            _ => !are_two_units(&first.device, &other.device),
        };
        if !alike {
            let problem = format!(
                "this recording belongs to {:?}, but {} belongs to {:?}: two units have two sets of curves",
                other.device, first.place, first.device
            );
            let remedy = "fit the recordings of each unit separately";
            return Err(Error::new(&other.place, problem, remedy));
        }
        if let (Some(a), Some(b)) = (&first.sensors, &other.sensors)
            && a != b
        {
            let problem = format!(
                "its sensors had another range or filter than those of {}",
                first.place
            );
            let remedy = "fit recordings with one setting together";
            return Err(Error::new(&other.place, problem, remedy));
        }
        if first.raw_unit != other.raw_unit || first.reference != other.reference {
            let problem = format!(
                "its readings are in {} with reference {:?}, but those of {} are in {} with reference {:?}",
                other.raw_unit, other.reference, first.place, first.raw_unit, first.reference
            );
            let remedy = "fit recordings of one kind together";
            return Err(Error::new(&other.place, problem, remedy));
        }
    }
    Ok(())
}

/// The temperatures of each session separately: after every power-on the biases differ, so only a single session shows their change over
/// temperature.
pub struct Spans {
    /// Lowest and highest temperature of each session, °C, sorted by the lower end.
    stretches: Vec<[f64; 2]>,
}

impl Spans {
    /// From the rows of `sessions`.
    pub fn of(sessions: &[Session]) -> Self {
        let of = |session: &Session| {
            let rows = session.rows.iter().flat_map(|(_, rows)| rows);
            extent(rows.map(|row| session.thermometer.at(row.middle_s).0))
        };
        let all = sessions.iter().map(of);
        let mut stretches: Vec<[f64; 2]> = all.filter(|[low, high]| low <= high).collect();
        stretches.sort_by(|a, b| a[0].total_cmp(&b[0]));
        Self { stretches }
    }

    /// Lowest and highest temperature of all, °C.
    pub fn range(&self) -> [f64; 2] {
        extent(self.stretches.iter().flatten().copied())
    }

    /// The widest of a session, °C.
    fn widest(&self) -> [f64; 2] {
        let span = |range: &&[f64; 2]| range[1] - range[0];
        let widest = self
            .stretches
            .iter()
            .max_by(|a, b| span(a).total_cmp(&span(b)));
        widest.copied().unwrap_or([f64::NAN; 2])
    }

    /// Temperatures between two sessions that no session crosses, °C.
    fn gaps(&self) -> Vec<[f64; 2]> {
        let mut gaps = Vec::new();
        let mut reached = f64::INFINITY;
        for [low, high] in &self.stretches {
            if low - reached > GAP_K {
                gaps.push([reached, *low]);
            }
            reached = if reached.is_finite() {
                reached.max(*high)
            } else {
                *high
            };
        }
        gaps
    }

    /// Refuses recordings in which no session shows a slope: the error compares the span of the column, of the dwells that are used, and of
    /// a single session.
    pub fn check(&self, sessions: &[Session], warnings: &mut Vec<Warning>) -> Result<()> {
        let words = |[low, high]: [f64; 2]| match low <= high {
            true => format!("{} K ({low:.1} to {high:.1} °C)", significant(high - low)),
            false => "nothing".to_string(),
        };
        let column = extent(sessions.iter().flat_map(|s| s.thermometer.range()));
        let (used, widest) = (self.range(), self.widest());
        let shows = |[low, high]: [f64; 2]| high - low >= SLOPE_SPAN;
        let needs = format!("a slope needs {SLOPE_SPAN} K, curvature 20 K");
        let (problem, remedy, declare) = if shows(widest) {
            warnings.extend(
                self.gaps()
                    .into_iter()
                    .map(|between_c| Warning::NotCrossed { between_c }),
            );
            return Ok(());
        } else if shows(used) {
            (
                format!(
                    "its dwells span {}, but at most {} within one recording, and each recording has separate biases: {needs}",
                    words(used),
                    words(widest)
                ),
                "heat or cool the unit in one recording, without switching it off",
                false,
            )
        } else if shows(column) {
            (
                format!(
                    "the column spans {}, but the dwells that are used span {}, because {}: {needs}",
                    words(column),
                    words(used),
                    sessions[0].unused
                ),
                "hold the unit still at more temperatures, or declare that it was at rest",
                true,
            )
        } else if column[0] == column[1] {
            let problem = match column[0] {
                0.0 => "it is exactly 0 in every row: there is no thermometer".to_owned(),
                c => format!(
                    "it is {c} °C in every row: the thermometer does not answer, or the value was typed in"
                ),
            };
            (
                problem,
                "record a thermometer near the sensors, or use `mimu fit`, which needs none",
                false,
            )
        } else {
            (
                format!("the column spans {} only: {needs}", words(column)),
                "heat or cool the unit further, or use `mimu fit`, which is for one temperature",
                false,
            )
        };
        let error = Error::undetermined(format!("{}, temp_c", sessions[0].place), problem, remedy);
        Err(match declare {
            true => error.about(Argument::AtRest).about(Argument::StillFactor),
            false => error,
        })
    }
}

/// Refuses a ramp in which the die is so far behind that a first-order lag decides everything.
pub fn check_speed(sessions: &[Session], lag: &Lag, span: f64) -> Result<()> {
    if !lag.is_determined() {
        return Ok(());
    }
    for session in sessions {
        let fastest = fastest(session);
        let behind = fastest * lag.value.abs();
        if behind > BEHIND_SHARE * span {
            let problem = format!(
                "the ramp of {} K/min is too fast: the dies differ from the thermometer by {} K because of their lag of {}",
                significant(fastest * 60.0),
                significant(behind),
                duration(lag.value.abs())
            );
            let slow = 0.4 * BEHIND_SHARE * span / lag.value.abs() * 60.0;
            let remedy = format!("heat and cool by at most {} K/min", significant(slow));
            return Err(Error::undetermined(&session.place, problem, remedy));
        }
    }
    Ok(())
}
