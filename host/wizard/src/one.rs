//! One of the units of a session: what comes from it, and the dwells that are made of it.

use mimu::estimate::earth::Earth;
use mimu::fit::Fit;
use mimu::quantity::Sensor;
use mimu::stillness::GUARD_S;
use mimu_core::compensation::Affine;
use mimu_recording::error::{Error, Result};
use mimu_recording::{Batch, Columns, Manifest, Recorded};
use nalgebra::Vector3;

use crate::event::{Event, UnitStanding};
use crate::folder::{Entry, Folder, Part, Taking, append};
use crate::procedure::{Asked, Fixture, SAME_POSE_DEG};
use crate::refit::{Progress, calibrate, progress};
use crate::source::Chunk;
use crate::station::{News, Station};
use crate::step::{Step, words};
use crate::watch::{Seen, Watch, force, guessed};

/// Share of the samples of a second that may be missing where only means matter, and where turns are integrated as well.
const LOST_SHARE: [f64; 2] = [0.5, 0.1];
/// Part of the second before that belongs to a dwell already: it was as still.
const BEFORE_S: f64 = 0.5;
/// A dwell that ends earlier than this has not begun, s.
const BEGUN_S: f64 = 0.5;
/// Departure of a rate that still is the one that is wanted: sensitivities differ from the data sheet's by some per cent.
const RATE_SHARE: f64 = 0.2;
/// The same of any rate, deg/s: noise and what the null has moved by.
const RATE_DPS: f64 = 2.0;
/// So much of what has come is kept between two dwells, s: a turn takes seconds.
const KEPT_S: f64 = 120.0;

/// From this many targets on a half-width tells nothing of where up is: 20 mrad.
const KNOWN: f64 = 20.0;

/// A dwell that runs.
#[derive(Debug, Clone, Copy)]
struct Dwell {
    step: Step,
    from: u64,
}

/// What a unit is looked at for.
#[derive(Debug, Clone, Copy)]
pub struct Round<'a> {
    /// What is asked of the session.
    pub asked: &'a Asked,
    /// The step that is wanted now.
    pub step: Option<&'a Step>,
    /// Those to come.
    pub others: &'a [Step],
    /// Whether the table still moves.
    pub busy: bool,
    /// Whether another step may be had first, as a person may.
    pub any_order: bool,
}

/// One of the units.
pub struct One {
    /// Its port.
    pub station: Station,
    /// Its folder.
    pub folder: Folder,
    /// The recording that grows.
    pub taking: Option<Taking>,
    /// The calibration so far, beside the targets.
    pub progress: Progress,
    /// How it stands.
    pub standing: UnitStanding,
    /// Whether it has had the step.
    pub done: bool,
    watch: Watch,
    /// Raw to SI: of the data sheet, or guessed, or of the calibration so far.
    nominal: Option<[Affine<f64>; 2]>,
    pending: Batch,
    next: Option<u64>,
    /// When the power came, on the clock of the recordings, s.
    power_on_s: Option<f64>,
    dwell: Option<Dwell>,
    seen: Option<Seen>,
    part: Part,
    number: i32,
}

impl One {
    /// A unit with its folder.
    pub fn new(station: Station, folder: Folder, asked: &Asked) -> Self {
        let unit = &station.unit;
        Self {
            watch: Watch::new(unit.rate_hz, asked.fixture != Fixture::Table),
            nominal: unit.nominal,
            standing: UnitStanding {
                unit: unit.name.clone(),
                tilt_limit_deg: asked.fixture.tolerance_deg(),
                ..UnitStanding::default()
            },
            station,
            folder,
            taking: None,
            progress: Progress::default(),
            done: false,
            pending: Batch::default(),
            next: None,
            power_on_s: None,
            dwell: None,
            seen: None,
            part: Part::Calibration,
            number: 0,
        }
    }

    /// Begins a recording, or goes on with it.
    pub fn begin(&mut self, part: Part, asked: &Asked) -> Result<()> {
        let unit = &self.station.unit;
        let table = asked.fixture == Fixture::Table;
        let columns = Columns {
            step: true,
            temp_c: true,
            gyro: true,
            accel: true,
            reference: [table; 6],
        };
        let mut manifest = Manifest::new(
            unit.name.clone(),
            unit.rate_hz,
            asked.gravity_mps2,
            unit.raw_unit,
            asked.fixture.reference(),
        );
        manifest.latitude_deg = asked.latitude_deg;
        manifest.power_on_s = self.power_on_s;
        if unit.is_device {
            manifest.recorded = Some(Recorded {
                tool: concat!("mimu ", env!("CARGO_PKG_VERSION")).into(),
                unit_id: unit.id.clone(),
                start: unit.start.clone().filter(|_| self.power_on_s.is_none()),
                ..Recorded::default()
            });
        }
        self.part = part;
        self.taking = Some(Taking::begin(&self.folder, part, columns, manifest)?);
        // Those that do not count keep their numbers.
        let had = self.folder.entries().iter().filter_map(|e| match e {
            Entry::Dwell {
                part: of, number, ..
            } if *of == part => Some(number + 1),
            _ => None,
        });
        self.number = had.max().unwrap_or(0);
        // What waits is of the time before.
        while self.station.news()?.is_some() {}
        (self.pending, self.dwell, self.next) = (Batch::default(), None, None);
        self.watch.interrupted();
        self.watch.begin();
        Ok(())
    }

    /// Name for events.
    pub fn name(&self) -> String {
        self.station.unit.name.clone()
    }

    /// First tick that a source may use, so that time goes on behind what was recorded.
    pub fn first_tick(folder: &Folder, rate_hz: f64) -> u64 {
        let last = folder.entries().iter().filter_map(|e| match e {
            Entry::Dwell { from_s, step, .. } => Some(from_s + step.dwell_s),
            _ => None,
        });
        // More than a period behind, so that the gap is one.
        (last.fold(0.0, f64::max) * rate_hz) as u64 + (10.0 * rate_hz) as u64
    }

    /// Takes what has come. What is to be told is added to `tell`; whether there was anything.
    pub fn listen(&mut self, round: &Round<'_>, tell: &mut Vec<Event>) -> Result<bool> {
        let mut some = false;
        while let Some(news) = self.station.news()? {
            some = true;
            match news {
                News::Samples(chunk) => {
                    self.keep(&chunk);
                    if let Some(seen) = self.watch.take(&chunk) {
                        self.seen = Some(seen);
                        self.stand(&seen, round.asked, round.step);
                        if let (Some(step), false) = (round.step, self.done) {
                            self.consider(&seen, round, step, tell)?;
                        }
                    }
                }
                News::Restarted(why) => {
                    let next = self.next.unwrap_or(0) as f64 / self.station.unit.rate_hz;
                    if let Some(taking) = &mut self.taking {
                        taking.restarted(next, why.clone());
                    }
                    self.interrupted(format!("the device has restarted: {why}"), tell)?;
                }
                News::Note(words) => tell.push(Event::Note {
                    words: format!("{}: {words}", self.name()),
                }),
                News::Lost(why) => self.interrupted(format!("the line is lost: {why}"), tell)?,
                News::Other(why) => {
                    self.standing.waiting = Some(why.clone());
                    tell.push(Event::Interrupted {
                        unit: self.name(),
                        why,
                    });
                }
                News::Back(_) => self.interrupted("the line is back".into(), tell)?,
            }
        }
        Ok(some)
    }

    fn interrupted(&mut self, why: String, tell: &mut Vec<Event>) -> Result<()> {
        self.throw(&why, tell)?;
        self.watch.interrupted();
        self.standing.waiting = Some(why.clone());
        self.folder.add(Entry::Interrupted { why: why.clone() })?;
        tell.push(Event::Interrupted {
            unit: self.name(),
            why,
        });
        Ok(())
    }

    fn keep(&mut self, chunk: &Chunk) {
        let missing = chunk.tick.saturating_sub(self.next.unwrap_or(chunk.tick));
        self.next = Some(chunk.tick + chunk.values.len() as u64);
        self.power_on_s = chunk.power_on_s;
        self.standing.lost += missing;
        if let Some(taking) = &mut self.taking {
            taking.missing(missing);
        }
        self.standing.samples += chunk.values.len() as u64;
        let rate_hz = self.station.unit.rate_hz;
        let rows = &mut self.pending;
        for (tick, row) in (chunk.tick..).zip(&chunk.values) {
            rows.t_s.push(tick as f64 / rate_hz);
            rows.step.push(-1);
            rows.temp_c.push(chunk.temp_c);
            for c in 0..6 {
                rows.raw[c].push(row[c]);
                rows.reference[c].push(f64::NAN);
            }
        }
        // Nobody turns a unit for minutes: whoever is at lunch leaves a gap.
        if self.dwell.is_none() && rows.len() as f64 > 2.0 * KEPT_S * rate_hz {
            cut(rows, rows.len() - (KEPT_S * rate_hz) as usize);
        }
    }

    fn stand(&mut self, seen: &Seen, asked: &Asked, step: Option<&Step>) {
        let nominal = self
            .nominal
            .unwrap_or_else(|| guessed(seen, asked.gravity_mps2));
        let up = force(seen, &nominal[1]);
        let standing = &mut self.standing;
        standing.motion = Some(seen.motion);
        let wanted_dps = step.map_or(0.0, |s| s.rate_dps);
        standing.motion_limits = motion_limits(wanted_dps);
        standing.rate_limit_dps = rate_limit_dps(wanted_dps);
        standing.trend_limit_c_per_min = asked.warm_c_per_min;
        standing.temp_c = seen.temp_c.is_finite().then_some(seen.temp_c);
        standing.trend_c_per_min = seen.trend;
        standing.tilt_deg = step.map(|s| up.angle(&s.up()).to_degrees());
        let rate = self.watch.rate(seen, &nominal[0]);
        // What was guessed of a gyro has no scale.
        let known = self.nominal.is_some();
        standing.rate_dps = known.then(|| rate.dot(&up.normalize()).to_degrees());
    }

    /// Up by the last second, of length 1.
    fn up(&self, seen: &Seen, asked: &Asked) -> Vector3<f64> {
        let nominal = self
            .nominal
            .unwrap_or_else(|| guessed(seen, asked.gravity_mps2));
        force(seen, &nominal[1]).normalize()
    }

    /// Why no dwell can run now.
    fn waits(&self, seen: &Seen, asked: &Asked, step: &Step, busy: bool) -> Option<String> {
        let rate_hz = self.station.unit.rate_hz;
        let share = LOST_SHARE[usize::from(asked.fixture != Fixture::Table)];
        if busy {
            return Some("the table moves".into());
        }
        if let Some(c) = seen.stuck {
            let column = mimu_recording::RAW_COLUMNS[c];
            return Some(format!("{column} repeats one value: check its wiring"));
        }
        if seen.missing as f64 > share * rate_hz {
            return Some(format!(
                "samples are lost, {} of the last {:.0}: check the cable",
                seen.missing, rate_hz
            ));
        }
        if seen.saturated {
            return Some("a reading is at the end of its range".into());
        }
        let turning = step.rate_dps != 0.0;
        let limits = motion_limits(step.rate_dps);
        for sensor in Sensor::BOTH {
            let motion = seen.motion[sensor as usize];
            if motion > limits[sensor as usize] {
                return Some(match turning {
                    true => {
                        format!("the rate is not steady ({sensor} {motion:.1} times the limit)")
                    }
                    false => format!("it moves ({sensor} {motion:.1} times the limit)"),
                });
            }
        }
        None
    }

    /// Why its rate is not that of the step.
    fn turns_otherwise(&self, seen: &Seen, step: &Step) -> Option<String> {
        let turning = step.rate_dps != 0.0;
        if let Some(nominal) = &self.nominal {
            let rate = self.watch.rate(seen, &nominal[0]);
            let wanted = step.rate();
            let off = (rate - wanted).norm().to_degrees();
            if off > rate_limit_dps(step.rate_dps) {
                let is = rate.dot(&step.up()).to_degrees();
                return Some(match (turning, is * step.rate_dps < 0.0) {
                    (true, true) => format!(
                        "it turns the other way: {is:+.0} deg/s, {:+.0} wanted",
                        step.rate_dps
                    ),
                    (true, false) => {
                        format!("it turns at {is:+.1} deg/s, {:+.1} wanted", step.rate_dps)
                    }
                    (false, _) => format!("it turns at {off:.1} deg/s"),
                });
            }
        }
        None
    }

    fn consider(
        &mut self,
        seen: &Seen,
        round: &Round<'_>,
        step: &Step,
        tell: &mut Vec<Event>,
    ) -> Result<()> {
        let asked = round.asked;
        let rate_hz = self.station.unit.rate_hz;
        let up = self.up(seen, asked);
        let running = self.dwell.map(|d| d.step);
        let wanted = running.unwrap_or(*step);
        let found = match self.waits(seen, asked, &wanted, round.busy) {
            Some(why) => Err(why),
            None => self.pose(&up, round, &wanted, running.is_none()),
        };
        let found = found.and_then(|step| match self.turns_otherwise(seen, &step) {
            Some(why) => Err(why),
            None => Ok(step),
        });
        match (found, self.dwell) {
            (Err(why), _) => {
                self.throw(&why, tell)?;
                if self.standing.waiting.as_ref() != Some(&why) {
                    // The first words say it; what the numbers in them do, the standing shows.
                    let same = self.standing.waiting.as_ref().is_some_and(|w| {
                        w.split_whitespace().next() == why.split_whitespace().next()
                    });
                    if !same {
                        tell.push(Event::Waiting {
                            unit: self.name(),
                            why: why.clone(),
                        });
                    }
                    self.standing.waiting = Some(why);
                }
            }
            (Ok(step), None) => {
                let from = seen.tick.saturating_sub((BEFORE_S * rate_hz) as u64);
                self.dwell = Some(Dwell { step, from });
                self.standing.waiting = None;
                self.standing.left_s = Some(step.dwell_s);
            }
            (Ok(_), Some(dwell)) => {
                let length = (dwell.step.dwell_s * rate_hz).round() as u64;
                let guard = (GUARD_S * rate_hz) as u64;
                let left = (dwell.from + length + guard).saturating_sub(seen.tick);
                self.standing.left_s = Some(left as f64 / rate_hz);
                if left == 0 {
                    self.accept(dwell, dwell.from + length, seen, asked, tell)?;
                }
            }
        }
        Ok(())
    }

    /// The step that this pose is: the one that is wanted or, where a person turns the unit and no dwell runs yet, one of those to come.
    fn pose(
        &self,
        up: &Vector3<f64>,
        round: &Round<'_>,
        step: &Step,
        begins: bool,
    ) -> std::result::Result<Step, String> {
        let asked = round.asked;
        let off = |s: &Step| up.angle(&s.up()).to_degrees();
        let limit = asked.fixture.tolerance_deg();
        let by_hand = asked.fixture != Fixture::Table;
        // By hand a pose is what it is, and only has to be another than those before.
        let as_it_is = |s: &Step| match by_hand {
            true => Step::at_rest(*up, s.dwell_s),
            false => *s,
        };
        let had = self.folder.dwells(self.part);
        let near = |d: &Step| off(d) < SAME_POSE_DEG;
        // The last pose is no turn; one before it may be asked for again.
        let same = by_hand && had.last().is_some_and(|d| near(&d.1));
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
            if asked.fixture == Fixture::Hands {
                return Ok(as_it_is(step));
            }
        }
        let lies = words(up);
        Err(match again {
            true => format!("pose had already ({lies}): turn it on"),
            false => format!(
                "wrong pose: {lies}, {:.0} degrees off what is wanted",
                off(step)
            ),
        })
    }

    /// Throws the dwell that runs away.
    fn throw(&mut self, why: &str, tell: &mut Vec<Event>) -> Result<()> {
        self.standing.left_s = None;
        let Some(dwell) = self.dwell.take() else {
            return Ok(());
        };
        let rate_hz = self.station.unit.rate_hz;
        let lasted = self.next.unwrap_or(dwell.from).saturating_sub(dwell.from);
        if lasted as f64 > (BEFORE_S + BEGUN_S) * rate_hz {
            self.folder.add(Entry::Thrown {
                step: dwell.step,
                why: why.into(),
            })?;
            tell.push(Event::Thrown {
                unit: self.name(),
                why: why.into(),
            });
        }
        Ok(())
    }

    fn accept(
        &mut self,
        dwell: Dwell,
        to: u64,
        seen: &Seen,
        asked: &Asked,
        tell: &mut Vec<Event>,
    ) -> Result<()> {
        let rate_hz = self.station.unit.rate_hz;
        self.check_temperature(seen, asked)?;
        let Some(taking) = &mut self.taking else {
            return Ok(());
        };
        let mut rows = std::mem::take(&mut self.pending);
        let end = rows
            .t_s
            .partition_point(|t| (t * rate_hz).round() < to as f64);
        let mut behind = Batch::default();
        append(&mut behind, &rows);
        cut(&mut behind, end);
        shorten(&mut rows, end);
        let begin = rows
            .t_s
            .partition_point(|t| (t * rate_hz).round() < dwell.from as f64);
        let input = known(&dwell.step, asked);
        for row in begin..end {
            rows.step[row] = self.number;
            for c in 0..6 {
                rows.reference[c][row] = input[c];
            }
        }
        if asked.fixture != Fixture::Table {
            rows.reference = Default::default();
        }
        let from_s = rows.t_s.get(begin).copied().unwrap_or(0.0);
        taking.write(&rows)?;
        self.pending = behind;
        let (rows, bytes) = taking.settled()?;
        let number = self.number;
        self.folder.add(Entry::Dwell {
            part: self.part,
            number,
            step: dwell.step,
            from_s,
            rows,
            bytes,
            temp_c: seen.temp_c.is_finite().then_some(seen.temp_c),
        })?;
        self.number += 1;
        (self.dwell, self.done, self.standing.left_s) = (None, true, None);
        tell.push(Event::Dwell {
            unit: self.name(),
            part: self.part,
            number,
            step: dwell.step,
            words: dwell.step.words(),
        });
        if self.part == Part::Calibration {
            self.refit(asked);
            tell.push(Event::Progress {
                unit: self.name(),
                progress: self.progress.clone(),
            });
        }
        Ok(())
    }

    fn check_temperature(&self, seen: &Seen, asked: &Asked) -> Result<()> {
        let Some([first, _]) = self.folder.temperatures() else {
            return Ok(());
        };
        let moved = seen.temp_c - first;
        if moved.abs() > asked.most_drift_c {
            let problem = format!(
                "the temperature has moved from {first:.1} to {:.1} °C since the first dwell, and a calibration holds at one",
                seen.temp_c
            );
            let remedy = "let the unit come to a steady temperature, and begin anew in another folder; or allow more with --drift";
            return Err(Error::new(self.name(), problem, remedy));
        }
        Ok(())
    }

    /// The calibration from what there is; its matrices tell up from now on.
    pub fn refit(&mut self, asked: &Asked) -> Option<Fit> {
        let taking = self.taking.as_ref()?;
        let fitted = calibrate(taking.manifest(), &taking.samples, 0);
        self.progress = progress(&fitted, &asked.targets);
        let fitted = fitted.ok()?;
        // A calibration that is open by degrees tells up no better than a data sheet.
        let known = self
            .progress
            .sensors
            .iter()
            .all(|s| s.aims.iter().all(|a| a.half_width < KNOWN * a.target));
        if let (true, [Some(gyro), Some(accel)]) = (known, Sensor::BOTH.map(|s| fitted.sensor(s))) {
            self.nominal = Some([gyro, accel].map(|s| s.estimated.triad.inverse));
        }
        Some(fitted)
    }

    /// The dwell of this number does not count any more; what it was.
    pub fn redo(&mut self, number: i32) -> Result<Option<Step>> {
        let had = self.folder.dwells(self.part);
        let Some((_, step)) = had.into_iter().find(|d| d.0 == number) else {
            return Ok(None);
        };
        let part = self.part;
        self.folder.add(Entry::Redo { part, number })?;
        if let Some(taking) = &mut self.taking {
            taking.drop_dwell(number);
        }
        Ok(Some(step))
    }

    /// Number of the last dwell that counts.
    pub fn last_number(&self) -> Option<i32> {
        self.folder.dwells(self.part).last().map(|d| d.0)
    }

    /// Whether it has warmed up: °C/min beside the limit, `None` while it is not known.
    pub fn trend(&self) -> Option<f64> {
        self.seen.and_then(|s| match s.temp_c.is_nan() {
            true => Some(0.0),
            false => s.trend,
        })
    }

    /// Whether samples come and it is known how quiet the unit can be.
    pub fn is_heard(&self) -> bool {
        self.watch.knows_rest()
    }
}

/// Known inputs of a step on a table: rates, deg/s, and specific forces, m/s².
fn known(step: &Step, asked: &Asked) -> [f64; 6] {
    let up = step.up();
    // Of the Earth's rate the table's heading leaves open all but what is along the vertical.
    let earth = asked
        .latitude_deg
        .map(|_| Earth::at(asked.latitude_deg).rate(&up));
    let rate = up * step.rate_dps + earth.unwrap_or_default().map(f64::to_degrees);
    let force = up * asked.gravity_mps2;
    [rate.x, rate.y, rate.z, force.x, force.y, force.z]
}

/// Motion of gyro and accelerometer that is allowed at a rate: a table's own unsteadiness is no movement of the unit on it.
fn motion_limits(rate_dps: f64) -> [f64; 2] {
    [if rate_dps != 0.0 { 5.0 } else { 1.0 }, 1.0]
}

/// Departure from a rate that is allowed, deg/s.
fn rate_limit_dps(rate_dps: f64) -> f64 {
    RATE_SHARE * rate_dps.abs() + RATE_DPS
}

/// Without the first rows.
fn cut(rows: &mut Batch, first: usize) {
    rows.t_s.drain(..first);
    rows.step.drain(..first);
    rows.temp_c.drain(..first);
    for c in 0..6 {
        rows.raw[c].drain(..first);
        rows.reference[c].drain(..first);
    }
}

/// Without the rows from this one on.
fn shorten(rows: &mut Batch, to: usize) {
    rows.t_s.truncate(to);
    rows.step.truncate(to);
    rows.temp_c.truncate(to);
    for c in 0..6 {
        rows.raw[c].truncate(to);
        rows.reference[c].truncate(to);
    }
}
