//! What stands between the emulator's thread and the owner of a board.

use std::sync::mpsc::{Receiver, Sender};

use rigless::emulator::{Driver, Host, Settled, Stop};
use rigless::session::Session;
use rigless::time::VirtualNanos;

use super::part::Machine;
use super::running::{Arrival, Standing};

/// What a stopped board can be asked for.
pub(super) type Errand = Box<dyn FnOnce(&mut Stopped<'_>) + Send>;

/// What the board is told.
pub(super) enum Order {
    /// Run to an instant, ns.
    To(u64),
    /// Do an errand where the board stands.
    Do(Errand),
}

/// The board between two instructions.
pub(super) struct Stopped<'a> {
    pub(super) session: &'a mut Session<Machine>,
    pub(super) host: &'a mut dyn Host,
    pub(super) driver: &'a mut Puppet,
    pub(super) stop: Stop,
}

/// The driver that the emulator calls: it does as it is told.
pub(super) struct Puppet {
    pub(super) orders: Receiver<Order>,
    pub(super) reports: Sender<Standing>,
    pub(super) arrivals: Vec<Arrival>,
}

impl Driver<Machine> for Puppet {
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
            .send(Standing {
                ns: stop.at.0,
                instructions: stop.instruction_count,
            })
            .ok()?;
        loop {
            // An error is the board's owner gone.
            match self.orders.recv().ok()? {
                Order::To(ns) => return Some(VirtualNanos(ns)),
                Order::Do(errand) => errand(&mut Stopped {
                    session,
                    host,
                    driver: self,
                    stop,
                }),
            }
        }
    }
}
