//! Table and chamber in a separate thread. A table that takes seconds to answer must not delay reading the samples: a port buffers only some tenths
//! of a second.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use mimu::plan::Turn;
use mimu_recording::error::{Error, Result};

use super::needs::Equipped;
use crate::drive::Driver;
use crate::step::Step;

/// Interval of the check whether the table still moves.
const BUSY: Duration = Duration::from_millis(100);
/// Interval of the interlock check: a table that the interlock stopped must not count as turning.
const INTERLOCK_INTERVAL: Duration = Duration::from_millis(500);
/// Interval of reading the chamber's temperature.
const READ: Duration = Duration::from_secs(2);

/// A command to table or chamber.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Order {
    /// Move to a pose, at rest or at a rate.
    Go(Step),
    /// Turn by an angle.
    Turn(Turn),
    /// Stop the table where it is.
    Halt,
    /// Set the temperature of the chamber, °C.
    Set(f64),
}

enum EquipmentEvent {
    /// Number of completed motions.
    Done(usize),
    Chamber(f64),
    Failed(Error),
}

/// Table and chamber, brought to rest when this is dropped.
pub(super) struct Equipment {
    orders: Option<Sender<Order>>,
    news: Receiver<EquipmentEvent>,
    thread: Option<JoinHandle<Vec<Error>>>,
    /// Numbers of ordered and of completed motions.
    motions: [usize; 2],
    chamber_c: Option<f64>,
}

impl Equipment {
    pub fn start(equipped: Equipped) -> Result<Self> {
        let (orders, to_do) = channel();
        let (tell, news) = channel();
        let chamber_c = equipped.chamber_c;
        let mut hands = Hands {
            equipped,
            tell,
            ordered: false,
            motions: 0,
            moves: false,
            interlock_checked: Instant::now(),
            read: None,
        };
        let work = move || {
            if let Err(error) = hands.work(&to_do) {
                // The receiver is gone only if the recording has ended too.
                let _ = hands.tell.send(EquipmentEvent::Failed(error));
            }
            hands.rest()
        };
        let thread = std::thread::Builder::new().name("equipment".into());
        let thread = thread
            .spawn(work)
            .map_err(|e| Error::new("equipment", e, "close other programs"))?;
        Ok(Self {
            orders: Some(orders),
            news,
            thread: Some(thread),
            motions: [0; 2],
            chamber_c,
        })
    }

    pub fn order(&mut self, order: Order) {
        self.motions[0] += usize::from(!matches!(order, Order::Set(_)));
        // A thread that has ended has reported why.
        let _ = self.orders.as_ref().map(|orders| orders.send(order));
    }

    /// Processes the thread's events; an error ends the procedure.
    pub fn take_news(&mut self) -> Option<Error> {
        for news in self.news.try_iter() {
            match news {
                EquipmentEvent::Done(motions) => self.motions[1] = motions,
                EquipmentEvent::Chamber(temp_c) => self.chamber_c = Some(temp_c),
                EquipmentEvent::Failed(error) => return Some(error),
            }
        }
        None
    }

    /// Whether all ordered motions are complete, so that the table is at rest or turns steadily.
    pub fn is_done(&self) -> bool {
        self.motions[0] == self.motions[1]
    }

    /// Temperature in the chamber, °C, if it can be read.
    pub fn chamber_c(&self) -> Option<f64> {
        self.chamber_c
    }

    /// Stops the table and sets the chamber to its rest temperature. Returns what failed.
    pub fn rest(mut self) -> Vec<Error> {
        self.end()
    }

    fn end(&mut self) -> Vec<Error> {
        self.orders = None;
        let ended = self.thread.take().map(JoinHandle::join);
        match ended {
            Some(Err(_)) => vec![Error::new(
                "equipment",
                "the thread of table and chamber failed",
                "stop the table and set the chamber by hand, and report this",
            )],
            Some(Ok(errors)) => errors,
            None => Vec::new(),
        }
    }
}

impl Drop for Equipment {
    fn drop(&mut self) {
        self.end();
    }
}

struct Hands {
    equipped: Equipped,
    tell: Sender<EquipmentEvent>,
    /// Whether any command was sent: equipment that was not touched is left unchanged.
    ordered: bool,
    motions: usize,
    moves: bool,
    interlock_checked: Instant,
    read: Option<Instant>,
}

impl Hands {
    /// Carries out orders until the channel closes.
    fn work(&mut self, to_do: &Receiver<Order>) -> Result<()> {
        loop {
            match to_do.recv_timeout(BUSY) {
                Ok(order) => self.carry_out(&order)?,
                Err(RecvTimeoutError::Timeout) => self.look()?,
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
            }
        }
    }

    fn of(&mut self, which: Option<usize>) -> Option<&mut (dyn Driver + 'static)> {
        Some(self.equipped.drivers[which?].as_mut())
    }

    fn carry_out(&mut self, order: &Order) -> Result<()> {
        let table = self.equipped.table;
        self.ordered = true;
        if let Order::Set(temp_c) = order {
            let chamber = self.equipped.chamber;
            return self.of(chamber).map_or(Ok(()), |c| c.set_chamber(*temp_c));
        }
        self.motions += 1;
        self.moves = true;
        let Some(table) = self.of(table) else {
            return Ok(());
        };
        match order {
            Order::Go(step) => table.go(step),
            Order::Turn(turn) => table.turn(turn),
            Order::Halt | Order::Set(_) => table.stop(),
        }
    }

    fn look(&mut self) -> Result<()> {
        let (table, chamber) = (self.equipped.table, self.equipped.chamber);
        if self.moves && !self.of(table).map_or(Ok(false), |t| t.busy())? {
            self.moves = false;
            let _ = self.tell.send(EquipmentEvent::Done(self.motions));
        }
        if self.interlock_checked.elapsed() >= INTERLOCK_INTERVAL {
            self.interlock_checked = Instant::now();
            for driver in &mut self.equipped.drivers {
                if let Some(why) = driver.interlock()? {
                    let remedy = "close that program, and record the rest as another recording";
                    return Err(Error::device(driver.abilities().place, why, remedy));
                }
            }
        }
        if self.read.is_none_or(|read| read.elapsed() >= READ) {
            self.read = Some(Instant::now());
            if let Some(temp_c) = self.of(chamber).map_or(Ok(None), |c| c.chamber_c())? {
                let _ = self.tell.send(EquipmentEvent::Chamber(temp_c));
            }
        }
        Ok(())
    }

    /// Brings table and chamber to rest separately: a table that does not answer must not leave the chamber hot.
    fn rest(&mut self) -> Vec<Error> {
        let (table, chamber) = (self.equipped.table, self.equipped.chamber);
        let rest_c = self.equipped.rest_c();
        if !self.ordered {
            return Vec::new();
        }
        let stopped = self.of(table).map_or(Ok(()), |t| t.stop());
        let set = match (self.of(chamber), rest_c) {
            (Some(chamber), Some(rest_c)) => chamber.set_chamber(rest_c),
            _ => Ok(()),
        };
        let by_hand = |error: Error, what: &str| error.map(|e| e.remedy = what.to_owned());
        let stopped = stopped.map_err(|e| by_hand(e, "stop the table by hand"));
        let set = set.map_err(|e| by_hand(e, "set the chamber to a safe temperature by hand"));
        [stopped, set].into_iter().filter_map(Result::err).collect()
    }
}

#[cfg(test)]
mod tests;
