//! One of the units of a session: its samples, and its dwells.

mod conditions;
mod rows;
mod spins;

use mimu::signal::increment::is_bridged;
use mimu::signal::stillness::GUARD_S;
use mimu::{Fit, Sensor, Triad};
use mimu_core::compensation::Affine;
use mimu_recording::error::{Argument, Error, Result};
use mimu_recording::{ClockRate, Columns, Manifest, REPORTED_SHARE, Recorded, TriadName};
use nalgebra::Vector3;

use self::conditions::{Tilts, Turns, motion_limits, rate_limit_dps};
use self::rows::{Pending, known};
use self::spins::Spinning;
use crate::axes;
use crate::compass::Compass;
use crate::event::{Event, UnitState};
use crate::folder::{Entry, Folder, OpenRecording, Part};
use crate::procedure::{Fixture, SessionConfig};
use crate::refit::{Parameter, Progress, calibrate, progress};
use crate::source::{Chunk, SourceEvent};
use crate::station::Station;
use crate::text::refuse_clock;
use crate::waiting::{Interruption, Waiting};
use crate::watch::{LastSecond, Watch, force, guessed};
use mimu_equipment::step::Step;

/// A dwell includes this much of the second in which it was detected, s: the unit was at rest then too.
const BEFORE_S: f64 = 0.5;
/// A dwell that ends earlier than this counts as not begun, s.
const BEGUN_S: f64 = 0.5;
/// Samples kept between two dwells, s: a turn takes seconds.
const KEPT_S: f64 = 120.0;
/// The same for whole turns, s: with rests in between, somebody may take minutes.
const KEPT_SPIN_S: f64 = 900.0;

/// Largest half-width, in multiples of its target, with which the calibration is used to find up: 20 mrad.
const KNOWN: f64 = 20.0;

/// Largest half-width of the axes' angles with which axes of gyro and accelerometer can be compared, µrad (6 degrees).
const AXES_KNOWN: f64 = 1e5;

/// Angle from the last pose, degrees, from which on the unit was turned away: in motion an accelerometer errs by some degrees.
const AWAY_DEG: f64 = 30.0;

/// If this many consecutive fits are refused for another reason than too few dwells, the session cannot succeed.
const REFUSED: u32 = 4;
/// Number of dwells from which [`REFUSED`] applies.
const REFUSED_FROM: i32 = 10;

/// The running dwell.
#[derive(Debug, Clone, Copy)]
struct Dwell {
    step: Step,
    from: u64,
    /// Missing samples. The dwell is extended by as many, because a fit counts the received ones.
    missing: u64,
}

impl Dwell {
    /// Tick after its last sample, at this rate.
    fn to(&self, rate_hz: f64) -> u64 {
        self.from + (self.step.dwell_s * rate_hz).round() as u64 + self.missing
    }
}

/// Inputs of one look at a unit.
#[derive(Debug, Clone, Copy)]
pub struct Round<'a> {
    /// Settings of the session.
    pub config: &'a SessionConfig,
    /// The requested dwell.
    pub step: Option<&'a Step>,
    /// Dwells that follow.
    pub others: &'a [Step],
    /// Whether the table still moves.
    pub busy: bool,
    /// Whether another pose may be recorded first; only a person can do that.
    pub any_order: bool,
}

/// One of the units of a session.
pub struct UnitSession {
    /// The unit and its line.
    pub station: Station,
    /// Its folder.
    pub folder: Folder,
    /// The recording in progress.
    pub recording: Option<OpenRecording>,
    /// The calibration so far, with its targets.
    pub progress: Progress,
    /// State of the unit.
    pub state: UnitState,
    /// Whether it has completed the requested dwell.
    pub done: bool,
    watch: Watch,
    compass: Compass,
    /// Model raw to SI: from the data sheet, estimated from gravity, or the calibration so far.
    nominal: Option<[Affine<f64>; 2]>,
    /// Whether it is the calibration so far.
    calibrated: bool,
    /// Gyro and accelerometer by the last fit.
    fitted: Option<[Triad; 2]>,
    /// The whole turns that are asked for.
    spin: Option<Spinning>,
    /// Turns by the gyro and by the accelerometer, for their units.
    tilts: Tilts,
    pending: Pending,
    next: Option<u64>,
    /// Cause of a restart after which no sample has come yet.
    restarted: Option<String>,
    /// Time of power-on by the clock of the recordings, s.
    power_on_s: Option<f64>,
    dwell: Option<Dwell>,
    /// Whether it was turned since the dwell was requested.
    moved: bool,
    /// Whether it was turned away from the last pose.
    away: bool,
    /// Why the dwells so far cannot give a calibration.
    hopeless: Option<Error>,
    /// Missing samples since the last dwell, and statistics of the turns so far.
    turn_missing: u64,
    turns: Turns,
    /// Samples at a rail since the last dwell.
    turn_clipped: u64,
    /// Last tick at which an axis of the accelerometer was at the end of its range at rest, and for how long it has been so in all, s.
    at_end: Option<(u64, f64)>,
    /// Gyro's mean readings in the dwells, raw.
    levels: Vec<Vector3<f64>>,
    /// Number of dwells before the line of a unit without a number was last lost.
    lost_at: Option<usize>,
    /// The clock of the samples by the best comparison with this computer's.
    pub clock: Option<ClockRate>,
    /// Consecutive refused fits for another reason than too few dwells.
    refused: u32,
    seen: Option<LastSecond>,
    part: Part,
    number: i32,
}

/// Why the unit has begun anew, if this event says so.
fn restart(news: &SourceEvent) -> Option<String> {
    match news {
        SourceEvent::Restarted(why) => Some(why.clone()),
        // Most boards have their supply from the same cable, and do not tell of a power-on.
        SourceEvent::Back(unit) if !unit.is_device => Some("the line came back".into()),
        _ => None,
    }
}

impl UnitSession {
    /// A unit with its folder.
    pub fn new(station: Station, folder: Folder, config: &SessionConfig) -> Self {
        let unit = &station.unit;
        Self {
            watch: Watch::new(unit.rate_hz, config.fixture != Fixture::Table),
            compass: Compass::default(),
            nominal: unit.nominal,
            calibrated: false,
            fitted: None,
            spin: None,
            tilts: Tilts::default(),
            state: UnitState {
                unit: unit.name.clone(),
                tilt_limit_deg: config.fixture.tolerance_deg(),
                ..UnitState::default()
            },
            station,
            folder,
            recording: None,
            progress: Progress::default(),
            done: false,
            pending: Pending::default(),
            next: None,
            restarted: None,
            power_on_s: None,
            dwell: None,
            moved: false,
            away: false,
            hopeless: None,
            turn_missing: 0,
            turn_clipped: 0,
            turns: Turns::default(),
            at_end: None,
            levels: Vec::new(),
            lost_at: None,
            clock: None,
            refused: 0,
            seen: None,
            part: Part::Calibration,
            number: 0,
        }
    }

    /// Begins or resumes a recording.
    pub fn begin(&mut self, part: Part, config: &SessionConfig) -> Result<()> {
        let unit = &self.station.unit;
        let table = config.fixture == Fixture::Table;
        let mut columns = Columns {
            step: true,
            temp_c: true,
            gyro: true,
            accel: true,
            reference: [table; 6],
            ..Columns::default()
        };
        if unit.has_mag {
            columns.add(TriadName::MAG);
        }
        let mut manifest = Manifest::new(
            unit.name.clone(),
            unit.rate_hz,
            config.gravity_mps2,
            unit.raw_unit,
            config.fixture.reference(),
        );
        manifest.latitude_deg = config.latitude_deg;
        manifest.power_on_s = self.power_on_s;
        manifest.reference_error = config.reference_error.clone();
        manifest.whole_turns = config.whole_turns.filter(|_| part != Part::Confirmation);
        if unit.is_device {
            manifest.recorded = Some(Recorded {
                tool: concat!("mimu ", env!("CARGO_PKG_VERSION")).into(),
                unit_id: unit.id.clone(),
                sensors: unit.sensors.clone(),
                start: unit.start.clone().filter(|_| self.power_on_s.is_none()),
                ..Recorded::default()
            });
        }
        manifest.clock = self.clock;
        self.part = part;
        self.recording = Some(OpenRecording::begin(&self.folder, part, columns, manifest)?);
        let compared = self.recording.as_ref().and_then(|r| r.manifest().clock);
        self.clock = compared.or(self.clock);
        // Discarded dwells keep their numbers.
        let had = self.folder.entries().iter().filter_map(|e| match e {
            Entry::Dwell {
                part: of, number, ..
            } if *of == part => Some(number + 1),
            _ => None,
        });
        self.number = had.max().unwrap_or(0);
        // Waiting events are from before this recording. It names a restart since the calibration at its first sample: its biases are others.
        while let Some(news) = self.station.news()? {
            self.restarted = restart(&news).or(self.restarted.take());
        }
        if self.number == 0 && part != Part::Calibration && self.restarted.is_none() {
            self.restarted = self.folder.restart_since_calibration();
        }
        self.pending.clear();
        (self.dwell, self.next) = (None, None);
        self.watch.interrupted();
        self.watch.begin();
        Ok(())
    }

    /// Name for events.
    pub fn name(&self) -> String {
        self.station.unit.name.clone()
    }

    /// First tick that a source may use, so that time continues after the recorded samples.
    pub fn first_tick(folder: &Folder, rate_hz: f64) -> u64 {
        let last = folder.entries().iter().filter_map(|e| match e {
            Entry::Dwell { from_s, step, .. } => Some(from_s + step.dwell_s),
            _ => None,
        });
        // More than a period later, so that there is a visible gap.
        (last.fold(0.0, f64::max) * rate_hz) as u64 + (10.0 * rate_hz) as u64
    }

    /// Processes all events up to the end of the dwell. Those after it wait for the next step: on a slow computer they may hold all of its dwell. Adds
    /// reports to `tell`; returns whether there were events.
    pub fn listen(&mut self, round: &Round<'_>, tell: &mut Vec<Event>) -> Result<bool> {
        let mut some = false;
        while let Some(news) = self.station.news()? {
            some = true;
            self.restarted = restart(&news).or(self.restarted.take());
            match news {
                SourceEvent::Samples(chunk) => {
                    self.keep(&chunk);
                    self.count_turns(&chunk);
                    self.tell_turns(tell);
                    self.compass.take(&chunk, self.station.unit.rate_hz);
                    if let Some(seen) = self.watch.take(&chunk) {
                        self.seen = Some(seen);
                        self.stand(&seen, round.config, round.step);
                        self.judge_field(&seen, tell);
                        if let (Some(step), false) = (round.step, self.done) {
                            self.update_dwell(&seen, round, step, tell)?;
                            if self.done {
                                break;
                            }
                        }
                    }
                }
                SourceEvent::Restarted(why) => {
                    self.interrupted(Interruption::Restarted(why), tell)?;
                }
                SourceEvent::Note(words) => tell.push(Event::Note {
                    words: format!("{}: {words}", self.name()),
                }),
                SourceEvent::Clock(rate) => self.compare_clock(rate, tell)?,
                SourceEvent::Nothing => {}
                SourceEvent::Lost(why) => self.interrupted(Interruption::Lost(why), tell)?,
                SourceEvent::Other(why) => {
                    let why = Interruption::OtherUnit(why);
                    self.state.waiting = Some(Waiting::Interrupted(why.clone()));
                    tell.push(Event::Interrupted {
                        unit: self.name(),
                        why,
                    });
                }
                SourceEvent::Back(unit) => {
                    let nameless = !unit.is_device;
                    self.lost_at = nameless.then_some(self.levels.len()).or(self.lost_at);
                    self.interrupted(Interruption::Back, tell)?;
                }
            }
        }
        Ok(some)
    }

    /// Keeps the comparison of the clocks, and reports a difference once.
    ///
    /// Errors: the clock is wrong.
    fn compare_clock(&mut self, rate: ClockRate, tell: &mut Vec<Event>) -> Result<()> {
        refuse_clock(&self.name(), &rate)?;
        // A comparison that began anew after an interruption is wider than the one before.
        if self.clock.is_some_and(|c| c.half_width < rate.half_width) {
            return Ok(());
        }
        let reported = self.clock.is_some_and(|c| c.differs_by() > REPORTED_SHARE);
        if rate.differs_by() > REPORTED_SHARE && !reported {
            let words = format!("{}: {}", self.name(), rate.described());
            tell.push(Event::Note { words });
        }
        self.clock = Some(rate);
        if let Some(recording) = &mut self.recording {
            recording.set_clock(rate);
        }
        Ok(())
    }

    fn interrupted(&mut self, why: Interruption, tell: &mut Vec<Event>) -> Result<()> {
        let waiting = Waiting::Interrupted(why.clone());
        self.discard(&waiting, tell)?;
        self.interrupt_spin(tell);
        self.watch.interrupted();
        self.state.waiting = Some(waiting);
        self.folder.add(Entry::Interrupted {
            why: why.to_string(),
        })?;
        tell.push(Event::Interrupted {
            unit: self.name(),
            why,
        });
        Ok(())
    }

    fn keep(&mut self, chunk: &Chunk) {
        let missing = chunk.tick.saturating_sub(self.next.unwrap_or(chunk.tick));
        self.next = Some(chunk.end());
        self.power_on_s = chunk.power_on_s;
        self.state.lost += missing;
        let rate_hz = self.station.unit.rate_hz;
        match &mut self.dwell {
            Some(dwell) => dwell.missing += missing,
            // A turn is integrated across shorter gaps.
            None if is_bridged((missing + 1) as f64 / rate_hz) => {}
            None => self.turn_missing += missing,
        }
        if chunk.saturated {
            let clipped = chunk.values.len() as u64;
            self.state.clipped += clipped;
            self.turn_clipped += clipped;
        }
        if let Some(recording) = &mut self.recording {
            recording.missing(missing);
        }
        self.state.samples += chunk.values.len() as u64;
        self.pending.add(chunk, rate_hz);
        let first = self.pending.rows.len() - chunk.values.len();
        if let (Some(recording), Some(t_s)) =
            (&mut self.recording, self.pending.rows.t_s.get(first))
            && let Some(why) = self.restarted.take()
        {
            recording.restarted(*t_s, why);
        }
        // A turn does not take minutes: a longer pause becomes a gap.
        let kept_s = if self.spin.is_some() {
            KEPT_SPIN_S
        } else {
            KEPT_S
        };
        let had = self.pending.rows.len();
        if self.dwell.is_none() && had as f64 > 2.0 * kept_s * rate_hz {
            self.pending.cut(had - (kept_s * rate_hz) as usize);
        }
    }

    fn stand(&mut self, seen: &LastSecond, config: &SessionConfig, step: Option<&Step>) {
        let nominal = self
            .nominal
            .unwrap_or_else(|| guessed(seen, config.gravity_mps2));
        let up = force(seen, &nominal[1]);
        let state = &mut self.state;
        state.motion = Some(seen.motion);
        let wanted_dps = step.map_or(0.0, |s| s.rate_dps);
        state.motion_limits = motion_limits(wanted_dps);
        state.rate_limit_dps = rate_limit_dps(wanted_dps);
        state.trend_limit_c_per_min = config.warm_c_per_min;
        state.temp_c = seen.temp_c.is_finite().then_some(seen.temp_c);
        state.trend_c_per_min = seen.trend;
        state.up = Some(up.normalize().into()).filter(|up: &[f64; 3]| up[0].is_finite());
        state.tilt_deg = step.map(|s| up.angle(&s.up()).to_degrees());
        let last = self.folder.last_dwell();
        self.away |= last.is_some_and(|s| up.angle(&s.up()).to_degrees() > AWAY_DEG);
        // An estimated gyro model has no scale.
        let rate = self.rate(seen);
        self.state.rate_dps = rate.map(|rate| rate.dot(&up.normalize()).to_degrees());
    }

    fn judge_field(&mut self, seen: &LastSecond, tell: &mut Vec<Event>) {
        let rests = seen.motion.iter().all(|m| *m <= 1.0);
        let words = self.compass.judge(seen, rests);
        self.state.field.clone_from(&self.compass.words);
        tell.extend(words.map(|words| Event::Field {
            unit: self.name(),
            words,
        }));
    }

    /// Unit vector upwards, from the last second.
    fn up(&self, seen: &LastSecond, config: &SessionConfig) -> Vector3<f64> {
        let nominal = self
            .nominal
            .unwrap_or_else(|| guessed(seen, config.gravity_mps2));
        force(seen, &nominal[1]).normalize()
    }

    fn update_dwell(
        &mut self,
        seen: &LastSecond,
        round: &Round<'_>,
        step: &Step,
        tell: &mut Vec<Event>,
    ) -> Result<()> {
        let config = round.config;
        let rate_hz = self.station.unit.rate_hz;
        if seen.learnt {
            let words = format!(
                "{}: the gyro's reading at rest has changed, and is measured again",
                self.name()
            );
            tell.push(Event::Note { words });
        }
        let up = self.up(seen, config);
        self.compare_units(seen, &up)?;
        let running = self.dwell.map(|d| d.step);
        let wanted = running.unwrap_or(*step);
        let limits = motion_limits(wanted.rate_dps);
        self.moved |= (0..2).any(|k| seen.motion[k] > limits[k]);
        let found = match self.waits(seen, config, &wanted, round.busy) {
            Some(why) => Err(why),
            // In motion an accelerometer does not read gravity alone.
            None if wanted.rate_dps == 0.0 && self.check_unit(seen, config).is_err() => {
                return self.check_unit(seen, config);
            }
            None => match &self.spin {
                Some(spin) => self.spin_pose(spin, &up, round, &wanted),
                None => self.pose(&up, round, &wanted, running.is_none()),
            },
        };
        let found = found.and_then(|step| match self.turns_otherwise(seen, &step) {
            Some(why) => Err(why),
            None => Ok(step),
        });
        match (found, self.dwell) {
            (Err(why), _) => {
                self.discard(&why, tell)?;
                self.check_range(seen, &why)?;
                let why = self.while_turning(why);
                if self.state.waiting.as_ref() != Some(&why) {
                    // Changes of its numbers are shown in the state only.
                    let told = self.state.waiting.as_ref();
                    if !why.is_expected() && !told.is_some_and(|told| told.is_like(&why)) {
                        tell.push(Event::Waiting {
                            unit: self.name(),
                            why: why.clone(),
                        });
                    }
                    self.state.waiting = Some(why);
                }
            }
            (Ok(step), None) => {
                let from = seen.tick.saturating_sub((BEFORE_S * rate_hz) as u64);
                let had = (self.pending.rows.len() - self.pending.before(from)) as u64;
                self.dwell = Some(Dwell {
                    step,
                    from,
                    missing: (seen.tick - from).saturating_sub(had),
                });
                self.state.waiting = None;
                self.state.left_s = Some(step.dwell_s);
            }
            (Ok(_), Some(dwell)) => {
                let guard = (GUARD_S * rate_hz) as u64;
                let to = dwell.to(rate_hz);
                let left = (to + guard).saturating_sub(seen.tick);
                self.state.left_s = Some(left as f64 / rate_hz);
                if left == 0 {
                    match self.spin.is_some() {
                        true => self.rested(dwell, to, seen, round, tell)?,
                        false => self.accept(dwell, to, seen, round, tell)?,
                    }
                }
            }
        }
        Ok(())
    }

    /// Discards the running dwell.
    fn discard(&mut self, why: &Waiting, tell: &mut Vec<Event>) -> Result<()> {
        self.state.left_s = None;
        let Some(dwell) = self.dwell.take() else {
            return Ok(());
        };
        let rate_hz = self.station.unit.rate_hz;
        let lasted = self.next.unwrap_or(dwell.from).saturating_sub(dwell.from);
        if lasted as f64 > (BEFORE_S + BEGUN_S) * rate_hz && !self.is_turned() {
            self.folder.add(Entry::Discarded {
                step: dwell.step,
                why: why.to_string(),
            })?;
            tell.push(Event::Discarded {
                unit: self.name(),
                why: why.clone(),
            });
        }
        Ok(())
    }

    fn accept(
        &mut self,
        dwell: Dwell,
        to: u64,
        seen: &LastSecond,
        round: &Round<'_>,
        tell: &mut Vec<Event>,
    ) -> Result<()> {
        let config = round.config;
        self.check_temperature(seen, config)?;
        let Some(recording) = &mut self.recording else {
            return Ok(());
        };
        let end = self.pending.before(to);
        let begin = self.pending.before(dwell.from);
        let mut rows = self.pending.take(end);
        let input = known(&dwell.step, config);
        for row in begin..end {
            rows.step[row] = self.number;
            for c in 0..6 {
                rows.reference[c][row] = input[c];
            }
        }
        if config.fixture != Fixture::Table {
            rows.reference = Default::default();
        }
        let from_s = rows.t_s.get(begin).copied().unwrap_or(0.0);
        recording.write(&rows)?;
        let (rows, bytes) = recording.settled()?;
        let number = self.number;
        self.folder.add(Entry::Dwell {
            part: self.part,
            number,
            step: dwell.step,
            asked: round
                .step
                .filter(|_| self.moved && round.any_order && self.spin.is_none())
                .map(|s| s.up),
            from_s,
            rows,
            bytes,
            temp_c: seen.temp_c.is_finite().then_some(seen.temp_c),
        })?;
        self.number += 1;
        self.away = false;
        self.levels.push(Vector3::from_fn(|c, _| seen.mean[c]));
        (self.dwell, self.done, self.state.left_s) = (None, self.spin.is_none(), None);
        tell.push(Event::Dwell {
            unit: self.name(),
            part: self.part,
            number,
            step: dwell.step,
            words: dwell.step.words(),
        });
        let missing = std::mem::take(&mut self.turn_missing);
        let clipped = std::mem::take(&mut self.turn_clipped);
        if config.fixture != Fixture::Table && number > 0 && self.spin.is_none() {
            self.count_turn([missing, clipped], tell)?;
        }
        if self.part == Part::Calibration {
            self.refit(config);
            self.check_unit_is_same()?;
            self.check_hope()?;
            tell.push(Event::Progress {
                unit: self.name(),
                progress: self.progress.clone(),
            });
        }
        Ok(())
    }

    /// Ends the session if further dwells cannot help.
    fn check_hope(&self) -> Result<()> {
        match &self.hopeless {
            Some(error) => Err(error.clone()),
            None => Ok(()),
        }
    }

    /// Why the poses show that the accelerometer's axes do not match their names.
    pub fn mirrored(&self, config: &SessionConfig) -> Option<String> {
        axes::mirrored(
            &self.folder.shown(self.part),
            config.fixture.tolerance_deg(),
        )
    }

    /// A dwell was requested.
    pub fn asked_for(&mut self) {
        (self.done, self.moved, self.state.waiting) = (false, false, None);
    }

    fn check_temperature(&self, seen: &LastSecond, config: &SessionConfig) -> Result<()> {
        let Some([first, _]) = self.folder.temperatures() else {
            return Ok(());
        };
        let moved = seen.temp_c - first;
        if moved.abs() > config.most_drift_c {
            let problem = format!(
                "the temperature has changed from {first:.1} to {:.1} °C since the first dwell, but a calibration is valid at one temperature",
                seen.temp_c
            );
            let remedy = "let the unit reach a steady temperature and start a new session in another folder, or allow a larger change";
            return Err(Error::new(self.name(), problem, remedy).about(Argument::Drift));
        }
        Ok(())
    }

    /// Fits the recording so far. From now on up is found with its result.
    pub fn refit(&mut self, config: &SessionConfig) -> Option<Fit> {
        let recording = self.recording.as_ref()?;
        let prior = config.prior.as_ref();
        let fitted = calibrate(recording.manifest(), &recording.samples, prior);
        self.progress = progress(&fitted, &config.targets);
        self.refused = match &fitted {
            Err(error) if !matches!(error, Error::Undetermined(_)) => self.refused + 1,
            _ => 0,
        };
        if let (Err(error), true) = (
            &fitted,
            self.number >= REFUSED_FROM && self.refused >= REFUSED,
        ) {
            self.hopeless = Some(error.clone());
        }
        let fitted = fitted.ok()?;
        self.compass.refit(recording, &fitted);
        if let [Some(gyro), Some(accel)] = Sensor::BOTH.map(|s| fitted.sensor(s)) {
            self.fitted = Some([gyro, accel].map(|s| s.estimated.triad.clone()));
        }
        // A calibration that is uncertain by degrees does not find up better than a data sheet.
        let known = self
            .progress
            .sensors
            .iter()
            .all(|s| s.aims.iter().all(|a| a.half_width < KNOWN * a.target));
        let turned = self.progress.sensors.iter().flat_map(|s| &s.aims);
        let mut angles = turned.filter(|a| a.parameter == Parameter::Angles);
        let known_angles = angles.all(|a| a.half_width < AXES_KNOWN);
        let apart = known_angles.then(|| axes::frames_apart(&fitted)).flatten();
        self.hopeless = apart.map(|why| Error::device(self.name(), why, axes::REMEDY));
        if let (true, [Some(gyro), Some(accel)]) = (known, Sensor::BOTH.map(|s| fitted.sensor(s))) {
            self.nominal = Some([gyro, accel].map(|s| s.estimated.triad.inverse));
            self.calibrated = true;
        }
        Some(fitted)
    }

    /// Discards the dwell with this number, and returns it.
    pub fn redo(&mut self, number: i32) -> Result<Option<Step>> {
        let had = self.folder.dwells(self.part);
        let Some((_, step)) = had.into_iter().find(|d| d.0 == number) else {
            return Ok(None);
        };
        let part = self.part;
        self.folder.add(Entry::Redo { part, number })?;
        if let Some(recording) = &mut self.recording {
            recording.drop_dwell(number);
        }
        Ok(Some(step))
    }

    /// Number of the last valid dwell.
    pub fn last_number(&self) -> Option<i32> {
        self.folder.dwells(self.part).last().map(|d| d.0)
    }

    /// Rate of change of the temperature, °C/min; `None` while it is unknown. Without a thermometer it is 0.
    pub fn trend(&self) -> Option<f64> {
        self.seen.and_then(|s| match s.temp_c.is_nan() {
            true => Some(0.0),
            false => s.trend,
        })
    }

    /// Samples so far may be from a turning table.
    pub fn was_turning(&mut self) {
        self.watch.was_turning();
    }

    /// Whether samples arrive and the noise at rest is known.
    pub fn is_heard(&self) -> bool {
        self.watch.knows_rest()
    }
}
