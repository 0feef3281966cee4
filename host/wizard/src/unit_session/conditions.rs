//! Conditions of a dwell: samples arrive, the unit is at rest or turns steadily, and pose and rate are those of the requested dwell.

use mimu::quantity::{Sensor, significant};
use mimu_recording::health::{Fault, Finding, accel_at_rest};
use mimu_recording::{Argument, Error, RawUnit, Result};
use nalgebra::Vector3;

use super::{Round, UnitSession};
use crate::event::Event;
use crate::procedure::{Fixture, SAME_POSE_DEG, SessionConfig};
use crate::waiting::Waiting;
use crate::watch::LastSecond;
use mimu_equipment::step::Step;

/// Largest fraction of missing samples in a second: if only means are used, and if turns are integrated too.
const LOST_SHARE: [f64; 2] = [0.5, 0.1];
/// Accepted relative difference from the requested rate: sensitivities differ from the data sheet's by a few per cent.
const RATE_SHARE: f64 = 0.2;
/// Accepted difference at any rate, deg/s: noise and drift of the null.
const RATE_DPS: f64 = 2.0;

/// Ratio of the angles by gyro and accelerometer that no turn by hand gives, but another unit does: deg/s for rad/s is 57.
const UNIT_RATIO: f64 = 10.0;
/// Turn of the direction of gravity in a second that counts, rad.
const LEAST_TILT: f64 = 0.1;
/// Turns of the direction of gravity after which they are compared, rad: less than a quarter turn, because in shaking hands no dwell may begin after it.
const ENOUGH_TILT: f64 = 1.0;
/// If this many consecutive turns, and more than half of all, lack samples or leave the gyro's range, the next ones will too: the gyro cannot be calibrated this way.
const LOST_IN_A_ROW: u32 = 4;
/// Change of the gyro's rates at rest that no power-on makes, rad/s (1 deg/s: low-cost parts change by some tenths), and in multiples of their scatter.
const OTHER_UNIT: (f64, f64) = (0.0175, 6.0);
/// Time at rest with an axis of the accelerometer at the end of its range, s: a bump is over sooner.
const AT_END_S: f64 = 10.0;

impl UnitSession {
    /// Why no dwell can run now, if so.
    pub(super) fn waits(
        &self,
        seen: &LastSecond,
        config: &SessionConfig,
        step: &Step,
        busy: bool,
    ) -> Option<Waiting> {
        let rate_hz = self.station.unit.rate_hz;
        let share = LOST_SHARE[usize::from(config.fixture != Fixture::Table)];
        if busy {
            return Some(Waiting::TableMoves);
        }
        // A channel that clips has one value, and looks stuck.
        let clips = seen
            .saturated
            .filter(|end| seen.stuck.is_none_or(|s| s.about == end.about));
        if let Some(found) = clips.or(seen.stuck) {
            return Some(Waiting::Faulty(found));
        }
        if seen.missing as f64 > share * rate_hz {
            return Some(Waiting::SamplesLost(seen.missing, rate_hz));
        }
        if seen.exchanged && !self.station.unit.is_device && !self.spins() {
            return Some(Waiting::Faulty(Finding::of_all(0, Fault::Exchanged)));
        }
        let limits = motion_limits(step.rate_dps);
        for sensor in Sensor::BOTH {
            let motion = seen.motion[sensor as usize];
            if motion > limits[sensor as usize] {
                return Some(match step.rate_dps {
                    0.0 => Waiting::Moves(sensor, motion),
                    _ => Waiting::Unsteady(sensor, motion),
                });
            }
        }
        None
    }

    /// Reports a rate that differs from the requested one.
    pub(super) fn turns_otherwise(&self, seen: &LastSecond, step: &Step) -> Option<Waiting> {
        let rate = self.rate(seen)?;
        let off = (rate - step.rate()).norm().to_degrees();
        (off > rate_limit_dps(step.rate_dps)).then(|| match step.rate_dps {
            0.0 => Waiting::Turns(off),
            wanted => Waiting::OtherRate(rate.dot(&step.up()).to_degrees(), wanted),
        })
    }

    /// The dwell that matches this pose: the requested one or, if a person turns the unit and no dwell runs yet, one of the others to come.
    pub(super) fn pose(
        &self,
        up: &Vector3<f64>,
        round: &Round<'_>,
        step: &Step,
        begins: bool,
    ) -> std::result::Result<Step, Waiting> {
        let config = round.config;
        let off = |s: &Step| up.angle(&s.up()).to_degrees();
        let limit = config.fixture.tolerance_deg();
        let by_hand = config.fixture != Fixture::Table;
        // By hand any pose is recorded that differs from the earlier ones.
        let as_it_is = |s: &Step| match by_hand {
            true => Step::at_rest(*up, s.dwell_s),
            false => *s,
        };
        let had = self.folder.dwells(self.part);
        let near = |d: &Step| off(d) < SAME_POSE_DEG;
        // Between equal poses there is a turn only if the unit was turned away in between, also across parts. An earlier pose may be requested again.
        let same = by_hand
            && !self.away
            && self
                .folder
                .last_dwell()
                .is_some_and(|step| off(&step) < SAME_POSE_DEG);
        let again = same || by_hand && off(step) > limit && had.iter().any(|d| near(&d.1));
        if off(step) <= limit && !again {
            return Ok(as_it_is(step));
        }
        if begins && round.any_order && !again {
            let nearest = round
                .others
                .iter()
                .filter(|s| s.rate_dps == step.rate_dps && off(s) <= limit);
            let nearest = nearest.min_by(|a, b| off(a).total_cmp(&off(b)));
            if let Some(other) = nearest {
                return Ok(as_it_is(other));
            }
            if config.fixture == Fixture::Hands {
                return Ok(as_it_is(step));
            }
        }
        Err(match again {
            true => Waiting::RepeatedPose(*up, step.up()),
            false => Waiting::WrongPose(*up, off(step)),
        })
    }
}

impl UnitSession {
    /// Rate, rad/s, relative to the gyro's reading at rest or, if that is less, by the calibration so far. The reading at rest may have been measured
    /// in motion, and the bias may have changed since the calibration. `None` while the scale is unknown.
    pub(super) fn rate(&self, seen: &LastSecond) -> Option<Vector3<f64>> {
        let nominal = self.nominal.as_ref()?;
        let by_rest = self.watch.rate(seen, &nominal[0]);
        if !self.calibrated {
            return Some(by_rest);
        }
        let by_fit = nominal[0].apply(&Vector3::from_fn(|c, _| seen.mean[c]));
        Some(match by_fit.norm() < by_rest.norm() {
            true => by_fit,
            false => by_rest,
        })
    }

    /// Refuses readings that are declared as SI but are not.
    pub(super) fn check_unit(&self, seen: &LastSecond, config: &SessionConfig) -> Result<()> {
        let size = Vector3::from_fn(|k, _| seen.mean[3 + k]).norm();
        let in_si = self.station.unit.raw_unit == RawUnit::Si;
        let found = in_si.then(|| accel_at_rest(size, config.gravity_mps2));
        let Some(found) = found.flatten() else {
            return Ok(());
        };
        let problem = format!("accel: {}", found.problem());
        let remedy =
            "let the board write m/s², or declare the readings as counts, which may have any unit";
        Err(Error::device(self.name(), problem, remedy).about(Argument::RawUnit))
    }

    /// Compares the angle by which the direction of gravity turns with the gyro's, if readings are declared as SI.
    ///
    /// Errors: the gyro's is so different that its unit is another one. In hands no dwell would ever begin, because the tremor is read as a turn.
    pub(super) fn compare_units(&mut self, seen: &LastSecond, up: &Vector3<f64>) -> Result<()> {
        if self.station.unit.raw_unit != RawUnit::Si || self.calibrated {
            return Ok(());
        }
        let Some(rate) = self.rate(seen) else {
            return Ok(());
        };
        let Some(ratio) = self.tilts.take(seen, up, &rate, self.station.unit.rate_hz) else {
            return Ok(());
        };
        let as_if = match ratio {
            r if (1.0 / UNIT_RATIO..UNIT_RATIO).contains(&r) => return Ok(()),
            r if (r.to_radians() - 1.0).abs() < 0.5 => ", as if it were in deg/s",
            _ => "",
        };
        let problem = format!(
            "the gyro turns {} times as far as the accelerometer sees{as_if}",
            significant(ratio)
        );
        let remedy =
            "let the board write rad/s, or declare the readings as counts, which may have any unit";
        Err(Error::device(self.name(), problem, remedy).about(Argument::RawUnit))
    }

    /// Counts turns that cannot calibrate the gyro, by the samples that are missing and at the end of a range in the turn before the completed dwell: all
    /// samples of a turn are integrated.
    ///
    /// Errors: too many in a row cannot.
    pub(super) fn count_turn(
        &mut self,
        [missing, clipped]: [u64; 2],
        tell: &mut Vec<Event>,
    ) -> Result<()> {
        self.turns = self.turns.with([missing > 0, clipped > 0]);
        if missing > 0 {
            let words = format!(
                "{}: the turn to it lacks {missing} samples and is not used for the gyro",
                self.name()
            );
            tell.push(Event::Note { words });
        }
        if clipped > 0 {
            let words = format!(
                "{}: in the turn to it {} at the end of a range: turn it more slowly, or give the gyro a larger range; such a turn is not used for it",
                self.name(),
                match clipped {
                    1 => "1 sample is".into(),
                    many => format!("{many} samples are"),
                }
            );
            tell.push(Event::Note { words });
        }
        let Turns {
            all,
            lost: [missing, clipped],
            in_a_row,
        } = self.turns;
        if in_a_row < LOST_IN_A_ROW || 2 * missing.max(clipped) <= all {
            return Ok(());
        }
        if clipped > missing {
            let problem = format!(
                "the gyro is at the end of its range in {clipped} of {all} turns, and only turns within it calibrate the gyro"
            );
            let remedy = "turn the unit more slowly, or set a larger range on the board";
            return Err(Error::device(self.name(), problem, remedy));
        }
        let share = self.state.lost as f64 / (self.state.lost + self.state.samples) as f64;
        let problem = format!(
            "samples are missing in {missing} of {all} turns ({} % of all samples), and only complete turns calibrate the gyro",
            significant(100.0 * share)
        );
        let remedy = "let the board write fewer or shorter lines, or use more bits per second; check the cable";
        Err(Error::device(self.name(), problem, remedy).about(Argument::Baud))
    }

    /// Ends the session if the gyro rests at another level since the line came back than before.
    ///
    /// Errors: the unit, which has no number, is another one.
    pub(super) fn check_unit_is_same(&self) -> Result<()> {
        let (Some(at), Some([gyro, _])) = (self.lost_at, &self.fitted) else {
            return Ok(());
        };
        let si = |raw: &Vector3<f64>| gyro.inverse.matrix * raw;
        let (before, after) = self.levels.split_at(at);
        let mean = |of: &[Vector3<f64>]| of.iter().map(si).sum::<Vector3<f64>>() / of.len() as f64;
        if before.len() < 2 || after.is_empty() {
            return Ok(());
        }
        let level = mean(before);
        let squares = before.iter().map(|raw| (si(raw) - level).norm_squared());
        let scatter = (squares.sum::<f64>() / (before.len() - 1) as f64).sqrt();
        let jump = (mean(after) - level).norm();
        if jump < OTHER_UNIT.0 || jump < OTHER_UNIT.1 * scatter {
            return Ok(());
        }
        let problem = format!(
            "since the line came back after dwell {at}, the gyro reads {} deg/s more at rest, which no power-on changes: it is another unit",
            significant(jump.to_degrees())
        );
        let remedy =
            "plug in one unit for the whole session, and start a new one in another folder";
        Err(Error::device(self.name(), problem, remedy))
    }

    /// Ends the session if the accelerometer is at the end of its range where the unit rests: no other pose is better for that axis.
    ///
    /// Errors: it has been so for [`AT_END_S`] in all.
    pub(super) fn check_range(&mut self, seen: &LastSecond, why: &Waiting) -> Result<()> {
        let Waiting::Faulty(Finding {
            about: Some(axis),
            fault: Fault::AtEnd,
            ..
        }) = why
        else {
            return Ok(());
        };
        let rests = seen.motion[Sensor::Gyro as usize] <= motion_limits(0.0)[0];
        if !rests || !axis.starts_with(Sensor::Accel.name()) {
            return Ok(());
        }
        let passed = seen
            .tick
            .saturating_sub(self.at_end.map_or(seen.tick, |(last, _)| last));
        let period_s = 1.0 / self.station.unit.rate_hz;
        // Looks at a unit are tenths of a second apart.
        let passed_s = (passed as f64 * period_s).min(0.2);
        let lasted_s = passed_s + self.at_end.map_or(0.0, |(_, lasted_s)| lasted_s);
        self.at_end = Some((seen.tick, lasted_s));
        if lasted_s < AT_END_S {
            return Ok(());
        }
        let problem = format!(
            "{axis} is at the end of its range where the unit rests, so that gravity is not read"
        );
        let remedy = "set a larger range of the accelerometer on the board, and start a new session in another folder";
        Err(Error::device(self.name(), problem, remedy))
    }
}

/// Turns of the direction of gravity, second by second.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Tilts {
    /// Tick, and direction up, of the last second used.
    last: Option<(u64, Vector3<f64>)>,
    /// Angles by the gyro and by the accelerometer, rad.
    angles: [f64; 2],
}

impl Tilts {
    /// Adds a second, unless it overlaps the last one. Returns the gyro's angle over the accelerometer's, once there are enough turns.
    fn take(
        &mut self,
        seen: &LastSecond,
        up: &Vector3<f64>,
        rate: &Vector3<f64>,
        rate_hz: f64,
    ) -> Option<f64> {
        let Some((tick, before)) = self.last else {
            self.last = Some((seen.tick, *up));
            return None;
        };
        let passed_s = seen.tick.saturating_sub(tick) as f64 / rate_hz;
        if passed_s < 1.0 {
            return None;
        }
        self.last = Some((seen.tick, *up));
        let tilt = up.angle(&before);
        // Smaller ones are tremor, and after a gap the turn is unknown.
        if passed_s > 1.5 || tilt < LEAST_TILT {
            return None;
        }
        self.angles[0] += passed_s * rate.cross(up).norm();
        self.angles[1] += tilt;
        (self.angles[1] > ENOUGH_TILT).then(|| self.angles[0] / self.angles[1])
    }
}

/// Statistics of the turns between dwells by hand.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Turns {
    all: u32,
    /// Turns with missing samples, and those with samples at the end of a range.
    lost: [u32; 2],
    /// Consecutive turns with either.
    in_a_row: u32,
}

impl Turns {
    fn with(self, lost: [bool; 2]) -> Self {
        Self {
            all: self.all + 1,
            lost: [0, 1].map(|k| self.lost[k] + u32::from(lost[k])),
            in_a_row: if lost.contains(&true) {
                self.in_a_row + 1
            } else {
                0
            },
        }
    }
}

/// Accepted motion of gyro and accelerometer at a rate. The unsteadiness of a table's rate does not count as motion.
pub(super) fn motion_limits(rate_dps: f64) -> [f64; 2] {
    [if rate_dps != 0.0 { 5.0 } else { 1.0 }, 1.0]
}

/// Accepted difference from a rate, deg/s.
pub(super) fn rate_limit_dps(rate_dps: f64) -> f64 {
    RATE_SHARE * rate_dps.abs() + RATE_DPS
}
