//! A session from the greeting to the last dwell: chooses the next dwell, and records which units have completed it.

mod spins;

use std::time::{Duration, Instant};

use mimu_recording::error::{Error, Result};

use crate::axes;
use crate::event::{Event, Phase, Question, SessionState, UserRequest, View};
use crate::folder::{Entry, Part};
use crate::procedure::{Fixture, SAME_POSE_DEG, SessionConfig, next_step};
use crate::turn::pause;
use crate::unit_session::{Round, UnitSession};
use crate::waiting::Waiting;
use mimu_device::patience;
use mimu_equipment::drive::Driver;
use mimu_equipment::step::Step;

/// Interval of showing the state.
const SHOWN: Duration = Duration::from_millis(100);
/// Longest wait for a unit to send anything, or for a table's interlock.
const SILENT: Duration = Duration::from_secs(30);

/// Longest time in a wrong pose if no person turns the unit: nobody corrects the pose.
const WRONG: Duration = Duration::from_secs(10);

/// Why a phase ended early.
#[derive(Debug)]
pub enum Stop {
    /// Cancelled by the user; the session can be resumed later.
    Cancelled,
    /// It failed.
    Failed(Error),
}

impl From<Error> for Stop {
    fn from(error: Error) -> Self {
        Self::Failed(error)
    }
}

/// Result of what the user can cancel.
pub type Phased<T> = std::result::Result<T, Stop>;

/// A session.
pub struct Wizard<'a> {
    /// Settings.
    pub config: SessionConfig,
    /// The units, all on one fixture.
    pub units: Vec<UnitSession>,
    /// Moves the units.
    pub driver: Box<dyn Driver + 'a>,
    /// Receives events and the state.
    pub view: &'a mut dyn View,
    /// The phase, for the state.
    pub phase: Phase,
    shown: Instant,
    queue: Vec<Step>,
    /// Requested dwells that the user replaced by another pose. They follow after the others.
    later: Vec<Step>,
    planned: usize,
    current: Option<Step>,
    zero_s: Option<u64>,
    /// Whether the user has confirmed that the poses differ from the requested ones.
    axes_agreed: bool,
}

/// How a dwell ended.
enum Stepped {
    Done,
    Skipped,
    Redo(Step),
}

impl<'a> Wizard<'a> {
    /// A session with these units.
    pub fn new(
        config: SessionConfig,
        units: Vec<UnitSession>,
        driver: Box<dyn Driver + 'a>,
        view: &'a mut dyn View,
    ) -> Self {
        Self {
            config,
            units,
            driver,
            view,
            phase: Phase::Start,
            shown: Instant::now(),
            queue: Vec::new(),
            later: Vec::new(),
            planned: 0,
            current: None,
            zero_s: None,
            axes_agreed: false,
        }
    }

    /// Reports an event.
    pub fn tell(&mut self, event: Event) {
        self.view.tell(&event);
    }

    /// Begins a phase.
    pub fn begin_phase(&mut self, phase: Phase, words: String) {
        self.phase = phase;
        self.tell(Event::Phase { phase, words });
    }

    /// Processes the events of all units once, and shows the state. Returns the user's request, if any; one to cancel ends the phase.
    async fn round(&mut self, step: Option<&Step>, busy: bool) -> Phased<Option<UserRequest>> {
        let mut tell = Vec::new();
        let round = Round {
            config: &self.config,
            step,
            others: &self.queue,
            busy,
            any_order: self.driver.is_person(),
        };
        let mut some = false;
        for unit in &mut self.units {
            some |= unit.listen(&round, &mut tell)?;
        }
        for event in tell {
            self.view.tell(&event);
        }
        if self.shown.elapsed() > SHOWN {
            self.shown = Instant::now();
            let samples = self.units.first().map_or(0, |u| u.state.samples);
            let zero = *self.zero_s.get_or_insert(samples);
            let rate_hz = self.units.first().map_or(1.0, |u| u.station.unit.rate_hz);
            let state = SessionState {
                phase: self.phase,
                step: self.current,
                dwells: [self.units.first().map_or(0, |u| self.had(u)), self.planned],
                discarded: self.units.iter().map(|u| u.folder.discarded()).sum(),
                elapsed_s: (samples - zero.min(samples)) as f64 / rate_hz,
                units: self.units.iter().map(|u| u.state.clone()).collect(),
                progress: self.units.iter().map(|u| u.progress.clone()).collect(),
            };
            self.view.show(&state);
        }
        let request = self.view.request();
        if request == Some(UserRequest::Cancel) {
            return Err(Stop::Cancelled);
        }
        if !some && request.is_none() {
            pause().await;
        }
        Ok(request)
    }

    fn had(&self, unit: &UnitSession) -> usize {
        match unit.spins() {
            true => unit.folder.spins(self.phase.part()).len(),
            false => unit.folder.dwells(self.phase.part()).len(),
        }
    }

    /// Waits until all units send samples and, if requested, have warmed up.
    pub async fn warm_up(&mut self) -> Phased<()> {
        let mut since = Instant::now();
        self.current = None;
        // A session that was killed may have left the table turning.
        self.driver.stop()?;
        while self.driver.busy()? {
            self.round(None, true).await?;
        }
        for unit in &mut self.units {
            unit.was_turning();
        }
        loop {
            self.round(None, false).await?;
            let heard = self.units.iter().all(UnitSession::is_heard);
            if !heard {
                if since.elapsed() > SILENT * patience() {
                    let silent = self.units.iter().find(|u| !u.is_heard());
                    let name = silent.map_or_else(String::new, UnitSession::name);
                    let (problem, remedy) = match silent.is_some_and(|u| u.state.samples > 0) {
                        true => (
                            "it does not come to rest: no two successive seconds have the same readings",
                            "leave it at rest until the first dwell, and run it again",
                        ),
                        false => ("no samples arrive", "reset the board and run it again"),
                    };
                    return Err(Error::device(name, problem, remedy).into());
                }
                continue;
            }
            let Some(limit) = self.config.warm_c_per_min else {
                return Ok(());
            };
            let warm = |u: &UnitSession| u.trend().is_some_and(|t| t.abs() <= limit);
            for unit in &mut self.units {
                let waiting = match unit.trend() {
                    None => Some(Waiting::TrendUnknown),
                    Some(t) if t.abs() > limit => Some(Waiting::Warming(t, limit)),
                    Some(_) => None,
                };
                unit.state.waiting = waiting;
            }
            if self.units.iter().all(warm) {
                return Ok(());
            }
            since = Instant::now();
        }
    }

    /// Records the dwells of a part: the planned ones that are missing and, for a calibration by targets, more or fewer.
    pub async fn dwells(&mut self, part: Part, steps: &[Step]) -> Phased<()> {
        for unit in &mut self.units {
            let config = self.config.clone();
            unit.begin(part, &config)?;
            if part == Part::Calibration {
                unit.refit(&config);
            }
        }
        self.planned = steps.len();
        (self.queue, self.later) = (self.left(part, steps), Vec::new());
        loop {
            let Some(step) = self.choose(part) else {
                self.driver.stop()?;
                self.current = None;
                return Ok(());
            };
            self.current = Some(step);
            let done = self
                .units
                .first()
                .map_or(0, |u| u.folder.dwells(part).len());
            let planned = self.planned.max(done + 1);
            self.tell(Event::Step {
                part,
                done,
                planned,
                step,
                words: step.words(),
            });
            match self.step(&step).await? {
                Stepped::Done if self.driver.is_person() => {
                    self.goes_on(part, steps, &step).await?;
                }
                Stepped::Done => {}
                Stepped::Skipped => self.queue.push(step),
                Stepped::Redo(other) => {
                    self.queue.insert(0, step);
                    self.queue.insert(0, other);
                }
            }
        }
    }

    /// Updates the remaining dwells if the user may have recorded another pose than `step`: the recorded one is done, and `step` follows later. If
    /// all poses differ in the same way, the session ends, unless the user confirms them.
    async fn goes_on(&mut self, part: Part, steps: &[Step], step: &Step) -> Phased<()> {
        self.queue = self.left(part, steps);
        self.queue.sort_by_key(|s| self.later.contains(s));
        let limit = self.config.fixture.tolerance_deg();
        let last = self.units.first().and_then(|u| u.folder.dwells(part).pop());
        let other = last.filter(|(_, had)| had.up().angle(&step.up()).to_degrees() > limit);
        let Some((_, had)) = other else {
            return Ok(());
        };
        self.later.push(*step);
        self.queue.sort_by_key(|s| self.later.contains(s));
        let words = format!(
            "that was {}; {} was requested and follows later",
            had.words(),
            step.words()
        );
        self.tell(Event::Note { words });
        let mirrored = self
            .units
            .iter()
            .find_map(|u| Some((u.name(), u.mirrored(&self.config)?)));
        let Some((name, why)) = mirrored.filter(|_| !self.axes_agreed) else {
            return Ok(());
        };
        self.axes_agreed = self.ask(&Question::GoOn(format!("{name}: {why}"))).await?;
        match self.axes_agreed {
            true => Ok(()),
            false => Err(Error::device(name, why, axes::REMEDY).into()),
        }
    }

    /// The planned dwells that are not in the journal.
    fn left(&self, part: Part, steps: &[Step]) -> Vec<Step> {
        // If the units were interrupted at different dwells, the one with the fewest decides. The others then get one dwell more.
        let had = self.units.iter().map(|u| u.folder.dwells(part));
        let had = had.min_by_key(Vec::len).unwrap_or_default();
        let mut left = steps.to_vec();
        let limit = self.config.fixture.tolerance_deg();
        for (_, dwell) in had {
            let is = |s: &Step| {
                s.rate_dps == dwell.rate_dps && s.up().angle(&dwell.up()).to_degrees() <= limit
            };
            if let Some(at) = left.iter().position(is) {
                left.remove(at);
            }
        }
        left
    }

    /// The next dwell; `None` if all are done.
    fn choose(&mut self, part: Part) -> Option<Step> {
        let going_by_targets = part == Part::Calibration && self.config.by_targets;
        if !going_by_targets {
            return self.queued();
        }
        let met = self.units.iter().all(|u| u.progress.missed() == [false; 2]);
        let done = self
            .units
            .first()
            .map_or(0, |u| u.folder.dwells(part).len());
        if met && done >= self.config.fewest_dwells() || done >= self.config.most_dwells {
            return None;
        }
        if let Some(step) = self.queued() {
            return Some(step);
        }
        let worst = self
            .units
            .iter()
            .find(|u| u.progress.missed() != [false; 2])?;
        let had: Vec<Step> = worst.folder.dwells(part).into_iter().map(|d| d.1).collect();
        Some(next_step(&self.config, &had, worst.progress.missed()))
    }

    /// The next dwell of the queue. By hand one that differs from the last pose comes first, so that a turn leads to it.
    fn queued(&mut self) -> Option<Step> {
        let last = self.units.first().and_then(|u| u.folder.last_dwell());
        let last = last.filter(|_| self.config.fixture != Fixture::Table);
        let differs = |s: &Step| {
            last.is_none_or(|last| s.up().angle(&last.up()).to_degrees() >= SAME_POSE_DEG)
        };
        let at = self.queue.iter().position(differs).unwrap_or(0);
        (!self.queue.is_empty()).then(|| self.queue.remove(at))
    }

    async fn step(&mut self, step: &Step) -> Phased<Stepped> {
        for unit in &mut self.units {
            unit.asked_for();
        }
        let mut since = Instant::now();
        let mut told = false;
        while let Some(why) = self.driver.interlock()? {
            if !told {
                self.tell(Event::Note { words: why.clone() });
                told = true;
            }
            self.round(None, false).await?;
            if since.elapsed() > SILENT * patience() && !self.driver.is_person() {
                let remedy = "close that program and run the same command";
                return Err(Error::device("table", why, remedy).into());
            }
        }
        self.driver.go(step)?;
        since = Instant::now();
        let mut stood = since;
        loop {
            let busy = self.driver.busy()?;
            match self.round(Some(step), busy).await? {
                Some(UserRequest::Skip) => return Ok(Stepped::Skipped),
                Some(UserRequest::RedoLast) => {
                    let last = self.units.iter().filter_map(UnitSession::last_number).max();
                    if let Some(step) = last.map(|n| self.redo(n)).transpose()?.flatten() {
                        return Ok(Stepped::Redo(step));
                    }
                }
                Some(UserRequest::Redo(number)) => {
                    if let Some(step) = self.redo(number)? {
                        return Ok(Stepped::Redo(step));
                    }
                }
                Some(UserRequest::Cancel) | None => {}
            }
            if self.units.iter().all(|u| u.done) {
                return Ok(Stepped::Done);
            }
            let wrong =
                |u: &UnitSession| u.done || matches!(u.state.waiting, Some(Waiting::WrongPose(..)));
            if busy || !self.units.iter().all(wrong) {
                stood = Instant::now();
            }
            let out_of_patience = since.elapsed().as_secs_f64()
                > self.config.patience_s * f64::from(patience())
                || stood.elapsed() > WRONG * patience();
            if out_of_patience && !self.driver.is_person() {
                let why = self.units.iter().filter(|u| !u.done);
                let why = why.filter_map(|u| u.state.waiting.as_ref()).next();
                let problem = format!(
                    "the conditions for {:?} are not met: {}",
                    step.words(),
                    why.map_or_else(
                        || "the dwell is interrupted again and again".into(),
                        Waiting::to_string
                    )
                );
                let remedy = match stood.elapsed() > WRONG * patience() {
                    true => {
                        "check the axes of the driver file, and wiring, signs and order of the accelerometer's axes"
                    }
                    false => "correct this and run the same command: the session resumes",
                };
                return Err(Error::device("session", problem, remedy).into());
            }
        }
    }

    fn redo(&mut self, number: i32) -> Result<Option<Step>> {
        let mut step = None;
        for unit in &mut self.units {
            step = unit.redo(number)?.or(step);
        }
        if step.is_some() {
            self.tell(Event::Redo { number });
        }
        Ok(step)
    }

    /// Asks a question, and processes the units' events meanwhile.
    pub async fn ask(&mut self, question: &Question) -> Phased<bool> {
        self.tell(Event::Question {
            question: question.name(),
            words: question.words(),
        });
        loop {
            if let Some(answer) = self.view.ask(question) {
                return Ok(answer);
            }
            self.round(None, false).await?;
        }
    }

    /// Adds an entry to the journal of each unit.
    pub fn journal(&mut self, entry: &Entry) -> Result<()> {
        for unit in &mut self.units {
            unit.folder.add(entry.clone())?;
        }
        Ok(())
    }
}
