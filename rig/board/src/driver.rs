//! Interface between the emulator's thread and the owner of a board.

use std::sync::mpsc::{Receiver, Sender};

use rigless::emulator::{Driver, Host, Settled, Stop};
use rigless::session::Session;
use rigless::time::VirtualNanos;

use crate::part::Machine;

/// Current state of a board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BoardState {
    /// The virtual clock, ns since the board was first switched on.
    pub ns: u64,
    /// Instructions executed. Waiting for an interrupt executes none.
    pub instructions: u64,
}

/// An arrival at a watched instruction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Arrival {
    /// The instruction.
    pub address: u64,
    /// The virtual clock, ns.
    pub ns: u64,
    /// Instructions executed before it.
    pub instructions: u64,
}

/// A function to run on a stopped board.
pub(crate) type Task = Box<dyn FnOnce(&mut Stopped<'_>) + Send>;

/// Commands to the board.
pub(crate) enum Order {
    /// Run until this time, ns.
    To(u64),
    /// Run a function at the board's current time.
    Do(Task),
}

/// The board between two instructions.
pub(crate) struct Stopped<'a> {
    pub(crate) session: &'a mut Session<Machine>,
    pub(crate) host: &'a mut dyn Host,
    pub(crate) driver: &'a mut CommandedDriver,
    pub(crate) stop: Stop,
}

/// The driver that the emulator calls: it carries out the commands.
pub(crate) struct CommandedDriver {
    pub(crate) orders: Receiver<Order>,
    pub(crate) reports: Sender<BoardState>,
    pub(crate) arrivals: Vec<Arrival>,
}

impl Driver<Machine> for CommandedDriver {
    fn on_settled(&mut self, _: &mut Session<Machine>, _: &mut dyn Host, settled: Settled) {
        if let Settled::Hit(hit) = settled {
            self.arrivals.push(Arrival {
                address: hit.address,
                ns: hit.at.0,
                instructions: hit.instruction_count,
            });
        }
    }

    fn on_stop(
        &mut self,
        session: &mut Session<Machine>,
        stop: Stop,
        host: &mut dyn Host,
    ) -> Option<VirtualNanos> {
        self.reports
            .send(BoardState {
                ns: stop.at.0,
                instructions: stop.instruction_count,
            })
            .ok()?;
        loop {
            // An error means that the board's owner is gone.
            match self.orders.recv().ok()? {
                Order::To(ns) => return Some(VirtualNanos(ns)),
                Order::Do(task) => task(&mut Stopped {
                    session,
                    host,
                    driver: self,
                    stop,
                }),
            }
        }
    }
}
